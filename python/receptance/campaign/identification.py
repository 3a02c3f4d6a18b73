"""The fit of a campaign, and the propagation of its tolerances."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from receptance.campaign.deviations import parse_share
from receptance.campaign.problems import CampaignError
from receptance.campaign.propagation import Propagation, tolerances_of
from receptance.campaign.series import FEWEST, over_levels, started_by_level
from receptance.identification import Identification, MeasuredFRF, Unknown, identify
from receptance.identification.factors import FACTORS
from receptance.identification.laws import Law
from receptance.identification.task import place_of

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.measurement_models import SettingsTable
    from receptance.campaign.observations import Measurement
    from receptance.identification.laws import Tolerance

__all__ = ["identify_campaign", "observed_unknowns", "propagation_of", "tolerances_of_measurements"]

_DISAGREE = 1.3
"""Residuals this many times their standard deviation, as rms, say that exact dimensions do not fit the data."""


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
    fitted = settings.tolerances == "fit"
    effects = [{} if fitted else measured.effects for measured in seen.values()]
    if any(effects) and any(unknown.address in FACTORS for unknown in unknowns):
        text = 'what stands between structure and record is unknown (`observation.`), expected `tolerances = "fit"`'
        raise CampaignError.about(campaign.file, text)
    observations = [measured.observation for measured in seen.values()]
    lines = sum(o.frequency_hz.size for o in observations)
    by_level = campaign.table.series is not None and any(isinstance(one, Law) and one.free for one in unknowns)
    if by_level:
        unknowns = started_by_level(observations, unknowns, settings, threads=threads, say=say)
    starts = 1 if by_level else settings.starts
    say(f"fitting {len(unknowns)} parameters to {lines} lines and modes from {starts} starts")
    try:
        fit = identify(
            observations,
            unknowns,
            objective=settings.objective,
            band_width_percent=band_width_percent(settings),
            starts=starts,
            seed=settings.seed,
            max_evaluations=settings.max_evaluations,
            threads=threads,
            tolerances=tolerances_of_measurements(seen) if fitted else (),
            strategy="direct" if by_level else settings.strategy,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    say("propagating the tolerances")
    fit = replace(
        fit,
        series=over_levels(campaign, fit),
        groups=campaign.templates,
        propagation=Propagation(fit, observations, effects, band_width_percent(settings)),
        provenance=campaign.provenance(seed=settings.seed, settings=settings.model_dump()),
    )
    notes = [*campaign.notes, *left_out, *(n for n in fit.notes if not any(o.endswith(n) for o in campaign.notes))]
    if any(effects):
        notes.append("tolerances widen the intervals; the fit itself takes dimensions and materials as exact")
        notes += _on_damping(fit) if any(isinstance(o, MeasuredFRF) for o in observations) else []
    if settings.objective == "percentage" and any(isinstance(o, MeasuredFRF) for o in observations) and any(effects):
        notes.append(
            "how the fit reacts to tolerances is taken from least squares on the lines of its bands, which the "
            "percentage objective only resembles"
        )
    if fitted and fit.errors:
        notes.append(f"{len(fit.errors)} errors of dimensions and materials are fitted, their tolerances are priors")
    if by_level:
        notes.append(
            "each level was fitted by itself first, and all together from there; profile intervals are not computed "
            "for a series"
        )
        if not fit.series:
            notes.append(f"trends and laws are not fitted: they take {FEWEST} different levels or more, from 0 on")
    profiled = None
    if settings.profiles and not by_level and fit.known_scatter and settings.objective == "log" and not any(effects):
        profiled = fit.profiles(progress=say)
    return replace(fit, notes=notes, profiled=profiled)


def propagation_of(fit: Identification | None) -> Propagation:
    """Return how a fit reacts to tolerances; one of nothing, or of a fit without a campaign, does not."""
    return Propagation(fit, [], []) if fit is None or fit.propagation is None else fit.propagation


def tolerances_of_measurements(seen: Mapping[str, Measurement]) -> list[Tolerance]:
    """Return the errors of all measurements; what has the same name is one error."""
    return [one for name, measured in seen.items() for one in tolerances_of(measured.effects, name)]


def _on_damping(fit: Identification) -> list[str]:
    """Say where intervals of dampings cannot be trusted; linear propagation does not see why."""
    damped = [a for a in fit.addresses if a.split(".")[-1].startswith("c_") or a.endswith("loss_factor")]
    if not damped or not fit.known_scatter or fit.rms < _DISAGREE:
        return []
    return [
        f"the residuals are {fit.rms:.2g} times what noise explains: dimensions are off (the resonances of several "
        "measurements then do not fit one model) or the noise is larger than stated; dampings answer to that first, "
        f"and the intervals of {', '.join(damped)} do not cover it"
    ]


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


def band_width_percent(settings: SettingsTable) -> float:
    """Return how far a band reaches to either side of its peak, in percent."""
    return 100.0 * parse_share(settings.band_width, 'a percentage such as "5 %"')
