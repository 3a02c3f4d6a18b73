"""The fit of a campaign, with the errors of dimensions and materials as parameters with priors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from receptance.campaign.problems import CampaignError, Problem
from receptance.campaign.quantities import parse_share
from receptance.campaign.series import FEWEST, over_levels, started_by_level
from receptance.campaign.tolerances import tolerances_of_measurements
from receptance.identification import Identification, Unknown, identify
from receptance.identification.laws import Law
from receptance.identification.task import Observation, place_of

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.observations import Measurement
    from receptance.identification.laws import Tolerance

__all__ = [
    "fit_options",
    "identify_campaign",
    "observed_unknowns",
    "weighable_tolerances",
]


def identify_campaign(
    campaign: Campaign, *, threads: int | None = None, progress: Callable[[str], None] | None = None
) -> Identification:
    """Identify the unknowns of a campaign; see `Campaign.identify`."""
    say = progress or (lambda _: None)
    seen = campaign.to_identify
    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there is nothing to identify, expected `unknowns`")
    if not seen:
        text = 'there is nothing to identify from, expected a measurement with the role "identify"'
        raise CampaignError.about(campaign.file, text)
    unknowns, left_out = observed_unknowns(campaign, seen)
    settings = campaign.table.settings
    tolerances = weighable_tolerances(campaign, seen)
    observations = [measured.observation for measured in seen.values()]
    lines = sum(o.frequency_hz.size for o in observations)
    by_level, unknowns, options = fit_options(campaign, observations, unknowns, threads=threads, say=say)
    say(f"fitting {len(unknowns)} parameters to {lines} lines and modes from {options['starts']} starts")
    try:
        fit = identify(observations, unknowns, tolerances=tolerances, seed=settings.seed, **options)
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    fit = replace(
        fit,
        series=over_levels(campaign, fit),
        groups=campaign.templates,
        provenance=campaign.provenance(seed=settings.seed, settings=settings.model_dump()),
    )
    notes = [*campaign.notes, *left_out, *(n for n in fit.notes if not any(o.endswith(n) for o in campaign.notes))]
    if fit.errors:
        notes.append(f"{len(fit.errors)} errors of dimensions and materials are fitted, their tolerances are priors")
    if by_level:
        notes.append(
            "each level was fitted by itself first, and all together from there; profile intervals are not computed "
            "for a series"
        )
        if not fit.series:
            notes.append(f"trends and laws are not fitted: they take {FEWEST} different levels or more, from 0 on")
    profiled = None
    if settings.profiles and not by_level and fit.known_scatter and settings.objective == "log":
        profiled = fit.profiles(progress=say)
    return replace(fit, notes=notes, profiled=profiled)


def fit_options(
    campaign: Campaign,
    observations: Sequence[Observation],
    unknowns: Sequence[Unknown],
    *,
    threads: int | None,
    say: Callable[[str], None],
) -> tuple[bool, list[Unknown], dict[str, Any]]:
    """Return whether each level of a series is fitted by itself first, unknowns that start there, and fit options."""
    settings = campaign.table.settings
    by_level = campaign.table.series is not None and any(isinstance(one, Law) and one.free for one in unknowns)
    started = list(unknowns)
    if by_level:
        started = started_by_level(observations, unknowns, settings, threads=threads, say=say)
    return (
        by_level,
        started,
        {
            "objective": settings.objective,
            "band_width_percent": 100.0 * parse_share(settings.band_width, 'a percentage such as "5 %"'),
            "starts": 1 if by_level else settings.starts,
            "max_evaluations": settings.max_evaluations,
            "threads": threads,
            "strategy": "direct" if by_level else settings.strategy,
        },
    )


def weighable_tolerances(campaign: Campaign, seen: Mapping[str, Measurement]) -> list[Tolerance]:
    """Return the errors of all measurements; a CampaignError where the fit cannot weigh them against the data."""
    tolerances = tolerances_of_measurements(seen)
    if not tolerances:
        return []
    if campaign.table.settings.objective == "percentage":
        raise CampaignError(
            campaign.file,
            [
                Problem(
                    ("settings", "objective"),
                    'is "percentage", which has no likelihood, so that errors of dimensions and materials cannot be '
                    'fitted; expected "log", or no tolerances',
                )
            ],
        )
    bare = [name for name, measured in seen.items() if not measured.observation.weighted]
    if bare:
        expected = (
            "has no standard deviation, which errors of dimensions and materials are weighed against; expected "
            '`standard_deviation`, such as "2 %", or no tolerances'
        )
        raise CampaignError(campaign.file, [Problem(("measurements", name), expected) for name in bare])
    return tolerances


def observed_unknowns(campaign: Campaign, seen: Mapping[str, Measurement]) -> tuple[list[Unknown], list[str]]:
    """Return the unknowns that some fitted measurement's assembly has, and what to say of the others."""
    places = [place_of(measured.observation, index) for index, measured in enumerate(seen.values())]
    kept, notes = [], []
    for unknown in campaign.unknowns:
        own = [place for place in places if place.among(unknown.configurations)]
        if any(place.covered(address) for place in own for address in unknown.reached):
            kept.append(unknown)
        else:
            notes.append(f"{unknown.address} is not identified: no measurement of its assemblies is for identification")
    if not kept:
        raise CampaignError.about(campaign.file, "no assembly that was measured for identification has an unknown")
    return kept, notes
