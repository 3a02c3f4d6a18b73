"""Arrays in NumPy files with a single array (.npy): a table without a header, whose columns the options name."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.io.arrays import parse_npy
from receptance.io.build import ReadOptions
from receptance.io.column_names import AXES, Column, complex_columns, parse_column
from receptance.io.errors import MAX_NUMBERS, FileFormatError, check_count, check_time
from receptance.io.measurements import Measurement
from receptance.io.tables import NumberTable, measurements_in


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
            "[m/N]', or 'hammer [N],tip [m/s^2]' with sample_rate_hz= (--sample-rate) for time records without times"
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
    columns, values = _real_columns([parse_column(name) for name in names], table)
    return measurements_in(
        NumberTable(tuple(columns), np.stack(values, axis=1), 0, tuple(range(1, table.shape[0] + 1)), None), options
    )


def _real_columns(columns: list[Column], table: NDArray[Any]) -> tuple[list[Column], list[NDArray[np.float64]]]:
    """Return the columns, of the real and the imaginary part where numbers are complex, and their values."""
    are_complex = [bool(np.any(table[:, index].imag)) for index in range(len(columns))]
    real: list[Column] = []
    values: list[NDArray[np.float64]] = []
    has_axis = False
    for index, column in enumerate(columns):
        check_time()
        is_axis = column.role in AXES and not has_axis
        has_axis |= is_axis
        numbers = table[:, index]
        is_frf = table.dtype.kind == "c" and not is_axis and column.role == "channel"
        if are_complex[index] and not is_frf:
            raise FileFormatError(
                f"column {column.name!r} has complex numbers, expected real ones; a column of complex numbers is named "
                "by its quantity, such as accelerance [m/s^2/N]"
            )
        if is_frf:
            real += complex_columns(column, several=table.shape[1] > 2)
            values += [numbers.real.astype(np.float64), numbers.imag.astype(np.float64)]
        else:
            real.append(column)
            values.append(numbers.real.astype(np.float64))
    return real, values
