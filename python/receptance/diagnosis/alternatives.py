"""Alternatives: changes of the model that are not causes, fitted beside the causes before one is named.

A wrong cause may absorb most of an effect that the catalogue does not have. The best explanation is therefore compared
with simple changes elsewhere, of the structure (a mass, a softer place, another piece, section or material, a taper, a
resonator, a support) and of the measuring chain (slow changes of level and phase). They show where the model is wrong,
not why, and are never reported as causes. Places are in m from the tip, where things on a tool stay when its overhang
changes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

from receptance.diagnosis.boundary_causes import RESONATOR_PARAMETERS, resonances
from receptance.diagnosis.causes import Cause, Group, Parameter, Variant
from receptance.diagnosis.model import IndescribableError, Model, UndecidableError, with_points
from receptance.diagnosis.part_causes import TOOL_MATERIALS, ToolMaterial, longest_first_section, stated_material
from receptance.diagnosis.scopes import Scope, scopes_of
from receptance.diagnosis.thresholds import (
    ALTERNATIVE_PIECES,
    ALTERNATIVE_PLACES,
    ORDINARY_DENSITY,
    ORDINARY_MODULUS,
    SAME_PLACE,
    SOFT_LENGTH,
    TAPER_CYLINDERS,
    TIP_STEP,
)
from receptance.fit.parameters import HIGH_PASS, LEVEL_EXPONENT, LEVEL_SLOPE, LOW_PASS, PHASE
from receptance.fit.unknowns import Prior
from receptance.model.addresses import edges_of
from receptance.model.anatomy import overhang_of
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.joints import GroundSpring, PointMass


def _holders(model: Model) -> tuple[str, ...]:
    holders = {anatomy.holder for anatomy in model.anatomies}
    return holders.pop() if len(holders) == 1 else ()


def _shortest(model: Model, name: str) -> float:
    return min(part.length for part in model.parts(name))


def _places(model: Model) -> Iterator[tuple[str, float]]:
    """Yield places on tool and holder, in m from the start of the part."""
    for name, shares in (
        (model.tip, ALTERNATIVE_PLACES),
        *((name, (0.0, *ALTERNATIVE_PLACES)) for name in _holders(model)),
    ):
        yield from ((name, share * _shortest(model, name)) for share in shares)


def _at(place: tuple[str, float]) -> str:
    return f"at {1e3 * place[1]:.3g} mm of {place[0]}"


def _mass(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    mass, inertia = p["mass"], p["inertia"]
    for place in _places(model):
        yield Variant(_at(place), partial(_add_mass, place, Scope(), [mass]))
        yield Variant(f"{_at(place)}, with inertia", partial(_add_mass, place, Scope(), [mass, inertia]))
    # A sensor that was on the tool during the stronger hits only.
    on_tool = [(model.tip, 0.0), *(place for place in _places(model) if place[0] == model.tip)]
    for scope, place in itertools.product(scopes_of(model, kinds=("force level",)), on_tool):
        yield Variant(f"{_at(place)}, {scope.name}", partial(_add_mass, place, scope, [mass]))


def _add_mass(place: tuple[str, float], scope: Scope, parameters: Sequence[Parameter], model: Model) -> Model:
    point = PointMass(mass=0.0, part=place[0], position=place[1], name="alternative_mass")
    limits = scope.limits(model)
    return model.with_change(_attach, point).plus(
        *(parameter.unknown(f"alternative_mass.{parameter.name}", **limits) for parameter in parameters)
    )


def _attach(model: Model, point: PointMass | GroundSpring) -> Model:
    """Return the model with a point element on every assembly that has its place."""
    return model.rebuild(partial(_with_point, point))


def _with_point(point: PointMass | GroundSpring, assembly: Assembly) -> Assembly:
    part = assembly.elements.get(point.part)
    if not isinstance(part, Part):
        return assembly
    if not isinstance(point.position, str) and point.position > part.length:
        raise IndescribableError(f"{point.part} is shorter than {1e3 * point.position:.3g} mm")
    return with_points(assembly, point)


def _support(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    # What hangs on its holder has the cause of a suspension there.
    places = [place for place in _places(model) if model.in_spindle or place[0] == model.tip]
    for place in ((model.tip, 0.0), *places):
        yield Variant(_at(place), partial(_hold, place, p["stiffness"], None))
        yield Variant(f"{_at(place)}, with a loss", partial(_hold, place, p["stiffness"], p["damping"]))


def _hold(place: tuple[str, float], stiffness: Parameter, damping: Parameter | None, model: Model) -> Model:
    spring = GroundSpring(part=place[0], position=place[1], name="alternative_support")
    held = model.with_change(_attach, spring).plus(stiffness.unknown("alternative_support.k_y"))
    return held if damping is None else held.plus(damping.unknown("alternative_support.c_y"))


def _section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    addresses = {
        f"{name}.segment[{index}].outer_diameter"
        for observation in model.observations
        for name, part in observation.assembly.elements.items()
        if isinstance(part, Part)
        for index in range(len(part.segments))
    }
    for address in sorted(addresses):
        if not model.has(address):
            name = f"of {address.removesuffix('.outer_diameter')}"
            yield Variant(name, partial(_move, p["log_diameter"], {address: 1.0}))


def _whole_section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield the sections of parts of several, each of another density or modulus."""
    for part in (model.tip, *_holders(model)):
        count = min(len(one.segments) for one in model.parts(part))
        for index in range(count if count > 1 else 0):
            section = f"{part}.segment[{index}]"
            for name in ("log_density", "log_modulus"):
                field, what = _PIECE_FIELDS[name]
                if not model.has(f"{section}.{field}"):
                    change = partial(_move, p[name], {f"{section}.{field}": 1.0})
                    yield Variant(f"{field.replace('_', ' ')} of {section}", change, meaning=what)


