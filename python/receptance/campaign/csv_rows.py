"""CSV files with a header with units: columns are the fields of a dataclass, rows are its objects.

A field `overhang: Annotated[float, units.LENGTH]` is the column `overhang [mm]`, in any unit of length; a quantity
without a unit is in `[%]` or `[1]`. Fields without a default are required. If the class has the field `conditions`, it
gets all other columns with units. Symbols of a standard are other heads of columns, with the unit of the standard.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
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
_NO_SYMBOLS: Mapping[str, Symbol] = {}
_Row = TypeVar("_Row")
_Cell = tuple[str, str]
"""Text and unit of a cell."""


_SYMBOL = re.compile(r"[A-Z][A-Z0-9_]{1,9}")
"""Heads that may be symbols of a standard."""


@dataclass(frozen=True)
class ShareOf:
    """Marks a column that may be in % of another column, or, where a row has none, of a further one."""

    column: str
    instead: str = ""


@dataclass(frozen=True)
class DerivedFrom:
    """Marks a column that another one can replace, or the difference of two."""

    column: str
    less: str = ""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return (self.column, self.less) if self.less else (self.column,)


@dataclass(frozen=True)
class Symbol:
    """A head of a column in a standard."""

    column: str
    """Name of the column."""
    unit: str
    """Unit that the standard defines; empty for a number without a unit."""
    meaning: str
    """What it is, for the documentation."""


@dataclass(frozen=True)
class RowMistake:
    """A mistake of a row beyond its single cells: a name that does not exist, or values that exclude each other."""

    columns: tuple[str, ...]
    """The column that the message is about, and others that it depends on; if one is unreadable there is no message."""
    text: str
    """Predicate of the first column: value, and what was expected."""


@dataclass(frozen=True)
class _Column:
    """A column: quantity of its numbers, or None for text and whole numbers."""

    is_text: bool
    quantity: Quantity | None
    of: tuple[str, ...]
    required: bool
    derived: DerivedFrom | None = None


@dataclass(frozen=True)
class _Head:
    """The head of a column of a file."""

    name: str
    """Name of the column."""
    unit: str
    called: str
    """Name in the file, without the unit."""
    symbol: str = ""
    """The symbol of the standard, if the column has its name by one."""
    by_standard: bool = False
    """Whether the unit is that of the standard, because the file states none."""


def read_rows(
    path: str | Path,
    kind: type[_Row],
    *,
    check: Callable[[_Row], Iterable[RowMistake]] = lambda row: (),
    number_last: bool = False,
    symbols: Mapping[str, Symbol] = _NO_SYMBOLS,
    notes: list[str] | None = None,
) -> list[_Row]:
    """Return the rows of a CSV file as objects of a dataclass with the field `line`, the line of the file.

    The header may follow comments, lines that begin with #. Cells are separated by commas, or by semicolons; with
    semicolons, decimals have a comma or a point. Empty cells have the default of their field. `check` returns further
    mistakes of a row; fields of cells that cannot be read are zero or empty there. With `number_last` there is a
    warning if the last line may be truncated, because a truncated number is a number. `symbols` are heads of a
    standard; what a user should know of them is added to `notes`.

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
    heads = [_head(cell, columns, symbols) for cell in header]
    others = "conditions" in kind.__dataclass_fields__  # type: ignore[attr-defined]
    if not any(head.name in columns or did_you_mean(head.name, columns) for head in heads):
        # The header is not quoted, because the file may be any file, also a confidential one.
        required = one_of(name for name, column in columns.items() if column.required)
        problems.append(Issue((), f"none of the {len(header)} columns is one of these: {required}"))
        raise CampaignError(file, problems)
    of_header = _header_problems(heads, header, columns, line, others=others, has_symbols=bool(symbols))
    # Columns without or with a wrong head are left out of the rows, whose other mistakes are told as well.
    unread = {name for names, _ in of_header for name in names}
    problems += [problem for _, problem in of_header]
    if notes is not None and symbols:
        notes += _notes(file, heads, columns)
    called = {head.name: head.called for head in heads}
    rows: list[_Row] = []
    for line, cells in cells_of:
        if len(cells) != len(heads):
            problems.append(Issue((), f"has {len(cells)} cells, expected {len(heads)}", line))
            continue
        texts = [cell.strip().replace(",", ".") if semicolons else cell.strip() for cell in cells]
        row = {head.name: (cell, head.unit) for head, cell in zip(heads, texts, strict=True) if cell}
        values, mistakes, left = _values(row, columns, unread)
        rows.append(kind(**{**_placeholders(columns), **values}, line=line))  # type: ignore[call-arg]
        of_row = [mistake for mistake in check(rows[-1]) if left.isdisjoint(mistake.columns)]
        texts_of = [*mistakes.items(), *((mistake.columns[0], mistake.text) for mistake in of_row)]
        problems += [Issue((_called(name, columns, called),), text, line) for name, text in texts_of]
    if problems:
        raise CampaignError(file, problems)
    if not rows:
        raise CampaignError.about(file, "there is no row below the header")
    return rows


