"""Errors that matter to a shop, by name, for `receptance diagnose --metric`: of what is made of a held-out FRF."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from receptance._text import did_you_mean
from receptance.campaign.problems import CampaignError
from receptance.identification import MeasuredFRF

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.cuts import CampaignCut
    from receptance.diagnosis import HeldOut, Metric

__all__ = ["NAMES", "named_metrics"]

NAMES = ("stable_depth",)
"""What may be asked for."""


def named_metrics(campaign: Campaign, names: Sequence[str]) -> dict[str, Metric]:
    """Return the metrics of these names, for `Campaign.diagnose`.

    `stable_depth` is, for each cut of the campaign, by how many percent the depth that is stable at every speed comes
    out wrong, where a held-out FRF of a tip takes the tip's place in both directions, or in x where y is rigid.

    Raises
    ------
    CampaignError
        There is no such metric, or the campaign has not what it needs. It is a ValueError.
    """
    found: dict[str, Metric] = {}
    for name in names:
        if name not in NAMES:
            text = f'there is no metric "{name}"; there are {", ".join(NAMES)}{did_you_mean(name, NAMES)}'
            raise CampaignError.about(campaign.file, text)
        if not campaign.cuts:
            text = f"there is no cut whose {name} could be compared, expected [cuts.NAME]"
            raise CampaignError.about(campaign.file, text)
        if not any(_of_tip(one.observation) for one in campaign.measurements.values()):
            text = f"no measurement is what {name} needs, an FRF with response and excitation at one place, along y"
            raise CampaignError.about(campaign.file, text)
        for cut in campaign.cuts.values():
            found[f"stable depth of {cut.name}, error in percent"] = partial(_error_of_depth, cut)
    return found


def _of_tip(one: object) -> bool:
    """Whether a measurement is a receptance on real lines at one place, a translation over a force."""
    if not isinstance(one, MeasuredFRF) or one.frequency_hz.dtype.kind == "c":
        return False
    response, excitation = one.response, one.excitation
    same = (response.part, response.position) == (excitation.part, excitation.position)
    return same and response.direction == excitation.direction == "y"


def _error_of_depth(cut: CampaignCut, one: HeldOut) -> float:
    seen = one.observation
    if not isinstance(seen, MeasuredFRF) or one.receptance is None or not _of_tip(seen):
        return math.nan
    lines = seen.frequency_hz.real
    measured, predicted = (_lowest(cut, lines, receptance) for receptance in (seen.receptance, one.receptance))
    return 100.0 * abs(predicted / measured - 1.0) if math.isfinite(measured) else math.nan


def _lowest(cut: CampaignCut, lines: NDArray[np.float64], receptance: NDArray[np.complex128]) -> float:
    """Return the depth in m that is stable at every speed."""
    from receptance.stability import Turning, critical_depths

    matrix = receptance[:, None, None] * np.diag([1.0, 0.0 if cut.y is None else 1.0])
    if isinstance(cut.cut, Turning):
        matrix = receptance[:, None, None]
    return float(critical_depths(cut.cut, lines, matrix)[0].min())
