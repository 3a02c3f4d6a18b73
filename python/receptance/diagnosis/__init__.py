"""Diagnosis of a model: whether it is adequate, and which causes explain the data if it is not.

Data flow of `engine.diagnose`::

    observations, unknowns, tolerances -> model.Model -> line_selection: usable lines
    Model -> starts, fitting: Fit of the base -> adequacy: Adequacy
    catalogue (joint, part, boundary and measurement causes): Cause + Model -> Variant (a changed Model)
    Fit + Variants -> screening: Direction (effect to first order, detection threshold, look-alikes)
    Directions -> selection: starts on few lines, Fits on all lines, several causes, alternatives
                  -> explanation: Selection (every Explanation = causes + Fit + evidence)
    Selection -> judgement: Judgement (one of six answers) -> advice: ProposedMeasurement
    Selection + Judgement -> verdict: Verdict -> averaging: predictions; wording, figure, report: texts and figures
    Model without a configuration -> selection again -> held_out: Improvement; by_mode: residuals and bias by mode
    `thresholds` has all constants.
"""

from typing import TYPE_CHECKING

from receptance._lazy import lazily

if TYPE_CHECKING:
    from receptance.diagnosis.catalogue import CATALOGUE
    from receptance.diagnosis.causes import Cause, Parameter, Step, Variant
    from receptance.diagnosis.engine import diagnose
    from receptance.diagnosis.held_out import Gain, HeldOut, Metric
    from receptance.diagnosis.model import Model, UndecidableError
    from receptance.diagnosis.verdict import CandidateCause, ProposedMeasurement, Verdict

__all__ = [
    "CATALOGUE",
    "CandidateCause",
    "Cause",
    "Gain",
    "HeldOut",
    "Metric",
    "Model",
    "Parameter",
    "ProposedMeasurement",
    "Step",
    "UndecidableError",
    "Variant",
    "Verdict",
    "diagnose",
]

_NAMES = {
    "catalogue": ["CATALOGUE"],
    "causes": ["Cause", "Parameter", "Step", "Variant"],
    "engine": ["diagnose"],
    "held_out": ["Gain", "HeldOut", "Metric"],
    "model": ["Model", "UndecidableError"],
    "verdict": ["CandidateCause", "ProposedMeasurement", "Verdict"],
}

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    __getattr__, __dir__ = lazily(__name__, _NAMES)
