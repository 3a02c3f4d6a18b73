"""Files of named arrays: several measurements of this library, or the variables of other programs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.frf import FRF
from receptance.io.build import complex_values, make, make_frf, missing_phase_notes, sampling, to_si
from receptance.io.description import ABOUT, about_text, arrays_of, kind_of, measurement_of, parse_about
from receptance.io.errors import FileFormatError, placed
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.io.options import SI, ReadOptions, resolve_frf

__all__ = ["measurements_of", "named_items", "requested_names"]

_PREFIXES = {"frf": "frf", "time series": "time", "coherence": "coherence"}
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


def named_items(measurements: Sequence[Measurement], *, separator: str) -> dict[str, Any]:
    """Return the arrays and texts of measurements under names such as frf1.values and frf1.about."""
    items: dict[str, Any] = {}
    counts: dict[str, int] = {}
    for measurement in measurements:
        prefix = _PREFIXES[kind_of(measurement)]
        counts[prefix] = counts.get(prefix, 0) + 1
        owner = f"{prefix}{counts[prefix]}{separator}"
        items[owner + ABOUT] = about_text(measurement)
        items.update({owner + name: array for name, array in arrays_of(measurement).items()})
    return items


def measurements_of(
    items: Mapping[str, Any], options: ReadOptions, *, separator: str, listed: Mapping[str, str] | None = None
) -> list[Measurement]:
    """Return the measurements stored under `named_items`, else that of the variables in the options.

    Parameters
    ----------
    items : mapping
        Arrays and texts by name.
    options : ReadOptions
        Options of `read`.
    separator : str
        Separator between the name of a measurement and the names of its arrays.
    listed : mapping, optional
        Shape and type of all variables in the file, if not all of them are in `items`.

    Raises
    ------
    FileFormatError
        No measurement; the message lists the variables and the options that identify them.
    """
    if options.variables is None:
        found = []
        owned: dict[str, dict[str, NDArray[Any]]] = {}
        for name, value in items.items():
            if isinstance(value, np.ndarray):
                for owner in _owners(name, separator):
                    owned.setdefault(owner, {})[name[len(owner) :].removeprefix(separator)] = value
        for name, value in items.items():
            owner, _, last = name.rpartition(separator)
            about = parse_about(value) if last == ABOUT else None
            if about is not None:
                with placed(place=owner or "the file"):
                    found.append(measurement_of(owned.get(owner, {}), about, options))
        if found:
            return found
    arrays = {name: array for name, array in items.items() if isinstance(array, np.ndarray)}
    try:
        return [_external(arrays, options)]
    except _MissingError as error:
        shapes = {
            name: f"{'x'.join(map(str, array.shape)) or 'scalar'} {array.dtype}" for name, array in arrays.items()
        }
        raise FileFormatError(f"{error}{_listing(listed if listed is not None else shapes)}") from None


def _owners(name: str, separator: str) -> list[str]:
    """Return the prefixes under which an array may belong to a measurement: none, and that of its name."""
    owner = name.rpartition(separator)[0]
    return ["", owner] if owner else [""]


def requested_names(options: ReadOptions) -> list[str] | None:
    """Return the names of the arrays requested by the options, or None."""
    if options.variables is None:
        return None
    columns = {name: _COLUMN.fullmatch(name) for name in options.variables.values()}
    return list(
        dict.fromkeys(name for text, match in columns.items() for name in (text, match["name"] if match else text))
    )


class _MissingError(Exception):
    """A missing variable; the list of the existing ones is appended to the message."""


def _external(arrays: Mapping[str, NDArray[Any]], options: ReadOptions) -> Measurement:
    """Return the measurement in arrays of another program, by the option `variables` or by their names."""
    chosen = dict(options.variables) if options.variables is not None else {k: k for k in _FRF_KEYS if k in arrays}
    if "frequency_hz" in chosen and {"values", "real", "magnitude", "coherence"} & set(chosen):
        return _external_frf(arrays, chosen, options)
    if options.variables is not None and "frequency_hz" not in chosen:
        return _external_time_series(arrays, chosen, options)
    raise _MissingError(
        "this file was not written by receptance; name its variables and their unit. For an FRF: "
        "variables={'frequency_hz': ..., 'values': ..., 'coherence': ...} and unit='m/s^2/N', for example, with 'real' "
        "and 'imaginary', or 'magnitude' and 'phase_deg' or 'phase_rad', instead of 'values' if they are separate. For "
        "time series: variables={'time_s': ..., 'hammer': ..., 'tip': ...} and unit={'hammer': 'N', 'tip': 'm/s^2'}. "
        "'NAME[:,1]' is the second column of NAME. On the command line: --variable frequency_hz=NAME. The file holds "
    )


def _listing(shapes: Mapping[str, str]) -> str:
    names = [f"{name} ({shape})" for name, shape in shapes.items()]
    more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
    return ", ".join(names[:_MAX_LISTED]) + more if names else "no arrays of numbers"


def _variable(arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], role: str) -> NDArray[Any]:
    array = arrays.get(chosen[role])
    column = _COLUMN.fullmatch(chosen[role])
    if array is None and column is not None and column["name"] in arrays:
        whole = arrays[column["name"]]
        if whole.ndim != 2 or int(column["column"]) >= whole.shape[1]:
            raise FileFormatError(
                f"the variable {column['name']!r} for {role!r} has shape {whole.shape} and no column "
                f"{column['column']}; columns are counted from 0"
            )
        array = whole[:, int(column["column"])]
    if array is None:
        raise _MissingError(f"there is no numeric variable {chosen[role]!r} for {role!r}; the file holds ")
    if role != "values" and array.dtype.kind == "c" and not np.any(array.imag):
        # A real axis stored in one array with complex values is complex as well.
        array = array.real
    kinds = "iufc" if role == "values" else "iuf"
    if array.dtype.kind not in kinds:
        raise FileFormatError(
            f"the variable {chosen[role]!r} for {role!r} has dtype {array.dtype}, expected "
            f"{'complex' if role == 'values' else 'real'} numbers"
            + (f"; {chosen[role] + '[:,0]'!r} is its first column" if array.ndim == 2 else "")
        )
    return array


def _external_frf(
    arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], options: ReadOptions
) -> FRF | Coherence:
    unknown = sorted(set(chosen) - set(_FRF_KEYS))
    if unknown:
        raise FileFormatError(f"variables names {unknown[0]!r}, expected some of {', '.join(_FRF_KEYS)} for an FRF")
    lines = _one_column(arrays, chosen, "frequency_hz")
    parts: dict[str, NDArray[Any]] = {}
    for role in chosen:
        if role != "frequency_hz":
            parts[role] = _by_line(_variable(arrays, chosen, role), lines.size, chosen[role], options)
    coherence = parts.pop("coherence", None)
    if not parts:
        return make(Coherence, frequency_hz=lines, values=coherence if coherence is not None else [])
    if set(parts) not in _PARTS:
        raise FileFormatError(
            f"variables names {', '.join(chosen)}, expected 'values', 'real' and 'imaginary', or 'magnitude' and "
            "'phase_deg' or 'phase_rad'"
        )
    if "values" in parts:
        values = parts["values"]
    elif "real" in parts:
        values = complex_values(parts["real"], parts["imaginary"])
    else:
        phase = parts["phase_rad"] if "phase_rad" in parts else np.deg2rad(parts["phase_deg"])
        values = parts["magnitude"] * np.exp(1j * phase)
    resolved = resolve_frf(options, declared=None, form=None, directions=None)
    notes = missing_phase_notes(values)
    kind = resolved.kind
    return make_frf(
        frequency_hz=lines,
        values=to_si(values.astype(np.complex128), resolved.factor),
        form=kind.form,
        directions=([kind.response] * values.shape[1], [kind.excitation] * values.shape[2]),
        coherence=coherence,
        options=options,
        notes=[*notes, *resolved.notes],
    )


def _one_column(arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], role: str) -> NDArray[np.float64]:
    """Return an axis or a channel: an array with one dimension longer than 1."""
    array = _variable(arrays, chosen, role)
    if array.ndim and array.size != max(array.shape):
        name = chosen[role]
        raise FileFormatError(
            f"the variable {name!r} for {role!r} has shape {array.shape}, expected one column; "
            + (
                f"name the column, counted from 0, for example {name + '[:,1]'!r}"
                if array.ndim == 2
                else "select it first"
            )
        )
    return array.astype(np.float64).ravel()


def _by_line(array: NDArray[Any], n: int, name: str, options: ReadOptions) -> NDArray[Any]:
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
            f"one column, counted from 0, for example {name + '[:,0]'!r}, or give {count} responses= or excitations="
        )
    return squeezed if squeezed.ndim == 3 else squeezed[:, None, None]


def _external_time_series(
    arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], options: ReadOptions
) -> TimeSeries:
    names = [name for name in chosen if name != "time_s"]
    if not names:
        raise FileFormatError("variables names no channel beside 'time_s'")
    columns = {name: _one_column(arrays, chosen, name) for name in names}
    sizes = {name: column.size for name, column in columns.items()}
    if len(set(sizes.values())) > 1:
        raise FileFormatError(f"the channels have different numbers of samples: {sizes}")
    units = options.channel_units(names)
    for name, unit in zip(names, units, strict=True):
        if unit is None or unit == SI:
            raise FileFormatError(
                f"the unit of channel {name!r} is unknown; give it, for example unit={{{name!r}: 'N'}}"
            )
    if "time_s" in chosen:
        seconds = _one_column(arrays, chosen, "time_s")
        if seconds.size != next(iter(sizes.values())):
            raise FileFormatError(f"there are {seconds.size} times for {next(iter(sizes.values()))} samples")
        if seconds.size == 0 or not np.all(np.isfinite(seconds)):
            raise FileFormatError("the times are not finite numbers")
        rate, start = sampling(seconds, options)
    elif options.sample_rate_hz is not None:
        rate, start = options.sample_rate_hz, 0.0
    else:
        raise FileFormatError("the sample rate is unknown; give 'time_s' in variables=, or sample_rate_hz=")
    values = np.stack(list(columns.values()), axis=1)
    return make(TimeSeries, values=values, channels=names, units=units, sample_rate_hz=rate, start_s=start)
