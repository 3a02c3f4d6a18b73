"""Which candidates are modes: added one by one while each explains more than noise would."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from receptance.modal._least_squares import PoleFit, PoleModel, PoleProblem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.modal._lines import Lines

Scatter = Literal["absolute", "relative"]

_TRIES = 8
"""Candidates that are tried before no further mode is looked for."""
_SHARE = 0.2
"""Of its price: a candidate that lowers the misfit by less before the poles are fitted is not tried."""
_EXACT = 1e-22
"""Share of the sum of squares below which what is left is rounding."""
_LOOSE, _QUICK = 1e-6, 30
"""Tolerance and most steps while modes are still being added."""
_FEW = 30
"""Fewer lines tell noise from misfit by their mean square alone."""
_REWEIGHTED = 3
"""Fits after which the weights, which follow from what the fit leaves, no longer change visibly."""
_BEYOND = (0.02, 0.06, 0.15, 0.4, 1.0)
"""In widths of the band: how far outside a pole is looked for."""
_OUTSIDE = 2
"""Most poles above the band, and below."""
_NARROWEST = 1e-3
"""Half-power bands are no narrower than this share of the distance of the lines, poles no closer than of their band."""
_APART = 0.1
"""In half-power bands: nearer poles, where no number of modes is given, are one mode that moved between the hits."""


@dataclass(frozen=True)
class Poles:
    """Poles that are looked for, each with the box that it stays in.

    Attributes
    ----------
    values : ndarray
        `(M,)` rad/s.
    low, high : ndarray
        `(M,)` bounds of the real and of the imaginary parts.
    role : ndarray
        `(M,)` which of the given frequencies it belongs to, 0 for any mode where none are given, -1 for poles that are
        background: those outside the band, and between given frequencies.
    """

    values: NDArray[np.complex128]
    low: NDArray[np.complex128]
    high: NDArray[np.complex128]
    role: NDArray[np.int64]

    @classmethod
    def none(cls) -> Poles:
        """Return no poles."""
        empty = np.empty(0, dtype=np.complex128)
        return cls(empty, empty, empty, np.empty(0, dtype=np.int64))

    def and_those(self, other: Poles) -> Poles:
        """Return both."""
        return Poles(
            np.concatenate([self.values, other.values]),
            np.concatenate([self.low, other.low]),
            np.concatenate([self.high, other.high]),
            np.concatenate([self.role, other.role]),
        )

    def only(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Poles:
        """Return some."""
        return Poles(self.values[which], self.low[which], self.high[which], self.role[which])

    def fitted(self, problem: PoleProblem, *, loose: bool = False) -> tuple[Poles, PoleFit]:
        """Return the poles where a fit puts them, and the fit."""
        options = {"tolerance": _LOOSE, "steps": _QUICK} if loose else {}
        fit = problem.fit(self.values, low=self.low, high=self.high, **options)  # type: ignore[arg-type]
        return Poles(fit.poles, self.low, self.high, self.role), fit

    def plausible(self, sigma: float, highest_damping: float, apart: float = _NARROWEST) -> NDArray[np.bool_]:
        """Which poles are inside their boxes, damped as modes are, and none that was there before them."""
        width = sigma - self.values.real
        inside = (self.values.real > self.low.real) & (self.values.real < self.high.real)
        inside &= (self.values.imag > self.low.imag) & (self.values.imag < self.high.imag)
        inside &= -self.values.real <= highest_damping * np.abs(self.values)
        close = np.abs(self.values[:, None] - self.values) <= 2.0 * apart * np.minimum(width[:, None], width)
        return inside & ~np.tril(close, -1).any(axis=1)


@dataclass(frozen=True)
class Search:
    """Where modes are looked for, and what a mode may look like.

    Attributes
    ----------
    lines : Lines
        What is fitted.
    terms : tuple of int
        Background, see `PoleModel`.
    scatter : {"absolute", "relative"}
        How the noise is spread over the lines where the FRF does not state it.
    candidates : ndarray
        Poles in the band in rad/s.
    highest_damping : float
        A pole with a higher damping ratio is no mode.
    band_hz : (float, float)
        First and last line.
    wanted : int, tuple of float, or None
        How many modes, or near which frequencies in Hz; None for those that the lines show.
    most : int
        No more modes than this.
    """

    lines: Lines
    terms: tuple[int, ...]
    scatter: Scatter
    candidates: NDArray[np.complex128]
    highest_damping: float
    wanted: int | tuple[float, ...] | None
    most: int

    def poles(self) -> Poles:
        """Poles of the modes that are asked for and of those that have to be known beside them.

        A mode that is asked for is added as long as there is a candidate; every other one, outside the band or between
        those near given frequencies, must lower the misfit by more than its parameters cost (Schwarz 1978).
        """
        poles = Poles.none()
        fit = poles.fitted(self._problem(None))[1]
        while poles.values.size < self.most:
            found = self._one_more(poles, fit) or self._all_given(poles, fit)
            if found is None:
                break
            poles, fit = self.assigned(found[0]), found[1]
            problem = self._problem(fit)
            if fit.chi_square <= _EXACT * problem.square:
                break
        return poles

    def assigned(self, poles: Poles) -> Poles:
        """Return the poles with the given frequencies shared out among them, to the nearest in all."""
        if not isinstance(self.wanted, tuple):
            return poles
        from scipy.optimize import linear_sum_assignment

        f = self.lines.frequency_hz
        inside = np.flatnonzero((poles.values.imag >= 2.0 * np.pi * f[0]) & (poles.values.imag <= 2.0 * np.pi * f[-1]))
        away = np.abs(poles.values[inside].imag[:, None] / (2.0 * np.pi) - np.array(self.wanted))
        reach = np.array([reach_of(place, self.lines) for place in self.wanted])
        role = np.full(poles.values.size, -1)
        # Too far is worse than any sum of distances that are not.
        for row, column in zip(*linear_sum_assignment(np.where(away > reach, 1e6 * f[-1], away)), strict=True):
            if away[row, column] <= reach[column]:
                role[inside[row]] = column
        return replace(poles, role=role)

    def _still(self, poles: Poles) -> int:
        """How many modes are still to be added whatever they explain."""
        if self.wanted is None:
            return 0
        if isinstance(self.wanted, int):
            return self.wanted - int(np.count_nonzero(poles.role >= 0))
        return len(self._unmet(poles))

    def _unmet(self, poles: Poles) -> list[int]:
        """Which of the given frequencies have no pole yet."""
        assert isinstance(self.wanted, tuple)
        return [index for index in range(len(self.wanted)) if index not in poles.role]

    @cached_property
    def _boxes(self) -> Poles:
        """First guesses at the given frequencies, with the boxes around them."""
        assert isinstance(self.wanted, tuple)
        f = self.lines.frequency_hz
        places = np.array(self.wanted)
        reach = np.array([reach_of(place, self.lines) for place in self.wanted])
        guesses = 2j * np.pi * places + (self._sigma - 2.0 * np.pi * self.lines.spacing_hz)
        ends = np.maximum(places - reach, f[0]), np.minimum(places + reach, f[-1])
        return self._boxed(guesses, *ends, np.arange(places.size))

    def _boxed(
        self,
        poles: NDArray[np.complex128],
        low_hz: NDArray[np.float64],
        high_hz: NDArray[np.float64],
        role: NDArray[np.int64],
    ) -> Poles:
        w = 2.0 * np.pi * np.stack([low_hz, high_hz])
        most = self.highest_damping / np.sqrt(1.0 - self.highest_damping**2) if self.highest_damping < 1.0 else np.inf
        narrowest = self._sigma - _NARROWEST * np.pi * self.lines.spacing_hz
        return Poles(poles, -most * w[1] + 1j * w[0], np.full(poles.size, narrowest) + 1j * w[1], role)

    @cached_property
    def _inside(self) -> Poles:
        f = self.lines.frequency_hz
        ends = np.full((2, self.candidates.size), [[f[0]], [f[-1]]])
        role = np.full(self.candidates.size, -1 if isinstance(self.wanted, tuple) else 0)
        return self._boxed(self.candidates, ends[0], ends[1], role)

    @cached_property
    def _outside(self) -> Poles:
        """Where poles outside the band are looked for."""
        first, last = self.lines.frequency_hz[[0, -1]]
        width = last - first
        beyond = np.array(_BEYOND)
        places, low, high = [np.empty(0)], [np.empty(0)], [np.empty(0)]
        if 0 in self.terms:
            places.append(last + width * beyond)
            low.append(np.full(beyond.size, last))
            high.append(np.full(beyond.size, last + 3.0 * width))
        if -2 in self.terms:
            own = first - width * beyond[width * beyond < 0.9 * first]
            places.append(own)
            low.append(np.full(own.size, max(first - 3.0 * width, 0.05 * first)))
            high.append(np.full(own.size, first))
        f, below, above = (np.concatenate(each) for each in (places, low, high))
        edge = np.where(f > last, f - last, first - f)
        guesses = [2j * np.pi * f + self._sigma - 2.0 * np.pi * share * edge for share in (0.1, 0.5)]
        both = Poles.none()
        for guess in guesses:
            both = both.and_those(self._boxed(guess, below, above, np.full(guess.size, -1)))
        return both

    def _plausible(self, poles: Poles) -> NDArray[np.bool_]:
        apart = _APART if self.wanted is None else _NARROWEST
        return poles.plausible(self._sigma, self.highest_damping, apart)

    @property
    def _sigma(self) -> float:
        return float(self.lines.frf.decay_rate)

    def _price(self, fit: PoleFit) -> float:
        """By how much a further mode has to lower the misfit; noise that lines share can look like one."""
        entries = self.lines.values.shape[1]
        lines = 2 * self.lines.frequency_hz.size
        price = 2.0 * np.log(lines * entries) + 2.0 * entries * np.log(lines)
        variance = fit.chi_square / max(fit.degrees_of_freedom, 1.0)
        return float(price * self.lines.shared * max(variance, self._stated))

    @cached_property
    def _stated(self) -> float:
        """Mean square of the stated noise in units of the weights that are searched with; zero if none is stated."""
        if self.lines.relative is None:
            return 0.0
        own = weights_of(self.lines, self.scatter, None)
        common = self._common(own)
        known = common > 0.0
        return float(np.mean((common[known] / own[known]) ** 2))

    @staticmethod
    def _common(weights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights nearest to these that are a product of one for each line and one for each entry.

        With those one factorisation serves all entries while modes are looked for; the last fit has its own weights.
        A line that one entry does not know is left out, unless few lines would be left.
        """
        known = np.all(weights > 0.0, axis=1)
        if np.count_nonzero(known) < 0.5 * known.size:
            return weights
        size = np.log(weights[known])
        lines = size.mean(axis=1, keepdims=True)
        common = np.zeros_like(weights)
        common[known] = np.exp(lines + (size - lines).mean(axis=0))
        return common

    def _problem(self, fit: PoleFit | None) -> PoleProblem:
        return _problem(self.lines, self.terms, self._common(weights_of(self.lines, self.scatter, fit)))

    def _allowed(self, poles: Poles) -> tuple[Poles, NDArray[np.bool_]]:
        """Candidates for the next pole, and which of them are asked for."""
        inside, still = self._inside, self._still(poles)
        asked = np.full(inside.values.size, still > 0)
        if isinstance(self.wanted, int):
            inside, asked = (inside, asked) if still > 0 else (Poles.none(), asked[:0])
        elif self.wanted is not None:
            boxes, unmet = self._boxes, self._unmet(poles)
            place = inside.values.imag[:, None]
            near = (place >= boxes.low.imag) & (place <= boxes.high.imag)
            others = inside.only(np.logical_not(near.any(axis=1)))
            inside, asked = others, np.zeros(others.values.size, dtype=bool)
            for index in unmet:
                # What is nearer to another frequency that has no pole yet is for that one.
                nearest = np.array(unmet)[np.argmin(np.abs(place - boxes.values.imag[unmet]), axis=1)]
                own = self.candidates[near[:, index] & (nearest == index)]
                guesses = np.append(own, boxes.values[index])
                low, high = (np.full(guesses.size, each[index]) for each in (boxes.low, boxes.high))
                inside = inside.and_those(Poles(guesses, low, high, np.full(guesses.size, index)))
                asked = np.append(asked, np.ones(guesses.size, dtype=bool))
        f = self.lines.frequency_hz
        above, below = (
            int(np.count_nonzero(each))
            for each in (poles.low.imag >= 2.0 * np.pi * f[-1], poles.high.imag <= 2.0 * np.pi * f[0])
        )
        places = self._outside.values.imag / (2.0 * np.pi)
        outside = self._outside.only(((places > f[-1]) & (above < _OUTSIDE)) | ((places < f[0]) & (below < _OUTSIDE)))
        return inside.and_those(outside), np.append(asked, np.zeros(outside.values.size, dtype=bool))

    def _one_more(self, poles: Poles, fit: PoleFit) -> tuple[Poles, PoleFit] | None:
        """Return the poles and one more, fitted, where there is a candidate that is asked for or worth its price."""
        candidates, asked = self._allowed(poles)
        if candidates.values.size == 0:
            return None
        problem = self._problem(fit)
        price = self._price(fit)
        gains = problem.gains(poles.values, candidates.values)
        tried: list[complex] = []
        # A given frequency where no candidate serves must not keep the others from being tried.
        left = dict.fromkeys(candidates.role.tolist(), _TRIES)
        for index in np.argsort(-gains):
            role = int(candidates.role[index])
            if left[role] == 0:
                continue
            if not asked[index] and gains[index] < _SHARE * price:
                continue
            # The same place again would end where it ended before.
            pole = complex(candidates.values[index])
            if any(abs(pole - other) <= 0.5 * abs(self._sigma - other.real) for other in tried):
                continue
            tried.append(pole)
            left[role] -= 1
            more, richer = poles.and_those(candidates.only(np.array([index]))).fitted(problem, loose=True)
            good = self._plausible(more)
            if not good.all():
                # A pole that is no mode any more goes; what is left must still be better than before.
                more, richer = more.only(good).fitted(problem, loose=True)
            more = self.assigned(more)
            if not self._plausible(more).all() or self._still(more) > self._still(poles):
                continue
            if self._still(more) < self._still(poles) and more.values.size > poles.values.size:
                return more, richer
            # Both with the weights of the richer model, which knows the scatter best.
            problem_after = self._problem(richer)
            _, before = poles.fitted(problem_after, loose=True)
            more, after = more.fitted(problem_after, loose=True)
            # An exchange of one pole for another is free, but must lead somewhere.
            least = max(more.values.size - poles.values.size, 0.1) * self._price(after)
            if self._plausible(more).all() and before.chi_square - after.chi_square > least:
                return more, after
        return None

    def _all_given(self, poles: Poles, fit: PoleFit) -> tuple[Poles, PoleFit] | None:
        """Return poles that begin at all given frequencies at once, where one more at a time leads no further.

        A pole that stands for two close modes keeps each of them from being added alone.
        """
        if not isinstance(self.wanted, tuple) or not self._still(poles):
            return None
        problem = self._problem(fit)
        more, richer = self._boxes.and_those(poles.only(poles.role < 0)).fitted(problem, loose=True)
        good = self._plausible(more)
        if not good.all():
            more, richer = more.only(good).fitted(problem, loose=True)
        more = self.assigned(more)
        if not self._plausible(more).all() or self._still(more) >= self._still(poles):
            return None
        return more, richer


