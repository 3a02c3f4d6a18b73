"""Several overhangs of one tool in one holder, joint and tolerances together, by SciPy's least squares.

Everything is a series in w^2 (see ``series``), and so are its derivatives: with T(s) the transfer matrix of a segment,
G its generator times the length, and loads and slopes measured in units that go with the diameter d and the modulus E,

    dT/dln L = G T,   dT/dln rho = s T',   dT/dln E = [K_E, T] - s T',   dT/dln d = [K_d, T] - G T + 2 s T',

K_E = diag(0, 0, 1, 1), K_d = diag(0, -1, 1, 2) for a solid section. With viscous joints the receptance is
(A + iw B) / (C + iw D) of series A to D, so a point is one product of coefficients with hoisted powers of w^2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from .segment import Complex, Real, segment_constants
from .series import PAIRS, degree_for, generators, minors_generator, powers_of, propagate, wave_span

LENGTH, DIAMETER, MODULUS, DENSITY = range(4)
COLUMNS = (2, 3, 5, 6)
"""Where these four stand in a segment's row."""
K_MODULUS, K_DIAMETER = np.array([0.0, 0.0, 1.0, 1.0]), np.array([0.0, -1.0, 1.0, 2.0])


class Error(NamedTuple):
    """An error in standard deviations: which quantity of the tool or the holder it moves, by how much.

    Attributes
    ----------
    holder : whether it is the holder's, of all its segments.
    quantity : LENGTH, DIAMETER, MODULUS or DENSITY.
    deviation : in SI units, or of the logarithm where ``relative``.
    overhang : the overhang that has it, None for all.
    """

    holder: bool
    quantity: int
    deviation: float
    relative: bool
    overhang: int | None = None


def transfers(row: Real, reference: float, powers: int) -> tuple[list[Complex], list[Complex]]:
    """Transfer matrix of the minors, and of the states, (d, d, powers), each with its four logarithmic derivatives."""
    constants = segment_constants(row)
    fixed, inertial = (matrix[0] for matrix in generators(constants, reference))
    own = min(degree_for(float(wave_span(constants, reference)[0])), powers)
    results = []
    for a, b, weights in (
        (minors_generator(fixed), minors_generator(inertial), lambda k: np.array([k[i] + k[j] for i, j in PAIRS])),
        (fixed, inertial, lambda k: k),
    ):
        size = len(a)
        start = np.zeros((size, own, size), dtype=np.complex128)
        start[:, 0] = np.eye(size)
        matrix = propagate(a, b, start).transpose(1, 0, 2)
        by_length = a @ matrix
        by_length[1:] += b @ matrix[:-1]
        by_square = matrix * np.arange(own)[:, None, None]

        def similar(k: Real, matrix: Complex = matrix) -> Complex:
            return k[:, None] * matrix - matrix * k

        by_diameter = similar(weights(K_DIAMETER)) - by_length + 2 * by_square
        by_modulus = similar(weights(K_MODULUS)) - by_square
        results.append([matrix, by_length, by_diameter, by_modulus, by_square])
    return results[0], results[1]


def apply(matrix: Complex, columns: Complex) -> Complex:
    """Product of series: (own powers, d', d) times (d, powers, n), cut to the powers of the second."""
    count, size, _ = matrix.shape
    d, powers, n = columns.shape
    result = np.zeros((size, powers, n), dtype=np.complex128)
    flat = columns.reshape(d, -1)
    for k in range(min(count, powers)):
        result[:, k:] += (matrix[k] @ flat[:, : (powers - k) * n]).reshape(size, powers - k, n)
    return result


def times(first: Complex, second: Complex) -> Complex:
    """Product of two series over the first axes of both, (p,) and (..., p)."""
    result = np.zeros_like(second)
    for k, value in enumerate(first):
        if value:
            result[..., k:] += value * second[..., : second.shape[-1] - k]
    return result


