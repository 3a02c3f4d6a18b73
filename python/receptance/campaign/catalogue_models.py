"""What a campaign file may hold: the machine behind a catalogue of tools and holders."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from receptance import units
from receptance.campaign.models import Table
from receptance.campaign.quantities import Deviation, Spread

__all__ = ["CatalogueSpread", "CatalogueTable"]

_LengthSpread = Annotated[Deviation | None, Spread(units.LENGTH)]


class CatalogueSpread(Table):
    """Standard deviations of the dimensions of every tool of a catalogue; each tool has errors of its own."""

    overhang: _LengthSpread = None
    """of the overhang"""
    diameter: _LengthSpread = None
    """of the diameter of the shank"""
    effective_diameter: _LengthSpread = None
    """of the effective diameter of the flutes"""


class CatalogueTable(Table):
    """Tools and holders in tables of their own, and the machine that they are put into."""

    tools: str | None = None
    """CSV file beside the campaign with a tool in each row; by default the one that the command is given"""
    holders: str | None = None
    """CSV file beside the campaign with a segment of a holder in each row; holders may be parts of this file too"""
    machine: Annotated[list[str], Field(min_length=1)]
    """names of joints and parts behind the holder, from its joint on"""
    attachments: list[str] = Field(default=[])
    """names of masses and ground springs on these parts"""
    spindle: str | None = None
    """file beside the campaign with the receptances of a spindle behind all that: from `write_spindle`, or FRFs"""
    joint: str | None = None
    """name of the joint between tool and holder, where a row names no other"""
    tolerance: CatalogueSpread = CatalogueSpread()
    """standard deviations of the dimensions of tools"""
