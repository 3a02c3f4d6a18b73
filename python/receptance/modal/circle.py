"""Circle fit of the mobility of one mode."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from receptance.errors import ReceptanceWarning
from receptance.modal._lines import select_lines_of_single_entry
from receptance.modal._local import highest_line, lines_around_peak, single_mode
from receptance.modal.estimate import ModeEstimate, constants, joint_with_residue, modal_values, scaled

if TYPE_CHECKING:
    from receptance.frf import FRF

_MIN_LINES = 5
_MIN_ARC = np.pi
"""Least arc in radians without a warning; the radius of shorter arcs is dominated by noise."""


@dataclass(frozen=True, kw_only=True, repr=False)
class CircleFit(ModeEstimate):
    """Estimate of a mode with the circle of its mobility.

    Attributes
    ----------
    centre : complex
        Centre in the plane of the mobility on real lines.
    radius : float
        Radius in the unit of the mobility.
    arc : float
        Angle in radians of the arc covered by the lines.
    off_circle : float
        Root mean square distance of the lines from the circle, relative to its radius.
    """

    centre: complex
    radius: float
    arc: float
    off_circle: float


def circle_fit(frf: FRF, *, low_hz: float | None = None, high_hz: float | None = None) -> CircleFit:
    """Estimate natural frequency, damping and modal constant from the circle of the highest peak in a band.

    Near one mode the mobility is B + C i w / (w_r^2 - w^2 + 2 i zeta w_r w): a circle displaced from the origin by the
    other modes (B) and rotated by nonproportional damping. The start values follow from the algebraic circle of Taubin
    (1991) and the bilinear map 1 / (Y - Y_far) = a + b w on it, equivalent to the classical sweep of angles. Frequency,
    damping, C and B are then fitted to the lines by weighted least squares in the plane, which uses angle and radius of
    every line and gives standard errors; a few lines on the circle are sufficient.

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
        Several responses or excitations, fewer than five lines, or no peak inside the band.

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
    lines, mobility = select_lines_of_single_entry(owner, frf, low_hz, high_hz, _MIN_LINES)
    peak = highest_line(owner, lines, np.abs(mobility))
    part = lines_around_peak(np.abs(mobility), peak)
    if lines.relative is not None and np.count_nonzero(np.isfinite(lines.relative[part])) < _MIN_LINES:
        raise ValueError(
            f"{owner}: the variance of fewer than {_MIN_LINES} lines around the peak at {lines.frequency_hz[peak]:g} "
            "Hz is finite"
        )
    centre, _ = _taubin(mobility[part])
    start = _first_pole(lines.frequency_hz[part], mobility[part], centre) + frf.decay_rate
    single = single_mode(lines, part, start)
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
        warnings.warn(f"{owner}: {text}", ReceptanceWarning, stacklevel=2)
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


def _first_pole(f: NDArray[np.float64], z: NDArray[np.complex128], centre: complex) -> complex:
    """Return the pole on the real lines from the bilinear map of the circle to a straight line.

    With Y_far, the point opposite to that of the fastest change, 1 / (Y - Y_far) is proportional to
    delta + i (w - w_r).
    """
    pace = np.abs(np.diff(z)) / np.diff(f)
    fastest = int(np.argmax(pace))
    nearest = 0.5 * (z[fastest] + z[fastest + 1])
    away = z - (2.0 * centre - nearest)
    w = 2.0 * np.pi * f
    middle = float(w.mean())
    # Lines near the far point are uncertain; the weight is the distance to it.
    columns = np.stack([np.ones_like(w), w - middle], axis=1) * np.abs(away)[:, None]
    a, b = np.linalg.lstsq(columns, np.abs(away) / away, rcond=None)[0]
    ratio = complex(a / b)
    least = float(np.min(np.diff(w)))
    return complex(-max(abs(ratio.imag), 1e-3 * least), middle - ratio.real)


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
