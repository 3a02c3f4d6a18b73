"""Further measurements, ranked by the intervals that are expected with them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.candidates import Candidate
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from receptance.report.table import Cell, Interval

__all__ = ["Expectation", "NextMeasurement", "RankedCandidate"]


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """What is known of a target now, and what is expected to be known with one more measurement.

    Attributes
    ----------
    name : str
        What it is of: a parameter, a natural frequency, the logarithm of a receptance.
    value : float
        Where it is now, in SI units or Hz; zero for the logarithm of a receptance, which is known up to a share.
    scale : {"log", "linear"}
        Whether intervals are symmetric in the logarithm.
    now : (float, float)
        Interval now; infinite or zero at a side that is open.
    lower, upper : float
        Interval that is expected, about where the value is now and not beyond the one of now.
    deviation, deviation_now : float
        Standard deviation then and now, of log10 of the value where the scale is "log".
    deviations : tuple of float
        The deviation expected at each point, if the truth were there; `deviation` is their geometric mean.
    stays_open : float
        Share of these points at which the interval would still reach the bounds of the fit.
    """

    name: str
    value: float
    scale: str
    now: tuple[float, float]
    lower: float
    upper: float
    deviation: float
    deviation_now: float
    deviations: tuple[float, ...]
    stays_open: float

    @property
    def range(self) -> tuple[float, float]:
        """The 10 % and 90 % points of the deviations: how much what is expected depends on what the truth is."""
        low, high = np.quantile(self.deviations, [0.1, 0.9])
        return float(low), float(high)

    @property
    def shrink(self) -> float:
        """The deviation that is expected, as a share of that of now."""
        return self.deviation / self.deviation_now if self.deviation_now > 0.0 else 1.0

    @property
    def percent(self) -> float:
        """Half of the interval that is expected, in percent of the value."""
        if self.scale == "log":
            return 100.0 * (self.upper / self.value - 1.0)
        whole = abs(self.value) or 1.0
        return 100.0 * 0.5 * (self.upper - self.lower) / whole


@dataclass(frozen=True, kw_only=True)
class RankedCandidate:
    """A candidate and what is expected of it.

    Attributes
    ----------
    candidate : Candidate
        The measurement.
    expected : dict of str to Expectation
        By target.
    shrink : float
        Geometric mean over the targets of the deviation that is expected, as a share of that of now.
    score : float
        -ln(shrink) / cost: what the ranking is by.
    """

    candidate: Candidate
    expected: dict[str, Expectation]
    shrink: float
    score: float

    @property
    def label(self) -> str:
        """Label of the candidate."""
        return self.candidate.label


@dataclass(frozen=True, kw_only=True)
class NextMeasurement(Result):
    """Candidates, the best first.

    Attributes
    ----------
    ranking : tuple of RankedCandidate
        The best first.
    targets : tuple of str
        What is to be known better.
    level : float
        Level of all intervals.
    points : tuple of dict
        Values of the fit's unknowns, in SI units by name, at which the information was taken and averaged: the fit, or
        where the truth may as well be.
    profiled : tuple of str
        Parameters so little known that these points are spread along their profiles.
    notes : tuple of str
        Notes for the user.
    provenance : Provenance
        Campaign, seed and versions of the software.
    """

    ranking: tuple[RankedCandidate, ...]
    targets: tuple[str, ...]
    level: float
    points: tuple[dict[str, float], ...]
    profiled: tuple[str, ...]
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Next measurement"

    @property
    def best(self) -> RankedCandidate:
        """The first of the ranking."""
        return self.ranking[0]

    def tables(self) -> list[Table]:
        """Return the ranking, and for each target the interval now and with each candidate."""
        priced = len({one.candidate.cost for one in self.ranking}) > 1
        ranking = Table(
            "Candidates, the best first",
            (
                Column("", form="d"),
                "candidate",
                "assembly",
                Column("deviations expected", "% of now", ".3g"),
                Column("cost", form="g"),
            ),
            [
                (
                    place,
                    one.label,
                    one.candidate.configuration,
                    100.0 * one.shrink,
                    one.candidate.cost if priced else None,
                )
                for place, one in enumerate(self.ranking, start=1)
            ],
        ).without_empty()
        rows: list[list[Cell]] = []
        for name in self.targets:
            first = self.ranking[0].expected[name]
            rows.append([name, "now", _ends(first, first.now), None, None])
            for one in self.ranking:
                e = one.expected[name]
                half = e.percent if e.value != 0.0 else 100.0 * e.deviation
                share = 100.0 * e.stays_open if e.stays_open else None
                rows.append([None, f"with {one.label}", _ends(e, (e.lower, e.upper)), half, share])
        columns = (
            "target",
            "measured",
            Column(f"{100.0 * self.level:g} % interval, SI units", form=".5g"),
            Column("half of it", "%", ".2g"),
            Column("chance that it\nstays open", "%", ".0f"),
        )
        return [ranking, Table("Intervals now and as expected, about the value of now", columns, rows).without_empty()]

    def sentences(self) -> list[str]:
        """Return the best candidate."""
        return [f"best: {self.best.label}; deviations to {100.0 * self.best.shrink:.3g} % of now."]

    def data(self) -> dict[str, Any]:
        """Return the ranking with the intervals that are expected."""
        return {
            "targets": self.targets,
            "level": self.level,
            "points": len(self.points),
            "profiled": self.profiled,
            "ranking": [
                {
                    "candidate": one.label,
                    "cost": one.candidate.cost,
                    "shrink": one.shrink,
                    "score": one.score,
                    "expected": {
                        name: {
                            "value": e.value,
                            "now": e.now,
                            "expected": (e.lower, e.upper),
                            "deviation_now": e.deviation_now,
                            "deviation": e.deviation,
                            "deviation_10_90": e.range,
                            "scale": e.scale,
                            "stays_open": e.stays_open,
                        }
                        for name, e in one.expected.items()
                    },
                }
                for one in self.ranking
            ],
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the interval of each target now and with each candidate; see `Result.plot`."""
        from receptance.identification.figures.next_measurement import draw_next_measurement

        return draw_next_measurement(self, ax)

    def __repr__(self) -> str:
        order = " > ".join(f"{one.label} ({100.0 * one.shrink:.3g} %)" for one in self.ranking)
        return f"NextMeasurement({order})"


def _ends(e: Expectation, ends: tuple[float, float]) -> Interval:
    """Return an interval whose open sides are None."""
    low, high = ends
    return (None if np.isinf(low) or (e.scale == "log" and low == 0.0) else low), (None if np.isinf(high) else high)
