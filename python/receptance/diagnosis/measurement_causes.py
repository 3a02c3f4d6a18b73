"""Causes in the measurement."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from receptance._text import join_names
from receptance.diagnosis.causes import Cause, Parameter, Variant
from receptance.diagnosis.model import (
    IndescribableError,
    Model,
    UndecidableError,
    require_beams,
    require_no_table,
    with_points,
)
from receptance.diagnosis.thresholds import (
    HIT_BOUND,
    HIT_STEP,
    LARGE_SIZE,
    SAME_PLACE,
    SCANNED_ENDS,
    SENSOR_SHARE,
    SUSPENSION_PLACES,
)
from receptance.fit.observation import Observation, altered
from receptance.fit.parameters import DECAY_RATES, DELAY, END, FREQUENCY_OFFSETS, LOG_GAIN
from receptance.model.addresses import QUANTITIES
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring, PointMass
from receptance.report.table import amount
from receptance.units import FORMS

_NOT_COMPLEX = "which has no values at the complex frequencies of a window: describe that part by modes"
_TIMES = {1: "once", 2: "twice"}
_EARLIEST, _LATEST = 0.8, 1.1
"""Bounds of the end of truncated records, as multiples of the end that the lines show."""
_RECORDED = ("displacements", "velocities", "accelerations")
"""Quantities of a record in the order of time derivatives."""
_POWERS = {
    **dict.fromkeys(("", "m", "rad"), (0.0, 0.0)),
    **dict.fromkeys(("kg", "kg m^2", "kg/m^3"), (1.0, 0.0)),
    **dict.fromkeys(("Pa", "N/m", "N m/rad", "N/rad"), (1.0, -2.0)),
    **dict.fromkeys(("N s/m", "N m s/rad", "N s/rad"), (1.0, -1.0)),
    **dict.fromkeys(("1/kg**0.5", "rad/(m*kg**0.5)"), (-0.5, 0.0)),
    **dict.fromkeys(("m/N", "rad/(N m)", "m/(N m)"), (-1.0, 2.0)),
    "Hz": (0.0, -1.0),
}
"""Powers of mass and time in the units of parameters."""


def _require_receptances(model: Model) -> None:
    if not model.receptances:
        raise UndecidableError("natural frequencies alone do not show it; measure FRFs")


def _each(model: Model) -> tuple[str | None, ...]:
    """Return None for all configurations together, then each one that has FRFs: only these have a measuring chain."""
    pairs = zip(model.configuration_of, model.observations, strict=True)
    names = dict.fromkeys(name for name, observation in pairs if observation.is_receptance)
    return (None, *names) if len(names) > 1 else (None,)


def _sensor(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    sizes = [size for observation in model.observations for size in _masses_at_response(observation).values()]
    stated = join_names(sorted({amount(size, "kg") for size in sizes}))
    more = (
        f"the mass at the sensor exceeds the stated {stated} by this size; below zero the stated one is too large by it"
    )
    weigh = f"correct the stated {stated}: weigh the sensor with its adapter, wax and cable; a laser has no mass"
    for name in _each(model):
        yield Variant(
            name or "all",
            partial(_add_sensor, p["mass"], name),
            meaning=more if stated else "",
            remedy=weigh if stated else "",
        )


def _add_sensor(mass: Parameter, configuration: str | None, model: Model) -> Model:
    """Return the model with the mass of a sensor in one configuration or in all; a stated mass may be too large."""
    # A large structure carries a large sensor.
    tools = {anatomy.tool for anatomy in model.anatomies}
    heaviest = max(sum(model.parts(name)[0].mass for name in tool) for tool in tools)
    largest = max(SENSOR_SHARE * heaviest, mass.plausible[1])
    mass = replace(mass, plausible=(0.0, largest), upper=max(mass.upper, LARGE_SIZE * largest))
    pairs = list(zip(model.configuration_of, model.observations, strict=True))
    masses = [_masses_at_response(observation) for name, observation in pairs if configuration in (None, name)]
    changed = model.with_change(_with_sensors)
    if not any(masses):
        return changed.plus(mass.unknown("cause_sensor.mass", configurations=configuration))
    # Where a mass is stated it is the one that changes, so that it ends at zero.
    addresses = {f"{name}.mass": 1.0 for stated in masses for name in stated}
    if any(map(model.has, addresses)):
        raise UndecidableError("the mass of the sensor is an unknown of the model already")
    if all(masses):
        least = min(max(stated.values()) for stated in masses)
        mass = replace(mass, lower=-least, plausible=(-least, largest))
    else:
        addresses["cause_sensor.mass"] = 1.0
    return changed.plus(mass.move(addresses, configurations=configuration))


def _with_sensors(model: Model) -> Model:
    return model.map(_with_sensor).with_shared_assemblies()


def _with_sensor(observation: Observation) -> Observation:
    if _masses_at_response(observation):
        return observation
    place = observation.response if observation.is_receptance else Coordinate()
    point = PointMass(mass=0.0, part=place.part, position=place.position, name="cause_sensor")
    return altered(observation, assembly=with_points(observation.assembly, point))


def _masses_at_response(observation: Observation) -> dict[str, float]:
    """Return the largest of the masses in kg that the model has where the sensor is, by its name."""
    place = observation.response if observation.is_receptance else Coordinate()
    first = next(iter(observation.assembly.elements))
    masses = {
        name: point.mass
        for name, point in observation.assembly.attachments.items()
        if isinstance(point, PointMass)
        and point.mass > 0.0
        and (point.part or first, point.position) == (place.part or first, place.position)
    }
    return dict(sorted(masses.items(), key=lambda pair: -pair[1])[:1])


def _offset(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    places = dict.fromkeys(map(_place_of_hit, model.witnesses or model.observations))
    hits = [(part, float(position)) for part, position in filter(None, places) if position != "end"]
    if not hits:
        raise UndecidableError("the model cannot move a hit at the far end of a part")
    for place in hits:
        part, position = place
        name = f"on {part} at {1e3 * position:g} mm"
        sides = {name: 0.0 if position else HIT_STEP}
        if position and any(abs(other - position) < SAME_PLACE for other in _fixed_places(model, place)):
            sides = {f"{name}, nearer to the tip": -HIT_STEP, f"{name}, farther from the tip": HIT_STEP}
        for side, step in sides.items():
            yield Variant(side, partial(_move_hits, p["distance"], place, step))


def _place_of_hit(observation: Observation) -> tuple[str, float | Literal["end"]] | None:
    """Return the part and the position of a hit across the axis; None for another measurement."""
    if not observation.is_receptance or observation.excitation.direction != "y":
        return None
    return observation.excitation.part or next(iter(observation.assembly.elements)), observation.excitation.position


def _fixed_places(model: Model, place: tuple[str, float]) -> list[float]:
    """Return the places on a part, in m, that keep their place when the hits at one place move."""
    others = model.map(partial(_without_hit, place))
    return sorted({0.0, *others.places(place[0]), *model.steps(place[0])})


def _without_hit(place: tuple[str, float], observation: Observation) -> Observation:
    return altered(observation, excitation=observation.response) if _place_of_hit(observation) == place else observation


def _move_hits(distance: Parameter, place: tuple[str, float], side: float, model: Model) -> Model:
    """Return the model with the hits at one place moved along the part; everything else keeps its place.

    The hits are placed on a step between two segments of one section, which the parameter moves. The step may not pass
    a step of the part, nor another coordinate or attachment; where one of these is at the place of the hits, the step
    is beside it, on either side.
    """
    part, at = place[0], place[1] + side
    fixed = _fixed_places(model, place)
    below = max((x for x in fixed if x < at - HIT_BOUND), default=0.0)
    above = min((x for x in fixed if x > at + HIT_BOUND), default=math.inf)
    lower = 0.0 if side > 0.0 else max(distance.lower, below - at + HIT_STEP)
    upper = 0.0 if side < 0.0 else min(distance.upper, above - at - HIT_STEP)
    if lower >= upper:
        raise IndescribableError(f"the hits on {part} at {1e3 * place[1]:g} mm have no room to be moved")
    divided, index = model.split(part, at)
    lengths = {f"{part}.segment[{index - 1}].length": 1.0, f"{part}.segment[{index}].length": -1.0}
    return divided.map(partial(_hit_at, place, at)).plus(distance.move(lengths, lower=lower, upper=upper))


def _hit_at(place: tuple[str, float], at: float, observation: Observation) -> Observation:
    if _place_of_hit(observation) != place:
        return observation
    return altered(observation, excitation=replace(observation.excitation, part=place[0], position=at))


def _chain(address: str, p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a parameter of the measuring chain for all configurations, and for each one."""
    _require_receptances(model)
    (parameter,) = p.values()
    for name in _each(model):
        yield Variant(name or "all", partial(_add_unknown, parameter, address, name))


