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
from receptance.diagnosis.model import Model, UndecidableError, require_beams, require_no_table, with_points
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
from receptance.fit.parameters import DECAY_RATES, DELAY, END, LOG_GAIN
from receptance.model.addresses import QUANTITIES
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring, PointMass
from receptance.report.table import amount
from receptance.units import FORMS

_NOT_COMPLEX = "which has no values at the complex frequencies of a window: describe that part by modes"
_TIMES = {1: "once", 2: "twice"}
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
    def change(observation: Observation) -> Observation:
        place = observation.response if observation.is_receptance else Coordinate()
        point = PointMass(mass=0.0, part=place.part, position=place.position, name="cause_sensor")
        return altered(observation, assembly=with_points(observation.assembly, point))

    # A large structure carries a large sensor.
    heaviest = max(
        sum(part.mass for name in anatomy.tool for part in model.parts(name)[:1]) for anatomy in model.anatomies
    )
    declared = p["mass"]
    largest = max(SENSOR_SHARE * heaviest, declared.plausible[1])
    mass = replace(declared, plausible=(0.0, largest), upper=max(declared.upper, LARGE_SIZE * largest))
    changed = model.map(change).with_shared_assemblies()
    stated = join_names(sorted({amount(size, "kg") for one in model.observations if (size := _mass_at_response(one))}))
    for name in _each(model):
        yield Variant(
            name or "all",
            changed.plus(mass.unknown("cause_sensor.mass", configurations=name)),
            meaning=f"the mass at the sensor exceeds the stated {stated} by this size" if stated else "",
            remedy=f"correct the stated {stated}: weigh the sensor with its adapter, wax and cable" if stated else "",
        )


def _mass_at_response(observation: Observation) -> float:
    """Return the mass in kg that the model has where the sensor is."""
    place = observation.response if observation.is_receptance else Coordinate()
    points = [point for point in observation.assembly.attachments.values() if isinstance(point, PointMass)]
    return sum(point.mass for point in points if (point.part, point.position) == (place.part, place.position))


