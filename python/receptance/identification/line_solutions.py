"""The complex stiffness of a joint from receptances: on each line by itself, and one joint for all lines.

With the joint rigid let H be the receptance, F the force in the joint under the unit load and Y the force per gap
imposed in it. A joint of the stiffness K adds its compliance in series, so that

    H_measured = H + F_r^T (K + Y)^-1 F_e,                                                            (T8) in the theory

which is linear in X = (K + Y)^-1: three independent pairs of coordinates give X, and K = X^-1 - Y. Where fewer terms
are unknown the equations det(K + Y) (H_measured - H) = F_r^T adj(K + Y) F_e are bilinear in them. Two of them without
their common determinant are a straight line, on which either is a quadratic equation.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from receptance import _core

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = [
    "TERMS",
    "Equations",
    "coarse_joints",
    "constant_joint",
    "linear_solution",
    "names_of",
    "polished",
    "roots",
    "solve_lines",
]

TERMS = {"k_y": (0, 0), "k_theta": (1, 1), "k_ytheta": (0, 1)}
"""Terms of the joint's stiffness and where they stand in it."""
_STEPS = 40
_FARTHEST = 1e16
"""A stiffness that no joint has; a search goes no further."""
_SETTLED = 1e-12
"""Relative step at which a line is left as it is."""
_GRID = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3)
"""Shares of the surroundings' stiffness at which a search begins that no closed form can begin."""
_BEST = 3
"""How many of them are followed."""
_AS_GOOD = 4.0
"""A solution whose sum of squares is so much larger, in variances, may be the right one all the same."""
_AGAIN = 2
_FOLLOWED = 6
"""Points of a grid from which fits of all lines together begin."""
_TOLERANCE = 1e-8
"""Relative change of misfit and joint at which such a fit has converged."""
_CENTRES = 40
"""Lines of which each solution is tried as the one that the others are to agree with."""


