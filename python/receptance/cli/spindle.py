"""The command `spindle`: a spindle from hits on a blank in it, written to a file that campaigns read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from receptance import campaign, coupling
from receptance.cli.campaigns import CampaignFile, protect_files, run_on_campaign
from receptance.cli.running import InputError, Targets, count_of_modes, input_errors, takes_targets


@takes_targets("if there is advice")
def spindle(
    file: CampaignFile,
    targets: Targets,
    out: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="File of the spindle: .npz, or .toml with --modes; by default the one that the campaign names.",
            rich_help_panel="Output",
        ),
    ] = None,
    modes: Annotated[
        str | None,
        typer.Option(
            "--modes",
            metavar="N|auto",
            help="Fit N modes, or as many as are found, and write these instead of the table.",
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="Spindle, if the campaign has blanks of several.")
    ] = None,
    limit: Annotated[
        float,
        typer.Option("--limit", metavar="PERCENT", min=0.1, help="Largest standard deviation of a usable line."),
    ] = 20.0,
) -> None:
    """Identify a spindle from hits on a blank in it, and write it to a file.

    The table spindles.NAME of the campaign names the assemblies with a blank, `blanks`, and the file, `file`. The exit
    code is 3 if the fit of modes is rejected, which writes no file.
    """
    count = None if modes is None else count_of_modes("--modes", modes)
    if out is not None:
        _check_suffix("--output", out, as_modes=modes is not None)

    def work(read: campaign.Campaign) -> tuple[Path, campaign.SpindleIdentification]:
        if out is not None:
            targets.add("--output", out, "Spindle")
            protect_files(read, targets, of_spindles=False)
            targets.require_new()
        chosen = campaign.spindle.chosen_spindle(read, name)
        target = campaign.spindle.target_of(read, chosen, out)
        if out is None:
            where = f"{read.file}: spindles.{chosen}.file"
            _check_suffix(where, target, as_modes=modes is not None)
            targets.add(where, target, "Spindle")
            targets.require_new()
        return target, read.spindle(chosen, modes=count, limit=limit / 100.0)

    _, (target, found) = run_on_campaign(file, targets, work, unidentified=True)
    if found.rejection:
        targets.leave_out(target)
        targets.show(found)
        targets.console().print(f"{target} was not written: the fit of the modes is rejected", soft_wrap=True)
    else:
        with input_errors():
            content = coupling.spindle_files.spindle_bytes(found.identified, target.suffix)
        targets.show(found, more={target: content})
    targets.require(not found.rejection, always=True)
    targets.require(not found.warnings())


def _check_suffix(option: str, path: Path, *, as_modes: bool) -> None:
    """Raise `InputError` unless the suffix of a file is that of the kind that is written to it."""
    expected = coupling.spindle_files.MODES if as_modes else coupling.spindle_files.TABLE
    if path.suffix.lower() == expected:
        return
    if as_modes:
        hint = "leave out --modes for the table" if path.suffix.lower() == coupling.spindle_files.TABLE else ""
    else:
        hint = "add --modes auto for modes" if path.suffix.lower() == coupling.spindle_files.MODES else ""
    kind = "modes are" if as_modes else "the table is"
    raise InputError(f"{option} is {path}, but {kind} written to a file {expected}{'; ' if hint else ''}{hint}")
