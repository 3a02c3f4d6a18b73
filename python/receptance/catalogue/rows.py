"""Catalogues as a shop has them: CSV files with a header, units in it, tools and holders as rows."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from receptance import units
from receptance._files import read_whole
from receptance._text import did_you_mean, one_of, shown
from receptance.campaign.problems import CampaignError, Problem, Problems
from receptance.campaign.quantities import parse_condition
from receptance.units import Quantity, parse

__all__ = ["HolderRow", "ToolRow", "read_holders", "read_tools"]

_HEADER = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*")
_Cell = Quantity | type[str] | type[int]
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
_TOOL_NEEDED = ("name", "holder", "material", "overhang", "diameter")
_HOLDER: dict[str, _Cell] = {
    "holder": str,
    "length": units.LENGTH,
    "outer diameter": units.LENGTH,
    "inner diameter": units.LENGTH_OR_ZERO,
    "material": str,
    "core": str,
}
_HOLDER_NEEDED = ("holder", "length", "outer diameter", "material")
_MOST_TEETH = 1000


@dataclass(frozen=True, kw_only=True)
class ToolRow:
    """A tool in its holder: lengths in m.

    Attributes
    ----------
    name : str
        One of a kind in the catalogue.
    line : int
        Line of the file.
    holder, joint, material : str
        Names; the joint is empty where the row names none.
    overhang, diameter, bore : float
        From the holder's face to the tip, of the shank, and of a coolant bore.
    flute_length, effective_diameter : float
        Of the fluted part, and the diameter of the round bar that bends like it; zero without flutes.
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
    """A segment of a holder, from its tip-side end on; lengths in m."""

    holder: str
    line: int
    length: float
    outer_diameter: float
    material: str
    inner_diameter: float = 0.0
    core: str = ""


def read_tools(path: str | Path) -> list[ToolRow]:
    """Read tools from a CSV file.

    Parameters
    ----------
    path : str or path
        Its first line names the columns, lengths with a unit: `name`, `holder`, `material`, `overhang [mm]`, `diameter
        [mm]`, and perhaps `joint`, `bore [mm]`, `flute length [mm]`, `effective diameter [mm]` or `[%]` of the
        diameter, `teeth`. Other columns with a unit are conditions of the clamping. Separated by commas, or by
        semicolons, decimals then with a comma or a point.

    Raises
    ------
    CampaignError
        With all mistakes of the file, each with its line. It is a ValueError.
    OSError
        There is no such file.
    """
    file, problems, rows = _opened(path, _TOOL, _TOOL_NEEDED)
    found: list[ToolRow] = []
    seen: dict[str, int] = {}
    for line, row in rows:
        values, conditions = _values(line, row, _TOOL, _TOOL_NEEDED, problems)
        if values is None:
            continue
        name = values["name"]
        if name in seen:
            _add(problems, line, "name", f'is "{name}", as in line {seen[name]}, expected another name')
        seen.setdefault(name, line)
        if _flutes_fit(line, values, problems):
            found.append(
                ToolRow(line=line, conditions=conditions, **{k.replace(" ", "_"): v for k, v in values.items()})
            )
    _finish(file, problems, found)
    return found


def read_holders(path: str | Path) -> dict[str, list[HolderRow]]:
    """Read holders from a CSV file: a segment in each row, those of a holder in order from its tip-side end.

    Columns: `holder`, `length [mm]`, `outer diameter [mm]`, `material`, and perhaps `inner diameter [mm]` and `core`,
    the material that fills the bore. Raises as `read_tools`.
    """
    file, problems, rows = _opened(path, _HOLDER, _HOLDER_NEEDED)
    found: dict[str, list[HolderRow]] = {}
    for line, row in rows:
        values, _ = _values(line, row, _HOLDER, _HOLDER_NEEDED, problems)
        if values is not None:
            segment = HolderRow(line=line, **{key.replace(" ", "_"): value for key, value in values.items()})
            found.setdefault(segment.holder, []).append(segment)
    _finish(file, problems, list(found))
    return found


_Row = dict[str, tuple[str, str]]
"""By column: the cell and the unit of the header."""


def _opened(
    path: str | Path, columns: Mapping[str, _Cell], needed: tuple[str, ...]
) -> tuple[Path, Problems, Iterator[tuple[int, _Row]]]:
    file = Path(path)
    try:
        text = read_whole(file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CampaignError.about(file, f"byte {error.start} is not UTF-8, expected a CSV file in UTF-8") from None
    if not text.strip():
        raise CampaignError.about(file, f"the file is empty, expected a first line such as {_example(columns, needed)}")
    first = text.partition("\n")[0]
    decimal_comma = first.count(";") > first.count(",")
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=";" if decimal_comma else ",")
    problems = Problems({})
    split = _split(lines, problems)
    _, header = next(split, (1, []))
    names = _columns(header, columns, needed, problems)
    if problems.found:
        raise CampaignError(file, problems.found)

    def rows() -> Iterator[tuple[int, _Row]]:
        for line, cells in split:
            if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
                continue
            if len(cells) != len(header):
                what = f"has {len(cells)} cells, expected {len(header)}"
                problems.found.append(Problem((), what, line))
                continue
            own = [cell.strip().replace(",", ".") if decimal_comma else cell.strip() for cell in cells]
            yield line, {name: (cell, unit) for (name, unit), cell in zip(names, own, strict=True) if cell}

    return file, problems, rows()


