"""All modes of a band at once: poles common to every entry, fitted by least squares."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.modal._conclusion import conclude
from receptance.modal._lines import Lines, lines_of
from receptance.modal._polynomials import of_parts, referenced, stabilisation, stable
from receptance.modal._selection import Scatter, Search, refined, weights_of
from receptance.modal.modal_fit import ModalFit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.frf import FRF

__all__ = ["fit_modes"]

Background = Literal["both", "above", "below", "none"]
_TERMS: dict[Background, tuple[int, ...]] = {
    "both": (-2, 0),
    "above": (0,),
    "below": (-2,),
    "none": (),
}
_MANY = 100
"""Most modes that are looked for where their number is not given."""
_PEAKS = 40
"""Most peaks that are candidates."""
_FEW_ORDERS = 10
"""Fewer orders do not show which candidates are stable."""
_LINES = 16000
"""Modes are looked for on about so many lines at most; the last fit takes all."""


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
) -> ModalFit:
    """Poles, damping and residues of all modes in a band, common to all entries of an FRF, with standard errors.

    Candidates for poles are those that several orders of the poly-reference least-squares complex frequency estimator
    (p-LSCF) agree on, over the whole band and over parts of it, and the peaks. Modes are added one by one, the
    candidate that explains most first, and after each one all poles are fitted again by nonlinear least squares on the
    complex lines; the residues are solved for at each step (variable projection), and every pole stays in its part of
    the complex plane. Poles outside the band are fitted as well where they lower the misfit by more than their
    parameters cost: near a band's end a constant does not represent them, and the modes in the band would be biased.
    The last fit is the maximum-likelihood estimate for Gaussian noise with the lines' own weights: it has no bias from
    the polynomials, its scatter reaches the Cramer-Rao bound, and its derivative gives the standard errors. Under an
    exponential window the lines are complex and the poles come out without it.

    Parameters
    ----------
    frf : FRF
        Any number of responses and excitations, in any form.
    modes : int or sequence of float, optional
        How many modes, or near which frequencies in Hz. By default as many as lower the misfit by more than
        their parameters cost (Bayesian information criterion) and are at least a tenth of a half-power band apart.
        With very little noise any misfit of the model is then significant (a mode that moved between two hits is taken
        for two): give the number where you know it. Near given frequencies means within 3 % or five lines; other modes
        in the band are then fitted as background.
    low_hz, high_hz : float, optional
        The band. Only usable lines inside are fitted; a band with a few half-power bands around its modes is enough.
    background : {"both", "above", "below", "none"}, optional
        Where modes outside the band are. Those far above are a constant receptance, those far below one over s
        squared, each with a complex coefficient per entry; of those near the band up to two on each side are poles.
    scatter : {"absolute", "relative"}, optional
        Where the FRF states no variance: whether noise is of one size on all lines of an entry, or in proportion to
        the magnitude. Its size is taken from the residuals, for each entry.
    order : int, optional
        Highest order of the polynomials; lowered where the band has few lines.
    highest_damping : float, optional
        A pole with a higher damping ratio is not a mode.

    Returns
    -------
    ModalFit
        Standard errors are larger than the stated variance says where the residuals are, or where those of
        neighbouring lines are correlated; a note then says so.

    Warns
    -----
    ReceptanceWarning
        Fewer modes than asked for, a fit that did not converge, or a damping that is not above zero.

    Raises
    ------
    TypeError, ValueError
        Unusable settings, too few lines for the modes asked for, or no mode at all.

    References
    ----------
    p-LSCF: Verboven, Ph. D. thesis, Vrije Universiteit Brussel 2002; Guillaume et al., IMAC 21 (2003). Variable
    projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; Kaufman, BIT 15 (1975) 49. Number of modes:
    Schwarz, Ann. Stat. 6 (1978) 461. Entries that disagree: Liang and Zeger, Biometrika 73 (1986) 13.

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
    >>> found = fit_modes(FRF(frequency_hz=f, values=h + noise[0] + 1j * noise[1]), 2)
    >>> [f"{n:.1f} Hz, {100 * z:.1f} %" for n, z in zip(found.frequency_hz, found.damping_ratio)]
    ['200.0 Hz, 1.0 %', '202.0 Hz, 1.0 %']
    """
    owner = "fit_modes"
    if background not in get_args(Background):
        raise ValueError(f"{owner}: background is {background!r}, expected one of {', '.join(get_args(Background))}")
    if scatter not in get_args(Scatter):
        raise ValueError(f"{owner}: scatter is {scatter!r}, expected one of {', '.join(get_args(Scatter))}")
    highest = _checks.positive(owner, "highest_damping", highest_damping)
    wanted = _wanted(owner, modes)
    _whole(owner, "order", order)
    terms = _TERMS[background]
    lines = lines_of(owner, frf, low_hz, high_hz, 4)
    count = wanted if isinstance(wanted, int) else 1 if wanted is None else len(wanted)
    # Each line of an entry gives two numbers; a mode takes two for the pole, and two for the residue of each entry.
    entries = lines.values.shape[1]
    most = (2 * lines.values.size - 2 * len(terms) * entries - 1) // (2 + 2 * entries)
    if count > most:
        raise ValueError(
            f"{owner}: {count} modes in {lines.frequency_hz.size} lines between {lines.frequency_hz[0]:g} and "
            f"{lines.frequency_hz[-1]:g} Hz: there are lines for at most {max(most, 0)}"
        )
    if wanted is not None and not isinstance(wanted, int):
        _inside(owner, wanted, lines)

    thin = lines.thinned(_LINES)
    shape = np.asarray(lines.frf.values).shape
    values, weights = referenced(lines.values.reshape(shape), weights_of(lines, scatter, None).reshape(shape))
    highest_order = min(order, lines.frequency_hz.size // 2 - 1)
    orders = stabilisation(lines.frequency_hz, values, weights, highest_order)
    found = [stable(orders), *of_parts(lines.frequency_hz, values, weights), _at_peaks(lines)]
    if wanted is not None or highest_order < _FEW_ORDERS:
        found += reversed(orders)
    search = Search(thin, terms, scatter, _candidates(found, lines, highest), highest, wanted, min(_MANY, most))
    poles, fit = refined(lines, terms, scatter, search.poles(), highest)
    poles = search.assigned(poles)
    if not np.any(poles.role >= 0):
        raise ValueError(
            f"{owner}: no mode between {lines.frequency_hz[0]:g} and {lines.frequency_hz[-1]:g} Hz stands out of the "
            "scatter; give the frequencies as modes, or another band"
        )
    result, aloud = conclude(fit, poles.role >= 0, lines, terms, scatter, orders, wanted)
    for text in aloud:
        warnings.warn(f"{owner}: {text}", ReceptanceWarning, stacklevel=2)
    return result


def _wanted(owner: str, modes: Any) -> int | tuple[float, ...] | None:
    if modes is None:
        return None
    if isinstance(modes, (int, np.integer)) and not isinstance(modes, bool):
        return _whole(owner, "modes", modes)
    if isinstance(modes, (bool, str, float)):
        raise TypeError(f"{owner}: modes is {modes!r}, expected how many or a list of frequencies in Hz")
    found = tuple(_checks.positive(owner, f"modes[{index}]", value, unit="Hz") for index, value in enumerate(modes))
    if not found:
        raise ValueError(f"{owner}: modes is empty, expected at least one frequency in Hz")
    if any(second <= first for first, second in itertools.pairwise(found)):
        raise ValueError(f"{owner}: modes is {list(found)}, expected ascending frequencies in Hz")
    return found


def _inside(owner: str, wanted: tuple[float, ...], lines: Lines) -> None:
    low, high = lines.frequency_hz[0], lines.frequency_hz[-1]
    for index, value in enumerate(wanted):
        if not low < value < high:
            raise ValueError(f"{owner}: modes[{index}] is {value:g} Hz, outside the lines from {low:g} to {high:g} Hz")


def _whole(owner: str, name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise ValueError(f"{owner}: {name} is {value!r}, expected a whole number of at least 1")
    return int(value)


def _candidates(found: list[NDArray[np.complex128]], lines: Lines, highest_damping: float) -> NDArray[np.complex128]:
    """Poles in rad/s from apparent ones in Hz, the first of those that are nearly the same."""
    f = lines.frequency_hz
    every = np.concatenate(found)
    every = every[(every.imag <= highest_damping * every.real) & (every.real > f[0]) & (every.real < f[-1])]
    kept: list[int] = []
    left = np.ones(every.size, dtype=bool)
    for index, pole in enumerate(every):
        if left[index]:
            kept.append(index)
            left &= np.abs(every - pole) > 0.1 * np.maximum(every.imag, pole.imag)
    return np.asarray(2j * np.pi * every[kept] + lines.frf.decay_rate)


def _at_peaks(lines: Lines) -> NDArray[np.complex128]:
    """Complex frequencies in Hz of the clearest peaks of all entries' mobilities together, as the lines show them."""
    from scipy.signal import find_peaks, peak_prominences

    f = lines.frequency_hz
    each = np.abs(lines.receptance * f[:, None]) ** 2
    level = each.mean(axis=0)
    power = np.sum(each[:, level > 0.0] / level[level > 0.0], axis=1)
    # A line of zeros is no place for a peak, nor for a logarithm.
    power = np.maximum(power, 1e-30)
    peaks, _ = find_peaks(power)
    height = np.log(power)
    peaks = peaks[np.argsort(-peak_prominences(height, peaks)[0])[:_PEAKS]]
    # One mode's inverse power is a parabola: a + b x + c x^2 through the peak and its neighbours.
    left, right = f[peaks - 1] - f[peaks], f[peaks + 1] - f[peaks]
    below, above = 1.0 / power[peaks - 1] - 1.0 / power[peaks], 1.0 / power[peaks + 1] - 1.0 / power[peaks]
    c = (above / right - below / left) / (right - left)
    b = below / left - c * left
    shift = -0.5 * b / c
    width = np.sqrt(np.maximum(1.0 / power[peaks] / c - shift**2, (0.1 * (right - left)) ** 2))
    return np.asarray(f[peaks] + shift + 1j * width)
