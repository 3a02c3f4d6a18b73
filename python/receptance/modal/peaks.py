"""Modes from the peaks of the mobility, with frequencies between the lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance._peaks import local_maxima
from receptance.modal._lines import Lines, select_lines_of_single_entry
from receptance.modal._local import lines_around_peak, polar_errors
from receptance.modal.estimate import ModeEstimate

if TYPE_CHECKING:
    from receptance.frf import FRF

_SHARE = 0.5
_LEAST, _MOST = 5, 25


def find_peaks(
    frf: FRF, *, low_hz: float | None = None, high_hz: float | None = None, prominence_db: float = 6.0
) -> tuple[ModeEstimate, ...]:
    """Find the peaks of the mobility's magnitude, and estimate the mode of each.

    The inverse square of one mode's receptance is exactly a parabola in w^2,
    1 / |H|^2 = ((w_r^2 - w^2)^2 + (2 zeta_r w_r w)^2) / |C|^2; it is fitted, with weights, to the lines around the peak
    with at least half of its height (at least five). The frequency is not limited to the lines, and no half-power
    points are needed. Only magnitudes are used, and other modes are neglected: suitable for finding modes and for
    isolated peaks; `circle_fit` and `fit_modes` are more accurate.

    Parameters
    ----------
    frf : FRF
        One response and one excitation.
    low_hz, high_hz : float, optional
        The band.
    prominence_db : float, optional
        Least prominence of a peak.

    Returns
    -------
    tuple of ModeEstimate
        In ascending frequency; empty without prominent peaks. The damping is NaN, with a note, if there are too few
        lines for the width. Peaks on lines of infinite stated variance are left out.

    Raises
    ------
    TypeError, ValueError
        Several responses or excitations, or fewer than five lines.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.modal import find_peaks
    >>> f = np.arange(10.0, 1000.0, 2.0)
    >>> s = 2j * np.pi * f
    >>> modes = [(251.3, 0.01), (700.4, 0.004)]
    >>> h = sum(1.0 / (s**2 + 4 * np.pi * z * n * s + (2 * np.pi * n) ** 2) for n, z in modes)
    >>> [f"{peak.frequency_hz:.0f} Hz" for peak in find_peaks(FRF(frequency_hz=f, values=h))]
    ['251 Hz', '700 Hz']
    """
    owner = "find_peaks"
    least = _checks.positive(owner, "prominence_db", prominence_db, unit="dB")
    lines, mobility = select_lines_of_single_entry(owner, frf, low_hz, high_hz, _LEAST)
    size = np.maximum(np.abs(mobility), np.finfo(np.float64).tiny)
    maxima, _ = local_maxima(20.0 * np.log10(size), least)
    return tuple(
        _estimate(lines, mobility, int(peak))
        for peak in maxima
        if _has_known_variance(lines, np.abs(mobility), int(peak))
    )


def _estimate(lines: Lines, mobility: NDArray[np.complex128], peak: int) -> ModeEstimate:
    part = _lines_of_peak(np.abs(mobility), peak)
    parabola = _Parabola.through(lines, part, peak)
    values, slopes = parabola.evaluated(lines, peak)
    deviation = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, parabola.covariance, slopes), 0.0))
    frequency, damping, size, turn, width = values
    notes = list(lines.notes)
    if np.isnan(damping):
        notes.append("the lines do not resolve the width of the peak: its damping is not determined")
    elif damping <= 0.0:
        notes.append("the peak is no wider than the exponential window makes it: the damping is not determined")
    constant = complex(np.exp(size + 1j * (np.angle(mobility[peak]) + turn))) if np.isfinite(size) else complex("nan")
    return ModeEstimate(
        method="peak",
        frequency_hz=float(frequency),
        frequency_standard_error_hz=float(deviation[0]),
        damping_ratio=float(damping),
        damping_standard_error=float(deviation[1]),
        modal_constant=constant,
        modal_constant_standard_error=polar_errors(
            constant, float(deviation[2]), float(np.hypot(deviation[3], parabola.scatter_at_peak))
        ),
        lines_in_band=float(width / lines.spacing_at(peak)),
        band_hz=(float(lines.frequency_hz[part][0]), float(lines.frequency_hz[part][-1])),
        lines=part.stop - part.start,
        degrees_of_freedom=parabola.degrees_of_freedom,
        notes=tuple(notes),
    )


def _has_known_variance(lines: Lines, size: NDArray[np.float64], peak: int) -> bool:
    """Return whether enough lines for a parabola have a finite variance."""
    return lines.relative is None or bool(
        np.count_nonzero(np.isfinite(lines.relative[_lines_of_peak(size, peak)])) >= 4
    )


def _lines_of_peak(size: NDArray[np.float64], peak: int) -> slice:
    lines = lines_around_peak(size, peak, _SHARE, _LEAST)
    return slice(max(lines.start, peak - _MOST // 2), min(lines.stop, peak + _MOST // 2 + 1))


@dataclass(frozen=True)
class _Parabola:
    """1 / |H|^2 = a + b x + c x^2 with x = (w^2 - middle) / reach."""

    coefficients: NDArray[np.float64]
    covariance: NDArray[np.float64]
    middle: float
    reach: float
    degrees_of_freedom: float
    scatter_at_peak: float

    @classmethod
    def through(cls, lines: Lines, part: slice, peak: int) -> _Parabola:
        squared = (2.0 * np.pi * lines.frequency_hz[part]) ** 2
        middle = float((2.0 * np.pi * lines.frequency_hz[peak]) ** 2)
        reach = float(np.max(np.abs(squared - middle)))
        x = (squared - middle) / reach
        inverse = 1.0 / np.maximum(np.abs(lines.receptance[part, 0]), np.finfo(np.float64).tiny ** 0.25) ** 2
        known = lines.relative is not None
        # Equal noise on all lines has a relative standard deviation inverse to the magnitude.
        raw = np.abs(lines.values[part, 0])
        relative = (
            lines.relative[part, 0] if lines.relative is not None else raw.max() / np.maximum(raw, raw.max() / 1e6)
        )
        weights = 1.0 / (2.0 * relative * inverse)
        columns = np.stack([np.ones_like(x), x, x**2], axis=1) * weights[:, None]
        q, r = np.linalg.qr(columns)
        target = inverse * weights
        coefficients = np.linalg.solve(r, q.T @ target)
        r_inverse = np.linalg.inv(r)
        freedom = x.size - 3
        residual = target - q @ (q.T @ target)
        scatter = 1.0 if known else float(residual @ residual) / freedom
        factor = scatter * lines.correlated_lines
        at_peak = float(relative[peak - part.start] * np.sqrt(scatter))
        return cls(
            coefficients,
            factor * r_inverse @ r_inverse.T,
            middle,
            reach,
            lines.freedom if known else max(freedom / lines.correlated_lines, 1.0),
            at_peak,
        )

    def evaluated(self, lines: Lines, peak: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the modal parameters, and their derivatives by the coefficients.

        The parameters are frequency in Hz, damping ratio, log |C|, phase from the peak line to the resonance, and width
        in Hz.
        """
        w, sigma = 2.0 * np.pi * float(lines.frequency_hz[peak]), float(lines.frf.decay_rate)
        steps = np.maximum(1e-3 * np.sqrt(np.diag(self.covariance)), 1e-9 * np.abs(self.coefficients).max())
        slopes = [
            (self._values(self.coefficients + step, w, sigma) - self._values(self.coefficients - step, w, sigma))
            / (2.0 * step[index])
            for index, step in enumerate(np.diag(steps))
        ]
        return self._values(self.coefficients, w, sigma), np.stack(slopes, axis=1)

    def _values(self, coefficients: NDArray[np.float64], w: float, sigma: float) -> NDArray[np.float64]:
        a, b, c = (float(value) for value in coefficients)
        if c <= 0.0:
            # Not a peak, but noise on a slope.
            return np.array([w / (2.0 * np.pi), np.nan, np.nan, np.nan, np.nan])
        vertex = self.middle - self.reach * b / (2.0 * c)
        depth = self.reach**2 * (a / c - (b / (2.0 * c)) ** 2)
        if depth <= 0.0 or vertex <= 0.0:
            return np.array([np.sqrt(max(vertex, w**2 / 4.0)) / (2.0 * np.pi), np.nan, np.nan, np.nan, np.nan])
        # Including an exponential window: x_vertex = w_r^2 (1 - 2 zeta^2), depth = 4 zeta^2 (1 - zeta^2) w_r^4.
        natural = np.sqrt(np.hypot(vertex, np.sqrt(depth)))
        # Half of natural^2 - vertex, without cancellation.
        apparent = np.sqrt(0.5 * depth / (natural**2 + vertex))
        decay = apparent - sigma
        undamped = np.sqrt(natural**2 - apparent**2 + decay**2)
        turn = np.arctan2(w - natural**2 / w, 2.0 * apparent)
        size = np.log(self.reach) - 0.5 * np.log(c)
        return np.array([undamped / (2.0 * np.pi), decay / undamped, size, turn, apparent / np.pi])
