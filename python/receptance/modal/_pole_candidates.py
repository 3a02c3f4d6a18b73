"""Candidates for poles by the poly-reference least-squares complex frequency estimator (p-LSCF)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_CIRCLE_SHARE = 0.9
"""Share of the unit circle onto which the band is mapped; the rest separates its ends."""
_MAX_REFERENCES = 3
"""Most columns of the denominator; further ones are combined by singular vectors."""
_STABLE_DISTANCE = 0.3
"""Largest distance of stable poles of successive orders, relative to the decay rate."""
_MIN_ORDERS = 3
"""Least number of orders of a stable pole."""
_PART_LINES, _PART_ORDER = 120, 20
"""Least number of lines of a part of the band, and its highest order."""


def stabilisation(
    frequency_hz: NDArray[np.float64],
    values: NDArray[np.complex128],
    weights: NDArray[np.float64],
    order: int,
) -> list[NDArray[np.complex128]]:
    """Return the poles of the denominators of all orders up to `order`, as complex frequencies in Hz.

    The band is mapped to the unit circle, z = exp(i angle). H A = B, with polynomials in 1/z with complex coefficients:
    B has a row for each response, A is square with the number of excitations. With one excitation A is the common
    denominator (Verboven, Ph. D. thesis, Vrije Universiteit Brussel 2002, sect. 5.3; Guillaume et al., IMAC 21, 2003).
    The coefficient of the highest order is fixed, so that poles of noise tend to be unstable and are removed.

    Products of two powers depend on their difference only, so that the normal equations follow from sums over the lines
    for 2 `order` + 1 differences: the time is proportional to the lines times the entries.

    Parameters
    ----------
    frequency_hz : ndarray
        `(n,)` real lines, in any spacing.
    values : ndarray
        `(n, n_out, n_in)` FRF in any form with few excitations, see `reduce_references`.
    weights : ndarray
        `(n, n_out)` weight of each line of each response.
    order : int
        The highest order.

    Returns
    -------
    list of ndarray
        For each order from 1, its poles in the upper half-plane: the real part is the damped natural frequency, the
        imaginary part the decay rate over 2 pi, including that of an exponential window.
    """
    low, high = frequency_hz[0], frequency_hz[-1]
    rate = 2.0 * np.pi * _CIRCLE_SHARE / (high - low)
    references, steps = values.shape[2], order + 1
    turns = np.exp(-1j * rate * (frequency_hz - low)[:, None] * np.arange(-order, order + 1))
    difference = np.arange(steps) - np.arange(steps)[:, None] + order
    normal = np.zeros((steps, references, steps, references), dtype=np.complex128)
    for response in range(values.shape[1]):
        square = weights[:, response, None] ** 2
        entries = values[:, response]
        weighted = square * entries
        products = entries.conj()[:, :, None] * weighted[:, None, :]
        sums = turns.T @ np.concatenate([square, weighted, products.reshape(len(entries), -1)], axis=1)
        numerator = sums[difference, 0]
        response_products = sums[difference, 1 : 1 + references].reshape(steps, -1)
        solution = np.linalg.lstsq(numerator, response_products, rcond=1e-14)[0]
        entry_products = sums[difference, 1 + references :].reshape(steps, steps, references, references)
        explained = (response_products.conj().T @ solution).reshape(steps, references, steps, references)
        normal += entry_products.transpose(0, 2, 1, 3) - explained
    flat = normal.reshape(steps * references, -1)
    orders = []
    for size in range(1, steps):
        last = size * references
        coefficients = np.linalg.lstsq(flat[:last, :last], -flat[:last, last : last + references], rcond=None)[0]
        # The companion matrix of A_0 + A_1 z + ... + z^size.
        companion = np.zeros((last, last), dtype=np.complex128)
        companion[:-references, references:] = np.eye(last - references)
        for power in range(size):
            part = slice(power * references, (power + 1) * references)
            companion[-references:, part] = -coefficients[part]
        roots = np.linalg.eigvals(companion)
        roots = roots[np.abs(roots) > 1e-12]
        # 1/z = exp(-i angle) at the pole, with the angle between 0 and a full turn.
        angle = 1j * np.log(roots)
        angle = np.mod(angle.real, 2.0 * np.pi) + 1j * angle.imag
        poles = low + angle / rate
        orders.append(poles[(poles.imag > 0.0) & (poles.real <= high)])
    return orders


def reduce_references(
    values: NDArray[np.complex128], weights: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return responses by references of an FRF for `stabilisation`, and weights per response.

    Parameters
    ----------
    values : ndarray
        `(n, n_out, n_in)`; transposed if there are more excitations than responses, which have the same poles.
    weights : ndarray
        `(n, n_out, n_in)`.
    """
    if values.shape[2] > values.shape[1]:
        values, weights = values.transpose(0, 2, 1), weights.transpose(0, 2, 1)
    # One weight for a row of H A = B.
    common = np.exp(np.mean(np.log(np.maximum(weights, np.finfo(np.float64).tiny)), axis=2))
    if values.shape[2] > _MAX_REFERENCES:
        scaled = values * common[:, :, None]
        gram = np.einsum("noi,noj->ij", scaled.conj(), scaled)
        values = values @ np.linalg.eigh(gram)[1][:, -_MAX_REFERENCES:]
    return values, common


def stable_poles(orders: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Return the poles that occur at several orders, without repetition, from the highest of these orders."""
    kept: list[complex] = []
    counts: list[int] = []
    for poles, lower in zip(orders[:0:-1], orders[-2::-1], strict=True):
        if not lower.size:
            continue
        for pole in poles[np.min(np.abs(poles[:, None] - lower), axis=1) <= _STABLE_DISTANCE * poles.imag]:
            near = np.abs(np.array(kept) - pole) <= _STABLE_DISTANCE * pole.imag if kept else np.zeros(0, dtype=bool)
            if near.any():
                counts[int(np.flatnonzero(near)[0])] += 1
            else:
                kept.append(complex(pole))
                counts.append(1)
    return np.array(
        [pole for pole, count in zip(kept, counts, strict=True) if count >= _MIN_ORDERS], dtype=np.complex128
    )


def poles_of_bands(
    frequency_hz: NDArray[np.float64], values: NDArray[np.complex128], weights: NDArray[np.float64]
) -> list[NDArray[np.complex128]]:
    """Return the stable poles of overlapping parts of the band, with successively a quarter of the width.

    Narrow or weakly excited modes are resolved by a polynomial over a part of the band, but not by one over all of it.
    """
    stable = []
    lines = frequency_hz.size // 4
    while lines >= _PART_LINES:
        for first in range(0, frequency_hz.size - lines // 2, lines // 2):
            part = slice(first, min(first + lines, frequency_hz.size))
            poles = stable_poles(stabilisation(frequency_hz[part], values[part], weights[part], _PART_ORDER))
            # Poles at the ends belong to the next part.
            inside = poles.real - frequency_hz[part][0], frequency_hz[part][-1] - poles.real
            stable.append(poles[np.minimum(*inside) > 0.02 * (inside[0] + inside[1])])
        lines //= 4
    return stable
