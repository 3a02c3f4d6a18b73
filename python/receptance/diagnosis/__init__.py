"""Diagnosis of a model: whether it is adequate, and which causes explain the data if it is not.

Data flow of `engine.diagnose`::

    observations, unknowns, tolerances -> model.Model -> measured_data: usable lines, contradictions
    Model -> starts, fitting: Fit of the base -> adequacy: Adequacy
    catalogue (joint, part, boundary and measurement causes): Cause + Model -> Variants (changes of a Model)
    Fit + Variants -> screening: Direction (changed Model, effect to first order, detection threshold, look-alikes)
    Directions -> selection: starts on few lines, Fits on all lines, several causes, alternatives
                  -> explanation: Selection (every Explanation = causes + Fit + evidence)
    Selection -> judgement: Judgement (one of six answers) -> advice: ProposedMeasurement
    Selection + Judgement + Improvement -> verdict: Verdict -> prediction: another assembly, by all fits
    Verdict -> presentation, text, figure: what is shown; a sentence is made from a Reason, a code with values
    Model without a configuration -> selection again -> held_out: Improvement; by_mode: residuals and bias by mode
    `thresholds` has all constants.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
