"""The command `catalogue`: predictions for all tools of a catalogue."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

import receptance
from receptance._files import check_target, write_whole
from receptance.cli.campaigns import CampaignFile, run_on_campaign
from receptance.cli.running import InputError, NewSeed, Targets, input_errors, refuse_existing, takes_targets

_LISTED = 20
"""Largest number of tools whose file names are listed."""
_DRAWS = 60
"""Number of draws for the bands of figures without a cut."""


@takes_targets("if the fit is rejected")
def catalogue(
    file: CampaignFile,
    targets: Targets,
    tools: Annotated[
        Path | None, typer.Argument(metavar="TOOLS.csv", help="Tools; by default the file the campaign names.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.csv", help="Write the modes of all tools with intervals.")
    ] = None,
    holders: Annotated[
        Path | None,
        typer.Option("--holders", metavar="FILE.csv", help="Holders; by default the file the campaign names."),
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--figures", metavar="FOLDER", help="Write a figure of each tool, NAME.png.")
    ] = None,
    depths: Annotated[
        Path | None,
        typer.Option("--depths", metavar="FILE.csv", help="Write recommended speeds and depths of all tools."),
    ] = None,
    cut: Annotated[
        str | None, typer.Option("--cut", metavar="NAME", help="Cut for --depths, if the campaign has several.")
    ] = None,
    frfs: Annotated[
        Path | None, typer.Option("--frfs", metavar="FOLDER", help="Write the receptance of each tool, NAME.csv.")
    ] = None,
    seed: NewSeed = None,
) -> None:
    """Predict the tips of all tools of a catalogue in a machine."""
    for option, path, what in (("--out", out, "Modes"), ("--depths", depths, "Depths")):
        targets.add(option, path, what)
    for folder in (figures, frfs):
        _check_folder(folder)
    for path in (tools, holders):
        if path is not None:
            targets.protect(path, "read")
    begun = time.perf_counter()

    def work(read: receptance.Campaign) -> receptance.catalogue.CatalogueSummary:
        name = "" if depths is None else _cut(read, cut)
        chosen = receptance.catalogue.Catalogue(read, tools, holders)
        names = receptance.catalogue.results.file_names(row.name for row in chosen.tools)
        _require_new(names.values(), figures, frfs, overwrite=targets.overwrite)
        draws = read.table.stability.number_of_draws if name else _DRAWS if figures else 0
        predictions = receptance.catalogue.predict_catalogue(chosen, draws=draws, seed=read.table.stability.seed)
        if out is not None:
            predictions = receptance.catalogue.results.write_modes(out, predictions)
        if depths is not None:
            predictions = receptance.catalogue.results.write_depths(depths, predictions, read, name)
        if figures is not None or frfs is not None:
            predictions = _write_files(predictions, names, figures, frfs)
        return receptance.catalogue.summary_of(chosen, predictions)

    _, summary = run_on_campaign(file, targets, work, seed)
    targets.show(summary)
    console = targets.console()
    for what, folder in (("Figures", figures), ("Receptances", frfs)):
        if folder is not None:
            console.print(f"{what}: {folder}", soft_wrap=True)
    if (figures is not None or frfs is not None) and (note := _renamed_files(summary)):
        console.print(Text(note), soft_wrap=True)
    console.print(f"{len(summary.tools)} tools in {time.perf_counter() - begun:.1f} s", soft_wrap=True)
    targets.require(not summary.rejection)


def _write_files(
    predictions: Iterable[receptance.catalogue.ToolPrediction],
    names: Mapping[str, str],
    figures: Path | None,
    frfs: Path | None,
) -> Iterator[receptance.catalogue.ToolPrediction]:
    """Write the figure and the FRF of each tool into folders under their file names, and yield the predictions."""
    for prediction in predictions:
        name = names[prediction.row.name]
        if figures is not None:
            figure = receptance.catalogue.figure.draw_tool(prediction)
            write_whole({figures / f"{name}.png": receptance.report.figure.as_image(figure, "png")})
        if frfs is not None:
            receptance.io.write(frfs / f"{name}.csv", prediction.as_frf())
        yield prediction


def _check_folder(folder: Path | None) -> None:
    """Raise `InputError` if files cannot be written into a folder."""
    if folder is None:
        return
    if not folder.is_dir():
        what = f"{folder} is a file" if folder.exists() else f"there is no folder {folder}"
        raise InputError(f"{what}, expected a folder for one file of each tool")
    with input_errors():
        check_target(folder / "NAME")


def _require_new(names: Collection[str], figures: Path | None, frfs: Path | None, *, overwrite: bool) -> None:
    """Raise `InputError` if the file of a tool exists and --overwrite was not given."""
    for option, folder, ending in (("--figures", figures, ".png"), ("--frfs", frfs, ".csv")):
        if folder is not None:
            for name in names:
                refuse_existing(option, folder / f"{name}{ending}", overwrite=overwrite)


def _cut(read: receptance.Campaign, cut: str | None) -> str:
    """Return the name of the cut for --depths after checking it and the spindle speeds."""
    if cut is None and len(read.cuts) != 1:
        cuts = f"there are {', '.join(read.cuts)}" if read.cuts else "the campaign has none"
        raise InputError(f"--depths needs one cut, name it with --cut; {cuts}")
    name = cut or next(iter(read.cuts))
    (chosen,) = read.select_cuts([name])
    if isinstance(chosen.cut, receptance.stability.Milling):
        with input_errors():
            chosen.cut.require_even(f"--depths uses the mean force, and cuts.{name}")
    read.spindle_speeds()
    return name


def _renamed_files(summary: receptance.catalogue.CatalogueSummary) -> str:
    """Return a note on the tools whose names cannot be file names."""
    names = receptance.catalogue.results.file_names(tool.name for tool in summary.tools)
    others = [f"{tool} as {file}" for tool, file in names.items() if tool != file]
    more = f", and {len(others) - _LISTED} more" if len(others) > _LISTED else ""
    text = f"note: tools whose files have another name: {', '.join(others[:_LISTED])}{more}"
    return text if others else ""
