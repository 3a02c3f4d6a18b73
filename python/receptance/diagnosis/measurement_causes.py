"""Causes in the measurement."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, permutations, product, starmap
from typing import Any, Literal

import numpy as np

from receptance._text import join_names
from receptance.diagnosis.causes import Cause, Parameter, Variant
from receptance.diagnosis.changes import (
    Scope,
    add,
    is_copy,
    move,
    moved_step,
    place_of,
    require_free,
    require_receptances,
    room_of_step,
    scopes_of,
)
from receptance.diagnosis.model import (
    IndescribableError,
    Model,
    UndecidableError,
    require_beams,
    require_no_table,
    with_points,
)
from receptance.diagnosis.thresholds import (
    LARGE_SIZE,
    SAME_PLACE,
    SENSOR_SHARE,
    START_LENGTH,
    SUSPENSION_PLACES,
    TIP_STEP,
)
from receptance.diagnosis.truncation import ALL_RECORDS, best_end
from receptance.fit.observation import Observation, altered
from receptance.fit.parameters import DECAY_RATES, DELAY, END, FREQUENCY_OFFSETS, LOG_GAIN
from receptance.fit.unknowns import Prior
from receptance.model.addresses import QUANTITIES
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring, PointMass
from receptance.report.table import amount
from receptance.units import FORMS, powers_of

_NOT_COMPLEX = "which has no values at the complex frequencies of a window: describe that part by modes"
_TIMES = {1: "once", 2: "twice"}
_EARLIEST, _LATEST = 0.8, 1.1
"""Bounds of the end of truncated records, as multiples of the end that the lines show."""
Place = tuple[str, float | Literal["end"]]
"""A part and a position on it, in m from its start."""
_BESIDE = 0.5 * TIP_STEP
"""Distance in m of a hit from a place that something else needs: it is moved along flutes as well."""
_RECORDED = ("displacements", "velocities", "accelerations")
"""Quantities of a record in the order of time derivatives."""


def _sensor(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    sizes = [size for observation in model.observations for size in _masses_at_response(observation).values()]
    stated = join_names(sorted({amount(size, "kg") for size in sizes}))
    more = (
        f"the mass at the sensor exceeds the stated {stated} by this size; below zero the stated one is too large by it"
    )
    weigh = f"correct the stated {stated}: weigh the sensor with its adapter, wax and cable; a laser has no mass"
    meaning, remedy = (more, weigh) if stated else ("", "")
    for scope in scopes_of(model):
        yield Variant(scope.name, partial(_add_sensor, p["mass"], scope), meaning=meaning, remedy=remedy)


def _add_sensor(mass: Parameter, scope: Scope, model: Model) -> Model:
    """Return the model with the mass of a sensor during some records or all; a stated mass may be too large."""
    # A large structure carries a large sensor.
    tools = {anatomy.tool for anatomy in model.anatomies}
    heaviest = max(sum(model.parts(name)[0].mass for name in tool) for tool in tools)
    largest = max(SENSOR_SHARE * heaviest, mass.plausible[1])
    mass = replace(mass, plausible=(0.0, largest), upper=max(mass.upper, LARGE_SIZE * largest))
    masses = [_masses_at_response(record) for record in model.observations if scope == Scope() or scope.has(record)]
    changed = model.with_change(_with_sensors)
    if not any(masses):
        return changed.plus(mass.unknown("cause_sensor.mass", **scope.limits(model)))
    # Where a mass is stated it is the one that changes, so that it ends at zero.
    addresses = {f"{name}.mass": 1.0 for stated in masses for name in stated}
    require_free(model, addresses, "the mass of the sensor")
    if all(masses):
        least = min(max(stated.values()) for stated in masses)
        mass = replace(mass, lower=-least, plausible=(-least, largest))
    else:
        addresses["cause_sensor.mass"] = 1.0
    return changed.plus(mass.move(addresses, **scope.limits(model)))


def _with_sensors(model: Model) -> Model:
    """Return the model with a point for a mass at the sensors of all records where none is stated."""

    def add_point(observation: Observation) -> Observation:
        if _masses_at_response(observation):
            return observation
        place = observation.response if observation.is_receptance else Coordinate()
        point = PointMass(mass=0.0, part=place.part, position=place.position, name="cause_sensor")
        return altered(observation, assembly=with_points(observation.assembly, point))

    return model.map(add_point).with_shared_assemblies()


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
    require_receptances(model)
    places = dict.fromkeys(map(_place_of_hit, model.witnesses or model.observations))
    hits = [(part, float(position)) for part, position in filter(None, places) if position != "end"]
    if not hits:
        raise UndecidableError("the model cannot move a hit at the far end of a part")
    for place in hits:
        part, position = place
        name = f"on {part} at {1e3 * position:g} mm"
        sides = {name: 0.0 if position else _BESIDE}
        if position and any(abs(other - position) < SAME_PLACE for other in _fixed_places(model, place)):
            sides = {f"{name}, nearer to the tip": -_BESIDE, f"{name}, farther from the tip": _BESIDE}
        for scope in scopes_of(model, partial(_is_hit_at, place)):
            for side, step in sides.items():
                yield Variant(scope.within(side), partial(_move_hits, p["distance"], scope, place, step))


def _place_of_hit(observation: Observation) -> tuple[str, float | Literal["end"]] | None:
    """Return the part and the position of a hit across the axis; None for another measurement."""
    if not observation.is_receptance or observation.excitation.direction != "y":
        return None
    return observation.excitation.part or next(iter(observation.assembly.elements)), observation.excitation.position


def _is_hit_at(place: tuple[str, float], observation: Observation) -> bool:
    return _place_of_hit(observation) == place


def _fixed_places(model: Model, place: tuple[str, float]) -> list[float]:
    """Return the places on a part, in m, that keep their place when the hits at one place move."""
    others = model.map(partial(_without_hit, place))
    return sorted({0.0, *others.places(place[0]), *model.steps(place[0])})


def _without_hit(place: tuple[str, float], observation: Observation) -> Observation:
    return altered(observation, excitation=observation.response) if _is_hit_at(place, observation) else observation


def _move_hits(distance: Parameter, scope: Scope, place: tuple[str, float], side: float, model: Model) -> Model:
    """Return the model with the hits at one place moved along the part; everything else keeps its place.

    The hits are placed on a step between two segments of one section, which the parameter moves. The step may not pass
    a step of the part, nor another coordinate or attachment; where one of these is at the place of the hits, the step
    is beside it, on either side.
    """
    part, at = place[0], place[1] + side
    fixed = _fixed_places(model, place)
    below = max((x for x in fixed if x < at - START_LENGTH), default=0.0)
    above = min((x for x in fixed if x > at + START_LENGTH), default=math.inf)
    lower = 0.0 if side > 0.0 else max(distance.lower, below - at + _BESIDE)
    upper = 0.0 if side < 0.0 else min(distance.upper, above - at - _BESIDE)
    if lower >= upper:
        raise IndescribableError(f"the hits on {part} at {1e3 * place[1]:g} mm have no room to be moved")
    on_step = model.with_change(_with_hits_on_step, place, at)
    moved = distance.move(moved_step(on_step, part, at), lower=lower, upper=upper, **scope.limits(model))
    return on_step.plus(moved)


def _with_hits_on_step(model: Model, place: tuple[str, float], at: float) -> Model:
    """Return the model with a step at a position, and with the hits at a place on it."""

    def to_step(observation: Observation) -> Observation:
        if not _is_hit_at(place, observation):
            return observation
        return altered(observation, excitation=replace(observation.excitation, part=place[0], position=at))

    return model.split(place[0], at)[0].map(to_step)


def _chain(address: str, p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a parameter of the measuring chain in each scope."""
    require_receptances(model)
    (parameter,) = p.values()
    for scope in scopes_of(model):
        yield Variant(scope.name, partial(add, {address: parameter}, scope))


