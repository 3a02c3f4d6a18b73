"""Causes that lie in the joint."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

from receptance.assembly import Assembly
from receptance.beams import Part, Section
from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
from receptance.diagnosis.model import Anatomy, Model, renamed
from receptance.identification.unknowns import covered
from receptance.joints import PointJoint, PointMass
from receptance.spread import SpreadJoint

__all__ = ["JOINT_CAUSES"]

_SHORTEST = 1e-4
"""A spread joint this short is a point joint."""
_VARIED = 1.05
"""A condition has been varied where its largest value is this many times its smallest."""
_STIFFNESSES = ("k_y", "k_theta")
_DAMPINGS = ("c_y", "c_theta")


def _point_joints(model: Model) -> tuple[str, ...]:
    joints = tuple(
        name
        for name in model.joints
        if all(
            isinstance(one.assembly.elements[name], PointJoint)
            for one in model.observations
            if name in one.assembly.elements
        )
    )
    if not joints:
        raise UndecidableError("the model has no point joint between tool and holder")
    return joints


def _own(joints: tuple[str, ...], name: str) -> str:
    return name if len(joints) > 1 else ""


def _cross(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    joints = _point_joints(model)
    if any(model.has(f"{name}.k_ytheta") for name in joints):
        raise UndecidableError("the coupling term is an unknown of the model already")
    stiff = model.plus(*(p["k_ytheta"].unknown(f"{name}.k_ytheta", part=_own(joints, name)) for name in joints))
    yield Variant("stiffness", stiff)
    damped = [name for name in joints if all(model.has(f"{name}.{c}") for c in _DAMPINGS)]
    if damped:
        both = (p["c_ytheta"].unknown(f"{name}.c_ytheta", part=_own(joints, name)) for name in damped)
        yield Variant("stiffness and damping", stiff.plus(*both))


def _loss(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    if not model.joints:
        raise UndecidableError("the model has no joint between tool and holder")
    _needs_receptances(model)
    if any(model.has(f"{name}.loss_factor") for name in model.joints):
        raise UndecidableError("the loss factor is an unknown of the model already")
    joints = model.joints
    yield Variant(
        "all stiffnesses",
        model.plus(*(p["loss_factor"].unknown(f"{name}.loss_factor", part=_own(joints, name)) for name in joints)),
    )


def _needs_receptances(model: Model) -> None:
    if not any(hasattr(one, "receptance") for one in model.observations):
        raise UndecidableError("natural frequencies alone say nothing of it; measure FRFs")


def _values(model: Model, condition: str) -> list[float]:
    found = []
    for one in model.observations:
        if condition in one.conditions:
            found.append(float(one.conditions[condition]))
        elif covered(condition, one.assembly):
            found.append(one.assembly.get(condition))
    return found


def _varied(values: list[float]) -> bool:
    return bool(values) and min(values) > 0.0 and max(values) > _VARIED * min(values)


def _laws(p: Mapping[str, Parameter], model: Model, of: str, prefix: str) -> Iterator[Variant]:
    """Yield powers of a condition for the joint's stiffnesses: one, both, both and their dampings."""
    values = _values(model, of)
    reference = math.exp(sum(math.log(value) for value in values) / len(values))

    def law(*fields: str) -> Model:
        # What a fit of the base has taken as fixed, and zero, no power can change.
        moved = [field for field in fields if any(_there(model, f"{name}.{field}") for name in model.joints)]
        return model.plus(
            *(
                p[field].move(
                    {f"{name}.{field}": 1.0 for name in model.joints}, relative=True, of=of, reference=reference
                )
                for field in moved
            )
        )

    yield Variant(f"{prefix}k_theta", law("k_theta"))
    yield Variant(f"{prefix}k_y", law("k_y"))
    yield Variant(f"{prefix}k_y and k_theta", law(*_STIFFNESSES))
    if any(model.has(f"{name}.{field}") for name in model.joints for field in _DAMPINGS):
        yield Variant(f"{prefix}stiffness and damping", law(*_STIFFNESSES, *_DAMPINGS))


def _there(model: Model, address: str) -> bool:
    return model.has(address) or any(
        covered(address, one.assembly) and one.assembly.get(address) for one in model.observations
    )