def _offset(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    places = dict.fromkeys(
        (observation.excitation.part or next(iter(observation.assembly.elements)), observation.excitation.position)
        for observation in model.witnesses or model.observations
        if observation.is_receptance and observation.excitation.direction == "y"
    )
    found = 0
    for part, position in places:
        if position != "end":
            for variant in _hits_at(p, model, part, float(position)):
                found += 1
                yield variant
    if not found:
        raise UndecidableError("the model cannot move a hit at the far end of a part")


def _hits_at(p: Mapping[str, Parameter], model: Model, part: str, position: float) -> Iterator[Variant]:
    """Yield the hits at one place moved along the part; everything else keeps its place.

    The hits are placed on a step between two segments of one section, which the parameter moves. The step may not pass
    a step of the part, nor another coordinate or attachment; where one of these is at the place of the hits, the step
    is beside it, on either side.
    """

    def hit(observation: Observation) -> bool:
        if not observation.is_receptance or observation.excitation.direction != "y":
            return False
        return (
            observation.excitation.part or next(iter(observation.assembly.elements)),
            observation.excitation.position,
        ) == (part, position)

    others = model.map(lambda one: altered(one, excitation=one.response) if hit(one) else one)
    fixed = sorted({0.0, *others.places(part), *model.steps(part)})
    beside = (-HIT_STEP, HIT_STEP) if any(abs(x - position) < SAME_PLACE for x in fixed) else (0.0,)
    for side in beside if position else (HIT_STEP,):
        at = position + side
        try:
            divided, index = model.split(part, at)
        except ValueError:
            continue  # the place is not in the same segment of all assemblies

        def change(observation: Observation, at: float = at) -> Observation:
            return (
                altered(observation, excitation=replace(observation.excitation, part=part, position=at))
                if hit(observation)
                else observation
            )

        below = max((x for x in fixed if x < at - HIT_BOUND), default=0.0)
        above = min((x for x in fixed if x > at + HIT_BOUND), default=math.inf)
        lower = 0.0 if side > 0.0 else max(p["distance"].lower, below - at + HIT_STEP)
        upper = 0.0 if side < 0.0 else min(p["distance"].upper, above - at - HIT_STEP)
        if lower >= upper:
            continue
        lengths = {f"{part}.segment[{index - 1}].length": 1.0, f"{part}.segment[{index}].length": -1.0}
        offset = p["distance"].move(lengths, lower=lower, upper=upper)
        name = f"on {part} at {1e3 * position:g} mm"
        if side and position:
            name += ", farther from the tip" if side > 0.0 else ", nearer to the tip"
        yield Variant(name, divided.map(change).plus(offset), local=True)


def _chain(address: str, p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a parameter of the measuring chain for all configurations, and for each one."""
    _require_receptances(model)
    (parameter,) = p.values()
    for name in _each(model):
        yield Variant(name or "all", model.plus(parameter.unknown(address, configurations=name)))


def _scale(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield the true frequencies as a multiple 1 + s of the stated ones, for each recorded quantity.

    A wrong clock is another unit of time: with the moduli and stiffnesses divided by (1 + s)^2 and the viscous damping
    by 1 + s, the model has the true accelerance of f (1 + s) at the stated f. The receptance that follows from it with
    the stated frequencies is too large by (1 + s)^2; where velocities or displacements were recorded, by 1 + s, or not
    at all. This difference is another unit of mass.
    """
    require_no_table(model, "whose frequencies may have the same error")
    addresses = dict.fromkeys(
        re.sub(r"segment\[\d+\]", "segment[*]", address)
        for observation in model.observations
        for address in observation.assembly.parameters
    )
    powers = {address: _POWERS[QUANTITIES[address.rpartition(".")[2]].unit] for address in addresses}
    frfs = bool(model.receptances)
    for number, recorded in enumerate(_RECORDED if frfs else _RECORDED[:1]):
        moves = {address: time + (2.0 - number) * mass for address, (mass, time) in powers.items()}
        scale = p["log_scale"].move({address: n for address, n in moves.items() if n}, relative=True)
        yield Variant(f"in {recorded}" if frfs else "in natural frequencies", model.plus(scale))


def _window(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    require_no_table(model, f"{_NOT_COMPLEX}, or repeat one measurement without a window")
    recorded = _RECORDED[::-1]
    for name, address in zip(recorded, DECAY_RATES, strict=True):
        yield Variant(f"on {name}", model.plus(p["decay_rate"].unknown(address)))
    # For a single configuration the kind of the record makes little difference.
    for place in _each(model)[1:]:
        unknown = p["decay_rate"].unknown(next(iter(DECAY_RATES)), configurations=place)
        yield Variant(f"on {recorded[0]}, {place}", model.plus(unknown))


def _suspension(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    if model.in_spindle:
        raise UndecidableError("the holder is in a spindle, so that nothing hangs")
    require_beams(model)
    # A structure without a joint hangs as a whole.
    hanging = {anatomy.holder or anatomy.tool for anatomy in model.anatomies}
    if len(hanging) != 1:
        raise UndecidableError("the model has several holders")
    lengths = {name: model.parts(name)[0].length for name in hanging.pop()}
    what = "holder" if model.joints else "structure"
    for share in SUSPENSION_PLACES:
        part, position = _at(lengths, share)
        spring = GroundSpring(part=part, position=position, name="cause_rope")
        name = f"at {100 * share:.0f} % of the {what}"
        hung = model.attach(spring).plus(p["stiffness"].unknown("cause_rope.k_y"))
        yield Variant(name, hung)
        # Without the damping of a rope another cause would explain its loss.
        yield Variant(f"{name}, with a loss", hung.plus(p["damping"].unknown("cause_rope.c_y")))


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

        def change(observation: Observation, order: int = order) -> Observation:
            return altered(
                observation, receptance=observation.receptance / (2j * np.pi * observation.frequency_hz) ** order
            )

        actual = [_quantity_of(FORMS.index(form) + order) for form in stated]
        how = "differentiated" if order > 0 else "integrated"
        form = (
            f'in Python `frf.with_(form="{actual[0]}")` before the FRF is used, '
            if len(actual) == 1 and actual[0] in FORMS
            else ""
        )
        yield Variant(
            f"{how} {_TIMES[abs(order)]} more than stated",
            model.map_receptances(change),
            meaning=f"the files say {' and '.join(stated)}, and the data are {' and '.join(actual)}",
            remedy=f"{form}in a campaign the line `integrate = {order}` in the tables of these measurements (a number "
            "that is there already is added to it)",
        )


def _polarity(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _require_receptances(model)
    yield Variant("all", model.map_receptances(lambda record: altered(record, receptance=-record.receptance)))
    records = [observation for observation in model.witnesses or model.observations if observation.is_receptance]
    places = dict.fromkeys(map(_sensor_place, records))
    for place in places if len(places) > 1 else ():

        def change(observation: Observation, place: tuple[str, float | Literal["end"]] = place) -> Observation:
            reverse = _sensor_place(observation) == place
            return altered(observation, receptance=-observation.receptance) if reverse else observation

        part, position = place
        name = f"sensor on {part} at " + (position if isinstance(position, str) else f"{1e3 * position:g} mm")
        yield Variant(
            name,
            model.map_receptances(change),
            meaning=f"the {name} points the other way: its FRFs have the wrong sign, those of other places have not",
        )


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
    end = model.truncation
    if end is None:
        raise UndecidableError("no record breaks off while the structure still rings: the lines are close enough")
    ended = model.map_receptances(lambda one: one if one.force is not None else altered(one, ends=end))
    low, high = 0.8 * end, 1.1 * end
    unknown = replace(p["end"], typical=end).unknown(END, lower=low, upper=high)
    # Chi-square has a minimum in each period of the highest frequency, and the lines show the end less accurately.
    highest = max(float(observation.frequency_hz.real.max()) for observation in model.receptances)
    ends = np.linspace(low, high, min(2 + int(2.0 * highest * (high - low)), SCANNED_ENDS))
    yield Variant("records end too early", ended.plus(unknown), scan={unknown.name: ends.tolist()})


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
