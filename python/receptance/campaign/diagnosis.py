"""The diagnosis of a campaign."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from receptance.campaign.identification import observed_unknowns
from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of_measurements
from receptance.errors import ReceptanceError

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.observations import Measurement
    from receptance.diagnosis import Cause, Metric, Verdict
    from receptance.diagnosis.model import Model

__all__ = ["campaign_model", "diagnose_campaign"]


def _as_split(campaign: Campaign) -> list[str]:
    """Say how the base model does as the campaign splits it, with nothing left to judge a cause by."""
    from receptance.diagnosis.by_mode import bias_of, slenderness_of
    from receptance.diagnosis.fitting import fit_base
    from receptance.diagnosis.held_out import FREQUENCIES, metrics_of

    model, _ = campaign_model(campaign, campaign.to_identify)
    out = replace(
        model,
        observations=tuple(one.observation for one in campaign.held_out.values()),
        tolerances=tuple(tolerances_of_measurements(campaign.held_out)),
    )
    try:
        errors, modes = metrics_of(fit_base(model, seed=campaign.table.settings.seed), out, scored=False)
    except (ValueError, ReceptanceError):
        return []
    if FREQUENCIES not in errors:
        return []
    bias = bias_of(modes, slenderness_of(out))
    text = f"identified as the campaign splits it, what is held out is {errors[FREQUENCIES]:.2f} % rms off in frequency"
    return [text + ("" if bias is None else f"; {bias}")]


def campaign_model(campaign: Campaign, seen: Mapping[str, Measurement]) -> tuple[Model, list[str]]:
    """Return measurements of a campaign as the model that is diagnosed, and what to say of unknowns left out."""
    from receptance.diagnosis.model import Model

    unknowns, left_out = observed_unknowns(campaign, seen)
    observations = tuple(one.observation for one in seen.values())
    return Model(observations, tuple(unknowns), tuple(tolerances_of_measurements(seen))), left_out


def diagnose_campaign(
    campaign: Campaign,
    *,
    causes: Iterable[Cause | str] | None = None,
    metrics: Mapping[str, Metric] | None = None,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Verdict:
    """Diagnose a campaign; see `Campaign.diagnose`."""
    from receptance.diagnosis import diagnose
    from receptance.diagnosis.fitting import observed_numbers
    from receptance.diagnosis.held_out import improvement
    from receptance.diagnosis.thresholds import LEAST_FREEDOM

    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there is nothing to identify, expected `unknowns`")
    if not campaign.measurements:
        raise CampaignError.about(campaign.file, "there is nothing to diagnose, expected `measurements`")
    notes = list(campaign.notes)
    seen, kept_back = dict(campaign.to_identify), dict(campaign.held_out)
    numbers = sum(observed_numbers(one.observation) for one in seen.values())
    if kept_back and numbers - len(campaign.unknowns) < LEAST_FREEDOM:
        notes.append(
            f"{numbers:.3g} numbers to identify {len(campaign.unknowns)} unknowns from leave too little to judge the "
            "model by, so the diagnosis uses what is held out as well; improvement is measured on assemblies left out "
            "in turn"
        )
        notes += _as_split(campaign)
        seen, kept_back = dict(campaign.measurements), {}
    if not seen:
        raise CampaignError.about(campaign.file, "there is nothing to diagnose, expected measurements to identify from")
    model, left_out = campaign_model(campaign, seen)
    settings = campaign.table.settings
    try:
        verdict = diagnose(
            model.observations,
            model.unknowns,
            tolerances=model.tolerances,
            causes=causes,
            seed=settings.seed,
            threads=threads,
            held_out=not kept_back,
            metrics=metrics,
            progress=progress,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    if kept_back and verdict.final:
        found = improvement(
            verdict.selection,
            verdict.explanation,
            [one.observation for one in kept_back.values()],
            tolerances_of_measurements(kept_back),
            metrics,
        )
        verdict = verdict.with_improvement(found)
    notes += [*left_out, *verdict.notes]
    return replace(verdict, notes=tuple(dict.fromkeys(notes)), provenance=campaign.provenance())
