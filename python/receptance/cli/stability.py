"""The command `stability`: how deep cuts may be, at which spindle speeds."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Annotated

import typer

from receptance.cli.campaigns import File, load_campaign
from receptance.cli.running import Json, Plot, Targets, input_errors, with_progress
from receptance.errors import ReceptanceError, ReceptanceWarning

if TYPE_CHECKING:
    pass

__all__ = ["stability"]


def stability(
    campaign: File,
    json_file: Json = None,
    plot: Plot = None,
    cut: Annotated[
        list[str] | None, typer.Option("--cut", metavar="NAME", help="Only this cut; may be given several times.")
    ] = None,
) -> None:
    """Say up to which depth the cuts of a campaign are stable, with bands, and at which speeds they may be deepest."""
    targets = Targets(json_file, plot)
    from receptance.campaign import CampaignError

    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        found = with_progress(lambda say: read.stability(cuts=cut or (), progress=say))
    targets.show(found)
