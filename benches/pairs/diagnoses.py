"""The pair of a diagnosis: three overhangs, tolerances, some causes, an effect that is there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
from scipy.optimize import least_squares

from receptance import Observation
from receptance.diagnosis import Verdict, diagnose
from receptance.fit.problem import End, Problem

from . import campaigns
from .pair import Pair

DELAY = 5e-6
"""Seconds by which one channel lags behind the other."""
CAUSES = ("time_delay", "calibration_gain", "sensor_mass", "tool_modulus", "joint_cross_term", "overhang_error")
"""The causes that are tried, few so that the pair is fast."""


def diagnosis_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pair, on one thread: whole fits in the core beside fits by SciPy."""
    made = campaigns.campaign(lines)
    data = [_delayed(one) for one in made.observations]

    def diagnosed() -> Verdict:
        return diagnose(data, made.unknowns, tolerances=made.tolerances, causes=CAUSES, max_causes=1, threads=1)

    def step_by_step() -> Verdict:
        with mock.patch.object(Problem, "fit", _fit_by_scipy):
            return diagnosed()

    def difference(ours: Verdict, theirs: Verdict) -> float:
        """Distance of the evidence of the first candidate; infinite where the answers differ."""
        names = [(v.verdict, [one.id for one in v.causes]) for v in (ours, theirs)]
        same = names[0] == names[1] == ("named", ["time_delay"])
        return abs(ours.candidates[0].evidence - theirs.candidates[0].evidence) if same else np.inf

    def remark(ours: Verdict, theirs: Verdict) -> str:
        mine, other = ours.selection, theirs.selection
        return (
            f"evaluations of the whole model: {mine.evaluations}, {mine.evaluations_per_second:.0f} a second; the "
            f"reference {other.evaluations}, {other.evaluations_per_second:.0f} a second"
        )

    yield Pair(
        subject=f"diagnosis of {len(data)} overhangs, {len(made.tolerances)} tolerances, {len(CAUSES)} causes",
        against="the fits by SciPy, derivatives from the core",
        ours=diagnosed,
        reference=step_by_step,
        difference=difference,
        tolerance=0.1,
        lines=lines * len(data),
        most_rounds=3,
        remark=remark,
    )


def _fit_by_scipy(
    problem: Problem,
    starts: np.ndarray,
    most: int | np.ndarray = 100,
    *,
    free: np.ndarray | None = None,
    tolerance: float = 1e-10,
    least: float = 0.0,
    of_all: bool = False,
) -> list[End]:
    """Return the ends of fits as `Problem.fit` does, with residuals and derivatives from the core and SciPy's steps."""
    limits = problem.variables.limits
    moving = np.ones(starts.shape[1], dtype=bool) if free is None else free
    ends = []
    for start, number in zip(np.asarray(starts), np.broadcast_to(most, len(starts)), strict=True):

        def whole(z: np.ndarray, start: np.ndarray = start) -> np.ndarray:
            x = start.copy()
            x[moving] = z
            return x

        first = 0.5 * float(np.square(problem.residual(start)).sum())
        settings: dict[str, Any] = {"ftol": max(tolerance, 1e-8), "xtol": 1e-8, "gtol": 1e-8, "max_nfev": int(number)}
        found = least_squares(
            lambda z: problem.residual(whole(z)),
            np.clip(start[moving], *limits[:, moving]),
            jac=lambda z: problem.jacobian(whole(z))[:, moving],
            bounds=tuple(limits[:, moving]),
            x_scale="jac",
            **settings,
        )
        x = whole(found.x)
        jacobian = problem.jacobian(x)[:, np.ones_like(moving) if of_all else moving]
        rows = np.column_stack([jacobian, problem.residual(x)])
        ends.append(End(x, float(found.cost), first, int(found.nfev), int(found.status), rows.T @ rows))
    return ends


def _delayed(one: Observation) -> Observation:
    """Return an observation as it is recorded with a delay, noise and all."""
    return Observation(
        assembly=one.assembly,
        frequency_hz=one.frequency_hz,
        receptance=one.receptance * np.exp(-2j * np.pi * one.frequency_hz * DELAY),
        standard_deviation=one.standard_deviation,
        label=one.label,
    )