def reach_of(place_hz: float, lines: Lines) -> float:
    """How far in Hz a mode may be from where it was said to be."""
    return max(0.03 * place_hz, 5.0 * lines.spacing_hz)


def refined(
    lines: Lines, terms: tuple[int, ...], scatter: Scatter, poles: Poles, highest_damping: float
) -> tuple[Poles, PoleFit]:
    """Fit the same poles to all lines, with weights from what the fit leaves; those that are no modes then go."""
    sigma = float(lines.frf.decay_rate)
    poles, fit = poles.fitted(_problem(lines, terms, weights_of(lines, scatter, None)), loose=True)
    for left in reversed(range(_REWEIGHTED)):
        poles = poles.only(poles.plausible(sigma, highest_damping))
        problem = _problem(lines, terms, weights_of(lines, scatter, fit, smooth=True))
        if left == 0:
            # Only the covariance depends on it, which is taken from the last fit.
            own = lines.additive if lines.relative is not None or scatter == "absolute" else 0.0 * problem.weights
            problem = replace(problem, additive=own, excitations=lines.frf.values.shape[2])
        poles, fit = poles.fitted(problem)
    return poles, fit


def _problem(lines: Lines, terms: tuple[int, ...], weights: NDArray[np.float64]) -> PoleProblem:
    return PoleProblem(PoleModel(lines.s, lines.power, terms), lines.values, weights, lines.shared)


