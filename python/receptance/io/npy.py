"""Arrays in NumPy files with a single array (.npy): a table without a header, whose columns the options name."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from receptance.io.arrays import parse_npy
from receptance.io.build import ReadOptions
from receptance.io.column_names import parse_column, with_complex_parts, with_one_axis
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
    rows = tuple(range(1, table.shape[0] + 1))
    parts = tuple(with_complex_parts(columns, are_complex))
    try:
        return measurements_in(NumberTable(parts, np.stack(values, axis=1), 0, rows, None), options)
    except FileFormatError as error:
        if error.line is None:
            raise
        raise FileFormatError(error.problem, place=f"row {error.line}") from None
