"""Causes and explanations as objects: identity of their parameters, variants, and the order of a selection."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from limits import LIMIT_S
from receptance import CARBIDE, STEEL, Assembly, ColletJoint, Material, Observation, Part, PointJoint, Segment, Unknown
from receptance.diagnosis import CATALOGUE, Cause, Model, Parameter, Step, UndecidableError, Variant
from receptance.diagnosis.causes import parameters_of
from receptance.diagnosis.explanation import Explanation, Selection, behind_limit
from receptance.diagnosis.fitting import Fit, evaluate, explore, fit_base, in_parallel
from receptance.diagnosis.model import IndescribableError
from receptance.diagnosis.screening import Direction, directions, rank
from receptance.diagnosis.selection import Search
from receptance.diagnosis.thresholds import BEHIND, COLLET_GYRATION, EVALUATIONS_OF_START, SAME_END
from receptance.fit import Law, Move, Tolerance
from receptance.fit.observation import altered
from receptance.fit.problem import Problem

LINES = np.linspace(200.0, 6000.0, 120)


def make_assembly(overhang: float, material: Material = CARBIDE) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=material)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint"), holder])


def make_observations(overhang: float) -> Observation:
    assembly = make_assembly(overhang)
    return Observation(
        assembly=assembly,
        frequency_hz=LINES,
        receptance=assembly.receptance(LINES),
        standard_deviation=0.01,
        label=f"{1e3 * overhang:.0f} mm",
    )


JOINT = (
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=6e8),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5),
)
MODEL = Model((make_observations(0.05), make_observations(0.08)), JOINT)


def moved_residual(model: Model, cause: str) -> np.ndarray:
    """Residuals of the lines with all variables off their starts, except those of a cause."""
    problem = model.task.problem()
    names = problem.variables.names
    x = problem.variables.start + 0.01 * np.array([not name.startswith(f"{cause}.") for name in names])
    return problem.residual(x)[: 2 * LINES.size * len(model.observations)].copy()


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_new_unknown_of_a_cause_stands_for_one_of_its_parameters(name: str) -> None:
    try:
        variants = CATALOGUE[name].variants(MODEL)
    except UndecidableError:
        return
    declared = {one.key for one in CATALOGUE[name].parameters}
    for variant in variants:
        own = parameters_of(variant.model.unknowns)
        assert {one.key for one in own.values()} <= declared
        assert {one.cause for one in own.values()} <= {name}
        assert set(own) == {u.name for u in variant.model.unknowns} - {u.name for u in JOINT}


def test_variants_have_different_names() -> None:
    for cause in CATALOGUE.values():
        try:
            names = [one.name for one in cause.variants(MODEL)]
        except UndecidableError:
            continue
        assert len(set(names)) == len(names), cause.id


def test_a_parameter_keeps_its_declaration_through_other_causes() -> None:
    """Flutes divide the tool and renumber unknowns; a sensor before them is still found."""
    steps = (Step(CATALOGUE["sensor_mass"], "50 mm"), Step(CATALOGUE["fluted_part"], "from the tip"))
    model = MODEL
    for step in steps:
        model = step.extend(model)
    fit: Any = SimpleNamespace(model=model, values={u.name: 0.1 for u in model.unknowns})
    found = Explanation(steps, fit, 0.0, 0.0)
    assert list(found.sizes(steps[0].cause)) == ["sensor_mass.mass @ 50 mm"]
    assert [one.key for one in found.parameters.values()] == [
        "sensor_mass.mass",
        "fluted_part.log_diameter",
        "fluted_part.length",
    ]
    assert found.implausible == ("sensor_mass.mass @ 50 mm", "fluted_part.log_diameter")
    assert found.title == "mass of the sensor + thinner fluted part"


def test_a_structure_without_a_joint_has_a_suspension_and_a_sensor_in_proportion() -> None:
    def observed(diameter: float) -> Observation:
        bar = Assembly([Part([Segment(length=1.0, outer_diameter=diameter, material=STEEL)], name="bar")])
        return Observation(
            assembly=bar, frequency_hz=LINES, receptance=bar.receptance(LINES), standard_deviation=0.01, label="bar"
        )

    loss = (Unknown(address="bar.segment[0].loss_factor", lower=1e-6, upper=0.1, start=1e-3),)
    for diameter, largest in ((0.005, 0.03), (0.04, 0.05 * 7850.0 * np.pi / 4.0 * 0.04**2)):
        model = Model((observed(diameter),), loss)
        (sensor,) = CATALOGUE["sensor_mass"].variants(model)
        mass = parameters_of(sensor.model.unknowns)["sensor_mass.mass"]
        assert mass.plausible == pytest.approx((0.0, largest))
        assert mass.upper >= 0.2
        hung = CATALOGUE["suspension"].variants(model)
        assert [one.name for one in hung][:2] == ["at 0 % of the structure", "at 0 % of the structure, with a loss"]
        assert hung[0].model.observations[0].assembly.get("cause_rope.k_y") == 0.0


def test_unknown_without_parameter_is_an_error() -> None:
    def change(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
        yield Variant("all", model.plus(Unknown(address="joint.c_y", lower=1.0, upper=1e4)))

    odd = Cause(id="odd", group="structure", parameters=(), change=change, meaning="odd", remedy="none")
    with pytest.raises(TypeError, match=r"Cause 'odd': the unknown 'joint.c_y' of 'all' is not made of one of its par"):
        odd.variants(MODEL)


def test_a_variant_that_the_model_does_not_have() -> None:
    with pytest.raises(IndescribableError, match="sensor_mass 99 mm"):
        Step(CATALOGUE["sensor_mass"], "99 mm").extend(MODEL)


def test_a_collet_of_no_mass_is_the_joint() -> None:
    """Laws, moves and tolerances of the joint apply to both springs, so the results are unchanged."""
    unknowns = (
        Law(address="joint.k_y", lower=1e6, upper=1e11, start=6e8, individual=0.05, follows={"joint.c_y": 0.5}),
        Move(address="both", lower=-1.0, upper=1.0, moves={"joint.k_theta": 1.0, "joint.c_theta": -1.0}, relative=True),
    )
    tolerances = (Tolerance(name="loss", moves={"joint.c_theta": 0.1}, relative=True),)
    model = Model(MODEL.observations, unknowns, tolerances)
    (collet, *_) = CATALOGUE["collet_mass"].variants(model)
    assert collet.name == "between tool and holder"
    assert isinstance(collet.model.observations[0].assembly.elements["joint"], ColletJoint)
    before, after = (moved_residual(one, "collet_mass") for one in (model, collet.model))
    np.testing.assert_allclose(after, before, atol=1e-7)
    with pytest.raises(UndecidableError, match="has a collet"):
        CATALOGUE["collet_mass"].variants(collet.model)


def test_a_heavy_collet_has_a_moment_of_inertia_of_its_own() -> None:
    """One radius of gyration for all collets leaves a misfit far beyond the noise where a collet of 70 g differs."""
    inertia = 0.07 * (0.75 * 0.012) ** 2

    def observe(overhang: float) -> Observation:
        tool, _, holder = make_assembly(overhang).elements.values()
        half = PointJoint(k_y=1.2e9, k_theta=2e5, c_y=600.0, c_theta=2.0)
        true = Assembly([tool, ColletJoint(inner=half, outer=half, mass=0.07, inertia=inertia, name="joint"), holder])
        return altered(
            make_observations(overhang), receptance=true.receptance(LINES), standard_deviation=np.full(LINES.size, 1e-3)
        )

    (collet, *_) = CATALOGUE["collet_mass"].variants(Model((observe(0.05), observe(0.08)), JOINT))
    few = explore(collet.model, [{"collet_mass.mass": 0.09}, {"collet_mass.mass": 0.03}]).go_on([])
    fit = few.finish()
    assert fit is not None
    assert fit.misfit < 0.01
    assert fit.values["collet_mass.mass"] == pytest.approx(0.07, rel=1e-2)
    assert fit.values["collet_mass.log_inertia"] == pytest.approx(2.0 * np.log(0.75 / COLLET_GYRATION), abs=0.02)


def test_later_starts_are_not_needed_where_a_fit_is_adequate() -> None:
    near, far = {"joint.k_y": 4e8, "joint.k_theta": 8e4}, {"joint.k_y": 2e6, "joint.k_theta": 2e7}
    alone = explore(MODEL, [near]).go_on([])
    assert alone.misfit < 1e-3
    assert explore(MODEL, [near]).go_on([far]).evaluations == alone.evaluations
    both = explore(MODEL, [far]).go_on([near])
    assert both.evaluations > alone.evaluations
    assert both.misfit < 1e-3


def test_a_start_far_behind_an_adequate_one_is_not_continued() -> None:
    near, far = {"joint.k_y": 4e8, "joint.k_theta": 8e4}, {"joint.k_y": 2e6, "joint.k_theta": 2e7}
    adequate, behind = (explore(MODEL, [start]).go_on([]) for start in (near, far))
    # Alone, the second start is continued after its first evaluations.
    assert behind.evaluations > EVALUATIONS_OF_START
    assert behind.chi_square > adequate.chi_square + BEHIND
    both = explore(MODEL, [near, far]).go_on([])
    assert both.chi_square == adequate.chi_square
    assert len(both.ends) == 2
    assert both.evaluations == adequate.evaluations + EVALUATIONS_OF_START


def test_an_error_of_the_first_segment_lengthens_a_joint_along_the_whole_insertion() -> None:
    """What that joint leaves of the segment is shorter than an ordinary error, which would make it negative."""
    error = Tolerance(name="insertion", moves={"holder.segment[0].length": 1e-4})
    model = Model(tuple(map(observe_insertion, (0.05, 0.08))), JOINT, (error,))
    whole = [one for one in CATALOGUE["joint_spread"].variants(model) if "whole insertion" in one.name]
    assert len(whole) == 6
    for variant in whole:
        problem = variant.model.task.problem()
        x = problem.variables.start.copy()
        at = problem.variables.names.index("insertion")
        lines = 2 * LINES.size
        before, after = (problem.residual(x + shift * np.eye(x.size)[at])[:lines].copy() for shift in (0.0, -3.0))
        assert np.isfinite(after).all()
        assert np.max(np.abs(after - before)) > 0.1


def test_all_variants_of_a_cause_that_takes_most_of_the_misfit() -> None:
    """Of twelve variants screening chooses three, and an uneven joint along the whole insertion is none of them."""
    model = Model(tuple(map(observe_uneven, (0.05, 0.065, 0.08))), JOINT)
    base = fit_base(model)
    selection = Selection(base, 6.0)
    search = Search(selection, [CATALOGUE["joint_spread"]], most=1)
    search.fit_singles()
    search.fit_variants()
    assert base.misfit > 10.0
    assert selection.best is not None
    assert selection.best.steps[0].variant == "4 points, uneven over the whole insertion"
    assert selection.best.fit.misfit < 0.01
    assert selection.best.fit.values["joint_spread.slope"] == pytest.approx(-0.6, abs=0.01)


def observe_uneven(overhang: float) -> Observation:
    nominal = observe_insertion(overhang)
    true = spread_along_all(nominal).replace({"joint.slope": -0.6})
    return altered(nominal, receptance=true.receptance(LINES), standard_deviation=np.full(LINES.size, 1e-4))


def spread_along_all(one: Observation) -> Assembly:
    variants = CATALOGUE["joint_spread"].variants(Model((one,), JOINT))
    whole = next(each for each in variants if each.name == "4 points, uneven over the whole insertion")
    return whole.model.observations[0].assembly


def observe_insertion(overhang: float) -> Observation:
    tool, joint, _ = make_assembly(overhang).elements.values()
    mouth = Segment(length=0.04, outer_diameter=0.03, inner_diameter=0.012, core=CARBIDE, material=STEEL)
    holder = Part([mouth, Segment(length=0.09, outer_diameter=0.045, material=STEEL)], name="holder")
    return altered(make_observations(overhang), assembly=Assembly([tool, joint, holder]))


def explanation(evidence: float, *ids: str) -> Explanation:
    return Explanation(tuple(Step(CATALOGUE[id], "all") for id in ids), SimpleNamespace(), evidence, evidence)  # type: ignore[arg-type]


def test_a_selection_keeps_the_best_of_each_set_of_causes_in_order() -> None:
    base: Any = SimpleNamespace(chi_square=1000.0)
    selection = Selection(base, 7.0)
    assert selection.best is None
    worse, better = explanation(3.0, "sensor_mass"), explanation(5.0, "sensor_mass")
    gain, pair = explanation(4.0, "calibration_gain"), explanation(9.0, "sensor_mass", "calibration_gain")
    selection.add(worse, pair)
    selection.add(gain, better)
    assert selection.singles == [better, gain]
    assert selection.explanations == [pair, better, gain]
    # The order of the causes makes no other explanation.
    selection.add(explanation(8.0, "calibration_gain", "sensor_mass"))
    assert selection.explanations == [pair, better, gain]
    assert selection.best is pair
    again: Any = SimpleNamespace(chi_square=998.0)
    selection.replace_base(again)
    assert selection.base is again
    assert [one.evidence for one in selection.singles] == [3.0, 2.0]


def test_explanations_far_behind_the_best_one_are_not_fitted_on_all_lines() -> None:
    """A fixed distance, and a share of the gain of the best one."""
    assert behind_limit(1000.0, [200.0, 700.0]) == pytest.approx(200.0 + 60.0 + 0.3 * 800.0)
    # Without a cause that gains, the model itself is the best one.
    assert behind_limit(1000.0, [1500.0]) == behind_limit(1000.0, []) == pytest.approx(1060.0)


def test_results_are_in_the_order_of_the_fits() -> None:
    second_is_done = threading.Event()

    def first() -> str:
        assert second_is_done.wait(LIMIT_S), "the second fit does not run at the same time"
        return "first"

    def second() -> str:
        second_is_done.set()
        return "second"

    fits: list[Callable[[], str]] = [first, second, lambda: "third"]
    assert list(in_parallel(fits, 2)) == ["first", "second", "third"]
    assert list(in_parallel(fits[1:], 1)) == ["second", "third"]


def test_fits_in_the_background_end_after_an_interrupt() -> None:
    """Signals reach the main thread alone, so that fits in other threads need a flag of their own."""
    problem, begun, ended, enough = MODEL.problem, threading.Event(), threading.Event(), threading.Event()
    start = problem.variables.start + 0.3

    def endless() -> None:
        begun.set()
        try:
            while not enough.is_set():
                problem.fit_one(start)
        finally:
            ended.set()

    def interrupted() -> None:
        assert begun.wait(LIMIT_S)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(in_parallel([interrupted, endless], 2))
    went_on = not ended.wait(LIMIT_S)
    enough.set()
    assert not went_on, "the fit goes on"


@pytest.mark.parametrize(
    ("base_misfit", "best_misfit", "fitted"),
    [
        (30.0, 1.0, [0, 1, 2, 3, 4]),  # an explanation is adequate: those far behind it are not fitted
        (30.0, 1.5, [0, 1, 2, 3, 4, 5, 6]),  # nothing is adequate, and the base is far from the data
        (10.0, 1.5, [0, 1, 2, 3, 4]),  # the base is near the data
    ],
)
def test_which_explanations_are_fitted_on_all_lines(base_misfit: float, best_misfit: float, fitted: list[int]) -> None:
    """Four causes are always fitted; of the others those within 60 and 30 % of the gain of the best one."""
    done: list[int] = []
    of_cause = list(CATALOGUE.values())

    def explored(number: int, chi_square: float) -> Any:
        def finish() -> Any:
            done.append(number)
            return evaluate()

        def evaluate() -> Any:
            return SimpleNamespace(
                chi_square=chi_square, evaluations=0, misfit=best_misfit, model=SimpleNamespace(unknowns=[])
            )

        few = SimpleNamespace(
            chi_square=chi_square, misfit=best_misfit, evaluations=0, finish=finish, evaluate=evaluate
        )
        direction = SimpleNamespace(
            cause=of_cause[number],
            variant=SimpleNamespace(name="all"),
            step=Step(of_cause[number], "all"),
            predicted_evidence=lambda penalty: 1.0,
            far=False,
        )
        return direction, few

    root: Any = SimpleNamespace(
        chi_square_on_few_lines=1000.0,
        chi_square=1000.0,
        misfit=base_misfit,
        model=SimpleNamespace(unknowns=[]),
        adequacy=SimpleNamespace(passed=False),
    )
    # The limit is 100 + 60 + 0.3 * 900 = 430.
    sizes = (100.0, 300.0, 350.0, 400.0, 429.0, 431.0, 900.0)
    pairs = [explored(number, size) for number, size in enumerate(sizes)]
    found = list(Search(Selection(root, 7.0), of_cause)._finish((), root, pairs))
    assert done == fitted
    assert [one.fit.chi_square for one in found] == list(sizes)


def test_a_far_variant_without_gain_is_listed_where_its_cause_has_no_other() -> None:
    fit = fit_of_right_model()
    leading, alone, both = (list(CATALOGUE.values())[i] for i in (slice(0, 4), 4, 5))

    def explored(cause: Cause, chi_square: float, *, far: bool) -> Any:
        step = Step(cause, "far" if far else "near")
        variant = SimpleNamespace(name=step.variant, model=fit.model)
        direction = SimpleNamespace(
            cause=cause, variant=variant, step=step, score=0.0, far=far, predicted_evidence=lambda penalty: -1.0
        )
        few = SimpleNamespace(
            chi_square=chi_square, misfit=1.0, evaluations=0, finish=lambda: fit, evaluate=lambda: fit
        )
        return direction, few

    pairs = [explored(one, 990.0, far=False) for one in leading]
    pairs += [explored(alone, 995.0, far=True), explored(both, 996.0, far=False), explored(both, 997.0, far=True)]
    fit.__dict__["chi_square_on_few_lines"] = 1000.0
    found = list(Search(Selection(fit, 7.0), [])._finish((), fit, pairs))
    assert sorted(one.steps[0].variant for one in found if one.ids == {alone.id}) == ["far"]
    assert sorted(one.steps[0].variant for one in found if one.ids == {both.id}) == ["near"]
    (predicted,) = [one for one in found if one.ids == {both.id}]
    assert predicted.adequacy is fit.adequacy


@pytest.mark.parametrize(
    ("misfits", "continued"),
    [
        # Nothing is adequate: every variant is continued.
        ([2.0, 2.1, 2.2, 2.3, 7.0, 9.0, 9.0, 9.0, 90.0, 9.0], [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        # Variant 4 is beyond the limit of 100 + 60 + 0.3 * 900 = 430, variant 5 is still worse than without a cause.
        # Of variants 6 and 7 screening predicts 1000 * (1 - 2800 / 5000) = 440 and 420. Variants 8 and 9 have no linear
        # effect: short fits are reliable up to a misfit of 20.
        ([1.0, 2.0, 3.0, 4.2, 7.0, 11.0, 7.0, 7.0, 20.1, 19.9], [0, 1, 2, 3, 5, 7, 9]),
    ],
)
def test_which_short_fits_are_continued(
    monkeypatch: pytest.MonkeyPatch, misfits: list[float], continued: list[int]
) -> None:
    done: list[int] = []
    of_cause = list(CATALOGUE.values())

    def start(number: int, starts: list[dict[str, float]], *, far: bool) -> Any:
        def go_on(further: list[dict[str, float]]) -> Any:
            assert further == [{"large": 1.0}, {"larger": 2.0}]
            done.append(number)
            return SimpleNamespace(chi_square=50.0, misfit=0.5, evaluations=25, ends=[0])

        assert starts == [{"near": 0.0}]
        assert far == (number >= 8)
        misfit = misfits[number]
        return SimpleNamespace(chi_square=100.0 * misfit, misfit=misfit, evaluations=8, ends=[0], go_on=go_on)

    monkeypatch.setattr("receptance.diagnosis.selection.explore", start)
    (variant, *_) = CATALOGUE["sensor_mass"].variants(MODEL)
    parameters = parameters_of(variant.model.unknowns)
    template: Any = Direction(CATALOGUE["sensor_mass"], variant, parameters, np.zeros((0, 0)), False, 0.0, {})
    scores = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2800.0, 2900.0, 0.0, 0.0)
    chosen: list[Any] = [
        replace(template, cause=cause, variant=replace(variant, model=number, far=number >= 8), score=score)
        for number, (cause, score) in enumerate(zip(of_cause, scores, strict=False))
    ]
    base: Any = SimpleNamespace(chi_square=5000.0, chi_square_on_few_lines=1000.0)
    search = Search(Selection(base, 7.0), of_cause)
    starts = [[[{"near": 0.0}], [{"large": 1.0}, {"larger": 2.0}]]] * len(chosen)
    found = list(search._explore("causes", [""] * len(chosen), chosen, starts, base))
    assert [chosen.index(one) for one, _ in found] == [*range(len(chosen)), *continued]
    assert done == continued
    assert search.selection.evaluations == 8 * len(chosen) + 17 * len(continued)


def test_far_variants_are_fitted_in_any_case() -> None:
    """Their derivatives at the fit without the cause do not exist."""
    fit = fit_of_right_model()
    spread = CATALOGUE["joint_spread"]
    found = directions(fit, [(spread, one) for one in spread.variants(fit.model)])
    far = [one for one in found if one.far]
    assert len(far) == 6
    assert not any(one.slopes.size for one in far)
    assert {one.typical_gain for one in far} == {None}
    chosen = rank(found, 6.0)
    assert set(far) < set(chosen)
    assert len(chosen) == len(far) + 3


def test_a_cause_is_predicted_from_its_near_variants_where_only_far_ones_are_fitted() -> None:
    """A far variant may be much worse than the fit without the cause, which the near ones contain."""
    search = Search(Selection(fit_of_right_model(), 6.0), list(CATALOGUE.values()))
    fitted: list[Direction] = []
    search._fit = lambda steps, root, chosen: iter(fitted.extend(chosen) or ())  # type: ignore[method-assign, func-returns-value]
    search.fit_singles()
    spread = [one.far for one in fitted if one.cause.id == "joint_spread"]
    assert spread == [True] * 6
    (found,) = [one for one in search.selection.explanations if one.ids == {"joint_spread"}]
    assert "whole insertion" not in found.steps[0].variant
    assert found.fit.chi_square == search.selection.base.chi_square


def test_a_far_variant_is_fitted_before_the_errors_of_tolerances(monkeypatch: pytest.MonkeyPatch) -> None:
    tolerances = tuple(
        Tolerance(name=f"{part} {field}", moves={f"{part}.segment[0].{field}": 0.02}, relative=True)
        for part in ("tool", "holder")
        for field in ("youngs_modulus", "density", "outer_diameter")
    )
    fit = fit_base(replace(MODEL, tolerances=tolerances))
    (whole, *_) = [one for one in CATALOGUE["joint_spread"].variants(fit.model) if one.far and "layer" in one.name]
    start = {
        **fit.values,
        "joint.k_y": 2.0 * fit.values["joint.k_y"],
        "joint.k_theta": 2.0 * fit.values["joint.k_theta"],
    }
    moving: list[tuple[str, ...]] = []
    fit_of_all = Problem.fit

    def fit_and_note(problem: Problem, starts: Any, *most: int, free: Any = None, **settings: Any) -> Any:
        names = problem.variables.names
        moving.append(tuple(n for i, n in enumerate(names) if free is None or free[i]))
        return fit_of_all(problem, starts, *most, free=free, **settings)

    monkeypatch.setattr(Problem, "fit", fit_and_note)
    far = explore(whole.model, [start], far=True)
    assert moving[0] == ("joint.k_y", "joint.k_theta")
    assert len(moving[1]) == 8
    assert far.chi_square < 1.2 * far.go_on([]).chi_square
    assert explore(whole.model, [start]).chi_square > far.chi_square


def test_fits_of_explanations_state_their_own_residuals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also fits of models that differ from the one without the cause where its size is null."""

    def evaluated(search: Search, steps: Any, root: Fit, direction: Direction) -> Explanation:
        assert not direction.far
        return search.selection.explain((*steps, direction.step), evaluate(direction.variant.model, root.values))

    monkeypatch.setattr(Search, "_predict", evaluated)
    selection = Selection(fit_of_right_model(), 6.0)
    names = ("joint_spread", "hammer_offset", "flexible_body", "collet_mass", "missing_mode")
    Search(selection, [CATALOGUE[name] for name in names], most=1).run()
    assert len(selection.explanations) > 3
    for one in selection.explanations:
        residual = one.fit.problem.residual(one.fit.x)
        assert residual @ residual == pytest.approx(one.fit.chi_square, rel=1e-9)


