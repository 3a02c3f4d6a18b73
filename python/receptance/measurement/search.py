"""The search for hits in records, and the judgement of each."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.measurement.contacts import Contact, find_contacts, flat_top, noise_level, second_contact
from receptance.measurement.hits import Hit, Hits, rows_of
from receptance.measurement.records import TimeRecords

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Settings", "find", "find_hits"]

DoubleHits = Literal["drop", "keep"]
_TRIGGER_SHARE = 0.1
"""Of the largest force."""
_TRIGGER_NOISE = 6.0
"""Standard deviations of the noise that a trigger is above: once in 1e9 samples noise is."""
_SAID_AT_ONCE = 5
"""Hits of which a warning speaks one by one; the notes have all of them."""
_EARLY = 0.5
"""Of the usual time between hits; what comes sooner is an accident, not the rhythm."""
_CUT_OFF = 0.8
"""Of the usual block that must be left after the last hit for the blocks to be shortened to it."""
_LEAST_BEFORE = 8
"""Samples before a hit that tell anything of the noise there."""
_CLEAR = 2
"""Samples left out before a contact: its foot is below the edge that is found."""
_OVERLOAD = 0.98
"""Share of full scale from which on a value counts as overloaded: filters round off the corner of a clipped wave."""
_RINGING = 3.0
"""Response before a hit, over the quietest, from which on an earlier hit is said to ring on,"""
_RINGING_SHARE = 3e-3
"""and over the largest response."""


def find_hits(
    records: TimeRecords | Sequence[TimeRecords],
    *,
    trigger: float | None = None,
    duration_s: float | None = None,
    pre_trigger_s: float = 0.01,
    one_per_record: bool | None = None,
    double_hits: DoubleHits = "drop",
    double_share: float = 0.02,
    separation_s: float = 0.1,
) -> Hits:
    """Find the hits in records and say of each whether it is kept or dropped, and why.

    A hit begins where the force passes the trigger. It is dropped where the hammer touches again inside its block (a
    second pulse of the first one's shape, looked for with a matched filter down to `double_share` of its peak or six
    times the noise, without the frequencies at which a recorder's anti-alias filter rings), where a channel is
    overloaded (98 % of a full scale that was given, or a flat top), and where the record does not hold all of its
    block.

    Parameters
    ----------
    records : TimeRecords or sequence of TimeRecords
        One record with several hits, or several with one each; a sequence may have records of different lengths.
    trigger : float, optional
        Force in N that begins a hit; by default a tenth of the record's largest, and at least six times the noise.
    duration_s : float, optional
        Length of a block; by default the whole record where each holds one hit, else what is free between hits.
    pre_trigger_s : float, optional
        How long before the trigger a block begins, where a record holds several hits.
    one_per_record : bool, optional
        Whether each record is the block of one hit; by default where there are several records.
    double_hits : {"drop", "keep"}, optional
        What to do with them. A kept one is valid as long as the force window spans all contacts, which it then does.
    double_share : float, optional
        Smallest second contact that counts, as a share of the first one's peak.
    separation_s : float, optional
        In a record with several hits: contacts closer than this are one double hit, others are hits of their own.

    Returns
    -------
    Hits
        All hits, also as a table: `print(hits)`.

    Raises
    ------
    TypeError, ValueError
        No records, records that do not belong together, or unusable settings.

    Warns
    -----
    ReceptanceWarning
        Hits that are dropped, pulses of negative force, and an earlier hit that still rings.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.measurement import TimeRecords, find_hits
    >>> time = np.arange(3 * 8192) / 8192.0
    >>> force = sum(np.where(abs(time - t) < 1e-3, 80.0 * np.cos(500 * np.pi * (time - t)), 0.0) for t in (0.4, 1.5))
    >>> records = TimeRecords(force=force, response=np.sin(2e3 * time), sample_rate_hz=8192.0, quantity="velocity")
    >>> print(find_hits(records, pre_trigger_s=0.1))
     hit record  time [s]   peak [N] contact [ms]  use
       1      1    0.3990      79.94         1.95  kept
       2      1    1.4990         80         2.08  kept
    """
    settings = Settings(trigger, duration_s, pre_trigger_s, one_per_record, double_hits, double_share, separation_s)
    return find(records, settings, stacklevel=3)


@dataclass(frozen=True)
class Settings:
    """The parameters of `find_hits`, checked."""

    trigger: float | None = None
    duration_s: float | None = None
    pre_trigger_s: float = 0.01
    one_per_record: bool | None = None
    double_hits: DoubleHits = "drop"
    double_share: float = 0.02
    separation_s: float = 0.1

    def __post_init__(self) -> None:
        for name in ("trigger", "duration_s", "double_share", "separation_s"):
            if getattr(self, name) is not None:
                _checks.positive("find_hits", name, getattr(self, name))
        _checks.not_negative("find_hits", "pre_trigger_s", self.pre_trigger_s, unit="s")
        if self.duration_s is not None and self.pre_trigger_s >= self.duration_s:
            raise ValueError(
                f"find_hits: pre_trigger_s is {self.pre_trigger_s:g} s, expected less than duration_s, "
                f"{self.duration_s:g} s"
            )
        if self.double_hits not in get_args(DoubleHits):
            raise ValueError(f"find_hits: double_hits is {self.double_hits!r}, expected one of drop, keep")


def find(records: TimeRecords | Sequence[TimeRecords], settings: Settings, *, stacklevel: int) -> Hits:
    """Find hits; see `find_hits`."""
    together = _together(records)
    search = _Search(together, settings)
    hits = tuple(search.judge(number, *found) for number, found in enumerate(search.candidates(), start=1))
    notes = dict.fromkeys(note for one in together for note in one.notes)
    said = [f"hit {hit.number} dropped: {hit.reason}" for hit in hits if not hit.kept]
    said += [f"hit {hit.number}: {hit.remark}" for hit in hits if hit.kept and hit.remark]
    if search.polarity < 0.0:
        said.append(
            "the hammer's pulses are negative: the force is taken as recorded, so the FRF has the opposite sign if the "
            "channel is of reversed polarity (then give -force)"
        )
    if said:
        label = f"{together[0].label}: " if together[0].label else ""
        more = len(said) - _SAID_AT_ONCE
        shown = [*said[:_SAID_AT_ONCE], f"and {more} more, see the notes"] if more > 0 else said
        warnings.warn(label + "; ".join(shown), ReceptanceWarning, stacklevel=stacklevel)
    return Hits(together, hits, search.n_samples, search.noise, (*notes, *said))


class _Search:
    """All records without offset and with positive pulses, and the contacts in them."""

    def __init__(self, records: tuple[TimeRecords, ...], settings: Settings) -> None:
        self.settings = settings
        self.rate = records[0].sample_rate_hz
        self.owners = [one for one in records for _ in range(one.n_records)]
        self.responses = [row[1] for row in rows_of(records)]
        levels = [noise_level(row[0]) for row in rows_of(records)]
        forces = [row[0] - level[0] for row, level in zip(rows_of(records), levels, strict=True)]
        self.polarity = 1.0 if sum(force.max() + force.min() for force in forces) >= 0.0 else -1.0
        self.forces = [self.polarity * force for force in forces]
        self.noise = float(np.median([level[1] for level in levels]))
        self.single = len(forces) > 1 if settings.one_per_record is None else settings.one_per_record
        self.groups = [self._grouped(force, level[1]) for force, level in zip(self.forces, levels, strict=True)]
        self.n_samples = self._block()
        self._quietest = self._pre_trigger_levels()

    def _grouped(self, force: NDArray[np.float64], noise: float) -> list[list[Contact]]:
        """Return the contacts of one record, those of one hit together."""
        trigger = self.settings.trigger
        if trigger is None:
            trigger = max(_TRIGGER_SHARE * float(force.max()), _TRIGGER_NOISE * noise)
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

    def _block(self) -> int:
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
        gaps, rooms = [], []
        for force, groups in zip(self.forces, self.groups, strict=True):
            onsets = [group[0].onset for group in groups]
            gaps += np.diff(onsets).tolist()
            rooms += [force.size - self._start(onset) for onset in onsets[-1:]]
        # One early hit must not shorten all blocks: it spoils the one before it, and that is said there.
        usual = [gap for gap in gaps if gap >= _EARLY * float(np.median(gaps))]
        whole = [room for room in rooms if not usual or room >= _CUT_OFF * min(usual)]
        return int(min([*usual, *whole], default=shortest))

    def _pre_trigger_levels(self) -> NDArray[np.float64]:
        levels = [
            np.std(self._before(row, group[0]), axis=0)
            for row, groups in enumerate(self.groups)
            for group in groups
            if len(self._before(row, group[0])) >= _LEAST_BEFORE
        ]
        return np.min(levels, axis=0) if levels else np.full(self.responses[0].shape[1], np.inf)

    def _before(self, row: int, contact: Contact) -> NDArray[np.float64]:
        return self.responses[row][self._start(contact.onset) : max(0, contact.onset - _CLEAR)]

    def candidates(self) -> Iterator[tuple[int, int]]:
        """Yield record and place in it of every hit; a record without one yields itself and -1."""
        for row, groups in enumerate(self.groups):
            yield from ((row, place) for place in range(len(groups)))
            if not groups:
                yield row, -1

    def judge(self, number: int, row: int, place: int) -> Hit:
        """Return a hit with what speaks against it."""
        if place < 0:
            force = self.forces[row]
            reason = f"no hit: the largest force is {force.max():.3g}, not above trigger and noise"
            return Hit(number, row, 0.0, float(force.max()), 0.0, 0, 0, 0, reason)
        contacts = self.groups[row][place]
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
        reason = self._cut_off(row, hit, stop) or self._overload(row, hit.start, stop) or self._next(row, place, stop)
        double, release = self._double(row, place, stop)
        if double and self.settings.double_hits == "keep":
            hit = replace(hit, release=release, remark=double)
            double = ""
        ringing = self._ringing(row, first, stop)
        return replace(hit, reason=reason or double, remark="; ".join(text for text in (hit.remark, ringing) if text))

    def _cut_off(self, row: int, hit: Hit, stop: int) -> str:
        if hit.onset == 0:
            return "cut off: the record begins inside the contact"
        if hit.release > stop:
            return f"cut off: the contact is not over when the block of {self.n_samples / self.rate:.3g} s ends"
        missing = stop - self.forces[row].size
        return f"cut off: the record ends {missing / self.rate:.3g} s before the block" if missing > 0 else ""

    def _overload(self, row: int, start: int, stop: int) -> str:
        channels = [("the force", self.forces[row][start:stop], self.owners[row].full_scale_force)]
        limits = self.owners[row].full_scale_response
        for index, response in enumerate(self.responses[row][start:stop].T):
            name = "the response" if self.responses[row].shape[1] == 1 else f"response channel {index}"
            channels.append((name, response, None if limits is None else float(limits[index])))
        for name, values, limit in channels:
            largest = float(np.abs(values).max(initial=0.0))
            if limit is not None and largest >= _OVERLOAD * limit:
                return f"overload: {name} reaches {largest:.4g}, full scale is {limit:.4g}"
            if values.size and (count := flat_top(values)):
                return f"overload: {name} has a flat top of {count} samples at {largest:.4g}"
        return ""

    def _next(self, row: int, place: int, stop: int) -> str:
        later = self.groups[row][place + 1 :]
        if not later or later[0][0].onset >= stop:
            return ""
        after = (later[0][0].onset - self.groups[row][place][0].onset) / self.rate
        return f"the next hit comes after {after:.3g} s, inside the block"

    def _double(self, row: int, place: int, stop: int) -> tuple[str, int]:
        """Return what is wrong, if anything, and the end of the last contact."""
        contacts = self.groups[row][place]
        first = contacts[0]
        later = self.groups[row][place + 1 :]
        end = min([stop, *(group[0].onset for group in later)])
        others = [contact for contact in contacts[1:] if contact.onset < end]
        others = [contact for contact in others if contact.peak >= self.settings.double_share * first.peak]
        found = [(contact.onset, contact.peak / first.peak) for contact in others]
        release = max([first.release, *(contact.release for contact in others)])
        matched = second_contact(self.forces[row], first, end, self.settings.double_share)
        if matched is not None and not found:
            found.append(matched)
            release = max(release, matched[0] + first.release - first.onset)
        if not found:
            return "", release
        onset, share = max(found, key=lambda pair: pair[1])
        after = 1e3 * (onset - first.onset) / self.rate
        return f"double hit: a contact with {100.0 * share:.2g} % of the force {after:.3g} ms later", release

    def _ringing(self, row: int, contact: Contact, stop: int) -> str:
        before = self._before(row, contact)
        if len(before) < _LEAST_BEFORE:
            return ""
        largest = np.abs(self.responses[row][contact.onset : stop]).max(axis=0, initial=0.0)
        level = np.std(before, axis=0)
        worst = int(np.argmax(level / np.maximum(self._quietest, 1e-60)))
        if level[worst] <= _RINGING * self._quietest[worst] or level[worst] <= _RINGING_SHARE * largest[worst]:
            return ""
        if largest[worst] == 0.0:
            return "the response is zero after it"
        share = 100.0 * level[worst] / largest[worst]
        return f"before it the response is {share:.2g} % of its largest: an earlier hit rings on"


def _together(records: TimeRecords | Sequence[TimeRecords]) -> tuple[TimeRecords, ...]:
    found = (records,) if isinstance(records, TimeRecords) else tuple(records)
    if not found:
        raise ValueError("find_hits: there are no records, expected at least one")
    for index, one in enumerate(found):
        if not isinstance(one, TimeRecords):
            raise TypeError(f"find_hits: records[{index}] is {one!r}, expected TimeRecords")
    for name in ("n_channels", "sample_rate_hz", "quantity", "excitation", "responses", "response_decay_rate"):
        for index, one in enumerate(found):
            if getattr(one, name) != getattr(found[0], name):
                raise ValueError(
                    f"find_hits: {name} is {getattr(found[0], name)!r} in records[0] and {getattr(one, name)!r} in "
                    f"records[{index}]; hits that are averaged must be of one measurement"
                )
    return found