def weights_of(lines: Lines, scatter: Scatter, fit: PoleFit | None, *, smooth: bool = False) -> NDArray[np.float64]:
    """`(n, m)` inverse standard deviations of the real and of the imaginary part of each value.

    Where the FRF states no variance, the weight of an entry follows from the noise that a fit leaves in it, and only
    the ratio of the entries' weights has a meaning; before there is a fit every entry counts alike.

    Parameters
    ----------
    lines : Lines
        The values.
    scatter : {"absolute", "relative"}
        Of what kind the scatter is if it is not stated: of one size on all lines, or in proportion to the magnitude.
    fit : PoleFit or None
        What is known so far.
    smooth : bool, optional
        Whether magnitudes are those of the fit as well: a line that noise made small would else weigh too much.
    """
    size = np.abs(lines.values)
    level = np.sqrt(np.mean(size**2, axis=0))
    # An entry of zeros, a node of every mode, weighs something and says nothing.
    floor = np.where(level > 0.0, 1e-12 * level, 1.0)
    if smooth and fit is not None:
        size = np.sqrt(0.5 * (size**2 + np.abs(fit.fitted) ** 2))
    size = np.maximum(size, floor)
    if lines.relative is not None:
        return np.asarray(1.0 / (lines.relative * size))
    unit = size if scatter == "relative" else np.ones_like(size)
    left = lines.values if fit is None else lines.values - fit.fitted
    spread = np.sqrt(_noise(left / unit) if fit is not None else np.mean(np.abs(left / unit) ** 2, axis=0))
    least = 1e-12 if scatter == "relative" else floor
    return np.asarray(1.0 / (unit * np.maximum(spread, least)))


def _noise(left: NDArray[np.complex128]) -> NDArray[np.float64]:
    """`(m,)` variance of the noise in each entry's residuals, up to one factor.

    From the median of how much a line differs from the mean of its neighbours, because a mode that sits elsewhere in
    one entry leaves large residuals on a few lines: counted as noise they would leave all weight to
    the entry that happens to agree. Few lines have no median worth having.
    """
    if len(left) < _FEW:
        return np.asarray(np.mean(np.abs(left) ** 2, axis=0) / 2.0)
    step = left[1:-1] - 0.5 * (left[:-2] + left[2:])
    # |step|^2 is 1.5 times the variance times chi-square of two degrees of freedom, whose median is 2 ln 2.
    return np.asarray(np.median(np.abs(step) ** 2, axis=0) / (3.0 * np.log(2.0)))
