"""Global modal fit: all modes of a band with poles common to all entries, from p-LSCF candidates by least squares."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance._peaks import local_maxima
from receptance.errors import warn_user
from receptance.frf import FRF
from receptance.modal._lines import Lines, select_lines
from receptance.modal._selection import ModeSearch, Scatter, refine, weights_of
from receptance.modal.modal_fit import ModalFit, make_modal_fit

Background = Literal["both", "above", "below", "none"]
_TERMS: dict[Background, tuple[int, ...]] = {
    "both": (-2, 0),
    "above": (0,),
    "below": (-2,),
    "none": (),
}
_MAX_MODES = 100
"""Most modes searched for if their number is not given."""
_PEAKS = 40
"""Most peaks used as candidates."""
_MIN_STABLE_ORDER = 10
"""Least order for a selection of stable candidates."""
_MAX_SEARCH_LINES = 16000
"""Most lines used for the search of modes; the last fit uses all lines."""


def fit_modes(
    frf: FRF,
    modes: int | Sequence[float] | None = None,
    *,
    low_hz: float | None = None,
    high_hz: float | None = None,
    background: Background = "both",
    scatter: Scatter = "absolute",
    order: int = 30,
    highest_damping: float = 0.2,
    progress: Callable[[str], None] | None = None,
) -> ModalFit:
    """Fit poles, damping and residues of all modes in a band, common to all entries of an FRF, with standard errors.

    Candidates for poles are the peaks and the stable poles of the poly-reference least-squares complex frequency
    estimator (p-LSCF) over the whole band and over parts of it. Modes are added one by one, beginning with the
    candidate that reduces the misfit most. After each addition all poles are fitted by nonlinear least squares on the
    complex lines, with the residues solved for at each step (variable projection) and every pole within bounds. Poles
    outside the band are added if they reduce the misfit by more than the penalty of their parameters, because a
    constant does not represent modes close to the band and would bias those within. The last fit is the
    maximum-likelihood estimate for Gaussian noise with the weights of the lines: it is free of the bias of the
    polynomials, attains the Cramer-Rao bound, and its derivative gives the standard errors. Under an exponential window
    the lines are complex, and the poles do not contain the window.

    Parameters
    ----------
    frf : FRF
        Any number of responses and excitations, in any form.
    modes : int or sequence of float, optional
        Number of modes, or their approximate frequencies in Hz (within 3 % or five lines; further modes in the band
        are then fitted as background). By default as many as reduce the misfit by more than the penalty of the Bayesian
        information criterion and are at least a tenth of a half-power band apart. With very little noise any error of
        the model is significant (a mode that changed between hits is taken for two): give the number if it is known.
    low_hz, high_hz : float, optional
        The band, of which the usable lines are fitted; a few half-power bands around the modes are sufficient.
    background : {"both", "above", "below", "none"}, optional
        Modes outside the band. Those far above are represented by a constant receptance, those far below by 1 / s^2,
        each with a complex coefficient per entry; up to two on each side near the band by poles.
    scatter : {"absolute", "relative"}, optional
        For FRFs without variance: whether the noise is equal on all lines of an entry, or proportional to the
        magnitude. Its size is estimated from the residuals of each entry.
    order : int, optional
        Highest order of the polynomials; reduced for few lines.
    highest_damping : float, optional
        Largest damping ratio of a mode.
    progress : callable, optional
        Called with a progress message.

    Returns
    -------
    ModalFit
        Modes with standard errors. These are enlarged, with a note, if the residuals are larger than stated by the
        variance, or correlated between neighbouring lines.

    Warns
    -----
    ReceptanceWarning
        Fewer modes than requested, a fit that did not converge, or a damping ratio that is not positive.

    Raises
    ------
    TypeError, ValueError
        Invalid settings, too few lines for the requested modes, or no mode found.

    References
    ----------
    p-LSCF: Verboven, Ph. D. thesis, Vrije Universiteit Brussel 2002; Guillaume et al., IMAC 21 (2003). Variable
    projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; Kaufman, BIT 15 (1975) 49. Number of modes:
    Schwarz, Ann. Stat. 6 (1978) 461. Inconsistent entries: Liang and Zeger, Biometrika 73 (1986) 13.

    Examples
    --------
    Two modes 2 Hz apart, each with a half-power band of 4 Hz:

    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.modal import fit_modes
    >>> f = np.arange(150.0, 250.0, 0.5)
    >>> s = 2j * np.pi * f
    >>> h = sum(c / (s**2 + 4 * np.pi * 0.01 * n * s + (2 * np.pi * n) ** 2) for n, c in [(200.0, 1.0), (202.0, -0.7)])
    >>> noise = np.random.default_rng(1).normal(size=(2, f.size)) * 1e-3 * np.abs(h).max()
    >>> fit = fit_modes(FRF(frequency_hz=f, values=h + noise[0] + 1j * noise[1]), 2)
    >>> [f"{n:.1f} Hz, {100 * z:.1f} %" for n, z in zip(fit.frequency_hz, fit.damping_ratio)]
    ['200.0 Hz, 1.0 %', '202.0 Hz, 1.0 %']
    """
    owner = "fit_modes"
    _checks.one_of(owner, "background", background, Background)
    _checks.one_of(owner, "scatter", scatter, Scatter)
    highest_damping = _checks.positive(owner, "highest_damping", highest_damping)
    requested = _checked_modes(owner, modes)
    _checks.whole_number(owner, "order", order)
    terms = _TERMS[background]
    lines = select_lines(owner, frf, low_hz, high_hz, 4)
    count = requested if isinstance(requested, int) else 1 if requested is None else len(requested)
    # Each line of an entry has two numbers; a mode has two for the pole, and two for the residue of each entry.
    entries = lines.values.shape[1]
    most = (2 * lines.values.size - 2 * len(terms) * entries - 1) // (2 + 2 * entries)
    if count > most:
        raise ValueError(
            f"{owner}: {count} modes in {lines.frequency_hz.size} lines between {lines.frequency_hz[0]:g} and "
            f"{lines.frequency_hz[-1]:g} Hz: the lines suffice for at most {max(most, 0)}"
        )
    low, high = lines.frequency_hz[0], lines.frequency_hz[-1]
    for index, value in enumerate(requested if isinstance(requested, tuple) else ()):
        if not low < value < high:
            raise ValueError(f"{owner}: modes[{index}] is {value:g} Hz, outside the lines from {low:g} to {high:g} Hz")

    thin = lines.thinned(_MAX_SEARCH_LINES)
    shape = np.asarray(lines.frf.values).shape
    values, weights = reduce_references(lines.values.reshape(shape), weights_of(lines, scatter, None).reshape(shape))
    highest_order = min(order, lines.frequency_hz.size // 2 - 1)
    orders = stabilisation(lines.frequency_hz, values, weights, highest_order)
    poles_hz = [stable_poles(orders), *poles_of_bands(lines.frequency_hz, values, weights), _poles_at_peaks(lines)]
    if requested is not None or highest_order < _MIN_STABLE_ORDER:
        poles_hz += reversed(orders)
    candidates = _candidates(np.concatenate(poles_hz), lines, highest_damping)
    report = progress or (lambda _: None)
    most = min(_MAX_MODES, most)
    search = ModeSearch(thin, terms, scatter, candidates, highest_damping, requested, most, report)
    poles, fit = refine(lines, terms, scatter, search.poles(), highest_damping)
    poles = search.assigned(poles)
    if not np.any(poles.role >= 0):
        raise ValueError(
            f"{owner}: no mode between {lines.frequency_hz[0]:g} and {lines.frequency_hz[-1]:g} Hz exceeds the "
            "scatter; give the frequencies as modes, or another band"
        )
    result, warned = make_modal_fit(fit, poles.role >= 0, lines, terms, scatter, orders, requested)
    for text in warned:
        warn_user(f"{owner}: {text}")
    return result


def _checked_modes(owner: str, modes: Any) -> int | tuple[float, ...] | None:
    if modes is None:
        return None
    if isinstance(modes, (int, np.integer)) and not isinstance(modes, bool):
        return _checks.whole_number(owner, "modes", modes)
    if isinstance(modes, (bool, str, float)):
        raise TypeError(f"{owner}: modes is {modes!r}, expected their number or a list of frequencies in Hz")
    frequencies = tuple(
        _checks.positive(owner, f"modes[{index}]", value, unit="Hz") for index, value in enumerate(modes)
    )
    if not frequencies:
        raise ValueError(f"{owner}: modes is empty, expected at least one frequency in Hz")
    if any(second <= first for first, second in itertools.pairwise(frequencies)):
        raise ValueError(f"{owner}: modes is {list(frequencies)}, expected ascending frequencies in Hz")
    return frequencies


def _candidates(poles_hz: NDArray[np.complex128], lines: Lines, highest_damping: float) -> NDArray[np.complex128]:
    """Return poles in rad/s from those in Hz on the real lines, without near duplicates."""
    f = lines.frequency_hz
    inside = (poles_hz.real > f[0]) & (poles_hz.real < f[-1])
    poles_hz = poles_hz[inside & (poles_hz.imag <= highest_damping * poles_hz.real)]
    kept: list[int] = []
    distinct = np.ones(poles_hz.size, dtype=bool)
    for index, pole in enumerate(poles_hz):
        if distinct[index]:
            kept.append(index)
            distinct &= np.abs(poles_hz - pole) > 0.1 * np.maximum(poles_hz.imag, pole.imag)
    return np.asarray(2j * np.pi * poles_hz[kept] + lines.frf.decay_rate)


def _poles_at_peaks(lines: Lines) -> NDArray[np.complex128]:
    """Return complex frequencies in Hz of the most prominent peaks in the combined mobility of all entries."""
    f = lines.frequency_hz
    powers = np.abs(lines.receptance * f[:, None]) ** 2
    level = powers.mean(axis=0)
    power = np.sum(powers[:, level > 0.0] / level[level > 0.0], axis=1)
    # The logarithm of a line of zeros is limited.
    power = np.maximum(power, 1e-30)
    peaks, prominences = local_maxima(np.log(power))
    peaks = peaks[np.argsort(-prominences)[:_PEAKS]]
    # The inverse power of one mode is a parabola: a + b x + c x^2 through the peak and its neighbours.
    left, right = f[peaks - 1] - f[peaks], f[peaks + 1] - f[peaks]
    below, above = 1.0 / power[peaks - 1] - 1.0 / power[peaks], 1.0 / power[peaks + 1] - 1.0 / power[peaks]
    c = (above / right - below / left) / (right - left)
    b = below / left - c * left
    shift = -0.5 * b / c
    width = np.sqrt(np.maximum(1.0 / power[peaks] / c - shift**2, (0.1 * (right - left)) ** 2))
    return np.asarray(f[peaks] + shift + 1j * width)


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

    The values are an FRF `(n, n_out, n_in)` in any form on real lines `(n,)` in any spacing, with few excitations (see
    `reduce_references`), the weights `(n, n_out)`. Returned are, for each order from 1, the poles in the upper
    half-plane: their real part is the damped natural frequency, their imaginary part the decay rate over 2 pi,
    including that of a window.
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

    Values and weights `(n, n_out, n_in)` are transposed if there are more excitations than responses, which have the
    same poles.
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
