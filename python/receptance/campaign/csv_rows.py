"""CSV files with a header with units: columns are the fields of a dataclass, rows are its objects.

A field `overhang: Annotated[float, units.LENGTH]` is the column `overhang [mm]`, in any unit of length; a quantity
without a unit is in `[%]` or `[1]`. Fields without a default are required. If the class has the field `conditions`, it
gets all other columns with units.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from receptance._files import read_whole
from receptance._text import did_you_mean, one_of, shown
from receptance.campaign.problems import CampaignError, Issue
from receptance.io.text import truncation_notes
from receptance.units import Quantity, parse, parse_any

_HEADER = re.compile(r"(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\[\]]*)\])?\s*")
_MOST_OF_A_COUNT = 1000
_Row = TypeVar("_Row")
_Cell = tuple[str, str]
"""Text and unit of a cell."""


@dataclass(frozen=True)
class ShareOf:
    """Marks a column that may be in % of another column."""

    column: str


@dataclass(frozen=True)
class _Column:
    """A column: quantity of its numbers, or None for text and whole numbers."""

    is_text: bool
    quantity: Quantity | None
    of: str
    required: bool


def read_rows(
    path: str | Path,
    kind: type[_Row],
    *,
    check: Callable[[_Row], Iterable[tuple[str, str]]] = lambda row: (),
    number_last: bool = False,
) -> list[_Row]:
    """Return the rows of a CSV file as objects of a dataclass with the field `line`, the line of the file.

    The header may follow comments, lines that begin with #. Cells are separated by commas, or by semicolons; with
    semicolons, decimals have a comma or a point. Empty cells have the default of their field. `check` returns further
    mistakes of a row, column and text. With `number_last` there is a warning if the last line may be truncated, because
    a truncated number is a number.

    Raises
    ------
    CampaignError
        The file has mistakes; all of them are listed with their lines. It is a ValueError.
    OSError
        The file does not exist or cannot be opened.
    """
    columns = _columns_of(kind)
    file = Path(path)
    try:
        text = read_whole(file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CampaignError.about(file, f"byte {error.start} is not UTF-8, expected a CSV file in UTF-8") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    head = next((line for _, line in lines if not line.lstrip().startswith("#")), "")
    if not head:
        example = _example(columns)
        raise CampaignError.about(file, f"the file is empty, expected a first line such as {example}")
    if number_last:
        truncation_notes(text, lines)
    semicolons = head.count(";") > head.count(",")
    problems: list[Issue] = []
    cells_of = _split(csv.reader(io.StringIO(text, newline=""), delimiter=";" if semicolons else ","), problems)
    line, header = next(cells_of, (1, []))
    names = _header(header, columns, "conditions" in kind.__dataclass_fields__, line, problems)  # type: ignore[attr-defined]
    if problems:
        raise CampaignError(file, problems)
    rows: list[_Row] = []
    for line, cells in cells_of:
        if len(cells) != len(names):
            problems.append(Issue((), f"has {len(cells)} cells, expected {len(names)}", line))
            continue
        texts = [cell.strip().replace(",", ".") if semicolons else cell.strip() for cell in cells]
        row = {name: (cell, unit) for (name, unit), cell in zip(names, texts, strict=True) if cell}
        values, mistakes = _values(row, columns)
        if not mistakes:
            rows.append(kind(**values, line=line))  # type: ignore[call-arg]
            mistakes = dict(check(rows[-1]))
        problems += [Issue((name,), text, line) for name, text in mistakes.items()]
    if problems:
        raise CampaignError(file, problems)
    if not rows:
        raise CampaignError.about(file, "there is no row below the header")
    return rows


def _columns_of(kind: type) -> dict[str, _Column]:
    hints = get_type_hints(kind, include_extras=True)
    found = {}
    for field in fields(kind):
        if field.name in ("line", "conditions"):
            continue
        hint = hints[field.name]
        plain, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        quantity = next((mark for mark in marks if isinstance(mark, Quantity)), None)
        of = next((mark.column for mark in marks if isinstance(mark, ShareOf)), "")
        found[field.name.replace("_", " ")] = _Column(plain is str, quantity, of, field.default is MISSING)
    return found


def _split(reader: Any, problems: list[Issue]) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line that is neither blank nor a comment, up to the first one that is no CSV."""
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                yield reader.line_num, cells
    except csv.Error as error:
        problems.append(Issue((), f"cannot be split into cells: {error}", reader.line_num))


