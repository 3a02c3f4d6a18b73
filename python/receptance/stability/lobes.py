"""The stability lobe diagram: the limit of depth over spindle speed, with bands where the receptance is uncertain."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.frf import FRF
from receptance.stability.cutting import Milling, Turning
from receptance.stability.zeroth_order import critical_depths, limit_over_speed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Lobes", "receptance_matrix", "stability_lobes"]

_FEWEST_DRAWS = 20
_LEVEL = 0.95


@dataclass(frozen=True, kw_only=True)
class Lobes:
    """Limit of depth over spindle speed.

    Attributes
    ----------
    speeds_rpm : ndarray
        Spindle speeds `(n,)`.
    depth : ndarray
        Largest depth in m below which cutting is stable `(n,)`; infinite where no line of the receptance can chatter.
    chatter_hz : ndarray
        Frequency of the vibration at the limit `(n,)`; NaN where the limit is infinite.
    lower, upper : ndarray or None
        95 % band of the limit `(n,)`, where draws of the receptance were given.
    draws : ndarray or None
        Limits of each draw `(m, n)`.
    cut : Milling or Turning
        The cut.
    notes : tuple of str
        What a person should know.
    """

    speeds_rpm: NDArray[np.float64]
    depth: NDArray[np.float64]
    chatter_hz: NDArray[np.float64]
    cut: Milling | Turning
    lower: NDArray[np.float64] | None = None
    upper: NDArray[np.float64] | None = None
    draws: NDArray[np.float64] | None = field(default=None, repr=False)
    notes: tuple[str, ...] = ()

    def stable_depth(self, probability: float = 0.95) -> NDArray[np.float64]:
        """Depth that is stable with a probability, at each speed `(n,)` in m.

        Raises
        ------
        ValueError
            Without draws of the receptance, or with fewer than that probability asks for.
        """
        share = _checks.number("Lobes", "probability", probability)
        if not 0.0 < share < 1.0:
            raise ValueError(f"Lobes: probability is {share:g}, expected between 0 and 1")
        if self.draws is None:
            raise ValueError("Lobes: no draws of the receptance were given, so nothing is known of probabilities")
        least = int(np.ceil(1.0 / min(share, 1.0 - share)))
        if len(self.draws) < least:
            raise ValueError(
                f"Lobes: {len(self.draws)} draws cannot show a probability of {share:g}, expected {least} or more"
            )
        return np.quantile(self.draws, 1.0 - share, axis=0, method="lower")

    def best(self, *, probability: float | None = None) -> tuple[float, float]:
        """Speed in rpm and depth in m of the deepest stable cut, with a probability if one is given.

        Raises
        ------
        ValueError
            Where no speed has a finite limit, or as `stable_depth`.
        """
        depth = self.depth if probability is None else self.stable_depth(probability)
        finite = np.isfinite(depth)
        if not finite.any():
            raise ValueError("Lobes: no speed has a finite limit of depth")
        index = int(np.argmax(np.where(finite, depth, -np.inf)))
        return float(self.speeds_rpm[index]), float(depth[index])


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
    given = {name: frf for name, frf in (("x", x), ("y", y), ("xy", xy)) if frf is not None}
    if not given or not ({"x", "y"} & set(given)):
        raise ValueError("stability: neither x nor y was given, expected an FRF of at least one direction")
    parts = {}
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
        keep = part.frequency_hz > 0.0
        parts[name] = part.frequency_hz[keep], part.values[keep, 0, 0]
    lines = next(iter(parts.values()))[0]
    for name, (own, _) in parts.items():
        lines = lines[np.isin(lines, own)]
        if lines.size < 2:
            raise ValueError(
                f"stability: {name} shares {lines.size} lines with the other FRFs, expected at least 2; resample one"
            )
    matrix = np.zeros((lines.size, 2, 2), np.complex128)
    for name, places in (("x", [(0, 0)]), ("y", [(1, 1)]), ("xy", [(0, 1), (1, 0)])):
        if name in parts:
            own, values = parts[name]
            for i, j in places:
                matrix[:, i, j] = values[np.isin(own, lines)]
    return lines, matrix


def stability_lobes(
    cut: Milling | Turning,
    frequency_hz: ArrayLike,
    receptance: ArrayLike,
    *,
    speeds_rpm: ArrayLike,
    draws: ArrayLike | None = None,
) -> Lobes:
    """Return the limit of depth over spindle speed from the receptance of the tool tip.

    Milling by the force's mean over a tooth pitch (zeroth order), which leaves out what interrupted cutting does at a
    small immersion; `semi_discretised_limit` shows that.

    Parameters
    ----------
    cut : Milling or Turning
        The cut.
    frequency_hz : array_like
        Ascending lines `(n,)`, dense enough to follow the resonances: the limit is linear between them.
    receptance : array_like
        `(n, 2, 2)` in x and y for milling (see `receptance_matrix`), `(n,)` for one direction, or for turning along the
        chip's thickness; in m/N.
    speeds_rpm : array_like
        Spindle speeds `(k,)`.
    draws : array_like, optional
        Receptances that may be the true one, `(m,)` more than `receptance`; at least 20.

    Returns
    -------
    Lobes

    Raises
    ------
    ValueError
        Shapes that do not fit, values that are not finite, too few draws.

    References
    ----------
    Altintas, Budak 1995, CIRP Annals 44.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.stability import Milling, TipModes, stability_lobes
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    >>> f = np.arange(800.0, 1200.0, 0.1)
    >>> lobes = stability_lobes(
    ...     Milling(teeth=2, k_t=6e8, k_n=2e8), f, tip.receptance(f), speeds_rpm=np.arange(4000.0, 30000.0, 20.0)
    ... )
    >>> f"{1e3 * lobes.depth.min():.3f} mm"
    '0.298 mm'
    """
    owner = "stability_lobes"
    lines = _checks.frequencies(frequency_hz)
    if lines.dtype.kind == "c" or lines.size < 2:
        raise ValueError(f"{owner}: frequency_hz has {lines.size} {lines.dtype} lines, expected two or more real ones")
    speeds = np.atleast_1d(np.asarray(speeds_rpm, dtype=np.float64))
    if speeds.ndim != 1 or not speeds.size or not (np.isfinite(speeds) & (speeds > 0.0)).all():
        raise ValueError(f"{owner}: speeds_rpm must be finite and more than zero, one dimension")
    matrix = _shaped(owner, "receptance", receptance, lines.size, cut)
    teeth = cut.teeth if isinstance(cut, Milling) else 1
    depth, chatter = limit_over_speed(teeth, speeds, lines, *critical_depths(cut, lines, matrix))
    notes = _on_ends(lines, chatter)
    if draws is None:
        return Lobes(speeds_rpm=speeds, depth=depth, chatter_hz=chatter, cut=cut, notes=notes)
    several = list(np.asarray(draws))
    if len(several) < _FEWEST_DRAWS:
        raise ValueError(f"{owner}: {len(several)} draws, expected at least {_FEWEST_DRAWS}")
    limits = np.array(
        [
            limit_over_speed(
                teeth, speeds, lines, *critical_depths(cut, lines, _shaped(owner, f"draws[{i}]", one, lines.size, cut))
            )[0]
            for i, one in enumerate(several)
        ]
    )
    low, high = (np.quantile(limits, q, axis=0, method="nearest") for q in (0.5 - 0.5 * _LEVEL, 0.5 + 0.5 * _LEVEL))
    return Lobes(
        speeds_rpm=speeds, depth=depth, chatter_hz=chatter, cut=cut, lower=low, upper=high, draws=limits, notes=notes
    )


def _shaped(owner: str, name: str, values: ArrayLike, lines: int, cut: Milling | Turning) -> NDArray[np.complex128]:
    array = np.asarray(values, dtype=np.complex128)
    size = 2 if isinstance(cut, Milling) else 1
    if array.shape == (lines,):
        matrix = np.zeros((lines, size, size), np.complex128)
        matrix[:, 0, 0] = array
        array = matrix
    if array.shape != (lines, size, size):
        raise ValueError(f"{owner}: {name} has shape {array.shape}, expected {(lines,)} or {(lines, size, size)}")
    if not np.isfinite(array).all():
        line = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"{owner}: {name} is not finite at line {line}")
    return array


def _on_ends(lines: NDArray[np.float64], chatter: NDArray[np.float64]) -> tuple[str, ...]:
    """Say so where the limit comes from the ends of the lines: it may be lower outside them."""
    step = np.median(np.diff(lines))
    at_end = np.isfinite(chatter) & ((chatter < lines[0] + step) | (chatter > lines[-1] - step))
    missing = ~np.isfinite(chatter)
    notes = []
    if at_end.any():
        notes.append(
            f"at {at_end.sum()} of {chatter.size} speeds the limit lies at an end of the lines, {lines[0]:g} or "
            f"{lines[-1]:g} Hz: beyond them it may be lower"
        )
    if missing.any():
        notes.append(f"at {missing.sum()} of {chatter.size} speeds no line can chatter: the lines end too early")
    return tuple(notes)
