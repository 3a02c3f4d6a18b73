"""Errors of one sign in a group of tools, and only these."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import campaign, examples
from receptance.diagnosis.by_mode import ModeResidual, bias_of, slenderness_of

NAN = float("nan")


def residual(configuration: str, mode: int, percent: float) -> ModeResidual:
    return ModeResidual(configuration, configuration, mode, 1000.0, percent, NAN, NAN, NAN)


def test_the_long_tools_first_mode() -> None:
    rng = np.random.default_rng(5)
    ratios = {f"c{i}": 2.0 + i for i in range(9)}
    modes = [residual(name, 2, rng.normal(scale=0.3)) for name in ratios]
    modes += [
        residual(name, 1, rng.normal(scale=0.05) - (1.2 if ratio > 7.5 else 0.0)) for name, ratio in ratios.items()
    ]
    found = bias_of(modes, ratios)
    assert found is not None
    assert (found.mode, found.configurations, found.slenderness) == (1, ("c6", "c7", "c8"), (8.0, 10.0))
    assert found.mean_percent == pytest.approx(-1.2, abs=0.1)
    assert str(found).startswith(
        "mode 1 of the 3 tools with overhangs of 8.0 to 10.0 diameters is calculated 1.2 % too low"
    )


def test_noise_is_no_bias() -> None:
    count = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        ratios = {f"c{i}": 2.0 + i for i in range(8)}
        modes = [residual(name, mode, rng.normal()) for name in ratios for mode in (1, 2, 3)]
        count += bias_of(modes, ratios) is not None
    assert count <= 6


def test_few_and_no_residuals() -> None:
    assert bias_of([], {}) is None
    assert bias_of([residual("a", 1, 1.0), residual("b", 1, 1.1)], {"a": 3.0, "b": 4.0}) is None
    assert bias_of([residual(f"{i}", 1, 0.001) for i in range(5)], {f"{i}": 3.0 + i for i in range(5)}) is None


def test_slenderness_of_the_published_case(tmp_path: object) -> None:
    read = campaign.load(examples.write("er32", f"{tmp_path}/er32")[0])
    model, _ = read.base_model(read.measurements)
    found = slenderness_of(model)
    assert len(found) == 13
    assert max(found, key=lambda name: found[name]) == "d7_long"
    assert found["d7_long"] == pytest.approx(14.3, abs=0.1)
