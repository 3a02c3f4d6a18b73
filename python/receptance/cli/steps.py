"""The commands `invert` and `next`: what to start a fit with, and what to measure after it."""

from __future__ import annotations

import warnings
from typing import Annotated

import typer

from receptance.cli.campaigns import File, load_campaign
from receptance.cli.running import Json, Plot, Targets, input_errors, with_progress
from receptance.errors import ReceptanceError, ReceptanceWarning

__all__ = ["invert", "next_step"]


def invert(
    campaign: File,
    json_file: Json = None,
    plot: Plot = None,
    joint: Annotated[
        str | None, typer.Option("--joint", metavar="NAME", help="Which joint; by default all with unknown stiffness.")
    ] = None,
    limit: Annotated[
        float,
        typer.Option(
            "--limit", metavar="PERCENT", min=0.1, help="Standard deviation up to which a line is said to speak."
        ),
    ] = 20.0,
) -> None:
    """Solve for the stiffness of a joint on each line by itself: where do the data speak at all."""
    targets = Targets(json_file, plot)
    from receptance.campaign import CampaignError

    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        found = with_progress(lambda say: read.invert(joint, limit=limit / 100.0, progress=say))
    targets.show(found)


def next_step(
    campaign: File,
    json_file: Json = None,
    plot: Plot = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target",
            metavar="NAME",
            help="What is to be known better: an unknown, or an assembly for its natural frequencies; may be repeated.",
        ),
    ] = None,
) -> None:
    """Rank the candidates of a campaign by what they are expected to bring, before any is measured."""
    targets = Targets(json_file, plot)
    from receptance.campaign import CampaignError

    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        found = with_progress(lambda say: read.next_measurement(targets=target or (), progress=say))
    targets.show(found)
