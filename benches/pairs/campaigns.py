"""The pair of a whole campaign: three overhangs, four joint parameters, eight tolerances, many starts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from numpy_reference import campaign as reference
from numpy_reference.campaign import DENSITY, DIAMETER, LENGTH, MODULUS, CampaignFit, CampaignResidual, Error
from numpy_reference.cases import segment_row
from receptance import Assembly, Identification, Observation, PointJoint, Unknown, identify
from receptance.fit import Tolerance, profile_likelihoods

from .models import part
from .pair import Pair

SEED, NOISE, STARTS, THREADS = 0, 0.01, 16, 2
OVERHANGS = (0.05, 0.06, 0.08)
CARBIDE, STEEL = (580e9, 14_400.0, 0.22, 0.002), (205e9, 7_800.0, 0.3, 0.004)
TRUTH = {"k_y": 6e8, "k_theta": 1e5, "c_y": 400.0, "c_theta": 1.0}
BOUNDS = {"k_y": (1e6, 1e11), "k_theta": (1e3, 1e8), "c_y": (1.0, 1e6), "c_theta": (1e-3, 1e3)}
# Name, whose, quantity, standard deviation, relative.
SHARED = (
    ("blank", False, DIAMETER, 5e-6, False),
    ("carbide modulus", False, MODULUS, 0.015, True),
    ("carbide density", False, DENSITY, 0.005, True),
    ("holder turned", True, DIAMETER, 1e-4, False),
    ("steel modulus", True, MODULUS, 0.01, True),
)
CLAMPED = 1e-4
FIELDS = {LENGTH: "length", DIAMETER: "outer_diameter", MODULUS: "youngs_modulus", DENSITY: "density"}


class Campaign(NamedTuple):
    """Common starting point of both sides."""

    observations: list[Observation]
    unknowns: list[Unknown]
    tolerances: list[Tolerance]
    residual: CampaignResidual


def holder_table() -> np.ndarray:
    """Return three steel sections."""
    rows = ((0.03, 0.04), (0.05, 0.05), (0.05, 0.063))
    return np.array([segment_row(i, length, d, 0.0, STEEL) for i, (length, d) in enumerate(rows)])


def make_assembly(overhang: float) -> Assembly:
    """Return the assembly with one overhang."""
    tool = np.array([segment_row(0, overhang, 0.012, 0.0, CARBIDE)])
    return Assembly([part(tool, "tool"), PointJoint(**TRUTH, name="joint"), part(holder_table(), "holder")])


def campaign(lines: int) -> Campaign:
    """Return a noisy campaign with an error drawn for each overhang."""
    rng = np.random.default_rng(SEED)
    frequency_hz = np.linspace(100.0, 8000.0, lines)
    observations = []
    for overhang in OVERHANGS:
        true = make_assembly(overhang + CLAMPED * rng.standard_normal())
        noise = NOISE * (rng.standard_normal((lines, 2)) @ np.array([1.0, 1j]))
        observations.append(
            Observation(
                assembly=make_assembly(overhang),
                frequency_hz=frequency_hz,
                receptance=true.receptance(frequency_hz) * np.exp(noise),
                standard_deviation=NOISE,
                label=f"{1e3 * overhang:g} mm",
            )
        )
    tolerances = [
        Tolerance(
            name=name,
            moves={f"{'holder.segment[*]' if holder else 'tool.segment[0]'}.{FIELDS[quantity]}": deviation},
            relative=relative,
        )
        for name, holder, quantity, deviation, relative in SHARED
    ]
    tolerances += [
        Tolerance(name=f"clamped {o.label}", moves={"tool.segment[0].length": CLAMPED}, configurations=o.label)
        for o in observations
    ]
    errors = [Error(*rest) for _, *rest in SHARED]
    errors += [Error(False, LENGTH, CLAMPED, False, index) for index in range(len(OVERHANGS))]
    residual = CampaignResidual(
        2 * np.pi * frequency_hz,
        np.array([one.receptance for one in observations]),
        NOISE,
        np.array([segment_row(0, overhang, 0.012, 0.0, CARBIDE) for overhang in OVERHANGS]),
        holder_table(),
        errors,
    )
    unknowns = [Unknown(address=f"joint.{field}", lower=low, upper=high) for field, (low, high) in BOUNDS.items()]
    return Campaign(observations, unknowns, tolerances, residual)


def campaign_pairs(lines: int, starts: int = STARTS) -> Iterator[Pair]:
    """Yield the pair, on one thread and on two."""
    made = campaign(lines)

    def found(threads: int) -> Identification:
        return identify(
            made.observations, made.unknowns, tolerances=made.tolerances, starts=starts, tolerance=1e-8, threads=threads
        )

    def other() -> CampaignFit:
        variables = found_once().task.variables
        made.residual.at = None
        low, high = variables.limits
        return reference.fit_campaign(made.residual, variables.draw(starts, 0), (low, high), 1e-8)

    kept: list[Identification] = []

    def found_once() -> Identification:
        if not kept:
            kept.append(found(1))
        return kept[0]

    def difference(ours: Identification, theirs: CampaignFit) -> float:
        """Distance of the two best optima in standard errors; infinite where one has not converged."""
        if not (ours.converged and theirs.best.success):
            return np.inf
        own = ours.task.variables.from_values(np.array(list(ours.values.values())))
        return float(np.max(np.abs(own - theirs.best.x) / np.sqrt(np.diag(ours.covariance))))

    def remark(ours: Identification, theirs: CampaignFit) -> str:
        begun = time.perf_counter()
        profiles = profile_likelihoods(ours)
        seconds = time.perf_counter() - begun
        evaluations = sum(profile.evaluations for profile in profiles.values())
        return (
            f"evaluations: ours {ours.evaluations}, on fewer lines where there are many, reference "
            f"{theirs.evaluations} residuals, {theirs.jacobians} Jacobians; {len(profiles)} profiles of ours "
            f"{seconds:.2f} s, {evaluations} evaluations"
        )

    for threads in (1, THREADS):
        yield Pair(
            subject=f"campaign of 3 overhangs, 4 joint and 8 tolerance parameters, {starts} starts",
            against=f"SciPy on NumPy, analytic Jacobian; ours on {threads} thread{'s' if threads > 1 else ''}",
            ours=lambda threads=threads: found(threads),
            reference=other,
            difference=difference,
            tolerance=1e-2,
            lines=lines * len(OVERHANGS),
            threads=threads,
            most_rounds=3,
            remark=remark,
        )
