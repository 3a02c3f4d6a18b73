"""Poles and residues by separable least squares: residues enter linearly and are solved for at every step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

_STEPS = 200
_TOLERANCE = 1e-13
_ROUNDING = 1e-14
"""Step of the poles, relative to their distance to the lines, at which the search has converged."""
_MAX_REACH = 400
"""Most lines of an autocorrelation of the residuals."""
_MIN_CORRELATION, _CHANCE = 0.2, 3.0
"""Least correlation of neighbouring residuals that counts, and in standard deviations of that of independent ones."""
_BLOCK = 64
"""Candidates evaluated at once, to limit memory."""


@dataclass(frozen=True)
class PoleFit:
    """Poles, residues and background with their covariance, of M poles, m entries with k coefficients and n lines."""

    poles: NDArray[np.complex128]
    """`(M,)` complex, s = -delta + i w_d."""
    coefficients: NDArray[np.float64]
    """`(m, k)` real: real parts of the M residues, their imaginary parts, then both parts of each background term."""
    residual: NDArray[np.complex128]
    """`(n, m)` complex: measured minus fitted values times the weights."""
    fitted: NDArray[np.complex128]
    """`(n, m)` fitted values in the form of the data."""
    inverse: NDArray[np.float64]
    """`(2M, 2M)` inverse of the information matrix of the real, then the imaginary parts of the poles."""
    pole_covariance: NDArray[np.float64]
    """`(2M, 2M)` their covariance, if the weights are the inverse standard deviations of real and imaginary part; equal
    to `inverse` for independent lines."""
    coefficient_covariance: NDArray[np.float64]
    """`(m, k, k)` covariance of the coefficients, including the uncertainty of the poles."""
    cross_covariance: NDArray[np.float64]
    """`(m, k, 2M)` covariance of the coefficients with the poles."""
    scores: NDArray[np.float64]
    """`(m, 2M)` contributions of each entry to the gradient of half the sum of squares, which is zero in total."""
    information_matrices: NDArray[np.float64]
    """`(m, 2M, 2M)` contributions of each entry to the information matrix."""
    degrees_of_freedom: float
    """Expectation of the sum of squared residuals for those weights: for independent lines, twice the number of values
    minus the number of real parameters."""
    converged: bool
    smooth_lines: float
    """Number of lines over which the errors were taken as smooth."""

    @property
    def chi_square(self) -> float:
        """Sum of the squared residuals."""
        return float(np.sum(self.residual.real**2 + self.residual.imag**2))

    @property
    def residues(self) -> NDArray[np.complex128]:
        """`(M, m)` residues of the receptance."""
        count = self.poles.size
        return np.asarray((self.coefficients[:, :count] + 1j * self.coefficients[:, count : 2 * count]).T)


@dataclass(frozen=True)
class PoleModel:
    """H(s) s^power, H = sum of A / (s - p) + A* / (s - p*), and c s^t for each background term.

    The power is 0, 1 or 2 for receptance, mobility, accelerance. The terms t represent the modes outside the band, each
    with a complex coefficient per entry: -2 for those below, 0 for those above.
    """

    s: NDArray[np.complex128]
    power: int
    terms: tuple[int, ...]

    def basis(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """`(n, k)` columns of the real coefficients."""
        return np.concatenate([self.pole_columns(poles), self.background()], axis=1)

    def background(self) -> NDArray[np.complex128]:
        """`(n, 2 len(terms))` columns of the background."""
        columns = [self.s ** (term + self.power) for term in self.terms]
        pairs = [part for column in columns for part in (column, 1j * column)]
        return np.stack(pairs, axis=1) if pairs else np.empty((self.s.size, 0), dtype=np.complex128)

    def pole_columns(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """`(n, 2M)` columns of the real parts of the residues, then of their imaginary parts."""
        return self._columns(poles, 1)

    def slopes(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """`(n, 2M)` derivatives of the two columns of each pole by its real part.

        With T and G these derivatives, those by the imaginary part are G and -T.
        """
        return self._columns(poles, 2)

    def _columns(self, poles: NDArray[np.complex128], exponent: int) -> NDArray[np.complex128]:
        factor = self.s[:, None] ** self.power
        terms = factor / (self.s[:, None] - poles) ** exponent
        conjugate_terms = factor / (self.s[:, None] - poles.conj()) ** exponent
        return np.concatenate([terms + conjugate_terms, 1j * (terms - conjugate_terms)], axis=1)

    @property
    def decay_rate(self) -> float:
        """Decay rate of the exponential window: distance of the lines from the imaginary axis."""
        return float(self.s[0].real)

    @property
    def spacing(self) -> float:
        """Smallest distance of the lines in rad/s."""
        return float(np.min(np.diff(self.s.imag)))


@dataclass(frozen=True)
class _WeightGroup:
    """Entries with equal relative weights of the lines, which share one factorisation."""

    entries: NDArray[np.int64]
    weight: NDArray[np.float64]
    factor: NDArray[np.float64]


@dataclass(frozen=True)
class PoleProblem:
    """Weighted least-squares problem of the poles by variable projection (Golub and Pereyra 1973).

    The derivative is that of Kaufman (1975), without terms of the order of the residual; it gives the exact covariance
    of the linearised problem.

    `values` are `(n, m)` in the form of the data, `weights` the inverse standard deviations of real and imaginary part,
    up to one factor; entries are ordered by response, then by excitation. The others affect the covariance only:
    `correlated_lines` is the stated number of neighbouring lines per independent value, `smooth_lines` that estimated
    from residuals (it replaces the stated one if above 1), `additive` the share `(n, m)` of
    additive noise in each variance, which is independent between entries (by default all of it). The rest is
    proportional to the FRF, as noise on the force, and may be correlated between the responses to one excitation; the
    correlation is estimated from the residuals.
    """

    model: PoleModel
    values: NDArray[np.complex128]
    weights: NDArray[np.float64]
    correlated_lines: float = 1.0
    smooth_lines: float = 1.0
    additive: NDArray[np.float64] | None = None
    excitations: int = 1

    def fit(
        self,
        start: NDArray[np.complex128],
        *,
        low: NDArray[np.complex128] | None = None,
        high: NDArray[np.complex128] | None = None,
        tolerance: float = _TOLERANCE,
        steps: int = _STEPS,
    ) -> PoleFit:
        """Return the result of a Levenberg-Marquardt search from these poles; the background alone without poles.

        The bounds `low` and `high` are those of real and imaginary parts. The search ends if the expected relative
        decrease of the sum of squares by a step is below the tolerance, or after a number of evaluations.
        """
        count = start.size
        groups = self._groups()
        if count == 0:
            return self._conclude(start, groups, True)
        lowest = -np.full(count, complex(np.inf, np.inf)) if low is None else low
        highest = np.full(count, complex(np.inf, np.inf)) if high is None else high
        bounds = _stacked(lowest), _stacked(highest)
        x = np.clip(_stacked(start), *bounds)
        sum_of_squares, gradient, curvature = self._evaluate(_unstacked(x), groups)
        damping, converged = 1e-3, False
        for _ in range(steps):
            # Variables at a bound are fixed if the gradient points outwards.
            free = ~(((x <= bounds[0]) & (gradient > 0.0)) | ((x >= bounds[1]) & (gradient < 0.0)))
            scale = np.sqrt(np.diag(curvature))
            scale = np.where(scale > 0.0, scale, 1.0)[free]
            if not free.any():
                converged = True
                break
            scaled = curvature[np.ix_(free, free)] / np.outer(scale, scale)
            step = np.zeros(2 * count)
            step[free] = -np.linalg.lstsq(scaled + damping * np.eye(scale.size), gradient[free] / scale, rcond=None)[0]
            step[free] /= scale
            # Poles move at most by their distance to the lines, the range of the linearisation.
            distance = np.maximum(np.abs(self.model.decay_rate - x[:count]), self.model.spacing)
            step /= max(1.0, float(np.max(np.abs(step) / np.tile(distance, 2))))
            new = np.clip(x + step, *bounds)
            step = new - x
            expected = -(2.0 * gradient @ step + step @ curvature @ step)
            trial = self._evaluate(_unstacked(new), groups)
            decrease = sum_of_squares - trial[0]
            if decrease >= 0.0:
                x, (sum_of_squares, gradient, curvature) = new, trial
                damping = max(damping * (0.1 if decrease > 0.5 * expected else 1.0), 1e-12)
            else:
                damping = max(damping, 1e-6) * 10.0
            is_small = float(np.max(np.abs(step) / np.tile(distance, 2))) <= _ROUNDING
            if (decrease >= 0.0 and expected <= tolerance * sum_of_squares) or is_small or damping > 1e10:
                converged = True
                break
        return self._conclude(_unstacked(x), groups, converged)

    def with_smooth_errors(self, fit: PoleFit) -> PoleFit:
        """Return a fit of this problem with the covariance for errors as smooth over the lines as its residuals."""
        smooth_lines = self._smooth_lines(fit)
        if smooth_lines <= 1.0:
            return fit
        return replace(self, smooth_lines=smooth_lines)._conclude(fit.poles, self._groups(), fit.converged)

    def gains(self, poles: NDArray[np.complex128], candidates: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the decrease of the sum of squared residuals by adding each candidate to these poles."""
        gains = np.zeros(candidates.size)
        basis = self.model.basis(poles)
        for group in self._groups():
            solution = _LinearSolution.solve(self, group, basis)
            for first in range(0, candidates.size, _BLOCK):
                block = candidates[first : first + _BLOCK]
                columns = _stacked(group.weight[:, None] * self.model.pole_columns(block))
                columns /= np.maximum(np.linalg.norm(columns, axis=0), np.finfo(np.float64).tiny)
                columns -= solution.q @ (solution.q.T @ columns)
                a, b = columns[:, : block.size], columns[:, block.size :]
                # Projection on a and b together, from their 2 x 2 Gram matrix.
                aa, bb, ab = (np.einsum("ij,ij->j", x, y) for x, y in ((a, a), (b, b), (a, b)))
                projections = columns.T @ solution.residual
                ya, yb = projections[: block.size], projections[block.size :]
                numerator = bb * np.sum(ya**2, axis=1) + aa * np.sum(yb**2, axis=1) - 2.0 * ab * np.sum(ya * yb, axis=1)
                determinant = aa * bb - ab**2
                is_regular = determinant > 1e-12 * np.maximum(aa, bb) ** 2
                gains[first : first + _BLOCK] += np.where(
                    is_regular, numerator / np.where(is_regular, determinant, 1.0), 0.0
                )
        return gains

    @property
    def square(self) -> float:
        """Sum of the squared values in units of the weights."""
        return float(np.sum(np.abs(self.values * self.weights) ** 2))

    def _groups(self) -> list[_WeightGroup]:
        groups: list[_WeightGroup] = []
        remaining = np.arange(self.values.shape[1])
        while remaining.size:
            scales = self.weights[:, remaining].max(axis=0)
            scales = np.where(scales > 0.0, scales, 1.0)
            first = self.weights[:, remaining[0]] / scales[0]
            same = np.all(
                np.abs(self.weights[:, remaining] / scales - first[:, None]) <= 1e-12 * first[:, None], axis=0
            )
            groups.append(_WeightGroup(remaining[same], first, scales[same]))
            remaining = remaining[~same]
        return groups

    def _evaluate(
        self, poles: NDArray[np.complex128], groups: list[_WeightGroup]
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Return the sum of squares with the best residues, half its gradient, and the Gauss-Newton matrix.

        The entries of a group share the columns of the poles, so that products over lines are formed once per group and
        only products over modes once per entry: time and memory do not grow with lines times entries times modes.
        """
        basis, slopes = self.model.basis(poles), self.model.slopes(poles)
        count = poles.size
        sum_of_squares, gradient, curvature = 0.0, np.zeros(2 * count), np.zeros((2 * count, 2 * count))
        for group in groups:
            solution = _LinearSolution.solve(self, group, basis)
            sum_of_squares += float(np.sum(solution.residual**2))
            outside = solution.outside(slopes)
            projection, gram = outside.T @ solution.residual, outside.T @ outside
            for half, (a, b) in enumerate(solution.factors(count)):
                gradient[half * count : (half + 1) * count] -= np.sum(
                    a * projection[:count] + b * projection[count:], axis=1
                )
                for other, (c, d) in enumerate(solution.factors(count)):
                    block = gram[:count, :count] * (a @ c.T) + gram[:count, count:] * (a @ d.T)
                    block += gram[count:, :count] * (b @ c.T) + gram[count:, count:] * (b @ d.T)
                    curvature[half * count : (half + 1) * count, other * count : (other + 1) * count] += block
        return sum_of_squares, gradient, curvature

    def _conclude(self, poles: NDArray[np.complex128], groups: list[_WeightGroup], converged: bool) -> PoleFit:
        basis, slopes = self.model.basis(poles), self.model.slopes(poles)
        entries, size, modes = self.values.shape[1], basis.shape[1], poles.size
        count = 2 * modes
        coefficients, scores = np.zeros((entries, size)), np.zeros((entries, count))
        # Of the coefficients: covariance for fixed poles, derivatives by the poles, covariance with the scores.
        fixed_pole_covariance, pole_slopes, score_covariance = (
            np.zeros((entries, size, columns)) for columns in (size, count, count)
        )
        information_matrices, score_variances = (np.zeros((entries, count, count)) for _ in range(2))
        freedom = 2.0 * np.count_nonzero(self.weights)
        for group in groups:
            solution = _LinearSolution.solve(self, group, basis)
            r_inverse = np.linalg.pinv(solution.r) / solution.norms[:, None]
            inside, outside = solution.q.T @ solution.weighted(slopes), solution.outside(slopes)
            gram, projection = outside.T @ outside, outside.T @ solution.residual
            for index, entry in enumerate(group.entries):
                if index == 0 or (self.additive is not None and self._are_correlated):
                    proportional = self._proportional_noise(entry, basis @ solution.coefficients[:, index])
                    noise_columns = self._times_noise_covariance(solution.q, proportional)
                    projected, cross_products = solution.q.T @ noise_columns, noise_columns.T @ outside
                    noise = outside.T @ self._times_noise_covariance(outside, proportional)
                    entry_covariance = r_inverse @ projected @ r_inverse.T
                rotation = solution.rotation(modes, index)
                coefficients[entry] = solution.coefficients[:, index]
                information_matrices[entry] = rotation.T @ gram @ rotation
                score_variances[entry] = rotation.T @ noise @ rotation
                scores[entry] = -rotation.T @ projection[:, index]
                fixed_pole_covariance[entry] = entry_covariance / group.factor[index] ** 2
                pole_slopes[entry] = -r_inverse @ (inside @ rotation) / group.factor[index]
                score_covariance[entry] = r_inverse @ (cross_products @ rotation) / group.factor[index]
                freedom -= float(np.trace(projected))
        inverse = _inverse(information_matrices.sum(axis=0))
        fitted = basis @ coefficients.T
        residual = (self.values - fitted) * self.weights
        score_variance = score_variances.sum(axis=0)
        if self.additive is not None:
            score_variance += self._between_entries(groups, basis, slopes, fitted, residual, score_covariance)
        if not np.all(np.isfinite(inverse)):
            # If the poles are not determined, neither are the coefficients.
            pole_covariance, coefficient_covariance, cross_covariance = (
                inverse,
                np.full(fixed_pole_covariance.shape, np.inf),
                np.full(pole_slopes.shape, np.inf),
            )
        else:
            pole_covariance = inverse @ score_variance @ inverse
            freedom -= float(np.trace(inverse @ score_variance))
            linked = score_covariance @ inverse
            cross_covariance = pole_slopes @ pole_covariance + linked
            coefficient_covariance = fixed_pole_covariance + pole_slopes @ pole_covariance @ pole_slopes.transpose(
                0, 2, 1
            )
            coefficient_covariance += linked @ pole_slopes.transpose(0, 2, 1) + pole_slopes @ linked.transpose(0, 2, 1)
        return PoleFit(
            poles,
            coefficients,
            residual,
            fitted,
            inverse,
            pole_covariance,
            coefficient_covariance,
            cross_covariance,
            scores,
            information_matrices,
            freedom,
            converged,
            self.smooth_lines,
        )

    def _between_entries(
        self,
        groups: list[_WeightGroup],
        basis: NDArray[np.complex128],
        slopes: NDArray[np.complex128],
        fitted: NDArray[np.complex128],
        residual: NDArray[np.complex128],
        score_covariance: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return the covariance of the scores of the poles from noise common to several responses.

        Relative to the FRF this noise is equal in all responses to one excitation. With g the derivative of an entry
        times its noise, rotated by the phase of the FRF, the products of different entries are G* T G minus the sum of
        g* T g, with G the sum of g and T the correlation of the lines. The covariance between the coefficients of an
        entry and the scores of the others is added to `score_covariance`.
        """
        count, (n, entries) = slopes.shape[1], self.values.shape
        total = np.zeros((count, count))
        proportional = np.stack([self._proportional_noise(entry, fitted[:, entry]) for entry in range(entries)], axis=1)
        common = np.array(
            [
                self._common(
                    proportional[:, excitation :: self.excitations], residual[:, excitation :: self.excitations]
                )
                for excitation in range(self.excitations)
            ]
        )
        if not common.any():
            return total
        sums = np.zeros((self.excitations, n, count), dtype=np.complex128)
        # The sums over all entries are complete after the first pass.
        for has_sums in (False, True):
            for group in groups:
                solution = _LinearSolution.solve(self, group, basis)
                outside = solution.outside(slopes)
                r_inverse = np.linalg.pinv(solution.r) / solution.norms[:, None]
                for index, entry in enumerate(group.entries):
                    excitation = entry % self.excitations
                    if common[excitation] == 0.0:
                        continue
                    conjugate = proportional[:, entry, None].conj()
                    entry_noise = conjugate * _unstacked(outside @ solution.rotation(count // 2, index))
                    if not has_sums:
                        sums[excitation] += entry_noise
                        continue
                    others = self._times_line_correlation(_stacked(sums[excitation] - entry_noise))
                    total += common[excitation] * (_stacked(entry_noise).T @ others)
                    projected = _stacked(conjugate * _unstacked(solution.q))
                    score_covariance[entry] += (
                        common[excitation] * (r_inverse @ (projected.T @ others)) / group.factor[index]
                    )
        return total

    @staticmethod
    def _common(proportional: NDArray[np.complex128], residual: NDArray[np.complex128]) -> float:
        """Estimate the correlation between responses of the noise proportional to the FRF, from 0 to 1.

        The sum of the products of different entries' residuals relative to its value for equal entries. The fit reduces
        both by the same factor.
        """
        share = np.abs(proportional) ** 2
        rotated = proportional.conj() * residual
        weight = share * (share.sum(axis=1, keepdims=True) - share)
        scale = float(np.sum(weight * np.abs(residual) ** 2))
        if scale == 0.0:
            return 0.0
        product = float(np.sum(np.abs(rotated.sum(axis=1)) ** 2) - np.sum(np.abs(rotated) ** 2))
        return float(np.clip(product / scale, 0.0, 1.0))

    @property
    def _are_correlated(self) -> bool:
        return max(self.correlated_lines, self.smooth_lines) > 1.0

    def _smooth_lines(self, fit: PoleFit) -> float:
        """Return the number of lines S over which the residuals of a fit are smooth, 1 if as correlated as stated.

        S is that for which the expected sum of the autocorrelation of the residuals, up to its first value below zero,
        is the observed one. With P the projection on the columns of an entry, its residuals have the covariance
        (1 - P) R (1 - P); residuals alone would give too small an S, because the fit follows smooth errors.
        """
        n = fit.residual.shape[0]
        reach = min(n // 2, _MAX_REACH)
        if reach < 2 or fit.chi_square <= 0.0:
            return 1.0
        power = np.sum(np.abs(np.fft.fft(fit.residual, 2 * n, axis=0)) ** 2, axis=1)
        products = np.fft.ifft(power)[: reach + 1].real
        correlation = products[1:] / products[0]
        below = np.flatnonzero(correlation <= 0.0)
        lags = int(below[0]) if below.size else reach
        stated = line_correlation(n, self.correlated_lines, 1.0)[1].real
        chance = _CHANCE / np.sqrt(2.0 * fit.residual.size / self.correlated_lines)
        if correlation[0] <= stated + max(_MIN_CORRELATION * (1.0 - stated), chance):
            return 1.0
        solution = _LinearSolution.solve(self, self._groups()[0], self.model.basis(fit.poles))
        slopes = solution.outside(self.model.slopes(fit.poles)) @ solution.rotation(fit.poles.size, 0)
        with_slopes = np.linalg.qr(np.concatenate([solution.q, slopes], axis=1))[0]
        # Poles common to m entries follow the errors of each of them by 1 / m.
        share = 1.0 / self.values.shape[1]
        removed_variance, removed_sum = (
            (1.0 - share) * fixed + share * free
            for fixed, free in zip(_removed(solution.q, lags), _removed(with_slopes, lags), strict=True)
        )

        def excess(log_lines: float) -> float:
            """Return the expected less the observed sum of the autocorrelation, relative to the variance."""
            noise = line_correlation(n, 1.0, float(np.exp(log_lines)))
            power = _toeplitz_spectrum(noise)
            expected = 2.0 * np.sum((n - np.arange(1, lags + 1)) * noise[1 : lags + 1].real) - power @ removed_sum
            variance = max(2.0 * n - float(power @ removed_variance), 1e-9 * n)
            return float(expected / variance - np.sum(correlation[:lags]))

        low, high = 0.0, float(np.log(2.0 * n))
        if excess(low) >= 0.0 or excess(high) <= 0.0:
            return 1.0 if excess(low) >= 0.0 else 2.0 * n
        return float(np.exp(scipy.optimize.brentq(excess, low, high, xtol=1e-3)))

    def _proportional_noise(self, entry: int, fitted: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the root of the share of noise proportional to the FRF, with the phase of the FRF."""
        size = np.abs(fitted)
        if self.additive is None:
            return np.zeros(size.shape, dtype=np.complex128)
        phase = np.where(size > 0.0, fitted, 1.0) / np.where(size > 0.0, size, 1.0)
        return np.asarray(np.sqrt(1.0 - self.additive[:, entry]) * phase)

    def _times_noise_covariance(
        self, columns: NDArray[np.float64], proportional: NDArray[np.complex128]
    ) -> NDArray[np.float64]:
        """Return the product of the noise covariance of one entry with stacked columns.

        Noise proportional to the FRF is correlated between lines relative to the phase of the FRF.
        """
        if not self._are_correlated or self.additive is None or columns.size == 0:
            return self._times_line_correlation(columns)
        values, phase = _unstacked(columns), proportional[:, None]
        additive = np.sqrt(np.maximum(1.0 - np.abs(phase) ** 2, 0.0))
        products = _stacked(np.concatenate([additive * values, phase.conj() * values], axis=1))
        first, second = np.split(_unstacked(self._times_line_correlation(products)), 2, axis=1)
        return _stacked(additive * first + phase * second)

    def _times_line_correlation(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the product of the correlation of the lines with `(2n, k)` stacked columns.

        Noise under an exponential window, exp(-2 sigma t) in power, has the correlation 1 / (1 + i pi m / c) between
        lines at a distance of m lines, with c, the sum of its squares, the number of correlated lines. Zero padding
        also leaves noise in the early part of the record and is treated in the same way. Errors found to be smooth over
        S lines have the correlation exp(-pi (m / S)^2), whose sum over all distances is S.
        """
        if not self._are_correlated or columns.size == 0:
            return columns
        first = line_correlation(columns.shape[0] // 2, self.correlated_lines, self.smooth_lines)
        return _stacked(_times_toeplitz(first, _unstacked(columns)))


def line_correlation(n: int, correlated_lines: float, smooth_lines: float) -> NDArray[np.complex128]:
    """Return the correlation of the noise between lines at a distance of 0 to n - 1 lines."""
    distance = np.arange(n)
    if smooth_lines > 1.0:
        return np.asarray(np.exp(-np.pi * (distance / smooth_lines) ** 2).astype(np.complex128))
    if correlated_lines > 1.0:
        return np.asarray(1.0 / (1.0 + 1j * np.pi * distance / correlated_lines))
    return np.asarray((distance == 0).astype(np.complex128))


def _removed(columns: NDArray[np.float64], lags: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what a fit removes from the autocorrelation of errors: at no distance, and in total at 1 to `lags` lines.

    Of errors with the correlation R it removes Q B* + B Q* with B = R Q - Q (Q* R Q) / 2, where Q are its orthonormal
    columns. Its sums are linear in R; returned are their factors for each value of the spectrum of the correlation.
    """
    n = columns.shape[0] // 2
    neighbours = np.zeros(n, dtype=np.complex128)
    neighbours[1 : lags + 1] = 1.0
    q = _unstacked(columns)
    near = _times_toeplitz(neighbours, q)
    spectrum, near_spectrum = (np.fft.fft(part, _padded(n), axis=0) / np.sqrt(_padded(n)) for part in (q, near))
    near_spectrum -= 0.5 * spectrum @ (columns.T @ _stacked(near))
    return np.sum(np.abs(spectrum) ** 2, axis=1), np.sum((spectrum.conj() * near_spectrum).real, axis=1)


def _padded(n: int) -> int:
    """Return the length of Fourier transforms of n lines with as many zeros."""
    return int(scipy.fft.next_fast_len(2 * n))


def _toeplitz_spectrum(first: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the eigenvalues of a circulant matrix with the Hermitian Toeplitz matrix of this first column in it."""
    padded = np.zeros(_padded(first.size), dtype=np.complex128)
    padded[: first.size] = first
    padded[padded.size - first.size + 1 :] = first[:0:-1].conj()
    return np.asarray(np.fft.fft(padded).real)


def _times_toeplitz(first: NDArray[np.complex128], columns: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the product of the Hermitian Toeplitz matrix with this first column with columns."""
    spectrum = _toeplitz_spectrum(first)
    transform = np.fft.fft(columns, spectrum.size, axis=0) * spectrum[:, None]
    return np.asarray(np.fft.ifft(transform, axis=0)[: first.size])


@dataclass(frozen=True)
class _LinearSolution:
    """Solution of the linear part for one group: A c = y with A = Q R diag(norms)."""

    q: NDArray[np.float64]
    r: NDArray[np.float64]
    norms: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    residual: NDArray[np.float64]
    weight: NDArray[np.float64]
    factor: NDArray[np.float64]

    @classmethod
    def solve(cls, problem: PoleProblem, group: _WeightGroup, basis: NDArray[np.complex128]) -> _LinearSolution:
        columns = _stacked(group.weight[:, None] * basis)
        norms = np.linalg.norm(columns, axis=0)
        norms = np.where(norms > 0.0, norms, 1.0)
        q, r = np.linalg.qr(columns / norms)
        y = _stacked(group.weight[:, None] * problem.values[:, group.entries] * group.factor)
        projection = q.T @ y
        solution = np.linalg.lstsq(r, projection, rcond=None)[0] / norms[:, None] / group.factor
        return cls(q, r, norms, solution, y - q @ projection, group.weight, group.factor)

    def weighted(self, slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """`(2n, 2M)` weighted columns of the slopes."""
        return _stacked(self.weight[:, None] * slopes)

    def outside(self, slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """`(2n, 2M)` part of them orthogonal to the columns of the residues."""
        columns = self.weighted(slopes)
        return np.asarray(columns - self.q @ (self.q.T @ columns))

    def factors(self, count: int) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...]:
        """Factors `(M, entries)` of both halves of the slopes' columns, for the real, then the imaginary parts."""
        a, b = self.coefficients[:count] * self.factor, self.coefficients[count : 2 * count] * self.factor
        return (a, b), (-b, a)

    def rotation(self, count: int, index: int) -> NDArray[np.float64]:
        """Matrix `(2M, 2M)` from the slopes' columns to the derivatives of an entry by real and imaginary parts."""
        (a, b), (c, d) = ([np.diag(part[:, index]) for part in pair] for pair in self.factors(count))
        return np.block([[a, c], [b, d]])


def _stacked(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the real parts of complex numbers or rows, then their imaginary parts, along the first axis."""
    return np.concatenate([values.real, values.imag], axis=0)


def _unstacked(values: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the complex numbers of `_stacked`."""
    n = values.shape[0] // 2
    return np.asarray(values[:n] + 1j * values[n:])


def _inverse(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse of a symmetric matrix, infinite if it is singular."""
    if information.size == 0:
        return information
    size = np.sqrt(np.diag(information))
    if not np.all(np.isfinite(information)) or np.any(size == 0.0):
        return np.full(information.shape, np.inf)
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    if values[0] <= values[-1] * 1e-14:
        return np.full(information.shape, np.inf)
    scaled: NDArray[np.float64] = (vectors / values) @ vectors.T
    return np.asarray(scaled / np.outer(size, size))
