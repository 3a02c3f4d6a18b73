"""Fits of a joint in the extension under anything that NumPy can hand them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bindings.test_fuzz import ALLOWED, ODD, good, limited_memory
from receptance import _core

__all__ = ["limited_memory"]


def reduction() -> dict[str, Any]:
    """Arguments of a reduction to a joint that works."""
    start = good()
    tip = np.array([[0.0, 0.0]])
    w = np.linspace(1e3, 1e4, 11) + 0j
    tables = {name: start[name] for name in ("segments", "joints", "masses", "grounds")}
    return {"angular_frequency": w, **tables, "joint": 0, "response": tip, "excitation": tip.copy(), "threads": 1}


def normal_matrix() -> dict[str, Any]:
    """Arguments of a normal matrix that works."""
    arguments = reduction()
    spring = np.ascontiguousarray(arguments["joints"][0, 2:])
    return {
        "reduction": _core.reduce_joint(**arguments),
        "angular_frequency": arguments["angular_frequency"],
        "measured": np.full(11, 1e-7 - 1e-8j),
        "weights": np.ones(11),
        "reference": spring,
        "joint": spring.copy(),
        "columns": np.array([0.0, 1.0]),
        "slopes": np.ones(2),
        "threads": 1,
    }


def residual() -> dict[str, Any]:
    """Arguments of residuals that work."""
    return {name: value for name, value in normal_matrix().items() if name not in ("columns", "slopes")}


def fit() -> dict[str, Any]:
    """Arguments of a fit that works."""
    one = normal_matrix()
    return {
        "reductions": [one["reduction"]],
        **{name: [one[name]] for name in ("angular_frequency", "measured", "weights")},
        "references": one["reference"][None].copy(),
        "joints": one["joint"][None].copy(),
        "variables": np.array([[0.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0]]),
        "logarithmic": np.ones(2, dtype=np.bool_),
        "bounds": np.array([[5.0, 3.0], [10.0, 8.0]]),
        "starts": np.array([[7.0, 5.0], [8.0, 6.0]]),
        "tolerance": 1e-8,
        "evaluations": 20,
        "threads": 1,
    }


@pytest.mark.parametrize(
    ("function", "arguments"),
    [
        ("reduce_joint", reduction),
        ("joint_normal_matrix", normal_matrix),
        ("joint_residual", residual),
        ("fit_joint", fit),
    ],
)
@settings(max_examples=400)
@given(data=st.data())
def test_fits_of_a_joint_answer_or_refuse(function: str, arguments: Any, data: st.DataObject) -> None:
    changed = {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in arguments().items()}
    name = data.draw(st.sampled_from(sorted(changed)))
    holder, key = (changed[name], 0) if isinstance(changed[name], list) else (changed, name)
    value = holder[key]
    if not isinstance(value, np.ndarray):
        holder[key] = data.draw(st.sampled_from([-1, 1, 7, 2**40, 2**70, 0.5, None, "one"]))
        if name == "threads" and holder[key] in (2**40, 7):
            holder[key] = 2
    else:
        how = data.draw(st.sampled_from(["number", "shorter", "transposed", "type", "dimensions"]))
        if how == "number":
            value.flat[data.draw(st.integers(0, value.size - 1))] = data.draw(st.sampled_from(ODD))
        elif how == "shorter":
            holder[key] = np.ascontiguousarray(value[:-1])
        elif how == "transposed":
            holder[key] = value.T
        elif how == "type":
            # Real lines in double precision are no mistake.
            holder[key] = value.real.astype(data.draw(st.sampled_from([np.float32, np.float64])))
        else:
            holder[key] = value[None]
    found, refused = None, ""
    try:
        found = getattr(_core, function)(**changed)
    except ALLOWED as error:
        refused = str(error)
    if found is None:
        assert refused
        assert "panick" not in refused
    else:
        for array in found if isinstance(found, tuple) else (found,):
            assert array.dtype in (np.float64, np.int64)
            assert array.flags.c_contiguous
