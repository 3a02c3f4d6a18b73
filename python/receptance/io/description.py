"""A measurement as named arrays and one JSON text, `about`, with all other fields.

NPZ, MAT and HDF5 files store both as variables, CSV files as columns and a comment; universal files use the JSON form
of coordinates.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.frf import FRF
from receptance.frf.data import PER_ENTRY, PER_LINE
from receptance.io.build import SI, ReadOptions, make
from receptance.io.errors import FileFormatError
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.model.coordinates import Coordinate, UnknownPosition
from receptance.units import parse_unit

ABOUT = "about"
QUALITY = tuple(name for name in (*PER_ENTRY, *PER_LINE) if name not in ("frequency_hz", "values", "coherence"))
"""Fields of an FRF, beside its coherence, that are stored as arrays."""
ARRAYS = ("frequency_hz", "values", "coherence", *QUALITY)
_VERSION = 1
_KINDS: dict[str, type[Measurement]] = {"frf": FRF, "time series": TimeSeries, "coherence": Coherence}


def kind_of(measurement: Measurement) -> str:
    """Return "frf", "time series" or "coherence"."""
    return next(kind for kind, measurement_class in _KINDS.items() if isinstance(measurement, measurement_class))


def arrays_of(measurement: Measurement) -> dict[str, NDArray[Any]]:
    """Return the arrays of a measurement by name, without those that are None or have their default."""
    arrays = {name: (getattr(measurement, name), field) for name, field in measurement.declared.items() if field.axes}
    return {
        name: array
        for name, (array, field) in arrays.items()
        if array is not None and not (isinstance(field.default, float) and np.all(array == field.default))
    }


def about_text(measurement: Measurement, **more: int) -> str:
    """Return all fields but the arrays as JSON, with further numbers for a format."""
    about: dict[str, Any] = {"receptance": kind_of(measurement), "version": _VERSION, **more}
    about |= {name: getattr(measurement, name) for name, field in measurement.declared.items() if not field.axes}
    if isinstance(measurement, FRF):
        about["unit"] = measurement.units
        for side in ("responses", "excitations"):
            about[side] = [coordinate_to_list(coordinate) for coordinate in about[side]]
    elif isinstance(measurement, TimeSeries):
        about["quantities"] = measurement.quantities
    else:
        about["shape"] = measurement.values.shape[1:]
    return json.dumps(about, allow_nan=False)


def coordinate_to_list(coordinate: Coordinate) -> list[Any]:
    """Return a coordinate for JSON: part, position (None if unknown) and direction."""
    position = None if isinstance(coordinate, UnknownPosition) else coordinate.position
    return [coordinate.part, position, coordinate.direction]


def parse_about(text: Any) -> dict[str, Any] | None:
    """Return the fields written by `about_text`, None for another text; damaged ones and later versions raise."""
    if not isinstance(text, str) or not text.lstrip().startswith('{"receptance"'):
        return None
    try:
        about: dict[str, Any] = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"the JSON text {ABOUT!r} is damaged: {error}") from None
    if about.get("receptance") not in list(_KINDS):
        raise FileFormatError(
            f"{ABOUT!r} names the kind {about.get('receptance')!r}, expected one of {', '.join(_KINDS)}"
        )
    if about.get("version") != _VERSION:
        raise FileFormatError(
            f"{ABOUT!r} has version {about.get('version')!r}, expected {_VERSION}: written by a later version"
        )
    return about


def measurement_of(
    arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any], options: ReadOptions, rows: Sequence[int] = ()
) -> Measurement:
    """Return the measurement with these arrays and fields; invalid or contradicting ones raise a FileFormatError.

    The `rows` are the lines of a text with the rows of the arrays.
    """
    name = about["receptance"]
    try:
        fields = _fields(_KINDS[name], arrays, about)
        if name == "frf":
            return _frf(fields, options, rows)
        if name == "time series":
            _check_channels_agree(fields, options)
        return make(_KINDS[name], rows=rows, **fields)
    except FileFormatError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"the fields are not those of a valid {name}: {error}") from None


def _fields(kind: type[Measurement], arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a measurement, with arrays in their full shape; MATLAB drops trailing dimensions of 1."""
    fields = {name: about[name] for name, field in kind.declared.items() if not field.axes and name in about}
    if kind is FRF:
        for side in ("responses", "excitations"):
            fields[side] = tuple(map(coordinate_from_list, _list(about, side)))
        counts = [len(fields["responses"]), len(fields["excitations"])]
    else:
        counts = [len(_list(about, "channels"))] if kind is TimeSeries else list(_list(about, "shape"))
    for name, field in kind.declared.items():
        if name in arrays and field.axes:
            array = arrays[name].astype(np.bool_) if name == "usable" else arrays[name]
            if field.axes != "lines" and array.size % max(math.prod(counts), 1):
                raise FileFormatError(f"the array {name!r} has shape {array.shape}, expected {(-1, *counts)}")
            fields[name] = array.ravel() if field.axes == "lines" else array.reshape(-1, *counts)
        elif field.axes and field.default is ...:
            raise FileFormatError(f"there is no array {name!r}; the arrays are {', '.join(arrays) or 'none'}")
    return fields


