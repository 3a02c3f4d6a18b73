"""Comparison of candidates, values of some parameters of a campaign, with its measurements."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import special

from receptance import sweep
from receptance._text import instead_of
from receptance.campaign.data import CampaignData
from receptance.campaign.identification import identify_campaign
from receptance.campaign.values import kind_of
from receptance.fit import Identification, Observation
from receptance.fit.adequacy import CHANCE, MISFIT_LIMIT
from receptance.fit.observation import altered
from receptance.fit.parameters import FACTORS
from receptance.fit.unknowns import Law, covered
from receptance.report import Column, Provenance, Result, Table
from receptance.sweep import Candidates

if TYPE_CHECKING:
    import xarray as xr

_BEST = 10
"""Largest number of candidates in tables and `to_dict`."""


@dataclass(frozen=True, kw_only=True)
class Comparison(Result):
    """Candidates of a campaign and their misfits to its measurements."""

    candidates: xr.Dataset = field(repr=False)
    """All candidates, as `receptance.sweep.sweep` returns them, with the variable `misfit`."""
    addresses: tuple[str, ...]
    """Addresses of the parameters that vary."""
    fit: Identification | None = field(repr=False)
    """The fit of all unknowns without a given value; None if all of them vary."""
    given: dict[str, float]
    """Given values of other parameters in SI units."""
    expected_misfit: float | None
    """Misfit of the true model that is expected from noise; None if a measurement has no standard deviation."""
    limit: float | None
    """Largest misfit that noise explains."""
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Comparison of candidates"
    plotted_by = "receptance.campaign.figure:draw_comparison"

    @property
    def fixed(self) -> dict[str, float]:
        """Given and identified values of the parameters that do not vary, in SI units."""
        if self.fit is None:
            return dict(self.given)
        varied, errors = self.addresses, self.fit.errors
        others = {n: v for n, v in self.fit.values.items() if n.split(" ")[0] not in varied and n not in errors}
        return {**self.given, **others}

    @cached_property
    def best(self) -> xr.Dataset:
        """Valid candidates with the smallest misfits, at most ten, in order of the misfit; `number` is their index."""
        valid = self.candidates["valid"].values
        order = np.argsort(np.where(valid, self.candidates["misfit"].values, np.inf), kind="stable")
        chosen = order[: min(_BEST, int(valid.sum()))]
        # Only these candidates of a store are loaded.
        return self.candidates.isel(candidate=chosen).load().assign(number=("candidate", chosen))

    @property
    def misfit_of_fit(self) -> float | None:
        """Misfit of the fit; None without a fit or without standard deviations."""
        if self.fit is None or not self.fit.known_scatter:
            return None
        return float(sum(np.sum(np.square(residual)) for residual in self.fit.residuals))

    @property
    def agrees(self) -> bool | None:
        """Whether the misfit of the best candidate is explained by noise; None without standard deviations."""
        if self.limit is None:
            return None
        best = self.best["misfit"].values
        return bool(best.size and best[0] <= self.limit)

    def tables(self) -> list[Table]:
        """Return the best candidates."""
        names = ("misfit", *self.addresses)
        columns = [Column("misfit", form=".6g"), *(Column(name, form=".5g") for name in self.addresses)]
        best = self.best
        rows = list(zip(*(best[name].values.tolist() for name in names), strict=True))
        return [Table("The best candidates, values in SI units", columns, rows)]

    def sentences(self) -> list[str]:
        """Return the number of candidates, the values of other parameters, and whether a candidate fits the data."""
        count, valid = self.candidates.sizes["candidate"], int(self.candidates["valid"].sum())
        invalid = f"; {count - valid:,} of them are not valid models" if valid < count else ""
        found = [f"{count:,} candidates of {', '.join(self.addresses)}{invalid}."]
        if self.fixed:
            values = (f"{name} = {value:.5g} {_unit(name)}".rstrip() for name, value in self.fixed.items())
            identified = "" if self.fit is None else ", identified" + (" where no value is given" if self.given else "")
            found.append(f"Not varied: {', '.join(values)}{identified}.")
        best = self.best["misfit"].values
        if self.expected_misfit is None or self.limit is None:
            found.append(
                "Agreement with the data cannot be tested, because not all measurements have a standard deviation "
                "(`standard_deviation`, or coherence and `averages`)."
            )
        elif not best.size:
            found.append("No candidate agrees with the data: none is a valid model.")
        else:
            limit = f"(limit {self.limit / self.expected_misfit:.3g})"
            ratio = f"{best[0] / self.expected_misfit:.3g} times the misfit expected from noise {limit}"
            if self.agrees:
                return [*found, f"The best candidate agrees with the data: its misfit is {ratio}."]
            found.append(f"No candidate agrees with the data: the smallest misfit is {ratio}.")
            if self.misfit_of_fit is not None:
                times = f"{self.misfit_of_fit / self.expected_misfit:.3g} times"
                if self.misfit_of_fit <= self.limit:
                    found.append(f"The fit of the unknowns agrees, with {times}.")
                else:
                    which = "the other unknowns at the given values" if self.given else "the unknowns"
                    found.append(f"The fit of {which} does not agree either, with {times}.")
        return found

    def warnings(self) -> list[str]:
        """Return the next step if no candidate agrees with the data."""
        if self.agrees in (None, True) or not self.best["misfit"].size:
            return []
        if self.misfit_of_fit is None:
            other = "Finer steps, other ranges or other parameters may agree"
            return [f"{other}; `receptance identify` finds the best values."]
        if self.limit is not None and self.misfit_of_fit <= self.limit:
            return ["Use finer steps or other ranges."]
        return [] if self.given else ["Find the cause with `receptance diagnose`."]

    def data(self) -> dict[str, Any]:
        """Return the best candidates and their agreement with the data."""
        valid, best = self.candidates["valid"], self.best
        return {
            "candidates": valid.size,
            "no_model": int((~valid).sum()),
            "best": [
                {
                    "number": int(one["number"]),
                    "misfit": float(one["misfit"]),
                    "values": {name: float(one[name]) for name in self.addresses},
                }
                for one in (best.isel(candidate=i) for i in range(best.sizes["candidate"]))
            ],
            "held": self.fixed,
            "expected_misfit": self.expected_misfit,
            "limit": self.limit,
            "misfit_of_fit": self.misfit_of_fit,
            "agrees": self.agrees,
        }


def compare_candidates(
    campaign: CampaignData,
    candidates: Candidates,
    *,
    given: Mapping[str, float] | None = None,
    store: str | os.PathLike[str] | None = None,
) -> Comparison:
    """Compare candidates with the measurements that are not held out; see `Campaign.compare`."""
    if not campaign.to_identify:
        raise campaign.error('there is no measurement with the role "identify" to compare candidates with')
    given = dict(given or {})
    observations, fit = _observations(campaign, candidates.addresses, given)
    found = sweep.sweep(
        campaign.assemblies,
        candidates,
        sweep.Misfit(observations),
        store=store,
        progress=lambda state: campaign.progress(str(state)),
    )
    expected, limit = expected_misfit(observations)
    laws = [u.address for u in campaign.unknowns if isinstance(u, Law) and u.address in candidates.addresses]
    one_value = "a candidate has one value of {} for all assemblies, although the campaign has a law"
    settings = {name: json.loads(text) for name, text in found.attrs.items() if name != "receptance"}
    return Comparison(
        candidates=found,
        addresses=candidates.addresses,
        fit=fit,
        given=given,
        expected_misfit=expected,
        limit=limit,
        notes=(one_value.format(", ".join(laws)),) if laws else (),
        provenance=campaign.provenance(seed=settings["candidates"].get("seed"), settings=settings),
    )


def _observations(
    campaign: CampaignData, varied: Sequence[str], given: Mapping[str, float]
) -> tuple[tuple[Observation, ...], Identification | None]:
    """Return the observations with given and identified values of parameters that do not vary, and the fit."""
    measurements = dict(campaign.to_identify)
    every = [observation.assembly for observation in measurements.values()]
    for address in (*varied, *given):
        if not any(covered(address, assembly) for assembly in every):
            known = sorted({name for assembly in every for name in assembly.parameters})
            raise campaign.error(f'no measured assembly has the parameter "{address}"{instead_of(address, known)}')
    for address, value in given.items():
        for name, observation in measurements.items():
            assembly = observation.assembly
            assembly = assembly.replace(dict.fromkeys(covered(address, assembly), value))
            measurements[name] = altered(observation, assembly=assembly)
    observations = tuple(measurements.values())
    unknowns = tuple(unknown for unknown in campaign.unknowns if unknown.address not in given)
    if all(unknown.address in varied for unknown in unknowns):
        return observations, None
    fit = identify_campaign(replace(campaign, measurements=measurements, unknowns=unknowns))
    identified = []
    for name, measured, assembly in zip(measurements, observations, fit.assemblies, strict=True):
        observation = altered(measured, assembly=assembly)
        if measured.is_receptance and any(unknown.address in FACTORS for unknown in fit.unknowns):
            # Candidates are structures, so the identified effect of the measuring chain is removed from the data.
            predicted = fit.predictor.at(measured.site(0), campaign.errors[name])
            chain = predicted.recorded(measured) / assembly.receptance(
                measured.frequency_hz, response=measured.response, excitation=measured.excitation
            )
            observation = altered(observation, receptance=measured.receptance / chain)
        identified.append(observation)
    return tuple(identified), fit


def expected_misfit(
    observations: Sequence[Observation],
) -> tuple[float, float] | tuple[None, None]:
    """Return the misfit of the true model expected from noise, and the largest misfit that noise explains.

    None if an observation has no standard deviation.
    """
    if not all(observation.weighted for observation in observations):
        return None, None
    count = sum(observation.independent_values for observation in observations)
    return count, float(np.maximum(MISFIT_LIMIT * count, special.chdtri(count, CHANCE)))


def _unit(address: str) -> str:
    try:
        return kind_of(address).unit
    except ValueError:
        return ""  # exponent of a law, or value of one configuration
