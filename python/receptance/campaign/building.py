"""From the tables of a campaign to materials, parts, unknowns, joints and what is attached."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from receptance.beams import Part, Segment
from receptance.campaign.addresses import SPRING_FIELDS, parse_position, value_at
from receptance.campaign.conditions import parse_condition
from receptance.campaign.deviations import parse_share
from receptance.campaign.joint_building import AnyJoint, build_joint, given, started
from receptance.campaign.priors import prior_of
from receptance.campaign.workshop import Workshop
from receptance.identification.laws import Law, Power
from receptance.identification.unknowns import Unknown
from receptance.joints import GroundSpring, PointMass
from receptance.materials import STEEL, Material

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.campaign.lines import Path
    from receptance.campaign.measurement_models import CampaignTable, UnknownTable
    from receptance.campaign.models import SegmentTable

__all__ = ["Built", "build_elements"]


@dataclass
class Built:
    """What could be built; what is missing here has been reported as a mistake."""

    materials: dict[str, Material] = field(default_factory=dict)
    parts: dict[str, Part] = field(default_factory=dict)
    joints: dict[str, AnyJoint] = field(default_factory=dict)
    attachments: dict[str, PointMass | GroundSpring] = field(default_factory=dict)
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
            _segment(("parts", name, "segments", i), row, built, workshop) for i, row in enumerate(part.segments)
        ]
        whole = [segment for segment in segments if segment is not None]
        if len(whole) == len(segments):
            built.parts[name] = Part(whole, name=name)
    for address, unknown in table.unknowns.items():
        _keep(built.unknowns, address, _unknown(address, unknown, table, workshop))
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


def _segment(path: Path, row: SegmentTable, built: Built, workshop: Workshop) -> Segment | None:
    values: dict[str, Any] = row.model_dump(exclude={"tolerance", "material", "core"})
    # A material with a mistake has been reported; steel in its place lets mistakes of the dimensions be found as well.
    material = built.materials.get(row.material, STEEL)
    core = None if row.core is None else built.materials.get(row.core, STEEL)
    return workshop.make(path, Segment, **values, material=material, core=core)


def _unknown(address: str, table: UnknownTable, campaign: CampaignTable, workshop: Workshop) -> Unknown | None:
    path: Path = ("unknowns", address)
    if workshop.problems.at(path):
        return None
    values: dict[str, float | None] = {}
    for key in ("lower", "upper", "start"):
        written = getattr(table, key)
        values[key] = None if written is None else workshop.make((*path, key), value_at, address, written)
    lower, upper, start = values["lower"], values["upper"], values["start"]
    if lower is None or upper is None:
        return None
    if start is None:
        start = given(address, campaign)
        if start is not None and not lower <= start <= upper:
            workshop.problems.add(
                path,
                f"has bounds without the {start:g} that the joint is given, expected wider bounds or another start",
            )
            return None
    fields = {"address": address, "lower": lower, "upper": upper, "start": start, "scale": table.scale}
    if table.prior is not None:
        logarithmic = table.scale == "log" or (table.scale is None and lower > 0.0)
        fields["prior"] = workshop.make((*path, "prior"), prior_of, address, table.prior, logarithmic)
        if fields["prior"] is None:
            return None
    if table.power_of is None and not table.free and table.individual is None:
        if table.reference is not None or table.exponent is not None:
            workshop.problems.add(path, "has a reference or an exponent, but no `power_of`")
            return None
        return workshop.make(path, Unknown, **fields)
    return _law(path, table, fields, workshop)


def _law(path: Path, table: UnknownTable, given: dict[str, Any], workshop: Workshop) -> Law | None:
    powers: tuple[Power, ...] = ()
    if table.power_of is not None:
        if table.reference is None:
            workshop.problems.add(path, "has a `power_of` but no `reference`, expected a value of that condition")
            return None
        reference = workshop.make((*path, "reference"), parse_condition, table.reference)
        if reference is None:
            return None
        lower, upper = table.exponent or (-4.0, 4.0)
        power = workshop.make(path, Power, of=table.power_of, reference=reference.value, lower=lower, upper=upper)
        if power is None:
            return None
        powers = (power,)
    individual = 0.0
    if table.individual is not None:
        share = workshop.make((*path, "individual"), parse_share, table.individual, 'a percentage such as "5 %"')
        if share is None:
            return None
        individual = share
    return workshop.make(path, Law, **given, powers=powers, free=table.free, individual=individual)


def _attachment(
    name: str, campaign: CampaignTable, built: Built, workshop: Workshop
) -> PointMass | GroundSpring | None:
    table = campaign.attachments[name]
    path: Path = ("attachments", name)
    position = workshop.make((*path, "position"), parse_position, table.position)
    if position is None:
        return None
    if table.kind == "mass":
        values = started(name, table, ("mass", "inertia"), built)
        return workshop.make(path, PointMass, **values, part=table.part, position=position, name=name)
    values = started(name, table, SPRING_FIELDS, built)
    return workshop.make(path, GroundSpring, **values, part=table.part, position=position, name=name)
