"""Data sets of a universal file: lines, fixed columns and numbers, and the contents of data set 58 (a function).

pyuff 2.5.8 is not used for reading, because on the files of `tests/validation/test_measured_files.py` and on synthetic
ones it reads the abscissa of uneven double-precision binaries as doubles (the standard has single precision), ignores
the declared number of values (a file truncated after 42 of 2,508,876 values is read without an error, and the padding
of the last line as two more lines of an FRF), fails on D exponents, sets unreadable header fields to zero, and names
neither line nor byte in errors. Checking all of this beforehand takes more code than reading. The tests compare with
pyuff in both directions.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.errors import warn_user
from receptance.io.build import complex_values
from receptance.io.errors import FileFormatError, check_time, error_location
from receptance.io.text import excerpt
from receptance.units import Form

_INTEGER = re.compile(rb"[+-]?[0-9]{1,18}")
_REAL = re.compile(rb"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(?:[EeDd]?([+-]?[0-9]{1,4}))?")
_COMPLETE_EXPONENT = re.compile(rb"[EeDd]?[+-][0-9]{2,4}|[EeDd][0-9]{2,4}")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_DOUBLE_EXPONENT = bytes.maketrans(b"Dd", b"EE")
_LEAST_WITH_EXPONENT = 3
"""Fewest numbers with an exponent that show that all have one."""
_IN_NUMBERS = b"0123456789+-.EeDd "

_MOST_DECADES, _MARGIN, _LEAST_NUMBERS = 16.0, 4.0, 8
"""Numbers of a measurement are within 16 decades of 1; half of those in the wrong byte order are not within 20."""

MARK = "receptance "
"""Beginning of the ID lines in which this library stores what the format has no place for.

