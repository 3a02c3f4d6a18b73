"""A campaign at chosen values of its parameters, beside its measurements: what a slider moves."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from receptance._text import instead_of, shown
from receptance.campaign.data import CampaignData
from receptance.campaign.identification import fit_inputs
from receptance.campaign.stability import stability_of_campaign
from receptance.diagnosis import Cause
from receptance.diagnosis.by_mode import measured_modes
from receptance.diagnosis.causes import CauseMove, CauseUnknown, Variant, extend
from receptance.diagnosis.changes import overhangs_of
from receptance.diagnosis.model import Model
from receptance.errors import ReceptanceError
from receptance.fit import Identification, Observation, Tolerance, Unknown
from receptance.fit.prediction import DECIBEL
from receptance.fit.problem import Problem
from receptance.fit.unknowns import PARAMETERS, Move
from receptance.model.assembly import Assembly
from receptance.model.modes import damped_modes
from receptance.stability import Stability

_EVALUATIONS = 200
"""Most evaluations of a fit."""
_OVERHANG = 0.5
"""Bounds of an overhang as a share of the length that sticks out."""
_ADDED = 2.0
"""Bounds of a parameter that is no unknown: from its value over this factor to its value times it."""


@dataclass(frozen=True, eq=False)
class TrialRecord:
    """A measured FRF and the model at the values of a trial, with the measuring chain."""

    observation: Observation
    calculated: NDArray[np.complex128]
    """Receptance of the model `(n,)`."""
    held_out: bool
    """Whether no fit uses it."""

    @property
    def difference_db(self) -> NDArray[np.float64]:
        """Measured over calculated magnitude in dB."""
        return DECIBEL * np.log(np.abs(self.observation.receptance / self.calculated))

    @property
    def difference_deg(self) -> NDArray[np.float64]:
        """Phase of the measured over that of the calculated receptance in degrees, from -180 to 180."""
        return np.degrees(np.angle(self.observation.receptance / self.calculated))


@dataclass(frozen=True)
class TrialMode:
    """A mode of a measurement and of the model; NaN where a side does not have or state it."""

    measured_hz: float = math.nan
    measured_damping: float = math.nan
    """Damping ratio."""
    calculated_hz: float = math.nan
    calculated_damping: float = math.nan

    @property
    def difference_percent(self) -> float:
        """Calculated less measured frequency, over the measured one, in percent."""
        return 100.0 * (self.calculated_hz / self.measured_hz - 1.0)


@dataclass(frozen=True, eq=False)
class Trial:
    """The model of a campaign at chosen values of its parameters.

    It is immutable; methods return changed copies, which share what does not depend on the values.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import campaign, examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("forgotten-sensor", folder)
    ...     trial = campaign.load(folder).trial()
    >>> softer = trial.at({"joint.k_theta": 0.5 * trial.values["joint.k_theta"]})
    >>> bool(softer.misfit > trial.misfit)
    True
    """

    campaign: CampaignData
    model: Model
    """All measurements, held-out ones included, with unknowns and tolerances; with the causes that act."""
    values: Mapping[str, float]
    """Value of each unknown, and of each error of a tolerance in standard deviations, by name; in SI units."""
    variants: tuple[Variant, ...] = ()
    """The causes that act, as they act."""
    described: Model | None = field(default=None, repr=False)
    """The model without causes; None where none acts."""

    @classmethod
    def of(cls, campaign: CampaignData, identified: Identification | None = None) -> Trial:
        """Return a campaign at the values of an identification, or at its start values.

        Raises
        ------
        CampaignError
            There are no measurements or no unknowns.
        """
        if identified is None:
            described, _, errors = fit_inputs(campaign)
            unknowns, tolerances = tuple(described), tuple(errors)
        else:
            unknowns, tolerances = identified.task.parameters.given, identified.task.parameters.tolerances
        observations = tuple(campaign.measurements.values())
        model = Model(observations, unknowns, tuple(tolerances), threads=campaign.threads)
        variables = model.task.variables
        values = dict(zip(variables.names, variables.to_values(variables.start).tolist(), strict=True))
        if identified is not None:
            values |= {name: value for name, value in identified.values.items() if name in values}
        return cls(campaign, model, MappingProxyType(values))

    # Values.

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """The parameters with bounds, errors of tolerances last."""
        return self.model.task.variables.unknowns

    def effect(self, name: str) -> tuple[float, str] | None:
        """Return by how much an unknown changes what it moves, with the SI unit, or the unit "%" of relative changes.

        It is None for a parameter itself, and where several addresses move by different amounts.
        """
        errors = [tolerance for tolerance in self.model.task.parameters.tolerances if tolerance.name == name]
        moves = [unknown for unknown in self.unknowns if unknown.name == name and isinstance(unknown, Move)]
        sources: list[Tolerance | Move] = [*errors, *moves]
        sizes = {
            (size, source.relative, _unit(address)) for source in sources for address, size in source.moves.items()
        }
        if len(sizes) != 1:
            return None
        size, relative, unit = sizes.pop()
        change = size * self.values[name]
        return (100.0 * math.expm1(change), "%") if relative else (change, unit)

    def is_error(self, name: str) -> bool:
        """Return whether an unknown is the error of a tolerance, whose values are standard deviations."""
        return name in self.model.task.parameters.errors

    def at(self, values: Mapping[str, float]) -> Trial:
        """Return the trial with other values of some unknowns.

        Raises
        ------
        ValueError
            There is no such unknown, or a value is beyond its bounds.
        """
        bounds = {unknown.name: unknown for unknown in self.unknowns}
        for name, value in values.items():
            if name not in bounds:
                raise ValueError(f"there is no unknown {shown(name)}{instead_of(name, bounds)}")
            low, high = bounds[name].lower, bounds[name].upper
            if not low <= value <= high:
                raise ValueError(f"{name} is {value:g}, expected from {low:g} to {high:g} {bounds[name].unit}".rstrip())
        return replace(self, values=MappingProxyType({**self.values, **values}))

    def with_parameter(self, address: str) -> Trial:
        """Return the trial in which the parameter at an address can be moved as well.

        Its bounds are half and twice its value.

        Raises
        ------
        ValueError
            No measured assembly has the address, it is an unknown, or its value is zero.
        """
        sites = [observation.site(index) for index, observation in enumerate(self.model.observations)]
        values = {site.value(address) for site in sites if address in site.assembly.parameters}
        if not values:
            names = dict.fromkeys(name for o in self.model.observations for name in o.assembly.parameters)
            raise ValueError(f"no measured assembly has {shown(address)}{instead_of(address, names)}")
        if self.model.has(address):
            raise ValueError(f"{address} is an unknown already")
        value = values.pop()
        if values:
            raise ValueError(f"{address} differs between the measured assemblies, expected one value")
        if value <= 0.0:
            raise ValueError(f"{address} is {value:g}, expected more than zero")
        return self._plus(Unknown(address=address, lower=value / _ADDED, upper=value * _ADDED, start=value))

    def with_overhangs(self) -> Trial:
        """Return the trial in which the overhang of each tool can be moved, by a change of its length in m."""
        moves = []
        for address, configurations in overhangs_of(self.model).items():
            length = self.campaign.site(configurations[0]).value(address)
            moves.append(
                Move(
                    address=f"overhang {address}", moves={address: 1.0}, relative=False,
                    lower=-_OVERHANG * length, upper=_OVERHANG * length, start=0.0,
                )
            )  # fmt: skip
        return self._plus(*(move for move in moves if not self.model.has(next(iter(move.moves)))))

    def _plus(self, *unknowns: Unknown) -> Trial:
        starts = {unknown.name: float(unknown.start or 0.0) for unknown in unknowns}
        # Causes act on what the parameters describe.
        described = (self.described or self.model).plus(*unknowns)
        model = extend(described, self.variants) if self.variants else described
        return replace(
            self, model=model, described=described if self.variants else None,
            values=MappingProxyType({**self.values, **starts}),
        )  # fmt: skip

    def with_causes(self, variants: Sequence[Variant]) -> Trial:
        """Return the trial in which exactly these causes act; those that are new have their typical size.

        Raises
        ------
        UndecidableError
            The data cannot show a cause, or the model cannot have it.
        """
        described = self.described or self.model
        model = extend(described, variants)
        values = {unknown.name: _typical(unknown) for unknown in model.task.variables.unknowns}
        values |= {name: value for name, value in self.values.items() if name in values}
        return replace(
            self, model=model, described=described if variants else None,
            variants=tuple(variants), values=MappingProxyType(values),
        )  # fmt: skip

    def as_fitted(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Trial:
        """Return the trial in which exactly these causes act, at the values of a fit.

        Values of others than its unknowns, or beyond their bounds, are left out. Raises as `with_causes`.
        """
        trial = self.with_causes(variants)
        fitting = {u.name: values[u.name] for u in trial.unknowns
                   if u.name in values and u.lower <= values[u.name] <= u.upper}  # fmt: skip
        return trial.at(fitting)

    def variants_of(self, cause: Cause) -> list[Variant]:
        """Return the ways in which a cause can act on the model; raises as `Cause.extensions`."""
        return [variant for variant, _ in cause.extensions(self.described or self.model)]

    def fit(self, held: Collection[str] = ()) -> Trial:
        """Return the trial at the optimum of the measurements that are not held out, with some unknowns held.

        It begins at the values of the trial, and at the start values, and ends at the better of both optima.

        Raises
        ------
        ReceptanceError
            The model has no value at the values of the trial.
        """
        model = self.model.select(self._fitted)
        variables, problem = model.task.variables, self._residuals(model)
        free = np.array([name not in held for name in variables.names])
        if not free.any():
            return self
        here = np.clip(variables.vector_of(self.values), *variables.limits)
        ends = problem.fit(np.array([here, np.where(free, variables.start, here)]), _EVALUATIONS, free=free)
        end = min(ends, key=lambda end: end.cost)
        if not np.isfinite(end.cost):
            raise ReceptanceError(f"the model has no value here: {problem.reason(end.x)}")
        fitted = {name: value for name, value in problem.named(end.x).items() if name not in held}
        return replace(self, values=MappingProxyType({**self.values, **fitted}))

    # What the model says at these values.

    @cached_property
    def _problem(self) -> Problem:
        # Trials of one model share its problem.
        if "_trial_problem" not in self.model.__dict__:
            self.model.__dict__["_trial_problem"] = self._ratios(self.model)
        problem: Problem = self.model.__dict__["_trial_problem"]
        return problem

    @staticmethod
    def _ratios(model: Model) -> Problem:
        """Return the logarithms of measured over calculated receptances, and the residuals of frequencies."""
        units = tuple("logarithm" if o.is_receptance else o.unit for o in model.observations)
        return replace(model.task, units=units).problem()

    @staticmethod
    def _residuals(model: Model) -> Problem:
        """Return the residuals of a fit: in standard deviations where all measurements have them."""
        if all(observation.weighted for observation in model.observations):
            return model.problem
        return replace(model.task, units=tuple(o.unit for o in model.observations)).problem()

    @property
    def _fitted(self) -> list[Observation]:
        held_out = self.campaign.held_out
        return [o for name, o in zip(self.campaign.measurements, self.model.observations, strict=True)
                if name not in held_out]  # fmt: skip

    @cached_property
    def _variables(self) -> NDArray[np.float64]:
        return self.model.task.variables.vector_of(self.values)

    @cached_property
    def _parts(self) -> list[NDArray[np.float64]]:
        return self._problem.parts(self._problem.value(self._variables))

    @cached_property
    def records(self) -> dict[str, TrialRecord]:
        """Measured FRFs by name, with the model.

        Raises
        ------
        ReceptanceError
            The model has no value at these values.
        """
        held_out = self.campaign.held_out
        records = {}
        for name, observation, part in zip(
            self.campaign.measurements, self.model.observations, self._parts, strict=True
        ):
            if observation.is_receptance:
                real, imaginary = part.reshape(2, -1)
                calculated = observation.receptance * np.exp(-real - 1j * imaginary)
                records[name] = TrialRecord(observation, calculated, name in held_out)
        return records

    @cached_property
    def misfit(self) -> float | None:
        """Root mean square of the residuals that are fitted, in standard deviations; None where not all have one."""
        squares, count = 0.0, 0
        held_out = self.campaign.held_out
        for name, observation, part in zip(
            self.campaign.measurements, self.model.observations, self._parts, strict=True
        ):
            if name in held_out:
                continue
            if not observation.weighted:
                return None
            if observation.is_receptance:
                part = part / observation.standard_deviations
            squares, count = squares + float(part @ part), count + part.size
        return float(np.sqrt(squares / count)) if count else None

    @cached_property
    def described_campaign(self) -> CampaignData:
        """The campaign whose assemblies have these values and whose unknowns are decided; without causes."""
        task = (self.described or self.model).task
        values = np.array([self.values[name] for name in task.variables.names])
        assemblies = {}
        for name, assembly in self.campaign.assemblies.items():
            errors = self.campaign.tolerances.get(name, ())
            shared = [error for error in errors if error.name in task.parameters.errors]
            mapping = task.parameters.at(self.campaign.site(name), shared)
            assemblies[name] = mapping.apply(assembly, values)
        cuts = {name: replace(cut, spread={}) for name, cut in self.campaign.cuts.items()}
        return replace(self.campaign, assemblies=assemblies, unknowns=(), tolerances={}, cuts=cuts)

    def measured_assembly(self, name: str) -> Assembly:
        """Return the assembly of a measurement, with its sensor and the causes, at these values."""
        index = list(self.campaign.measurements).index(name)
        task = self.model.task
        values = task.variables.to_values(self._variables)
        return task.mappings[index].apply(self.model.observations[index].assembly, values)

    def modes(self, name: str) -> list[TrialMode]:
        """Return the modes of a measurement beside those of the model, ascending.

        Those of an FRF are circle fits at its peaks. A mode of it and one of the model are paired where each is the
        nearest of the other. Natural frequencies are paired by their numbers.

        Raises
        ------
        ValueError
            As in `damped_modes`: the motion is not bending.
        """
        assembly, seen = self.measured_assembly(name), self.campaign.measurements[name]
        if not seen.is_receptance:
            undamped, _ = assembly.lowest_natural_frequencies(max(seen.modes))
            ratios = np.full(len(seen.modes), np.nan) if seen.damping_ratio is None else seen.damping_ratio
            return [
                TrialMode(float(f.real), float(ratio), float(undamped[number - 1]))
                for f, ratio, number in zip(seen.frequency_hz, ratios, seen.modes, strict=True)
            ]
        upper = float(seen.frequency_hz[-1].real)
        damped = damped_modes(assembly, upper, response=seen.response, excitation=seen.excitation)
        # A peak without width, or with that of a negative damping, is noise.
        measured = [
            (mode.frequency_hz, mode.damping_ratio) for mode in measured_modes(seen) if mode.damping_ratio > 0.0
        ]
        calculated = list(zip(damped.frequency_hz.tolist(), damped.damping_ratio.tolist(), strict=True))
        none = (math.nan, math.nan)
        return [
            TrialMode(*(none if i is None else measured[i]), *(none if j is None else calculated[j]))
            for i, j in _paired([f for f, _ in measured], [f for f, _ in calculated])
        ]

    def stability(self, cuts: Sequence[str] = ()) -> Stability:
        """Return the lobes of cuts at these values, without causes and bands: `Campaign.stability` has the latter.

        Raises
        ------
        CampaignError
            As in `Campaign.stability`.
        """
        return stability_of_campaign(self.described_campaign, None, cuts=cuts)


def _unit(address: str) -> str:
    quantity = PARAMETERS.get(address.rpartition(".")[2])
    return "" if quantity is None else quantity.unit


def _paired(first: Sequence[float], second: Sequence[float]) -> list[tuple[int | None, int | None]]:
    """Return the numbers of frequencies that are nearest to each other, and those of one side alone, ascending."""
    distance = np.abs(np.log(first)[:, None] - np.log(second)[None, :])
    pairs: dict[int, int] = {}
    if distance.size:
        nearest, backwards = distance.argmin(axis=1).tolist(), distance.argmin(axis=0).tolist()
        pairs = {i: j for i, j in enumerate(nearest) if backwards[j] == i}
    placed: list[tuple[float, int | None, int | None]] = [(f, i, pairs.get(i)) for i, f in enumerate(first)]
    placed += [(f, None, j) for j, f in enumerate(second) if j not in pairs.values()]
    return [(i, j) for _, i, j in sorted(placed, key=lambda item: item[0])]


def _typical(unknown: Unknown) -> float:
    if isinstance(unknown, CauseUnknown | CauseMove):
        return min(max(unknown.parameter.typical, unknown.lower), unknown.upper)
    return float(unknown.start or 0.0)
