"""Data sets of a universal file: where each begins and ends, and what data set 58 (a function) declares and holds."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.io.build import joined
from receptance.io.errors import FileFormatError
from receptance.io.uff.text import Cursor, Line, columns_of_text, integer, is_delimiter, real, text_values

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Axis", "Function", "Other", "Point", "UnitSystem", "data_sets", "looks_like_uff"]


@dataclass(frozen=True)
class Point:
    """A degree of freedom: entity name, node and direction (+-1 to 3 translation, +-4 to 6 rotation, 0 scalar)."""

    name: str
    node: int
    direction: int

    @property
    def label(self) -> str:
        """Name for people: "22:+3", with an entity name "tool 22:+3", else empty."""
        where = f"{self.node}:{self.direction:+d}" if self.direction else f"{self.node}" if self.node else ""
        return f"{self.name} {where}".strip()


@dataclass(frozen=True)
class Axis:
    """What the file says about one axis."""

    kind: int
    """Specific data type: 8 displacement, 11 velocity, 12 acceleration, 13 force, 17 time, 18 frequency, 0 unknown."""
    label: str
    unit: str


@dataclass(frozen=True)
class UnitSystem:
    """Data set 164: divide numbers by these to be in SI."""

    length: float
    force: float
    description: str


@dataclass(frozen=True, eq=False)
class Function:
    """One data set 58 as it stands in the file: nothing is converted."""

    line: Line
    """Where it begins."""
    binary: bool
    kind: int
    """Function type: 1 time response, 4 FRF, 6 coherence, ..."""
    response: Point
    reference: Point
    abscissa: NDArray[np.float64]
    ordinate: NDArray[Any]
    """Real or complex."""
    step: float | None
    """Abscissa increment as it is declared; None where the spacing is uneven."""
    axes: tuple[Axis, Axis, Axis]
    """Abscissa, ordinate numerator, ordinate denominator."""
    texts: tuple[str, ...]
    """The five ID lines, empty where they say NONE."""
    units: UnitSystem | None
    """The data set 164 that comes before it in the file."""
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Other:
    """A data set of another kind."""

    line: Line
    kind: int


@dataclass(frozen=True)
class _Form:
    """Record 7, and for binary data what the identifier line says."""

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
        """Numbers per abscissa: the ordinate, and where it is uneven the abscissa."""
        return (2 if self.complex_ else 1) + (0 if self.even else 1)

    def named(self) -> str:
        """Return the layout in words."""
        return (
            f"{self.count} {'complex' if self.complex_ else 'real'} {'double' if self.double else 'single'}-precision "
            f"values with {'even' if self.even else 'uneven'} spacing"
        )


def looks_like_uff(data: bytes) -> bool:
    """Return whether the first line that is not blank opens a data set."""
    return re.match(rb"(?:[ \t]*\r?\n)*    -1[ \t]*\r?\n", data[:2000]) is not None


def data_sets(data: bytes) -> Iterator[Function | Other]:
    """Go through the data sets of a universal file in order.

    Raises
    ------
    FileFormatError
        Whatever cannot be read right, with its line, or its byte behind binary data.
    """
    cursor = Cursor(data)
    units: UnitSystem | None = None
    known = False
    while (opening := cursor.next()) is not None:
        if not opening.content.strip(b" \t\r\n\x1a\x00"):
            continue
        if not is_delimiter(opening.content):
            # Before the first data set the file may be anything, and what stands in it is not shown.
            found = opening.shown() if known else "text"
            raise opening.error(f"found {found}, expected a line with -1 in columns 5 and 6 before a data set")
        identity = cursor.expect("the number of a data set")
        if is_delimiter(identity.content):
            raise identity.error("found -1, expected the number of a data set: one -1 too many or too few before")
        kind = integer(identity, 0, 6, "the number of the data set")
        known = True
        if kind == 58:
            yield _function(cursor, identity, units)
        elif kind == 164:
            units = _unit_system(cursor)
            yield Other(identity, kind)
        else:
            while (line := cursor.next()) is not None and not is_delimiter(line.content):
                pass
            yield Other(identity, kind)


def _unit_system(cursor: Cursor) -> UnitSystem:
    first = cursor.expect("the code of the units")
    described = columns_of_text(first.content)[10:30].strip()
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
    return UnitSystem(length, force, described or f"units code {code}")


def _function(cursor: Cursor, identity: Line, units: UnitSystem | None) -> Function:
    records = [cursor.expect(f"record {k} of data set 58") for k in range(1, 12)]
    for k, record in enumerate(records, 1):
        if is_delimiter(record.content):
            raise record.error(f"the data set ends here, expected record {k} of the 11 before the data")
    binary = identity.content[6:7] in (b"b", b"B")
    if identity.content[6:].strip() and not binary:
        raise identity.error(f"found {identity.shown()}, expected 58, or 58b with what the binary data are")
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
    elif not is_delimiter(closing.content):
        raise closing.error(f"found {closing.shown()} after {form.named()}, expected the -1 that closes the data set")
    texts = tuple(columns_of_text(record.content).strip() for record in records[:5])
    return Function(
        line=identity,
        binary=binary,
        kind=kind,
        response=response,
        reference=reference,
        abscissa=abscissa,
        ordinate=ordinate,
        step=form.step if form.even else None,
        axes=(axes[0], axes[1], axes[2]),
        texts=tuple("" if text == "NONE" else text for text in texts),
        units=units,
        notes=tuple(notes),
    )


def _point(line: Line, start: int, what: str) -> Point:
    # An entity name may hold a multi-byte character; the numbers behind it then stand further on in bytes.
    text = columns_of_text(line.content)
    shifted = Line(text.encode("latin-1", "replace"), line.number, line.byte)
    name = text[start + 1 : start + 11].strip()
    node = integer(shifted, start + 11, 10, f"the {what}'s node")
    direction = integer(shifted, start + 21, 4, f"the {what}'s direction")
    if abs(direction) > 6:
        raise line.error(f"the {what}'s direction is {direction}, expected -6 to 6")
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
        named = {1: "DEC VMS", 3: "IBM 370"}.get(floats, "unknown")
        raise line.error(f"the floating-point format is {floats} ({named}); only 2 (IEEE 754) can be read")
    lines = integer(line, 19, 12, "the number of header lines")
    if lines != 11:
        raise line.error(f"the number of header lines is {lines}, expected 11")
    return ("<" if order == 1 else ">"), integer(line, 31, 12, "the number of binary bytes")


def _axis(line: Line, what: str) -> Axis:
    kind = integer(line, 0, 10, f"the {what}'s specific data type")
    for start, name in ((10, "length"), (15, "force"), (20, "temperature")):
        integer(line, start, 5, f"the {what}'s {name} exponent")
    text = columns_of_text(line.content)
    if text[25:26].strip() or text[46:47].strip():
        # Columns counted in bytes all the same: the blank between the labels is where it should be then.
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
        ordinate = joined(ordinate, table[:, first + 1])
    return _abscissa(form, table[:, 0]), ordinate


def _binary_body(cursor: Cursor, form: _Form, notes: list[str]) -> tuple[NDArray[np.float64], NDArray[Any]]:
    start = cursor.byte
    ordinate = f"{form.order}{'f8' if form.double else 'f4'}"
    fields: list[tuple[str, str]] = [("re", ordinate)] + ([("im", ordinate)] if form.complex_ else [])
    layouts = [np.dtype(fields)]
    if not form.even:
        # By the standard the abscissa is single precision whatever the ordinate is; pyuff writes it as precise.
        layouts = [np.dtype([("x", f"{form.order}f4"), *fields])]
        if form.double:
            layouts.append(np.dtype([("x", f"{form.order}f8"), *fields]))
    fitting = [layout for layout in layouts if _closed(cursor.data, start + form.count * layout.itemsize)]
    fitting.sort(key=lambda layout: layout.itemsize * form.count != form.declared_bytes)
    if not fitting:
        expected = " or ".join(str(form.count * layout.itemsize) for layout in layouts)
        raise FileFormatError(
            f"binary data begin here; {form.named()} take {expected} bytes, but behind these there is no -1 that "
            f"closes the data set ({len(cursor.data) - start} bytes are left, {form.declared_bytes} were declared)",
            byte=start,
        )
    size = form.count * fitting[0].itemsize
    if size != form.declared_bytes:
        notes.append(f"{form.declared_bytes} binary bytes are declared, {form.named()} take {size}; these were read")
    table = np.frombuffer(cursor.data, dtype=fitting[0], count=form.count, offset=start)
    real_part = table["re"].astype(np.float64)
    values: NDArray[Any] = joined(real_part, table["im"]) if form.complex_ else real_part
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


def _closed(data: bytes, end: int) -> bool:
    """Return whether a data set may end at this byte."""
    return end <= len(data) and re.match(rb"[\r\n]{0,2}(?:    -1[ ]*(?:[\r\n]|$)|$)", data[end : end + 100]) is not None


def _abscissa(form: _Form, stored: NDArray[np.float64]) -> NDArray[np.float64]:
    if not form.even:
        return stored.copy()
    return form.first + form.step * np.arange(form.count, dtype=np.float64)
