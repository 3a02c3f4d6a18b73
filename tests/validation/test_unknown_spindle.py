"""A machine with an unknown spindle, hits at five points: what joint and modes, fitted to three, predict at the others.

`python benches/machine.py` prints the same for many machines. The real one is read where its files are present.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from five_points import MEASURED, measured, simulated
from receptance.coupling.unknown_modes import bounds_of_modes, start_modes

CAUSES = (
    "sensor_mass",
    "tool_modulus",
    "tool_material",
    "tool_density",
    "calibration_gain",
    "hammer_offset",
    "overhang_error",
    "spindle_mode",
)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [100])
def test_held_out_points_are_predicted(tmp_path: Path, seed: int) -> None:
    machine = simulated(seed)
    loaded = machine.write(tmp_path, 9)
    fit = loaded.identify()
    assert fit.rms < 1.5, seed
    between = machine.interpolated()
    for frf in loaded.predict(fit).frfs:
        assert frf.rms_decibel is not None
        assert frf.rms_decibel < 0.5 * between[frf.name], (seed, frf.name)
    assert machine.joint is not None
    assert fit.values["joint.k_theta"] == pytest.approx(machine.joint["k_theta"], rel=0.2), seed
    # The data determine k_y less, and the interval says so.
    low, high = fit.interval("joint.k_y", 0.999)
    assert 0.7 * low < machine.joint["k_y"] < high / 0.7, seed


@pytest.mark.slow
def test_a_diagnosis_with_unknown_modes_is_adequate_and_says_what_is_hidden(tmp_path: Path) -> None:
    machine = simulated(1)
    verdict = machine.write(tmp_path, 9).diagnose()
    assert verdict.verdict == "adequate"
    assert not verdict.causes
    text = "all modes of spindle are unknowns of the model, and there is one configuration"
    assert verdict.undecidable["spindle_mode"] == text
    assert any("tool_modulus" in one.values["causes"] for one in verdict.reasons if one.code == "imitated_by_modes")
    joint = machine.joint
    assert joint is not None
    low, high = verdict.base.interval("joint.k_theta", 0.999)
    assert low < joint["k_theta"] < high


@pytest.mark.slow
@pytest.mark.parametrize("effect", [{"tool_modulus": 1.12}])
def test_an_effect_that_modes_imitate_gets_no_wrong_name(tmp_path: Path, effect: dict[str, float]) -> None:
    verdict = simulated(1, **effect).write(tmp_path, 9).diagnose(CAUSES)
    right = {"sensor": {"sensor_mass"}, "tool_modulus": {"tool_modulus", "tool_material"}}
    if verdict.verdict == "named":
        assert {one.id for one in verdict.causes} <= right[next(iter(effect))]


def test_a_real_machine_is_predicted_better_than_by_interpolation(tmp_path: Path) -> None:
    machine = measured()
    if machine is None:
        pytest.skip(f"the files of the real machine are not in {MEASURED}")
    loaded = machine.write(tmp_path, 7, tolerances=False)
    errors = [frf.rms_decibel for frf in loaded.predict(loaded.identify()).frfs]
    assert np.hypot(*errors) < 0.7 * np.hypot(*machine.interpolated().values())


@pytest.mark.slow
def test_modes_are_added_to_those_with_a_peak(tmp_path: Path) -> None:
    loaded = simulated(103).write(tmp_path, 5)
    observed = list(loaded.to_identify.values())
    bounds = bounds_of_modes("spindle", [{}] * 5, {}, observed)
    own = [one for one in loaded.unknowns if not one.address.startswith("spindle.")]
    begun, errors, _ = start_modes(observed, [*own, *bounds], "spindle")
    assert not errors
    # The imaginary shape of a mode above the lines is no unknown.
    left_out = {one.name for one in [*own, *bounds]} - {one.name for one in begun}
    assert all(name.endswith("_imaginary") for name in left_out)
    assert all(one.lower <= one.start <= one.upper for one in begun)
    frequencies = [one.start for one in begun if one.address.endswith("frequency_hz")]
    assert frequencies == sorted(frequencies)
    assert all(one.start > 0.0 for one in begun if one.address.endswith("].y"))
