"""The core's answers for a flattened assembly, whether or not joints of it depend on their amplitude."""

from __future__ import annotations

from math import tau
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _core
from receptance._addresses import interfaces_by_name
from receptance._amplitude import added_stiffness, evaluate, force_amplitudes, natural_weights
from receptance.terminals import ENTRIES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance._flatten import Flat

__all__ = ["by_line", "log_determinant", "modes", "responses"]


def by_line(flat: Flat, lines: NDArray[Any], added: NDArray[np.complex128] | None = None) -> _core.ByLine | None:
    """Return the properties of a model that differ from line to line, on checked lines in Hz; None without any.

    These are `added` stiffness of the joints, flat of `(n_freq, n_joints, 2)`, and the tables of measured parts.

    Raises
    ------
    ValueError
        A line at which a measured part is not known, or which is outside the band of a modal part.
    """
    for part in flat.banded:
        part.check_band(lines)
    if not flat.tabled:
        return None if added is None else _core.ByLine(added)
    beyond = np.zeros((lines.size, len(flat.terminals), len(ENTRIES)), dtype=np.complex128)
    for row, measured in flat.tabled:
        beyond[:, row] = measured.table_entries(lines)
    return _core.ByLine(added, beyond.reshape(-1))


def responses(
    flat: Flat,
    lines: NDArray[Any],
    points: list[NDArray[np.float64]],
    rows: NDArray[np.float64],
    threads: int,
    force: ArrayLike | None,
    motion: int = 0,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return receptance `(n, r, e)` between responses and excitations, and derivatives for table entries `(..., m)`.

    `lines` are checked ones in Hz, real or complex; the core scales them, so that they need not be copied.
    """
    amplitudes = force_amplitudes(force, lines, len(points[1]))
    given = _core.Lines(lines, tau)
    same = by_line(flat, lines)

    def solve(
        loads: NDArray[Any], seen: NDArray[Any], asked: NDArray[Any], added: NDArray[np.complex128] | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        own_lines = same if added is None else by_line(flat, lines, added)
        return flat.model(motion).receptance(given, loads, seen, asked, threads, own_lines)

    with interfaces_by_name(flat):
        if flat.microslips:
            w = (tau * lines).astype(np.complex128)
            return evaluate(solve, flat, w, points[1], points[0], rows, amplitudes)
        return solve(points[1], points[0], rows)


def modes(
    flat: Flat, upper: float | None, most: int, rows: NDArray[np.float64], motion: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest natural angular frequencies, at most so many or up to a limit, and derivatives `(n, m)`.

    Joints in micro-slip are at their stated levels.
    """
    if flat.terminals:
        raise ValueError(
            "natural frequencies are counted for parts and joints, not for a spindle known by its receptances; take "
            "the peaks of a receptance"
        )
    asked, weights = rows, None
    with interfaces_by_name(flat):
        if flat.microslips:
            joints, asked, weights = natural_weights(flat, rows)
            model = flat.tables._replace(joints=joints).model(motion)
        else:
            model = flat.model(motion)
        angular, slope = model.natural_frequencies(upper, most, asked)
    return angular, slope if weights is None else slope @ weights


def log_determinant(flat: Flat, lines: NDArray[np.complex128], motion: int = 0) -> NDArray[np.complex128]:
    """Return the logarithm of the determinant that is zero at the complex natural frequencies, joints at their levels.

    `lines` are complex ones in Hz with a positive real part. The logarithm is that up to a constant and multiples of
    2 pi i; it is NaN where the determinant is zero.
    """
    added = _core.ByLine(added_stiffness(flat, lines.size)) if flat.microslips else None
    with interfaces_by_name(flat):
        return flat.model(motion).log_determinant(_core.Lines(lines, tau), added)
