"""From the tables of a campaign to joints of each kind."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from receptance.beams import Section
from receptance.campaign.addresses import SPRING_FIELDS
from receptance.campaign.models import ModalPartTable
from receptance.collet import ColletJoint
from receptance.joints import PointJoint
from receptance.materials import STEEL
from receptance.microslip import MicroslipJoint
from receptance.spread import SpreadJoint

if TYPE_CHECKING:
    from receptance.campaign.building import Built
    from receptance.campaign.joint_models import ColletJointTable, SectionTable, SpreadJointTable
    from receptance.campaign.lines import Path
    from receptance.campaign.measurement_models import CampaignTable
    from receptance.campaign.workshop import Workshop

__all__ = ["AnyJoint", "build_joint", "given", "started"]

AnyJoint = PointJoint | SpreadJoint | ColletJoint | MicroslipJoint


def given(address: str, campaign: CampaignTable) -> float | None:
    """Return the value that the file gives a joint's parameter: where the fit starts unless it says otherwise."""
    owner, *inside, name = address.split(".")
    table: Any = campaign.joints.get(owner, campaign.modal_parts.get(owner))
    for member in inside:
        key, _, number = member.partition("[")
        if key == "mode" and isinstance(table, ModalPartTable):
            index = int(number[:-1])
            table = table.modes[index] if index < len(table.modes) else None
        else:
            table = getattr(table, member, None)
    return getattr(table, name) if table is not None and name in table.model_fields_set else None


def started(first: str, table: Any, fields: tuple[str, ...], built: Built) -> dict[str, float]:
    """Return the values of an element; what is unknown and not given is where its fit starts."""
    values: dict[str, float] = {}
    for key in fields:
        unknown = built.unknowns.get(f"{first}.{key}")
        start = None if unknown is None or key in table.model_fields_set else unknown.start
        values[key] = getattr(table, key) if start is None else start
    return values


def build_joint(name: str, campaign: CampaignTable, built: Built, workshop: Workshop) -> AnyJoint | None:
    """Return a joint, or None after its mistakes are added."""
    table = campaign.joints[name]
    path: Path = ("joints", name)
    wrong = [problem.path[1:2] for problem in workshop.problems.found if problem.path[:1] == ("unknowns",)]
    if any(not key or str(key[0]).startswith(f"{name}.") for key in wrong):
        return None  # what is wrong with the unknowns has been said; that the joint lacks one only follows from that
    if table.kind == "spread":
        return _spread(name, table, built, workshop)
    if table.kind == "collet":
        return _collet(name, table, built, workshop)
    if table.kind == "micro-slip":
        fields = (*SPRING_FIELDS, *MicroslipJoint.amplitude_of)
        return workshop.make(path, MicroslipJoint, **started(name, table, fields, built), name=name)
    return workshop.make(path, PointJoint, **started(name, table, SPRING_FIELDS, built), name=name)


def _spread(name: str, table: SpreadJointTable, built: Built, workshop: Workshop) -> SpreadJoint | None:
    path: Path = ("joints", name)
    sections = {key: _section((*path, key), getattr(table, key), built, workshop) for key in ("shank", "sleeve")}
    if None in sections.values():
        return None
    values = started(name, table, SpreadJoint.columns_of, built)
    return workshop.make(path, SpreadJoint, **values, **sections, points=table.points, name=name)


def _section(path: Path, table: SectionTable, built: Built, workshop: Workshop) -> Section | None:
    values: dict[str, Any] = table.model_dump(exclude={"tolerance", "material", "core"})
    # A material with a mistake has been reported; steel in its place lets mistakes of the dimensions be found as well.
    material = built.materials.get(table.material, STEEL)
    core = None if table.core is None else built.materials.get(table.core, STEEL)
    return workshop.make(path, Section, **values, material=material, core=core)


def _collet(name: str, table: ColletJointTable, built: Built, workshop: Workshop) -> ColletJoint | None:
    path: Path = ("joints", name)
    springs = {}
    for key in ColletJoint.joints_of:
        values = started(f"{name}.{key}", getattr(table, key), SPRING_FIELDS, built)
        springs[key] = workshop.make((*path, key), PointJoint, **values)
    if None in springs.values():
        return None
    return workshop.make(path, ColletJoint, **springs, **started(name, table, ColletJoint.columns_of, built), name=name)