def test_an_evaluated_variant_is_not_worse_than_its_model_without_an_effect() -> None:
    root = fit_of_right_model()
    (direction, *_) = directions(root, [(CATALOGUE["sensor_mass"], CATALOGUE["sensor_mass"].variants(root.model)[0])])
    wrong = evaluate(direction.variant.model, {**root.values, **dict.fromkeys(direction.parameters, 0.1)})
    assert wrong.chi_square > root.chi_square + 100.0
    few: Any = SimpleNamespace(chi_square=0.0, misfit=1.0, evaluations=0, finish=lambda: wrong, evaluate=lambda: wrong)
    (found,) = Search(Selection(root, 7.0), [])._finish((), root, [(direction, few)])
    assert found.fit.chi_square == pytest.approx(root.chi_square, abs=1e-6)


def test_of_two_ends_the_better_one_on_all_lines_is_fitted_on(monkeypatch: pytest.MonkeyPatch) -> None:
    fit = fit_of_right_model()
    few = explore(fit.model, [fit.values]).go_on([])
    (end,) = few.ends
    away = end._replace(x=end.x + 0.5, cost=end.cost)
    begun: list[float] = []
    monkeypatch.setattr(
        "receptance.diagnosis.fitting.refit", lambda model, start, evaluations: begun.append(start["joint.k_y"])
    )
    for ends in ((end, away), (away, end)):
        replace(few, ends=ends).finish()
    # On few lines it is further behind than SAME_END.
    replace(few, ends=(away, end._replace(cost=end.cost + 0.6 * SAME_END))).finish()
    at, far = (few.problem.named(one.x)["joint.k_y"] for one in (end, away))
    assert begun == [at, at, far]