def _scale(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield the true frequencies as a multiple 1 + s of the stated ones, for each recorded quantity.

    A wrong clock is another unit of time: with the moduli and stiffnesses divided by (1 + s)^2 and the viscous damping
    by 1 + s, the model has the true accelerance of f (1 + s) at the stated f. The receptance that follows from it with
    the stated frequencies is too large by (1 + s)^2; where velocities or displacements were recorded, by 1 + s, or not
    at all. This difference is another unit of mass.
    """
    require_no_table(model, "whose frequencies may have the same error")
    if not model.receptances:
        yield Variant("in natural frequencies", partial(_scale_time, p["log_scale"], 2.0, Scope()))
        return
    offsets = {integrations: address for address, integrations in FREQUENCY_OFFSETS.items()}
    for scope, number in _by_recorded(model):
        name = scope.within(f"in {_RECORDED[number]}")
        yield Variant(name, partial(_scale_time, p["log_scale"], 2.0 - number, scope))
    for scope, number in _by_recorded(model):
        yield Variant(
            scope.within(f"a constant, in {_RECORDED[number]}"),
            partial(_shift_lines, p["offset"], offsets[number], scope),
            meaning="the frequency axis is off by a constant, half a line for example",
            remedy="compare the first lines of the file with those of the analyser, and its spacing with 1 / duration",
        )


def _shift_lines(offset: Parameter, address: str, scope: Scope, model: Model) -> Model:
    if any(record.force is not None or record.ends is not None for record in model.receptances):
        raise UndecidableError("the lines of a stepped sine, and of a record that ends too early, have no offset")
    return add({address: offset}, scope, model)


def _by_recorded(model: Model) -> Iterator[tuple[Scope, int]]:
    """Yield scopes and indices of the recorded quantity: that of some records makes little difference."""
    for scope in scopes_of(model):
        for number in range(len(_RECORDED)) if scope == Scope() else (len(_RECORDED) - 1,):
            yield scope, number


def _scale_time(scale: Parameter, mass: float, scope: Scope, model: Model) -> Model:
    """Return the model in another unit of time, with a unit of mass that changes by a power of it."""
    addresses = dict.fromkeys(
        re.sub(r"segment\[\d+\]", "segment[*]", address)
        for observation in model.observations
        for address in observation.assembly.parameters
    )
    powers = {address: powers_of(QUANTITIES[address.rpartition(".")[2]].unit) for address in addresses}
    moves = {a: n for a, of in powers.items() if (n := of.get("time", 0.0) + mass * of.get("mass", 0.0))}
    return move(scale, moves, scope, model)


def _window(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_receptances(model)
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
    addresses = {integrations: address for address, integrations in DECAY_RATES.items()}
    for scope, number in _by_recorded(model):
        name = scope.within(f"on {_RECORDED[number]}")
        yield Variant(name, partial(add, {addresses[number]: rate}, scope), meaning=meaning)


def _suspension(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    what = "holder" if model.joints else "structure"
    for share in SUSPENSION_PLACES:
        name = f"near {100 * share:.0f} % of the {what}"
        yield Variant(name, partial(_hang, p, (share,), False))
        # Without the damping of a rope another cause would explain its loss.
        yield Variant(f"{name}, with a loss", partial(_hang, p, (share,), True))
    # Ropes at the ends cannot move, and act on a stiff holder as two others between them do.
    for pair in combinations(SUSPENSION_PLACES[1:-1], 2):
        name = f"near {100 * pair[0]:.0f} % and {100 * pair[1]:.0f} % of the {what}, with a loss"
        yield Variant(name, partial(_hang, p, pair, True))


def _hanging(model: Model) -> dict[str, float]:
    """Return the parts that hang, of the holder or of a structure without a joint, and their lengths in m."""
    if model.in_spindle:
        raise UndecidableError("the holder is in a spindle, so that nothing hangs")
    require_beams(model)
    hanging = {anatomy.holder or anatomy.tool for anatomy in model.anatomies}
    if len(hanging) != 1:
        raise UndecidableError("the model has several holders")
    return {name: model.parts(name)[0].length for name in hanging.pop()}


def _hang(p: Mapping[str, Parameter], shares: Sequence[float], with_loss: bool, model: Model) -> Model:
    """Return the model on ropes near shares of the length of the parts that hang; they have one damping."""
    lengths = _hanging(model)
    places = tuple(_at(lengths, share) for share in shares)
    hung = model.with_change(_with_ropes, places)
    reach = sum(lengths.values()) / (len(SUSPENSION_PLACES) - 1)
    for i, place in enumerate(places):
        part = f"of rope {i + 1}" if len(places) > 1 else ""
        hung = hung.plus(p["stiffness"].unknown(f"{_rope(i)}.k_y", part=part))
        lower, upper = _room(model, place, places)
        if lower < upper:
            # The place is a step between two segments of one section, which the parameter moves. All places of one rope
            # are about equally likely: the priors of neighbouring variants add up to a nearly constant density. Of two
            # ropes the places are free parameters, because these act as one would anywhere between them.
            moves = moved_step(hung, place[0], float(place[1]))
            prior = Prior(mean=0.0, standard_deviation=0.5 * reach) if len(places) == 1 else None
            distance = replace(p["distance"], prior=prior)
            hung = hung.plus(distance.move(moves, part=part, lower=max(lower, -reach), upper=min(upper, reach)))
    if not with_loss:
        return hung
    others = {f"{_rope(i)}.c_y": 1.0 for i in range(1, len(places))}
    return hung.plus(p["damping"].unknown(f"{_rope(0)}.c_y", also=others))


def _rope(number: int) -> str:
    return f"cause_rope_{number + 1}" if number else "cause_rope"


def _with_ropes(model: Model, places: Sequence[Place]) -> Model:
    """Return the model with springs at places, each on a step between segments where it may move."""
    for place in places:
        if _room(model, place, places) != (0.0, 0.0):
            model, _ = model.split(place[0], float(place[1]))
    ropes = [GroundSpring(part=part, position=position, name=_rope(i)) for i, (part, position) in enumerate(places)]
    return model.attach(*ropes)


def _room(model: Model, place: Place, places: Sequence[Place]) -> tuple[float, float]:
    """Return how far a rope may move towards the tip and away from it; one at the end of a part stays there."""
    part, position = place
    if position == "end":
        return 0.0, 0.0
    halfway = [0.5 * (position + at) for owner, at in places if owner == part and at != position and at != "end"]
    return room_of_step(model, part, position, halfway)


def _at(lengths: Mapping[str, float], share: float) -> Place:
    """Return the part and the place in it at a share of the length of all parts."""
    position = share * sum(lengths.values())
    for part, length in lengths.items():
        if position < length * (1.0 - 1e-9):
            return part, position
        position -= length
    return part, "end"


def _quantity(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_receptances(model)
    for scope, order in product(scopes_of(model), (1, 2, -1, -2)):
        stated = dict.fromkeys(record.form for record in model.receptances if scope.has(record))
        actual = [_quantity_of(FORMS.index(form) + order) for form in stated]
        how = "differentiated" if order > 0 else "integrated"
        form = (
            f'in Python `frf.with_(form="{actual[0]}")` before the FRF is used, '
            if len(actual) == 1 and actual[0] in FORMS
            else ""
        )
        yield Variant(
            scope.within(f"{how} {_TIMES[abs(order)]} more than stated"),
            partial(scope.change, change=partial(_integrate, order)),
            meaning=f"the files say {' and '.join(stated)}, and the data are {' and '.join(actual)}",
            remedy=f"{form}in a campaign the line `integrate = {order}` in the tables of these measurements (a number "
            "that is there already is added to it)",
        )

    for scope in scopes_of(model):
        yield Variant(
            scope.within("complex conjugate"),
            partial(scope.change, change=lambda record: altered(record, receptance=record.receptance.conj())),
            meaning="the files are written for the other sign of the exponent in time",
            remedy="in Python `frf.conjugated()` before the FRF is used, in a campaign the line `conjugate = true` in "
            "the tables of these measurements",
        )


def _integrate(order: int, record: Observation) -> Observation:
    return altered(record, receptance=record.receptance / (2j * np.pi * record.frequency_hz) ** order)


def _polarity(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_receptances(model)
    for scope in scopes_of(model):
        there = f"sensor or hammer pointed the other way in the {scope.name}, and not in the other FRFs"
        meaning = "" if scope == Scope() else there
        change = partial(scope.change, change=lambda record: altered(record, receptance=-record.receptance))
        yield Variant(scope.name, change, meaning=meaning)


def _exchange(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_receptances(model)
    if len({record.label for record in model.receptances} - {""}) < len(model.receptances):
        raise UndecidableError("to exchange records, label each one differently")
    if any(starmap(is_copy, combinations(model.receptances, 2))):
        raise UndecidableError(
            "two configurations have the same values: find the file that was copied over another one"
        )
    # Records of two configurations belong together by their places, and in order among those of the same places.
    records: dict[str, dict[Any, Observation]] = {name: {} for name in model.configurations}
    for name, record in zip(model.configuration_of, model.observations, strict=True):
        if record.is_receptance:
            places = place_of(record, record.response), place_of(record, record.excitation)
            number = sum(key[:2] == places for key in records[name])
            records[name][(*places, number)] = record
    pairs = [(a, b) for a, b in combinations(records, 2) if records[a] and records[a].keys() == records[b].keys()]
    if not pairs:
        raise UndecidableError("no two configurations have the same number of FRFs at the same places")
    for a, b in pairs:
        partners = [(records[a][key], records[b][key]) for key in records[a]]
        others = {record.label: other for pair in partners for record, other in permutations(pair)}
        yield Variant(
            f"{a} and {b}",
            partial(_exchange_records, others),
            far=True,
            meaning=f"the files of {a} are those of {b}, and the other way round",
        )


def _exchange_records(others: Mapping[str, Observation], model: Model) -> Model:
    """Return the model in which each record is in the place of another one, by its label."""
    if not any(record.label in others for record in model.receptances):
        raise UndecidableError("none of these records is among the measurements")
    fields = ("assembly", "label", "configuration", "conditions", "response", "excitation")

    def change(record: Observation) -> Observation:
        other = others.get(record.label)
        return record if other is None else altered(record, **{name: getattr(other, name) for name in fields})

    return model.map(change)


def _quantity_of(order: int) -> str:
    """Return the name of an FRF whose motion is a displacement differentiated `order` times."""
    if 0 <= order < len(FORMS):
        return FORMS[order]
    if order < 0:
        return f"{FORMS[0]} whose displacement is integrated {_TIMES[-order]}"
    return f"{FORMS[-1]} whose acceleration is differentiated {_TIMES[order - len(FORMS) + 1]}"


def _truncation(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    require_receptances(model)
    require_no_table(model, f"{_NOT_COMPLEX}, or record until the structure is at rest")
    if not model.ends:
        raise UndecidableError("no record breaks off while the structure still rings: the lines are close enough")
    for scope in scopes_of(model):
        yield Variant(scope.within("records end too early"), partial(_truncate, p["end"], scope), begin=_best_end)


def _truncate(parameter: Parameter, scope: Scope, model: Model) -> Model:
    records = [ALL_RECORDS] if scope == Scope() else [record.label for record in model.receptances if scope.has(record)]
    ends = [model.ends[name] for name in records if name in model.ends]
    if not ends:
        raise UndecidableError(f"no record of the scope {scope.name!r} breaks off while the structure still rings")
    end = float(np.median(ends))
    unknown = replace(parameter, typical=end).unknown(
        END, lower=_EARLIEST * end, upper=_LATEST * end, **scope.limits(model)
    )
    # A stepped sine has no end.
    ended = scope.change(model, lambda record: altered(record, ends=end) if record.force is None else record)
    return ended.plus(unknown)


def _best_end(model: Model, values: Mapping[str, float]) -> dict[str, float]:
    """Return the end of records, the last unknown of this kind, at which chi-square is smallest on few lines."""
    end = next(unknown for unknown in reversed(model.unknowns) if unknown.address == END)
    return best_end(end, model.task, model.on_few_lines, values)


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
        group="measurement",
        parameters=(Parameter(name="log_gain", unit="", lower=-16.0, upper=16.0, typical=0.03, plausible=(-2.4, 2.4)),),
        change=partial(_chain, LOG_GAIN),
        meaning="the calibration of hammer or sensor is off",
        remedy="calibrate the chain with a known free mass",
    ),
    Cause(
        id="frequency_scale",
        title="scale of the frequencies",
        group="measurement",
        parameters=(
            Parameter(name="log_scale", unit="", lower=-0.06, upper=0.06, typical=4e-3, plausible=(-0.02, 0.02)),
            Parameter(name="offset", unit="Hz", lower=-30.0, upper=30.0, typical=1.0, plausible=(-12.0, 12.0)),
        ),
        change=_scale,
        meaning="the sample clock is off: the true frequencies are a multiple of the stated ones",
        remedy="measure a generator of known frequency with the analyser, or a free bar of known modulus and density",
    ),
    Cause(
        id="exponential_window",
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
            Parameter(name="distance", unit="m", lower=-1.0, upper=1.0, typical=0.0, secondary=True),
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
        changes_data=True,
        meaning="the file holds another quantity than the one it was read as",
        remedy="state the quantity of the file (receptance, mobility, accelerance)",
    ),
    Cause(
        id="reversed_polarity",
        group="measurement",
        parameters=(),
        change=_polarity,
        changes_data=True,
        meaning="sensor or hammer point the other way: every FRF has the wrong sign",
        remedy="turn the sign of the response: in a campaign its direction, in Python `frf.flipped()`",
    ),
    Cause(
        id="exchanged_files",
        title="exchanged files",
        group="measurement",
        parameters=(),
        change=_exchange,
        changes_data=True,
        meaning="the files of two configurations are exchanged",
        remedy="exchange the files of these two configurations",
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
