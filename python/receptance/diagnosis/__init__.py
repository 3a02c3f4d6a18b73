"""What a simulation gets wrong: shown, named, and added to the model."""

from receptance.diagnosis.catalogue import CATALOGUE
from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
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
    "UndecidableError",
    "Variant",
    "Verdict",
    "diagnose",
]
