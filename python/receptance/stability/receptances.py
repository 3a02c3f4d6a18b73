"""Receptances of the tool tip in x and y as stability takes them: measured ones put together, and draws of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.frf import FRF

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["receptance_draws", "receptance_matrix"]


def receptance_matrix(
    x: FRF | None, y: FRF | None = None, *, xy: FRF | None = None
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return lines and the receptance matrix of the tip in x and y from FRFs measured one by one.

    Parameters
    ----------
    x, y : FRF
        Drive points in the direction of feed and across it; one may be missing, which takes that direction as rigid.
        Any form; one response and one excitation each.
    xy : FRF, optional
        Between the two, taken as equal both ways; zero by default.

    Returns
    -------
    frequency_hz, receptance : ndarray
        `(n,)`, and `(n, 2, 2)` in m/N. Lines are those that all FRFs have.

    Raises
    ------
    ValueError
        Nothing given, FRFs with several entries, or lines that do not match.
    """
    lines, found = _shared(x, y, xy)
    return lines, _matrix(lines.size, {name: entry.values for name, entry in found.items()})


def receptance_draws(
    x: FRF | None, y: FRF | None = None, *, xy: FRF | None = None, draws: int = 200, seed: int = 0
) -> NDArray[np.complex128]:
    """Return receptance matrices that may be the true one, from the variance of measured FRFs.

    Real and imaginary part of the logarithm err on each line by their standard deviation, neighbouring lines alike
    where the FRF says so. The noise of the measurement is in the middle as well, so that limits come out a little too
    low rather than too high; draws of modes (`TipModes.drawn_from_estimates`) have no noise from line to line.

    Parameters
    ----------
    x, y, xy : FRF
        As in `receptance_matrix`; each with its `log_variance`.
    draws : int, optional
        How many.
    seed : int, optional
        Of what is drawn.

    Returns
    -------
    ndarray
        `(draws, n, 2, 2)` in m/N, on the lines of `receptance_matrix`.

    Raises
    ------
    ValueError
        An FRF without a variance, or as `receptance_matrix`.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.stability import TipModes, receptance_draws
    >>> f = np.arange(800.0, 1000.0)
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[5.0, 0.0]])
    >>> x = FRF(frequency_hz=f, values=tip.receptance(f)[:, 0, 0], log_variance=0.02**2)
    >>> receptance_draws(x, draws=50).shape
    (50, 200, 2, 2)
    """
    lines, found = _shared(x, y, xy)
    if isinstance(draws, bool) or not isinstance(draws, (int, np.integer)) or draws < 1:
        raise ValueError(f"stability: draws is {draws!r}, expected a whole number of at least 1")
    for name, entry in found.items():
        if entry.variance is None or not np.isfinite(entry.variance).all():
            raise ValueError(
                f"stability: {name} has no variance{'' if entry.variance is None else ' on some lines'}, so nothing "
                "is known of its errors; expected log_variance"
            )
    rng = np.random.default_rng(seed)
    result = np.empty((int(draws), lines.size, 2, 2), np.complex128)
    for drawn in result:
        drawn[:] = _matrix(lines.size, {name: entry.drawn(rng) for name, entry in found.items()})
    return result


@dataclass(frozen=True)
class _Entry:
    """One receptance `(n,)`, its variance and how many neighbouring lines err alike."""

    frequency_hz: NDArray[np.float64]
    values: NDArray[np.complex128]
    variance: NDArray[np.float64] | None
    alike: NDArray[np.intp]

    @classmethod
    def of(cls, frf: FRF) -> _Entry:
        variance = None if frf.log_variance is None else frf.log_variance[:, 0, 0]
        return cls(frf.frequency_hz, frf.values[:, 0, 0], variance, np.rint(frf.correlated_lines).astype(np.intp))

    def subset(self, keep: NDArray[np.bool_]) -> _Entry:
        variance = None if self.variance is None else self.variance[keep]
        return _Entry(self.frequency_hz[keep], self.values[keep], variance, self.alike[keep])

    def drawn(self, rng: np.random.Generator) -> NDArray[np.complex128]:
        if self.variance is None:
            return self.values
        # Each line gets the mean of as many independent numbers as lines err alike there, neighbours shared ones.
        parts = rng.standard_normal((2, self.values.size + int(self.alike.max()) - 1))
        parts = np.cumsum(np.pad(parts, ((0, 0), (1, 0))), axis=1)
        first = np.arange(self.values.size)
        real, imaginary = (parts[:, first + self.alike] - parts[:, first]) * np.sqrt(self.variance / self.alike)
        return np.asarray(self.values * np.exp(real + 1j * imaginary))


def _shared(x: FRF | None, y: FRF | None, xy: FRF | None) -> tuple[NDArray[np.float64], dict[str, _Entry]]:
    """Return the lines that all FRFs have, and their receptances on these."""
    given = {name: frf for name, frf in (("x", x), ("y", y), ("xy", xy)) if frf is not None}
    if not given or not ({"x", "y"} & set(given)):
        raise ValueError("stability: neither x nor y was given, expected an FRF of at least one direction")
    found = {}
    for name, frf in given.items():
        if not isinstance(frf, FRF):
            raise TypeError(f"stability: {name} is {type(frf).__name__}, expected an FRF")
        if frf.values.shape[1:] != (1, 1):
            raise ValueError(
                f"stability: {name} has entries {frf.values.shape[1:]}, expected one response and one excitation"
            )
        if frf.decay_rate:
            raise ValueError(
                f"stability: {name} has an exponential window of {frf.decay_rate:g} 1/s, so it is no receptance of the "
                "tip; fit modes first"
            )
        part = frf.masked().to("receptance")
        found[name] = _Entry.of(part).subset(part.frequency_hz > 0.0)
    lines = next(iter(found.values())).frequency_hz
    for name, entry in found.items():
        lines = lines[np.isin(lines, entry.frequency_hz)]
        if lines.size < 2:
            own = entry.frequency_hz.size
            what = f"shares {lines.size} lines with the other FRFs, expected at least 2; resample one"
            if own < 2 or len(found) == 1:
                what = f"has {own} usable lines, expected at least 2"
            raise ValueError(f"stability: {name} {what}")
    return lines, {name: entry.subset(np.isin(entry.frequency_hz, lines)) for name, entry in found.items()}


def _matrix(count: int, values: dict[str, NDArray[np.complex128]]) -> NDArray[np.complex128]:
    matrix = np.zeros((count, 2, 2), np.complex128)
    for name, places in (("x", [(0, 0)]), ("y", [(1, 1)]), ("xy", [(0, 1), (1, 0)])):
        for i, j in places if name in values else ():
            matrix[:, i, j] = values[name]
    return matrix
