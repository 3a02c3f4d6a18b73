"""Fits of a joint in the extension under anything that NumPy can hand them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bindings import calls
from bindings.test_fuzz import ALLOWED, ODD, good, limited_memory
from receptance import _core

__all__ = ["limited_memory"]


def reduction() -> dict[str, Any]:
    """Arguments of a reduction to a joint that works."""
    start = good()
    tables = {name: start[name] for name in calls.TABLES}
    return {
        "angular_frequency": np.linspace(1e3, 1e4, 11) + 0j,
        **tables,
        "joint": 0,
        "points": np.zeros((2, 2)),
        "threads": 1,
    }


def reduced_model(arguments: dict[str, Any]) -> Any:
    """Return the model that is reduced to its joint, as power series."""
    model = _core.Model(0, **{name: arguments[name] for name in calls.TABLES})
    return model.reduced_to_joint(0, _core.Lines(arguments["angular_frequency"]), arguments["points"], 1)


def problem() -> dict[str, Any]:
    """Arguments of a problem that works."""
    arguments = reduction()
    return {
        "reduction": reduced_model(arguments),
        "spring": np.ascontiguousarray(arguments["joints"][0, 2:]),
        "variables": np.array([0.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0]),
        "measured": np.full(11, 1e-7 - 1e-8j),
        "weights": np.ones(11),
        "logarithmic": np.ones(2, dtype=np.bool_),
        "bounds": np.array([[5.0, 3.0], [10.0, 8.0]]),
        "priors": np.array([[1.0, 2.0, 10.0]]),
        "threads": 1,
    }


def normal_matrix() -> dict[str, Any]:
    """Arguments of a normal matrix that works."""
    return {**problem(), "x": np.array([7.0, 5.0])}


def rows() -> dict[str, Any]:
    """Arguments of residuals and derivatives that work."""
    return {**normal_matrix(), "free": np.array([True, False])}


def fit() -> dict[str, Any]:
    """Arguments of a fit that works."""
    return {
        **problem(),
        "starts": np.array([[7.0, 5.0], [8.0, 6.0]]),
        "free": np.ones(2, dtype=np.bool_),
        "tolerance": 1e-8,
        "least": 1e-9,
        "evaluations": np.array([20, 20]),
    }


@pytest.mark.parametrize(
    ("function", "arguments"),
    [("planes", reduction), ("normal_matrix", normal_matrix), ("rows", rows), ("fit", fit)],
)
@settings(max_examples=400)
@given(data=st.data())
def test_fits_of_a_joint_answer_or_refuse(function: str, arguments: Any, data: st.DataObject) -> None:
    changed = {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in arguments().items()}
    name = data.draw(st.sampled_from(sorted(changed)))
    value = changed[name]
    if not isinstance(value, np.ndarray):
        changed[name] = data.draw(st.sampled_from([-1, 1, 7, 2**40, 2**70, 0.5, None, "one"]))
        if name == "threads" and changed[name] in (2**40, 7):
            changed[name] = 2
    else:
        how = data.draw(st.sampled_from(["number", "shorter", "transposed", "type", "dimensions"]))
        if how == "number":
            odd = [-1, 0, 1, 2**62] if value.dtype.kind == "i" else ODD
            value.flat[data.draw(st.integers(0, value.size - 1))] = data.draw(st.sampled_from(odd))
        elif how == "shorter":
            changed[name] = np.ascontiguousarray(value[:-1])
        elif how == "transposed":
            changed[name] = value.T
        elif how == "type":
            # Real lines in double precision are no mistake.
            changed[name] = value.real.astype(data.draw(st.sampled_from([np.float32, np.float64])))
        else:
            changed[name] = value[None]
    found, refused, empty = None, "", False
    try:
        found = getattr(calls, function)(**changed)
        empty = found is None
    except ALLOWED as error:
        refused = str(error)
    if found is None:
        # Rows of a joint without a value are None.
        assert refused or (empty and function == "rows")
        assert "panick" not in refused
    else:
        for array in found if isinstance(found, tuple) else (found,):
            assert array.dtype in (np.float64, np.int64)
            assert array.flags.c_contiguous
