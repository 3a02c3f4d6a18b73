"""The command `catalogue`: the tips of all tools of a catalogue."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.text import Text

from receptance._files import check_target, write_whole
from receptance.cli.campaigns import File, load_campaign
from receptance.cli.running import InputError, Json, Plot, Targets, input_errors, with_progress
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.identification.spread import SAYS_NOTHING
from receptance.report import Column, Table
from receptance.report.terminal import print_table

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from rich.console import Console

    from receptance.campaign import Campaign
    from receptance.catalogue import ToolCut, ToolPrediction
    from receptance.catalogue.writing import Reduced
    from receptance.report.table import Cell

__all__ = ["catalogue"]

_SHOWN = 20
_WIDE = 100.0
_DRAWS = 60
"""For the bands of figures, where a resonance may move by more than its width."""


def catalogue(
    campaign: File,
    tools: Annotated[Path | None, typer.Argument(metavar="TOOLS.csv", help="By default as the campaign says.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.csv", help="Write the modes of all tools with their intervals."),
    ] = None,
    holders: Annotated[
        Path | None, typer.Option("--holders", metavar="FILE.csv", help="Holders; by default as the campaign says.")
    ] = None,
    json_file: Json = None,
    plot: Plot = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="FOLDER", help="Write a figure for each tool, NAME.png.")
    ] = None,
    depths: Annotated[
        Path | None,
        typer.Option("--depths", metavar="FILE.csv", help="Write recommended speeds and depths of all tools."),
    ] = None,
    cut: Annotated[
        str | None, typer.Option("--cut", metavar="NAME", help="Which cut of the campaign, where there are several.")
    ] = None,
    frfs: Annotated[
        Path | None, typer.Option("--frfs", metavar="FOLDER", help="Write the receptance of each tool, NAME.csv.")
    ] = None,
) -> None:
    """Predict the tip of every tool of a catalogue in the machine of a campaign, with intervals of its modes."""
    targets = Targets(json_file, plot)
    for option, path in (("--out", out), ("--depths", depths)):
        if path is not None:
            targets.keep_off(path, f"written by {option}")
            with input_errors():
                check_target(path)
    if out is not None and depths is not None and out.resolve() == depths.resolve():
        raise InputError(f"--out and --depths both name {out}; give two files")
    for folder in (figures, frfs):
        if folder is None:
            continue
        if not folder.is_dir():
            what = f"{folder} is a file" if folder.exists() else f"there is no folder {folder}"
            raise InputError(f"{what}, expected a folder to write one file for each tool to")
        with input_errors():
            check_target(folder / "NAME")
    from receptance.campaign import CampaignError

    begun = time.perf_counter()
    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        for path in _read(read, tools, holders):
            targets.keep_off(path, "read")
            for option, written in (("--out", out), ("--depths", depths)):
                if written is not None and written.resolve() == path.resolve():
                    raise InputError(f"{option} names {written}, which is read; give another file")
        asked = None if depths is None else _asked(read, cut)
        wanted = _Wanted(tools, holders, out, depths, asked, figures, frfs)
        found = with_progress(lambda say: _run(read, wanted, say))

    def draw() -> Figure:
        from receptance.catalogue.figure import draw_catalogue

        return draw_catalogue(found, read.title)

    targets.write(_document(read, found), draw)
    console = targets.console()
    _print(console, found, time.perf_counter() - begun)
    if out is not None:
        console.print(f"Modes: {out}", soft_wrap=True)
    if depths is not None:
        console.print(f"Depths: {depths}", soft_wrap=True)
    for name, folder in (("Figures", figures), ("Receptances", frfs)):
        if folder is not None:
            console.print(f"{name}: {folder}", soft_wrap=True)
    if figures is not None or frfs is not None:
        _print_names(console, found)
    targets.name(console)


@dataclass(frozen=True)
class _Wanted:
    """What is read and what is written."""

    tools: Path | None
    holders: Path | None
    out: Path | None
    depths: Path | None
    cut: ToolCut | None
    figures: Path | None
    frfs: Path | None


def _asked(read: Campaign, name: str | None) -> ToolCut:
    from receptance.catalogue import ToolCut

    if name is None and len(read.cuts) != 1:
        known = f"there are {', '.join(read.cuts)}" if read.cuts else "the campaign has none"
        raise InputError(f"--depths needs one cut, name it with --cut; {known}")
    return ToolCut(read, name or next(iter(read.cuts)))


def _read(read: Campaign, *given: Path | None) -> list[Path]:
    """Return the files that are read."""
    table = read.table.catalogue
    files = (table.tools, table.holders) if table is not None else ()
    folder = read.file.parent
    return [read.file, *(one for one in given if one), *(folder / name for name in files if name)]


def _document(read: Campaign, found: list[Reduced]) -> dict[str, Any]:
    """Return the most flexible mode of each tool as what JSON holds."""
    from receptance.provenance import versions
    from receptance.report.plain import plain

    names = ("frequency_hz", "damping_ratio", "dynamic_stiffness")
    tools = [
        {
            "name": one.name,
            "holder": one.holder,
            "modes": one.modes,
            "most_flexible": None
            if one.values is None or one.interval is None
            else {
                name: {"value": value, "interval": ends}
                for name, value, ends in zip(names, one.values, one.interval, strict=True)
            },
            "notes": one.notes,
        }
        for one in found
    ]
    document: dict[str, Any] = plain(
        {
            "campaign": read.title,
            "file": read.file.name,
            "level": read.table.prediction.level,
            "tools": tools,
            "notes": read.notes,
            "versions": versions(),
        }
    )
    return document


def _run(read: Campaign, wanted: _Wanted, say: Callable[[str], None]) -> list[Reduced]:
    from receptance.catalogue import Catalogue, predict_catalogue
    from receptance.catalogue.cutting import write_depths
    from receptance.catalogue.writing import file_names, reduced, write_modes

    chosen = Catalogue(read, wanted.tools, wanted.holders)
    draws = read.table.stability.number_of_draws if wanted.cut else _DRAWS if wanted.figures else 0
    predictions = predict_catalogue(chosen, draws=draws, seed=read.table.stability.seed, progress=say)
    if wanted.out is not None:
        predictions = write_modes(wanted.out, predictions)
    if wanted.depths is not None and wanted.cut is not None:
        predictions = write_depths(wanted.depths, predictions, wanted.cut)
    if wanted.figures is not None or wanted.frfs is not None:
        names = file_names(row.name for row in chosen.tools)
        predictions = _with_files(predictions, names, wanted.figures, wanted.frfs)
    return list(reduced(predictions))


def _with_files(
    predictions: Iterator[ToolPrediction], names: dict[str, str], figures: Path | None, frfs: Path | None
) -> Iterator[ToolPrediction]:
    """Write the files of each tool while predictions go through."""
    from receptance.catalogue.figure import draw_tool
    from receptance.catalogue.writing import as_frf
    from receptance.io import write
    from receptance.report.figure import as_image

    for one in predictions:
        name = names[one.row.name]
        if figures is not None:
            write_whole({figures / f"{name}.png": as_image(draw_tool(one), "png")})
        if frfs is not None:
            write(frfs / f"{name}.csv", as_frf(one))
        yield one


def _print_names(console: Console, found: list[Reduced]) -> None:
    """Say which files belong to tools whose names no file can have."""
    from receptance.catalogue.writing import file_names

    others = [f"{tool} as {file}" for tool, file in file_names(one.name for one in found).items() if tool != file]
    if others:
        more = f", and {len(others) - _SHOWN} more" if len(others) > _SHOWN else ""
        text = f"note: names of files that are not those of their tools: {', '.join(others[:_SHOWN])}{more}"
        console.print(Text(text), soft_wrap=True)


def _interval(ends: NDArray[np.float64]) -> Cell:
    """Return an interval of a logarithm; one over a factor of ten to either side says nothing."""
    low, high = ends.tolist()
    return (low, high) if high < _WIDE * low else SAYS_NOTHING


def _print(console: Console, found: list[Reduced], seconds: float) -> None:
    rows: list[list[Cell]] = []
    for one in found[:_SHOWN]:
        if one.values is None or one.interval is None:
            rows.append([one.name, one.holder, "none", None, None, None, None, None])
            continue
        cells: list[Cell] = []
        for value, ends, scale in zip(one.values.tolist(), one.interval, (1.0, 100.0, 1e-6), strict=True):
            cells += [scale * value, _interval(scale * ends)]
        rows.append([one.name, one.holder, *cells])
    columns: list[Column | str] = ["tool", "holder"]
    for name, unit, form in (
        ("frequency", "Hz", ".0f"),
        ("damping", "%", ".2f"),
        ("dynamic stiffness", "N/\u00b5m", ".3g"),
    ):
        columns += [Column(name, unit, form), Column("interval", form=form)]
    print_table(console, Table("The most flexible mode of each tool", columns, rows))
    if len(found) > _SHOWN:
        console.print(f"and {len(found) - _SHOWN} more", soft_wrap=True)
    for note in dict.fromkeys(note for one in found[:_SHOWN] for note in one.notes):
        console.print(Text(f"note: {note}"), soft_wrap=True)
    console.print(f"{len(found)} tools in {seconds:.1f} s", soft_wrap=True)
