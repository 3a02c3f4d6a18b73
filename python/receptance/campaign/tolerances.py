"""Tolerances of a campaign: which errors there are, and how far each moves which parameter of which assembly.

An error belongs to a thing: this blank's diameter, this material's density, the overhang of this clamping. It is a
standard normal number times a standard deviation for every parameter that it moves. What has the same name is one
error.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from receptance.beams import Segment
from receptance.campaign.builder import JOINTS, addresses_of, no_address
from receptance.campaign.problems import path_text
from receptance.campaign.quantities import Deviation
from receptance.fields import Member
from receptance.identification.laws import Tolerance
from receptance.identification.unknowns import covered
from receptance.materials import Material

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from receptance.assembly import Assembly
    from receptance.campaign.builder import Builder, Built
    from receptance.campaign.format import CampaignTable
    from receptance.campaign.lines import Path
    from receptance.campaign.observations import Measurement
    from receptance.fields import Element

__all__ = ["Effects", "assembly_effects", "effects_beside", "tolerances_of", "tolerances_of_measurements"]

Effects = dict[str, dict[str, float]]
"""By error, then by address: the standard deviation in SI units that the error gives the parameter."""


def tolerances_of(effects: Effects, labels: str | None = None) -> list[Tolerance]:
    """Return errors as tolerances of a fit or a prediction, perhaps of the observation with one label alone.

    A standard deviation of zero is no error.
    """
    some = {name: {a: d for a, d in moves.items() if d} for name, moves in effects.items()}
    return [Tolerance(name=name, moves=moves, labels=labels) for name, moves in some.items() if moves]


def tolerances_of_measurements(seen: Mapping[str, Measurement]) -> list[Tolerance]:
    """Return the errors of measurements; errors of the same name are one error."""
    return [one for name, measured in seen.items() for one in tolerances_of(measured.effects, name)]


def assembly_effects(name: str, campaign: CampaignTable, built: Built, builder: Builder) -> Effects:
    """Return the errors of an assembly.

    A value that the assembly sets errs on its own, by the tolerance of what it takes the place of; a tolerance of
    the assembly itself goes before all others. What is identified has no tolerance.
    """
    assembly = built.assemblies[name]
    table = campaign.assemblies[name]
    here: Path = ("assemblies", name)
    named = [address for unknown in built.unknowns.values() for address in addresses_of(unknown)]
    taken = {own for address in named for own in covered(address, assembly)}
    own_sets = {own for address in table.set for own in covered(address, assembly)}
    effects: Effects = {}

    for address, deviation in table.tolerance.items():
        path = (*here, "tolerance", address)
        addresses = sorted(covered(address, assembly))
        if not addresses:
            builder.problems.add(path, no_address(address, assembly))
        elif taken & set(addresses):
            builder.problems.add(path, "has a tolerance and is among the unknowns, expected one of the two")
        else:
            own = {a: deviation.of(assembly.get(a)) for a in addresses}
            effects.setdefault(deviation.name or path_text(path), {}).update(own)
            taken |= set(addresses)

    for address, path, deviation in _inherited(assembly, campaign, table.attachments):
        if address in taken or address not in assembly.parameters:
            continue
        title = deviation.name or path_text((*here, "set", address) if address in own_sets else path)
        effects.setdefault(title, {})[address] = deviation.of(assembly.get(address))
    return effects


def effects_beside(name: str, campaign: CampaignTable, built: Built) -> Effects:
    """Return the errors of a sensor, or of what else sat on an assembly only while it was measured."""
    effects: Effects = {}
    section = "sensors" if name in built.sensors else "attachments"
    spread = getattr(campaign, section)[name].tolerance
    point = (built.sensors if name in built.sensors else built.attachments)[name]
    for address, path, deviation in _fields((section, name), name, spread):
        if address not in built.unknowns:
            value = float(getattr(point, address.split(".", 1)[1]))
            effects.setdefault(deviation.name or path_text(path), {})[address] = deviation.of(value)
    return effects


def _inherited(
    assembly: Assembly, campaign: CampaignTable, attachments: list[str]
) -> Iterator[tuple[str, Path, Deviation]]:
    """Yield address, place in the file and deviation of what the parts of an assembly bring with them."""
    for name in assembly.elements:
        if name in campaign.joints:
            joint = campaign.joints[name]
            yield from _of_element(("joints", name), name, JOINTS[joint.kind], joint, campaign)
        elif name in campaign.parts:  # a spindle known by its receptances brings its own errors
            for index, segment in enumerate(campaign.parts[name].segments):
                place: Path = ("parts", name, "segments", index)
                yield from _of_element(place, f"{name}.segment[{index}]", Segment, segment, campaign)
    for name in attachments:
        yield from _fields(("attachments", name), name, campaign.attachments[name].tolerance)


def _of_element(
    place: Path, first: str, kind: type[Element], table: Any, campaign: CampaignTable
) -> Iterator[tuple[str, Path, Deviation]]:
    """Yield the errors of an element, of its members and of its materials; addresses begin with `first`."""
    yield from _fields(place, first, table.tolerance)
    for name, member in kind.declared.items():
        if not isinstance(member, Member):
            continue
        inside, own = getattr(table, name), f"{first}.{member.prefix}".removesuffix(".")
        if member.kind is not Material:
            yield from _of_element((*place, name), own, member.kind, inside, campaign)
        elif inside in campaign.materials:
            yield from _fields(("materials", inside), own, campaign.materials[inside].tolerance)


def _fields(place: Path, owner: str, spread: Any) -> Iterator[tuple[str, Path, Deviation]]:
    for field in type(spread).model_fields:
        deviation = getattr(spread, field)
        if deviation is not None:
            yield f"{owner}.{field}", (*place, field), deviation
