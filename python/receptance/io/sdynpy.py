"""Structured arrays in NPZ files as SDynPy writes them: abscissae, ordinates and coordinates of functions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.io.build import ReadOptions
from receptance.io.errors import FileFormatError, error_location
from receptance.io.measurements import Measurement
from receptance.io.uff.datasets import NO_POINT, Axis, Function, Point
from receptance.io.uff.read import measurements_of_functions

_ORDINATE, _NODE, _DIRECTION = "data.ordinate", "data.coordinate.node", "data.coordinate.direction"
_COMMENTS = 5


def is_sdynpy(arrays: Mapping[str, Any]) -> bool:
    """Return whether the arrays of an NPZ file, with the fields of structured ones, are those of SDynPy."""
    return {"function_type", _ORDINATE, _NODE, _DIRECTION} <= arrays.keys()


def read_sdynpy(arrays: Mapping[str, Any], options: ReadOptions) -> list[Measurement]:
    """Return the FRFs, coherences and time series in the arrays of SDynPy, which state points but no units."""
    with error_location(place="the array 'data'"):
        ordinate, node, direction = (arrays[name] for name in (_ORDINATE, _NODE, _DIRECTION))
        kind = np.asarray(arrays["function_type"])
        is_valid = ordinate.ndim >= 1 and node.shape == direction.shape and node.shape[:-1] == ordinate.shape[:-1]
        if kind.size != 1 or ordinate.dtype.kind not in "iufc" or not is_valid or {node.dtype.kind} - set("iu"):
            raise FileFormatError(
                f"ordinate has shape {ordinate.shape} and coordinate {node.shape}, expected one for each function"
            )
        abscissa = _abscissae(arrays, ordinate.shape)
        comments = [np.asarray(arrays.get(f"data.comment{number}", "")) for number in range(1, _COMMENTS + 1)]
        axis = Axis(17, "", "s") if kind.item() == 1 else Axis(18, "", "Hz")
        functions = [
            Function(
                kind=int(kind.item()),
                response=points[0],
                reference=points[1],
                abscissa=abscissa[at].astype(np.float64),
                ordinate=ordinate[at].astype(np.complex128 if ordinate.dtype.kind == "c" else np.float64),
                axes=(axis, Axis(0, "", ""), Axis(0, "", "")),
                texts=[str(text[at]).strip() if text.shape == ordinate.shape[:-1] else "" for text in comments],
            )
            for at in np.ndindex(ordinate.shape[:-1])
            for points in [_points(node[at], direction[at])]
        ]
        return measurements_of_functions(functions, [], options)


def _abscissae(arrays: Mapping[str, Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the abscissae of all functions; compressed ones are stated by their start and step."""
    if "abscissa_start" in arrays and "abscissa_step" in arrays:
        start, step = (float(np.asarray(arrays[f"abscissa_{name}"]).ravel()[0]) for name in ("start", "step"))
        return np.broadcast_to(start + step * np.arange(shape[-1]), shape)
    abscissa = arrays.get("data.abscissa")
    if abscissa is None or abscissa.shape != shape or abscissa.dtype.kind not in "iuf":
        raise FileFormatError(f"there is no numeric field abscissa of shape {shape}")
    if not np.all(np.isfinite(abscissa)):
        raise FileFormatError("the abscissa is not finite")
    return np.asarray(abscissa)


def _points(nodes: NDArray[Any], directions: NDArray[Any]) -> tuple[Point, Point]:
    """Return response and reference of a function."""
    points = [Point("", int(node), int(direction)) for node, direction in zip(nodes, directions, strict=True)]
    if any(abs(point.direction) > 6 for point in points):
        raise FileFormatError(f"the direction of a coordinate is {directions.tolist()}, expected -6 to 6")
    return (points[0] if points else NO_POINT), (points[1] if len(points) > 1 else NO_POINT)
