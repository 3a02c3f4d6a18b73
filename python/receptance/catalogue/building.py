"""Assemblies from the rows of a catalogue: tool, joint, holder and machine, with their errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from receptance._text import first_of, instead_of
from receptance.campaign import Campaign, CampaignError, Deviation, Issue
from receptance.campaign.csv_rows import RowMistake
from receptance.campaign.listed_materials import listed_deviations, listed_materials, note_on_listed
from receptance.campaign.problems import path_text
from receptance.campaign.tolerances import inherited_tolerances
from receptance.catalogue.rows import (
    HolderRow,
    ToolRow,
    flutes_of,
    mistakes_of_holder,
    mistakes_of_tool,
    read_holders,
    read_tools,
)
from receptance.fit.parameters import Site
from receptance.fit.unknowns import Tolerance
from receptance.model.assembly import Assembly
from receptance.model.beams import Material, Part, Segment
from receptance.model.insertion import FIT, fits_bore
from receptance.model.terminals import MeasuredPart, ModalPart

_NO_CATALOGUE = """there is no [catalogue]; write one, such as
  [catalogue]
  machine = ["taper", "spindle"]
  joint = "collet"
  tools = "tools.csv"
with the joint and the part behind the holders, and the joint of the tools; see `receptance example machine`"""
_TOOL = "tool"
_Row = TypeVar("_Row", bound=ToolRow | HolderRow)
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
        self._listed: dict[str, Material] = {}
        self._holders: dict[str, Part] = {}
        self._names_of_holders: tuple[str, ...] = ()
        self.tools: tuple[ToolRow, ...] = ()
        # Mistakes of both files are told together.
        mistakes: list[CampaignError] = []
        with _collected(mistakes):
            self._read_holders(holders)
        with _collected(mistakes):
            self._read_tools(tools)
        if mistakes:
            raise CampaignError.of_files(mistakes)
        self._check_machine()
        self.notes += [*self._notes_on_shanks(), *self._notes_on_materials()]

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
                    of_material = listed_deviations(material.name)
                    deviations |= {f"{address}{key}": deviation for key, deviation in of_material.items()}
        return deviations

    def _read_holders(self, holders: str | Path | Mapping[str, list[HolderRow]] | None) -> None:
        """Read the holders of a file, or take those that are given, and check their names and materials."""
        if holders is None and self.table.holders is None:
            return
        file = _source(holders, self.table.holders, self.campaign, "holders")
        built = self.campaign.built
        # The names in the file are those that tools may have, also where rows have mistakes.
        names: dict[str, None] = {}

        def mistakes(row: HolderRow) -> Iterator[RowMistake]:
            if row.holder not in names and (row.holder == _TOOL or row.holder in {**built.parts, **built.joints}):
                text = f'is "{row.holder}", which is also a part or a joint of the campaign, expected another name'
                yield RowMistake(("holder",), text)
            names.setdefault(row.holder)
            for key, material in (("material", row.material), ("core", row.core)):
                if material:
                    yield from self._unknown_material(key, material, "which is not a material of the campaign")

        try:
            if isinstance(holders, Mapping):
                all_rows = [row for rows in holders.values() for row in rows]
                _check_rows(file, all_rows, mistakes_of_holder, mistakes, lambda row: row.holder)
            else:
                holders = read_holders(file, notes=self.notes, check=mistakes)
        finally:
            self._names_of_holders = tuple(names)
        for name, rows in holders.items():
            self._holders[name] = Part([self._segment_of(row) for row in rows], name=name)

    def _segment_of(self, row: HolderRow) -> Segment:
        return Segment(
            length=row.length,
            outer_diameter=row.outer_diameter,
            inner_diameter=row.inner_diameter,
            end_outer_diameter=row.end_outer_diameter,
            end_inner_diameter=row.end_inner_diameter,
            material=self.materials[row.material],
            core=self.materials[row.core] if row.core else None,
        )

    def _read_tools(self, tools: str | Path | Sequence[ToolRow] | None) -> None:
        """Read the tools of a file, or take those that are given, and check their names and dimensions."""
        if isinstance(tools, Sequence) and not isinstance(tools, str):
            _check_rows(self.file, tools, mistakes_of_tool, self._mistakes_of_tool, lambda row: row.name)
            self.tools = tuple(tools)
        else:
            self.tools = tuple(read_tools(self.file, notes=self.notes, check=self._mistakes_of_tool))

    def _mistakes_of_tool(self, row: ToolRow) -> Iterator[RowMistake]:
        """Yield the names in a row that the machine does not have, and a shank for which a holder has no room."""
        built = self.campaign.built
        for key, name, names in (
            ("holder", row.holder, (*built.parts, *self._names_of_holders)),
            ("joint", row.joint, tuple(built.joints)),
        ):
            if name and name not in names:
                yield RowMistake((key,), f'is "{name}", which is not known{instead_of(name, names)}')
        yield from self._unknown_material("material", row.material, "which is not known")
        nose = self._nose(row)
        if nose is not None and nose.core is not None and row.diameter >= nose.outer_diameter:
            text = f"is {_mm(row.diameter)}, but the nose of the holder {row.holder} is {_mm(nose.outer_diameter)} "
            text += f"thick, with a core of {_mm(nose.inner_diameter)}; expected another holder, or the diameter of "
            yield RowMistake(("diameter", "holder"), f"{text}the shank")

    def _unknown_material(self, key: str, name: str, problem: str) -> Iterator[RowMistake]:
        """Yield a mistake unless the campaign or the list has a material, and remember a listed one."""
        self._listed |= listed_materials([name], self.campaign.built.materials)
        if name not in self.materials:
            yield RowMistake((key,), f'is "{name}", {problem}{instead_of(name, self.materials)}')

    def _nose(self, row: ToolRow) -> Segment | None:
        """Return the first segment of the holder of a tool, None if its joint is in the bore or there is none."""
        built = self.campaign.built
        holder = {**built.parts, **self._holders}.get(row.holder)
        joint = built.joints.get(row.joint or self.table.joint or "")
        # A spread joint describes shank and sleeve itself, in front of the holder.
        return None if holder is None or hasattr(joint, "length") else holder.segments[0]

    def _check_machine(self) -> None:
        """Check that tools, joints, holders and the machine fit together, each combination once."""
        combinations = {(row.joint, row.holder): row for row in reversed(self.tools)}
        texts: dict[str, None] = {}
        for row in reversed(combinations.values()):
            try:
                self.assemble(row)
            except (ValueError, TypeError) as error:
                texts.setdefault(f"catalogue: {error}")
        if texts:
            raise CampaignError(self.campaign.file, [Issue((), text) for text in texts])

    def _notes_on_shanks(self) -> Iterator[str]:
        """Yield where the shank of tools is another one than the core of the holder, or fits its empty bore."""
        alike: dict[tuple[str, str, float], list[ToolRow]] = {}
        for tool in self.tools:
            alike.setdefault((tool.holder, tool.joint, tool.diameter), []).append(tool)
        for (holder, _, shank), rows in alike.items():
            row = rows[0]
            nose = self._nose(row)
            if nose is None or fits_bore(shank, nose.inner_diameter) == (nose.core is not None):
                continue
            lines = first_of([str(tool.line) for tool in rows])
            place = f"{self.file.name}, line{'s' if len(rows) > 1 else ''} {lines}, diameter: "
            if nose.core is None:
                yield (
                    f"{place}the shank of {_mm(shank)} fits the bore of {_mm(nose.inner_diameter)} in the nose of the "
                    f'holder {holder}, which is empty; where the shank is in it, state core = "{row.material}" there'
                )
            else:
                yield (
                    f"{place}the shank has {_mm(shank)}, but the core in the nose of the holder {holder} "
                    f"{_mm(nose.inner_diameter)}, expected the same within {100.0 * FIT:g} %; add a holder with the "
                    f"inner diameter {_mm(shank)} and this core, and name it in the column holder"
                )

    def _notes_on_materials(self) -> list[str]:
        return [f"{path_text(('materials', name))}: {note_on_listed(name)}" for name in self._listed]


@contextmanager
def _collected(mistakes: list[CampaignError]) -> Iterator[None]:
    """Add the mistakes of a file to a list."""
    try:
        yield
    except CampaignError as error:
        mistakes.append(error)


def _check_rows(
    file: Path,
    rows: Sequence[_Row],
    of_dimensions: Callable[[_Row], Iterable[RowMistake]],
    of_names: Callable[[_Row], Iterable[RowMistake]],
    name_of: Callable[[_Row], str],
) -> None:
    """Raise with all mistakes of rows that are not from a file."""
    problems: list[Issue] = []
    for row in rows:
        mistakes = (*of_dimensions(row), *of_names(row))
        problems += [Issue((name_of(row), mistake.columns[0]), mistake.text) for mistake in mistakes]
    if problems:
        raise CampaignError(file, problems)


def _mm(length: float) -> str:
    return f"{1e3 * length:.6g} mm"


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
