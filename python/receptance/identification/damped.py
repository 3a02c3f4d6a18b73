"""Complex eigenfrequencies of assemblies, and their derivatives: natural frequencies and damping ratios.

A receptance H has a pole at each, w = |w| (sqrt(1 - zeta^2) + i zeta) with exp(iwt). Newton's method on 1 / H finds it
from the undamped natural frequency, w <- w + H / (dH/dw), and from 1 / H = 0 follows dw/da = -(dH/da) / (dH/dw). Both
come from one call of the model on one complex line. H is that at the free end of the first part, which no mode leaves
at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.errors import ReceptanceError
from receptance.identification.factors import frequency_weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["complex_frequencies"]

_STEPS = 30
_SETTLED = 1e-7
"""A step this small, relatively, is the last one; the derivative there is as good."""
_FARTHEST = 0.5
"""Relative distance from the undamped natural frequency at which it is another mode, or none."""


def complex_frequencies(
    assembly: Assembly, near_hz: Sequence[float] | NDArray[np.float64], addresses: Sequence[str] = ()
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return complex eigenfrequencies near undamped natural ones, and their derivatives.

    Parameters
    ----------
    assembly : Assembly
        With its damping.
    near_hz : array_like
        `(m,)` undamped natural frequencies in Hz, from `Assembly.natural_frequencies`.
    addresses : sequence of str, optional
        Parameters to differentiate by.

    Returns
    -------
    frequency_hz : ndarray
        `(m,)` complex: its magnitude is the natural frequency, imaginary part over magnitude the damping ratio.
    derivatives : ndarray
        `(m, p)` complex, in Hz per SI unit.

    Raises
    ------
    ReceptanceError
        A mode that damping has moved so far that it is not found.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import complex_frequencies
    >>> bar = Segment(length=0.2, outer_diameter=0.02, material=replace(STEEL, loss_factor=0.002))
    >>> bar = Assembly([Part([bar], name="bar")])
    >>> found, _ = complex_frequencies(bar, bar.natural_frequencies(5e3))
    >>> round(float(found[0].imag / abs(found[0])), 5)  # half the loss factor
    0.001
    """
    extra, weights = frequency_weights(assembly)
    asked = [*addresses, *extra]
    found: list[complex] = []
    slopes: list[NDArray[np.complex128]] = []
    for undamped in near_hz:
        line = complex(undamped)
        for _ in range(_STEPS):
            h, dh = assembly.derivatives([line], asked, threads=1)
            by_line = (dh[0, len(addresses) :] @ weights) / line
            step = h[0] / by_line
            if not np.isfinite(step):
                raise ReceptanceError(f"the mode at {undamped:g} Hz has no complex eigenfrequency near it")
            line += step
            if abs(line - undamped) > _FARTHEST * undamped or line.real <= 0.0:
                raise ReceptanceError(f"damping moves the mode at {undamped:g} Hz further than it can be followed")
            if abs(step) <= _SETTLED * abs(line):
                found.append(line)
                slopes.append(-dh[0, : len(addresses)] / by_line)
                break
        else:
            raise ReceptanceError(f"the complex eigenfrequency of the mode at {undamped:g} Hz was not found")
    return np.array(found, dtype=np.complex128), np.reshape(slopes, (len(found), len(addresses)))
