"""Plausibility of measured FRFs: form, sign and time convention at drive points, and noise at the lowest lines.

Drive points: near a resonance an FRF is c + R / (w - p). For e^(+i w t) the pole p lies above the real axis, because
motion decays. The residue R of a drive point of a passive structure has the direction -1 for receptance, -i for
mobility and +1 for accelerance; a reversed sign turns R, a complex conjugate mirrors p and R. R and the side of p,
fitted to the lines around each prominent peak, therefore distinguish most of the twelve conventions of a file. Pairs
that they do not distinguish, such as receptance and accelerance of opposite sign, are both reported.

What no convention explains is reported as well, with what it looks like: both halves of an FFT, radians read as degrees
or degrees as radians, and peaks of both signs, which an FRF between two places has.

Lowest lines: a receptance measured with an accelerometer contains the accelerometer's noise and drift divided by
(2 pi f)^2. Where these dominate, f^2 |H| is about constant or falls with frequency. A supported structure is a spring
at 0 Hz, so that f^2 |H| rises as f^2 up to its first mode. Above a mode, and for a free body, f^2 |H| is about constant
as well, but H is real there, negative at a drive point, and does not scatter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance._peaks import local_maxima
from receptance.frf.data import FRFData
from receptance.model.coordinates import UnknownPosition
from receptance.units import FORMS, Form

_PROMINENCE = float(np.log(3.0))
"""Least prominence of a peak in the log magnitude; lower peaks are distorted by their neighbours."""
_MAX_PEAKS = 24
_MIN_PEAK_LINES = 11
"""Least lines for the fit of a peak, which has three complex unknowns."""
_PEAK_FLOOR = 0.25
"""A peak extends down to this share of its height."""
_FALSE_PEAK_RATE = 1e-6
"""Accepted probability of a false peak in noise; a record has thousands of lines."""
_SIDE_DEVIATIONS = 3.0
"""Standard deviations by which a pole must be away from the real axis for its side to count."""
_MIN_AGREEMENT = 0.5
"""Least mean cosine between the residues and an accepted convention (60 degrees)."""
_CLEAR_AGREEMENT = 0.8
"""Least mean cosine of the best convention for any contradiction (37 degrees)."""
_MIRRORED = 1e-3
"""Largest relative difference of mirrored lines, which are written with few digits."""
_NOT_MIRRORED = 0.01
"""Largest share of lines that differ more, such as the one in the middle."""
_MAGNITUDE_MISFIT = 0.1
"""Largest relative rms misfit of the squared magnitude of a peak that counts as one of a mode."""
_LIKE_A_MODE = 0.85
"""Smallest correlation of a peak with a mode of its magnitude; 0.74 for a constant phase."""


@dataclass(frozen=True)
class Convention:
    """Form, sign and time convention in which a drive point may be stored."""

    form: Form
    conjugated: bool = False
    flipped: bool = False

    @property
    def residue(self) -> complex:
        """Direction of the residues at the peaks, of magnitude 1."""
        direction: complex = (-1.0, -1j, 1.0)[FORMS.index(self.form)]
        direction = direction.conjugate() if self.conjugated else direction
        return -direction if self.flipped else direction

    def __str__(self) -> str:
        changes = [
            word
            for word, applies in (("the complex conjugate of", self.conjugated), ("minus", self.flipped))
            if applies
        ]
        return " ".join([*changes, self.form])


@dataclass(frozen=True)
class DrivePointVerdict:
    """Number of fitted peaks of a drive point, and the conventions that agree with them, simplest first.

    `unphysical` states what no convention explains, so that no passive structure has this phase; empty otherwise.
    """

    peaks: int
    conventions: tuple[Convention, ...]
    declared: Convention
    unphysical: str = ""

    @property
    def contradicted(self) -> bool:
        """Whether another convention agrees clearly and the declared one does not."""
        return bool(self.conventions) and self.declared not in self.conventions

    @property
    def reason(self) -> str:
        """Why this is no drive point as declared, with the remedies; empty if nothing contradicts it."""
        if self.unphysical:
            return f"no passive structure has its phase at a drive point: {self.unphysical}"
        if not self.contradicted:
            return ""
        alternatives = ", or of ".join(_with_remedies(other, self.declared.form) for other in self.conventions)
        peaks = "only clear peak has the phase" if self.peaks == 1 else f"{self.peaks} clear peaks have the phase"
        return (
            f"its {peaks} of {alternatives}; not of {self.declared.form}, as declared (passive structure, e^(+i w t))"
        )


@dataclass(frozen=True)
class _Peak:
    residue: complex
    side: int
    """1 if the pole lies clearly above the real axis, -1 if below, 0 if uncertain."""


def drive_point_notes(frf: FRFData) -> list[str]:
    """Return a note for each drive point whose peaks contradict the declared form."""
    notes = []
    chosen = slice(None) if frf.usable is None else frf.usable
    for i, response in enumerate(frf.responses):
        for j, excitation in enumerate(frf.excitations):
            if isinstance(response, UnknownPosition) or response != excitation:
                continue
            verdict = check_drive_point(frf.frequency_hz[chosen], frf.values[chosen, i, j], frf.form)
            if verdict.reason:
                notes.append(f"drive point {response.describe()}: {verdict.reason}. The data are unchanged")
    return notes


def _with_remedies(convention: Convention, declared: str) -> str:
    remedies = []
    if convention.form != declared:
        remedies.append(f'quantity = "{convention.form}"')
    if convention.flipped:
        remedies.append("reversed sensor or hammer: reverse = true, --reverse, flipped()")
    if convention.conjugated:
        remedies.append("written for e^(-i w t): conjugate = true, --conjugate, conjugated()")
    return f"{convention} ({'; '.join(remedies)})"


def check_drive_point(
    frequency_hz: NDArray[np.float64], values: NDArray[np.complex128], form: Form
) -> DrivePointVerdict:
    """Compare the peaks of a drive point, `(n,)` lines in Hz and complex values, with the declared form.

    There are no conventions in the result if no peak is prominent enough.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.frf.plausibility import check_drive_point
    >>> f = np.linspace(900.0, 1100.0, 201)
    >>> verdict = check_drive_point(f, 1e-3 / (1000.0**2 - f**2 + 10j * f), "accelerance")
    >>> verdict.contradicted, [str(convention) for convention in verdict.conventions]
    (True, ['minus accelerance', 'receptance'])
    """
    known = (frequency_hz > 0.0) & (values != 0.0)
    frequency_hz, values = frequency_hz[known], values[known]
    parts = _peak_parts(values)
    with np.errstate(all="ignore"):
        fits = [_fit(frequency_hz[part], values[part], float(frequency_hz[top])) for top, part in parts]
    peaks = [peak for peak in fits if peak is not None]
    declared = Convention(form)
    conventions: list[Convention] = []
    unphysical = _mirrored(frequency_hz, values) or _without_turn(frequency_hz, values, parts, fits)
    if peaks and not unphysical:
        every = [Convention(f, c, s) for f in FORMS for c in (False, True) for s in (False, True)]
        every.sort(key=lambda other: ((other.form != form) + other.conjugated + other.flipped, other.form != form))
        agreements = {convention: _agreement(convention, peaks) for convention in every}
        if max(agreements.values()) >= _CLEAR_AGREEMENT:
            conventions = [convention for convention, cosine in agreements.items() if cosine >= _MIN_AGREEMENT]
        elif max(agreements.values()) < _MIN_AGREEMENT:
            unphysical = (
                f"its {len(peaks)} clear peaks have different signs, as those of an FRF between two places or "
                "directions"
            )
    return DrivePointVerdict(len(peaks), tuple(conventions), declared, unphysical)


def _agreement(convention: Convention, peaks: list[_Peak]) -> float:
    """Return the mean cosine between residues and a convention; -1 for a pole on the opposite side."""
    side = -1 if convention.conjugated else 1
    cosines = [
        -1.0 if peak.side == -side else (peak.residue * convention.residue.conjugate()).real / abs(peak.residue)
        for peak in peaks
    ]
    return float(np.mean(cosines))


def _mirrored(lines: NDArray[np.float64], values: NDArray[np.complex128]) -> str:
    """Return that the upper half of the lines mirrors the lower one, or an empty text."""
    size = np.abs(values)
    if (
        lines.size < _MIN_PEAK_LINES
        or np.ptp(np.log(size)) < _PROMINENCE
        or not np.allclose(lines + lines[::-1], lines[0] + lines[-1], rtol=1e-6)
        or float(np.mean(np.abs(values - values[::-1].conj()) > _MIRRORED * size)) > _NOT_MIRRORED
    ):
        return ""
    middle = 0.5 * (lines[0] + lines[-1])
    return (
        f"the lines above {middle:g} Hz are the mirrored complex conjugate of those below, the second half of an FFT; "
        f'leave them out, bands = [["{lines[0]:g} Hz", "{middle:g} Hz"]]'
    )


def _without_turn(
    lines: NDArray[np.float64],
    values: NDArray[np.complex128],
    parts: list[tuple[int, slice]],
    fits: list[_Peak | None],
) -> str:
    """Return that the phase does not turn where the magnitude has the peaks of modes, or an empty text."""
    wrong = [
        part for (_, part), fit in zip(parts, fits, strict=True) if fit is None and _stays(lines[part], values[part])
    ]
    if len(wrong) <= sum(fit is not None for fit in fits):
        return ""
    peaks = "the phase does not turn as at a mode, though the magnitude has the peak of one"
    if not values.imag.any():
        return f"{peaks}: a magnitude without a phase, or one part of the FRF"
    angle = np.abs(np.angle(values))
    if angle.max() <= np.deg2rad(2.0 * np.pi) * (1.0 + 1e-9):
        return f"{peaks}, and is within {np.rad2deg(angle.max()):.3g} degrees: radians read as degrees"
    return f"{peaks}: degrees read as radians, or a phase of another unit, sensor or record"


def _stays(lines: NDArray[np.float64], values: NDArray[np.complex128]) -> bool:
    """Return whether the magnitude of lines is that of one mode, and the phase is not."""
    if values.size < _MIN_PEAK_LINES:
        return False
    x = (lines - lines.mean()) / np.ptp(lines)
    power = np.abs(values) ** 2 / np.max(np.abs(values)) ** 2
    # |1 / (x - p)|^-2 is quadratic in x.
    quadratic = np.polyfit(x, 1.0 / power, 2, w=power)
    misfit = float(np.sqrt(np.mean((power * np.polyval(quadratic, x) - 1.0) ** 2)))
    pole = complex(np.roots(quadratic)[0]) if quadratic[0] > 0.0 else 0j
    if misfit > _MAGNITUDE_MISFIT or abs(pole.imag) < float(np.diff(x).max()):
        return False
    shapes = [1.0 / (x - side) for side in (pole, pole.conjugate())]
    alike = [abs(np.vdot(shape, values)) / np.linalg.norm(shape) / np.linalg.norm(values) for shape in shapes]
    return bool(max(alike) < _LIKE_A_MODE)


def _peak_parts(values: NDArray[np.complex128]) -> list[tuple[int, slice]]:
    """Return the line of each prominent peak, and the lines around it."""
    if values.size < _MIN_PEAK_LINES:
        return []
    size = np.log(np.abs(values))
    tops, prominences = local_maxima(size, _PROMINENCE)
    chosen = np.sort(tops[np.argsort(-prominences)[:_MAX_PEAKS]])
    parts = []
    for number, top in enumerate(chosen):
        # Limited by the lowest line between this peak and the next.
        first = 0 if number == 0 else chosen[number - 1] + int(size[chosen[number - 1] : top].argmin())
        last = size.size if number == chosen.size - 1 else top + int(size[top : chosen[number + 1]].argmin()) + 1
        low = np.flatnonzero(size < size[top] + np.log(_PEAK_FLOOR))
        index = int(np.searchsorted(low, top))
        begin = low[index - 1] + 1 if index else 0
        end = low[index] if index < low.size else size.size
        begin, end = min(begin, top - _MIN_PEAK_LINES // 2), max(end, top + _MIN_PEAK_LINES // 2 + 1)
        parts.append((int(top), slice(max(begin, first), min(end, last))))
    return parts


def _fit(frequency_hz: NDArray[np.float64], values: NDArray[np.complex128], top_hz: float) -> _Peak | None:
    """Fit c + R / (f - p) to the lines around a peak, linear as f d = p d + c f + e with e = R - c p."""
    if values.size < _MIN_PEAK_LINES:
        return None
    x = (frequency_hz - top_hz) / np.ptp(frequency_hz)
    d = values / np.abs(values).max()
    rows = np.stack([d, x.astype(np.complex128), np.ones_like(d)], axis=1)
    (p, c, e), *_ = np.linalg.lstsq(rows, x * d, rcond=None)
    residue = e + c * p
    # Without the top and its neighbours: a pole between them would fit hum on one or two lines, but not its flanks.
    beside = np.abs(np.arange(d.size) - int(np.abs(d).argmax())) > 1
    slope = np.stack([x[beside], np.ones(int(beside.sum()))], axis=1).astype(np.complex128)
    straight = d[beside] - slope @ np.linalg.lstsq(slope, d[beside], rcond=None)[0]
    level = float(np.sum(np.abs(straight) ** 2))
    misfit_with_pole = float(np.sum(np.abs(d - c - residue / (x - p))[beside] ** 2)) + np.finfo(float).tiny
    freedom = int(beside.sum()) - 3
    ratio = max((level - misfit_with_pole) / 2.0 / misfit_with_pole * freedom, 0.0)
    chance = float(special.fdtrc(4, 2 * freedom, ratio))
    near = max(abs(p.imag), 1.5 * float(np.abs(np.diff(x)).max()))
    if not (chance <= _FALSE_PEAK_RATE and abs(p.real) <= near):
        return None
    misfit = float(np.sum(np.abs(rows @ np.array([p, c, e]) - x * d) ** 2)) / (d.size - 3)
    error = np.sqrt(0.5 * misfit * abs(np.linalg.pinv(rows.conj().T @ rows)[0, 0]))
    return _Peak(complex(residue), int(np.sign(p.imag)) if abs(p.imag) > _SIDE_DEVIATIONS * error else 0)


_OCTAVE = 2.0
_HALF_OCTAVE = 2.0**0.5
_MIN_GROUP_LINES = 4
"""Least lines of a group; the mean power of four lines of noise has a relative error of about 1.6."""
_SPRING_SLOPE = 1.0
"""Least exponent of the growth of f^2 |H| with frequency for a spring: noise has 0, a spring 2."""
_TOP_RANGE = 2.0**0.25
"""Frequency ratio from the lowest line within which the largest magnitude must be; otherwise it is a mode."""
_MIN_NOISE_SHARE = 0.1
"""Least share of noise in the power of lines classified as noise."""
_MIN_REAL_SHARE = 0.9
"""Least share of the real part in the values of a mass."""
_CLEAR_RATIO = 3.0
"""Frequency ratio over which noise that equals a spring's receptance falls to a tenth of it."""


