"""Estimates of single modes from the lines around a peak: parabola, half-power points, circle."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance._peaks import local_maxima
from receptance.errors import warn_user
from receptance.frf import FRF
from receptance.modal._least_squares import PoleFit, PoleModel, PoleProblem
from receptance.modal._lines import Lines, select_lines
from receptance.modal.estimate import ModeEstimate, constants, joint_with_residue, modal_values, scaled
from receptance.report.table import percent

_BACKGROUND = (-1,)
"""Background of one mode: a constant mobility, which represents the other modes."""
_MIN_SHARE = 0.3
"""Least mobility of the lines of a mode relative to its peak: three half-power half-widths to each side."""
_LEAST = 7
_FEWEST = 5
"""Least number of lines of a circle or a parabola."""


def _single_entry(
    owner: str, frf: FRF, low_hz: float | None, high_hz: float | None, least: int
) -> tuple[Lines, NDArray[np.complex128]]:
    """Return the lines of the only entry of an FRF and the mobility `(n,)` on real lines.

    An exponential window counts as part of the damping there.
    """
    lines = select_lines(owner, frf, low_hz, high_hz, least)
    entries = lines.values.shape[1]
    if entries != 1:
        raise ValueError(
            f"{owner}: the FRF has {entries} entries, expected one response and one excitation; "
            "select one with frf.select(responses=..., excitations=...), or use fit_modes for all entries"
        )
    return lines, lines.receptance[:, 0] * (2j * np.pi * lines.frequency_hz)


def _highest_line(owner: str, lines: Lines, size: NDArray[np.float64]) -> int:
    """Return the index of the highest line, or raise if it is the first or last of the band."""
    peak = int(np.argmax(size))
    if peak in (0, size.size - 1):
        f = lines.frequency_hz
        raise ValueError(
            f"{owner}: the highest mobility between {f[0]:g} and {f[-1]:g} Hz is at {f[peak]:g} Hz, the "
            f"{'first' if peak == 0 else 'last'} line of the band; expected a peak inside it: change low_hz or high_hz"
        )
    return peak


def _lines_around_peak(size: NDArray[np.float64], peak: int, share: float = _MIN_SHARE, least: int = _LEAST) -> slice:
    """Return the lines around a peak above a share of its height, at least `least` if the band has as many."""
    first = last = peak
    while first > 0 and size[first - 1] >= share * size[peak]:
        first -= 1
    while last < size.size - 1 and size[last + 1] >= share * size[peak]:
        last += 1
    while last - first + 1 < min(least, size.size):
        down, up = first > 0, last < size.size - 1
        # The nearer end is extended first, which keeps the peak in the middle.
        if down and (not up or peak - first <= last - peak):
            first -= 1
        else:
            last += 1
    return slice(first, last + 1)


@dataclass(frozen=True)
class _SingleMode:
    """One mode and a constant mobility fitted to some lines.

    The weights are those of the stated standard deviations, or equal. The factor of the covariances is the residual
    variance if no variance is stated, else 1.
    """

    fit: PoleFit
    factor: float
    degrees_of_freedom: float


def _single_mode(lines: Lines, mobility: NDArray[np.complex128], peak: int, part: slice) -> _SingleMode:
    """Fit one mode and a constant mobility to the lines of the only entry around a peak."""
    values = lines.values[part]
    weights = np.ones(values.shape)
    if lines.relative is not None:
        weights = 1.0 / (lines.relative[part] * np.maximum(np.abs(values), np.finfo(np.float64).tiny))
    else:
        weights /= float(np.max(np.abs(values)))
    # The first pole is at the peak, and as wide as the lines above half power.
    above = np.count_nonzero(np.abs(mobility[part]) >= np.abs(mobility[peak]) / np.sqrt(2.0))
    decay = np.pi * above * lines.spacing_at(peak) - lines.frf.decay_rate
    start = complex(-decay, 2.0 * np.pi * lines.frequency_hz[peak])
    model = PoleModel(lines.s[part], lines.power, _BACKGROUND)
    fit = PoleProblem(model, values, weights, lines.correlated_lines).fit(np.array([start]))
    if lines.relative is not None:
        return _SingleMode(fit, 1.0, lines.freedom)
    freedom = fit.degrees_of_freedom
    if freedom < 0.5:
        return _SingleMode(fit, float("inf"), 1.0)
    return _SingleMode(fit, fit.chi_square / freedom, max(freedom / lines.correlated_lines, 1.0))


def _relative_scatter(
    lines: Lines, mobility: NDArray[np.complex128], peak: int
) -> tuple[NDArray[np.float64], float, tuple[str, ...]]:
    """Return the standard deviation of the log of every line of the only entry, its degrees of freedom, and notes.

    It is that stated by the FRF, or follows from the residuals of one mode fitted around the peak, with equal noise on
    all lines in the measured form.
    """
    if lines.relative is not None:
        return lines.relative[:, 0], lines.freedom, ()
    size = np.abs(lines.values[:, 0])
    part = _lines_around_peak(np.abs(mobility), peak)
    single = _single_mode(lines, mobility, peak, part)
    if not np.isfinite(single.factor):
        note = f"{part.stop - part.start} lines around the peak are too few to estimate their scatter"
        return np.full(size.shape, np.inf), 1.0, (note,)
    deviation = np.sqrt(single.factor) * float(np.max(size[part]))
    floor = np.finfo(np.float64).tiny
    return deviation / np.maximum(size, floor), single.degrees_of_freedom, ()


def _polar_errors(value: complex, log_error: float, phase_error: float) -> complex:
    """Return the standard errors of real and imaginary part from those of ln|value| and of the phase in rad."""
    if not (np.isfinite(log_error) and np.isfinite(phase_error)):
        return complex(np.inf, np.inf)
    return complex(
        np.hypot(value.real * log_error, value.imag * phase_error),
        np.hypot(value.imag * log_error, value.real * phase_error),
    )


_PEAK_SHARE, _MOST_AT_PEAK = 0.5, 25
"""Least share of the height, and most lines, of a parabola."""


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
    lines, mobility = _single_entry(owner, frf, low_hz, high_hz, _FEWEST)
    size = np.maximum(np.abs(mobility), np.finfo(np.float64).tiny)
    maxima, _ = local_maxima(20.0 * np.log10(size), least)
    modes = []
    for peak in maxima.tolist():
        part = _lines_around_peak(np.abs(mobility), peak, _PEAK_SHARE, _FEWEST)
        part = slice(max(part.start, peak - _MOST_AT_PEAK // 2), min(part.stop, peak + _MOST_AT_PEAK // 2 + 1))
        if lines.relative is None or np.count_nonzero(np.isfinite(lines.relative[part])) >= 4:
            modes.append(_mode_at_peak(lines, mobility, peak, part))
    return tuple(modes)


def _mode_at_peak(lines: Lines, mobility: NDArray[np.complex128], peak: int, part: slice) -> ModeEstimate:
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
        modal_constant_standard_error=_polar_errors(
            constant, float(deviation[2]), float(np.hypot(deviation[3], parabola.scatter_at_peak))
        ),
        lines_in_band=float(width / lines.spacing_at(peak)),
        band_hz=(float(lines.frequency_hz[part][0]), float(lines.frequency_hz[part][-1])),
        lines=part.stop - part.start,
        degrees_of_freedom=parabola.degrees_of_freedom,
        notes=tuple(notes),
    )


@dataclass(frozen=True)
class _Parabola:
    """1 / |H|^2 = a + b x + c x^2 with x = (w^2 - middle) / reach; coefficients from c to a."""

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
        stated = lines.relative is not None
        # Equal noise on all lines has a relative standard deviation inverse to the magnitude.
        raw = np.abs(lines.values[part, 0])
        relative = (
            lines.relative[part, 0] if lines.relative is not None else raw.max() / np.maximum(raw, raw.max() / 1e6)
        )
        weights = 1.0 / (2.0 * relative * inverse)
        coefficients, covariance = np.polyfit(x, inverse, 2, w=weights, cov="unscaled")
        freedom = x.size - 3
        residual = weights * (inverse - np.polyval(coefficients, x))
        scatter = 1.0 if stated else float(residual @ residual) / freedom
        at_peak = float(relative[peak - part.start] * np.sqrt(scatter))
        return cls(
            coefficients,
            scatter * lines.correlated_lines * covariance,
            middle,
            reach,
            lines.freedom if stated else max(freedom / lines.correlated_lines, 1.0),
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
        c, b, a = (float(value) for value in coefficients)
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


_MIN_LINES = 5.0
"""Least number of lines in the half-power band without a warning of bias."""


def half_power(frf: FRF, *, low_hz: float | None = None, high_hz: float | None = None) -> ModeEstimate:
    """Estimate natural frequency and damping from the half-power points of the highest peak in a band.

    On the magnitude of the mobility (w times the receptance), whose half-power points w_1 and w_2 satisfy
    w_2 - w_1 = 2 zeta w_r and w_1 w_2 = w_r^2 exactly for one viscously damped mode. The peak is the highest line, and
    the points are interpolated linearly between lines, as is customary. With few lines the peak is truncated and the
    width is overestimated. This is not corrected; below five lines a warning states the mean bias, and `circle_fit` or
    `fit_modes` should be used instead.

    Parameters
    ----------
    frf : FRF
        One response and one excitation.
    low_hz, high_hz : float, optional
        The band; its highest peak is the mode.

    Returns
    -------
    ModeEstimate
        The standard errors contain the scatter of the lines (stated by the variance of the FRF, else from the residuals
        of one mode fitted around the peak) and that of the position of the peak between two lines. They contain neither
        the bias nor the influence of neighbouring modes.

    Warns
    -----
    ReceptanceWarning
        Fewer than five lines in the half-power band.

    Raises
    ------
    TypeError, ValueError
        Several responses or excitations, fewer than three lines, no peak inside the band, or no half-power point
        to one side of it.

    References
    ----------
    Ewins, Modal Testing, 2nd ed. 2000, ch. 4 (peak amplitude method).

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.modal import half_power
    >>> f = np.arange(600.0, 1000.0, 1.0)
    >>> s = 2j * np.pi * f
    >>> frf = FRF(frequency_hz=f, values=1.0 / (s**2 + 2 * 0.01 * 5000.0 * s + 5000.0**2))
    >>> mode = half_power(frf)
    >>> f"{mode.frequency_hz:.1f} Hz, {100 * mode.damping_ratio:.2f} %, {mode.lines_in_band:.0f} lines"
    '795.8 Hz, 1.00 %, 16 lines'
    """
    owner = "half_power"
    lines, mobility = _single_entry(owner, frf, low_hz, high_hz, 3)
    peak = _highest_line(owner, lines, np.abs(mobility))
    points = _half_power_points(owner, lines.frequency_hz, np.abs(mobility), peak)
    width, spacing = points.high - points.low, lines.spacing_at(peak)
    resolution = _resolution(round(float(np.clip(width / spacing, 0.5, 50.0)), 1))
    scatter, freedom, notes = _relative_scatter(lines, mobility, peak)

    # The centre, the log of the width and that of the modal constant by the log of every line.
    slopes = np.stack([0.5 * (points.slopes[0] + points.slopes[1]), (points.slopes[1] - points.slopes[0]) / width])
    slopes = np.vstack([slopes, slopes[1]])
    slopes[2, peak] += 1.0
    # Lines with infinite scatter matter only if they are used.
    reach = np.multiply(np.abs(slopes), scatter, out=np.zeros_like(slopes), where=slopes != 0.0)
    # Of correlated lines only the two at each end contribute, so that the variance is at most doubled.
    centre_error, width_error, constant_error = np.sqrt(min(lines.correlated_lines, 2.0) * np.sum(reach**2, axis=1))

    decay = np.pi * width - frf.decay_rate
    # w_1 w_2 is w_r^2 of the mode with the window's damping; its damped frequency is not changed by the window.
    damped_squared = (2.0 * np.pi) ** 2 * points.low * points.high - (np.pi * width) ** 2
    natural = float(np.sqrt(damped_squared + decay**2))
    # Rotation on the circle from the highest line to the resonance.
    turn = np.arctan2(lines.frequency_hz[peak] - np.sqrt(points.low * points.high), 0.5 * width)
    constant = complex(2.0 * np.pi * width * mobility[peak] * np.exp(1j * turn))
    phase_error = float(np.hypot(scatter[peak], 2.0 * centre_error / width))
    messages = [*lines.notes, *notes]
    if width / spacing < _MIN_LINES:
        window = "(including that of the exponential window) " if frf.decay_rate > 0.0 else ""
        messages.append(
            f"only {width / spacing:.1f} lines in the half-power band of the mode at {natural / (2.0 * np.pi):.6g} Hz: "
            f"its width {window}is overestimated by {percent(resolution.bias)} on average; use circle_fit or "
            "fit_modes"
        )
        warn_user(f"{owner}: {messages[-1]}")
    if decay <= 0.0:
        messages.append("the peak is no wider than the exponential window makes it: the damping is not determined")
    return ModeEstimate(
        method="half-power",
        frequency_hz=natural / (2.0 * np.pi),
        frequency_standard_error_hz=float(np.hypot(centre_error, resolution.centre_error * spacing)),
        damping_ratio=decay / natural,
        damping_standard_error=float(np.hypot(width_error, resolution.width_error) * np.pi * width / natural),
        modal_constant=constant,
        modal_constant_standard_error=_polar_errors(
            constant,
            float(np.hypot(constant_error, resolution.constant_error)),
            float(np.hypot(phase_error, resolution.phase_error)),
        ),
        lines_in_band=width / spacing,
        band_hz=(float(lines.frequency_hz[points.first]), float(lines.frequency_hz[points.last])),
        lines=points.last - points.first + 1,
        degrees_of_freedom=freedom,
        notes=tuple(messages),
    )


@dataclass(frozen=True)
class _HalfPowerPoints:
    """Half-power frequencies, their `(2, n)` derivatives by the log of every line, and the outermost lines used."""

    low: float
    high: float
    slopes: NDArray[np.float64]
    first: int
    last: int


def _half_power_points(owner: str, f: NDArray[np.float64], size: NDArray[np.float64], peak: int) -> _HalfPowerPoints:
    level = size[peak] / np.sqrt(2.0)
    points, outermost, slopes = [], [], np.zeros((2, f.size))
    for side, step in enumerate((-1, 1)):
        outer = peak
        while size[outer] > level:
            outer += step
            if not 0 <= outer < size.size:
                raise ValueError(
                    f"{owner}: the mobility does not fall to its half-power point "
                    f"{'below' if step < 0 else 'above'} the peak at {f[peak]:g} Hz before the band ends at "
                    f"{f[outer - step]:g} Hz; widen the band, or use fit_modes if there is another mode beside the peak"
                )
        inner = outer - step
        gap, rise = f[inner] - f[outer], size[inner] - size[outer]
        share = (level - size[outer]) / rise
        points.append(float(f[outer] + share * gap))
        slopes[side, peak] += level / rise * gap
        slopes[side, inner] -= size[inner] * share / rise * gap
        slopes[side, outer] -= size[outer] * (1.0 - share) / rise * gap
        outermost.append(outer)
    return _HalfPowerPoints(points[0], points[1], slopes, outermost[0], outermost[1])


@dataclass(frozen=True)
class _Resolution:
    """Errors of the half-power method for one mode from the position of the lines, averaged over all positions.

    Mean relative error of the width, and standard deviations of the width (relative), of the centre (in distances of
    the lines), of the log of the modal constant, and of its phase.
    """

    bias: float
    width_error: float
    centre_error: float
    constant_error: float
    phase_error: float


_SHIFTS = tuple((np.arange(40) + 0.5) / 40.0)
_NEARBY = (0.85, 0.9, 0.95, 1.0, 1.05)
"""Ratios of the true to the apparent number of lines over which the errors are averaged."""


@functools.lru_cache(maxsize=256)
def _resolution(lines_in_band: float) -> _Resolution:
    # (factors, shifts, quantities)
    table = np.array([[_half_power_errors(lines_in_band * factor, shift) for shift in _SHIFTS] for factor in _NEARBY])
    deviations = np.sqrt(np.mean(table.var(axis=1), axis=0)).tolist()
    return _Resolution(float(table[:, :, 0].mean()) - 1.0, *deviations)


def _half_power_errors(lines_in_band: float, shift: float) -> tuple[float, float, float, float]:
    """Return relative width, centre, log of the modal constant and its phase for one position of the lines."""
    reach = int(2.0 * lines_in_band) + 6
    x = np.arange(-reach, reach + 1).astype(np.float64) + shift
    values = 1.0 / (1.0 + 2j * x / lines_in_band)
    size = np.abs(values)
    peak = int(np.argmax(size))
    points = _half_power_points("", x, size, peak)
    width, centre = points.high - points.low, 0.5 * (points.low + points.high)
    phase = float(np.angle(values[peak]) + np.arctan2(x[peak] - centre, 0.5 * width))
    return width / lines_in_band, centre, float(np.log(width / lines_in_band * size[peak])), phase


_MIN_ARC = np.pi
"""Least arc in radians without a warning; the radius of shorter arcs is dominated by noise."""


@dataclass(frozen=True, kw_only=True, repr=False)
class CircleFit(ModeEstimate):
    """Estimate of a mode with the circle of its mobility."""

    centre: complex
    """Centre in the plane of the mobility on real lines."""
    radius: float
    """Radius in the unit of the mobility."""
    arc: float
    """Angle in radians of the arc covered by the lines."""
    off_circle: float
    """Root mean square distance of the lines from the circle, relative to its radius."""


def circle_fit(frf: FRF, *, low_hz: float | None = None, high_hz: float | None = None) -> CircleFit:
    """Estimate natural frequency, damping and modal constant from the circle of the highest peak in a band.

    Near one mode the mobility is B + C i w / (w_r^2 - w^2 + 2 i zeta w_r w): a circle displaced from the origin by the
    other modes (B) and rotated by nonproportional damping. Frequency, damping, C and B are fitted to the lines by
    weighted least squares in the plane, which uses angle and radius of every line and gives standard errors; a few
    lines on the circle are sufficient. The circle is that of Taubin (1991) through the fitted values.

    Parameters
    ----------
    frf : FRF
        One response and one excitation.
    low_hz, high_hz : float, optional
        The band; its highest peak is the mode. The lines around it with at least 0.3 of its mobility are used, at least
        seven if the band has as many.

    Returns
    -------
    CircleFit
        Standard errors from the variance of the FRF, else from the residuals. They do not contain the influence of
        modes a few half-power bands away, which B does not represent: use `fit_modes` there.

    Warns
    -----
    ReceptanceWarning
        An arc of less than half a turn, or a fit that did not converge.

    Raises
    ------
    TypeError, ValueError
        Several responses or excitations, fewer than five lines, no peak inside the band, or no damping.

    References
    ----------
    Kennedy and Pancu, J. Aeronautical Sciences 14 (1947) 603; Ewins, Modal Testing, 2nd ed. 2000, ch. 4;
    Taubin, IEEE PAMI 13 (1991) 1115.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.modal import circle_fit
    >>> f = np.arange(780.0, 812.0, 4.0)
    >>> s = 2j * np.pi * f
    >>> frf = FRF(frequency_hz=f, values=2.0 / (s**2 + 2 * 0.002 * 5000.0 * s + 5000.0**2))
    >>> mode = circle_fit(frf)
    >>> f"{mode.damping_ratio:.5f} from {mode.lines_in_band:.1f} lines in the half-power band"
    '0.00200 from 0.8 lines in the half-power band'
    """
    owner = "circle_fit"
    lines, mobility = _single_entry(owner, frf, low_hz, high_hz, _FEWEST)
    peak = _highest_line(owner, lines, np.abs(mobility))
    part = _lines_around_peak(np.abs(mobility), peak)
    if lines.relative is not None and np.count_nonzero(np.isfinite(lines.relative[part])) < _FEWEST:
        raise ValueError(
            f"{owner}: the variance of fewer than {_FEWEST} lines around the peak at "
            f"{lines.frequency_hz[peak]:g} Hz is finite"
        )
    if _is_straight(mobility[part]):
        raise ValueError(
            f"{owner}: the lines around the peak at {lines.frequency_hz[peak]:g} Hz are on a straight line in the "
            "complex plane, as without damping, expected an arc of a circle; find_peaks estimates the frequency"
        )
    single = _single_mode(lines, mobility, peak, part)
    fit = single.fit
    frequency, damping, covariance = modal_values(fit.poles, scaled(fit.pole_covariance, single.factor))
    constant, constant_error = constants(
        complex(fit.poles[0]), complex(fit.residues[0, 0]), scaled(joint_with_residue(fit, 0, 0), single.factor)
    )
    # From the measured form to the mobility on real lines.
    fitted = fit.fitted[:, 0] * mobility[part] / lines.values[part, 0]
    centre, radius = _taubin(fitted)
    arc = float(np.sum(np.mod(-np.diff(np.angle(fitted - centre)), 2.0 * np.pi)))
    width = max(frf.decay_rate - fit.poles[0].real, 0.0) / (np.pi * lines.spacing_at(peak))
    messages = list(lines.notes)
    if arc < _MIN_ARC:
        messages.append(
            f"the lines cover {np.degrees(arc):.0f} degrees of the circle: its radius is dominated by noise"
        )
    if not fit.converged:
        messages.append("the fit did not converge: is there one mode in the band?")
    for text in messages[len(lines.notes) :]:
        warn_user(f"{owner}: {text}")
    if damping[0] <= 0.0:
        messages.append("the damping ratio is not positive within its uncertainty")
    deviation = np.sqrt(np.diag(covariance))
    return CircleFit(
        method="circle",
        frequency_hz=float(frequency[0]),
        frequency_standard_error_hz=float(deviation[0]),
        damping_ratio=float(damping[0]),
        damping_standard_error=float(deviation[1]),
        modal_constant=constant,
        modal_constant_standard_error=constant_error,
        lines_in_band=float(width),
        band_hz=(float(lines.frequency_hz[part][0]), float(lines.frequency_hz[part][-1])),
        lines=part.stop - part.start,
        degrees_of_freedom=single.degrees_of_freedom,
        notes=tuple(messages),
        centre=centre,
        radius=radius,
        arc=arc,
        off_circle=float(np.sqrt(np.mean((np.abs(mobility[part] - centre) - radius) ** 2)) / radius),
    )


def _is_straight(z: NDArray[np.complex128]) -> bool:
    """Return whether points are on a straight line."""
    points = z - z.mean()
    long, short = np.linalg.svd(np.stack([points.real, points.imag]), compute_uv=False)
    return bool(short <= 1e-12 * long)


def _taubin(z: NDArray[np.complex128]) -> tuple[complex, float]:
    """Return centre and radius of the algebraic circle through points (Taubin 1991, by singular values)."""
    middle = complex(z.mean())
    size = float(np.sqrt(np.mean(np.abs(z - middle) ** 2)))
    x, y = (z - middle).real / size, (z - middle).imag / size
    square = x**2 + y**2
    mean = float(square.mean())
    columns = np.stack([(square - mean) / (2.0 * np.sqrt(mean)), x, y], axis=1)
    a, b, c = np.linalg.svd(columns, full_matrices=False)[2][2]
    a /= 2.0 * np.sqrt(mean)
    centre = -0.5 * complex(b, c) / a
    radius = float(np.sqrt(abs(centre) ** 2 + mean))
    return middle + size * centre, size * radius