def _add_unknown(parameter: Parameter, address: str, configuration: str | None, model: Model) -> Model:
    return model.plus(parameter.unknown(address, configurations=configuration))


def _scale(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield the true frequencies as a multiple 1 + s of the stated ones, for each recorded quantity.

    A wrong clock is another unit of time: with the moduli and stiffnesses divided by (1 + s)^2 and the viscous damping
    by 1 + s, the model has the true accelerance of f (1 + s) at the stated f. The receptance that follows from it with
    the stated frequencies is too large by (1 + s)^2; where velocities or displacements were recorded, by 1 + s, or not
    at all. This difference is another unit of mass.
    """
    require_no_table(model, "whose frequencies may have the same error")
    if not model.receptances:
        yield Variant("in natural frequencies", partial(_scale_time, p["log_scale"], 2.0))
        return
    for number, recorded in enumerate(_RECORDED):
        yield Variant(f"in {recorded}", partial(_scale_time, p["log_scale"], 2.0 - number))
    for recorded, address in zip(_RECORDED[::-1], FREQUENCY_OFFSETS, strict=True):
        yield Variant(
            f"a constant, in {recorded}",
            partial(_shift_lines, p["offset"], address),
            meaning="the frequency axis is off by a constant, half a line for example",
            remedy="compare the first lines of the file with those of the analyser, and its spacing with 1 / duration",
        )


def _shift_lines(offset: Parameter, address: str, model: Model) -> Model:
    if any(record.force is not None or record.ends is not None for record in model.receptances):
        raise UndecidableError("the lines of a stepped sine, and of a record that ends too early, have no offset")
    return _add_unknown(offset, address, None, model)


def _scale_time(scale: Parameter, mass: float, model: Model) -> Model:
    """Return the model in another unit of time, with a unit of mass that changes by a power of it."""
    addresses = dict.fromkeys(
        re.sub(r"segment\[\d+\]", "segment[*]", address)
        for observation in model.observations
        for address in observation.assembly.parameters
    )
    powers = {address: _POWERS[QUANTITIES[address.rpartition(".")[2]].unit] for address in addresses}
    moves = {address: of_time + mass * of_mass for address, (of_mass, of_time) in powers.items()}
    return model.plus(scale.move({address: n for address, n in moves.items() if n}, relative=True))


def _window(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    require_no_table(model, f"{_NOT_COMPLEX}, or repeat one measurement without a window")
    rate, meaning = p["decay_rate"], ""
    # A window that was not applied, or has another rate, is stated in the lines.
    stated = min(-2.0 * math.pi * float(record.frequency_hz[0].imag) for record in model.receptances)
    if stated > 0.0:
        rate = replace(rate, lower=-stated, plausible=(-stated, rate.plausible[1]))
        meaning = (
            f"the rate of the exponential window exceeds the stated {amount(stated, '1/s')} by this size; below zero "
            "the stated one is too large by it"
        )
    recorded = _RECORDED[::-1]
    for name, address in zip(recorded, DECAY_RATES, strict=True):
        yield Variant(f"on {name}", partial(_add_unknown, rate, address, None), meaning=meaning)
    # For a single configuration the kind of the record makes little difference.
    for place in _each(model)[1:]:
        change = partial(_add_unknown, rate, next(iter(DECAY_RATES)), place)
        yield Variant(f"on {recorded[0]}, {place}", change, meaning=meaning)


def _suspension(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    what = "holder" if model.joints else "structure"
    for share in SUSPENSION_PLACES:
        name = f"at {100 * share:.0f} % of the {what}"
        yield Variant(name, partial(_hang, share, p["stiffness"]))
        # Without the damping of a rope another cause would explain its loss.
        yield Variant(f"{name}, with a loss", partial(_hang, share, p["stiffness"], damping=p["damping"]))


def _hanging(model: Model) -> dict[str, float]:
    """Return the parts that hang, of the holder or of a structure without a joint, and their lengths in m."""
    if model.in_spindle:
        raise UndecidableError("the holder is in a spindle, so that nothing hangs")
    require_beams(model)
    hanging = {anatomy.holder or anatomy.tool for anatomy in model.anatomies}
    if len(hanging) != 1:
        raise UndecidableError("the model has several holders")
    return {name: model.parts(name)[0].length for name in hanging.pop()}


def _hang(share: float, stiffness: Parameter, model: Model, damping: Parameter | None = None) -> Model:
    """Return the model on a rope at a share of the length of the parts that hang."""
    part, position = _at(_hanging(model), share)
    spring = GroundSpring(part=part, position=position, name="cause_rope")
    hung = model.with_change(Model.attach, spring).plus(stiffness.unknown("cause_rope.k_y"))
    return hung if damping is None else hung.plus(damping.unknown("cause_rope.c_y"))


def _at(lengths: Mapping[str, float], share: float) -> tuple[str, float | Literal["end"]]:
    """Return the part and the place in it at a share of the length of all parts."""
    position = share * sum(lengths.values())
    for part, length in lengths.items():
        if position < length * (1.0 - 1e-9):
            return part, position
        position -= length
    return part, "end"


def _quantity(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    stated = dict.fromkeys(observation.form for observation in model.receptances)
    for order in (1, 2, -1, -2):
        actual = [_quantity_of(FORMS.index(form) + order) for form in stated]
        how = "differentiated" if order > 0 else "integrated"
        form = (
            f'in Python `frf.with_(form="{actual[0]}")` before the FRF is used, '
            if len(actual) == 1 and actual[0] in FORMS
            else ""
        )
        yield Variant(
            f"{how} {_TIMES[abs(order)]} more than stated",
            partial(Model.map_receptances, change=partial(_integrate, order)),
            meaning=f"the files say {' and '.join(stated)}, and the data are {' and '.join(actual)}",
            remedy=f"{form}in a campaign the line `integrate = {order}` in the tables of these measurements (a number "
            "that is there already is added to it)",
        )


def _integrate(order: int, record: Observation) -> Observation:
    return altered(record, receptance=record.receptance / (2j * np.pi * record.frequency_hz) ** order)


def _polarity(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    yield Variant("all", partial(Model.map_receptances, change=_reverse))
    records = [observation for observation in model.witnesses or model.observations if observation.is_receptance]
    places = dict.fromkeys(map(_sensor_place, records))
    for place in places if len(places) > 1 else ():
        part, position = place
        name = f"sensor on {part} at " + (position if isinstance(position, str) else f"{1e3 * position:g} mm")
        yield Variant(
            name,
            partial(Model.map_receptances, change=partial(_reverse_at, place)),
            meaning=f"the {name} points the other way: its FRFs have the wrong sign, those of other places have not",
        )


def _reverse(record: Observation) -> Observation:
    return altered(record, receptance=-record.receptance)


def _reverse_at(place: tuple[str, float | Literal["end"]], record: Observation) -> Observation:
    return _reverse(record) if _sensor_place(record) == place else record


def _sensor_place(observation: Observation) -> tuple[str, float | Literal["end"]]:
    response = observation.response
    return response.part or next(iter(observation.assembly.elements)), response.position


def _quantity_of(order: int) -> str:
    """Return the name of an FRF whose motion is a displacement differentiated `order` times."""
    if 0 <= order < len(FORMS):
        return FORMS[order]
    if order < 0:
        return f"{FORMS[0]} whose displacement is integrated {_TIMES[-order]}"
    return f"{FORMS[-1]} whose acceleration is differentiated {_TIMES[order - len(FORMS) + 1]}"


def _truncation(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    require_no_table(model, f"{_NOT_COMPLEX}, or record until the structure is at rest")
    end = _end_of_records(model)
    low, high = _EARLIEST * end, _LATEST * end
    # Chi-square has a minimum in each period of the highest frequency, and the lines show the end less accurately.
    highest = max(float(observation.frequency_hz.real.max()) for observation in model.receptances)
    ends = np.linspace(low, high, min(2 + int(2.0 * highest * (high - low)), SCANNED_ENDS))
    yield Variant("records end too early", partial(_truncate, p["end"]), scan={p["end"].key: ends.tolist()})


def _end_of_records(model: Model) -> float:
    if model.truncation is None:
        raise UndecidableError("no record breaks off while the structure still rings: the lines are close enough")
    return model.truncation


def _truncate(parameter: Parameter, model: Model) -> Model:
    end = _end_of_records(model)
    unknown = replace(parameter, typical=end).unknown(END, lower=_EARLIEST * end, upper=_LATEST * end)
    return model.map_receptances(partial(_end_at, end)).plus(unknown)


def _end_at(time: float, record: Observation) -> Observation:
    # A stepped sine has no end.
    return record if record.force is not None else altered(record, ends=time)


MEASUREMENT_CAUSES = (
    Cause(
        id="sensor_mass",
        title="mass of the sensor",
        group="measurement",
        parameters=(Parameter(name="mass", unit="kg", lower=0.0, upper=0.2, typical=1e-3, plausible=(0.0, 0.03)),),
        change=_sensor,
        meaning="the sensor's mass is on the structure and not in the model",
        remedy="state the sensor in the campaign, or measure with a laser or a second sensor of known mass",
    ),
    Cause(
        id="hammer_offset",
        title="offset of the hits",
        group="measurement",
        parameters=(
            Parameter(name="distance", unit="m", lower=-0.02, upper=0.02, typical=2e-3, plausible=(-0.012, 0.012)),
        ),
        change=_offset,
        meaning="the hammer hit beside the stated place",
        remedy="mark the place, and hit at stated offsets once to see their effect",
    ),
    Cause(
        id="time_delay",
        title="delay of a channel",
        group="measurement",
        parameters=(
            Parameter(
                name="delay", unit="s", lower=-1e-3, upper=1e-3, typical=5e-6, plausible=(-5e-4, 5e-4), negligible=1e-7
            ),
        ),
        change=partial(_chain, DELAY),
        meaning="one channel lags behind the other",
        remedy="measure a known free mass with both channels and correct the delay",
    ),
    Cause(
        id="calibration_gain",
        title="calibration gain",
        group="measurement",
        parameters=(Parameter(name="log_gain", unit="", lower=-3.0, upper=3.0, typical=0.03, plausible=(-2.4, 2.4)),),
        change=partial(_chain, LOG_GAIN),
        meaning="the calibration of hammer or sensor is off",
        remedy="calibrate the chain with a known free mass",
    ),
    Cause(
        id="frequency_scale",
        title="scale of the frequencies",
        group="measurement",
        parameters=(
            Parameter(
                name="log_scale",
                unit="",
                lower=-0.06,
                upper=0.06,
                typical=4e-3,
                plausible=(-0.02, 0.02),
            ),
            Parameter(name="offset", unit="Hz", lower=-30.0, upper=30.0, typical=1.0, plausible=(-12.0, 12.0)),
        ),
        change=_scale,
        meaning="the sample clock is off: the true frequencies are a multiple of the stated ones",
        remedy="measure a generator of known frequency with the analyser, or a free bar of known modulus and density",
    ),
    Cause(
        id="exponential_window",
        title="exponential window",
        group="measurement",
        parameters=(
            Parameter(name="decay_rate", unit="1/s", lower=0.0, upper=500.0, typical=10.0, plausible=(0.0, 200.0)),
        ),
        change=_window,
        meaning="an exponential window was applied to the records, and the FRF does not state it",
        remedy="state the window's decay rate, or repeat one measurement without it",
    ),
    Cause(
        id="suspension",
        title="stiff suspension",
        group="measurement",
        parameters=(
            Parameter(name="stiffness", unit="N/m", lower=0.0, upper=1e8, typical=1e4, plausible=(0.0, 1e6)),
            Parameter(name="damping", unit="N s/m", lower=0.0, upper=1e5, typical=1.0, plausible=(0.0, 1e3)),
        ),
        change=_suspension,
        meaning="the suspension is not soft enough to count as free",
        remedy="hang it softer, or put the suspension's stiffness into the model",
    ),
    Cause(
        id="wrong_quantity",
        title="wrong quantity",
        group="measurement",
        parameters=(),
        change=_quantity,
        changes_data=True,
        meaning="the file holds another quantity than the one it was read as",
        remedy="state the quantity of the file (receptance, mobility, accelerance)",
    ),
    Cause(
        id="reversed_polarity",
        title="reversed polarity",
        group="measurement",
        parameters=(),
        change=_polarity,
        changes_data=True,
        meaning="sensor or hammer point the other way: every FRF has the wrong sign",
        remedy="turn the sign of the response: in a campaign its direction, in Python `frf.flipped()`",
    ),
    Cause(
        id="coarse_resolution",
        title="truncated records",
        group="measurement",
        parameters=(Parameter(name="end", unit="s", lower=1e-4, upper=1e3, typical=0.1, secondary=True),),
        change=_truncation,
        meaning="the records end while the structure still rings: the lines are farther apart than resonances are wide",
        remedy="record longer, or state an exponential window that the response dies away in",
    ),
)
