"""What a record shows that ends while the structure still rings: resolution coarser than the resonances are wide.

A hit's record that ends at the time e after the hit has the response's transform over [0, e] alone,

    H_e(s) = s^-2 int_0^e a(t) exp(-s t) dt,

with the acceleration a(t) after a unit impulse. It is got from the response A(s) = s^2 H(s) on complex lines: with the
period P > e and a decay s0 the samples A(s0 + i v_j), v_j = (j + 1/2) 2 pi / P, are the Fourier coefficients of
a(t) exp(-s0 t) continued antiperiodically, an error of exp(-s0 P), so that

    s^2 H_e(s) = sum_j A(s0 + i v_j) (exp(z e) - exp(-z b)) / (P z),    z = s0 + i v_j - s,

where the integral begins at -b, in silence, for the sake of what answers at once. Lines above the measured band are
faded out; they are smooth there, and so act at t = 0 alone.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["EarlyEnd"]

ComplexArray = NDArray[np.complex128]
_PERIOD = 1.6
"""Period as a multiple of the longest end."""
_BEFORE = 0.1
"""Where the integral begins before the hit, as a share of the longest end."""
_DECAY = 9.0
"""s0 P: what comes round is below exp(-9)."""
_WHOLE, _TOP = 1.05, 1.35
"""Up to which multiples of the highest line the response counts wholly, and at all."""


class EarlyEnd:
    """From receptances on lines of its own to what records that end early say on the measured lines.

    Parameters
    ----------
    lines_hz : ndarray
        `(n,)` measured lines, complex where a window is stated.
    longest : float
        Longest end in s that will be asked for.
    """

    def __init__(self, lines_hz: NDArray[np.inexact], longest: float) -> None:
        period = _PERIOD * longest
        self._decay = _DECAY / period
        self._before = _BEFORE * longest
        top = float(np.max(lines_hz.real))
        step = 2.0 * np.pi / period
        self._angular = step * (np.arange(int(2.0 * np.pi * _TOP * top / step)) + 0.5)
        share = (self._angular / (2.0 * np.pi * top) - _WHOLE) / (_TOP - _WHOLE)
        self._fading = 0.5 + 0.5 * np.cos(np.pi * np.clip(share, 0.0, 1.0))
        self._stated = 2j * np.pi * lines_hz.astype(np.complex128)
        self._period = period
        self._kernel = _kernel(self._stated.tobytes(), self._angular.size, step, self._decay, period)

    @property
    def lines_hz(self) -> ComplexArray:
        """Complex lines on which the structure is to be evaluated, `(m,)`."""
        return np.asarray((self._angular - 1j * self._decay) / (2.0 * np.pi), dtype=np.complex128)

    def seen(self, receptance: ComplexArray, end: float, rate: float = 0.0) -> ComplexArray:
        """Return what is seen of receptances or of derivatives, `(m,)` or `(m, p)`; `rate` is of one more window."""
        both, poles = self._both(receptance, rate)
        after = np.exp(-self._stated * end)[:, None] * (self._kernel @ (np.exp(poles * end)[:, None] * both))
        before = np.exp(self._stated * self._before)[:, None] * (
            self._kernel @ (np.exp(-poles * self._before)[:, None] * both)
        )
        result: ComplexArray = (after - before) / ((self._stated + rate) ** 2)[:, None]
        return result.reshape(-1, *receptance.shape[1:])

    def slope(self, receptance: ComplexArray, end: float, rate: float = 0.0) -> ComplexArray:
        """Return the derivative of what is seen with respect to the end, `(n,)`."""
        both, poles = self._both(receptance, rate)
        signal = np.sum(np.exp(poles * end) * both[:, 0]) / self._period
        result: ComplexArray = signal * np.exp(-self._stated * end) / (self._stated + rate) ** 2
        return result

    def _both(self, receptance: ComplexArray, rate: float) -> tuple[ComplexArray, ComplexArray]:
        """Return accelerations on lines of both signs, `(2 m, p)`, and s0 + i v of these."""
        own = self._decay + 1j * self._angular
        values = receptance.reshape(own.size, -1) * (self._fading * (own + rate) ** 2)[:, None]
        return np.concatenate([values.conj()[::-1], values]), np.concatenate([own.conj()[::-1], own])


@lru_cache(maxsize=4)
def _kernel(stated: bytes, count: int, step: float, decay: float, period: float) -> ComplexArray:
    """Return 1 / (P z), `(n, 2 m)`; all records with the same lines share it."""
    angular = step * (np.arange(-count, count) + 0.5)
    z = decay + 1j * angular[None, :] - np.frombuffer(stated, dtype=np.complex128)[:, None]
    result: ComplexArray = 1.0 / (period * z)
    result.setflags(write=False)
    return result
