"""The command `show`: the contents of a measurement file as text and as a figure."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from receptance.cli.reading import MeasurementNumber, Reading, read_measurements, takes_reading
from receptance.cli.running import InputError, Targets, input_errors, takes_targets

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["NoWindow", "open_figure", "show"]

NoWindow = Annotated[bool, typer.Option("--no-window", help="Do not open the figure in a viewer.")]


@takes_reading()
@takes_targets()
def show(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="File with FRFs, coherences or time records.")],
    reading: Reading,
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
    contents = FileContents(source.name, FORMATS[read_as], tuple(found), tuple(warned))
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
