"""The checks behind all bad input: frequencies, threads and numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from receptance import _checks


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "frequency_hz is empty, expected at least one line"),
        ([0.0, 1.0], r"frequency_hz\[0\] is 0 Hz, expected more than zero .*omit that line"),
        ([1.0, 2.0, -3.0], r"frequency_hz\[2\] is -3 Hz"),
        ([1.0, np.nan], r"frequency_hz\[1\] is nan, expected a finite number of Hz"),
        ([complex(0.0, -1.0)], r"frequency_hz\[0\] is"),
        ([1.0, 3.0, 2.0], "not ascending: line 2 is 2 Hz after 3 Hz; sort the lines"),
        ([[1.0, 2.0]], r"frequency_hz has shape \(1, 2\), expected one dimension"),
    ],
)
def test_unusable_lines_are_named(lines: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        _checks.frequencies(lines)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "lines", ["100", ["1", "2"], None, [None], [True, False], object(), np.array(["2020"], dtype="M8[s]")]
)
def test_lines_of_invalid_type(lines: object) -> None:
    with pytest.raises(TypeError, match="frequency_hz has dtype"):
        _checks.frequencies(lines)  # type: ignore[arg-type]


def test_lines_of_any_kind_of_number() -> None:
    for lines in (
        [1, 2],
        np.array([1, 2], dtype=np.uint8),
        np.array([1, 2], dtype=np.float32),
        range(1, 3),
        (1.0, 2.0),
    ):
        found = _checks.frequencies(lines)
        assert found.dtype == np.float64
        np.testing.assert_array_equal(found, [1.0, 2.0])
    assert _checks.frequencies(5).shape == (1,)
    assert _checks.frequencies([1 - 2j, 2]).dtype == np.complex128


def test_lines_go_to_the_core_as_they_are() -> None:
    lines = np.linspace(1.0, 9.0, 9)
    lines.flags.writeable = False
    assert _checks.frequencies(lines) is lines
    windowed = lines - 1j
    assert _checks.frequencies(windowed) is windowed


@pytest.mark.parametrize("kind", ["<f8", ">f8", "<c16", ">c16"])
def test_non_contiguous_lines_are_copied(kind: str) -> None:
    lines = np.arange(1, 10).astype(kind)
    apart = np.repeat(lines, 2)[::2]
    room = np.zeros(lines.nbytes + 1, np.uint8)
    aside = room[1:].view(kind)
    aside[:] = lines
    assert not apart.flags.c_contiguous
    assert not aside.flags.aligned
    for given in (lines, apart, aside):
        found = _checks.frequencies(given)
        assert found.flags.c_contiguous
        assert found.flags.aligned
        assert found.dtype.isnative
        np.testing.assert_array_equal(found, lines)


@pytest.mark.parametrize(("threads", "expected"), [(0, 0), (3, 3), (np.int64(2), 2)])
def test_thread_counts(threads: int, expected: int) -> None:
    assert _checks.thread_count(threads) == expected


@pytest.mark.parametrize("threads", [-1, 1.0, 2.5, True, "many", [1]])
def test_invalid_thread_counts(threads: object) -> None:
    with pytest.raises(ValueError, match=r"threads is .* expected a whole number"):
        _checks.thread_count(threads)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", ["", "-1", "1.5", "all"])
def test_thread_counts_from_the_environment(value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RECEPTANCE_THREADS", value)
    with pytest.raises(ValueError, match="environment variable RECEPTANCE_THREADS is"):
        _checks.thread_count(None)
    monkeypatch.setenv("RECEPTANCE_THREADS", "2")
    assert _checks.thread_count(None) == 2
    assert _checks.thread_count(1) == 1
    monkeypatch.delenv("RECEPTANCE_THREADS")
    assert _checks.thread_count(None) == 0


def test_numbers() -> None:
    assert _checks.number("x", "y", Fraction(1, 2)) == 0.5
    assert _checks.number("x", "y", np.float32(0.5)) == 0.5
    assert _checks.not_negative("x", "y", 0) == 0.0
    with pytest.raises(TypeError, match="x: y is"):
        _checks.number("x", "y", np.str_("1"))
    with pytest.raises(ValueError, match="x: y is -0, expected more than zero mm"):
        _checks.positive("x", "y", -0.0, unit="mm")
    with pytest.raises((OverflowError, ValueError), match=r".+"):
        _checks.number("x", "y", 10**400)
