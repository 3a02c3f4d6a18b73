"""Hits of a hammer test: contacts in the force, the search for hits, and the reasons for dropping some."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from receptance import _checks
from receptance._text import first_of
from receptance.errors import warn_user
from receptance.hammer import agreement
from receptance.hammer.records import HammerRecords
from receptance.report import Column, Renderable, Table
from receptance.report.table import percent

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
_RINGING_SAMPLES = 16
"""Samples from a contact within which the ringing of the filter may exceed the trigger."""
_SMOOTHED_TRIGGER = 0.3
"""Share of the trigger above which the smoothed force is a contact."""
_BAND = 0.1
"""Least magnitude of a force's spectrum at the end of its band, relative to the largest."""
_SWING = 0.5
"""Least negative force between a contact and a lobe of its ringing, relative to the peak of the lobe: ringing
alternates, and a hammer does not pull."""
_FLAT_SAMPLES = 3
"""Least number of equal samples of a flat top. A rounded top of three equal samples drops by less than three steps."""
_EXTREME = 0.3
"""Least share of the largest magnitude at which an extreme may be clipped; the lower extreme of a force is silence."""
_FLAT_STEP = 4.0
"""Steps of the digitiser by which the signal drops beside a flat top; it drops less beside a rounded one."""
_CHANCE_STEPS = 50.0
"""Steps of the digitiser by which the signal drops beside two equal samples that are not equal by chance."""
_ROUNDED = 1.5
"""Ratio of the second drop from a rounded top of two equal samples to the first; that of a parabola is 2."""


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
        if nearest >= 0 and gaps[nearest] < _RINGING_SAMPLES:
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

    The force `(n,)` is without offset, pulses positive; it is searched up to sample `stop` for peaks of at least
    `share` of that of the contact. Returned are the first sample of the pulse and its peak relative to the contact, or
    None.
    """
    ends = int(4.0 * _SMOOTH)
    shape = np.pad(force[contact.onset : contact.release] / contact.peak, ends)
    smooth = _smoothed(shape)
    following = force[contact.release : stop]
    if following.size < 2 * shape.size:
        return None
    heights = (
        scipy.signal.correlate(following - np.median(following), smooth, mode="valid")
        / np.sum(shape * smooth)
        / contact.peak
    )
    # The median absolute deviation includes hum and ringing of the channel.
    smallest = max(share, NOISE_PEAK * noise_level(heights)[1])
    best = int(heights.argmax())
    if heights[best] < smallest:
        return None
    return contact.release + best + ends, float(heights[best])


def spectrum_loss_db(force: NDArray[np.float64]) -> float:
    """Return the depth in dB of the deepest dip in the spectrum of contacts `(n,)`, down to 20 dB below its maximum.

    A dip is a line with less force than a lower and a higher line: the decrease of a pulse's spectrum with frequency is
    no dip.
    """
    magnitude = np.abs(np.fft.rfft(force, 4 * force.size))
    band = magnitude[: int(np.flatnonzero(magnitude >= _BAND * magnitude.max())[-1]) + 1]
    beside = np.minimum(np.maximum.accumulate(band), np.maximum.accumulate(band[::-1])[::-1])
    return 20.0 * float(np.log10(np.max(beside / np.maximum(band, 1e-15 * band.max()))))


def clipped_samples(signal: NDArray[np.float64]) -> int:
    """Return the number of equal samples at the clipped extreme of a signal, 0 if it is not clipped.

    Two equal samples may be chance: they are an overload if the recorder's range ends there.
    """
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
    if count < 2 or top <= 0.0:
        return 0
    first, last = int(begins[longest]), int(ends[longest]) - 1
    drops = [top - signal[i] for i in (first - 1, last + 1) if 0 <= i < signal.size]
    if count >= _FLAT_SAMPLES:
        return count if all(drop > _FLAT_STEP * step for drop in drops) else 0
    second_drops = [
        signal[near] - signal[far]
        for near, far in ((first - 1, first - 2), (last + 1, last + 2))
        if 0 <= far < signal.size
    ]
    steep = any(second < _ROUNDED * drop for drop, second in zip(drops, second_drops, strict=False))
    return count if steep and all(drop > _CHANCE_STEPS * step for drop in drops) else 0


@dataclass(frozen=True)
class Hit:
    """A hit with its position in the record, its peak force, and whether it is used.

    `onset`, `release` and `start` are samples of the record: the first of the contact, the first after the (last)
    contact, and the first of the block that is transformed. `reason` is why a hit is dropped, empty for
    hits that are kept; `note` is a note on a hit that is kept.
    """

    number: int
    record: int
    time_s: float
    peak: float
    contact_s: float
    onset: int
    release: int
    start: int
    reason: str = ""
    note: str = ""

    @property
    def kept(self) -> bool:
        """Whether the hit is used."""
        return not self.reason


@dataclass(frozen=True, eq=False, repr=False)
class Hits(Renderable):
    """Hits found in records, each kept or dropped for a reason."""

    records: tuple[HammerRecords, ...]
    hits: tuple[Hit, ...]
    """In order of time."""
    n_samples: int
    """Length of the block of every hit."""
    noise: float
    """Standard deviation of the force outside contacts, in its SI unit."""
    notes: tuple[str, ...]
    """Notes for the user, with the dropped hits and the reasons."""

    @property
    def kept(self) -> tuple[Hit, ...]:
        """Hits that are used."""
        return tuple(hit for hit in self.hits if hit.kept)

    @property
    def dropped(self) -> tuple[Hit, ...]:
        """Hits that are not used."""
        return tuple(hit for hit in self.hits if not hit.kept)

    @property
    def sample_rate_hz(self) -> float:
        """Samples per second."""
        return self.records[0].sample_rate_hz

    @property
    def duration_s(self) -> float:
        """Length of the block of every hit, the inverse of the distance of the frequency lines."""
        return self.n_samples / self.sample_rate_hz

    def blocks(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return force `(n_kept, n_samples)` and response `(n_kept, n_samples, n_channels)` without windows."""
        rows = list(single_records(self.records))
        cuts = [(rows[hit.record], slice(hit.start, hit.start + self.n_samples)) for hit in self.kept]
        return np.array([row[0][cut] for row, cut in cuts]), np.array([row[1][cut] for row, cut in cuts])

    def without(self, *numbers: int, reason: str = "dropped by hand") -> Hits:
        """Return the hits with some of them dropped.

        Raises
        ------
        ValueError
            An unknown number, or an empty reason.
        """
        existing = {hit.number for hit in self.hits}
        for number in numbers:
            if number not in existing:
                raise ValueError(f"there is no hit {number}; the numbers are 1 to {len(self.hits)}")
        if not reason:
            raise ValueError("reason is empty; state why the hits are dropped")
        changed = [replace(hit, reason=hit.reason or reason) if hit.number in numbers else hit for hit in self.hits]
        added = tuple(f"hit {number} dropped: {reason}" for number in numbers)
        return replace(self, hits=tuple(changed), notes=(*self.notes, *added))

    @property
    def title(self) -> str:
        """Title of `summary`."""
        return f"{len(self.kept)} of {len(self.hits)} hits are kept"

    def tables(self) -> list[Table]:
        """Return the table of `summary`, with a row for each hit."""
        columns = (
            Column("hit", form="d"),
            Column("record", form="d"),
            Column("time", "s", ".4f"),
            Column("peak", "N" if self.records[0].excitation.direction == "y" else "N m"),
            Column("contact", "ms", ".3g"),
            "use",
        )
        rows = []
        for hit in self.hits:
            use = f"dropped: {hit.reason}" if hit.reason else "kept" + (f" ({hit.note})" if hit.note else "")
            rows.append((hit.number, hit.record + 1, hit.time_s, hit.peak, 1e3 * hit.contact_s, use))
        return [Table("", columns, rows)]

    def __len__(self) -> int:
        return len(self.kept)

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        dropped = [f"hit {hit.number} dropped: {hit.reason}" for hit in self.dropped]
        kept = f"{len(self.kept)} of {len(self.hits)} kept, blocks of {self.duration_s:g} s"
        return f"Hits({'; '.join(filter(None, [kept, first_of(dropped, '; ')]))})"


