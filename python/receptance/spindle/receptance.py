"""A spindle's receptances line by line, and how far each line can be believed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.frf import FRF
from receptance.report import Column, Provenance, Result, Table
from receptance.terminals import ENTRIES, MeasuredPart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["SpindleReceptance"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpindleReceptance(Result):
    """The receptances of a spindle at its connection plane, as `identify_spindle` finds them.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` lines, complex where an exponential window was used.
    matrix : ndarray
        `(n, 2, 2)` over (y, theta): y/F, y/M, theta/F and theta/M.
    covariance : ndarray
        `(n, 3, 3)` Hermitian, of the errors of y/F, theta/M and y/M: that of their real parts, which the imaginary
        parts have as well; first order in the noise of the responses.
    condition : ndarray
        `(n,)` by how much a relative error of the responses can grow on its way to the spindle.
    usable : ndarray
        `(n,)` where the standard deviation of each term is below `limit` of its size and the line is not ambiguous.
    limit : float
        That share.
    ambiguous : ndarray
        `(n,)` where two spindles explain the responses and the other lines do not decide between them.
    rms : float
        Root mean square of what several blanks disagree by, in standard deviations; not a number with three responses.
    labels : tuple of str
        What was measured.
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
        """`(n, 2, 2)` of the real and of the imaginary part, each."""
        deviation = np.sqrt(np.einsum("nii->ni", self.covariance).real)
        result = np.empty(self.matrix.shape)
        for column, (i, j) in enumerate(ENTRIES):
            result[:, i, j] = result[:, j, i] = deviation[:, column]
        return result

    @property
    def decay_rate(self) -> float:
        """Decay in 1/s of the window that the responses had."""
        return float(-2.0 * np.pi * np.asarray(self.frequency_hz).imag[0]) + 0.0

    def part(self, *, name: str = "spindle") -> MeasuredPart:
        """Return the usable lines as the far end of an assembly, with their covariance.

        Raises
        ------
        ValueError
            No line is usable.
        """
        rows = self._usable()
        return MeasuredPart(
            frequency_hz=np.asarray(self.frequency_hz).real[rows],
            matrix=self.matrix[rows],
            covariance=self.covariance[rows],
            decay_rate=self.decay_rate,
            name=name,
        )

    def as_frf(self, *, label: str = "spindle") -> FRF:
        """Return the usable lines as an FRF over (y, theta) with the variance of its logarithm, to be kept in files."""
        rows = self._usable()
        spread = self.standard_deviation[rows] / np.abs(self.matrix[rows])
        return FRF(
            frequency_hz=np.asarray(self.frequency_hz).real[rows],
            values=self.matrix[rows],
            responses=["y", "theta"],
            excitations=["y", "theta"],
            decay_rate=self.decay_rate,
            log_variance=spread**2,
            label=label,
            source=f"identify_spindle from {', '.join(self.labels)}",
            notes=self.notes,
        )

    def with_note(self, note: str) -> SpindleReceptance:
        """Return the same with one note more."""
        return replace(self, notes=(*self.notes, note))

    def _usable(self) -> NDArray[np.intp]:
        rows = np.flatnonzero(self.usable)
        if not rows.size:
            raise ValueError(
                f"no line is usable: nowhere are the standard deviations of all terms below {100.0 * self.limit:g} % "
                "of them; measure with less noise, with a longer or stiffer blank, or raise limit"
            )
        return rows

    def tables(self) -> list[Table]:
        """Return for each term its size and its standard deviation on the usable lines."""
        columns = (
            "term",
            Column("usable lines", form="d"),
            Column("from, to", "Hz", "g"),
            Column("least magnitude", form=".3g"),
            Column("most", form=".3g"),
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
        """Return how many lines are usable."""
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
