"""NumPy's files: arrays by name (.npz), of this library, of SDynPy or of other programs, and a single array (.npy)."""

from __future__ import annotations

import io
import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.io.arrays import measurements_of, named_items
from receptance.io.build import ReadOptions
from receptance.io.column_names import parse_column, with_complex_parts, with_one_axis
from receptance.io.errors import MAX_NUMBERS, FileFormatError, check_count, check_size, check_time, error_location
from receptance.io.measurements import Measurement
from receptance.io.tables import measurements_in_rows
from receptance.io.uff.datasets import NO_POINT, Axis, Function, Point
from receptance.io.uff.read import measurements_of_functions

_ORDINATE, _NODE, _DIRECTION = "data.ordinate", "data.coordinate.node", "data.coordinate.direction"
_COMMENTS = 5
_KINDS = "biufcU"
_BROKEN = (zipfile.BadZipFile, zlib.error, NotImplementedError, EOFError, OSError, RuntimeError, ValueError, IndexError)


def is_npz(start: bytes) -> bool:
    """Return whether a file begins like a zip file."""
    return start.startswith(b"PK\x03\x04")


def npz_bytes(measurements: Sequence[Measurement]) -> bytes:
    """Return the contents of an NPZ file; all fields are stored."""
    buffer = io.BytesIO()
    arrays: dict[str, Any] = {
        name: np.asarray(value) for name, value in named_items(measurements, separator=".").items()
    }
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def read_npz(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the measurements in an NPZ file: those written by this library, else the arrays of the options."""
    arrays = arrays_in(data)
    if options.variables is None and _is_sdynpy(arrays):
        return _read_sdynpy(arrays, options)
    return measurements_of(arrays, options, separator=".")


def arrays_in(data: bytes) -> dict[str, Any]:
    """Return the arrays of an NPZ file by name, texts as str; damaged files and Python objects raise.

    The fields of structured arrays are arrays of their own, such as data.abscissa.
    """
    arrays: dict[str, Any] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            # No member is expanded beyond its declared size.
            check_size(sum(member.file_size for member in members), "the arrays")
            for member in members:
                check_time()
                name = member.filename.removesuffix(".npy")
                with error_location(place=f"array {name!r}"):
                    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                        raise FileFormatError(f"the compression {member.compress_type} is not one of NumPy's")
                    arrays.update(_with_fields(name, parse_npy(archive.read(member))))
    except FileFormatError:
        raise
    except _BROKEN as error:
        raise FileFormatError(f"this is not a complete NPZ file: {error}") from None
    return arrays


def _with_fields(name: str, array: NDArray[Any] | str) -> Iterator[tuple[str, NDArray[Any] | str]]:
    """Yield an array by its name, or the fields of a structured one."""
    if isinstance(array, str) or array.dtype.names is None:
        yield name, array
        return
    for field in array.dtype.names:
        yield from _with_fields(f"{name}.{field}", array[field])


def parse_npy(content: bytes) -> NDArray[Any] | str:
    """Return the array or text of an NPY file, after checking its declared size against that of the data."""
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_column, dtype = read(stream)
    except Exception as error:
        # NumPy evaluates the header as a Python literal, and damaged ones raise various errors.
        raise FileFormatError(f"the header is damaged: {error}") from None
    if (dtype.kind not in _KINDS and dtype.names is None) or dtype.hasobject:
        raise FileFormatError(f"the dtype is {dtype}, expected numbers or text: Python objects (pickles) are not read")
    start, count = stream.tell(), math.prod(shape)
    size = len(content) - start
    if any(length < 0 for length in shape) or len(shape) > 8 or count * dtype.itemsize != size:
        raise FileFormatError(f"shape {shape} of {dtype} takes {count * dtype.itemsize} bytes, there are {size}")
    if not size:
        return np.zeros(0)
    flat = np.frombuffer(content, dtype=dtype, count=count, offset=start)
    array = flat.reshape(shape, order="F" if by_column else "C")
    try:
        return str(array[()]) if dtype.kind == "U" and not shape else array
    except (UnicodeError, ValueError):
        raise FileFormatError("the text is damaged") from None


# Structured arrays of SDynPy: abscissae, ordinates and coordinates of functions ---------------------------------------


def _is_sdynpy(arrays: Mapping[str, Any]) -> bool:
    """Return whether the arrays of an NPZ file, with the fields of structured ones, are those of SDynPy."""
    return {"function_type", _ORDINATE, _NODE, _DIRECTION} <= arrays.keys()


def _read_sdynpy(arrays: Mapping[str, Any], options: ReadOptions) -> list[Measurement]:
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


# A single array: a table without a header, whose columns the options name -----------------------------------------


def is_npy(data: bytes) -> bool:
    """Return whether a file begins like one with a single array."""
    return data.startswith(b"\x93NUMPY")


def read_npy(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the FRF, coherence or time records in the columns, or the rows, of an array.

    A complex array has the axis in a column of its own, as real parts; each other complex column is an FRF.
    """
    array = parse_npy(data)
    if isinstance(array, str) or array.dtype.kind not in "iufc" or array.ndim not in (1, 2) or not array.size:
        shape = "a text" if isinstance(array, str) else f"an array {array.shape} of {array.dtype}"
        raise FileFormatError(f"the file holds {shape}, expected numbers in one or two dimensions")
    check_count(array.size, MAX_NUMBERS, "numbers")
    if options.columns is None:
        raise FileFormatError(
            f"the file holds an array {array.shape} of {array.dtype} without names; give them with columns=[...] (on "
            "the command line --columns), a name with its unit for each column: 'frequency [Hz],real [m/N],imag "
            "[m/N]', or 'hammer [N],tip [m/s^2]' with sample_rate_hz= (--sample-rate) for time records without times",
            option="columns",
        )
    names = list(options.columns)
    table = array[:, None] if array.ndim == 1 else array
    if table.shape[1] != len(names) and table.shape[0] == len(names):
        table = table.T
    if table.shape[1] != len(names):
        raise FileFormatError(
            f"the array has the shape {array.shape}, expected {len(names)} columns as named by columns=: "
            f"{', '.join(names[:6])}"
        )
    columns = with_one_axis([parse_column(name) for name in names])
    is_complex = table.dtype.kind == "c" and any(column.role == "frequency" for column in columns)
    are_complex = [
        (is_complex and column.role == "channel") or bool(np.any(table[:, index].imag))
        for index, column in enumerate(columns)
    ]
    values: list[NDArray[np.float64]] = []
    for index, has_parts in enumerate(are_complex):
        check_time()
        numbers = table[:, index]
        values += [part.astype(np.float64) for part in ([numbers.real, numbers.imag] if has_parts else [numbers.real])]
    return measurements_in_rows(with_complex_parts(columns, are_complex), values, options)
