"""Options of commands that read measurement files of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from receptance.cli.running import InputError

__all__ = [
    "FORMATS",
    "CoherenceFile",
    "Columns",
    "FileFormat",
    "IgnoreCoherence",
    "QuantityName",
    "SampleRate",
    "Units",
    "Variables",
    "named_values",
    "read_options",
    "units_of",
]

FORMATS = "uff, csv, npz, mat, hdf5, cutpro or dataphysics"

QuantityName = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="Quantity of FRFs if the file does not state it: receptance, mobility or accelerance."
    ),
]
Units = Annotated[
    list[str] | None,
    typer.Option(metavar="UNIT", help="Unit of FRFs, such as m/s^2/N; for time records CHANNEL=UNIT for each channel."),
]
Variables = Annotated[
    list[str] | None,
    typer.Option(
        metavar="ROLE=NAME",
        help="Variable in MAT, HDF5 or NPZ files of other programs: frequency_hz=NAME, values=NAME, time_s=NAME, "
        "CHANNEL=NAME.",
    ),
]
Columns = Annotated[
    str | None,
    typer.Option(
        metavar="NAMES",
        help="Header with units of a table, separated by commas, if it has none or one with other names: "
        "'frequency [Hz],real [g/N],imag [g/N],coherence'.",
    ),
]
CoherenceFile = Annotated[Path | None, typer.Option(metavar="FILE", help="Another file with the coherence of the FRF.")]
IgnoreCoherence = Annotated[bool, typer.Option("--ignore-coherence", help="Ignore the coherence of the FRFs.")]
SampleRate = Annotated[
    float | None, typer.Option(metavar="HZ", help="Sample rate of time records if the file does not state it.")
]
FileFormat = Annotated[
    str | None,
    typer.Option(
        "--from", metavar="FORMAT", help=f"Format of the file if its ending does not determine it: {FORMATS}."
    ),
]


def read_options(
    *,
    quantity: str | None = None,
    unit: Sequence[str] | None = None,
    variable: Sequence[str] | None = None,
    columns: str | None = None,
    coherence: Path | None = None,
    ignore_coherence: bool = False,
    sample_rate: float | None = None,
    source_format: str | None = None,
) -> dict[str, Any]:
    """Return the options of a command as keyword arguments of `receptance.io.read_all`."""
    return {
        "format": source_format,
        "quantity": quantity,
        "unit": units_of(unit),
        "variables": named_values(variable, "--variable", "ROLE=NAME") or None,
        "columns": None if columns is None else columns.split(","),
        "coherence": coherence,
        "ignore_coherence": ignore_coherence,
        "sample_rate_hz": sample_rate,
    }


def named_values(given: Sequence[str] | None, option: str, form: str) -> dict[str, str]:
    """Return names and values, separated by the last =, because names may contain one and units do not."""
    found: dict[str, str] = {}
    for text in given or ():
        name, sign, value = text.rpartition("=")
        if not sign or not name or not value:
            raise InputError(f"{option} is {text!r}, expected {form}")
        if name in found:
            raise InputError(f"{option} is given twice for {name!r}, expected one")
        found[name] = value
    return found


def units_of(given: Sequence[str] | None) -> str | dict[str, str] | None:
    """Return the unit of FRFs, or the units of channels."""
    if not given:
        return None
    if len(given) == 1 and "=" not in given[0]:
        return given[0]
    return named_values(given, "--unit", "one unit, or CHANNEL=UNIT for each channel")
