"""The extension's own functions with arbitrary NumPy input: a result or an ordinary exception."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bindings import calls
from limits import LIMIT_S
from receptance import ReceptanceError

ALLOWED = (ValueError, TypeError, OverflowError, ReceptanceError)
STEEL = [200e9, 7800.0, 0.29]
ODD = [
    0.0,
    -0.0,
    1.0,
    2.0,
    3.0,
    0.5,
    -1.0,
    1e-300,
    5e-324,
    1e300,
    -1e300,
    1.7e308,
    np.nan,
    np.inf,
    -np.inf,
    1e15,
    2**24,
    2**53,
    2**64,
]


@pytest.fixture(autouse=True)
def limited_memory() -> Iterator[None]:
    """Let a runaway allocation end this process and not its neighbours."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0]) if Path("/proc/self/statm").exists() else 0
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + 4 * 2**30, hard))
    yield
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def run_alone(script: str) -> None:
    """Run a script in a process of its own, the test folder as its first argument; it must end well."""
    tests = str(Path(__file__).resolve().parents[1])
    command = [sys.executable, "-c", textwrap.dedent(script), tests]
    done = subprocess.run(command, timeout=LIMIT_S, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"ended with {done.returncode}: {done.stderr[-500:]}"


def good() -> dict[str, Any]:
    """Return arguments that work: two segments, a joint, a mass, a support."""
    return {
        "angular_frequency": np.array([1e3, 2e3, 5e4 - 10j]),
        "motion": 0,
        "segments": np.array([
            [0, 1, 0.1, 0.02, 0.0, *STEEL, 0.01, 0, 0, 0, 0, 0],
            [2, 3, 0.05, 0.04, 0.01, *STEEL, 0.0, *STEEL, 0.02, 1],
        ]),
        "joints": np.array([[1, 2, 1e8, 1e5, 1e6, 1.0, 1e-3, 0.0, 0.01]]),
        "masses": np.array([[0, 0.01, 1e-6]]),
        "grounds": np.array([[3, 1e7, 1e4, 0, 0, 0, 0, 0.1]]),
        "excitations": np.array([[0.0, 0.0], [3.0, 1.0]]),
        "responses": np.array([[0.0, 0.0], [1.0, 1.0]]),
        "parameters": np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 4.0], [2.0, 0.0, 1.0], [3.0, 0.0, 1.0]]),
        "threads": 1,
    }  # fmt: skip


