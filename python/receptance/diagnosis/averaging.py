"""Prediction of another assembly by all fitted models: a mean and the scatter between the models.

An adequate model is not proven. A cause with a small effect on these data has no evidence and may still change
another overhang, or a mode above the band; an interval from the fit of one model alone leaves that out. Each fitted
model therefore counts with its probability, exp(evidence / 2) times what it had beforehand: one half for the base, the
other half shared by the causes, and for two of them the product (Hoeting, Madigan, Raftery and Volinsky 1999, Bayesian
model averaging). The prediction is that of the reported model; the variance is the mean over all models of their own
variance and of the square of their distance from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.fitting import refit
from receptance.diagnosis.model import IndescribableError, Model
from receptance.diagnosis.thresholds import BEYOND_LIMIT, LEAST_PROBABILITY
from receptance.errors import ReceptanceError
from receptance.identification.observations import Observation, altered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.diagnosis.explanation import Explanation, Selection
    from receptance.identification.result import Identification
    from receptance.identification.unknowns import Tolerance
    from receptance.model.assembly import Assembly


@dataclass(frozen=True, eq=False)
class Target:
    """An assembly in the base model, and its name and conditions."""

    assembly: Assembly
    configuration: str = ""
    conditions: Mapping[str, float] | None = None
    tolerances: Sequence[Tolerance] | None = None


def extension(
    base: Model, explanation: Explanation | None, found: Identification, target: Target
) -> tuple[Identification, Model]:
    """Return an identification and another assembly as a model, both without what belongs to the measurement."""
    model = replace(base, observations=(_stand_in(base, target),), tolerances=tuple(target.tolerances or ()))
    nulls: dict[str, float] = {}
    for step in explanation.steps if explanation is not None else ():
        try:
            model = step.transfer(model)
        except IndescribableError:
            if step.cause.group == "structure":
                raise
        if explanation is not None and step.cause.group == "measurement":
            nulls |= {n: explanation.parameters[n].null for n in explanation.sizes(step.cause)}
    return (replace(found, values={**found.values, **nulls}) if nulls else found), model


def _stand_in(base: Model, target: Target) -> Observation:
    """Return an observation of another assembly, measured like the first one of the base."""
    name = target.configuration
    fields = {"configuration": name, "label": name, "conditions": dict(target.conditions or {})}
    for one in base.observations:
        if one.is_receptance:
            return altered(one, assembly=target.assembly, **fields)
    return altered(base.observations[0], assembly=target.assembly, **fields)


class Ensemble:
    """The fitted models of a selection with their probabilities.

    Parameters
    ----------
    selection : Selection
        The fits.
    reported : Explanation or None
        The reported explanation, which counts even with an unusual size.
    """

    def __init__(self, selection: Selection, reported: Explanation | None) -> None:
        self._selection, self._reported = selection, reported

    @cached_property
    def members(self) -> list[tuple[Explanation | None, float]]:
        """Models and their probabilities, the base as None; those rejected or of low probability are excluded."""
        every = self._selection.explanations
        # A model that the data reject counts as little as one of an implausible size, even where none is adequate.
        explanations = [one for one in every if one is self._reported or (one.passed and not one.implausible)]
        count = max(len({cause for one in explanations for cause in one.ids}), 1)
        logs = [0.0, *(0.5 * one.evidence - len(one.steps) * math.log(count) for one in explanations)]
        weights = np.exp(np.array(logs) - max(logs))
        weights /= weights.sum()
        kept = [(one, float(w)) for one, w in zip([None, *explanations], weights, strict=True) if w > LEAST_PROBABILITY]
        total = sum(w for _, w in kept)
        return [(one, w / total) for one, w in kept]

    def natural_frequencies(
        self, found: Identification, target: Target, upper_hz: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return natural frequencies by the reported model, and standard deviations by all of them."""
        middle, own = self._predicted(self._reported, found, target, upper_hz)
        variance = np.zeros(middle.size)
        own_weight = 1.0
        for one, weight in self.members:
            if one is self._reported or not middle.size:
                continue
            try:
                other, deviation = self._predicted(one, self._identified(one), target, BEYOND_LIMIT * upper_hz)
            except (ReceptanceError, ValueError):
                continue  # this assembly cannot be predicted with it
            if not other.size:
                continue
            nearest = np.abs(other[None, :] - middle[:, None]).argmin(axis=1)
            variance += weight * (deviation[nearest] ** 2 + (other[nearest] - middle) ** 2)
            own_weight -= weight
        return middle, np.sqrt(variance + max(own_weight, 0.0) * own**2)

    def _predicted(
        self, one: Explanation | None, found: Identification, target: Target, upper_hz: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        extended, model = extension(self._selection.base.model, one, found, target)
        return extended.predict_natural_frequencies(
            model.observations[0].assembly,
            upper_hz,
            configuration=target.configuration,
            conditions=target.conditions,
            tolerances=None if target.tolerances is None else model.tolerances,
        )

    def _identified(self, one: Explanation | None) -> Identification:
        if one is None:
            return self._selection.base.identification
        fit = refit(one.fit.model, one.fit.values) if one.expected else one.fit
        return fit.identification
