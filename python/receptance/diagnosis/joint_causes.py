"""Causes in the joint between tool and holder."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

from receptance.diagnosis.causes import Cause, Parameter, Variant
from receptance.diagnosis.changes import attach, overhangs_of, require_free, with_places
from receptance.diagnosis.model import (
    SPRING_TERMS,
    IndescribableError,
    Model,
    UndecidableError,
    named,
    part_of,
    require_beams,
    require_joint,
)
from receptance.diagnosis.thresholds import (
    COLLET_GYRATION,
    COLLET_SHAPE,
    LAYER_POINTS,
    SAME_PLACE,
    SHORTENED,
    START_LENGTH,
    VARIED,
)
from receptance.fit.observation import Observation, altered
from receptance.fit.unknowns import Prior, covered
from receptance.model.addresses import check_motion
from receptance.model.anatomy import Anatomy
from receptance.model.assembly import Assembly
from receptance.model.beams import Part, Section, Segment, SpreadJoint
from receptance.model.coordinates import Coordinate
from receptance.model.joints import ColletJoint, GroundSpring, PointJoint, PointMass, Resonator

_Placed = TypeVar("_Placed", bound=Coordinate | PointMass | GroundSpring | Resonator)
_STIFFNESSES = ("k_y", "k_theta")
_DAMPINGS = ("c_y", "c_theta")


def _point_joints(model: Model) -> tuple[str, ...]:
    joints = tuple(
        name
        for name in model.joints
        if all(
            isinstance(observation.assembly.elements[name], PointJoint)
            for observation in model.observations
            if name in observation.assembly.elements
        )
    )
    if not joints:
        raise UndecidableError("the model has no point joint between tool and holder")
    return joints


def _part(joints: tuple[str, ...], name: str) -> str:
    """Return the word that distinguishes the unknowns of a joint: its name, where there are several."""
    return name if len(joints) > 1 else ""


def _cross_term(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    joints = _point_joints(model)
    require_free(model, (f"{name}.k_ytheta" for name in joints), "the coupling term")
    yield Variant("stiffness", partial(_add_cross_terms, p["k_ytheta"], None))
    if _damped(joints, model):
        yield Variant("stiffness and damping", partial(_add_cross_terms, p["k_ytheta"], p["c_ytheta"]))


def _add_cross_terms(stiffness: Parameter, damping: Parameter | None, model: Model) -> Model:
    joints = _point_joints(model)
    terms = [stiffness.unknown(f"{name}.k_ytheta", part=_part(joints, name)) for name in joints]
    if damping is not None:
        terms += [damping.unknown(f"{name}.c_ytheta", part=_part(joints, name)) for name in _damped(joints, model)]
    return model.with_change(Model.couple_terms, *joints).plus(*terms)


def _damped(joints: tuple[str, ...], model: Model) -> list[str]:
    """Return the joints whose dampings are unknowns."""
    return [name for name in joints if all(model.has(f"{name}.{field}") for field in _DAMPINGS)]


def _loss(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_joint(model)
    if not model.receptances and not any(observation.damped.size for observation in model.frequencies):
        raise UndecidableError("natural frequencies alone do not show it; measure FRFs, or damping ratios")
    require_free(model, model.joint_addresses("loss_factor"), "the loss factor")
    yield Variant("all stiffnesses", partial(_add_loss, p["loss_factor"]))


def _add_loss(parameter: Parameter, model: Model) -> Model:
    unknowns = []
    for name in model.joints:
        first, *others = model.addresses_of(name, "loss_factor")
        unknowns.append(parameter.unknown(first, part=_part(model.joints, name), also=dict.fromkeys(others, 1.0)))
    return model.plus(*unknowns)


def _values(model: Model, condition: str) -> list[float]:
    """Return the values of a condition, or of an address, in all observations that have it."""
    values = []
    for observation in model.observations:
        if condition in observation.conditions:
            values.append(float(observation.conditions[condition]))
        elif covered(condition, observation.assembly):
            values.append(observation.assembly.get(condition))
    return values


def _is_varied(values: list[float]) -> bool:
    return bool(values) and min(values) > 0.0 and max(values) > VARIED * min(values)


def _laws(p: Mapping[str, Parameter], model: Model, condition: str, *, prefix: str = "") -> Iterator[Variant]:
    """Yield power laws of a condition for the joint's stiffnesses and dampings, together and separately.

    The condition is a name, or the address of the overhang.
    """
    values = _values(model, condition)
    reference = math.exp(sum(math.log(value) for value in values) / len(values))
    add = partial(_add_laws, "" if condition in overhangs_of(model) else condition, reference)
    damped = any(model.has(a) for field in _DAMPINGS for a in model.joint_addresses(field))
    for fields in (("y",), ("theta",), ("y", "theta")):
        name = " and ".join(f"k_{field}" for field in fields)
        powers = {f"k_{field}": 1.0 for field in fields}
        yield Variant(f"{prefix}{name}", partial(add, [(p["exponent"], powers)]))
        if damped:
            powers = powers | {f"c_{field}": -1.0 for field in fields}
            yield Variant(f"{prefix}{name}, damping the other way", partial(add, [(p["exponent"], powers)]))
    apart = [(p[field], {field: 1.0}) for field in (*_STIFFNESSES, *_DAMPINGS)]
    yield Variant(f"{prefix}k_y and k_theta apart", partial(add, apart[: len(_STIFFNESSES)]))
    if damped:
        yield Variant(f"{prefix}stiffness and damping apart", partial(add, apart))


def _add_laws(
    condition: str, reference: float, laws: Sequence[tuple[Parameter, Mapping[str, float]]], model: Model
) -> Model:
    """Return the model with fields of the joints that follow laws of a condition.

    A law is an exponent, and the power of it for each field. Without a name the condition is the overhang of the
    assemblies; the joint is that of the model at the reference.
    """
    require_joint(model)
    if not condition:
        if len(addresses := overhangs_of(model)) != 1:
            raise UndecidableError("the overhangs have different addresses in the assemblies")
        (condition,) = addresses
    for exponent, powers in laws:
        moves = {address: n for field, n in powers.items() for address in model.joint_addresses(field)}
        # Terms that are zero and no unknowns stay zero under any power.
        if any(_is_present(model, address) for address in moves):
            model = model.plus(exponent.move(moves, relative=True, of=condition, reference=reference))
    return model


def _is_present(model: Model, address: str) -> bool:
    assemblies = [observation.assembly for observation in model.observations]
    return model.has(address) or any(covered(address, assembly) and assembly.get(address) for assembly in assemblies)


def _law_of(condition: str, missing: str, p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield power laws of one condition; `missing` is the reason why they are undecidable where it was not varied."""
    require_joint(model)
    if not _is_varied(_values(model, condition)):
        raise UndecidableError(missing)
    yield from _laws(p, model, condition)


