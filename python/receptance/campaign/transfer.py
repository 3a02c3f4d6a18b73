"""All measurements of a campaign, each assembly predicted from the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from receptance.campaign.identification import fit_options, weighable_tolerances
from receptance.campaign.problems import CampaignError
from receptance.identification import Transfer, transfer

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign

__all__ = ["transfer_campaign"]

Splits = Literal["leave-one-out", "one-for-all"]


def transfer_campaign(
    campaign: Campaign,
    *,
    splits: Splits = "leave-one-out",
    draws: int = 200,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Transfer:
    """Predict every measured assembly from the others; see `Campaign.transfer`."""
    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there is nothing to identify, expected `unknowns`")
    if len({one.assembly for one in campaign.measurements.values()}) < 2:
        text = "fewer than two assemblies were measured, expected two or more to predict one from the others"
        raise CampaignError.about(campaign.file, text)
    notes = list(campaign.notes)
    if any(one.held_out for one in campaign.measurements.values()):
        notes.append('measurements with the role "hold out" are used like the others: each assembly is held out once')
    measured, settings = campaign.measurements, campaign.table.settings
    tolerances = weighable_tolerances(campaign, measured)
    observations = [one.observation.configured(one.assembly, one.observation.conditions) for one in measured.values()]
    say = progress or (lambda _: None)
    _, unknowns, options = fit_options(campaign, observations, campaign.unknowns, threads=threads, say=say)
    try:
        found = transfer(
            observations,
            unknowns,
            tolerances=tolerances,
            splits=splits,
            level=campaign.table.prediction.level,
            draws=draws,
            seed=settings.seed,
            progress=progress,
            **options,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    provenance = campaign.provenance(settings=settings.model_dump())
    return replace(found, campaign_notes=tuple(dict.fromkeys(notes)), provenance=provenance)
