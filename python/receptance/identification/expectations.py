"""What further measurements are expected to bring, as a result to read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.candidates import Candidate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
class NextMeasurement:
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
        What a person should know.
    """

    ranking: tuple[RankedCandidate, ...]
    targets: tuple[str, ...]
    level: float
    points: tuple[dict[str, float], ...]
    profiled: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def best(self) -> RankedCandidate:
        """The first of the ranking."""
        return self.ranking[0]

    def plot(self) -> Figure:
        """Draw the interval of each target now and with each candidate."""
        from receptance.plot.next_measurement import draw_next_measurement

        return draw_next_measurement(self)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain values; infinite ends of intervals are as they are."""
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
            "notes": self.notes,
        }

    def summary(self) -> str:
        """Return the ranking as text."""
        lines = []
        for place, one in enumerate(self.ranking, start=1):
            cost = f", cost {one.candidate.cost:g}" if one.candidate.cost != 1.0 else ""
            lines.append(f"{place}. {one.label}: deviations to {100.0 * one.shrink:.3g} % of now{cost}")
            lines += [f"   {name}: {_said(e)}" for name, e in one.expected.items()]
        return "\n".join([*lines, *(f"note: {text}" for text in self.notes)])

    def __repr__(self) -> str:
        order = " > ".join(f"{one.label} ({100.0 * one.shrink:.3g} %)" for one in self.ranking)
        return f"NextMeasurement({order})"


def _said(e: Expectation) -> str:
    """Return in words what is expected of a target."""
    if e.value == 0.0:
        return f"{100.0 * e.deviation_now:.3g} % now, {100.0 * e.deviation:.3g} % expected"
    ends = [f"{end:.4g}" if np.isfinite(end) and end != 0.0 else "open" for end in e.now]
    text = f"{ends[0]} to {ends[1]} now, {e.lower:.4g} to {e.upper:.4g} expected"
    if e.stays_open > 0.0:
        text += f"; {100.0 * e.stays_open:.0f} % of what is likely would leave it open"
    return text
