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
from receptance.diagnosis.held_out import FREQUENCIES, improvement, metrics_of
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import LEAST_FREEDOM
from receptance.diagnosis.truncation import record_ends
from receptance.diagnosis.unknown_spindle import MODE_CHOICES
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
    notes = list(campaign.notes)
    seen, held_out = dict(campaign.to_identify), dict(campaign.held_out)
    numbers = sum(one.independent_values for one in seen.values())
    if held_out and numbers - len(campaign.unknowns) < LEAST_FREEDOM:
        notes.append(
            f"{numbers:.3g} measured values for {len(campaign.unknowns)} unknowns are too few to test the model, so "
            "held-out measurements are used in the diagnosis; improvement is computed for assemblies left out in "
            "turn"
        )
        notes += _held_out_error(campaign)
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
            held_out=not held_out,
            fast=fast,
            metrics=metrics,
            progress=campaign.progress,
            choose_modes=choose_modes,
        )
    if held_out and verdict.final:
        observations = tuple(held_out.values())
        unseen = replace(
            verdict.selection.base.model,
            observations=observations,
            # Held-out records may end at another time, or not at all.
            ends=record_ends([observation for observation in observations if observation.is_receptance]),
            tolerances=tuple(campaign.errors_of(held_out)),
        )
        found = improvement(verdict.selection, verdict.explanation, unseen, metrics)
        verdict = replace(verdict.with_improvement(found), held_out=unseen)
    notes = [*verdict.notes, *notes, *left_out]
    if choose_modes is not None:
        notes += _notes_on_modes(stabilised, verdict)
    return replace(verdict, notes=tuple(dict.fromkeys(notes)), provenance=campaign.provenance())


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


def _notes_on_modes(stabilised: Stabilisations, verdict: Verdict) -> list[str]:
    """Return notes on what a diagnosis with unknown modes of spindles can decide."""
    notes = []
    if verdict.final and (hidden := verdict.selection.absorbed):
        count = len(verdict.selection.base.model.unknown_modes)
        notes.append(
            f"these data do not show causes of typical size that the joint and the {count} unknown modes imitate: "
            f"{', '.join(hidden)}; measure another overhang, or the spindle alone, to decide them"
        )
    if verdict.adequacy.passed:
        return notes
    for name, each in stabilised.items():
        if each.stated is None:
            notes.append(f"more modes of {name} do not explain the rest: the fit has as many as the records show")
        elif each.chosen < each.stated:
            notes.append(f"more modes of {name} do not explain the rest: the records show {each.chosen}")
        elif each.stated > 1:
            notes.append(
                f"each of the {each.stated} modes of {name} improves the description, the last one by "
                f"{each.criterion[each.stated - 1]:.3g} of the criterion: before a cause is searched for, try "
                '`modes = "auto"`, which adds modes as long as they do'
            )
        else:
            notes.append(f'one mode of {name} may be too few: before a cause is searched for, try `modes = "auto"`')
    return notes


def _held_out_error(campaign: CampaignData) -> list[str]:
    """Return a note on the error of the base model for the held-out measurements."""
    model, _ = base_model(campaign)
    out = replace(
        model,
        observations=tuple(campaign.held_out.values()),
        tolerances=tuple(campaign.errors_of(campaign.held_out)),
    )
    try:
        errors, modes = metrics_of(fit_base(model), out, scored=False)
    except (ValueError, ReceptanceError):
        return []
    if FREQUENCIES not in errors:
        return []
    bias = bias_of(modes, slenderness_of(out))
    text = "identified without the held-out measurements, the model predicts their natural frequencies with an rms "
    return [f"{text}error of {errors[FREQUENCIES]:.2f} %" + ("" if bias is None else f"; {bias}")]
