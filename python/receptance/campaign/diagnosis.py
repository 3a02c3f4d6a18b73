"""Diagnosis of a campaign: its model, and what is said about held-out measurements and unknown modes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from receptance.campaign.data import CampaignData
from receptance.campaign.identification import check_unknowns, observed_unknowns, parts_to_start, started_by_mode
from receptance.campaign.problems import errors_about
from receptance.coupling.stabilisation import Stabilisations
from receptance.coupling.unknown_modes import ModeChoice
from receptance.diagnosis import Cause, Metric, Verdict, diagnose
from receptance.diagnosis.by_mode import bias_of, slenderness_of
from receptance.diagnosis.fitting import fit_base
from receptance.diagnosis.held_out import FREQUENCIES, predict
from receptance.diagnosis.model import Model
from receptance.diagnosis.text import Reason
from receptance.diagnosis.thresholds import LEAST_FREEDOM
from receptance.diagnosis.unknown_spindle import MODE_CHOICES
from receptance.diagnosis.verdict import CampaignTexts
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation


def base_model(campaign: CampaignData, seen: Mapping[str, Observation] | None = None) -> tuple[Model, list[str]]:
    """Return the model for a diagnosis, and notes on unknowns that are left out; see `Campaign.base_model`."""
    seen = campaign.to_identify if seen is None else seen
    unknowns, left_out = observed_unknowns(campaign, seen)
    observations = tuple(seen.values())
    tolerances = tuple(campaign.errors_of(seen))
    return Model(observations, tuple(unknowns), tolerances, seed=campaign.table.settings.seed), left_out


def diagnose_campaign(
    campaign: CampaignData, causes: Iterable[Cause | str] | None, fast: bool, metrics: Mapping[str, Metric] | None
) -> Verdict:
    """Test whether the model explains the measurements; see `Campaign.diagnose`."""
    check_unknowns(campaign)
    if not campaign.measurements:
        raise campaign.error("there are no measurements, expected `measurements`")
    reasons: list[Reason] = []
    seen, held_out = dict(campaign.to_identify), dict(campaign.held_out)
    numbers = sum(one.independent_values for one in seen.values())
    if held_out and numbers - len(campaign.unknowns) < LEAST_FREEDOM:
        reasons.append(Reason("held_out_used", {"values": numbers, "unknowns": len(campaign.unknowns)}))
        reasons += _held_out_error(campaign)
        seen, held_out = dict(campaign.measurements), {}
    if not seen:
        raise campaign.error('there is no measurement for the diagnosis, expected one with the role "identify"')
    model, left_out = base_model(campaign, seen)
    stabilised = Stabilisations({})
    choose_modes = None
    if parts_to_start(campaign):
        described = model
        model, stabilised = _choose_modes(campaign, described, described, MODE_CHOICES[0])

        def choose_modes(extended: Model, choice: ModeChoice) -> Model:
            return _choose_modes(campaign, described, extended, choice)[0]

    settings = campaign.table.settings
    with errors_about(campaign.file):
        verdict = diagnose(
            model.observations,
            model.unknowns,
            tolerances=model.tolerances,
            causes=causes,
            seed=settings.seed,
            threads=campaign.threads,
            held_out=Model(tuple(held_out.values()), (), tuple(campaign.errors_of(held_out))) if held_out else True,
            fast=fast,
            metrics=metrics,
            progress=campaign.progress,
            choose_modes=choose_modes,
        )
    if choose_modes is not None:
        reasons += _reasons_of_modes(stabilised, verdict)
    return replace(
        verdict,
        data_reasons=(*reasons, *verdict.data_reasons),
        provenance=campaign.provenance(),
        campaign=CampaignTexts(notes=(*campaign.notes, *left_out)),
    )


def _choose_modes(
    campaign: CampaignData, described: Model, model: Model, choice: ModeChoice
) -> tuple[Model, Stabilisations]:
    """Return a model with the modes of unknown spindles that its records show, by a choice, and their fits by number.

    `described` is the model of the campaign, with all modes that a spindle may have; `model` is the same, or has causes
    and other modes. All but the causes start as described.
    """
    owners = tuple(f"{name}." for name in parts_to_start(campaign))
    modal = [unknown for unknown in described.unknowns if unknown.address.startswith(owners)]
    starts = {unknown.name: unknown.start for unknown in described.unknowns}
    others = [
        replace(unknown, start=starts.get(unknown.name, unknown.start))
        for unknown in model.unknowns
        if not unknown.address.startswith(owners)
    ]
    errors = [replace(tolerance, start=0.0) for tolerance in model.tolerances]
    unknowns, tolerances, stabilised = started_by_mode(
        campaign, model.observations, [*others, *modal], errors, choice=choice
    )
    return replace(model, unknowns=tuple(unknowns), tolerances=tuple(tolerances)), stabilised


def _reasons_of_modes(stabilised: Stabilisations, verdict: Verdict) -> list[Reason]:
    """Return what a diagnosis with unknown modes of spindles cannot decide, and whether more modes would help."""
    reasons = []
    if verdict.final and (hidden := verdict.selection.absorbed):
        count = len(verdict.selection.base.model.unknown_modes)
        reasons.append(Reason("imitated_by_modes", {"modes": count, "causes": hidden}))
    for name, each in () if verdict.adequacy.passed else stabilised.items():
        values = {"part": name, "modes": each.chosen}
        if each.stated is None:
            code = "all_modes_fitted"
        elif each.chosen < each.stated:
            code = "modes_shown"
        elif each.stated > 1:
            code, values["criterion"] = "each_mode_improves", each.criterion[each.stated - 1]
        else:
            code = "one_mode_stated"
        reasons.append(Reason(code, values))
    return reasons


def _held_out_error(campaign: CampaignData) -> list[Reason]:
    """Return the error of the base model for the held-out measurements."""
    model, _ = base_model(campaign)
    out = replace(
        model,
        observations=tuple(campaign.held_out.values()),
        tolerances=tuple(campaign.errors_of(campaign.held_out)),
    )
    try:
        predicted = predict(fit_base(model), out, scored=False)
    except (ValueError, ReceptanceError):
        return []
    if FREQUENCIES not in predicted.metrics:
        return []
    bias = bias_of(predicted.modes, slenderness_of(out))
    error = Reason("held_out_error", {"percent": predicted.metrics[FREQUENCIES]})
    return [error] if bias is None else [error, Reason("bias", {"bias": bias})]
