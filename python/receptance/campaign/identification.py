"""Identification of the unknowns of a campaign, and the inputs of its fits."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from receptance.campaign.data import CampaignData
from receptance.campaign.problems import CampaignError, Issue, errors_about
from receptance.campaign.series import LEAST_LEVELS, over_levels, started_by_level
from receptance.coupling.unknown_modes import start_modes
from receptance.errors import ReceptanceError
from receptance.fit import Identification, Tolerance, Unknown, identify, profile_likelihoods
from receptance.fit.observation import Observation
from receptance.fit.unknowns import Law

_MODE_OF = re.compile(r"mode\[(\d+)\]")


def identify_campaign(campaign: CampaignData) -> Identification:
    """Identify the unknowns on the measurements that are not held out; see `Campaign.identify`."""
    unknowns, left_out, tolerances = fit_inputs(campaign)
    settings = campaign.table.settings
    observations = list(campaign.to_identify.values())
    lines = sum(o.frequency_hz.size for o in observations)
    by_level, unknowns, options = fit_options(campaign, observations, unknowns)
    campaign.progress(f"fitting {len(unknowns)} parameters to {lines} lines and modes from {options['starts']} starts")
    with errors_about(campaign.file):
        fit = identify(observations, unknowns, tolerances=tolerances, seed=settings.seed, **options)
    series = None
    if campaign.table.series is not None:
        series = over_levels(campaign, fit)
    fit = replace(
        fit,
        series=series,
        groups=campaign.templates,
        provenance=campaign.provenance(seed=settings.seed, settings=settings.data()),
    )
    notes = [*campaign.notes, *left_out, *(n for n in fit.notes if not any(o.endswith(n) for o in campaign.notes))]
    if fit.errors:
        notes.append(f"{len(fit.errors)} errors of dimensions and materials are fitted with their tolerances as priors")
    if by_level:
        notes.append(
            "each level was fitted separately first, then all together from these values; profile intervals are "
            "not computed for a series"
        )
        if not fit.series:
            notes.append(
                f"trends and laws are not fitted: they need at least {LEAST_LEVELS} different levels, none negative"
            )
    profiled = None
    if settings.profiles and not by_level and fit.known_scatter and settings.objective == "log":
        try:
            profiled = profile_likelihoods(fit, progress=campaign.progress)
        except ReceptanceError as error:
            # The fit is a result without profiles as well; its linear intervals remain.
            notes.append(f"profile intervals are not computed: {error}")
    return replace(fit, notes=notes, profiled=profiled)


def fit_inputs(campaign: CampaignData) -> tuple[list[Unknown], list[str], list[Tolerance]]:
    """Return the unknowns of a fit, notes on those that are left out, and the errors.

    Raises
    ------
    CampaignError
        There are no unknowns or no measurements, or measurements have no weights.
    """
    seen = campaign.to_identify
    check_unknowns(campaign)
    if not seen:
        text = 'there is no measurement for identification, expected one with the role "identify"'
        raise CampaignError.about(campaign.file, text)
    unknowns, left_out = observed_unknowns(campaign, seen)
    return unknowns, left_out, weighted_tolerances(campaign, seen)


def transfer_errors(campaign: CampaignData) -> list[Tolerance]:
    """Return the errors of all measurements, whose assemblies a transfer predicts; raise if it cannot."""
    check_unknowns(campaign)
    if len({observation.configuration for observation in campaign.measurements.values()}) < 2:
        text = "fewer than two assemblies were measured, expected at least two, to predict one from the others"
        raise CampaignError.about(campaign.file, text)
    return weighted_tolerances(campaign, campaign.measurements)


def check_unknowns(campaign: CampaignData) -> None:
    """Raise if there are no unknowns."""
    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there are no unknowns, expected `unknowns`")


def fit_options(
    campaign: CampaignData, observations: Sequence[Observation], unknowns: Sequence[Unknown]
) -> tuple[bool, list[Unknown], dict[str, Any]]:
    """Return whether the levels of a series are fitted separately first, unknowns with start values, and options."""
    settings = campaign.table.settings
    by_level = campaign.table.series is not None and any(
        isinstance(unknown, Law) and unknown.free for unknown in unknowns
    )
    started = started_by_mode(campaign, observations, unknowns)
    by_mode = started is not None
    if started is None and by_level:
        started = started_by_level(campaign, observations, unknowns)
    return (
        by_level,
        list(unknowns) if started is None else started,
        {
            "objective": settings.objective,
            "band_width_percent": 100.0 * settings.band_width,
            "starts": 1 if by_level or by_mode else settings.starts,
            "max_evaluations": settings.max_evaluations,
            "threads": campaign.threads,
            "strategy": "direct" if by_level or by_mode else settings.strategy,
        },
    )


def started_by_mode(
    campaign: CampaignData, observations: Sequence[Observation], unknowns: Sequence[Unknown]
) -> list[Unknown] | None:
    """Return unknowns with the starts of a fit to which the modes of modal parts were added; None without such modes.

    Modes with a row of their own among the unknowns have the start of that row.
    """
    table = campaign.table
    started: list[Unknown] | None = None
    for name, part in table.modal_parts.items():
        given = {match[1] for address in table.unknowns if (match := _MODE_OF.match(address.removeprefix(f"{name}.")))}
        if not part.identify or len(given) == len(part.modes):
            continue
        campaign.progress(f"adding the {len(part.modes)} modes of {name} one at a time")
        with errors_about(campaign.file):
            started = start_modes(
                observations,
                unknowns if started is None else started,
                name,
                starts=table.settings.starts,
                seed=table.settings.seed,
                threads=campaign.threads,
            )
    return started


def weighted_tolerances(campaign: CampaignData, seen: Mapping[str, Observation]) -> list[Tolerance]:
    """Return the errors of all measurements; the objective must have a likelihood, and measurements weights."""
    tolerances = campaign.errors_of(seen)
    if not tolerances:
        return []
    if campaign.table.settings.objective == "percentage":
        raise CampaignError(
            campaign.file,
            [
                Issue(
                    ("settings", "objective"),
                    'is "percentage", which has no likelihood, so that errors of dimensions and materials cannot be '
                    'fitted; expected "log", or no tolerances',
                )
            ],
        )
    unweighted = [name for name, measured in seen.items() if not measured.weighted]
    if unweighted:
        expected = (
            "has no standard deviation, which a fit of errors of dimensions and materials needs; expected "
            '`standard_deviation`, such as "2 %", or no tolerances'
        )
        raise CampaignError(campaign.file, [Issue(("measurements", name), expected) for name in unweighted])
    return tolerances


def observed_unknowns(campaign: CampaignData, seen: Mapping[str, Observation]) -> tuple[list[Unknown], list[str]]:
    """Return the unknowns that some fitted measurement depends on, and notes on the others."""
    places = [measured.site(index) for index, measured in enumerate(seen.values())]
    kept, notes = [], []
    for unknown in campaign.unknowns:
        own = [place for place in places if place.among(unknown.configurations)]
        if any(place.covered(address) for place in own for address in unknown.addresses):
            kept.append(unknown)
        else:
            notes.append(f"{unknown.address} is not identified: no measurement of its assemblies is for identification")
    if not kept:
        raise CampaignError.about(campaign.file, "no measurement for identification depends on an unknown")
    return kept, notes
