"""Files of named arrays: how several measurements share one, and which arrays of other programs are what."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.frf import FRF
from receptance.io.build import in_si, joined, make_frf, sampled, without_phase
from receptance.io.coherence import Coherence
from receptance.io.errors import FileFormatError
from receptance.io.fields import ABOUT, about_text, arrays_of, kind_of, parse_about, thing_of
from receptance.io.options import SI, ReadOptions, resolve_frf, several_channels
from receptance.io.time_series import TimeSeries

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["items_of", "things_of", "wanted_names"]

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
_MOST_LISTED = 30


def items_of(things: Sequence[FRF | TimeSeries | Coherence], *, separator: str) -> dict[str, Any]:
    """Return the arrays and texts of measurements under names such as frf1.values and frf1.about."""
    items: dict[str, Any] = {}
    counts: dict[str, int] = {}
    for thing in things:
        prefix = _PREFIXES[kind_of(thing)]
        counts[prefix] = counts.get(prefix, 0) + 1
        owner = f"{prefix}{counts[prefix]}{separator}"
        items[owner + ABOUT] = about_text(thing)
        items.update({owner + name: array for name, array in arrays_of(thing).items()})
    return items


def things_of(
    items: Mapping[str, Any], options: ReadOptions, *, separator: str, listed: Mapping[str, str] | None = None
) -> list[FRF | TimeSeries | Coherence]:
    """Return the measurements under such names, else what the `variables` that were given make of the arrays.

    Parameters
    ----------
    items : mapping
        Arrays and texts by name.
    options : ReadOptions
        What was given.
    separator : str
        Between the name of a measurement and those of its arrays.
    listed : mapping, optional
        Shape and type of all that is in the file, where not all of it is in `items`.

    Raises
    ------
    FileFormatError
        Nothing that is a measurement; the message lists what is there and how to say what it is.
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
                try:
                    found.append(thing_of(owned.get(owner, {}), about, options))
                except FileFormatError as error:
                    raise FileFormatError(error.problem, place=owner or "the file") from None
        if found:
            return found
    arrays = {name: array for name, array in items.items() if isinstance(array, np.ndarray)}
    try:
        return [_foreign(arrays, options)]
    except _MissingError as error:
        shapes = {
            name: f"{'x'.join(map(str, array.shape)) or 'scalar'} {array.dtype}" for name, array in arrays.items()
        }
        raise FileFormatError(f"{error}{_listed(listed if listed is not None else shapes)}") from None


def _owners(name: str, separator: str) -> list[str]:
    """Return the measurement that an array belongs to by its name, and the file as a whole."""
    owner = name.rpartition(separator)[0]
    return ["", owner] if owner else [""]


def wanted_names(options: ReadOptions) -> list[str] | None:
    """Return the names of the arrays that the options ask for, None where they name none."""
    if options.variables is None:
        return None
    columns = {name: _COLUMN.fullmatch(name) for name in options.variables.values()}
    return list(
        dict.fromkeys(name for text, match in columns.items() for name in (text, match["name"] if match else text))
    )


class _MissingError(Exception):
    """Something that is not there: what is there follows."""


def _foreign(arrays: Mapping[str, NDArray[Any]], options: ReadOptions) -> FRF | TimeSeries | Coherence:
    """Return what arrays of another program are, as `variables` says; names as this library's own say it themselves."""
    chosen = dict(options.variables) if options.variables is not None else {k: k for k in _FRF_KEYS if k in arrays}
    if "frequency_hz" in chosen and {"values", "real", "magnitude", "coherence"} & set(chosen):
        return _foreign_frf(arrays, chosen, options)
    if options.variables is not None and "frequency_hz" not in chosen:
        return _foreign_time_series(arrays, chosen, options)
    raise _MissingError(
        "this file was not written by receptance, so it has to be said which of its variables is what, and in which "
        "unit: variables={'frequency_hz': ..., 'values': ..., 'coherence': ...} with unit='m/s^2/N', say, for an FRF "
        "('real' and 'imaginary', or 'magnitude' and 'phase_deg' or 'phase_rad', instead of 'values' where they are "
        "apart), variables={'time_s': ..., 'hammer': ..., 'tip': ...} with unit={'hammer': 'N', 'tip': 'm/s^2'} for "
        "time records; 'NAME[:,1]' is the second column of NAME; on the command line --variable frequency_hz=NAME and "
        "so on. It holds "
    )


def _listed(shapes: Mapping[str, str]) -> str:
    names = [f"{name} ({shape})" for name, shape in shapes.items()]
    more = f" and {len(names) - _MOST_LISTED} more" if len(names) > _MOST_LISTED else ""
    return ", ".join(names[:_MOST_LISTED]) + more if names else "no arrays of numbers"