@dataclass(frozen=True)
class Equations:
    """One equation for each pair of coordinates on each line.

    Attributes
    ----------
    rigid, measured : ndarray
        `(n, p)` receptance with the joint rigid, and as it was measured.
    response, excitation : ndarray
        `(n, p, 2)` force in the rigid joint under a unit load at either coordinate.
    surroundings : ndarray
        `(n, p, 2, 2)` force in the joint per gap imposed in it.
    deviation : ndarray
        `(n, p)` standard deviation of the real and of the imaginary part of the logarithm.
    known : ndarray
        `(n, 2, 2)` stiffness of the joint as far as it is known.
    angular_frequency : ndarray
        `(n,)`.
    terms : tuple of str
        What is not known.
    """

    rigid: NDArray[np.complex128]
    measured: NDArray[np.complex128]
    response: NDArray[np.complex128]
    excitation: NDArray[np.complex128]
    surroundings: NDArray[np.complex128]
    deviation: NDArray[np.float64]
    known: NDArray[np.complex128]
    angular_frequency: NDArray[np.complex128]
    terms: tuple[str, ...]

    @property
    def alike(self) -> bool:
        """Whether all pairs are of one structure."""
        return bool(np.all(self.surroundings == self.surroundings[:, :1]))

    def on(self, lines: NDArray[np.bool_]) -> Equations:
        """Return the equations on some of the lines."""
        own = {one.name: getattr(self, one.name) for one in fields(self)}
        return Equations(**{name: value[lines] if name != "terms" else value for name, value in own.items()})

    def stiffness(self, x: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the whole stiffness `(n, 2, 2)` for values of the unknown terms `(n, m)`."""
        result = self.known.copy()
        for column, term in enumerate(self.terms):
            i, j = TERMS[term]
            result[:, i, j] = result[:, j, i] = x[:, column]
        return result

    def evaluate(self, x: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the receptances `(n, p)` and their derivatives by the unknown terms `(n, p, m)`."""
        inverse = _inverse(self.stiffness(x)[:, None] + self.surroundings)
        ends = [np.einsum("npij,npj->npi", inverse, force) for force in (self.response, self.excitation)]
        h = self.rigid + np.einsum("npi,npi->np", self.response, ends[1])
        slopes = []
        for term in self.terms:
            i, j = TERMS[term]
            slope = -ends[0][..., i] * ends[1][..., j]
            slopes.append(slope if i == j else slope - ends[0][..., j] * ends[1][..., i])
        return h, np.stack(slopes, axis=-1)

    def cost(self, x: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the sum of squares on each line, in variances."""
        h, _ = self.evaluate(x)
        result: NDArray[np.float64] = np.sum(np.abs((h / self.measured - 1.0) / self.deviation) ** 2, axis=1)
        return np.where(np.isfinite(result) & (np.abs(x) < _FARTHEST).all(axis=1), result, np.inf)

    def reaction(self, x: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return how the solution moves with the logarithms of the measured receptances, `(n, m, p)`."""
        h, slope = self.evaluate(x)
        weighted = slope / (h * self.deviation)[..., None]
        size = np.linalg.norm(weighted, axis=1, keepdims=True)
        size = np.where(size > 0.0, size, 1.0)
        return _pseudo_inverse(weighted / size, 1e-13) / size.transpose(0, 2, 1) / self.deviation[:, None, :]

    def noise(self, x: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the standard deviation of the real and of the imaginary part of the terms, `(n, m)`."""
        moved = self.reaction(x) * self.deviation[:, None, :]
        result: NDArray[np.float64] = np.sqrt(np.sum(np.abs(moved) ** 2, axis=2))
        return result

    def scale(self, x: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return what an error of each term is relative to: itself, or sqrt(|k_y k_theta|) for the coupling."""
        k = self.stiffness(x)
        both = np.sqrt(np.abs(k[:, 0, 0] * k[:, 1, 1]))
        return np.stack([both if t == "k_ytheta" else np.abs(k[:, *TERMS[t]]) for t in self.terms], axis=1)

    def rank(self, x: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return how many terms the pairs can tell apart, on each line; none where the model has no value."""
        h, slope = self.evaluate(x)
        relative = slope / h[..., None] * self.scale(x)[:, None, :]
        size = np.linalg.norm(relative, axis=1, keepdims=True)
        relative = relative / np.where(size > 0.0, size, 1.0)
        finite = np.isfinite(relative).all(axis=(1, 2))
        result: NDArray[np.intp] = np.zeros(len(relative), dtype=np.intp)
        result[finite] = np.sum(np.linalg.svd(relative[finite], compute_uv=False) > 1e-9, axis=1)
        return result


def solve_lines(equations: Equations) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return the unknown terms on each line `(n, m)`, and where several solutions fit and their neighbours decided."""
    with np.errstate(all="ignore"):
        starts = _candidates(equations)
        exact = len(equations.terms) == equations.rigid.shape[1] and _closed(equations)
        ends = starts if exact else [polished(equations, x) for x in starts]
        found = np.stack(ends, axis=1)
        costs = np.stack([equations.cost(x) for x in ends], axis=1)
        chosen, ambiguous, centre = _agreed(equations, found, costs)
        for _ in range(_AGAIN):
            if equations.alike or centre is None:
                break
            # What the lines agree on is a better start than a grid, for those that went astray.
            end = polished(equations, np.broadcast_to(centre * (1.0 + 0.01j), chosen.shape).astype(np.complex128))
            found = np.concatenate([found, end[:, None]], axis=1)
            costs = np.concatenate([costs, equations.cost(end)[:, None]], axis=1)
            chosen, ambiguous, centre = _agreed(equations, found, costs)
        return chosen, ambiguous


def _closed(eq: Equations) -> bool:
    return len(eq.terms) == 1 or eq.alike


def _candidates(eq: Equations) -> list[NDArray[np.complex128]]:
    """Return all closed solutions of as many pairs as there are unknowns, or the best points of a grid."""
    pairs, count = eq.rigid.shape[1], len(eq.terms)
    if count == 1:
        return [x for pair in range(pairs) for x in _single(eq, pair)]
    found: list[NDArray[np.complex128]] = []
    if eq.alike:
        if pairs >= 3:
            found.append(linear_solution(eq))
        if count == 2:
            for pair in list(combinations(range(pairs), 2))[:3]:
                found += _double(eq, pair)
        return found
    return _best_of_grid(eq)


def linear_solution(eq: Equations) -> NDArray[np.complex128]:
    """Return the terms of X^-1 - Y, X by weighted linear least squares."""
    r, e = eq.response, eq.excitation
    rows = np.stack([r[..., 0] * e[..., 0], r[..., 1] * e[..., 1], r[..., 0] * e[..., 1] + r[..., 1] * e[..., 0]], -1)
    weight = 1.0 / (np.abs(eq.measured) * eq.deviation)
    rows = rows * weight[..., None]
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    right = ((eq.measured - eq.rigid) * weight)[..., None]
    x = (_pseudo_inverse(rows / size, 1e-14) @ right)[..., 0] / size[:, 0]
    k = _inverse(np.stack([x[:, [0, 2]], x[:, [2, 1]]], axis=1)) - eq.surroundings[:, 0]
    return np.stack([k[:, *TERMS[term]] for term in eq.terms], axis=1)


def _polynomial(eq: Equations, pair: int) -> tuple[NDArray[np.complex128], ...]:
    """Return d, a, b, c of d (s t - B^2) = a t - b B + c s, with s, t and B the terms of K + Y."""
    r, e = eq.response[:, pair], eq.excitation[:, pair]
    d = eq.measured[:, pair] - eq.rigid[:, pair]
    return d, r[:, 0] * e[:, 0], r[:, 0] * e[:, 1] + r[:, 1] * e[:, 0], r[:, 1] * e[:, 1]


def _single(eq: Equations, pair: int) -> list[NDArray[np.complex128]]:
    d, a, b, c = _polynomial(eq, pair)
    y = eq.surroundings[:, pair]
    whole = eq.known + y
    s, t, both = whole[:, 0, 0], whole[:, 1, 1], whole[:, 0, 1]
    (term,) = eq.terms
    if term == "k_y":
        return [((a * t - b * both + d * both**2) / (d * t - c) - y[:, 0, 0])[:, None]]
    if term == "k_theta":
        return [((c * s - b * both + d * both**2) / (d * s - a) - y[:, 1, 1])[:, None]]
    return [(root - y[:, 0, 1])[:, None] for root in roots(d, -b, a * t + c * s - d * s * t)]


def _double(eq: Equations, pair: tuple[int, ...]) -> list[NDArray[np.complex128]]:
    """Return both solutions of two pairs of one structure for two terms."""
    first, second = (_polynomial(eq, one) for one in pair)
    d = first[0]
    # Without the determinant: alpha t - beta B + gamma s = 0.
    alpha, beta, gamma = (second[0] * u - first[0] * v for u, v in zip(first[1:], second[1:], strict=True))
    _, a, b, c = first
    y = eq.surroundings[:, 0]
    whole = eq.known + y
    s, t, both = whole[:, 0, 0], whole[:, 1, 1], whole[:, 0, 1]
    solutions = []
    if "k_ytheta" not in eq.terms:
        # s = p + q t
        p, q = beta * both / gamma, -alpha / gamma
        for root in roots(d * q, d * p - a - c * q, b * both - c * p - d * both**2):
            solutions.append({"k_y": p + q * root, "k_theta": root, "k_ytheta": both})
    elif "k_y" in eq.terms:
        # s = p + q B
        p, q = -alpha * t / gamma, beta / gamma
        for root in roots(-d, d * q * t + b - c * q, d * p * t - a * t - c * p):
            solutions.append({"k_y": p + q * root, "k_theta": t, "k_ytheta": root})
    else:
        p, q = -gamma * s / alpha, beta / alpha
        for root in roots(-d, d * q * s + b - a * q, d * p * s - c * s - a * p):
            solutions.append({"k_y": s, "k_theta": p + q * root, "k_ytheta": root})
    return [np.stack([found[term] - y[:, *TERMS[term]] for term in eq.terms], axis=1) for found in solutions]


def roots(
    a: NDArray[np.complex128], b: NDArray[np.complex128], c: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return both roots of a x^2 + b x + c, neither as a difference of nearly equal numbers."""
    root = np.sqrt(b * b - 4.0 * a * c)
    root = np.where((np.conj(b) * root).real < 0.0, -root, root)
    large = -0.5 * (b + root)
    return large / a, c / large


def _best_of_grid(eq: Equations) -> list[NDArray[np.complex128]]:
    y = np.exp(np.mean(np.log(np.abs(eq.surroundings) + 1e-300), axis=1))
    around = {"k_y": y[:, 0, 0], "k_theta": y[:, 1, 1]}
    free = [term for term in eq.terms if term in around]
    points = []
    for shares in np.stack(np.meshgrid(*[_GRID] * len(free)), -1).reshape(-1, len(free)):
        values = dict(zip(free, shares, strict=True))
        columns = [
            around[t] * values[t] * (1.0 + 0.02j) if t in values else np.zeros(len(y), np.complex128) for t in eq.terms
        ]
        points.append(np.stack(columns, axis=1))
    costs = np.stack([eq.cost(x) for x in points])
    order = np.argsort(costs, axis=0)[:_BEST]
    rows = np.arange(len(y))
    return [np.stack(points)[which, rows] for which in order]


def polished(eq: Equations, x: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the least squares near a start on each line: Levenberg and Marquardt's steps, all lines at once."""
    result = np.where(np.isfinite(x), x, 1.0)
    lines = np.arange(len(x))
    x, cost, damping = result, eq.cost(result), np.full(len(x), 1e-3)
    for _ in range(_STEPS):
        step = _step(eq, x, damping)
        tried = x + step
        new = eq.cost(tried)
        better = new < cost
        moved = np.max(np.abs(step) / (np.abs(x) + 1e-300), axis=1)
        x, cost = np.where(better[:, None], tried, x), np.where(better, new, cost)
        damping = np.where(better, np.maximum(damping * 0.1, 1e-15), damping * 10.0)
        result[lines] = x
        on = (moved > _SETTLED) & (damping < 1e6)
        if not on.any():
            break
        if on.sum() < 0.7 * on.size:
            # Lines that have settled need no more work.
            eq, lines, x, cost, damping = eq.on(on), lines[on], x[on], cost[on], damping[on]
    return result


def _step(eq: Equations, x: NDArray[np.complex128], damping: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return a damped step on each line, none where the model has no value."""
    h, slope = eq.evaluate(x)
    weight = 1.0 / (eq.measured * eq.deviation)
    slope = slope * weight[..., None]
    residual = (h - eq.measured) * weight
    normal = np.einsum("npi,npj->nij", slope.conj(), slope)
    size = np.maximum(np.sqrt(np.abs(np.einsum("nii->ni", normal))), 1e-300)
    normal = normal / (size[:, :, None] * size[:, None, :]) + damping[:, None, None] * np.eye(x.shape[1])
    gradient = np.einsum("npi,np->ni", slope.conj(), residual) / size
    usable = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(gradient).all(axis=1)
    normal = np.where(usable[:, None, None], normal, np.eye(x.shape[1]))
    found: NDArray[np.complex128] = -np.linalg.solve(normal, gradient[..., None])[..., 0] / size
    return np.where(usable[:, None], found, 0.0)


def _agreed(
    eq: Equations, found: NDArray[np.complex128], costs: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.float64] | None]:
    """Return on each line the solution that agrees with the other lines, of those that fit about as well.

    Also where several fit, and the real parts that most lines are near, if there were any to choose from.
    """
    best = np.argmin(costs, axis=1)
    rows = np.arange(len(found))
    chosen = found[rows, best]
    # A closed solution fits to rounding, so that of its two neither is the better fit.
    good = costs <= np.maximum(costs[rows, best] + _AS_GOOD, 2.0 * costs[rows, best])[:, None]
    scale = np.stack([eq.scale(found[:, i]) for i in range(found.shape[1])], axis=1)
    apart = np.max(np.abs(found - chosen[:, None]) / scale, axis=-1) > 1e-6
    ambiguous = np.any(good & apart, axis=1)
    if not ambiguous.any():
        return chosen, ambiguous, None
    relative = eq.noise(chosen) / eq.scale(chosen)
    weight = 1.0 / (0.05 + np.max(relative, axis=1))
    weight = np.where(np.isfinite(weight), weight, 0.0)
    diagonal = [i for i, term in enumerate(eq.terms) if term != "k_ytheta"]
    least, centre = np.inf, None
    for line in np.argsort(-weight)[:_CENTRES]:
        for which in np.flatnonzero(good[line]):
            middle = found[line, which].real
            if np.any(middle[diagonal] <= 0.0):
                continue
            total = float(np.sum(weight * np.min(_distance(found, good, middle, scale[line, which]), axis=1)))
            if total < least:
                least, centre = total, (middle, scale[line, which])
    if centre is None:
        return chosen, ambiguous, None
    nearest = np.argmin(_distance(found, good, *centre), axis=1)
    return found[rows, nearest], ambiguous, centre[0]


def _distance(
    found: NDArray[np.complex128], good: NDArray[np.bool_], middle: NDArray[np.float64], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how far every solution is from one, nothing counting more than its own size."""
    off = np.sum(np.abs(found.real - middle) / scale, axis=-1)
    off = off / (1.0 + off)
    return np.where(good & np.isfinite(off), off, 2.0)


def _pseudo_inverse(matrix: NDArray[np.complex128], rcond: float) -> NDArray[np.complex128]:
    """Return the pseudo-inverses `(n, m, p)` of `(n, p, m)`, not a number where a matrix is not finite.

    LAPACK stops at the first matrix that is not finite, and one degenerate line must not take the others with it.
    """
    finite = np.isfinite(matrix).all(axis=(1, 2))
    result = np.full(matrix.transpose(0, 2, 1).shape, np.nan, dtype=np.complex128)
    result[finite] = np.linalg.pinv(matrix[finite], rcond=rcond)
    return result


def _inverse(matrix: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the inverse of 2 x 2 matrices, symmetric ones."""
    s, t, both = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 0, 1]
    determinant = s * t - both * both
    rows = [np.stack([t, -both], axis=-1), np.stack([-both, s], axis=-1)]
    result: NDArray[np.complex128] = np.stack(rows, axis=-2) / determinant[..., None, None]
    return result


def constant_joint(
    equations: Equations, start: NDArray[np.float64], lines: NDArray[np.bool_]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the k + i w c near a start `(m, 2)` that fits the lines best: misfit, stiffnesses, dashpots `(m,)`.

    Least squares of the logarithm. Stiffnesses but the coupling's keep their signs.
    """
    w, count = equations.angular_frequency, len(equations.terms)
    begun = start.T.reshape(-1)
    # Variables of about one: stiffnesses and dashpots differ by orders of magnitude.
    scale = np.where(begun != 0.0, np.abs(begun), np.median(np.abs(begun)) + 1e-300)

    def evaluate(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        v = scale * x
        with np.errstate(all="ignore"):
            h, slope = equations.evaluate(v[:count] + 1j * w[:, None] * v[count:])
            residual = np.log(h / equations.measured) / equations.deviation
            slope = slope / (h * equations.deviation)[..., None]
            slope = np.concatenate([slope, 1j * w[:, None, None] * slope], axis=-1)[lines].reshape(-1, 2 * count)
        flat = residual[lines].reshape(-1)
        return np.concatenate([flat.real, flat.imag]), np.concatenate([slope.real, slope.imag]) * scale

    limits = np.array([[-np.inf], [np.inf]]) * np.ones(2 * count)
    for column, term in enumerate(equations.terms):
        if term != "k_ytheta":
            limits[0 if begun[column] >= 0.0 else 1, column] = 0.0
    problem = _core.Problem(np.zeros(2 * count, dtype=np.bool_), limits, np.zeros((0, 3)), 1)
    problem.add_function(evaluate)
    free = np.ones(2 * count, dtype=np.bool_)
    end = problem.fit((begun / scale)[None], free, np.array([_STEPS]), _TOLERANCE)
    v = scale * end.x[0]
    return 2.0 * float(end.cost[0]), v[:count], v[count:]


def coarse_joints(equations: Equations, lines: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """Return the few points of a grid of constant joints that fit the lines best, as starts `(m, 2)`."""
    around = np.median(np.abs(equations.surroundings), axis=(0, 1))
    free = [term for term in equations.terms if term != "k_ytheta"]
    w = equations.angular_frequency
    chosen = equations.on(lines)
    starts, costs = [], []
    for shares in np.stack(np.meshgrid(*[_GRID] * len(free)), -1).reshape(-1, len(free)):
        values = dict(zip(free, shares, strict=True))
        k = np.array([values[t] * around[TERMS[t]] if t in values else 0.0 for t in equations.terms])
        start = np.stack([k, 0.02 * k / float(np.median(w.real))], axis=1)
        h, _ = chosen.evaluate(start[:, 0] + 1j * w[lines][:, None] * start[:, 1])
        cost = np.sum(np.abs(np.log(h / chosen.measured) / chosen.deviation) ** 2)
        starts.append(start)
        costs.append(cost if np.isfinite(cost) else np.inf)
    return [starts[i] for i in np.argsort(costs)[:_FOLLOWED]]


def names_of(terms: Sequence[str]) -> str:
    """Return names of terms as text."""
    return " and ".join(terms) if len(terms) < 3 else ", ".join(terms[:-1]) + f" and {terms[-1]}"
