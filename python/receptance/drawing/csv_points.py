"""Profiles in CSV files: tables of points with units in the head.

A table has the columns `x [mm]` and `diameter [mm]` or `radius [mm]`, of the outer profile, and perhaps `arc [mm]`, the
radius of the arc that leads to a point. A column `bore [mm]` (a diameter) or `bore radius [mm]` has the bore at the
same x; an empty cell ends a bore. Another head in the same file begins a further table, such as one of a bore alone.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from receptance._files import read_whole
from receptance._text import did_you_mean, one_of, shown
from receptance.io import FileFormatError
from receptance.io.text import truncation_notes
from receptance.model.contour import Contour, PointError
from receptance.units import COORDINATE, LENGTH, parse

_CELL = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*")
_NUMBER = re.compile(r"\s*[-+]?[\d.,]*\d[\d.,]*([eE][-+]?\d+)?\s*")
_OUTER = {"diameter": 1.0, "radius": 2.0}
"""Columns of the outer profile, with their diameter."""
_BORE = {"bore": 1.0, "bore_diameter": 1.0, "bore_radius": 2.0}
_COLUMNS = ("x", *_OUTER, *_BORE, "arc", "y")
_EXAMPLE = '"x [mm],diameter [mm]"'
MOST_ROWS = 100_000
"""Largest number of rows."""


@dataclass
class _Profile:
    """Points of the outer profile or of a bore, with the lines on which they stand."""

    points: list[tuple[float, ...]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def add(self, line: int, *point: float) -> None:
        self.points.append(point)
        self.lines.append(line)


@dataclass(frozen=True)
class _Head:
    """Names and units of the columns of a table, and the line of the file."""

    names: list[str]
    units: list[str]
    line: int

    def factor(self, columns: dict[str, float]) -> tuple[str, float] | None:
        """Return the column that the table has of several, with its factor."""
        return next(((name, factor) for name, factor in columns.items() if name in self.names), None)


def read_csv(file: Path, *, unit: str = "", tolerance: float) -> Contour:
    """Return the contour in a CSV file; `unit` is that of columns without one.

    Raises
    ------
    FileFormatError
        The file has a mistake; the message names its line. It is a ValueError.
    OSError
        The file cannot be opened.
    """
    outer, bores = _Profile(), [_Profile()]
    head: _Head | None = None
    for line, cells in _rows(file):
        if not _NUMBER.fullmatch(cells[0]) and cells[0]:
            head = _read_head(cells, line, unit)
            bores.append(_Profile())
            if head.factor(_OUTER) and outer.points:
                problem = f"begins a second outer profile after that of line {outer.lines[0]}, expected one in a file"
                raise FileFormatError(problem, line=line)
            continue
        if head is None:
            raise FileFormatError(f"is no head, expected one such as {_EXAMPLE}", line=line)
        _read_row(head, cells, line, outer, bores)
    if head is None:
        raise FileFormatError(f"the file is empty, expected a first line such as {_EXAMPLE}")
    if not outer.points:
        raise FileFormatError(f"there is no outer profile, expected the columns {_EXAMPLE} and rows below them")
    profiles = {"outer": outer}
    drawn = [bore for bore in bores if bore.points]
    profiles |= {f"bores[{index}]": bore for index, bore in enumerate(drawn)}
    try:
        return Contour(outer.points, [bore.points for bore in drawn], tolerance=tolerance, owner="contour")
    except PointError as error:
        profile = error.profile.removeprefix("contour: ")
        raise FileFormatError(error.problem, line=profiles[profile].lines[error.index]) from None
    except ValueError as error:
        raise FileFormatError(str(error).removeprefix("contour: ")) from None


def read_outline(file: Path, *, unit: str = "") -> list[list[tuple[float, float]]]:
    """Return closed outlines in the plane from the columns x and y, in m; a blank cell or a head ends an outline."""
    outlines: list[list[tuple[float, float]]] = [[]]
    head: _Head | None = None
    for line, cells in _rows(file):
        if not _NUMBER.fullmatch(cells[0]) and cells[0]:
            head = _read_head(cells, line, unit)
            if "y" not in head.names:
                raise FileFormatError('has no column y, expected a head such as "x [mm],y [mm]"', line=line)
            outlines.append([])
        elif head is None:
            raise FileFormatError('is no head, expected one such as "x [mm],y [mm]"', line=line)
        elif not any(cells):
            outlines.append([])
        else:
            values = _values(head, cells, line)
            if len(values.keys() & {"x", "y"}) < 2:
                raise FileFormatError("has no x or no y, expected both", line=line)
            outlines[-1].append((values["x"], values["y"]))
    return [outline for outline in outlines if outline]


def _rows(file: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield line and cells of every row that is neither blank nor a comment; decimals have points."""
    try:
        text = read_whole(file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError("is not UTF-8, expected a CSV file in UTF-8", byte=error.start) from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if len(lines) > MOST_ROWS:
        raise FileFormatError(
            f"the file has {len(lines)} lines, expected at most {MOST_ROWS}; a profile needs only the points where its "
            "direction changes, and `arc` for arcs"
        )
    truncation_notes(text, lines)
    head = next((line for _, line in lines if not line.lstrip().startswith("#")), "")
    semicolons = head.count(";") > head.count(",")
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=";" if semicolons else ",")
    try:
        for cells in reader:
            if cells and any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                yield (
                    reader.line_num,
                    [cell.strip().replace(",", ".") if semicolons else cell.strip() for cell in cells],
                )
            elif cells and len(cells) > 1 and not any(cell.strip() for cell in cells):
                yield reader.line_num, [""] * len(cells)
    except csv.Error as error:
        raise FileFormatError(f"cannot be split into cells: {error}", line=reader.line_num) from None


