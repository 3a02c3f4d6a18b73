"""The core's answers for a flattened assembly, whether or not joints of it depend on their amplitude."""

from __future__ import annotations

from math import tau
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _core
from receptance._addresses import interfaces_by_name
from receptance._amplitude import evaluate, force_amplitudes, natural_weights

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance._flatten import Flat

__all__ = ["modes", "responses"]


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

    def solve(
        loads: NDArray[Any], seen: NDArray[Any], asked: NDArray[Any], added: NDArray[np.complex128] | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        tables = flat.tables()
        return _core.receptance(
            lines, motion, *tables, loads, seen, asked, threads, flat.beside(), scale=tau, added=added
        )

    with interfaces_by_name(flat):
        if flat.microslips:
            w = (tau * lines).astype(np.complex128)
            return evaluate(solve, flat, w, points[1], points[0], rows, amplitudes)
        return solve(points[1], points[0], rows)


def modes(
    flat: Flat, upper: float, rows: NDArray[np.float64], motion: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return natural angular frequencies up to a limit, joints at their stated levels, and derivatives `(n, m)`."""
    tables = flat.tables()
    asked, weights = rows, None
    if flat.microslips:
        joints, asked, weights = natural_weights(flat, rows)
        tables = (tables[0], joints, *tables[2:])
    with interfaces_by_name(flat):
        angular, slope = _core.natural_frequencies(upper, 2**31, motion, *tables, asked, flat.beside())
    return angular, slope if weights is None else slope @ weights
