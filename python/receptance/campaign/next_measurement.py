"""The next measurement of a campaign: its candidates or those of the menu, ranked for unknowns or assemblies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from receptance._text import did_you_mean, one_of
from receptance.campaign.data import CampaignData
from receptance.campaign.identification import identify_campaign
from receptance.campaign.problems import CampaignError, errors_about
from receptance.fit import Identification, Observation
from receptance.predict import Candidate, NextMeasurement, next_measurement
from receptance.predict.gain import Target


def next_measurement_of(
    campaign: CampaignData, identified: Identification | None, targets: Sequence[str]
) -> NextMeasurement:
    """Rank the candidates of a campaign, or those of the menu; see `Campaign.next_measurement`."""
    fit = identified or identify_campaign(campaign)
    chosen = [_target(name, campaign, fit) for name in targets]
    with errors_about(campaign.file):
        found = next_measurement(
            fit,
            list(campaign.candidates.values()) or None,
            targets=chosen or None,
            level=campaign.table.prediction.level,
            profiles=fit.profiled or {},
            progress=campaign.progress,
        )
    stated = "" if campaign.candidates else "other lines, places, assemblies and costs are stated as [candidates.NAME]"
    notes = (*found.notes, *filter(None, [stated]))
    return replace(found, notes=notes, provenance=campaign.provenance(seed=fit.seed))


def _target(name: str, campaign: CampaignData, fit: Identification) -> Target:
    """Return the name of an unknown, or the natural frequencies of an assembly up to `highest_frequency`."""
    if name in fit.values:
        return name
    if name not in campaign.assemblies:
        choices = [*(n for n in fit.addresses if n not in fit.errors), *campaign.assemblies]
        text = f'the target "{name}" is neither an identified parameter nor an assembly, expected {one_of(choices)}'
        raise CampaignError.about(campaign.file, text + did_you_mean(name, choices))
    errors = campaign.tolerances.get(name, ())
    conditions = campaign.site(name).conditions
    predicted = fit.at(campaign.assemblies[name], configuration=name, conditions=conditions, tolerances=errors)
    upper = campaign.highest_frequency
    assert upper is not None  # a fit has measurements
    modes = predicted.assembly.natural_frequencies(upper)
    if not modes.size:
        raise CampaignError.about(campaign.file, f'the target "{name}" has no natural frequency below {upper:g} Hz')
    observation = Observation.from_modes(
        label=name,
        assembly=campaign.assemblies[name],
        modes=range(1, modes.size + 1),
        configuration=name,
        conditions=conditions,
    )
    return Candidate(observation=observation, tolerances=errors)
