"""An operating point in a stability lobe diagram: spindle speed and depth of cut beside the limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from receptance.report.table import amount, amount_interval, percent
from receptance.stability.lobes import Lobes

_HIGHEST = 15.0
"""Upper end of the depth axis over the lowest limit, so that high lobes do not compress the others."""


@dataclass(frozen=True, kw_only=True)
class OperatingPoint:
    """A spindle speed and a depth of cut, with the limit at this speed."""

    speed_rpm: float
    """Spindle speed in rpm, of the nearest one of the lobes."""
    depth: float
    """Depth of cut in m."""
    limit: float
    """Limit of the stable depth in m; infinite or NaN as in `Lobes.depth`."""
    band: tuple[float, float] | None
    """The 95 % band of the limit in m; None for an exact receptance."""
    probability: float | None
    """Probability that the depth is stable; None without draws."""
    chatter_hz: float
    """Chatter frequency in Hz at the limit."""

    def __str__(self) -> str:
        point = f"{self.speed_rpm:.0f} rpm, {amount(self.depth, 'm')}"
        if math.isnan(self.limit):
            return f"{point}: no limit is known"
        if math.isinf(self.limit):
            return f"{point}: no line limits the depth of cut"
        state = "stable" if self.depth < self.limit else "chatter"
        if self.probability is not None:
            state = f"stable with {percent(self.probability, 3)}"
        band = "" if self.band is None else f" ({amount_interval(self.band, 'm', 3)})"
        return f"{point}: {state}; limit {amount(self.limit, 'm')}{band}, chatter at {self.chatter_hz:.0f} Hz"


def operating_point(lobes: Lobes, speed_rpm: float, depth: float) -> OperatingPoint:
    """Return an operating point in lobes, at the nearest one of their spindle speeds.

    Parameters
    ----------
    lobes : Lobes
        Limit of the depth of cut over spindle speed.
    speed_rpm : float
        Spindle speed in rpm.
    depth : float
        Depth of cut in m.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.stability import Milling, TipModes, operating_point, stability_lobes
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    >>> f = np.arange(800.0, 1200.0, 0.1)
    >>> lobes = stability_lobes(
    ...     Milling(teeth=2, k_t=6e8, k_n=2e8), f, tip.receptance(f), speeds_rpm=np.arange(4000.0, 30000.0, 20.0)
    ... )
    >>> str(operating_point(lobes, 10000.0, 0.2e-3))
    '10000 rpm, 0.200 mm: stable; limit 0.307 mm, chatter at 930 Hz'
    """
    index = int(np.argmin(np.abs(lobes.speeds_rpm - speed_rpm)))
    band = None
    if lobes.lower is not None and lobes.upper is not None:
        band = (float(lobes.lower[index]), float(lobes.upper[index]))
    return OperatingPoint(
        speed_rpm=float(lobes.speeds_rpm[index]),
        depth=depth,
        limit=float(lobes.depth[index]),
        band=band,
        probability=None if lobes.draws is None else float(lobes.stable_probability(depth)[index]),
        chatter_hz=float(lobes.chatter_hz[index]),
    )


def top_of(lobes: Lobes) -> float:
    """Return the upper end of an axis of the depth in mm, such that high lobes do not compress the others."""
    finite = np.isfinite(lobes.depth)
    if not finite.any():
        return 1.0
    highest = lobes.upper if lobes.upper is not None else lobes.depth
    largest = np.max(highest[np.isfinite(highest)], initial=float(lobes.depth[finite].max()))
    return float(1e3 * min(1.1 * largest, _HIGHEST * lobes.depth[finite].min()))
