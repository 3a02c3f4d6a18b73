"""CSV files of a catalogue: tools and holders as rows below a header with units."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from receptance import units
from receptance.campaign.csv_rows import DerivedFrom, RowMistake, ShareOf, read_rows
from receptance.campaign.shapes import note_on_directions
from receptance.catalogue.iso13399 import HOLDER_SYMBOLS, TOOL_SYMBOLS
from receptance.model.sections import SectionShape

_PLAY = 1e-4
"""Largest excess in m of a length that is no contradiction, because catalogues round lengths."""
_AT_MOST = (
    ("overhang", "overall_length"),
    ("functional_length", "overall_length"),
    ("usable_length", "overall_length"),
    ("head_length", "overall_length"),
    ("clamping_length", "overall_length"),
    ("flute_length", "overhang"),
    ("flute_length", "overall_length"),
    ("depth_of_cut", "flute_length"),
    ("depth_of_cut", "usable_length"),
    ("cutting_diameter", "largest_cutting_diameter"),
)
"""Fields of a tool of which the first is at most the second, if the row has both."""


@dataclass(frozen=True, kw_only=True)
class ToolRow:
    """A tool in its holder; lengths in m, zero where the row has none."""

    name: str
    """Name, unique in the catalogue."""
    line: int
    """Line of the file."""
    holder: str
    """Name of the holder."""
    material: str
    """Name of the material."""
    overhang: Annotated[float, units.LENGTH, DerivedFrom("overall length", "clamping length")]
    """Length from the holder's face to the tip."""
    diameter: Annotated[float, units.LENGTH]
    """Diameter of the shank."""
    joint: str = ""
    """Name of the joint; empty if the row names none."""
    bore: Annotated[float, units.LENGTH_OR_ZERO] = 0.0
    """Diameter of a coolant bore."""
    flute_length: Annotated[float, units.LENGTH_OR_ZERO, DerivedFrom("depth of cut")] = 0.0
    """Length of the fluted part; zero without flutes."""
    effective_diameter: Annotated[float, units.LENGTH, ShareOf("cutting diameter", "diameter")] = 0.0
    """Diameter of the round bar with the same bending stiffness; zero without flutes."""
    teeth: int | None = None
    """Number of teeth."""
    core_diameter: Annotated[float, units.LENGTH, ShareOf("cutting diameter", "diameter")] = 0.0
    """Diameter of the core of the flutes, whose section is then that of as many flutes; zero if it is not known."""
    helix_angle: Annotated[float | None, units.HELIX] = None
    """Helix angle of the flutes in degrees; None if it is not known."""
    cutting_diameter: Annotated[float, units.LENGTH] = 0.0
    """Diameter of the cutting edges."""
    largest_cutting_diameter: Annotated[float, units.LENGTH] = 0.0
    overall_length: Annotated[float, units.LENGTH] = 0.0
    """Length of the tool with its shank."""
    clamping_length: Annotated[float, units.LENGTH_OR_ZERO] = 0.0
    """Length of the shank in the holder."""
    functional_length: Annotated[float, units.LENGTH] = 0.0
    depth_of_cut: Annotated[float, units.LENGTH] = 0.0
    """Largest depth of cut."""
    usable_length: Annotated[float, units.LENGTH] = 0.0
    """Length from the tip to the end of the neck, or to where the tool can be used."""
    head_length: Annotated[float, units.LENGTH] = 0.0
    neck_diameter: Annotated[float, units.LENGTH] = 0.0
    """Diameter between flutes and shank; zero without a neck."""
    conditions: dict[str, float] = field(default_factory=dict)
    """Other columns with numbers, in SI units, for laws of joints."""

    @property
    def neck_end(self) -> float:
        """Length in m from the tip to the end of the neck; zero without a neck."""
        return (self.usable_length or self.head_length) if self.neck_diameter else 0.0


@dataclass(frozen=True, kw_only=True)
class HolderRow:
    """A segment of a holder; lengths in m."""

    holder: str
    """Name of the holder."""
    line: int
    """Line of the file."""
    length: Annotated[float, units.LENGTH]
    outer_diameter: Annotated[float, units.LENGTH]
    material: str
    """Name of the material."""
    inner_diameter: Annotated[float, units.LENGTH_OR_ZERO] = 0.0
    core: str = ""
    """Name of the material that fills the bore; empty if there is none."""
    end_outer_diameter: Annotated[float | None, units.LENGTH] = None
    """Outer diameter at the far end of a cone; None for a cylinder."""
    end_inner_diameter: Annotated[float | None, units.LENGTH_OR_ZERO] = None
    """Bore at the far end of a cone; None for a cylindrical bore."""


