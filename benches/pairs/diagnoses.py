"""The pair of a diagnosis: three overhangs, tolerances, some causes, an effect that is there."""

from __future__ import annotations

from collections.abc import Iterator
from unittest import mock

import numpy as np

from receptance import MeasuredFRF
from receptance.diagnosis import Verdict, diagnose
from receptance.identification.task import Task

from . import campaigns
from .pair import Pair

DELAY = 5e-6
"""Seconds by which one channel lags behind the other."""
CAUSES = ("time_delay", "calibration_gain", "sensor_mass", "tool_modulus", "joint_cross_term", "overhang_error")
"""What it may be: so few that this is soon done."""


def diagnosis_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pair, on one thread: whole fits in the core beside fits whose steps are taken in Python."""
    made = campaigns.campaign(lines)
    seen = [_delayed(one) for one in made.observations]

    def told() -> Verdict:
        return diagnose(seen, made.unknowns, tolerances=made.tolerances, causes=CAUSES, most=1, threads=1)

    def step_by_step() -> Verdict:
        # The road of models that the core's fits do not know: residuals and derivatives from the core, all else NumPy.
        with mock.patch.object(Task, "modelled", return_value=None):
            return told()

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
        subject=f"diagnosis of {len(seen)} overhangs, {len(made.tolerances)} tolerances, {len(CAUSES)} causes",
        against="the steps of each fit in Python, derivatives from the core",
        ours=told,
        reference=step_by_step,
        difference=difference,
        tolerance=0.1,
        lines=lines * len(seen),
        most_rounds=3,
        remark=remark,
    )


def _delayed(one: MeasuredFRF) -> MeasuredFRF:
    """Return an observation as it is recorded with a delay, noise and all."""
    return MeasuredFRF(
        assembly=one.assembly,
        frequency_hz=one.frequency_hz,
        receptance=one.receptance * np.exp(-2j * np.pi * one.frequency_hz * DELAY),
        standard_deviation=one.standard_deviation,
        label=one.label,
    )
