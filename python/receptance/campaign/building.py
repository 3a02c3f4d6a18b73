"""From the tables of a campaign to materials, parts, unknowns, joints and what is attached."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from receptance.beams import Part, Segment
from receptance.campaign.addresses import SPRING_FIELDS, parse_position
from receptance.campaign.joint_building import AnyJoint, build_joint, started
from receptance.campaign.unknown_building import build_unknown
from receptance.campaign.workshop import Workshop
from receptance.joints import GroundSpring, PointMass, Resonator
from receptance.materials import STEEL, Material
from receptance.modal_parts import ModalPart, Mode
from receptance.taper.body import as_rigid
from receptance.terminals import RESIDUALS

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.campaign.lines import Path
    from receptance.campaign.measurement_models import CampaignTable
    from receptance.campaign.models import SegmentTable
    from receptance.identification.unknowns import Unknown

__all__ = ["Built", "build_elements", "build_segment"]

_STAND_IN_HZ = 1000.0
"""Frequency of a mode until the measured FRFs give its start."""


@dataclass
class Built:
    """What could be built; what is missing here has been reported as a mistake."""

    materials: dict[str, Material] = field(default_factory=dict)
    parts: dict[str, Part] = field(default_factory=dict)
    modal_parts: dict[str, ModalPart] = field(default_factory=dict)
    joints: dict[str, AnyJoint] = field(default_factory=dict)
    attachments: dict[str, PointMass | GroundSpring | Resonator] = field(default_factory=dict)
    sensors: dict[str, PointMass] = field(default_factory=dict)
    unknowns: dict[str, Unknown] = field(default_factory=dict)
    assemblies: dict[str, Assembly] = field(default_factory=dict)


def build_elements(table: CampaignTable, workshop: Workshop) -> Built:
    """Build all that assemblies consist of, as far as it is right."""
    built = Built()
    for name, material in table.materials.items():
        values = material.model_dump(exclude={"tolerance"})
        _keep(built.materials, name, workshop.make(("materials", name), Material, **values, name=name))
    for name, part in table.parts.items():
        segments = [
            build_segment(("parts", name, "segments", i), row, built, workshop) for i, row in enumerate(part.segments)
        ]
        whole = [segment for segment in segments if segment is not None]
        if len(whole) == len(segments):
            made = Part(whole, name=name)
            built.parts[name] = as_rigid(made) if part.rigid else made
    for address, unknown in table.unknowns.items():
        _keep(built.unknowns, address, build_unknown(address, unknown, table, workshop))
    for name in table.modal_parts:
        _keep(built.modal_parts, name, _modal_part(name, table, built, workshop))
    for name in table.joints:
        _keep(built.joints, name, build_joint(name, table, built, workshop))
    for name in table.attachments:
        _keep(built.attachments, name, _attachment(name, table, built, workshop))
    for name, sensor in table.sensors.items():
        values = started(name, sensor, ("mass", "inertia"), built)
        _keep(built.sensors, name, workshop.make(("sensors", name), PointMass, **values, name=name))
    return built


def _keep(store: dict[str, Any], name: str, made: Any) -> None:
    if made is not None:
        store[name] = made


def build_segment(path: Path, row: SegmentTable, built: Built, workshop: Workshop) -> Segment | None:
    """Return a segment, or None after its mistakes are added."""
    values: dict[str, Any] = row.model_dump(exclude={"tolerance", "material", "core"})
    # A material with a mistake has been reported; steel in its place lets mistakes of the dimensions be found as well.
    material = built.materials.get(row.material, STEEL)
    core = None if row.core is None else built.materials.get(row.core, STEEL)
    return workshop.make(path, Segment, **values, material=material, core=core)


def _modal_part(name: str, campaign: CampaignTable, built: Built, workshop: Workshop) -> ModalPart | None:
    table = campaign.modal_parts[name]
    path: Path = ("modal_parts", name)
    modes = []
    for index, row in enumerate(table.modes):
        values = started(f"{name}.mode[{index}]", row, Mode.columns_of, built)
        here: Path = (*path, "modes", index)
        shapes = {f"{name}.mode[{index}].{key}" for key in Mode.columns_of if key.startswith(("y", "theta"))}
        if values["frequency_hz"] is None:
            if not table.identify:
                text = "has no frequency_hz, expected one, or `identify = true` for the whole modal part"
                workshop.problems.add(here, text)
                continue
            values["frequency_hz"] = _STAND_IN_HZ
        unknown = table.identify or not shapes.isdisjoint(campaign.unknowns)
        if not (row.y or row.theta or row.y_imaginary or row.theta_imaginary or unknown):
            workshop.problems.add(here, "has no mode shape, expected y or theta, or one of them among the unknowns")
        modes.append(workshop.make(here, Mode, **values))
    if None in modes or len(modes) < len(table.modes):
        return None
    return workshop.make(path, ModalPart, modes=modes, **started(name, table, RESIDUALS, built), name=name)


def _attachment(
    name: str, campaign: CampaignTable, built: Built, workshop: Workshop
) -> PointMass | GroundSpring | Resonator | None:
    table = campaign.attachments[name]
    path: Path = ("attachments", name)
    position = workshop.make((*path, "position"), parse_position, table.position)
    if position is None:
        return None
    if table.kind == "mass":
        values = started(name, table, ("mass", "inertia"), built)
        return workshop.make(path, PointMass, **values, part=table.part, position=position, name=name)
    if table.kind == "resonator":
        values = started(name, table, Resonator.columns_of, built)
        return workshop.make(path, Resonator, **values, part=table.part, position=position, name=name)
    values = started(name, table, SPRING_FIELDS, built)
    shape = {"length": table.length, "points": table.points, "weights": tuple(table.weights)}
    return workshop.make(path, GroundSpring, **values, **shape, part=table.part, position=position, name=name)
