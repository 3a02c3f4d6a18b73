"""The complex stiffness of a joint from receptances, line by line, and one constant joint fitted to all lines.

Let H be the receptance with a rigid joint, F the force in the rigid joint under a unit load, and Y the force per gap
imposed in it. A joint of stiffness K adds its compliance in series:

    H_measured = H + F_r^T (K + Y)^-1 F_e,                                                            (T8) in the theory

This is linear in X = (K + Y)^-1: three independent pairs of coordinates give X, and K = X^-1 - Y. With fewer unknown
terms the equations det(K + Y) (H_measured - H) = F_r^T adj(K + Y) F_e are bilinear in them. Eliminating the
determinant from two of them leaves a linear relation; with it, either equation is quadratic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance import _core
from receptance.fit.search import START_LOSS_FACTOR

TERMS = {"k_y": (0, 0), "k_theta": (1, 1), "k_ytheta": (0, 1)}
"""Terms of the joint's stiffness and their positions in the matrix."""
_MAX_ITERATIONS = 40
_STIFFNESS_LIMIT = 1e16
"""A search does not go beyond this stiffness, which no joint has."""
_STEP_TOLERANCE = 1e-12
"""Relative step at which a line has converged."""
_GRID = (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3)
"""Starts without a closed form, relative to the stiffness of the adjoining structure."""
_CONSTANT_STARTS = 6
"""Grid points that are refined on all lines together."""
_EQUIVALENT = 4.0
"""Solutions whose sum of squares is larger by up to this much, in variances, are not rejected by the data."""
_CENTRES = 40
"""Lines whose solutions are tried as the common value when one of several solutions is selected."""
_SHOWN = 5
"""Number of masked lines that are listed by their frequency."""
_CONSTANT_TOLERANCE = 1e-8
"""Relative change of misfit and variables at which the fit of a constant joint has converged."""


