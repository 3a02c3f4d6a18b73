"""The fit of a campaign, and what its tolerances make of the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.campaign.plain import plain
from receptance.campaign.problems import CampaignError
from receptance.campaign.propagation import Propagation, tolerances_of
from receptance.campaign.quantities import parse_share
from receptance.campaign.series import FEWEST, level_unit, over_levels, started_by_level
from receptance.identification import Identification, MeasuredFRF, Unknown, identify
from receptance.identification.factors import FACTORS
from receptance.identification.laws import Law
from receptance.identification.spread import quantile
from receptance.identification.task import place_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.format import SettingsTable
    from receptance.campaign.observations import Measurement
    from receptance.identification.laws import Tolerance
    from receptance.identification.profiles import Profile
    from receptance.taper import ForceSeries

__all__ = ["CampaignIdentification", "identify_campaign", "observed_unknowns", "tolerances_of_measurements"]

_DISAGREE = 1.3
"""Residuals this many times their standard deviation, as rms, say that exact dimensions do not fit the data."""


@dataclass(frozen=True, kw_only=True)
class CampaignIdentification:
    """Identified parameters of a campaign.

    Attributes
    ----------
    campaign : Campaign
        What was fitted.
    fit : Identification
        Values, standard errors from the scatter of the data, residuals, advice.
    propagation : Propagation
        How the fit reacts to the tolerances, which it takes as exact.
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
    propagation: Propagation
    notes: tuple[str, ...]
    versions: dict[str, str]
    profiles: dict[str, Profile] = field(default_factory=dict)
    series: dict[str, ForceSeries] = field(default_factory=dict)

    @property
    def measurements(self) -> tuple[str, ...]:
        """Names of the measurements that were fitted, in the order of `fit.residuals`."""
        return tuple(self.campaign.to_identify)

    def standard_errors(self) -> dict[str, float]:
        """Standard errors in SI units by address, from the scatter of the data and the tolerances together."""
        return self.propagation.standard_errors()

    def interval(self, address: str, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of a value in SI units, tolerances included; symmetric in the fitted variable.

        Raises
        ------
        ValueError
            An address that was not identified, or a level not between 0 and 1.
        """
        value = self.fit.values[address] if address in self.fit.values else self.fit.interval(address)[0]
        unknown = self.fit.unknowns[self.fit.addresses.index(address)]
        reach = quantile(level, None if self.fit.known_scatter else self.fit.degrees_of_freedom)
        spread = self.standard_errors()[address]
        if unknown.scale == "linear":
            return value - reach * spread, value + reach * spread
        with np.errstate(over="ignore"):
            factor = float(np.exp(np.float64(reach * spread / value)))
        return (value / factor if np.isfinite(factor) else 0.0), value * factor

    def determined(self, address: str) -> bool:
        """Return whether the 95 % interval of a value ends within the bounds of the unknown, on one side at least."""
        unknown = self.fit.unknowns[self.fit.addresses.index(address)]
        low, high = self.interval(address)
        return low > unknown.lower or high < unknown.upper

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds: an infinite number is None."""
        fit, campaign = self.fit, self.campaign
        together = self.standard_errors()
        found: dict[str, Any] = plain(
            {
                "campaign": campaign.title,
                "file": campaign.file.name,
                "converged": fit.converged,
                "parameters": {
                    address: {
                        "value": value,
                        "standard_error": fit.standard_errors[address],
                        "interval_95": fit.interval(address),
                        "standard_error_with_tolerances": together[address],
                        "interval_95_with_tolerances": self.interval(address),
                        "determined": self.determined(address),
                    }
                    for address, value in fit.values.items()
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
            There are none: `profiles` is off, or tolerances are propagated.
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
    width = band_width_percent(settings)
    try:
        fit = identify(
            observations,
            unknowns,
            objective=settings.objective,
            band_width_percent=width,
            starts=starts,
            seed=settings.seed,
            max_evaluations=settings.max_evaluations,
            threads=threads,
            tolerances=tolerances_of_measurements(seen) if fitted else (),
            strategy="direct" if by_level else settings.strategy,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    series = over_levels(campaign, fit)
    say("propagating the tolerances")
    propagation = Propagation(fit, observations, effects, width)
    notes = [
        *campaign.notes,
        *left_out,
        *(n for n in fit.notes if not any(said.endswith(n) for said in campaign.notes)),
    ]
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
    profiles = {}
    if by_level:
        notes.append(
            "each level was fitted by itself first, and all together from there; profile intervals are not computed "
            "for a series"
        )
        if not series:
            notes.append(f"nothing is said of trends and laws: that takes {FEWEST} different levels or more, from 0 on")
    if settings.profiles and not by_level and fit.known_scatter and settings.objective == "log" and not any(effects):
        profiles = fit.profiles(progress=say)
    return CampaignIdentification(
        campaign=campaign,
        fit=fit,
        propagation=propagation,
        notes=tuple(notes),
        versions=versions(),
        profiles=profiles,
        series=series,
    )


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
