"""What a campaign file may hold: a series of levels, such as drawbar forces."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from receptance.campaign.models import Name, Table, Written

__all__ = ["SeriesTable"]


class SeriesTable(Table):
    """Levels at which the same was measured: tables with `{level}` in their names stand for one table for each."""

    over: Name
    """name of the condition that the levels are of, such as `"drawbar force"`"""
    levels: Annotated[list[Written], Field(min_length=1)]
    """the levels, `["0 kN", "1 kN"]`; `{level}` stands for one as it is written, `{value}` for its number alone"""
    hold_out: list[Written] = Field(default=[])
    """levels whose measurements are held out, written as among the levels"""