def _columns_of(kind: type) -> dict[str, _Column]:
    hints = get_type_hints(kind, include_extras=True)
    columns = {}
    for field in fields(kind):
        if field.name in ("line", "conditions"):
            continue
        hint = hints[field.name]
        plain, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        quantity = next((mark for mark in marks if isinstance(mark, Quantity)), None)
        share = next((mark for mark in marks if isinstance(mark, ShareOf)), None)
        of = () if share is None else tuple(filter(None, (share.column, share.instead)))
        derived = next((mark for mark in marks if isinstance(mark, DerivedFrom)), None)
        required = field.default is MISSING
        columns[field.name.replace("_", " ")] = _Column(plain is str, quantity, of, required, derived)
    return columns


def _placeholders(columns: Mapping[str, _Column]) -> dict[str, Any]:
    """Return fields for a row whose cells are unreadable, for further checks of the others."""
    needed = {name: column for name, column in columns.items() if column.required}
    return {name.replace(" ", "_"): "" if column.is_text else 0 for name, column in needed.items()}


def _called(name: str, columns: Mapping[str, _Column], called: Mapping[str, str]) -> str:
    """Return the name in the file of a column, or of the only one from which it is derived."""
    derived = columns[name].derived if name in columns else None
    if name not in called and derived is not None and not derived.less:
        name = derived.column
    return called.get(name, name)


