"""Observations of a campaign with which candidates of some parameters are compared."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from receptance._text import instead_of
from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of
from receptance.identification import (
    Identification,
    MeasuredFRF,
)
from receptance.identification.factors import FACTORS
from receptance.identification.observations import altered
from receptance.identification.prediction import Forecast
from receptance.identification.task import place_of
from receptance.identification.unknowns import covered

if TYPE_CHECKING:
    from receptance.campaign.run import Campaign
    from receptance.identification import Identification, MeasuredFrequencies

__all__ = ["Compared", "compared_with", "expected_misfit"]

_LIMIT, _RARE = 1.25, 1e-3
"""As in a diagnosis: multiple of its expectation up to which a misfit is explained by noise, and tail probability."""


@dataclass(frozen=True)
class Compared:
    """Observations with which candidates of some parameters are compared.

    Attributes
    ----------
    observations : tuple of MeasuredFRF or MeasuredFrequencies
        Observations of the campaign, with the other parameters of their assemblies at the values `held`.
    fit : Identification or None
        The fit of all unknowns without a given value; None if all of them are varied.
    held : dict of str to float
        Given and identified values of the other parameters in SI units.
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
    """Return the measurements for identification, with given and identified values of parameters that do not vary.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    varied : sequence of str
        Addresses of the parameters that vary between candidates.
    given : mapping of str to float
        Values at other addresses in SI units.
    progress : callable, optional
        As in `Campaign.identify`.

    Raises
    ------
    CampaignError
        No measured assembly has a varied or given address; or as in `Campaign.identify`.
    """
    measurements = dict(campaign.to_identify)
    every = [one.observation.assembly for one in measurements.values()]
    for address in (*varied, *given):
        if not any(covered(address, assembly) for assembly in every):
            known = sorted({name for assembly in every for name in assembly.parameters})
            text = f'no measured assembly has the parameter "{address}"{instead_of(address, known)}'
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
            # Candidates are structures, so the identified effect of the measuring chain is removed from the data.
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
    """Return the expected misfit of the true model, and the largest misfit that noise explains.

    None if an observation has no standard deviation.
    """
    from scipy.special import chdtri

    count = 0.0
    for one in observations:
        if not one.weighted:
            return None
        count += 2.0 * one.independent_lines if isinstance(one, MeasuredFRF) else one.frequency_hz.size
    return count, float(np.maximum(_LIMIT * count, chdtri(count, _RARE)))
