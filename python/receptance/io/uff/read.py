"""FRFs, coherences and time series in universal files."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from receptance.frf import FRF
from receptance.io.build import SI, ReadOptions, make, make_frf, missing_phase_notes, resolve_frf, sampling, to_si
from receptance.io.description import coordinate_from_list
from receptance.io.errors import FileFormatError
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.io.uff.datasets import (
    LOADS,
    MARK,
    MOTIONS,
    NO_POINT,
    QUANTITIES,
    SEPARATE,
    Function,
    Other,
    Point,
    data_sets,
)
from receptance.model.coordinates import Coordinate
from receptance.units import (
    CHANNEL_UNITS,
    FORM_NAMES,
    ROTATIONS,
    Form,
    FRFKind,
    Unit,
    UnitError,
    channel_kind,
    frf_unit,
    parse_unit,
)

_TIME, _FRF, _COHERENCE = 1, 4, 6
_FUNCTIONS = {
    0: "general function",
    1: "time response",
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response function",
    5: "transmissibility",
    6: "coherence",
    9: "power spectral density",
    10: "energy spectral density",
    12: "spectrum",
    26: "multiple coherence",
}


@dataclass(frozen=True, eq=False)
class _Entry:
    """An entry of an FRF: one response, one excitation, in SI."""

    function: Function
    form: Form
    directions: tuple[str, str]
    values: NDArray[Any]
    notes: tuple[str, ...]

    @property
    def pair(self) -> tuple[str, str]:
        return self.function.response.label, self.function.reference.label


def read_uff(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the FRFs, coherences and time series among the functions (data sets 58) of a universal file.

    FRFs of one form on the same lines form one matrix if every response is combined with every excitation. A coherence
    is assigned to the FRF of the same points and lines, else it is returned separately. Other functions are noted.
    """
    items = list(data_sets(data))
    functions = [item for item in items if isinstance(item, Function)]
    return measurements_of_functions(functions, [item for item in items if isinstance(item, Other)], options)


def measurements_of_functions(
    functions: Sequence[Function], others: Sequence[Other], options: ReadOptions
) -> list[Measurement]:
    """Return the measurements of the functions in a file; see `read_uff`."""
    by_kind = {kind: [f for f in functions if f.kind == kind] for kind in (_TIME, _FRF, _COHERENCE)}
    if not any(by_kind.values()):
        items: list[Function | Other] = sorted([*functions, *others], key=lambda item: item.line.byte)
        contents = ", ".join(dict.fromkeys(_describe_item(item) for item in items)) or "no data set"
        raise FileFormatError(
            "there is no time series, FRF or coherence in the file (data set 58 of function type 1, 4 or 6); "
            f"it holds {contents}",
            line=items[0].line.number if items else 1,
        )
    unread = Counter(_FUNCTIONS.get(f.kind, f"function of type {f.kind}") for f in functions if f.kind not in by_kind)
    notes = [f"not read: {name} ({count} in the file)" for name, count in unread.items()]
    if remarks := [item.line for item in others if item.kind is None]:
        where = ", ".join(f"{name} {number}" for name, number in remarks[0].location.items())
        notes.append(f"{len(remarks)} lines of text between the data sets were skipped, the first is {where}")
    coherences = _by_points(by_kind[_COHERENCE], by_kind[_FRF])
    measurements: list[Measurement] = [
        _frf(matrix, coherences, notes, options)
        for matrix in _matrices([_entry(function, options) for function in by_kind[_FRF]])
    ]
    if not (options.ignore_coherence and measurements):
        unassigned = {id(function) for functions in coherences.values() for function in functions}
        unassigned |= {id(function) for function in by_kind[_COHERENCE] if SEPARATE in _stored_values(function.texts)}
        entries = [
            _Entry(function, "receptance", ("y", "y"), _real(function), function.notes)
            for function in by_kind[_COHERENCE]
            if id(function) in unassigned
        ]
        measurements.extend(_coherence(matrix, notes) for matrix in _matrices(entries))
    measurements.extend(_time_series(channels, notes, options) for channels in _sampling_groups(by_kind[_TIME]))
    return measurements


