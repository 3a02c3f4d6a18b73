"""Causes in the tool and in the holder: dimensions, materials, and bodies that are described as rigid."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from receptance.diagnosis.causes import Cause, CauseMove, Parameter, Variant
from receptance.diagnosis.changes import attach, moved_step, overhangs_of, require_free
from receptance.diagnosis.model import (
    IndescribableError,
    Model,
    UndecidableError,
    far_end,
    of_thickness,
    places_on,
    require_beams,
    require_joint,
)
from receptance.diagnosis.thresholds import (
    DRAWING,
    LARGE_SIZE,
    MATERIAL_DEVIATIONS,
    METAL_MODULUS,
    ORDINARY_DENSITY,
    ORDINARY_MODULUS,
    SAME_PLACE,
    SHORT_SECTION,
    SHORTENED,
    TIP_STEP,
)
from receptance.fit.unknowns import Prior, covered
from receptance.model.addresses import edges_of
from receptance.model.anatomy import overhang_of
from receptance.model.assembly import Assembly
from receptance.model.beams import Material, Part, Segment
from receptance.model.joints import PointMass
from receptance.model.materials import MATERIAL_CLASSES, MaterialClass

_RIGID_MODULUS = 10.0 * METAL_MODULUS
"""Young's modulus in Pa from which a body is rigid: no material reaches it."""


def _everywhere(model: Model, field: str, sides: Iterable[str]) -> dict[str, float]:
    """Return equal moves of a material property of tool or holder: in their parts, as a core, and in a spread joint."""
    moves: dict[str, float] = {}
    for side in sides:
        if side == "holder":
            require_beams(model)
        parts = [name for anatomy in model.anatomies for name in getattr(anatomy, side)]
        if not parts:
            raise UndecidableError(f"the model has no {side}")
        possible = [f"{name}.segment[*].{field}" for name in parts]
        if side == "tool":
            possible += [f"{name}.segment[*].core.{field}" for anatomy in model.anatomies for name in anatomy.holder]
        possible += [f"{name}.{'shank' if side == 'tool' else 'sleeve'}.{field}" for name in model.joints]
        moves |= {a: 1.0 for a in dict.fromkeys(possible) if any(covered(a, o.assembly) for o in model.observations)}
    require_free(model, moves, f"{field} of {' and '.join(sides)}")
    return moves


