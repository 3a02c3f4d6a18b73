"""Fits of one joint on the reduced model: the same residuals and derivatives as on the whole one."""

import numpy as np
import pytest

from receptance import Coordinate, GroundSpring, MeasuredFRF, PointMass, Unknown, identify
from receptance.identification.problem import Problem
from receptance.identification.reduced import JointResidual, only_joint
from receptance.identification.residuals import FRFResidual, InfeasibleError
from receptance.identification.unknowns import Variables
from tool_in_holder import DASHPOTS, LINES, STIFFNESSES, TRUE, make_assembly, simulate

COUPLING = Unknown(address="joint.k_ytheta", lower=-1e9, upper=1e9)
LOSS = Unknown(address="joint.loss_factor", lower=0.0, upper=0.5)
NOSE = Coordinate("holder", 0.0)


def both(frf, unknowns, unit="logarithm", chosen=None):
    variables = Variables(tuple(unknowns))
    whole = FRFResidual(frf, variables, unit, chosen, 1)
    return variables, whole, JointResidual(frf, variables, unit, chosen, "joint", 1)


@pytest.mark.parametrize(
    "places",
    [
        {},
        {"response": NOSE},
        {"response": NOSE, "excitation": NOSE},
        {"excitation": Coordinate("holder", "end", "theta")},
    ],
)
def test_sum_of_squares_gradient_and_curvature_are_those_of_the_whole_model(places):
    unknowns = [*STIFFNESSES, COUPLING, *DASHPOTS, LOSS]
    frf = simulate(make_assembly(k_ytheta=3e6), **places)
    variables, whole, reduced = both(frf, unknowns)
    seed = 5
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(5):
        values = np.array([10 ** rng.uniform(6, 10), 10 ** rng.uniform(3, 7), 0.0, *10 ** rng.uniform(-1, 2, 2), 0.03])
        values[2] = rng.uniform(-0.9, 0.9) * np.sqrt(values[0] * values[1])
        slopes = variables.slopes(values)
        residual, jacobian = whole.evaluate(values, slopes)
        small, small_jacobian = reduced.evaluate(values, slopes)
        assert small @ small == pytest.approx(residual @ residual, rel=1e-9)
        size = np.linalg.norm(jacobian, axis=0)
        gradient = np.abs(small_jacobian.T @ small - jacobian.T @ residual)
        assert np.all(gradient <= 1e-9 * size * np.linalg.norm(residual))
        curvature = np.abs(small_jacobian.T @ small_jacobian - jacobian.T @ jacobian)
        assert np.all(curvature <= 1e-9 * np.outer(size, size))


def test_bands_weights_attachments_and_threads_enter_alike():
    assembly = make_assembly()
    more = [
        PointMass(mass=0.002, part="tool", position=0.01),
        GroundSpring(k_y=1e5, c_y=3.0, part="holder", position="end"),
    ]
    assembly = type(assembly)(assembly.elements.values(), more)
    spread = np.linspace(0.01, 0.1, LINES.size)
    frf = simulate(assembly, standard_deviation=spread)
    chosen = (LINES > 900.0) & (LINES < 7777.0)
    variables, whole, reduced = both(frf, STIFFNESSES, "standard deviations", chosen)
    values = np.array([2e8, 4e4])
    slopes = variables.slopes(values)
    expected, got = whole.evaluate(values, slopes)[0], reduced.evaluate(values, slopes)[0]
    assert got @ got == pytest.approx(expected @ expected, rel=1e-9)
    threaded = JointResidual(frf, variables, "standard deviations", chosen, "joint", 3)
    assert np.array_equal(threaded.evaluate(values, slopes)[0], got)


def test_the_reduction_is_taken_where_only_one_joint_is_unknown():
    frf = simulate(make_assembly())
    assert only_joint(frf, Variables(tuple(STIFFNESSES))) == "joint"
    diameter = Unknown(address="tool.segment[0].outer_diameter", lower=0.01, upper=0.02)
    assert only_joint(frf, Variables((*STIFFNESSES, diameter))) is None
    assert only_joint(frf, Variables((diameter,))) is None


def in_series(frf):
    """Whether the reduction is power series for all lines, not planes with a value a line."""
    found = frf.assembly.reduced_to_joint(
        "joint", frf.frequency_hz, response=frf.response, excitation=frf.excitation, threads=1
    )
    planes = found.planes()
    assert planes is None or planes.shape == (16, frf.frequency_hz.size)
    return planes is None


def test_series_serve_at_the_tip_and_sweeps_elsewhere():
    assembly = make_assembly()
    assert in_series(simulate(assembly))
    end = Coordinate("holder", "end", "theta")
    assert in_series(simulate(assembly, response=end, excitation=end))
    assert not in_series(simulate(assembly, response=NOSE))
    assert not in_series(simulate(assembly, response=NOSE, excitation=NOSE))
    damped = type(assembly)(assembly.elements.values(), [GroundSpring(k_y=1e5, c_y=3.0, part="holder")])
    assert not in_series(simulate(damped))
    assert not in_series(simulate(assembly, LINES * 100.0))


