"""CSV files of a catalogue: tools and holders as rows below a header with units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from receptance import units
from receptance.campaign.csv_rows import DerivedFrom, ShareOf, read_rows
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


def read_tools(path: str | Path, *, notes: list[str] | None = None) -> list[ToolRow]:
    """Read tools from a CSV file.

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
        A list to which remarks for the user are added: units by the standard, and columns that were not needed.

    Raises
    ------
    CampaignError
        The file has mistakes; all of them are listed with their lines. It is a ValueError.
    OSError
        The file does not exist or cannot be opened.
    """
    lines: dict[str, int] = {}

    def mistakes(tool: ToolRow) -> Iterator[tuple[str, str]]:
        if tool.name in lines:
            yield "name", f'is "{tool.name}", as in line {lines[tool.name]}, expected another name'
        lines.setdefault(tool.name, tool.line)
        if tool.flute_length and not (tool.effective_diameter or tool.core_diameter):
            text = "is empty, but the tool has flutes; expected the diameter of the round bar with their bending "
            yield "effective diameter", f"{text}stiffness, or `core diameter` and the number of teeth"
        elif tool.core_diameter:
            yield from _of_flutes(tool)
        else:
            yield from _contradictions(tool)

    return read_rows(path, ToolRow, check=mistakes, symbols=TOOL_SYMBOLS, notes=notes)


def _of_flutes(tool: ToolRow) -> Iterator[tuple[str, str]]:
    """Yield what the section of flutes lacks, or excludes."""
    if tool.effective_diameter:
        yield "core diameter", "is given beside an effective diameter, expected one of the two"
    elif not tool.flute_length:
        yield "core diameter", "is given without a flute length, expected it as well"
    elif tool.teeth is None:
        yield "teeth", "is empty, expected the number of flutes, because the row has a core diameter"
    elif tool.bore:
        yield "bore", "is given beside a core diameter, but the section of flutes is solid, expected one of the two"
    else:
        try:
            flutes_of(tool)
        except ValueError as error:
            yield "core diameter", f"makes no section of flutes: {str(error).partition(': ')[2]}"
        else:
            yield from _contradictions(tool)


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


def _contradictions(tool: ToolRow) -> Iterator[tuple[str, str]]:
    """Yield lengths and diameters of a row that exclude each other."""
    for small, large in _AT_MOST:
        size, limit = getattr(tool, small), getattr(tool, large)
        if size and limit and size > limit + (0.0 if small == "flute_length" else _PLAY):
            name = large.replace("_", " ")
            yield small.replace("_", " "), f"is {1e3 * size:g} mm, expected at most the {name}, {1e3 * limit:g} mm"
            return
    whole = tool.overhang + tool.clamping_length
    if tool.overall_length and tool.clamping_length and whole > tool.overall_length + _PLAY:
        text = f"is {1e3 * tool.clamping_length:g} mm, which makes {1e3 * whole:g} mm with the overhang of "
        yield (
            "clamping length",
            f"{text}{1e3 * tool.overhang:g} mm, expected at most the overall length, {1e3 * tool.overall_length:g} mm",
        )
    if not tool.neck_diameter:
        return
    if not tool.neck_end:
        yield "neck diameter", "is given without usable length (LU) or head length (LH), expected where the neck ends"
    elif not tool.flute_length < tool.neck_end <= tool.overhang:
        text = f"ends {1e3 * tool.neck_end:g} mm from the tip, expected more than the flute length, "
        yield (
            "neck diameter",
            f"{text}{1e3 * tool.flute_length:g} mm, and at most the overhang, {1e3 * tool.overhang:g} mm",
        )


def read_holders(path: str | Path, *, notes: list[str] | None = None) -> dict[str, list[HolderRow]]:
    """Read holders from a CSV file with one segment in each row, in order from the tip-side end.

    Columns: `holder`, `length [mm]`, `outer diameter [mm]`, `material`, and optionally `inner diameter [mm]`, `core`,
    the material that fills the bore, and for cones `end outer diameter [mm]` and `end inner diameter [mm]`. See
    `read_tools` for parameters and errors.
    """
    holders: dict[str, list[HolderRow]] = {}
    for row in read_rows(path, HolderRow, symbols=HOLDER_SYMBOLS, notes=notes):
        holders.setdefault(row.holder, []).append(row)
    return holders
