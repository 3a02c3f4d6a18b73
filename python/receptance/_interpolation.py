"""Values between the lines of a table, where the table itself shows that it can be interpolated."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["interpolated"]

_SAME = 1e-9
"""Lines that differ by less, relative, are the same but for rounding."""
_MOST = 0.01
"""Error of an interpolation, relative to the values around it, beyond which it is refused."""
_HALVED = 16.0
"""By how much the error of a cubic spline falls when its lines are twice as dense."""
_GAP = 2.5
"""An interval longer than so many of its neighbours is a gap, which nothing is interpolated across."""
_AROUND = 4
_FEWEST = 8


def interpolated(
    owner: str, known_hz: NDArray[np.float64], table: NDArray[np.complex128], lines_hz: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return the columns of a table at lines; at its own lines exactly, between them by a cubic spline.

    How far the spline can be trusted is read off the table: each line is predicted from the others next to it, and the
    error of that, with twice the spacing, is 16 times that of the spline.

    Raises
    ------
    ValueError
        A line outside the table, in a gap of it, or where the table is too coarse or too noisy.
    """
    low, high = known_hz[0], known_hz[-1]
    outside = np.flatnonzero((lines_hz < low * (1.0 - _SAME)) | (lines_hz > high * (1.0 + _SAME)))
    if outside.size:
        raise ValueError(
            f"{owner} is known from {low:g} to {high:g} Hz, and the line at {lines_hz[outside[0]]:g} Hz is outside; "
            "nothing is extrapolated"
        )
    after = np.clip(np.searchsorted(known_hz, lines_hz), 1, max(known_hz.size - 1, 1)) if known_hz.size > 1 else None
    if after is None:
        return np.broadcast_to(table, (lines_hz.size, table.shape[1])).copy()
    before = after - 1
    nearest = np.where(lines_hz - known_hz[before] < known_hz[after] - lines_hz, before, after)
    result = table[nearest]
    between = np.flatnonzero(np.abs(known_hz[nearest] - lines_hz) > _SAME * lines_hz)
    if not between.size:
        return result
    _check_between(owner, known_hz, table, lines_hz[between], after[between])
    result[between] = _spline(known_hz, table, lines_hz[between])
    return result


def _check_between(
    owner: str,
    known_hz: NDArray[np.float64],
    table: NDArray[np.complex128],
    lines_hz: NDArray[np.float64],
    after: NDArray[np.intp],
) -> None:
    if known_hz.size < _FEWEST:
        raise ValueError(
            f"{owner} has {known_hz.size} lines, too few to interpolate to {lines_hz[0]:g} Hz; ask for its own lines"
        )
    spacing = np.diff(known_hz)
    usual = np.array([np.median(spacing[max(i - _AROUND, 0) : i + _AROUND + 1]) for i in range(spacing.size)])
    gap = np.flatnonzero((spacing > _GAP * usual)[after - 1])
    if gap.size:
        ends = known_hz[after[gap[0]] - 1], known_hz[after[gap[0]]]
        raise ValueError(
            f"{owner} is not known between {ends[0]:g} and {ends[1]:g} Hz, where the line at {lines_hz[gap[0]]:g} Hz "
            "is; leave it out, or fit a ModalPart"
        )
    error = _error(known_hz, table)
    worst = np.max(np.maximum(error[after - 1], error[after]), axis=1)
    if (bad := np.flatnonzero(worst > _MOST)).size:
        raise ValueError(
            f"{owner}: interpolation to {lines_hz[bad[0]]:g} Hz would be about {100.0 * worst[bad[0]]:.2g} % off, as "
            "its lines are too far apart or too noisy there; ask for its own lines, or fit a ModalPart"
        )


def _error(known_hz: NDArray[np.float64], table: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the error of the spline around each line, relative to the values around it, `(n, columns)`."""
    size = np.abs(table)
    off = np.zeros(size.shape)
    for start in (0, 1):
        kept = slice(start, None, 2)
        other = slice(1 - start, None, 2)
        inside = (known_hz[other] >= known_hz[kept][0]) & (known_hz[other] <= known_hz[kept][-1])
        lines = known_hz[other][inside]
        rows = np.arange(known_hz.size)[other][inside]
        off[rows] = np.abs(_spline(known_hz[kept], table[kept], lines) - table[rows]) / _HALVED
    around = np.ones(2 * _AROUND + 1) / (2 * _AROUND + 1)
    local = np.stack([np.convolve(np.pad(column, _AROUND, "edge"), around, "valid") for column in size.T], axis=1)
    result: NDArray[np.float64] = off / np.maximum(local, 1e-300)
    return result


def _spline(
    known_hz: NDArray[np.float64], table: NDArray[np.complex128], lines_hz: NDArray[np.float64]
) -> NDArray[np.complex128]:
    from scipy.interpolate import CubicSpline

    found: Any = CubicSpline(known_hz, table)(lines_hz)
    return np.asarray(found, dtype=np.complex128)
