"""Texts with tables of numbers: decoding, lines, numbers with the place of what is wrong."""

from __future__ import annotations

import codecs
import re
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.errors import ReceptanceWarning
from receptance.io.build import outside
from receptance.io.errors import FileFormatError
from receptance.io.limits import check_time

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "check_ascending",
    "check_count",
    "decode",
    "doubts_of_end",
    "ends_with_line",
    "number",
    "numbered_lines",
    "rows_of_numbers",
    "shown",
]

_NUMBER = re.compile(
    r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[EeDd]([+-]?[0-9]{1,4}))?|[+-]?(?:nan|inf(?:inity)?)", re.IGNORECASE
)


_FEW = 100
"""Lines of different lengths among which the shortest one may well be the last by chance."""


def decode(data: bytes) -> str:
    """Return a text as UTF-16 where it begins with its mark, else as UTF-8, or as Latin-1 where it is not.

    Raises
    ------
    FileFormatError
        UTF-16 that is damaged, or without its mark.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            return data.decode("utf-16")
        except UnicodeDecodeError as error:
            problem = f"the text begins as UTF-16 and is damaged: {error.reason}"
            raise FileFormatError(problem, byte=error.start) from None
    start = data[:200]
    if start.count(0) * 4 > len(start):
        raise FileFormatError(
            "there are zero bytes, as in a text in UTF-16 without the mark that it should begin with; save it as UTF-8",
            byte=data.index(0),
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def ends_with_line(text: str) -> bool:
    """Return whether the last line has an end of line (Ctrl-Z, which DOS programs wrote last, may follow it)."""
    behind = text[len(text.rstrip(" \t\r\n\f\x1a")) :]
    return "\n" in behind or "\r" in behind


def doubts_of_end(text: str, rows: Sequence[tuple[int, str]]) -> list[str]:
    """Return what to note of rows of numbers whose text may have been cut off, after warning of it.

    A number that was cut is a number still, and what is missing of the last one may be its exponent.
    """
    if not rows:
        return []
    line, last = rows[-1]
    lengths = {len(row.rstrip()) for _, row in rows[:-1]}
    telling = len(rows) > _FEW or (len(rows) > 2 and len(lengths) == 1)
    note = ""
    if not ends_with_line(text):
        note = f"line {line}, the last one, has no end of line: if the file was cut off, its last number is wrong"
    elif telling and len(last.rstrip()) < min(lengths):
        note = f"line {line}, the last one, is shorter than all others: if it was cut off, its last number is wrong"
    if note:
        warnings.warn(note, ReceptanceWarning, stacklevel=outside())
    return [note] if note else []


def check_count(text: str, rows: int, declared: int, line: int) -> None:
    """Raise where a file of this library does not have the rows it says, or ends in the middle of one.

    Parameters
    ----------
    text : str
        The whole file.
    rows, declared : int
        Rows of numbers that are there, and that the file says.
    line : int
        Last line.
    """
    if rows != declared:
        raise FileFormatError(
            f"the file says that it has {declared} rows of numbers, there are {rows}: it was cut off or changed",
            line=line,
        )
    if not ends_with_line(text):
        raise FileFormatError(
            "the last line has no end of line, which it was written with: it was cut off, and its last number may be "
            "wrong; if it is right, end the line",
            line=line,
        )


def numbered_lines(text: str) -> list[tuple[int, str]]:
    """Return the lines that are not blank, with their numbers from 1."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return [(number, line) for number, line in enumerate(lines, 1) if line.strip()]


def shown(text: str) -> str:
    """Return the beginning of a text as it can be shown."""
    return repr(text[:60] + ("..." if len(text) > 60 else ""))


def number(field: str, line: int, what: str, *, decimal_comma: bool = False, show: bool = True) -> float:
    """Return a number, with E or D before its exponent; it may be infinite or not a number.

    Where nothing has shown yet that the file is a measurement, errors do not show what stands in it.
    """
    plain = field.strip()
    if decimal_comma and "." not in plain:
        plain = plain.replace(",", ".", 1)
    match = _NUMBER.fullmatch(plain)
    if not match:
        raise FileFormatError(f"{what} is {shown(field.strip()) if show else 'text'}, expected a number", line=line)
    mantissa, exponent = match.groups()
    return float(plain) if mantissa is None else float(f"{mantissa}E{exponent or 0}")


def rows_of_numbers(lines: Sequence[tuple[int, str]], names: Sequence[str]) -> NDArray[np.float64]:
    """Return a table of finite numbers with blanks between them, `(rows, names)`, or raise with the line.

    What stands in the first row is not shown where it is no number: the file may be anything then.
    """
    try:
        # Most files have nothing special in them; this is ten times as fast as looking at every field.
        table = np.array([[float(field) for field in text.split()] for _, text in lines], dtype=np.float64)
        if (
            table.shape == (len(lines), len(names))
            and np.all(np.isfinite(table))
            and not any("_" in t for _, t in lines)
        ):
            return table
    except ValueError:
        pass
    rows: list[list[float]] = []
    for line, text in lines:
        check_time()
        fields = text.split()
        if len(fields) != len(names):
            raise FileFormatError(f"there are {len(fields)} columns, expected {', '.join(names)}", line=line)
        show = bool(rows)
        rows.append([number(field, line, f"the {name}", show=show) for field, name in zip(fields, names, strict=True)])
        if not np.all(np.isfinite(rows[-1])):
            raise FileFormatError("the numbers are not all finite", line=line)
    return np.array(rows, dtype=np.float64)


def check_ascending(frequency_hz: Sequence[float], lines: Sequence[int]) -> None:
    """Raise where a frequency is not above the one before it, or is below zero or not finite."""
    array = np.asarray(frequency_hz, dtype=np.float64)
    bad = np.flatnonzero(~(np.isfinite(array) & (array >= 0.0)))
    if bad.size:
        raise FileFormatError(f"the frequency is {array[bad[0]]:g} Hz, expected a number from 0 on", line=lines[bad[0]])
    bad = np.flatnonzero(np.diff(array) <= 0.0)
    if bad.size:
        first, second = array[bad[0]], array[bad[0] + 1]
        raise FileFormatError(
            f"the frequency is {second:.9g} Hz after {first:.9g} Hz, expected ascending lines", line=lines[bad[0] + 1]
        )
