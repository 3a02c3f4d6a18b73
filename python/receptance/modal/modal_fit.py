"""The modes that a global fit found, with what it cannot tell."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.frf.forms import conversion
from receptance.modal.estimate import ModeEstimate, quantile
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf import FRF

__all__ = ["ModalFit"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ModalFit(Result):
    """Modes common to all entries of an FRF, in ascending frequency.

    H(s) = sum over modes of A_r / (s - p_r) + A_r* / (s - p_r*), and background, s = i w on real lines; for a mode
    with a real modal constant that is C_r / (w_r^2 - w^2 + 2 i zeta_r w_r w) with C_r = 2 i w_d A_r.

    Attributes
    ----------
    frequency_hz, frequency_standard_error_hz : ndarray
        `(M,)` undamped natural frequencies.
    damping_ratio, damping_standard_error : ndarray
        `(M,)` viscous damping ratios; an exponential window is taken off.
    covariance : ndarray
        `(2M, 2M)` of the frequencies in Hz, then the damping ratios.
    modal_constant, modal_constant_standard_error : ndarray
        `(M, n_out, n_in)` complex C_r of the receptance, in 1/kg for m/N. Of the standard error the real part is that
        of the real part, the imaginary part that of the imaginary part.
    residue : ndarray
        `(M, n_out, n_in)` complex A_r of the receptance.
    background : dict of int to ndarray
        `(n_out, n_in)` complex coefficient of each power of s in the receptance: -2 for the modes far below the
        band, 0 for those far above it.
    outside_poles, outside_residue : ndarray
        `(K,)` in rad/s and `(K, n_out, n_in)`: poles that stand for modes near the band, and, where frequencies were
        given, for other modes in it. They are part of the background.
    lines_in_band : ndarray
        `(M,)` width of the half-power band over the distance of the lines, both as measured.
    frf : FRF
        The lines that were fitted.
    scatter : ndarray
        `(n_out, n_in)` root mean square of what is left over, of the real and of the imaginary part: in stated standard
        deviations where the FRF has a variance, else in the unit of the FRF ("absolute") or over it ("relative").
    known_scatter : bool
        Whether the FRF stated its variance.
    correlation : float
        Of what is left on neighbouring lines.
    degrees_of_freedom : float
        Of the standard errors: those of the FRF's variance where it explains what is left, infinite if that is exact,
        else those of the residuals or of the entries that disagree.
    converged : bool
        Whether the last fit stopped because nothing changed any more.
    stabilisation : tuple of ndarray
        For each order of the polynomials, its candidates as complex frequencies in Hz, damped natural frequency plus
        i times decay rate over 2 pi, that of the window taken off.
    notes : tuple of str
        Notes for the user.
    provenance : Provenance
        Versions of the software.
    """

    frequency_hz: NDArray[np.float64]
    frequency_standard_error_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    damping_standard_error: NDArray[np.float64]
    covariance: NDArray[np.float64]
    modal_constant: NDArray[np.complex128]
    modal_constant_standard_error: NDArray[np.complex128]
    residue: NDArray[np.complex128]
    background: dict[int, NDArray[np.complex128]]
    outside_poles: NDArray[np.complex128]
    outside_residue: NDArray[np.complex128]
    lines_in_band: NDArray[np.float64]
    frf: FRF
    scatter: NDArray[np.float64]
    known_scatter: bool
    correlation: float
    degrees_of_freedom: float
    converged: bool
    stabilisation: tuple[NDArray[np.complex128], ...]
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Modes"

    @property
    def poles(self) -> NDArray[np.complex128]:
        """`(M,)` -zeta w_r + i w_r sqrt(1 - zeta^2) in rad/s."""
        w = 2.0 * np.pi * self.frequency_hz
        return np.asarray(-self.damping_ratio * w + 1j * w * np.sqrt(1.0 - self.damping_ratio**2))

    def receptance(self, frequency_hz: ArrayLike, *, background: bool = True) -> NDArray[np.complex128]:
        """`(n, n_out, n_in)` receptance of the modes.

        Parameters
        ----------
        frequency_hz : array_like
            `(n,)` real, or complex f - i sigma / 2 pi for lines under an exponential window.
        background : bool, optional
            Whether what stands for modes outside the band is added; it holds in the band only.
        """
        s = 2j * np.pi * np.atleast_1d(_checks.unmasked("", "frequency_hz", frequency_hz)).astype(np.complex128)
        poles, residue = self.poles, self.residue
        if background:
            poles = np.concatenate([poles, self.outside_poles])
            residue = np.concatenate([residue, self.outside_residue])
        own, other = 1.0 / (s[:, None] - poles), 1.0 / (s[:, None] - poles.conj())
        total = np.tensordot(own, residue, 1) + np.tensordot(other, residue.conj(), 1)
        if background:
            for term, coefficient in self.background.items():
                total = total + s[:, None, None] ** term * coefficient
        return np.asarray(total)

    def synthesised(self) -> NDArray[np.complex128]:
        """`(n, n_out, n_in)` the fit on the lines and in the form of `frf`."""
        lines = self.frf.complex_frequency_hz
        return self.receptance(lines) * conversion(lines, "receptance", self.frf.form)[:, None, None]

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

    def frequency_interval_hz(self, level: float = 0.95) -> NDArray[np.float64]:
        """`(M, 2)` intervals that hold the natural frequencies, each with this probability."""
        reach = quantile(level, self.degrees_of_freedom) * self.frequency_standard_error_hz
        return np.stack([self.frequency_hz - reach, self.frequency_hz + reach], axis=1)

    def damping_interval(self, level: float = 0.95) -> NDArray[np.float64]:
        """`(M, 2)` intervals that hold the damping ratios, each with this probability."""
        reach = quantile(level, self.degrees_of_freedom) * self.damping_standard_error
        return np.stack([self.damping_ratio - reach, self.damping_ratio + reach], axis=1)

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
        """Draw measured and synthesised values of one entry, residuals and poles; see `Result.plot`."""
        from receptance.modal.figure import draw_modal_fit

        return draw_modal_fit(self, response=response, excitation=excitation, ax=ax)

    def _headline(self) -> str:
        low, high = self.frf.frequency_hz[0], self.frf.frequency_hz[-1]
        count = f"{len(self.frequency_hz)} mode{'' if len(self.frequency_hz) == 1 else 's'}"
        return f"{count} between {low:g} and {high:g} Hz"

    def __repr__(self) -> str:
        found = ", ".join(
            f"{f:.6g} Hz {100.0 * z:.3g} %" for f, z in zip(self.frequency_hz, self.damping_ratio, strict=True)
        )
        state = "" if self.converged else ", not converged"
        return f"ModalFit({self._headline()}: {found}{state})"
