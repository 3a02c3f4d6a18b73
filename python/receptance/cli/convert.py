"""The command `convert`."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from receptance.cli.reading import (
    CoherenceFile,
    Columns,
    FileFormat,
    IgnoreCoherence,
    QuantityName,
    SampleRate,
    Units,
    Variables,
    read_options,
)
from receptance.cli.running import InputError, input_errors, output
from receptance.errors import ReceptanceWarning

if TYPE_CHECKING:
    from receptance import FRF
    from receptance.io import Coherence, TimeSeries

__all__ = ["chosen", "convert"]


def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="File with FRFs, coherences or time records.")],
    target: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="Output file: .uff, .ufb, .csv, .npz, .mat, .h5 or .frf."),
    ],
    quantity: QuantityName = None,
    unit: Units = None,
    variable: Variables = None,
    columns: Columns = None,
    coherence: CoherenceFile = None,
    ignore_coherence: IgnoreCoherence = False,
    sample_rate: SampleRate = None,
    form: Annotated[
        str | None, typer.Option("--as", metavar="NAME", help="Write FRFs as receptance, mobility or accelerance.")
    ] = None,
    number: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Number of the only measurement to write, from 1.")
    ] = None,
    source_format: FileFormat = None,
    target_format: Annotated[
        str | None, typer.Option("--to", metavar="FORMAT", help="Format of OUT if its ending does not determine it.")
    ] = None,
) -> None:
    """Convert FRFs, coherences and time records to another file format."""
    from receptance.io import read_all, write

    if target.exists() and source.exists() and target.resolve() == source.resolve():
        raise InputError(f"IN and OUT are both {source}; give two files")
    options = read_options(
        quantity=quantity,
        unit=unit,
        variable=variable,
        columns=columns,
        coherence=coherence,
        ignore_coherence=ignore_coherence,
        sample_rate=sample_rate,
        source_format=source_format,
    )
    with warnings.catch_warnings(record=True) as caught, input_errors():
        warnings.simplefilter("always", ReceptanceWarning)
        found = chosen(read_all(source, **options), number)
        written = [_as_form(thing, form) for thing in found]
        write(target, written, format=target_format)
    console = output()
    for thing in written:
        console.print(f"{thing!r}", soft_wrap=True)
    notes = [str(warning.message) for warning in caught if issubclass(warning.category, ReceptanceWarning)]
    for note in dict.fromkeys([*notes, *(note for thing in written for note in thing.notes)]):
        console.print(f"Note: {note}", soft_wrap=True)
    console.print(f"Written: {target}", soft_wrap=True)


def chosen(found: list[Any], number: int | None) -> list[Any]:
    """Return all measurements of a file, or the only one of a number from 1."""
    if number is None:
        return found
    if number > len(found):
        raise ValueError(f"--number is {number}, but there are {len(found)}: {'; '.join(map(repr, found[:6]))}")
    return [found[number - 1]]


def _as_form(thing: FRF | TimeSeries | Coherence, form: str | None) -> Any:
    from receptance import FRF
    from receptance.units import form_name

    if form is None:
        return thing
    name = form_name(form)
    if not isinstance(thing, FRF):
        raise ValueError(f"--as is {form!r}, but {thing!r} is not an FRF")
    return thing.to(name)
