"""Problems of the core: the same sums and the same optimum as residuals of assemblies and SciPy."""

from __future__ import annotations

import signal
import time
from dataclasses import replace

import numpy as np
import pytest

import scipy_fits
from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    ColletJoint,
    Coordinate,
    GroundSpring,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Unknown,
    _core,
)
from receptance.fit import Law, Power, Prior, Tolerance, identify
from receptance.fit.observation import altered
from receptance.fit.parameters import Parameters
from receptance.fit.problem import Task
from receptance.fit.search import smeared
from simulated_campaigns import simulate_campaign

LINES = np.linspace(200.0, 6000.0, 300)
RNG = np.random.default_rng(4)


def make_assembly(overhang: float = 0.06) -> Assembly:
    tool = Part(
        [
            Segment(length=overhang, outer_diameter=0.0127, material=replace(CARBIDE, loss_factor=0.002)),
            Segment(length=0.01, outer_diameter=0.0125, material=CARBIDE),
        ],
        name="tool",
    )
    holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    masses = [
        PointMass(mass=0.003, part="tool", position=overhang, name="sensor"),
        GroundSpring(k_y=1e6, k_theta=10.0, part="holder", position="end", name="rope"),
    ]
    return Assembly([tool, PointJoint(k_y=6e8, k_theta=1e5, c_theta=2.0, name="joint"), holder], masses)


def measured(overhang: float, lines: np.ndarray = LINES, **places: Coordinate) -> Observation:
    noise = RNG.normal(scale=0.01, size=(2, lines.size))
    values = make_assembly(overhang + 5e-5).receptance(lines, **places) * np.exp(noise[0] + 1j * noise[1])
    return Observation(
        assembly=make_assembly(overhang),
        frequency_hz=lines,
        receptance=values,
        standard_deviation=np.linspace(0.01, 0.02, lines.size),
        label=f"{1e3 * overhang:.0f} mm",
        **places,
    )


UNKNOWNS = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, prior=Prior(mean=1e9, standard_deviation=1.0)),
    Law(
        address="joint.k_theta",
        lower=1e2,
        upper=1e8,
        powers=Power(of="tool.segment[0].length", reference=0.06),
        individual=0.05,
    ),
    Unknown(address="joint.k_ytheta", lower=-1e6, upper=1e6),
    Unknown(address="joint.c_theta", lower=1e-2, upper=1e2),
    Unknown(address="sensor.mass", lower=1e-4, upper=1e-1),
]
JOINT = [
    Unknown(address="joint.k_y", lower=1e7, upper=1e10, start=5e8),
    Unknown(address="joint.k_theta", lower=1e4, upper=1e6, start=9e4),
    Unknown(address="joint.c_theta", lower=1e-1, upper=1e2, start=1.5),
]
TOLERANCES = [
    Tolerance(name="blank", moves={"tool.segment[*].outer_diameter": 1e-3}, relative=True),
    Tolerance(name="modulus", moves={"tool.segment[*].youngs_modulus": 0.01, "holder.segment[0].density": 0.01}),
    Tolerance(name="clamped", moves={"tool.segment[0].length": 1e-4}, configurations="50 mm"),
    Tolerance(name="rope", moves={"rope.k_y": 0.3}, relative=True),
]


def everything() -> Task:
    """Return a task with all features of the core: laws, priors, errors, places inside segments, modes, a window."""
    modes = make_assembly(0.07).natural_frequencies(9e3)
    observed = (
        measured(0.05),
        measured(0.06, response=Coordinate(part="tool", position=0.02), excitation=Coordinate(part="tool")),
        measured(0.08, LINES - 3j, excitation=Coordinate(part="tool", position=0.08, direction="theta")),
        Observation.from_modes(
            assembly=make_assembly(0.07),
            frequency_hz=modes[[0, 2]],
            modes=[1, 3],
            standard_deviation_hz=[1.0, 4.0],
            label="70 mm",
        ),
    )
    places = [one.site(i) for i, one in enumerate(observed)]
    parameters = Parameters(UNKNOWNS, TOLERANCES, places)
    return Task(observed, parameters, ("standard deviations",) * 4, threads=1)