class CampaignResidual:
    """Weighted complex log residuals of all overhangs and the priors of the errors, and their Jacobian.

    Parameters
    ----------
    angular_frequency : (n,) real, the same for all overhangs [rad/s].
    measured : (n_overhangs, n) tip receptances.
    deviation : standard deviation of the logarithm.
    tools : (n_overhangs, 14) a segment row each, solid.
    holder : (m, 14) solid.
    errors : tolerances.
    """

    def __init__(
        self,
        angular_frequency: Real,
        measured: Complex,
        deviation: float,
        tools: Real,
        holder: Real,
        errors: list[Error],
    ) -> None:
        self.w, self.measured, self.weight = angular_frequency, measured, 1.0 / deviation
        self.tools, self.holder, self.errors = tools, holder, errors
        self.reference = float(angular_frequency.max())
        span = max(float(wave_span(segment_constants(np.vstack([row, holder])), self.reference).sum()) for row in tools)
        # One more for the product of the dampings.
        self.powers = degree_for(span) + 1
        square = (angular_frequency / self.reference) ** 2
        self.table = powers_of(square, self.powers, np.empty((self.powers, square.size)))
        self.at: Real | None = None
        self.size = 2 * measured.size + len(errors)

    def __call__(self, x: Real) -> Real:
        """Residuals: real, then imaginary parts of each overhang; last the errors."""
        self._evaluate(x)
        return self.residual

    def jacobian(self, x: Real) -> Real:
        """Jacobian (size, 4 + n_errors)."""
        self._evaluate(x)
        return self.columns.T

    def _evaluate(self, x: Real) -> None:
        if self.at is not None and np.array_equal(x, self.at):
            return
        n = self.w.size
        self.residual, self.columns = np.empty(self.size), np.zeros((x.size, self.size))
        joint, errors = 10.0 ** x[:4], x[4:]
        behind = self._holder(errors)
        for index, tool in enumerate(self.tools):
            self._overhang(index, tool, joint, errors, behind, slice(2 * n * index, 2 * n * (index + 1)))
        self.residual[-errors.size :] = errors
        self.columns[4:, -errors.size :] = np.eye(errors.size)
        self.at = x.copy()

    def _changed(
        self, row: Real, errors: Real, holder: bool, overhang: int | None
    ) -> tuple[Real, list[tuple[int, int, float]]]:
        """A row with the errors in it, and which errors it has: number, quantity, logarithmic rate."""
        row, own = row.copy(), []
        for number, (error, value) in enumerate(zip(self.errors, errors, strict=True)):
            if error.holder != holder or error.overhang not in (None, overhang):
                continue
            column = COLUMNS[error.quantity]
            if error.relative:
                row[column] *= np.exp(error.deviation * value)
            else:
                row[column] += error.deviation * value
            own.append((number, error.quantity, error.deviation))
        relative = [self.errors[number].relative for number, _, _ in own]
        return row, [
            (number, quantity, rate if log else rate / row[COLUMNS[quantity]])
            for (number, quantity, rate), log in zip(own, relative, strict=True)
        ]

    def _holder(self, errors: Real) -> tuple[Complex, list[int]]:
        """Minors behind the joint and their derivatives by the holder's errors, (6, powers, 1 + n)."""
        mine = [number for number, error in enumerate(self.errors) if error.holder]
        minors = np.zeros((6, self.powers, 1 + len(mine)), dtype=np.complex128)
        minors[0, 0, 0] = 1
        for row in self.holder[::-1]:
            row, own = self._changed(row, errors, True, None)
            matrices, _ = transfers(row, self.reference, self.powers)
            # The changes of the matrix act on the minors before this segment.
            more = [rate * matrices[1 + quantity] for _, quantity, rate in own]
            new = apply(np.concatenate([matrices[0], *more], axis=1), minors[:, :, :1])
            minors = np.concatenate([new[:6], apply(matrices[0], minors[:, :, 1:])], axis=2)
            for place, (number, _, _) in enumerate(own):
                minors[:, :, 1 + mine.index(number)] += new[6 * (place + 1) : 6 * (place + 2), :, 0]
        return minors, mine

    def _overhang(
        self, index: int, row: Real, joint: Real, errors: Real, behind: tuple[Complex, list[int]], rows: slice
    ) -> None:
        row, own = self._changed(row, errors, False, index)
        minors, states = transfers(row, self.reference, self.powers)
        coefficients, mine = _at_joint(behind[0]), [number for number, _, _ in own] + behind[1]
        # The four parts with 1, k1, k2, k1 k2 in front become A and iw B at once, before the tool is passed.
        above = self._joined(coefficients, joint)
        more = [rate * minors[1 + quantity] for _, quantity, rate in own]
        # Only the rows y M and V M of the minors are needed at the tip.
        pick = np.concatenate([matrix[:, [2, 5]] for matrix in (minors[0], *more)], axis=1)
        front = apply(pick, above[0])
        rear = apply(minors[0][:, [2, 5]], np.concatenate(above[1:], axis=2)) if len(above) > 1 else None
        pairs = [front[2 * i : 2 * i + 2] for i in range(1 + len(own))]
        if rear is not None:
            pairs += [rear[:, :, 2 * i : 2 * i + 2] for i in range(len(above) - 1)]
        motion = self._motion(behind[0][:, :, 0], states[0], joint)
        functions = np.concatenate([np.stack(pairs), motion[None]])
        values = self._values(functions)
        self._fill(index, values, joint, mine, rows)

    def _joined(self, parts: list[Complex], joint: Real) -> list[Complex]:
        """Minors on the joint's tool side as (6, powers, 2): A and B of A + iw B, for the holder and each change."""
        k_y, k_theta, c_y, c_theta = joint
        joined = []
        for both, rotation, translation, none in parts:
            # k1 k2 x both + k2 x rotation + k1 x translation + none
            a = k_y * k_theta * both + k_theta * rotation + k_y * translation + none
            a[:, 1:] -= self.reference**2 * c_y * c_theta * both[:, :-1]
            b = (k_y * c_theta + k_theta * c_y) * both + c_theta * rotation + c_y * translation
            joined.append(np.stack([a, b], axis=2))
        return joined

    def _motion(self, minors: Complex, states: Complex, joint: Real) -> Complex:
        """The joint's motions d_y and d_theta under a unit tip force, A and B of each, (2, powers, 2)."""
        k_y, k_theta, c_y, c_theta = joint
        _, yv, ym, tv, tm, vm = minors
        to_y, to_t, to_v, to_m = states[:, 3].T
        x0 = -times(to_y, yv) - times(to_t, tv) + times(to_m, vm)
        x1 = times(to_t, vm)
        y0 = -(times(to_y, ym) + times(to_t, tm) + times(to_v, vm))
        y1 = -times(to_y, vm)
        return np.stack(
            [
                np.stack([k_theta * x0 + x1, c_theta * x0], axis=1),
                np.stack([k_y * y0 + y1, c_y * y0], axis=1),
            ]
        )

    def _values(self, functions: Complex) -> Complex:
        """A + iw B on all lines, (..., n), from (..., powers, 2)."""
        a, b = functions[..., 0].reshape(-1, self.powers), functions[..., 1].reshape(-1, self.powers)
        count = len(a)
        parts = np.concatenate([a.real, a.imag, b.real, b.imag]) @ self.table
        parts[2 * count :] *= self.w
        values = np.empty((count, self.w.size), dtype=np.complex128)
        np.subtract(parts[:count], parts[3 * count :], out=values.real)
        np.add(parts[count : 2 * count], parts[2 * count : 3 * count], out=values.imag)
        return values.reshape(*functions.shape[:-2], -1)

    def _fill(self, index: int, values: Complex, joint: Real, mine: list[int], rows: slice) -> None:
        n = self.w.size
        above, below = values[0]
        both = 1.0 / (above * below)
        ratio = self.measured[index] * below * (both * below)
        start, middle, stop = rows.start, rows.start + n, rows.stop
        self.residual[start:middle] = 0.5 * self.weight * np.log(ratio.real**2 + ratio.imag**2)
        self.residual[middle:stop] = self.weight * np.arctan2(ratio.imag, ratio.real)
        moves = values[-1] ** 2 * both
        moves *= self.weight * np.log(10.0)
        for k, move in enumerate(moves):
            self.columns[k, start:middle] = joint[k] * move.real
            self.columns[k, middle:stop] = joint[k] * move.imag
            self.columns[2 + k, start:middle] = -joint[2 + k] * self.w * move.imag
            self.columns[2 + k, middle:stop] = joint[2 + k] * self.w * move.real
        slopes = values[1:-1, 1] * (self.weight * both * above) - values[1:-1, 0] * (self.weight * both * below)
        for number, slope in zip(mine, slopes, strict=True):
            self.columns[4 + number, start:middle] = slope.real
            self.columns[4 + number, middle:stop] = slope.imag


