"""What no model of noise covers: a floor under the standard deviations of a measured receptance.

Every line has it as an independent error: a relative part, and one that a jitter of frequency makes through the slope
of the receptance, sd^2 = relative^2 + (frequency |d ln H / d ln f|)^2. Without it the lines around resonances decide
everything, and errors of the model far below those of any measurement look like effects.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Floor"]

_WIDEST = 12
"""Lines to each side from which a slope is taken, at most."""
_QUIET = 0.2
"""Share of a line's noise that the noise of its slope may add."""


@dataclass(frozen=True, kw_only=True)
class Floor:
    """What no model of noise covers, for `MeasuredFRF.from_frf`.

    Parameters
    ----------
    relative : float, optional
        Standard deviation of the real and of the imaginary part of the logarithm, on every line.
    frequency : float, optional
        Standard deviation of the frequency of a line, as a share of it.

    Raises
    ------
    TypeError, ValueError
        Numbers below zero.

    Examples
    --------
    >>> from receptance.identification import Floor
    >>> print(Floor())
    0.3 % of the receptance and 0.01 % of frequency
    """

    relative: float = 0.003
    frequency: float = 1e-4

    def __post_init__(self) -> None:
        for name in ("relative", "frequency"):
            object.__setattr__(self, name, _checks.not_negative("Floor", name, getattr(self, name)))

    def __bool__(self) -> bool:
        return self.relative > 0.0 or self.frequency > 0.0

    def __str__(self) -> str:
        if not self.frequency:
            return f"{self.relative:g}"
        return f"{100.0 * self.relative:g} % of the receptance and {100.0 * self.frequency:g} % of frequency"

    def variance(
        self,
        frequency_hz: NDArray[np.float64],
        receptance: NDArray[np.complex128],
        noise: NDArray[np.float64] | None = None,
    ) -> NDArray[np.float64]:
        """Return the variance `(n,)` of real and imaginary part, each, of the logarithm.

        `noise` is the variance that noise has made. The slope is measured, and noise adds to it: it is taken over as
        many lines as keep that small, and what noise is expected to add is subtracted.
        """
        constant = np.full(frequency_hz.shape, self.relative**2)
        if not self.frequency or frequency_hz.size < 3:
            return constant
        return constant + self.frequency**2 * _slope_squared(frequency_hz, receptance, noise, self.frequency)


def _slope_squared(
    lines: NDArray[np.float64], values: NDArray[np.complex128], noise: NDArray[np.float64] | None, frequency: float
) -> NDArray[np.float64]:
    """Return |d ln H / d ln f|^2 on every line, from the straight line through it and its neighbours."""
    n = lines.size
    x = np.log(lines)
    # Steps of the logarithm add up to it without the jumps of a phase, whatever the distance of the lines.
    y = np.concatenate([[0.0], np.cumsum(np.log(values[1:] / values[:-1]))])
    own = np.zeros(n) if noise is None else noise
    result = np.zeros(n)
    open_ = np.ones(n, dtype=np.bool_)
    at = np.arange(n)
    for half in range(1, min(_WIDEST, (n - 1) // 2) + 1):
        near = np.clip(at[:, None] + np.arange(-half, half + 1), 0, n - 1)
        dx = x[near] - x[near].mean(axis=1, keepdims=True)
        power = np.sum(dx**2, axis=1)
        slope = np.sum(dx * y[near], axis=1) / power
        added = 2.0 * own / power
        quiet = frequency**2 * added <= _QUIET**2 * 2.0 * own
        last = half == min(_WIDEST, (n - 1) // 2)
        done = open_ & (quiet | last)
        result[done] = np.maximum(np.abs(slope) ** 2 - added, 0.0)[done]
        open_ &= ~done
        if not open_.any():
            break
    return result
