"""Values held against the data, and the evidence of laws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from receptance import (
    STEEL,
    Assembly,
    GroundSpring,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    identify,
)
from receptance.fit import Law, Power, Prior, Tolerance, constrained_fit, log_evidence, profile_likelihoods

BAR = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
PAIR = Assembly([Part([BAR], name="tool"), PointJoint(k_y=1e8, k_theta=1e5, name="joint"), Part([BAR], name="holder")])
UNKNOWNS = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e10, start=1e8),
    Unknown(address="joint.k_theta", lower=1e3, upper=1e7, start=1e5),
]


def modes(pair: Assembly = PAIR, spread: float = 2.0, **more: object) -> Observation:
    return Observation.from_modes(
        assembly=PAIR, frequency_hz=pair.natural_frequencies(3e4)[:4], standard_deviation_hz=spread, **more
    )


def test_holding_one_value_is_its_profile() -> None:
    found = identify(modes(), UNKNOWNS, starts=1)
    profile = profile_likelihoods(found, "joint.k_theta")["joint.k_theta"]
    for end in (profile.lower, profile.upper):
        held = constrained_fit(found, {"joint.k_theta": end})
        assert held.rise == pytest.approx(profile.threshold, rel=0.03)
        assert held.p_value == pytest.approx(0.05, abs=0.003)
        assert set(held.others) == {"joint.k_y"}
    assert constrained_fit(found, found.values).rise == pytest.approx(0.0, abs=1e-6)
    assert constrained_fit(found, found.values).p_value == pytest.approx(1.0)


def test_two_values_have_two_degrees_of_freedom() -> None:
    found = identify(modes(), UNKNOWNS, starts=1)
    held = constrained_fit(found, {"joint.k_y": 1e8, "joint.k_theta": 1.02e5})
    assert held.p_value == pytest.approx(stats.chi2.sf(held.rise, 2))
    assert held.rejected() == (held.p_value < 0.05)


def test_tolerances_move_along_within_their_priors() -> None:
    shorter = PAIR.replace({"tool.segment[0].length": 0.0995})
    exact = identify(modes(shorter), UNKNOWNS, starts=1, noise="stated")
    length = Tolerance(name="length", moves={"tool.segment[0].length": 5e-4})
    loose = identify(modes(shorter), UNKNOWNS, tolerances=length, starts=1)
    values = {"joint.k_y": 1e8, "joint.k_theta": 1e5}
    assert constrained_fit(exact, values).rejected()
    held = constrained_fit(loose, values)
    assert not held.rejected()
    assert held.others["length"] == pytest.approx(-1.0, abs=0.2)


def test_a_rejected_truth_is_as_rare_as_it_should_be() -> None:
    rng = np.random.default_rng(11)
    p_values = []
    for _ in range(80):
        noisy = Observation.from_modes(
            assembly=PAIR,
            frequency_hz=PAIR.natural_frequencies(3e4)[:4] + 2.0 * rng.standard_normal(4),
            standard_deviation_hz=2.0,
        )
        found = identify(noisy, UNKNOWNS, starts=1)
        p_values.append(constrained_fit(found, {"joint.k_y": 1e8, "joint.k_theta": 1e5}, starts=1).p_value)
    assert stats.kstest(p_values, "uniform").pvalue > 0.01


def test_held_values_are_checked() -> None:
    found = identify(modes(), UNKNOWNS, starts=1)
    with pytest.raises(ValueError, match="was not identified"):
        constrained_fit(found, {"joint.c_y": 1.0})
    with pytest.raises(ValueError, match="outside the bounds"):
        constrained_fit(found, {"joint.k_y": 1e12})
    with pytest.raises(ValueError, match="values is empty"):
        constrained_fit(found, {})
    lines = np.linspace(200.0, 9e3, 200)
    frf = Observation(assembly=PAIR, frequency_hz=lines, receptance=PAIR.receptance(lines))
    percentage = identify(frf, UNKNOWNS[1], objective="percentage", starts=1)
    with pytest.raises(ValueError, match="no likelihood"):
        constrained_fit(percentage, {"joint.k_theta": 1e5})


def test_evidence_of_one_parameter_is_the_integral() -> None:
    """Against the integral of likelihood over a flat prior, by quadrature."""
    found = identify(modes(spread=20.0), UNKNOWNS[1], starts=1)
    x = np.linspace(4.9, 5.1, 401)
    problem = found.task.problem()
    density = [math.exp(-0.5 * float(np.sum(problem.residual(np.array([one])) ** 2))) for one in x]
    integral = float(np.trapezoid(density, x)) / (math.log10(1e7) - math.log10(1e3))
    assert log_evidence(found) == pytest.approx(math.log(integral), abs=0.02)
    prior = Unknown(
        address="joint.k_theta",
        lower=1e3,
        upper=1e7,
        start=1e5,
        prior=Prior(mean=1e5, standard_deviation=0.05),
    )
    known = identify(modes(spread=20.0), prior, starts=1)
    weights = stats.norm.pdf(x * math.log(10.0), math.log(1e5), 0.05) * math.log(10.0)
    integral = float(np.trapezoid(np.array(density) * weights, x))
    assert log_evidence(known) == pytest.approx(math.log(integral), abs=0.02)


def test_evidence_prefers_the_law_that_made_the_data() -> None:
    def measured(exponent: float) -> list[Observation]:
        return [
            modes(
                PAIR.replace({"joint.k_theta": 1e5 * (torque / 40.0) ** exponent}),
                configuration=f"{torque:g}",
                conditions={"torque": torque},
            )
            for torque in (20.0, 40.0, 80.0)
        ]

    def difference(exponent: float) -> float:
        power = Power(of="torque", reference=40.0, lower=-2.0, upper=2.0)
        laws = [Law(address="joint.k_theta", lower=1e3, upper=1e7, start=1e5, powers=p) for p in ((), power)]
        constant, grows = (log_evidence(identify(measured(exponent), law, starts=1, noise="stated")) for law in laws)
        return grows - constant

    assert difference(0.4) > 10.0
    assert difference(0.0) < 0.0, "a power that is not needed is not preferred"


def test_evidence_needs_standard_deviations() -> None:
    bare = Observation.from_modes(assembly=PAIR, frequency_hz=PAIR.natural_frequencies(3e4)[:4])
    with pytest.raises(ValueError, match="needs standard deviations"):
        log_evidence(identify(bare, UNKNOWNS[1], starts=1))


def test_evidence_is_compared_at_the_stated_noise() -> None:
    """Data that no joint fits: by default the error of the model is estimated, "stated" leaves the noise alone."""
    rng = np.random.default_rng(7)
    true = PAIR.natural_frequencies(3e4)[:4]
    data = Observation.from_modes(
        assembly=PAIR, frequency_hz=true * (1.0 + 0.02 * rng.standard_normal(4)), standard_deviation_hz=1.0
    )
    length = Tolerance(name="length", moves={"tool.segment[0].length": 5e-5})
    judged = identify(data, UNKNOWNS, tolerances=length, starts=1)
    stated = identify(data, UNKNOWNS, tolerances=length, starts=1, noise="stated")
    assert 0.005 < judged.discrepancy.frequency < 0.08
    assert stated.discrepancy is None
    assert judged.rejection.widened
    assert "too narrow" in stated.rejection.unusable[0]
    assert abs(judged.values["length"]) < 1.0 < abs(stated.values["length"])
    assert np.isfinite(log_evidence(stated))
    with pytest.raises(ValueError, match="allows for an error of its model"):
        log_evidence(judged)
    with pytest.raises(ValueError, match="noise is 'none', expected one of judged, stated"):
        identify(data, UNKNOWNS, noise="none")  # type: ignore[arg-type]


def test_a_start_on_a_bound_where_the_model_jumps_is_kept() -> None:
    """A free bar: any stiffness to ground turns its rigid-body motion into the lowest modes, zero does not."""
    free = Assembly([Part([BAR], name="bar")], attachments=[GroundSpring(k_y=1e3, position="end", name="support")])
    none = free.replace({"support.k_y": 0.0})
    data = Observation.from_modes(
        assembly=free, frequency_hz=none.natural_frequencies(6e4)[:3], standard_deviation_hz=1.0
    )
    support = Unknown(address="support.k_y", lower=0.0, upper=1e8, start=0.0, scale="linear")
    found = identify(data, support, starts=1)
    assert found.values["support.k_y"] == 0.0
    assert found.rms < 1e-6
    inside = identify(data, replace(support, start=1e4), starts=1)
    assert inside.rms > 100.0
