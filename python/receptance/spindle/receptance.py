"""Receptances of a spindle line by line, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from receptance.frf import FRF
from receptance.model.terminals import ENTRIES, MeasuredPart
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpindleReceptance(Result):
    """Receptances of a spindle at its connection plane, as identified by `identify_spindle`.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` lines in Hz, complex if the responses have an exponential window.
    matrix : ndarray
        `(n, 2, 2)` receptance over (y, theta): y/F, y/M, theta/F and theta/M, SI units.
    covariance : ndarray
        `(n, 3, 3)` Hermitian covariance of the errors of y/F, theta/M and y/M, for the real and for the imaginary
        parts; first order in the noise of the responses.
    condition : ndarray
        `(n,)` condition number: largest amplification of a relative error of the responses.
    usable : ndarray
        `(n,)` lines on which the relative standard deviation of each term is below `limit` and which are not
        ambiguous.
    limit : float
        Largest relative standard deviation of usable lines.
    ambiguous : ndarray
        `(n,)` lines on which two spindles explain the responses and the other lines do not decide between them.
    rms : float
        Root mean square of the residuals of several blanks, in standard deviations; NaN for three responses.
    labels : tuple of str
        Labels of the measurements.
    notes : tuple of str
        Notes for the user.
    provenance : Provenance
        Versions of the software.
    """

    frequency_hz: NDArray[Any]
    matrix: NDArray[np.complex128]
    covariance: NDArray[np.complex128]
    condition: NDArray[np.float64]
    usable: NDArray[np.bool_]
    limit: float
    ambiguous: NDArray[np.bool_]
    rms: float
    labels: tuple[str, ...]
    notes: tuple[str, ...] = field(default=())
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Spindle receptances line by line"

    @property
    def standard_deviation(self) -> NDArray[np.float64]:
        """Standard deviation `(n, 2, 2)` of the real and of the imaginary part, each."""
        deviation = np.sqrt(np.einsum("nii->ni", self.covariance).real)
        result = np.empty(self.matrix.shape)
        for column, (i, j) in enumerate(ENTRIES):
            result[:, i, j] = result[:, j, i] = deviation[:, column]
        return result

    @property
    def decay_rate(self) -> float:
        """Decay rate in 1/s of the window of the responses."""
        return float(-2.0 * np.pi * np.asarray(self.frequency_hz).imag[0]) + 0.0

    def part(self, *, name: str = "spindle") -> MeasuredPart:
        """Return the usable lines as the far end of an assembly, with their covariance.

        Raises
        ------
        ValueError
            No line is usable.
        """
        rows = self._usable_rows()
        return MeasuredPart(
            frequency_hz=np.asarray(self.frequency_hz).real[rows],
            matrix=self.matrix[rows],
            covariance=self.covariance[rows],
            decay_rate=self.decay_rate,
            name=name,
        )

    def as_frf(self) -> FRF:
        """Return the usable lines as an FRF over (y, theta) with the variance of its logarithm, for files."""
        rows = self._usable_rows()
        deviation = self.standard_deviation[rows] / np.abs(self.matrix[rows])
        return FRF(
            frequency_hz=np.asarray(self.frequency_hz).real[rows],
            values=self.matrix[rows],
            responses=["y", "theta"],
            excitations=["y", "theta"],
            decay_rate=self.decay_rate,
            log_variance=deviation**2,
            label="spindle",
            source=f"identify_spindle from {', '.join(self.labels)}",
            notes=self.notes,
        )

    def _usable_rows(self) -> NDArray[np.intp]:
        rows = np.flatnonzero(self.usable)
        if not rows.size:
            raise ValueError(
                f"no line is usable: the relative standard deviation of a term is above {100.0 * self.limit:g} % on "
                "every line; reduce the noise, use a longer or stiffer blank, or increase limit"
            )
        return rows

    def tables(self) -> list[Table]:
        """Return magnitude and standard deviation of each term on the usable lines."""
        columns = (
            "term",
            Column("usable lines", form="d"),
            Column("from, to", "Hz", "g"),
            Column("smallest magnitude", form=".3g"),
            Column("largest", form=".3g"),
            Column("median standard\ndeviation", "%", ".2g"),
        )
        lines = np.asarray(self.frequency_hz).real[self.usable]
        if not lines.size:
            return []
        rows = []
        for name, (i, j) in zip(("y/F", "theta/M", "y/M"), ENTRIES, strict=True):
            size = np.abs(self.matrix[self.usable, i, j])
            share = 100.0 * float(np.median(self.standard_deviation[self.usable, i, j] / size))
            ends = (float(lines[0]), float(lines[-1]))
            rows.append((name, lines.size, ends, float(size.min()), float(size.max()), share))
        return [Table("Receptances at the connection plane, SI units", columns, rows)]

    def sentences(self) -> list[str]:
        """Return the number of usable lines."""
        return [f"{int(self.usable.sum())} of {self.usable.size} lines are usable, measured: {', '.join(self.labels)}."]

    def data(self) -> dict[str, Any]:
        """Return each term on each line with its standard deviation."""
        names = ("y_over_force", "theta_over_moment", "y_over_moment")
        terms = {}
        for name, (i, j) in zip(names, ENTRIES, strict=True):
            value = self.matrix[:, i, j]
            deviation = self.standard_deviation[:, i, j]
            terms[name] = {"real": value.real, "imaginary": value.imag, "standard_deviation": deviation}
        return {
            "measured": self.labels,
            "frequency_hz": np.asarray(self.frequency_hz).real,
            "decay_rate": self.decay_rate,
            "terms": terms,
            "condition": self.condition,
            "usable": self.usable,
            "limit": self.limit,
            "rms": self.rms,
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the three terms with bands, and the condition number; see `Result.plot`."""
        from receptance.spindle.figure import draw_spindle

        return draw_spindle(self, ax=ax)

    def __repr__(self) -> str:
        lines = np.asarray(self.frequency_hz).real
        return (
            f"SpindleReceptance({int(self.usable.sum())} of {lines.size} lines from {lines[0]:g} to {lines[-1]:g} Hz "
            "are usable)"
        )
