"""Causes in the tool and in the holder: dimensions, materials, and bodies that are described as rigid."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

from receptance.diagnosis.causes import Cause, Parameter, Variant
from receptance.diagnosis.model import Model, UndecidableError, places_on, require_beams
from receptance.diagnosis.thresholds import (
    DRAWING,
    FLUTE_ROOM,
    LARGE_SIZE,
    MATERIAL_DEVIATIONS,
    METAL_MODULUS,
    ORDINARY_DENSITY,
    ORDINARY_DRAWING,
    ORDINARY_MODULUS,
    RIGID_MODULUS,
    SHORTENED,
    TIP_STEP,
)
from receptance.fit.unknowns import Prior, covered
from receptance.model.addresses import edges_of
from receptance.model.anatomy import overhang_of
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.joints import PointMass


def _parts(model: Model, side: str) -> tuple[str, ...]:
    if side == "holder":
        require_beams(model)
    found = tuple(dict.fromkeys(name for anatomy in model.anatomies for name in getattr(anatomy, side)))
    if not found:
        raise UndecidableError(f"the model has no {side}")
    return found


def _everywhere(model: Model, side: str, field: str) -> list[str]:
    """Return the addresses of a material property of a side: in its parts, as a core, and in a spread joint."""
    addresses = [f"{name}.segment[*].{field}" for name in _parts(model, side)]
    if side == "tool":
        holders = dict.fromkeys(name for anatomy in model.anatomies for name in anatomy.holder)
        addresses += [f"{name}.segment[*].core.{field}" for name in holders]
    addresses += [f"{name}.{'shank' if side == 'tool' else 'sleeve'}.{field}" for name in model.joints]
    return [
        a
        for a in dict.fromkeys(addresses)
        if any(covered(a, observation.assembly) for observation in model.observations)
    ]


def _scaled(side: str, field: str, p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield the model with a property of a whole side multiplied by a factor."""
    (parameter,) = p.values()
    yield Variant(f"all of the {side}", _scale(parameter, model, side, field))


def _scale(parameter: Parameter, model: Model, side: str, field: str) -> Model:
    """Return the model with a property of a side multiplied by a factor, whose logarithm is the parameter."""
    moves = dict.fromkeys(_everywhere(model, side, field), 1.0)
    if any(model.has(address) for address in moves):
        raise UndecidableError(f"{field} of the {side} is an unknown of the model already")
    return model.plus(parameter.move(moves, relative=True))