def test_the_curvature_at_the_best_end_is_the_one_evaluated_there():
    frf = simulate(make_assembly())
    rng = np.random.default_rng(7)
    noisy = frf.receptance * np.exp(0.01 * rng.standard_normal(LINES.size))
    frf = MeasuredFRF(assembly=frf.assembly, frequency_hz=LINES, receptance=noisy)
    problem = reduced_problem([frf], [*STIFFNESSES, *DASHPOTS])
    run = min(problem.fit_all(problem.variables.draw(3, 1), 200, 1e-8), key=lambda run: run.cost)
    kept = problem.jacobian(run.variables)
    assert problem.evaluations == 0
    fresh = reduced_problem([frf], [*STIFFNESSES, *DASHPOTS]).jacobian(run.variables)
    size = np.linalg.norm(fresh, axis=0)
    assert np.all(np.abs(kept.T @ kept - fresh.T @ fresh) <= 1e-3 * np.outer(size, size))


def test_the_fit_reaches_the_truth_from_soft_and_from_stiff():
    for start in (1e6, 1e11):
        unknowns = [
            Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=start),
            Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e2 if start < 1e8 else 1e8),
            *DASHPOTS,
        ]
        found = identify(simulate(make_assembly()), unknowns, starts=4)
        for address, value in TRUE.items():
            assert found.values[address] == pytest.approx(value, rel=1e-6)
        assert len(found.residuals[0]) == 2 * LINES.size


def reduced_problem(frfs, unknowns):
    variables = Variables(tuple(unknowns))
    return Problem([JointResidual(frf, variables, "logarithm", None, "joint", 1) for frf in frfs], variables)


def test_the_residuals_of_all_lines_are_those_of_the_whole_model():
    frf = simulate(make_assembly())
    _, whole, reduced = both(frf, STIFFNESSES)
    values = np.array([2e8, 4e4])
    assert reduced.value(values) == pytest.approx(whole.value(values), rel=1e-8, abs=1e-10)
    with pytest.raises(InfeasibleError, match="k_ytheta"):
        both(frf, [*STIFFNESSES, COUPLING])[2].value(np.array([1e6, 1e2, 1e9]))


@pytest.mark.parametrize("lines", [LINES, np.linspace(100.0, 15e3, 7001)])
def test_the_core_ends_where_scipy_ends(lines):
    """Noisy data of two overhangs: the same optimum, to a small part of a standard error, from every start."""
    seed = 3
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    frfs = []
    for overhang in (0.05, 0.0623):
        clean = simulate(make_assembly(overhang=overhang), lines)
        noise = np.exp(0.05 * (rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size)))
        frfs.append(MeasuredFRF(assembly=clean.assembly, frequency_hz=lines, receptance=clean.receptance * noise))
    problem = reduced_problem(frfs, [*STIFFNESSES, *DASHPOTS])
    starts = problem.variables.draw(6, seed)
    ours = problem.fit_all(starts, 200, 1e-10)
    theirs = [problem.fit(x, None, 200, 1e-10, None) for x in starts]
    optimum = min(theirs, key=lambda run: run.cost)
    best, reference = optimum.cost, optimum.variables
    jacobian = problem.jacobian(reference)
    errors = 0.05 * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    reached = [run for run in ours if run.cost < best * (1 + 1e-9)]
    assert len(reached) >= sum(run.cost < best * (1 + 1e-9) for run in theirs) > 0
    for run in reached:
        assert run.converged
        assert np.all(np.abs(run.variables - reference) < 1e-3 * errors)


def test_a_bound_that_holds_the_optimum_back_is_reached_by_both():
    frf = simulate(make_assembly())
    unknowns = [
        Unknown(address="joint.k_y", lower=1e6, upper=4e8, start=2e8),
        Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=2e5),
    ]
    problem = reduced_problem([frf], unknowns)
    start = problem.variables.start
    (ours,), theirs = problem.fit_all(start[None], 200, 1e-10), problem.fit(start, None, 200, 1e-10, None)
    assert ours.converged
    assert ours.values["joint.k_y"] == pytest.approx(4e8, rel=1e-6)
    assert ours.cost <= theirs.cost * (1 + 1e-6)
    assert ours.values["joint.k_theta"] == pytest.approx(theirs.values["joint.k_theta"], rel=1e-4)


def test_the_ends_do_not_depend_on_the_number_of_threads():
    frf = simulate(make_assembly(), np.linspace(100.0, 15e3, 5001))
    variables = Variables((*STIFFNESSES, *DASHPOTS))
    starts = variables.draw(5, 1)
    ends = [
        Problem([JointResidual(frf, variables, "logarithm", None, "joint", threads)], variables).fit_all(x, 50, 1e-10)
        for threads, x in ((1, starts), (2, starts), (1, starts[:1]), (2, starts[:1]))
    ]
    for one, two in (ends[:2], ends[2:]):
        assert [run.values for run in one] == [run.values for run in two]


def test_a_start_without_a_model_says_why():
    frf = simulate(make_assembly())
    unknowns = [*STIFFNESSES, Unknown(address="joint.k_ytheta", lower=-1e10, upper=1e10, start=9e9)]
    problem = reduced_problem([frf], unknowns)
    lost = problem.variables.start
    (run,) = problem.fit_all(lost[None], 50, 1e-8)
    assert run.cost == np.inf
    assert not run.converged
    assert "k_ytheta" in run.message


def test_fits_on_fewer_lines_count_among_the_evaluations():
    frf = simulate(make_assembly(), np.linspace(100.0, 15e3, 8001))
    found = identify(frf, [*STIFFNESSES, *DASHPOTS], starts=3, max_evaluations=6)
    assert max(start.evaluations for start in found.starts) <= 7
