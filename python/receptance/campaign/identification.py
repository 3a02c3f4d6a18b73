"""The fit of a campaign, with the errors of dimensions and materials as parameters with priors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.campaign.deviations import parse_share
from receptance.campaign.plain import plain
from receptance.campaign.problems import CampaignError, Problem
from receptance.campaign.series import FEWEST, level_unit, over_levels, started_by_level
from receptance.campaign.tolerances import tolerances_of_measurements
from receptance.identification import Identification, Unknown, identify
from receptance.identification.laws import Law
from receptance.identification.task import Observation, place_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.observations import Measurement
    from receptance.identification.laws import Tolerance
    from receptance.identification.profiles import Profile
    from receptance.taper import ForceSeries

__all__ = [
    "CampaignIdentification",
    "fit_options",
    "identify_campaign",
    "observed_unknowns",
    "weighable_tolerances",
]


@dataclass(frozen=True, kw_only=True)
class CampaignIdentification:
    """Identified parameters of a campaign.

    Attributes
    ----------
    campaign : Campaign
        What was fitted.
    fit : Identification
        Values, standard errors, residuals, advice.
    notes : tuple of str
        What a person should know, of the campaign and of the fit.
    versions : dict of str to str
        What is needed to do it again.
    profiles : dict of str to Profile
        What the data say about each parameter; empty where that was not asked for.
    series : dict of str to ForceSeries
        Parameters over the levels of the campaign's series, in the unit of these.
    """

    campaign: Campaign
    fit: Identification
    notes: tuple[str, ...]
    versions: dict[str, str]
    profiles: dict[str, Profile] = field(default_factory=dict)
    series: dict[str, ForceSeries] = field(default_factory=dict)

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of the measurements that were fitted, in the order of `fit.residuals`."""
        return tuple(self.campaign.to_identify)

    def interval(self, address: str, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of a value in SI units; see `Identification.interval`."""
        return self.fit.interval(address, level)

    def determined(self, address: str) -> bool:
        """Return whether the 95 % interval of a value ends within the bounds of the unknown, on one side at least."""
        unknown = self.fit.unknowns[self.fit.addresses.index(address)]
        low, high = self.interval(address)
        return low > unknown.lower or high < unknown.upper

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds: an infinite number is None."""
        fit, campaign = self.fit, self.campaign
        data, shares = fit.data_errors, fit.scatter().shares
        found: dict[str, Any] = plain(
            {
                "campaign": campaign.title,
                "file": campaign.file.name,
                "converged": fit.converged,
                "parameters": {
                    address: {
                        "value": value,
                        "standard_error": fit.standard_errors[address],
                        "standard_error_of_data": data[address],
                        "interval_95": self.interval(address),
                        "shares_of_variance": {name: own[index] for name, own in shares.items()},
                        "determined": self.determined(address),
                    }
                    for index, (address, value) in enumerate(fit.values.items())
                    if address not in fit.errors
                },
                "errors": {
                    name: {"value": fit.values[name], "standard_error": fit.standard_errors[name]}
                    for name in fit.errors
                },
                "profiles": {
                    name: {
                        "statement": one.statement,
                        "level": one.level,
                        "interval": (one.lower, one.upper),
                        "open": (one.lower_open, one.upper_open),
                        "values": one.values,
                        "rise": one.rise,
                    }
                    for name, one in self.profiles.items()
                },
                **({"series": self._series()} if campaign.table.series is not None else {}),
                "correlation": {"parameters": fit.addresses, "matrix": fit.correlation},
                "covariance_of_fitted_variables": fit.covariance,
                "scales": {unknown.address: unknown.scale for unknown in fit.unknowns},
                "measurements": [
                    {
                        "name": name,
                        "assembly": campaign.measurements[name].assembly,
                        "unit": unit,
                        "count": residual.size,
                        "rms": np.sqrt(np.mean(residual**2)),
                        "residuals": residual,
                    }
                    for name, unit, residual in zip(self.measurements, fit.units, fit.residuals, strict=True)
                ],
                "rms": fit.rms,
                "noise_factor": fit.noise_factor,
                "degrees_of_freedom": fit.degrees_of_freedom,
                "known_scatter": fit.known_scatter,
                "starts": len(fit.starts),
                "starts_agreeing": fit.agreeing,
                "evaluations": fit.evaluations,
                "advice": fit.advice,
                "notes": self.notes,
                "settings": campaign.table.settings.model_dump(),
                "seed": fit.seed,
                "versions": self.versions,
            }
        )
        return found

    def _series(self) -> dict[str, Any]:
        table = self.campaign.table.series
        assert table is not None
        parameters = {name: one.as_dict() for name, one in self.series.items()}
        return {"over": table.over, "unit": level_unit(table)[0], "parameters": parameters}

    def plot(self) -> Figure:
        """Draw the measurements against the fitted model, with what is left; of a series, parameters over levels."""
        if self.series:
            from receptance.plot.series import draw_series

            return draw_series(self)
        from receptance.plot.campaign import draw_identification

        return draw_identification(self)

    def plot_profiles(self) -> Figure:
        """Draw the profile likelihoods; see `receptance.plot.profiles.draw_profiles`.

        Raises
        ------
        ValueError
            There are none, because `profiles` is off, standard deviations are unknown, or levels form a series.
        """
        from receptance.plot.profiles import draw_profiles

        return draw_profiles(self.profiles, self.campaign.title)

    def __repr__(self) -> str:
        return f"CampaignIdentification({self.campaign.title!r}, {self.fit!r})"


def identify_campaign(
    campaign: Campaign, *, threads: int | None = None, progress: Callable[[str], None] | None = None
) -> CampaignIdentification:
    """Identify the unknowns of a campaign; see `Campaign.identify`."""
    from receptance.studies._provenance import versions

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
    series = over_levels(campaign, fit)
    notes = [
        *campaign.notes,
        *left_out,
        *(n for n in fit.notes if not any(said.endswith(n) for said in campaign.notes)),
    ]
    if fit.errors:
        notes.append(f"{len(fit.errors)} errors of dimensions and materials are fitted, their tolerances are priors")
    profiles = {}
    if by_level:
        notes.append(
            "each level was fitted by itself first, and all together from there; profile intervals are not computed "
            "for a series"
        )
        if not series:
            notes.append(f"nothing is said of trends and laws: that takes {FEWEST} different levels or more, from 0 on")
    if settings.profiles and not by_level and fit.known_scatter and settings.objective == "log":
        profiles = fit.profiles(progress=say)
    return CampaignIdentification(
        campaign=campaign,
        fit=fit,
        notes=tuple(notes),
        versions=versions(),
        profiles=profiles,
        series=series,
    )


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