def _condition_law(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_joint(model)
    names = dict.fromkeys(name for observation in model.observations for name in observation.conditions)
    lengths = overhangs_of(model)
    conditions = [name for name in names if name not in ("force", "plane") and ".segment[" not in name]
    if "overhang" not in names and len(lengths) == 1:
        conditions += lengths
    chosen = [name for name in conditions if _is_varied(_values(model, name))]
    if not chosen:
        raise UndecidableError("no condition that a joint could depend on (overhang, torque, pre-force) was varied")
    for name in chosen:
        yield from _laws(p, model, name, prefix=f"{name}: ")


def _collet(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant("between tool and holder", partial(_put_collet_between, p))
    for side in ("tool", "holder"):
        yield Variant(f"on the {side}", partial(_put_collet_on, side, p["mass"]))


def _joints_without_collet(model: Model) -> tuple[str, ...]:
    require_joint(model)
    elements = [observation.assembly.elements for observation in model.observations]
    if any(isinstance(element.get(name), ColletJoint) for element in elements for name in model.joints):
        raise UndecidableError("the model has a collet between tool and holder already")
    return _point_joints(model)


def _put_collet_on(side: str, mass: Parameter, model: Model) -> Model:
    """Return the model with the mass of a collet at the joint, on the tool or on the holder."""
    _joints_without_collet(model)
    anatomies = [anatomy for anatomy in model.anatomies if anatomy.joint]
    collet = PointMass(mass=0.0, name="cause_collet")
    if side == "tool":
        points = [replace(collet, part=anatomy.tool[-1], position="end") for anatomy in anatomies]
    elif all(anatomy.holder for anatomy in anatomies):
        points = [replace(collet, part=anatomy.holder[0], position=0.0) for anatomy in anatomies]
    else:
        raise IndescribableError("data instead of a holder have no place for a mass")
    return attach(model, points, {"mass": mass})


def _put_collet_between(p: Mapping[str, Parameter], model: Model) -> Model:
    """Return the model with a collet between two equal springs that in series are the joint.

    Matthias et al. 2016, eq. 15.
    """
    joints = _joints_without_collet(model)
    tools = {anatomy.tool[-1] for anatomy in model.anatomies if anatomy.joint}
    if len(joints) > 1 or len(tools) > 1:
        raise IndescribableError("there are several joints between tool and holder, or several tools")
    (joint,), (tool,) = joints, tools
    diameter = min(part.segments[-1].ends[1][0] for part in model.parts(tool))

    def halves(address: str) -> dict[str, float]:
        """Return a parameter of the joint as those of two equal springs: each is twice as stiff as both in series."""
        element, _, field = address.partition(".")
        names = (f"{joint}.inner.{field}", f"{joint}.outer.{field}") if element == joint else (address,)
        return dict.fromkeys(names, 2.0 if element == joint and field in SPRING_TERMS else 1.0)

    changed = with_places(model.rebuild(partial(_with_collet, joint)), halves)
    inertia = f"{joint}.inertia"
    mass = p["mass"].unknown(f"{joint}.mass", also={inertia: (COLLET_GYRATION * diameter) ** 2})
    shape = p["log_inertia"].move({inertia: 1.0}, relative=True)
    split = {f"{joint}.inner.{field}": 1.0 for field in SPRING_TERMS}
    split |= {f"{joint}.outer.{field}": -1.0 for field in SPRING_TERMS}
    return changed.plus(mass, shape, p["split"].move(split, relative=True))


def _with_collet(joint: str, assembly: Assembly) -> Assembly:
    if joint not in assembly.elements:
        return assembly
    check_motion(ColletJoint, assembly.motion, joint)
    elements = named(assembly.elements)
    whole = elements[joint]
    terms = {field: 2.0 * getattr(whole, field) for field in SPRING_TERMS}
    spring = PointJoint(**terms, loss_factor=whole.loss_factor)
    elements[joint] = ColletJoint(inner=spring, outer=spring, name=joint)
    return Assembly(elements.values(), named(assembly.attachments).values(), motion=assembly.motion)


_LAYERS = ((None, False), (2, False), (4, False), (2, True), (4, True), (LAYER_POINTS, True))
"""Numbers of points along a spread joint, None for a layer, and whether it is uneven."""


def _spread(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    for points, is_uneven in _LAYERS:
        name = "layer" if points is None else f"{points} points{', uneven' if is_uneven else ''}"
        slope = p["slope"] if is_uneven else None
        yield Variant(name, partial(_spread_over, points, p["length"], slope))
        yield Variant(f"{name} over the whole insertion", partial(_spread_over, points, None, slope), far=True)


def _anatomy_to_spread(model: Model) -> Anatomy:
    """Return the anatomy about the joint that is spread, the same in all assemblies."""
    (joint, *others) = _point_joints(model)
    require_beams(model)
    anatomies = {anatomy for anatomy in model.anatomies if anatomy.joint}
    if others or len(anatomies) > 1:
        raise UndecidableError("there are several joints between tool and holder")
    if any(model.has(f"{joint}.{field}") for field in ("k_ytheta", "c_ytheta")):
        raise UndecidableError("a spread joint has no coupling term of its own, and the model's joint has one")
    return anatomies.pop()


def _spread_over(points: int | None, length: Parameter | None, slope: Parameter | None, model: Model) -> Model:
    """Return the model with a joint that is spread from the mouth to an unknown depth, or over the whole insertion."""
    anatomy = _anatomy_to_spread(model)
    fixed = model.with_change(_fix_places, anatomy)
    joint, tool, holder = anatomy.joint, anatomy.tool[-1], anatomy.holder[0]
    if length is None and min(model.places(holder), default=math.inf) < _mouth(model, anatomy):
        raise IndescribableError(f"a coordinate or an attachment is on {holder} within the insertion")
    spread = _spread_model(fixed, anatomy, points, whole=length is None)
    first, contact = f"{holder}.segment[0].length", f"{joint}.length"
    last = str(len(fixed.parts(tool)[0].segments) - 1)
    owners = spread.observations

    def follow(address: str) -> dict[str, float]:
        """Return the parameters in the place of one: shank and sleeve of the joint are of tool and holder.

        Along the whole insertion the joint leaves `START_LENGTH` of the holder's first segment, which most errors
        would make negative, so that the contact becomes longer; and no shank is bonded into the holder.
        """
        if length is None and address == first:
            return {contact: 1.0}
        part, _, rest = address.partition(".segment[")
        index, _, field = rest.partition("].")
        if field.startswith("core.") and not any(
            covered(address, observation.assembly) for observation in spread.observations
        ):
            return {}
        addresses = [address]
        if field and field != "length" and not field.startswith("core."):
            if part == tool and index in ("*", last):
                # The shank of a conical tool has the diameters at its end.
                of_shank = field.removeprefix("end_")
                if field == of_shank and any(
                    covered(f"{tool}.segment[{last}].end_{field}", o.assembly) for o in owners
                ):
                    of_shank = ""
                addresses += [f"{joint}.shank.{of_shank}"] if of_shank else []
            elif part == holder and index in ("*", "0") and field != "inner_diameter":
                addresses.append(f"{joint}.sleeve.{field}")
        return dict.fromkeys(addresses, 1.0)

    spread = with_places(spread, follow)
    added = [] if slope is None else [slope.unknown(f"{joint}.slope")]
    if length is None:
        return spread.plus(*added)
    longest = min(length.upper, SHORTENED * _mouth(fixed, anatomy))
    return spread.plus(length.move({contact: 1.0, first: -1.0}, upper=longest - START_LENGTH), *added)


def _mouth(model: Model, anatomy: Anatomy) -> float:
    """Return the length in m of the holder's first segment, the shortest one of all assemblies with the joint."""
    owners = [
        observation.assembly for observation in model.observations if anatomy.joint in observation.assembly.elements
    ]
    return min(part_of(owner, anatomy.holder[0]).segments[0].length for owner in owners)


def _fix_places(model: Model, anatomy: Anatomy) -> Model:
    """Return the model with a step of the holder at every coordinate and attachment.

    As the contact grows the holder's first segment becomes shorter. Steps between segments keep their place on the
    real holder, while a position within a segment is counted from the moving start of the segment.
    """
    holder = anatomy.holder[0]
    steps = model.steps(holder)
    for place in model.places(holder):
        if place <= 2.0 * START_LENGTH:
            raise IndescribableError(
                f"a coordinate or an attachment is on {holder} at {1e3 * place:g} mm, within the contact of a spread "
                "joint, where the model has no node"
            )
        if all(abs(place - step) > SAME_PLACE for step in steps):
            try:
                model, _ = model.split(holder, place)
            except ValueError as error:
                raise IndescribableError(f"a joint cannot be spread with these places on the holder: {error}") from None
    return model


def _spread_model(model: Model, anatomy: Anatomy, points: int | None, *, whole: bool) -> Model:
    """Return the model with a spread joint; coordinates keep their place on the real holder."""

    def change(observation: Observation) -> Observation:
        if not observation.is_receptance or anatomy.joint not in observation.assembly.elements:
            return observation
        length = observation.assembly.get(f"{anatomy.joint}.length")
        sides = ("response", "excitation")
        return altered(observation, **{side: _shift(getattr(observation, side), anatomy, length) for side in sides})

    build = partial(_spread_joint, anatomy=anatomy, points=points, whole=whole)
    return model.rebuild(build).map(change)


def _spread_joint(assembly: Assembly, anatomy: Anatomy, points: int | None, whole: bool) -> Assembly:
    elements = named(assembly.elements)
    if anatomy.joint not in elements:
        return assembly
    check_motion(SpreadJoint, assembly.motion, anatomy.joint)
    joint, tool, holder = (elements[name] for name in (anatomy.joint, anatomy.tool[-1], anatomy.holder[0]))
    last, first = tool.segments[-1], holder.segments[0]
    _require_cylinder(first, anatomy.holder[0])
    if not last.is_circular:
        raise UndecidableError(f"the last segment of {anatomy.tool[-1]} is not circular, and the shank is to be")
    # The shank continues with the section at the end of the tool.
    (_, (shank_outer, shank_inner)) = last.ends
    bore = max(first.inner_diameter, shank_outer)
    if bore >= first.outer_diameter:
        raise UndecidableError("the holder's mouth is narrower than the shank")
    fields = ("outer_diameter", "inner_diameter", "material", "shear")
    shank, sleeve = (Section(**{field: getattr(segment, field) for field in fields}) for segment in (last, first))
    shank = replace(shank, outer_diameter=shank_outer, inner_diameter=shank_inner)
    sleeve = replace(sleeve, inner_diameter=bore)
    held = {name: getattr(joint, name) for name in (*_STIFFNESSES, *_DAMPINGS, "loss_factor")}
    length = first.length - START_LENGTH if whole else START_LENGTH
    layer = SpreadJoint(length=length, shank=shank, sleeve=sleeve, points=points, name=anatomy.joint, **held)
    elements[anatomy.joint] = layer
    # Where the joint is spread over the whole insertion, no shank is bonded into the holder.
    rest = replace(first, length=first.length - length, **({"core": None} if whole else {}))
    segments = (rest, *holder.segments[1:])
    elements[anatomy.holder[0]] = Part(segments, name=anatomy.holder[0])
    attached = [_shift(point, anatomy, length) for point in named(assembly.attachments).values()]
    return Assembly(elements.values(), attached, motion=assembly.motion)


def _require_cylinder(mouth: Segment, holder: str) -> None:
    """Raise `UndecidableError` if the mouth of a holder has no sleeve that a spread joint describes."""
    if mouth.is_conical or not mouth.is_circular:
        what = "a cone" if mouth.is_conical else "not circular"
        raise UndecidableError(
            f"the first segment of {holder} is {what}, and the sleeve of a spread joint is a circular cylinder; "
            f"describe the mouth of {holder} as a cylinder, or give the model a SpreadJoint"
        )


def _shift(point: _Placed, anatomy: Anatomy, length: float) -> _Placed:
    """Return a place at its old position on a holder whose start moved by a length away from the tip."""
    if point.part != anatomy.holder[0] or point.position == "end":
        return point
    return replace(point, position=point.position - length)


_EXPONENTS = tuple(
    Parameter(name=name, unit="", lower=-4.0, upper=4.0, typical=-0.3, plausible=(-2.5, 2.5))
    for name in ("exponent", *_STIFFNESSES, *_DAMPINGS)
)

JOINT_CAUSES = (
    Cause(
        id="joint_cross_term",
        title="coupling term of the joint",
        parameters=(
            Parameter(name="k_ytheta", unit="N/rad", lower=-1e9, upper=1e9, typical=1e5),
            Parameter(name="c_ytheta", unit="N s/rad", lower=-1e4, upper=1e4, typical=1e-2),
        ),
        change=_cross_term,
        meaning="the joint's stiffness does not act at the interface: translation and rotation are coupled",
        remedy="identify k_ytheta = k_y e, which gives the distance e; an FRF at the holder's nose confirms it",
    ),
    Cause(
        id="joint_spread",
        title="joint along the insertion",
        parameters=(
            Parameter(name="length", unit="m", lower=0.0, upper=0.08, typical=0.02),
            Parameter(name="slope", unit="", lower=-0.99, upper=0.99, typical=-0.3, secondary=True),
        ),
        change=_spread,
        meaning="the joint holds the shank along the insertion and not at one point",
        remedy="use a SpreadJoint of the insertion's length",
    ),
    Cause(
        id="joint_hysteretic_loss",
        title="hysteretic loss in the joint",
        parameters=(Parameter(name="loss_factor", unit="", lower=0.0, upper=1.0, typical=0.02, plausible=(0.0, 0.3)),),
        change=_loss,
        meaning="the joint loses energy by friction or in its material: damping does not grow with frequency",
        remedy="give the joint a loss factor; damping of three modes or more confirms it",
    ),
    Cause(
        id="joint_amplitude",
        title="joint that depends on the amplitude",
        parameters=_EXPONENTS,
        change=partial(
            _law_of,
            "force",
            "one force level does not show whether the joint depends on the amplitude: measure at two, and state them "
            "as the condition 'force'",
        ),
        meaning="the joint depends on the amplitude of the hits",
        remedy="measure at the amplitude of use, or give the joint a law of the amplitude",
    ),
    Cause(
        id="joint_overhang_law",
        title="joint that depends on overhang or torque",
        parameters=_EXPONENTS,
        change=_condition_law,
        meaning="the joint changes with overhang, torque or pre-force, and the model has one joint for all",
        remedy="give the joint a law of that condition; vary it alone to confirm",
    ),
    Cause(
        id="xy_asymmetry",
        title="different joints in x and y",
        parameters=_EXPONENTS,
        change=partial(
            _law_of,
            "plane",
            "all measurements are in one plane: measure in two, and state the condition 'plane' as 1 and 2",
        ),
        meaning="the joint is stiffer in one plane than in the other",
        remedy="identify the two planes separately",
    ),
    Cause(
        id="collet_mass",
        title="mass of the collet",
        parameters=(
            Parameter(name="mass", unit="kg", lower=0.0, upper=1.0, typical=0.03, plausible=(0.0, 0.5)),
            Parameter(name="split", unit="", lower=-2.0, upper=2.0, typical=0.0, secondary=True),
            Parameter(
                name="log_inertia",
                unit="",
                lower=-4.0 * COLLET_SHAPE,
                upper=4.0 * COLLET_SHAPE,
                typical=0.0,
                secondary=True,
                prior=Prior(mean=0.0, standard_deviation=COLLET_SHAPE),
            ),
        ),
        change=_collet,
        meaning="collet and nut move with the joint, and the model has no mass there",
        remedy="weigh collet and nut and add their mass",
    ),
)
