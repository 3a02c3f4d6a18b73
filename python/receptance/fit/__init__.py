"""Fits of parameters to measured receptances and natural frequencies, and predictions from their posterior.

::

    frf.FRF -> observation (weights)       Observation: data, standard deviations, assembly
    unknowns                               Unknown, Law, Tolerance: what is fitted, with bounds and priors
       |  parameters                       Parameters: unknowns -> addresses of each assembly (Site -> ParameterMap)
       v
    problem                                Task: input of a fit; Problem: residuals and fits, evaluated in the core
       |  search                           direct and staged fits from several starts
       v
    identification -> result               identify -> Identification: values, covariance, residuals, advice
       |-- likelihood, sampling            constrained fits, profiles, intervals, draws from the posterior
       `-- predictor -> prediction         Predictor: other assemblies, with intervals and draws (peaks, line_modes)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