def single_records(records: Sequence[HammerRecords]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield force `(n,)` and response `(n, n_channels)` of each record."""
    for record in records:
        yield from zip(record.force, record.response, strict=True)


DeviatingHits = Literal["drop", "keep"]
_TRIGGER_SHARE = 0.1
"""Default trigger as a share of the largest force."""
_MAX_IN_WARNING = 5
"""Most hits listed in a warning; the notes list all of them."""
_EARLY = 0.5
"""Share of the median time between hits below which a hit is early and does not shorten the blocks."""
_MIN_LAST_BLOCK = 0.8
"""Share of the usual block left after the last hit above which all blocks are shortened to it."""
_LEAST_BEFORE = 8
"""Least samples before a hit for an estimate of the noise."""
_OVERLOAD = 0.98
"""Share of full scale that counts as an overload, because filters round off the corners of a clipped signal."""
_RINGING = 3.0
"""Response before a hit, relative to the lowest of all hits, above which an earlier hit is still ringing,"""
_RINGING_SHARE = 3e-3
"""and relative to the largest response."""
_SECOND_CONTACT = 0.02
"""Least peak of a second contact relative to the first."""
_FAR_ABOVE = 5.0
"""Peak of a hit, relative to the median of the others, that may be an overload where its gain deviates as well."""


def find_hits(
    records: HammerRecords | Sequence[HammerRecords],
    *,
    trigger: float | None = None,
    duration_s: float | None = None,
    pre_trigger_s: float = 0.01,
    one_per_record: bool | None = None,
    double_hit_loss_db: float = 3.0,
    deviating_hits: DeviatingHits = "drop",
    separation_s: float = 0.1,
) -> Hits:
    """Find the hits in records, and keep or drop each with a reason.

    A hit begins where the force exceeds the trigger. A second contact within its block is a pulse of the same shape,
    detected by a matched filter down to 2 % of its peak or six times the noise, without the frequencies at which a
    recorder's anti-alias filter rings. The hit is dropped if the second contact takes more than `double_hit_loss_db`
    from the force's spectrum. It is dropped as well if a channel is overloaded (98 % of a given full scale, or a flat
    top), if the record does not contain its whole block, and if its FRF has another sign or gain than those of the
    other hits, or none.

    Parameters
    ----------
    records : HammerRecords or sequence of HammerRecords
        One record with several hits, or several records with a hit each, which may have different lengths.
    trigger : float, optional
        Force in N at which a hit begins; by default a tenth of the largest in the record, at least six times the noise.
    duration_s : float, optional
        Length of a block; by default the whole record if each holds a single hit, else the time between hits.
    pre_trigger_s : float, optional
        Time from the beginning of a block to the trigger, in records with several hits.
    one_per_record : bool, optional
        Whether each record is the block of a single hit; by default if there are several records.
    double_hit_loss_db : float, optional
        Largest loss of a double hit that is kept: depth in dB of the deepest dip of the force's spectrum, down to 20 dB
        below its maximum. A second contact with the share a of the force causes (1 - a) / (1 + a). The force window of
        a kept hit spans all contacts. 0 drops every double hit, infinity keeps all.
    deviating_hits : {"drop", "keep"}, optional
        Whether to drop a hit whose FRF contradicts those of the majority (`receptance.hammer.agreement`), or to
        keep it with a note.
    separation_s : float, optional
        In a record with several hits, contacts closer than this are a double hit.

    Returns
    -------
    Hits
        All hits; `print(hits)` shows them as a table.

    Raises
    ------
    TypeError, ValueError
        No records, records of different measurements, or invalid settings.

    Warns
    -----
    ReceptanceWarning
        Dropped hits, pulses of negative force, hits that contradict each other, and a response still ringing from an
        earlier hit.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.hammer import HammerRecords, find_hits
    >>> time = np.arange(3 * 8192) / 8192.0
    >>> force = sum(np.where(abs(time - t) < 1e-3, 80.0 * np.cos(500 * np.pi * (time - t)), 0.0) for t in (0.4, 1.5))
    >>> records = HammerRecords(force=force, response=np.sin(2e3 * time), sample_rate_hz=8192.0, quantity="velocity")
    >>> find_hits(records, pre_trigger_s=0.1)
    Hits(2 of 2 kept, blocks of 1.09998 s)
    """
    settings = _Settings(
        trigger, duration_s, pre_trigger_s, one_per_record, double_hit_loss_db, deviating_hits, separation_s
    )
    checked = _checked_records(records)
    search = _Search(checked, settings)
    classified = [search.classify(number, *place) for number, place in enumerate(search.candidates(), start=1)]
    hits = tuple(search.compared(classified))
    notes = dict.fromkeys(note for record in checked for note in record.notes)
    messages = [f"hit {hit.number} dropped: {hit.reason}" for hit in hits if not hit.kept]
    messages += [f"hit {hit.number}: {hit.note}" for hit in hits if hit.kept and hit.note]
    if search.polarity < 0.0:
        messages.append(
            "the hammer's pulses are negative: the force is used as recorded, so the FRF has the opposite sign if the "
            "polarity of the channel is reversed (then give -force)"
        )
    if messages:
        label = f"{checked[0].label}: " if checked[0].label else ""
        more = len(messages) - _MAX_IN_WARNING
        shown = [*messages[:_MAX_IN_WARNING], f"and {more} more, see the notes"] if more > 0 else messages
        warn_user(label + "; ".join(shown))
    return Hits(checked, hits, search.n_samples, search.noise, (*notes, *messages))


@dataclass(frozen=True)
class _Settings:
    """Validated parameters of `find_hits`."""

    trigger: float | None
    duration_s: float | None
    pre_trigger_s: float
    one_per_record: bool | None
    double_hit_loss_db: float
    deviating_hits: DeviatingHits
    separation_s: float

    def __post_init__(self) -> None:
        for name in ("trigger", "duration_s", "separation_s"):
            if getattr(self, name) is not None:
                _checks.positive("find_hits", name, getattr(self, name))
        _checks.not_negative("find_hits", "pre_trigger_s", self.pre_trigger_s, unit="s")
        if self.duration_s is not None and self.pre_trigger_s >= self.duration_s:
            raise ValueError(
                f"find_hits: pre_trigger_s is {self.pre_trigger_s:g} s, expected less than duration_s, "
                f"{self.duration_s:g} s"
            )
        if not self.double_hit_loss_db >= 0.0:
            raise ValueError(f"find_hits: double_hit_loss_db is {self.double_hit_loss_db!r}, expected zero or more dB")
        _checks.one_of("find_hits", "deviating_hits", self.deviating_hits, DeviatingHits)


@dataclass(frozen=True)
class _SecondPulse:
    """Second pulse of a hit: first sample, peak over the contact's, end of the last pulse, loss of the spectrum."""

    onset: int
    share: float
    release: int
    loss_db: float