def _read_head(cells: Sequence[str], line: int, unit: str) -> _Head:
    """Return the names and units of columns."""
    names: list[str] = []
    units: list[str] = []
    for cell in cells:
        match = _CELL.fullmatch(cell)
        name = (match["name"] if match else cell).strip().casefold().replace(" ", "_")
        written = ((match["unit"] or "") if match else "").strip() or unit
        if name not in _COLUMNS:
            expected = one_of(column.replace("_", " ") for column in _COLUMNS)
            problem = f"column {shown(cell)} is no known column, expected {expected}{did_you_mean(name, _COLUMNS)}"
            raise FileFormatError(problem, line=line)
        if name in names:
            raise FileFormatError(f"column {shown(cell)} occurs twice", line=line)
        shown_name = name.replace("_", " ")
        if not written:
            raise FileFormatError(
                f'column {shown(cell)} has no unit, expected one such as "{shown_name} [mm]", or a unit in `unit`',
                line=line,
                option="unit",
            )
        try:
            parse(f"1 {written}", LENGTH)
        except ValueError as error:
            raise FileFormatError(
                f"column {shown(cell)} {str(error).replace(shown(f'1 {written}'), f'in {shown(written)}')}", line=line
            ) from None
        names.append(name)
        units.append(written)
    head = _Head(names, units, line)
    if "x" not in names or not ({*_OUTER, *_BORE, "y"} & set(names)):
        raise FileFormatError(f"has {one_of(names)}, expected a head such as {_EXAMPLE}", line=line)
    if len({*_OUTER} & set(names)) > 1 or len({*_BORE} & set(names)) > 1:
        raise FileFormatError("has a diameter and a radius of one thing, expected one of the two", line=line)
    return head


def _values(head: _Head, cells: Sequence[str], line: int) -> dict[str, float]:
    """Return the numbers of a row in m by the name of their column; empty cells are left out."""
    if len(cells) != len(head.names):
        raise FileFormatError(f"has {len(cells)} cells, expected {len(head.names)}", line=line)
    values = {}
    for name, unit, cell in zip(head.names, head.units, cells, strict=True):
        if not cell:
            continue
        try:
            values[name] = parse(f"{cell} {unit}", COORDINATE)
        except ValueError:
            raise FileFormatError(f"{name.replace('_', ' ')} is {shown(cell)}, expected a number", line=line) from None
    return values


def _read_row(head: _Head, cells: Sequence[str], line: int, outer: _Profile, bores: list[_Profile]) -> None:
    """Add the points of a row to the outer profile and to the last bore."""
    values = _values(head, cells, line)
    if not values:
        bores.append(_Profile())
        return
    if "x" not in values:
        raise FileFormatError("has no x, expected one", line=line)
    body, hole = head.factor(_OUTER), head.factor(_BORE)
    arc = (values["arc"],) if "arc" in values else ()
    if body is not None and body[0] in values:
        outer.add(line, values["x"], body[1] * values[body[0]], *arc)
    if hole is not None and hole[0] in values:
        # Beside an outer profile the arc is that of the profile.
        bores[-1].add(line, values["x"], hole[1] * values[hole[0]], *(arc if body is None else ()))
    elif hole is not None and bores[-1].points:
        bores.append(_Profile())
