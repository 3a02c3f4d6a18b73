"""Random measuring campaigns with random joints, tolerances and noise, for statistics of fits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.fit import Profile, Tolerance
from receptance.fit.parameters import Parameters

LINES = 1000
PARAMETERS = ("joint.k_y", "joint.k_theta", "joint.k_ytheta")
BOUNDS = {
    "joint.k_y": (1e5, 1e12),
    "joint.k_theta": (1e2, 1e8),
    "joint.k_ytheta": (-1e8, 1e8),
    "joint.c_y": (1e-1, 1e6),
    "joint.c_theta": (1e-4, 1e3),
}


@dataclass(frozen=True)
class SimulatedCampaign:
    """Observations, prior information, and the truth."""

    observations: list[Observation]
    tolerances: list[Tolerance]
    truth: dict[str, float]
    errors: dict[str, float]
    noise: float

    def unknowns(self, starts: dict[str, float] | None = None) -> list[Unknown]:
        """Return the joint's unknowns, with the given starts, by default in the middle of the bounds."""
        given = starts or {}
        return [Unknown(address=a, lower=b[0], upper=b[1], start=given.get(a)) for a, b in BOUNDS.items()]

    def decades_off(self, rng: np.random.Generator, decades: float = 3.0) -> dict[str, float]:
        """Return starts that are so far off, to either side; no coupling."""
        starts = {}
        for address, (lower, upper) in BOUNDS.items():
            if lower < 0.0:
                starts[address] = 0.0
            else:
                start = self.truth[address] * 10.0 ** (decades * rng.choice([-1.0, 1.0]))
                starts[address] = float(np.clip(start, lower, upper))
        return starts


def simulate_campaign(rng: np.random.Generator, overhangs: int | None = None) -> SimulatedCampaign:
    """Return a campaign of one to three overhangs of one tool in one holder, all errors drawn from their priors."""
    diameter = rng.uniform(0.008, 0.020)
    count = int(rng.integers(1, 4)) if overhangs is None else overhangs
    lengths = np.sort(rng.uniform(3.0, 6.0, count)) * diameter
    sections = [
        Segment(length=rng.uniform(0.03, 0.06), outer_diameter=d, material=replace(STEEL, loss_factor=0.002))
        for d in rng.uniform(0.034, 0.055, 3)
    ]
    k_y = 10.0 ** rng.uniform(7.3, 9.0)
    k_theta = 10.0 ** rng.uniform(4.0, 5.3) * (diameter / 0.012) ** 2
    values = {
        "k_y": k_y,
        "k_theta": k_theta,
        "k_ytheta": rng.uniform(-0.6, 0.6) * np.sqrt(k_y * k_theta),
        # A loss of half a per cent to five at 2 kHz.
        "c_y": k_y * 10.0 ** rng.uniform(-2.3, -1.3) / (4000.0 * np.pi),
        "c_theta": k_theta * 10.0 ** rng.uniform(-2.3, -1.3) / (4000.0 * np.pi),
    }

    def assembled(length: float, **joint: float) -> Assembly:
        blank = Segment(length=length, outer_diameter=diameter, material=replace(CARBIDE, loss_factor=0.001))
        return Assembly([Part([blank], name="tool"), PointJoint(**joint, name="joint"), Part(sections, name="holder")])

    tolerances = [
        Tolerance(name="blank", moves={"tool.segment[0].outer_diameter": 5e-6}),
        Tolerance(name="carbide E", moves={"tool.segment[0].youngs_modulus": 0.015}, relative=True),
        Tolerance(name="carbide density", moves={"tool.segment[0].density": 0.005}, relative=True),
        Tolerance(name="holder turned", moves={"holder.segment[*].outer_diameter": 1e-4}),
        Tolerance(name="holder length", moves={"holder.segment[1].length": 1e-4}),
        Tolerance(name="steel E", moves={"holder.segment[*].youngs_modulus": 0.01}, relative=True),
        *(
            Tolerance(name=f"clamping {i}", moves={"tool.segment[0].length": 1e-4}, configurations=f"{i}")
            for i in range(count)
        ),
    ]
    noise = 10.0 ** rng.uniform(-2.5, -1.5)
    upper = rng.uniform(5000.0, 9000.0)
    lines = np.linspace(150.0, upper, LINES)
    start = dict.fromkeys(("k_y", "k_theta"), 1.0)
    nominal = [
        Observation(
            assembly=assembled(length, **start),
            frequency_hz=lines,
            receptance=np.ones(LINES),
            standard_deviation=noise,
            configuration=f"{i}",
        )
        for i, length in enumerate(lengths)
    ]
    truth = {f"joint.{name}": float(value) for name, value in values.items()}
    unknowns = [Unknown(address=a, lower=b[0], upper=b[1]) for a, b in BOUNDS.items()]
    parameters = Parameters(unknowns, tolerances, [o.site(i) for i, o in enumerate(nominal)])
    errors = {name: float(rng.standard_normal()) for name in parameters.errors}
    vector = np.array([*(truth[a] for a in BOUNDS), *errors.values()])
    observations = []
    for i, one in enumerate(nominal):
        true = parameters.at(one.site(i)).apply(one.assembly, vector)
        scatter = noise * (rng.standard_normal(LINES) + 1j * rng.standard_normal(LINES))
        observations.append(
            Observation(
                assembly=one.assembly,
                frequency_hz=lines,
                receptance=true.receptance(lines) * np.exp(scatter),
                standard_deviation=noise,
                configuration=f"{i}",
            )
        )
    return SimulatedCampaign(observations, tolerances, truth, errors, noise)


def confidence(profile: Profile, value: float) -> float:
    """Return the confidence that a parameter lies below a value in SI units, from the signed root of the rise.

    The root is interpolated between the points of the profile and extrapolated linearly beyond them.
    """
    root = np.sqrt(profile.rise) * np.sign(np.arange(profile.rise.size) - int(np.argmin(profile.rise)))
    scale = np.log10 if np.all(profile.values > 0.0) else np.asarray
    if not profile.values[0] <= value <= profile.values[-1]:
        # The root is nearly linear.
        ends = slice(0, 2) if value < profile.values[0] else slice(-2, None)
        if profile.values.size < 2 or (value <= 0.0 and scale is np.log10):
            return 0.0 if value < profile.values[0] else 1.0
        x, z = scale(profile.values[ends]), root[ends]
        return float(ndtr(z[0] + (scale(value) - x[0]) * (z[1] - z[0]) / (x[1] - x[0])))
    return float(ndtr(np.interp(scale(value), scale(profile.values), root)))
