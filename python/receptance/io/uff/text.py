"""Lines and numbers of universal files, with the place of whatever is wrong.

pyuff was meant to do the reading. On the files of `tests/validation/test_measured_files.py` and on made-up ones pyuff
2.5.8 takes the abscissa of uneven double-precision binaries for doubles (the standard says single precision), does not
look at the declared number of values (a file cut off after 42 of 2,508,876 values reads as whole, the padding of the
last line as two more lines of an FRF), gives up on D exponents, sets header fields that it cannot read to zero, and
names neither line nor byte. To keep it from that, every header field, number and length has to be checked beforehand;
what is left to do then is less than the wrapping would be. It is what the tests compare with, in both directions.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from receptance.io.errors import FileFormatError
from receptance.io.limits import check_time

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Cursor", "Line", "columns_of_text", "integer", "is_delimiter", "real", "text_values"]

_INTEGER = re.compile(rb"[+-]?[0-9]{1,18}")
_REAL = re.compile(rb"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[EeDd]?([+-]?[0-9]{1,4}))?")
_DOUBLE_EXPONENT = bytes.maketrans(b"Dd", b"EE")
_IN_NUMBERS = b"0123456789+-.EeDd "


@dataclass(frozen=True)
class Line:
    """A line of a file, without its end."""

    content: bytes
    number: int | None
    byte: int

    def error(self, problem: str) -> FileFormatError:
        """Return an error that names this line, or its first byte where lines do not count."""
        return FileFormatError(problem, line=self.number, byte=self.byte if self.number is None else None)

    def shown(self) -> str:
        """Return the line as it can be shown."""
        text = self.content[:60].decode("latin-1")
        return repr(text + ("..." if len(self.content) > 60 else ""))


class Cursor:
    """A place in a file, moved on line by line."""

    def __init__(self, data: bytes) -> None:
        self.data, self.byte = data, 0
        self.number: int | None = 1

    def peek(self) -> Line | None:
        """Return the next line without moving, or None at the end."""
        if self.byte >= len(self.data):
            return None
        end = self.data.find(b"\n", self.byte)
        content = self.data[self.byte : len(self.data) if end < 0 else end]
        return Line(content.removesuffix(b"\r"), self.number, self.byte)

    def next(self) -> Line | None:
        """Return the next line and move past it, or None at the end."""
        check_time()
        line = self.peek()
        if line is not None:
            end = self.data.find(b"\n", self.byte)
            self.byte = len(self.data) if end < 0 else end + 1
            if self.number is not None:
                self.number += 1
        return line

    def expect(self, what: str) -> Line:
        """Return the next line, or raise where the file ends before it."""
        line = self.next()
        if line is None:
            self.fail(f"the file ends here, expected {what}")
        return line

    def jump(self, byte: int) -> None:
        """Go to a byte behind binary data, after which lines have no numbers."""
        self.byte, self.number = byte, None

    def fail(self, problem: str) -> NoReturn:
        """Raise an error at this place."""
        raise FileFormatError(problem, line=self.number, byte=self.byte if self.number is None else None)


def is_delimiter(line: bytes) -> bool:
    """Return whether a line is the -1 in columns 5 and 6 that opens and closes data sets."""
    return line[:6] == b"    -1" and not line[6:].strip()


def columns_of_text(content: bytes) -> str:
    """Return a line in which a character is a column.

    Writers that know UTF-8 count characters when they fill columns, the others write one byte per character.
    """
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def integer(line: Line, start: int, width: int, what: str) -> int:
    """Return the whole number in some columns; blanks are zero, as in Fortran."""
    field = line.content[start : start + width].strip()
    if not field:
        return 0
    if not _INTEGER.fullmatch(field):
        raise line.error(
            f"{what} is {field.decode('latin-1')!r}, expected a whole number in columns {start + 1} to {start + width}"
        )
    return int(field)


def real(line: Line, start: int, width: int, what: str) -> float:
    """Return the number in some columns; blanks are zero, as in Fortran."""
    field = line.content[start : start + width].strip()
    return _number(line, field, what, start, width) if field else 0.0


def _number(line: Line, field: bytes, what: str, start: int, width: int) -> float:
    match = _REAL.fullmatch(field)
    value = float(b"E".join(part for part in match.groups() if part)) if match else np.nan
    if not np.isfinite(value):
        raise line.error(
            f"{what} is {field.decode('latin-1')!r}, expected a finite number in columns {start + 1} to {start + width}"
        )
    return value


def text_values(cursor: Cursor, widths: tuple[int, ...], count: int, declared: Line) -> tuple[NDArray[np.float64], str]:
    """Return `count` numbers from lines of fixed columns, and a note where the columns were others.

    How many there are is known, so no value is taken for the end of the data set. The cursor is left on the line after
    the data.
    """
    start, number = cursor.byte, cursor.number
    values = _full_lines(cursor, widths, count)
    if values is not None:
        return values, ""
    try:
        return _line_by_line(cursor, widths, count, declared), ""
    except FileFormatError as problem:
        cursor.byte, cursor.number = start, number
        free = _separated(cursor, count)
        if free is None:
            raise problem from None
        return free, "the numbers are not in the columns of the format; they were taken as separated by blanks"


def _full_lines(cursor: Cursor, widths: tuple[int, ...], count: int) -> NDArray[np.float64] | None:
    """Read all lines at once where nothing is unusual; None where something is."""
    rows = -(-count // len(widths))
    lines: list[bytes] = []
    byte, data, width = cursor.byte, cursor.data, sum(widths)
    if rows * len(widths) > len(data) - byte:
        return None
    for _ in range(rows):
        end = data.find(b"\n", byte)
        if end < 0:
            return None
        content = data[byte:end].rstrip()
        if len(content) > width or is_delimiter(content):
            return None
        lines.append(content.ljust(width))
        byte = end + 1
    table = b"".join(lines)
    if table.translate(None, _IN_NUMBERS):
        return None
    table = table.translate(_DOUBLE_EXPONENT)
    fields = np.frombuffer(table, dtype=[(f"c{k}", f"S{w}") for k, w in enumerate(widths)])
    values = np.empty((rows, len(widths)))
    last = count - (rows - 1) * len(widths)
    try:
        for k in range(len(widths)):
            filled = rows if k < last else rows - 1
            values[:filled, k] = fields[f"c{k}"][:filled].astype(np.float64)
    except ValueError:
        return None
    flat = values.ravel()[:count]
    if not np.all(np.isfinite(flat)):
        return None
    cursor.byte = byte
    if cursor.number is not None:
        cursor.number += rows
    return flat


def _line_by_line(cursor: Cursor, widths: tuple[int, ...], count: int, declared: Line) -> NDArray[np.float64]:
    values: list[float] = []
    promised = f"{count} numbers that the record in line {declared.number} asks for"
    while len(values) < count:
        line = cursor.next()
        if line is None:
            cursor.fail(f"the file ends after {len(values)} of the {promised}")
        if is_delimiter(line.content):
            raise line.error(f"the data set ends after {len(values)} of the {promised}")
        content, start = line.content.rstrip(), 0
        for width in widths:
            if start >= len(content) or len(values) == count:
                break
            field = content[start : start + width].strip()
            values.append(_number(line, field, f"number {len(values) + 1} of {count}", start, width))
            start += width
    return np.array(values)


def _separated(cursor: Cursor, count: int) -> NDArray[np.float64] | None:
    """Read numbers with blanks between them, as many in every line but the last; None where that does not fit."""
    values: list[float] = []
    in_line = 0
    while len(values) < count:
        line = cursor.next()
        if line is None or is_delimiter(line.content):
            return None
        fields = line.content.split()
        in_line = in_line or len(fields)
        if not fields or len(fields) != min(in_line, count - len(values)):
            return None
        try:
            values.extend(_number(line, field, "", 0, 0) for field in fields)
        except FileFormatError:
            return None
    return np.array(values)
