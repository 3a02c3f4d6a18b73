"""How far a sweep is."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SweepProgress"]


@dataclass(frozen=True, kw_only=True)
class SweepProgress:
    """Candidates done and time taken.

    Attributes
    ----------
    done, count : int
        Candidates that are finished and kept, and all.
    resumed : int
        How many of them an earlier run had finished.
    seconds : float
        Since this run began.

    Examples
    --------
    >>> from receptance.sweep import SweepProgress
    >>> print(SweepProgress(done=3000, count=9000, resumed=1000, seconds=2.0))
    3,000 of 9,000 candidates, 1,000 a second, 6 s left
    """

    done: int
    count: int
    resumed: int
    seconds: float

    @property
    def rate(self) -> float:
        """Candidates a second in this run; zero before the first block."""
        return (self.done - self.resumed) / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def remaining_seconds(self) -> float:
        """Time left at this rate; infinite before the first block."""
        return (self.count - self.done) / self.rate if self.rate > 0.0 else float("inf")

    def __str__(self) -> str:
        text = f"{self.done:,} of {self.count:,} candidates"
        if self.rate > 0.0:
            text += f", {self.rate:,.{0 if self.rate >= 10.0 else 2}f} a second, {self.remaining_seconds:,.0f} s left"
        return text
