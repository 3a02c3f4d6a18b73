"""From a file with an FRF to an observation: read, told what it is, weighed, cut to its bands."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.campaign.quantities import parse_share
from receptance.identification import MeasuredFRF
from receptance.identification.observations import altered
from receptance.units import FORMS

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.campaign.format import FileFields, FRFTable, HammerTable
    from receptance.coordinates import Coordinate
    from receptance.frf import FRF

__all__ = ["deviation_share", "integrated", "observe", "placed", "read", "weighed", "within"]

_MOST = 0.9
"""Share of the lines of a band below which a note says how many are used; a few are lost at antiresonances always."""
_SHARE = 'a standard deviation of the FRF in percent, such as "2 %"'


def read(table: FileFields, folder: FilePath) -> FRF:
    """Return the FRF that a measurement names; one entry of it where the file holds several.

    Raises
    ------
    ValueError
        A file that cannot be read, or several responses or excitations without a word which one is meant.
    """
    from receptance.io import read_all, read_frf

    options: dict[str, Any] = {
        "format": table.format,
        "quantity": table.quantity,
        "unit": table.unit,
        "coherence": None if table.coherence is None else folder / table.coherence,
        "ignore_coherence": table.ignore_coherence or None,
        "variables": table.variables or None,
        "columns": table.columns or None,
    }
    given = {key: value for key, value in options.items() if value is not None}
    if table.entry.number is None:
        found = read_frf(folder / table.file, **given)
    else:
        found = _numbered(read_all(folder / table.file, **given), table.entry.number)
    found = found.select(responses=table.entry.response, excitations=table.entry.excitation)
    _, n_out, n_in = found.shape
    if (n_out, n_in) != (1, 1):
        names = found.labels or ((), ())
        known = "; ".join(
            f"{what} {', '.join(side) if any(side) else f'0 to {count - 1}'}"
            for what, side, count in (("responses", names[0], n_out), ("excitations", names[1], n_in))
        )
        raise ValueError(
            f"holds {n_out} responses and {n_in} excitations, expected `entry` to say which, as in "
            f"`entry = {{ response = 0, excitation = 0 }}`; there are {known}"
        )
    return _told(found, table)


def _numbered(things: Sequence[object], number: int) -> FRF:
    from receptance.frf import FRF

    frfs = [thing for thing in things if isinstance(thing, FRF)]
    if number >= len(frfs):
        listed = "; ".join(f"{index}: {frf!r}" for index, frf in enumerate(frfs[:6])) or "none"
        raise ValueError(f"holds {len(frfs)} FRFs, expected `entry.number` to be one of them, from 0: {listed}")
    return frfs[number]


def _told(frf: FRF, table: FileFields) -> FRF:
    """Return the FRF with what the campaign says of it and the file does not."""
    changes: dict[str, Any] = {}
    for key, told, own in (
        ("averages", table.averages, frf.averages),
        ("decay_rate", table.decay_rate, frf.decay_rate or None),
    ):
        if told is None:
            continue
        if own is not None and not np.isclose(told, own, rtol=1e-9):
            raise ValueError(
                f"says {key} {own:g} and the campaign {told:g}, expected the same; leave it out of the campaign"
            )
        changes[key] = told
    return frf.with_(**changes) if changes else frf


def deviation_share(written: str | None) -> float | None:
    """Return a standard deviation that the campaign states, as a share, or None."""
    if written is None:
        return None
    share = parse_share(written, _SHARE)
    if share <= 0.0:
        raise ValueError(f'is "{written}", expected more than zero: {_SHARE}')
    return share


def weighed(frf: FRF, share: float | None) -> FRF:
    """Return the FRF with a variance: the stated one, the file's, or that of coherence and averages.

    The last is (1 - g^2) / (2 (n - 1) g^2), pooled over neighbouring lines, see `receptance.frf.variance`.
    """
    if share is not None:
        return frf.with_(log_variance=share**2, degrees_of_freedom=None)
    from receptance.frf.variance import with_variance

    return with_variance(frf)


def placed(frf: FRF, table: FRFTable | HammerTable, response: Coordinate, excitation: Coordinate, name: str) -> FRF:
    """Return the FRF with the coordinates and the sign that the campaign gives its channels."""
    if table.response.direction[0] != table.excitation.direction[0]:
        frf = frf.flipped()
    return frf.with_(label=name, responses=response, excitations=excitation)


def within(frf: FRF, bands: Sequence[Sequence[float]]) -> FRF:
    """Return the FRF with its usable lines inside the bands alone as usable ones, and a note where these are few.

    Raises
    ------
    ValueError
        The lower end is not first, or a band has no usable line.
    """
    lines = frf.frequency_hz
    usable = np.ones(lines.size, dtype=np.bool_) if frf.usable is None else frf.usable
    chosen = np.zeros_like(usable)
    notes = []
    for low, high in bands:
        if low >= high:
            raise ValueError(f"has a band from {low:g} to {high:g} Hz, expected the lower end first")
        asked = (lines >= low) & (lines <= high)
        inside = usable & asked
        if not inside.any():
            first, last = lines[usable][[0, -1]] if usable.any() else lines[[0, -1]]
            raise ValueError(
                f"has a band from {low:g} to {high:g} Hz without a usable line, expected one within {first:g} to "
                f"{last:g} Hz"
            )
        count, of = np.count_nonzero(inside), np.count_nonzero(asked)
        if count < _MOST * of:
            first, last = lines[inside][[0, -1]]
            notes.append(
                f"of the band from {low:g} to {high:g} Hz {count} of {of} lines are used, from {first:g} to {last:g} "
                "Hz; the others are not usable"
            )
        chosen |= inside
    return frf.with_(usable=chosen, notes=(*frf.notes, *notes))


def observe(
    frf: FRF,
    table: FRFTable | HammerTable,
    assembly: Assembly,
    response: Coordinate,
    excitation: Coordinate,
    floor: float,
) -> MeasuredFRF:
    """Return the observation: lines inside the bands of the campaign.

    Raises
    ------
    ValueError
            No usable line, a band without one, or an early end of a stepped sine.
    """
    force = table.force if table.kind == "frf" else None
    if force is not None and table.ends is not None:
        raise ValueError("has a force, which belongs to a stepped sine, and ends, which belongs to the record of a hit")
    if table.bands is not None:
        frf = within(frf, table.bands)
    found = MeasuredFRF.from_frf(assembly, frf, response=response, excitation=excitation, floor=floor, force=force)
    return altered(integrated(found, table.integrate), ends=table.ends)


def integrated(one: MeasuredFRF, times: int) -> MeasuredFRF:
    """Return an FRF whose motion is integrated in addition, or differentiated where `times` is negative."""
    if not times:
        return one
    said = FORMS.index(one.form) + times
    form = FORMS[said] if 0 <= said < len(FORMS) else one.form
    return altered(one, receptance=one.receptance / (2j * np.pi * one.frequency_hz) ** times, form=form)
