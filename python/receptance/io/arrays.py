"""Named arrays in files: several measurements of this library, or the variables of other programs."""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.frf import FRF
from receptance.io.build import (
    ReadOptions,
    complex_values,
    make,
    make_frf,
    missing_phase_notes,
    phase_notes,
    resolve_frf,
    to_si,
)
from receptance.io.column_names import TableColumn
from receptance.io.description import ABOUT, ARRAYS, about_text, arrays_of, kind_of, measurement_of, parse_about
from receptance.io.errors import FileFormatError, error_location
from receptance.io.measurements import Coherence, Measurement
from receptance.io.tables import measurements_in_rows

_FRF_KEYS = (
    "frequency_hz",
    "values",
    "real",
    "imaginary",
    "magnitude",
    "phase_deg",
    "phase_rad",
    "coherence",
)
_PARTS = ({"values"}, {"real", "imaginary"}, {"magnitude", "phase_deg"}, {"magnitude", "phase_rad"})
_COLUMN = re.compile(r"(?P<name>.+)\[:, ?(?P<column>[0-9]{1,9})\]")
"""A column of a two-dimensional array, counted from 0."""
_MAX_LISTED = 30


def named_items(measurements: Sequence[Measurement], *, separator: str, with_checksum: bool = True) -> dict[str, Any]:
    """Return the arrays and texts of measurements under names such as frf1.values and frf1.about.

    The checksum in `about` is that of its other fields and of names, types, shapes and numbers of the arrays.
    """
    items: dict[str, Any] = {}
    counts: dict[str, int] = {}
    for measurement in measurements:
        kind = kind_of(measurement).removesuffix(" series")
        counts[kind] = counts.get(kind, 0) + 1
        prefix = f"{kind}{counts[kind]}{separator}"
        arrays, about = arrays_of(measurement), about_text(measurement)
        if with_checksum:
            about = about_text(measurement, measurements=len(measurements))
            about = about_text(
                measurement, measurements=len(measurements), checksum=_checksum(json.loads(about), arrays)
            )
        items[prefix + ABOUT] = about
        items.update({prefix + name: array for name, array in arrays.items()})
    return items


