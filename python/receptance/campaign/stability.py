"""Stability of the cuts of a campaign: lobes with their bands, and recommended spindle speeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.campaign.cuts import CampaignCut
from receptance.campaign.plain import plain
from receptance.campaign.problems import CampaignError
from receptance.campaign.suggestions import did_you_mean
from receptance.campaign.tips import Tips
from receptance.stability import Lobes, Milling, StableCut, critical_depths, semi_discretised_lobes, stability_lobes

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.cut_models import StabilityTable
    from receptance.campaign.identification import CampaignIdentification

__all__ = ["CampaignStability", "CutLobes", "chosen_cuts", "spindle_speeds", "stability_of_campaign"]

_SPEEDS = {"mean force": 400, "semi-discretisation": 30}
_TIMES_THE_LOWEST = 10.0
_RECOMMENDED = 5


@dataclass(frozen=True, kw_only=True)
class CutLobes:
    """Lobes of one cut.

    Attributes
    ----------
    cut : CampaignCut
        What was cut, and with which tip.
    lobes : Lobes
        Limits over spindle speed.
    probability : float or None
        With which recommended depths are stable; None where nothing is known of any errors.
    notes : tuple of str
        What a person should know.
    """

    cut: CampaignCut
    lobes: Lobes
    probability: float | None
    notes: tuple[str, ...]

    @property
    def depth(self) -> NDArray[np.float64]:
        """Depths `(n,)` in m that are stable with the probability, or the limits where there is none."""
        return self.lobes.depth if self.probability is None else self.lobes.stable_depth(self.probability)

    @property
    def recommended(self) -> tuple[StableCut, ...]:
        """Speeds that allow the deepest cuts, the deepest first; none where no speed has a limit."""
        if not np.isfinite(self.depth).any():
            return ()
        return self.lobes.recommended(probability=self.probability, count=_RECOMMENDED)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain values."""
        tips = {"x": self.cut.x.name, "y": None if self.cut.y is None else self.cut.y.name}
        kind = "milling" if isinstance(self.cut.cut, Milling) else "turning"
        return {
            "name": self.cut.name,
            "kind": kind,
            "cut": vars(self.cut.cut),
            "spread": self.cut.spread,
            "tips": tips,
            "probability": self.probability,
            "draws": 0 if self.lobes.draws is None else len(self.lobes.draws),
            "always_stable": float(np.min(self.depth)),
            "recommended": [vars(one) for one in self.recommended],
            "speeds_rpm": self.lobes.speeds_rpm,
            "limit": self.lobes.depth,
            "lower": self.lobes.lower,
            "upper": self.lobes.upper,
            "stable_depth": self.depth,
            "chatter_hz": self.lobes.chatter_hz,
            "notes": self.notes,
        }


@dataclass(frozen=True, kw_only=True)
class CampaignStability:
    """Stability of the cuts of a campaign.

    Attributes
    ----------
    campaign : Campaign
        What it is of.
    identified : CampaignIdentification or None
        The fit that predicted tips rest on; None where all were measured or nothing is unknown.
    cuts : tuple of CutLobes
        Each cut.
    notes : tuple of str
        What a person should know of all of them.
    versions : dict of str to str
        What is needed to do it again.
    """

    campaign: Campaign
    identified: CampaignIdentification | None
    cuts: tuple[CutLobes, ...]
    notes: tuple[str, ...]
    versions: dict[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds: depths in m, an infinite number is None."""
        found: dict[str, Any] = plain(
            {
                "campaign": self.campaign.title,
                "file": self.campaign.file.name,
                "settings": self.campaign.table.stability.model_dump(),
                "cuts": [one.as_dict() for one in self.cuts],
                "identified": None if self.identified is None else self.identified.as_dict(),
                "notes": self.notes,
                "versions": self.versions,
            }
        )
        return found

    def plot(self) -> Figure:
        """Draw the lobes of each cut with their bands."""
        from receptance.plot.stability import draw_several_lobes

        titles = [f"{one.cut.name}: {one.cut.x.name}" for one in self.cuts]
        lobes = [one.lobes for one in self.cuts]
        return draw_several_lobes(lobes, titles, probability=self.campaign.table.stability.probability)

    def __repr__(self) -> str:
        return f"CampaignStability({self.campaign.title!r}, {len(self.cuts)} cuts)"


def stability_of_campaign(
    campaign: Campaign,
    identified: CampaignIdentification | None,
    *,
    cuts: Sequence[str] = (),
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignStability:
    """Return the stability of the cuts of a campaign; see `Campaign.stability`."""
    from receptance.studies._provenance import versions

    say = progress or (lambda _: None)
    chosen = chosen_cuts(campaign, cuts)
    asked = campaign.table.stability
    speeds = spindle_speeds(campaign)
    predicted = any(tip is not None and tip.assembly for cut in chosen for tip in (cut.x, cut.y))
    if not predicted:
        identified = None
    elif identified is None and campaign.unknowns:
        identified = campaign.identify(threads=threads, progress=progress)
    found = []
    for cut in chosen:
        say(f"lobes of {cut.name}")
        directions = (cut.x, cut.y) if isinstance(cut.cut, Milling) else (cut.x,)
        try:
            tips = Tips(campaign, identified, asked.number_of_draws, asked.seed, directions, threads)
            found.append(_lobes(cut, tips, speeds, asked, threads, say))
        except ValueError as error:
            raise CampaignError.about(campaign.file, f"cuts.{cut.name}: {error}") from error
    notes = campaign.notes if identified is None else identified.notes
    return CampaignStability(
        campaign=campaign, identified=identified, cuts=tuple(found), notes=notes, versions=versions()
    )


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
) -> CutLobes:
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
    return CutLobes(
        cut=cut, lobes=lobes, probability=asked.probability if uncertain else None, notes=tuple(dict.fromkeys(notes))
    )


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
