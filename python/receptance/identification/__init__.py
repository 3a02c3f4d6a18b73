"""Identification of joint parameters, or any others, from measured receptances and natural frequencies.

::

    frf.FRF -> from_frf -> observations    Observation: data, standard deviations, assembly
    unknowns                               Unknown, Law, Tolerance: what is fitted, with bounds and priors
       |  mapping                          Parameters: unknowns -> addresses of each assembly (Site -> ParameterMap)
       v
    problem                                Task: input of a fit; Problem: residuals and fits, evaluated in the core
       |  search                           direct and staged fits from several starts
       v
    fit -> result                          identify -> Identification: values, covariance, residuals, advice
       |-- likelihood, sampling            constrained fits, profiles, intervals, draws from the posterior
       |-- predictor -> prediction         Predictor: other assemblies, with intervals and draws; held-out data (peaks)
       |     `-- transfers                 a fit of some configurations predicts the others
       |-- new_observations -> ranking     hypothetical measurements and their information
    pointwise_joint -> inverse_coupling                 the joint line by line, without a fit
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