def _at_joint(behind: Complex) -> list[list[Complex]]:
    """The four parts of the minors on the joint's tool side, for the holder and each of its changes, (6, powers)."""
    zero = np.zeros_like(behind[0, :, 0])
    found = []
    for k in range(behind.shape[2]):
        _, _, ym, tv, _, vm = behind[:, :, k]
        found.append(
            [
                behind[:, :, k],
                np.array([-tv, zero, vm, zero, zero, zero]),
                np.array([ym, zero, zero, -vm, zero, zero]),
                np.array([vm, zero, zero, zero, zero, zero]),
            ]
        )
    return found


class CampaignFit(NamedTuple):
    """The best of SciPy's results, residuals and Jacobians in all starts."""

    best: OptimizeResult
    evaluations: int
    jacobians: int


def fit_campaign(residual: CampaignResidual, starts: Real, bounds: tuple[Real, Real], tolerance: float) -> CampaignFit:
    """Fit from every start."""
    options = {"xtol": tolerance, "ftol": tolerance, "gtol": tolerance, "x_scale": "jac", "max_nfev": 200}
    found = [least_squares(residual, x, jac=residual.jacobian, bounds=bounds, **options) for x in starts]
    best = min(found, key=lambda one: one.cost)
    return CampaignFit(best, sum(one.nfev for one in found), sum(one.njev for one in found))
