"""Causes that lie in how it was measured."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Literal, TypeGuard

import numpy as np

from receptance.coordinates import Coordinate
from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
from receptance.diagnosis.model import Model, with_points
from receptance.diagnosis.records import visible_end
from receptance.identification.factors import DECAY_RATES, DELAY, END, LOG_GAIN
from receptance.identification.observations import MeasuredFRF, altered
from receptance.identification.task import Observation, place_of
from receptance.joints import GroundSpring, PointMass
from receptance.units import FORMS

__all__ = ["MEASUREMENT_CAUSES"]

_ROPES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""Where on the holder a suspension is tried, as shares of its length."""
_BEGUN = 1e-4
"""Steps that are nearer than this, in m, are the beginnings of fits of other lengths, and are no bounds."""
_TIMES = {1: "once", 2: "twice"}
_SAME_PLACE = 1e-9
"""Places in m that are nearer than this are one."""
_SPLIT = 5e-6
"""A hit where something else is as well is moved by this much, in m, so that there is a step that can move on.

It is less than the length of flutes before their fit, so that hits can be moved along flutes."""


def _receptances(model: Model) -> None:
    if not any(isinstance(one, MeasuredFRF) for one in model.observations):
        raise UndecidableError("natural frequencies alone say nothing of it; measure FRFs")


def _each(model: Model) -> tuple[str | None, ...]:
    """Return all configurations together, then each alone that was measured with FRFs: only these have a chain."""
    own = dict.fromkeys(
        place_of(one, i).configuration for i, one in enumerate(model.observations) if isinstance(one, MeasuredFRF)
    )
    return (None, *own) if len(own) > 1 else (None,)