def read_tools(
    path: str | Path,
    *,
    notes: list[str] | None = None,
    check: Callable[[ToolRow], Iterable[RowMistake]] = lambda tool: (),
) -> list[ToolRow]:
    r"""Read tools from a CSV file.

    The first line names the columns, lengths with a unit: `name`, `holder`, `material`, `overhang [mm]`, `diameter
    [mm]`, and optionally `joint`, `bore [mm]`, `flute length [mm]`, `effective diameter [mm]` or `[%]` of the cutting
    diameter, or of the diameter where there is none, or likewise `core diameter`, and `teeth`. Symbols of ISO 13399
    name columns as well, see `receptance.catalogue.iso13399`; without a unit they have mm, as the standard defines.
    Other columns with a unit are conditions of the clamping. Cells are separated by commas, or by semicolons; with
    semicolons, decimals have a comma or a point.

    Parameters
    ----------
    path : str or path
        The file.
    notes : list of str, optional
        A list to which remarks for the user are added: units by the standard, symbols in lower case, and columns that
        were not needed.
    check : callable, optional
        Returns further mistakes of a row, such as names that a machine does not have; they are listed with the others.

    Raises
    ------
    CampaignError
        The file has mistakes; all of them are listed with line, column and value. It is a ValueError.
    OSError
        The file does not exist or cannot be opened.

    Examples
    --------
    >>> import tempfile
    >>> from receptance.catalogue import read_tools
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "tools.csv"
    ...     _ = file.write_text("name,holder,material,DCON,LPR\nT1,er32,carbide,12,60\n")
    ...     (tool,) = read_tools(file)
    >>> tool.name, tool.diameter, tool.overhang
    ('T1', 0.012, 0.06)
    """
    lines: dict[str, int] = {}

    def mistakes(tool: ToolRow) -> Iterator[RowMistake]:
        if tool.name in lines:
            yield RowMistake(("name",), f'is "{tool.name}", as in line {lines[tool.name]}, expected another name')
        lines.setdefault(tool.name, tool.line)
        yield from mistakes_of_tool(tool)
        yield from check(tool)

    return read_rows(path, ToolRow, check=mistakes, symbols=TOOL_SYMBOLS, notes=notes)


def mistakes_of_tool(tool: ToolRow) -> Iterator[RowMistake]:
    """Yield what the dimensions of a tool lack, and what they exclude."""
    if tool.flute_length and not (tool.effective_diameter or tool.core_diameter):
        text = "is empty, but the tool has flutes; expected the diameter of the round bar with their bending "
        text += "stiffness, or `core diameter` and the number of teeth"
        yield RowMistake(("effective diameter", "core diameter", "flute length"), text)
    if tool.core_diameter:
        yield from _of_flutes(tool)
    yield from _too_large(tool)
    yield from _of_bore(tool)
    yield from _of_neck(tool)


def _of_flutes(tool: ToolRow) -> Iterator[RowMistake]:
    """Yield what the section of flutes lacks, or excludes."""
    if tool.effective_diameter:
        text = "is given beside an effective diameter, expected one of the two"
        yield RowMistake(("core diameter", "effective diameter"), text)
    if not tool.flute_length:
        text = "is given without a flute length, expected it as well"
        yield RowMistake(("core diameter", "flute length"), text)
    if tool.bore:
        text = "is given beside a core diameter, but the section of flutes is solid, expected one of the two"
        yield RowMistake(("bore", "core diameter"), text)
    if tool.teeth is None:
        text = "is empty, expected the number of flutes, because the row has a core diameter"
        yield RowMistake(("teeth", "core diameter"), text)
        return
    try:
        flutes_of(tool)
    except ValueError as error:
        columns = ("core diameter", "cutting diameter", "diameter", "teeth")
        yield RowMistake(columns, f"makes no section of flutes: {str(error).partition(': ')[2]}")


def flutes_of(tool: ToolRow) -> SectionShape:
    """Return the section of the flutes of a tool with a core diameter; two flutes without helix do not average.

    Raises
    ------
    ValueError, TypeError
        Flutes that `SectionShape.fluted` refuses.
    """
    return SectionShape.fluted(
        tool.teeth or 0,
        diameter=tool.cutting_diameter or tool.diameter,
        core_diameter=tool.core_diameter,
        straight=tool.helix_angle == 0.0,
    )


def note_on_flutes(tool: ToolRow) -> str:
    """Return what a user should know of a tool with two flutes, in whose directions it bends differently.

    It is empty for other tools, and for those with an effective diameter.
    """
    if not tool.core_diameter:
        return ""
    shape = flutes_of(tool)
    shank = (tool.overhang - tool.flute_length, tool.diameter / shape.diameter)
    text = note_on_directions(shape, tool.flute_length, helix=tool.helix_angle, shank=shank)
    if text and tool.helix_angle == 0.0:
        text += '; a part of a campaign has `plane = "x"` or "mean" under `shape` for the others'
    return text