def _split(reader: Any, problems: list[Issue]) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line that is neither blank nor a comment, up to the first one that is no CSV."""
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#"):
                yield reader.line_num, cells
    except csv.Error as error:
        problems.append(Issue((), f"cannot be split into cells: {error}", reader.line_num))


def _head(cell: str, columns: Mapping[str, _Column], symbols: Mapping[str, Symbol]) -> _Head:
    """Return name and unit of a column from its cell in the header."""
    match = _HEADER.fullmatch(cell.strip())
    name, unit = (match["name"].strip(), (match["unit"] or "").strip()) if match else (cell.strip(), "")
    if name.endswith("_hz") and not unit:
        name, unit = name.removesuffix("_hz"), "Hz"
    plain = name.replace("_", " ")
    if plain in columns:
        return _Head(plain, unit, plain)
    symbol = symbols.get(name.upper())
    if symbol is None or (name not in symbols and not _is_symbol_in_lower_case(unit, columns[symbol.column])):
        return _Head(name, unit, name)
    return _Head(symbol.column, unit or symbol.unit, name, name.upper(), not unit and bool(symbol.unit))


def _is_symbol_in_lower_case(unit: str, column: _Column) -> bool:
    """Return whether a head that is a symbol but for its case is meant as such: without a unit, or with a fitting one.

    With another unit, `lf [N]`, it is a condition of that name.
    """
    return not unit or (column.quantity is not None and not _column_problem("", unit, column))


def _header_problems(
    heads: Sequence[_Head],
    header: Sequence[str],
    columns: Mapping[str, _Column],
    line: int,
    *,
    others: bool,
    has_symbols: bool,
) -> list[tuple[tuple[str, ...], Issue]]:
    """Return the mistakes of the header, each with the names of its columns.

    `others` are allowed beside the columns of the dataclass, and so are symbols.
    """
    problems: list[tuple[tuple[str, ...], Issue]] = []
    names = [head.name for head in heads]
    missing = [
        name
        for name, column in columns.items()
        if column.required
        and name not in names
        and not (column.derived is not None and set(column.derived.columns) <= set(names))
    ]
    for index, head in enumerate(heads):
        before = next((other for other in heads[:index] if other.name == head.name), None)
        if before is not None:
            text = "occurs twice" if before.called == head.called else f"is also column {shown(before.called)}"
        elif head.name in columns:
            text = _column_problem(head.name, head.unit, columns[head.name])
        else:
            # A symbol that no column has is a property that is not needed.
            is_symbol = has_symbols and _SYMBOL.fullmatch(head.name)
            text = "" if is_symbol else _other_column_problem(head.name, head.unit, columns, others)
        if text:
            problems.append(((head.name,), Issue((), f"column {shown(header[index].strip())} {text}", line)))
    if missing:
        text = f"expected a first line such as {_example(columns)}, but it is {shown(','.join(header))}"
        listed = ", ".join(f'"{name}"' for name in missing)
        problems.append((tuple(missing), Issue((), f"there is no column {listed}, {text}", line)))
    return problems


def _notes(file: Path, heads: Sequence[_Head], columns: Mapping[str, _Column]) -> Iterator[str]:
    """Yield what a user should know of a file: units that the standard defines, and columns that are not needed."""
    assumed: dict[str, list[str]] = {}
    for head in heads:
        if head.by_standard:
            assumed.setdefault(head.unit, []).append(head.called)
    if assumed:
        (unit, first), *others = assumed.items()
        rest = "".join(f", {_listed(names)} in {other}" for other, names in others)
        yield f"{file.name}: {_listed(first)} without a unit in {unit}{rest}, as ISO 13399 defines"
    turned = [head for head in heads if head.symbol and head.called != head.symbol]
    if turned:
        listed = ", ".join(f"{shown(head.called)} as {head.symbol}" for head in turned)
        yield f"{file.name}: symbols of ISO 13399 in lower case: {listed}"
    unknown = [head for head in heads if head.name not in columns]
    unused = [head.called for head in unknown if head.called and (not head.unit or _SYMBOL.fullmatch(head.called))]
    if unused:
        yield f"{file.name}: not needed: {_listed(unused)}"


def _listed(names: list[str]) -> str:
    return f"{'columns' if len(names) > 1 else 'column'} {', '.join(map(shown, names))}"


def _other_column_problem(name: str, unit: str, columns: Mapping[str, _Column], others: bool) -> str:
    """Return the mistake in the heading of a column that is none of the dataclass, or an empty text."""
    near = did_you_mean(name, columns)
    if not others:
        return f"is no known column, expected {one_of(columns)}{near}"
    return f"is no known column{near}; other columns need a unit" if near and not unit else ""


def _column_problem(name: str, unit: str, column: _Column) -> str:
    """Return the mistake in the unit of a column, or an empty text."""
    quantity = column.quantity
    if quantity is None or (unit == "%" and column.of):
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
    required = {name: column.quantity for name, column in columns.items() if column.required}
    heads = (name if of is None else f"{name} [{of.example.partition(' ')[2]}]" for name, of in required.items())
    return ",".join(heads)


def _values(
    row: Mapping[str, _Cell], columns: Mapping[str, _Column], unread: Set[str]
) -> tuple[dict[str, Any], dict[str, str], set[str]]:
    """Return the fields of a row, its mistakes by column, and the columns that have no value because of mistakes.

    `unread` are columns without or with a wrong head.
    """
    values: dict[str, Any] = {}
    conditions: dict[str, float] = {}
    mistakes: dict[str, str] = {}
    left = set(unread)
    # Shares of other columns come last, so that a mistake of the whole is not one of its share.
    for name, (cell, unit) in sorted(row.items(), key=lambda item: item[0] in columns and bool(columns[item[0]].of)):
        try:
            if name in left or (name in columns and unit == "%" and _whole(columns[name], row) in left):
                left.add(name)
            elif name in columns:
                values[name.replace(" ", "_")] = _value(cell, unit, columns[name], row, columns)
            elif unit:
                conditions[name], _ = parse_any(f"{cell} {unit}")
        except ValueError as error:
            mistakes[name] = str(error)
            left.add(name)
    for name, column in columns.items():
        if name not in row and name not in left and (column.required or column.derived is not None):
            _derive(name, column, values, mistakes, left)
    return {**values, **({"conditions": conditions} if conditions else {})}, mistakes, left


def _derive(name: str, column: _Column, values: dict[str, Any], mistakes: dict[str, str], left: set[str]) -> None:
    """Add the value of an empty cell from those of other columns, or a mistake."""
    others = () if column.derived is None else column.derived.columns
    if left.intersection(others):
        left.add(name)
        return
    numbers = [values[other.replace(" ", "_")] for other in others if other.replace(" ", "_") in values]
    if others and len(numbers) == len(others):
        number = numbers[0] - sum(numbers[1:])
        if number > 0.0:
            values[name.replace(" ", "_")] = number
            return
        mistakes[name] = f"is {1e3 * number:g} mm, from {' less '.join(others)}, expected more than zero"
    elif column.required:
        mistakes[name] = f"is empty, expected it, or {' and '.join(others)}" if others else "is empty"
    else:
        return
    left.add(name)


def _whole(column: _Column, row: Mapping[str, _Cell]) -> str:
    """Return the name of the column of which a column may be a share; empty if it is no share."""
    return next((name for name in column.of if name in row), column.of[-1] if column.of else "")


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
    of = _whole(column, row)
    whole = columns[of].quantity
    assert whole is not None
    return number * parse(" ".join(row.get(of, ("1", "mm"))), whole)