def test_alternatives_start_from_the_joint_of_the_best_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    base = fit_of_right_model()
    step = Step(CATALOGUE["sensor_mass"], CATALOGUE["sensor_mass"].variants(MODEL)[0].name)
    best = Explanation((step,), replace(fit_base(step.extend(base.model))), 0.0, 50.0)
    assert best.passed
    seen: list[Any] = []
    where = "receptance.diagnosis.selection.starts_of"
    monkeypatch.setattr(where, lambda direction, fit: [[{"near": 1.0}], [{"large": 2.0}, {"large": -2.0}]])
    monkeypatch.setattr(Search, "_explore", lambda self, *given: seen.extend(given[3]) or ())
    selection = Selection(base, 7.0, explanations=[best])
    Search(selection, []).fit_alternatives()
    joint = best.fit.values
    near, *large = {"near": 1.0}, {"large": 2.0}, {"large": -2.0}
    assert seen
    assert seen[0] == [[near], [*large, *({**one, **joint} for one in (near, *large))]]


def test_unfinished_fits_continue_where_they_may_be_reported() -> None:
    fit = fit_of_right_model()
    steps = [
        (Step(CATALOGUE[name], CATALOGUE[name].variants(MODEL)[0].name),) for name in ("sensor_mass", "time_delay")
    ]
    selection = Selection(fit, 6.0)
    for own, chi_square in zip(steps, (100.0, 105.0), strict=True):
        model = own[0].extend(fit.model)
        early = replace(fit_base(model), chi_square=chi_square, converged=False, evaluations=30, regained=2.0)
        selection.add(Explanation(own, early, 0.0, 50.0 - 0.1 * chi_square))
    far = Explanation((Step(CATALOGUE["tool_density"], "all"),), replace(fit, converged=False), 0.0, 15.0)
    selection.add(far)
    Search(selection, []).finish_best()
    assert [one.fit.converged for one in selection.explanations if one.steps != far.steps] == [True, True]
    assert all(
        one.fit.evaluations > 30 and one.fit.regained >= 2.0 for one in selection.explanations if one.fit.converged
    )
    assert selection.evaluations == sum(one.fit.evaluations - 30 for one in selection.explanations if one.fit.converged)
    assert far in selection.explanations


