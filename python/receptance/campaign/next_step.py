"""Which measurement next, of the candidates of a campaign."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from receptance.campaign.identification import identify_campaign, tolerances_of_measurements
from receptance.campaign.problems import CampaignError
from receptance.campaign.propagation import tolerances_of
from receptance.campaign.suggestions import did_you_mean, one_of
from receptance.identification import FrequencyTarget, Identification, NextMeasurement, next_measurement
from receptance.report.plain import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.campaign.campaign import Campaign
    from receptance.identification.information import Target

__all__ = ["CampaignNext", "next_of_campaign"]


@dataclass(frozen=True, kw_only=True)
class CampaignNext:
    """Candidates of a campaign, the best first.

    Attributes
    ----------
    campaign : Campaign
        What was asked about.
    identified : Identification
        What is known now.
    found : NextMeasurement
        The ranking.
    versions : dict of str to str
        What is needed to do it again.
    """

    campaign: Campaign
    identified: Identification
    found: NextMeasurement
    versions: dict[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds: an infinite number is None."""
        result: dict[str, Any] = plain(
            {
                "campaign": self.campaign.title,
                "file": self.campaign.file.name,
                **self.found.as_dict(),
                "seed": self.identified.seed,
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
    identified: Identification | None,
    *,
    targets: Sequence[str] = (),
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignNext:
    """Rank the candidates of a campaign; see `Campaign.next_measurement`."""
    from receptance.provenance import versions

    if not campaign.candidates:
        raise CampaignError.about(campaign.file, "there is nothing to choose from, expected `candidates`")
    known = identified or identify_campaign(campaign, threads=threads, progress=progress)
    wanted = [_target(name, campaign, known) for name in targets]
    exact = campaign.table.settings.tolerances == "propagate" and known.known_scatter
    try:
        found = next_measurement(
            known,
            list(campaign.candidates.values()),
            targets=wanted or None,
            # The fit took dimensions as exact; what more data would bring depends on them all the same.
            tolerances=tolerances_of_measurements(campaign.to_identify) if exact else (),
            level=campaign.table.prediction.level,
            profiles=known.profiled or {},
            progress=progress,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    if exact and any(one.effects for one in campaign.to_identify.values()):
        text = (
            'tolerances count here as what is known of dimensions beforehand, as with `tolerances = "fit"`; identify '
            "takes dimensions as exact, and its intervals with tolerances are wider"
        )
        found = replace(found, notes=(*found.notes, text))
    return CampaignNext(campaign=campaign, identified=known, found=found, versions=versions())


def _target(name: str, campaign: Campaign, known: Identification) -> Target:
    """Return an unknown, or the natural frequencies of an assembly as far up as was measured."""
    fit = known
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
