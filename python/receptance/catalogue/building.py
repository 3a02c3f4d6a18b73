"""From rows of a catalogue to assemblies: tool, joint, holder and the machine behind it, with their errors."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.assembly import Assembly
from receptance.beams import Part, Segment
from receptance.campaign.builder import Builder, expected
from receptance.campaign.element_tables import ElementTable, Of, table_of, tolerance_of
from receptance.campaign.format import AssemblyTable, CatalogueTable, PartTable
from receptance.campaign.lines import Path as Line
from receptance.campaign.problems import CampaignError, Problems
from receptance.campaign.quantities import Deviation
from receptance.campaign.tolerances import Effects, assembly_effects
from receptance.catalogue.rows import HolderRow, ToolRow, read_holders, read_tools
from receptance.identification.mapping import Place
from receptance.modal_parts import ModalPart
from receptance.terminals import MeasuredPart

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from receptance.campaign.campaign import Campaign

__all__ = ["Catalogue", "Described", "errors_of"]

_TOOL = "tool"


@dataclass(frozen=True)
class Described:
    """A tool in the machine as it is described, with its conditions and errors."""

    row: ToolRow
    place: Place
    effects: Effects


class Catalogue:
    """Tools and holders, and the machine of a campaign.

    Parameters
    ----------
    campaign : Campaign
        With a table `catalogue`: joints, materials, the machine.
    tools : str, path or sequence of ToolRow, optional
        The CSV file, by default that of the campaign.
    holders : str, path or dict of str to list of HolderRow, optional
        Likewise; parts of the campaign are holders as well.
    spindle : MeasuredPart or ModalPart, optional
        What the chain ends with, behind the machine that the campaign describes; by default the file that it names, if
        it names one.
    errors : dict, optional
        Further errors: by name and address the standard deviation in SI units, such as `errors_of` gives.

    Raises
    ------
    CampaignError
        The campaign has no `catalogue`, or a row has a mistake; all of them at once, with their lines. It is a
        ValueError.
    """

    def __init__(
        self,
        campaign: Campaign,
        tools: str | Path | Sequence[ToolRow] | None = None,
        holders: str | Path | Mapping[str, list[HolderRow]] | None = None,
        *,
        spindle: MeasuredPart | ModalPart | None = None,
        errors: Effects | None = None,
    ) -> None:
        table = campaign.table.catalogue
        if table is None:
            raise CampaignError.about(campaign.file, "there is no [catalogue], expected one with the `machine`")
        self.campaign, self.table = campaign, table
        self.spindle = spindle if spindle is not None or table.spindle is None else _spindle(table.spindle, campaign)
        self.errors = errors or {}
        self.file = _source(tools, table.tools, campaign, "tools")
        given = tools if isinstance(tools, Sequence) and not isinstance(tools, str) else read_tools(self.file)
        self.tools: tuple[ToolRow, ...] = tuple(given)
        self._holders: dict[str, PartTable] = dict(campaign.table.parts)
        self._parts: dict[str, Part] = dict(campaign.built.parts)
        self._read_holders(holders)
        self._check()

    def __len__(self) -> int:
        return len(self.tools)

    def __iter__(self) -> Iterator[Described]:
        """Assemblies one after the other; none is kept."""
        return map(self.described, self.tools)

    def described(self, row: ToolRow) -> Described:
        """Return the assembly of a row."""
        name = f"{self.file.name}: {row.name}"
        joint = row.joint or self.table.joint
        tool = PartTable.model_construct(segments=_segments(row, self.table))
        chain = [_TOOL, *([joint] if joint else []), row.holder, *self.table.machine]
        campaign, built = self.campaign.table, self.campaign.built
        parts = {**self._parts, _TOOL: Part([_segment(one, self.campaign) for one in tool.segments], name=_TOOL)}
        elements: dict[str, Any] = {**parts, **built.joints}
        own: list[Any] = [elements[link] for link in chain]
        points = [built.attachments[link] for link in self.table.attachments]
        assembly = Assembly(own if self.spindle is None else [*own, self.spindle], points)
        as_table = AssemblyTable.model_construct(chain=chain, attachments=self.table.attachments, set={}, tolerance={})
        together = campaign.model_copy(update={"parts": {**self._holders, _TOOL: tool}, "assemblies": {name: as_table}})
        effects = assembly_effects(
            name, together, replace(built, assemblies={name: assembly}), Builder(Problems({}), {})
        )
        return Described(row, Place(assembly, row.name, "", row.conditions), {**effects, **self.errors})

    def _read_holders(self, holders: str | Path | Mapping[str, list[HolderRow]] | None) -> None:
        if holders is None and self.table.holders is None:
            return
        file = _source(holders, self.table.holders, self.campaign, "holders")
        found = holders if isinstance(holders, Mapping) else read_holders(file)
        lines: dict[Line, int] = {(name, i): row.line for name, rows in found.items() for i, row in enumerate(rows)}
        problems = Problems(lines)
        builder = Builder(problems, {"materials": list(self.campaign.table.materials)})
        builder.built = self.campaign.built
        for name, rows in found.items():
            if name == _TOOL or name in self._parts or name in self.campaign.built.joints:
                problems.add((name, 0), f'is "{name}", the name of something else, expected another')
            segments = []
            for index, row in enumerate(rows):
                at = (name, index)
                for key, material in (("material", row.material), ("core", row.core)):
                    if material:
                        builder.known((*at, key), material, "materials")
                one = table_of(Of(Segment)).model_construct(
                    length=row.length,
                    outer_diameter=row.outer_diameter,
                    inner_diameter=row.inner_diameter,
                    material=row.material,
                    core=row.core or None,
                )
                segments.append((one, builder.segment(at, one)))
            self._holders[name] = PartTable.model_construct(segments=[one for one, _ in segments])
            self._parts[name] = Part([made for _, made in segments if made is not None], name=name)
        if problems.found:
            raise CampaignError(file, problems.found)

    def _check(self) -> None:
        """Names and dimensions of all rows, and once that the machine fits together."""
        problems = Problems({(row.name,): row.line for row in self.tools})
        built = self.campaign.built
        for row in self.tools:
            at = (row.name,)
            for key, name, known in (
                ("holder", row.holder, self._parts),
                ("joint", row.joint, built.joints),
                ("material", row.material, built.materials),
            ):
                if name and name not in known:
                    problems.add((*at, key), f'is "{name}", which is not known{expected(name, known)}')
            if row.material in built.materials:
                try:
                    for one in _segments(row, self.table):
                        _segment(one, self.campaign)
                except ValueError as error:
                    problems.add(at, str(error).removeprefix("Segment: "))
        if problems.found:
            raise CampaignError(self.file, problems.found)
        try:
            self.described(self.tools[0])
        except (ValueError, TypeError) as error:
            raise CampaignError.about(self.campaign.file, f"catalogue: {error}") from error


def errors_of(name: str, addresses: Sequence[str], covariance: ArrayLike) -> Effects:
    """Return parameters that err together as independent errors, from their covariance.

    Parameters
    ----------
    name : str
        What the errors belong to.
    addresses : sequence of str
        The parameters, `p` of them.
    covariance : array_like
        `(p, p)` in SI units.

    Examples
    --------
    >>> errors_of("spindle", ["spindle.a", "spindle.b"], [[4.0, 0.0], [0.0, 1.0]])
    {'spindle, error 1': {'spindle.a': 2.0}, 'spindle, error 2': {'spindle.b': 1.0}}
    """
    matrix = _checks.unmasked(f"errors of {name}", "covariance", covariance, np.float64)
    if matrix.shape != (len(addresses), len(addresses)) or not np.isfinite(matrix).all():
        raise ValueError(
            f"errors of {name}: covariance has shape {matrix.shape}, expected finite {(len(addresses),) * 2}"
        )
    scale = np.sqrt(np.diag(matrix))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    # In the order of the parameters where these are independent, and with a sign that does not depend on the solver.
    root = root[:, np.argsort(np.argmax(np.abs(root / scale[:, None]), axis=0), kind="stable")]
    root = root * np.where(root[np.argmax(np.abs(root), axis=0), np.arange(len(root))] < 0.0, -1.0, 1.0)
    return {
        f"{name}, error {i + 1}": {a: float(v) for a, v in zip(addresses, column, strict=True) if v}
        for i, column in enumerate(root.T)
        if column.any()
    }


def _spindle(name: str, campaign: Campaign) -> MeasuredPart:
    from receptance.spindle import read_spindle

    try:
        return read_spindle(campaign.file.parent / name)
    except (OSError, ValueError) as error:
        raise CampaignError.about(campaign.file, f"catalogue.spindle: {error}") from error


def _source(given: object, written: str | None, campaign: Campaign, what: str) -> Path:
    if isinstance(given, (str, Path)):
        return Path(given)
    if given is not None:
        return Path(what)
    if written is None:
        text = f"there is no file with {what}, expected `{what}` under [catalogue] or the name of one"
        raise CampaignError.about(campaign.file, text)
    return campaign.file.parent / written


def _segments(row: ToolRow, table: CatalogueTable) -> list[ElementTable]:
    """The fluted part and the shank, as far as there is any."""
    spread = table.tolerance
    shank = row.overhang - row.flute_length
    pieces = [
        (row.flute_length, row.effective_diameter, "effective diameter", spread.effective_diameter),
        (shank, row.diameter, "diameter", spread.diameter),
    ]
    # An overhang of flutes alone is clamped shorter or longer there.
    own = [piece for piece in pieces if piece[0] > 1e-9]
    found = []
    for index, (length, diameter, what, deviation) in enumerate(own):
        overhang = _named(spread.overhang, row, "overhang", row.overhang) if index == len(own) - 1 else None
        found.append(
            table_of(Of(Segment)).model_construct(
                length=length,
                outer_diameter=diameter,
                inner_diameter=row.bore,
                material=row.material,
                tolerance=tolerance_of(Of(Segment)).model_construct(
                    length=overhang, outer_diameter=_named(deviation, row, what, diameter), inner_diameter=None
                ),
            )
        )
    return found


def _named(deviation: Deviation | None, row: ToolRow, what: str, value: float) -> Deviation | None:
    """An error that belongs to one tool, absolute: a share is one of the whole overhang, not of the shank."""
    if deviation is None:
        return None
    return Deviation(deviation.of(value), False, deviation.name or f"{row.name}: {what}")


def _segment(table: ElementTable, campaign: Campaign) -> Segment:
    return Segment(
        length=table.length,
        outer_diameter=table.outer_diameter,
        inner_diameter=table.inner_diameter,
        material=campaign.built.materials[table.material],
    )