def fit_of_right_model() -> Any:
    rng = np.random.default_rng(5)
    noise = 0.01 * (rng.normal(size=(2, LINES.size)) + 1j * rng.normal(size=(2, LINES.size)))
    observations = [
        altered(one, receptance=one.receptance * np.exp(own))
        for one, own in zip(MODEL.observations, noise, strict=True)
    ]
    return fit_base(replace(MODEL, observations=tuple(observations)))


def test_a_predicted_variant_does_not_stand_beside_fitted_ones_of_its_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen: list[Direction] = []
    monkeypatch.setattr(Search, "_fit", lambda self, steps, root, some: iter(chosen.extend(some) or ()))
    selection = Selection(fit_of_right_model(), 6.0)
    Search(selection, list(CATALOGUE.values())).fit_singles()
    assert chosen
    assert selection.explanations
    near = {one.cause.id for one in chosen if not one.far}
    assert not near & {id for one in selection.explanations for id in one.ids}


def test_an_adequate_model_needs_no_fits_of_causes_without_effect() -> None:
    selection = Selection(fit_of_right_model(), 6.0)
    Search(selection, list(CATALOGUE.values())).fit_singles()
    assert len(selection.singles) >= 15
    assert not any(one.fit.evaluations for one in selection.singles)
    assert max(one.evidence for one in selection.singles) < selection.threshold - 10.0


