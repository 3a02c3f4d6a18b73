"""The spindle's three terms on each line: in closed form, and which of two solutions, decided over all lines."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.line_solutions import TERMS, Equations, linear_solution, polished, roots
from receptance.spindle.plausible import gained

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["solved"]

_APART = 1e-6
"""Relative distance below which two solutions are the same."""
_WIDTH = 0.03
"""Relative change of frequency over which a spindle's receptance may change by its own size."""
_LEAST = 0.05
"""Least relative change from one line to the next that is expected."""
_MOST = 60.0
"""Largest cost of one step or of one line, so that a single bad line cannot decide for all."""
_NEVER = 1e9
"""Cost of a solution that has no value."""
_ODDS = 12.0
"""Difference of twice the logarithm of the likelihood from which on a branch is decided, e^6 to 1."""
_NEAR = 4.0
"""Distance of two solutions in standard deviations below which the equations are not linear over the noise."""
_AROUND = 8
"""Lines to either side over which the precision of a line is judged."""


def solved(equations: Equations, limit: float) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the terms `(n, 3)`, where the branch is ambiguous, and where the precision is by chance only.

    The two solutions of one line explain it equally well. Which of them is the spindle is decided for all lines
    together, by the most likely path over frequency: a spindle changes little from line to line, and takes energy.
    """
    with np.errstate(all="ignore"):
        starts = [linear_solution(_of(equations, pairs)) for pairs in _alike(equations) if len(pairs) >= len(TERMS)]
        exact = equations.rigid.shape[1] == len(TERMS)
        none = np.zeros(len(equations.rigid), dtype=np.bool_)
        if starts and exact:
            return starts[0], none, none
        ends = starts or _both(equations)
        if not exact:
            ends = [polished(equations, start) for start in ends]
        if len(ends) == 1:
            return ends[0], none, none
        return _connected(equations, ends, limit)


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


def _both(eq: Equations) -> list[NDArray[np.complex128]]:
    """Return both solutions of three equations, or two starts for more.

    With d the measured less the free receptance, each equation is linear in the three terms and in det G:
    d det(G + Y) = a (G_tt + Y_tt) - b (G_yt + Y_yt) + c (G_yy + Y_yy). Three equations leave a line p + lambda q, and
    the determinant of its terms is quadratic in lambda.
    """
    r, e, y = eq.response, eq.excitation, eq.surroundings
    d = eq.measured - eq.rigid
    a, b, c = r[..., 0] * e[..., 0], r[..., 0] * e[..., 1] + r[..., 1] * e[..., 0], r[..., 1] * e[..., 1]
    y_y, y_t, y_c = y[..., 0, 0], y[..., 1, 1], y[..., 0, 1]
    mean = np.abs(y).mean(axis=1)
    y_size, t_size = mean[:, 0, 0], mean[:, 1, 1]
    sizes = np.stack([y_size * t_size, y_size, t_size, np.sqrt(y_size * t_size)], axis=1)
    rows = np.stack([d, d * y_t - c, d * y_y - a, b - 2.0 * d * y_c], axis=-1) * sizes[:, None, :]
    right = a * y_t - b * y_c + c * y_y - d * (y_y * y_t - y_c**2)
    norm = np.linalg.norm(rows, axis=-1)
    rows, right = rows / norm[..., None], right / norm
    finite = np.isfinite(rows).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    left, singular, vectors = np.linalg.svd(np.where(finite[:, None, None], rows, 0.0))
    vectors = vectors.conj().transpose(0, 2, 1)
    shares = np.einsum("npi,np->ni", left[:, :, :3].conj(), np.where(finite[:, None], right, np.nan)) / singular[:, :3]
    p, q = np.einsum("nij,nj->ni", vectors[:, :, :3], shares), vectors[:, :, 3]
    second = q[:, 1] * q[:, 2] - q[:, 3] ** 2
    first = p[:, 1] * q[:, 2] + p[:, 2] * q[:, 1] - 2.0 * p[:, 3] * q[:, 3] - q[:, 0]
    rest = p[:, 1] * p[:, 2] - p[:, 3] ** 2 - p[:, 0]
    return [(p + root[:, None] * q)[:, 1:] * sizes[:, 1:] for root in roots(second, first, rest)]


def _connected(
    eq: Equations, ends: list[NDArray[np.complex128]], limit: float
) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the most likely path through the solutions, where it is uncertain, and where precision is by chance."""
    found = np.stack(ends, axis=1)
    scale = np.stack([eq.scale(x) for x in ends], axis=1)
    costs = np.stack([eq.cost(x) for x in ends], axis=1)
    reaction = np.stack([eq.reaction(x) for x in ends], axis=1) * eq.deviation[:, None, None, :] / scale[..., None]
    covariance = reaction @ reaction.conj().swapaxes(-1, -2)
    # Rounding must not make it singular.
    covariance = covariance + 1e-12 * np.einsum("nkii->nk", covariance)[..., None, None] * np.eye(len(TERMS))
    whole = np.asarray(np.isfinite(covariance).all(axis=(2, 3)) & np.isfinite(costs))
    covariance = np.where(whole[..., None, None], covariance, np.eye(len(TERMS)))
    found, scale = np.where(whole[..., None], found, 0.0), np.where(whole[..., None], scale, 1.0)
    best = costs.min(axis=1, keepdims=True)
    own = np.where(whole & np.isfinite(best), costs - np.where(np.isfinite(best), best, 0.0), 0.0)
    if not np.any(eq.angular_frequency.imag):
        own = own + np.stack([_activity(eq, found, covariance, scale, i) for i in range(len(ends))], axis=1)
    own = np.where(whole, np.minimum(own, _MOST), _NEVER)
    w = eq.angular_frequency.real
    steps = _steps(found, covariance, scale, np.clip(np.diff(w) / (_WIDTH * w[1:]), _LEAST, 1.0))
    forward, backward = own.copy(), np.zeros_like(own)
    for line in range(1, len(own)):
        forward[line] += np.min(forward[line - 1][:, None] + steps[line - 1], axis=0)
    for line in range(len(own) - 2, -1, -1):
        backward[line] = np.min(steps[line] + own[line + 1] + backward[line + 1], axis=1)
    total = forward + backward
    chosen, lines = np.argmin(total, axis=1), np.arange(len(own))
    x, cov = found[lines, chosen], covariance[lines, chosen]
    off = (found - x[:, None]) / scale[lines, chosen][:, None]
    apart = whole & (np.abs(off).max(axis=-1) > _APART)
    distance = np.einsum("nki,nki->nk", off.conj(), np.linalg.solve(cov[:, None], off[..., None])[..., 0]).real
    likely = apart & ((total - total[lines, chosen][:, None] < _ODDS) | (distance < _NEAR**2))
    ambiguous = np.any(likely & (own - own[lines, chosen][:, None] < _ODDS), axis=1)
    relative = np.sqrt(np.einsum("nii->ni", cov).real.max(axis=1))
    padded = np.pad(relative, _AROUND, mode="edge")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1), axis=1)
    return np.where(whole[lines, chosen][:, None], x, np.nan), ambiguous, around > limit