def recorded() -> Task:
    """Return a task with what stands between structure and record, a collet, multiples, and records of one model."""

    def seat(mass: float) -> Assembly:
        springs = [PointJoint(k_y=9e8, k_theta=2e5, c_theta=2.0), PointJoint(k_y=2e9, k_theta=3e5, c_y=100.0)]
        tool, _, holder = make_assembly().elements.values()
        collet = ColletJoint(inner=springs[0], outer=springs[1], mass=mass, inertia=1e-6, name="collet")
        return Assembly([tool, collet, holder], make_assembly().attachments.values())

    one = measured(0.06)
    observed = (
        one,
        altered(measured(0.06), assembly=one.assembly, label="again"),
        altered(measured(0.06, LINES - 2j), assembly=seat(0.02), configuration="collet"),
    )
    unknowns = [
        Unknown(address="joint.k_y", lower=1e6, upper=1e11, multiple=2.0, also={"joint.k_theta": 4e-4}),
        Unknown(address="collet.mass", lower=0.0, upper=0.1, start=0.02),
        Unknown(address="observation.log_gain", lower=-1.0, upper=1.0, configurations="60 mm"),
        Unknown(address="observation.delay", lower=-1e-4, upper=1e-4),
        Unknown(address="observation.decay_rate", lower=0.0, upper=100.0, start=5.0),
        Unknown(address="observation.decay_rate_of_velocity", lower=0.0, upper=50.0, start=3.0, configurations="60 mm"),
    ]
    places = [one.site(i) for i, one in enumerate(observed)]
    return Task(observed, Parameters(unknowns, TOLERANCES[:2], places), ("standard deviations",) * 3, threads=1)


def percentages() -> Task:
    """Return a task of magnitudes in percent, in bands, and of natural frequencies."""
    task = everything()
    observed = (*task.observed, altered(task.observed[0], label="again"))
    parameters = Parameters(UNKNOWNS[2:], TOLERANCES, [one.site(i) for i, one in enumerate(observed)])
    return Task(observed, parameters, ("percent",) * 5, bands=[(900.0, 2000.0), (3000.0, 5000.0)], threads=1)


def near(task: Task) -> np.ndarray:
    low, high = task.variables.limits
    x = task.variables.start + RNG.normal(scale=0.02, size=task.variables.start.size)
    return np.clip(x, low + 1e-3 * (high - low), high - 1e-3 * (high - low))


@pytest.mark.parametrize("made", [everything, recorded, percentages])
def test_normal_matrices_are_those_of_the_residuals(made):
    task = made()
    problem = task.problem()
    for _ in range(3):
        x = near(task)
        if "joint.k_ytheta" in task.variables.names:
            x[task.variables.names.index("joint.k_ytheta")] = RNG.uniform(-1e5, 1e5)
        normal, (residual, jacobian) = problem.core.normal_matrix(x), scipy_fits.residual_and_jacobian(task, x)
        scale = np.linalg.norm(jacobian, axis=0)
        assert scale.min() > 0.0
        cost = problem.cost(x)
        assert cost == pytest.approx(0.5 * residual @ residual, rel=1e-9)
        slope = jacobian.T @ residual
        assert normal[:-1, -1] / scale == pytest.approx(slope / scale, rel=1e-7, abs=1e-8 * np.sqrt(cost))
        assert normal[:-1, :-1] / np.outer(scale, scale) == pytest.approx(
            jacobian.T @ jacobian / np.outer(scale, scale), rel=1e-8, abs=1e-9
        )


@pytest.mark.parametrize("made", [everything, recorded, percentages])
def test_rows_are_those_of_the_residuals(made):
    task = made()
    problem = task.problem()
    x = near(task)
    residual, jacobian = scipy_fits.residual_and_jacobian(task, x)
    scale = np.linalg.norm(jacobian, axis=0)
    assert problem.residual(x) == pytest.approx(residual, rel=1e-9, abs=1e-9)
    assert problem.value(x) == pytest.approx(residual, rel=1e-9, abs=1e-9)
    assert problem.jacobian(x) / scale == pytest.approx(jacobian / scale, rel=1e-7, abs=1e-9)
    free = RNG.random(x.size) < 0.5
    assert problem.rows(x, free)[1] / scale[free] == pytest.approx(jacobian[:, free] / scale[free], abs=1e-8)
    assert [part.size for part in problem.parts(residual)] == list(problem.sizes)