def _split(lines: Any, problems: Problems) -> Iterator[tuple[int, list[str]]]:
    """Return the cells of each line with its number, up to one that cannot be split."""
    try:
        for cells in lines:
            yield lines.line_num, cells
    except csv.Error as error:
        problems.found.append(Problem((), f"cannot be split into cells: {error}", lines.line_num))


def _columns(
    header: list[str], known: Mapping[str, _Cell], needed: tuple[str, ...], problems: Problems
) -> list[tuple[str, str]]:
    if not any(cell.strip().startswith(needed) for cell in header):
        # What stands there is not shown: the file may be anything.
        problems.add((), f"none of the {len(header)} columns is one of these: {one_of(needed)}")
        return []
    names: list[tuple[str, str]] = []
    for cell in header:
        match = _HEADER.fullmatch(cell.strip())
        name, unit = (match["name"].strip(), (match["unit"] or "").strip()) if match else (cell.strip(), "")
        at = f"column {shown(cell.strip())}"
        if name in {other for other, _ in names}:
            problems.add((), f"{at} is there twice")
        if name in known and isinstance(known[name], Quantity):
            if not unit:
                problems.add((), f'{at} has no unit, expected one such as "{name} [mm]"')
            elif not (name == "effective diameter" and unit == "%"):
                _check_unit(at, unit, problems)
        elif name not in known and not unit and did_you_mean(name, known):
            problems.add((), f"{at} is no known column{did_you_mean(name, known)}; other columns need a unit")
        names.append((name, unit))
    there = {name for name, _ in names}
    missing = [f'"{name}"' for name in needed if name not in there]
    if missing:
        text = f"expected a first line such as {_example(known, needed)}, and it is {shown(','.join(header))}"
        problems.add((), f"there is no column {', '.join(missing)}, {text}")
    return names


def _example(columns: Mapping[str, _Cell], needed: tuple[str, ...]) -> str:
    return ",".join(f"{name} [mm]" if isinstance(columns[name], Quantity) else name for name in needed)


def _check_unit(at: str, unit: str, problems: Problems) -> None:
    try:
        parse(f"1 {unit}", units.LENGTH)
    except ValueError as error:
        problems.add((), f"{at} " + str(error).replace(f'"1 {unit}"', f'in "{unit}"'))


def _values(
    line: int, row: _Row, columns: Mapping[str, _Cell], needed: tuple[str, ...], problems: Problems
) -> tuple[dict[str, Any] | None, dict[str, float]]:
    """The cells of a row as text, whole numbers and SI values, and the conditions; None with mistakes."""
    values: dict[str, Any] = {}
    conditions: dict[str, float] = {}
    before = len(problems.found)
    for name in needed:
        if name not in row:
            _add(problems, line, name, "is empty")
    for name, (cell, unit) in row.items():
        try:
            if name in columns:
                values[name] = _value(cell, unit, columns[name], row)
            elif unit:
                conditions[name] = parse_condition(f"{cell} {unit}").value
        except ValueError as error:
            _add(problems, line, name, str(error))
    return (values if len(problems.found) == before else None), conditions


def _value(cell: str, unit: str, kind: _Cell, row: _Row) -> Any:
    if kind is str:
        return cell
    if not isinstance(kind, Quantity):
        if not cell.isdecimal() or not 1 <= int(cell) <= _MOST_TEETH:
            raise ValueError(f"is {shown(cell)}, expected a whole number from 1 to {_MOST_TEETH}")
        return int(cell)
    if unit == "%":
        whole, its_unit = row.get("diameter", ("1", "mm"))
        return _share(cell) * parse(f"{whole} {its_unit}", units.LENGTH)
    return parse(f"{cell} {unit}", kind)


def _share(cell: str) -> float:
    try:
        share = float(cell) / 100.0
    except ValueError:
        share = math.nan
    if not 0.0 < share <= 1.0:
        raise ValueError(f"is {shown(cell)}, expected a percentage over 0 and up to 100")
    return share


def _flutes_fit(line: int, values: dict[str, Any], problems: Problems) -> bool:
    flutes, effective = values.get("flute length", 0.0), values.get("effective diameter")
    if flutes and effective is None:
        text = "is empty, and the tool has flutes: expected the diameter of the round bar that bends like them"
        _add(problems, line, "effective diameter", text)
        return False
    if flutes > values["overhang"]:
        text = f"is {1e3 * flutes:g} mm, expected at most the overhang, {1e3 * values['overhang']:g} mm"
        _add(problems, line, "flute length", text)
        return False
    return True


def _add(problems: Problems, line: int, column: str, text: str) -> None:
    problems.found.append(Problem((column,), text, line))


def _finish(file: Path, problems: Problems, found: list[Any]) -> None:
    if problems.found:
        raise CampaignError(file, problems.found)
    if not found:
        raise CampaignError.about(file, "there is no row below the header")
