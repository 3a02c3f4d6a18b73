"""Hits: which parts of the records are used, and why the others are not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.measurement.records import TimeRecords

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Hit", "Hits", "rows_of"]


@dataclass(frozen=True)
class Hit:
    """One hit: where it is, how hard, and whether it is used.

    `onset`, `release` and `start` count samples of the record: the contact's first one, the first one after the
    (last) contact, and the first one of the block that is transformed. `reason` says why a hit is dropped and is
    empty for those that are kept; `remark` is what should be known about one that is kept.
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
    remark: str = ""

    @property
    def kept(self) -> bool:
        """Whether the hit is used."""
        return not self.reason


@dataclass(frozen=True, eq=False, repr=False)
class Hits:
    """All hits that were found, each kept or dropped for a reason.

    Attributes
    ----------
    records : tuple of TimeRecords
        Where they were found.
    hits : tuple of Hit
        In order of time.
    n_samples : int
        Length of the block of every hit.
    noise : float
        Standard deviation of the force where no hammer touches, in its SI unit.
    notes : tuple of str
        What was dropped, and why.
    """

    records: tuple[TimeRecords, ...]
    hits: tuple[Hit, ...]
    n_samples: int
    noise: float
    notes: tuple[str, ...]

    @property
    def kept(self) -> tuple[Hit, ...]:
        """Hits that are used."""
        return tuple(hit for hit in self.hits if hit.kept)

    @property
    def dropped(self) -> tuple[Hit, ...]:
        """Hits that are not used, each with its reason."""
        return tuple(hit for hit in self.hits if not hit.kept)

    @property
    def sample_rate_hz(self) -> float:
        """Samples per second."""
        return self.records[0].sample_rate_hz

    @property
    def duration_s(self) -> float:
        """Length of the block of every hit; frequency lines are one over it apart."""
        return self.n_samples / self.sample_rate_hz

    def blocks(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return force `(n_kept, n_samples)` and response `(n_kept, n_samples, n_channels)` as recorded."""
        rows = list(rows_of(self.records))
        cuts = [(rows[hit.record], slice(hit.start, hit.start + self.n_samples)) for hit in self.kept]
        return np.array([row[0][cut] for row, cut in cuts]), np.array([row[1][cut] for row, cut in cuts])

    def without(self, *numbers: int, reason: str = "dropped by hand") -> Hits:
        """Return the same with some hits dropped.

        Raises
        ------
        ValueError
            A number that no hit has, or no reason.
        """
        known = {hit.number for hit in self.hits}
        for number in numbers:
            if number not in known:
                raise ValueError(f"there is no hit {number}; the numbers are 1 to {len(self.hits)}")
        if not reason:
            raise ValueError("reason is empty; say why the hits are dropped")
        changed = [replace(hit, reason=hit.reason or reason) if hit.number in numbers else hit for hit in self.hits]
        added = tuple(f"hit {number} dropped: {reason}" for number in numbers)
        return replace(self, hits=tuple(changed), notes=(*self.notes, *added))

    def table(self) -> str:
        """Return one line of text for each hit."""
        unit = "N" if self.records[0].excitation.direction == "y" else "N m"
        lines = [f"{'hit':>4} {'record':>6} {'time [s]':>9} {'peak [' + unit + ']':>10} {'contact [ms]':>12}  use"]
        for hit in self.hits:
            found = f"{hit.time_s:9.4f} {hit.peak:10.4g} {1e3 * hit.contact_s:12.3g}"
            use = f"dropped: {hit.reason}" if hit.reason else "kept" + (f" ({hit.remark})" if hit.remark else "")
            lines.append(f"{hit.number:4d} {hit.record + 1:6d} {found}  {use}")
        return "\n".join(lines)

    def __len__(self) -> int:
        return len(self.kept)

    def __str__(self) -> str:
        return self.table()

    def __repr__(self) -> str:
        dropped = "".join(f"; hit {hit.number} dropped: {hit.reason}" for hit in self.dropped)
        return f"Hits({len(self.kept)} of {len(self.hits)} kept, blocks of {self.duration_s:g} s{dropped})"


def rows_of(records: Sequence[TimeRecords]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield force `(n,)` and response `(n, n_channels)` of every single record."""
    for one in records:
        yield from zip(one.force, one.response, strict=True)
