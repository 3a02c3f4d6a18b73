"""Modes of a spindle from equations for its receptances, added one at a time.

With s = i w and the pole p = w_r (-zeta + i (1 - zeta^2)^(1/2)) a mode of the shape psi = (y, theta), which is complex
where damping couples the modes, adds

    A / (s - p) + A* / (s - p*),    A = psi psi^T / (2 i w_r (1 - zeta^2)^(1/2)),

to the receptance of the spindle, see `Mode`. For a given pole this is linear in the symmetric matrix A. Each further
mode is tried at the poles at which a matrix A reduces the residuals most, beside all changes that the numbers fitted so
far can make; its largest singular value gives the shape. All numbers are fitted after each addition. Residuals are
linear in everything before the plane, so that an evaluation costs a few sums of modes and a projection. They are linear
about the spindle that was solved line by line, and, once the modes come near to it, about the modes. Candidates are
tried on some of the lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, _core
from receptance.coupling.line_equations import Equations

QUANTITIES = ("frequency_hz", "damping_ratio", "y", "theta", "y_imaginary", "theta_imaginary")
"""Numbers of a mode in the order of all arrays here."""
_Y, _THETA = 2, 3
_AT_LIMIT = 1e-3
"""Relative distance from the end of its side at which a mode is held there."""
_ACROSS = 1.3
"""Ratio of the start of a mode above the lines to the limit at which it was held."""
_POLES = 60
"""Natural frequencies at which a further mode is tried."""
_RATIOS = (0.01, 0.05)
"""Damping ratios of these modes."""
_BESIDE = 2.0
"""Factor between the ends of the lines and the lowest and highest of these frequencies."""
_TRIED = 3
"""Number of the best candidates that are fitted."""
_APART = 0.1
"""Least relative distance of the natural frequencies of two of them."""
_EVALUATIONS = 80
"""Largest number of evaluations of each of these fits."""
_TOLERANCE = 1e-5
"""Relative change at which they have converged."""
_EVALUATIONS_AGAIN = 40
"""Largest number of evaluations of a fit that another follows."""
_LEAST_DECREASE = 0.5
"""Decrease of the cost at which it has converged."""
_LEAST = 1e-9
"""Least frequency in Hz and damping ratio: a lower bound may be zero."""
_DEPENDENT = 1e-8
"""Singular values of candidates below this share of the largest are not used."""

_Rows = tuple[NDArray[np.complex128], NDArray[np.complex128]]
"""Residuals `(n, k)` on each line in standard deviations, and their derivatives `(n, k, 3)` by the entries."""


@dataclass(frozen=True, eq=False)
class SpindleResiduals:
    """Residuals of the records as a function of the entries of the spindle, `(n, 3)`, on some lines.

    They are linear in the variables before the plane about the values `before`: `columns` are the derivatives by these,
    of the real parts of all residuals, of their imaginary parts, and of further residuals, whose values are `others`.
    """

    of_entries: Callable[[NDArray[np.complex128]], _Rows]
    before: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    columns: NDArray[np.float64] | None = None
    others: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    constant: float = 0.0
    """Part of chi-square that neither these nor the entries change."""

    @cached_property
    def _basis(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        assert self.columns is not None
        basis, root = np.linalg.qr(self.columns)
        return basis, root

    def real(
        self, residual: NDArray[np.complex128], slopes: NDArray[np.complex128]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residuals `(n, k)` and derivatives `(n, k, p)` as real ones, with the best variables.

        These are the variables before the plane.
        """
        flat = np.concatenate([residual.real.reshape(-1), residual.imag.reshape(-1), self.others])
        return self._projected(flat), self.real_columns(slopes)

    def real_columns(self, slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return derivatives `(n, k, p)` as real ones, with the best variables before the plane."""
        wide = slopes.reshape(-1, slopes.shape[-1])
        return self._projected(np.concatenate([wide.real, wide.imag, np.zeros((self.others.size, wide.shape[1]))]))

    def _projected(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        if self.columns is None:
            return rows
        basis, _ = self._basis
        return np.asarray(rows - basis @ (basis.T @ rows))

    def best_before(self, residual: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the best values of the variables before the plane."""
        if self.columns is None:
            return self.before
        basis, root = self._basis
        flat = np.concatenate([residual.real.reshape(-1), residual.imag.reshape(-1), self.others])
        return np.asarray(self.before - np.linalg.lstsq(root, basis.T @ flat, rcond=_DEPENDENT)[0])


@dataclass(frozen=True, eq=False)
class SpindleLines:
    """Records about the receptances of a spindle on some lines and values of the variables before its plane.

    Residuals and derivatives are in standard deviations.
    """

    x: NDArray[np.float64]
    """`(p,)` variables: unknowns and errors."""
    entries: NDArray[np.complex128]
    """`(n, 3)` y/F, theta/M and y/M."""
    residual: NDArray[np.complex128]
    """`(n, records)` residuals of the records: the ratio of calculated over measured, less one."""
    columns: NDArray[np.complex128]
    """`(n, records, 3)` derivatives by the entries; zero on a line without a spindle."""
    slopes: NDArray[np.complex128]
    """`(n, records, p)` derivatives by the variables."""
    others: tuple[NDArray[np.float64], NDArray[np.float64]]
    """Residuals of other observations and of priors, and their derivatives by the variables."""

    @property
    def chi_square(self) -> float:
        """Sum of squares of all residuals on lines with a spindle."""
        return float(np.sum(np.abs(self.residual[self._solved]) ** 2) + np.sum(self.others[0] ** 2))

    @property
    def _solved(self) -> NDArray[np.bool_]:
        return np.asarray(np.any(self.columns != 0.0, axis=(1, 2)))

    def select(self, lines: NDArray[np.intp]) -> SpindleLines:
        """Return the records on some of the lines."""
        arrays = {name: getattr(self, name)[lines] for name in ("entries", "residual", "columns", "slopes")}
        return replace(self, **arrays)

    def residuals(self) -> SpindleResiduals:
        """Return the residuals in this metric, in which they are linear."""
        solved, entries, count = self._solved, self.entries, self.x.size
        basis, root = np.linalg.qr(self.columns)
        adjoint = basis.conj().transpose(0, 2, 1)
        along, first = adjoint @ self.slopes, (adjoint @ self.residual[..., None])[..., 0]
        along[~solved], first[~solved] = 0.0, 0.0

        def rows(other: NDArray[np.complex128]) -> _Rows:
            change = np.where(solved[:, None], other - entries, 0.0)
            return first + np.einsum("nij,nj->ni", root, change), root

        # What no spindle explains depends on the variables alone: as many rows as variables have its sum of squares.
        rest = (self.slopes - basis @ along)[solved].reshape(-1, count)
        left = self.residual[solved].reshape(-1)
        turn, square = np.linalg.qr(np.concatenate([rest.real, rest.imag, self.others[1]]))
        others = turn.T @ np.concatenate([left.real, left.imag, self.others[0]])
        flat = along.reshape(-1, count)
        constant = self.chi_square - float(np.sum(np.abs(first) ** 2) + np.sum(others**2))
        return SpindleResiduals(rows, self.x, np.concatenate([flat.real, flat.imag, square]), others, constant)


def of_records(equations: Equations) -> SpindleResiduals:
    """Return the residuals of the records themselves, with all before the plane held."""
    weight = 1.0 / (equations.measured * equations.deviation)

    def rows(entries: NDArray[np.complex128]) -> _Rows:
        h, slope = equations.evaluate(entries)
        return (h - equations.measured) * weight, slope * weight[..., None]

    return SpindleResiduals(rows)


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedModes:
    """Modes and residuals of a spindle that were fitted together, in SI units with frequencies in Hz."""

    modes: NDArray[np.float64]
    """`(m, 6)` numbers of each mode."""
    bounds: NDArray[np.float64]
    """`(m, 6, 2)` their bounds; equal where a number is held."""
    residuals: NDArray[np.float64]
    """`(3,)`."""
    chi_square: float
    """Sum of the squared residuals, in variances."""
    before: NDArray[np.float64]
    """`(p,)` variables before the plane that go with them; empty where these are held."""
    entries: NDArray[np.complex128]
    """`(n, 3)` y/F, theta/M and y/M of the spindle."""

    @property
    def free(self) -> int:
        """Number of fitted numbers of the modes."""
        return int(np.sum(self.bounds[..., 0] < self.bounds[..., 1]))


@dataclass(frozen=True, eq=False, kw_only=True)
class ModeGrowth:
    """Modes and residuals of a spindle within their bounds."""

    lines_hz: NDArray[np.inexact]
    """`(n,)` lines, complex with an exponential window."""
    residuals_of: SpindleResiduals
    """Residuals as a function of the spindle's entries."""
    bounds: NDArray[np.float64]
    """`(m, 6, 2)` bounds of the numbers of each mode; equal where a number is known."""
    below: NDArray[np.float64] | None = None
    """`(m, 6, 2)` bounds of a mode with a natural frequency in the lines; None where modes may leave the lines."""
    above: NDArray[np.float64]
    """`(m, 6, 2)` bounds of a mode with a natural frequency above the lines, where several modes with complex shapes
    can imitate each other."""
    residual_bounds: NDArray[np.float64]
    """`(3, 2)` bounds of the residuals."""

    def first(self, residuals: Sequence[float]) -> FittedModes:
        """Return the fit without modes, of the residuals from their start."""
        return self._end(np.array(residuals, dtype=np.float64) / self._entry_scale, np.empty((0, 6, 2)))

    def fitted(self, start: FittedModes) -> FittedModes:
        """Return the fit from a start.

        A mode that is held at the limit between the sides moves to the other one if the fit is better with it there.
        """
        fit = self._refitted(start)
        for index in range(len(fit.modes)):
            other = self._on_other_side(fit, index)
            if other is not None:
                fit = min(fit, self._refitted(other), key=lambda end: end.chi_square)
        return fit

    def _refitted(self, start: FittedModes) -> FittedModes:
        return self._end(self._variables(start), start.bounds, _EVALUATIONS_AGAIN, _LEAST_DECREASE)

    def _on_other_side(self, fit: FittedModes, index: int) -> FittedModes | None:
        """Return a start with a mode on the other side of the limit; None where the mode is not at it."""
        if self.below is None:
            return None
        limit, ends = self.above[index, 0, 0], self.below[index, 0]
        if not ends[0] < limit == ends[1] or abs(fit.modes[index, 0] / limit - 1.0) > _AT_LIMIT:
            return None
        modes, bounds = fit.modes.copy(), fit.bounds.copy()
        if fit.bounds[index, 0, 1] == limit:
            bounds[index] = self.above[index]
            modes[index, 0] *= _ACROSS
            # With the same compliance at the last line.
            last = self.lines_hz.real[-1]
            modes[index, 2:4] *= np.sqrt((modes[index, 0] ** 2 - last**2) / (limit**2 - last**2))
        else:
            bounds[index] = self.below[index]
            modes[index, 0] = self.lines_hz.real[-1]
        return replace(fit, modes=np.clip(modes, bounds[..., 0], bounds[..., 1]), bounds=bounds)

    def with_next(self, start: FittedModes) -> FittedModes:
        """Return the best fit with a further mode."""
        x, index = self._variables(start), len(start.modes)
        ends = []
        for mode in self._candidates(x, index) or [self._absent(index)]:
            is_above = mode[0] > self.above[index, 0, 0]
            trial = np.concatenate([start.bounds, (self.above if is_above else self.bounds)[index : index + 1]])
            ends.append(self._end(self._with_mode(x, mode), trial))
        return self._on_its_side(min(ends, key=lambda end: end.chi_square))

    def _on_its_side(self, fit: FittedModes) -> FittedModes:
        """Return a start for a fit in which each mode stays below or above the end of the lines."""
        if self.below is None:
            return fit
        is_above = fit.modes[:, :1] > self.above[: len(fit.modes), 0, :1]
        bounds = np.where(is_above[..., None], self.above[: len(fit.modes)], self.below[: len(fit.modes)])
        return replace(fit, modes=np.clip(fit.modes, bounds[..., 0], bounds[..., 1]), bounds=bounds)

    def _end(
        self,
        x: NDArray[np.float64],
        limits: NDArray[np.float64],
        evaluations: int = _EVALUATIONS,
        least: float = 0.0,
    ) -> FittedModes:
        """Return the end of a fit of modes within their bounds `(k, 6, 2)`."""
        cost, x = self._fitted(x, limits, evaluations, least)
        modes, rest = self._split(x)
        entries = self._entries(modes)[0] + rest * self._entry_scale
        return FittedModes(
            modes=np.clip(self._unscaled(modes), limits[..., 0], limits[..., 1]),
            bounds=limits,
            residuals=np.clip(rest * self._entry_scale, *self.residual_bounds.T),
            chi_square=2.0 * cost + self.residuals_of.constant,
            before=self.residuals_of.best_before(self.residuals_of.of_entries(entries)[0]),
            entries=entries,
        )

    def _variables(self, fit: FittedModes) -> NDArray[np.float64]:
        return np.concatenate([self._scaled(fit.modes).reshape(-1), fit.residuals / self._entry_scale])

    @cached_property
    def _middle(self) -> float:
        """Middle of the band in rad/s."""
        real = self.lines_hz.real
        return float(2.0 * np.pi * np.sqrt(real[real > 0.0][0] * real[-1]))

    @cached_property
    def _shape_scale(self) -> NDArray[np.float64]:
        """Sizes of y and theta, `(2,)`."""
        return np.asarray(np.abs(self.bounds[:, [_Y, _THETA]]).max(axis=(0, 2)) / 10.0)

    @cached_property
    def _entry_scale(self) -> NDArray[np.float64]:
        """Sizes of y/F, theta/M and y/M, `(3,)`."""
        y, theta = self._shape_scale / self._middle
        return np.array([y * y, theta * theta, y * theta])

    def _scaled(self, modes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fitted variables of numbers `(..., 6)`: logarithms of frequency and damping, scaled shapes."""
        positive = np.maximum(modes[..., :2], _LEAST)
        return np.concatenate([np.log(positive), modes[..., 2:] / np.tile(self._shape_scale, 2)], axis=-1)

    def _unscaled(self, variables: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate([np.exp(variables[..., :2]), variables[..., 2:] * np.tile(self._shape_scale, 2)], axis=-1)

    def _split(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the variables of modes `(k, 6)` and residuals `(3,)`."""
        return x[:-3].reshape(-1, 6), x[-3:]

    def _with_mode(self, x: NDArray[np.float64], mode: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variables with a further mode, which has the numbers `mode`."""
        return np.concatenate([x[:-3], self._scaled(mode), x[-3:]])

    def _absent(self, index: int) -> NDArray[np.float64]:
        """Return the numbers of a mode without effect, or as near to it as its bounds allow."""
        low, high = self.bounds[index].T
        return np.concatenate([np.sqrt(low[:2] * high[:2]), np.clip(0.0, low[2:], high[2:])])

    def _fitted(
        self, x: NDArray[np.float64], bounds: NDArray[np.float64], evaluations: int, least: float
    ) -> tuple[float, NDArray[np.float64]]:
        """Return the cost and the variables at the end of a fit of modes within their bounds `(k, 6, 2)`."""
        sides = [self._scaled(bounds[..., side]).reshape(-1) for side in (0, 1)]
        rest = (self.residual_bounds / self._entry_scale[:, None]).T
        limits = np.ascontiguousarray([np.append(side, bound) for side, bound in zip(sides, rest, strict=True)])
        core = _core.Problem(np.zeros(x.size, dtype=np.bool_), limits, np.zeros((0, 3)), _checks.thread_count(1))
        core.add_function(self._evaluate)
        start = np.ascontiguousarray(np.clip(x, *limits)[None])
        ends = core.fit(start, limits[0] < limits[1], np.array([evaluations]), _TOLERANCE, least)
        return float(ends.cost[0]), np.asarray(ends.x[0])

    def _evaluate(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return residuals and derivatives by the variables, real parts first; None where there is no value."""
        modes, rest = self._split(x)
        entries, slopes = self._entries(modes)
        with np.errstate(all="ignore"):
            residual, by_entry = self.residuals_of.of_entries(entries + rest * self._entry_scale)
            columns = np.concatenate([slopes, np.broadcast_to(np.diag(self._entry_scale), (len(slopes), 3, 3))], axis=2)
            flat, wide = self.residuals_of.real(residual, by_entry @ columns)
        return (flat, wide) if np.isfinite(flat).all() and np.isfinite(wide).all() else None

    def _entries(self, modes: NDArray[np.float64]) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the sum of modes `(n, 3)` and its derivatives by their variables, `(n, 3, 6 m)`."""
        count = len(modes)
        numbers = self._unscaled(modes)
        w, ratio = 2.0 * np.pi * numbers[:, 0], numbers[:, 1]
        shape = numbers[:, 2:4] + 1j * numbers[:, 4:6]
        s = 2j * np.pi * self.lines_hz[:, None]
        free = np.sqrt(1.0 - ratio**2)
        pole = w * (-ratio + 1j * free)
        first, second = 1.0 / (s - pole), 1.0 / (s - pole.conj())
        gain = 1.0 / (2j * w * free)
        y, theta = shape.T
        products = np.stack([y * y, theta * theta, y * theta])
        size = self._shape_scale
        zero = np.zeros(count)
        by_y = np.stack([2.0 * y, zero, theta]) * size[0] * gain
        by_theta = np.stack([zero, 2.0 * theta, y]) * size[1] * gain
        result = np.empty((s.size, 3, count, 6), dtype=np.complex128)

        def pair(matrix: NDArray[np.complex128]) -> NDArray[np.complex128]:
            return np.asarray(first[:, None] * matrix + second[:, None] * matrix.conj())

        for column, (pole_slope, gain_slope) in enumerate(
            ((pole, -gain), (w * ratio * (-1.0 - 1j * ratio / free), gain * (ratio / free) ** 2))
        ):
            moved = products * gain * pole_slope
            result[..., column] = first[:, None] ** 2 * moved + second[:, None] ** 2 * moved.conj()
            result[..., column] += pair(products * gain_slope)
        for column, slope in ((2, by_y), (3, by_theta), (4, 1j * by_y), (5, 1j * by_theta)):
            result[..., column] = pair(slope)
        return pair(products * gain).sum(axis=2), result.reshape(s.size, 3, 6 * count)

    def _candidates(self, x: NDArray[np.float64], index: int) -> list[NDArray[np.float64]]:
        """Return the numbers of further modes that reduce the residuals most to first order."""
        rows = self._evaluate(x)
        if rows is None:
            return []
        residual, jacobian = rows
        moving = jacobian[:, np.linalg.norm(jacobian, axis=0) > 0.0]
        basis, _ = np.linalg.qr(moving / np.linalg.norm(moving, axis=0))
        residual = residual - basis @ (basis.T @ residual)
        modes, rest = self._split(x)
        _, by_entry = self.residuals_of.of_entries(self._entries(modes)[0] + rest * self._entry_scale)
        scaled = by_entry * self._entry_scale
        lines = self.lines_hz.real
        (low, high), (least, most) = self.bounds[index, :2]
        low, high = max(low, lines[lines > 0.0][0] / _BESIDE), min(high, lines[-1] * _BESIDE)
        tried: list[tuple[float, NDArray[np.float64]]] = []
        for frequency in np.geomspace(min(low, high), high, _POLES):
            for ratio in dict.fromkeys(float(np.clip(ratio, least, most)) for ratio in _RATIOS):
                gain, matrix = self._best_matrix(scaled, residual, basis, 2.0 * np.pi * frequency, ratio)
                left, sizes, right = np.linalg.svd(matrix)
                shape = left[:, 0] * np.sqrt(sizes[0] * np.vdot(left[:, 0], right[0]))
                shape *= self._shape_scale * (-1.0 if shape[0].real < 0.0 else 1.0)
                tried.append((gain, np.array([frequency, ratio, *shape.real, *shape.imag])))
        tried.sort(key=lambda candidate: -candidate[0])
        kept: list[NDArray[np.float64]] = []
        for gain, mode in tried:
            if len(kept) == _TRIED or not gain > 0.0:
                break
            if all(abs(np.log(mode[0] / other[0])) > _APART for other in kept):
                kept.append(mode)
        return kept

    def _best_matrix(
        self,
        slope: NDArray[np.complex128],
        residual: NDArray[np.float64],
        basis: NDArray[np.float64],
        angular: float,
        ratio: float,
    ) -> tuple[float, NDArray[np.complex128]]:
        """Return the decrease of the sum of squares by the best matrix of a pole, and this matrix, in scaled units."""
        free = np.sqrt(1.0 - ratio**2)
        s, pole = 2j * np.pi * self.lines_hz, angular * (-ratio + 1j * free)
        gain = self._middle**2 / (2j * angular * free)
        first, second = gain / (s - pole), np.conj(gain) / (s - np.conj(pole))
        factors = (first + second, 1j * (first - second))
        columns = self.residuals_of.real_columns(
            np.concatenate([slope * factor[:, None, None] for factor in factors], axis=2)
        )
        columns = columns - basis @ (basis.T @ columns)
        sizes = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        columns = columns / sizes
        projected = -columns.T @ residual
        solution = np.linalg.lstsq(columns.T @ columns, projected, rcond=_DEPENDENT)[0]
        y, theta, both = (solution / sizes)[:3] + 1j * (solution / sizes)[3:]
        return float(projected @ solution), np.array([[y, both], [both, theta]])
