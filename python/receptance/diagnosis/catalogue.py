"""The catalogue: the causes that a diagnosis tries by default, and the alternatives, which are not causes.

A wrong cause may absorb most of an effect that the catalogue does not have. The best explanation is therefore compared
with simple changes elsewhere, of the structure (a mass, a softer place, another piece, section or material, a taper, a
resonator, a support) and of the measuring chain (slow changes of level and phase). They show where the model is wrong,
not why, and are never reported as causes. Their places are in m from the tip, where things on a tool stay when its
overhang changes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

from receptance._text import instead_of, shown
from receptance.diagnosis.boundary_causes import BOUNDARY_CAUSES, RESONATOR_PARAMETERS, resonances
from receptance.diagnosis.causes import Cause, Group, Parameter, Variant
from receptance.diagnosis.changes import (
    Scope,
    add,
    attach,
    move,
    moved_step,
    overhangs_of,
    require_receptances,
    room_of_step,
    scopes_of,
)
from receptance.diagnosis.joint_causes import JOINT_CAUSES
from receptance.diagnosis.measurement_causes import MEASUREMENT_CAUSES
from receptance.diagnosis.model import Model, UndecidableError, of_thickness, require_joint
from receptance.diagnosis.part_causes import (
    PART_CAUSES,
    longest_first_section,
    other_materials,
    replace_values,
    stated_material,
)
from receptance.diagnosis.thresholds import ALTERNATIVE_PLACES, PIECES, SAME_PLACE, SHORT_SECTION, TIP_STEP
from receptance.fit.parameters import HIGH_PASS, LEVEL_EXPONENT, LEVEL_SLOPE, LOW_PASS, PHASE
from receptance.fit.unknowns import Prior
from receptance.model.addresses import edges_of
from receptance.model.beams import Part
from receptance.model.joints import GroundSpring, PointMass
from receptance.model.materials import MaterialClass

CATALOGUE: Mapping[str, Cause] = MappingProxyType(
    {cause.id: cause for cause in (*JOINT_CAUSES, *PART_CAUSES, *BOUNDARY_CAUSES, *MEASUREMENT_CAUSES)}
)
"""The causes by id."""


def resolve_causes(causes: Iterable[Cause | str] | None) -> tuple[Cause, ...]:
    """Return causes given as objects or ids; None is the whole catalogue.

    Raises
    ------
    TypeError, ValueError
        An unknown id, an object that is not a cause, or a cause that is given twice.
    """
    if causes is None:
        return tuple(CATALOGUE.values())
    by_id: dict[str, Cause] = {}
    for cause in [causes] if isinstance(causes, (Cause, str)) else causes:
        if isinstance(cause, str):
            if cause not in CATALOGUE:
                raise ValueError(f"there is no cause {shown(cause)}{instead_of(cause, CATALOGUE)}")
            cause = CATALOGUE[cause]
        if not isinstance(cause, Cause):
            raise TypeError(f"causes has {cause!r}, expected a Cause or the id of one")
        if cause.id in by_id:
            raise ValueError(f"the cause {cause.id!r} is given twice")
        by_id[cause.id] = cause
    return tuple(by_id.values())


def _carriers(model: Model) -> tuple[str, ...]:
    """Return the parts that an alternative may be on: that with the tip, and those of the holder."""
    holders = {anatomy.holder for anatomy in model.anatomies}
    return (model.tip, *(holders.pop() if len(holders) == 1 else ()))


def _shortest(model: Model, name: str) -> float:
    return min(part.length for part in model.parts(name))


def _places(model: Model) -> Iterator[tuple[str, float]]:
    """Yield places on tool and holder, in m from the start of the part."""
    for name in _carriers(model):
        shares = ALTERNATIVE_PLACES if name == model.tip else (0.0, *ALTERNATIVE_PLACES)
        yield from ((name, share * _shortest(model, name)) for share in shares)


def _at(place: tuple[str, float]) -> str:
    return f"at {1e3 * place[1]:.3g} mm of {place[0]}"


def _mass(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    mass = partial(PointMass, mass=0.0, name="alternative_mass")
    for place in _places(model):
        yield Variant(_at(place), partial(_attach, mass, place, {"mass": p["mass"]}))
        yield Variant(f"{_at(place)}, with inertia", partial(_attach, mass, place, p))
    # A sensor that was on the tool during the stronger hits only.
    on_tool = [(model.tip, 0.0), *(place for place in _places(model) if place[0] == model.tip)]
    for scope, place in itertools.product(scopes_of(model, kinds=("force level",)), on_tool):
        change = partial(_attach, mass, place, {"mass": p["mass"]}, scope=scope)
        yield Variant(f"{_at(place)}, {scope.name}", change)


def _mass_near_tip(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant(f"near the tip of {model.tip}", partial(_add_near_tip, p))


def _add_near_tip(p: Mapping[str, Parameter], model: Model) -> Model:
    """Return the model with a mass near the tip, whose place is fitted.

    It lies before the first of the other places, and apart from the tip, where a sensor's mass is a cause.
    """
    tip, position = model.tip, 0.5 * ALTERNATIVE_PLACES[0] * _shortest(model, model.tip)
    towards, away = room_of_step(model, tip, position)
    if not away:
        raise UndecidableError("there is a step, a hit or an attachment already")
    mass = PointMass(mass=0.0, part=tip, position=position, name="alternative_mass")
    changed = attach(model.split(tip, position)[0], [mass], {"mass": p["mass"]})
    moves = moved_step(changed, tip, position)
    return changed.plus(p["distance"].move(moves, lower=max(towards, -0.5 * position), upper=min(away, position)))


def _support(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    spring = partial(GroundSpring, name="alternative_support")
    # What hangs on its holder has the cause of a suspension there.
    places = [place for place in _places(model) if model.in_spindle or place[0] == model.tip]
    for place in ((model.tip, 0.0), *places):
        yield Variant(_at(place), partial(_attach, spring, place, {"k_y": p["stiffness"]}))
        fields = {"k_y": p["stiffness"], "c_y": p["damping"]}
        yield Variant(f"{_at(place)}, with a loss", partial(_attach, spring, place, fields))
    # A hose that sticks in weak hits and slides in strong ones.
    for scope, place in itertools.product(scopes_of(model, kinds=("force level",)), _places(model)):
        change = partial(_attach, spring, place, {"k_y": p["stiffness"], "c_y": p["damping"]}, scope=scope)
        yield Variant(f"{_at(place)}, {scope.name}", change)


def _attach(
    element: Callable[..., PointMass | GroundSpring],
    place: tuple[str, float],
    parameters: Mapping[str, Parameter],
    model: Model,
    scope: Scope | None = None,
) -> Model:
    return attach(model, [element(part=place[0], position=place[1])], parameters, scope)


def _section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    addresses = {
        f"{name}.segment[{index}].outer_diameter"
        for observation in model.observations
        for name, part in observation.assembly.elements.items()
        if isinstance(part, Part)
        for index in range(len(part.segments))
    }
    if any(len(part.segments) > 1 for part in model.parts(model.tip)):
        # The first of several sections is changed by causes: flutes, and another diameter near the tip.
        addresses.discard(f"{model.tip}.segment[0].outer_diameter")
    for address in sorted(addresses):
        if not model.has(address):
            name = f"of {address.removesuffix('.outer_diameter')}"
            yield Variant(name, partial(_thicken, p["log_diameter"], address.removesuffix(".outer_diameter")))


def _thicken(diameter: Parameter, section: str, model: Model) -> Model:
    return move(diameter, of_thickness(model, section), Scope(), model)


def _whole_section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield the sections of parts of several, each of another density or modulus."""
    for part in _carriers(model):
        count = min(len(one.segments) for one in model.parts(part))
        for index in range(count if count > 1 else 0):
            section = f"{part}.segment[{index}]"
            for name in ("log_density", "log_modulus"):
                field, what = _PIECE_FIELDS[name]
                if not model.has(f"{section}.{field}"):
                    change = partial(move, p[name], {f"{section}.{field}": 1.0}, Scope())
                    yield Variant(f"{field.replace('_', ' ')} of {section}", change, meaning=what)


