"""Predictions by the fits of a diagnosis: data of further observations, and another assembly by all fitted models.

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
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from receptance._checks import set_fields
from receptance.diagnosis.causes import transfer
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.model import IndescribableError, Model
from receptance.diagnosis.thresholds import MARGIN
from receptance.errors import ReceptanceError
from receptance.fit.discrepancy_fit import SAME_MODE
from receptance.fit.observation import altered
from receptance.fit.parameters import Site
from receptance.fit.prediction import PredictedFrequencies
from receptance.fit.predictor import PredictedAssembly, PredictedData, Predictor
from receptance.fit.result import Identification
from receptance.fit.unknowns import Tolerance
from receptance.model.assembly import Assembly


def predictor_of(fit: Fit) -> Predictor:
    """Return the predictor of a fit, from its end point and the normal matrix there."""
    values = np.array(list(fit.values.values()))
    return Predictor(fit.task.parameters, values, root=fit.curvature_root, threads=fit.model.threads)


def predicted_data(fit: Fit, model: Model) -> PredictedData:
    """Return the data of the observations of a model, with its tolerances as their errors, by a fit.

    The observations have errors of their own, those of a new clamping for example, which only they determine. The
    residuals of a prediction are those with these errors fitted; its score is that of a fit of all variables.
    """
    return predictor_of(fit).of(model.observations, [model.tolerances] * len(model.observations))


@dataclass(frozen=True, kw_only=True, eq=False)
class AveragedAssembly:
    """An assembly predicted by all fitted models of a selection; see `Verdict.at`."""

    selection: Selection
    """The fits."""
    reported: Explanation | None
    """The reported explanation, which counts even with an unusual size."""
    identified: Identification
    """Its fit, or that of the base."""
    site: Site
    """The assembly as the base model describes it."""
    tolerances: Sequence[Tolerance] | None
    """Its errors; by default those of the fit."""
    discrepancy: float
    """Relative standard deviation of natural frequencies by the error of the model itself."""

    assembly: Assembly = field(init=False)
    """The assembly with the fitted values, and the causes that belong to it."""
    _predicted: PredictedAssembly = field(init=False)

    def __post_init__(self) -> None:
        predicted = self._by(self.reported, self.identified)
        set_fields(self, {"_predicted": predicted, "assembly": predicted.assembly})

    def natural_frequencies(self, upper_hz: float) -> PredictedFrequencies:
        """Return natural frequencies by the reported model, with standard errors by all models.

        The errors include the differences to the other fitted models, weighted by the probabilities of these, and the
        discrepancy of the model; infinite where the model is known to be wrong by an unknown amount.
        """
        predicted = self._predicted.natural_frequencies(upper_hz)
        others: list[tuple[float, PredictedFrequencies]] = []
        for explanation, weight in models_of(self.selection, self.reported) if predicted.modes else ():
            if explanation is self.reported:
                continue
            fit = self.selection.base if explanation is None else explanation.fit
            try:
                if explanation is not None and explanation.expected:
                    fit = refit(fit.model, fit.values)
                # With another model the last mode may lie above the limit.
                other = self._by(explanation, fit.identification).natural_frequencies((1.0 + SAME_MODE) * upper_hz)
            except (ReceptanceError, ValueError):
                continue  # this assembly cannot be predicted with it
            others += [(weight, other)] if other.modes else []
        total = np.hypot(average(predicted, others), self.discrepancy * predicted.predicted_hz)
        pairs = zip(predicted.modes, total.tolist(), strict=True)
        modes = tuple(replace(mode, deviation_hz=deviation) for mode, deviation in pairs)
        return replace(predicted, modes=modes, scatter=replace(predicted.scatter, total=total))

    def _by(self, explanation: Explanation | None, identified: Identification) -> PredictedAssembly:
        """Return the predictions of the assembly with the causes of an explanation, and by its fit.

        Causes that belong to the measurement do not act on it.
        """
        base, site = self.selection.base.model, self.site
        like = next(iter(base.receptances), base.observations[0])
        fields = {"configuration": site.configuration, "label": site.configuration, "conditions": dict(site.conditions)}
        stand_in = altered(like, assembly=site.assembly, **fields)
        model = replace(base, observations=(stand_in,), tolerances=tuple(self.tolerances or ()))
        nulls: dict[str, float] = {}
        for variant in () if explanation is None else explanation.variants:
            try:
                model = transfer(model, [variant])
            except IndescribableError:
                if variant.cause.group == "structure":
                    raise
            if explanation is not None and variant.cause.group == "measurement":
                nulls |= {name: explanation.parameters[name].null for name in explanation.sizes(variant.cause)}
        if nulls:
            identified = replace(identified, values={**identified.values, **nulls})
        return identified.at(
            model.observations[0].assembly,
            configuration=site.configuration,
            conditions=site.conditions,
            tolerances=None if self.tolerances is None else model.tolerances,
        )


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
    """Return models and their probabilities, the base as None; those rejected, or beyond the margin, are excluded."""
    # A model that the data reject counts as little as one of an implausible size, even where none is adequate.
    explanations = [
        explanation
        for explanation in selection.explanations
        if explanation is reported or (explanation.passed and not explanation.implausible)
    ]
    count = max(len({cause for explanation in explanations for cause in explanation.ids}), 1)
    logs = [0.0, *(0.5 * each.evidence - len(each.variants) * math.log(count) for each in explanations)]
    near = [
        (model, math.exp(log - max(logs)))
        for model, log in zip([None, *explanations], logs, strict=True)
        if max(logs) - log < 0.5 * MARGIN
    ]
    total = sum(weight for _, weight in near)
    return [(model, weight / total) for model, weight in near]