def _checksum(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> int:
    """Return the CRC-32 of fields and of arrays of a measurement; arrays of other names are left out."""
    checksum = zlib.crc32(json.dumps(about, sort_keys=True).encode())
    for name in ARRAYS:
        if name in arrays:
            array = arrays[name].astype(arrays[name].dtype.newbyteorder("<"), copy=False)
            checksum = zlib.crc32(f"{name} {array.dtype.str} {array.shape}".encode(), checksum)
            checksum = zlib.crc32(array.tobytes(), checksum)
    return checksum


def _check_undamaged(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Raise if fields or arrays differ from the checksum, which files of other formats and earlier ones lack."""
    if "checksum" not in about:
        return
    checksum = _checksum({name: value for name, value in about.items() if name != "checksum"}, arrays)
    if checksum != about["checksum"]:
        raise FileFormatError(
            f"the checksum is {checksum}, but {ABOUT!r} states {about['checksum']!r}: the file was damaged or changed "
            f"after it was written; restore a copy, or, if the change is intended, remove the checksum from {ABOUT!r}"
        )


def measurements_of(
    items: Mapping[str, Any], options: ReadOptions, *, separator: str, listed: Mapping[str, str] | None = None
) -> list[Measurement]:
    """Return the measurements stored under `named_items`, else that of the variables in the options.

    `separator` is between the name of a measurement and those of its arrays. `listed` gives shape and type of all
    variables in the file, if not all are in `items`. Without a measurement the FileFormatError lists the variables and
    the options that identify them.
    """
    arrays = {name: array for name, array in items.items() if isinstance(array, np.ndarray)}
    measurements = _stored_measurements(items, arrays, options, separator) if options.variables is None else []
    if measurements:
        return measurements
    if listed is None:
        listed = {
            name: f"{'x'.join(map(str, array.shape)) or 'scalar'} {array.dtype}" for name, array in arrays.items()
        }
    return [_external(arrays, options, _listing(listed))]


def _stored_measurements(
    items: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]], options: ReadOptions, separator: str
) -> list[Measurement]:
    """Return the measurements written by this library: the arrays with the prefix of each description."""
    arrays_by_prefix: dict[str, dict[str, NDArray[Any]]] = {"": dict(arrays)}
    for name, array in arrays.items():
        prefix, _, field = name.rpartition(separator)
        if prefix:
            arrays_by_prefix.setdefault(prefix, {})[field] = array
    measurements: list[Measurement] = []
    count = 0
    for name, value in items.items():
        prefix, _, field = name.rpartition(separator)
        about = parse_about(value) if field == ABOUT else None
        if about is not None:
            with error_location(place=prefix or "the file"):
                _check_undamaged(about, arrays_by_prefix.get(prefix, {}))
                measurements.append(measurement_of(arrays_by_prefix.get(prefix, {}), about, options))
            stated = about.get("measurements")
            count = max(count, stated if isinstance(stated, int) else 0)
    if len(measurements) < count:
        raise FileFormatError(f"the file holds {len(measurements)} of {count} measurements: the others are damaged")
    return measurements


def requested_names(options: ReadOptions) -> list[str] | None:
    """Return the names of the arrays requested by the options, or None."""
    if options.variables is None:
        return None
    columns = {name: _COLUMN.fullmatch(name) for name in options.variables.values()}
    return list(
        dict.fromkeys(name for text, match in columns.items() for name in (text, match["name"] if match else text))
    )


def _external(arrays: Mapping[str, NDArray[Any]], options: ReadOptions, listing: str) -> Measurement:
    """Return the measurement in arrays of another program, by the option `variables` or by their names."""
    names = dict(options.variables) if options.variables is not None else {k: k for k in _FRF_KEYS if k in arrays}
    is_frf = "frequency_hz" in names and not {"values", "real", "magnitude", "coherence"}.isdisjoint(names)
    if is_frf and (unknown := sorted(names.keys() - set(_FRF_KEYS))):
        raise FileFormatError(f"variables names {unknown[0]!r}, expected some of {', '.join(_FRF_KEYS)} for an FRF")
    if options.variables is not None and options.sample_rate_hz is None and not is_frf and set(names) <= set(_FRF_KEYS):
        missing = "a value such as 'values'" if "frequency_hz" in names else "'frequency_hz', the axis,"
        raise FileFormatError(
            f"variables names {', '.join(map(repr, names))}, but not {missing} of the FRF; if one variable holds both, "
            "name its columns, counted from 0: variables={'frequency_hz': 'NAME[:,0]', 'values': 'NAME[:,1]'} (on the "
            f"command line --variable 'frequency_hz=NAME[:,0]'). The file holds {listing}"
        )
    if is_frf or (options.variables is not None and "frequency_hz" not in names):
        variables = {role: _variable(arrays, role, name, listing) for role, name in names.items()}
        return _external_frf(variables, names, options) if is_frf else _external_time_series(variables, names, options)
    raise FileFormatError(
        "this file was not written by receptance; name its variables and their unit. For an FRF: "
        "variables={'frequency_hz': ..., 'values': ..., 'coherence': ...} and unit='m/s^2/N', for example, with 'real' "
        "and 'imaginary', or 'magnitude' and 'phase_deg' or 'phase_rad', instead of 'values' if they are separate. For "
        "time series: variables={'time_s': ..., 'hammer': ..., 'tip': ...} and unit={'hammer': 'N', 'tip': 'm/s^2'}. "
        "'NAME[:,1]' is the second column of NAME. On the command line: --variable frequency_hz=NAME. The file holds "
        f"{listing}"
    )


def _listing(shapes: Mapping[str, str]) -> str:
    names = [f"{name} ({shape})" for name, shape in shapes.items()]
    more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
    return ", ".join(names[:_MAX_LISTED]) + more if names else "no arrays of numbers"


def _variable(arrays: Mapping[str, NDArray[Any]], role: str, name: str, listing: str) -> NDArray[Any]:
    array = arrays.get(name)
    column = _COLUMN.fullmatch(name)
    if array is None and column is not None and column["name"] in arrays:
        table = arrays[column["name"]]
        if table.ndim != 2 or int(column["column"]) >= table.shape[1]:
            raise FileFormatError(
                f"the variable {column['name']!r} for {role!r} has shape {table.shape} and no column "
                f"{column['column']}; columns are counted from 0"
            )
        array = table[:, int(column["column"])]
    if array is None:
        raise FileFormatError(f"there is no numeric variable {name!r} for {role!r}; the file holds {listing}")
    if role != "values" and array.dtype.kind == "c" and not np.any(array.imag):
        # A real axis in the same array as complex values is stored as complex.
        array = array.real
    kinds = "iufc" if role == "values" else "iuf"
    if array.dtype.kind not in kinds:
        raise FileFormatError(
            f"the variable {name!r} for {role!r} has dtype {array.dtype}, expected "
            f"{'complex' if role == 'values' else 'real'} numbers"
            + (f"; {name + '[:,0]'!r} is its first column" if array.ndim == 2 else "")
        )
    return array


def _external_frf(
    variables: dict[str, NDArray[Any]], names: Mapping[str, str], options: ReadOptions
) -> FRF | Coherence:
    """Return the FRF or coherence of variables by their role; `names` are those in the file."""
    lines = _one_column("frequency_hz", names["frequency_hz"], variables["frequency_hz"])
    parts = {
        role: _by_line(names[role], array, lines.size, options)
        for role, array in variables.items()
        if role != "frequency_hz"
    }
    coherence = parts.pop("coherence", None)
    if not parts:
        return make(Coherence, frequency_hz=lines, values=coherence if coherence is not None else [])
    if set(parts) not in _PARTS:
        raise FileFormatError(
            f"variables names {', '.join(variables)}, expected 'values', 'real' and 'imaginary', or 'magnitude' and "
            "'phase_deg' or 'phase_rad'"
        )
    notes: list[str] = []
    if "values" in parts:
        values = parts["values"]
    elif "real" in parts:
        values = complex_values(parts["real"], parts["imaginary"])
    else:
        phase = parts["phase_rad"] if "phase_rad" in parts else np.deg2rad(parts["phase_deg"])
        notes = phase_notes(phase, degrees="phase_deg" in parts)
        values = parts["magnitude"] * np.exp(1j * phase)
    resolved = resolve_frf(options, declared=None, form=None, directions=None)
    kind = resolved.kind
    return make_frf(
        frequency_hz=lines,
        values=to_si(values.astype(np.complex128), resolved.factor),
        form=kind.form,
        directions=([kind.response] * values.shape[1], [kind.excitation] * values.shape[2]),
        coherence=coherence,
        options=options,
        notes=[*notes, *missing_phase_notes(values), *resolved.notes],
    )


def _one_column(role: str, name: str, array: NDArray[Any]) -> NDArray[np.float64]:
    """Return an axis or a channel: an array with one dimension longer than 1."""
    if array.ndim and array.size != max(array.shape):
        raise FileFormatError(
            f"the variable {name!r} for {role!r} has shape {array.shape}, expected one column; "
            + (
                f"name the column, counted from 0, for example "
                f"{name + ('[:,0]' if role in ('frequency_hz', 'time_s') else '[:,1]')!r}"
                if array.ndim == 2
                else "select it first"
            )
        )
    return array.astype(np.float64).ravel()


def _by_line(name: str, array: NDArray[Any], n: int, options: ReadOptions) -> NDArray[Any]:
    """Return an array as `(n, n_responses, n_excitations)`."""
    squeezed = array.squeeze() if array.ndim > 1 else array
    if squeezed.ndim == 0:
        squeezed = squeezed.reshape(1)
    if array.ndim == 3 and array.shape[0] == n:
        squeezed = array
    if squeezed.shape[0] != n or squeezed.ndim > 3:
        raise FileFormatError(
            f"the variable {name!r} has shape {array.shape} for {n} frequency lines, expected ({n},) or "
            f"({n}, responses, excitations)"
        )
    if squeezed.ndim == 2:
        count = squeezed.shape[1]
        responses, excitations = (len(side or ()) for side in (options.responses, options.excitations))
        if responses == count and excitations <= 1:
            return squeezed[:, :, None]
        if excitations == count and responses <= 1:
            return squeezed[:, None, :]
        raise FileFormatError(
            f"the variable {name!r} has shape {array.shape}, and its columns may be responses or excitations; select "
            f"one column, counted from 0, for example {name + ('[:,1]' if count == 2 else '[:,0]')!r}, or give {count} "
            "responses= or excitations="
        )
    return squeezed if squeezed.ndim == 3 else squeezed[:, None, None]


def _external_time_series(
    variables: dict[str, NDArray[Any]], names: Mapping[str, str], options: ReadOptions
) -> Measurement:
    """Return the time series of variables by channel; `names` are those in the file."""
    channels = {name: _one_column(name, names[name], array) for name, array in variables.items()}
    seconds = channels.pop("time_s", None)
    if not channels:
        raise FileFormatError("variables names no channel beside 'time_s'")
    axis = {} if seconds is None else {"time_s": seconds}
    sizes = {name: column.size for name, column in (axis | channels).items()}
    if len(set(sizes.values())) > 1 or 0 in sizes.values():
        raise FileFormatError(f"the channels and their times have different numbers of samples, or none: {sizes}")
    columns = [TableColumn("time_s", "s", "time")] * len(axis) + [TableColumn(c, None, "channel") for c in channels]
    (series,) = measurements_in_rows(columns, list((axis | channels).values()), options)
    return series
