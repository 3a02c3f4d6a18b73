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
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.causes import transfer
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import refit
from receptance.diagnosis.model import IndescribableError, Model
from receptance.diagnosis.thresholds import BEYOND_LIMIT, LEAST_PROBABILITY
from receptance.errors import ReceptanceError
from receptance.fit.observation import altered
from receptance.fit.parameters import Site
from receptance.fit.prediction import PredictedFrequencies
from receptance.fit.predictor import PredictedAssembly
from receptance.fit.result import Identification
from receptance.fit.unknowns import Tolerance


def predict_with(
    base: Model,
    explanation: Explanation | None,
    identified: Identification,
    site: Site,
    tolerances: Sequence[Tolerance] | None,
) -> PredictedAssembly:
    """Return the predictions of an assembly of the base model with the causes of an explanation.

    Causes that belong to the measurement do not act on it.
    """
    like = next((observation for observation in base.observations if observation.is_receptance), base.observations[0])
    name = site.configuration
    stand_in = altered(like, assembly=site.assembly, configuration=name, label=name, conditions=dict(site.conditions))
    model = replace(base, observations=(stand_in,), tolerances=tuple(tolerances or ()))
    nulls: dict[str, float] = {}
    for variant in explanation.variants if explanation is not None else ():
        try:
            model = transfer(model, [variant])
        except IndescribableError:
            if variant.cause.group == "structure":
                raise
        if explanation is not None and variant.cause.group == "measurement":
            nulls |= {n: explanation.parameters[n].null for n in explanation.sizes(variant.cause)}
    if nulls:
        identified = replace(identified, values={**identified.values, **nulls})
    return identified.at(
        model.observations[0].assembly,
        configuration=name,
        conditions=site.conditions,
        tolerances=None if tolerances is None else model.tolerances,
    )


class AveragedAssembly:
    """An assembly predicted by all fitted models of a selection; see `Verdict.at`.

    Parameters
    ----------
    selection : Selection
        The fits.
    reported : Explanation or None
        The reported explanation, which counts even with an unusual size.
    identified : Identification
        Its fit, or that of the base.
    site : Site
        The assembly as the base model describes it.
    tolerances : sequence of Tolerance or None
        Its errors; by default those of the fit.
    discrepancy : float
        Relative standard deviation of natural frequencies by the error of the model itself.
    """

    def __init__(
        self,
        selection: Selection,
        reported: Explanation | None,
        identified: Identification,
        site: Site,
        tolerances: Sequence[Tolerance] | None,
        discrepancy: float,
    ) -> None:
        self._selection, self._reported, self._discrepancy = selection, reported, discrepancy
        self._site, self._tolerances = site, tolerances
        self._predicted = predict_with(selection.base.model, reported, identified, site, tolerances)
        self.assembly = self._predicted.assembly

    def natural_frequencies(self, upper_hz: float) -> PredictedFrequencies:
        """Return natural frequencies by the reported model, with standard errors by all models.

        The errors include the differences to the other fitted models, weighted by the probabilities of these, and the
        discrepancy of the model; infinite where the model is known to be wrong by an unknown amount.
        """
        predicted = self._predicted.natural_frequencies(upper_hz)
        middle, total = predicted.predicted_hz, predicted.scatter.total
        if middle.size:
            others: list[tuple[float, PredictedFrequencies]] = []
            for explanation, weight in models_of(self._selection, self._reported):
                if explanation is self._reported:
                    continue
                try:
                    other = self._predicted_by(explanation).natural_frequencies(BEYOND_LIMIT * upper_hz)
                except (ReceptanceError, ValueError):
                    continue  # this assembly cannot be predicted with it
                others += [(weight, other)] if other.modes else []
            total = average(predicted, others)
        total = np.hypot(total, self._discrepancy * middle)
        modes = (
            replace(mode, deviation_hz=deviation)
            for mode, deviation in zip(predicted.modes, total.tolist(), strict=True)
        )
        return replace(predicted, modes=tuple(modes), scatter=replace(predicted.scatter, total=total))

    def _predicted_by(self, explanation: Explanation | None) -> PredictedAssembly:
        fit = self._selection.base if explanation is None else explanation.fit
        if explanation is not None and explanation.expected:
            fit = refit(fit.model, fit.values)
        base = self._selection.base.model
        return predict_with(base, explanation, fit.identification, self._site, self._tolerances)


def average(
    predicted: PredictedFrequencies, others: Sequence[tuple[float, PredictedFrequencies]]
) -> NDArray[np.float64]:
    """Return standard deviations by a model and by others with their probabilities: the law of total variance."""
    middle = predicted.predicted_hz
    variance = max(1.0 - sum(weight for weight, _ in others), 0.0) * predicted.scatter.total**2
    for weight, other in others:
        nearest = np.abs(other.predicted_hz[None, :] - middle[:, None]).argmin(axis=1)
        distance = other.predicted_hz[nearest] - middle
        variance = variance + weight * (other.scatter.total[nearest] ** 2 + distance**2)
    return np.asarray(np.sqrt(variance))


def models_of(selection: Selection, reported: Explanation | None) -> list[tuple[Explanation | None, float]]:
    """Return models and their probabilities, the base as None; those rejected or of low probability are excluded."""
    # A model that the data reject counts as little as one of an implausible size, even where none is adequate.
    explanations = [
        explanation
        for explanation in selection.explanations
        if explanation is reported or (explanation.passed and not explanation.implausible)
    ]
    count = max(len({cause for explanation in explanations for cause in explanation.ids}), 1)
    logs = [
        0.0,
        *(0.5 * explanation.evidence - len(explanation.variants) * math.log(count) for explanation in explanations),
    ]
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    kept = [(one, float(w)) for one, w in zip([None, *explanations], weights, strict=True) if w > LEAST_PROBABILITY]
    total = sum(w for _, w in kept)
    return [(one, w / total) for one, w in kept]
