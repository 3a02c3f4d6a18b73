"""The spindle's three terms on each line: in closed form from one blank, by least squares from several."""

from __future__ import annotations

from dataclasses import fields
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.line_solutions import TERMS, Equations, linear_solution, polished

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["solved"]

_SHARES = (1e-3, 1e-2, 1e-1, 1.0)
"""Shares of the blank's own receptance at which a search begins where no closed form can begin it."""
_FOLLOWED = 4
_AS_GOOD = 4.0
"""A solution whose sum of squares is so much larger, in variances, may be the right one all the same."""
_APART = 1e-6
_ROUNDS = 2000
_SETTLED = 20.0
"""Sum of squares for each equation that is not needed, in variances, up to which a line is solved."""


def solved(equations: Equations) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return the terms `(n, 3)`, and where several solutions fit and their neighbours decided."""
    with np.errstate(all="ignore"):
        starts = [linear_solution(_of(equations, pairs)) for pairs in _alike(equations) if len(pairs) >= len(TERMS)]
        if len(starts) == 1 and equations.rigid.shape[1] == len(TERMS):
            return starts[0], np.zeros(len(starts[0]), dtype=np.bool_)
        ends = [polished(equations, start) for start in starts or _grid(equations)]
        if not starts:
            ends.append(_spread(equations, ends))
        return _continued(equations, ends)


def _alike(equations: Equations) -> list[list[int]]:
    """Return the observations of each blank."""
    groups: list[list[int]] = []
    for pair in range(equations.rigid.shape[1]):
        own = equations.surroundings[:, pair]
        for group in groups:
            if np.array_equal(equations.surroundings[:, group[0]], own):
                group.append(pair)
                break
        else:
            groups.append([pair])
    return groups


def _of(equations: Equations, pairs: list[int]) -> Equations:
    """Return the equations of some of the observations."""
    by_pair = ("rigid", "measured", "response", "excitation", "surroundings", "deviation")
    own = {one.name: getattr(equations, one.name) for one in fields(equations)}
    return Equations(**{name: value[:, pairs] if name in by_pair else value for name, value in own.items()})


def _grid(equations: Equations) -> list[NDArray[np.complex128]]:
    """Return the best points of a grid: springs, softer than the blanks or as soft."""
    size = np.abs(equations.surroundings).mean(axis=1)
    points = []
    for y, theta, turn in product(_SHARES, _SHARES, (0.0, 0.5)):
        terms = [y * size[:, 0, 0], theta * size[:, 1, 1]]
        coupling = turn * np.sqrt(terms[0] * terms[1])
        points.append(np.stack([*terms, coupling], axis=1) * (1.0 - 0.05j))
    costs = np.stack([equations.cost(x) for x in points])
    order = np.argsort(costs, axis=0)[:_FOLLOWED]
    lines = np.arange(len(size))
    return [np.stack(points)[which, lines] for which in order]


def _spread(equations: Equations, ends: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Return what each line ends at from the solutions of the lines beside it, so that what few found all have."""
    costs = np.stack([equations.cost(x) for x in ends])
    x: NDArray[np.complex128] = np.stack(ends)[np.argmin(costs, axis=0), np.arange(len(ends[0]))]
    cost = costs.min(axis=0)
    unknown = max(equations.rigid.shape[1] - len(TERMS), 1)
    for _ in range(_ROUNDS):
        settled = cost <= _SETTLED * unknown
        if settled.all() or not settled.any():
            break
        for step in (1, -1):
            # Only lines beside a settled one are tried: from further away they would go astray again.
            tried = np.flatnonzero(~settled & np.roll(settled, step))
            tried = tried[(tried > 0) if step == 1 else (tried < len(x) - 1)]
            if not tried.size:
                continue
            rows = np.zeros(len(x), dtype=np.bool_)
            rows[tried] = True
            some = equations.on(rows)
            new = polished(some, x[tried - step])
            found = some.cost(new)
            better = found < cost[tried]
            x[tried[better]], cost[tried[better]] = new[better], found[better]
            settled = cost <= _SETTLED * unknown
    return x


def _continued(
    equations: Equations, ends: list[NDArray[np.complex128]]
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return on each line the solution that goes on from the line before, of those that fit about as well."""
    found = np.stack(ends, axis=1)
    costs = np.stack([equations.cost(x) for x in ends], axis=1)
    best = costs.min(axis=1)
    good = costs <= np.maximum(best + _AS_GOOD, 2.0 * best)[:, None]
    lines = np.arange(len(found))
    chosen = found[lines, np.argmin(costs, axis=1)]
    scale = np.stack([equations.scale(x) for x in ends], axis=1)
    apart = np.max(np.abs(found - chosen[:, None]) / scale, axis=-1) > _APART
    ambiguous = np.any(good & apart, axis=1)
    sure = np.flatnonzero(~ambiguous & np.isfinite(best))
    if not ambiguous.any() or not sure.size:
        return chosen, ambiguous
    for line in np.flatnonzero(ambiguous):
        near = sure[np.argmin(np.abs(sure - line))]
        off = np.max(np.abs(found[line] - chosen[near]) / scale[line], axis=-1)
        chosen[line] = found[line, np.argmin(np.where(good[line], off, np.inf))]
    return chosen, ambiguous
