"""Do 95 % intervals hold the truth where the model is wrong? `python tests/validation/foreign_coverage.py --cases 60`.

Every case is a random tool in a holder with a cone, which is described as one cylinder. The tip is measured at two
overhangs; natural frequencies, the magnitude of the FRF and the stable depth of a slot are predicted at a third one.
Counted are the intervals that hold the truth, and the depths "stable with 95 %" that lie above the true limit.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import dataclass, field, replace

import numpy as np

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.fit import Tolerance, identify
from receptance.stability import Milling, stability_lobes

LEVEL = 0.95
NOISE = 0.01
LINES = np.arange(200.0, 6000.0, 8.0)
SPEEDS = np.linspace(4e3, 24e3, 101)
SLOT = Milling(teeth=4, k_t=8e8, k_n=2.5e8)
DRAWS = 60
PIECES = 12
"""Cylinders of the true cone."""
JOINT = {"k_y": (1e6, 1e11), "k_theta": (1e2, 1e8), "c_y": (1e-1, 1e6), "c_theta": (1e-4, 1e3)}


@dataclass(frozen=True)
class Machine:
    """A tool in a holder whose middle is a cone."""

    shank: float
    overhangs: tuple[float, ...]
    nose: float
    body: float
    joint: PointJoint
    cone: float
    """Length of the cone."""

    def assembly(self, overhang: float, pieces: int, joint: PointJoint | None = None) -> Assembly:
        """Return the tool with an overhang in the holder, with the cone as so many cylinders."""
        steel, carbide = (replace(one, loss_factor=0.003) for one in (STEEL, CARBIDE))
        shares = (np.arange(pieces) + 0.5) / pieces
        diameters = self.nose + (self.body - self.nose) * shares
        cone = [Segment(length=self.cone / pieces, outer_diameter=d, material=steel) for d in diameters]
        tool = Part([Segment(length=overhang, outer_diameter=self.shank, material=carbide)], name="tool")
        holder = Part(
            [
                Segment(length=0.02, outer_diameter=self.nose, material=steel),
                *cone,
                Segment(length=0.06, outer_diameter=self.body, material=steel),
            ],
            name="holder",
        )
        return Assembly([tool, joint or self.joint, holder])


def draw_machine(rng: np.random.Generator) -> Machine:
    """Return a random machine."""
    shank = rng.uniform(0.010, 0.020)
    joint = PointJoint(
        k_y=10.0 ** rng.uniform(8.0, 9.0),
        k_theta=3e4 * (shank / 0.012) ** 3 * 10.0 ** rng.uniform(-0.3, 0.3),
        c_y=rng.uniform(100.0, 800.0),
        c_theta=rng.uniform(0.05, 1.0),
        name="joint",
    )
    overhangs = tuple(shank * np.array([4.0, 6.0, 5.0]) * rng.uniform(0.9, 1.1, 3))
    nose = shank + rng.uniform(0.008, 0.014)
    return Machine(shank, overhangs, nose, nose + rng.uniform(0.006, 0.02), joint, rng.uniform(0.03, 0.06))


@dataclass
class Count:
    """Numbers of intervals that hold the truth, and of those that were stated."""

    held: dict[str, list[bool]] = field(default_factory=dict)
    losses: list[float] = field(default_factory=list)
    adequate: int = 0
    refused: int = 0

    def add(self, name: str, held: bool) -> None:
        """Count an interval."""
        self.held.setdefault(name, []).append(bool(held))

    def report(self) -> str:
        """Return all shares as text."""
        lines = [f"{name:12s} {sum(x)} of {len(x)} = {100.0 * np.mean(x):.1f} %" for name, x in self.held.items()]
        if self.losses:
            lines.append(f"loss of depth against the true limit: {100.0 * np.median(self.losses):.0f} % in the median")
        return "\n".join([*lines, f"adequate {self.adequate}, refused {self.refused}"])


def measure(machine: Machine, rng: np.random.Generator) -> list[Observation]:
    """Return the tip FRFs of the first two overhangs, as described with one cylinder."""
    found = []
    for overhang in machine.overhangs[:2]:
        noise = NOISE * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        true = machine.assembly(overhang, PIECES).receptance(LINES)
        name = f"{1e3 * overhang:.1f} mm"
        joint = PointJoint(k_y=1e8, k_theta=1e5, c_y=200.0, c_theta=0.2, name="joint")
        found.append(
            Observation(
                assembly=machine.assembly(overhang, 1, joint),
                frequency_hz=LINES,
                receptance=true * np.exp(noise),
                standard_deviation=NOISE,
                label=name,
                configuration=name,
            )
        )
    return found


def tolerances(observed: list[Observation]) -> list[Tolerance]:
    """Return ordinary errors of dimensions and materials."""
    common = {
        "carbide": {"tool.segment[*].youngs_modulus": 0.01},
        "shank": {"tool.segment[*].outer_diameter": 0.0005},
        "holder": {"holder.segment[*].outer_diameter": 0.002},
        "steel": {"holder.segment[*].youngs_modulus": 0.01},
    }
    own = [
        Tolerance(name=f"overhang {o.label}", moves={"tool.segment[0].length": 1e-4}, configurations=o.configuration)
        for o in observed
    ]
    return [*(Tolerance(name=n, moves=moves, relative=True) for n, moves in common.items()), *own]


def depths(receptance: np.ndarray, draws: np.ndarray | None = None) -> tuple[float, float | None]:
    """Return the depth of a slot that is stable at every speed, and that which is so with 95 %."""
    both = np.eye(2)
    several = None if draws is None else draws[:, :, None, None] * both
    lobes = stability_lobes(SLOT, LINES, receptance[:, None, None] * both, speeds_rpm=SPEEDS, draws=several)
    return float(lobes.depth.min()), None if draws is None else float(lobes.stable_depth(LEVEL).min())


def count_case(count: Count, rng: np.random.Generator) -> None:
    """Count the intervals of one random machine."""
    machine = draw_machine(rng)
    observed = measure(machine, rng)
    unknowns = [Unknown(address=f"joint.{n}", lower=low, upper=high) for n, (low, high) in JOINT.items()]
    fit = identify(observed, unknowns, tolerances=tolerances(observed), starts=1, strategy="staged")
    count.adequate += not fit.rejection
    if getattr(fit.rejection, "unusable", ()):
        count.refused += 1
        return
    for name in ("k_y", "k_theta"):
        low, high = fit.interval(f"joint.{name}")
        count.add(name, low <= getattr(machine.joint, name) <= high)
    overhang = machine.overhangs[2]
    true = machine.assembly(overhang, PIECES)
    predicted = fit.at(machine.assembly(overhang, 1))
    frequencies = predicted.natural_frequencies(LINES[-1]).modes
    for mode, frequency in zip(frequencies, true.natural_frequencies(1.2 * LINES[-1]), strict=False):
        low, high = mode.interval_hz(LEVEL) or (0.0, 0.0)
        count.add("frequency", low <= frequency <= high)
    exact = true.receptance(LINES)
    try:
        frf = predicted.receptance(LINES, draws=DRAWS, seed=1)
        limit, _ = depths(exact)
        _, certain = depths(frf.receptance, frf.drawn)
    except (ReceptanceError, ValueError) as error:
        print("left out:", error)
        return
    low, high = frf.band(LEVEL)
    count.add("band", np.mean((low <= np.abs(exact)) & (np.abs(exact) <= high)) > 0.9)
    if certain is not None and np.isfinite(limit):
        count.add("depth safe", certain <= limit)
        count.losses.append(1.0 - certain / limit)


def main() -> None:
    """Count cases and print the result."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=20261127)
    chosen = parser.parse_args()
    warnings.simplefilter("ignore", ReceptanceWarning)
    count = Count()
    for case in range(chosen.cases):
        count_case(count, np.random.default_rng([chosen.seed, case]))
    print(f"seed {chosen.seed}, {chosen.cases} cases\n{count.report()}")


if __name__ == "__main__":
    main()
