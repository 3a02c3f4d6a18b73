"""The command `stability`: how deep cuts may be, at which spindle speeds."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.text import Text

from receptance.cli._tables import table
from receptance.cli.campaigns import File, load_campaign
from receptance.cli.running import Json, Plot, Targets, input_errors, with_progress
from receptance.errors import ReceptanceError, ReceptanceWarning

if TYPE_CHECKING:
    from rich.console import Console

    from receptance.campaign import CampaignStability, CutLobes

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
    targets.write(found.as_dict(), found.plot)
    console = targets.console()
    print_stability(console, found)
    targets.name(console)


def print_stability(console: Console, found: CampaignStability) -> None:
    """Print recommended speeds of each cut."""
    for one in found.cuts:
        console.print(Text(_headline(one)), soft_wrap=True)
        console.print(Text(_lowest(one)), soft_wrap=True)
        if one.recommended:
            console.print(table(*_rows(one)))
        for note in one.notes:
            console.print(Text(f"note: {note}"), soft_wrap=True)
        console.print()
    for note in found.notes:
        console.print(Text(f"note: {note}"), soft_wrap=True)


def _headline(one: CutLobes) -> str:
    from receptance.stability import Milling

    cut = one.cut.cut
    if isinstance(cut, Milling):
        how = "slot" if cut.immersion == 1.0 else f"{cut.feed}-milling, immersion {cut.immersion:g}"
        across = "rigid across it" if one.cut.y is None else f"y: {one.cut.y.name}"
        return f"{one.cut.name}: {cut.teeth} teeth, {how}; x: {one.cut.x.name}, {across}"
    return f"{one.cut.name}: turning; {one.cut.x.name}"


def _lowest(one: CutLobes) -> str:
    low, high = one.lobes.speeds_rpm.min(), one.lobes.speeds_rpm.max()
    sure = "" if one.probability is None else f" with {100.0 * one.probability:g} %"
    if not np.isfinite(one.depth).any():
        return f"no depth that was looked at is unstable from {low:.0f} to {high:.0f} rpm"
    return f"stable{sure} at every speed from {low:.0f} to {high:.0f} rpm: {1e3 * one.depth.min():.3g} mm"


def _rows(one: CutLobes) -> tuple[str, list[str], list[list[str]]]:
    limits = dict(zip(one.lobes.speeds_rpm.tolist(), one.lobes.depth.tolist(), strict=True))
    sure = "depth (mm)" if one.probability is None else f"stable with {100.0 * one.probability:g} % (mm)"
    columns = ["speed (rpm)", sure, "limit (mm)", "nine tenths of it (rpm)", "would chatter (Hz)"]
    rows = [
        [
            f"{best.speed_rpm:.0f}",
            f"{1e3 * best.depth:.3g}",
            f"{1e3 * limits[best.speed_rpm]:.3g}",
            f"{best.lowest_rpm:.0f} to {best.highest_rpm:.0f}",
            "" if np.isnan(best.chatter_hz) else f"{best.chatter_hz:.0f}",
        ]
        for best in one.recommended
    ]
    return "Recommended speeds", columns, rows
