"""Causes beyond the holder: its supports, modes that the model does not have, and the spindle."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from receptance.diagnosis.causes import Cause, CauseUnknown, Parameter, Variant
from receptance.diagnosis.changes import attach, with_places
from receptance.diagnosis.model import (
    SPRING_TERMS,
    Model,
    UndecidableError,
    far_end,
    named,
    require_beams,
    require_no_table,
)
from receptance.diagnosis.thresholds import PIECES, RESONANCE_STEP
from receptance.fit.unknowns import Move, Prior, Unknown
from receptance.model.assembly import Assembly
from receptance.model.joints import GroundSpring, Resonator
from receptance.model.terminals import ModalPart

_STIFFNESSES = ("k_y", "k_theta", "k_ytheta")
_MODE_SHAPE = ("y", "theta", "y_imaginary", "theta_imaginary")
_OTHER_MODE = {
    "log_frequency": (("frequency_hz",), 0.05),
    "log_damping": (("damping_ratio",), 0.5),
    "log_shape": (_MODE_SHAPE, 0.3),
    "log_slope": (("theta", "theta_imaginary"), 0.3),
}
"""Numbers of a mode that each parameter moves where all modes are unknowns, and the standard deviation of the move: the
records of one configuration do not determine every mode."""


Place = Callable[[Model], tuple[str, float | Literal["end"]]]
"""Returns a part of a model and a position on it; raises `UndecidableError` where the model does not have it."""


def _end_of_holder(model: Model) -> tuple[str, Literal["end"]]:
    require_beams(model)
    require_no_table(model, "which contains every mode of that part; measure it again")
    if not all(observation.assembly.countable for observation in model.observations):
        raise UndecidableError("the model ends with a spindle that has its modes already; see spindle_mode")
    return far_end(model), "end"


def resonances(p: Mapping[str, Parameter], model: Model, *, place: Place, where: str) -> Iterator[Variant]:
    """Yield resonators at a place, tuned to frequencies over the whole band of the lines.

    Parameters
    ----------
    p : mapping of str to Parameter
        `RESONATOR_PARAMETERS` by name.
    model : Model
        The model without it.
    place : callable
        Place of the resonator.
    where : str
        The place in the name of the variants.
    """
    low, high = _band(model)
    count = 1 + math.ceil(math.log(high / low) / RESONANCE_STEP)
    for frequency in np.geomspace(low, high, max(count, 2)).tolist():
        yield Variant(f"near {frequency:.0f} Hz {where}", partial(_resonate, p, place, frequency))


def _resonate(p: Mapping[str, Parameter], place: Place, frequency: float, model: Model) -> Model:
    """Return the model with a resonator of a frequency in Hz."""
    part, position = place(model)
    low, high = _band(model)
    angular = 2.0 * math.pi * frequency
    # No mode is measured outside the lines: a spring to ground or a mass has the same effect there.
    frequency_factor = replace(p["log_frequency"], plausible=(math.log(low / frequency), math.log(high / frequency)))
    name = f"{p['mass'].cause}_resonator"
    resonator = Resonator(mass=0.0, k_y=1.0, part=part, position=position, name=name)
    return attach(model, [resonator], {}).plus(
        p["mass"].unknown(f"{name}.mass", also={f"{name}.k_y": angular**2, f"{name}.c_y": 0.02 * angular}),
        frequency_factor.move({f"{name}.k_y": 2.0, f"{name}.c_y": 1.0}, relative=True),
        p["log_damping"].move({f"{name}.c_y": 1.0}, relative=True),
    )


def _band(model: Model) -> tuple[float, float]:
    """Return the lowest and the highest line in Hz."""
    low = min(float(observation.frequency_hz[0].real) for observation in model.observations)
    high = max(float(observation.frequency_hz[-1].real) for observation in model.observations)
    return low, high


def _spindle_mode(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    name, spindle = _modal_end(model)
    described = [
        mode.frequency_hz
        for index, mode in enumerate(spindle.modes)
        if (mode.y or mode.theta) and not model.has(f"{name}.mode[{index}].frequency_hz")
    ]
    if not described:
        yield from _other_modes(p, model, name)
        return
    low, high = _band(model)
    for frequency in described:
        if low <= frequency <= high:
            yield Variant(f"mode at {frequency:.0f} Hz", partial(_move_mode, p, frequency))


def _modal_end(model: Model) -> tuple[str, ModalPart]:
    """Return the name and the modes of the spindle, the same in all assemblies that end with one."""
    ends = {
        (name, element)
        for observation in model.observations
        for name, element in observation.assembly.elements.items()
        if isinstance(element, ModalPart)
    }
    if not ends:
        raise UndecidableError("the model does not end with a spindle that is described by its modes")
    if len(ends) > 1:
        raise UndecidableError("the assemblies end with different spindles")
    return ends.pop()


def _move_mode(p: Mapping[str, Parameter], frequency: float, model: Model) -> Model:
    """Return the model in which the mode of a frequency in Hz is another one."""
    name, spindle = _modal_end(model)
    indices = [index for index, mode in enumerate(spindle.modes) if mode.frequency_hz == frequency]
    if not indices:
        raise UndecidableError(f"{name} has no mode at {frequency:.0f} Hz")
    address = f"{name}.mode[{indices[0]}]"
    return model.plus(
        p["log_frequency"].move({f"{address}.frequency_hz": 1.0}, relative=True),
        p["log_damping"].move({f"{address}.damping_ratio": 1.0}, relative=True),
        p["log_shape"].move({f"{address}.{quantity}": 1.0 for quantity in _MODE_SHAPE}, relative=True),
    )


def _other_modes(p: Mapping[str, Parameter], model: Model, name: str) -> Iterator[Variant]:
    """Yield other modes of the spindle `name` in one configuration, where all its modes are unknowns."""
    configurations = model.configurations
    if len(configurations) < 2:
        raise UndecidableError(f"all modes of {name} are unknowns of the model, and there is one configuration")
    # Of two configurations that differ either may be the changed one.
    for configuration in configurations if len(configurations) > 2 else configurations[1:]:
        yield Variant(
            f"all modes, {configuration}",
            partial(_move_all_modes, p, configuration),
            meaning=f"the spindle has other modes in {configuration} than in the other configurations",
            remedy="hit the blank in the warm spindle before and after each tool, with the same preload and drawbar "
            "force; identify the spindle for each configuration where the blank shows the difference",
        )


def _move_all_modes(p: Mapping[str, Parameter], configuration: str, model: Model) -> Model:
    name, _ = _modal_end(model)
    moves = [
        # Beside another cause such moves imitate effects outside the catalogue, whatever their size.
        replace(p[parameter], prior=Prior(mean=0.0, standard_deviation=deviation), ordinary=0.0).move(
            {f"{name}.mode[{index}].{quantity}": 1.0 for quantity in quantities},
            relative=True,
            configurations=configuration,
            part=f"mode[{index}]",
        )
        for _, index in model.unknown_modes
        for parameter, (quantities, deviation) in _OTHER_MODE.items()
    ]
    return model.plus(*moves)


@dataclass(frozen=True)
class _Pieces:
    """The pieces of a divided spring; the first one keeps its name."""

    springs: tuple[GroundSpring, ...]
    shares: tuple[float, ...]
    """Their shares of the whole."""
    places: tuple[float, ...]
    """Normalised positions of their middles."""


_UNEVEN = {
    "more or less at the ends": ("log_ends",),
    "more at one end": ("log_tilt",),
    "more at the ends, and more at one of them": ("log_ends", "log_tilt"),
}
"""Distributions along springs, and their parameters."""
_SHAPES: Mapping[str, Callable[[int, float], float]] = {
    "log_ends": lambda i, x: 2.0 * x * x - 1.0,
    "log_tilt": lambda i, x: x,
}
"""Logarithms of the stiffness of a piece with a number and a place from -1 to 1, for a parameter of one."""


def _contact(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    points, distributed = _springs(model)
    uneven = _UNEVEN if distributed else {}
    for name, parameters in uneven.items():
        yield Variant(name, partial(_distribute, p, parameters, along=False))
    if points:
        yield Variant("not at points", partial(_distribute, p, (), along=True))
        for name, parameters in uneven.items():
            yield Variant(f"not at points, {name}", partial(_distribute, p, parameters, along=True))


def _springs(model: Model) -> tuple[list[GroundSpring], list[GroundSpring]]:
    """Return the identified springs to ground: none or two at points, and those along a stretch.

    They are on one part and at the same places in all assemblies. Springs that a cause has added are none of the model.
    """
    identified: dict[str, GroundSpring] = {}
    stated = replace(model, unknowns=tuple(u for u in model.unknowns if not isinstance(u, CauseUnknown)))
    for observation in model.observations:
        for name, point in observation.assembly.attachments.items():
            if isinstance(point, GroundSpring) and any(stated.has(f"{name}.{field}") for field in _STIFFNESSES):
                spring = replace(point, name=name, part=point.part or next(iter(observation.assembly.elements)))
                first = identified.setdefault(name, spring)
                if any(getattr(spring, f) != getattr(first, f) for f in ("part", "position", "length", "weights")):
                    raise UndecidableError(f"{name} has another place in another assembly")
    if not identified:
        raise UndecidableError("no spring to ground is identified")
    if len({spring.part for spring in identified.values()}) > 1:
        raise UndecidableError("the springs to ground are on several parts")
    points = [spring for spring in identified.values() if spring.length == 0.0]
    distributed = [spring for spring in identified.values() if spring.length > 0.0]
    if len(points) not in (0, 2) or (not distributed and len(points) != 2):
        raise UndecidableError("the stretch along which the springs to ground could act is unknown")
    return points, distributed


def _distribute(p: Mapping[str, Parameter], uneven: Iterable[str], model: Model, *, along: bool) -> Model:
    """Return the model with springs to ground in pieces.

    Springs along a stretch differ from the model by the parameters in `uneven`. If `along`, point springs act between
    their points as well.
    """
    points, distributed = _springs(model)
    laid = [_lay_out(point, points, model) for point in points] if along else []
    stretches = [_divide(spring, distributed) for spring in distributed] if uneven else []
    unknowns: list[Unknown] = []
    if laid:
        # As the springs along the stretch grow the point spring decreases: at both bounds the unknown is the whole.
        unknowns.append(_redistribute(p["log_along"], laid, lambda i, x: 1.0 if i else -1.0))
        unknowns.append(_redistribute(p["fading"], laid, lambda i, x: 0.5 - x if i else 0.0))
    if stretches:
        unknowns += [_redistribute(p[name], stretches, _SHAPES[name]) for name in uneven]
    if not unknowns:
        raise UndecidableError("the springs to ground act elsewhere")
    return _replace_springs(model, [*laid, *stretches]).plus(*unknowns)


def _position(spring: GroundSpring, model: Model) -> float:
    if spring.position != "end":
        return float(spring.position)
    return model.parts(spring.part)[0].length


def _divide(spring: GroundSpring, springs: Iterable[GroundSpring]) -> _Pieces:
    """Return a distributed spring in pieces, each with an equal number of its points.

    Their places are -1 at the start of the first one of all springs, and 1 at the end of the last one.
    """
    count = next((n for n in range(PIECES, 1, -1) if spring.points % n == 0), 0)
    if not count:
        raise UndecidableError(
            f"{spring.name} has {spring.points} points, which cannot be divided into 2 to {PIECES} equal groups"
        )
    each, length, begin = spring.points // count, spring.length / count, float(spring.position)
    weights = [spring.shares[i * each : (i + 1) * each] for i in range(count)]
    if any(sum(weight) == 0.0 for weight in weights):
        raise UndecidableError(f"{spring.name} has a piece without contact")
    pieces = tuple(
        replace(spring, position=begin + i * length, length=length, weights=weight, name=_piece_name(spring, i))
        for i, weight in enumerate(weights)
    )
    first = min(float(other.position) for other in springs)
    whole = max(float(other.position) + other.length for other in springs) - first
    places = tuple(2.0 * (float(piece.position) + 0.5 * piece.length - first) / whole - 1.0 for piece in pieces)
    return _Pieces(pieces, tuple(sum(weight) for weight in weights), places)


def _lay_out(spring: GroundSpring, both: list[GroundSpring], model: Model) -> _Pieces:
    """Return a point spring with further springs that decay towards the other point spring.

    Places are shares of the distance between the two.
    """
    first, last = sorted(_position(point, model) for point in both)
    if first == last:
        raise UndecidableError("the springs to ground act at the same point")
    each = (last - first) / PIECES
    places = tuple((i + 0.5) / PIECES for i in range(PIECES))
    forward = _position(spring, model) == first
    springs = [
        replace(
            spring,
            position=first + i * each if forward else last - (i + 1) * each,
            length=each,
            points=2,
            weights=(),
            name=_piece_name(spring, i + 1),
        )
        for i in range(PIECES)
    ]
    # They decay to a tenth from one end to the other; at the null of the cause all are a thousandth of the spring.
    weights = [math.exp(-2.3 * x) for x in places]
    shares = (1.0, *(1e-3 * weight / sum(weights) for weight in weights))
    return _Pieces((spring, *springs), shares, (0.0, *places))


def _piece_name(spring: GroundSpring, number: int) -> str:
    return spring.name if number == 0 else f"cause_{spring.name}_{number}"


def _replace_springs(model: Model, pieces: Iterable[_Pieces]) -> Model:
    """Return the model with springs in pieces, and unknowns that still mean the whole spring."""
    by_name = {piece.springs[0].name: piece for piece in pieces}

    def follow(address: str) -> dict[str, float]:
        """Return a parameter of a spring as those of its pieces."""
        name, _, field = address.partition(".")
        if name not in by_name:
            return {address: 1.0}
        pairs = zip(by_name[name].springs, by_name[name].shares, strict=True)
        return {f"{spring.name}.{field}": share if field in SPRING_TERMS else 1.0 for spring, share in pairs}

    return with_places(model.rebuild(partial(_divide_in, by_name)), follow)


def _divide_in(by_name: Mapping[str, _Pieces], assembly: Assembly) -> Assembly:
    points = []
    for name, point in named(assembly.attachments).items():
        if name not in by_name or not isinstance(point, GroundSpring):
            points.append(point)
            continue
        for spring, share in zip(by_name[name].springs, by_name[name].shares, strict=True):
            values = {field: share * getattr(point, field) for field in SPRING_TERMS}
            points.append(replace(spring, **values, loss_factor=point.loss_factor))
    return Assembly(named(assembly.elements).values(), points, motion=assembly.motion)


def _redistribute(parameter: Parameter, pieces: list[_Pieces], shape: Callable[[int, float], float]) -> Move:
    """Return the parameter as a change of springs, of which the logarithm is a function of number and place."""
    moves = {
        f"{spring.name}.{field}": weight
        for piece in pieces
        for i, (spring, x) in enumerate(zip(piece.springs, piece.places, strict=True))
        for field in SPRING_TERMS
        if (weight := shape(i, x))
    }
    return parameter.move(moves, relative=True)


RESONATOR_PARAMETERS = (
    Parameter(name="mass", unit="kg", lower=1e-6, upper=20.0, typical=0.02, null=1e-6),
    Parameter(name="log_frequency", unit="", lower=-0.7, upper=0.7, typical=0.0, secondary=True),
    Parameter(name="log_damping", unit="", lower=-4.0, upper=3.0, typical=0.0, secondary=True),
)
"""Parameters of a mass on a spring."""

BOUNDARY_CAUSES = (
    Cause(
        id="missing_mode",
        parameters=RESONATOR_PARAMETERS,
        change=partial(resonances, place=_end_of_holder, where="at the holder's far end"),
        meaning="spindle or fixture has a mode that the model does not have",
        remedy="measure the spindle or the fixture alone at that frequency",
        remedy_in_spindle="hit a gauge blank in the warm spindle: a mode of spindle or machine is there as well",
        unspecific=True,
    ),
    Cause(
        id="contact_distribution",
        title="distribution of the contact",
        parameters=(
            Parameter(name="log_ends", unit="", lower=-3.0, upper=3.0, typical=0.5, plausible=(-2.0, 2.0)),
            Parameter(name="log_tilt", unit="", lower=-3.0, upper=3.0, typical=0.5, plausible=(-2.0, 2.0)),
            Parameter(name="log_along", unit="", lower=0.0, upper=9.0, typical=2.3),
            Parameter(name="fading", unit="", lower=-5.0, upper=8.0, typical=0.0, secondary=True),
        ),
        change=_contact,
        meaning="a part is held elsewhere along its contact than modelled: more at an end, or not at points",
        remedy="blue the taper and spread the springs as it bears; mode shapes along the contact confirm it",
    ),
    Cause(
        id="spindle_mode",
        title="mode of the spindle",
        parameters=(
            Parameter(name="log_frequency", unit="", lower=-0.2, upper=0.2, typical=0.02, plausible=(-0.15, 0.15)),
            Parameter(name="log_damping", unit="", lower=-2.0, upper=2.0, typical=0.2, plausible=(-1.5, 1.5)),
            Parameter(name="log_shape", unit="", lower=-1.0, upper=1.0, typical=0.05, plausible=(-0.7, 0.7)),
            Parameter(name="log_slope", unit="", lower=-1.0, upper=1.0, typical=0.05, plausible=(-0.7, 0.7)),
        ),
        change=_spindle_mode,
        meaning="a mode of the spindle has another frequency, shape or damping than identified",
        remedy="hit the blank again in the warm spindle and identify the spindle again, with the preload and at the "
        "temperature at which the tool was measured",
    ),
)
