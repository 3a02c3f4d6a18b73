"""Causes that lie in tool and holder."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from receptance._addresses import edges_of
from receptance.assembly import Assembly
from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
from receptance.diagnosis.model import Model, places_on
from receptance.identification.task import place_of
from receptance.identification.unknowns import covered
from receptance.joints import PointMass, Resonator

__all__ = ["PART_CAUSES", "RESONATOR", "RIGID", "everywhere", "resonances"]

_SPLIT = 1e-5
"""Distance in m from the tip, or from a place on the tool, at which a part is divided; the parameter moves the step."""
_MOST_SHORTENED = 0.98
"""Share of what is left behind the last place on a tool by which the tool may be shorter than stated."""
_ROOM = 1e-3
"""Between places that are nearer to each other than this, in m, no step is looked for."""
_METAL = 2e11
"""Young's modulus in Pa from which the stiffness of a body is counted, in decades; nine of them are rigid."""
RIGID = 2e12
"""No material has a Young's modulus above this, in Pa: who gives one means a rigid body."""
_STEP = 0.08
"""Distance of the frequencies near which a mode is looked for, as a natural logarithm."""


def _parts(model: Model, side: str) -> tuple[str, ...]:
    found = tuple(dict.fromkeys(name for anatomy in model.anatomies for name in getattr(anatomy, side)))
    if not found:
        raise UndecidableError(f"the model has no {side}")
    return found


def everywhere(model: Model, side: str, field: str) -> list[str]:
    """Return the addresses of a number of a material: in the parts, within the holder, beside a spread joint."""
    addresses = [f"{name}.segment[*].{field}" for name in _parts(model, side)]
    if side == "tool":
        holders = dict.fromkeys(name for anatomy in model.anatomies for name in anatomy.holder)
        addresses += [f"{name}.segment[*].core.{field}" for name in holders]
    addresses += [f"{name}.{'shank' if side == 'tool' else 'sleeve'}.{field}" for name in model.joints]
    return [a for a in dict.fromkeys(addresses) if any(covered(a, one.assembly) for one in model.observations)]


def _scaled(p: Parameter, model: Model, side: str, field: str) -> Model:
    moves = dict.fromkeys(everywhere(model, side, field), 1.0)
    if any(model.has(address) for address in moves):
        raise UndecidableError(f"{field} of the {side} is an unknown of the model already")
    return model.plus(p.move(moves, relative=True))


