"""Stability of the cuts of a campaign: lobes with their bands, and recommended spindle speeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance._text import did_you_mean
from receptance.campaign.cuts import CampaignCut
from receptance.campaign.problems import CampaignError
from receptance.campaign.tips import Tips
from receptance.stability import Lobes, Milling, Stability, critical_depths, semi_discretised_lobes, stability_lobes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.format import StabilityTable
    from receptance.identification import Identification

__all__ = ["chosen_cuts", "described", "spindle_speeds", "stability_of_campaign"]

_SPEEDS = {"mean force": 400, "semi-discretisation": 30}
_TIMES_THE_LOWEST = 10.0


def stability_of_campaign(
    campaign: Campaign,
    identified: Identification | None,
    *,
    cuts: Sequence[str] = (),
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Stability:
    """Return the stability of the cuts of a campaign; see `Campaign.stability`."""
    say = progress or (lambda _: None)
    chosen = chosen_cuts(campaign, cuts)
    asked = campaign.table.stability
    speeds = spindle_speeds(campaign)
    predicted = any(tip is not None and tip.assembly for cut in chosen for tip in (cut.x, cut.y))
    if not predicted:
        identified = None
    elif identified is None and campaign.unknowns:
        identified = campaign.identify(threads=threads, progress=progress)
    found = {}
    provenance = campaign.provenance(settings=asked.model_dump())
    for cut in chosen:
        say(f"lobes of {cut.name}")
        directions = (cut.x, cut.y) if isinstance(cut.cut, Milling) else (cut.x,)
        try:
            tips = Tips(campaign, identified, asked.number_of_draws, asked.seed, directions, threads)
            found[cut.name] = replace(_lobes(cut, tips, speeds, asked, threads, say), provenance=provenance)
        except ValueError as error:
            raise CampaignError.about(campaign.file, f"cuts.{cut.name}: {error}") from error
    notes = [*(campaign.notes if identified is None else identified.notes)]
    notes += [f"{name}: {note}" for name, one in found.items() for note in one.notes]
    return Stability(found, identified=identified, provenance=provenance, notes=notes)


def chosen_cuts(campaign: Campaign, names: Sequence[str]) -> list[CampaignCut]:
    """Return the cuts of these names, all where none is named; a CampaignError where there is no such cut."""
    if not campaign.cuts:
        raise CampaignError.about(campaign.file, "there is no cut, expected [cuts.NAME]")
    for name in names:
        if name not in campaign.cuts:
            known = ", ".join(campaign.cuts)
            text = f'there is no cut "{name}"; there are {known}{did_you_mean(name, campaign.cuts)}'
            raise CampaignError.about(campaign.file, text)
    return [campaign.cuts[name] for name in names] if names else list(campaign.cuts.values())


def _lobes(
    cut: CampaignCut,
    tips: Tips,
    speeds: NDArray[np.float64],
    asked: StabilityTable,
    threads: int | None,
    say: Callable[[str], None],
) -> Lobes:
    several = cut.drawn(asked.number_of_draws, asked.seed)
    uncertain = tips.uncertain or several is not None
    if asked.method == "mean force":
        receptance = tips.receptance()
        draws, good = tips.receptances() if tips.uncertain else (None, np.ones(asked.number_of_draws, np.bool_))
        lobes = stability_lobes(
            cut.cut,
            tips.lines,
            receptance,
            speeds_rpm=speeds,
            draws=draws,
            cuts=_kept(several, good),
        )
    else:
        assert isinstance(cut.cut, Milling)
        most = asked.largest_depth
        if most is None:
            most = _TIMES_THE_LOWEST * float(critical_depths(cut.cut, tips.lines, tips.receptance())[0].min())
        modes, good = tips.drawn_modes() if tips.uncertain else (None, np.ones(asked.number_of_draws, np.bool_))
        lobes = semi_discretised_lobes(
            cut.cut,
            tips.modes(),
            speeds_rpm=speeds,
            most=most,
            draws=modes,
            cuts=_kept(several, good),
            threads=threads,
            progress=say,
        )
    notes = [*tips.notes, *lobes.notes]
    if not uncertain:
        notes.append("nothing is known of the errors of tip and coefficients, so there is no band: give tolerances")
    return replace(
        described(lobes, cut),
        probability=asked.probability if uncertain else None,
        notes=tuple(dict.fromkeys(notes)),
    )


def described(lobes: Lobes, cut: CampaignCut) -> Lobes:
    """Return lobes with name, tips and coefficients of a campaign's cut."""
    tips = {"x": cut.x.name, "y": None if cut.y is None else cut.y.name}
    return replace(lobes, name=cut.name, tips=tips, spread=cut.spread)


def _kept(cuts: Sequence[Any] | None, good: NDArray[np.bool_]) -> list[Any] | None:
    return None if cuts is None else [one for one, kept in zip(cuts, good, strict=True) if kept]


def spindle_speeds(campaign: Campaign) -> NDArray[np.float64]:
    """Return the spindle speeds in rpm that a campaign asks for; a CampaignError where it names none."""
    asked = campaign.table.stability
    if asked.speeds is None:
        text = 'there are no spindle speeds, expected `speeds = ["4000 rpm", "24000 rpm"]` under [stability]'
        raise CampaignError.about(campaign.file, text)
    low, high = asked.speeds
    step = asked.step if asked.step is not None else (high - low) / _SPEEDS[asked.method]
    return low + step * np.arange(int((high - low) / step * (1.0 + 1e-12)) + 1, dtype=np.float64)