@dataclass(frozen=True, kw_only=True)
class LowFrequencyRise:
    """Lowest lines on which a receptance falls approximately as 1/f^2, by a factor from the first to the last.

    `noise_share` is the share of the power of f^2 H that scatters from line to line: 0 for a smooth curve, 1 for noise.
    """

    lowest_hz: float
    highest_hz: float
    factor: float
    noise_share: float

    @property
    def clear_hz(self) -> float:
        """Frequency above which such noise is below a tenth of a spring's receptance, to two digits."""
        return float(f"{_CLEAR_RATIO / _OCTAVE * self.highest_hz:.1e}")

    def __str__(self) -> str:
        return (
            f"from {self.lowest_hz:.4g} to {self.highest_hz:.4g} Hz the receptance falls approximately as 1/f^2, by a "
            f"factor of {self.factor:.3g}, unlike that of a mass: noise or drift of an accelerometer divided by "
            "(2 pi f)^2, or a mode at the lowest lines"
        )


@np.errstate(over="ignore", divide="ignore", invalid="ignore")  # values that no structure has are no rise
def low_frequency_rise(
    frequency_hz: NDArray[np.inexact], receptance: NDArray[np.complex128], *, drive_point: bool
) -> LowFrequencyRise | None:
    """Return the lowest lines on which a receptance falls approximately as 1/f^2, unlike that of a mass.

    The receptance, `(n,)` complex on lines in Hz, may be in any unit. At a drive point that of a mass is negative. None
    if there are no such lines over at least one octave.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.frf.plausibility import low_frequency_rise
    >>> f = np.arange(5.0, 1000.0, 1.25)
    >>> supported = 1e-7 / (1.0 - (f / 800.0) ** 2 + 0.04j * f / 800.0)
    >>> low_frequency_rise(f, supported, drive_point=True) is None
    True
    >>> drift = 2e-4 / f**2 * np.exp(1j * np.random.default_rng(1).uniform(0.0, 6.28, f.size))
    >>> rise = low_frequency_rise(f, supported + drift, drive_point=True)
    >>> rise.lowest_hz, 25.0 < rise.highest_hz < 80.0, rise.noise_share > 0.5
    (5.0, True, True)
    """
    lines = frequency_hz.real
    known = lines > 0.0
    lines = lines[known]
    acceleration = lines**2 * receptance[known]
    first = _line_groups(lines)
    if first.size < 3:
        return None
    size = np.diff(np.append(first, lines.size))
    power = np.add.reduceat(np.abs(acceleration) ** 2, first) / size
    # The frequency at which a spring has the mean power of the group's lines.
    centre = (np.add.reduceat(lines**4, first) / size) ** 0.25
    last = 0
    for i in range(first.size):
        further = np.flatnonzero(centre >= 0.99 * _OCTAVE * centre[i])
        if not further.size or 0.5 * np.log(power[further[0]] / power[i]) >= _SPRING_SLOPE * np.log(
            centre[further[0]] / centre[i]
        ):
            break
        last = int(further[0])
    if not last:
        return None
    stop = int(first[last] + size[last])
    lowest = acceleration[:stop]
    highest = max(_MIN_GROUP_LINES, int(np.searchsorted(lines, _TOP_RANGE * lines[0])))
    if int(np.argmax(np.abs(lowest) / lines[:stop] ** 2)) >= highest:
        return None
    # The second difference of noise has six times its power, that of a smooth curve almost none.
    share = float(np.mean(np.abs(np.diff(lowest, 2)) ** 2) / 6.0 / np.mean(np.abs(lowest) ** 2))
    # The upper half may contain the following antiresonance, of a mass and a spring for example.
    lower = lowest[: int(np.searchsorted(lines, lines[stop - 1] / _OCTAVE))]
    real = float(lower.real.sum() / np.abs(lower).sum())
    if share < _MIN_NOISE_SHARE and (-real if drive_point else abs(real)) > _MIN_REAL_SHARE:
        return None
    fall = np.sqrt(power[0] / power[last]) * (centre[last] / centre[0]) ** 2
    return LowFrequencyRise(
        lowest_hz=float(lines[0]), highest_hz=float(lines[stop - 1]), factor=float(fall), noise_share=min(share, 1.0)
    )


def _line_groups(lines: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the first line of each group of half an octave and at least `_MIN_GROUP_LINES` lines."""
    first_lines, start = [], 0
    while start < lines.size:
        end = max(int(np.searchsorted(lines, _HALF_OCTAVE * lines[start])), start + _MIN_GROUP_LINES)
        first_lines.append(start)
        start = end
    return np.array(first_lines, dtype=np.int64)
