"""Candidates for poles: poly-reference least-squares complex frequency (p-LSCF), and which of them are stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SHARE = 0.9
"""Share of the unit circle that the band is laid on; the rest keeps its two ends apart."""
_REFERENCES = 3
"""Most columns of the denominator; more are combined to these by their singular vectors."""
_NEAR = 0.3
"""Of its decay rate: how far a pole may be from one of the next lower order and count as the same."""
_ORDERS = 3
"""A candidate is stable when so many orders have it."""
_PART_LINES, _PART_ORDER = 120, 20
"""Parts of the band have no fewer lines than this, and polynomials of no higher order."""


def stabilisation(
    frequency_hz: NDArray[np.float64],
    values: NDArray[np.complex128],
    weights: NDArray[np.float64],
    order: int,
) -> list[NDArray[np.complex128]]:
    """Return the poles of the denominators of every order up to one, as complex frequencies in Hz.

    The band is laid on the unit circle, z = exp(i angle). H A = B, with polynomials in 1/z with complex coefficients:
    B is a row for each response, A a square matrix of the size of the number of excitations. With one excitation that
    is the common denominator (Verboven, Ph. D. thesis, Vrije Universiteit Brussel 2002, sect. 5.3; Guillaume et al.,
    IMAC 21, 2003). The coefficient of the highest order is the one that is fixed: poles that only describe noise then
    tend to be unstable, and go.

    Products of two polynomials depend on the difference of their powers only, so that all normal equations come from
    sums over the lines for 2 `order` + 1 differences: time grows with the lines times the entries.

    Parameters
    ----------
    frequency_hz : ndarray
        `(n,)` real lines, in any spacing.
    values : ndarray
        `(n, n_out, n_in)` the FRF in any form; few excitations, see `referenced`.
    weights : ndarray
        `(n, n_out)`, what each line of each response is multiplied by.
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
    references, steps = values.shape[2], order + 1
    turns = np.exp(-1j * rate * (frequency_hz - low)[:, None] * np.arange(-order, order + 1))
    difference = np.arange(steps) - np.arange(steps)[:, None] + order
    normal = np.zeros((steps, references, steps, references), dtype=np.complex128)
    for response in range(values.shape[1]):
        square = weights[:, response, None] ** 2
        own = values[:, response]
        weighted = square * own
        products = own.conj()[:, :, None] * weighted[:, None, :]
        sums = turns.T @ np.concatenate([square, weighted, products.reshape(len(own), -1)], axis=1)
        numerator = sums[difference, 0]
        mixed = sums[difference, 1 : 1 + references].reshape(steps, -1)
        known = np.linalg.lstsq(numerator, mixed, rcond=1e-14)[0]
        both = sums[difference, 1 + references :].reshape(steps, steps, references, references)
        explained = (mixed.conj().T @ known).reshape(steps, references, steps, references)
        normal += both.transpose(0, 2, 1, 3) - explained
    flat = normal.reshape(steps * references, -1)
    found = []
    for size in range(1, steps):
        last = size * references
        below = np.linalg.lstsq(flat[:last, :last], -flat[:last, last : last + references], rcond=None)[0]
        # The companion matrix of A_0 + A_1 z + ... + z^size.
        companion = np.zeros((last, last), dtype=np.complex128)
        companion[:-references, references:] = np.eye(last - references)
        for power in range(size):
            part = slice(power * references, (power + 1) * references)
            companion[-references:, part] = -below[part]
        roots = np.linalg.eigvals(companion)
        roots = roots[np.abs(roots) > 1e-12]
        # 1/z = exp(-i angle) at the pole, with the angle between 0 and a full turn.
        angle = 1j * np.log(roots)
        angle = np.mod(angle.real, 2.0 * np.pi) + 1j * angle.imag
        poles = low + angle / rate
        found.append(poles[(poles.imag > 0.0) & (poles.real <= high)])
    return found


def referenced(
    values: NDArray[np.complex128], weights: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Responses by references of an FRF for `stabilisation`, and weights per response.

    Parameters
    ----------
    values : ndarray
        `(n, n_out, n_in)`. By reciprocity of the poles the larger dimension is that of the responses.
    weights : ndarray
        `(n, n_out, n_in)`.
    """
    if values.shape[2] > values.shape[1]:
        values, weights = values.transpose(0, 2, 1), weights.transpose(0, 2, 1)
    # One weight for a row of H A = B.
    common = np.exp(np.mean(np.log(np.maximum(weights, np.finfo(np.float64).tiny)), axis=2))
    if values.shape[2] > _REFERENCES:
        scaled = values * common[:, :, None]
        gram = np.einsum("noi,noj->ij", scaled.conj(), scaled)
        values = values @ np.linalg.eigh(gram)[1][:, -_REFERENCES:]
    return values, common


def stable(orders: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
    """Return the candidates that several orders agree on, each once, as the highest of these orders has it."""
    kept: list[complex] = []
    hits: list[int] = []
    for found, below in zip(orders[:0:-1], orders[-2::-1], strict=True):
        if not below.size:
            continue
        for pole in found[np.min(np.abs(found[:, None] - below), axis=1) <= _NEAR * found.imag]:
            near = np.abs(np.array(kept) - pole) <= _NEAR * pole.imag if kept else np.zeros(0, dtype=bool)
            if near.any():
                hits[int(np.flatnonzero(near)[0])] += 1
            else:
                kept.append(complex(pole))
                hits.append(1)
    return np.array([pole for pole, count in zip(kept, hits, strict=True) if count >= _ORDERS], dtype=np.complex128)


def of_parts(
    frequency_hz: NDArray[np.float64], values: NDArray[np.complex128], weights: NDArray[np.float64]
) -> list[NDArray[np.complex128]]:
    """Return the stable candidates of overlapping parts of the band, each set of parts a quarter as wide.

    One polynomial over a wide band does not see narrow or weakly excited modes; over a part of it, where they are a
    larger share of what there is, it does.
    """
    found = []
    lines = frequency_hz.size // 4
    while lines >= _PART_LINES:
        for first in range(0, frequency_hz.size - lines // 2, lines // 2):
            part = slice(first, min(first + lines, frequency_hz.size))
            poles = stable(stabilisation(frequency_hz[part], values[part], weights[part], _PART_ORDER))
            # What lies at the ends belongs to the next part.
            inside = poles.real - frequency_hz[part][0], frequency_hz[part][-1] - poles.real
            found.append(poles[np.minimum(*inside) > 0.02 * (inside[0] + inside[1])])
        lines //= 4
    return found
