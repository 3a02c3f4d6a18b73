"""identify(simulate(p)) = p, statements of the result, and errors."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    Part,
    ReceptanceError,
    ReceptanceWarning,
    Segment,
)
from receptance.fit import Observation, Unknown, find_bands, identify
from scipy_fits import task_of
from tool_in_holder import DASHPOTS, LINES, STIFFNESSES, TRUE, assert_found, make_assembly, simulate, simulate_modes


@pytest.mark.parametrize("objective", ["log", "percentage"])
def test_four_joint_parameters_from_one_frf_several_decades_off(objective):
    result = identify(simulate(make_assembly()), STIFFNESSES + DASHPOTS, objective=objective)
    assert_found(result, TRUE)
    assert result.agreeing >= 4
    assert result.units == ["percent" if objective == "percentage" else "logarithm"]


@pytest.mark.parametrize("objective", ["log", "percentage"])
def test_joint_stiffnesses_from_natural_frequencies(objective):
    result = identify(simulate_modes(make_assembly()), STIFFNESSES, objective=objective)
    assert_found(result, {u.address: TRUE[u.address] for u in STIFFNESSES})
    assert result.units == ["percent"]


def test_one_joint_shared_by_two_assemblies_and_kinds():
    observed = [
        simulate(make_assembly(0.0623), standard_deviation=0.02),
        simulate_modes(make_assembly(0.114), standard_deviation_hz=2.0),
    ]
    result = identify(observed, STIFFNESSES + DASHPOTS)
    assert_found(result, TRUE)
    assert result.units == ["standard deviations"] * 2
    assert [len(r) for r in result.residuals] == [2 * LINES.size, observed[1].frequency_hz.size]
    for address, value in TRUE.items():
        assert result.assemblies[1].get(address) == pytest.approx(value, rel=1e-6)


def test_two_assemblies_with_separate_joints_and_a_shared_modulus():
    first = make_assembly(0.0623, "short", k_y=4e8)
    second = make_assembly(0.114, "long", k_theta=3e5)
    true = {"short.k_y": 4e8, "short.k_theta": 1e5, "long.k_y": 6.3e8, "long.k_theta": 3e5}
    unknowns = [Unknown(address=a, lower=v / 300.0, upper=v * 300.0, start=v * 2.0) for a, v in true.items()]
    unknowns.append(Unknown(address="tool.segment[*].youngs_modulus", lower=500e9, upper=650e9, start=550e9))
    result = identify([simulate(first), simulate(second)], unknowns, starts=3)
    assert_found(result, true | {"tool.segment[*].youngs_modulus": CARBIDE.youngs_modulus})


def test_mixed_kinds_without_standard_deviations_give_a_note():
    observed = [simulate(make_assembly()), simulate_modes(make_assembly(0.114))]
    with pytest.warns(ReceptanceWarning, match="weighs as much"):
        result = identify(observed, STIFFNESSES + DASHPOTS)
    assert_found(result, TRUE)
    assert any("weighs as much" in note for note in result.notes)
    assert_found(identify(observed, STIFFNESSES + DASHPOTS, objective="percentage"), TRUE)


def test_other_coordinates_and_a_length_that_moves_them():
    assembly = make_assembly()
    step = Coordinate("holder", 0.06)
    unknowns = [*STIFFNESSES, Unknown(address="holder.segment[1].length", lower=0.025, upper=0.035, start=0.031)]
    result = identify(simulate(assembly, response=step), unknowns, starts=4)
    assert_found(result, {"joint.k_y": 6.3e8, "joint.k_theta": 1e5, "holder.segment[1].length": 0.03})


def test_bands_of_the_seed_are_found_and_can_be_given():
    frf = simulate(make_assembly())
    bands = find_bands(frf)
    modes = make_assembly().natural_frequencies(15e3)
    assert len(bands) == len(modes)
    assert all(low < mode < high for mode, (low, high) in zip(modes, bands, strict=True))
    (merged,) = find_bands(frf, width_percent=90.0)
    assert merged == pytest.approx((bands[0][0] / 0.95 * 0.1, bands[-1][1] / 1.05 * 1.9))
    given = identify(frf, STIFFNESSES, objective="percentage", bands=bands, starts=2)
    found = identify(frf, STIFFNESSES, objective="percentage", starts=2)
    assert given.residuals[0].shape == found.residuals[0].shape
    inside = sum(np.count_nonzero((low <= LINES) & (high >= LINES)) for low, high in bands)
    assert given.residuals[0].shape == (inside,)


def test_the_same_seed_gives_the_same_result_bit_for_bit():
    frf = simulate(make_assembly())
    runs = [identify(frf, STIFFNESSES, seed=7, threads=threads) for threads in (1, 2, 2)]
    assert runs[0].values == runs[1].values == runs[2].values
    assert runs[0].seed == 7
    other = identify(frf, STIFFNESSES, seed=8)
    assert other.starts[0].start == runs[0].starts[0].start
    assert other.starts[1].start != runs[0].starts[1].start


@pytest.mark.parametrize("unit", ["logarithm", "standard deviations", "percent"])
def test_jacobians_of_receptances_against_differences(unit):
    frf = simulate(make_assembly(), np.linspace(300.0, 9e3, 50), standard_deviation=np.linspace(0.01, 0.1, 50))
    unknowns = (*STIFFNESSES, *DASHPOTS, Unknown(address="tool.segment[0].length", lower=0.06, upper=0.065))
    problem = task_of(frf, unknowns, unit, bands=[(0.0, 1e9)]).problem()
    assert_jacobian(problem, np.array([8.3, 5.4, 2.2, -1.4, np.log10(0.0611)]))


@pytest.mark.parametrize("unit", ["percent", "relative", "standard deviations"])
def test_jacobians_of_natural_frequencies_against_differences(unit):
    modes = simulate_modes(make_assembly(), standard_deviation_hz=3.0)
    unknowns = (*STIFFNESSES, Unknown(address="tool.segment[0].density", lower=-1.0, upper=2e4))
    problem = task_of(modes, unknowns, unit).problem()
    assert_jacobian(problem, np.array([8.3, 5.4, 14100.0]))


def assert_jacobian(problem, x):
    jacobian = problem.jacobian(x)
    for column in range(x.size):
        step = np.zeros(x.size)
        step[column] = 2e-5 * max(1.0, abs(x[column]))
        wide, half = (
            (problem.residual(x + h * step) - problem.residual(x - h * step)) / (2.0 * h * step[column])
            for h in (1.0, 0.5)
        )
        slope = (4.0 * half - wide) / 3.0
        scale = np.abs(slope).max()
        np.testing.assert_allclose(jacobian[:, column], slope, rtol=1e-5, atol=1e-6 * scale)


def test_value_and_derivative_at_a_point_cost_one_evaluation():
    problem = task_of(simulate(make_assembly()), STIFFNESSES).problem()
    x = problem.variables.start
    problem.residual(x)
    problem.jacobian(x)
    assert problem.evaluations == 1
    problem.residual(x + 0.1)
    assert problem.evaluations == 2


def test_modes_that_only_a_higher_limit_shows_are_counted_up_to():
    # With the joint a decade too stiff the third mode is far above its measured frequency.
    soft = make_assembly(k_y=1e6, k_theta=1e3)
    modes = soft.natural_frequencies(20e3)[:3]
    unknowns = [replace(unknown, start=unknown.upper) for unknown in STIFFNESSES]
    result = identify(Observation.from_modes(assembly=soft, frequency_hz=modes), unknowns)
    assert_found(result, {"joint.k_y": 1e6, "joint.k_theta": 1e3})


def test_fit_avoids_points_without_a_joint_value():
    # The cross term's bounds reach beyond sqrt(k_y k_theta), where the joint is not passive.
    true = {"joint.k_y": 6.3e8, "joint.k_theta": 1e5, "joint.k_ytheta": 4e6}
    assembly = make_assembly(k_ytheta=4e6)
    unknowns = [*STIFFNESSES, Unknown(address="joint.k_ytheta", lower=-1e7, upper=1e7, start=0.0)]
    result = identify([simulate(assembly)], unknowns, starts=6)
    assert_found(result, true)
    assert any("no value" in note and "positive semidefinite" in note for note in result.notes)
    assert any(not np.isfinite(start.cost) for start in result.starts)


def test_error_without_a_valid_start_gives_the_reason():
    assembly = make_assembly(k_ytheta=4e6)
    unknown = Unknown(address="joint.k_ytheta", lower=8e6, upper=1e7)
    with pytest.raises(ReceptanceError, match=r"any of the 3 starts.*positive semidefinite"):
        identify(simulate(assembly), unknown, starts=3)


def test_result_objects_are_readable_and_pickle():
    result = identify(simulate(make_assembly(), label="short <tool>"), STIFFNESSES, starts=2)
    again = pickle.loads(pickle.dumps(result))
    assert again.values == result.values
    assert again.assemblies == result.assemblies
    text = result.summary()
    assert "joint.k_theta" in text
    assert "short <tool>   FRF, 1200 lines" in text
    assert "converged, " in repr(result)
    assert f"{result.agreeing} of 2 starts" in repr(result)
    page = result._repr_html_()
    assert "short &lt;tool&gt;" in page
    assert ">joint.k_y</td>" in page


def test_result_carries_over_to_another_overhang():
    result = identify(simulate_modes(make_assembly(), standard_deviation_hz=5.0), STIFFNESSES)
    guess = make_assembly(0.09, k_y=1e8, k_theta=1e4)
    expected = make_assembly(0.09).natural_frequencies(15e3)
    np.testing.assert_allclose(result.at(guess).assembly.natural_frequencies(15e3), expected, rtol=1e-6)
    predicted = result.at(guess).natural_frequencies(15e3)
    found, error = predicted.predicted_hz, predicted.standard_error_hz
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert np.all((error > 0.1) & (error < 50.0))
    other = Assembly([Part([Segment(length=0.1, outer_diameter=0.01, material=STEEL)])])
    with pytest.raises(ValueError, match="none of the identified"):
        result.at(other)