@pytest.mark.parametrize(("effect", "is_small"), [("gain", True), ("another material", False)])
def test_variants_of_little_effect_are_fitted_only_where_effects_are_not_small(
    monkeypatch: pytest.MonkeyPatch, effect: str, is_small: bool
) -> None:
    """The linear effect of a gain explains the data, that of another material does not."""
    observations = []
    for one, overhang in zip(fit_of_right_model().model.observations, (0.05, 0.08), strict=True):
        factor: Any = 1.03
        if effect == "another material":
            factor = make_assembly(overhang, STEEL).receptance(LINES) / one.assembly.receptance(LINES)
        observations.append(altered(one, receptance=factor * one.receptance))
    calls: list[list[Direction]] = []
    monkeypatch.setattr(Search, "_fit", lambda self, steps, root, some: iter(calls.append(list(some)) or ()))
    selection = Selection(fit_base(replace(MODEL, observations=tuple(observations))), 6.0)
    assert not selection.base.adequacy.passed
    Search(selection, list(CATALOGUE.values())).fit_singles()
    ranked = rank([one for one in selection.directions if not one.far], 6.0)
    least = 0.1 * ranked[0].predicted_evidence(6.0)
    weak = {one.step for one in ranked if one.predicted_evidence(6.0) < least}
    assert len(weak) > 10
    left_out = {one.step for one in ranked} - {one.step for one in calls[0]}
    assert left_out <= weak
    # The best variants of four causes are fitted in any case.
    assert len(left_out) >= len(weak) - 4 if is_small else not left_out
    # Where no fit is adequate the predictions were wrong, and the others are fitted as well.
    assert {one.step for one in calls[-1]} == left_out if is_small else len(calls) == 1