def _sensor(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    def change(one: Observation) -> Observation:
        place = one.response if isinstance(one, MeasuredFRF) else Coordinate()
        point = PointMass(mass=0.0, part=place.part, position=place.position, name="cause_sensor")
        return altered(one, assembly=with_points(one.assembly, point))

    changed = model.map(change)
    for name in _each(model):
        yield Variant(name or "all", changed.plus(p["mass"].unknown("cause_sensor.mass", configurations=name)))


def _offset(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _receptances(model)
    places = dict.fromkeys(
        (one.excitation.part or next(iter(one.assembly.elements)), one.excitation.position)
        for one in model.witnesses or model.observations
        if isinstance(one, MeasuredFRF) and one.excitation.direction == "y"
    )
    found = 0
    for part, position in places:
        if position != "end":
            for variant in _hits_at(p, model, part, float(position)):
                found += 1
                yield variant
    if not found:
        raise UndecidableError("a hit at the far end of a part can only be moved by hand")


def _hits_at(p: Mapping[str, Parameter], model: Model, part: str, position: float) -> Iterator[Variant]:
    """Yield the hits at one place moved along the part; all else is where it was said to be.

    The hits are put on a step between two segments of one section, which the parameter moves. It may not pass a real
    step, nor a place where something else is measured, hit or attached; where such a thing is at the place of the
    hits, the step is laid beside it, on one side and on the other.
    """

    def hit(one: Observation) -> TypeGuard[MeasuredFRF]:
        if not isinstance(one, MeasuredFRF) or one.excitation.direction != "y":
            return False
        return (one.excitation.part or next(iter(one.assembly.elements)), one.excitation.position) == (part, position)

    others = model.map(lambda one: altered(one, excitation=one.response) if hit(one) else one)
    fixed = sorted({0.0, *others.places(part), *model.steps(part)})
    beside = (-_SPLIT, _SPLIT) if any(abs(x - position) < _SAME_PLACE for x in fixed) else (0.0,)
    for side in beside if position else (_SPLIT,):
        at = position + side
        try:
            divided, index = model.split(part, at)
        except ValueError:
            continue  # not all assemblies with that part have the place

        def change(one: Observation, at: float = at) -> Observation:
            return altered(one, excitation=replace(one.excitation, part=part, position=at)) if hit(one) else one

        below = max((x for x in fixed if x < at - _BEGUN), default=0.0)
        above = min((x for x in fixed if x > at + _BEGUN), default=math.inf)
        offset = p["distance"].move(
            {f"{part}.segment[{index - 1}].length": 1.0, f"{part}.segment[{index}].length": -1.0}
        )
        lower = 0.0 if side > 0.0 else max(offset.lower, below - at + _SPLIT)
        upper = 0.0 if side < 0.0 else min(offset.upper, above - at - _SPLIT)
        if lower >= upper:
            continue
        title = f"on {part} at {1e3 * position:g} mm"
        if side and position:
            title += ", farther from the tip" if side > 0.0 else ", nearer to the tip"
        yield Variant(title, divided.map(change).plus(replace(offset, lower=lower, upper=upper)), local=True)


def _delay(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _receptances(model)
    for name in _each(model):
        yield Variant(name or "all", model.plus(p["delay"].unknown(DELAY, configurations=name)))


def _gain(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _receptances(model)
    for name in _each(model):
        yield Variant(name or "all", model.plus(p["log_gain"].unknown(LOG_GAIN, configurations=name)))


def _window(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _receptances(model)
    recorded = ("accelerations", "velocities", "displacements")
    for name, address in zip(recorded, DECAY_RATES, strict=True):
        yield Variant(f"on {name}", model.plus(p["decay_rate"].unknown(address)))
    # What was recorded hardly matters where a window is a mistake in one configuration.
    for place in _each(model)[1:]:
        unknown = p["decay_rate"].unknown(next(iter(DECAY_RATES)), configurations=place)
        yield Variant(f"on {recorded[0]}, {place}", model.plus(unknown))


def _suspension(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    holders = {anatomy.holder for anatomy in model.anatomies if anatomy.holder}
    if len(holders) != 1:
        raise UndecidableError("the model has no holder, or several")
    lengths = {part: _length(model, part) for part in holders.pop()}
    for share in _ROPES:
        part, position = _at(lengths, share)
        spring = GroundSpring(part=part, position=position, name="cause_rope")
        title = f"at {100 * share:.0f} % of the holder"
        hung = model.attached(spring).plus(p["stiffness"].unknown("cause_rope.k_y"))
        yield Variant(title, hung)
        # A rope loses energy; where that shows, something else would be made up for it.
        yield Variant(f"{title}, with a loss", hung.plus(p["damping"].unknown("cause_rope.c_y")))


def _length(model: Model, part: str) -> float:
    first = next(one.assembly.elements[part] for one in model.observations if part in one.assembly.elements)
    return float(np.sum([segment.length for segment in first.segments]))  # type: ignore[union-attr]


def _at(lengths: Mapping[str, float], share: float) -> tuple[str, float | Literal["end"]]:
    """Return the part and the place in it at a share of the length of all parts."""
    left = share * sum(lengths.values())
    for part, length in lengths.items():
        if left < length * (1.0 - 1e-9):
            return part, left
        left -= length
    return part, "end"


def _quantity(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _receptances(model)
    said = dict.fromkeys(one.form for one in model.observations if isinstance(one, MeasuredFRF))
    for order in (1, 2, -1, -2):

        def change(one: Observation, order: int = order) -> Observation:
            if not isinstance(one, MeasuredFRF):
                return one
            return altered(one, receptance=one.receptance / (2j * np.pi * one.frequency_hz) ** order)

        are = [_quantity_of(FORMS.index(form) + order) for form in said]
        how = "differentiated" if order > 0 else "integrated"
        form = (
            f'in Python `frf.with_(form="{are[0]}")` before the FRF is used, '
            if len(are) == 1 and are[0] in FORMS
            else ""
        )
        yield Variant(
            f"{how} {_TIMES[abs(order)]} more than stated",
            model.map(change),
            fresh=True,
            meaning=f"the files say {' and '.join(said)}, and the data are {' and '.join(are)}",
            remedy=f"{form}in a campaign the line `integrate = {order}` in the tables of these measurements (a number "
            "that is there already is added to it)",
        )


def _quantity_of(order: int) -> str:
    """Return what an FRF is whose motion is so many derivatives of a displacement."""
    if 0 <= order < len(FORMS):
        return FORMS[order]
    if order < 0:
        return f"{FORMS[0]} whose displacement is integrated {_TIMES[-order]}"
    return f"{FORMS[-1]} whose acceleration is differentiated {_TIMES[order - len(FORMS) + 1]}"


def _coarse(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    _receptances(model)
    end = visible_end([one for one in model.observations if isinstance(one, MeasuredFRF)])
    if end is None:
        raise UndecidableError("in no record is there still a ringing that breaks off: the lines are close enough")
    ended = model.map(lambda one: altered(one, ends=end) if isinstance(one, MeasuredFRF) else one)
    unknown = replace(p["end"].unknown(END), lower=0.8 * end, upper=1.1 * end, start=end)
    yield Variant("records end too early", ended.plus(unknown), limited=(replace(p["end"], typical=end),))


MEASUREMENT_CAUSES = (
    Cause(
        id="sensor_mass",
        group="measurement",
        parameters=(Parameter(name="mass", unit="kg", lower=0.0, upper=0.2, typical=1e-3, plausible=(0.0, 0.03)),),
        change=_sensor,
        meaning="the sensor's mass sat on the structure and is not in the model",
        remedy="state the sensor in the campaign, or measure with a laser or a second sensor of known mass",
    ),
    Cause(
        id="hammer_offset",
        group="measurement",
        parameters=(
            Parameter(name="distance", unit="m", lower=-0.02, upper=0.02, typical=2e-3, plausible=(-0.012, 0.012)),
        ),
        change=_offset,
        meaning="the hammer hit beside the place that was written down",
        remedy="mark the place, and hit at stated offsets once to see what they do",
    ),
    Cause(
        id="time_delay",
        group="measurement",
        parameters=(
            Parameter(
                name="delay", unit="s", lower=-1e-3, upper=1e-3, typical=5e-6, plausible=(-5e-4, 5e-4), least=1e-7
            ),
        ),
        change=_delay,
        meaning="one channel lags behind the other",
        remedy="measure a known free mass with both channels and correct the delay",
    ),
    Cause(
        id="calibration_gain",
        group="measurement",
        parameters=(Parameter(name="log_gain", unit="", lower=-3.0, upper=3.0, typical=0.03, plausible=(-0.5, 0.5)),),
        change=_gain,
        meaning="the calibration of hammer or sensor is off",
        remedy="calibrate the chain with a known free mass",
    ),
    Cause(
        id="exponential_window",
        group="measurement",
        parameters=(
            Parameter(name="decay_rate", unit="1/s", lower=0.0, upper=500.0, typical=10.0, plausible=(0.0, 200.0)),
        ),
        change=_window,
        meaning="an exponential window was put on the records, and the FRF does not say so",
        remedy="state the window's decay rate, or repeat one measurement without it",
    ),
    Cause(
        id="suspension",
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
        group="measurement",
        parameters=(),
        change=_quantity,
        meaning="the file holds another quantity than it was read as",
        remedy="state the quantity of the file (receptance, mobility, accelerance)",
    ),
    Cause(
        id="coarse_resolution",
        group="measurement",
        parameters=(Parameter(name="end", unit="s", lower=1e-4, upper=1e3, typical=0.1, secondary=True),),
        change=_coarse,
        meaning="the records end while the structure still rings: the lines are farther apart than resonances are wide",
        remedy="record longer, or state an exponential window that the response dies away in",
    ),
)
