"""FRFs of a campaign from files: measured FRFs, and records of hammer hits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance import units
from receptance._text import shown
from receptance.campaign.values import parse_share
from receptance.identification import MeasuredFRF
from receptance.identification.observations import altered
from receptance.units import FORMS, parse

if TYPE_CHECKING:
    from receptance.campaign.schema import FileFields, FRFTable, HammerTable
    from receptance.frf import FRF
    from receptance.measurement import HammerRecords
    from receptance.model.assembly import Assembly
    from receptance.model.coordinates import Coordinate

__all__ = [
    "estimate_hammer_frf",
    "integrate_motion",
    "observed_frf",
    "parse_deviation_share",
    "parse_force_window",
    "read_entry",
    "read_records",
    "restrict_to_bands",
    "with_coordinates",
    "with_stated_variance",
]

_USED_SHARE = 0.9
"""Share of usable lines in a band below which a note is made; a few lines at antiresonances are never usable."""
_EXPECTED_DEVIATION = 'a standard deviation of the FRF in percent, such as "2 %"'


def read_entry(table: FileFields, folder: Path) -> FRF:
    """Return the FRF of a measurement, selected by `entry` if the file holds several.

    Raises
    ------
    ValueError
        The file cannot be read, or holds several responses or excitations and `entry` selects none.
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
        found = _entry(read_all(folder / table.file, **given), table.entry.number)
    found = found.select(responses=table.entry.response, excitations=table.entry.excitation)
    _, n_out, n_in = found.shape
    if (n_out, n_in) != (1, 1):
        names = found.labels or ((), ())
        known = "; ".join(
            f"{what} {', '.join(side) if any(side) else f'0 to {count - 1}'}"
            for what, side, count in (("responses", names[0], n_out), ("excitations", names[1], n_in))
        )
        raise ValueError(
            f"holds {n_out} responses and {n_in} excitations, expected `entry` to select one of each, such as "
            f"`entry = {{ response = 0, excitation = 0 }}`; there are {known}"
        )
    return _with_stated_properties(found, table)


def _entry(things: Sequence[object], number: int) -> FRF:
    from receptance.frf import FRF

    frfs = [thing for thing in things if isinstance(thing, FRF)]
    if number >= len(frfs):
        listed = "; ".join(f"{index}: {frf!r}" for index, frf in enumerate(frfs[:6])) or "none"
        raise ValueError(f"holds {len(frfs)} FRFs, expected `entry.number` to be one of their numbers: {listed}")
    return frfs[number]


def _with_stated_properties(frf: FRF, table: FileFields) -> FRF:
    """Return the FRF with the properties that the campaign states and the file does not."""
    changes: dict[str, Any] = {}
    for key, stated, own in (
        ("averages", table.averages, frf.averages),
        ("decay_rate", table.decay_rate, frf.decay_rate or None),
    ):
        if stated is None:
            continue
        if own is not None and not np.isclose(stated, own, rtol=1e-9):
            raise ValueError(
                f"states {key} {own:g} and the campaign {stated:g}, expected equal values; delete it in the campaign"
            )
        changes[key] = stated
    return frf.with_(**changes) if changes else frf


def parse_deviation_share(written: str | None) -> float | None:
    """Return a relative standard deviation from a percentage, or None."""
    if written is None:
        return None
    share = parse_share(written, _EXPECTED_DEVIATION)
    if share <= 0.0:
        raise ValueError(f'is "{written}", expected more than zero: {_EXPECTED_DEVIATION}')
    return share


def with_stated_variance(frf: FRF, share: float | None) -> FRF:
    """Return the FRF with a variance: the stated one, that of the file, or that from coherence and averages.

    The last is (1 - g^2) / (2 (n - 1) g^2), pooled over neighbouring lines, see `receptance.frf.variance`.

    Parameters
    ----------
    frf : FRF
        The FRF.
    share : float or None
        Stated standard deviation, relative to the magnitude.
    """
    if share is not None:
        return frf.with_(log_variance=share**2, degrees_of_freedom=None)
    from receptance.frf.variance import with_variance

    return with_variance(frf)


def with_coordinates(
    frf: FRF, table: FRFTable | HammerTable, response: Coordinate, excitation: Coordinate, name: str
) -> FRF:
    """Return the FRF with the coordinates and signs that the campaign gives its channels."""
    if table.response.direction[0] != table.excitation.direction[0]:
        frf = frf.flipped()
    return frf.with_(label=name, responses=response, excitations=excitation)


