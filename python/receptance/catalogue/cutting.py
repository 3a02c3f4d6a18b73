"""How deep the tools of a catalogue may cut: lobes with bands from the draws of each tip."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from receptance._files import inert, streamed
from receptance.campaign.stability import chosen_cuts, described, spindle_speeds
from receptance.stability import Lobes, Milling, stability_lobes

if TYPE_CHECKING:
    from receptance.campaign import Campaign, CampaignCut
    from receptance.catalogue.prediction import ToolPrediction

__all__ = ["ToolCut", "tool_lobes", "write_depths"]

_HEADER = (
    "name",
    "holder",
    "teeth",
    "cut",
    "rank",
    "speed [rpm]",
    "stable depth [mm]",
    "probability",
    "limit [mm]",
    "speed lower [rpm]",
    "speed upper [rpm]",
    "always stable [mm]",
)


@dataclass(frozen=True)
class ToolCut:
    """A cut of a campaign that the tools of a catalogue make, each with its own number of teeth.

    Raises
    ------
    CampaignError
        No such cut, or no spindle speeds.
    """

    campaign: Campaign
    name: str

    def __post_init__(self) -> None:
        chosen_cuts(self.campaign, [self.name])
        spindle_speeds(self.campaign)

    @property
    def cut(self) -> CampaignCut:
        """The cut of the campaign."""
        return self.campaign.cuts[self.name]


def tool_lobes(one: ToolPrediction, asked: ToolCut) -> Lobes:
    """Return the lobes of a tool that was predicted with draws, the same in x and y, by the mean force.

    The number of teeth is that of the row, or the cut's where it says none.

    Raises
    ------
    ValueError
        Fewer draws than the probability asks for.
    """
    settings = asked.campaign.table.stability
    cut = asked.cut.cut
    if isinstance(cut, Milling) and one.row.teeth is not None:
        cut = replace(cut, teeth=one.row.teeth)
    own = replace(asked.cut, cut=cut)
    size = np.eye(2 if isinstance(cut, Milling) else 1)
    lobes = stability_lobes(
        cut,
        one.frequency_hz,
        one.receptance[:, None, None] * size,
        speeds_rpm=spindle_speeds(asked.campaign),
        draws=one.drawn[:, :, None, None] * size,
        cuts=own.drawn(len(one.drawn), settings.seed),
    )
    return replace(described(lobes, own), probability=settings.probability)


def write_depths(path: Path, predictions: Iterable[ToolPrediction], asked: ToolCut) -> Iterator[ToolPrediction]:
    """Write recommended speeds of each tool while predictions go through; the file is there when all have."""
    with streamed(path) as file:
        rows = csv.writer(file)
        rows.writerow(_HEADER)
        for one in predictions:
            found = tool_lobes(one, asked)
            limits = dict(zip(found.speeds_rpm.tolist(), found.depth.tolist(), strict=True))
            teeth = getattr(found.cut, "teeth", "")
            for rank, best in enumerate(found.best_cuts):
                values = (best.speed_rpm, 1e3 * best.depth, best.probability, 1e3 * limits[best.speed_rpm])
                ends = (best.lowest_rpm, best.highest_rpm, 1e3 * float(np.min(found.certain_depth)))
                cells = [f"{value:.6g}" for value in (*values, *ends)]
                name, holder, cut_name = map(inert, (one.row.name, one.row.holder, found.name))
                rows.writerow([name, holder, teeth, cut_name, rank + 1, *cells])
            yield one