def _tool_modulus(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant("all of the tool", _scaled(p["log_modulus"], model, "tool", "youngs_modulus"))


def _tool_density(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant("all of the tool", _scaled(p["log_density"], model, "tool", "density"))


def _holder_modulus(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant("all of the holder", _scaled(p["log_modulus"], model, "holder", "youngs_modulus"))


def _holder_inertia(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant("density", _scaled(p["log_density"], model, "holder", "density"))
    last = dict.fromkeys(anatomy.holder[-1] for anatomy in model.anatomies if anatomy.holder)
    for name in last if len(last) == 1 else ():
        point = PointMass(mass=0.0, part=name, position="end", name="cause_end_mass")
        yield Variant("mass at the far end", model.attached(point).plus(p["mass"].unknown("cause_end_mass.mass")))


def _overhang(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    by_configuration: dict[str, list[str]] = {}
    rooms: dict[str, float] = {}
    for index, (one, anatomy) in enumerate(zip(model.observations, model.anatomies, strict=True)):
        if anatomy.joint:
            part = anatomy.tool[-1]
            count = len(one.assembly.elements[part].segments)  # type: ignore[union-attr]
            name = place_of(one, index).configuration
            by_configuration.setdefault(name, []).append(f"{part}.segment[{count - 1}].length")
            # The tool cannot become shorter than where it was measured.
            *before, end = edges_of(one.assembly.elements[part])
            used = max([before[-1], *places_on(one, part)])
            rooms[name] = min(rooms.get(name, math.inf), _MOST_SHORTENED * (end - used))
    addresses = {address for own in by_configuration.values() for address in own}
    if not addresses:
        raise UndecidableError("the model has no joint between tool and holder")
    if any(model.has(address) for address in addresses):
        raise UndecidableError("the overhang is an unknown of the model already")
    whole = p["length"].move(dict.fromkeys(sorted(addresses), 1.0))
    yield Variant("all", model.plus(replace(whole, lower=max(whole.lower, -min(rooms.values())))))
    for name, own in by_configuration.items() if len(by_configuration) > 1 else ():
        alone = p["length"].move(dict.fromkeys(own, 1.0), configurations=name)
        yield Variant(name, model.plus(replace(alone, lower=max(alone.lower, -rooms[name]))))


def _flutes(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    tips = dict.fromkeys(anatomy.tool[0] for anatomy in model.anatomies if anatomy.tool)
    if len(tips) != 1:
        raise UndecidableError("the tools are called differently in the assemblies")
    tip = next(iter(tips))
    parts = [one.assembly.elements[tip] for one in model.observations if tip in one.assembly.elements]
    first = f"{tip}.segment[0]"
    if any(len(part.segments) > 1 for part in parts):  # type: ignore[union-attr]
        changed = model.plus(p["log_diameter"].move({f"{first}.outer_diameter": 1.0}, relative=True))
        yield Variant("first section", changed, limited=(_up_to_full(p["log_diameter"], parts),))
        return
    shortest = min(part.segments[0].length for part in parts)  # type: ignore[union-attr]
    upper = 0.95 * shortest
    # A step cannot pass a place where something is measured or attached: it lies between two of them.
    places = [place for place in model.places(tip) if 0.0 < place < upper]
    for low, high in pairwise([0.0, *places, upper]):
        if high - low < _ROOM:
            continue
        divided, _ = model.split(tip, low + _SPLIT)
        moves = {f"{first}.length": 1.0, f"{tip}.segment[1].length": -1.0}
        beyond = f"beyond {1e3 * low:g} mm" if low else ""
        length = p["length"].move(moves, part=beyond)
        own = high - low - (2.0 * _SPLIT if high < upper else 0.0)
        length = replace(length, lower=0.0 if low else min(length.lower, 0.1 * own), upper=own, start=0.5 * own)
        diameter = p["log_diameter"].move({f"{first}.outer_diameter": 1.0}, relative=True)
        yield Variant(
            "from the tip" + (f", ending {beyond}" if low else ""), divided.plus(diameter, length), local=bool(places)
        )


def _up_to_full(diameter: Parameter, parts: Sequence[Any]) -> Parameter:
    """Return the plausible range of a first section: an effective diameter can be too small, up to the full circle."""
    low, high = diameter.plausible or (diameter.lower, diameter.upper)
    room = min(math.log(part.segments[-1].outer_diameter / part.segments[0].outer_diameter) for part in parts)
    return replace(diameter, upper=max(diameter.upper, high + room), plausible=(low, high + max(room, 0.0)))


def _flexible(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    rigid = dict.fromkeys(
        address
        for one in model.observations
        for address in one.assembly.parameters
        if address.endswith(".youngs_modulus") and one.assembly.get(address) >= RIGID
    )
    parts = dict.fromkeys(address.split(".")[0] for address in rigid)
    if not parts:
        raise UndecidableError("no part is described as rigid")
    for name in parts:
        own = [address for address in rigid if address.split(".")[0] == name]
        moves = dict.fromkeys(own, math.log(10.0))
        yield Variant(name, model.rebuilt(partial(_of_metal, own)).plus(p["decades"].move(moves, relative=True)))


def _of_metal(addresses: list[str], assembly: Assembly) -> Assembly:
    """Return the assembly with some moduli at which its decades of stiffness begin to count."""
    return assembly.replace({address: _METAL for address in addresses if covered(address, assembly)})


def _missing(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    ends = dict.fromkeys(anatomy.holder[-1] for anatomy in model.anatomies if anatomy.holder)
    if len(ends) != 1:
        raise UndecidableError("the model has no holder, or several")
    if not all(one.assembly.countable for one in model.observations):
        raise UndecidableError("the model ends with a spindle that has its modes already; see spindle_mode")
    yield from resonances(p, model, next(iter(ends)), "end", "at the holder's far end")


def resonances(
    p: Mapping[str, Parameter], model: Model, part: str, position: float | Literal["end"], where: str
) -> Iterator[Variant]:
    """Yield models with a resonator on a part, tuned to frequencies over the whole band of the lines."""
    low = min(float(one.frequency_hz[0].real) for one in model.observations)
    high = max(float(one.frequency_hz[-1].real) for one in model.observations)
    count = 1 + math.ceil(math.log(high / low) / _STEP)
    resonator = Resonator(mass=0.0, k_y=1.0, part=part, position=position, name="cause_resonator")
    changed = model.attached(resonator)
    for frequency in np.geomspace(low, high, max(count, 2)):
        angular = 2.0 * math.pi * float(frequency)
        also = {"cause_resonator.k_y": angular**2, "cause_resonator.c_y": 0.02 * angular}
        mass = replace(p["mass"].unknown("cause_resonator.mass"), also=also)
        tuned = p["log_frequency"].move({"cause_resonator.k_y": 2.0, "cause_resonator.c_y": 1.0}, relative=True)
        damped = p["log_damping"].move({"cause_resonator.c_y": 1.0}, relative=True)
        within = (math.log(low / frequency), math.log(high / frequency))
        yield Variant(
            f"near {frequency:.0f} Hz {where}",
            changed.plus(mass, tuned, damped),
            # No mode is measured outside the lines: a spring to ground or a mass has the same effect there.
            limited=(replace(p["log_frequency"], plausible=within),),
        )


def _shear(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    addresses = {
        address: one.assembly.get(address)
        for one in model.observations
        for address in one.assembly.parameters
        if address.endswith(".poisson_ratio")
    }
    highest, lowest = max(addresses.values()), min(addresses.values())
    sides = [side for side in ("tool", "holder") if any(getattr(a, side) for a in model.anatomies)]
    moved = [address for side in sides for address in everywhere(model, side, "poisson_ratio")]
    ratio = p["poisson_ratio"].move(dict.fromkeys(moved, 1.0))
    lower, upper = max(ratio.lower, -0.98 - lowest), min(ratio.upper, 0.499 - highest)
    if lower >= 0.0 or upper <= 0.0:
        raise UndecidableError("Poisson's ratio is at its limit")
    yield Variant("all parts", model.plus(replace(ratio, lower=lower, upper=upper)))


def _share(name: str, typical: float, believable: float) -> Parameter:
    limit = 3.0 * believable
    return Parameter(
        name=name, unit="", lower=-limit, upper=limit, typical=typical, plausible=(-believable, believable)
    )


RESONATOR = (
    Parameter(name="mass", unit="kg", lower=1e-6, upper=20.0, typical=0.02, null=1e-6),
    Parameter(name="log_frequency", unit="", lower=-0.3, upper=0.3, typical=0.0, secondary=True),
    Parameter(name="log_damping", unit="", lower=-4.0, upper=3.0, typical=0.0, secondary=True),
)
"""Of a body that swings on a spring."""

PART_CAUSES = (
    Cause(
        id="fluted_part",
        group="structure",
        parameters=(
            Parameter(name="log_diameter", unit="", lower=-0.5, upper=0.2, typical=-0.05, plausible=(-0.4, 0.02)),
            Parameter(name="length", unit="m", lower=0.003, upper=0.5, typical=0.02, secondary=True),
        ),
        change=_flutes,
        meaning="the fluted part is thinner than the full circle that the model has there",
        remedy="model the flutes with their effective diameter; a plain blank of the same size confirms it",
    ),
    Cause(
        id="tool_modulus",
        group="structure",
        parameters=(_share("log_modulus", 0.02, 0.15),),
        change=_tool_modulus,
        meaning="the tool's Young's modulus is not that of its material",
        remedy="measure the blank alone, free-free",
    ),
    Cause(
        id="tool_density",
        group="structure",
        parameters=(_share("log_density", 0.01, 0.1),),
        change=_tool_density,
        meaning="the tool is heavier or lighter than its material says",
        remedy="weigh the blank",
    ),
    Cause(
        id="overhang_error",
        group="structure",
        parameters=(
            Parameter(name="length", unit="m", lower=-0.01, upper=0.01, typical=5e-4, plausible=(-4e-3, 4e-3)),
        ),
        change=_overhang,
        meaning="the overhang is not what was written down",
        remedy="measure it again with a caliper",
    ),
    Cause(
        id="holder_inertia",
        group="structure",
        parameters=(
            _share("log_density", 0.02, 0.1),
            Parameter(name="mass", unit="kg", lower=0.0, upper=5.0, typical=0.03, plausible=(0.0, 1.0)),
        ),
        change=_holder_inertia,
        meaning="the holder is heavier or lighter than the model says",
        remedy="weigh the holder with all that is screwed to it",
    ),
    Cause(
        id="holder_modulus",
        group="structure",
        parameters=(_share("log_modulus", 0.02, 0.1),),
        change=_holder_modulus,
        meaning="the holder is stiffer or softer than the model says",
        remedy="measure the holder alone, free-free",
    ),
    Cause(
        id="flexible_body",
        group="structure",
        # Fits start three typical sizes from null, which is where metals are.
        parameters=(Parameter(name="decades", unit="", lower=-1.0, upper=9.0, typical=6.0, null=9.0),),
        change=_flexible,
        meaning="a body that the model takes as rigid is elastic",
        remedy="give the body its material",
    ),
    Cause(
        id="missing_mode",
        group="structure",
        parameters=RESONATOR,
        change=_missing,
        meaning="spindle or fixture has a mode of its own that the model does not have",
        remedy="measure the spindle or the fixture alone at that frequency",
    ),
    Cause(
        id="shear_neglected",
        group="structure",
        parameters=(Parameter(name="poisson_ratio", unit="", lower=-1.3, upper=1.5, typical=0.05),),
        change=_shear,
        meaning="the beams shear more or less than the model says",
        remedy="use the shear modulus and the shear coefficient of the section",
    ),
)