def restrict_to_bands(frf: FRF, bands: Sequence[Sequence[float]]) -> FRF:
    """Return the FRF with only the lines inside the bands usable, and a note on bands with few usable lines.

    Raises
    ------
    ValueError
        The ends of a band are not ascending, or a band has no usable line.
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
        if count < _USED_SHARE * of:
            first, last = lines[inside][[0, -1]]
            notes.append(
                f"of the band from {low:g} to {high:g} Hz {count} of {of} lines are used, from {first:g} to {last:g} "
                "Hz; the others are not usable"
            )
        chosen |= inside
    return frf.with_(usable=chosen, notes=(*frf.notes, *notes))


def observed_frf(
    frf: FRF,
    table: FRFTable | HammerTable,
    assembly: Assembly,
    response: Coordinate,
    excitation: Coordinate,
    floor: float,
) -> MeasuredFRF:
    """Return the observation of an FRF on the lines inside the bands of the campaign.

    Raises
    ------
    ValueError
        There is no usable line, or a stepped sine has the key `ends`.
    """
    force = table.force if table.kind == "frf" else None
    if force is not None and table.ends is not None:
        raise ValueError("has `force`, a key of stepped sines, and `ends`, a key of hammer hits; expected one of them")
    if table.bands is not None:
        frf = restrict_to_bands(frf, table.bands)
    found = MeasuredFRF.from_frf(assembly, frf, response=response, excitation=excitation, floor=floor, force=force)
    return altered(integrate_motion(found, table.integrate), ends=table.ends)


def integrate_motion(one: MeasuredFRF, times: int) -> MeasuredFRF:
    """Return an FRF with its motion integrated so many times, or differentiated if `times` is negative."""
    if not times:
        return one
    index = FORMS.index(one.form) + times
    form = FORMS[index] if 0 <= index < len(FORMS) else one.form
    return altered(one, receptance=one.receptance / (2j * np.pi * one.frequency_hz) ** times, form=form)


Window = float | Literal["auto", "none"]


def parse_force_window(written: str) -> Window:
    """Return the length of the force window in s, "auto" or "none"."""
    if written == "auto":
        return "auto"
    if written == "none":
        return "none"
    try:
        return parse(written, units.TIME)
    except ValueError as error:
        found = str(error).split(", expected", 1)[0]
        text = found or f"is {shown(written)}"
        raise ValueError(f'{text}, expected a time such as "2 ms", "auto" or "none"') from None


def read_records(table: HammerTable, folder: Path) -> list[HammerRecords]:
    """Return the time records of all files of a measurement.

    Raises
    ------
    ValueError
        A file cannot be read, a channel does not exist, or its quantity is unknown or wrong.
    """
    from receptance.io import read_time_series
    from receptance.measurement import HammerRecords

    options: dict[str, Any] = {
        "format": table.format,
        "sample_rate_hz": table.sample_rate,
        "unit": table.units or None,
        "variables": table.variables or None,
        "columns": table.columns or None,
    }
    given = {key: value for key, value in options.items() if value is not None}
    names = [table.file] if isinstance(table.file, str) else table.file
    if not names:
        raise ValueError("is an empty list, expected at least one file")
    return [
        HammerRecords.from_series(
            read_time_series(folder / name, **given),
            force=table.force,
            responses=table.motion,
            excitation=_unsigned(table.excitation.direction),
            at=_unsigned(table.response.direction),
            full_scale_force=table.full_scale_force,
            response_decay_rate=table.response_decay_rate,
            label=name,
        )
        for name in names
    ]


def estimate_hammer_frf(records: list[HammerRecords], table: HammerTable, window: Window) -> FRF:
    """Return the FRF that is estimated from the hits in time records.

    Raises
    ------
    ValueError
        There are no hits, or the settings do not match the records.
    """
    from receptance.measurement import estimate_frf, find_hits

    options: dict[str, Any] = {
        "trigger": table.trigger,
        "duration_s": table.duration,
        "pre_trigger_s": table.pre_trigger,
        "double_hits": table.double_hits,
        "double_share": table.double_share,
        "separation_s": table.separation,
    }
    hits = find_hits(records, **{key: value for key, value in options.items() if value is not None})
    if table.drop_hits:
        hits = hits.without(*table.drop_hits, reason="dropped by the campaign")
    return estimate_frf(
        hits,
        estimator=table.estimator,
        decay_rate=table.decay_rate,
        force_drop_db=table.force_drop_db,
        force_window_s=None if window == "none" else window,
    )


def _unsigned(written: str) -> str:
    return written.removeprefix("+").removeprefix("-")