def _move(parameter: Parameter, moves: Mapping[str, float], model: Model) -> Model:
    return model.plus(parameter.move(moves, relative=True))


def _piece(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield sections and pieces of tool and holder of another density, modulus or diameter."""
    yield from _whole_section(p, model)
    for part in (model.tip, *_holders(model)):
        length = _shortest(model, part)
        edges = tuple(i / ALTERNATIVE_PIECES * length for i in range(ALTERNATIVE_PIECES + 1))
        for begin, end in itertools.pairwise(edges):
            where = f"from {1e3 * begin:.3g} to {1e3 * end:.3g} mm of {part}"
            for name, (field, what) in _PIECE_FIELDS.items():
                if name != "log_modulus" and part == model.tip and begin == 0.0:
                    continue  # the causes of a sensor and of a fluted part
                change = partial(_change_piece, part, edges, (begin, end), field, p[name])
                yield Variant(f"{field.replace('_', ' ')} {where}", change, meaning=what)


_PIECE_FIELDS = {
    "log_density": ("density", "a piece that is heavier or lighter, its"),
    "log_modulus": ("youngs_modulus", "a piece that is stiffer or softer, its"),
    "log_diameter": ("outer_diameter", "a piece that is thicker or thinner, its"),
}


def _change_piece(
    part: str,
    edges: Sequence[float],
    piece: tuple[float, float],
    field: str,
    parameter: Parameter,
    model: Model,
) -> Model:
    cut = model.with_change(_cut, part, tuple(edges[1:-1]))
    steps = edges_of(cut.parts(part)[0])
    indices = [
        index
        for index, (begin, end) in enumerate(itertools.pairwise(steps))
        if piece[0] - SAME_PLACE <= begin and (end <= piece[1] + SAME_PLACE or piece[1] == edges[-1])
    ]
    return _move(parameter, {f"{part}.segment[{index}].{field}": 1.0 for index in indices}, cut)


def _cut(model: Model, part: str, edges: Sequence[float]) -> Model:
    for edge in edges:
        model, _ = model.split(part, edge)
    return model


def _second_material(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a tool of two materials: another one up to a place, or from a place on."""
    stated = stated_material(model)
    middle = 0.5 * _shortest(model, model.tip)
    for material in (one for one in TOOL_MATERIALS if one.name in _BRAZED):
        log_modulus, log_density = material.relative_to(stated)
        if abs(log_modulus) <= ORDINARY_MODULUS and abs(log_density) <= ORDINARY_DENSITY:
            continue
        yield Variant(f"{material.name} at the tip", partial(_make_head, material, p))
        yield Variant(f"{material.name} behind a head", partial(_make_shank, material, middle, p["share"], p["begin"]))


_BRAZED = ("steel", "cemented carbide")
"""Materials of heads and shanks that are brazed or shrunk together."""


def _make_head(material: ToolMaterial, p: Mapping[str, Parameter], model: Model) -> Model:
    """Return the model with a head of another material, of which the grade is not known."""
    tip, length = model.tip, p["length"]
    divided, _ = model.split(tip, 0.05 * TIP_STEP)
    upper = longest_first_section(model.parts(tip))
    lengths = {f"{tip}.segment[0].length": 1.0, f"{tip}.segment[1].length": -1.0}
    grade = [
        replace(p[name], prior=Prior(mean=0.0, standard_deviation=scatter)).move(
            {f"{tip}.segment[0].{field}": 1.0}, relative=True
        )
        for name, field, scatter in (
            ("log_modulus", "youngs_modulus", material.modulus_scatter),
            ("log_density", "density", material.density_scatter),
        )
    ]
    changed = divided.with_change(_with_head, tip, material)
    return changed.plus(length.move(lengths, upper=min(length.upper, upper)), *grade)


def _with_head(model: Model, tip: str, material: ToolMaterial) -> Model:
    return model.rebuild(partial(_replace_head, tip, material))


def _replace_head(tip: str, material: ToolMaterial, assembly: Assembly) -> Assembly:
    if tip not in assembly.elements:
        return assembly
    first = f"{tip}.segment[0]"
    properties = ("youngs_modulus", "density", "poisson_ratio")
    return assembly.replace({f"{first}.{name}": getattr(material, name) for name in properties})


def _make_shank(material: ToolMaterial, middle: float, share: Parameter, begin: Parameter, model: Model) -> Model:
    """Return the model with a share of the way to another material from a place on, which moves as well."""
    tip = model.tip
    log_modulus, log_density = material.relative_to(stated_material(model))
    divided, index = model.split(tip, middle)
    count = len(divided.parts(tip)[0].segments)
    moves = {f"{tip}.segment[{i}].youngs_modulus": log_modulus for i in range(index, count)}
    moves |= {f"{tip}.segment[{i}].density": log_density for i in range(index, count)}
    lengths = {f"{tip}.segment[{index - 1}].length": 1.0, f"{tip}.segment[{index}].length": -1.0}
    room = 0.9 * min(part.segments[i].length for part in divided.parts(tip) for i in (index - 1, index))
    return divided.plus(share.move(moves, relative=True), begin.move(lengths, lower=-room, upper=room))


def _taper(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant(f"of {model.tip}", partial(_make_conical, p["log_diameter"]))


def _make_conical(diameter: Parameter, model: Model) -> Model:
    tip = model.tip
    if any(len(part.segments) != 1 for part in model.parts(tip)):
        raise UndecidableError("the tool has steps")
    for i in range(TAPER_CYLINDERS - 1):
        model, _ = model.split(tip, partial(_share, (i + 1) / TAPER_CYLINDERS))
    # The change of the diameter decreases from the tip to zero at the holder.
    weights = {f"{tip}.segment[{i}].outer_diameter": 1.0 - (i + 0.5) / TAPER_CYLINDERS for i in range(TAPER_CYLINDERS)}
    return _move(diameter, weights, model)


def _share(share: float, part: Part) -> float:
    return share * part.length


def _soft_section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    for name, position in _places(model):
        if position:
            yield Variant(_at((name, position)), partial(_soften, name, position, p["log_diameter"]))


def _soften(part: str, position: float, diameter: Parameter, model: Model) -> Model:
    started, _ = model.split(part, position)
    ended, index = started.split(part, position + SOFT_LENGTH)
    return _move(diameter, {f"{part}.segment[{index - 1}].outer_diameter": 1.0}, ended)


def _other_tool(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a tool that is another one, or has another overhang, in some records."""
    scopes = scopes_of(model, kinds=("configuration", "record"))
    if not scopes:
        raise UndecidableError("there are no FRFs, or a single one: measure several")
    pairs = zip(model.observations, model.anatomies, strict=True)
    overhangs = {overhang_of(observation.assembly, anatomy) for observation, anatomy in pairs if anatomy.joint}
    fields = {"log_density": f"{model.tip}.segment[*].density", "log_modulus": f"{model.tip}.segment[*].youngs_modulus"}
    for scope in scopes:
        for name, address in fields.items():
            if not model.has(address):
                change = partial(_change_in, scope, {address: 1.0}, p[name], relative=True)
                yield Variant(f"of another {name.removeprefix('log_')} in the {scope.name}", change)
        if len(overhangs) == 1 and not any(map(model.has, overhangs)):
            change = partial(_change_in, scope, dict.fromkeys(overhangs, 1.0), p["length"], relative=False)
            yield Variant(f"of another overhang in the {scope.name}", change)


def _change_in(
    scope: Scope, moves: Mapping[str, float], parameter: Parameter, model: Model, *, relative: bool
) -> Model:
    return model.plus(parameter.move(moves, relative=relative, **scope.limits(model)))


def _resonator(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield from resonances(p, model, _tip, f"on the tip of {model.tip}")


def _tip(model: Model) -> tuple[str, float]:
    return model.tip, 0.0


def _amplifier(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield slow changes of level and phase over the frequency, of all records."""
    if not model.receptances:
        raise UndecidableError("natural frequencies alone do not show it; measure FRFs")
    level = "a level that changes"
    yield Variant("with a power of the frequency", partial(_add, p, {LEVEL_EXPONENT: "exponent"}), meaning=level)
    yield Variant("in proportion to the frequency", partial(_add, p, {LEVEL_SLOPE: "slope"}), meaning=level)
    yield Variant("at all frequencies", partial(_add, p, {PHASE: "phase"}), meaning="a phase that is turned")
    yield Variant(
        "with the frequency",
        partial(_add, p, {LEVEL_EXPONENT: "exponent", PHASE: "phase"}),
        meaning="a level and a phase that change slowly",
    )
    yield Variant("of first order", partial(_add, p, {LOW_PASS: "time_constant"}), meaning="a low pass in one channel")
    yield Variant("of one channel", partial(_add, p, {HIGH_PASS: "corner"}), meaning="the AC coupling")


def _add(p: Mapping[str, Parameter], addresses: Mapping[str, str], model: Model) -> Model:
    return model.plus(*(p[name].unknown(address) for address, name in addresses.items()))


def _alternative(
    id: str,
    change: Callable[..., Iterator[Variant]],
    *parameters: Parameter,
    meaning: str,
    anywhere: bool = False,
    group: Group = "structure",
    remedy: str = "inspect the place: a mass, a crack, a dimension, a loose part",
) -> Cause:
    return Cause(
        id=id, group=group, parameters=parameters, change=change, meaning=meaning, remedy=remedy, anywhere=anywhere
    )


def _diameter(lower: float, upper: float, typical: float) -> Parameter:
    return Parameter(name="log_diameter", unit="", lower=lower, upper=upper, typical=typical)


ALTERNATIVES = (
    _alternative(
        "mass_somewhere",
        _mass,
        Parameter(name="mass", unit="kg", lower=0.0, upper=2.0, typical=0.005),
        Parameter(name="inertia", unit="kg m2", lower=0.0, upper=1e-2, typical=1e-6),
        meaning="a mass",
        anywhere=True,
    ),
    _alternative("other_section", _section, _diameter(-0.4, 0.4, 0.02), meaning="another diameter", anywhere=True),
    _alternative("cone", _taper, _diameter(-0.4, 0.4, 0.02), meaning="a taper"),
    _alternative(
        "soft_place", _soft_section, _diameter(-2.0, 0.0, -0.2), meaning="a place with more bending", anywhere=True
    ),
    _alternative(
        "other_piece",
        _piece,
        Parameter(name="log_density", unit="", lower=-2.0, upper=2.0, typical=0.05),
        Parameter(name="log_modulus", unit="", lower=-2.0, upper=2.0, typical=0.05),
        _diameter(-0.5, 0.5, 0.02),
        meaning="another piece",
        anywhere=True,
    ),
    _alternative(
        "second_material",
        _second_material,
        Parameter(name="length", unit="m", lower=0.0, upper=0.5, typical=5e-3),
        Parameter(name="share", unit="", lower=0.0, upper=1.5, typical=0.3),
        Parameter(name="begin", unit="m", lower=-0.5, upper=0.5, typical=0.0, secondary=True),
        Parameter(name="log_modulus", unit="", lower=-0.3, upper=0.3, typical=0.0, secondary=True),
        Parameter(name="log_density", unit="", lower=-0.3, upper=0.3, typical=0.0, secondary=True),
        meaning="a tool of two materials,",
        anywhere=True,
        remedy="ask for the drawing of the tool: a brazed head or a steel shank; weigh it",
    ),
    _alternative(
        "support",
        _support,
        Parameter(name="stiffness", unit="N/m", lower=0.0, upper=1e9, typical=1e4),
        Parameter(name="damping", unit="N s/m", lower=0.0, upper=1e5, typical=1.0),
        meaning="something that holds or rubs",
        anywhere=True,
        remedy="look for what touches tool or holder: a cable, foam, a hand, a support",
    ),
    _alternative(
        "other_tool",
        _other_tool,
        Parameter(name="log_density", unit="", lower=-1.0, upper=1.0, typical=0.02),
        Parameter(name="log_modulus", unit="", lower=-1.0, upper=1.0, typical=0.02),
        Parameter(name="length", unit="m", lower=-2e-3, upper=2e-3, typical=2e-4),
        meaning="a tool",
        remedy="compare the records: another blank of the same name, or a tool that slipped between them",
    ),
    _alternative(
        "body_on_the_tip",
        _resonator,
        # At the tip a resonator of a milligram is not negligible.
        Parameter(name="mass", unit="kg", lower=1e-8, upper=1.0, typical=1e-3, null=1e-8),
        *RESONATOR_PARAMETERS[1:],
        meaning="a mass on a spring",
    ),
    _alternative(
        "slow_change",
        _amplifier,
        Parameter(name="exponent", unit="", lower=-1.0, upper=1.0, typical=0.01),
        Parameter(name="slope", unit="s", lower=-1e-4, upper=1e-4, typical=1e-6),
        Parameter(name="phase", unit="rad", lower=-3.2, upper=3.2, typical=0.01),
        Parameter(name="time_constant", unit="s", lower=-1e-3, upper=1e-3, typical=3e-6),
        Parameter(name="corner", unit="rad/s", lower=-3e3, upper=3e3, typical=30.0),
        meaning="a slow change of level or phase",
        group="measurement",
        remedy="measure a known free mass with both channels: its level and phase over the frequency are those of the "
        "chain; look for filters, AC coupling and amplifiers",
    ),
)
"""Changes that are fitted beside the causes and never reported as causes."""
