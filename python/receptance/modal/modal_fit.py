"""Result of a global modal fit: modes with standard errors, background and warnings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from scipy import special

from receptance import _checks
from receptance._text import first_of
from receptance.frf import FRF, form_factor
from receptance.modal._least_squares import PoleFit
from receptance.modal._lines import Lines
from receptance.modal._selection import EXACT, Scatter, search_range, weights_of
from receptance.modal.estimate import ModeEstimate, ModeIntervals, constants, joint_with_residue, modal_values, scaled
from receptance.report import Column, Provenance, Result, Table
from receptance.report.table import percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ModalFit(ModeIntervals, Result):
    """Modes common to all entries of an FRF, in ascending frequency.

    H(s) = sum over modes of A_r / (s - p_r) + A_r* / (s - p_r*) plus background, with s = i w on real lines. For a
    real modal constant the term of a mode is C_r / (w_r^2 - w^2 + 2 i zeta_r w_r w) with C_r = 2 i w_d A_r.
    """

    frequency_hz: NDArray[np.float64]
    """`(M,)` undamped natural frequencies."""
    frequency_standard_error_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    """`(M,)` viscous damping ratios, without that of an exponential window."""
    damping_standard_error: NDArray[np.float64]
    covariance: NDArray[np.float64]
    """`(2M, 2M)` covariance of the frequencies in Hz, then the damping ratios."""
    modal_constant: NDArray[np.complex128]
    """`(M, n_out, n_in)` complex C_r of the receptance, in 1/kg for m/N."""
    modal_constant_standard_error: NDArray[np.complex128]
    """Standard errors of its real and imaginary parts as complex numbers."""
    residue: NDArray[np.complex128]
    """`(M, n_out, n_in)` complex A_r of the receptance."""
    background: dict[int, NDArray[np.complex128]]
    """`(n_out, n_in)` complex coefficient of each power of s in the receptance: -2 for the modes far below the band, 0
    for those far above it."""
    outside_poles: NDArray[np.complex128]
    """`(K,)` in rad/s: poles of modes near the band, and of further modes in the band if frequencies were given. They
    are part of the background."""
    outside_residue: NDArray[np.complex128]
    """`(K, n_out, n_in)` their residues."""
    lines_in_band: NDArray[np.float64]
    """`(M,)` width of the half-power band over the distance of the lines."""
    frf: FRF
    """The fitted lines."""
    scatter: NDArray[np.float64]
    """`(n_out, n_in)` root mean square of the real and imaginary parts of the residuals: in stated standard deviations
    if the FRF has a variance, else in the unit of the FRF ("absolute") or relative to it ("relative")."""
    known_scatter: bool
    """Whether the FRF stated its variance."""
    correlation: float
    """Correlation of the residuals of neighbouring lines."""
    degrees_of_freedom: float
    """Degrees of freedom of the standard errors: those of the variance of the FRF if it explains the residuals,
    infinite if it is exact, else those of the residuals or of inconsistent entries."""
    converged: bool
    """Whether the last fit converged."""
    stabilisation: tuple[NDArray[np.complex128], ...]
    """Candidates of each polynomial order as complex frequencies in Hz, damped natural frequency plus i times decay
    rate over 2 pi, without that of an exponential window."""
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Modes"
    plotted_by = "receptance.modal.figure:draw_modal_fit"

    @property
    def poles(self) -> NDArray[np.complex128]:
        """`(M,)` -zeta w_r + i w_r sqrt(1 - zeta^2) in rad/s."""
        w = 2.0 * np.pi * self.frequency_hz
        return np.asarray(-self.damping_ratio * w + 1j * w * np.sqrt(1.0 - self.damping_ratio**2))

    def receptance(self, frequency_hz: ArrayLike, *, background: bool = True) -> NDArray[np.complex128]:
        """Return the receptance `(n, n_out, n_in)` of the modes.

        Parameters
        ----------
        frequency_hz : array_like
            `(n,)` real, or complex f - i sigma / 2 pi for lines under an exponential window.
        background : bool, optional
            Whether to add the background, which is valid in the band only.
        """
        s = 2j * np.pi * np.atleast_1d(_checks.unmasked("", "frequency_hz", frequency_hz)).astype(np.complex128)
        poles, residue = self.poles, self.residue
        if background:
            poles = np.concatenate([poles, self.outside_poles])
            residue = np.concatenate([residue, self.outside_residue])
        total = np.tensordot(1.0 / (s[:, None] - poles), residue, 1)
        total += np.tensordot(1.0 / (s[:, None] - poles.conj()), residue.conj(), 1)
        if background:
            for term, coefficient in self.background.items():
                total = total + s[:, None, None] ** term * coefficient
        return np.asarray(total)

    def synthesised(self) -> NDArray[np.complex128]:
        """Return the fit `(n, n_out, n_in)` on the lines and in the form of `frf`."""
        lines = self.frf.complex_frequency_hz
        return self.receptance(lines) * form_factor(lines, "receptance", self.frf.form)[:, None, None]

    def mode(self, number: int, response: int = 0, excitation: int = 0) -> ModeEstimate:
        """Return one mode, counted from 0, with its modal constant at one entry."""
        return ModeEstimate(
            method="global",
            frequency_hz=float(self.frequency_hz[number]),
            frequency_standard_error_hz=float(self.frequency_standard_error_hz[number]),
            damping_ratio=float(self.damping_ratio[number]),
            damping_standard_error=float(self.damping_standard_error[number]),
            modal_constant=complex(self.modal_constant[number, response, excitation]),
            modal_constant_standard_error=complex(self.modal_constant_standard_error[number, response, excitation]),
            lines_in_band=float(self.lines_in_band[number]),
            band_hz=(float(self.frf.frequency_hz[0]), float(self.frf.frequency_hz[-1])),
            lines=len(self.frf.frequency_hz),
            degrees_of_freedom=self.degrees_of_freedom,
            notes=self.notes,
        )

    def tables(self) -> list[Table]:
        """Return the modes with standard errors."""
        columns = (
            Column("frequency", "Hz", ".4f"),
            Column("standard error", "Hz", ".2g"),
            Column("damping", "%", ".4f"),
            Column("standard error", "%", ".2g"),
            Column("lines in half-power band", form=".1f"),
        )
        cells = (
            self.frequency_hz,
            self.frequency_standard_error_hz,
            100.0 * self.damping_ratio,
            100.0 * self.damping_standard_error,
            self.lines_in_band,
        )
        return [Table("Modes", columns, np.stack(cells, axis=1).tolist())]

    def sentences(self) -> list[str]:
        """Return number of modes and band."""
        return [f"{self._headline()}{'' if self.converged else '; the fit has not converged'}."]

    def data(self) -> dict[str, Any]:
        """Return modes, modal constants and their standard errors."""
        return {
            "frequency_hz": self.frequency_hz,
            "frequency_standard_error_hz": self.frequency_standard_error_hz,
            "damping_ratio": self.damping_ratio,
            "damping_standard_error": self.damping_standard_error,
            "covariance": self.covariance,
            "modal_constant": self.modal_constant,
            "modal_constant_standard_error": self.modal_constant_standard_error,
            "lines_in_band": self.lines_in_band,
            "scatter": self.scatter,
            "known_scatter": self.known_scatter,
            "degrees_of_freedom": self.degrees_of_freedom,
            "converged": self.converged,
        }

    def plot(self, ax: Axes | None = None, *, response: int = 0, excitation: int = 0) -> Figure:
        """Draw measured and synthesised values of one entry, residuals and poles.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            As in `Result.plot`.
        response, excitation : int, optional
            Numbers of the entry, from 0.
        """
        return self._plot(ax, response=response, excitation=excitation)

    def _headline(self) -> str:
        low, high = self.frf.frequency_hz[0], self.frf.frequency_hz[-1]
        count = f"{len(self.frequency_hz)} mode{'' if len(self.frequency_hz) == 1 else 's'}"
        return f"{count} between {low:g} and {high:g} Hz"

    def __repr__(self) -> str:
        modes = first_of(
            [f"{f:.6g} Hz {percent(z, 3)}" for f, z in zip(self.frequency_hz, self.damping_ratio, strict=True)]
        )
        state = "" if self.converged else ", not converged"
        return f"ModalFit({self._headline()}: {modes}{state})"


_MIN_ENTRIES = 4
"""Least number of entries for an estimate of their inconsistency."""
_MIN_CLUSTERS = 1.2
"""Least effective number of entries that determine a pole, for an estimate of their inconsistency."""


def make_modal_fit(
    fit: PoleFit,
    modes: NDArray[np.bool_],
    lines: Lines,
    terms: tuple[int, ...],
    scatter: Scatter,
    orders: list[NDArray[np.complex128]],
    requested: int | tuple[float, ...] | None,
) -> tuple[ModalFit, list[str]]:
    """Return the result and its warnings; `modes` are the poles that are not background."""
    shape = np.asarray(lines.frf.values).shape[1:]
    sigma = float(lines.frf.decay_rate)
    factor, freedom, correlation, notes = _covariance_factor(fit, lines)
    pole_covariance = scaled(fit.pole_covariance, factor)
    if not _is_exact(fit, lines):
        pole_covariance, freedom, consistency_notes = _between_entries(fit, pole_covariance, freedom)
        notes += consistency_notes
    order = np.flatnonzero(modes)
    order = order[np.argsort(np.abs(fit.poles[order]))]
    poles, count = fit.poles[order], order.size
    parts = np.concatenate([order, fit.poles.size + order])
    frequency, damping, covariance = modal_values(poles, pole_covariance[np.ix_(parts, parts)])
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    constant = np.empty((count, fit.coefficients.shape[0]), dtype=np.complex128)
    constant_error = np.empty_like(constant)
    for row, mode in enumerate(order):
        for entry in range(constant.shape[1]):
            joint = scaled(joint_with_residue(fit, int(mode), entry), factor)
            residue = complex(fit.residues[mode, entry])
            constant[row, entry], constant_error[row, entry] = constants(complex(fit.poles[mode]), residue, joint)
    background = fit.coefficients[:, 2 * fit.poles.size :]
    decay = sigma - poles.real
    warned = [
        *_missing_mode_warnings(frequency, lines, requested),
        *_validity_warnings(fit, frequency, damping, errors[count:]),
    ]
    notes += [*warned, *_resolution_notes(frequency, decay, lines)]
    further = np.sort(np.abs(fit.poles[~modes]) / (2.0 * np.pi))
    inside = [f"{hz:.6g}" for hz in further if lines.frequency_hz[0] <= hz <= lines.frequency_hz[-1]]
    if inside:
        notes.append(f"the band contains further modes, fitted as background: {', '.join(inside)} Hz")
    result = ModalFit(
        frequency_hz=frequency,
        frequency_standard_error_hz=errors[:count],
        damping_ratio=damping,
        damping_standard_error=errors[count:],
        covariance=covariance,
        modal_constant=constant.reshape(count, *shape),
        modal_constant_standard_error=constant_error.reshape(count, *shape),
        residue=fit.residues[order].reshape(count, *shape),
        background={
            term: (background[:, 2 * index] + 1j * background[:, 2 * index + 1]).reshape(shape)
            for index, term in enumerate(terms)
        },
        outside_poles=fit.poles[~modes],
        outside_residue=fit.residues[~modes].reshape(-1, *shape),
        lines_in_band=np.maximum(decay, 0.0) / np.pi / _spacing_at(lines, poles.imag / (2.0 * np.pi)),
        frf=lines.frf,
        scatter=_residual_scatter(fit, lines, scatter).reshape(shape),
        known_scatter=lines.relative is not None,
        correlation=correlation,
        degrees_of_freedom=freedom,
        converged=fit.converged,
        stabilisation=tuple(candidates - 1j * sigma / (2.0 * np.pi) for candidates in orders),
        notes=(*lines.notes, *notes),
    )
    return result, warned


def _covariance_factor(fit: PoleFit, lines: Lines) -> tuple[float, float, float, list[str]]:
    """Return the factor of the covariances, its degrees of freedom, the correlation of the residuals, and notes."""
    notes = []
    freedom = fit.degrees_of_freedom
    independent = freedom / lines.correlated_lines
    if fit.smooth_lines > 1.0:
        # Of the independent values of smooth errors each parameter of the fit takes one.
        parameters = fit.coefficients.size + 2 * fit.poles.size
        independent = 2.0 * fit.residual.size / fit.smooth_lines - parameters
    variance = fit.chi_square / freedom if freedom >= 0.5 else float("inf")
    if lines.relative is None:
        factor_freedom = max(independent, 1.0)
    elif variance > 1.0 + 3.0 * np.sqrt(2.0 / max(independent, 1.0)):
        factor_freedom = max(independent, 1.0)
        notes.append(
            f"the residuals are {np.sqrt(variance):.2g} times as large as stated by the variance; the standard errors "
            "are enlarged by this factor"
        )
    else:
        variance, factor_freedom = 1.0, lines.freedom
    correlation = _correlation(fit)
    if fit.smooth_lines > 1.0 and not _is_exact(fit, lines):
        factor_freedom = min(factor_freedom, max(independent, 1.0))
        notes.append(
            f"the residuals of neighbouring lines are correlated ({correlation:.2f}), as of errors smooth over "
            f"{fit.smooth_lines:.2g} lines: the model is incomplete, or the lines are closer than the resolution of "
            "the record; the number of modes and the standard errors take this into account"
        )
    return variance, factor_freedom, correlation, notes


def _correlation(fit: PoleFit) -> float:
    """Return the correlation of the residuals of neighbouring lines."""
    products = float(np.sum((fit.residual[:-1].conj() * fit.residual[1:]).real))
    return products / max(fit.chi_square, np.finfo(np.float64).tiny)


def _is_exact(fit: PoleFit, lines: Lines) -> bool:
    """Return whether the residuals are rounding errors."""
    misfit = np.sum(np.abs(lines.values - fit.fitted) ** 2)
    return bool(misfit <= EXACT * np.sum(np.abs(lines.values) ** 2))


def _between_entries(
    fit: PoleFit, covariance: NDArray[np.float64], freedom: float
) -> tuple[NDArray[np.float64], float, list[str]]:
    """Return the covariance of the poles, enlarged if entries are inconsistent beyond their scatter.

    If the structure changes between hits (position of a sensor, temperature), every entry has its own poles. The scores
    of the entries then determine the uncertainty: the covariance with entries as clusters (Liang and Zeger 1986).
    """
    if not np.all(np.isfinite(covariance)) or fit.scores.shape[0] < _MIN_ENTRIES:
        return covariance, freedom, []

    influence = fit.scores @ fit.inverse
    shares = np.einsum("ij,ejk,ki->ei", fit.inverse, fit.information_matrices, fit.inverse)
    clusters = shares.sum(axis=0) ** 2 / np.sum(shares**2, axis=0)
    identified = clusters > _MIN_CLUSTERS
    between = np.sum(influence**2, axis=0) / np.where(identified, 1.0 - 1.0 / clusters, 1.0)
    ratio = between / np.diag(covariance)
    # Upper 0.1 % point of chi-square over its degrees of freedom.
    limit = special.chdtri(clusters, 1e-3) / clusters
    over = identified & (ratio > limit)
    if not over.any():
        return covariance, freedom, []
    scale = np.sqrt(np.where(over, ratio, 1.0))
    note = (
        f"the poles of the entries differ by up to {scale.max():.2g} times their scatter (did the structure change "
        "between the hits?); the standard errors are enlarged by this factor"
    )
    return covariance * np.outer(scale, scale), min(freedom, max(float(clusters[over].min()) - 1.0, 1.0)), [note]


def _missing_mode_warnings(
    frequency: NDArray[np.float64], lines: Lines, requested: int | tuple[float, ...] | None
) -> list[str]:
    if requested is None:
        return []
    if isinstance(requested, int):
        if frequency.size == requested:
            return []
        return [
            f"{requested} modes were requested, {frequency.size} found: no further pole in the band improves the fit; "
            "give the frequencies as modes"
        ]
    distance = np.abs(np.array(requested)[:, None] - frequency)
    rows, columns = scipy.optimize.linear_sum_assignment(distance)
    assigned = rows[np.isfinite(distance[rows, columns])].tolist()
    return [
        f"no mode was found within {search_range(requested_hz, lines):.3g} Hz of {requested_hz:g} Hz"
        for index, requested_hz in enumerate(requested)
        if index not in assigned
    ]


def _validity_warnings(
    fit: PoleFit,
    frequency: NDArray[np.float64],
    damping: NDArray[np.float64],
    damping_error: NDArray[np.float64],
) -> list[str]:
    messages = []
    if not fit.converged:
        messages.append("the fit did not converge; check the number of modes")
    for f, z, error in zip(frequency, damping, damping_error, strict=True):
        if z <= 0.0:
            messages.append(f"the damping ratio of the mode at {f:.6g} Hz is {z:.2g} +- {error:.1g}, not above zero")
    return messages


def _resolution_notes(frequency: NDArray[np.float64], decay: NDArray[np.float64], lines: Lines) -> list[str]:
    messages = []
    width = decay / np.pi
    spacing = _spacing_at(lines, frequency)
    for f, half_power_band, step in zip(frequency, width, spacing, strict=True):
        if 0.0 < half_power_band < step:
            messages.append(
                f"the half-power band of the mode at {f:.6g} Hz is {half_power_band / step:.1g} of the distance of the "
                "lines: its damping is valid only for lines without leakage"
            )
    for index in range(frequency.size - 1):
        if frequency[index + 1] - frequency[index] < 0.5 * min(width[index], width[index + 1]):
            messages.append(
                f"the poles at {frequency[index]:.6g} and {frequency[index + 1]:.6g} Hz are within half of a "
                "half-power band: two close modes, or one mode that changed between hits"
            )
    return messages


def _spacing_at(lines: Lines, frequency_hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of the lines at given frequencies."""
    gaps = np.diff(lines.frequency_hz)
    return np.asarray(gaps[np.clip(np.searchsorted(lines.frequency_hz, frequency_hz) - 1, 0, gaps.size - 1)])


def _residual_scatter(fit: PoleFit, lines: Lines, scatter: Scatter) -> NDArray[np.float64]:
    """Return the root mean square `(m,)` of the residuals, corrected for the fitted parameters."""
    residuals = lines.values - fit.fitted
    if lines.relative is not None:
        residuals = residuals * weights_of(lines, scatter, fit, smooth=True)
    elif scatter == "relative":
        residuals = residuals / np.maximum(np.abs(lines.values), np.finfo(np.float64).tiny)
    share = max(fit.degrees_of_freedom, 1) / (2.0 * fit.residual.size)
    return np.asarray(np.sqrt(np.mean(np.abs(residuals) ** 2, axis=0) / 2.0 / share))
