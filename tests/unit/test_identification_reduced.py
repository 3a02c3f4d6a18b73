"""Fits of one joint on the reduced model: the same residuals and derivatives as on the whole one."""

from dataclasses import replace

import numpy as np
import pytest

import scipy_fits
from receptance import Coordinate, GroundSpring, Observation, PointMass, Unknown, identify
from receptance.fit import Prior
from receptance.fit.problem import InfeasibleError, only_joint
from receptance.fit.search import fit_direct
from scipy_fits import task_of
from tool_in_holder import DASHPOTS, LINES, STIFFNESSES, TRUE, make_assembly, simulate


def joint_of(task):
    """Return the joint to which the first observation of a task is reduced."""
    return only_joint(task.observed[0], task.mappings[0])


COUPLING = Unknown(address="joint.k_ytheta", lower=-1e9, upper=1e9)
LOSS = Unknown(address="joint.loss_factor", lower=0.0, upper=0.5)
NOSE = Coordinate("holder", 0.0)


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
    task = task_of(simulate(make_assembly(k_ytheta=3e6), **places), unknowns)
    problem = task.problem()
    assert joint_of(task) == "joint"
    seed = 5
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(5):
        values = np.array([10 ** rng.uniform(6, 10), 10 ** rng.uniform(3, 7), 0.0, *10 ** rng.uniform(-1, 2, 2), 0.03])
        values[2] = rng.uniform(-0.9, 0.9) * np.sqrt(values[0] * values[1])
        x = np.clip(task.variables.from_values(values), *task.variables.limits)
        residual, jacobian = scipy_fits.residual_and_jacobian(task, x)
        normal = problem.core.normal_matrix(x)
        assert 2.0 * problem.cost(x) == pytest.approx(residual @ residual, rel=1e-9)
        size = np.linalg.norm(jacobian, axis=0)
        gradient = np.abs(normal[:-1, -1] - jacobian.T @ residual)
        assert np.all(gradient <= 1e-9 * size * np.linalg.norm(residual))
        curvature = np.abs(normal[:-1, :-1] - jacobian.T @ jacobian)
        assert np.all(curvature <= 1e-9 * np.outer(size, size))


def test_reduction_with_bands_weights_attachments_and_threads():
    assembly = make_assembly()
    more = [
        PointMass(mass=0.002, part="tool", position=0.01),
        GroundSpring(k_y=1e5, c_y=3.0, part="holder", position="end"),
    ]
    assembly = type(assembly)(assembly.elements.values(), more)
    spread = np.linspace(0.01, 0.1, LINES.size)
    frf = simulate(assembly, standard_deviation=spread)
    task = task_of(frf, STIFFNESSES, "standard deviations", bands=[(900.0, 7777.0)])
    x = task.variables.from_values(np.array([2e8, 4e4]))
    expected, got = scipy_fits.residual_and_jacobian(task, x)[0], task.problem().residual(x)
    assert got @ got == pytest.approx(expected @ expected, rel=1e-9)
    assert np.array_equal(replace(task, threads=3).problem().residual(x), got)


def test_the_reduction_is_taken_where_only_one_joint_is_unknown():
    frf = simulate(make_assembly())
    assert joint_of(task_of(frf, STIFFNESSES)) == "joint"
    diameter = Unknown(address="tool.segment[0].outer_diameter", lower=0.01, upper=0.02)
    assert joint_of(task_of(frf, (*STIFFNESSES, diameter))) is None
    assert joint_of(task_of(frf, (diameter,))) is None
    doubled = Unknown(address="joint.k_y", lower=1e6, upper=1e11, multiple=2.0)
    assert joint_of(task_of(frf, (doubled,))) is None
    known = Unknown(address="joint.k_y", lower=1e6, upper=1e11, prior=Prior(mean=1e9, standard_deviation=1.0))
    assert joint_of(task_of(frf, (known,), "standard deviations")) == "joint"


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
    assert assembly.reduced_to_joint("joint", LINES - 3.0j, threads=1).planes() is not None


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


def test_the_residuals_of_all_lines_are_those_of_the_whole_model():
    frf = simulate(make_assembly())
    task = task_of(frf, STIFFNESSES)
    x = task.variables.from_values(np.array([2e8, 4e4]))
    residual, jacobian = scipy_fits.residual_and_jacobian(task, x)
    assert task.problem().value(x) == pytest.approx(residual, rel=1e-8, abs=1e-10)
    assert task.problem().jacobian(x) == pytest.approx(jacobian, rel=1e-8, abs=1e-8)
    with pytest.raises(InfeasibleError, match="k_ytheta"):
        task_of(frf, [*STIFFNESSES, COUPLING]).problem().value(np.array([6.0, 2.0, 1e9]))


@pytest.mark.parametrize("lines", [LINES, np.linspace(100.0, 15e3, 3001)])
def test_the_core_ends_where_scipy_ends(lines):
    """Noisy data of two overhangs: the same optimum, to a small part of a standard error, from every start."""
    seed = 3
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    frfs = []
    for overhang in (0.05, 0.0623):
        clean = simulate(make_assembly(overhang=overhang), lines)
        noise = np.exp(0.05 * (rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size)))
        frfs.append(Observation(assembly=clean.assembly, frequency_hz=lines, receptance=clean.receptance * noise))
    task = task_of(frfs, [*STIFFNESSES, *DASHPOTS])
    problem = task.problem()
    starts = problem.variables.draw(6, seed)
    ours = fit_direct(problem, starts, 200, 1e-10)
    theirs = [scipy_fits.fit(task, x) for x in starts]
    optimum = min(theirs, key=lambda run: run.cost)
    best, reference = optimum.cost, optimum.x
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
    task = task_of(frf, unknowns)
    start = task.variables.start
    (ours,), theirs = fit_direct(task.problem(), start[None], 200, 1e-10), scipy_fits.fit(task, start)
    assert ours.converged
    assert ours.values["joint.k_y"] == pytest.approx(4e8, rel=1e-6)
    assert ours.cost <= theirs.cost * (1 + 1e-6)
    assert ours.values["joint.k_theta"] == pytest.approx(10.0 ** theirs.x[1], rel=1e-4)


def test_the_ends_do_not_depend_on_the_number_of_threads():
    frf = simulate(make_assembly(), np.linspace(100.0, 15e3, 5001))
    task = task_of(frf, (*STIFFNESSES, *DASHPOTS))
    starts = task.variables.draw(5, 1)
    ends = [
        fit_direct(replace(task, threads=threads).problem(), x, 50, 1e-10)
        for threads, x in ((1, starts), (2, starts), (1, starts[:1]), (2, starts[:1]))
    ]
    for one, two in (ends[:2], ends[2:]):
        assert [run.values for run in one] == [run.values for run in two]


def test_fits_on_fewer_lines_count_among_the_evaluations():
    frf = simulate(make_assembly(), np.linspace(100.0, 15e3, 8001))
    found = identify(frf, [*STIFFNESSES, *DASHPOTS], starts=3, max_evaluations=6)
    assert max(start.evaluations for start in found.starts) <= 7
