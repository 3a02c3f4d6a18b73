"""Measurement files: the options that read them, and the commands `show` and `convert`."""

from __future__ import annotations

import inspect
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from receptance.cli.running import (
    InputError,
    Overwrite,
    Targets,
    input_errors,
    output,
    refuse_existing,
    takes_targets,
    with_parameters,
)
from receptance.errors import ReceptanceWarning

if TYPE_CHECKING:
    from rich.console import Console

    from receptance import FRF
    from receptance.io import Coherence, TimeSeries
    from receptance.io.measurements import Measurement

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
class ReadingOptions:
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
    """Give a command the options of `ReadingOptions`, but for some, in place of its parameter `reading`."""

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        options = [one for one in fields(ReadingOptions) if one.name not in without]
        hints = get_type_hints(ReadingOptions, include_extras=True)

        def called(**values: Any) -> None:
            command(reading=ReadingOptions(**{one.name: values.pop(one.name) for one in options}), **values)

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


def read_measurements(source: Path, reading: ReadingOptions, number: int | None) -> tuple[list[Measurement], list[str]]:
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


# Commands -------------------------------------------------------------------------------------------------------------

NoWindow = Annotated[bool, typer.Option("--no-window", help="Do not open the figure in a viewer.")]


@takes_reading()
@takes_targets()
def show(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="File with FRFs, coherences or time records.")],
    reading: ReadingOptions,
    targets: Targets,
    no_window: NoWindow = False,
    number: MeasurementNumber = None,
) -> None:
    """Print what a measurement file contains, and plot it.

    The figure is opened in the default viewer, or saved with --plot.
    """
    from receptance.io.contents import FileContents
    from receptance.io.files import FORMATS, file_format

    targets.protect(source, "the file to show")
    targets.require_new()
    with input_errors():
        found, warned = read_measurements(source, reading, number)
        read_as = reading.source_format or file_format(source)
    contents = FileContents(source.name, FORMATS[read_as].title, tuple(found), tuple(warned))
    targets.show(contents)
    if not no_window and not targets.asked:
        open_figure(targets.console(), contents.plot, source.stem)


def open_figure(console: Console, draw: Any, name: str) -> None:
    """Draw a figure and open it in the default viewer of the desktop; in a pipe only the option is named."""
    if not (sys.stdout.isatty() and sys.stdin.isatty()):
        console.print("No figure in a pipe: --plot FILE.png saves it.", soft_wrap=True)
        return
    from receptance.report.figure import as_image

    try:
        with tempfile.NamedTemporaryFile(prefix=f"{name}-", suffix=".png", delete=False) as file:
            file.write(as_image(draw(), "png"))
    except OSError as error:
        raise InputError(f"the figure cannot be written: {error.strerror or error}; --plot FILE.png saves it") from None
    if typer.launch(file.name) != 0:
        console.print(f"There is no viewer for {file.name}; --plot FILE.png saves the figure.", soft_wrap=True)
    else:
        console.print(f"Figure: {file.name}", soft_wrap=True)


@takes_reading()
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="File with FRFs, coherences or time records.")],
    target: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="Output file: .uff, .ufb, .csv, .npz, .mat, .h5 or .frf."),
    ],
    reading: ReadingOptions,
    form: Annotated[
        str | None, typer.Option("--as", metavar="NAME", help="Write FRFs as receptance, mobility or accelerance.")
    ] = None,
    number: MeasurementNumber = None,
    target_format: Annotated[
        str | None, typer.Option("--to", metavar="FORMAT", help="Format of OUT if its ending does not determine it.")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Convert FRFs, coherences and time records to another file format."""
    from receptance.io import write

    if target.exists() and source.exists() and target.resolve() == source.resolve():
        raise InputError(f"IN and OUT are both {source}; give two files")
    refuse_existing("OUT", target, overwrite=overwrite)
    with input_errors(), collected_warnings() as further:
        found, notes = read_measurements(source, reading, number)
        written = [_as_form(thing, form) for thing in found]
        write(target, written, format=target_format)
    console = output()
    for thing in written:
        console.print(f"{thing!r}", soft_wrap=True)
    for note in dict.fromkeys([*notes, *further, *(note for thing in written for note in thing.notes)]):
        console.print(f"Note: {note}", soft_wrap=True)
    console.print(f"Written: {target}", soft_wrap=True)


def _as_form(thing: FRF | TimeSeries | Coherence, form: str | None) -> Any:
    from receptance import FRF
    from receptance.units import form_name

    if form is None:
        return thing
    name = form_name(form)
    if not isinstance(thing, FRF):
        raise ValueError(f"--as is {form!r}, but {thing!r} is not an FRF")
    return thing.to(name)