def test_a_variant_without_a_linear_effect_is_fitted_in_any_case(monkeypatch: pytest.MonkeyPatch) -> None:
    """A parameter that shapes the effect of others has none of its own to first order."""
    chosen: list[Direction] = []
    monkeypatch.setattr(Search, "_fit", lambda self, steps, root, some: iter(chosen.extend(some) or ()))
    monkeypatch.setattr("receptance.diagnosis.selection.LEADING_CAUSES", 0)
    gain = CATALOGUE["calibration_gain"]
    shape = replace(gain, id="shape", parameters=tuple(replace(one, secondary=True) for one in gain.parameters))
    selection = Selection(fit_of_right_model(), 6.0)
    Search(selection, [*CATALOGUE.values(), shape]).fit_singles()
    assert selection.base.adequacy.passed
    assert {one.cause.id for one in chosen if not one.far} == {"shape"}


@pytest.mark.parametrize("second", [0.0, 9.0])
def test_a_further_effect_beside_an_adequate_cause_is_predicted(second: float) -> None:
    selection = Selection(fit_of_right_model(), 6.0)
    search = Search(selection, list(CATALOGUE.values()))
    search.fit_singles()
    gain, delay = (
        next(one for one in selection.directions if one.cause.id == id) for id in ("calibration_gain", "time_delay")
    )
    search._rest = sum(
        size * one.slopes[:, 0] / np.linalg.norm(one.slopes[:, 0]) for size, one in ((40.0, gain), (second, delay))
    )
    root = Explanation((gain.step,), selection.base, 0.0, 50.0)
    assert root.passed
    assert search._predicts_nothing_beside(root) == (second == 0.0)
    # From another minimum of the base predictions do not hold.
    search._rest = None
    assert not search._predicts_nothing_beside(root)


