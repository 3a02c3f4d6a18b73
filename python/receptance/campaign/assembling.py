"""From chains of names to assemblies, with what each of them sets differently."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from receptance.assembly import Assembly
from receptance.beams import Part
from receptance.campaign.addresses import parse_position, value_at
from receptance.campaign.suggestions import did_you_mean, one_of
from receptance.campaign.unknown_building import addresses_of
from receptance.campaign.workshop import expected
from receptance.coordinates import Coordinate
from receptance.identification.factors import FACTORS
from receptance.identification.unknowns import covered
from receptance.joints import GroundSpring, PointMass, Resonator
from receptance.modal_parts import ModalPart

if TYPE_CHECKING:
    from receptance.campaign.building import Built
    from receptance.campaign.joint_building import AnyJoint
    from receptance.campaign.lines import Path
    from receptance.campaign.measurement_models import CampaignTable
    from receptance.campaign.models import AssemblyTable, CoordinateTable
    from receptance.campaign.workshop import Workshop

__all__ = ["build_assemblies", "carrying", "check_unknowns", "no_address", "place", "with_sensor"]


def build_assemblies(table: CampaignTable, built: Built, workshop: Workshop) -> None:
    """Build the assemblies, as far as they are right, into `built`."""
    for name, assembly_table in table.assemblies.items():
        path: Path = ("assemblies", name)
        assembly = _plain(path, assembly_table, built, workshop)
        if assembly is not None:
            assembly = _changed(path, assembly, assembly_table, built, workshop)
        if assembly is not None:
            built.assemblies[name] = assembly


def _plain(path: Path, table: AssemblyTable, built: Built, workshop: Workshop) -> Assembly | None:
    elements: dict[str, Part | AnyJoint | ModalPart] = {**built.parts, **built.joints, **built.modal_parts}
    points = built.attachments
    if not elements.keys() >= set(table.chain) or not points.keys() >= set(table.attachments):
        return None
    chain = [elements[name] for name in table.chain]
    bare = workshop.make((*path, "chain"), Assembly, chain, motion=table.motion)
    if bare is None or not table.attachments:
        return bare
    on = [points[name] for name in table.attachments]
    return workshop.make((*path, "attachments"), Assembly, chain, on, motion=table.motion)


def _changed(path: Path, assembly: Assembly, table: AssemblyTable, built: Built, workshop: Workshop) -> Assembly | None:
    problems = workshop.problems
    for address in table.set:
        here = (*path, "set", address)
        if problems.at(here):
            continue
        own = covered(address, assembly)
        if not own:
            problems.add(here, no_address(address, assembly))
        elif any(own & covered(a, assembly) for unknown in built.unknowns.values() for a in addresses_of(unknown)):
            problems.add(here, "is set here and is among the unknowns, expected one of the two")
    if problems.at((*path, "set")):
        return None
    given = {address: value_at(address, text) for address, text in table.set.items()}
    return workshop.make((*path, "set"), assembly.replace, given) if given else assembly


def check_unknowns(table: CampaignTable, built: Built, workshop: Workshop) -> None:
    """Every unknown must be a parameter of some assembly, and no parameter may have two."""
    if len(built.assemblies) < len(workshop.named["assemblies"]) or not built.assemblies:
        return  # an assembly with a mistake may be the one that has it
    measured = {*built.sensors, *(name for one in table.measurements.values() for name in one.attachments)}
    claimed: dict[tuple[str, str], str] = {}
    for title, unknown in built.unknowns.items():
        owned = addresses_of(unknown)
        for address in unknown.reached:
            if address.split(".", 1)[0] in measured or address in FACTORS:
                continue
            found = sorted((name, own) for name, one in built.assemblies.items() for own in covered(address, one))
            if not found:
                first = next(iter(built.assemblies.values()))
                workshop.problems.add(("unknowns", title), no_address(address, first, "is a parameter of no assembly"))
            for key in found if address in owned else ():
                if key in claimed:
                    text = f'moves {key[1]}, which the unknown "{claimed[key]}" moves too, expected one of the two'
                    workshop.problems.add(("unknowns", title), text)
                    break
                claimed[key] = title


def place(path: Path, table: CoordinateTable, assembly: Assembly, workshop: Workshop) -> Coordinate | None:
    """Return a coordinate that the assembly has, or None after its mistakes are added."""
    if workshop.problems.at(path):
        return None
    if assembly.motion == "axial" and table.direction.endswith("theta"):
        problems = workshop.problems
        problems.add((*path, "direction"), f'is "{table.direction}", and nothing turns in axial motion; expected "+y"')
        return None
    position = parse_position(table.position)
    parts = {name: element for name, element in assembly.elements.items() if isinstance(element, Part)}
    name = table.part or next(iter(parts))
    if name not in parts:
        workshop.problems.add((*path, "part"), f'is "{name}", which the assembly has not{expected(name, parts)}')
        return None
    length = parts[name].length
    if position != "end" and position > length * (1.0 + 1e-9):
        text = f'is "{table.position}", expected at most the length {1e3 * length:g} mm of part "{name}"'
        workshop.problems.add((*path, "position"), text)
        return None
    direction: Literal["y", "theta"] = "theta" if table.direction.endswith("theta") else "y"
    return Coordinate(name, position, direction)


def with_sensor(assembly: Assembly, sensor: PointMass | None, at: Coordinate) -> Assembly:
    """Return the assembly with the mass of a sensor at a coordinate."""
    if sensor is None:
        return assembly
    return carrying(assembly, replace(sensor, part=at.part, position=at.position))


def carrying(assembly: Assembly, *points: PointMass | GroundSpring | Resonator) -> Assembly:
    """Return the assembly with more attached to it."""
    return Assembly(assembly.elements.values(), [*assembly.attachments.values(), *points], motion=assembly.motion)


def no_address(address: str, assembly: Assembly, what: str = "is no parameter of this assembly") -> str:
    """Return what is wrong with an address that an assembly does not have."""
    first = address.split(".", 1)[0] + "."
    own = [name for name in assembly.parameters if name.startswith(first)]
    return f"{what}{did_you_mean(address, assembly.parameters)}; expected {one_of(own or assembly.parameters)}"