@dataclass(frozen=True)
class Equations:
    """One equation for each pair of coordinates on each line."""

    rigid: NDArray[np.complex128]
    """`(n, p)` receptance with the joint rigid."""
    measured: NDArray[np.complex128]
    """`(n, p)` measured receptance."""
    response: NDArray[np.complex128]
    """`(n, p, 2)` force in the rigid joint under a unit load at the response."""
    excitation: NDArray[np.complex128]
    """The same for the excitation."""
    surroundings: NDArray[np.complex128]
    """`(n, p, 2, 2)` force in the joint per gap imposed in it: the dynamic stiffness of the adjoining structure."""
    deviation: NDArray[np.float64]
    """`(n, p)` standard deviation of the real and of the imaginary part of the logarithm."""
    known: NDArray[np.complex128]
    """`(n, 2, 2)` known part of the joint's stiffness."""
    angular_frequency: NDArray[np.complex128]
    """`(n,)`."""
    terms: tuple[str, ...]
    """The `m` unknown terms."""

    @property
    def one_structure(self) -> bool:
        """Whether all pairs were measured on one structure."""
        return bool(np.all(self.surroundings == self.surroundings[:, :1]))

    def select(self, lines: NDArray[np.bool_] | NDArray[np.intp]) -> Equations:
        """Return the equations of selected lines."""
        arrays = [column.name for column in fields(self) if column.name != "terms"]
        return replace(self, **{name: getattr(self, name)[lines] for name in arrays})

    @cached_property
    def products(self) -> NDArray[np.complex128]:
        """Coefficients `(n, p, 3)` of X_yy, X_tt and X_yt in the measured less the rigid receptance."""
        r, e = self.response, self.excitation
        both = r[..., 0] * e[..., 1] + r[..., 1] * e[..., 0]
        return np.stack([r[..., 0] * e[..., 0], r[..., 1] * e[..., 1], both], axis=-1)

    def of_pairs(self, pairs: Sequence[int]) -> Equations:
        """Return the equations of selected pairs."""
        arrays = ("rigid", "measured", "response", "excitation", "surroundings", "deviation")
        return replace(self, **{name: getattr(self, name)[:, pairs] for name in arrays})

    def terms_of(self, matrix: NDArray[Any]) -> NDArray[Any]:
        """Return the unknown terms `(n, m)` of matrices `(n, 2, 2)`."""
        return np.stack([matrix[:, *TERMS[term]] for term in self.terms], axis=1)

    def stiffness(self, x: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the stiffness matrices `(n, 2, 2)` for values of the unknown terms `(n, m)`."""
        result = self.known.copy()
        for column, term in enumerate(self.terms):
            i, j = TERMS[term]
            result[:, i, j] = result[:, j, i] = x[:, column]
        return result

    def evaluate(self, x: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the receptances `(n, p)` and their derivatives with respect to the unknown terms `(n, p, m)`."""
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
        """Return the sum of squares on each line, in variances; infinite where there is no value."""
        h, _ = self.evaluate(x)
        result: NDArray[np.float64] = np.sum(np.abs((h / self.measured - 1.0) / self.deviation) ** 2, axis=1)
        return np.where(np.isfinite(result) & (np.abs(x) < _STIFFNESS_LIMIT).all(axis=1), result, np.inf)

    def sensitivity(self, x: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the derivatives of the solution with respect to the logarithms of the receptances, `(n, m, p)`."""
        h, slope = self.evaluate(x)
        return _pseudo_inverse(slope / (h * self.deviation)[..., None]) / self.deviation[:, None, :]

    def standard_deviation(self, x: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the standard deviation of the real and of the imaginary part of the terms, each, `(n, m)`."""
        moved = self.sensitivity(x) * self.deviation[:, None, :]
        result: NDArray[np.float64] = np.sqrt(np.sum(np.abs(moved) ** 2, axis=2))
        return result

    def scale(self, x: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the reference of relative errors: the term itself, for the coupling sqrt(|k_y k_theta|), `(n, m)`."""
        k = np.abs(self.stiffness(x))
        k[:, 0, 1] = np.sqrt(k[:, 0, 0] * k[:, 1, 1])
        return self.terms_of(k)

    def rank(self, x: NDArray[np.complex128]) -> NDArray[np.intp]:
        """Return the number of terms that the pairs can separate on each line; zero where the model has no value."""
        h, slope = self.evaluate(x)
        relative = slope / h[..., None] * self.scale(x)[:, None, :]
        size = np.linalg.norm(relative, axis=1, keepdims=True)
        relative = relative / np.where(size > 0.0, size, 1.0)
        finite = np.isfinite(relative).all(axis=(1, 2))
        result: NDArray[np.intp] = np.zeros(len(relative), dtype=np.intp)
        result[finite] = np.sum(np.linalg.svd(relative[finite], compute_uv=False) > 1e-9, axis=1)
        return result

    def determined(self, x: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.intp]]:
        """Return a solution with zeros on lines without a value, and the number of terms determined on each line."""
        with np.errstate(all="ignore"):
            good = np.isfinite(x).all(axis=1) & np.isfinite(self.cost(np.where(np.isfinite(x), x, 1.0)))
            x = np.where(good[:, None], x, 0.0)
            return x, np.where(good, self.rank(x), 0)

    def conditions(
        self, x: NDArray[np.complex128], good: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], NDArray[np.complex128], NDArray[np.float64]]:
        """Return which good lines have finite sensitivities, these relative to the scale, and condition numbers.

        On the other lines the sensitivities `(n, m, p)` are zero and the condition numbers `(n,)` infinite.
        """
        with np.errstate(all="ignore"):
            relative = self.sensitivity(x) / self.scale(x)[..., None]
        good = good & np.isfinite(relative).all(axis=(1, 2))
        relative = np.where(good[:, None, None], relative, 0.0)
        return good, relative, np.where(good, np.linalg.norm(relative, ord=2, axis=(1, 2)), np.inf)


def solve_lines(equations: Equations) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Solve for the unknown terms on each line, `(n, m)`.

    The mask `(n,)` tells on which lines several solutions fit; the one closest to those of the other lines was
    selected.
    """
    count, pairs = len(equations.terms), equations.rigid.shape[1]
    linear = equations.one_structure and pairs >= len(TERMS)
    with np.errstate(all="ignore"):
        solutions = [linear_solution(equations)] if linear else []
        if not linear or count < len(TERMS):
            solutions += quadratic_solutions(equations)
        if pairs > count:
            solutions = [refine(equations, x) for x in solutions]
        return _select_consistent(equations, solutions)


def linear_solution(eq: Equations) -> NDArray[np.complex128]:
    """Return the terms of X^-1 - Y for pairs of one structure, X by weighted linear least squares."""
    weight = 1.0 / (np.abs(eq.measured) * eq.deviation)
    right = (eq.measured - eq.rigid) * weight
    x = np.einsum("nmp,np->nm", _pseudo_inverse(eq.products * weight[..., None]), right)
    return eq.terms_of(_inverse(np.stack([x[:, [0, 2]], x[:, [2, 1]]], axis=1)) - eq.surroundings[:, 0])


def quadratic_solutions(eq: Equations) -> list[NDArray[np.complex128]]:
    """Return both solutions of as many pairs as unknown terms, two approximate ones of more pairs.

    With d the measured less the rigid receptance, each equation is linear in the terms and in det K:
    d det(K + Y) = a (K_tt + Y_tt) - b (K_yt + Y_yt) + c (K_yy + Y_yy). As many equations as unknown terms leave a line
    p + lambda q in the space of det K and these terms, and the determinant of its terms is quadratic in lambda. Of more
    equations the singular values but the smallest count.
    """
    y = eq.surroundings
    y_yy, y_tt, y_yt = y[..., 0, 0], y[..., 1, 1], y[..., 0, 1]
    d = eq.measured - eq.rigid
    a, c, b = np.moveaxis(eq.products, -1, 0)
    mean = np.abs(y).mean(axis=1)
    size_y, size_t = mean[:, 0, 0], mean[:, 1, 1]
    sizes = np.stack([size_y * size_t, size_y, size_t, np.sqrt(size_y * size_t)], axis=1)
    rows = np.stack([d, d * y_tt - c, d * y_yy - a, b - 2.0 * d * y_yt], axis=-1) * sizes[:, None, :]
    right = a * y_tt - b * y_yt + c * y_yy - d * (y_yy * y_tt - y_yt**2)
    # Columns are det K and the terms in the order of TERMS; known terms go to the right-hand side.
    fixed = np.stack([eq.known[:, *at] for at in TERMS.values()], axis=1) / sizes[:, 1:]
    unknown = [name in eq.terms for name in TERMS]
    fixed[:, unknown] = 0.0
    right = right - np.einsum("npi,ni->np", rows[..., 1:], fixed)
    rows = rows[..., [True, *unknown]]
    count = len(eq.terms)
    norm = np.linalg.norm(rows, axis=-1)
    rows, right = rows / norm[..., None], right / norm
    finite = np.isfinite(rows).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    left, singular, vectors = np.linalg.svd(np.where(finite[:, None, None], rows, 0.0))
    vectors = vectors.conj().transpose(0, 2, 1)
    right = np.einsum("npi,np->ni", left[:, :, :count].conj(), np.where(finite[:, None], right, np.nan))
    p, q = np.zeros((len(d), 4), np.complex128), np.zeros((len(d), 4), np.complex128)
    p[:, 1:] = fixed
    p[:, [True, *unknown]] = np.einsum("nij,nj->ni", vectors[:, :, :count], right / singular[:, :count])
    q[:, [True, *unknown]] = vectors[:, :, count]
    second = q[:, 1] * q[:, 2] - q[:, 3] ** 2
    first = p[:, 1] * q[:, 2] + p[:, 2] * q[:, 1] - 2.0 * p[:, 3] * q[:, 3] - q[:, 0]
    rest = p[:, 1] * p[:, 2] - p[:, 3] ** 2 - p[:, 0]
    solutions = [(p + root[:, None] * q) * sizes for root in _quadratic_roots(second, first, rest)]
    return [x[:, [False, *unknown]] for x in solutions]


def _quadratic_roots(
    a: NDArray[np.complex128], b: NDArray[np.complex128], c: NDArray[np.complex128]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return both roots of a x^2 + b x + c without cancellation."""
    root = np.sqrt(b * b - 4.0 * a * c)
    root = np.where((np.conj(b) * root).real < 0.0, -root, root)
    large = -0.5 * (b + root)
    return large / a, c / large


def refine(eq: Equations, x: NDArray[np.complex128], tolerance: float = _STEP_TOLERANCE) -> NDArray[np.complex128]:
    """Refine solutions by Gauss-Newton steps, vectorised over the lines.

    Every line is a least-squares problem of its own in one to three complex unknowns. A step that does not lower the
    cost of a line is repeated with a quarter of its length.
    """
    result, lines = x.copy(), np.arange(len(x))
    cost, length = eq.cost(x), np.ones(len(x))
    for _ in range(_MAX_ITERATIONS):
        step = length[:, None] * _gauss_newton_step(eq, x)
        new = eq.cost(x + step)
        better = new < cost
        x, cost = np.where(better[:, None], x + step, x), np.where(better, new, cost)
        length = np.where(better, np.minimum(2.0 * length, 1.0), 0.25 * length)
        result[lines] = x
        active = np.max(np.abs(step) / (np.abs(x) + 1e-300), axis=1) > tolerance
        if not active.any():
            break
        if active.sum() < 0.7 * active.size:
            eq, lines, x, cost, length = eq.select(active), lines[active], x[active], cost[active], length[active]
    return result


def _gauss_newton_step(eq: Equations, x: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the Gauss-Newton step on each line; zero where the model has no value."""
    h, slope = eq.evaluate(x)
    weight = 1.0 / (eq.measured * eq.deviation)
    slope = slope * weight[..., None]
    normal = np.einsum("npi,npj->nij", slope.conj(), slope)
    size = np.maximum(np.sqrt(np.abs(np.einsum("nii->ni", normal))), 1e-300)
    # The ridge of the order of rounding keeps LAPACK from stopping at a singular line.
    normal = normal / (size[:, :, None] * size[:, None, :]) + 1e-14 * np.eye(x.shape[1])
    gradient = np.einsum("npi,np->ni", slope.conj(), (h - eq.measured) * weight) / size
    usable = np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(gradient).all(axis=1)
    normal = np.where(usable[:, None, None], normal, np.eye(x.shape[1]))
    step: NDArray[np.complex128] = -np.linalg.solve(normal, gradient[..., None])[..., 0] / size
    return np.where(usable[:, None], step, 0.0)


def _select_consistent(
    eq: Equations, solutions: Sequence[NDArray[np.complex128]]
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Select one solution on each line, `(n, m)`; the mask `(n,)` tells on which lines several fit.

    Where several fit about equally well, the one closest to the solutions of the other lines is selected.
    """
    values = np.stack(solutions, axis=1)
    costs = np.stack([eq.cost(x) for x in solutions], axis=1)
    best = np.argmin(costs, axis=1)
    rows = np.arange(len(values))
    chosen = values[rows, best]
    # Closed solutions have rounding errors as residuals; the smaller one is not the better fit.
    good = costs <= np.maximum(costs[rows, best] + _EQUIVALENT, 2.0 * costs[rows, best])[:, None]
    scale = np.stack([eq.scale(x) for x in solutions], axis=1)
    apart = np.max(np.abs(values - chosen[:, None]) / scale, axis=-1) > 1e-6
    ambiguous = np.any(good & apart, axis=1)
    if not ambiguous.any():
        return chosen, ambiguous
    deviation = np.stack([eq.standard_deviation(x) for x in solutions], axis=1)
    weight = 1.0 / (0.05 + np.max(deviation[rows, best] / scale[rows, best], axis=1))
    weight = np.where(np.isfinite(weight), weight, 0.0)
    diagonal = [i for i, term in enumerate(eq.terms) if term != "k_ytheta"]
    least = np.inf
    for line in np.argsort(-weight)[:_CENTRES]:
        for which in np.flatnonzero(good[line]):
            middle = values[line, which].real
            if np.any(middle[diagonal] <= 0.0):
                continue
            # The error of a poorly determined solution may reach its standard deviation.
            off = np.sum(np.abs(values.real - middle) / np.hypot(scale[line, which], deviation), axis=-1)
            distance = np.where(good & np.isfinite(off), off / (1.0 + off), 2.0)
            total = float(np.sum(weight * np.min(distance, axis=1)))
            if total < least:
                least, chosen = total, values[rows, np.argmin(distance, axis=1)]
    return chosen, ambiguous


def _pseudo_inverse(matrix: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the pseudo-inverses `(n, m, p)` of `(n, p, m)` with columns scaled to length one before.

    Matrices that are not finite give NaN; LAPACK would stop at the first of them.
    """
    size = np.linalg.norm(matrix, axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    scaled = matrix / size
    finite = np.isfinite(scaled).all(axis=(1, 2))
    result = np.full(matrix.transpose(0, 2, 1).shape, np.nan, dtype=np.complex128)
    result[finite] = np.linalg.pinv(scaled[finite], rcond=1e-14)
    return result / size.transpose(0, 2, 1)


def _inverse(matrix: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the inverses of symmetric 2 x 2 matrices."""
    s, t, both = matrix[..., 0, 0], matrix[..., 1, 1], matrix[..., 0, 1]
    determinant = s * t - both * both
    rows = [np.stack([t, -both], axis=-1), np.stack([-both, s], axis=-1)]
    result: NDArray[np.complex128] = np.stack(rows, axis=-2) / determinant[..., None, None]
    return result


def constant_joint(
    equations: Equations, start: NDArray[np.float64], lines: NDArray[np.bool_]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Fit one joint k + i w c to the logarithms of the receptances on selected lines, from a start `(m, 2)` of k and c.

    Stiffnesses keep the signs of the start, except that of the coupling. The result is the sum of squares in variances,
    the stiffnesses and the dashpots, `(m,)` each.
    """
    chosen, count = equations.select(lines), len(equations.terms)
    w = chosen.angular_frequency
    begun = start.T.reshape(-1)
    # Variables of the order of one: stiffnesses and dashpots differ by orders of magnitude.
    scale = np.where(begun != 0.0, np.abs(begun), np.median(np.abs(begun)) + 1e-300)

    def evaluate(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        v = scale * x
        with np.errstate(all="ignore"):
            h, slope = chosen.evaluate(v[:count] + 1j * w[:, None] * v[count:])
            residual = np.log(h / chosen.measured) / chosen.deviation
            slope = slope / (h * chosen.deviation)[..., None]
            slope = np.concatenate([slope, 1j * w[:, None, None] * slope], axis=-1).reshape(-1, 2 * count)
        flat = residual.reshape(-1)
        return np.concatenate([flat.real, flat.imag]), np.concatenate([slope.real, slope.imag]) * scale

    limits = np.array([[-np.inf], [np.inf]]) * np.ones(2 * count)
    for column, term in enumerate(equations.terms):
        if term != "k_ytheta":
            limits[0 if begun[column] >= 0.0 else 1, column] = 0.0
    problem = _core.Problem(np.zeros(2 * count, dtype=np.bool_), limits, np.zeros((0, 3)), 1)
    problem.add_function(evaluate)
    free = np.ones(2 * count, dtype=np.bool_)
    end = problem.fit((begun / scale)[None], free, np.array([_MAX_ITERATIONS]), _CONSTANT_TOLERANCE)
    v = scale * end.x[0]
    return 2.0 * float(end.cost[0]), v[:count], v[count:]


def constant_grid_starts(equations: Equations, lines: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """Return the constant joints of a grid that fit the selected lines best, as starts `(m, 2)`."""
    chosen = equations.select(lines)
    w = chosen.angular_frequency
    around = chosen.terms_of(np.median(np.abs(chosen.surroundings), axis=(0, 1))[None])[0]
    values = [(0.0,) if term == "k_ytheta" else _GRID for term in equations.terms]
    starts, costs = [], []
    for share in product(*values):
        k = np.array(share) * around
        start = np.stack([k, START_LOSS_FACTOR * k / float(np.median(w.real))], axis=1)
        h, _ = chosen.evaluate(start[:, 0] + 1j * w[:, None] * start[:, 1])
        cost = np.sum(np.abs(np.log(h / chosen.measured) / chosen.deviation) ** 2)
        starts.append(start)
        costs.append(cost if np.isfinite(cost) else np.inf)
    return [starts[i] for i in np.argsort(costs)[:_CONSTANT_STARTS]]


def masked_lines(masked: NDArray[Any], count: int) -> str:
    """Return the note on the lines, of so many, whose equations have no finite and unique solution."""
    shown = ", ".join(f"{line:g}" for line in masked.real[:_SHOWN])
    more = f" and {masked.size - _SHOWN} more" if masked.size > _SHOWN else ""
    reason = "their equations have no finite and unique solution"
    return f"{masked.size} of {count} lines are masked, {reason}: {shown} Hz{more}"
