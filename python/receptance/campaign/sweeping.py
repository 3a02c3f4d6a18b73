"""What a sweep over some parameters of a campaign compares candidates with, the other unknowns where they belong."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of
from receptance.identification import MeasuredFRF
from receptance.identification.factors import FACTORS
from receptance.identification.observations import altered
from receptance.identification.prediction import Forecast
from receptance.identification.task import place_of
from receptance.identification.unknowns import covered

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign
    from receptance.identification import Identification, MeasuredFrequencies

__all__ = ["Compared", "compared_with", "expected_misfit"]

_LIMIT, _RARE = 1.25, 1e-3
"""As in a diagnosis: up to this multiple of its expectation a misfit counts as explained, or to its rare quantile."""


@dataclass(frozen=True)
class Compared:
    """Observations that candidates of some parameters are compared with.

    Attributes
    ----------
    observations : tuple of MeasuredFRF or MeasuredFrequencies
        Of the campaign, each on its assembly with the other parameters at `held` and at what was identified.
    fit : Identification or None
        The fit of all unknowns that are not given; None where no other unknown is left.
    held : dict of str to float
        The other unknowns, and what was given, in SI units.
    """

    observations: tuple[MeasuredFRF | MeasuredFrequencies, ...]
    fit: Identification | None
    held: dict[str, float]


def compared_with(
    campaign: Campaign,
    varied: Sequence[str],
    given: Mapping[str, float],
    progress: Callable[[str], None] | None = None,
) -> Compared:
    """Return the measurements to identify from, with given values of some parameters and identified ones of others.

    Parameters
    ----------
    campaign : Campaign
        What was measured.
    varied : sequence of str
        Addresses that candidates have values of.
    given : mapping of str to float
        Values of other addresses, in SI units.
    progress : callable, optional
        As in `Campaign.identify`.

    Raises
    ------
    CampaignError
        No assembly has a varied or given address; or as in `Campaign.identify`.
    """
    measurements = dict(campaign.to_identify)
    every = [one.observation.assembly for one in measurements.values()]
    for address in (*varied, *given):
        if not any(covered(address, assembly) for assembly in every):
            known = ", ".join(sorted({name for assembly in every for name in assembly.parameters}))
            text = f"no assembly has the parameter {address!r} where it was measured; there are {known}"
            raise CampaignError.about(campaign.file, text)
    for address, value in given.items():
        for name, one in measurements.items():
            assembly = one.observation.assembly
            assembly = assembly.replace(dict.fromkeys(covered(address, assembly), value))
            measurements[name] = replace(one, observation=altered(one.observation, assembly=assembly))
    observations = tuple(one.observation for one in measurements.values())
    unknowns = tuple(unknown for unknown in campaign.unknowns if unknown.address not in given)
    if all(unknown.address in varied for unknown in unknowns):
        return Compared(observations, None, dict(given))
    settings = campaign.table.settings.model_copy(update={"profiles": False})
    found = replace(
        campaign,
        table=campaign.table.model_copy(update={"settings": settings}),
        measurements=measurements,
        unknowns=unknowns,
    ).identify(progress=progress)
    placed = []
    for name, seen, assembly in zip(measurements, observations, found.assemblies, strict=True):
        here = altered(seen, assembly=assembly)
        if isinstance(seen, MeasuredFRF) and any(unknown.address in FACTORS for unknown in found.unknowns):
            # Candidates are structures: what the measuring chain does to the record is taken out of the record.
            forecast = Forecast(found, place_of(seen, 0), tolerances_of(measurements[name].effects))
            chain = forecast.recorded(seen) / assembly.receptance(
                seen.frequency_hz, response=seen.response, excitation=seen.excitation
            )
            here = altered(here, receptance=seen.receptance / chain)
        placed.append(here)
    others = {
        name: value
        for name, value in found.values.items()
        if name.split(" ")[0] not in varied and name not in found.errors
    }
    return Compared(tuple(placed), found, {**given, **others})


def expected_misfit(observations: Sequence[MeasuredFRF | MeasuredFrequencies]) -> tuple[float, float] | None:
    """Return what the misfit of the true model is on average, and up to where it counts as explained by noise.

    None where some observation has no standard deviation.
    """
    from scipy.special import chdtri

    count = 0.0
    for one in observations:
        if not one.weighted:
            return None
        count += 2.0 * one.independent_lines if isinstance(one, MeasuredFRF) else one.frequency_hz.size
    return count, float(np.maximum(_LIMIT * count, chdtri(count, _RARE)))
