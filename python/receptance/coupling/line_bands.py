"""Bands of lines on which a spindle is known or not, and why not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from receptance.coupling.spindle_receptance import SpindleReceptance
from receptance.model.terminals import ENTRIES

Reason = Literal["", "y/F", "theta/M", "y/M", "two solutions", "noise", "not determined"]
"""Why a line is not usable: the term with the largest standard deviation above the limit; two spindles explain the
responses; the noise is too large for a standard deviation; the equations have no solution. Empty for a usable line."""
REASONS: tuple[Reason, ...] = ("", "y/F", "theta/M", "y/M", "two solutions", "noise", "not determined")
_SHORTEST = 60
"""A band has at least this part of all lines, or five."""


@dataclass(frozen=True)
class LineBand:
    """Neighbouring lines, most of which are usable or most of which are not."""

    low_hz: float
    high_hz: float
    lines: int
    """Number of lines."""
    usable: int
    """Number of usable lines."""
    reason: Reason
    """The most frequent reason of the other lines."""
    condition: float
    """Median condition number: amplification of a relative error of the responses."""
    deviation: float
    """Median of the largest standard deviation of a term, relative to the term; of the coupling relative to
    sqrt(|G_yy G_tt|)."""


def relative_deviations(spindle: SpindleReceptance) -> NDArray[np.float64]:
    """Return the standard deviations of y/F, theta/M and y/M as the limit compares them, `(n, 3)`."""
    size = np.abs(spindle.matrix)
    size[:, 0, 1] = np.sqrt(size[:, 0, 0] * size[:, 1, 1])
    with np.errstate(all="ignore"):
        ratio = [spindle.standard_deviation[:, i, j] / size[:, i, j] for i, j in ENTRIES]
    return np.where(np.isfinite(ratio), ratio, np.inf).T


def reasons_of(spindle: SpindleReceptance) -> NDArray[np.intp]:
    """Return the number of its reason in `REASONS` for each line, `(n,)`."""
    deviation = relative_deviations(spindle)
    result = np.full(spindle.usable.size, REASONS.index("noise"))
    result[spindle.ambiguous] = REASONS.index("two solutions")
    large = deviation.max(axis=1) > spindle.limit
    result[large] = 1 + np.argmax(deviation, axis=1)[large]
    result[~np.isfinite(spindle.matrix).all(axis=(1, 2))] = REASONS.index("not determined")
    result[spindle.usable] = 0
    return result


def bands_of(spindle: SpindleReceptance) -> list[LineBand]:
    """Return the bands of a spindle in ascending order; together they have all its lines."""
    lines, deviation = np.asarray(spindle.frequency_hz).real, relative_deviations(spindle)
    reasons = reasons_of(spindle)
    starts = _starts(spindle.usable, max(5, lines.size // _SHORTEST))
    bands = []
    for first, last in zip(starts, [*starts[1:], lines.size], strict=True):
        inside = slice(first, last)
        counts = np.bincount(reasons[inside], minlength=len(REASONS))
        usable = int(counts[0])
        counts[0] = 0
        bands.append(
            LineBand(
                low_hz=float(lines[first]),
                high_hz=float(lines[last - 1]),
                lines=last - first,
                usable=usable,
                reason=REASONS[int(np.argmax(counts))] if counts.any() else "",
                condition=float(np.median(spindle.condition[inside])),
                deviation=float(np.median(deviation[inside].max(axis=1))),
            )
        )
    return bands


def _starts(usable: NDArray[np.bool_], shortest: int) -> list[int]:
    """Return the first lines of the bands: runs of one state, of which the shortest is joined to its neighbours."""
    edges = [0, *(np.flatnonzero(np.diff(usable.astype(np.int8))) + 1).tolist(), usable.size]
    while len(edges) > 2:
        lengths = np.diff(edges)
        short = int(np.argmin(lengths))
        if lengths[short] >= shortest:
            break
        # Both neighbours have the other state, so that both edges go.
        edges = [edge for i, edge in enumerate(edges) if i not in (short, short + 1) or i in (0, len(edges) - 1)]
    return edges[:-1]