def _amplitude(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    if not model.joints:
        raise UndecidableError("the model has no joint between tool and holder")
    if not _varied(_values(model, "force")):
        raise UndecidableError(
            "one force level cannot tell an amplitude-dependent joint from another joint: measure at two, and state "
            "them as the condition 'force'"
        )
    yield from _laws(p, model, "force", "")


def _across(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    if not model.joints:
        raise UndecidableError("the model has no joint between tool and holder")
    names = dict.fromkeys(name for one in model.observations for name in one.conditions)
    lengths = {_overhang(one.assembly, anatomy) for one, anatomy in zip(model.observations, model.anatomies, strict=True)}
    wanted = [name for name in names if name not in ("force", "plane") and ".segment[" not in name]
    if "overhang" not in names and len(lengths) == 1:
        wanted += lengths
    chosen = [name for name in wanted if _varied(_values(model, name))]
    if not chosen:
        raise UndecidableError("no condition (overhang, torque, pre-force) was varied that a joint could depend on")
    for name in chosen:
        yield from _laws(p, model, name, f"{name}: ")


def _overhang(assembly: Assembly, anatomy: Anatomy) -> str:
    part = anatomy.tool[-1]
    return f"{part}.segment[{len(assembly.elements[part].segments) - 1}].length"  # type: ignore[union-attr]


def _planes(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    if not model.joints:
        raise UndecidableError("the model has no joint between tool and holder")
    if not _varied(_values(model, "plane")):
        raise UndecidableError("all was measured in one plane: measure in two, and state the condition 'plane' as 1 and 2")
    for fields in (("k_theta",), ("k_y",), _STIFFNESSES):
        moves = (
            p[field].move({f"{name}.{field}": 1.0 for name in model.joints}, relative=True, of="plane") for field in fields
        )
        yield Variant(" and ".join(fields), model.plus(*moves))


def _collet(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    if not model.joints:
        raise UndecidableError("the model has no joint between tool and holder")
    sides = {
        "on the tool": lambda anatomy: PointMass(mass=0.0, part=anatomy.tool[-1], position="end", name="cause_collet"),
        "on the holder": lambda anatomy: PointMass(mass=0.0, part=anatomy.holder[0], position=0.0, name="cause_collet"),
    }
    for name, point in sides.items():
        points = dict.fromkeys(point(anatomy) for anatomy in model.anatomies if anatomy.joint)
        if len(points) > 1:
            raise UndecidableError("tool or holder are called differently in the assemblies")
        yield Variant(name, model.attached(*points).plus(p["mass"].unknown("cause_collet.mass")))


def _spread(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    (joint, *others) = _point_joints(model)
    if others or len({anatomy for anatomy in model.anatomies if anatomy.joint}) > 1:
        raise UndecidableError("there are several joints between tool and holder")
    if any(model.has(f"{joint}.{field}") for field in ("k_ytheta", "c_ytheta")):
        raise UndecidableError("a spread joint has no coupling term of its own, and the model's joint has one")
    anatomy = next(one for one in model.anatomies if one.joint)
    longest = min(
        one.assembly.elements[anatomy.holder[0]].segments[0].length  # type: ignore[union-attr]
        for one in model.observations
        if joint in one.assembly.elements
    )
    length = p["length"]
    upper = min(length.upper, 0.98 * longest)
    for points in (None, 2, 3):
        changed = model.rebuilt(lambda assembly, points=points: _spread_out(assembly, anatomy, points))  # type: ignore[misc]
        if changed is None:
            raise UndecidableError("the holder's mouth is narrower than the shank")
        unknown = length.move({f"{joint}.length": 1.0, f"{anatomy.holder[0]}.segment[0].length": -1.0})
        unknown = replace(unknown, upper=upper - _SHORTEST)
        tolerances = tuple(replace(t, moves=_beside(t.moves, anatomy)) for t in model.tolerances)
        yield Variant(
            "layer" if points is None else f"{points} points",
            replace(changed, tolerances=tolerances).plus(unknown),
        )


def _spread_out(assembly: Assembly, anatomy: Anatomy, points: int | None) -> Assembly:
    elements = renamed(assembly)
    if anatomy.joint not in elements:
        return assembly
    joint, tool, holder = (elements[name] for name in (anatomy.joint, anatomy.tool[-1], anatomy.holder[0]))
    last, first = tool.segments[-1], holder.segments[0]
    bore = max(first.inner_diameter, last.outer_diameter)
    if bore >= first.outer_diameter:
        raise UndecidableError("the holder's mouth is narrower than the shank")
    shank = Section(
        outer_diameter=last.outer_diameter, inner_diameter=last.inner_diameter, material=last.material, shear=last.shear
    )
    sleeve = Section(outer_diameter=first.outer_diameter, inner_diameter=bore, material=first.material, shear=first.shear)
    kept = {name: getattr(joint, name) for name in (*_STIFFNESSES, *_DAMPINGS, "loss_factor")}
    elements[anatomy.joint] = SpreadJoint(
        length=_SHORTEST, shank=shank, sleeve=sleeve, points=points, name=anatomy.joint, **kept
    )
    segments = (replace(first, length=first.length - _SHORTEST), *holder.segments[1:])
    elements[anatomy.holder[0]] = Part(segments, name=anatomy.holder[0])
    points_ = [replace(point, name=name) for name, point in assembly.attachments.items()]
    return Assembly(elements.values(), points_)


def _beside(moves: Mapping[str, float], anatomy: Anatomy) -> dict[str, float]:
    """Return what a tolerance moves, the sections beside each other included."""
    result = dict(moves)
    for address, n in moves.items():
        part, _, rest = address.partition(".segment[")
        field = rest.partition("].")[2]
        if field in ("", "length") or field.startswith("core."):
            continue
        if part == anatomy.tool[-1]:
            result[f"{anatomy.joint}.shank.{field}"] = n
        elif part == anatomy.holder[0] and rest[0] in "*0" and field != "inner_diameter":
            result[f"{anatomy.joint}.sleeve.{field}"] = n
    return result


def _exponents(*names: str) -> tuple[Parameter, ...]:
    return tuple(Parameter(name=name, unit="", lower=-4.0, upper=4.0, typical=-0.3, plausible=(-2.5, 2.5)) for name in names)


JOINT_CAUSES = (
    Cause(
        id="joint_cross_term",
        group="structure",
        parameters=(
            Parameter(name="k_ytheta", unit="N/rad", lower=-1e9, upper=1e9, typical=1e5),
            Parameter(name="c_ytheta", unit="N s/rad", lower=-1e4, upper=1e4, typical=1e-2),
        ),
        change=_cross,
        meaning="the joint's stiffness acts elsewhere than at the interface: translation and rotation are coupled",
        remedy="free the coupling term, k_ytheta = k_y e says how far off; an FRF at the holder's nose confirms it",
    ),
    Cause(
        id="joint_spread",
        group="structure",
        parameters=(Parameter(name="length", unit="m", lower=0.0, upper=0.08, typical=0.02, plausible=(0.0, 0.08)),),
        change=_spread,
        meaning="the joint holds the shank along the insertion and not at one point",
        remedy="use a SpreadJoint of the insertion's length",
    ),
    Cause(
        id="joint_hysteretic_loss",
        group="structure",
        parameters=(Parameter(name="loss_factor", unit="", lower=0.0, upper=1.0, typical=0.02, plausible=(0.0, 0.3)),),
        change=_loss,
        meaning="the joint loses energy by friction or material, not with speed: damping does not grow with frequency",
        remedy="give the joint a loss factor; damping of three modes or more confirms it",
    ),
    Cause(
        id="joint_amplitude",
        group="structure",
        parameters=_exponents(*_STIFFNESSES, *_DAMPINGS),
        change=_amplitude,
        meaning="the joint depends on how hard it is hit",
        remedy="measure at the amplitude of use, or give the joint its law of amplitude",
    ),
    Cause(
        id="joint_overhang_law",
        group="structure",
        parameters=_exponents(*_STIFFNESSES, *_DAMPINGS),
        change=_across,
        meaning="the joint changes with overhang, torque or pre-force, and the model has one for all",
        remedy="give the joint a law of that condition; vary it alone to confirm",
    ),
    Cause(
        id="xy_asymmetry",
        group="structure",
        parameters=_exponents(*_STIFFNESSES),
        change=_planes,
        meaning="the joint is stiffer in one plane than in the other",
        remedy="identify the two planes apart",
    ),
    Cause(
        id="collet_mass",
        group="structure",
        parameters=(Parameter(name="mass", unit="kg", lower=0.0, upper=1.0, typical=0.03, plausible=(0.0, 0.5)),),
        change=_collet,
        meaning="collet and nut move with the joint, and the model has no mass there",
        remedy="weigh collet and nut and add their mass",
    ),
)