def _describe_item(item: Function | Other) -> str:
    if isinstance(item, Other):
        return "text" if item.kind is None else f"data set {item.kind}"
    return f"{_FUNCTIONS.get(item.kind, 'a function')} (data set 58 of function type {item.kind})"


def _entry(function: Function, options: ReadOptions) -> _Entry:
    """Return an entry of an FRF in SI."""
    with function.line.error_location():
        _expect_abscissa(function, 18)
        form = _declared_form(function)
        resolved = resolve_frf(
            options,
            declared=_declared_unit(function, form, options),
            form=form,
            directions=_directions(function),
            undeclared="neither a data set 164 nor axis labels state the unit of the FRF",
        )
    notes = [*function.notes, *resolved.notes, *missing_phase_notes(function.ordinate)]
    values = to_si(function.ordinate, resolved.factor)
    kind = resolved.kind
    return _Entry(function, kind.form, (kind.response, kind.excitation), values, tuple(notes))


def _matrices(entries: Sequence[_Entry]) -> list[list[list[_Entry]]]:
    """Group entries of one form on the same lines to matrices [response][excitation], or single entries."""
    groups: dict[tuple[Form, bytes], list[dict[tuple[str, str], _Entry]]] = {}
    order: list[dict[tuple[str, str], _Entry]] = []
    counts: Counter[tuple[Form, bytes, tuple[str, str]]] = Counter()
    for entry in entries:
        lines = _lines_key(entry.function)
        matrices_on_lines = groups.setdefault((entry.form, lines), [])
        # The n-th occurrence of a pair belongs to the n-th matrix on these lines.
        position = counts[entry.form, lines, entry.pair]
        counts[entry.form, lines, entry.pair] += 1
        if position == len(matrices_on_lines):
            matrices_on_lines.append({})
            order.append(matrices_on_lines[position])
        matrices_on_lines[position][entry.pair] = entry
    matrices: list[list[list[_Entry]]] = []
    for group in order:
        responses, references = (list(dict.fromkeys(pair[side] for pair in group)) for side in (0, 1))
        if len(group) == len(responses) * len(references) and _directions_agree(group):
            matrices.append([[group[row, column] for column in references] for row in responses])
        else:
            matrices.extend([[entry]] for entry in group.values())
    return matrices


def _directions_agree(group: dict[tuple[str, str], _Entry]) -> bool:
    """Return whether each point has one direction in all entries."""
    seen: dict[tuple[int, str], str] = {}
    for pair, entry in group.items():
        for side in (0, 1):
            if seen.setdefault((side, pair[side]), entry.directions[side]) != entry.directions[side]:
                return False
    return True


def _lines_key(function: Function) -> bytes:
    """Return a key that is equal for equal lines (0 and -0 are equal)."""
    return (function.abscissa + 0.0).tobytes()


_Key: TypeAlias = tuple[Point, Point, bytes]


def _key(function: Function) -> _Key:
    """Return a key of the points and lines of a function."""
    return function.response, function.reference, _lines_key(function)


def _by_points(coherences: Sequence[Function], frfs: Sequence[Function]) -> dict[_Key, list[Function]]:
    """Return the coherences of FRFs by points and lines; the first in the file is last.

    One without a reference, or without points, belongs to the FRFs of its response, or on its lines, if these have one
    pair of points.
    """
    exact = {_key(frf) for frf in frfs}
    candidates: dict[tuple[Point, bytes], set[_Key]] = {}
    for key in exact:
        for response in (key[0], NO_POINT):
            candidates.setdefault((response, key[2]), set()).add(key)
    by_key: dict[_Key, list[Function]] = {}
    for function in reversed(coherences):
        if SEPARATE in _stored_values(function.texts):
            continue
        key = _key(function)
        if key not in exact and function.reference == NO_POINT:
            matching = candidates.get((key[0], key[2]), set())
            key = next(iter(matching)) if len(matching) == 1 else key
        by_key.setdefault(key, []).append(function)
    return by_key


