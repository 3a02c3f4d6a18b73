"""From files with hammer hits against time to an FRF with its variance."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

from receptance import units
from receptance._text import shown
from receptance.units import parse

if TYPE_CHECKING:
    from receptance.campaign.format import HammerTable
    from receptance.frf import FRF
    from receptance.measurement import TimeRecords

__all__ = ["estimate", "read", "window_of"]

Window = float | Literal["auto", "none"]


def window_of(written: str) -> Window:
    """Return how long the force counts in s, "auto" or "none"."""
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


def read(table: HammerTable, folder: FilePath) -> list[TimeRecords]:
    """Return the records of all files that a measurement names.

    Raises
    ------
    ValueError
        A file that cannot be read, a channel that is not there, or one of unknown or wrong quantity.
    """
    from receptance.io import read_time_series
    from receptance.measurement import TimeRecords

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
        TimeRecords.from_series(
            read_time_series(folder / name, **given),
            force=table.force,
            responses=table.motion,
            excitation=_direction(table.excitation.direction),
            at=_direction(table.response.direction),
            full_scale_force=table.full_scale_force,
            response_decay_rate=table.response_decay_rate,
            label=name,
        )
        for name in names
    ]


def estimate(records: list[TimeRecords], table: HammerTable, window: Window) -> FRF:
    """Return the FRF of the hits in the records.

    Raises
    ------
    ValueError
        No hit that is kept, or settings that do not fit the records.
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


def _direction(written: str) -> str:
    return written.removeprefix("+").removeprefix("-")
