"""An unknown spindle: joint and dimensions with the spindle eliminated, and modes added to its receptances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from receptance import STEEL, Assembly, Coordinate, ModalPart, Mode, Observation, Part, PointJoint, Segment, Tolerance
from receptance.coupling.mode_growth import QUANTITIES, FittedModes, ModeGrowth, SpindleResiduals, of_records
from receptance.coupling.spindle_elimination import SpindleRecords, unexplained
from receptance.coupling.stabilisation import Stabilisation, Stabilisations, up_to_least
from receptance.coupling.unknown_modes import FEWEST_MODES, ModeChoice, _Modes, bounds_of_modes, start_modes
from receptance.errors import ReceptanceError
from receptance.fit import Unknown, identify
from receptance.fit.covariance import covariance_of
from receptance.fit.observation import altered

SEED = 20261128
LINES = np.linspace(200.0, 2500.0, 120)
MODES = (
    Mode(frequency_hz=520.0, damping_ratio=0.04, y=0.25, theta=1.2, y_imaginary=0.02, theta_imaginary=-0.3),
    Mode(frequency_hz=1500.0, damping_ratio=0.03, y=0.35, theta=-2.5, y_imaginary=-0.03, theta_imaginary=0.2),
)
TRUE = {"joint.k_y": 2e8, "joint.k_theta": 4e4}
PLACES = {"tip": Coordinate("tool", 0.0), "middle": Coordinate("tool", 0.04), "holder": Coordinate("holder", 0.02)}
HITS = (("tip", "tip"), ("tip", "middle"), ("tip", "holder"), ("holder", "holder"), ("middle", "middle"))


def machine(k_y: float, k_theta: float, *, diameter: float = 0.016, modes: tuple[Mode, ...] = MODES) -> Assembly:
    """Return tool, joint and holder on a spindle."""
    tool = Part([Segment(length=0.08, outer_diameter=diameter, material=STEEL)], name="tool")
    holder = Part([Segment(length=0.09, outer_diameter=0.045, material=STEEL)], name="holder")
    joint = PointJoint(k_y=k_y, k_theta=k_theta, c_y=100.0, c_theta=1.0, name="joint")
    spindle = ModalPart(modes=modes, residual_y=2e-9, residual_theta=3e-7, residual_ytheta=1e-8, name="spindle")
    return Assembly([tool, joint, holder, spindle])


def records(
    noise: float = 0.005,
    *,
    diameter: float = 0.016,
    hits: tuple[tuple[str, str], ...] = HITS,
    modes: tuple[Mode, ...] = MODES,
) -> list[Observation]:
    """Return records of the true machine; the description has another joint, tool and spindle."""
    rng = np.random.default_rng(SEED)
    described = machine(1e9, 4e5, modes=(Mode(frequency_hz=1.0, damping_ratio=0.1, y=0.0, theta=0.0),) * 2)
    true = machine(*TRUE.values(), diameter=diameter, modes=modes)
    observations = []
    for response, excitation in hits:
        h = true.receptance(LINES, response=PLACES[response], excitation=PLACES[excitation])
        error = noise * (rng.standard_normal(LINES.size) + 1j * rng.standard_normal(LINES.size))
        observations.append(
            Observation(
                assembly=described,
                frequency_hz=LINES,
                receptance=h * np.exp(error),
                response=PLACES[response],
                excitation=PLACES[excitation],
                standard_deviation=max(noise, 1e-6),
                configuration="machine",
                label=f"{response} {excitation}",
            )
        )
    return observations


def joint(start: float) -> list[Unknown]:
    """Return the stiffnesses as unknowns that start at so many times the true ones."""
    return [
        Unknown(address=name, lower=value / 1e3, upper=value * 1e3, start=value * start) for name, value in TRUE.items()
    ]


DIAMETER = Tolerance(name="diameter", moves={"tool.segment[0].outer_diameter": 0.002}, relative=True)


@pytest.mark.parametrize("start", [1e-2, 1.0, 1e2])
def test_the_joint_is_found_whatever_the_spindle_is(start: float) -> None:
    spindle_records = SpindleRecords.of(records(0.001), joint(start), "spindle")
    assert spindle_records is not None
    found = spindle_records.eliminated(seed=0)
    assert found is not None
    values = spindle_records.named(found.x)
    for name, value in TRUE.items():
        assert values[name] == pytest.approx(value, rel=0.01), (SEED, name)
    true = machine(*TRUE.values()).elements["spindle"].entries(spindle_records.lines_hz)
    assert np.median(np.abs(found.entries / true - 1.0)) < 0.1, SEED


@pytest.mark.parametrize("shapes", [1.0, 3.0])
def test_the_first_step_has_no_residual_at_the_true_joint_whatever_the_spindle_is(shapes: float) -> None:
    other = tuple(replace(mode, y=shapes * mode.y, theta=-shapes * mode.theta) for mode in MODES)
    spindle_records = SpindleRecords.of(records(0.0, modes=other), joint(1.0), "spindle")
    true, wrong = (np.log10([factor * value for value in TRUE.values()]) for factor in (1.0, 2.0))
    exact, off = (np.linalg.norm(unexplained(spindle_records.equations(x))) for x in (true, wrong))
    assert exact < 1e-6 < 0.1 < off


def test_an_error_of_a_dimension_is_found_beside_the_joint() -> None:
    measured = records(0.002, diameter=0.016 * np.exp(2.0 * 0.002))
    spindle_records = SpindleRecords.of(measured, joint(1.0), "spindle", [DIAMETER])
    values = spindle_records.named(spindle_records.eliminated(seed=0).x)
    assert values["diameter"] == pytest.approx(2.0, abs=0.3), SEED
    assert values["joint.k_theta"] == pytest.approx(TRUE["joint.k_theta"], rel=0.01), SEED


@pytest.mark.parametrize("hits", [HITS[:3], (HITS[0], HITS[1], HITS[2], ("tip", "tip"))])
def test_records_that_do_not_separate_the_spindle_are_not_eliminated(hits: tuple[tuple[str, str], ...]) -> None:
    # With the response at one place the records do not contain the whole matrix of the spindle.
    assert SpindleRecords.of(records(hits=hits), joint(1.0), "spindle").eliminated(seed=0) is None


def growth(residuals_of: SpindleResiduals, count: int = 2) -> ModeGrowth:
    """Return the growth of modes within wide bounds."""
    bounds = np.tile(
        [[50.0, 3700.0], [1e-3, 0.3], [-5.0, 5.0], [-50.0, 50.0], [-5.0, 5.0], [-50.0, 50.0]], (count, 1, 1)
    )
    above = bounds.copy()
    above[:, 0, 0], above[:, 4:] = 1.05 * LINES[-1], 0.0
    limits = np.array([[-1e-7, 1e-7], [-1e-4, 1e-4], [-1e-6, 1e-6]])
    return ModeGrowth(lines_hz=LINES, residuals_of=residuals_of, bounds=bounds, above=above, residual_bounds=limits)


@pytest.mark.parametrize("linear", [True, False])
def test_modes_with_complex_shapes_are_recovered_from_exact_records(linear: bool) -> None:
    spindle_records = SpindleRecords.of(records(0.0), joint(1.0), "spindle")
    x = spindle_records.starts(1, 0)[0]
    entries = machine(*TRUE.values()).elements["spindle"].entries(LINES)
    residuals = spindle_records.about(x, entries).residuals() if linear else of_records(spindle_records.equations(x))
    growing = growth(residuals)
    fit = growing.first([0.0] * 3)
    for _ in MODES:
        fit = growing.with_next(fit)
    modes, residuals = fit.modes, fit.residuals
    numbers = [[getattr(mode, name) for name in ("frequency_hz", "damping_ratio")] for mode in MODES]
    np.testing.assert_allclose(modes[np.argsort(modes[:, 0]), :2], numbers, rtol=1e-3)
    np.testing.assert_allclose(residuals, [2e-9, 3e-7, 1e-8], rtol=0.05)
    part = ModalPart(
        modes=[Mode(**dict(zip(QUANTITIES, row, strict=True))) for row in modes.tolist()],
        residual_y=residuals[0],
        residual_theta=residuals[1],
        residual_ytheta=residuals[2],
    )
    np.testing.assert_allclose(part.entries(LINES), entries, rtol=1e-3)
    np.testing.assert_allclose(fit.entries, entries, rtol=1e-3)


def test_derivatives_of_added_modes_are_those_of_differences() -> None:
    rng = np.random.default_rng(SEED)

    def rows(entries: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return entries, np.broadcast_to(np.eye(3, dtype=complex), (len(entries), 3, 3))

    before = rng.normal(size=(6 * LINES.size + 2, 2))
    grown = growth(SpindleResiduals(rows, np.zeros(2), before, 1e-6 * rng.normal(size=2)))
    x = np.concatenate(
        [
            grown._scaled(np.array([[500.0, 0.03, 0.3, 2.0, 0.1, -4.0], [1500.0, 0.05, 0.4, -2.0, 0.0, 6.0]])).ravel(),
            rng.normal(size=3),
        ]
    )
    _, jacobian = grown._evaluate(x)
    step = 1e-6
    numerical = np.stack(
        [
            (grown._evaluate(x + step * row)[0] - grown._evaluate(x - step * row)[0]) / (2.0 * step)
            for row in np.eye(x.size)
        ],
        axis=1,
    )
    assert np.all(np.abs(jacobian - numerical) < 1e-7 * np.abs(jacobian).max(axis=0))


def test_residuals_about_a_spindle_are_those_of_changed_records_and_variables() -> None:
    """In the metric chi-square is that of all records, to first order in the spindle and in what is before it."""
    rng = np.random.default_rng(SEED)
    spindle_records = SpindleRecords.of(records(0.01), joint(1.0), "spindle", [DIAMETER])
    start = spindle_records.starts(1, 0)[0]
    entries = machine(*TRUE.values()).elements["spindle"].entries(LINES)
    about = spindle_records.about(start, entries)
    metric = about.residuals()
    change = 1e-6 * rng.normal(size=(LINES.size, 3)) * np.abs(entries)
    step = 1e-6 * rng.normal(size=start.size)
    assert metric.columns is not None
    residual, _ = metric.of_entries(entries + change)
    flat = np.concatenate([residual.real.ravel(), residual.imag.ravel(), metric.others]) + metric.columns @ step
    changed = spindle_records.about(start + step, entries + change)
    assert np.sum(flat**2) + metric.constant - about.chi_square == pytest.approx(
        changed.chi_square - about.chi_square, rel=1e-3
    )
    assert abs(changed.chi_square - about.chi_square) > 1e-6 * about.chi_square


def started(
    count: int, noise: float = 0.005, *, choice: ModeChoice = FEWEST_MODES
) -> tuple[list[Unknown], Stabilisation]:
    """Return the starts of the modes of a machine of which the records choose the number."""
    modes = [{} for _ in range(count)]
    observed = [
        altered(
            o, assembly=machine(1e9, 4e5, modes=(Mode(frequency_hz=1e3, damping_ratio=0.1, y=0.0, theta=0.0),) * count)
        )
        for o in records(noise)
    ]
    bounds = bounds_of_modes("spindle", modes, {}, observed)
    unknowns, _, chosen = start_modes(observed, [*joint(1.0), *bounds], "spindle", by_evidence=True, choice=choice)
    assert chosen is not None
    return unknowns, chosen


def test_the_records_choose_the_number_of_modes() -> None:
    unknowns, chosen = started(6)
    assert chosen.chosen == len(MODES), (SEED, chosen.criterion)
    assert len(chosen.fits) - 1 < 6  # no more are added when further ones do not pay
    frequencies = [u for u in unknowns if u.address.endswith(".frequency_hz")]
    assert [u.address for u in frequencies] == ["spindle.mode[0].frequency_hz", "spindle.mode[1].frequency_hz"]
    np.testing.assert_allclose([u.start for u in frequencies], [mode.frequency_hz for mode in MODES], rtol=0.02)
    stiffness = next(u for u in unknowns if u.address == "joint.k_theta")
    assert stiffness.start == pytest.approx(TRUE["joint.k_theta"], rel=0.05)
    assert chosen.chi_square[2] == pytest.approx(1.0, abs=0.1), SEED
    assert chosen.stable(3).sum() >= 2
    assert not chosen.stable(1).any()


def test_the_number_of_modes_is_shown() -> None:
    _, chosen = started(6)
    (table,) = chosen.tables()
    assert [row[-1] for row in table.rows].index("chosen") == len(MODES) - 1
    assert chosen.to_dict()["chosen"] == len(MODES)
    left, right, _ = Stabilisations({"spindle": chosen}).plot().axes
    assert [len(line.get_xdata()) for line in right.lines] == [len(chosen.fits) - 1]
    marks = sum(len(line.get_xdata()) for line in left.lines if line.get_marker() == "o")
    assert marks == sum(range(len(chosen.fits)))


def test_records_without_a_common_line_cannot_choose_the_number() -> None:
    first, *others = records()
    apart = [altered(o, frequency_hz=o.frequency_hz + 5000.0) for o in others]
    bounds = bounds_of_modes("spindle", [{}] * 2, {}, [first, *apart])
    with pytest.raises(ReceptanceError, match=r"no common lines; expected .* or a number of modes"):
        start_modes([first, *apart], [*joint(1.0), *bounds], "spindle", by_evidence=True)


def test_a_mode_stays_on_its_side_of_the_last_line() -> None:
    above = Mode(frequency_hz=3300.0, damping_ratio=0.03, y=0.6, theta=-4.0)
    observed = records(modes=(*MODES, above))
    described = machine(1e9, 4e5, modes=(Mode(frequency_hz=1.0, damping_ratio=0.1, y=0.0, theta=0.0),) * 4)
    observed = [altered(o, assembly=described) for o in observed]
    bounds = bounds_of_modes("spindle", [{}] * 4, {}, observed)
    limit = 1.05 * LINES[-1]
    assert all(u.lower < limit < u.upper for u in bounds if u.address.endswith("frequency_hz"))
    unknowns, _, _ = start_modes(observed, [*joint(1.0), *bounds], "spindle")
    frequencies = [u for u in unknowns if u.address.endswith("frequency_hz")]
    assert all(u.upper <= limit * (1.0 + 1e-9) or u.lower >= limit * (1.0 - 1e-9) for u in frequencies), SEED
    beyond = {u.address.removesuffix("frequency_hz") for u in frequencies if u.upper > 1.1 * limit}
    assert beyond, SEED
    # Such a mode has a real shape.
    assert not {f"{mode}{part}_imaginary" for mode in beyond for part in ("y", "theta")} & {u.address for u in unknowns}


def test_a_mode_that_is_held_at_the_limit_moves_to_the_other_side() -> None:
    """With a complex shape at the limit it stands for a mode far beyond."""
    far = Mode(frequency_hz=5500.0, damping_ratio=0.02, y=0.8, theta=-6.0)
    limit = 1.05 * LINES[-1]
    spindle_records = SpindleRecords.of(records(0.0005, modes=(*MODES, far)), joint(1.0), "spindle")
    entries = machine(*TRUE.values(), modes=(*MODES, far)).elements["spindle"].entries(LINES)
    lines = spindle_records.about(spindle_records.starts(1, 0)[0], entries)
    wide = growth(lines.residuals(), 3)
    above = wide.bounds.copy()
    above[:, 0, 0], above[:, 0, 1], above[:, 4:] = limit, 3.0 * LINES[-1], 0.0
    below = wide.bounds.copy()
    below[:, 0, 1] = limit
    two_sided = replace(wide, below=below, above=above)
    numbers = [[getattr(mode, name) for name in QUANTITIES] for mode in MODES]
    held = FittedModes(
        modes=np.array([*numbers, [limit, 0.1, 0.4, -3.0, 0.1, -0.5]]),
        bounds=below,
        residuals=np.array([2e-9, 3e-7, 1e-8]),
        chi_square=np.inf,
        before=np.empty(0),
        entries=entries,
    )
    fit = two_sided.fitted(held)
    assert fit.modes[2, 0] == pytest.approx(5500.0, rel=0.1), SEED
    assert fit.free == 16  # a real shape above the limit
    assert fit.chi_square < 2.0 * lines.chi_square


def test_modes_far_beyond_the_lines_are_reached() -> None:
    far = (
        Mode(frequency_hz=4373.0, damping_ratio=0.02, y=0.23, theta=-10.5),
        Mode(frequency_hz=5445.0, damping_ratio=0.02, y=0.57, theta=-3.1),
    )
    none = Mode(frequency_hz=1.0, damping_ratio=0.1, y=0.0, theta=0.0)
    described = machine(1e9, 4e5, modes=(none,) * 6)
    observed = [altered(o, assembly=described) for o in records(0.0005, modes=(*MODES, *far))]
    bounds = bounds_of_modes("spindle", [{}] * 6, {}, observed)
    _, _, chosen = start_modes(observed, [*joint(1.0), *bounds], "spindle", by_evidence=True, tolerances=[DIAMETER])
    # One mode stands for both.
    assert chosen.used == 3, SEED
    assert chosen.chi_square[3] < 1.1, SEED


def test_modes_are_added_as_long_as_they_do_not_explain_the_records() -> None:
    def fit(chi_square: float) -> FittedModes:
        none = np.empty((0, 6))
        return FittedModes(
            modes=none,
            bounds=np.empty((0, 6, 2)),
            residuals=np.zeros(3),
            chi_square=chi_square,
            before=np.empty(0),
            entries=np.empty((0, 3), dtype=np.complex128),
        )

    sums = [1e6, 1e5, 1.1e5, 1.2e5, 1e3, 1e3, 1e3, 1e3, 1e3]
    assert len(up_to_least(map(fit, sums), 1000.0)) == 4
    assert len(up_to_least(map(fit, sums), 1000.0, near=2e3)) == 7


def test_unknowns_of_modes_are_in_the_order_of_their_frequencies() -> None:
    """Whatever the order is in which a fit of everything leaves them."""
    spindle = machine(1e9, 4e5, modes=(Mode(frequency_hz=1.0, damping_ratio=0.1, y=0.0, theta=0.0),) * 2)
    bounds = bounds_of_modes("spindle", [{}, {}], {}, records())
    modes = _Modes("spindle", spindle.elements["spindle"], {unknown.address: unknown for unknown in bounds})
    swapped = {"spindle.mode[0].frequency_hz": 1500.0, "spindle.mode[1].frequency_hz": 520.0}
    begun = [replace(u, start=swapped.get(u.address, u.start)) for u in bounds]
    ordered = modes.ascending([*joint(1.0), *begun])
    assert [u.address for u in ordered] == [u.address for u in [*joint(1.0), *bounds]]
    assert [u.start for u in ordered if u.address.endswith("frequency_hz")] == [520.0, 1500.0]


def test_a_diagnosis_has_further_modes() -> None:
    unknowns, chosen = started(6, choice=ModeChoice(further=1))
    assert chosen.used == chosen.chosen + 1 == len(MODES) + 1, (SEED, chosen.criterion)
    assert sum(u.address.endswith("frequency_hz") for u in unknowns) == chosen.used


def test_a_tolerance_starts_where_it_says() -> None:
    bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    observation = Observation.from_modes(
        assembly=bar, frequency_hz=bar.natural_frequencies(2e4)[:3], standard_deviation_hz=5.0
    )
    length = Tolerance(name="length", moves={"bar.segment[0].length": 1e-4}, start=1.5)
    fit = identify(observation, {"bar.segment[0].youngs_modulus": (1e11, 3e11)}, tolerances=length, starts=1)
    assert fit.starts[0].start["length"] == 1.5
    assert abs(fit.values["length"]) < 1.0


def test_draws_with_uncertain_modes_scatter_about_the_fit() -> None:
    """Numbers of modes are correlated: drawn vectors of them have other receptances, far from those of the fit."""
    observations = records(0.02)
    modal = [
        Unknown(address=f"spindle.mode[{i}].{name}", lower=low, upper=high, start=getattr(mode, name))
        for i, mode in enumerate(MODES)
        for name, low, high in (
            ("frequency_hz", 100.0, 3000.0),
            ("damping_ratio", 1e-3, 0.3),
            ("y", -5.0, 5.0),
            ("theta", -50.0, 50.0),
        )
    ]
    fit = identify(observations, [*joint(1.0), *modal], starts=1, noise="stated")
    tip = fit.at(observations[0].assembly).receptance(LINES, draws=100, seed=SEED)
    spread = np.std(np.log(np.abs(tip.drawn / tip.receptance)), axis=0)
    np.testing.assert_allclose(spread, tip.scatter.total, rtol=0.35)


def test_draws_of_modes_that_only_together_are_determined() -> None:
    """Two modes alike: the data determine the sum of their receptances, and neither shape."""
    true = machine(*TRUE.values(), modes=(MODES[0], MODES[0], MODES[1]))
    error = 0.02 * np.array([1.0, 1.0j]) @ np.random.default_rng(SEED).standard_normal((2, LINES.size))
    tip = {"response": PLACES["tip"], "excitation": PLACES["tip"]}
    observation = Observation(
        assembly=true,
        frequency_hz=LINES,
        receptance=true.receptance(LINES, **tip) * np.exp(error),
        standard_deviation=0.02,
        **tip,
    )
    shapes = [Unknown(address=f"spindle.mode[{i}].y", lower=-5.0, upper=5.0, start=MODES[0].y) for i in (0, 1)]
    fit = identify(observation, shapes, starts=1, noise="stated")
    # At equal shapes; the fit itself may end beside them.
    shape = np.array([MODES[0].y] * 2)
    root = fit.task.problem().curvature_root(fit.task.variables.from_values(shape))
    covariance, _ = covariance_of(root)
    assert np.isinf(covariance).all()
    predictor = replace(fit.predictor, values=shape, covariance=covariance, root=root)
    predicted = predictor.at(observation.site(0)).receptance(LINES, **tip, draws=200, seed=SEED)
    assert np.std(np.log(np.abs(predicted.drawn / predicted.receptance)), axis=0).max() < 0.02


def test_records_are_linear_only_where_the_model_has_a_value() -> None:
    """A linear effect may lead to a negative length, or beyond the bounds of an error."""
    length = Tolerance(name="length", moves={"tool.segment[0].length": 0.012})
    spindle_records = SpindleRecords.of(records(), joint(1.0), "spindle", [DIAMETER, length])
    assert spindle_records is not None
    lines = spindle_records.eliminated(seed=0)
    assert lines is not None
    diameter, tool = (list(spindle_records.named(lines.x)).index(name) for name in ("diameter", "length"))
    far = lines.x.copy()
    far[diameter] = 50.0
    inside = spindle_records.about(far, lines.entries)
    assert inside is not None
    assert inside.x[diameter] == 8.0
    # 80 mm less 8 times 12 mm.
    far[tool] = -50.0
    assert spindle_records.about(far, lines.entries) is None