def _frf(
    matrix: list[list[_Entry]], coherences: dict[_Key, list[Function]], notes: Sequence[str], options: ReadOptions
) -> FRF:
    """Return the FRF of a matrix; its coherences are removed from those of the file."""
    first = matrix[0][0].function
    values = np.stack([np.stack([entry.values for entry in row], axis=-1) for row in matrix], axis=1)
    coherence, coherence_notes = _pop_coherence(matrix, coherences)
    rows, columns = [row[0] for row in matrix], matrix[0]
    labels = tuple(e.function.response.label for e in rows), tuple(e.function.reference.label for e in columns)
    fields = _stored_values(first.texts)
    fields.pop("sample_rate_hz", None)
    lines = _lines(first, fields.pop("lines", None))
    labelled = fields.pop("labels", 1) and (any(labels[0]) or any(labels[1]))
    for name, side, entries in (("responses", 0, rows), ("excitations", 1, columns)):
        stored = [_stored_coordinates(entry.function.texts) for entry in entries]
        coordinates = [pair[side] for pair in stored if pair is not None]
        if [coordinate.direction for coordinate in coordinates] == [entry.directions[side] for entry in entries]:
            fields[name] = tuple(coordinates)
    with first.line.error_location():
        return make_frf(
            frequency_hz=lines,
            values=values,
            form=matrix[0][0].form,
            directions=([e.directions[0] for e in rows], [e.directions[1] for e in columns]),
            labels=labels if labelled else None,
            coherence=coherence,
            label=first.texts[0],
            notes=[
                *dict.fromkeys(note for row in matrix for entry in row for note in entry.notes),
                *coherence_notes,
                *notes,
            ],
            options=options,
            **fields,
        )


def _lines(function: Function, exact: tuple[float, float] | None) -> NDArray[np.float64]:
    """Return the frequency lines, from the exact increment of the ID lines if it agrees."""
    if exact is not None and function.step is not None:
        lines = exact[0] + exact[1] * np.arange(function.abscissa.size, dtype=np.float64)
        if np.allclose(lines, function.abscissa, rtol=1e-5, atol=1e-5 * function.step):
            return lines
    return function.abscissa


def _pop_coherence(
    matrix: list[list[_Entry]], coherences: dict[_Key, list[Function]]
) -> tuple[NDArray[np.float64] | None, list[str]]:
    """Remove the coherences of all entries from those of the file; return them with notes, None if one is missing."""
    frfs = [entry.function for row in matrix for entry in row]
    keys = [_key(frf) for frf in frfs]
    if any(len(coherences.get(key, ())) < count for key, count in Counter(keys).items()):
        return None, []
    functions = [coherences[key].pop() for key in keys]
    notes: list[str] = []
    for frf, function in zip(frfs, functions, strict=True):
        notes += function.notes
        if (function.response, function.reference) != (frf.response, frf.reference):
            notes.append("the coherence states no reference point: it is the only one on the lines of the FRF")
        if function.texts[0] and frf.texts[0] and function.texts[0] != frf.texts[0]:
            notes.append(f"the coherence is labelled {function.texts[0]!r}; it has the points and lines of the FRF")
    array = np.stack([_real(function) for function in functions], axis=-1).reshape(-1, len(matrix), len(matrix[0]))
    return array, list(dict.fromkeys(notes))


def _real(function: Function) -> NDArray[np.float64]:
    values: NDArray[Any] = function.ordinate
    if np.iscomplexobj(values):
        if np.any(values.imag != 0.0):
            raise function.line.error("the coherence is complex, expected real numbers from 0 to 1")
        values = values.real
    return values


