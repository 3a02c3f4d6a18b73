"""Poles and residues by least squares: the residues, which enter linearly, are solved for at every step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STEPS = 200
_TOLERANCE = 1e-13


@dataclass(frozen=True)
class PoleFit:
    """Poles, residues and background with their covariance.

    Attributes
    ----------
    poles : ndarray
        `(M,)` complex, s = -delta + i w_d.
    coefficients : ndarray
        `(m, k)` real, for each entry: real parts of the M residues, their imaginary parts, then real and imaginary
        part of each background term in the terms' order.
    residual : ndarray
        `(n, m)` complex, measured less fitted in units of the weights.
    fitted : ndarray
        `(n, m)` complex, in the form of the data.
    inverse : ndarray
        `(2M, 2M)` inverse of the information on the real, then the imaginary parts of the poles.
    of_poles : ndarray
        `(2M, 2M)` their covariance for weights that are the inverse standard deviation of the real and of the
        imaginary part; `inverse` itself where lines are independent.
    of_coefficients : ndarray
        `(m, k, k)` covariance of the coefficients, that of the poles included.
    with_poles : ndarray
        `(m, k, 2M)` covariance of the coefficients with the poles.
    scores : ndarray
        `(m, 2M)` where each entry alone would pull the poles: its share of the derivative of half the sum of squares,
        which is zero for all entries together.
    informations : ndarray
        `(m, 2M, 2M)` share of each entry in the inverse of `inverse`.
    degrees_of_freedom : float
        What the sum of squared residuals is expected to be for those weights: twice the number of values less that of
        real parameters where lines are independent.
    converged : bool
        Whether it stopped because nothing changed any more.
    """

    poles: NDArray[np.complex128]
    coefficients: NDArray[np.float64]
    residual: NDArray[np.complex128]
    fitted: NDArray[np.complex128]
    inverse: NDArray[np.float64]
    of_poles: NDArray[np.float64]
    of_coefficients: NDArray[np.float64]
    with_poles: NDArray[np.float64]
    scores: NDArray[np.float64]
    informations: NDArray[np.float64]
    degrees_of_freedom: float
    converged: bool

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

    Attributes
    ----------
    s : ndarray
        `(n,)` complex lines.
    power : int
        0, 1 or 2 for receptance, mobility, accelerance.
    terms : tuple of int
        Powers of s in the receptance that stand for the modes outside the band, each with a complex coefficient per
        entry: -2 for those below, 0 for those above.
    """

    s: NDArray[np.complex128]
    power: int
    terms: tuple[int, ...]

    def basis(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """`(n, k)` columns of the real coefficients."""
        return np.concatenate([self.of_poles(poles), self.background()], axis=1)

    def background(self) -> NDArray[np.complex128]:
        """`(n, 2 len(terms))` columns of the background."""
        columns = [self.s ** (term + self.power) for term in self.terms]
        pairs = [part for column in columns for part in (column, 1j * column)]
        return np.stack(pairs, axis=1) if pairs else np.empty((self.s.size, 0), dtype=np.complex128)

    def of_poles(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """`(n, 2M)` columns of the real parts of the residues, then of their imaginary parts."""
        own, other = 1.0 / (self.s[:, None] - poles), 1.0 / (self.s[:, None] - poles.conj())
        raised = self.s[:, None] ** self.power
        return np.concatenate([raised * (own + other), 1j * raised * (own - other)], axis=1)

    def slopes(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """`(4, n, M)`: of the two columns of each pole, by the pole's real, then by its imaginary part."""
        own, other = 1.0 / (self.s[:, None] - poles) ** 2, 1.0 / (self.s[:, None] - poles.conj()) ** 2
        raised = self.s[:, None] ** self.power
        total, gap = raised * (own + other), 1j * raised * (own - other)
        return np.stack([total, gap, gap, -total])


@dataclass(frozen=True)
class _Group:
    """Entries that share their weights per line, so that one factorisation serves all of them."""

    entries: NDArray[np.int64]
    weight: NDArray[np.float64]
    factor: NDArray[np.float64]


@dataclass(frozen=True)
class PoleProblem:
    """The weighted problem; by variable projection (Golub and Pereyra 1973) only the poles are searched for.

    The derivative is Kaufman's (1975), which leaves out what is of the size of the residual: it gives the exact
    covariance of the linearised problem.

    Attributes
    ----------
    model : PoleModel
        The lines and the form.
    values : ndarray
        `(n, m)` in the form of the data.
    weights : ndarray
        `(n, m)`, the inverse standard deviation of the real and of the imaginary part, up to one factor.
    shared : float
        How many neighbouring lines share one independent value. The estimate does not depend on it, its covariance
        does.
    """

    model: PoleModel
    values: NDArray[np.complex128]
    weights: NDArray[np.float64]
    shared: float = 1.0

    def fit(self, start: NDArray[np.complex128], *, tolerance: float = _TOLERANCE, steps: int = _STEPS) -> PoleFit:
        """Return the fit that a Levenberg-Marquardt search from these poles ends at; without poles the background's."""
        from scipy.optimize import least_squares

        count = start.size
        if count == 0:
            return self._conclude(start, self._groups(), True)
        # Poles move by some of their distance to the axis.
        scale = np.maximum(np.abs(start.real), 1e-6 * np.abs(start))
        groups = self._groups()
        kept: dict[bytes, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

        def poles_at(x: NDArray[np.float64]) -> NDArray[np.complex128]:
            return np.asarray(start + scale * (x[:count] + 1j * x[count:]))

        def evaluate(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            key = x.tobytes()
            if key not in kept:
                kept.clear()
                kept[key] = self._project(poles_at(x), scale, groups)
            return kept[key]

        def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
            return evaluate(x)[0]

        def jacobian(x: NDArray[np.float64]) -> NDArray[np.float64]:
            return evaluate(x)[1]

        found = least_squares(
            residuals,
            np.zeros(2 * count),
            jac=jacobian,
            method="lm",
            ftol=tolerance,
            xtol=tolerance,
            gtol=tolerance,
            max_nfev=steps,
        )
        return self._conclude(poles_at(found.x), groups, bool(found.status > 0))

    def gains(self, poles: NDArray[np.complex128], candidates: NDArray[np.complex128]) -> NDArray[np.float64]:
        """By how much each candidate, added to these poles, would lower the sum of the squared residuals."""
        gains = np.zeros(candidates.size)
        basis = self.model.basis(poles)
        for group in self._groups():
            w = group.weight[:, None]
            q = _orthonormal(_stacked(w * basis))
            y = _stacked(w * self.values[:, group.entries] * group.factor)
            left = y - q @ (q.T @ y)
            for index in range(candidates.size):
                pair = _stacked(w * self.model.of_poles(candidates[index : index + 1]))
                pair = _orthonormal(pair - q @ (q.T @ pair))
                gains[index] += float(np.sum((pair.T @ left) ** 2))
        return gains

    @property
    def square(self) -> float:
        """Sum of the squared values in units of the weights."""
        return float(np.sum(np.abs(self.values * self.weights) ** 2))

    def _groups(self) -> list[_Group]:
        groups: list[_Group] = []
        left = list(range(self.values.shape[1]))
        while left:
            sizes = self.weights[:, left].max(axis=0)
            sizes = np.where(sizes > 0.0, sizes, 1.0)
            shapes = self.weights[:, left] / sizes
            same = np.all(np.abs(shapes - shapes[:, :1]) <= 1e-12 * shapes[:, :1], axis=0)
            chosen = [entry for entry, alike in zip(left, same, strict=True) if alike]
            groups.append(_Group(np.array(chosen), shapes[:, 0], sizes[same]))
            left = [entry for entry in left if entry not in chosen]
        return groups

    def _project(
        self, poles: NDArray[np.complex128], scale: NDArray[np.float64], groups: list[_Group]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residuals with the best residues for these poles, and their derivative."""
        basis, slopes = self.model.basis(poles), self.model.slopes(poles) * scale
        residuals, jacobians = [], []
        for group in groups:
            solved = _Solved.of(self, group, basis)
            residuals.append(solved.residual.T.ravel())
            moved = solved.moved(slopes)
            moved -= np.einsum("ij,jpe->ipe", solved.q, np.einsum("ij,ipe->jpe", solved.q, moved))
            jacobians.append(-moved.transpose(2, 0, 1).reshape(-1, moved.shape[1]))
        return np.concatenate(residuals), np.concatenate(jacobians)

    def _conclude(self, poles: NDArray[np.complex128], groups: list[_Group], converged: bool) -> PoleFit:
        basis, slopes = self.model.basis(poles), self.model.slopes(poles)
        entries, size, count = self.values.shape[1], basis.shape[1], 2 * poles.size
        coefficients, scores = np.zeros((entries, size)), np.zeros((entries, count))
        # Of the coefficients with the poles held, their slopes by the poles, and what links both errors.
        own, by_poles, link = (np.zeros((entries, size, each)) for each in (size, count, count))
        informations, squares = (np.zeros((entries, count, count)) for _ in range(2))
        freedom = 2.0 * np.count_nonzero(self.weights)
        for group in groups:
            solved = _Solved.of(self, group, basis)
            moved = solved.moved(slopes)
            back = np.linalg.pinv(solved.r) / solved.norms[:, None]
            spread = self._with_shared(solved.q)
            seen = solved.q.T @ spread
            for place, entry in enumerate(group.entries):
                coefficients[entry] = solved.coefficients[:, place]
                inside = solved.q.T @ moved[:, :, place]
                # Rounding makes a difference of two squares negative; a product of a matrix with itself never is.
                outside = moved[:, :, place] - solved.q @ inside
                informations[entry] = outside.T @ outside
                squares[entry] = outside.T @ self._with_shared(outside)
                scores[entry] = -outside.T @ solved.residual[:, place]
                own[entry] = back @ seen @ back.T / group.factor[place] ** 2
                by_poles[entry] = -back @ inside / group.factor[place]
                link[entry] = back @ (spread.T @ outside) / group.factor[place]
                freedom -= float(np.trace(seen))
        inverse = _inverse(informations.sum(axis=0))
        fitted = basis @ coefficients.T
        residual = (self.values - fitted) * self.weights
        if not np.all(np.isfinite(inverse)):
            # Poles that the data do not determine leave nothing determined that depends on them.
            of_poles, of_coefficients, with_poles = inverse, np.full(own.shape, np.inf), np.full(by_poles.shape, np.inf)
        else:
            of_poles = inverse @ squares.sum(axis=0) @ inverse
            freedom -= float(np.trace(inverse @ squares.sum(axis=0)))
            linked = link @ inverse
            with_poles = by_poles @ of_poles + linked
            of_coefficients = own + by_poles @ of_poles @ by_poles.transpose(0, 2, 1)
            of_coefficients += linked @ by_poles.transpose(0, 2, 1) + by_poles @ linked.transpose(0, 2, 1)
        return PoleFit(
            poles,
            coefficients,
            residual,
            fitted,
            inverse,
            of_poles,
            of_coefficients,
            with_poles,
            scores,
            informations,
            freedom,
            converged,
        )

    def _with_shared(self, columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Product of the correlation of the lines with `(2n, k)` stacked columns.

        Noise under an exponential window, exp(-2 sigma t) in power, has between lines m apart the correlation
        1 / (1 + i pi m / c), where c, the sum of its squares, is the number of lines that share a value. Zero padding
        leaves noise in the early part of the record as well, and is taken for the same.
        """
        if self.shared <= 1.0 or columns.size == 0:
            return columns
        from scipy.linalg import matmul_toeplitz

        n = columns.shape[0] // 2
        first = 1.0 / (1.0 + 1j * np.pi * np.arange(n) / self.shared)
        return _stacked(np.asarray(matmul_toeplitz((first, first.conj()), columns[:n] + 1j * columns[n:])))


@dataclass(frozen=True)
class _Solved:
    """The linear part for one group: A c = y with A = Q R diag(norms)."""

    q: NDArray[np.float64]
    r: NDArray[np.float64]
    norms: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    residual: NDArray[np.float64]
    weight: NDArray[np.float64]
    factor: NDArray[np.float64]

    @classmethod
    def of(cls, problem: PoleProblem, group: _Group, basis: NDArray[np.complex128]) -> _Solved:
        columns = _stacked(group.weight[:, None] * basis)
        norms = np.linalg.norm(columns, axis=0)
        norms = np.where(norms > 0.0, norms, 1.0)
        q, r = np.linalg.qr(columns / norms)
        y = _stacked(group.weight[:, None] * problem.values[:, group.entries] * group.factor)
        inside = q.T @ y
        solution = np.linalg.lstsq(r, inside, rcond=None)[0] / norms[:, None] / group.factor
        return cls(q, r, norms, solution, y - q @ inside, group.weight, group.factor)

    def moved(self, slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """`(2n, 2M, entries)`: how the fitted values move with the poles while the residues stay."""
        count = slopes.shape[2]
        a, b = self.coefficients[:count] * self.factor, self.coefficients[count : 2 * count] * self.factor
        w = self.weight[:, None, None]
        by_real = w * (slopes[0][:, :, None] * a + slopes[1][:, :, None] * b)
        by_imaginary = w * (slopes[2][:, :, None] * a + slopes[3][:, :, None] * b)
        return _stacked(np.concatenate([by_real, by_imaginary], axis=1))


def _stacked(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real parts above imaginary parts."""
    return np.concatenate([values.real, values.imag], axis=0)


def _orthonormal(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    norms = np.linalg.norm(columns, axis=0)
    q: NDArray[np.float64] = np.linalg.qr(columns / np.where(norms > 0.0, norms, 1.0))[0]
    return q


def _inverse(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a symmetric matrix; infinite where it is singular, as nothing is known there."""
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
