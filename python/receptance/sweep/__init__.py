"""Sweeps: many candidates through one model, on all cores and on many machines."""

from receptance.sweep.candidates import Candidates, Grid, Listed, Sampled
from receptance.sweep.definition import SweepError
from receptance.sweep.outputs import (
    FrequencyResponse,
    Misfit,
    NaturalFrequencies,
    Output,
    Reduction,
    StableDepth,
    Variable,
)
from receptance.sweep.run import SweepProgress, sweep
from receptance.sweep.store import as_grid, open_sweep

__all__ = [
    "Candidates",
    "FrequencyResponse",
    "Grid",
    "Listed",
    "Misfit",
    "NaturalFrequencies",
    "Output",
    "Reduction",
    "Sampled",
    "StableDepth",
    "SweepError",
    "SweepProgress",
    "Variable",
    "as_grid",
    "open_sweep",
    "sweep",
]