class _Search:
    """Records without offset and with positive pulses, and the contacts in them."""

    def __init__(self, records: tuple[HammerRecords, ...], settings: _Settings) -> None:
        self.settings = settings
        self.rate = records[0].sample_rate_hz
        self.records = [record for record in records for _ in range(record.n_records)]
        self.responses = [row[1] for row in single_records(records)]
        levels = [noise_level(row[0]) for row in single_records(records)]
        forces = [row[0] - level[0] for row, level in zip(single_records(records), levels, strict=True)]
        self.polarity = 1.0 if sum(force.max() + force.min() for force in forces) >= 0.0 else -1.0
        self.forces = [self.polarity * force for force in forces]
        self.noise = float(np.median([level[1] for level in levels]))
        self.single = len(forces) > 1 if settings.one_per_record is None else settings.one_per_record
        self.groups = [self._contact_groups(force, level[1]) for force, level in zip(self.forces, levels, strict=True)]
        self.n_samples = self._block_length()
        self._lowest_levels = self._pre_trigger_levels()

    def _contact_groups(self, force: NDArray[np.float64], noise: float) -> list[list[Contact]]:
        """Return the contacts of one record, grouped by hit."""
        trigger = self.settings.trigger
        if trigger is None:
            trigger = max(_TRIGGER_SHARE * float(force.max()), NOISE_PEAK * noise)
        groups: list[list[Contact]] = []
        for contact in find_contacts(force, trigger, noise):
            near = groups and contact.onset - groups[-1][-1].onset < self.settings.separation_s * self.rate
            if groups and (self.single or near):
                groups[-1].append(contact)
            else:
                groups.append([contact])
        return groups

    def _start(self, onset: int) -> int:
        if self.single and self.settings.duration_s is None:
            return 0
        return max(0, onset - round(self.settings.pre_trigger_s * self.rate))

    def _block_length(self) -> int:
        shortest = min(force.size for force in self.forces)
        if self.settings.duration_s is not None:
            n_samples = round(self.settings.duration_s * self.rate)
            if not 16 <= n_samples <= shortest:
                raise ValueError(
                    f"find_hits: duration_s is {self.settings.duration_s:g} s, {n_samples} samples, expected "
                    f"16 samples to the {shortest / self.rate:g} s of the shortest record"
                )
            return n_samples
        if self.single:
            return shortest
        gaps, available = [], []
        for force, groups in zip(self.forces, self.groups, strict=True):
            onsets = [group[0].onset for group in groups]
            gaps += np.diff(onsets).tolist()
            available += [force.size - self._start(onset) for onset in onsets[-1:]]
        # An early hit must not shorten all blocks: only the hit before it is dropped.
        usual = [gap for gap in gaps if gap >= _EARLY * float(np.median(gaps))]
        last = [samples for samples in available if not usual or samples >= _MIN_LAST_BLOCK * min(usual)]
        return int(min([*usual, *last], default=shortest))

    def _pre_trigger_levels(self) -> NDArray[np.float64]:
        levels = [
            np.std(self._pre_trigger(row, group[0]), axis=0)
            for row, groups in enumerate(self.groups)
            for group in groups
            if len(self._pre_trigger(row, group[0])) >= _LEAST_BEFORE
        ]
        return np.min(levels, axis=0) if levels else np.full(self.responses[0].shape[1], np.inf)

    def _pre_trigger(self, row: int, contact: Contact) -> NDArray[np.float64]:
        return self.responses[row][self._start(contact.onset) : max(0, contact.onset - CLEAR)]

    def candidates(self) -> Iterator[tuple[int, int]]:
        """Yield record and number within the record of every hit; -1 for a record without hits."""
        for row, groups in enumerate(self.groups):
            yield from ((row, index) for index in range(len(groups)))
            if not groups:
                yield row, -1

    def classify(self, number: int, row: int, index: int) -> Hit:
        """Return a hit with the reason to drop it, if any."""
        if index < 0:
            force = self.forces[row]
            reason = f"no hit: the largest force, {force.max():.3g}, is below trigger or noise"
            return Hit(number, row, 0.0, float(force.max()), 0.0, 0, 0, 0, reason)
        contacts = self.groups[row][index]
        first = contacts[0]
        hit = Hit(
            number=number,
            record=row,
            time_s=first.onset / self.rate,
            peak=self.polarity * first.peak,
            contact_s=(first.release - first.onset) / self.rate,
            onset=first.onset,
            release=first.release,
            start=self._start(first.onset),
        )
        stop = hit.start + self.n_samples
        overload, equal_samples = self._overload(row, hit.start, stop)
        reason = self._truncated(row, hit, stop) or overload or self._next_hit(row, index, stop)
        second = self._second_pulse(row, index, stop)
        second_note = ""
        if second is not None:
            delay_ms = 1e3 * (second.onset - first.onset) / self.rate
            text = (
                f"{percent(second.share)} of the force {delay_ms:.3g} ms later "
                f"takes up to {second.loss_db:.2g} dB from the force's spectrum"
            )
            if second.loss_db < self.settings.double_hit_loss_db:
                hit = replace(hit, release=second.release)
                second_note = f"a second pulse (a contact, or ringing of a filter) with {text}"
            else:
                limit = f"double_hit_loss_db is {self.settings.double_hit_loss_db:g}"
                reason = reason or f"double hit: a contact with {text} ({limit})"
        notes = (second_note, equal_samples, self._ringing(row, first, stop))
        return replace(hit, reason=reason, note="; ".join(text for text in notes if text))

    def compared(self, hits: Sequence[Hit]) -> list[Hit]:
        """Return the hits, those that contradict the other kept ones with the reason, or a note."""
        kept = [index for index, hit in enumerate(hits) if hit.kept]
        cuts = [(hits[index].record, slice(hits[index].start, hits[index].start + self.n_samples)) for index in kept]
        if len(cuts) < 2:
            return list(hits)
        force = np.array([self.forces[row][cut] for row, cut in cuts])
        deviations = agreement.deviating_hits(force, np.array([self.responses[row][cut] for row, cut in cuts]))
        compared = list(hits)
        for position, deviation in deviations.items():
            hit = hits[kept[position]]
            others = np.median([abs(hits[index].peak) for index in kept if index != kept[position]])
            text = self._contradiction(deviation, len(cuts) == 2, abs(hit.peak), float(others))
            if len(cuts) == 2 or self.settings.deviating_hits == "keep":
                compared[kept[position]] = replace(hit, note="; ".join(filter(None, (hit.note, text))))
            else:
                compared[kept[position]] = replace(hit, reason=f'{text} (deviating_hits = "keep" keeps it)')
        return compared

    def _contradiction(self, deviation: agreement.HitDeviation, pair: bool, peak: float, others: float) -> str:
        """Return the sentence on a hit whose FRF differs from the others."""
        other = "the other hit" if pair else "the other hits"
        channel = "" if self.responses[0].shape[1] == 1 else f" of channel {deviation.channel}"
        if deviation.fault is agreement.Fault.REVERSED:
            return f"its response{channel} has the opposite sign to {other}: hit from the other side, or polarity"
        if deviation.fault is agreement.Fault.UNRELATED:
            return f"its response{channel} does not belong to its force, unlike {other}: check cable and trigger"
        if pair:
            ratio = max(deviation.gain, 1.0 / deviation.gain)
            return f"the FRFs{channel} of the two hits differ by a factor of {ratio:.3g}: one of them is wrong"
        text = f"its FRF{channel} is {deviation.gain:.2g} times that of {other}: another gain, range or place"
        if peak > _FAR_ABOVE * others:
            text += f", or an overload: its force reaches {peak:.4g}, that of {other} {others:.4g}"
        return text

    def _truncated(self, row: int, hit: Hit, stop: int) -> str:
        if hit.onset == 0:
            return "truncated: the record begins within the contact"
        if hit.release > stop:
            return f"truncated: the contact does not end within the block of {self.n_samples / self.rate:.3g} s"
        missing = stop - self.forces[row].size
        return f"truncated: the record ends {missing / self.rate:.3g} s before the block" if missing > 0 else ""

    def _overload(self, row: int, start: int, stop: int) -> tuple[str, str]:
        """Return the description of an overload, or an empty text, and of two equal samples that may be one."""
        channels = [("the force", "full_scale_force", self.forces[row][start:stop], self.records[row].full_scale_force)]
        limits = self.records[row].full_scale_response
        for index, response in enumerate(self.responses[row][start:stop].T):
            name = "the response" if self.responses[row].shape[1] == 1 else f"response channel {index}"
            channels.append((name, "full_scale_response", response, None if limits is None else float(limits[index])))
        question = ""
        for name, option, values, limit in channels:
            largest = float(np.abs(values).max(initial=0.0))
            if limit is not None and largest >= _OVERLOAD * limit:
                return f"overload: {name} reaches {largest:.4g}, full scale is {limit:.4g}", ""
            count = clipped_samples(values) if values.size else 0
            if count >= _FLAT_SAMPLES:
                return f"overload: {name} has a flat top of {count} samples at {largest:.4g}", ""
            if count and limit is None:
                question = (
                    f"the two largest samples of {name} are equal, {largest:.4g}: an overload? ({option} decides)"
                )
        return "", question

    def _next_hit(self, row: int, index: int, stop: int) -> str:
        later = self.groups[row][index + 1 :]
        if not later or later[0][0].onset >= stop:
            return ""
        delay = (later[0][0].onset - self.groups[row][index][0].onset) / self.rate
        return f"the next hit follows after {delay:.3g} s, within the block"

    def _second_pulse(self, row: int, index: int, stop: int) -> _SecondPulse | None:
        """Return the largest pulse after the first contact of a hit, if there is one."""
        contacts = self.groups[row][index]
        first = contacts[0]
        later = self.groups[row][index + 1 :]
        end = min([stop, *(group[0].onset for group in later)])
        others = [contact for contact in contacts[1:] if contact.onset < end]
        others = [contact for contact in others if contact.peak >= _SECOND_CONTACT * first.peak]
        pulses = [(contact.onset, contact.peak / first.peak) for contact in others]
        release = max([first.release, *(contact.release for contact in others)])
        matched = second_contact(self.forces[row], first, end, _SECOND_CONTACT)
        if matched is not None and not pulses:
            pulses.append(matched)
            release = max(release, matched[0] + first.release - first.onset)
        if not pulses:
            return None
        onset, share = max(pulses, key=lambda pulse: pulse[1])
        return _SecondPulse(onset, share, release, spectrum_loss_db(self.forces[row][first.onset : release]))

    def _ringing(self, row: int, contact: Contact, stop: int) -> str:
        before = self._pre_trigger(row, contact)
        if len(before) < _LEAST_BEFORE:
            return ""
        largest = np.abs(self.responses[row][contact.onset : stop]).max(axis=0, initial=0.0)
        level = np.std(before, axis=0)
        worst = int(np.argmax(level / np.maximum(self._lowest_levels, 1e-60)))
        if level[worst] <= _RINGING * self._lowest_levels[worst] or level[worst] <= _RINGING_SHARE * largest[worst]:
            return ""
        if largest[worst] == 0.0:
            return "the response is zero after the hit"
        share = 100.0 * level[worst] / largest[worst]
        return f"the response before it is {share:.2g} % of the largest: it is from an earlier hit"


def _checked_records(records: HammerRecords | Sequence[HammerRecords]) -> tuple[HammerRecords, ...]:
    checked = _checks.items("find_hits: records", records, HammerRecords)
    for name in ("n_channels", "sample_rate_hz", "quantity", "excitation", "responses", "response_decay_rate"):
        first = getattr(checked[0], name)
        for index, record in enumerate(checked):
            if (value := getattr(record, name)) != first:
                raise ValueError(
                    f"find_hits: {name} is {first!r} in records[0] and {value!r} in records[{index}]; averaged hits "
                    "must belong to the same measurement"
                )
    return checked
