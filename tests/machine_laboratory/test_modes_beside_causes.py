"""Diagnoses of machines whose records a large effect has changed: modes chosen from them alone hide the effect."""

from __future__ import annotations

import pytest

from machine_laboratory.blind import machine_of
from machine_laboratory.generator import write
from receptance import campaign


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "index", "effect", "others"),
    [
        (3701, 0, "sensor_mass", ("calibration_gain", "tool_modulus")),
        # It divides a segment that has tolerances.
        (281128, 3, "fluted_part", ("tool_density",)),
        # With one further mode the density of steel is strained.
        (281205, 49, "joint_overhang_law", ("tool_density",)),
    ],
)
@pytest.mark.filterwarnings("ignore:.*clear peaks")
def test_modes_are_chosen_beside_the_cause_of_a_large_misfit(tmp_path, seed, index, effect, others):
    machine = machine_of(seed, index, [effect])
    loaded = campaign.load(write(machine, tmp_path, modes="auto"), threads=1)
    # Without the alternatives and the discrepancy: what matters here is the fit of the cause.
    verdict = loaded.diagnose(causes=[effect, *others], fast=True)
    best = verdict.selection.best
    assert best.ids == {effect}
    # With the modes that were chosen without the cause the misfit is 1.03 to more than 20,000.
    assert best.fit.misfit < 1.01
    assert best.passed
    assert verdict.selection.base.misfit > 2.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*clear peaks")
def test_a_spindle_that_differs_between_overhangs_explains_the_records(tmp_path):
    machine = machine_of(281130, 9, ["spindle_mode"])
    loaded = campaign.load(write(machine, tmp_path, modes="auto"), threads=1)
    verdict = loaded.diagnose(causes=["spindle_mode", "joint_overhang_law", "tool_density"], fast=True)
    best = verdict.selection.best
    assert best.ids == {"spindle_mode"}
    assert best.passed
    assert verdict.selection.base.misfit > 3.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*clear peaks")
@pytest.mark.parametrize(("seed", "index"), [(281130, 4), (281204, 2)])
def test_modes_explain_a_machine_without_an_effect(tmp_path, seed, index):
    """With one limit of their frequencies alone, the near or the far one, the steel's density is strained."""
    machine = machine_of(seed, index, ())
    loaded = campaign.load(write(machine, tmp_path, modes="auto"), threads=1)
    verdict = loaded.diagnose(causes=["holder_inertia"], fast=True)
    assert verdict.verdict == "adequate", verdict.adequacy
