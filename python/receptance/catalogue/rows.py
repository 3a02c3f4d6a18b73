"""CSV files of a catalogue: tools and holders as rows below a header with units."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sized
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from receptance import units
from receptance._files import read_whole
from receptance._text import did_you_mean, one_of, shown
from receptance.campaign import CampaignError, Issue
from receptance.units import Quantity, parse, parse_any

__all__ = ["HolderRow", "ToolRow", "read_holders", "read_tools"]

_HEADER = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*")
_Cell = Quantity | type[str] | type[int]
_Row = dict[str, tuple[str, str]]
"""Cell and unit by column; empty cells are left out."""
_TOOL: dict[str, _Cell] = {
    "name": str,
    "holder": str,
    "joint": str,
    "material": str,
    "overhang": units.LENGTH,
    "diameter": units.LENGTH,
    "bore": units.LENGTH_OR_ZERO,
    "flute length": units.LENGTH_OR_ZERO,
    "effective diameter": units.LENGTH,
    "teeth": int,
}
_TOOL_REQUIRED = ("name", "holder", "material", "overhang", "diameter")
_HOLDER: dict[str, _Cell] = {
    "holder": str,
    "length": units.LENGTH,
    "outer diameter": units.LENGTH,
    "inner diameter": units.LENGTH_OR_ZERO,
    "material": str,
    "core": str,
}
_HOLDER_REQUIRED = ("holder", "length", "outer diameter", "material")
_MOST_TEETH = 1000


@dataclass(frozen=True, kw_only=True)
class ToolRow:
    """A tool in its holder; lengths in m.

    Attributes
    ----------
    name : str
        Name, unique in the catalogue.
    line : int
        Line of the file.
    holder, joint, material : str
        Names; the joint is empty if the row names none.
    overhang, diameter, bore : float
        Length from the holder's face to the tip, diameter of the shank, and diameter of a coolant bore.
    flute_length, effective_diameter : float
        Length of the fluted part, and diameter of the round bar with the same bending stiffness; zero without flutes.
    teeth : int or None
        Number of teeth.
    conditions : dict of str to float
        Other columns with numbers, in SI units, for laws of joints.
    """

    name: str
    line: int
    holder: str
    material: str
    overhang: float
    diameter: float
    joint: str = ""
    bore: float = 0.0
    flute_length: float = 0.0
    effective_diameter: float = 0.0
    teeth: int | None = None
    conditions: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class HolderRow:
    """A segment of a holder; lengths in m.

    Attributes
    ----------
    holder : str
        Name of the holder.
    line : int
        Line of the file.
    length, outer_diameter, inner_diameter : float
        Dimensions.
    material, core : str
        Names; the core fills the bore and is empty if there is none.
    """

    holder: str
    line: int
    length: float
    outer_diameter: float
    material: str
    inner_diameter: float = 0.0
    core: str = ""


def read_tools(path: str | Path) -> list[ToolRow]:
    """Read tools from a CSV file.

    The first line names the columns, lengths with a unit: `name`, `holder`, `material`, `overhang [mm]`, `diameter
    [mm]`, and optionally `joint`, `bore [mm]`, `flute length [mm]`, `effective diameter [mm]` or `[%]` of the
    diameter, and `teeth`. Other columns with a unit are conditions of the clamping. Cells are separated by commas, or
    by semicolons; with semicolons, decimals have a comma or a point.

    Parameters
    ----------
    path : str or path
        The file.

    Raises
    ------
    CampaignError
        The file has mistakes; all of them are listed with their lines. It is a ValueError.
    OSError
        The file does not exist or cannot be opened.
    """
    file, problems, rows = _open(path, _TOOL, _TOOL_REQUIRED)
    tools: list[ToolRow] = []
    lines: dict[str, int] = {}
    for line, row in rows:
        values, conditions = _values(line, row, _TOOL, _TOOL_REQUIRED, problems)
        if values is None:
            continue
        name = values["name"]
        if name in lines:
            text = f'is "{name}", as in line {lines[name]}, expected another name'
            problems.append(Issue(("name",), text, line))
        lines.setdefault(name, line)
        problem = _check_flutes(line, values)
        if problem is None:
            fields = {key.replace(" ", "_"): value for key, value in values.items()}
            tools.append(ToolRow(line=line, conditions=conditions, **fields))
        else:
            problems.append(problem)
    _raise_problems(file, problems, tools)
    return tools


def read_holders(path: str | Path) -> dict[str, list[HolderRow]]:
    """Read holders from a CSV file with one segment in each row, in order from the tip-side end.

    Columns: `holder`, `length [mm]`, `outer diameter [mm]`, `material`, and optionally `inner diameter [mm]` and
    `core`, the material that fills the bore. See `read_tools` for parameters and errors.
    """
    file, problems, rows = _open(path, _HOLDER, _HOLDER_REQUIRED)
    holders: dict[str, list[HolderRow]] = {}
    for line, row in rows:
        values, _ = _values(line, row, _HOLDER, _HOLDER_REQUIRED, problems)
        if values is not None:
            segment = HolderRow(line=line, **{key.replace(" ", "_"): value for key, value in values.items()})
            holders.setdefault(segment.holder, []).append(segment)
    _raise_problems(file, problems, holders)
    return holders


def _open(
    path: str | Path, columns: Mapping[str, _Cell], required: tuple[str, ...]
) -> tuple[Path, list[Issue], Iterator[tuple[int, _Row]]]:
    """Return the file, a list of problems to which reading the rows adds, and an iterator over the rows."""
    file = Path(path)
    try:
        text = read_whole(file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CampaignError.about(file, f"byte {error.start} is not UTF-8, expected a CSV file in UTF-8") from None
    if not text.strip():
        example = _example(columns, required)
        raise CampaignError.about(file, f"the file is empty, expected a first line such as {example}")
    first = text.partition("\n")[0]
    semicolons = first.count(";") > first.count(",")
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=";" if semicolons else ",")
    problems: list[Issue] = []
    lines = _split(reader, problems)
    _, header = next(lines, (1, []))
    names = _columns(header, columns, required, problems)
    if problems:
        raise CampaignError(file, problems)

    def rows() -> Iterator[tuple[int, _Row]]:
        for line, cells in lines:
            if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
                continue
            if len(cells) != len(header):
                problems.append(Issue((), f"has {len(cells)} cells, expected {len(header)}", line))
                continue
            texts = [cell.strip().replace(",", ".") if semicolons else cell.strip() for cell in cells]
            yield line, {name: (cell, unit) for (name, unit), cell in zip(names, texts, strict=True) if cell}

    return file, problems, rows()


def _split(reader: Any, problems: list[Issue]) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line, up to the first one that is no CSV."""
    try:
        for cells in reader:
            yield reader.line_num, cells
    except csv.Error as error:
        problems.append(Issue((), f"cannot be split into cells: {error}", reader.line_num))


