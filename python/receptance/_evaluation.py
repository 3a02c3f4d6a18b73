"""The core's answers for a flattened assembly, whether or not joints of it depend on their amplitude."""

from __future__ import annotations

from math import tau
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _core
from receptance._addresses import interfaces_by_name
from receptance._amplitude import added_stiffness, evaluate, force_amplitudes, natural_weights
from receptance._flatten import TERMINALS
from receptance.terminals import ENTRIES

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance._flatten import Flat

__all__ = ["by_line", "log_determinant", "modes", "responses"]

_CORE_TERMINALS = 5
"""The core's number of the table of receptances beyond terminals."""


def by_line(flat: Flat, lines: NDArray[Any], added: NDArray[np.complex128] | None = None) -> _core.ByLine | None:
    """Return the properties of a model that differ from line to line, on checked lines in Hz; None without any.

    These are `added` stiffness of the joints, flat of `(n_freq, n_joints, 2)`, and the receptances beyond terminals.
    """
    if not flat.terminals:
        return None if added is None else _core.ByLine(added)
    nodes = np.array([node for node, _ in flat.terminals], dtype=np.float64)
    entries = np.concatenate([terminal.entries(lines) for _, terminal in flat.terminals], axis=1)
    return _core.ByLine(added, nodes, entries.reshape(-1))


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
        own = asked[:, 0] == TERMINALS
        needed = np.vstack([asked[~own], _entries_of_terminals(flat)]) if own.any() else asked
        own_lines = same if added is None else by_line(flat, lines, added)
        h, dh = flat.model(motion).receptance(given, loads, seen, needed, threads, own_lines)
        return h, _through_terminals(flat, lines, dh, asked) if own.any() else dh

    with interfaces_by_name(flat):
        if flat.microslips:
            w = (tau * lines).astype(np.complex128)
            return evaluate(solve, flat, w, points[1], points[0], rows, amplitudes)
        return solve(points[1], points[0], rows)


def _entries_of_terminals(flat: Flat) -> NDArray[np.float64]:
    """Return the core's table entries of all terminals, three each."""
    count = len(flat.terminals)
    rows = np.repeat(np.arange(count), len(ENTRIES)), np.tile(np.arange(len(ENTRIES)), count)
    return np.column_stack([np.full(count * len(ENTRIES), _CORE_TERMINALS), *rows]).astype(np.float64)


def _through_terminals(
    flat: Flat, lines: NDArray[Any], dh: NDArray[np.complex128], asked: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return derivatives for table entries, those of terminals made of the core's by their receptances."""
    own = asked[:, 0] == TERMINALS
    first = int(np.count_nonzero(~own))
    result = np.empty((*dh.shape[:3], len(asked)), dtype=np.complex128)
    result[..., ~own] = dh[..., :first]
    for row, (_, terminal) in enumerate(flat.terminals):
        columns = np.flatnonzero(own & (asked[:, 1] == row))
        slopes = terminal.slopes(lines, [terminal.addresses[int(asked[column, 2])] for column in columns])
        start = first + len(ENTRIES) * row
        through = dh[..., start : start + len(ENTRIES)]
        result[..., columns] = np.einsum("nres,nsm->nrem", through, slopes)
    return result


def modes(
    flat: Flat, upper: float, rows: NDArray[np.float64], motion: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return natural angular frequencies up to a limit, joints at their stated levels, and derivatives `(n, m)`."""
    if flat.terminals:
        raise ValueError(
            "natural frequencies are counted for parts and joints, not for a spindle known by its receptances; take "
            "the peaks of a receptance"
        )
    asked, weights = rows, None
    with interfaces_by_name(flat):
        if flat.microslips:
            joints, asked, weights = natural_weights(flat, rows)
            segments, _, masses, grounds = flat.tables()
            model = _core.Model(motion, segments, joints, masses, grounds, flat.beside())
        else:
            model = flat.model(motion)
        angular, slope = model.natural_frequencies(upper, 2**31, asked)
    return angular, slope if weights is None else slope @ weights


def log_determinant(flat: Flat, lines: NDArray[np.complex128], motion: int = 0) -> NDArray[np.complex128]:
    """Return the logarithm of the determinant that is zero at the complex natural frequencies, joints at their levels.

    `lines` are complex ones in Hz with a positive real part. The logarithm is that up to a constant and multiples of
    2 pi i; it is NaN where the determinant is zero.
    """
    added = _core.ByLine(added_stiffness(flat, lines.size)) if flat.microslips else None
    with interfaces_by_name(flat):
        return flat.model(motion).log_determinant(_core.Lines(lines, tau), added)
