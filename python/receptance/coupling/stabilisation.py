"""The number of modes of an unknown spindle, which the evidence of its records chooses.

Modes are added one at a time (`mode_growth`). With chi^2_k the sum of squares of the records with k modes, of N
independent real numbers of which the scatter is not known better than from their own residuals, the Bayesian
information criterion (Schwarz, Ann. Statist. 6, 1978) is

    N log(chi^2_k / N) + p_k log N,

p_k the fitted numbers of the modes: a mode has to lower chi-square by about log N times its numbers, six or four. The
number with the least criterion is chosen; a spurious mode lowers chi-square by two or three times its numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.coupling.mode_growth import FittedModes
from receptance.report import Column, Provenance, Result, Results, Table
from receptance.report.table import Cell

_PATIENCE = 2
"""Further modes without a lower criterion after which no more are added."""
FREQUENCY_CHANGE = 0.01
"""Largest relative change of the natural frequency of a stable mode from that of a mode with one mode fewer."""
DAMPING_CHANGE = 0.1
"""Largest relative change of its damping ratio."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stabilisation(Result):
    """Modes of an unknown spindle by their number, and the number that was chosen."""

    name: str
    """Name of the spindle."""
    fits: tuple[FittedModes, ...] = field(repr=False)
    """The fit with no mode, with one and so on."""
    count: int
    """Real numbers of the records."""
    values: float
    """Effective number of them, as neighbouring lines may be correlated."""
    lines_hz: NDArray[np.float64] = field(repr=False)
    """`(n,)` lines of the records."""
    magnitude: NDArray[np.float64] = field(repr=False)
    """`(n,)` magnitude of a measured FRF, as the background of the figure."""
    measured: str = ""
    """The measurement of `magnitude`."""
    stated: int | None = None
    """The stated number of modes; None where the records choose it."""
    further: int = 0
    """Modes of the fit beyond the chosen number."""
    provenance: Provenance = field(default_factory=Provenance, repr=False)
    notes: tuple[str, ...] = ()

    heading = "Number of modes"
    plotted_by = "receptance.coupling.figure:draw_stabilisation"

    @property
    def chi_square(self) -> NDArray[np.float64]:
        """Sum of squares of the records with each number of modes, per real number."""
        return np.array([fit.chi_square for fit in self.fits]) / self.count

    @property
    def criterion(self) -> NDArray[np.float64]:
        """Bayesian information criterion of each number of modes, less the least one."""
        result = np.array([criterion(fit, self.values) for fit in self.fits])
        return np.asarray(result - result.min())

    @property
    def chosen(self) -> int:
        """The number of modes with the least criterion."""
        return int(np.argmin(self.criterion))

    @property
    def used(self) -> int:
        """The number of modes of the fit: the stated one, else the chosen one plus `further`, if so many are fitted."""
        return min(self.chosen + self.further, len(self.fits) - 1) if self.stated is None else self.stated

    def stable(self, count: int) -> NDArray[np.bool_]:
        """Return which modes of a number, in the order of `fits`, are there with one mode fewer.

        Their frequencies differ by at most `FREQUENCY_CHANGE`, and their damping ratios by `DAMPING_CHANGE`.
        """
        modes = self.fits[count].modes[:, :2]
        before = self.fits[count - 1].modes[:, :2] if count else np.empty((0, 2))
        change = np.abs(modes[:, None] / before[None] - 1.0)
        return np.asarray(np.any((change <= (FREQUENCY_CHANGE, DAMPING_CHANGE)).all(axis=-1), axis=1))

    def tables(self) -> list[Table]:
        """Return chi-square and criterion by the number of modes."""
        columns = (
            Column("modes", form="d"),
            Column("chi-square\nper number", form=".4g"),
            Column("criterion above\nthe least", form=".4g"),
            Column("stable\nmodes", form="d"),
            "",
        )
        rows: list[list[Cell]] = [
            [
                count,
                float(self.chi_square[count]),
                float(self.criterion[count]),
                int(self.stable(count).sum()),
                self._mark(count),
            ]
            for count in range(1, len(self.fits))
        ]
        return [Table(f"Number of modes of {self.name}", columns, rows)]

    def _mark(self, count: int) -> str:
        if count == self.stated:
            return "stated"
        return ("chosen" if self.stated is None else "least") if count == self.chosen else ""

    def sentences(self) -> list[str]:
        """Return the chosen number."""
        if self.stated is None:
            return [f"The records show {self.chosen} modes of {self.name}."]
        if self.chosen == self.stated:
            return []
        text = f"The records show {self.chosen} of the {self.stated} stated modes of {self.name}"
        return [f'{text}: `modes = "auto"` leaves out the others.']

    def data(self) -> dict[str, Any]:
        """Return the fits with each number of modes."""
        return {
            "chosen": self.chosen,
            "stated": self.stated,
            "values": self.values,
            "numbers": [
                {
                    "modes": count,
                    "chi_square_per_value": self.chi_square[count],
                    "criterion": self.criterion[count],
                    "frequency_hz": fit.modes[:, 0],
                    "damping_ratio": fit.modes[:, 1],
                    "stable": self.stable(count),
                }
                for count, fit in enumerate(self.fits)
            ],
        }


class Stabilisations(Results[Stabilisation]):
    """Modes of the unknown spindles by their number; see `Stabilisation`."""

    heading = "Number of modes"
    key = "spindles"
    plotted_by = "receptance.coupling.figure:draw_stabilisation"

    def with_provenance(self, provenance: Provenance) -> Stabilisations:
        """Return the same with the source of the records."""
        return Stabilisations(
            {name: replace(each, provenance=provenance) for name, each in self.items()}, provenance=provenance
        )


def up_to_least(steps: Iterable[FittedModes], values: float, near: float = float("inf")) -> tuple[FittedModes, ...]:
    """Return the fits up to the least criterion, and those after it that show that it is the least.

    While chi-square is above `near`, modes are added in any case, because the first ones may be in the wrong places.
    """
    fits: list[FittedModes] = []
    criteria: list[float] = []
    for fit in steps:
        fits.append(fit)
        criteria.append(criterion(fit, values))
        if min(fit.chi_square for fit in fits) < near and len(fits) - 1 - int(np.argmin(criteria)) >= _PATIENCE:
            break
    return tuple(fits)


def criterion(fit: FittedModes, values: float) -> float:
    """Return the Bayesian information criterion of a fit, up to a constant of the records."""
    return values * float(np.log(max(fit.chi_square, 1e-300))) + fit.free * float(np.log(values))
