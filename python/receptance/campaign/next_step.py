"""Which measurement next, of the candidates of a campaign."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from receptance.campaign.identification import identify_campaign
from receptance.campaign.plain import plain
from receptance.campaign.problems import CampaignError
from receptance.campaign.suggestions import did_you_mean, one_of
from receptance.campaign.tolerances import tolerances_of
from receptance.identification import FrequencyTarget, NextMeasurement, next_measurement

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.identification import CampaignIdentification
    from receptance.identification.information import Target

__all__ = ["CampaignNext", "next_of_campaign"]


@dataclass(frozen=True, kw_only=True)
class CampaignNext:
    """Candidates of a campaign, the best first.

    Attributes
    ----------
    identified : CampaignIdentification
        What is known now.
    found : NextMeasurement
        The ranking.
    versions : dict of str to str
        What is needed to do it again.
    """

    identified: CampaignIdentification
    found: NextMeasurement
    versions: dict[str, str]

    @property
    def campaign(self) -> Campaign:
        """What was asked about."""
        return self.identified.campaign

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds: an infinite number is None."""
        result: dict[str, Any] = plain(
            {
                "campaign": self.campaign.title,
                "file": self.campaign.file.name,
                **self.found.as_dict(),
                "seed": self.identified.fit.seed,
                "versions": self.versions,
            }
        )
        return result

    def plot(self) -> Figure:
        """Draw the interval of each target now and with each candidate."""
        from receptance.plot.next_measurement import draw_next_measurement

        return draw_next_measurement(self.found, f"{self.campaign.title}: which measurement next")


def next_of_campaign(
    campaign: Campaign,
    identified: CampaignIdentification | None,
    *,
    targets: Sequence[str] = (),
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignNext:
    """Rank the candidates of a campaign; see `Campaign.next_measurement`."""
    from receptance.studies._provenance import versions

    if not campaign.candidates:
        raise CampaignError.about(campaign.file, "there is nothing to choose from, expected `candidates`")
    known = identified or identify_campaign(campaign, threads=threads, progress=progress)
    wanted = [_target(name, campaign, known) for name in targets]
    try:
        found = next_measurement(
            known.fit,
            list(campaign.candidates.values()),
            targets=wanted or None,
            level=campaign.table.prediction.level,
            profiles=known.profiles,
            progress=progress,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    return CampaignNext(identified=known, found=found, versions=versions())


def _target(name: str, campaign: Campaign, known: CampaignIdentification) -> Target:
    """Return an unknown, or the natural frequencies of an assembly as far up as was measured."""
    fit = known.fit
    if name in fit.values:
        return name
    if name not in campaign.assemblies:
        choices = [*(n for n in fit.addresses if n not in fit.errors), *campaign.assemblies]
        text = f'the target "{name}" is not identified and no assembly, expected {one_of(choices)}'
        raise CampaignError.about(campaign.file, text + did_you_mean(name, choices))
    errors = tuple(tolerances_of(campaign.effects.get(name, {})))
    conditions = {key: one.value for key, one in campaign.conditions.get(name, {}).items()}
    assembly = fit.apply(campaign.assemblies[name], configuration=name, conditions=conditions, tolerances=errors)
    asked = campaign.table.prediction.upper
    measured = [float(one.observation.frequency_hz[-1].real) for one in campaign.measurements.values()]
    upper = max(measured) if asked is None else asked
    modes = assembly.natural_frequencies(upper)
    if not modes.size:
        raise CampaignError.about(campaign.file, f'the target "{name}" has no natural frequency below {upper:g} Hz')
    return FrequencyTarget(
        label=name,
        assembly=campaign.assemblies[name],
        modes=tuple(range(1, modes.size + 1)),
        tolerances=errors,
        configuration=name,
        conditions=conditions,
    )
