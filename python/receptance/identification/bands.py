"""Bands of frequency around the peaks of a measured receptance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.observations import MeasuredFRF

__all__ = ["check_bands", "find_bands", "within"]

Bands = list[tuple[float, float]]


def find_bands(frf: MeasuredFRF, *, width_percent: float = 5.0, prominence: float = 1.0) -> Bands:
    """Bands around the peaks of a measured receptance.

    Parameters
    ----------
    frf : MeasuredFRF
        The measurement.
    width_percent : float, optional
        How far a band reaches to either side of its peak, in percent of the peak's frequency.
    prominence : float, optional
        How far a peak must stand above its surroundings, as natural logarithm of the magnitude; 1 is a factor
        of 2.7.

    Returns
    -------
    list of (float, float)
        Lower and upper end of each band in Hz, ascending; bands that overlap are one.

    Raises
    ------
    ValueError
        No peak.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import MeasuredFRF, find_bands
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> lines = np.linspace(100.0, 8000.0, 400)
    >>> frf = MeasuredFRF(assembly=bar, frequency_hz=lines, receptance=bar.receptance(lines))
    >>> [(round(low), round(high)) for low, high in find_bands(frf)]
    [(2126, 2350), (5625, 6217)]
    """
    from scipy.signal import find_peaks  # slow to import

    width = _checks.positive("find_bands", "width_percent", width_percent, unit="percent")
    if width >= 100.0:
        raise ValueError(f"find_bands: width_percent is {width:g}, expected less than 100")
    least = _checks.positive("find_bands", "prominence", prominence)
    peaks, _ = find_peaks(np.log(np.abs(frf.receptance)), prominence=least)
    if not len(peaks):
        raise ValueError(f"{frf!r} has no peak that stands out by a factor of {np.exp(least):.3g}: give the bands")
    found: Bands = []
    for peak in frf.frequency_hz[peaks].real:
        low, high = float(peak * (1.0 - width / 100.0)), float(peak * (1.0 + width / 100.0))
        if found and low <= found[-1][1]:
            low = found.pop()[0]
        found.append((low, high))
    return found


def check_bands(bands: Sequence[tuple[float, float]]) -> Bands:
    """Return bands as pairs of numbers, or raise."""
    found: Bands = []
    for index, band in enumerate(bands):
        owner = f"bands[{index}]"
        if isinstance(band, (str, int, float)) or len(band) != 2:
            raise ValueError(f"{owner} is {band!r}, expected its lower and upper end in Hz")
        low = _checks.number(owner, "the lower end", band[0], unit="Hz")
        high = _checks.number(owner, "the upper end", band[1], unit="Hz")
        if not 0.0 <= low < high:
            raise ValueError(f"{owner} is {low:g} to {high:g} Hz, expected the lower end first")
        found.append((low, high))
    if not found:
        raise ValueError("bands is empty, expected at least one band")
    return found


def within(frf: MeasuredFRF, bands: Bands) -> NDArray[np.bool_]:
    """Return which lines lie in some band; every band must hold a line of the measurement."""
    chosen = np.zeros(frf.frequency_hz.shape, dtype=np.bool_)
    lines = frf.frequency_hz.real
    for low, high in bands:
        inside = (lines >= low) & (lines <= high)
        if not inside.any():
            raise ValueError(f"no line of {frf!r} lies in the band {low:g} to {high:g} Hz")
        chosen |= inside
    return chosen
