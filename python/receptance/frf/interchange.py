"""FRFs as arrays of other programs, xarray data sets and pandas tables, and back."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance.errors import require
from receptance.frf.data import PER_ENTRY, PER_LINE, WITHOUT_AXES, FRFData
from receptance.model.coordinates import Coordinate, UnknownPosition

if TYPE_CHECKING:
    import pandas
    import xarray


Order: TypeAlias = Literal["lines first", "lines last"]
"""Lines, responses, excitations (here and in pyFBS), or responses, excitations, lines (pyFRF, sdypy)."""
FREQUENCY, RESPONSE, EXCITATION = _DIMENSIONS = ("frequency_hz", "response", "excitation")
"""Dimensions of the data set."""
_ARRAYS = [name for name in (*PER_ENTRY, *PER_LINE) if name not in ("values", FREQUENCY)]
"""Fields that are variables of the data set under their own name."""
_LONG_NAMES = {
    "log_variance": "variance of the real and of the imaginary part of the logarithm",
    "degrees_of_freedom": "degrees of freedom of the variance",
}


def _check(order: str) -> None:
    if order not in get_args(Order):
        raise ValueError(f"order is {order!r}, expected one of {', '.join(map(repr, get_args(Order)))}")


def ordered(values: NDArray[np.complex128], order: Order) -> NDArray[np.complex128]:
    """Return values `(n, n_responses, n_excitations)` in the order of another program."""
    _check(order)
    return values.copy() if order == "lines first" else np.ascontiguousarray(np.moveaxis(values, 0, 2))


def reordered(values: ArrayLike, order: Order) -> NDArray[Any]:
    """Return values of another program with the lines first; one or two axes are lines, and responses and lines."""
    _check(order)
    found = np.asarray(values)
    if order == "lines first" or found.ndim == 1:
        return found[:, :, None] if found.ndim == 2 else found
    if found.ndim == 2:  # responses and lines
        return found.T[:, :, None]
    return np.moveaxis(found, -1, 0)


def dataset(frf: FRFData) -> xarray.Dataset:
    """Return the FRF as an xarray data set; see `FRF.to_xarray`."""
    require("sweep", "FRF.to_xarray", "xarray")
    import xarray  # slow to import

    arrays: dict[str, Any] = {"frf": (_DIMENSIONS, frf.values, {"long_name": frf.form})}
    if len(frf.distinct_units) == 1:
        arrays["frf"][2]["units"] = frf.unit
    for name in _ARRAYS:
        if getattr(frf, name) is not None:
            axes = _DIMENSIONS if name in PER_ENTRY else FREQUENCY
            attributes = {"long_name": _LONG_NAMES.get(name, name.replace("_", " ")), "units": "1"}
            arrays[name] = (axes, getattr(frf, name), attributes)
    coordinates: dict[str, Any] = {
        FREQUENCY: (FREQUENCY, frf.frequency_hz, {"long_name": "frequency", "units": "Hz"}),
        "unit": (_DIMENSIONS[1:], np.array(frf.units)),
    }
    names = frf.labels or (None, None)
    for title, side, labels in zip(_DIMENSIONS[1:], (frf.responses, frf.excitations), names, strict=True):
        coordinates[title] = (title, [coordinate.describe() for coordinate in side])
        coordinates[f"{title}_direction"] = (title, [coordinate.direction for coordinate in side])
        if labels is not None:
            coordinates[f"{title}_label"] = (title, list(labels))
    stated = {name: getattr(frf, name) for name in WITHOUT_AXES if name != "labels" and getattr(frf, name) is not None}
    for name in ("responses", "excitations", "notes"):
        stated[name] = [item if isinstance(item, str) else repr(item) for item in stated[name]]
    return xarray.Dataset(arrays, coordinates, stated)


def fields_from_xarray(data: xarray.Dataset) -> dict[str, Any]:
    """Return the arguments of an FRF from a data set of `FRF.to_xarray`."""
    missing = [name for name in ("frf", FREQUENCY) if name not in data.variables]
    if missing or "form" not in data.attrs:
        lacking = ", ".join(missing) or "the attribute form"
        raise ValueError(
            f"from_xarray: the data set has no {lacking}, expected one of FRF.to_xarray; build others with "
            "FRF(frequency_hz=..., values=...)"
        )
    fields: dict[str, Any] = {"values": data["frf"].transpose(*_DIMENSIONS).values}
    for name in (FREQUENCY, *_ARRAYS):
        if name in data.variables:
            fields[name] = data[name].transpose(*_DIMENSIONS[: data[name].ndim]).values
    fields |= {name: data.attrs[name] for name in WITHOUT_AXES if name in data.attrs}
    for name in ("responses", "excitations", "notes"):
        # A list of one text is a text in a file of NetCDF.
        fields[name] = np.atleast_1d(data.attrs.get(name, ())).tolist()
    for name in ("responses", "excitations"):
        fields[name] = [_coordinate(text) for text in fields[name]]
    if f"{RESPONSE}_label" in data.coords:
        fields["labels"] = tuple(tuple(data[f"{side}_label"].values.tolist()) for side in (RESPONSE, EXCITATION))
    return fields


def _coordinate(text: str) -> Coordinate:
    """Return a coordinate from its `repr`; nothing is evaluated but names of arguments and plain values."""
    call = ast.parse(str(text), mode="eval").body
    if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
        raise ValueError(f"from_xarray: {text!r} is no coordinate")
    values = [ast.literal_eval(one) for one in call.args]
    named = {str(keyword.arg): ast.literal_eval(keyword.value) for keyword in call.keywords}
    return (UnknownPosition if call.func.id == "UnknownPosition" else Coordinate)(*values, **named)


def frame(frf: FRFData) -> pandas.DataFrame:
    """Return the values of an FRF as a table over frequency."""
    require("sweep", "FRF.to_pandas", "pandas")
    import pandas  # slow to import

    _, n_out, n_in = frf.shape
    names = frf.labels or ((), ())
    sides = []
    for side, labels in zip((frf.responses, frf.excitations), names, strict=True):
        own = [(labels[i] if labels else "") or side[i].describe() for i in range(len(side))]
        # Without labels and positions the number distinguishes them.
        sides.append(own if len(set(own)) == len(own) else [f"{number}: {name}" for number, name in enumerate(own)])
    columns = pandas.MultiIndex.from_product(sides, names=[RESPONSE, EXCITATION])
    index = pandas.Index(frf.frequency_hz, name=FREQUENCY)
    return pandas.DataFrame(frf.values.reshape(-1, n_out * n_in), index=index, columns=columns)


def fields_from_pandas(table: pandas.DataFrame | pandas.Series[Any]) -> dict[str, Any]:
    """Return the arguments of an FRF from a table over frequency, with a column for each response (and excitation)."""
    values = np.asarray(table.to_numpy())
    fields: dict[str, Any] = {"frequency_hz": np.asarray(table.index.to_numpy(), dtype=np.float64)}
    if values.ndim == 1:
        return fields | {"values": values}
    columns = table.columns
    if columns.nlevels == 1:
        return fields | {"values": values[:, :, None], "labels": ([str(name) for name in columns], [""])}
    pairs = [(str(column[0]), str(column[1])) for column in columns]
    rows, sources = (list(dict.fromkeys(pair[side] for pair in pairs)) for side in (0, 1))
    if len(set(pairs)) != len(pairs) or len(pairs) != len(rows) * len(sources):
        raise ValueError(
            f"from_pandas: {len(pairs)} columns of {len(rows)} responses and {len(sources)} excitations, expected one "
            "for each pair of them"
        )
    found = np.empty((len(values), len(rows), len(sources)), dtype=np.complex128)
    for number, (row, source) in enumerate(pairs):
        found[:, rows.index(row), sources.index(source)] = values[:, number]
    return fields | {"values": found, "labels": (rows, sources)}