def _frf(fields: dict[str, Any], options: ReadOptions, rows: Sequence[int]) -> FRF:
    fields["values"], turned = options.turned(fields["values"])
    fields["notes"] = [*fields.get("notes", ()), *turned]
    if options.ignore_coherence:
        fields.pop("coherence", None)
    frf = make(FRF, rows=rows, **fields)
    _check_options_agree(frf, options)
    sides = {"responses": options.responses, "excitations": options.excitations}
    return frf.with_(**{name: side for name, side in sides.items() if side is not None})


def _check_options_agree(frf: FRF, options: ReadOptions) -> None:
    """Raise if the given unit or quantity contradicts the file."""
    given = parse_unit(options.unit) if isinstance(options.unit, str) and options.unit != SI else None
    wrong = [f"the quantity {options.quantity}"] if options.quantity not in (None, frf.form) else []
    if given is not None and any(parse_unit(unit) != given for unit in frf.distinct_units):
        wrong.append(f"the unit {options.unit}")
    if wrong:
        raise FileFormatError(
            f"the file states that it holds {frf.form} in {', '.join(frf.distinct_units)}, but {' and '.join(wrong)} "
            f"{'was' if len(wrong) == 1 else 'were'} given; leave {'it' if len(wrong) == 1 else 'them'} out"
        )


def _check_channels_agree(fields: Mapping[str, Any], options: ReadOptions) -> None:
    """Raise if the given unit of a channel, or the sample rate, contradicts the file."""
    channels, units = fields["channels"], fields.get("units", ())
    for name, unit, given in zip(channels, units, options.channel_units(channels), strict=False):
        if given not in (None, SI, unit):
            raise FileFormatError(f"channel {name!r} of the file is in {unit!r}, but unit={given!r} was given")
    rate = fields.get("sample_rate_hz", math.nan)
    if options.sample_rate_hz is not None and not math.isclose(options.sample_rate_hz, rate, rel_tol=1e-9):
        raise FileFormatError(
            f"the file has {rate!r} samples per second, but sample_rate_hz={options.sample_rate_hz!r} was given"
        )


def _list(about: Mapping[str, Any], name: str) -> Sequence[Any]:
    value = about.get(name)
    if not isinstance(value, list):
        raise FileFormatError(f"{name} in {ABOUT!r} is {value!r}, expected a list")
    return value


def coordinate_from_list(fields: Any) -> Coordinate:
    """Return the coordinate of `coordinate_to_list`, or raise a FileFormatError."""
    if not (isinstance(fields, list) and len(fields) == 3 and isinstance(fields[0], str)):
        raise FileFormatError(f"a coordinate in {ABOUT!r} is {fields!r}, expected [part, position, direction]")
    part, position, direction = fields
    if position is None and direction in ("y", "theta"):
        return UnknownPosition(direction)
    is_number = isinstance(position, (int, float)) and not isinstance(position, bool)
    if position != "end" and not (is_number and math.isfinite(position)):
        raise FileFormatError(f"a coordinate's position in {ABOUT!r} is {position!r}, expected metres or 'end'")
    return Coordinate(part, position, direction)