def _piece(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield sections and pieces of tool and holder of another density, modulus or diameter."""
    yield from _whole_section(p, model)
    for part in _carriers(model):
        length = _shortest(model, part)
        edges = tuple(i / PIECES * length for i in range(PIECES + 1))
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
    moves: dict[str, float] = {}
    for section in (f"{part}.segment[{index}]" for index in indices):
        moves |= of_thickness(cut, section) if field == "outer_diameter" else {f"{section}.{field}": 1.0}
    return move(parameter, moves, Scope(), cut)


def _cut(model: Model, part: str, edges: Sequence[float]) -> Model:
    for edge in edges:
        model, _ = model.split(part, edge)
    return model


def _second_material(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a tool of two materials: another one up to a place, or from a place on."""
    middle = 0.5 * _shortest(model, model.tip)
    for material in other_materials(stated_material(model)):
        if material.name in _BRAZED:
            yield Variant(f"{material.name} at the tip", partial(_make_head, material, p))
            yield Variant(f"{material.name} behind a head", partial(_make_shank, material, p, middle))


_BRAZED = ("steel", "cemented carbide")
"""Materials of heads and shanks that are brazed or shrunk together."""


def _make_head(material: MaterialClass, p: Mapping[str, Parameter], model: Model) -> Model:
    """Return the model with a head of another material, of which the grade is not known."""
    tip, length, at = model.tip, p["length"], 0.05 * TIP_STEP
    scatter = {"youngs_modulus": ("log_modulus", material.modulus_scatter)}
    scatter["density"] = ("log_density", material.density_scatter)
    grade = [
        replace(p[name], prior=Prior(mean=0.0, standard_deviation=deviation)).move(
            {f"{tip}.segment[0].{field}": 1.0}, relative=True
        )
        for field, (name, deviation) in scatter.items()
    ]
    changed = model.with_change(_with_head, at, material)
    upper = min(length.upper, longest_first_section(model.parts(tip)))
    return changed.plus(length.move(moved_step(changed, tip, at), upper=upper), *grade)


def _with_head(model: Model, at: float, material: MaterialClass) -> Model:
    """Return the model with a first section of another material up to a place."""
    fields = ("youngs_modulus", "density", "poisson_ratio")
    values = {f"{model.tip}.segment[0].{field}": getattr(material, field) for field in fields}
    return model.split(model.tip, at)[0].rebuild(partial(replace_values, values))


def _make_shank(material: MaterialClass, p: Mapping[str, Parameter], middle: float, model: Model) -> Model:
    """Return the model with a share of the way to another material from a place on, which moves as well."""
    tip = model.tip
    log_modulus, log_density = material.relative_to(stated_material(model))
    divided, index = model.split(tip, middle)
    behind = [f"{tip}.segment[{i}]" for i in range(index, len(divided.parts(tip)[0].segments))]
    moves = {f"{section}.youngs_modulus": log_modulus for section in behind}
    moves |= {f"{section}.density": log_density for section in behind}
    room = 0.9 * min(part.segments[i].length for part in divided.parts(tip) for i in (index - 1, index))
    begin = p["begin"].move(moved_step(divided, tip, middle), lower=-room, upper=room)
    return divided.plus(p["share"].move(moves, relative=True), begin)


def _taper(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant(f"of {model.tip}", partial(_make_conical, p["log_diameter"]))


def _make_conical(diameter: Parameter, model: Model) -> Model:
    tip = model.tip
    if any(len(part.segments) != 1 for part in model.parts(tip)):
        raise UndecidableError("the tool has steps")
    for i in range(PIECES - 1):
        model, _ = model.split(tip, partial(_share, (i + 1) / PIECES))
    # The change of the diameter decreases from the tip to zero at the holder.
    weights: dict[str, float] = {}
    for i in range(PIECES):
        diameters = of_thickness(model, f"{tip}.segment[{i}]")
        # A cylinder has the change in its middle, a piece of a cone those at its ends.
        shares = [(i + 0.5) / PIECES] if len(diameters) == 1 else [i / PIECES, (i + 1) / PIECES]
        weights |= {address: 1.0 - share for address, share in zip(diameters, shares, strict=True)}
    return move(diameter, weights, Scope(), model)


def _share(share: float, part: Part) -> float:
    return share * part.length


def _soft_section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    for name, position in _places(model):
        if position:
            edges = (0.0, position, position + SHORT_SECTION, math.inf)
            change = partial(_change_piece, name, edges, edges[1:3], "outer_diameter", p["log_diameter"])
            yield Variant(_at((name, position)), change)


def _other_tool(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a tool that is another one, or has another overhang, in some records."""
    overhangs = overhangs_of(model)
    fields = {"log_density": f"{model.tip}.segment[*].density", "log_modulus": f"{model.tip}.segment[*].youngs_modulus"}
    for scope in _of_some_records(model):
        for name, address in fields.items():
            if not model.has(address):
                change = partial(move, p[name], {address: 1.0}, scope)
                yield Variant(f"of another {name.removeprefix('log_')} in the {scope.name}", change)
        if len(overhangs) == 1 and not any(map(model.has, overhangs)):
            change = partial(move, p["length"], dict.fromkeys(overhangs, 1.0), scope, relative=False)
            yield Variant(f"of another overhang in the {scope.name}", change)


def _of_some_records(model: Model) -> list[Scope]:
    """Return the scopes of an error that some configurations or records have."""
    if not (scopes := scopes_of(model, kinds=("configuration", "record"))):
        raise UndecidableError("there are no FRFs, or a single one: measure several")
    return scopes


def _other_joint(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a joint that is another one in some records: another clamping, or another session."""
    require_joint(model)
    for scope in _of_some_records(model):
        for what, terms in _JOINT_TERMS.items():
            yield Variant(f"of other {what} in the {scope.name}", partial(_change_joint, p, terms, scope))


_JOINT_TERMS = {"stiffnesses": ("k_y", "k_theta"), "stiffnesses and dampings": ("k_y", "k_theta", "c_y", "c_theta")}


def _change_joint(p: Mapping[str, Parameter], terms: Iterable[str], scope: Scope, model: Model) -> Model:
    for term in terms:
        moves = dict.fromkeys(filter(model.has, model.joint_addresses(term)), 1.0)
        if moves:
            model = move(p[f"log_{term}"], moves, scope, model)
    return model


def _resonator(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield from resonances(p, model, place=lambda other: (other.tip, 0.0), where=f"on the tip of {model.tip}")


def _amplifier(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield slow changes of level and phase over the frequency, of all records."""
    require_receptances(model)
    for name, addresses, meaning in _SLOW_CHANGES:
        change = partial(add, {address: p[parameter] for address, parameter in addresses.items()}, Scope())
        yield Variant(name, change, meaning=meaning)


_SLOW_CHANGES = (
    ("with a power of the frequency", {LEVEL_EXPONENT: "exponent"}, "a level that changes"),
    ("in proportion to the frequency", {LEVEL_SLOPE: "slope"}, "a level that changes"),
    ("at all frequencies", {PHASE: "phase"}, "a phase that is turned"),
    ("with the frequency", {LEVEL_EXPONENT: "exponent", PHASE: "phase"}, "a level and a phase that change slowly"),
    ("of one channel", {HIGH_PASS: "corner"}, "the AC coupling"),
)


def _low_pass(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_receptances(model)
    yield Variant("of first order in one channel", partial(add, {LOW_PASS: p["time_constant"]}, Scope()))


_CHAIN_REMEDY = (
    "measure a known free mass with both channels: its level and phase over the frequency are those of the chain; look "
    "for filters, AC coupling and amplifiers"
)


def _alternative(
    id: str,
    change: Callable[..., Iterator[Variant]],
    *parameters: Parameter,
    meaning: str,
    anywhere: bool = False,
    group: Group = "structure",
    remedy: str = "inspect the place: a mass, a crack, a dimension, a loose part",
    contains: tuple[str, ...] = (),
) -> Cause:
    return Cause(
        id=id,
        group=group,
        parameters=parameters,
        change=change,
        meaning=meaning,
        remedy=remedy,
        anywhere=anywhere,
        contains=contains,
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
    _alternative(
        "mass_near_tip",
        _mass_near_tip,
        Parameter(name="mass", unit="kg", lower=0.0, upper=2.0, typical=0.005),
        Parameter(name="distance", unit="m", lower=-0.5, upper=0.5, typical=0.0, secondary=True),
        meaning="a mass",
        contains=("sensor_mass",),
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
        "other_joint",
        _other_joint,
        *(
            Parameter(name=f"log_{term}", unit="", lower=-3.0, upper=3.0, typical=0.1)
            for term in ("k_y", "k_theta", "c_y", "c_theta")
        ),
        meaning="a joint",
        remedy="clamp that tool again with the same torque and measure it again",
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
        "low_pass",
        _low_pass,
        Parameter(name="time_constant", unit="s", lower=-1e-3, upper=1e-3, typical=3e-6),
        meaning="a low pass",
        group="measurement",
        remedy=_CHAIN_REMEDY,
        # Far below its corner it is a delay.
        contains=("time_delay",),
    ),
    _alternative(
        "slow_change",
        _amplifier,
        Parameter(name="exponent", unit="", lower=-1.0, upper=1.0, typical=0.01),
        Parameter(name="slope", unit="s", lower=-1e-4, upper=1e-4, typical=1e-6),
        Parameter(name="phase", unit="rad", lower=-3.2, upper=3.2, typical=0.01),
        Parameter(name="corner", unit="rad/s", lower=-3e3, upper=3e3, typical=30.0),
        meaning="a slow change of level or phase",
        group="measurement",
        remedy=_CHAIN_REMEDY,
    ),
)
"""Changes that are fitted beside the causes and never reported as causes."""