def _get(arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], role: str) -> NDArray[Any]:
    array = arrays.get(chosen[role])
    column = _COLUMN.fullmatch(chosen[role])
    if array is None and column is not None and column["name"] in arrays:
        whole = arrays[column["name"]]
        if whole.ndim != 2 or int(column["column"]) >= whole.shape[1]:
            raise FileFormatError(
                f"the variable {column['name']!r} for {role!r} has shape {whole.shape}, so there is no column "
                f"{column['column']} in it; columns are counted from 0"
            )
        array = whole[:, int(column["column"])]
    if array is None:
        raise _MissingError(f"there are no numbers named {chosen[role]!r} for {role!r}; the file holds ")
    if role != "values" and array.dtype.kind == "c" and not np.any(array.imag):
        # An axis beside complex values in one array is complex as well.
        array = array.real
    kinds = "iufc" if role == "values" else "iuf"
    if array.dtype.kind not in kinds:
        raise FileFormatError(
            f"the variable {chosen[role]!r} for {role!r} is of {array.dtype}, expected "
            f"{'complex' if role == 'values' else 'real'} numbers"
            + (f"; {chosen[role] + '[:,0]'!r} is its first column" if array.ndim == 2 else "")
        )
    return array


def _foreign_frf(
    arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], options: ReadOptions
) -> FRF | Coherence:
    unknown = sorted(set(chosen) - set(_FRF_KEYS))
    if unknown:
        raise FileFormatError(f"variables names {unknown[0]!r}, expected some of {', '.join(_FRF_KEYS)} for an FRF")
    lines = _one_column(arrays, chosen, "frequency_hz")
    parts: dict[str, NDArray[Any]] = {}
    for role in chosen:
        if role != "frequency_hz":
            parts[role] = _by_line(_get(arrays, chosen, role), lines.size, chosen[role], options)
    coherence = parts.pop("coherence", None)
    if not parts:
        return Coherence(frequency_hz=lines, values=coherence if coherence is not None else [])
    if set(parts) not in _PARTS:
        raise FileFormatError(
            f"variables names {', '.join(chosen)}, expected 'values', 'real' and 'imaginary', or 'magnitude' and "
            "'phase_deg' or 'phase_rad'"
        )
    if "values" in parts:
        values = parts["values"]
    elif "real" in parts:
        values = joined(parts["real"], parts["imaginary"])
    else:
        phase = parts["phase_rad"] if "phase_rad" in parts else np.deg2rad(parts["phase_deg"])
        values = parts["magnitude"] * np.exp(1j * phase)
    resolved = resolve_frf(options, declared=None, form=None, directions=None)
    notes = without_phase(values)
    kind = resolved.kind
    return make_frf(
        frequency_hz=lines,
        values=in_si(values.astype(np.complex128), resolved.factor),
        form=kind.form,
        directions=([kind.response] * values.shape[1], [kind.excitation] * values.shape[2]),
        coherence=coherence,
        options=options,
        notes=[*notes, *resolved.notes],
    )


def _one_column(arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], role: str) -> NDArray[np.float64]:
    """Return an axis or a time record: an array that has one dimension, or of which all others are one."""
    array = _get(arrays, chosen, role)
    if array.ndim and array.size != max(array.shape):
        name = chosen[role]
        raise FileFormatError(
            f"the variable {name!r} for {role!r} has shape {array.shape}, expected one column; "
            + (f"name the column, counted from 0: {name + '[:,1]'!r}, say" if array.ndim == 2 else "select it first")
        )
    return array.astype(np.float64).ravel()


def _by_line(array: NDArray[Any], n: int, name: str, options: ReadOptions) -> NDArray[Any]:
    """Return an array as (n, responses, excitations)."""
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
            f"the variable {name!r} has shape {array.shape}: whether its columns are responses or excitations is not "
            f"said; select one column, counted from 0: {name + '[:,0]'!r}, say, or give the {count} responses= or "
            f"excitations= that the columns are"
        )
    return squeezed if squeezed.ndim == 3 else squeezed[:, None, None]


def _foreign_time_series(
    arrays: Mapping[str, NDArray[Any]], chosen: Mapping[str, str], options: ReadOptions
) -> TimeSeries:
    names = [name for name in chosen if name != "time_s"]
    if not names:
        raise FileFormatError("variables names no channel, expected the time records beside 'time_s'")
    columns = {name: _one_column(arrays, chosen, name) for name in names}
    sizes = {name: column.size for name, column in columns.items()}
    if len(set(sizes.values())) > 1:
        raise FileFormatError(f"the channels have different numbers of samples: {sizes}")
    if isinstance(options.unit, str) and len(names) > 1:
        raise FileFormatError(several_channels(names, options.unit))
    units = []
    for name in names:
        unit = options.channel_unit(name)
        if unit is None or unit == SI:
            raise FileFormatError(
                f"it is not said in which unit channel {name!r} is; give it: unit={{{name!r}: 'N'}}, say"
            )
        units.append(unit)
    if "time_s" in chosen:
        seconds = _one_column(arrays, chosen, "time_s")
        if seconds.size != next(iter(sizes.values())):
            raise FileFormatError(f"there are {seconds.size} times for {next(iter(sizes.values()))} samples")
        if seconds.size == 0 or not np.all(np.isfinite(seconds)):
            raise FileFormatError("the times are not finite numbers")
        rate, start = sampled(seconds, options)
    elif options.sample_rate_hz is not None:
        rate, start = options.sample_rate_hz, 0.0
    else:
        raise FileFormatError("the sample rate is not said; give 'time_s' in variables=, or sample_rate_hz=")
    return TimeSeries(
        values=np.stack(list(columns.values()), axis=1), channels=names, units=units, sample_rate_hz=rate, start_s=start
    )
