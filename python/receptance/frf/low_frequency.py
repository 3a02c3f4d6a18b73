"""Whether the lowest lines of a receptance are noise or drift that was divided by (2 pi f)^2.

A receptance that was measured with an accelerometer has the noise and the drift of the accelerometer in it, divided by
(2 pi f)^2. Where the structure moves less than that, f^2 |H| is about constant or falls with frequency. A structure
that is held is a spring at 0 Hz, so that f^2 |H| rises as f^2 up to its first mode. Above a mode, and where a body
floats, f^2 |H| is about constant as well: there H is real, and negative at a drive point, and does not scatter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LowFrequencyRise", "low_frequency_rise"]

_OCTAVE = 2.0
_HALF_OCTAVE = 2.0**0.5
_LEAST_LINES = 4
"""Of a group: the mean power of four lines of noise is known to a factor of 1.6."""
_SLOPE = 1.0
"""Least power of the frequency that f^2 |H| grows by where stiffness decides: noise has 0, a spring 2."""
_NEAR = 2.0**0.25
"""Within which the magnitude is largest: a peak further up is a mode."""
_SCATTER = 0.1
"""Least share of noise in the power of lines that are noise."""
_REAL = 0.9
"""Least part of the values that is real where inertia decides."""
_CLEAR = 3.0
"""Times of the noise's frequency from which on it is below a tenth of a spring's receptance."""


@dataclass(frozen=True, kw_only=True)
class LowFrequencyRise:
    """Lines at the lower end on which a receptance falls about as 1/f^2.

    Attributes
    ----------
    lowest_hz, highest_hz : float
        First and last of them in Hz.
    factor : float
        By how much the magnitude falls over them.
    noise_share : float
        Share of their power, divided by that of 1/f^4, that differs from line to line: 0 of a smooth curve, 1 of noise.
    """

    lowest_hz: float
    highest_hz: float
    factor: float
    noise_share: float

    @property
    def clear_hz(self) -> float:
        """From where on such noise is about a tenth of the receptance of a spring, to two digits."""
        return float(f"{_CLEAR / _OCTAVE * self.highest_hz:.1e}")

    def __str__(self) -> str:
        return (
            f"from {self.lowest_hz:.4g} to {self.highest_hz:.4g} Hz the receptance falls about as 1/f^2, by a factor "
            f"of {self.factor:.3g}, and is not that of a mass: noise or drift of an accelerometer, divided by "
            "(2 pi f)^2, or a mode at the lowest lines"
        )


def low_frequency_rise(
    frequency_hz: NDArray[Any], receptance: NDArray[np.complex128], *, drive_point: bool
) -> LowFrequencyRise | None:
    """Return the lowest lines on which a receptance falls about as 1/f^2 and is not that of a mass.

    Parameters
    ----------
    frequency_hz : ndarray
        `(n,)` ascending lines in Hz.
    receptance : ndarray
        `(n,)` complex, in m/N or in any other unit.
    drive_point : bool
        Whether response and excitation are at one place: the receptance of a mass is negative there.

    Returns
    -------
    LowFrequencyRise or None
        None if there is nothing like that over an octave at least.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.frf.low_frequency import low_frequency_rise
    >>> f = np.arange(5.0, 1000.0, 1.25)
    >>> held = 1e-7 / (1.0 - (f / 800.0) ** 2 + 0.04j * f / 800.0)
    >>> low_frequency_rise(f, held, drive_point=True) is None
    True
    >>> drift = 2e-4 / f**2 * np.exp(1j * np.random.default_rng(1).uniform(0.0, 6.28, f.size))
    >>> found = low_frequency_rise(f, held + drift, drive_point=True)
    >>> found.lowest_hz, 25.0 < found.highest_hz < 80.0, found.noise_share > 0.5
    (5.0, True, True)
    """
    lines = frequency_hz.real
    known = lines > 0.0
    lines = lines[known]
    acceleration = lines**2 * receptance[known]
    first = _groups(lines)
    if first.size < 3:
        return None
    size = np.diff(np.append(first, lines.size))
    power = np.add.reduceat(np.abs(acceleration) ** 2, first) / size
    # The frequency at which a spring has the mean power of its lines.
    centre = (np.add.reduceat(lines**4, first) / size) ** 0.25
    last = 0
    for i in range(first.size):
        further = np.flatnonzero(centre >= 0.99 * _OCTAVE * centre[i])
        if not further.size or 0.5 * np.log(power[further[0]] / power[i]) >= _SLOPE * np.log(
            centre[further[0]] / centre[i]
        ):
            break
        last = int(further[0])
    if not last:
        return None
    stop = int(first[last] + size[last])
    own = acceleration[:stop]
    highest = max(_LEAST_LINES, int(np.searchsorted(lines, _NEAR * lines[0])))
    if int(np.argmax(np.abs(own) / lines[:stop] ** 2)) >= highest:
        return None
    # The second difference of noise has six times its power, that of a smooth curve next to none.
    share = float(np.mean(np.abs(np.diff(own, 2)) ** 2) / 6.0 / np.mean(np.abs(own) ** 2))
    # The upper half has what follows in it, an antiresonance of a mass and a spring say.
    lower = own[: int(np.searchsorted(lines, lines[stop - 1] / _OCTAVE))]
    real = float(lower.real.sum() / np.abs(lower).sum())
    if share < _SCATTER and (-real if drive_point else abs(real)) > _REAL:
        return None
    fall = np.sqrt(power[0] / power[last]) * (centre[last] / centre[0]) ** 2
    return LowFrequencyRise(
        lowest_hz=float(lines[0]), highest_hz=float(lines[stop - 1]), factor=float(fall), noise_share=min(share, 1.0)
    )


def _groups(lines: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the first line of each group, half an octave wide and of several lines at least; the rest is left out."""
    found, start = [], 0
    while start < lines.size:
        end = max(int(np.searchsorted(lines, _HALF_OCTAVE * lines[start])), start + _LEAST_LINES)
        found.append(start)
        start = end
    return np.array(found, dtype=np.int64)
