"""The command `convert`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from receptance.cli.reading import MeasurementNumber, Reading, collected_warnings, read_measurements, takes_reading
from receptance.cli.running import InputError, Overwrite, input_errors, output, refuse_existing

if TYPE_CHECKING:
    from receptance import FRF
    from receptance.io import Coherence, TimeSeries

__all__ = ["convert"]


@takes_reading()
def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="File with FRFs, coherences or time records.")],
    target: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="Output file: .uff, .ufb, .csv, .npz, .mat, .h5 or .frf."),
    ],
    reading: Reading,
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
