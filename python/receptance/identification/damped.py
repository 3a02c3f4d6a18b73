"""Complex eigenfrequencies of assemblies, and their derivatives: natural frequencies and damping ratios.

A receptance H has a pole at each, w = |w| (sqrt(1 - zeta^2) + i zeta) with exp(iwt). Newton's method on 1 / H finds it,
w <- w + H / (dH/dw), and from 1 / H = 0 follows dw/da = -(dH/da) / (dH/dw). Both come from one call of the model on one
complex line. H is that at the free end of the first part, which no mode leaves at rest.

Each pole is followed from the undamped natural frequency while the damping grows from nothing to what it is, in one
step where the derivative by the damping confirms that this is the same mode, else in as many as that takes.
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
"""Relative distance in one step at which it is another mode, or none."""
_DAMPING = ("c_y", "c_theta", "c_ytheta", "loss_factor")
_BENT, _STILL = 0.5, 1e-4
"""How far a step may be from straight: as a share of its length, and of the frequency."""
_SHORTEST = 1e-4
"""Share of the damping that a step is not shorter than."""
_SAME = 1e-7
"""Relative distance within which two eigenfrequencies are one."""


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
        A mode that cannot be followed to its damping, because it ceases to oscillate or meets another one.

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
    path = _Path(assembly, addresses)
    found, slopes = [], []
    for undamped in near_hz:
        pole, slope = path.follow(float(undamped))
        found.append(pole)
        slopes.append(slope)
    poles = np.array(found, dtype=np.complex128)
    for index, pole in enumerate(poles):
        if np.any(np.abs(poles[:index] - pole) <= _SAME * abs(pole)):
            raise ReceptanceError(f"damping moves the mode at {near_hz[index]:g} Hz to where another one is")
    return poles, np.reshape(slopes, (len(found), len(addresses)))


class _Path:
    """Complex eigenfrequencies of an assembly whose damping is multiplied by a share from 0 to 1."""

    def __init__(self, assembly: Assembly, addresses: Sequence[str]) -> None:
        self._assembly = assembly
        self._addresses = list(addresses)
        own = {name: assembly.get(name) for name in assembly.parameters if name.rsplit(".", 1)[-1] in _DAMPING}
        self._damping = {name: value for name, value in own.items() if value}
        extra, weights = frequency_weights(assembly)
        by_frequency = dict(zip(extra, weights.tolist(), strict=True))
        self._names = list(by_frequency | self._damping)
        self._by_frequency = np.array([by_frequency.get(name, 0.0) for name in self._names])
        self._by_share = np.array([self._damping.get(name, 0.0) for name in self._names])
        self._lossy = np.array([name in self._damping for name in self._names])
        # Slip changes the stiffness as well; without it the modes are not the undamped ones.
        self._direct = any(name.endswith(".slip_y") for name in assembly.parameters)

    def follow(self, undamped: float) -> tuple[complex, NDArray[np.complex128]]:
        """Return the eigenfrequency that an undamped one becomes, and its derivatives by the addresses."""
        place, share, step = complex(undamped), 0.0, 1.0
        while True:
            target = min(1.0, share + step)
            found = self._newton(place, target)
            if found is not None:
                pole, slopes, by_share = found
                # The way back with the slope at the new place leads to the old one, unless this is another mode.
                off = abs(pole - by_share * (target - share) - place)
                if self._direct or off <= _BENT * abs(pole - place) + _STILL * abs(pole):
                    if target >= 1.0:
                        return pole, slopes
                    place, share, step = pole, target, 2.0 * step
                    continue
            step *= 0.5
            if step < _SHORTEST or self._direct:
                raise ReceptanceError(f"damping moves the mode at {undamped:g} Hz further than it can be followed")

    def _newton(self, line: complex, share: float) -> tuple[complex, NDArray[np.complex128], complex] | None:
        """Return an eigenfrequency near a line, its derivatives by the addresses and by the share."""
        if share < 1.0:
            assembly = self._assembly.replace({name: share * value for name, value in self._damping.items()})
        else:
            assembly = self._assembly
        # Frequency enters dashpots as w c, so that their share is one of their weight as well.
        by_frequency = self._by_frequency * np.where(self._lossy, share, 1.0)
        count = len(self._addresses)
        start = line
        for _ in range(_STEPS):
            h, dh = assembly.derivatives([line], [*self._addresses, *self._names], threads=1)
            by_line = (dh[0, count:] @ by_frequency) / line
            step = h[0] / by_line
            if not np.isfinite(step):
                return None
            line += step
            if abs(line - start) > _FARTHEST * abs(start) or line.real <= 0.0:
                return None
            if abs(step) <= _SETTLED * abs(line):
                slopes = -dh[0] / by_line
                return line, slopes[:count], complex(slopes[count:] @ self._by_share)
        return None
