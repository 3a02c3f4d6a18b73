"""The command `show`: the contents of a measurement file as text and as a figure."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from receptance.cli.reading import MeasurementNumber, Reading, read_measurements, takes_reading
from receptance.cli.running import InputError, Plot, Targets, input_errors, output

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from receptance.io.measurements import Measurement

__all__ = ["NoWindow", "open_figure", "show"]

NoWindow = Annotated[bool, typer.Option("--no-window", help="Do not open the figure in a viewer.")]
_MOST_DRAWN = 4
"""Most measurements of one file in a figure."""


@takes_reading()
def show(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="File with FRFs, coherences or time records.")],
    reading: Reading,
    plot: Plot = None,
    no_window: NoWindow = False,
    number: MeasurementNumber = None,
) -> None:
    """Print what a measurement file contains, and plot it.

    The figure is opened in the default viewer, or saved with --plot.
    """
    from receptance.io.files import FORMATS, file_format
    from receptance.report.terminal import print_sentences, print_table, print_title

    targets = Targets(None, plot)
    targets.protect(source, "the file to show")
    with input_errors():
        found, warned = read_measurements(source, reading, number)
        read_as = reading.source_format or file_format(source)
    console = output()
    for index, measurement in enumerate(found, 1):
        named = f"{index}: {measurement.title}" if len(found) > 1 else f"{source.name}: {measurement.title}"
        print_title(console, named)
        for table in measurement.tables():
            print_table(console, table)
    notes = dict.fromkeys([*warned, *(note for measurement in found for note in measurement.notes)])
    print_sentences(console, [f"Format: {FORMATS[read_as].title}", *(f"Note: {note}" for note in notes)])
    drawn = found[:_MOST_DRAWN]
    if len(drawn) < len(found):
        console.print(
            f"The figure shows the first {len(drawn)} of {len(found)} measurements; --number N shows another.",
            soft_wrap=True,
        )
    if plot is not None:
        targets.write(dict, lambda: draw_measurements(drawn))
        targets.print_names(console)
    elif not no_window:
        open_figure(console, lambda: draw_measurements(drawn), source.stem)


def draw_measurements(found: list[Measurement]) -> Figure:
    """Return one figure with a panel for each measurement."""
    from receptance.report.figure import new_figure

    if len(found) == 1:
        return found[0].plot()
    figure = new_figure(9.0, 4.6 * len(found))
    for axes, measurement in zip(figure.subplots(len(found), 1), found, strict=True):
        measurement.plot(axes)
    return figure


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