@pytest.mark.parametrize(("evidence", "is_fitted"), [(-20.0, False), (50.0, True)])
def test_look_alikes_of_a_cause_without_evidence_are_not_fitted(
    monkeypatch: pytest.MonkeyPatch, evidence: float, is_fitted: bool
) -> None:
    selection = Selection(fit_of_right_model(), 6.0)
    search = Search(selection, list(CATALOGUE.values()))
    search.fit_singles()
    sensor = next(one for one in selection.directions if one.cause.id == "sensor_mass")
    selection.explanations = [Explanation((sensor.step,), selection.base, 0.0, evidence)]
    seen: list[Any] = []
    monkeypatch.setattr(Search, "_fit_near", lambda self, best, chosen: seen.append(chosen))
    search.fit_look_alikes()
    assert bool(seen) == is_fitted


@pytest.mark.parametrize(("known", "continued"), [(np.inf, [0, 1, 2, 3, 4]), (100.0, [0, 1])])
def test_variants_far_behind_a_known_fit_are_not_continued(
    monkeypatch: pytest.MonkeyPatch, known: float, continued: list[int]
) -> None:
    """The limit is 100 + 60 + 0.3 * 900 = 430; without an adequate fit all go on."""
    done: list[int] = []

    def explored(number: int, chi_square: float) -> Any:
        few = SimpleNamespace(chi_square=chi_square, misfit=5.0, evaluations=0, ends=[0])
        few.go_on = lambda starts: done.append(number) or few
        return few

    sizes = (300.0, 420.0, 440.0, 600.0, 900.0)
    fits = [explored(number, size) for number, size in enumerate(sizes)]
    monkeypatch.setattr("receptance.diagnosis.selection.explore", lambda model, starts, *, far: fits[model])
    chosen = [
        Direction(
            cause, Variant("all", cast(Any, number)), {"size": cause.parameters[0]}, np.zeros((1, 1)), False, 0.0, {}
        )
        for number, cause in enumerate([one for one in CATALOGUE.values() if one.parameters][:5])
    ]
    root: Any = SimpleNamespace(chi_square_on_few_lines=1000.0, chi_square=1000.0)
    search = Search(Selection(root, 7.0), [])
    list(search._explore("alternatives", ["x"] * 5, chosen, [[[{}]]] * 5, root, known))
    assert done == continued


