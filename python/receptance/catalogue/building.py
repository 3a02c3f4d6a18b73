"""Assemblies from the rows of a catalogue: tool, joint, holder and machine, with their errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from receptance._text import instead_of
from receptance.campaign import Campaign, CampaignError, Deviation, Issue
from receptance.campaign.listed_materials import listed_deviations, listed_materials, note_on_listed
from receptance.campaign.problems import path_text
from receptance.campaign.tolerances import inherited_tolerances
from receptance.catalogue.rows import HolderRow, ToolRow, flutes_of, read_holders, read_tools
from receptance.fit.parameters import Site
from receptance.fit.unknowns import Tolerance
from receptance.model.assembly import Assembly
from receptance.model.beams import STEEL, Material, Part, Segment
from receptance.model.terminals import MeasuredPart, ModalPart

_NO_CATALOGUE = """there is no [catalogue]; write one, such as
  [catalogue]
  machine = ["taper", "spindle"]
  joint = "collet"
  tools = "tools.csv"
with the joint and the part behind the holders, and the joint of the tools; see `receptance example machine`"""
_TOOL = "tool"
_SHORTEST = 1e-9
"""Length in m below which the fluted part or the shank of a tool is left out."""


@dataclass(frozen=True)
class ToolAssembly:
    """A tool in the machine, with unknowns at their start values.

    `tolerances` are its errors.
    """

    row: ToolRow
    site: Site
    tolerances: tuple[Tolerance, ...]


class Catalogue:
    """Tools and holders, and the machine of a campaign.

    Parameters
    ----------
    campaign : Campaign
        A campaign with the table `catalogue`; it describes joints, materials and the machine.
    tools : str, path or sequence of ToolRow, optional
        The CSV file or its rows; by default the file that the campaign names.
    holders : str, path or dict of str to list of HolderRow, optional
        Likewise; parts of the campaign are holders as well.
    spindle : MeasuredPart or ModalPart, optional
        Last element of the chain, behind the machine of the campaign; by default the one that the campaign names, with
        its errors, if it names one.
    errors : iterable of Tolerance, optional
        Further errors, such as `receptance.coupling.mode_tolerances` of the spindle.

    Raises
    ------
    CampaignError
        The campaign has no table `catalogue`, or rows have mistakes; all of them are listed with their lines. It is a
        ValueError.
    """

    def __init__(
        self,
        campaign: Campaign,
        tools: str | Path | Sequence[ToolRow] | None = None,
        holders: str | Path | Mapping[str, list[HolderRow]] | None = None,
        *,
        spindle: MeasuredPart | ModalPart | None = None,
        errors: Iterable[Tolerance] = (),
    ) -> None:
        table = campaign.table.catalogue
        if table is None:
            raise CampaignError.about(campaign.file, _NO_CATALOGUE)
        self.campaign, self.table = campaign, table
        named = None if table.spindle is None else campaign.built.spindles.get(table.spindle)
        if table.spindle is not None and named is None:
            text = f"catalogue.spindle: {campaign.built.unidentified[table.spindle]}"
            raise CampaignError.about(campaign.file, text)
        self.spindle = named.part if spindle is None and named is not None else spindle
        self.errors = tuple(errors)
        self.notes: list[str] = []
        """What a user should know of the files: units, columns that are not needed, and listed materials."""
        self.file = _source(tools, table.tools, campaign, "tools")
        rows = (
            tools
            if isinstance(tools, Sequence) and not isinstance(tools, str)
            else read_tools(self.file, notes=self.notes)
        )
        self.tools: tuple[ToolRow, ...] = tuple(rows)
        self._listed = listed_materials((row.material for row in self.tools), campaign.built.materials)
        self._holders: dict[str, Part] = {}
        self._read_holders(holders)
        self._check_tools()
        self.notes += [f"{path_text(('materials', name))}: {note_on_listed(name)}" for name in self._listed]

    def __len__(self) -> int:
        return len(self.tools)

    def __iter__(self) -> Iterator[ToolAssembly]:
        """Yield the assembly of each tool; none is stored."""
        return map(self.assemble, self.tools)

    @property
    def materials(self) -> dict[str, Material]:
        """Materials of the campaign, and those of the list that rows name."""
        return {**self._listed, **self.campaign.built.materials}

    def assemble(self, row: ToolRow) -> ToolAssembly:
        """Return the assembly of a row with its errors."""
        built = self.campaign.built
        segments, deviations = self._segments(row)
        joint = row.joint or self.table.joint
        chain = [_TOOL, *([joint] if joint else []), row.holder, *self.table.machine]
        elements: dict[str, Any] = {
            **built.parts,
            **self._holders,
            _TOOL: Part(segments, name=_TOOL),
            **built.joints,
        }
        links: list[Any] = [elements[name] for name in chain]
        if self.spindle is not None:
            links.append(self.spindle)
        assembly = Assembly(links, [built.attachments[name] for name in self.table.attachments])
        parts: dict[str, dict[str, Deviation]] = {**{name: {} for name in self._holders}, _TOOL: deviations}
        for name in parts:
            if name in assembly.parts:
                parts[name] = parts[name] | self._of_materials(assembly.parts[name])
        inherited = inherited_tolerances(assembly, self.campaign.table, self.campaign.built, parts)
        by_name = {tolerance.name: tolerance for tolerance in (*inherited, *self.errors)}
        return ToolAssembly(row, Site(assembly, row.name, "", row.conditions), tuple(by_name.values()))

    def _segments(self, row: ToolRow) -> tuple[list[Segment], dict[str, Deviation]]:
        """Return the fluted part, the neck and the shank of a tool, and the standard deviations of their dimensions."""
        tolerance = self.table.tolerance
        shape = flutes_of(row) if row.core_diameter else None
        fluted = row.effective_diameter if shape is None else shape.diameter
        pieces = [
            (row.flute_length, fluted, "effective diameter", tolerance.effective_diameter),
            (max(row.neck_end - row.flute_length, 0.0), row.neck_diameter, "neck diameter", tolerance.diameter),
            (row.overhang - max(row.flute_length, row.neck_end), row.diameter, "diameter", tolerance.diameter),
        ]
        pieces = [piece for piece in pieces if piece[0] > _SHORTEST]
        segments: list[Segment] = []
        deviations: dict[str, Deviation | None] = {}
        for index, (length, diameter, key, deviation) in enumerate(pieces):
            segment = f"{_TOOL}.segment[{index}]"
            deviations[f"{segment}.outer_diameter"] = _of_tool(deviation, row, key, diameter)
            if index == len(pieces) - 1:  # the clamped end, so that an error of the overhang changes its length
                deviations[f"{segment}.length"] = _of_tool(tolerance.overhang, row, "overhang", row.overhang)
            segments.append(
                Segment(
                    length=length,
                    outer_diameter=diameter,
                    inner_diameter=row.bore,
                    shape=shape if index == 0 else None,
                    material=self.materials[row.material],
                )
            )
        return segments, {address: deviation for address, deviation in deviations.items() if deviation is not None}

    def _of_materials(self, part: Part) -> dict[str, Deviation]:
        """Return the standard deviations of listed materials in a part, by address."""
        deviations: dict[str, Deviation] = {}
        for index, segment in enumerate(part.segments):
            for prefix, material in (("", segment.material), ("core.", segment.core)):
                if material is not None and material.name in self._listed:
                    address = f"{part.name}.segment[{index}].{prefix}"
                    deviations |= {f"{address}{key}": one for key, one in listed_deviations(material.name).items()}
        return deviations

    def _read_holders(self, holders: str | Path | Mapping[str, list[HolderRow]] | None) -> None:
        if holders is None and self.table.holders is None:
            return
        file = _source(holders, self.table.holders, self.campaign, "holders")
        rows = holders if isinstance(holders, Mapping) else read_holders(file, notes=self.notes)
        built = self.campaign.built
        of_holders = (name for holder in rows.values() for row in holder for name in (row.material, row.core))
        self._listed |= listed_materials(of_holders, built.materials)
        materials = self.materials
        problems: list[Issue] = []
        for name, holder_rows in rows.items():
            if name == _TOOL or name in built.parts or name in built.joints:
                text = f'is "{name}", which is also a part or a joint of the campaign, expected another name'
                problems.append(Issue((name, 0), text, holder_rows[0].line))
            segments = []
            for index, row in enumerate(holder_rows):
                for key, material in (("material", row.material), ("core", row.core)):
                    if material and material not in materials:
                        text = f'is "{material}", which is not a material of the campaign'
                        text += instead_of(material, materials)
                        problems.append(Issue((name, index, key), text, row.line))
                try:
                    segments.append(
                        Segment(
                            length=row.length,
                            outer_diameter=row.outer_diameter,
                            inner_diameter=row.inner_diameter,
                            end_outer_diameter=row.end_outer_diameter,
                            end_inner_diameter=row.end_inner_diameter,
                            # An unknown material was reported; with steel in its place dimensions are checked as well.
                            material=materials.get(row.material, STEEL),
                            core=materials.get(row.core, STEEL) if row.core else None,
                        )
                    )
                except ValueError as error:
                    problems.append(Issue((name, index), str(error).removeprefix("Segment: "), row.line))
            if segments:
                self._holders[name] = Part(segments, name=name)
        if problems:
            raise CampaignError(file, problems)

    def _check_tools(self) -> None:
        """Check names and dimensions of all rows, and that the machine fits together."""
        problems: list[Issue] = []
        built = self.campaign.built
        for row in self.tools:
            for key, name, names in (
                ("holder", row.holder, {**built.parts, **self._holders}),
                ("joint", row.joint, built.joints),
                ("material", row.material, self.materials),
            ):
                if name and name not in names:
                    text = f'is "{name}", which is not known{instead_of(name, names)}'
                    problems.append(Issue((row.name, key), text, row.line))
            if row.material in self.materials:
                try:
                    self._segments(row)
                except ValueError as error:
                    problems.append(Issue((row.name,), str(error).removeprefix("Segment: "), row.line))
        if problems:
            raise CampaignError(self.file, problems)
        try:
            self.assemble(self.tools[0])
        except (ValueError, TypeError) as error:
            raise CampaignError.about(self.campaign.file, f"catalogue: {error}") from error


def _source(rows: object, named: str | None, campaign: Campaign, key: str) -> Path:
    """Return the file of tools or holders, for messages also where rows were given instead."""
    if isinstance(rows, (str, Path)):
        return Path(rows)
    if rows is not None:
        return Path(key)
    if named is None:
        text = f"there is no file with {key}, expected `{key}` under [catalogue] or the name of one"
        raise CampaignError.about(campaign.file, text)
    return campaign.file.parent / named


def _of_tool(deviation: Deviation | None, row: ToolRow, key: str, value: float) -> Deviation | None:
    """Return a standard deviation as an error of one tool, absolute: a share of the overhang, not of the shank."""
    if deviation is None:
        return None
    return replace(deviation, amount=deviation.of(value), relative=False, name=deviation.name or f"{row.name}: {key}")
