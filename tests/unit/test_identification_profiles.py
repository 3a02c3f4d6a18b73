"""Information of the data: profiles, statements, constrained fits, and the staged fit."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.errors import ReceptanceWarning
from receptance.fit import Law, Power, Profiles, Tolerance, identify, profile_likelihoods
from receptance.fit.likelihood import interval_statement
from receptance.fit.observation import altered
from simulated_campaigns import confidence, simulate_campaign

LINES = np.linspace(200.0, 6000.0, 400)


def make_assembly(k_y: float = 6.3e8, k_theta: float = 1.0e5, overhang: float = 0.0623) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=k_y, k_theta=k_theta, c_theta=2.0, name="joint"), holder])


def measure(truth: Assembly, nominal: Assembly | None = None, sd: float = 0.01, seed: int = 1) -> Observation:
    noise = np.random.default_rng(seed).normal(scale=sd, size=(2, LINES.size))
    values = truth.receptance(LINES) * np.exp(noise[0] + 1j * noise[1])
    return Observation(
        assembly=nominal or make_assembly(), frequency_hz=LINES, receptance=values, standard_deviation=sd, label="a"
    )


STIFFNESSES = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
]
BLANK = Tolerance(name="blank", moves={"tool.segment[*].outer_diameter": 0.002}, relative=True)


def test_a_fit_stops_at_a_bound_with_the_rest_at_its_best():
    found = identify(measure(make_assembly()), STIFFNESSES, tolerances=BLANK, starts=3)
    tight = [STIFFNESSES[0], Unknown(address="joint.k_theta", lower=1e2, upper=9e4)]
    bounded = identify(measure(make_assembly()), tight, tolerances=BLANK, starts=1, strategy="staged")
    scipy = identify(measure(make_assembly()), tight, tolerances=BLANK, starts=3)
    assert bounded.values["joint.k_theta"] == pytest.approx(9e4)
    assert bounded.starts[0].cost == pytest.approx(min(run.cost for run in scipy.starts), rel=1e-6)
    assert bounded.starts[0].cost > min(run.cost for run in found.starts)


def test_a_profile_is_the_standard_error_where_the_data_are_plenty():
    found = identify(measure(make_assembly()), STIFFNESSES, tolerances=BLANK, starts=3)
    profiles = profile_likelihoods(found)
    assert set(profiles) == {"joint.k_y", "joint.k_theta"}
    for name, profile in profiles.items():
        assert profile.bounded
        assert (profile.lower, profile.upper) == pytest.approx(found.interval(name), rel=2e-3)
        assert profile.statement.startswith("determined to")
        assert profile.values[0] < profile.value < profile.values[-1]
        assert profile.rise.min() == 0.0
        assert confidence(profile, profile.lower) == pytest.approx(0.025, abs=0.002)
        assert confidence(profile, profile.value) == pytest.approx(0.5, abs=1e-3)


def test_an_undetermined_damping_does_not_disturb_the_profile_of_a_stiffness():
    """A linear prediction moves this damping out of its bounds, where a constrained fit has other optima."""
    dampings = [
        Unknown(address="joint.c_y", lower=1e-3, upper=1e6),
        Unknown(address="joint.c_theta", lower=1e-7, upper=1e2),
    ]
    truth = make_assembly().replace({"joint.c_y": 100.0, "joint.c_theta": 0.02})
    found = identify(measure(truth, truth), [*STIFFNESSES, *dampings], tolerances=BLANK, starts=1, strategy="staged")
    profile = profile_likelihoods(found, "joint.k_y")["joint.k_y"]
    assert profile.rise.max() < 3.0 * profile.threshold
    half = 1.96 * found.standard_errors["joint.k_y"] / found.values["joint.k_y"]
    assert np.log(profile.upper / profile.lower) == pytest.approx(2.0 * half, rel=0.2)
    assert profile.evaluations < 40


def test_profile_follows_its_definition():
    found = identify(measure(make_assembly()), STIFFNESSES, tolerances=BLANK, starts=3)
    profile = profile_likelihoods(found, "joint.k_theta")["joint.k_theta"]
    problem = found.task.problem()
    best = min(run.cost for run in found.starts)
    for end in (profile.lower, profile.upper):
        x = problem.variables.from_values(np.array([found.values["joint.k_y"], end, 0.0]))
        rest = least_squares(
            lambda y, x=x: problem.residual(np.array([y[0], x[1], y[1]])),
            x[[0, 2]],
            jac=lambda y, x=x: problem.jacobian(np.array([y[0], x[1], y[1]]))[:, [0, 2]],
        )
        assert 2.0 * (rest.cost - best) == pytest.approx(3.84, rel=0.03)


def test_a_stiff_joint_has_only_a_lower_bound():
    found = identify(measure(make_assembly(k_y=5e10), sd=0.2), STIFFNESSES, starts=4)
    profile = profile_likelihoods(found, "joint.k_y")["joint.k_y"]
    assert profile.upper_open
    assert profile.upper == np.inf
    assert not profile.lower_open
    assert 1e8 < profile.lower < 5e10
    assert profile.statement.startswith("only a lower bound:")


def test_flat_receptance_leaves_the_joint_undetermined():
    # Far below all resonances the assembly moves as a rigid body.
    lines = np.linspace(1.0, 3.0, 40)
    flat = Observation(
        assembly=make_assembly(),
        frequency_hz=lines,
        receptance=make_assembly().receptance(lines),
        standard_deviation=0.05,
    )
    profiles = profile_likelihoods(identify(flat, STIFFNESSES, starts=2))
    for profile in profiles.values():
        assert not profile.bounded
        assert profile.upper_open
        assert not profile.statement.startswith("determined")


def test_more_parameters_than_information_is_noted():
    tolerances = [BLANK, Tolerance(name="E", moves={"tool.segment[*].youngs_modulus": 0.02}, relative=True)]
    modes = Observation.from_modes(
        assembly=make_assembly(), frequency_hz=make_assembly().natural_frequencies(9e3)[:1], standard_deviation_hz=5.0
    )
    with pytest.raises(ValueError, match="2 unknowns but only 1 observed"):
        identify(modes, STIFFNESSES, tolerances=tolerances)
    found = identify([modes, modes], STIFFNESSES, tolerances=tolerances, starts=2)
    assert not any(p.statement.startswith("determined") for p in profile_likelihoods(found).values())


def test_one_configuration_leaves_a_law_undetermined():
    law = Law(address="joint.k_theta", lower=1e2, upper=1e8, powers=Power(of="torque", reference=20.0))
    one = altered(measure(make_assembly()), configuration="40 Nm", conditions={"torque": 40.0})
    found = identify(one, [STIFFNESSES[0], law], tolerances=BLANK, starts=3)
    profiles = profile_likelihoods(found)
    for name in ("joint.k_theta", "joint.k_theta ~ torque"):
        # Where an interval ends at all, the bounds of the other one end it.
        assert not profiles[name].statement.startswith("determined")
        assert "tied to joint.k_theta" in profiles[name].statement
    assert profiles["joint.k_y"].statement.startswith("determined")
    assert any("tied" in advice or "do not determine" in advice for advice in found.advice)
    # The exponent at the torque itself is no parameter of the measurement at all.
    at = altered(measure(make_assembly()), configuration="20 Nm", conditions={"torque": 20.0})
    blind = identify(at, [STIFFNESSES[0], law], tolerances=BLANK, starts=2)
    assert "do not determine joint.k_theta ~ torque" in " ".join(blind.advice)
    assert blind.standard_errors["joint.k_theta ~ torque"] == np.inf
    exponent = profile_likelihoods(blind, "joint.k_theta ~ torque")["joint.k_theta ~ torque"]
    assert (exponent.lower, exponent.upper) == (-np.inf, np.inf)
    assert exponent.statement.startswith("not determined")


def test_a_better_optimum_restarts_the_fit():
    """A fit that stopped too early is not profiled as if it were the optimum: profiles and fit have the same values."""
    with_error = measure(make_assembly())
    found = identify(with_error, STIFFNESSES, starts=1, max_evaluations=2, noise="stated")
    assert not found.converged
    with pytest.warns(ReceptanceWarning, match="the fit is restarted"):
        profiles = profile_likelihoods(found, "joint.k_theta")
    profile, again = profiles["joint.k_theta"], profiles.fit
    assert profile.lower < 1e5 < profile.upper
    assert again.converged
    assert not again.rejection
    assert again.values["joint.k_theta"] == pytest.approx(profile.value, rel=1e-9)
    assert again.starts[:-1] == found.starts
    assert again.starts[-1].cost < found.starts[0].cost
    low, high = again.interval("joint.k_theta")
    assert (low, high) == pytest.approx((profile.lower, profile.upper), rel=0.02)
    assert any("restarted" in note for note in again.notes)


def test_a_fit_that_is_not_adequate_is_tried_again_from_the_wider_valley():
    """A fit that stopped too early has large residuals, and not because of its model."""
    found = identify(measure(make_assembly()), STIFFNESSES, starts=1, max_evaluations=3)
    assert found.adequacy.passed
    assert found.discrepancy is None
    assert [text[:13] for text in found.rejection] == ["not converged"]
    assert found.rms == pytest.approx(1.0, abs=0.1)


def test_evaluations_of_profiles_are_limited():
    found = identify(measure(make_assembly()), STIFFNESSES, starts=2)
    whole = profile_likelihoods(found)
    assert whole.fit is found
    assert whole.unfinished == ()
    first, last = whole
    some = profile_likelihoods(found, most=whole[first].evaluations + 2)
    assert list(some) == [first]
    assert some.unfinished == (last,)
    assert some[first].lower == whole[first].lower


def test_percentages_are_no_likelihood():
    frf = measure(make_assembly())
    found = identify(frf, STIFFNESSES, objective="percentage", starts=1)
    with pytest.raises(ValueError, match="no likelihood"):
        profile_likelihoods(found)
    with pytest.raises(ValueError, match="was not identified"):
        profile_likelihoods(identify(frf, STIFFNESSES, starts=1), "joint.c_y")
    with pytest.raises(ValueError, match="is for the objective"):
        identify(frf, STIFFNESSES, objective="percentage", strategy="staged")


def test_the_staged_fit_reaches_the_optimum_from_three_decades_off():
    rng = np.random.default_rng([7, 0])
    campaign = simulate_campaign(rng, overhangs=2)
    staged = identify(
        campaign.observations,
        campaign.unknowns(campaign.decades_off(rng)),
        tolerances=campaign.tolerances,
        starts=1,
        strategy="staged",
    )
    near = identify(campaign.observations, campaign.unknowns(campaign.truth), tolerances=campaign.tolerances, starts=1)
    assert staged.starts[0].cost <= near.starts[0].cost + 0.01
    assert staged.rms == pytest.approx(1.0, abs=0.1)


def test_staged_fit_without_receptances():
    modes = Observation.from_modes(
        assembly=make_assembly(), frequency_hz=make_assembly().natural_frequencies(15e3)[:2], standard_deviation_hz=5.0
    )
    found = identify(modes, STIFFNESSES, starts=1, strategy="staged")
    assert found.values["joint.k_y"] == pytest.approx(6.3e8, rel=1e-3)
    assert found.values["joint.k_theta"] == pytest.approx(1e5, rel=1e-3)


@pytest.mark.parametrize(
    ("interval", "scale", "words"),
    [
        ((1e5, 9.8e4, 1.02e5), "log", "determined to 2 %"),
        ((1e5, 6e4, 2e5), "log", "determined to a factor of 2"),
        ((1e5, 1e4, 2e6), "log", "poorly determined: between 1e+04 and 2e+06"),
        ((1e5, 4e4, np.inf), "log", "only a lower bound: 4e+04"),
        ((1e5, 0.0, 2e5), "log", "only an upper bound: 2e+05"),
        ((1e5, 0.0, np.inf), "log", "not determined within the bounds"),
        ((1.0, -1.0, 3.0), "linear", "not distinguishable from zero: -1 to 3"),
        ((2.0, 1.9, 2.1), "linear", "determined to 5 %"),
        ((2.0, -np.inf, 2.1), "linear", "only an upper bound: 2.1"),
    ],
)
def test_statements(interval, scale, words):
    assert interval_statement(*interval, scale=scale) == words


def test_the_figure_shows_every_profile():
    found = identify(measure(make_assembly(k_y=5e10), sd=0.2), STIFFNESSES, tolerances=BLANK, starts=3)
    profiles = profile_likelihoods(found)
    assert profiles["joint.k_y"].upper_open  # at the bound the rise is just below the threshold
    figure = profiles.plot()
    assert [axes.get_title(loc="left").splitlines()[0] for axes in figure.axes] == list(profiles)
    assert figure.axes[0].get_xscale() == "log"
    with pytest.raises(ValueError, match="profiles is empty"):
        Profiles({}).plot()