@pytest.mark.parametrize("plausible", [None, (1.0,), "ab", (5.0, 1.0), (float("nan"), 1.0)])
def test_a_plausible_range_is_two_numbers_in_order(plausible: Any) -> None:
    with pytest.raises(ValueError, match=r"Parameter 'mass': plausible is .*, expected two numbers, the smaller one"):
        Parameter(name="mass", unit="kg", lower=0.0, upper=1.0, typical=0.1, plausible=plausible)


def test_the_unknown_of_an_earlier_cause_is_no_size_of_another_one() -> None:
    (sensor, *_) = CATALOGUE["sensor_mass"].variants(MODEL)
    (gain, *_) = CATALOGUE["calibration_gain"].variants(sensor.model)
    values = {unknown.name: unknown.start for unknown in gain.model.unknowns} | {"sensor_mass.mass": 5.0}
    fit: Any = SimpleNamespace(model=gain.model, values=values)
    alone = Explanation((Step(CATALOGUE["calibration_gain"], gain.name),), fit, 1.0, 1.0)
    assert set(alone.parameters) == {"calibration_gain.log_gain"}
    assert alone.implausible == ()
    both = Explanation((Step(CATALOGUE["sensor_mass"], sensor.name), *alone.steps), fit, 1.0, 1.0)
    assert both.implausible == ("sensor_mass.mass",)