def _coherence(matrix: list[list[_Entry]], notes: Sequence[str]) -> Coherence:
    first = matrix[0][0].function
    labels = tuple(row[0].pair[0] for row in matrix), tuple(entry.pair[1] for entry in matrix[0])
    entry_notes = dict.fromkeys(note for row in matrix for entry in row for note in entry.notes)
    with first.line.error_location():
        _expect_abscissa(first, 18)
        return make(
            Coherence,
            frequency_hz=first.abscissa,
            values=np.stack([np.stack([entry.values for entry in row], axis=-1) for row in matrix], axis=1),
            labels=labels if any(labels[0]) or any(labels[1]) else None,
            label=first.texts[0],
            notes=(*entry_notes, *notes),
        )


def _sampling_groups(functions: Sequence[Function]) -> list[list[Function]]:
    """Group channels that were sampled together; repeated channels begin the next record."""
    groups: list[list[Function]] = []
    for function in functions:
        if groups and np.array_equal(function.abscissa, groups[-1][0].abscissa):
            groups[-1].append(function)
        else:
            groups.append([function])
    records: list[list[Function]] = []
    for group in groups:
        names = [function.response.label for function in group]
        count = len(names)
        periods = (k for k in range(1, count) if count % k == 0 and names == names[:k] * (count // k))
        period = next(periods, count) if all(names) else count
        records.extend(group[k : k + period] for k in range(0, count, period))
    return records


def _time_series(functions: Sequence[Function], notes: Sequence[str], options: ReadOptions) -> TimeSeries:
    """Return a time series of channels that were sampled together."""
    names, first = _names(functions), functions[0]
    with first.line.error_location():
        given = options.channel_units(names)
    units: list[tuple[str, float]] = []
    notes = list(notes)
    for function, name, unit_in_options in zip(functions, names, given, strict=True):
        with function.line.error_location():
            _expect_abscissa(function, 17)
            unit, factor, note = _channel_unit(function, name, unit_in_options)
        units.append((unit, factor))
        notes.extend(f"{name}: {text}" for text in (*function.notes, note) if text)
        if np.iscomplexobj(function.ordinate):
            raise function.line.error(f"the time series {name!r} is complex, expected real numbers")
    exact: float | None = _stored_values(first.texts).get("sample_rate_hz")
    with first.line.error_location():
        # A single sample has no time step.
        step = 1.0 / exact if exact is not None and first.abscissa.size == 1 else first.step
        rate, start = sampling(first.abscissa, options, step=step)
        if exact is not None and options.sample_rate_hz is None and abs(exact / rate - 1.0) < 1e-5:
            rate = exact
        return make(
            TimeSeries,
            values=np.stack([f.ordinate * factor for f, (_, factor) in zip(functions, units, strict=True)], axis=1),
            channels=names,
            units=[unit for unit, _ in units],
            sample_rate_hz=rate,
            start_s=start,
            label=first.texts[0],
            notes=notes,
        )


def _names(functions: Sequence[Function]) -> list[str]:
    """Return unique channel names: of the point, else of the axis label, else a number."""
    names: dict[str, None] = {}
    counts: dict[str, int] = {}
    for number, function in enumerate(functions, 1):
        name = function.response.label or function.axes[1].label or f"channel {number}"
        repeated, unique = counts.get(name, 1), name
        while unique in names:
            repeated += 1
            unique = f"{name} ({repeated})"
        counts[name] = repeated
        names[unique] = None
    return list(names)


def _stored_coordinates(texts: Sequence[str]) -> tuple[Coordinate, Coordinate] | None:
    """Return response and excitation from the ID lines; None for lines of other programs and damaged ones."""
    ends = _parse_json(texts[3].replace("] [", "],["), "[{}]") if texts[3].startswith(MARK) else None
    if not isinstance(ends, list) or len(ends) != 2:
        return None
    try:
        return coordinate_from_list(ends[0]), coordinate_from_list(ends[1])
    except ValueError:
        return None


def _stored_values(texts: Sequence[str]) -> dict[str, Any]:
    """Return the values in ID line 5 by name; lines of other programs, and damaged values, are ignored."""
    values = _parse_json(texts[4], "{}") if texts[4].startswith(MARK) else None
    valid: dict[str, Any] = {}
    if not isinstance(values, dict):
        return valid
    averages = values.get("averages")
    if isinstance(averages, int) and not isinstance(averages, bool) and averages > 0:
        valid["averages"] = averages
    lines = values.get("lines")
    if isinstance(lines, list) and len(lines) == 2 and all(isinstance(x, float) and 0.0 <= x < math.inf for x in lines):
        valid["lines"] = (lines[0], lines[1])
    valid |= {name: flag for name, flag in (("labels", 0), (SEPARATE, 1)) if values.get(name) == flag}
    for name in ("decay_rate", "sample_rate_hz"):
        value = values.get(name)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 < value < math.inf:
            valid[name] = float(value)
    return valid


def _parse_json(line: str, form: str) -> Any:
    try:
        return json.loads(form.replace("{}", line.removeprefix(MARK)))
    except (ValueError, RecursionError):
        return None


_ABSCISSAE = {17: ("time", "s"), 18: ("frequency", "Hz")}
_UNIT_TOLERANCE = 1e-4
"""Largest relative difference of two statements of the same unit; labels are rounded."""


def _expect_abscissa(function: Function, kind: int) -> None:
    """Raise if the abscissa is not time in s (17) or frequency in Hz (18), as expected."""
    axis = function.axes[0]
    quantity, unit = _ABSCISSAE[kind]
    if axis.unit:
        try:
            declared = parse_unit(axis.unit)
        except UnitError as error:
            if axis.kind == kind:
                # Text that is not a unit; the data type is sufficient.
                return
            raise FileFormatError(f"the abscissa's unit: {error}") from None
        if declared != parse_unit(unit):
            raise FileFormatError(f"the abscissa is in {axis.unit!r}, expected {unit}")
    elif axis.kind != kind:
        raise FileFormatError(f"the abscissa's specific data type is {axis.kind}, expected {kind} ({quantity})")


def _declared_form(function: Function) -> Form | None:
    """Return the form by specific data type or axis label, or None."""
    numerator, denominator = function.axes[1:]
    if numerator.kind in QUANTITIES and numerator.kind not in MOTIONS:
        raise FileFormatError(f"the numerator of the FRF is {QUANTITIES[numerator.kind]}, expected a motion per load")
    if denominator.kind in MOTIONS:
        raise FileFormatError(
            f"the denominator of the FRF is {QUANTITIES[denominator.kind]}, expected a load: transmissibilities and "
            "dynamic stiffnesses are not read"
        )
    if numerator.kind in MOTIONS:
        return MOTIONS[numerator.kind]
    label = numerator.label.lower()
    return next((form for word, form in FORM_NAMES.items() if word in label), None)


def _directions(function: Function) -> tuple[str, str] | None:
    """Return the directions "y" or "theta" of response and reference, or None if one is not stated."""
    codes = function.response.direction, function.reference.direction
    if 0 in codes:
        return None
    return ("theta" if abs(codes[0]) > 3 else "y", "theta" if abs(codes[1]) > 3 else "y")


def _declared_unit(function: Function, form: Form | None, options: ReadOptions) -> Unit | None:
    """Return the unit by the axis labels or data set 164, which must agree, or None."""
    try:
        label = _label_unit(function)
    except UnitError as error:
        if options.unit is not None and (options.unit != SI or options.quantity is not None):
            return None
        raise FileFormatError(f"the axis label: {error}; give quantity= and unit=") from None
    if function.units is None:
        return label
    form, sides = options.quantity or form, _directions(function)
    if form is None or sides is None:
        if label is None and options.unit is None:
            raise FileFormatError(
                "data set 164 gives the units of length and force, but directions or specific data types are "
                "missing; give quantity= and unit="
            )
        return label
    kind = FRFKind(form, *sides)
    length, force = 1.0 / function.units.length, 1.0 / function.units.force
    factor = (length if sides[0] == "y" else 1.0) / (force if sides[1] == "y" else force * length)
    if (
        label is not None
        and options.unit is None
        and not np.isclose(label.factor, factor, rtol=_UNIT_TOLERANCE, atol=0.0)
    ):
        raise FileFormatError(
            f"the file contradicts itself: by its labels the unit is {label.text!r}, by data set 164 "
            f"({function.units.description}) it is {factor:.6g} {frf_unit(kind)}; find out which is correct "
            "and give unit="
        )
    if label is not None:
        return label
    return Unit(f"{frf_unit(kind)} times {factor:.6g}", factor, parse_unit(frf_unit(kind)).dimension)


def _label_unit(function: Function) -> Unit | None:
    numerator, denominator = function.axes[1:]
    if numerator.unit and denominator.unit:
        return parse_unit(f"({numerator.unit})/({denominator.unit})")
    unit = parse_unit(numerator.unit) if numerator.unit else None
    if unit is not None and denominator.kind in LOADS and channel_kind(unit) is not None:
        # The unit of the load is missing.
        return None
    return unit


def _channel_unit(function: Function, name: str, given: str | None) -> tuple[str, float, str]:
    """Return the unit of a time series, the factor of its numbers to this unit, and a note or an empty text.

    `given` is the unit in the options, or None.
    """
    axis = function.axes[1]
    quantity = QUANTITIES.get(axis.kind, "")
    if abs(function.response.direction) > 3:
        quantity = ROTATIONS.get(quantity, quantity)
    system = _system_factor(function, quantity)
    if given is not None:
        if given == SI and not quantity:
            raise FileFormatError(
                f"unit is 'SI', but the file does not state the quantity of channel {name!r}; give its unit"
            )
        unit = CHANNEL_UNITS[quantity] if given == SI else given
        stated = axis.unit or (f"{system:.6g} {CHANNEL_UNITS[quantity]}" if system is not None else "")
        return (
            unit,
            1.0,
            f"the unit in the file, {stated!r}, was overridden by {unit!r}" if stated not in ("", unit) else "",
        )
    if axis.unit:
        _check_label_unit(axis.unit, name, quantity, system)
        return axis.unit, 1.0, ""
    if system is not None:
        return CHANNEL_UNITS[quantity], system, ""
    raise FileFormatError(
        f"neither a data set 164 nor an axis label states the unit of channel {name!r}; give it, for example "
        f"unit={{{name!r}: 'N'}} (on the command line --unit '{name}=N')",
        option="unit",
    )


def _check_label_unit(text: str, name: str, quantity: str, system: float | None) -> None:
    try:
        unit = parse_unit(text)
    except UnitError:
        # Other units, such as volts and counts, are kept.
        return
    kind = channel_kind(unit)
    if quantity and (kind is None or kind[0] != quantity):
        raise FileFormatError(
            f"the file contradicts itself: channel {name!r} is declared as {quantity}, but its unit is {text!r}; "
            "give unit= for it"
        )
    if system is not None and not np.isclose(unit.factor, system, rtol=_UNIT_TOLERANCE, atol=0.0):
        raise FileFormatError(
            f"the file contradicts itself: by its label channel {name!r} is in {text!r}, by data set 164 in "
            f"{system:.6g} {CHANNEL_UNITS[quantity]}; find out which is correct and give unit= for it"
        )


def _system_factor(function: Function, quantity: str) -> float | None:
    """Return the factor to SI by data set 164, or None."""
    units = function.units
    if units is None or quantity not in CHANNEL_UNITS:
        return None
    if quantity in ("force", "moment"):
        return 1.0 / (units.force * (units.length if quantity == "moment" else 1.0))
    return 1.0 / units.length if quantity in ("displacement", "velocity", "acceleration") else 1.0
