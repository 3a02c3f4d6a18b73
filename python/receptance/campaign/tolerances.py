"""Errors of dimensions, materials and positions, from the standard deviations in a campaign.

An error belongs to one object, such as the diameter of one blank, the density of one material or the overhang of one
clamping. It is a standard normal variable; each parameter that depends on it changes by its standard deviation times
that variable. Tolerances with the same name are one error.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace

from receptance.campaign.build import Builder, Built, addresses_of, unknown_address
from receptance.campaign.keys import ElementTable
from receptance.campaign.problems import KeyPath, path_text
from receptance.campaign.schema import CampaignTable
from receptance.campaign.values import Deviation
from receptance.fit.unknowns import Tolerance, covered
from receptance.model.assembly import Assembly
from receptance.model.beams import Material, Part, Segment
from receptance.model.fields import Member
from receptance.model.insertion import Insertion

Errors = dict[tuple[str, bool], dict[str, float]]
"""Standard deviations while they are collected, by name of the error, by whether they are of the logarithm (else in SI
units), and by address of the parameter."""
_LARGE = 0.2
"""Relative standard deviation above which it is that of the logarithm: the value then keeps its sign."""
Deviations = dict[str, Deviation]
"""Standard deviations by address."""
_OF_DRAWING = {
    "diameter": ("outer_diameter", "end_outer_diameter"),
    "bore": ("inner_diameter", "end_inner_diameter"),
    "length": ("length",),
}
"""Dimensions of a segment that each tolerance of a contour belongs to."""
_Inherited = tuple[str, KeyPath, Deviation]
"""Address, place in the file and standard deviation."""


def _tolerances(errors: Errors) -> tuple[Tolerance, ...]:
    """Return errors as tolerances of a fit or a prediction; standard deviations of zero are left out."""
    some = {key: {a: d for a, d in moves.items() if d} for key, moves in errors.items()}
    return tuple(Tolerance(name=name, moves=moves, relative=log) for (name, log), moves in some.items() if moves)


def _put(errors: Errors, name: str, address: str, deviation: Deviation, value: float) -> None:
    """Add the standard deviation of a parameter to the errors of a name."""
    log = deviation.relative and deviation.amount > _LARGE and value != 0.0
    errors.setdefault((name, log), {})[address] = deviation.amount if log else deviation.of(value)


def tolerances_of_assembly(name: str, campaign: CampaignTable, built: Built, builder: Builder) -> tuple[Tolerance, ...]:
    """Return the errors of an assembly of the file.

    A tolerance of the assembly itself takes precedence over those of its parts. A value that the assembly sets has an
    error of its own, with the tolerance of the value it replaces. Identified parameters have no error. Where a shank is
    inserted, the tolerances are those of the parts as drawn.
    """
    shank = built.insertions.get(name)
    assembly = built.assemblies[name] if shank is None else shank.drawn
    table = campaign.assemblies[name]
    here: KeyPath = ("assemblies", name)
    taken = _identified(assembly, built)
    errors: Errors = {}

    for address, deviation in table.tolerance.items():
        path = (*here, "tolerance", address)
        addresses = sorted(covered(address, assembly))
        if not addresses:
            builder.problems.add(path, unknown_address(address, assembly))
        elif taken & set(addresses):
            builder.problems.add(path, "has a tolerance and is among the unknowns, expected one of the two")
        else:
            _add(errors, assembly, ((a, path, deviation) for a in addresses), set())
            taken |= set(addresses)

    own = {own: (*here, "set", own) for address in table.set for own in covered(address, assembly)}
    inherited = ((a, own.get(a, path), deviation) for a, path, deviation in _inherited(assembly, campaign, {}))
    _add(errors, assembly, inherited, taken)
    if shank is not None:
        errors = _moved(errors, shank.insertion)
    return (*_tolerances(errors), *_of_spindle(assembly, built))


def _moved(errors: Errors, insertion: Insertion) -> Errors:
    """Return the errors of parts as drawn as those of the parts with the shank in the bore."""
    moved: Errors = {}
    for (name, log), deviations in errors.items():
        here = moved.setdefault((name, log), {})
        for address, deviation in deviations.items():
            for target, factor in insertion.moved(address).items():
                # A logarithm has the same deviation, whatever the factor between the values.
                here[target] = here.get(target, 0.0) + deviation * (1.0 if log else factor)
    return moved


def inherited_tolerances(
    assembly: Assembly, campaign: CampaignTable, built: Built, parts: Mapping[str, Deviations]
) -> tuple[Tolerance, ...]:
    """Return the errors of an assembly that is not in the file.

    `parts` are those of its parts that are not in the file either, with the standard deviations of their dimensions by
    address.
    """
    errors: Errors = {}
    _add(errors, assembly, _inherited(assembly, campaign, parts), _identified(assembly, built))
    return (*_tolerances(errors), *_of_spindle(assembly, built))


def _of_spindle(assembly: Assembly, built: Built) -> tuple[Tolerance, ...]:
    """Return the errors of the spindle at the end of an assembly, which its file states."""
    spindle = built.spindles.get(next(reversed(assembly.elements)))
    return () if spindle is None else spindle.tolerances


def with_attachments(
    known: Iterable[Tolerance], names: Iterable[str], campaign: CampaignTable, built: Built
) -> tuple[Tolerance, ...]:
    """Return the errors of an assembly with those of sensors and attachments on it."""
    errors = {(one.name, one.relative): dict(one.moves) for one in known}
    for name in names:
        section = "sensors" if name in built.sensors else "attachments"
        tolerance = getattr(campaign, section)[name].tolerance
        point = (built.sensors if name in built.sensors else built.attachments)[name]
        for address, path, deviation in _own((section, name), name, tolerance):
            if address not in built.unknowns:
                value = float(getattr(point, address.split(".", 1)[1]))
                _put(errors, deviation.name or path_text(path), address, deviation, value)
    return _tolerances(errors)


def _add(errors: Errors, assembly: Assembly, inherited: Iterable[_Inherited], taken: Collection[str]) -> None:
    """Add the standard deviations of parameters of an assembly, except for those that are taken."""
    for address, path, deviation in inherited:
        if address not in taken and address in assembly.parameters:
            _put(errors, deviation.name or path_text(path), address, deviation, assembly.get(address))


def _identified(assembly: Assembly, built: Built) -> set[str]:
    """Return the addresses of an assembly that are identified."""
    named = [address for unknown in built.unknowns.values() for address in addresses_of(unknown)]
    return {own for address in named for own in covered(address, assembly)}


def _inherited(assembly: Assembly, campaign: CampaignTable, parts: Mapping[str, Deviations]) -> Iterator[_Inherited]:
    """Yield the tolerances of the elements, materials and attachments of an assembly."""
    for name in assembly.elements:
        if name in parts:
            for index, segment in enumerate(assembly.parts[name].segments):
                yield from _of_segment(f"{name}.segment[{index}]", segment, parts[name], campaign)
        elif name in campaign.joints:
            joint = campaign.joints[name]
            yield from _of_element(("joints", name), name, joint, campaign)
        elif name in campaign.parts and campaign.parts[name].contour is not None:
            yield from _of_contour(name, assembly.parts[name], campaign)
        elif name in campaign.parts:  # a measured or modal spindle has errors of its own
            for index, table in enumerate(campaign.parts[name].segments):
                place: KeyPath = ("parts", name, "segments", index)
                yield from _of_element(place, f"{name}.segment[{index}]", table, campaign)
    for name in assembly.attachments:
        if name in campaign.attachments:
            yield from _own(("attachments", name), name, campaign.attachments[name].tolerance)


def _of_contour(name: str, part: Part, campaign: CampaignTable) -> Iterator[_Inherited]:
    """Yield the tolerances of a part with a contour: one error of all diameters, of all bores and of the whole length.

    An absolute standard deviation of the length is divided in proportion to the lengths.
    """
    table = campaign.parts[name]
    place: KeyPath = ("parts", name)
    for index, segment in enumerate(part.segments):
        first = f"{name}.segment[{index}]"
        for key, fields in _OF_DRAWING.items():
            deviation = getattr(table.tolerance, key)
            if deviation is None:
                continue
            if key == "length" and not deviation.relative:
                deviation = replace(deviation, amount=deviation.amount * segment.length / part.length)
            for field in fields:
                # A bore that is not there, or ends in a point, has no tolerance.
                if getattr(segment, field):
                    yield f"{first}.{field}", (*place, "tolerance", key), deviation
        if table.material is not None and table.material in campaign.materials:
            yield from _own(("materials", table.material), first, campaign.materials[table.material].tolerance)


def _of_segment(first: str, segment: Segment, own: Deviations, campaign: CampaignTable) -> Iterator[_Inherited]:
    """Yield the tolerances of a segment that is not in the file, and of its materials."""
    for address, deviation in own.items():
        if address.startswith(f"{first}."):
            yield address, (address,), deviation
    for name, member in Segment.declared.items():
        material = getattr(segment, name)
        if isinstance(member, Member) and material is not None and material.name in campaign.materials:
            place: KeyPath = ("materials", material.name)
            yield from _own(place, _prefixed(first, member), campaign.materials[material.name].tolerance)


def _of_element(place: KeyPath, first: str, table: ElementTable, campaign: CampaignTable) -> Iterator[_Inherited]:
    """Yield the tolerances of an element, of its members and of its materials; addresses begin with `first`."""
    yield from _own(place, first, table.tolerance)
    for name, member in table.element.declared.items():
        if not isinstance(member, Member):
            continue
        inside, own = getattr(table, name), _prefixed(first, member)
        if member.kind is not Material:
            yield from _of_element((*place, name), own, inside, campaign)
        elif inside in campaign.materials:
            yield from _own(("materials", inside), own, campaign.materials[inside].tolerance)


def _prefixed(first: str, member: Member) -> str:
    return f"{first}.{member.prefix}".removesuffix(".")


def _own(place: KeyPath, owner: str, tolerance: Mapping[str, Deviation]) -> Iterator[_Inherited]:
    """Yield the standard deviations that stand in one table."""
    for name, deviation in tolerance.items():
        yield f"{owner}.{name}", (*place, name), deviation
