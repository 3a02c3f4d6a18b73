"""Contacts of the hammer in a force signal, and detection of clipping."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CLEAR = 2
"""Samples left out before a contact, whose rise begins before the detected edge."""
_MAD = 1.4826
"""Ratio of standard deviation and median absolute deviation of Gaussian noise."""
_EDGE_NOISE = 3.0
"""A contact ends where the force is below this many standard deviations of the noise,"""
_EDGE_SHARE = 0.1
"""or below this share of the trigger,"""
_EDGE_MOST = 0.5
"""but at most at this share of the trigger."""
NOISE_PEAK = 6.0
"""Least trigger and least second contact in standard deviations of the noise, exceeded by noise once in 1e9 samples."""
_SMOOTH = 1.5
"""Standard deviation in samples of the Gaussian that removes ringing of a recorder's anti-alias filter from a force.
Recorders have cut-off frequencies of at least 0.39 of the sample rate, where the Gaussian leaves a thousandth."""
_RINGING = 16
"""Samples from a contact within which the ringing of the filter may exceed the trigger."""
_SMOOTHED_TRIGGER = 0.3
"""Share of the trigger above which the smoothed force is a contact."""
_SWING = 0.5
"""Least negative force between a contact and a lobe of its ringing, relative to the peak of the lobe: ringing
alternates, and a hammer does not pull."""
_FLAT_SAMPLES = 4
"""Least number of equal samples of a flat top."""
_EXTREME = 0.3
"""Least share of the largest magnitude at which an extreme may be clipped; the lower extreme of a force is silence."""
_FLAT_STEP = 3.0
"""Steps of the digitiser by which the signal drops beside a flat top; it drops less beside a rounded one."""


@dataclass(frozen=True)
class Contact:
    """A contact of the hammer: first sample, first sample after it, and peak force."""

    onset: int
    release: int
    peak: float


def noise_level(force: NDArray[np.float64]) -> tuple[float, float]:
    """Return offset and standard deviation, by medians, of a signal that is mostly silent."""
    offset = float(np.median(force))
    return offset, _MAD * float(np.median(np.abs(force - offset)))


def find_contacts(force: NDArray[np.float64], trigger: float, noise: float) -> list[Contact]:
    """Return the contacts in a force `(n,)` without offset, pulses positive, in order of time.

    An anti-alias filter rings before and after a short pulse. Lobes of the ringing alternate in sign and have no
    impulse; they belong to the neighbouring contact.
    """
    pulses = _stretches_above(force, trigger, noise)
    if len(pulses) < 2:
        return pulses
    smoothed = _smoothed(force)
    share = float(smoothed.max() / force.max())
    smooth_pulses = _stretches_above(smoothed, _SMOOTHED_TRIGGER * share * trigger, noise)
    groups: list[list[Contact]] = [[] for _ in smooth_pulses]
    contacts = []
    for pulse in pulses:
        gaps = [max(smooth.onset - pulse.release, pulse.onset - smooth.release) for smooth in smooth_pulses]
        nearest = int(np.argmin(gaps)) if gaps else -1
        if nearest >= 0 and gaps[nearest] < _RINGING:
            groups[nearest].append(pulse)
        else:
            contacts.append(pulse)
    for group in filter(None, groups):
        main = max(group, key=lambda pulse: pulse.peak)
        lobes = [pulse for pulse in group if pulse is main or _is_ringing(force, main, pulse)]
        contacts.append(Contact(lobes[0].onset, lobes[-1].release, main.peak))
        contacts += [pulse for pulse in group if pulse not in lobes]
    return sorted(contacts, key=lambda contact: contact.onset)


def _is_ringing(force: NDArray[np.float64], main: Contact, other: Contact) -> bool:
    """Return whether a contact may be a lobe of the ringing of another contact: the force is negative between them."""
    first, second = sorted((main, other), key=lambda contact: contact.onset)
    between = force[first.release : second.onset]
    return bool(between.size) and float(-between.min()) >= _SWING * other.peak


def _smoothed(force: NDArray[np.float64]) -> NDArray[np.float64]:
    offsets = np.arange(-int(4.0 * _SMOOTH), int(4.0 * _SMOOTH) + 1)
    kernel = np.exp(-0.5 * (offsets / _SMOOTH) ** 2)
    return np.asarray(np.convolve(force, kernel / kernel.sum(), mode="full")[-offsets[0] : -offsets[-1]])


def _stretches_above(force: NDArray[np.float64], trigger: float, noise: float) -> list[Contact]:
    """Return the stretches of a force above the trigger."""
    above = np.flatnonzero(force > trigger)
    edge = min(max(_EDGE_NOISE * noise, _EDGE_SHARE * trigger), _EDGE_MOST * trigger)
    low = np.flatnonzero(force <= edge)
    stretches: list[Contact] = []
    while above.size:
        index = int(np.searchsorted(low, above[0]))
        onset = int(low[index - 1]) + 1 if index else 0
        release = int(low[index]) if index < low.size else force.size
        stretches.append(Contact(onset, release, float(force[onset:release].max())))
        above = above[np.searchsorted(above, release) :]
    return stretches


def second_contact(force: NDArray[np.float64], contact: Contact, stop: int, share: float) -> tuple[int, float] | None:
    """Return the largest pulse after a contact with its shape, by a matched filter without the ringing frequencies.

    Parameters
    ----------
    force : ndarray
        `(n,)` without offset, pulses positive.
    contact : Contact
        The first contact.
    stop : int
        End of the search.
    share : float
        Smallest peak, relative to the first contact.

    Returns
    -------
    tuple or None
        First sample of the pulse, and its peak relative to the first contact.
    """
    ends = int(4.0 * _SMOOTH)
    shape = np.pad(force[contact.onset : contact.release] / contact.peak, ends)
    smooth = _smoothed(shape)
    following = force[contact.release : stop]
    if following.size < 2 * shape.size:
        return None
    from scipy.signal import correlate  # slow to import

    heights = correlate(following - np.median(following), smooth, mode="valid") / np.sum(shape * smooth) / contact.peak
    # The median absolute deviation includes hum and ringing of the channel.
    smallest = max(share, NOISE_PEAK * noise_level(heights)[1])
    best = int(heights.argmax())
    if heights[best] < smallest:
        return None
    return contact.release + best + ends, float(heights[best])


def clipped_samples(signal: NDArray[np.float64]) -> int:
    """Return the number of equal samples at the clipped extreme of a signal, 0 if it is not clipped."""
    size = float(np.abs(signal).max())
    # A slow signal on a coarse digitiser has flat tops as well, but drops from them by single steps.
    step = float(np.diff(np.unique(signal)).min(initial=np.inf))
    counts = [_flat_top_length(side, step) for side in (signal, -signal) if side.max() >= _EXTREME * size]
    return max(counts, default=0)


def _flat_top_length(signal: NDArray[np.float64], step: float) -> int:
    top = signal.max()
    changes = np.flatnonzero(np.diff(np.concatenate([[False], signal == top, [False]]).astype(np.int8)))
    begins, ends = changes[::2], changes[1::2]
    longest = int(np.argmax(ends - begins))
    count = int(ends[longest] - begins[longest])
    if count < _FLAT_SAMPLES or top <= 0.0:
        return 0
    beside = [signal[i] for i in (begins[longest] - 1, ends[longest]) if 0 <= i < signal.size]
    return count if all(top - value > _FLAT_STEP * step for value in beside) else 0