def _scaled(side: str, field: str, p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a property of a whole side multiplied by a factor, whose logarithm is the parameter."""
    (parameter,) = p.values()
    yield Variant(f"all of the {side}", partial(_scale, side, field, parameter))


def _scale(side: str, field: str, parameter: Parameter, model: Model) -> Model:
    return model.plus(parameter.move(_everywhere(model, field, [side]), relative=True))


def _holder_inertia(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant("density", partial(_scale, "holder", "density", p["log_density"]))
    yield Variant("mass at the far end", partial(_add_end_mass, p["mass"]))


def _add_end_mass(mass: Parameter, model: Model) -> Model:
    require_beams(model)
    point = PointMass(mass=0.0, part=far_end(model), position="end", name="cause_end_mass")
    return attach(model, [point], {"mass": mass})


def _overhang(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_joint(model)
    overhangs = overhangs_of(model)
    require_free(model, overhangs, "the overhang")
    yield Variant("all", partial(_lengthen, p["length"], None))
    names = dict.fromkeys(name for configurations in overhangs.values() for name in configurations)
    for name in names if len(names) > 1 else ():
        yield Variant(name, partial(_lengthen, p["length"], name))


def _lengthen(length: Parameter, configuration: str | None, model: Model) -> Model:
    """Return the model with an error of the overhang, of one configuration or the same of all."""
    addresses: set[str] = set()
    room = math.inf
    for name, observation, anatomy in zip(model.configuration_of, model.observations, model.anatomies, strict=True):
        if anatomy.joint and configuration in (None, name):
            part = anatomy.tool[-1]
            addresses.add(overhang_of(observation.assembly, anatomy))
            # The tool cannot become shorter than up to the last place on it.
            *before, end = edges_of(observation.assembly.elements[part])
            used = max([before[-1], *places_on(observation, part)])
            room = min(room, SHORTENED * (end - used))
    if not addresses:
        raise UndecidableError(f"{configuration or 'the model'} has no joint between tool and holder")
    moves, lower = dict.fromkeys(sorted(addresses), 1.0), max(length.lower, -room)
    return model.plus(length.move(moves, configurations=configuration, lower=lower))


def _flutes(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a thinner first section. Flutes leave less than the full circle, which is that of the last section.

    Where the model has the section of flutes, their core and their length are in question instead.
    """
    require_joint(model)
    if _has_flutes(model):
        core, length = p["log_core_diameter"], p["flute_length"]
        for name, changed in (("core", (core,)), ("length", (length,)), ("core and length", (core, length))):
            words = name.replace("core", "core diameter")
            yield Variant(
                f"{name} of the flutes",
                partial(_change_flutes, changed),
                meaning=f"the {words} of the flutes {'differ' if len(changed) > 1 else 'differs'} from what is stated",
                remedy=f"measure the {words} of the flutes"
                + ("; a worn tool of the kind, cut across, shows its section" if core in changed else ""),
            )
        return
    room = max(_room_to_full_circle(model), 0.0)
    low, high = p["log_diameter"].plausible
    yield from _first_section(replace(p["log_diameter"], upper=room, plausible=(low, high + room)), p["length"], model)


def _tip_diameter(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield another diameter of a first section, which flutes do not explain."""
    diameter = p["log_diameter"]
    if model.joints:
        if _room_to_full_circle(model) > 0.0 or _has_flutes(model):
            kind = "the section of flutes" if _has_flutes(model) else "a thinner first section"
            raise UndecidableError(f"the model has {kind}: see fluted_part")
        # A thinner one is that of flutes.
        diameter = replace(diameter, lower=0.0)
    yield from _first_section(diameter, p["length"], model)


def _has_flutes(model: Model) -> bool:
    """Return whether the model states the core of the flutes at the tip."""
    shapes = [part.segments[0].shape for part in model.parts(model.tip)]
    return any(shape is not None and shape.core_ratio is not None for shape in shapes)


def _change_flutes(changed: Sequence[Parameter], model: Model) -> Model:
    """Return the model with another core of the flutes, another length, or both."""
    moves = {"log_core_diameter": _other_core, "flute_length": _other_flute_length}
    for parameter in changed:
        model = model.plus(moves[parameter.name](parameter, model))
    return model


def _other_core(core: Parameter, model: Model) -> CauseMove:
    """Return an error of the core diameter.

    In bending a section is its mass, rotary inertia and stiffnesses in bending and shear. With the exponents a, b and m
    of area and second moments those of a core c times as large are rho D^2 c^a, rho D^4 c^b and E D^4 c^m, and so they
    are with D c^((b - a) / 2), rho c^(2 a - b) and E c^(m - 2 b + 2 a), of which the core of the model has derivatives.
    The shear stiffness goes with c^(m - b + a), which is c^a except for two flutes, and the shear coefficient stays: in
    the tools that were tried both leave at most a twentieth of the change of the lowest mode.
    """
    shape, *others = {part.segments[0].shape for part in model.parts(model.tip)}
    if any(observation.assembly.motion != "bending" for observation in model.observations):
        raise IndescribableError("another core of the flutes is described for bending only")
    if others or shape is None or shape.core_ratio is None:
        raise IndescribableError("the flutes differ between the assemblies")
    area, moment, inertia = shape.core_exponents()
    first = f"{model.tip}.segment[0]"
    diameter = 0.5 * (inertia - area)
    moves = {address: n * diameter for address, n in of_thickness(model, first).items()}
    moves[f"{first}.density"] = 2.0 * area - inertia
    moves[f"{first}.youngs_modulus"] = moment - 4.0 * diameter
    low, high = (math.log(limit / shape.core_ratio) for limit in shape.core_limits)
    return core.move(moves, relative=True, lower=max(core.lower, low), upper=min(core.upper, high))


def _other_flute_length(length: Parameter, model: Model) -> CauseMove:
    """Return an error of the length of the flutes, which end before the next place or step on the tool."""
    tip, parts = model.tip, model.parts(model.tip)
    if any(len(part.segments) == 1 for part in parts):
        raise IndescribableError("the whole tool has flutes")
    room_back, room_on = math.inf, math.inf
    for observation in model.observations:
        if tip in observation.assembly.elements:
            edges = edges_of(observation.assembly.elements[tip])
            others = [x - edges[1] for x in (*places_on(observation, tip), edges[0], edges[2])]
            if min(map(abs, others)) < SAME_PLACE:
                raise IndescribableError("a coordinate or an attachment is where the flutes end")
            room_back = min(room_back, -max(x for x in others if x < 0.0))
            room_on = min(room_on, min(x for x in others if x > 0.0))
    lower, upper = max(length.lower, -SHORTENED * room_back), min(length.upper, SHORTENED * room_on)
    return length.move(moved_step(model, tip, edges_of(parts[0])[1]), lower=lower, upper=upper)


def _room_to_full_circle(model: Model) -> float:
    """Return the logarithm of the diameter of the last section over that of the first one, the smallest of all."""
    parts = model.parts(model.tip)
    return min(math.log(part.segments[-1].ends[1][0] / max(_outer_ends(part.segments[0]))) for part in parts)


def _outer_ends(segment: Segment) -> tuple[float, float]:
    (near, _), (far, _) = segment.ends
    return near, far


def _first_section(diameter: Parameter, length: Parameter, model: Model) -> Iterator[Variant]:
    """Yield another diameter of the first section, or where the tool has one section, of a new one from the tip."""
    parts = model.parts(model.tip)
    if any(len(part.segments) > 1 for part in parts):
        yield Variant("first section", partial(_change_first_section, diameter))
        return
    # The end of the section cannot pass a place on the tool, so it lies between two of them.
    for low in (0.0, *(place for place in model.places(model.tip) if 0.0 < place < longest_first_section(parts))):
        name = "from the tip" + (f", ending beyond {1e3 * low:g} mm" if low else "")
        yield Variant(name, partial(_add_first_section, diameter, length, low))


def _change_first_section(diameter: Parameter, model: Model) -> Model:
    if all(len(part.segments) == 1 for part in model.parts(model.tip)):
        raise IndescribableError("the tool has one section")
    return model.plus(diameter.move(of_thickness(model, f"{model.tip}.segment[0]"), relative=True))


def longest_first_section(parts: Sequence[Part]) -> float:
    """Return the length in m that a change at the tip may reach in the first section of every part."""
    return 0.95 * min(part.segments[0].length for part in parts)


def _add_first_section(diameter: Parameter, length: Parameter, low: float, model: Model) -> Model:
    """Return the model with another section from the tip, that ends between a place on the tool and the next one."""
    tip = model.tip
    longest = longest_first_section(model.parts(tip))
    high = min([longest, *(place for place in model.places(tip) if place > low + SAME_PLACE)])
    if high - low < SHORT_SECTION:
        raise IndescribableError(f"no section of its own can end beyond {1e3 * low:g} mm on {tip}")
    divided, _ = model.split(tip, low + TIP_STEP)
    beyond = f"beyond {1e3 * low:g} mm" if low else ""
    room = high - low - (2.0 * TIP_STEP if high < longest else 0.0)
    lower = 0.0 if low else min(length.lower, 0.1 * room)
    lengths = moved_step(divided, tip, low + TIP_STEP)
    moved = length.move(lengths, part=beyond, lower=lower, upper=room, start=0.5 * room)
    return divided.plus(diameter.move(of_thickness(divided, f"{tip}.segment[0]"), relative=True), moved)


def _flexible(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    rigid = _rigid_moduli(model)
    if not rigid:
        raise UndecidableError("no part is described as rigid")
    for name in rigid:
        yield Variant(name, partial(_make_elastic, name, p["decades"]), begin=partial(_as_metal, p["decades"]))


def _as_metal(decades: Parameter, model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Return the stiffness of metals as the starting value, because that of a rigid body has no effect."""
    return {decades.key: 0.0}


def _rigid_moduli(model: Model) -> dict[str, dict[str, float]]:
    """Return the addresses of the moduli of rigid bodies by part, each with the value from which decades count."""
    by_part: dict[str, dict[str, float]] = {}
    for observation in model.observations:
        for address in observation.assembly.parameters:
            if address.endswith(".youngs_modulus") and observation.assembly.get(address) >= _RIGID_MODULUS:
                by_part.setdefault(address.partition(".")[0], {})[address] = METAL_MODULUS
    return by_part


def _make_elastic(part: str, decades: Parameter, model: Model) -> Model:
    moduli = _rigid_moduli(model).get(part)
    if not moduli:
        raise UndecidableError(f"{part} is not described as rigid")
    changed = model.rebuild(partial(replace_values, moduli))
    return changed.plus(decades.move(dict.fromkeys(moduli, math.log(10.0)), relative=True))


def replace_values(values: Mapping[str, float], assembly: Assembly) -> Assembly:
    """Return an assembly with other values of the parameters that it has."""
    return assembly.replace({address: value for address, value in values.items() if covered(address, assembly)})


def _of_sides(
    change: Callable[[Parameter, Sequence[str], Model], Model], p: Mapping[str, Parameter], model: Model
) -> Iterator[Variant]:
    """Yield a change of all parts, and of the tool and the holder alone; it gets the parameter and the sides."""
    (parameter,) = p.values()
    sides = [side for side in ("tool", "holder") if any(getattr(anatomy, side) for anatomy in model.anatomies)]
    yield Variant("all parts", partial(change, parameter, sides))
    for side in sides if len(sides) > 1 else ():
        yield Variant(f"all of the {side}", partial(change, parameter, [side]))


def _stated_along(model: Model, moves: Mapping[str, float]) -> list[float]:
    """Return the stated values of the parameters that moves change."""
    assemblies = [observation.assembly for observation in model.observations]
    return [assembly.get(name) for assembly in assemblies for address in moves for name in covered(address, assembly)]


def _move_losses(loss: Parameter, sides: Sequence[str], model: Model) -> Model:
    moves = _everywhere(model, "loss_factor", sides)
    least = max(loss.lower, -min(_stated_along(model, moves)))
    return model.plus(replace(loss, lower=least, plausible=(least, loss.plausible[1])).move(moves))


def _move_ratios(ratio: Parameter, sides: Sequence[str], model: Model) -> Model:
    moves = _everywhere(model, "poisson_ratio", sides)
    stated = _stated_along(model, moves)
    lower, upper = max(ratio.lower, -0.98 - min(stated)), min(ratio.upper, 0.499 - max(stated))
    if lower >= 0.0 or upper <= 0.0:
        raise UndecidableError("Poisson's ratio is at its limit")
    return model.plus(ratio.move(moves, lower=lower, upper=upper))


def other_materials(stated: Material) -> Iterator[MaterialClass]:
    """Yield the classes of listed materials of tools that a stated one is not.

    Deviations within its class are `tool_modulus` and `tool_density`.
    """
    for material in MATERIAL_CLASSES:
        if not material.of_tools:
            continue
        log_modulus, log_density = material.relative_to(stated)
        if abs(log_modulus) > ORDINARY_MODULUS or abs(log_density) > ORDINARY_DENSITY:
            yield material


def _other_material(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    stated = stated_material(model)
    for material in other_materials(stated):
        yield Variant(
            material.name,
            partial(_use_material, material, p),
            meaning=f"the tool is of {material.name}, and the model has a material with "
            f"{1e-9 * stated.youngs_modulus:.0f} GPa and {stated.density:.0f} kg/m3",
            remedy=f"weigh the tool; if it is of {material.name}, give it that material in the model; grades in "
            f"the list are {', '.join(material.grades)}",
        )


def stated_material(model: Model) -> Material:
    """Return the material of the tool, of which the elastic properties and the density are those of all its parts."""
    parts = dict.fromkeys(name for anatomy in model.anatomies for name in anatomy.tool)
    materials = [segment.material for name in parts for part in model.parts(name) for segment in part.segments]
    if len({(material.youngs_modulus, material.density, material.poisson_ratio) for material in materials}) > 1:
        raise UndecidableError("the tool is made of several materials")
    if materials[0].youngs_modulus > _RIGID_MODULUS:
        raise UndecidableError("the tool is described as rigid; the cause flexible_body gives it a modulus")
    return materials[0]


def _use_material(material: MaterialClass, p: Mapping[str, Parameter], model: Model) -> Model:
    stated = stated_material(model)
    log_modulus, log_density = material.relative_to(stated)
    moduli, densities = (_everywhere(model, field, ["tool"]) for field in ("youngs_modulus", "density"))
    # Poisson's ratio changes in proportion to the property that changes most, and reaches that of the material.
    leading, most = (moduli, log_modulus) if abs(log_modulus) >= abs(log_density) else (densities, log_density)
    if stated.poisson_ratio > 0.0:
        change = math.log(material.poisson_ratio / stated.poisson_ratio) / most
        leading |= dict.fromkeys(_everywhere(model, "poisson_ratio", ["tool"]), change)
    of_modulus = _expect(p["log_modulus"], log_modulus, material.modulus_scatter)
    of_density = _expect(p["log_density"], log_density, material.density_scatter)
    return model.plus(of_modulus.move(moduli, relative=True), of_density.move(densities, relative=True))


def _expect(parameter: Parameter, target: float, scatter: float) -> Parameter:
    """Return a parameter with the value of a material as its prior; fits start at null and at that value."""
    reach = MATERIAL_DEVIATIONS * scatter
    return replace(
        parameter,
        lower=min(0.0, target - reach),
        upper=max(0.0, target + reach),
        typical=target / LARGE_SIZE,
        plausible=(target - reach, target + reach),
        prior=Prior(mean=target, standard_deviation=scatter),
    )


def _of_drawing(name: str, typical: float) -> Parameter:
    """Return the natural logarithm of an effective property of parts that a simplified drawing describes."""
    return replace(_between(name, typical, math.log(1.0 - DRAWING), math.log(1.0 + DRAWING)), ordinary=ORDINARY_DENSITY)


def _between(name: str, typical: float, low: float, high: float) -> Parameter:
    """Return the natural logarithm of a factor; its bounds are three times the plausible range."""
    return Parameter(name=name, unit="", lower=3.0 * low, upper=3.0 * high, typical=typical, plausible=(low, high))


_LENGTH_OF_SECTION = Parameter(name="length", unit="m", lower=0.003, upper=0.5, typical=0.02, secondary=True)

PART_CAUSES = (
    Cause(
        id="fluted_part",
        title="fluted part",
        parameters=(
            Parameter(name="log_diameter", unit="", lower=-0.5, upper=0.0, typical=-0.05, plausible=(-0.4, 0.0)),
            _LENGTH_OF_SECTION,
            Parameter(name="log_core_diameter", unit="", lower=-0.4, upper=0.4, typical=0.05, plausible=(-0.25, 0.25)),
            Parameter(name="flute_length", unit="m", lower=-0.03, upper=0.03, typical=1e-3, plausible=(-0.01, 0.01)),
        ),
        change=_flutes,
        meaning="the fluted part is thinner than the full circle that the model has there",
        remedy="model the flutes with their section, or with their effective diameter; a plain blank of the same size "
        "confirms it",
        unspecific=True,
    ),
    Cause(
        id="tip_diameter",
        title="another diameter near the tip",
        parameters=(
            Parameter(name="log_diameter", unit="", lower=-0.5, upper=0.2, typical=0.05, plausible=(-0.4, 0.02)),
            _LENGTH_OF_SECTION,
        ),
        change=_tip_diameter,
        meaning="the part has another diameter near the tip than further on",
        remedy="measure the diameter along the part; look for a collar, a groove, a coating or something left on it",
        unspecific=True,
    ),
    Cause(
        id="tool_modulus",
        title="modulus of the tool",
        parameters=(_between("log_modulus", 0.02, -ORDINARY_MODULUS, ORDINARY_MODULUS),),
        change=partial(_scaled, "tool", "youngs_modulus"),
        meaning="the tool's Young's modulus is not that of its material",
        remedy="measure the blank alone, free-free",
    ),
    Cause(
        id="tool_density",
        title="density of the tool",
        parameters=(_between("log_density", 0.01, -ORDINARY_DENSITY, ORDINARY_DENSITY),),
        change=partial(_scaled, "tool", "density"),
        meaning="the tool is heavier or lighter than its material implies",
        remedy="weigh the blank",
    ),
    Cause(
        id="overhang_error",
        title="wrong overhang",
        parameters=(
            Parameter(name="length", unit="m", lower=-0.01, upper=0.01, typical=5e-4, plausible=(-4e-3, 4e-3)),
        ),
        change=_overhang,
        meaning="the overhang differs from the stated one",
        remedy="measure it again with a caliper",
    ),
    Cause(
        id="holder_inertia",
        title="mass of the holder",
        parameters=(
            _of_drawing("log_density", 0.02),
            Parameter(name="mass", unit="kg", lower=0.0, upper=5.0, typical=0.03, plausible=(0.0, 1.0)),
        ),
        change=_holder_inertia,
        meaning="the holder is heavier or lighter than modelled",
        remedy="weigh the holder with everything that is screwed to it",
    ),
    Cause(
        id="holder_modulus",
        title="stiffness of the holder",
        parameters=(_of_drawing("log_modulus", 0.02),),
        change=partial(_scaled, "holder", "youngs_modulus"),
        meaning="the holder is stiffer or softer than modelled",
        remedy="measure the holder alone, free-free",
        remedy_in_spindle="hit the holder at its nose and near the spindle, and a gauge blank in the same spindle",
    ),
    Cause(
        id="flexible_body",
        title="elastic body",
        parameters=(Parameter(name="decades", unit="", lower=-1.0, upper=9.0, typical=6.0, null=9.0),),
        change=_flexible,
        meaning="a body that the model describes as rigid is elastic",
        remedy="give the body its material",
    ),
    Cause(
        id="shear_neglected",
        title="shear of the beams",
        parameters=(Parameter(name="poisson_ratio", unit="", lower=-1.3, upper=1.5, typical=0.05),),
        change=partial(_of_sides, _move_ratios),
        meaning="the beams shear more or less than modelled",
        remedy="use the shear modulus and the shear coefficient of the section",
    ),
    Cause(
        id="material_loss",
        title="loss factor of the material",
        parameters=(
            Parameter(name="loss_factor", unit="", lower=-0.05, upper=0.3, typical=2e-3, plausible=(-0.05, 0.05)),
        ),
        change=partial(_of_sides, _move_losses),
        meaning="the material of tool or holder loses more or less energy than its stated loss factor",
        remedy="measure the blank alone, free-free, and take the loss factor from its damping",
    ),
    Cause(
        id="tool_material",
        title="material of the tool",
        parameters=tuple(
            Parameter(name=name, unit="", lower=-3.0, upper=3.0, typical=0.3) for name in ("log_modulus", "log_density")
        ),
        change=_other_material,
        large=True,
        meaning="the tool is of another material than modelled",
        remedy="weigh the tool: its density distinguishes the materials",
    ),
)
