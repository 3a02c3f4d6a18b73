"""Poles and residues by least squares: the residues, which enter linearly, are solved for at every step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STEPS = 200
_TOLERANCE = 1e-13
_ROUNDING = 1e-14
"""A step of poles over their distance to the lines that is no step."""
_BLOCK = 64
"""Candidates whose columns are held at one time."""


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
    information_matrices : ndarray
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
    information_matrices: NDArray[np.float64]
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
        """`(n, 2M)`: of each pole the derivatives of its two columns by its real part.

        With them T and G, the derivatives of the columns by the imaginary part are G and -T.
        """
        own, other = 1.0 / (self.s[:, None] - poles) ** 2, 1.0 / (self.s[:, None] - poles.conj()) ** 2
        raised = self.s[:, None] ** self.power
        return np.concatenate([raised * (own + other), 1j * raised * (own - other)], axis=1)

    @property
    def decay_rate(self) -> float:
        """Of the exponential window: how far the lines are from the imaginary axis."""
        return float(self.s[0].real)

    @property
    def spacing(self) -> float:
        """Smallest distance of the lines in rad/s."""
        return float(np.min(np.diff(self.s.imag)))


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
    additive : ndarray, optional
        `(n, m)` share of each variance that is additive noise, independent between entries. The rest is in proportion
        to the FRF, as noise of the force is, and may be common to the responses to one excitation: how far it is
        follows from the residuals. By default all is additive. The covariance alone depends on it.
    excitations : int
        Entries are the responses by so many excitations, one row after the other.
    """

    model: PoleModel
    values: NDArray[np.complex128]
    weights: NDArray[np.float64]
    shared: float = 1.0
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
        """Return the fit that a Levenberg-Marquardt search from these poles ends at; without poles the background's.

        Parameters
        ----------
        start : ndarray
            `(M,)` first poles.
        low, high : ndarray, optional
            `(M,)` bounds of the real and of the imaginary parts.
        tolerance : float, optional
            The search ends where a step is expected to lower the sum of squares by less than this share of it.
        steps : int, optional
            Most evaluations.
        """
        count = start.size
        groups = self._groups()
        if count == 0:
            return self._conclude(start, groups, True)
        least = -np.full(count, complex(np.inf, np.inf)) if low is None else low
        most = np.full(count, complex(np.inf, np.inf)) if high is None else high
        ends = _parts(least), _parts(most)
        x = np.clip(_parts(start), *ends)
        size, slope, bending = self._evaluate(_whole(x), groups)
        damping, converged = 1e-3, False
        for _ in range(steps):
            # A pole at a bound that the sum of squares pushes against stays there.
            free = ~(((x <= ends[0]) & (slope > 0.0)) | ((x >= ends[1]) & (slope < 0.0)))
            scale = np.sqrt(np.diag(bending))
            scale = np.where(scale > 0.0, scale, 1.0)[free]
            if not free.any():
                converged = True
                break
            scaled = bending[np.ix_(free, free)] / np.outer(scale, scale)
            step = np.zeros(2 * count)
            step[free] = -np.linalg.lstsq(scaled + damping * np.eye(scale.size), slope[free] / scale, rcond=None)[0]
            step[free] /= scale
            # In one step no pole moves farther than it is from the lines: the linearisation ends there.
            away = np.maximum(np.abs(self.model.decay_rate - x[:count]), self.model.spacing)
            step /= max(1.0, float(np.max(np.abs(step) / np.tile(away, 2))))
            new = np.clip(x + step, *ends)
            step = new - x
            expected = -(2.0 * slope @ step + step @ bending @ step)
            tried = self._evaluate(_whole(new), groups)
            better = size - tried[0]
            if better >= 0.0:
                x, (size, slope, bending) = new, tried
                damping = max(damping * (0.1 if better > 0.5 * expected else 1.0), 1e-12)
            else:
                damping = max(damping, 1e-6) * 10.0
            small = float(np.max(np.abs(step) / np.tile(away, 2))) <= _ROUNDING
            if (better >= 0.0 and expected <= tolerance * size) or small or damping > 1e10:
                converged = True
                break
        return self._conclude(_whole(x), groups, converged)

    def gains(self, poles: NDArray[np.complex128], candidates: NDArray[np.complex128]) -> NDArray[np.float64]:
        """By how much each candidate, added to these poles, would lower the sum of the squared residuals."""
        gains = np.zeros(candidates.size)
        basis = self.model.basis(poles)
        for group in self._groups():
            solved = _Solved.of(self, group, basis)
            for first in range(0, candidates.size, _BLOCK):
                own = candidates[first : first + _BLOCK]
                columns = _stacked(group.weight[:, None] * self.model.of_poles(own))
                columns /= np.maximum(np.linalg.norm(columns, axis=0), np.finfo(np.float64).tiny)
                columns -= solved.q @ (solved.q.T @ columns)
                a, b = columns[:, : own.size], columns[:, own.size :]
                # Of what a and b explain together, from their Gram matrix of two by two.
                aa, bb, ab = (np.einsum("ij,ij->j", x, y) for x, y in ((a, a), (b, b), (a, b)))
                left = columns.T @ solved.residual
                ya, yb = left[: own.size], left[own.size :]
                top = bb * np.sum(ya**2, axis=1) + aa * np.sum(yb**2, axis=1) - 2.0 * ab * np.sum(ya * yb, axis=1)
                known = aa * bb - ab**2
                good = known > 1e-12 * np.maximum(aa, bb) ** 2
                gains[first : first + _BLOCK] += np.where(good, top / np.where(good, known, 1.0), 0.0)
        return gains

    def left_over(self, poles: NDArray[np.complex128]) -> float:
        """Sum of the squared residuals with the best residues for these poles."""
        basis = self.model.basis(poles)
        return float(sum(np.sum(_Solved.of(self, group, basis).residual ** 2) for group in self._groups()))

    @property
    def square(self) -> float:
        """Sum of the squared values in units of the weights."""
        return float(np.sum(np.abs(self.values * self.weights) ** 2))

    def _groups(self) -> list[_Group]:
        groups: list[_Group] = []
        left = np.arange(self.values.shape[1])
        while left.size:
            sizes = self.weights[:, left].max(axis=0)
            sizes = np.where(sizes > 0.0, sizes, 1.0)
            first = self.weights[:, left[0]] / sizes[0]
            same = np.all(np.abs(self.weights[:, left] / sizes - first[:, None]) <= 1e-12 * first[:, None], axis=0)
            groups.append(_Group(left[same], first, sizes[same]))
            left = left[~same]
        return groups

    def _evaluate(
        self, poles: NDArray[np.complex128], groups: list[_Group]
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
        """Return the sum of squares with the best residues, half its gradient, and the Gauss-Newton matrix.

        Entries of one group share the columns that the residues multiply, so that the matrices over lines are formed
        once and only those over modes once per entry: neither time nor memory grow with lines times entries times
        modes.
        """
        basis, slopes = self.model.basis(poles), self.model.slopes(poles)
        count = poles.size
        size, slope, bending = 0.0, np.zeros(2 * count), np.zeros((2 * count, 2 * count))
        for group in groups:
            solved = _Solved.of(self, group, basis)
            size += float(np.sum(solved.residual**2))
            outside = solved.outside(slopes)
            pull, gram = outside.T @ solved.residual, outside.T @ outside
            for half, (a, b) in enumerate(solved.turns(count)):
                slope[half * count : (half + 1) * count] -= np.sum(a * pull[:count] + b * pull[count:], axis=1)
                for other, (c, d) in enumerate(solved.turns(count)):
                    block = gram[:count, :count] * (a @ c.T) + gram[:count, count:] * (a @ d.T)
                    block += gram[count:, :count] * (b @ c.T) + gram[count:, count:] * (b @ d.T)
                    bending[half * count : (half + 1) * count, other * count : (other + 1) * count] += block
        return size, slope, bending

    def _conclude(self, poles: NDArray[np.complex128], groups: list[_Group], converged: bool) -> PoleFit:
        basis, slopes = self.model.basis(poles), self.model.slopes(poles)
        entries, size, modes = self.values.shape[1], basis.shape[1], poles.size
        count = 2 * modes
        coefficients, scores = np.zeros((entries, size)), np.zeros((entries, count))
        # Of the coefficients with the poles held, their slopes by the poles, and what links both errors.
        own, by_poles, link = (np.zeros((entries, size, each)) for each in (size, count, count))
        information_matrices, squares = (np.zeros((entries, count, count)) for _ in range(2))
        freedom = 2.0 * np.count_nonzero(self.weights)
        for group in groups:
            solved = _Solved.of(self, group, basis)
            back = np.linalg.pinv(solved.r) / solved.norms[:, None]
            inside, outside = solved.q.T @ solved.moved(slopes), solved.outside(slopes)
            gram, pull = outside.T @ outside, outside.T @ solved.residual
            for place, entry in enumerate(group.entries):
                if place == 0 or (self.additive is not None and self.shared > 1.0):
                    turned = self._turned(entry, basis @ solved.coefficients[:, place])
                    spread = self._with_noise(solved.q, turned)
                    seen, crossed = solved.q.T @ spread, spread.T @ outside
                    shared = outside.T @ self._with_noise(outside, turned)
                    of_coefficients = back @ seen @ back.T
                turn = solved.turn(modes, place)
                coefficients[entry] = solved.coefficients[:, place]
                information_matrices[entry] = turn.T @ gram @ turn
                squares[entry] = turn.T @ shared @ turn
                scores[entry] = -turn.T @ pull[:, place]
                own[entry] = of_coefficients / group.factor[place] ** 2
                by_poles[entry] = -back @ (inside @ turn) / group.factor[place]
                link[entry] = back @ (crossed @ turn) / group.factor[place]
                freedom -= float(np.trace(seen))
        inverse = _inverse(information_matrices.sum(axis=0))
        fitted = basis @ coefficients.T
        residual = (self.values - fitted) * self.weights
        square = squares.sum(axis=0)
        if self.additive is not None:
            square += self._between_entries(groups, basis, slopes, fitted, residual, link)
        if not np.all(np.isfinite(inverse)):
            # Poles that the data do not determine leave nothing determined that depends on them.
            of_poles, of_coefficients, with_poles = inverse, np.full(own.shape, np.inf), np.full(by_poles.shape, np.inf)
        else:
            of_poles = inverse @ square @ inverse
            freedom -= float(np.trace(inverse @ square))
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
            information_matrices,
            freedom,
            converged,
        )

    def _between_entries(
        self,
        groups: list[_Group],
        basis: NDArray[np.complex128],
        slopes: NDArray[np.complex128],
        fitted: NDArray[np.complex128],
        residual: NDArray[np.complex128],
        link: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Return what noise common to several responses adds to the covariance of the poles' scores.

        Relative to the FRF this noise is the same in all responses to one excitation. With g the derivative of an entry
        times its noise, turned back by the phase of the FRF, the products of different entries are G* T G less the sum
        of g* T g, with G the sum of g and T the correlation of the lines. What links the coefficients of an entry to
        the scores of the others is added to `link`.
        """
        count, (n, entries) = slopes.shape[1], self.values.shape
        total = np.zeros((count, count))
        turned = np.stack([self._turned(entry, fitted[:, entry]) for entry in range(entries)], axis=1)
        common = np.array(
            [
                self._common(turned[:, x :: self.excitations], residual[:, x :: self.excitations])
                for x in range(self.excitations)
            ]
        )
        if not common.any():
            return total
        sums = np.zeros((self.excitations, n, count), dtype=np.complex128)
        for repeated in (False, True):
            for group in groups:
                solved = _Solved.of(self, group, basis)
                outside = solved.outside(slopes)
                back = np.linalg.pinv(solved.r) / solved.norms[:, None]
                for place, entry in enumerate(group.entries):
                    x = entry % self.excitations
                    if common[x] == 0.0:
                        continue
                    back_turned = turned[:, entry, None].conj()
                    own = back_turned * _unstacked(outside @ solved.turn(count // 2, place))
                    if not repeated:
                        sums[x] += own
                        continue
                    others = self._with_shared(_stacked(sums[x] - own))
                    total += common[x] * (_stacked(own).T @ others)
                    seen = _stacked(back_turned * _unstacked(solved.q))
                    link[entry] += common[x] * (back @ (seen.T @ others)) / group.factor[place]
        return total

    @staticmethod
    def _common(turned: NDArray[np.complex128], residual: NDArray[np.complex128]) -> float:
        """Correlation between responses of their noise in proportion to the FRF, from 0 to 1, from the residuals.

        The sum of the products of different entries over what it is where they are alike. The fit makes both smaller
        by the same factor.
        """
        share = np.abs(turned) ** 2
        own = turned.conj() * residual
        weight = share * (share.sum(axis=1, keepdims=True) - share)
        size = float(np.sum(weight * np.abs(residual) ** 2))
        if size == 0.0:
            return 0.0
        product = float(np.sum(np.abs(own.sum(axis=1)) ** 2) - np.sum(np.abs(own) ** 2))
        return float(np.clip(product / size, 0.0, 1.0))

    def _turned(self, entry: int, fitted: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Root of the share of the noise in proportion to the FRF, with the FRF's phase."""
        size = np.abs(fitted)
        if self.additive is None:
            return np.zeros(size.shape, dtype=np.complex128)
        phase = np.where(size > 0.0, fitted, 1.0) / np.where(size > 0.0, size, 1.0)
        return np.asarray(np.sqrt(1.0 - self.additive[:, entry]) * phase)

    def _with_noise(self, columns: NDArray[np.float64], turned: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Product of the covariance of one entry's noise with stacked columns.

        Noise in proportion to the FRF is correlated between lines once the phase of the FRF is taken off.
        """
        if self.shared <= 1.0 or self.additive is None or columns.size == 0:
            return self._with_shared(columns)
        values, phase = _unstacked(columns), turned[:, None]
        additive = np.sqrt(np.maximum(1.0 - np.abs(phase) ** 2, 0.0))
        own = _stacked(np.concatenate([additive * values, phase.conj() * values], axis=1))
        first, second = np.split(_unstacked(self._with_shared(own)), 2, axis=1)
        return _stacked(additive * first + phase * second)

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
        """`(2n, 2M)`: the slopes' columns with the weights."""
        return _stacked(self.weight[:, None] * slopes)

    def outside(self, slopes: NDArray[np.complex128]) -> NDArray[np.float64]:
        """`(2n, 2M)`: the part of them that no residues explain."""
        moved = self.moved(slopes)
        return np.asarray(moved - self.q @ (self.q.T @ moved))

    def turns(self, count: int) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...]:
        """What multiplies both halves of the slopes' columns, `(M, entries)` each: by real, then by imaginary parts."""
        a, b = self.coefficients[:count] * self.factor, self.coefficients[count : 2 * count] * self.factor
        return (a, b), (-b, a)

    def turn(self, count: int, place: int) -> NDArray[np.float64]:
        """How the slopes' columns make up an entry's derivative by the real and by the imaginary parts, `(2M, 2M)`."""
        (a, b), (c, d) = ([np.diag(part[:, place]) for part in pair] for pair in self.turns(count))
        return np.block([[a, c], [b, d]])


def _parts(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real parts, then imaginary parts."""
    return np.concatenate([values.real, values.imag])


def _whole(parts: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the complex numbers of `_parts`."""
    return np.asarray(parts[: parts.size // 2] + 1j * parts[parts.size // 2 :])


def _stacked(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Real parts above imaginary parts."""
    return np.concatenate([values.real, values.imag], axis=0)


def _unstacked(values: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the complex columns of `_stacked`."""
    n = values.shape[0] // 2
    return np.asarray(values[:n] + 1j * values[n:])


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
