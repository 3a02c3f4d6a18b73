"""NPZ files: NumPy arrays in a zip file, without pickles."""

from __future__ import annotations

import io
import math
import zipfile
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.io.arrays import measurements_of, named_items
from receptance.io.errors import FileFormatError, error_location
from receptance.io.limits import check_size, check_time
from receptance.io.measurements import Measurement
from receptance.io.options import ReadOptions

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
    """Return the measurements in an NPZ file: those written by this library, else the arrays of the options.

    Raises
    ------
    FileFormatError
        A file that is damaged or holds Python objects, or arrays that are not a measurement.
    """
    return measurements_of(arrays_in(data), options, separator=".")


def arrays_in(data: bytes) -> dict[str, Any]:
    """Return the arrays of an NPZ file by name, texts as str.

    Raises
    ------
    FileFormatError
        A file that is damaged, too large, or holds Python objects.
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
                    arrays[name] = _parse_npy(archive.read(member))
    except FileFormatError:
        raise
    except _BROKEN as error:
        raise FileFormatError(f"this is not a complete NPZ file: {error}") from None
    return arrays


def _parse_npy(content: bytes) -> NDArray[Any] | str:
    """Return the array or text of an NPY file, after checking its declared size against that of the data."""
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_column, dtype = read(stream)
    except Exception as error:
        # NumPy evaluates the header as a Python literal, and damaged ones raise various errors.
        raise FileFormatError(f"the header is damaged: {error}") from None
    if dtype.kind not in _KINDS or dtype.hasobject:
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
