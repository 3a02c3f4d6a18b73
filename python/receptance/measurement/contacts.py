"""Contacts of the hammer in a force signal, and signs of overload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Contact", "find_contacts", "flat_top", "noise_level", "second_contact"]

_MAD = 1.4826
"""Standard deviation of Gaussian noise over its median absolute deviation."""
_EDGE_NOISE = 3.0
"""A contact lasts until the force is below this many standard deviations of the noise, or below `_EDGE_SHARE`."""
_EDGE_SHARE = 0.1
"""Of the trigger."""
_EDGE_MOST = 0.5
"""Of the trigger, however noisy the force is."""
_SECOND_NOISE = 6.0
"""Standard deviations above which a second contact is not taken for noise: once in 1e9 samples."""
_SMOOTH = 1.5
"""Samples, of the Gaussian that takes the ringing of a recorder's anti-alias filter off a force. Recorders cut off at
0.39 of the sample rate or above; at that frequency, where the filter rings, a thousandth is left."""
_RINGING = 16
"""Samples from a contact within which the filter's ringing may be above the trigger."""
_CALM = 0.3
"""Of the trigger: what is above this without the ringing is a contact of its own."""
_SWING = 0.5
"""Smallest negative force between a contact and a lobe of its ringing, over the lobe's peak: ringing alternates and
decays, and a hammer does not pull."""
_FLAT_SAMPLES = 4
"""Equal samples at the extreme that make a flat top."""
_EXTREME = 0.3
"""Of the largest value, that an extreme is where something may be clipped: a force's lower one is silence."""
_FLAT_STEP = 3.0
"""How many steps of the digitiser the wave is away from its extreme beside a flat top; less beside a round one."""


@dataclass(frozen=True)
class Contact:
    """One touch of the hammer: first sample, first sample after it, and largest force between."""

    onset: int
    release: int
    peak: float


def noise_level(force: NDArray[np.float64]) -> tuple[float, float]:
    """Return offset and standard deviation of a signal that is silent most of the time, by medians."""
    offset = float(np.median(force))
    return offset, _MAD * float(np.median(np.abs(force - offset)))


def find_contacts(force: NDArray[np.float64], trigger: float, noise: float) -> list[Contact]:
    """Return the contacts in a force `(n,)` without offset, pulses positive, in order of time.

    An anti-alias filter rings before and after a pulse of few samples. Its lobes change sign, have no impulse of their
    own, and are part of the contact they are next to.
    """
    found = _above(force, trigger, noise)
    if len(found) < 2:
        return found
    calm = _smoothed(force)
    share = float(calm.max() / force.max())
    own = _above(calm, _CALM * share * trigger, noise)
    groups: list[list[Contact]] = [[] for _ in own]
    alone = []
    for contact in found:
        gaps = [max(one.onset - contact.release, contact.onset - one.release) for one in own]
        nearest = int(np.argmin(gaps)) if gaps else -1
        if nearest >= 0 and gaps[nearest] < _RINGING:
            groups[nearest].append(contact)
        else:
            alone.append(contact)
    for group in filter(None, groups):
        main = max(group, key=lambda contact: contact.peak)
        rings = [contact is main or _rings(force, main, contact) for contact in group]
        lobes = [contact for contact, ringing in zip(group, rings, strict=True) if ringing]
        alone += [Contact(lobes[0].onset, lobes[-1].release, main.peak)]
        alone += [contact for contact, ringing in zip(group, rings, strict=True) if not ringing]
    return sorted(alone, key=lambda contact: contact.onset)


def _rings(force: NDArray[np.float64], main: Contact, other: Contact) -> bool:
    """Return whether a contact can be a lobe of another one's ringing: the force swings below zero between them."""
    first, second = sorted((main, other), key=lambda contact: contact.onset)
    between = force[first.release : second.onset]
    return bool(between.size) and float(-between.min()) >= _SWING * other.peak


def _smoothed(force: NDArray[np.float64]) -> NDArray[np.float64]:
    reach = np.arange(-int(4.0 * _SMOOTH), int(4.0 * _SMOOTH) + 1)
    kernel = np.exp(-0.5 * (reach / _SMOOTH) ** 2)
    return np.asarray(np.convolve(force, kernel / kernel.sum(), mode="full")[-reach[0] : -reach[-1]])


def _above(force: NDArray[np.float64], trigger: float, noise: float) -> list[Contact]:
    """Return the stretches of a force that pass the trigger."""
    above = np.flatnonzero(force > trigger)
    edge = min(max(_EDGE_NOISE * noise, _EDGE_SHARE * trigger), _EDGE_MOST * trigger)
    low = np.flatnonzero(force <= edge)
    found: list[Contact] = []
    while above.size:
        first = int(above[0])
        place = int(np.searchsorted(low, first))
        onset = int(low[place - 1]) + 1 if place else 0
        release = int(low[place]) if place < low.size else force.size
        found.append(Contact(onset, release, float(force[onset:release].max())))
        above = above[np.searchsorted(above, release) :]
    return found


def second_contact(force: NDArray[np.float64], contact: Contact, stop: int, share: float) -> tuple[int, float] | None:
    """Look for another pulse of the first one's shape after it: a matched filter, without the frequencies that ring.

    Parameters
    ----------
    force : ndarray
        `(n,)` without offset, pulses positive.
    contact : Contact
        The first one.
    stop : int
        Where to end.
    share : float
        Smallest peak that counts, over the first one's.

    Returns
    -------
    tuple or None
        The sample at which the largest second pulse begins, and its peak over the first one's.
    """
    ends = int(4.0 * _SMOOTH)
    shape = np.pad(force[contact.onset : contact.release] / contact.peak, ends)
    smooth = _smoothed(shape)
    rest = force[contact.release : stop]
    if rest.size < 2 * shape.size:
        return None
    from scipy.signal import correlate  # slow to import

    heights = correlate(rest - np.median(rest), smooth, mode="valid") / np.sum(shape * smooth) / contact.peak
    # The median absolute deviation knows hum and ringing of the channel as well as white noise.
    smallest = max(share, _SECOND_NOISE * noise_level(heights)[1])
    best = int(heights.argmax())
    if heights[best] < smallest:
        return None
    return contact.release + best + ends, float(heights[best])


def flat_top(signal: NDArray[np.float64]) -> int:
    """Return how many equal samples in a row a clipped wave has at an extreme, 0 where it does not look clipped."""
    size = float(np.abs(signal).max())
    # A slow wave on a coarse digitiser is flat at its top as well, but leaves it by single steps.
    step = float(np.diff(np.unique(signal)).min(initial=np.inf))
    counts = [_flat(side, step) for side in (signal, -signal) if side.max() >= _EXTREME * size]
    return max(counts, default=0)


def _flat(signal: NDArray[np.float64], step: float) -> int:
    top = signal.max()
    changes = np.flatnonzero(np.diff(np.concatenate([[False], signal == top, [False]]).astype(np.int8)))
    begins, ends = changes[::2], changes[1::2]
    longest = int(np.argmax(ends - begins))
    count = int(ends[longest] - begins[longest])
    if count < _FLAT_SAMPLES or top <= 0.0:
        return 0
    beside = [signal[i] for i in (begins[longest] - 1, ends[longest]) if 0 <= i < signal.size]
    return count if all(top - value > _FLAT_STEP * step for value in beside) else 0
