"""Clamped aluminium rods: first modes read from figures of github.com/leekunhwee/Dynamics, RCSA/Example, +-5 Hz."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from receptance.studies.clamped_rods import ClampedRods, as_dict, findings, load_rods, run


@pytest.fixture(scope="module")
def study() -> ClampedRods:
    return run()


@pytest.fixture(scope="module")
def form(study: ClampedRods) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads(json.dumps(as_dict(study), allow_nan=False))
    return loaded


def test_rigid_clamp_is_a_cantilever(study: ClampedRods) -> None:
    """Euler-Bernoulli, beta L = 1.8751 (lambda^4 EI / (rho A L^4)); shear takes off a percent of a slender rod."""
    rods, material, _ = load_rods()
    for rod in rods:
        if len(rod.segments_mm) == 1:
            ((length, diameter),) = rod.segments_mm
            wave_speed = math.sqrt(material.youngs_modulus / material.density)
            radius = 1e-3 * diameter / 4.0
            euler = 1.8751**2 * radius * wave_speed / (2.0 * math.pi * (1e-3 * length) ** 2)
            assert 0.98 * euler < study.rigid_hz[rod.name] < euler
    # Rigid-clamp Timoshenko values that came with the readings.
    assert study.rigid_hz == pytest.approx({"b": 312.6, "c": 573.7, "d": 414.2}, abs=0.1)


def test_clamp_gives_its_rod_back(study: ClampedRods) -> None:
    rods = {rod.name: rod for rod in study.rods}
    assert len(study.clamps) == 6
    for clamp in study.clamps:
        rod = rods[clamp.rod]
        assert clamp.value is not None
        for value, reading in zip(
            (clamp.interval[0], clamp.value, clamp.interval[1]),
            rod.measured_hz + np.array([-5.0, 0.0, 5.0]),
            strict=True,
        ):
            assert value is not None
            first = rod.assembly(study.material).replace({clamp.address: value}).natural_frequencies(1e3)[0]
            assert first == pytest.approx(reading, abs=1e-3)


def test_predictions_carry_the_reading_error(study: ClampedRods) -> None:
    assert len(study.predictions) == 12
    for prediction in study.predictions:
        low, high = prediction.interval_hz
        assert low < prediction.predicted_hz < high
        assert prediction.identified_on != prediction.rod
        meets = low <= prediction.measured_hz + 5.0 and high >= prediction.measured_hz - 5.0
        assert prediction.agrees is meets


def test_wider_reading_error_leaves_the_stiff_side_open() -> None:
    """Rod d reads 16.2 Hz below its rigid clamp: +-20 Hz cannot tell its clamp from a rigid one."""
    study = run(reading_error_hz=20.0)
    found = {(clamp.rod, clamp.assumption): clamp for clamp in study.clamps}
    assert found["d", "rotation"].interval[1] is None
    assert found["d", "rotation"].interval[0] is not None
    prediction = next(p for p in study.predictions if (p.assumption, p.identified_on, p.rod) == ("rotation", "d", "b"))
    assert prediction.interval_hz[1] == pytest.approx(study.rigid_hz["b"], abs=0.01)
    assert any(clamp.explains for clamp in study.common)
    json.dumps(as_dict(study), allow_nan=False)


def test_common_clamp(study: ClampedRods) -> None:
    """What is said of one clamp for all rods is what a search over its stiffness finds."""
    rods = study.rods
    for clamp in study.common:
        assert clamp.least_worst_hz <= max(abs(error) for error in clamp.error_hz.values()) + 1e-9
        assert clamp.explains is (clamp.least_worst_hz <= study.reading_error_hz)
        if len(clamp.values) == 1:
            ((address, _),) = clamp.values.items()
            grid = np.geomspace(1e3, 1e6, 400) if address == "clamp.k_theta" else np.geomspace(1e5, 1e8, 400)
            assemblies = [rod.assembly(study.material) for rod in rods]
            worst = [
                max(
                    abs(a.replace({address: float(k)}).natural_frequencies(1e3)[0] - rod.measured_hz)
                    for a, rod in zip(assemblies, rods, strict=True)
                )
                for k in grid
            ]
            assert clamp.least_worst_hz == pytest.approx(min(worst), abs=0.6)


def test_json(form: dict[str, Any], study: ClampedRods) -> None:
    assert {"settings", "seed", "versions", "rods", "identified", "predictions", "common_clamp"} <= form.keys()
    assert form["settings"] == {"reading_error_hz": 5.0}
    assert json.loads(json.dumps(as_dict(run()), allow_nan=False)) == form
    assert any("One frequency decides one number" in text for text in findings(study))


@pytest.mark.parametrize("error", [0.0, -1.0, math.nan, 500.0])
def test_reading_error_without_meaning(error: float) -> None:
    with pytest.raises(ValueError, match="reading error"):
        run(reading_error_hz=error)
