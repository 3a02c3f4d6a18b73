"""Every result has a text, a page, a figure and JSON, whatever numbers it has."""

from __future__ import annotations

import copy
import json
import math
import sys
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import receptance as rc
from receptance.diagnosis import Verdict, diagnose
from receptance.diagnosis.held_out import FREQUENCIES, SCORE
from receptance.diagnosis.presentation import of_metric
from receptance.diagnosis.text import sizes
from receptance.fit import profile_likelihoods
from receptance.report import Renderable, Result
from receptance.report.figure import as_image
from receptance.report.table import amount, amount_interval, amounts, interval, number, percent

AWKWARD = st.sampled_from(
    [
        0.0,
        -0.0,
        5e-324,
        -5e-324,
        1e-310,
        1e-100,
        1.0,
        1e8,
        1e150,
        -1e300,
        sys.float_info.max,
        math.inf,
        -math.inf,
        math.nan,
    ]
)
NUMBERS = st.one_of(AWKWARD, st.floats())
UNITS = st.sampled_from(["", "N/m", "kg", "m", "s", "%"])


@given(st.lists(NUMBERS, min_size=1, max_size=4), UNITS, st.integers(1, 6))
def test_numbers_have_short_texts(values: list[float], unit: str, digits: int) -> None:
    texts = [*amounts(values, unit, digits)[0], *(amount(value, unit, digits) for value in values)]
    texts += [form for value in values for form in (number(value, "+.4g"), interval((value, values[0]), ".4g"))]
    texts += [percent(value, digits, sign=True) for value in values]
    texts += [amount_interval((value, values[-1]), unit, digits) for value in values]
    texts += [of_metric(name, value) for value in values for name in (SCORE, FREQUENCIES)]
    # The largest number without a power of ten may have many digits in nats alone.
    assert all(len(text) < 500 for text in texts)
    assert not any(text.startswith(("-0.0", "+0.0")) and not any(c in text for c in "123456789") for text in texts)


def test_subnormal_and_zero_beside_large_numbers() -> None:
    assert amounts([5e-324, 0.0, 1e8], "N/m", 3) == (["4.94e-324", "0", "1.00e8"], "N/m")
    assert amounts([1.7976931348623157e308], "N/m", 3) == (["1.80e308"], "N/m")
    assert amounts([-0.0, 1.0])[0] == ["0.00", "1.00"]


@cache
def _results() -> dict[str, Renderable]:
    bar = rc.Segment(length=0.1, outer_diameter=0.02, material=rc.STEEL)
    joint = rc.PointJoint(k_y=1e8, k_theta=1e5)
    pair = rc.Assembly([rc.Part([bar], name="tool"), joint, rc.Part([bar], name="holder")])
    lines = np.linspace(500.0, 5000.0, 181)
    values = pair.receptance(lines)
    modes = rc.Observation.from_modes(
        assembly=pair, frequency_hz=pair.natural_frequencies(2e4)[:3], standard_deviation_hz=1.0
    )
    measured = rc.Observation(assembly=pair, frequency_hz=lines, receptance=values, standard_deviation=0.01)
    unknown = rc.Unknown(address="joint.k_theta", lower=1e3, upper=1e7)
    fit = rc.identify([modes, measured], unknown)
    frf = rc.FRF(frequency_hz=lines, values=values, coherence=np.full(181, 0.99), log_variance=1e-4)
    profiles = profile_likelihoods(fit)
    return {
        "identification": fit,
        "profiles": profiles,
        "profile": profiles["joint.k_theta"],
        "frf": frf,
        "verdict": diagnose([modes], [unknown], causes=["tool_modulus"]),
        "assembly": pair,
    }


_NUMERIC = ("values", "standard_errors", "covariance", "correlation", "rise", "threshold", "lower", "upper", "value")
"""Attributes of the results that are replaced."""


def _damaged(value: Any, draw: Callable[[], float]) -> Any:
    if isinstance(value, float):
        return draw()
    if isinstance(value, np.ndarray) and value.dtype.kind in "fc":
        found = value.copy()
        found.flat[:: max(found.size // 5, 1)] = draw()
        return found
    if isinstance(value, Mapping):
        return {name: _damaged(own, draw) for name, own in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(_damaged(own, draw) for own in value)
    return value


@pytest.mark.filterwarnings("ignore::RuntimeWarning", "ignore::UserWarning")
@pytest.mark.parametrize("name", ["identification", "profile", "frf"])
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_results_with_awkward_numbers_are_rendered(name: str, data: st.DataObject) -> None:
    result = copy.copy(_results()[name])
    chosen = [field for field in _NUMERIC if hasattr(result, "__dict__") and field in vars(result)]
    field = data.draw(st.sampled_from(chosen))
    object.__setattr__(result, field, _damaged(getattr(result, field), lambda: data.draw(AWKWARD)))
    assert result.summary(80)
    assert len(repr(result)) < 1000
    if name != "frf":  # it shows its figure
        assert result._repr_html_()
    if isinstance(result, Result):
        json.dumps(result.to_dict(), allow_nan=False)
        assert result.heading


@settings(max_examples=50, deadline=None)
@given(data=st.data())
def test_causes_with_awkward_sizes_are_rendered(data: st.DataObject) -> None:
    verdict = _results()["verdict"]
    assert isinstance(verdict, Verdict)
    cause = next(one for one in verdict.candidates)
    damaged = copy.copy(cause)
    vars(damaged)["parameters"] = {name: tuple(data.draw(AWKWARD) for _ in range(3)) for name in cause.parameters}
    assert " (95 %: " in sizes(damaged.parameters, damaged.explanation.parameters)


@pytest.mark.parametrize("name", ["identification", "profiles", "frf", "verdict"])
def test_every_result_has_a_figure(name: str) -> None:
    assert as_image(_results()[name].plot(), "png").startswith(b"\x89PNG")  # type: ignore[attr-defined]
