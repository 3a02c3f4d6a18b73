"""Measurement files: the options that read them, and the commands `show` and `convert`."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

import receptance
from receptance import io, report
from receptance._reading import LISTED, REPEATED, Option, ReadingOptions, options_of_texts, reading_options
from receptance.cli.running import (
    InputError,
    Overwrite,
    Targets,
    input_errors,
    output,
    refuse_existing,
    takes_options,
    takes_targets,
)
from receptance.errors import collected_warnings
from receptance.units import form_name

READING = "Reading of files that do not state everything"
"""Group of options in the help."""

MeasurementNumber = Annotated[
    int | None,
    typer.Option(
        "--number", rich_help_panel=READING, min=1, metavar="N", help="Number of the only measurement to take, from 1."
    ),
]


def takes_reading(*, several: bool = False) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of reading in place of its parameter `reading`, the keywords of `read_all`.

    With `several` the command reads several files, and `coherence` is a list with a file for each.
    """
    options = {name: _declared(name, kind, option, several) for name, (kind, option) in reading_options().items()}
    return takes_options("reading", options, _reading_of)


def _declared(name: str, kind: Any, option: Option, several: bool) -> tuple[Any, Any]:
    """Return the type and the default of an option of reading."""
    typed: Any = {bool: bool, float | None: float | None}.get(kind, str | None)
    text = option.text
    if name == "coherence":
        typed = list[Path] | None if several else Path | None
        text += "; once for each file in their order" if several else ""
    elif name in REPEATED:
        typed = list[str] | None
        text += "; may be repeated"
    elif name in LISTED:
        text += "; separated by commas"
    declared = typer.Option(
        f"--{option.option or name.replace('_', '-')}",
        rich_help_panel=READING,
        metavar=option.value or None,
        help=f"{text[0].upper()}{text[1:]}.".replace("[", r"\["),
    )
    return Annotated[typed, declared], False if kind is bool else None


def _reading_of(values: Mapping[str, Any]) -> ReadingOptions:
    with input_errors():
        return options_of_texts(values)


def read_measurements(source: Path, reading: ReadingOptions, number: int | None) -> io.contents.FileContents:
    """Return the contents of a file, or the only measurement of a number from 1."""
    contents = io.contents.FileContents.read(source, **reading)
    measurements = contents.measurements
    if number is None:
        return contents
    if number > len(measurements):
        listed = "; ".join(map(repr, measurements[:6]))
        raise ValueError(f"--number is {number}, but there are {len(measurements)}: {listed}")
    return replace(contents, measurements=(measurements[number - 1],))


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
    targets.protect(source, "the file to show")
    targets.require_new()
    with input_errors():
        contents = read_measurements(source, reading, number)
    targets.show(contents)
    if not no_window and not targets.asked:
        open_figure(targets.console(), contents.plot, source.stem)


def open_figure(console: Console, draw: Any, name: str) -> None:
    """Draw a figure and open it in the default viewer of the desktop; in a pipe only the option is named."""
    if not (sys.stdout.isatty() and sys.stdin.isatty()):
        console.print("No figure in a pipe: --plot FILE.png saves it.", soft_wrap=True)
        return
    try:
        with tempfile.NamedTemporaryFile(prefix=f"{name}-", suffix=".png", delete=False) as file:
            file.write(report.figure.as_image(draw(), "png"))
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
    if target.exists() and source.exists() and target.resolve() == source.resolve():
        raise InputError(f"IN and OUT are both {source}; give two files")
    refuse_existing("OUT", target, overwrite=overwrite)
    with input_errors(), collected_warnings() as further:
        contents = read_measurements(source, reading, number)
        written = [_as_form(thing, form) for thing in contents.measurements]
        io.write(target, written, format=target_format)
    console = output()
    for thing in written:
        console.print(f"{thing!r}", soft_wrap=True)
    for note in dict.fromkeys([*contents.warned, *further, *(note for thing in written for note in thing.notes)]):
        console.print(f"Note: {note}", soft_wrap=True)
    console.print(f"Written: {target}", soft_wrap=True)


def _as_form(thing: io.measurements.Measurement, form: str | None) -> Any:
    if form is None:
        return thing
    name = form_name(form)
    if not isinstance(thing, receptance.FRF):
        raise ValueError(f"--as is {form!r}, but {thing!r} is not an FRF")
    return thing.to(name)
