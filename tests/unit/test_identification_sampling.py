"""Draws of the posterior, against closed forms and profiles."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.errors import ReceptanceError
from receptance.fit import Identification, Prior, Tolerance, identify, profile_likelihoods, sample_posterior

LINES = np.linspace(200.0, 6000.0, 40)


def make_assembly(k_theta: float = 1e5) -> Assembly:
    tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6.3e8, k_theta=k_theta, c_theta=2.0, name="joint"), holder])


def fitted(sd: float = 0.05) -> Identification:
    noise = np.random.default_rng(1).normal(scale=sd, size=(2, LINES.size))
    frf = Observation(
        assembly=make_assembly(),
        frequency_hz=LINES,
        receptance=make_assembly().receptance(LINES) * np.exp(noise[0] + 1j * noise[1]),
        standard_deviation=sd,
    )
    return identify(
        frf,
        Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
        tolerances=Tolerance(name="blank", moves={"tool.segment[*].outer_diameter": 0.002}, relative=True),
        starts=2,
    )


@pytest.mark.slow
def test_draws_agree_with_profile_and_standard_errors():
    found = fitted()
    draws = sample_posterior(found, steps=900, seed=2)
    assert draws.names == found.addresses
    assert draws.values.shape == (draws.walkers * (draws.steps - draws.burnt), 2)
    assert 0.2 < draws.acceptance < 0.9
    assert draws.effective > 300
    profile = profile_likelihoods(found, "joint.k_theta")["joint.k_theta"]
    width = np.log(profile.upper / profile.lower)
    # A quantile of 300 draws at 2.5 % is known to a seventh of the width or so.
    assert np.log(draws.interval("joint.k_theta")) == pytest.approx(
        np.log([profile.lower, profile.upper]), abs=0.15 * width
    )
    logarithms = np.log10(draws.of("joint.k_theta"))
    assert np.std(logarithms) == pytest.approx(np.sqrt(found.covariance[0, 0]), rel=0.15)
    assert np.corrcoef(logarithms, draws.of("blank"))[0, 1] == pytest.approx(found.correlation[0, 1], abs=0.1)
    assert "draws of 2 parameters" in repr(draws)
    again = sample_posterior(found, steps=100, seed=2)
    assert np.array_equal(again.values, sample_posterior(found, steps=100, seed=2).values)


def test_short_chains_are_noted():
    draws = sample_posterior(fitted(), steps=100)
    assert any("autocorrelation times long" in note for note in draws.notes)


@pytest.mark.slow
def test_a_gaussian_posterior_is_found_in_closed_form():
    """Without information in the data the posterior is the prior, cut off at the bounds."""
    far = Observation.from_modes(assembly=make_assembly(), frequency_hz=make_assembly().natural_frequencies(5e3)[:1])
    mode = Observation.from_modes(assembly=far.assembly, frequency_hz=far.frequency_hz, standard_deviation_hz=1e6)
    known = Prior(mean=2e5, standard_deviation=0.3)
    found = identify(mode, Unknown(address="joint.k_theta", lower=1e3, upper=2e5, prior=known), starts=1)
    draws = np.log(sample_posterior(found, steps=1000).of("joint.k_theta"))
    # Half a Gaussian below its own mean.
    assert draws.max() <= np.log(2e5)
    assert np.mean(np.log(2e5) - draws) == pytest.approx(0.3 * np.sqrt(2.0 / np.pi), rel=0.1)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"steps": 3}, "steps is 3"), ({"walkers": 2}, "two per parameter"), ({"walkers": 8.5}, "walkers is 8.5")],
)
def test_useless_settings_are_refused(options, words):
    with pytest.raises(ValueError, match=words):
        sample_posterior(fitted(), **options)


def test_unsupported_sampling_is_an_error(monkeypatch):
    draws = sample_posterior(fitted(), steps=100)
    with pytest.raises(ValueError, match=r"was not sampled, only joint\.k_theta, blank"):
        draws.of("joint.k_y")
    with pytest.raises(ValueError, match="between 0 and 1"):
        draws.interval("blank", 1.0)
    monkeypatch.setitem(sys.modules, "emcee", None)
    with pytest.raises(ReceptanceError, match=r"receptance\[sampling\]"):
        sample_posterior(fitted())
