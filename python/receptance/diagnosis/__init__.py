"""Diagnosis of a model: whether it is adequate, and which causes explain the data if it is not."""

from receptance.diagnosis.catalogue import CATALOGUE
from receptance.diagnosis.causes import Cause, Parameter, Step, UndecidableError, Variant
from receptance.diagnosis.engine import diagnose
from receptance.diagnosis.held_out import HeldOut, Metric
from receptance.diagnosis.model import Model
from receptance.diagnosis.verdict import Candidate, Gain, NextMeasurement, Verdict

__all__ = [
    "CATALOGUE",
    "Candidate",
    "Cause",
    "Gain",
    "HeldOut",
    "Metric",
    "Model",
    "NextMeasurement",
    "Parameter",
    "Step",
    "UndecidableError",
    "Variant",
    "Verdict",
    "diagnose",
]
