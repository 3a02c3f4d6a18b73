"""Identification of joint parameters, or any others, from measured receptances and natural frequencies.

::

    frf.FRF -> from_frf -> observations    MeasuredFRF, MeasuredFrequencies: data, standard deviations, assembly
    unknowns                               Unknown, Law, Tolerance: what is fitted, with bounds and priors
       |  mapping                          Parameters: unknowns -> addresses of each assembly (Site -> ParameterMap)
       v
    problem                                Task: input of a fit; Problem: residuals and fits, evaluated in the core
       |  search                           direct and staged fits from several starts
       v
    fit -> result                          identify -> Identification: values, covariance, residuals, advice
       |-- likelihood, sampling            constrained fits, profiles, intervals, draws from the posterior
       |-- prediction -> transfers         other assemblies, with intervals; held-out measurements (peaks)
       |-- new_observations -> ranking     hypothetical measurements and their information
    pointwise_joint -> inverse_coupling                 the joint line by line, without a fit
"""

from typing import TYPE_CHECKING

from receptance._lazy import lazily

if TYPE_CHECKING:
    from receptance.identification.fit import identify
    from receptance.identification.from_frf import Floor
    from receptance.identification.inverse_coupling import InverseCoupling, InverseCouplings, invert_coupling
    from receptance.identification.likelihood import ConstrainedFit, Profile, Profiles, constrained_fit, log_evidence
    from receptance.identification.new_observations import Candidate
    from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF
    from receptance.identification.peaks import PredictedMode, find_bands
    from receptance.identification.prediction import PredictedFrequencies, PredictedFRF, Scatter
    from receptance.identification.ranking import (
        Expectation,
        NextMeasurement,
        RankedCandidate,
        next_measurement,
    )
    from receptance.identification.result import Identification, Start
    from receptance.identification.sampling import Samples
    from receptance.identification.transfers import Split, Transfer, transfer
    from receptance.identification.unknowns import Law, Move, Power, Prior, Tolerance, Unknown

__all__ = [
    "Candidate",
    "ConstrainedFit",
    "Expectation",
    "Floor",
    "Identification",
    "InverseCoupling",
    "InverseCouplings",
    "Law",
    "MeasuredFRF",
    "MeasuredFrequencies",
    "Move",
    "NextMeasurement",
    "Power",
    "PredictedFRF",
    "PredictedFrequencies",
    "PredictedMode",
    "Prior",
    "Profile",
    "Profiles",
    "RankedCandidate",
    "Samples",
    "Scatter",
    "Split",
    "Start",
    "Tolerance",
    "Transfer",
    "Unknown",
    "constrained_fit",
    "find_bands",
    "identify",
    "invert_coupling",
    "log_evidence",
    "next_measurement",
    "transfer",
]

_NAMES = {
    "fit": ["identify"],
    "from_frf": ["Floor"],
    "inverse_coupling": ["InverseCoupling", "InverseCouplings", "invert_coupling"],
    "likelihood": ["ConstrainedFit", "Profile", "Profiles", "constrained_fit", "log_evidence"],
    "new_observations": ["Candidate"],
    "observations": ["MeasuredFRF", "MeasuredFrequencies"],
    "peaks": ["PredictedMode", "find_bands"],
    "prediction": ["PredictedFRF", "PredictedFrequencies", "Scatter"],
    "ranking": ["Expectation", "NextMeasurement", "RankedCandidate", "next_measurement"],
    "result": ["Identification", "Start"],
    "sampling": ["Samples"],
    "transfers": ["Split", "Transfer", "transfer"],
    "unknowns": ["Law", "Move", "Power", "Prior", "Tolerance", "Unknown"],
}

if not TYPE_CHECKING:  # a type checker is to find misspelt names
    __getattr__, __dir__ = lazily(__name__, _NAMES)
