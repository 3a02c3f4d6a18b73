"""CSV files of a catalogue: tools and holders as rows below a header with units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from receptance import units
from receptance.campaign.csv_rows import ShareOf, read_rows


@dataclass(frozen=True, kw_only=True)
class ToolRow:
    """A tool in its holder; lengths in m."""

    name: str
    """Name, unique in the catalogue."""
    line: int
    """Line of the file."""
    holder: str
    """Name of the holder."""
    material: str
    """Name of the material."""
    overhang: Annotated[float, units.LENGTH]
    """Length from the holder's face to the tip."""
    diameter: Annotated[float, units.LENGTH]
    """Diameter of the shank."""
    joint: str = ""
    """Name of the joint; empty if the row names none."""
    bore: Annotated[float, units.LENGTH_OR_ZERO] = 0.0
    """Diameter of a coolant bore."""
    flute_length: Annotated[float, units.LENGTH_OR_ZERO] = 0.0
    """Length of the fluted part; zero without flutes."""
    effective_diameter: Annotated[float, units.LENGTH, ShareOf("diameter")] = 0.0
    """Diameter of the round bar with the same bending stiffness; zero without flutes."""
    teeth: int | None = None
    """Number of teeth."""
    conditions: dict[str, float] = field(default_factory=dict)
    """Other columns with numbers, in SI units, for laws of joints."""


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
    lines: dict[str, int] = {}

    def mistakes(tool: ToolRow) -> Iterator[tuple[str, str]]:
        if tool.name in lines:
            yield "name", f'is "{tool.name}", as in line {lines[tool.name]}, expected another name'
        lines.setdefault(tool.name, tool.line)
        if tool.flute_length and not tool.effective_diameter:
            text = "is empty, but the tool has flutes; expected the diameter of the round bar with their bending "
            yield "effective diameter", f"{text}stiffness"
        elif tool.flute_length > tool.overhang:
            text = f"is {1e3 * tool.flute_length:g} mm, expected at most the overhang, {1e3 * tool.overhang:g} mm"
            yield "flute length", text

    return read_rows(path, ToolRow, check=mistakes)


def read_holders(path: str | Path) -> dict[str, list[HolderRow]]:
    """Read holders from a CSV file with one segment in each row, in order from the tip-side end.

    Columns: `holder`, `length [mm]`, `outer diameter [mm]`, `material`, and optionally `inner diameter [mm]`, `core`,
    the material that fills the bore, and for cones `end outer diameter [mm]` and `end inner diameter [mm]`. See
    `read_tools` for parameters and errors.
    """
    holders: dict[str, list[HolderRow]] = {}
    for row in read_rows(path, HolderRow):
        holders.setdefault(row.holder, []).append(row)
    return holders
