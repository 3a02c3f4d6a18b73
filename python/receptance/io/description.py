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
from receptance.frf.data import PER_ENTRY, PER_LINE, WITHOUT_AXES
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
_KINDS: dict[str, type] = {"frf": FRF, "time series": TimeSeries, "coherence": Coherence}


def kind_of(measurement: Measurement) -> str:
    """Return "frf", "time series" or "coherence"."""
    return next(kind for kind, measurement_class in _KINDS.items() if isinstance(measurement, measurement_class))


def arrays_of(measurement: Measurement) -> dict[str, NDArray[Any]]:
    """Return the arrays of a measurement by name, without those that are None or have their default."""
    if isinstance(measurement, TimeSeries):
        return {"values": measurement.values}
    arrays: dict[str, NDArray[Any]] = {"frequency_hz": measurement.frequency_hz, "values": measurement.values}
    if isinstance(measurement, FRF):
        if measurement.coherence is not None:
            arrays["coherence"] = measurement.coherence
        for name in QUALITY:
            array = getattr(measurement, name)
            if array is not None and not (name == "correlated_lines" and np.all(array == 1.0)):
                arrays[name] = array
    return arrays


def about_text(measurement: Measurement, **more: int) -> str:
    """Return all fields but the arrays as JSON, with further numbers for a format."""
    about: dict[str, Any] = {"receptance": kind_of(measurement), "version": _VERSION, **more}
    if isinstance(measurement, FRF):
        about["unit"] = measurement.units
        about |= {name: getattr(measurement, name) for name in WITHOUT_AXES}
        for name in ("responses", "excitations"):
            about[name] = [coordinate_to_list(coordinate) for coordinate in about[name]]
    elif isinstance(measurement, TimeSeries):
        about["channels"] = measurement.channels
        about["units"] = measurement.units
        about["quantities"] = measurement.quantities
        about["sample_rate_hz"] = measurement.sample_rate_hz
        about["start_s"] = measurement.start_s
    else:
        about["shape"] = measurement.values.shape[1:]
        about["labels"] = measurement.labels
    about["label"], about["source"], about["notes"] = measurement.label, measurement.source, measurement.notes
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


def measurement_of(arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any], options: ReadOptions) -> Measurement:
    """Return the measurement with these arrays and fields; invalid or contradicting ones raise a FileFormatError."""
    kind = about["receptance"]
    try:
        if kind == "frf":
            return _frf(arrays, about, options)
        if kind == "time series":
            return _time_series(arrays, about, options)
        return Coherence(
            frequency_hz=_real(arrays, "frequency_hz").ravel(),
            values=_by_response_and_excitation(_real(arrays, "values"), about),
            labels=_labels(about),
            **_texts(about),
        )
    except FileFormatError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"the fields are not those of a valid {kind}: {error}") from None


def _frf(arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any], options: ReadOptions) -> FRF:
    lines = _real(arrays, "frequency_hz").ravel()
    sides = {name: tuple(map(coordinate_from_list, _list(about, name))) for name in ("responses", "excitations")}
    shape = (lines.size, len(sides["responses"]), len(sides["excitations"]))
    quality: dict[str, Any] = {}
    for name in ("coherence", *QUALITY):
        if name in arrays:
            array = arrays[name] if name == "usable" else _real(arrays, name)
            quality[name] = array.ravel() if name in ("usable", "correlated_lines") else _shaped(name, array, shape)
    if "usable" in quality:
        quality["usable"] = quality["usable"].astype(np.bool_)
    if options.ignore_coherence:
        quality.pop("coherence", None)
    values = arrays.get("values")
    if values is None or values.dtype.kind not in "iufc":
        raise FileFormatError("there is no numeric array 'values'")
    values, turned = options.turned(_shaped("values", values, shape))
    stated = {name: about[name] for name in WITHOUT_AXES if name in about} | _texts(about) | sides
    frf = make(
        FRF,
        **stated | quality | {"frequency_hz": lines, "values": values, "notes": (*stated["notes"], *turned)},
    )
    _check_options_agree(frf, options)
    if options.responses is None and options.excitations is None:
        return frf
    return frf.with_coordinates(options.responses, options.excitations)


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


def _time_series(arrays: Mapping[str, NDArray[Any]], about: Mapping[str, Any], options: ReadOptions) -> TimeSeries:
    channels = tuple(map(str, _list(about, "channels")))
    values = _real(arrays, "values")
    if values.ndim != 2 or values.shape[1] != len(channels):
        values = _shaped("values", values, (values.size // max(len(channels), 1), len(channels)))
    units = [str(unit) for unit in _list(about, "units")]
    for name, unit, given in zip(channels, units, options.channel_units(channels), strict=False):
        if given not in (None, SI, unit):
            raise FileFormatError(f"channel {name!r} of the file is in {unit!r}, but unit={given!r} was given")
    rate = about.get("sample_rate_hz", math.nan)
    if options.sample_rate_hz is not None and not math.isclose(options.sample_rate_hz, rate, rel_tol=1e-9):
        raise FileFormatError(
            f"the file has {rate!r} samples per second, but sample_rate_hz={options.sample_rate_hz!r} was given"
        )
    return TimeSeries(
        values=values,
        channels=channels,
        units=units,
        sample_rate_hz=rate,
        start_s=about.get("start_s", 0.0),
        **_texts(about),
    )


def _texts(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return label, source and notes."""
    return {
        "label": str(about.get("label", "")),
        "source": str(about.get("source", "")),
        "notes": tuple(map(str, _list(about, "notes"))),
    }


def _list(about: Mapping[str, Any], name: str) -> Sequence[Any]:
    value = about.get(name)
    if not isinstance(value, list):
        raise FileFormatError(f"{name} in {ABOUT!r} is {value!r}, expected a list")
    return value


def _labels(about: Mapping[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    labels = about.get("labels")
    if labels is None:
        return None
    if not (isinstance(labels, list) and len(labels) == 2 and all(isinstance(side, list) for side in labels)):
        raise FileFormatError(f"labels in {ABOUT!r} is {labels!r}, expected a list of two lists")
    return tuple(map(str, labels[0])), tuple(map(str, labels[1]))


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


def _real(arrays: Mapping[str, NDArray[Any]], name: str) -> NDArray[Any]:
    array = arrays.get(name)
    if array is None:
        raise FileFormatError(f"there is no array {name!r}; the arrays are {', '.join(arrays) or 'none'}")
    if array.dtype.kind not in "iuf":
        raise FileFormatError(f"the array {name!r} has dtype {array.dtype}, expected real numbers")
    return array


def _shaped(name: str, array: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Return an array in its full shape; MATLAB drops trailing dimensions of 1."""
    if array.size != math.prod(shape):
        raise FileFormatError(f"the array {name!r} has shape {array.shape}, expected {shape}")
    return array if array.shape == shape else array.reshape(shape)


def _by_response_and_excitation(array: NDArray[Any], about: Mapping[str, Any]) -> NDArray[Any]:
    counts = _list(about, "shape")
    if len(counts) != 2 or any(not isinstance(count, int) or count < 1 for count in counts):
        raise FileFormatError(f"shape in {ABOUT!r} is {counts!r}, expected the numbers of responses and excitations")
    return _shaped("values", array, (array.size // math.prod(counts), *counts))
