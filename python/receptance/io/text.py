"""Texts with tables of numbers: decoding, lines, numbers with the place of what is wrong."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.io.errors import FileFormatError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["check_ascending", "decode", "number", "numbered_lines", "rows_of_numbers", "shown"]

_NUMBER = re.compile(
    r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[EeDd]([+-]?[0-9]{1,4}))?|[+-]?(?:nan|inf(?:inity)?)", re.IGNORECASE
)


def decode(data: bytes) -> str:
    """Return a text as UTF-8, or as Latin-1 where it is not."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def numbered_lines(text: str) -> list[tuple[int, str]]:
    """Return the lines that are not blank, with their numbers from 1."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return [(number, line) for number, line in enumerate(lines, 1) if line.strip()]


def shown(text: str) -> str:
    """Return the beginning of a text as it can be shown."""
    return repr(text[:60] + ("..." if len(text) > 60 else ""))


def number(field: str, line: int, what: str, *, decimal_comma: bool = False) -> float:
    """Return a number, with E or D before its exponent; it may be infinite or not a number."""
    plain = field.strip()
    if decimal_comma and "." not in plain:
        plain = plain.replace(",", ".", 1)
    match = _NUMBER.fullmatch(plain)
    if not match:
        raise FileFormatError(f"{what} is {shown(field.strip())}, expected a number", line=line)
    mantissa, exponent = match.groups()
    return float(plain) if mantissa is None else float(f"{mantissa}E{exponent or 0}")


def rows_of_numbers(lines: Sequence[tuple[int, str]], names: Sequence[str]) -> NDArray[np.float64]:
    """Return a table of finite numbers with blanks between them, `(rows, names)`, or raise with the line."""
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
    rows = []
    for line, text in lines:
        fields = text.split()
        if len(fields) != len(names):
            raise FileFormatError(f"there are {len(fields)} columns, expected {', '.join(names)}", line=line)
        rows.append([number(field, line, f"the {name}") for field, name in zip(fields, names, strict=True)])
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
