"""Options of commands that read measurement files of other programs."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from receptance.cli.running import InputError, with_parameters
from receptance.errors import ReceptanceWarning

if TYPE_CHECKING:
    from receptance.io.measurements import Measurement

__all__ = ["MeasurementNumber", "Reading", "collected_warnings", "read_measurements", "takes_reading"]

READING = "Reading of files that do not state everything"
"""Group of options in the help."""
FORMATS = "uff, csv, npz, mat, hdf5, cutpro or dataphysics"

MeasurementNumber = Annotated[
    int | None,
    typer.Option(
        "--number", rich_help_panel=READING, min=1, metavar="N", help="Number of the only measurement to take, from 1."
    ),
]


@dataclass(frozen=True)
class Reading:
    """The options of a command that say how to read measurement files; the fields declare them."""

    quantity: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=READING,
            metavar="NAME",
            help="Quantity of FRFs if the file does not state it: receptance, mobility or accelerance.",
        ),
    ] = None
    unit: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=READING,
            metavar="UNIT",
            help="Unit of FRFs, such as m/s^2/N; for time records CHANNEL=UNIT for each channel.",
        ),
    ] = None
    variable: Annotated[
        list[str] | None,
        typer.Option(
            rich_help_panel=READING,
            metavar="ROLE=NAME",
            help="Variable in MAT, HDF5 or NPZ files of other programs: frequency_hz=NAME, values=NAME, time_s=NAME, "
            "CHANNEL=NAME.",
        ),
    ] = None
    columns: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=READING,
            metavar="NAMES",
            help="Header with units of a table, separated by commas, if it has none or one with other names: "
            "'frequency \\[Hz],real \\[g/N],imag \\[g/N],coherence'.",
        ),
    ] = None
    coherence: Annotated[
        Path | None,
        typer.Option(rich_help_panel=READING, metavar="FILE", help="Another file with the coherence of the FRF."),
    ] = None
    ignore_coherence: Annotated[
        bool, typer.Option("--ignore-coherence", rich_help_panel=READING, help="Ignore the coherence of the FRFs.")
    ] = False
    sample_rate: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=READING, metavar="HZ", help="Sample rate of time records if the file does not state it."
        ),
    ] = None
    source_format: Annotated[
        str | None,
        typer.Option(
            "--from",
            rich_help_panel=READING,
            metavar="FORMAT",
            help=f"Format of the file if its ending does not determine it: {FORMATS}.",
        ),
    ] = None

    @property
    def keywords(self) -> dict[str, Any]:
        """Keyword arguments of `receptance.io.read_all`."""
        return {
            "format": self.source_format,
            "quantity": self.quantity,
            "unit": _units_of(self.unit),
            "variables": _named_values(self.variable, "--variable", "ROLE=NAME") or None,
            "columns": None if self.columns is None else self.columns.split(","),
            "coherence": self.coherence,
            "ignore_coherence": self.ignore_coherence,
            "sample_rate_hz": self.sample_rate,
        }


def takes_reading(*without: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of `Reading`, but for some, in place of its parameter `reading`."""

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        options = [one for one in fields(Reading) if one.name not in without]
        hints = get_type_hints(Reading, include_extras=True)

        def called(**values: Any) -> None:
            command(reading=Reading(**{one.name: values.pop(one.name) for one in options}), **values)

        kind = inspect.Parameter.KEYWORD_ONLY
        added = [inspect.Parameter(one.name, kind, default=one.default, annotation=hints[one.name]) for one in options]
        return with_parameters(command, called, added, without="reading")

    return with_options


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Collect the texts of the warnings of readers and writers, in place of showing them."""
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ReceptanceWarning)
        yield notes
    notes += [str(one.message) for one in caught if issubclass(one.category, ReceptanceWarning)]


def read_measurements(source: Path, reading: Reading, number: int | None) -> tuple[list[Measurement], list[str]]:
    """Return all measurements of a file, or the only one of a number from 1, and the warnings of its reader."""
    from receptance.io import read_all

    with collected_warnings() as notes:
        found = read_all(source, **reading.keywords)
    if number is not None and number > len(found):
        raise ValueError(f"--number is {number}, but there are {len(found)}: {'; '.join(map(repr, found[:6]))}")
    return found if number is None else [found[number - 1]], notes


def _named_values(given: Sequence[str] | None, option: str, form: str) -> dict[str, str]:
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


def _units_of(given: Sequence[str] | None) -> str | dict[str, str] | None:
    """Return the unit of FRFs, or the units of channels."""
    if not given:
        return None
    if len(given) == 1 and "=" not in given[0]:
        return given[0]
    return _named_values(given, "--unit", "one unit, or CHANNEL=UNIT for each channel")