def modes(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of the other function."""
    kept = {name: arguments[name] for name in ("motion", "segments", "joints", "masses", "grounds", "parameters")}
    return {"upper": 1e5, "most": 50, **kept}


def check(function: Any, arguments: dict[str, Any]) -> Exception | None:
    """Call; the result must be finite and of the right shape, or the error one of the allowed types.

    A panic would be a `PanicException`, which is not an `Exception` and is not caught here.
    """
    started = time.perf_counter()
    refused: Exception | None = None
    try:
        first, second = function(**arguments)
    except ALLOWED as error:
        refused = error
    assert time.perf_counter() - started < LIMIT_S
    if refused is not None:
        assert str(refused)
        assert "internal" not in str(refused)
        assert "panick" not in str(refused)
        return refused
    n_parameters = len(arguments["parameters"])
    if function is calls.receptance:
        shape = (len(arguments["angular_frequency"]), len(arguments["responses"]), len(arguments["excitations"]))
        assert first.shape == shape
        assert second.shape == (*shape, n_parameters)
        assert first.dtype == second.dtype == np.complex128
    else:
        assert second.shape == (len(first), n_parameters)
        assert np.all(np.diff(first) >= 0.0)
    assert np.all(np.isfinite(first))
    assert np.all(np.isfinite(second))
    assert first.flags.c_contiguous
    assert second.flags.c_contiguous
    return None


def test_undamaged_call_succeeds() -> None:
    assert check(calls.receptance, good()) is None
    assert check(calls.natural_frequencies, modes(good())) is None


TABLES = ["segments", "joints", "masses", "grounds", "excitations", "responses", "parameters"]


@settings(max_examples=250)
@given(data=st.data())
def test_any_number_in_any_place(data: st.DataObject) -> None:
    arguments = good()
    for _ in range(data.draw(st.integers(1, 4))):
        name = data.draw(st.sampled_from([*TABLES, "angular_frequency", "motion", "threads"]))
        value = data.draw(st.sampled_from(ODD) | st.floats() | st.integers(-3, 20).map(float))
        if name == "motion" or name == "threads":
            arguments[name] = data.draw(st.integers(-2, 5))
        elif name == "angular_frequency":
            index = data.draw(st.integers(0, 2))
            both = complex(value, data.draw(st.sampled_from(ODD) | st.floats()))
            arguments[name][index] = both if np.iscomplexobj(arguments[name]) else value
            if data.draw(st.booleans()):
                arguments[name] = arguments[name].real.copy()
        else:
            row = data.draw(st.integers(0, len(arguments[name]) - 1))
            arguments[name][row, data.draw(st.integers(0, arguments[name].shape[1] - 1))] = value
    check(calls.receptance, arguments)
    check(calls.natural_frequencies, modes(arguments))


@settings(max_examples=150)
@given(upper=st.floats() | st.sampled_from(ODD), most=st.integers(-2, 2**66), motion=st.integers(-1, 3))
def test_any_limit_of_natural_frequencies(upper: float, most: int, motion: int) -> None:
    # A limit far above every wave asks for as many modes as there are; a few will do here.
    arguments = {**modes(good()), "upper": upper, "most": most if upper < 1e6 else min(most, 20), "motion": motion}
    check(calls.natural_frequencies, arguments)


@settings(max_examples=250)
@given(data=st.data())
def test_any_shape_and_type(data: st.DataObject) -> None:
    arguments = good()
    name = data.draw(st.sampled_from([*TABLES, "angular_frequency"]))
    shape = tuple(data.draw(st.lists(st.integers(0, 15), min_size=0, max_size=3)))
    kind = data.draw(
        st.sampled_from(["f8", "f4", "c16", "c8", "i8", "i4", "u1", "?", "O", "S3", "U2", "M8[s]", ">f8", "f2"])
    )
    array = np.zeros(shape, dtype=kind)
    layout = data.draw(st.sampled_from(["C", "F", "step", "reversed"]))
    if layout == "F":
        array = np.asfortranarray(array)
    elif layout == "step" and array.ndim:
        array = np.repeat(array, 2, axis=0)[::2]
    elif layout == "reversed" and array.ndim:
        array = array[::-1]
    arguments[name] = array
    check(calls.receptance, arguments)
    if name in modes(good()):
        check(calls.natural_frequencies, modes(arguments))


@pytest.mark.parametrize("name", [*TABLES, "angular_frequency"])
@pytest.mark.parametrize("value", [None, 1.0, "text", [], [[1.0]], object(), {}, b"bytes", np.float64(2.0)])
def test_non_array_is_a_type_error(name: str, value: object) -> None:
    with pytest.raises(TypeError, match=name):
        calls.receptance(**{**good(), name: value})


@pytest.mark.parametrize("name", ["motion", "threads"])
@pytest.mark.parametrize("value", [None, 1.5, "1", -1, 2**70, [0]])
def test_invalid_count_is_an_error(name: str, value: object) -> None:
    with pytest.raises((TypeError, OverflowError), match=f"{name}|negative|too (big|large)"):
        calls.receptance(**{**good(), name: value})


@pytest.mark.parametrize("name", TABLES)
def test_wrong_columns_name_the_table(name: str) -> None:
    for change in (-1, 1):
        width = good()[name].shape[1] + change
        with pytest.raises(ValueError, match=rf"{name}: shape is \(2, {width}\), expected"):
            calls.receptance(**{**good(), name: np.zeros((2, width))})


@pytest.mark.parametrize("name", TABLES)
def test_non_contiguous_arrays_are_refused_or_read_correctly(name: str) -> None:
    # Two rows and more: one row lies the same way in both orders.
    arguments = good()
    arguments["joints"] = np.repeat(arguments["joints"], 2, axis=0)
    arguments["joints"][1, :2] = [3, 4]
    arguments["masses"] = np.array([[0, 0.01, 1e-6], [1, 0.02, 2e-6]])
    arguments["grounds"] = np.array([[3, 1e7, 1e4, 0, 0, 0, 0, 0.1], [0, 1e4, 1e2, 0, 0, 0, 0, 0.2]])
    reference = calls.receptance(**arguments)
    doubled = np.repeat(arguments[name], 2, axis=0)
    found: list[Any] = []
    refused: list[str] = []
    for array in (doubled[::2], np.asfortranarray(arguments[name])):
        assert not array.flags.c_contiguous
        try:
            found.append(calls.receptance(**{**arguments, name: array}))
        except ValueError as error:
            refused.append(str(error))
    assert all(name in words and "contiguous" in words for words in refused), refused
    for h, dh in found:
        np.testing.assert_array_equal(h, reference[0])
        np.testing.assert_array_equal(dh, reference[1])


@pytest.mark.parametrize(
    ("table", "row", "column", "value", "words"),
    [
        ("segments", 0, 0, 0.5, "segment 0: node is 0.5"),
        ("segments", 0, 2, 0.0, "segment 0: length is 0"),
        ("segments", 1, 2, np.nan, "segment 1: length is NaN"),
        ("segments", 0, 3, -0.02, "outer_diameter is -0.02"),
        ("segments", 1, 4, 0.04, "inner_diameter is 0.04"),
        ("segments", 0, 5, 0.0, "youngs_modulus is 0"),
        ("segments", 0, 6, np.inf, "density is inf"),
        ("segments", 0, 7, -1.0, "poisson_ratio is -1"),
        ("segments", 0, 7, 0.6, "poisson_ratio is 0.6"),
        ("segments", 0, 8, -0.1, "loss_factor is -0.1"),
        ("segments", 1, 9, -1.0, "youngs_modulus is -1"),
        ("segments", 0, 10, 7800.0, "inner_diameter is 0"),
        ("segments", 0, 13, 2.0, "shear_model is 2"),
        ("joints", 0, 2, -1.0, "joint 0: k_y is -1"),
        ("joints", 0, 4, 1e9, "joint 0: k_ytheta is 1000000000"),
        ("joints", 0, 5, np.nan, "c_y is NaN"),
        ("joints", 0, 7, 1.0, "c_ytheta is 1"),
        ("joints", 0, 8, -0.1, "loss_factor is -0.1"),
        ("masses", 0, 1, -1.0, "point mass 0: mass is -1"),
        ("masses", 0, 2, np.inf, "inertia is inf"),
        ("masses", 0, 0, 9.0, "node 9"),
        ("grounds", 0, 1, -1.0, "ground spring 0: k_y is -1"),
        ("excitations", 0, 0, 9.0, "excitation"),
        ("excitations", 0, 1, 2.0, "excitation"),
        ("responses", 1, 0, -1.0, "responses: -1"),
        ("responses", 1, 0, 0.5, "responses: 0.5"),
        ("parameters", 0, 0, 8.0, "table is 8"),
        ("parameters", 0, 1, 2.0, "parameter row 0 is 2"),
        ("parameters", 0, 2, 13.0, "parameter column 0 is 13"),
        ("parameters", 0, 2, 1.0, "parameter column 0 is 1"),
        ("segments", 1, 1, 1.0, "tree"),
        ("joints", 0, 1, 1.0, "tree"),
    ],
)
def test_errors_name_the_quantity_and_its_value(table: str, row: int, column: int, value: float, words: str) -> None:
    arguments = good()
    arguments[table][row, column] = value
    with pytest.raises(ValueError, match=words):
        calls.receptance(**arguments)


@pytest.mark.parametrize(
    "line", [0.0, -1.0, np.nan, np.inf, complex(1.0, np.nan), complex(0.0, -1.0), complex(-1.0, 1.0)]
)
def test_invalid_frequencies_are_errors(line: complex) -> None:
    arguments = good()
    arguments["angular_frequency"][1] = line
    with pytest.raises(ValueError, match="frequency line 1"):
        calls.receptance(**arguments)


def test_empty_requests_give_empty_arrays() -> None:
    for name, columns in (("excitations", 2), ("responses", 2), ("parameters", 3)):
        arguments = {**good(), name: np.zeros((0, columns))}
        assert check(calls.receptance, arguments) is None
    arguments = {**good(), "angular_frequency": np.zeros(0, dtype=complex)}
    error = check(calls.receptance, arguments)
    assert error is None or isinstance(error, ValueError)


@pytest.mark.parametrize("motion", [1, 2])
def test_rods_take_the_same_tables(motion: int) -> None:
    arguments = {**good(), "motion": motion, "excitations": np.array([[0.0, 0.0]]), "responses": np.array([[3.0, 0.0]])}
    assert check(calls.receptance, arguments) is None
    arguments["excitations"] = np.array([[0.0, 1.0]])
    assert isinstance(check(calls.receptance, arguments), ValueError)


EXTREMES = [
    ("segments", 0, 2, 1e7), ("segments", 0, 2, 1e300), ("segments", 0, 3, 1e300), ("segments", 0, 3, 1e-300),
    ("segments", 0, 5, 1e-10), ("segments", 0, 5, 1e-300), ("segments", 0, 5, 1e300), ("segments", 0, 6, 1e30),
    ("segments", 0, 6, 1e300), ("segments", 0, 6, 1e-300), ("joints", 0, 2, 1e300), ("masses", 0, 1, 1e300),
    ("angular_frequency", 2, None, 1e12), ("angular_frequency", 2, None, 1e300), ("angular_frequency", 2, None, 1e-300),
    ("angular_frequency", 2, None, 1e5 + 1e300j), ("upper", None, None, 1e12), ("upper", None, None, 1e300),
]  # fmt: skip


def test_extreme_numbers_return_or_raise() -> None:
    """Slips of many orders of magnitude: a result or an error, within limits of memory and time."""
    script = """
        import resource, sys, time
        import numpy as np
        resource.setrlimit(resource.RLIMIT_AS, (4 * 2**30, 4 * 2**30))
        sys.path.insert(0, sys.argv[1])
        from bindings.test_fuzz import EXTREMES, LIMIT_S, check, good, modes
        from bindings import calls
        for name, row, column, value in EXTREMES:
            print(name, row, column, value, file=sys.stderr, flush=True)
            arguments = good()
            if name in arguments:
                arguments[name][row if column is None else (row, column)] = value
            other = modes(arguments)
            if name in other and row is None:
                other[name] = value
            other["most"] = 5
            started = time.perf_counter()
            check(calls.receptance, arguments)
            check(calls.natural_frequencies, other)
            assert time.perf_counter() - started < LIMIT_S
    """
    run_alone(script)


def test_huge_node_numbers_are_refused_before_allocation() -> None:
    """In a process of its own, with a limit on memory: the nodes must not be allocated before they are counted."""
    script = """
        import resource, sys
        import numpy as np
        sys.path.insert(0, sys.argv[1])
        from bindings import calls
        from bindings.test_fuzz import good
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for node in (2.0**23, 2.0**24 - 1, 2.0**24, 2.0**31, 2.0**32, 2.0**53, 2.0**63, 1e300):
            for name, row, column in (("segments", 0, 1), ("segments", 1, 0), ("joints", 0, 1), ("masses", 0, 0),
                                      ("grounds", 0, 0), ("excitations", 0, 0), ("responses", 0, 0),
                                      ("parameters", 0, 1), ("parameters", 0, 2)):
                arguments = good()
                arguments[name][row, column] = node
                try:
                    calls.receptance(**arguments)
                except ValueError as error:
                    assert str(error)
                else:
                    raise SystemExit(f"{name} with node {node} was taken")
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used
        assert grown < 50_000, f"{grown} kB"
    """
    run_alone(script)
