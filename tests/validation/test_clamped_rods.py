"""docs/studies/clamped_rods.py: first modes read from figures of github.com/leekunhwee/Dynamics, to +-5 Hz."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import clamped_rods


@pytest.fixture(scope="module")
def study() -> dict[str, Any]:
    return clamped_rods.study()


def test_rigid_clamp_is_a_cantilever(study: dict[str, Any]) -> None:
    """Euler-Bernoulli, beta L = 1.8751 (lambda^4 EI / (rho A L^4)); shear lowers it by 1 % for a slender rod."""
    rigid_hz = {rod["name"]: rod["rigid_clamp_hz"] for rod in study["rods"]}
    material = clamped_rods.ALUMINIUM
    for name, segments in clamped_rods.RODS.items():
        if len(segments) == 1:
            ((length, diameter),) = segments
            wave_speed = math.sqrt(material.youngs_modulus / material.density)
            radius = 1e-3 * diameter / 4.0
            euler = 1.8751**2 * radius * wave_speed / (2.0 * math.pi * (1e-3 * length) ** 2)
            assert 0.98 * euler < rigid_hz[name] < euler
    # Rigid-clamp Timoshenko values that came with the readings.
    assert rigid_hz == pytest.approx({"b": 312.6, "c": 573.7, "d": 414.2}, abs=0.1)


def test_clamp_is_recovered_from_its_rod(study: dict[str, Any]) -> None:
    assert len(study["identified"]) == 6
    for clamp in study["identified"]:
        low, high = clamp["interval"]
        readings = clamped_rods.MEASURED_HZ[clamp["rod"]] + np.array([-5.0, 0.0, 5.0])
        for value, reading in zip((low, clamp["value"], high), readings, strict=True):
            moved = clamped_rods.rod(clamp["rod"]).replace({clamp["address"]: value})
            assert moved.natural_frequencies(1e3)[0] == pytest.approx(reading, abs=1e-3)


def test_predictions_include_the_reading_error(study: dict[str, Any]) -> None:
    assert len(study["predictions"]) == 12
    for one in study["predictions"]:
        low, high = one["interval_hz"]
        assert low < one["predicted_hz"] < high
        assert one["identified_on"] != one["rod"]
        assert one["agrees"] is (low <= one["measured_hz"] + 5.0 and high >= one["measured_hz"] - 5.0)


def test_wider_reading_error_leaves_the_stiff_side_open() -> None:
    """Rod d reads 16.2 Hz below its rigid clamp: +-20 Hz cannot distinguish its clamp from a rigid one."""
    study = clamped_rods.study(20.0)
    found = {(clamp["rod"], clamp["assumption"]): clamp["interval"] for clamp in study["identified"]}
    assert found["d", "rotation"][1] is None
    assert found["d", "rotation"][0] is not None
    keys = ("assumption", "identified_on", "rod")
    one = next(p for p in study["predictions"] if tuple(p[key] for key in keys) == ("rotation", "d", "b"))
    assert one["interval_hz"][1] == pytest.approx(clamped_rods.first_mode("b", {}), abs=0.01)
    assert any(clamp["explains"] for clamp in study["common_clamp"])
