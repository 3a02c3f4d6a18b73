"""The command `convert`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from receptance.cli.running import InputError, input_errors, output
from receptance.errors import ReceptanceWarning

if TYPE_CHECKING:
    from receptance import FRF
    from receptance.io import Coherence, TimeSeries

__all__ = ["convert"]

_FORMATS = "uff, csv, npz, mat, hdf5, cutpro or dataphysics"


def convert(
    source: Annotated[Path, typer.Argument(metavar="IN", help="File with FRFs, coherences or time records.")],
    target: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="Output file: .uff, .ufb, .csv, .npz, .mat, .h5 or .frf."),
    ],
    quantity: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Quantity of FRFs if IN does not state it: receptance, mobility or accelerance."
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="UNIT", help="Unit of FRFs, such as m/s^2/N; for time records CHANNEL=UNIT for each channel."
        ),
    ] = None,
    variable: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROLE=NAME",
            help="Variable in MAT, HDF5 or NPZ files of other programs: frequency_hz=NAME, values=NAME, time_s=NAME, "
            "CHANNEL=NAME.",
        ),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(metavar="NAMES", help="Header of a table without one, separated by commas."),
    ] = None,
    coherence: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Another file with the coherence of the FRF.")
    ] = None,
    ignore_coherence: Annotated[
        bool, typer.Option("--ignore-coherence", help="Ignore the coherence of the FRFs.")
    ] = False,
    sample_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Sample rate of time records if IN does not state it.")
    ] = None,
    form: Annotated[
        str | None, typer.Option("--as", metavar="NAME", help="Write FRFs as receptance, mobility or accelerance.")
    ] = None,
    number: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Number of the only measurement to write, from 1.")
    ] = None,
    source_format: Annotated[
        str | None,
        typer.Option("--from", metavar="FORMAT", help=f"Format of IN if its ending does not determine it: {_FORMATS}."),
    ] = None,
    target_format: Annotated[
        str | None, typer.Option("--to", metavar="FORMAT", help="Format of OUT if its ending does not determine it.")
    ] = None,
) -> None:
    """Convert FRFs, coherences and time records to another file format."""
    from receptance.io import read_all, write

    if target.exists() and source.exists() and target.resolve() == source.resolve():
        raise InputError(f"IN and OUT are both {source}; give two files")
    options: dict[str, Any] = {
        "format": source_format,
        "quantity": quantity,
        "unit": _units(unit),
        "variables": _pairs(variable, "--variable", "ROLE=NAME") or None,
        "columns": None if columns is None else columns.split(","),
        "coherence": coherence,
        "ignore_coherence": ignore_coherence,
        "sample_rate_hz": sample_rate,
    }
    with warnings.catch_warnings(record=True) as caught, input_errors():
        warnings.simplefilter("always", ReceptanceWarning)
        found = _chosen(read_all(source, **options), number)
        written = [_as_form(thing, form) for thing in found]
        write(target, written, format=target_format)
    console = output()
    for thing in written:
        console.print(f"{thing!r}", soft_wrap=True)
    notes = [str(warning.message) for warning in caught if issubclass(warning.category, ReceptanceWarning)]
    for note in dict.fromkeys([*notes, *(note for thing in written for note in thing.notes)]):
        console.print(f"Note: {note}", soft_wrap=True)
    console.print(f"Written: {target}", soft_wrap=True)


def _pairs(given: Sequence[str] | None, option: str, form: str) -> dict[str, str]:
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


def _units(given: Sequence[str] | None) -> str | dict[str, str] | None:
    if not given:
        return None
    if len(given) == 1 and "=" not in given[0]:
        return given[0]
    return _pairs(given, "--unit", "one unit, or CHANNEL=UNIT for each channel")


def _chosen(found: list[Any], number: int | None) -> list[Any]:
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
