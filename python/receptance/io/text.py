"""Texts with tables of numbers: decoding, lines and numbers, and the line of every error."""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from receptance.errors import warn_user
from receptance.io.errors import FileFormatError, check_time

_NUMBER = re.compile(
    r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[EeDd]([+-]?[0-9]{1,4}))?|[+-]?(?:nan|inf(?:inity)?)", re.IGNORECASE
)
_MIN_ROWS_FOR_LENGTHS = 100
"""Number of rows of different lengths above which a last row shorter than all others is not taken for chance."""


def decode(data: bytes) -> str:
    """Decode a text as UTF-16 if it begins with a byte order mark, else as UTF-8, else as Latin-1."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            return data.decode("utf-16")
        except UnicodeDecodeError as error:
            problem = f"the UTF-16 text is damaged: {error.reason}"
            raise FileFormatError(problem, byte=error.start) from None
    start = data[:200]
    if start.count(0) * 4 > len(start):
        raise FileFormatError(
            "there are zero bytes, as in UTF-16 without a byte order mark; save the text as UTF-8",
            byte=data.index(0),
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def ends_with_line(text: str) -> bool:
    """Return whether the last line has a line ending (which a Ctrl-Z of DOS programs may follow)."""
    trailing = text[len(text.rstrip(" \t\r\n\f\x1a")) :]
    return "\n" in trailing or "\r" in trailing


def truncation_notes(text: str, rows: Sequence[tuple[int, str]]) -> list[str]:
    """Warn of a text that may be truncated in its last row, and return the note.

    A truncated number may still be a number, for example without its exponent.
    """
    if not rows:
        return []
    line, last = rows[-1]
    lengths = {len(row.rstrip()) for _, row in rows[:-1]}
    lengths_are_informative = len(rows) > _MIN_ROWS_FOR_LENGTHS or (len(rows) > 2 and len(lengths) == 1)
    note = ""
    if not ends_with_line(text):
        note = f"the last line, {line}, has no line ending: if the file is truncated, its last number is wrong"
    elif lengths_are_informative and len(last.rstrip()) < min(lengths):
        note = f"the last line, {line}, is shorter than all others: if it is truncated, its last number is wrong"
    if note:
        warn_user(note)
    return [note] if note else []


def check_row_count(text: str, rows: int, declared: int, line: int) -> None:
    """Raise if a file of this library has not the declared number of rows, or ends within its last `line`."""
    if rows != declared:
        raise FileFormatError(
            f"the file declares {declared} rows of numbers and has {rows}: it was truncated or changed",
            line=line,
        )
    if not ends_with_line(text):
        raise FileFormatError(
            "the last line has no line ending: the file was truncated, and its last number may be wrong; if the number "
            "is right, add a line ending",
            line=line,
        )


def numbered_lines(text: str) -> list[tuple[int, str]]:
    """Return the lines that are not blank, with their numbers from 1."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return [(number, line) for number, line in enumerate(lines, 1) if line.strip()]


def excerpt(text: str) -> str:
    """Return the beginning of a text for a message."""
    return repr(text[:60] + ("..." if len(text) > 60 else ""))


def number(field: str, line: int, name: str, *, decimal_comma: bool = False, quote: bool = True) -> float:
    """Return the number in a field, with E or D before its exponent; it may be infinite or NaN.

    With quote=False the error does not quote the field: the file is not known to be a measurement yet.
    """
    plain = field.strip()
    if decimal_comma and "." not in plain:
        plain = plain.replace(",", ".", 1)
    match = _NUMBER.fullmatch(plain)
    if not match:
        raise FileFormatError(f"{name} is {excerpt(field.strip()) if quote else 'text'}, expected a number", line=line)
    mantissa, exponent = match.groups()
    return float(plain) if mantissa is None else float(f"{mantissa}E{exponent or 0}")


def parse_rows(
    rows: Sequence[tuple[int, list[str]]],
    names: Sequence[str],
    *,
    decimal_comma: bool = False,
    quote_first_row: bool = False,
) -> NDArray[np.float64]:
    """Return the numbers `(rows, names)` in rows of fields with their line numbers, or raise with the line.

    By default errors in the first row do not quote it, because the file is not known to be a measurement yet.
    """
    width = len(names)
    try:
        # Ten times as fast as `number`, and sufficient for most files. Python's float() also accepts "1_000".
        values = np.array([[float(field) for field in fields] for _, fields in rows], dtype=np.float64)
        if values.shape == (len(rows), width) and not any("_" in field for _, fields in rows for field in fields):
            return values
    except ValueError:
        pass
    values = np.empty((len(rows), width))
    for index, (line, fields) in enumerate(rows):
        check_time()
        while len(fields) > width and not fields[-1].strip():
            fields.pop()
        if len(fields) != width:
            raise FileFormatError(f"there are {len(fields)} columns, expected {width}", line=line)
        quote = quote_first_row or index > 0
        for column, (field, name) in enumerate(zip(fields, names, strict=True)):
            values[index, column] = number(field, line, name, decimal_comma=decimal_comma, quote=quote)
    return values


def check_ascending(frequency_hz: Sequence[float], lines: Sequence[int]) -> None:
    """Raise if frequencies are not ascending, negative or not finite."""
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