def _activity(
    eq: Equations,
    found: NDArray[np.complex128],
    covariance: NDArray[np.complex128],
    scale: NDArray[np.float64],
    which: int,
) -> NDArray[np.float64]:
    """Return minus twice the logarithm of the probability that a solution takes energy, `(n,)`."""
    from scipy.special import log_ndtr

    size = scale[:, which]
    matrix, spread = eq.stiffness(found[:, which]), covariance[:, which] * (size[:, :, None] * size[:, None, :])
    usable = np.isfinite(matrix).all(axis=(1, 2)) & (np.abs(np.einsum("nii->ni", matrix)) > 0.0).all(axis=1)
    energy, deviation = gained(np.where(usable[:, None, None], matrix, np.eye(2)), spread)
    result: NDArray[np.float64] = np.where(usable, -2.0 * log_ndtr(-energy / np.maximum(deviation, 1e-300)), 0.0)
    return result


def _steps(
    found: NDArray[np.complex128],
    covariance: NDArray[np.complex128],
    scale: NDArray[np.float64],
    expected: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the costs of going from each solution of a line to each of the next, `(n - 1, k, k)`.

    Minus twice the logarithm of the likelihood of the next line's data, with what the line before and its noise say.
    """
    count = found.shape[1]
    result = np.empty((len(found) - 1, count, count))
    for before in range(count):
        for after in range(count):
            size, past = scale[1:, after], scale[:-1, before]
            ratio = past / size
            last = covariance[:-1, before] * (ratio[:, :, None] * ratio[:, None, :])
            change = (0.5 * expected[:, None] * (1.0 + ratio)) ** 2
            spread = last + covariance[1:, after] + change[:, :, None] * np.eye(len(TERMS))
            off = (found[1:, after] - found[:-1, before]) / size
            finite = np.asarray(np.isfinite(spread).all(axis=(1, 2)) & np.isfinite(off).all(axis=1))
            spread = np.where(finite[:, None, None], spread, np.eye(len(TERMS)))
            off = np.where(finite[:, None], off, 0.0)
            squares = np.einsum("ni,ni->n", off.conj(), np.linalg.solve(spread, off[..., None])[..., 0]).real
            growth = np.linalg.slogdet(spread)[1] - np.linalg.slogdet(covariance[1:, after])[1]
            cost = np.minimum(squares, _MOST) + growth
            result[:, before, after] = np.where(finite & np.isfinite(cost), cost, 0.0)
    return result
