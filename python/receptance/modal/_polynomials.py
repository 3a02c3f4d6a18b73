"""Candidates for poles: least-squares complex frequency (LSCF), one common denominator for all entries."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SHARE = 0.9
"""Share of the unit circle that the band is laid on; the rest keeps its two ends apart."""


def stabilisation(
    frequency_hz: NDArray[np.float64],
    values: NDArray[np.complex128],
    weights: NDArray[np.float64],
    order: int,
) -> list[NDArray[np.complex128]]:
    """Return the poles of the denominators of every order up to one, as complex frequencies in Hz.

    The band is laid on the unit circle, z = exp(i angle), and numerators and denominator are polynomials in 1/z with
    complex coefficients, which keeps the normal equations well-conditioned up to high orders and needs no even
    spacing of the lines (Verboven, Ph. D. thesis, Vrije Universiteit Brussel 2002, sect. 5.3). The coefficient of the
    highest order is the one that is fixed: poles that only describe noise then tend to be unstable, and go.

    Parameters
    ----------
    frequency_hz : ndarray
        `(n,)` real lines.
    values, weights : ndarray
        `(n, m)` the FRF in any form, and what each line of each entry is multiplied by.
    order : int
        The highest order.

    Returns
    -------
    list of ndarray
        For each order from 1 on, its poles in the upper half-plane: the real part is the damped natural frequency in
        the band, the imaginary part the decay rate over 2 pi as the lines show it, an exponential window included.
    """
    low, high = frequency_hz[0], frequency_hz[-1]
    rate = 2.0 * np.pi * _SHARE / (high - low)
    z = np.exp(-1j * rate * (frequency_hz - low)[:, None] * np.arange(order + 1))
    normal = np.zeros((order + 1, order + 1), dtype=np.complex128)
    for entry in range(values.shape[1]):
        w = weights[:, entry][:, None]
        numerator = np.linalg.qr(w * z)[0]
        denominator = w * values[:, entry][:, None] * z
        denominator -= numerator @ (numerator.conj().T @ denominator)
        normal += denominator.conj().T @ denominator
    found = []
    for size in range(1, order + 1):
        below = np.linalg.lstsq(normal[:size, :size], -normal[:size, size], rcond=None)[0]
        roots = np.roots(np.append(below, 1.0)[::-1])
        roots = roots[np.abs(roots) > 0.0]
        # 1/z = exp(-i angle) at the pole, with the angle between 0 and a full turn.
        angle = 1j * np.log(roots)
        angle = np.mod(angle.real, 2.0 * np.pi) + 1j * angle.imag
        poles = low + angle / rate
        found.append(poles[(poles.imag > 0.0) & (poles.real <= high)])
    return found
