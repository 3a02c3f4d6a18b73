"""Texts with tables of numbers: decoding, lines and numbers, and the line of every error."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from receptance.errors import warn_user
from receptance.io.errors import MAX_NUMBERS, FileFormatError, check_count, check_time

MAX_TEXT = 1 << 28
"""Most bytes of a text, which is three times in memory while it is read."""
MAX_LINES = 1 << 22
"""Most lines of a text; each takes 200 bytes of memory while the text is read."""
_NUMBER = re.compile(
    r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+))(?:[EeDd]([+-]?[0-9]{1,4}))?|[+-]?(?:nan|inf(?:inity)?)", re.IGNORECASE
)
_MIN_ROWS_FOR_LENGTHS = 100
"""Number of rows of different lengths above which a last row shorter than all others is not taken for chance."""
_PART = r"(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[EeDd][+-]?[0-9]{1,4})?"
_COMPLEX = re.compile(
    rf"(?P<opened>\()?\s*(?:(?P<real>[+-]?{_PART})\s*(?=[+-]))?(?P<imaginary>\+?-?\s*[+-]?{_PART})\s*\*?\s*[ij]\s*(?P<closed>\))?",
    re.IGNORECASE,
)
"""A complex number as MATLAB, NumPy and spreadsheets write it."""
_LONGEST_NUMBER = 200
_NUMBER_WITH = {sign: re.compile(rf"[0-9.,]*{re.escape(sign)}[0-9.,]*") for sign in ",."}
"""Digits with a decimal sign, for messages."""
_BLOCK = 4096
"""Lines that are split at a time, and between two checks of the time."""


def decode(data: bytes) -> str:
    """Decode a text as UTF-16 if it begins with a byte order mark, else as UTF-8, else as Latin-1."""
    check_count(len(data), MAX_TEXT, "bytes")
    check_count(max(data.count(b"\n"), data.count(b"\r")), MAX_LINES, "lines")
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


def truncation_notes(text: str, rows: Sequence[tuple[int, str]], declared: int | None = None) -> list[str]:
    """Warn of a text that may be truncated in its last row, and return the note.

    A truncated number may still be a number, for example without its exponent. A file of this library declares its
    number of rows: another number, or an end within the last row, raises.
    """
    if not rows:
        return []
    line, last = rows[-1]
    if declared is not None and len(rows) != declared:
        raise FileFormatError(
            f"the file declares {declared} rows of numbers and has {len(rows)}: it was truncated or changed", line=line
        )
    trailing = text[len(text.rstrip(" \t\r\n\f\x1a")) :]  # a Ctrl-Z of DOS programs may follow the last line
    ends_with_line = "\n" in trailing or "\r" in trailing
    if declared is not None:
        if not ends_with_line:
            raise FileFormatError(
                "the last line has no line ending: the file was truncated, and its last number may be wrong; if the "
                "number is right, add a line ending",
                line=line,
            )
        return []
    lengths = {len(row.rstrip()) for _, row in rows[:-1]}
    lengths_are_informative = len(rows) > _MIN_ROWS_FOR_LENGTHS or (len(rows) > 2 and len(lengths) == 1)
    note = ""
    if not ends_with_line:
        note = f"the last line, {line}, has no line ending: if the file is truncated, its last number is wrong"
    elif lengths_are_informative and len(last.rstrip()) < min(lengths):
        note = f"the last line, {line}, is shorter than all others: if it is truncated, its last number is wrong"
    if note:
        warn_user(note)
    return [note] if note else []


def numbered_lines(data: bytes) -> tuple[str, list[tuple[int, str]]]:
    """Return a text, and its lines that are not blank with their numbers from 1."""
    text = decode(data)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    numbered = []
    for start in range(0, len(lines), _BLOCK):
        check_time()
        numbered += [
            (number, line) for number, line in enumerate(lines[start : start + _BLOCK], start + 1) if line.strip()
        ]
    return text, numbered


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
    match = _NUMBER.fullmatch(plain) if len(plain) <= _LONGEST_NUMBER else None
    if not match:
        raise FileFormatError(f"{name} is {excerpt(field.strip()) if quote else 'text'}, expected a number", line=line)
    mantissa, exponent = match.groups()
    return float(plain) if mantissa is None else float(f"{mantissa}E{exponent or 0}")


def complex_parts(field: str) -> tuple[str, str] | None:
    """Return the texts of the real and the imaginary part of a complex number, None for other texts.

    Examples
    --------
    >>> from receptance.io.text import complex_parts
    >>> complex_parts("1.5-0.5i"), complex_parts("(1e-3+-2j)"), complex_parts("0,5 j"), complex_parts("1.5")
    (('1.5', '-0.5'), ('1e-3', '-2'), ('0', '0,5'), None)
    """
    if not field.rstrip(" )").endswith(("i", "j", "I", "J")) or len(field) > _LONGEST_NUMBER:
        return None
    match = _COMPLEX.fullmatch(field.strip())
    if not match or bool(match["opened"]) != bool(match["closed"]):
        return None
    return match["real"] or "0", "".join(match["imaginary"].split()).replace("+-", "-")


def parse_lines(
    lines: Sequence[tuple[int, str]],
    split: Callable[[int, str], list[str]],
    names: Sequence[str],
    *,
    decimal_comma: bool = False,
    quote_first_row: bool = False,
) -> NDArray[np.float64]:
    """Return the numbers `(lines, names)` in numbered lines, split into fields, or raise with the line.

    By default errors in the first row do not quote it, because the file is not known to be a measurement yet.
    """
    check_count(len(lines) * len(names), MAX_NUMBERS, "numbers")
    if decimal_comma:
        _check_decimal_signs(lines)
    blocks = [np.empty((0, len(names)))]
    for start in range(0, len(lines), _BLOCK):
        check_time()
        block = [(line, split(line, text)) for line, text in lines[start : start + _BLOCK]]
        blocks.append(_parse_block(block, names, decimal_comma=decimal_comma, quote_first=quote_first_row or start > 0))
    return np.concatenate(blocks)


def _parse_block(
    rows: Sequence[tuple[int, list[str]]], names: Sequence[str], *, decimal_comma: bool, quote_first: bool
) -> NDArray[np.float64]:
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
        for column, (field, name) in enumerate(zip(fields, names, strict=True)):
            quote = quote_first or index > 0
            values[index, column] = number(field, line, name, decimal_comma=decimal_comma, quote=quote)
    return values


def _check_decimal_signs(lines: Sequence[tuple[int, str]]) -> None:
    """Raise if some numbers have a comma and others a point: one of them separates thousands."""
    first: dict[str, tuple[int, str]] = {}
    for sign in ",.":
        for line, text in lines:
            if sign in text:
                first[sign] = line, _NUMBER_WITH[sign].search(text)[0]  # type: ignore[index]
                break
    if len(first) == 2:
        (comma_line, comma), (point_line, point) = first[","], first["."]
        raise FileFormatError(
            f"{comma!r} has a comma, and {point!r} in line {point_line} a point: one of them is the decimal sign and "
            "the other separates thousands; export the numbers without separators of thousands",
            line=comma_line,
        )
