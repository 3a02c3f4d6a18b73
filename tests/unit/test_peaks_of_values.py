"""Local maxima and prominences against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks
from scipy.stats import norm, qmc

from receptance._peaks import local_maxima
from receptance.fit.unknowns import Prior, Unknown, Variables


@pytest.mark.parametrize("seed", range(8))
def test_they_are_those_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=rng.integers(1, 400)).cumsum() * rng.integers(0, 2) + rng.normal(size=1)
    if seed % 2:
        values = np.round(values)  # equal neighbours, and maxima of equal height
    for prominence in (0.0, 0.5, 2.0):
        places, found = local_maxima(values, prominence)
        expected, properties = find_peaks(values, prominence=prominence)
        np.testing.assert_array_equal(places, expected)
        np.testing.assert_array_equal(found, properties["prominences"])


def test_a_latin_hypercube_is_that_of_scipy() -> None:
    unknowns = [
        Unknown(address=f"joint.{name}", lower=0.0, upper=1.0, start=0.5, scale="linear") for name in ("k_y", "c_y")
    ]
    expected = qmc.LatinHypercube(2, seed=np.random.default_rng(3)).random(7)
    np.testing.assert_array_equal(Variables(unknowns).draw(8, 3)[1:], expected)


def test_a_start_of_an_unknown_with_a_prior_is_normal() -> None:
    prior = Prior(mean=100.0, standard_deviation=0.5)
    unknowns = [
        Unknown(address=f"joint.{name}", lower=1.0, upper=1e4, start=90.0, scale=scale, prior=prior)
        for name, scale in (("k_y", "linear"), ("k_theta", "log"))
    ]
    share = qmc.LatinHypercube(2, seed=np.random.default_rng(3)).random(7)
    found = Variables(unknowns).draw(8, 3)[1:]
    np.testing.assert_allclose(found[:, 0], norm.ppf(share[:, 0], 100.0, 0.5), rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], norm.ppf(share[:, 1], 2.0, 0.5 / np.log(10.0)), rtol=1e-12)
