"""The command `sweep`: many candidate values of parameters of a campaign, compared with the measurements."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from receptance import cli
from receptance.cli.campaigns import CampaignFile, load_campaign
from receptance.cli.running import Seed, Targets, input_errors, output, takes_targets, with_progress
from receptance.errors import ReceptanceError, ReceptanceWarning


@takes_targets("if no candidate agrees with the measurements")
def sweep(
    file: CampaignFile,
    targets: Targets,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="'ADDRESS = LOW to HIGH'",
            help="Parameter and its range with units; may be repeated. By default all unknowns.",
        ),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option("--points", metavar="N", min=2, help="Values of each parameter in a grid; by default 20."),
    ] = None,
    sample: Annotated[
        int | None,
        typer.Option("--sample", metavar="COUNT", min=1, help="Number of random candidates instead of a grid."),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="'ADDRESS = VALUE'",
            help="Fixed value of a parameter; may be repeated. Unknowns that are neither varied nor fixed have their "
            "identified values.",
        ),
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option(
            "--store", metavar="FOLDER", help="Zarr store of all results; an interrupted run resumes from it."
        ),
    ] = None,
    seed: Seed = 0,
) -> None:
    """Compare many values of parameters with the measurements."""
    with warnings.catch_warnings(record=True) as caught, input_errors(ReceptanceError, ValueError, OSError):
        warnings.simplefilter("always", ReceptanceWarning)
        read = with_progress(lambda say: load_campaign(file, targets, say))
        caught.clear()  # warnings on measurements are shown by the commands that fit them
        given = cli.candidates.fixed_values(at or [])
        candidates = cli.candidates.candidates_of(read, vary or [], points, sample, seed, given)
        if targets.draws:
            cli.candidates.check_figure(candidates)
        try:
            found = with_progress(lambda say: replace(read, progress=say).compare(candidates, given=given, store=store))
        except (KeyboardInterrupt, OSError):
            # OSError: the disk may be full.
            if store is not None and store.is_dir():
                print(
                    f"receptance: the store {store} contains the results so far; the same command resumes from it",
                    file=sys.stderr,
                )
            raise
    for one in caught:
        output(stderr=True).print(f"receptance: {one.message}", soft_wrap=True)
    targets.show(found)
    if store is not None:
        targets.console().print(f"Store: {store}", soft_wrap=True)
    targets.require(found.agrees in (None, True))