def _columns(
    header: list[str], known: Mapping[str, _Cell], required: tuple[str, ...], problems: list[Issue]
) -> list[tuple[str, str]]:
    """Return names and units of the columns, and add mistakes of the header."""
    if not any(cell.strip().startswith(required) for cell in header):
        # The header is not quoted, because the file may be any file, also a confidential one.
        text = f"none of the {len(header)} columns is one of these: {one_of(required)}"
        problems.append(Issue((), text))
        return []
    names: list[tuple[str, str]] = []
    for cell in header:
        match = _HEADER.fullmatch(cell.strip())
        name, unit = (match["name"].strip(), (match["unit"] or "").strip()) if match else (cell.strip(), "")
        if text := _column_problem(name, unit, known, [other for other, _ in names]):
            problems.append(Issue((), f"column {shown(cell.strip())} {text}"))
        names.append((name, unit))
    missing = [f'"{name}"' for name in required if name not in dict(names)]
    if missing:
        text = f"expected a first line such as {_example(known, required)}, but it is {shown(','.join(header))}"
        problems.append(Issue((), f"there is no column {', '.join(missing)}, {text}"))
    return names


def _column_problem(name: str, unit: str, known: Mapping[str, _Cell], before: list[str]) -> str:
    """Return the mistake in the heading of a column, or an empty text."""
    if name in before:
        return "occurs twice"
    if not isinstance(known.get(name), Quantity):
        near = did_you_mean(name, known) if name not in known and not unit else ""
        return f"is no known column{near}; other columns need a unit" if near else ""
    if not unit:
        return f'has no unit, expected one such as "{name} [mm]"'
    if name == "effective diameter" and unit == "%":
        return ""
    try:
        parse(f"1 {unit}", units.LENGTH)
    except ValueError as error:
        return str(error).replace(f'"1 {unit}"', f'in "{unit}"')
    return ""


def _example(columns: Mapping[str, _Cell], required: tuple[str, ...]) -> str:
    return ",".join(f"{name} [mm]" if isinstance(columns[name], Quantity) else name for name in required)


def _values(
    line: int, row: _Row, columns: Mapping[str, _Cell], required: tuple[str, ...], problems: list[Issue]
) -> tuple[dict[str, Any] | None, dict[str, float]]:
    """Return values of a row (text, whole numbers, SI values; None after a mistake is added) and its conditions."""
    values: dict[str, Any] = {}
    conditions: dict[str, float] = {}
    mistakes = [Issue((name,), "is empty", line) for name in required if name not in row]
    for name, (cell, unit) in row.items():
        try:
            if name in columns:
                values[name] = _value(cell, unit, columns[name], row)
            elif unit:
                conditions[name], _ = parse_any(f"{cell} {unit}")
        except ValueError as error:
            mistakes.append(Issue((name,), str(error), line))
    problems += mistakes
    return (None if mistakes else values), conditions


def _value(cell: str, unit: str, kind: _Cell, row: _Row) -> Any:
    if kind is str:
        return cell
    if not isinstance(kind, Quantity):
        if not cell.isdecimal() or not 1 <= int(cell) <= _MOST_TEETH:
            raise ValueError(f"is {shown(cell)}, expected a whole number from 1 to {_MOST_TEETH}")
        return int(cell)
    if unit == "%":
        return _share(cell) * parse(" ".join(row.get("diameter", ("1", "mm"))), units.LENGTH)
    return parse(f"{cell} {unit}", kind)


def _share(cell: str) -> float:
    try:
        share = float(cell) / 100.0
    except ValueError:
        share = math.nan
    if not 0.0 < share <= 1.0:
        raise ValueError(f"is {shown(cell)}, expected a percentage above 0 and up to 100")
    return share


def _check_flutes(line: int, values: dict[str, Any]) -> Issue | None:
    """Return the mistake in the flutes of a tool, if there is one."""
    flutes, effective = values.get("flute length", 0.0), values.get("effective diameter")
    if flutes and effective is None:
        text = "is empty, but the tool has flutes; expected the diameter of the round bar with their bending stiffness"
        return Issue(("effective diameter",), text, line)
    if flutes > values["overhang"]:
        text = f"is {1e3 * flutes:g} mm, expected at most the overhang, {1e3 * values['overhang']:g} mm"
        return Issue(("flute length",), text, line)
    return None


def _raise_problems(file: Path, problems: list[Issue], rows: Sized) -> None:
    if problems:
        raise CampaignError(file, problems)
    if not rows:
        raise CampaignError.about(file, "there is no row below the header")
