"""Whether a drive point's peaks look like the declared form, sign and time convention.

Near a resonance an FRF is c + R / (w - p). For e^(+i w t) the pole p lies above the real axis, because motion decays,
and a drive point's residue R points, because no structure gives off energy, along -1 for receptance, -i for mobility
and +1 for accelerance; a changed sign turns R, a conjugate mirrors p and R. So R and the side of p, fitted to the lines
around each peak that stands out, tell most of the twelve readings of a file apart. What they cannot tell, such as
receptance from accelerance of the other sign, is named as fitting both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.units import FORMS, Form

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Reading", "Verdict", "judge"]

_PROMINENCE = float(np.log(3.0))
"""Of a peak in the logarithm of the magnitude; what stands out less is bent by its neighbours."""
_MOST_PEAKS = 24
_LEAST_LINES = 11
"""A peak has three unknowns; fewer lines say little of how well they fit."""
_DEPTH = 0.25
"""Lines count down to this share of the peak."""
_CHANCE = 1e-6
"""Of noise around a straight line that a mode fits it so much better; it has thousands of lines to find a peak in."""
_SURE = 3.0
"""Standard deviations by which a pole must lie on one side."""
_FITS = 0.5
"""Least mean cosine between residues and a reading: within 60 degrees."""
_CLEAR = 0.8
"""Least mean cosine of a reading that is held against the declared one: within 37 degrees."""


@dataclass(frozen=True)
class Reading:
    """One way in which a file can hold a drive point."""

    form: Form
    conjugated: bool = False
    flipped: bool = False

    @property
    def residue(self) -> complex:
        """Direction of the residues at its peaks, 1 in magnitude."""
        direction: complex = (-1.0, -1j, 1.0)[FORMS.index(self.form)]
        direction = direction.conjugate() if self.conjugated else direction
        return -direction if self.flipped else direction

    def __str__(self) -> str:
        changes = [
            word for word, is_so in (("the complex conjugate of", self.conjugated), ("minus", self.flipped)) if is_so
        ]
        return " ".join([*changes, self.form])


@dataclass(frozen=True)
class Verdict:
    """What the peaks of a drive point say: how many were fitted, and the readings that fit, simplest first."""

    peaks: int
    readings: tuple[Reading, ...]
    declared: Reading

    @property
    def contradicted(self) -> bool:
        """Whether something else fits clearly and the declared form does not."""
        return bool(self.readings) and self.declared not in self.readings


@dataclass(frozen=True)
class _Peak:
    residue: complex
    side: int
    """1 where the pole lies clearly above the real axis, -1 below, 0 where that is not sure."""


def judge(frequency_hz: NDArray[np.float64], values: NDArray[np.complex128], form: Form) -> Verdict:
    """Return what the peaks of a drive point say.

    Parameters
    ----------
    frequency_hz : ndarray
        `(n,)` ascending lines in Hz.
    values : ndarray
        `(n,)` complex.
    form : {"receptance", "mobility", "accelerance"}
        As declared.

    Returns
    -------
    Verdict
        No readings where no peak stands out clearly enough.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.frf.drive_points import judge
    >>> f = np.linspace(900.0, 1100.0, 201)
    >>> verdict = judge(f, 1e-3 / (1000.0**2 - f**2 + 10j * f), "accelerance")
    >>> verdict.contradicted, [str(reading) for reading in verdict.readings]
    (True, ['minus accelerance', 'receptance'])
    """
    peaks = _peaks(frequency_hz, values)
    declared = Reading(form)
    readings: list[Reading] = []
    if peaks:
        every = [Reading(f, c, s) for f in FORMS for c in (False, True) for s in (False, True)]
        every.sort(key=lambda one: ((one.form != form) + one.conjugated + one.flipped, one.form != form))
        fits = {reading: _agreement(reading, peaks) for reading in every}
        if max(fits.values()) >= _CLEAR:
            readings = [reading for reading, fit in fits.items() if fit >= _FITS]
    return Verdict(len(peaks), tuple(readings), declared)


def _agreement(reading: Reading, peaks: list[_Peak]) -> float:
    """Return the mean cosine between residues and a reading, -1 for a pole on the other side."""
    side = -1 if reading.conjugated else 1
    cosines = [
        -1.0 if peak.side == -side else (peak.residue * reading.residue.conjugate()).real / abs(peak.residue)
        for peak in peaks
    ]
    return float(np.mean(cosines))


def _peaks(frequency_hz: NDArray[np.float64], values: NDArray[np.complex128]) -> list[_Peak]:
    """Return the peaks that stand out and that one mode fits."""
    from scipy.signal import find_peaks  # slow to import

    known = (frequency_hz > 0.0) & (values != 0.0)
    frequency_hz, values = frequency_hz[known], values[known]
    if frequency_hz.size < _LEAST_LINES:
        return []
    size = np.log(np.abs(values))
    tops, properties = find_peaks(size, prominence=_PROMINENCE)
    chosen = np.sort(tops[np.argsort(-properties["prominences"])[:_MOST_PEAKS]])
    found = []
    for number, top in enumerate(chosen):
        # Not beyond the lowest line on the way to the next peak.
        first = 0 if number == 0 else chosen[number - 1] + int(size[chosen[number - 1] : top].argmin())
        last = size.size if number == chosen.size - 1 else top + int(size[top : chosen[number + 1]].argmin()) + 1
        low = np.flatnonzero(size < size[top] + np.log(_DEPTH))
        place = int(np.searchsorted(low, top))
        begin = low[place - 1] + 1 if place else 0
        end = low[place] if place < low.size else size.size
        begin, end = min(begin, top - _LEAST_LINES // 2), max(end, top + _LEAST_LINES // 2 + 1)
        part = slice(max(begin, first), min(end, last))
        with np.errstate(all="ignore"):
            peak = _fit(frequency_hz[part], values[part], float(frequency_hz[top]))
        if peak is not None:
            found.append(peak)
    return found


def _fit(frequency_hz: NDArray[np.float64], values: NDArray[np.complex128], top_hz: float) -> _Peak | None:
    """Fit c + R / (f - p) to the lines around a peak, linear as f d = p d + c f + e with e = R - c p."""
    from scipy.special import fdtrc  # slow to import

    if values.size < _LEAST_LINES:
        return None
    x = (frequency_hz - top_hz) / np.ptp(frequency_hz)
    d = values / np.abs(values).max()
    rows = np.stack([d, x.astype(np.complex128), np.ones_like(d)], axis=1)
    (p, c, e), *_ = np.linalg.lstsq(rows, x * d, rcond=None)
    residue = e + c * p
    # Without the top and its neighbours: hum on a line or two is fitted by a pole between them, its flanks are not.
    beside = np.abs(np.arange(d.size) - int(np.abs(d).argmax())) > 1
    slope = np.stack([x[beside], np.ones(int(beside.sum()))], axis=1).astype(np.complex128)
    straight = d[beside] - slope @ np.linalg.lstsq(slope, d[beside], rcond=None)[0]
    level = float(np.sum(np.abs(straight) ** 2))
    left = float(np.sum(np.abs(d - c - residue / (x - p))[beside] ** 2)) + np.finfo(float).tiny
    freedom = int(beside.sum()) - 3
    chance = fdtrc(4, 2 * freedom, (level - left) / 2.0 / left * freedom)
    near = max(abs(p.imag), 1.5 * float(np.abs(np.diff(x)).max()))
    if not (chance <= _CHANCE and abs(p.real) <= near):
        return None
    misfit = float(np.sum(np.abs(rows @ np.array([p, c, e]) - x * d) ** 2)) / (d.size - 3)
    error = np.sqrt(0.5 * misfit * abs(np.linalg.pinv(rows.conj().T @ rows)[0, 0]))
    return _Peak(complex(residue), int(np.sign(p.imag)) if abs(p.imag) > _SURE * error else 0)
