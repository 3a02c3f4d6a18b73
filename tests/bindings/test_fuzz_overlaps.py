"""Overlaps with arbitrary NumPy input: a result or an ordinary exception."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bindings import calls
from bindings.test_fuzz import ALLOWED, ODD, STEEL, check, good, limited_memory, modes
from receptance import _core

__all__ = ["limited_memory"]


def overlap_receptance() -> dict[str, Any]:
    """Return arguments that work: a tool, an overlap, a holder, a mass, a support."""
    shank = [0.02, 0.005, *STEEL, 0.01, *STEEL, 0.02, 1]
    sleeve = [0.04, 0.02, *STEEL, 0.0, 0, 0, 0, 0, 0]
    return {
        **good(),
        "joints": np.zeros((0, 9)),
        "parameters": np.array([[4.0, 0.0, 2.0], [4.0, 0.0, 25.0], [4.0, 0.0, 16.0], [0.0, 0.0, 2.0]]),
        "overlaps": np.array([[1, 2, 0.03, *shank, *sleeve, 1e8, 1e4, 10.0, 1e-3, 0.02, 0.0, 0]]),
    }


def overlap_modes(arguments: dict[str, Any]) -> dict[str, Any]:
    return {**modes(arguments), "overlaps": arguments["overlaps"]}


@pytest.mark.parametrize("points", [0, 1, 4])
def test_undamaged_call_succeeds(points: int) -> None:
    arguments = overlap_receptance()
    arguments["overlaps"][0, 31] = points
    assert check(calls.receptance, arguments) is None
    assert check(calls.natural_frequencies, overlap_modes(arguments)) is None


@settings(max_examples=100)
@given(data=st.data())
def test_any_number_in_any_place(data: st.DataObject) -> None:
    arguments = overlap_receptance()
    arguments["overlaps"][0, 31] = data.draw(st.sampled_from([0, 0, 1, 3]))
    for _ in range(data.draw(st.integers(1, 4))):
        name = data.draw(st.sampled_from(["overlaps", "overlaps", "overlaps", "parameters", "segments", "motion"]))
        value = data.draw(st.sampled_from(ODD) | st.floats() | st.integers(-3, 40).map(float))
        if name == "motion":
            arguments[name] = data.draw(st.integers(-1, 3))
            continue
        row = data.draw(st.integers(0, len(arguments[name]) - 1))
        arguments[name][row, data.draw(st.integers(0, arguments[name].shape[1] - 1))] = value
    check(calls.receptance, arguments)
    check(calls.natural_frequencies, overlap_modes(arguments))


@settings(max_examples=100)
@given(data=st.data())
def test_any_scale_of_any_column(data: st.DataObject) -> None:
    """Each number multiplied by anything, which stays in the range of meaning more often than a number does."""
    arguments = overlap_receptance()
    for _ in range(data.draw(st.integers(1, 6))):
        column = data.draw(st.integers(2, 29))
        arguments["overlaps"][0, column] *= 10.0 ** data.draw(st.floats(-12, 12))
    check(calls.receptance, arguments)
    check(calls.natural_frequencies, overlap_modes(arguments))


@settings(max_examples=100)
@given(data=st.data())
def test_any_shape_and_type(data: st.DataObject) -> None:
    shape = tuple(data.draw(st.lists(st.integers(0, 33), min_size=0, max_size=3)))
    kind = data.draw(st.sampled_from(["f8", "f4", "c16", "i8", "?", "O", "S3", "U2", "M8[s]", ">f8"]))
    arguments = {**overlap_receptance(), "overlaps": np.zeros(shape, dtype=kind)}
    check(calls.receptance, arguments)
    check(calls.natural_frequencies, overlap_modes(arguments))


def test_wrong_columns_name_the_table() -> None:
    for width in (31, 33):
        with pytest.raises(ValueError, match=rf"overlaps: shape is \(2, {width}\), expected"):
            calls.receptance(**{**overlap_receptance(), "overlaps": np.zeros((2, width))})


@pytest.mark.parametrize("column", [0, 1, 13, 24, 31, 32])
def test_derivative_by_an_invalid_column_is_an_error(column: int) -> None:
    arguments = {**overlap_receptance(), "parameters": np.array([[4.0, 0.0, float(column)]])}
    assert isinstance(check(calls.receptance, arguments), ValueError)


@pytest.mark.parametrize("motion", [1, 2])
def test_rods_have_no_overlap(motion: int) -> None:
    with pytest.raises(ValueError, match="an overlap joins beams in bending"):
        calls.receptance(**{**overlap_receptance(), "motion": motion})


def test_a_loose_overlap_is_a_singular_interface() -> None:
    loose = overlap_receptance()
    loose["overlaps"][0, [25, 27]] = 0.0
    with pytest.raises(_core.SingularInterfaceError, match="overlap 0: the interface is singular"):
        calls.receptance(**loose)
    hinge = overlap_receptance()
    hinge["overlaps"][0, [26, 28]] = 0.0
    assert check(calls.receptance, hinge) is None
    hinge["overlaps"][0, 31] = 1
    with pytest.raises(_core.SingularInterfaceError, match="overlap 0"):
        calls.receptance(**hinge)


def test_excessive_layer_stiffness_is_an_error() -> None:
    stiff = overlap_receptance()
    stiff["overlaps"][0, 25] = 1e25
    with pytest.raises(ValueError, match=r"overlap 0: at .* grows by"):
        calls.receptance(**stiff)
    with pytest.raises(ALLOWED, match="too high"):
        calls.natural_frequencies(**overlap_modes(stiff))
