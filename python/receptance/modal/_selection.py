"""Which candidates are modes: added one by one while each explains more than noise would."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from receptance import _checks
from receptance.modal._least_squares import PoleFit, PoleModel, PoleProblem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.modal._lines import Lines

Scatter = Literal["absolute", "relative"]

_TRIES = 8
"""Candidates that are tried before no further mode is looked for."""
_EXACT = 1e-22
"""Share of the sum of squares below which what is left is rounding."""
_LOOSE, _QUICK = 1e-7, 40
"""Tolerance and most steps while modes are still being added."""
_FEW = 30
"""Fewer lines tell noise from misfit by their mean square alone."""
_REWEIGHTED = 3
"""Fits after which the weights, which follow from what the fit leaves, no longer change visibly."""


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
        Poles in rad/s.
    highest_damping : float
        A pole with a higher damping ratio is no mode.
    """

    lines: Lines
    terms: tuple[int, ...]
    scatter: Scatter
    candidates: NDArray[np.complex128]
    highest_damping: float

    def first(self, count: int) -> PoleFit:
        """Fit so many modes, or fewer where no further one is found."""
        fit = self._empty()
        while fit.poles.size < count:
            more = self._one_more(fit, self.candidates)
            if more is None:
                break
            fit = more
        return fit

    def near(self, frequency_hz: Sequence[float]) -> PoleFit:
        """Fit one mode near each frequency."""
        fit = self._empty()
        wanted = _checks.unmasked("fit_modes", "frequency_hz", frequency_hz, np.float64)
        places = self.candidates.imag / (2.0 * np.pi)
        nearest = np.argmin(np.abs(places[:, None] - wanted), axis=1)
        for index, place in enumerate(wanted):
            # What is nearer to another wanted mode is that one's.
            own = (nearest == index) & (np.abs(places - place) <= reach_of(place, self.lines))
            guess = complex(self._sigma - 2.0 * np.pi * self.lines.spacing_hz, 2.0 * np.pi * place)
            more = self._one_more(fit, self.candidates[own])
            fit = (
                more
                if more is not None
                else self._problem(fit).fit(np.append(fit.poles, guess), tolerance=_LOOSE, steps=_QUICK)
            )
        return fit

    def all(self, most: int) -> PoleFit:
        """Fit every mode that lowers the misfit by more than its parameters cost (Schwarz 1978), the largest first."""
        fit = self._empty()
        entries = self.lines.values.shape[1]
        price = (2 + 2 * entries) * np.log(2 * self.lines.values.size)
        while fit.poles.size < most:
            more = self._one_more(fit, self.candidates)
            if more is None:
                break
            # Both with the weights of the richer model, which knows the scatter best.
            problem = self._problem(more)
            before, after = (problem.fit(start.poles, tolerance=_LOOSE, steps=_QUICK) for start in (fit, more))
            variance = after.chi_square / max(after.degrees_of_freedom, 1)
            if self.lines.relative is not None:
                variance = max(variance, 1.0)
            # Noise that lines share can look like a mode of that width.
            if before.chi_square - after.chi_square <= price * variance * self.lines.shared:
                break
            fit = after
            if after.chi_square <= _EXACT * problem.square:
                break
        return fit

    @property
    def _sigma(self) -> float:
        return float(self.lines.frf.decay_rate)

    def _empty(self) -> PoleFit:
        return self._problem(None).fit(np.empty(0, dtype=np.complex128))

    def _problem(self, fit: PoleFit | None) -> PoleProblem:
        return _problem(self.lines, self.terms, weights_of(self.lines, self.scatter, fit))

    def _one_more(self, fit: PoleFit, candidates: NDArray[np.complex128]) -> PoleFit | None:
        """Return the fit with the candidate that helps most and that stays a mode when all poles are fitted."""
        problem = self._problem(fit)
        order = np.argsort(-problem.gains(fit.poles, candidates))
        for candidate in candidates[order[:_TRIES]]:
            more = problem.fit(np.append(fit.poles, candidate), tolerance=_LOOSE, steps=_QUICK)
            if self._plausible(more.poles):
                return more
        return None

    def _plausible(self, poles: NDArray[np.complex128]) -> bool:
        f = self.lines.frequency_hz
        inside = (poles.imag >= 2.0 * np.pi * f[0]) & (poles.imag <= 2.0 * np.pi * f[-1])
        apparent = self._sigma - poles.real
        damped = (apparent > 0.0) & (-poles.real <= self.highest_damping * np.abs(poles))
        gaps = np.abs(poles[:, None] - poles) + np.diag(np.full(poles.size, np.inf))
        apart = np.min(gaps, axis=1, initial=np.inf) > 1e-3 * apparent
        return bool(np.all(inside & damped & apart))


def reach_of(place_hz: float, lines: Lines) -> float:
    """How far in Hz a mode may be from where it was said to be."""
    return max(0.03 * place_hz, 5.0 * lines.spacing_hz)


def refined(lines: Lines, terms: tuple[int, ...], scatter: Scatter, fit: PoleFit) -> PoleFit:
    """Fit the same poles to all lines, with weights from what the fit leaves."""
    if fit.poles.size == 0:
        return fit
    better = _problem(lines, terms, weights_of(lines, scatter, None)).fit(fit.poles, tolerance=_LOOSE, steps=_QUICK)
    for _ in range(_REWEIGHTED):
        better = _problem(lines, terms, weights_of(lines, scatter, better, smooth=True)).fit(better.poles)
    return better


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
