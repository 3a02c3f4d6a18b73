"""What a campaign file may hold: how a file with a frequency response function is read."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from receptance import units
from receptance.campaign.models import Table
from receptance.campaign.quantities import Amount, OneOf

__all__ = ["Band", "EntryTable", "FileFields", "FrequencyOrZero"]

FrequencyOrZero = Annotated[float, Amount(units.FREQUENCY_OR_ZERO)]
Band = Annotated[list[FrequencyOrZero], Field(min_length=2, max_length=2)]
_Which = Annotated[str | int | None, OneOf(str, int, what="a number from 0 or a name in the file")]


class EntryTable(Table):
    """Which part of a file with several FRFs, responses or excitations is meant."""

    number: Annotated[int, Field(ge=0)] | None = None
    """number from 0 of the FRF, where the file holds several"""
    response: _Which = None
    """number from 0 of the response, or its name in the file"""
    excitation: _Which = None
    """number from 0 of the excitation, or its name in the file"""


class FileFields(Table):
    """A file with an FRF, and what it does not say itself; the base of tables that name one."""

    file: str
    """file beside the campaign: UFF58, CSV, NPZ, MAT, HDF5, `.frf`, DataPhysics ASCII"""
    format: str | None = None
    """format of the file where its ending does not tell"""
    quantity: Literal["receptance", "mobility", "accelerance"] | None = None
    """what was measured, where the file does not say"""
    unit: str | None = None
    """its unit, where the file does not say, such as `"m/s^2/N"`"""
    entry: EntryTable = EntryTable()
    """which part of the file, where it holds several FRFs, responses or excitations"""
    coherence: str | None = None
    """another file with the coherence"""
    ignore_coherence: bool = False
    """read the FRF without its coherence, where that is worth nothing"""
    variables: dict[str, str] = Field(default={})
    """which variables of an NPZ, MAT or HDF5 file of another program are `frequency_hz`, `values`, `coherence`"""
    columns: list[str] = Field(default=[])
    """header of a table that has none, `["frequency [Hz]", "accelerance real [m/s^2/N]", ...]`"""
    averages: Annotated[int, Field(ge=1)] | None = None
    """how many hits were averaged, where the file does not say"""
    standard_deviation: str | None = None
    """of the FRF on every line, such as `"2 %"`; by default from the file's variance, or from coherence and averages"""
    decay_rate: Annotated[float, Amount(units.DECAY_RATE)] | None = None
    """of an exponential window on both channels, where the file does not say"""