def _too_large(tool: ToolRow) -> Iterator[RowMistake]:
    """Yield lengths and diameters that are larger than those of which they are a part."""
    limits: dict[str, tuple[float, str]] = {}
    for small, large in _AT_MOST:
        size, limit = getattr(tool, small), getattr(tool, large)
        if size and limit and size > limit + (0.0 if small == "flute_length" else _PLAY):
            limits[small] = min(limits.get(small, (limit, large)), (limit, large))
    for small, (limit, large) in limits.items():
        columns = (small.replace("_", " "), large.replace("_", " "))
        text = f"is {_mm(getattr(tool, small))}, expected at most the {columns[1]}, {_mm(limit)}"
        yield RowMistake(columns, text)
    whole = tool.overhang + tool.clamping_length
    if tool.overall_length and tool.clamping_length and whole > tool.overall_length + _PLAY:
        text = f"is {_mm(tool.clamping_length)}, which makes {_mm(whole)} with the overhang of {_mm(tool.overhang)}, "
        text += f"expected at most the overall length, {_mm(tool.overall_length)}"
        yield RowMistake(("clamping length", "overall length", "overhang"), text)


def _of_bore(tool: ToolRow) -> Iterator[RowMistake]:
    """Yield a bore that is not smaller than the least diameter around it."""
    names = ("diameter", "effective diameter", "neck diameter")
    diameters = {name: getattr(tool, name.replace(" ", "_")) for name in names}
    stated = {name: diameter for name, diameter in diameters.items() if diameter}
    name = min(stated, key=stated.__getitem__, default="diameter")
    if stated and tool.bore >= stated[name]:
        yield RowMistake(("bore", name), f"is {_mm(tool.bore)}, expected less than the {name}, {_mm(stated[name])}")


def _of_neck(tool: ToolRow) -> Iterator[RowMistake]:
    """Yield what a neck lacks, or an end of the neck where none can be."""
    columns = ("neck diameter", "usable length", "head length", "flute length", "overhang")
    if not tool.neck_diameter:
        return
    if not tool.neck_end:
        text = "is given without usable length (LU) or head length (LH), expected where the neck ends"
        yield RowMistake(columns[:3], text)
    elif not tool.flute_length < tool.neck_end <= tool.overhang:
        text = f"ends {_mm(tool.neck_end)} from the tip, expected more than the flute length, {_mm(tool.flute_length)},"
        yield RowMistake(columns, f"{text} and at most the overhang, {_mm(tool.overhang)}")


def _mm(length: float) -> str:
    return f"{1e3 * length:g} mm"


def read_holders(
    path: str | Path,
    *,
    notes: list[str] | None = None,
    check: Callable[[HolderRow], Iterable[RowMistake]] = lambda row: (),
) -> dict[str, list[HolderRow]]:
    """Read holders from a CSV file with one segment in each row, in order from the tip-side end.

    Columns: `holder`, `length [mm]`, `outer diameter [mm]`, `material`, and optionally `inner diameter [mm]`, `core`,
    the material that fills the bore, and for cones `end outer diameter [mm]` and `end inner diameter [mm]`. See
    `read_tools` for parameters and errors.
    """

    def mistakes(row: HolderRow) -> Iterator[RowMistake]:
        yield from mistakes_of_holder(row)
        yield from check(row)

    holders: dict[str, list[HolderRow]] = {}
    for row in read_rows(path, HolderRow, check=mistakes, symbols=HOLDER_SYMBOLS, notes=notes):
        holders.setdefault(row.holder, []).append(row)
    return holders


def mistakes_of_holder(row: HolderRow) -> Iterator[RowMistake]:
    """Yield bores of a segment that are not smaller than its outer diameter, and a core without a bore."""
    ends = [("inner diameter", row.inner_diameter, "outer diameter", row.outer_diameter)]
    if row.end_outer_diameter is not None or row.end_inner_diameter is not None:
        is_cone, is_conical_bore = row.end_outer_diameter is not None, row.end_inner_diameter is not None
        ends.append(
            (
                "end inner diameter" if is_conical_bore else "inner diameter",
                row.inner_diameter if row.end_inner_diameter is None else row.end_inner_diameter,
                "end outer diameter" if is_cone else "outer diameter",
                row.outer_diameter if row.end_outer_diameter is None else row.end_outer_diameter,
            )
        )
    for name, bore, around, outer in ends:
        if row.core and bore == 0.0:
            text = f'is "{row.core}", but the {name} is 0, expected the diameter of the bore that it fills'
            yield RowMistake(("core", name), text)
        elif bore >= outer:
            yield RowMistake((name, around), f"is {_mm(bore)}, expected less than the {around}, {_mm(outer)}")