ID line 4 holds the coordinates, `receptance ["tool",0.0,"y"] ["tool",0.05,"y"]` (response, excitation), ID line 5 the
other values, `receptance {"averages":10,"decay_rate":20.0}`: averages, decay rate, sample rate, first frequency line
and increment with all digits ("lines"), whether the points are only numbered ("labels":0), and that a coherence belongs
to no FRF of the file ("separate":1). Other programs show these lines as text.
"""
SEPARATE = "separate"
MOTIONS: dict[int, Form] = {8: "receptance", 11: "mobility", 12: "accelerance"}
"""Form of an FRF by the specific data type of its numerator."""
LOADS = (9, 13)
"""Specific data types of loads: reaction force and excitation force."""
QUANTITIES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}


@dataclass(frozen=True)
class Line:
    """A line of a file, without its line ending; lines behind binary data have no number."""

    content: bytes
    number: int | None
    byte: int

    @property
    def location(self) -> dict[str, Any]:
        """Line number, or the first byte without a number, as arguments of `FileFormatError`."""
        if self.number is not None:
            return {"line": self.number}
        return {"byte": self.byte} if self.byte >= 0 else {}

    def error(self, problem: str) -> FileFormatError:
        """Return an error at this line."""
        return FileFormatError(problem, **self.location)

    def error_location(self) -> AbstractContextManager[None]:
        """Return a context that adds this line to errors without a location."""
        return error_location(**self.location)

    def excerpt(self) -> str:
        """Return the beginning of the line for a message."""
        return excerpt(self.content.decode("latin-1"))


class Cursor:
    """Position in a file, advanced line by line."""

    def __init__(self, data: bytes) -> None:
        self.data, self.byte = data, len(_BYTE_ORDER_MARK) if data.startswith(_BYTE_ORDER_MARK) else 0
        self.number: int | None = 1

    def next(self) -> Line | None:
        """Return the next line and advance past it, or None at the end."""
        check_time()
        if self.byte >= len(self.data):
            return None
        end = self.data.find(b"\n", self.byte)
        end = len(self.data) if end < 0 else end
        line = Line(self.data[self.byte : end].removesuffix(b"\r"), self.number, self.byte)
        self.byte = min(end + 1, len(self.data))
        if self.number is not None:
            self.number += 1
        return line

    def expect(self, name: str) -> Line:
        """Return the next line, or raise at the end of the file."""
        line = self.next()
        if line is None:
            raise self.error(f"the file ends here, expected {name}")
        return line

    def jump(self, byte: int) -> None:
        """Advance to a byte behind binary data, after which lines have no numbers."""
        self.byte, self.number = byte, None

    def error(self, problem: str) -> FileFormatError:
        """Return an error at this position."""
        return Line(b"", self.number, self.byte).error(problem)


def is_delimiter(line: bytes) -> bool:
    """Return whether a line is the -1 in columns 5 and 6 that delimits data sets."""
    return line[:6] == b"    -1" and not line[6:].strip()


def columns_of_text(content: bytes) -> str:
    """Return a line as text with one character per column.

    Writers with UTF-8 count characters to fill columns; others write one byte per character.
    """
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def integer(line: Line, start: int, width: int, name: str) -> int:
    """Return the whole number in a range of columns; blanks are zero, as in Fortran."""
    field = line.content[start : start + width].strip()
    if not field:
        return 0
    if not _INTEGER.fullmatch(field):
        raise line.error(
            f"{name} is {field.decode('latin-1')!r}, expected a whole number in columns {start + 1} to {start + width}"
        )
    return int(field)


def real(line: Line, start: int, width: int, name: str) -> float:
    """Return the number in a range of columns; blanks are zero, as in Fortran."""
    field = line.content[start : start + width].strip()
    value = _number(line, field, name, start, width) if field else 0.0
    if value and len(line.content.rstrip()) < start + width and not _COMPLETE_EXPONENT.search(field[1:]):
        raise line.error(
            f"{name} is {field.decode('latin-1')!r}, and the line ends before column {start + width}: its last "
            "characters are missing; copy or export the file again"
        )
    return value


def _number(line: Line, field: bytes, name: str, start: int, width: int) -> float:
    match = _REAL.fullmatch(field)
    value = float(b"E".join(part for part in match.groups() if part)) if match else np.nan
    if not np.isfinite(value):
        raise line.error(
            f"{name} is {field.decode('latin-1')!r}, expected a finite number in columns {start + 1} to {start + width}"
        )
    return value


def text_values(cursor: Cursor, widths: tuple[int, ...], count: int, declared: Line) -> tuple[NDArray[np.float64], str]:
    """Return `count` numbers from lines of fixed columns, and a note if other columns were used.

    Because their number is known, a value of -1 is not taken for the end of the data set. The cursor advances to the
    line after the data.
    """
    start, number = cursor.byte, cursor.number
    note = ""
    values = _full_lines(cursor, widths, count)
    if values is None:
        try:
            values = _line_by_line(cursor, widths, count, declared)
        except FileFormatError as problem:
            cursor.byte, cursor.number = start, number
            widths = ()
            try:
                values = _line_by_line(cursor, widths, count, declared)
            except FileFormatError:
                raise problem from None
            note = "the numbers are not in the columns of the format; they were read as separated by blanks"
    _check_ends(cursor.data[start : cursor.byte], widths, Line(b"", number, start))
    return values, note


def _check_ends(text: bytes, widths: tuple[int, ...], first: Line) -> None:
    """Raise if a line lost its last characters: what is left of a number is a number, but without its exponent.

    Numbers end with their columns, and all have exponents or none; other writers do neither, but all their lines are
    alike.
    """
    lines = [line.rstrip() for line in text.split(b"\n")]
    ends = tuple(accumulate(widths))
    short = [index for index, line in enumerate(lines) if line and len(line) not in ends]
    if not short:
        return
    filled = [line[end - 1] not in b" \t" for line in lines for end in ends if end <= len(line)]
    if filled and 2 * sum(filled) > len(filled) + len(short):
        cut, others = short[0], "end with their columns"
    else:
        words = [line.split() for line in lines]
        cut = next((index for index in short if not _COMPLETE_EXPONENT.search(words[index][-1][1:])), -1)
        inner = [word for line in words for word in line[:-1]]
        if cut < 0 or len(inner) < _LEAST_WITH_EXPONENT or not all(_COMPLETE_EXPONENT.search(w[1:]) for w in inner):
            return
        others = "have an exponent of two digits"
    line = Line(lines[cut], None if first.number is None else first.number + cut, first.byte + text.find(lines[cut]))
    raise line.error(
        f"the line ends with {line.content.split()[-1].decode('latin-1')!r}, but the other numbers {others}: its last "
        "characters are missing; copy or export the file again"
    )


def _full_lines(cursor: Cursor, widths: tuple[int, ...], count: int) -> NDArray[np.float64] | None:
    """Read all lines at once; None if a line is not in the usual form."""
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


def _line_by_line(cursor: Cursor, widths: Sequence[int], count: int, declared: Line) -> NDArray[np.float64]:
    """Read numbers in columns, or without widths numbers separated by blanks.

    The latter are equally many in all lines but the last.
    """
    values: list[float] = []
    per_line = 0
    expected = f"{count} numbers declared in line {declared.number}"
    while len(values) < count:
        line = cursor.next()
        if line is None:
            raise cursor.error(f"the file ends after {len(values)} of the {expected}")
        if is_delimiter(line.content):
            raise line.error(f"the data set ends after {len(values)} of the {expected}")
        content = line.content.rstrip()
        if widths:
            starts = accumulate(widths[:-1], initial=0)
            columns = [(start, width) for start, width in zip(starts, widths, strict=True) if start < len(content)]
            fields = [(content[start : start + width].strip(), start, width) for start, width in columns]
        else:
            fields = [(field, 0, 0) for field in content.split()]
            per_line = per_line or len(fields)
            if not fields or len(fields) != min(per_line, count - len(values)):
                raise line.error(f"there are {len(fields)} numbers, expected {per_line}")
        for field, start, width in fields[: count - len(values)]:
            values.append(_number(line, field, f"number {len(values) + 1} of {count}", start, width))
    return np.array(values)


@dataclass(frozen=True)
class Point:
    """A degree of freedom: entity name, node and direction (+-1 to 3 translation, +-4 to 6 rotation, 0 scalar)."""

    name: str
    node: int
    direction: int

    @property
    def label(self) -> str:
        """Label such as "22:+3", with an entity name "tool 22:+3"; empty without a node and a name."""
        number = f"{self.node}:{self.direction:+d}" if self.direction else f"{self.node}" if self.node else ""
        return f"{self.name} {number}".strip()


NO_POINT = Point("", 0, 0)
"""A point that the file does not state."""


@dataclass(frozen=True)
class Axis:
    """Kind, label and unit of an axis."""

    kind: int
    """Specific data type: 8 displacement, 11 velocity, 12 acceleration, 13 force, 17 time, 18 frequency, 0 unknown."""
    label: str
    unit: str


@dataclass(frozen=True)
class UnitSystem:
    """Data set 164: numbers divided by these factors are in SI."""

    length: float
    force: float
    description: str


@dataclass(frozen=True, eq=False)
class Function:
    """Contents of one data set 58, without conversion."""

    kind: int
    """Function type: 1 time response, 4 FRF, 6 coherence, ..."""
    response: Point
    reference: Point
    abscissa: NDArray[np.float64]
    ordinate: NDArray[Any]
    """Real or complex."""
    axes: tuple[Axis, Axis, Axis]
    """Abscissa, ordinate numerator, ordinate denominator."""
    texts: Sequence[str]
    """The five ID lines; empty for NONE."""
    line: Line = Line(b"", None, -1)
    """First line in the file; without a place if it is not in a universal file."""
    binary: bool = False
    step: float | None = None
    """Abscissa increment in the file; None for uneven spacing."""
    units: UnitSystem | None = None
    """The preceding data set 164."""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Other:
    """A data set of another kind, or a line of text between data sets."""

    line: Line
    kind: int | None
    """None for text."""


@dataclass(frozen=True)
class _Form:
    """Record 7, and for binary data the fields of the identifier line."""

    line: Line
    complex_: bool
    double: bool
    even: bool
    count: int
    first: float
    step: float
    order: str = ""
    declared_bytes: int = 0

    @property
    def numbers_per_line(self) -> int:
        """Numbers per abscissa: those of the ordinate, and of an uneven abscissa."""
        return (2 if self.complex_ else 1) + (0 if self.even else 1)

    def describe(self) -> str:
        """Return the layout as text."""
        return (
            f"{self.count} {'complex' if self.complex_ else 'real'} {'double' if self.double else 'single'}-precision "
            f"values with {'even' if self.even else 'uneven'} spacing"
        )


def is_uff(data: bytes) -> bool:
    """Return whether the first line that is not blank begins a data set."""
    return re.match(rb"(?:\xef\xbb\xbf)?(?:[ \t]*\r?\n)*    -1[ \t]*\r?\n", data[:2000]) is not None


def data_sets(data: bytes) -> Iterator[Function | Other]:
    """Yield the data sets of a universal file in order; errors have the line, or the byte behind binary data."""
    cursor = Cursor(data)
    units: UnitSystem | None = None
    is_universal = False
    while (opening := cursor.next()) is not None:
        if not opening.content.strip(b" \t\r\n\x1a\x00"):
            continue
        if is_universal and _is_text(opening.content):
            yield Other(opening, None)
            continue
        if not is_delimiter(opening.content):
            # Text before the first data set is not quoted, because the file may be anything.
            text = opening.excerpt() if is_universal else "text"
            raise opening.error(f"found {text}, expected a line with -1 in columns 5 and 6 before a data set")
        identity = cursor.expect("the number of a data set")
        if is_delimiter(identity.content):
            raise identity.error("found -1, expected the number of a data set: a -1 is missing or repeated before")
        kind = integer(identity, 0, 6, "the number of the data set")
        is_universal = True
        if kind == 58:
            yield _function(cursor, identity, units)
        elif kind == 164:
            units = _unit_system(cursor)
            yield Other(identity, kind)
        else:
            while (line := cursor.next()) is not None and not is_delimiter(line.content):
                pass
            yield Other(identity, kind)


def _is_text(content: bytes) -> bool:
    """Return whether a line is a remark, and neither numbers nor a part of a data set without its opening -1."""
    return not all(_REAL.fullmatch(word) for word in content.split()) and content[:6].strip() not in (b"58", b"58b")


def _unit_system(cursor: Cursor) -> UnitSystem:
    first = cursor.expect("the code of the units")
    description = columns_of_text(first.content)[10:30].strip()
    code = integer(first, 0, 10, "the code of the units")
    factors: list[float] = []
    line = first
    while (line := cursor.expect("the -1 that closes data set 164")) and not is_delimiter(line.content):
        for start in range(0, len(line.content.rstrip()), 25):
            factors.append(real(line, start, 25, f"factor {len(factors) + 1} of the units"))
    if len(factors) < 2:
        raise line.error(f"data set 164 ends after {len(factors)} factors, expected those of length and force")
    length, force = factors[:2]
    if length <= 0.0 or force <= 0.0:
        raise first.error(f"the factors of length and force are {length:g} and {force:g}, expected more than zero")
    return UnitSystem(length, force, description or f"units code {code}")


def _function(cursor: Cursor, identity: Line, units: UnitSystem | None) -> Function:
    records = [cursor.expect(f"record {k} of data set 58") for k in range(1, 12)]
    for k, record in enumerate(records, 1):
        if is_delimiter(record.content):
            raise record.error(f"the data set ends here, expected record {k} of the 11 before the data")
    binary = identity.content[6:7] in (b"b", b"B")
    if identity.content[6:].strip() and not binary:
        raise identity.error(f"found {identity.excerpt()}, expected 58, or 58b with the layout of binary data")
    points = records[5]
    kind = integer(points, 0, 5, "the function type")
    response = _point(points, 30, "response")
    reference = _point(points, 55, "reference")
    form = _form(records[6], identity, binary=binary)
    axes = tuple(_axis(records[7 + k], name) for k, name in enumerate(("abscissa", "ordinate", "denominator")))
    notes: list[str] = []
    if binary:
        abscissa, ordinate = _binary_body(cursor, form, notes)
    else:
        abscissa, ordinate = _text_body(cursor, form, notes)
    closing = cursor.next()
    if closing is None:
        notes.append("the file ends without the -1 that closes the data set")
        warn_user(f"{notes[-1]}: its last number may be cut")
    elif not is_delimiter(closing.content):
        raise closing.error(
            f"found {closing.excerpt()} after {form.describe()}, expected the -1 that closes the data set"
        )
    texts = tuple(columns_of_text(record.content).strip() for record in records[:5])
    return Function(
        kind=kind,
        response=response,
        reference=reference,
        abscissa=abscissa,
        ordinate=ordinate,
        axes=(axes[0], axes[1], axes[2]),
        texts=tuple("" if text == "NONE" else text for text in texts),
        line=identity,
        binary=binary,
        step=form.step if form.even else None,
        units=units,
        notes=tuple(notes),
    )


def _point(line: Line, start: int, end: str) -> Point:
    # A multi-byte character in an entity name shifts the bytes of the following numbers.
    text = columns_of_text(line.content)
    shifted = Line(text.encode("latin-1", "replace"), line.number, line.byte)
    name = text[start + 1 : start + 11].strip()
    node = integer(shifted, start + 11, 10, f"the {end}'s node")
    direction = integer(shifted, start + 21, 4, f"the {end}'s direction")
    if abs(direction) > 6:
        raise line.error(f"the {end}'s direction is {direction}, expected -6 to 6")
    return Point("" if name == "NONE" else name, node, direction)


def _form(line: Line, identity: Line, *, binary: bool) -> _Form:
    ordinate = integer(line, 0, 10, "the ordinate data type")
    if ordinate not in (2, 4, 5, 6):
        raise line.error(
            f"the ordinate data type is {ordinate}, expected 2 or 4 (real, single or double) or 5 or 6 (complex)"
        )
    count = integer(line, 10, 10, "the number of values")
    if count < 1:
        raise line.error(f"the number of values is {count}, expected one or more")
    spacing = integer(line, 20, 10, "the abscissa spacing")
    if spacing not in (0, 1):
        raise line.error(f"the abscissa spacing is {spacing}, expected 0 (uneven) or 1 (even)")
    first, step = real(line, 30, 13, "the abscissa minimum"), real(line, 43, 13, "the abscissa increment")
    if spacing and step <= 0.0 and count > 1:
        raise line.error(f"the abscissa increment is {step:g}, expected more than zero with even spacing")
    order, size = _binary_identity(identity) if binary else ("", 0)
    return _Form(line, ordinate in (5, 6), ordinate in (4, 6), bool(spacing), count, first, step, order, size)


def _binary_identity(line: Line) -> tuple[str, int]:
    order = integer(line, 7, 6, "the byte order")
    if order not in (1, 2):
        raise line.error(f"the byte order is {order}, expected 1 (little endian) or 2 (big endian)")
    floats = integer(line, 13, 6, "the floating-point format")
    if floats != 2:
        format_name = {1: "DEC VMS", 3: "IBM 370"}.get(floats, "unknown")
        raise line.error(f"the floating-point format is {floats} ({format_name}); only 2 (IEEE 754) can be read")
    lines = integer(line, 19, 12, "the number of header lines")
    if lines != 11:
        raise line.error(f"the number of header lines is {lines}, expected 11")
    return ("<" if order == 1 else ">"), integer(line, 31, 12, "the number of binary bytes")


def _axis(line: Line, name: str) -> Axis:
    kind = integer(line, 0, 10, f"the {name}'s specific data type")
    for start, quantity in ((10, "length"), (15, "force"), (20, "temperature")):
        integer(line, start, 5, f"the {name}'s {quantity} exponent")
    text = columns_of_text(line.content)
    if text[25:26].strip() or text[46:47].strip():
        # Columns are counted in bytes here: then the blanks between the labels are in their columns.
        text = line.content.decode("latin-1")
    label, unit = text[26:46].strip(), text[47:].strip()
    with contextlib.suppress(UnicodeError):
        label, unit = (part.encode("latin-1").decode("utf-8") for part in (label, unit))
    return Axis(kind, "" if label == "NONE" else label, "" if unit == "NONE" else unit)


def _text_body(cursor: Cursor, form: _Form, notes: list[str]) -> tuple[NDArray[np.float64], NDArray[Any]]:
    if not form.double:
        widths: tuple[int, ...] = (13,) * 6
    elif form.even:
        widths = (20,) * 4
    else:
        widths = (13, 20, 20) if form.complex_ else (13, 20, 13, 20)
    table, note = text_values(cursor, widths, form.count * form.numbers_per_line, form.line)
    if note:
        notes.append(note)
    table = table.reshape(form.count, form.numbers_per_line)
    first = 0 if form.even else 1
    ordinate: NDArray[Any] = table[:, first].copy()
    if form.complex_:
        ordinate = complex_values(ordinate, table[:, first + 1])
    return _abscissa(form, table[:, 0]), ordinate


def _binary_body(cursor: Cursor, form: _Form, notes: list[str]) -> tuple[NDArray[np.float64], NDArray[Any]]:
    start = cursor.byte
    ordinate = f"{form.order}{'f8' if form.double else 'f4'}"
    fields: list[tuple[str, str]] = [("re", ordinate)] + ([("im", ordinate)] if form.complex_ else [])
    layouts = [np.dtype(fields)]
    if not form.even:
        # By the standard the abscissa always has single precision; pyuff writes that of the ordinate.
        layouts = [np.dtype([("x", f"{form.order}f4"), *fields])]
        if form.double:
            layouts.append(np.dtype([("x", f"{form.order}f8"), *fields]))
    fitting = [layout for layout in layouts if _closed(cursor.data, start + form.count * layout.itemsize)]
    fitting.sort(key=lambda layout: layout.itemsize * form.count != form.declared_bytes)
    if not fitting:
        expected = " or ".join(str(form.count * layout.itemsize) for layout in layouts)
        raise FileFormatError(
            f"binary data begin here; {form.describe()} take {expected} bytes, but no -1 that closes the data set "
            f"follows ({len(cursor.data) - start} bytes are left, {form.declared_bytes} were declared)",
            byte=start,
        )
    size = form.count * fitting[0].itemsize
    if size != form.declared_bytes:
        notes.append(f"{form.declared_bytes} binary bytes are declared, {form.describe()} take {size}, which were read")
    table = _in_plausible_order(np.frombuffer(cursor.data, dtype=fitting[0], count=form.count, offset=start), notes)
    real_part = table["re"].astype(np.float64)
    values: NDArray[Any] = complex_values(real_part, table["im"]) if form.complex_ else real_part
    abscissa = _abscissa(form, real_part if form.even else table["x"].astype(np.float64))
    bad = np.flatnonzero(~(np.isfinite(values) & np.isfinite(abscissa)))
    if bad.size:
        raise FileFormatError(
            f"value {bad[0] + 1} of {form.count} is {values[bad[0]]} at {abscissa[bad[0]]}, expected finite numbers",
            byte=start + int(bad[0]) * fitting[0].itemsize,
        )
    cursor.jump(start + size)
    while cursor.data[cursor.byte : cursor.byte + 1] in (b"\r", b"\n"):
        cursor.jump(cursor.byte + 1)
    return abscissa, values


def _in_plausible_order(table: NDArray[Any], notes: list[str]) -> NDArray[Any]:
    """Return the table in the stated byte order, or in the other one if only that gives numbers of a measurement."""
    stated, turned = (_decades(one) for one in (table, table.view(table.dtype.newbyteorder())))
    if stated <= _MOST_DECADES + _MARGIN or turned > _MOST_DECADES:
        return table
    note = (
        f"a tenth of the numbers is more than {min(stated, 999.0):.0f} decades from 1 in the byte order that the "
        f"header states, and {turned:.0f} in the other one, in which they were read"
    )
    warn_user(note)
    notes.append(note)
    return table.view(table.dtype.newbyteorder())


def _decades(table: NDArray[Any]) -> float:
    """Return how many decades the largest tenth of the ordinates is from 1, at least; 0 for few numbers."""
    with np.errstate(all="ignore"):
        parts = [table[name].astype(np.float64) for name in table.dtype.names or () if name != "x"]
        numbers = np.concatenate(parts)
        decades = np.abs(np.log10(np.abs(numbers[numbers != 0.0])))
    if decades.size < _LEAST_NUMBERS:
        return 0.0
    return float(np.quantile(np.where(np.isfinite(decades), decades, np.inf), 0.9, method="lower"))


def _closed(data: bytes, end: int) -> bool:
    """Return whether a data set may end at a byte."""
    return end <= len(data) and re.match(rb"[\r\n]{0,2}(?:    -1[ ]*(?:[\r\n]|$)|$)", data[end : end + 100]) is not None


def _abscissa(form: _Form, stored: NDArray[np.float64]) -> NDArray[np.float64]:
    if not form.even:
        return stored.copy()
    return form.first + form.step * np.arange(form.count, dtype=np.float64)