def _header(
    header: list[str], known: Mapping[str, _Column], others: bool, line: int, problems: list[Issue]
) -> list[tuple[str, str]]:
    """Return names and units of the columns, and add mistakes of the header."""
    names: list[tuple[str, str]] = []
    for cell in header:
        match = _HEADER.fullmatch(cell.strip())
        name, unit = (match["name"].strip(), (match["unit"] or "").strip()) if match else (cell.strip(), "")
        if name.endswith("_hz") and not unit:
            name, unit = name.removesuffix("_hz"), "Hz"
        names.append((name.replace("_", " ") if name.replace("_", " ") in known else name, unit))
    missing = [f'"{name}"' for name, one in known.items() if one.required and name not in dict(names)]
    if not any(name in known or did_you_mean(name, known) for name, _ in names):
        # The header is not quoted, because the file may be any file, also a confidential one.
        required = [name for name, one in known.items() if one.required]
        problems.append(Issue((), f"none of the {len(header)} columns is one of these: {one_of(required)}"))
        return []
    for index, (name, unit) in enumerate(names):
        if text := _column_problem(name, unit, known, others, [other for other, _ in names[:index]]):
            problems.append(Issue((), f"column {shown(header[index].strip())} {text}", line))
    if missing:
        text = f"expected a first line such as {_example(known)}, but it is {shown(','.join(header))}"
        problems.append(Issue((), f"there is no column {', '.join(missing)}, {text}", line))
    return names


def _column_problem(name: str, unit: str, known: Mapping[str, _Column], others: bool, before: list[str]) -> str:
    """Return the mistake in the heading of a column, or an empty text."""
    if name in before:
        return "occurs twice"
    if name not in known:
        near = did_you_mean(name, known)
        if not others:
            return f"is no known column, expected {one_of(known)}{near}"
        return f"is no known column{near}; other columns need a unit" if near and not unit else ""
    quantity = known[name].quantity
    if quantity is None or (unit == "%" and known[name].of):
        return ""
    expected = "%" if not quantity.unit else quantity.example.partition(" ")[2]
    if not unit:
        return f'has no unit, expected one such as "{name} [{expected}]"'
    if not quantity.unit:
        return "" if unit in ("%", "1") else f'is in {unit}, expected "{name} [%]"'
    try:
        parse(f"1 {unit}", quantity)
    except ValueError as error:
        return str(error).replace(f'"1 {unit}"', f'in "{unit}"')
    return ""


def _example(columns: Mapping[str, _Column]) -> str:
    required = {name: one.quantity for name, one in columns.items() if one.required}
    return ",".join(f"{name} [{one.example.partition(' ')[2]}]" if one else name for name, one in required.items())


def _values(
    row: Mapping[str, tuple[str, str]], columns: Mapping[str, _Column]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the fields of a row, and its mistakes by column."""
    values: dict[str, Any] = {}
    conditions: dict[str, float] = {}
    mistakes = {name: "is empty" for name, one in columns.items() if one.required and name not in row}
    for name, (cell, unit) in row.items():
        try:
            if name in columns:
                values[name.replace(" ", "_")] = _value(cell, unit, columns[name], row, columns)
            elif unit:
                conditions[name], _ = parse_any(f"{cell} {unit}")
        except ValueError as error:
            mistakes[name] = str(error)
    return {**values, **({"conditions": conditions} if conditions else {})}, mistakes


def _value(cell: str, unit: str, column: _Column, row: Mapping[str, _Cell], columns: Mapping[str, _Column]) -> Any:
    if column.quantity is None:
        if column.is_text:
            return cell
        if not cell.isdecimal() or not 1 <= int(cell) <= _MOST_OF_A_COUNT:
            raise ValueError(f"is {shown(cell)}, expected a whole number from 1 to {_MOST_OF_A_COUNT}")
        return int(cell)
    if column.quantity.unit and not (unit == "%" and column.of):
        return parse(f"{cell} {unit}", column.quantity)
    try:
        number = float(cell) * (0.01 if unit == "%" else 1.0)
    except ValueError:
        raise ValueError(f"is {shown(cell)}, expected a number") from None
    if not column.of:
        return parse(number, column.quantity)
    if not 0.0 < number <= 1.0:
        raise ValueError(f"is {shown(cell)}, expected a percentage above 0 and up to 100")
    whole = columns[column.of].quantity
    assert whole is not None
    return number * parse(" ".join(row.get(column.of, ("1", "mm"))), whole)