def test_records_of_one_model_share_its_evaluation(monkeypatch):
    records = []

    class Counted:
        """A problem of the core that notes how many records each receptance has."""

        def __init__(self, *arguments):
            self.problem = problem_of_the_core(*arguments)

        def add_receptance(self, *arguments):
            before = self.problem.lines
            self.problem.add_receptance(*arguments)
            records.append((self.problem.lines - before) // LINES.size)

        @property
        def lines(self):
            return self.problem.lines

    problem_of_the_core = _core.Problem
    monkeypatch.setattr(_core, "Problem", Counted)
    task = recorded()
    problem = task.problem()
    assert records == [2, 1]
    assert problem.core.lines == 3 * LINES.size


def test_subsets_of_lines():
    task = everything()
    lines = [np.arange(0, LINES.size, 3), None, np.arange(100), None]
    some = task.problem([one.select(own) for one, own in zip(task.observed, lines, strict=True)])
    whole, x = task.problem(), near(task)
    kept = [np.r_[chosen, LINES.size + chosen] for chosen in (lines[0], np.arange(LINES.size), lines[2])]
    begins = np.cumsum([0, *whole.sizes, len(TOLERANCES) + 1 + 4])
    rows = np.concatenate([begins[i] + own for i, own in enumerate(kept)] + [np.arange(begins[3], begins[-1])])
    assert some.residual(x) == pytest.approx(whole.residual(x)[rows], rel=1e-9, abs=1e-9)


def test_results_are_bitwise_independent_of_threads():
    task = everything()
    one, two = (replace(task, threads=threads).problem().core for threads in (1, 2))
    assert np.array_equal(*(core.normal_matrix(task.variables.start) for core in (one, two)))


def test_the_optimum_is_that_of_scipy():
    campaign = simulate_campaign(np.random.default_rng([5, 1]), overhangs=1)
    found = identify(campaign.observations, campaign.unknowns(campaign.truth), tolerances=campaign.tolerances, starts=3)
    best = min(found.starts, key=lambda run: run.cost)
    scipy = scipy_fits.fit(found.task, best.variables + 0.01)
    assert best.cost == pytest.approx(scipy.cost, rel=1e-8)
    assert np.max(np.abs(best.variables - scipy.x) / np.sqrt(np.diag(found.covariance))) < 1e-3


def damped() -> Task:
    """Return a task of natural frequencies with damping ratios."""
    assembly = make_assembly(0.07)
    poles, _ = assembly.complex_frequencies(assembly.natural_frequencies(9e3)[:3])
    modes = Observation.from_modes(
        assembly=assembly,
        frequency_hz=np.abs(poles) * [1.001, 0.999, 1.0005],
        standard_deviation_hz=2.0,
        damping_ratio=poles.imag / np.abs(poles) * [1.02, 0.99, 1.01],
        standard_deviation_damping=1e-4,
    )
    return scipy_fits.task_of(modes, JOINT[1:], "standard deviations")


def truncated() -> Task:
    """Return a task of a record that ends early."""
    one = altered(measured(0.06, LINES[::5]), ends=0.1)
    return scipy_fits.task_of(one, JOINT, "standard deviations", TOLERANCES[:1])


def alone() -> Task:
    """Return a task of one joint, to which the model is reduced."""
    return scipy_fits.task_of([measured(0.06), measured(0.08)], JOINT, "standard deviations")


@pytest.mark.parametrize("made", [everything, recorded, damped, truncated, alone])
def test_fits_end_where_those_of_scipy_do(made):
    task = made()
    start = task.variables.start
    end, scipy = task.problem().fit_one(start, 400), scipy_fits.fit(task, start)
    assert end.converged
    assert end.cost == pytest.approx(scipy.cost, rel=1e-6)
    errors = 1.0 / np.linalg.svd(scipy_fits.residual_and_jacobian(task, scipy.x)[1], compute_uv=False)[-1]
    assert np.linalg.norm(end.x - scipy.x) < 0.01 * errors


def test_the_optimum_of_percentages_is_that_of_scipy():
    """Sums of smoothed absolute values, against SciPy's `soft_l1`."""
    frfs = [measured(0.05), measured(0.08)]
    modes = Observation.from_modes(
        assembly=make_assembly(0.07), frequency_hz=make_assembly(0.07).natural_frequencies(9e3)[:2]
    )
    unknowns = [replace(UNKNOWNS[0], prior=None), UNKNOWNS[3]]
    found = identify([*frfs, modes], unknowns, objective="percentage", starts=2)
    best = min(found.starts, key=lambda run: run.cost)
    for smoothing in (0.1, 3.0):
        end = found.task.problem(smoothing=smoothing).fit_one(best.variables + 0.003, 200)
        scipy = scipy_fits.fit(found.task, best.variables + 0.003, smoothing)
        assert end.converged
        assert end.cost == pytest.approx(scipy.cost, rel=1e-6)
        assert end.x == pytest.approx(scipy.x, abs=1e-4)
    assert best.cost == pytest.approx(scipy_fits.fit(found.task, best.variables, 0.1).cost, rel=1e-6)


def test_abandoned_starts_are_reported():
    lines = np.linspace(200.0, 6000.0, 1600)
    tolerance = Tolerance(name="blank", moves={"tool.segment[*].outer_diameter": 1e-3}, relative=True)
    found = identify(
        [measured(0.05, lines), measured(0.07, lines)], UNKNOWNS[0:1] + UNKNOWNS[3:4], tolerances=tolerance, starts=8
    )
    assert found.converged
    left = [run for run in found.starts if "left on fewer lines" in run.message]
    best = min(run.cost for run in found.starts)
    assert all(not run.converged and run.cost > best for run in left)
    assert found.agreeing + len(left) <= 8
    assert found.evaluations == sum(run.evaluations for run in found.starts)


def test_held_variables_stay_where_they_start():
    task = everything()
    problem = task.problem()
    free = np.zeros(task.variables.start.size, dtype=np.bool_)
    free[:2] = True
    end = problem.fit_one(task.variables.start, 30, tolerance=1e-6, free=free)
    assert np.array_equal(end.x[2:], task.variables.start[2:])
    assert end.first == pytest.approx(problem.cost(task.variables.start), rel=1e-12)
    assert end.cost < end.first
    assert end.curvature[2, 0] == 0.0
    whole = problem.fit_one(task.variables.start, 30, tolerance=1e-6, free=free, of_all=True)
    assert np.array_equal(whole.x, end.x)
    there = problem.core.normal_matrix(whole.x)[:-1, :-1]
    assert np.all(np.abs(whole.curvature - there) <= 1e-2 * np.sqrt(np.outer(np.diag(there), np.diag(there))))


def test_start_without_a_model_is_an_error():
    campaign = simulate_campaign(np.random.default_rng(6), overhangs=1)
    starts = {"joint.k_y": 1e6, "joint.k_theta": 1e3, "joint.k_ytheta": 9e7}
    found = identify(campaign.observations, campaign.unknowns(starts), tolerances=campaign.tolerances, starts=12)
    assert found.starts[0].cost == np.inf
    assert "positive semidefinite" in found.starts[0].message
    assert any("no value at" in note for note in found.notes)


def test_an_error_in_a_function_ends_the_fit():
    problem = _core.Problem(np.zeros(1, dtype=bool), np.array([[0.0], [9.0]]), np.zeros((0, 3)), 1)
    asked = []

    def function(x):
        asked.append(float(x[0]))
        if len(asked) == 2:
            raise KeyError("an error of the function")
        return x - 5.0, np.ones((1, 1))

    problem.add_function(function)
    for call in (problem.normal_matrix, lambda x: problem.fit(x[None], np.ones(1, dtype=bool), np.array([9]), 1e-9)):
        asked.clear()
        asked.extend([0.0] if call == problem.normal_matrix else [])
        with pytest.raises(KeyError, match="of the function"):
            call(np.array([1.0]))
        assert len(asked) == 2
    for wrong in ((np.ones(1), np.ones((2, 1))), np.ones(1), (np.ones(1), np.ones(1)), 7):
        other = _core.Problem(np.zeros(1, dtype=bool), np.array([[0.0], [9.0]]), np.zeros((0, 3)), 1)
        other.add_function(lambda x, wrong=wrong: wrong)
        with pytest.raises((TypeError, ValueError)):
            other.normal_matrix(np.array([1.0]))
    none = _core.Problem(np.zeros(1, dtype=bool), np.array([[0.0], [9.0]]), np.zeros((0, 3)), 1)
    none.add_function(lambda x: None)
    assert np.isnan(none.normal_matrix(np.array([1.0]))).all()
    with pytest.raises(ValueError, match="smoothing"):
        _core.Problem(np.zeros(1, dtype=bool), np.array([[0.0], [9.0]]), np.zeros((0, 3)), 1, -1.0)


@pytest.mark.parametrize("threads", [1, 2])
def test_an_interruption_in_a_function_ends_the_fits_from_all_starts(threads: int) -> None:
    problem = _core.Problem(np.zeros(1, dtype=bool), np.array([[0.0], [9.0]]), np.zeros((0, 3)), threads)
    asked = []

    def function(x):
        asked.append(float(x[0]))
        signal.raise_signal(signal.SIGINT)
        time.sleep(0.1)  # the caller's thread, which alone receives signals, has had its turn
        return x - 5.0, np.ones((1, 1))

    problem.add_function(function)
    starts = np.linspace(1.0, 8.0, 40)[:, None]
    with pytest.raises(KeyboardInterrupt):
        problem.fit(starts, np.ones(1, dtype=bool), np.full(40, 9), 1e-9)
    assert len(asked) < starts.size


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"x": np.zeros(3)}, "expected 2"),
        ({"bounds": np.array([[1.0, 0.0], [0.0, 1.0]])}, "lower bound"),
        ({"priors": np.array([[7.0, 1.0, 0.0]])}, "variable below 2"),
        ({"measured": np.zeros((1, 3), dtype=complex), "weights": np.ones((1, 3))}, "measured receptance"),
        ({"points": np.zeros((1, 2))}, "two rows"),
        ({"addresses": np.full((2, 8), np.nan)}, "unknown below 2"),
        ({"end": -1.0}, "end of record"),
        ({"present": np.zeros(1)}, "present values"),
    ],
)
def test_arrays_of_wrong_shape_are_errors(change, words):
    """A bar whose length and outer diameter are unknown."""
    bar = [0.0, 1.0, 0.1, 0.02, 0.0, 2e11, 7800.0, 0.3, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0]
    none = [np.zeros((0, columns)) for columns in (9, 3, 8)]
    arguments = {
        "rates": np.array([[0.0, 0.0, 2.0, 0.0, 1.0], [0.0, 0.0, 3.0, 1.0, 1.0]]),
        "present": np.array([0.1, 0.02]),
        "addresses": np.array([[i, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0] for i in (0.0, 1.0)]),
        "points": np.zeros((2, 2)),
        "measured": np.full((1, 5), 1e-6 + 1e-7j),
        "weights": np.ones((1, 5)),
        "end": None,
        "bounds": np.array([[0.05, 0.01], [0.2, 0.04]]),
        "priors": np.zeros((0, 3)),
        "x": np.array([0.1, 0.02]),
    }

    def normal(rates, present, addresses, points, measured, weights, end, bounds, priors, x):
        model = _core.Model(0, np.array([bar]), *none).tied(rates, present, addresses)
        problem = _core.Problem(np.zeros(2, dtype=bool), bounds, priors, 1)
        records = _core.Records(measured, weights, end=end)
        problem.add_receptance(model, _core.Lines(np.linspace(1e3, 5e3, 5)), points, records)
        return problem.normal_matrix(x)

    assert np.isfinite(normal(**arguments)).all()
    with pytest.raises(ValueError, match=words):
        normal(**{**arguments, **change})


def test_natural_frequencies_of_broad_resonances_are_uncertain_by_half_the_width() -> None:
    """The stages of a fit begin with broad resonances; the data are to have the same weight as receptances there."""
    modes = Observation.from_modes(assembly=make_assembly(), frequency_hz=[1500.0, 4000.0], standard_deviation_hz=1.0)
    broad = smeared(modes, 0.1)
    assert broad is not None
    assert broad.standard_deviation == pytest.approx([75.0, 200.0])
    assert modes.standard_deviation == pytest.approx([1.0, 1.0])


def test_a_field_that_observations_do_not_have_is_refused() -> None:
    with pytest.raises(TypeError, match="standard_deviation_hz"):
        altered(measured(0.06), standard_deviation_hz=1.0)
