"""Two calls that are timed against each other, once they agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .models import Array


@dataclass(frozen=True, kw_only=True)
class Pair:
    """Two calls that are timed against each other.

    Parameters
    ----------
    subject, against : str
        The computation, and the reference that our time is compared with.
    ours, reference : callable
        The two sides, without arguments.
    difference : callable
        Difference of two results, see `tolerance`.
    tolerance : float
        Largest permitted value of `difference`.
    lines, segments : int, optional
        Frequency lines of a call and segments of the model.
    threads : int
        Threads on our side.
    is_cost : bool
        Whether the ratio is our time over that of the reference, for the cost of more work, instead of the inverse.
    most_rounds : int, optional
        Largest number of turns of each side, for long calls.
    remark : callable, optional
        Returns a remark on two results for the table.
    """

    subject: str
    against: str
    ours: Callable[[], Any]
    reference: Callable[[], Any]
    difference: Callable[[Any, Any], float]
    tolerance: float
    lines: int | None = None
    segments: int | None = None
    threads: int = 1
    is_cost: bool = False
    most_rounds: int | None = None
    remark: Callable[[Any, Any], str] | None = None

    @property
    def name(self) -> str:
        """Subject and reference in one line."""
        return f"{self.subject}: {self.against}"

    @property
    def ratio_is(self) -> str:
        """Meaning of the ratio, as in the JSON keys."""
        return "ours_s / reference_s" if self.is_cost else "reference_s / ours_s"

    def check(self) -> tuple[float, str]:
        """Run both sides once; return their difference and the remark.

        Raises
        ------
        AssertionError
            They disagree, so their times are not comparable.
        """
        ours, other = self.ours(), self.reference()
        found = self.difference(ours, other)
        if not found <= self.tolerance:
            raise AssertionError(
                f"{self.name}: the two sides differ by {found:.2g}, expected at most {self.tolerance:g}"
            )
        return found, self.remark(ours, other) if self.remark else ""


def largest_difference(ours: Array, other: Array) -> float:
    """Return the largest relative difference of two arrays, entry by entry."""
    if ours.shape != other.shape:
        raise AssertionError(f"shape {ours.shape} against {other.shape}")
    with np.errstate(invalid="ignore"):
        return float(np.max(np.abs(ours - other) / np.abs(other), initial=0.0))