def _holder_inertia(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant("density", _scale(p["log_density"], model, "holder", "density"))
    last = dict.fromkeys(anatomy.holder[-1] for anatomy in model.anatomies if anatomy.holder)
    for name in last if len(last) == 1 else ():
        point = PointMass(mass=0.0, part=name, position="end", name="cause_end_mass")
        yield Variant("mass at the far end", model.attach(point).plus(p["mass"].unknown("cause_end_mass.mass")))


def _overhang(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    by_configuration: dict[str, list[str]] = {}
    rooms: dict[str, float] = {}
    for name, observation, anatomy in zip(model.configuration_of, model.observations, model.anatomies, strict=True):
        if anatomy.joint:
            part = anatomy.tool[-1]
            by_configuration.setdefault(name, []).append(overhang_of(observation.assembly, anatomy))
            # The tool cannot become shorter than up to the last place on it.
            *before, end = edges_of(observation.assembly.elements[part])
            used = max([before[-1], *places_on(observation, part)])
            rooms[name] = min(rooms.get(name, math.inf), SHORTENED * (end - used))
    addresses = {address for own in by_configuration.values() for address in own}
    if not addresses:
        raise UndecidableError("the model has no joint between tool and holder")
    if any(model.has(address) for address in addresses):
        raise UndecidableError("the overhang is an unknown of the model already")

    def lengthen(own: Sequence[str], room: float, configurations: str | None) -> Model:
        lower = max(p["length"].lower, -room)
        return model.plus(p["length"].move(dict.fromkeys(own, 1.0), configurations=configurations, lower=lower))

    yield Variant("all", lengthen(sorted(addresses), min(rooms.values()), None))
    for name, own in by_configuration.items() if len(by_configuration) > 1 else ():
        yield Variant(name, lengthen(own, rooms[name], name))


def _flutes(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    tip = model.tip
    parts = model.parts(tip)
    first = f"{tip}.segment[0]"
    if any(len(part.segments) > 1 for part in parts):
        diameter = _up_to_full(p["log_diameter"], parts)
        yield Variant("first section", model.plus(diameter.move({f"{first}.outer_diameter": 1.0}, relative=True)))
        return
    shortest = min(part.segments[0].length for part in parts)
    longest = 0.95 * shortest
    # The end of the flutes cannot pass a place on the tool, so it lies between two of them.
    places = [place for place in model.places(tip) if 0.0 < place < longest]
    for low, high in pairwise([0.0, *places, longest]):
        if high - low < FLUTE_ROOM:
            continue
        divided, _ = model.split(tip, low + TIP_STEP)
        moves = {f"{first}.length": 1.0, f"{tip}.segment[1].length": -1.0}
        beyond = f"beyond {1e3 * low:g} mm" if low else ""
        room = high - low - (2.0 * TIP_STEP if high < longest else 0.0)
        lower = 0.0 if low else min(p["length"].lower, 0.1 * room)
        length = p["length"].move(moves, part=beyond, lower=lower, upper=room, start=0.5 * room)
        diameter_moved = p["log_diameter"].move({f"{first}.outer_diameter": 1.0}, relative=True)
        name = "from the tip" + (f", ending {beyond}" if low else "")
        yield Variant(name, divided.plus(diameter_moved, length), local=bool(places))


def _up_to_full(diameter: Parameter, parts: Sequence[Part]) -> Parameter:
    """Return the effective diameter of a first section with a plausible range up to the diameter of the last one."""
    low, high = diameter.plausible
    room = min(math.log(part.segments[-1].outer_diameter / part.segments[0].outer_diameter) for part in parts)
    return replace(diameter, upper=max(diameter.upper, high + room), plausible=(low, high + max(room, 0.0)))


def _flexible(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    rigid = dict.fromkeys(
        address
        for observation in model.observations
        for address in observation.assembly.parameters
        if address.endswith(".youngs_modulus") and observation.assembly.get(address) >= RIGID_MODULUS
    )
    by_part: dict[str, list[str]] = {}
    for address in rigid:
        by_part.setdefault(address.partition(".")[0], []).append(address)
    if not by_part:
        raise UndecidableError("no part is described as rigid")
    for name, own in by_part.items():
        decades = p["decades"].move(dict.fromkeys(own, math.log(10.0)), relative=True)
        yield Variant(name, model.rebuild(partial(_make_of_metal, own)).plus(decades))


def _make_of_metal(addresses: list[str], assembly: Assembly) -> Assembly:
    """Return the assembly with the moduli from which the decades of stiffness count."""
    return assembly.replace({address: METAL_MODULUS for address in addresses if covered(address, assembly)})


def _shear(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    ratios = [
        observation.assembly.get(address)
        for observation in model.observations
        for address in observation.assembly.parameters
        if address.endswith(".poisson_ratio")
    ]
    sides = [side for side in ("tool", "holder") if any(getattr(a, side) for a in model.anatomies)]
    moved = [address for side in sides for address in _everywhere(model, side, "poisson_ratio")]
    lower = max(p["poisson_ratio"].lower, -0.98 - min(ratios))
    upper = min(p["poisson_ratio"].upper, 0.499 - max(ratios))
    if lower >= 0.0 or upper <= 0.0:
        raise UndecidableError("Poisson's ratio is at its limit")
    ratio = p["poisson_ratio"].move(dict.fromkeys(moved, 1.0), lower=lower, upper=upper)
    yield Variant("all parts", model.plus(ratio))


@dataclass(frozen=True)
class ToolMaterial:
    """A class of materials: typical values and the scatter of its grades."""

    name: str
    """Name in texts."""
    youngs_modulus: float
    """Typical value in Pa."""
    density: float
    """Typical value in kg/m3."""
    poisson_ratio: float
    modulus_scatter: float
    """Standard deviation of the natural logarithm over the grades of the class."""
    density_scatter: float
    """Standard deviation of the natural logarithm over the grades of the class."""


TOOL_MATERIALS = (
    ToolMaterial("steel", 215e9, 7950.0, 0.3, 0.04, 0.02),
    ToolMaterial("cemented carbide", 595e9, 14500.0, 0.22, 0.045, 0.018),
    ToolMaterial("tungsten heavy alloy", 360e9, 17700.0, 0.28, 0.05, 0.025),
    ToolMaterial("aluminium", 70e9, 2740.0, 0.33, 0.03, 0.02),
)
"""Materials of tools, boring bars and dummies.

steel
    210 GPa and a ratio of 0.3 (EN 1993-1-1, 3.2.6), 7850 kg/m3 (EN 1991-1-1, table A.4); high-speed steels have
    215 to 230 GPa and 8000 to 8300 kg/m3 (ISO 4957 grades HS6-5-2 and the like, makers' data sheets).
cemented carbide
    WC with 4 to 15 % Co: 540 to 650 GPa and 13 900 to 15 000 kg/m3 (Brookes, World Directory and Handbook of
    Hardmetals; makers' tables).
tungsten heavy alloy
    W with Ni, Fe or Cu, classes 1 to 4 of ASTM B777: 330 to 390 GPa and 17 000 to 18 500 kg/m3 (makers' data sheets,
    for example Plansee Densimet D170 to D185); for boring bars.
aluminium
    70 GPa and 2700 kg/m3 (EN 1999-1-1, 3.2.5), alloys to 73 GPa and 2850 kg/m3; for dummies and test pieces.
"""


def _other_material(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    addresses = {field: _everywhere(model, "tool", field) for field in ("youngs_modulus", "density", "poisson_ratio")}
    if any(model.has(address) for own in addresses.values() for address in own):
        raise UndecidableError("modulus or density of the tool is an unknown of the model already")
    parts = dict.fromkeys(name for anatomy in model.anatomies for name in anatomy.tool)
    stated = {
        (segment.material.youngs_modulus, segment.material.density, segment.material.poisson_ratio)
        for name in parts
        for part in model.parts(name)
        for segment in part.segments
    }
    if len(stated) > 1:
        raise UndecidableError("the tool is made of several materials")
    ((modulus, density, ratio),) = stated
    if modulus > RIGID_MODULUS:
        raise UndecidableError("the tool is described as rigid; the cause flexible_body gives it a modulus")
    for material in TOOL_MATERIALS:
        log_modulus, log_density = math.log(material.youngs_modulus / modulus), math.log(material.density / density)
        if abs(log_modulus) <= ORDINARY_MODULUS and abs(log_density) <= ORDINARY_DENSITY:
            continue  # the stated material; smaller deviations are tool_modulus and tool_density
        moduli = dict.fromkeys(addresses["youngs_modulus"], 1.0)
        densities = dict.fromkeys(addresses["density"], 1.0)
        # Poisson's ratio changes in proportion to the property that changes most, and reaches that of the material.
        leading, most = (moduli, log_modulus) if abs(log_modulus) >= abs(log_density) else (densities, log_density)
        if ratio > 0.0:
            leading |= dict.fromkeys(addresses["poisson_ratio"], math.log(material.poisson_ratio / ratio) / most)
        of_modulus = _expect(p["log_modulus"], log_modulus, material.modulus_scatter)
        of_density = _expect(p["log_density"], log_density, material.density_scatter)
        yield Variant(
            material.name,
            model.plus(of_modulus.move(moduli, relative=True), of_density.move(densities, relative=True)),
            meaning=f"the tool is of {material.name}, and the model has a material with {1e-9 * modulus:.0f} GPa and "
            f"{density:.0f} kg/m3",
            remedy=f"weigh the tool; if it is of {material.name}, give it that material in the model",
        )


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
    return replace(_between(name, typical, math.log(1.0 - DRAWING), math.log(1.0 + DRAWING)), ordinary=ORDINARY_DRAWING)


def _between(name: str, typical: float, low: float, high: float) -> Parameter:
    """Return the natural logarithm of a factor; its bounds are three times the plausible range."""
    return Parameter(name=name, unit="", lower=3.0 * low, upper=3.0 * high, typical=typical, plausible=(low, high))


PART_CAUSES = (
    Cause(
        id="fluted_part",
        title="thinner fluted part",
        group="structure",
        parameters=(
            Parameter(name="log_diameter", unit="", lower=-0.5, upper=0.2, typical=-0.05, plausible=(-0.4, 0.02)),
            Parameter(name="length", unit="m", lower=0.003, upper=0.5, typical=0.02, secondary=True),
        ),
        change=_flutes,
        meaning="the fluted part is thinner than the full circle that the model has there",
        remedy="model the flutes with their effective diameter; a plain blank of the same size confirms it",
        unspecific=True,
    ),
    Cause(
        id="tool_modulus",
        title="modulus of the tool",
        group="structure",
        parameters=(_between("log_modulus", 0.02, -ORDINARY_MODULUS, ORDINARY_MODULUS),),
        change=partial(_scaled, "tool", "youngs_modulus"),
        meaning="the tool's Young's modulus is not that of its material",
        remedy="measure the blank alone, free-free",
    ),
    Cause(
        id="tool_density",
        title="density of the tool",
        group="structure",
        parameters=(_between("log_density", 0.01, -ORDINARY_DENSITY, ORDINARY_DENSITY),),
        change=partial(_scaled, "tool", "density"),
        meaning="the tool is heavier or lighter than its material implies",
        remedy="weigh the blank",
    ),
    Cause(
        id="overhang_error",
        title="wrong overhang",
        group="structure",
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
        group="structure",
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
        group="structure",
        parameters=(_of_drawing("log_modulus", 0.02),),
        change=partial(_scaled, "holder", "youngs_modulus"),
        meaning="the holder is stiffer or softer than modelled",
        remedy="measure the holder alone, free-free",
        remedy_in_spindle="hit the holder at its nose and near the spindle, and a gauge blank in the same spindle",
    ),
    Cause(
        id="flexible_body",
        title="elastic body",
        group="structure",
        # Fits start three typical sizes from null, which is the stiffness of metals.
        parameters=(Parameter(name="decades", unit="", lower=-1.0, upper=9.0, typical=6.0, null=9.0),),
        change=_flexible,
        meaning="a body that the model describes as rigid is elastic",
        remedy="give the body its material",
    ),
    Cause(
        id="shear_neglected",
        title="shear of the beams",
        group="structure",
        parameters=(Parameter(name="poisson_ratio", unit="", lower=-1.3, upper=1.5, typical=0.05),),
        change=_shear,
        meaning="the beams shear more or less than modelled",
        remedy="use the shear modulus and the shear coefficient of the section",
    ),
    Cause(
        id="tool_material",
        title="material of the tool",
        group="structure",
        parameters=tuple(
            Parameter(name=name, unit="", lower=-3.0, upper=3.0, typical=0.3) for name in ("log_modulus", "log_density")
        ),
        change=_other_material,
        large=True,
        meaning="the tool is of another material than modelled",
        remedy="weigh the tool: its density distinguishes the materials",
    ),
)
