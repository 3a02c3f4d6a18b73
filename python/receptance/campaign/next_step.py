"""Which measurement next, of the candidates of a campaign."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from receptance._text import did_you_mean, one_of
from receptance.campaign.identification import identify_campaign
from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of
from receptance.identification import FrequencyTarget, Identification, NextMeasurement, next_measurement

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign
    from receptance.identification.information import Target

__all__ = ["next_of_campaign"]


def next_of_campaign(
    campaign: Campaign,
    identified: Identification | None,
    *,
    targets: Sequence[str] = (),
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> NextMeasurement:
    """Rank the candidates of a campaign; see `Campaign.next_measurement`."""
    if not campaign.candidates:
        raise CampaignError.about(campaign.file, "there is nothing to choose from, expected `candidates`")
    known = identified or identify_campaign(campaign, threads=threads, progress=progress)
    wanted = [_target(name, campaign, known) for name in targets]
    try:
        found = next_measurement(
            known,
            list(campaign.candidates.values()),
            targets=wanted or None,
            level=campaign.table.prediction.level,
            profiles=known.profiled or {},
            progress=progress,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    return replace(found, provenance=campaign.provenance(seed=known.seed))


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
