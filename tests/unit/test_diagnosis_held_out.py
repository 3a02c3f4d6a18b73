"""Held-out data: distances, natural frequencies, log scores, custom metrics."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize, stats

from blank_in_holder import STARTED as JOINT
from blank_in_holder import make_assembly as in_holder
from blank_in_holder import observe
from receptance import STEEL, Assembly, Observation, PointMass
from receptance.diagnosis import HeldOut, Model, diagnose
from receptance.diagnosis.fitting import refit
from receptance.diagnosis.held_out import (
    FREQUENCIES,
    SCORE,
    SPECTRAL,
    Fold,
    Gain,
    Prediction,
    doubt_prediction,
    gain_of,
    predict,
)
from receptance.diagnosis.prediction import predicted_data
from receptance.fit import Move, Tolerance
from receptance.fit.observation import altered
from variant_of_cause import extended_by

LINES = np.linspace(200.0, 6000.0, 300)
LENGTH = "tool.segment[0].length"


def make_assembly(overhang: float, density: float = 1.0, masses: Sequence[PointMass] = ()) -> Assembly:
    return in_holder(overhang, *masses, material=replace(STEEL, density=density * STEEL.density))


def make_observations(
    overhang: float, density: float = 1.0, seed: int = 1, factor: float | np.ndarray = 1.0
) -> Observation:
    true = factor * make_assembly(overhang, density).receptance(LINES)
    return observe(make_assembly(overhang), LINES, true, np.random.default_rng(seed), f"{overhang}")


def clamping(*overhangs: float) -> tuple[Tolerance, ...]:
    return tuple(
        Tolerance(name=f"clamping {x}", moves={"tool.segment[0].length": 5e-5}, configurations=f"{x}")
        for x in overhangs
    )


def test_gains_in_all_metrics_and_a_custom_metric() -> None:
    """A heavier blank: all metrics improve, and a metric receives the structure and the prediction."""
    data: list[HeldOut] = []

    def first_peak(one: HeldOut) -> float:
        data.append(one)
        return float(
            abs(
                one.assembly.natural_frequencies(6000.0)[0] / make_assembly(0.1, 1.08).natural_frequencies(6e3)[0] - 1.0
            )
        )

    verdict = diagnose(
        [make_observations(x, 1.08) for x in (0.06, 0.08, 0.1)],
        JOINT,
        tolerances=clamping(0.06, 0.08, 0.1),
        causes=["tool_density", "calibration_gain"],
        max_causes=1,
        held_out=True,
        metrics={"first peak": first_peak},
    )
    gains = {one.metric: one for one in verdict.gains}
    assert list(gains) == [SPECTRAL, FREQUENCIES, SCORE, "first peak"]
    for name in (SPECTRAL, FREQUENCIES):
        assert gains[name].held_out_after < 0.5 * gains[name].held_out_before
    # Each line was measured to one per cent in both parts of its logarithm.
    assert gains[SPECTRAL].held_out_after == pytest.approx(0.01 * math.sqrt(2.0), rel=0.15)
    assert gains[SCORE].held_out_after > gains[SCORE].held_out_before + 100.0
    assert verdict.gain is verdict.gains[0]
    assert [fold["causes"] for fold in gains[SCORE].folds] == [["tool_density"]] * 3
    assert data[0].receptance is not None
    assert data[0].receptance.shape == LINES.shape
    reported = json.loads(json.dumps(verdict.to_dict(), allow_nan=False))
    assert [one["metric"] for one in reported["gains"]] == list(gains)
    assert reported["gain"]["held_out_after"] == reported["gains"][0]["held_out_after"]


def test_the_log_score_is_the_density_of_a_linear_model() -> None:
    """Against the Gaussian of the data themselves, where the model is so nearly linear that there is one."""
    tolerances = (Tolerance(name="blank", moves={"tool.segment[*].density": 1e-4}, relative=True),)
    fitted = Observation.from_modes(
        assembly=make_assembly(0.06),
        frequency_hz=make_assembly(0.06).natural_frequencies(9000.0)[:2],
        standard_deviation_hz=0.2,
        label="0.06",
    )
    fit = refit(Model((fitted,), tuple(JOINT[:2]), tolerances), {"joint.k_y": 6e8, "joint.k_theta": 1e5})
    other = Observation.from_modes(
        assembly=make_assembly(0.08),
        frequency_hz=make_assembly(0.08).natural_frequencies(9000.0)[:2] * np.array([1.0001, 0.9999]),
        standard_deviation_hz=[0.3, 0.4],
        label="0.08",
    )
    data = predicted_data(fit, Model((other,), tuple(JOINT[:2]), (*tolerances, *clamping(0.08))))
    problem, start = data.problem(), data.start
    rows, root = np.split(problem.jacobian(start), [2])
    jacobian = rows * np.array([[0.3], [0.4]])
    off = problem.residual(start)[:2] * np.array([0.3, 0.4])
    covariance = np.diag([0.09, 0.16]) + jacobian @ np.linalg.inv(root.T @ root) @ jacobian.T
    expected = -0.5 * (off @ np.linalg.solve(covariance, off) + np.linalg.slogdet(2.0 * np.pi * covariance)[1])
    score = data.log_score(data.fit(100, 0.0, all_variables=True))
    assert score == pytest.approx(expected, abs=0.02)
    assert start.size == fit.x.size + 1, "the clamping is a new error, the blank is not"


def test_individual_errors_are_fitted_before_and_after() -> None:
    """A clamping that is off by two standard deviations is no error of the prediction."""
    model = Model((make_observations(0.06), make_observations(0.08, seed=2)), tuple(JOINT))
    fit = refit(model, {})
    off = make_observations(0.1001, seed=3)
    off = Observation(
        assembly=make_assembly(0.1), frequency_hz=LINES, receptance=off.receptance, standard_deviation=0.01, label="0.1"
    )
    without = predict(fit, Model((off,), tuple(JOINT))).metrics
    with_error = predict(fit, Model((off,), tuple(JOINT), clamping(0.1))).metrics
    assert with_error[SPECTRAL] < 0.7 * without[SPECTRAL]
    assert with_error[SCORE] > without[SCORE] + 100.0


def test_errors_far_from_the_model_are_fitted_to_the_end() -> None:
    """A forgotten mass of 3 g, which only the length of that tool can imitate: the best length by a plain search."""
    model = Model((make_observations(0.06), make_observations(0.08, seed=2)), tuple(JOINT))
    fit, deviation = refit(model, {}), 5e-4
    measured = make_assembly(0.1, masses=[PointMass(mass=3e-3)]).receptance(LINES)
    off = observe(make_assembly(0.1), LINES, measured, np.random.default_rng(3), "0.1")
    clamping_error = Tolerance(name="clamping", moves={LENGTH: deviation}, configurations="0.1")

    def logarithms(error: float) -> np.ndarray:
        there = make_assembly(0.1 + deviation * error).replace(fit.values)
        return np.log(off.receptance / there.receptance(LINES))

    def cost(error: float) -> float:
        return float(np.sum(np.square(np.abs(logarithms(error)) / off.standard_deviation)) + error**2)

    errors = np.linspace(-20.0, 20.0, 401)
    best = errors[np.argmin([cost(error) for error in errors])]
    best = optimize.minimize_scalar(cost, bounds=(best - 0.2, best + 0.2), method="bounded").x
    expected = math.sqrt(np.mean(np.square(np.abs(logarithms(best)))))
    predicted = predict(fit, Model((off,), tuple(JOINT), (clamping_error,)))
    assert predicted.metrics[SPECTRAL] == pytest.approx(expected, rel=1e-3)


def test_natural_frequencies_alone_and_a_held_out_gain() -> None:
    model = Model((make_observations(0.06, factor=1.05), make_observations(0.08, seed=2, factor=1.05)), tuple(JOINT))
    base, fit = refit(model, {}), refit(extended_by(model, "calibration_gain", "all"), {})
    other = Model((make_observations(0.1, seed=3, factor=1.05),), tuple(JOINT))
    before, after = (predict(one, other).metrics for one in (base, fit))
    assert after[SPECTRAL] == pytest.approx(0.01 * math.sqrt(2.0), rel=0.15)
    assert before[SPECTRAL] > 2.0 * after[SPECTRAL]
    assert abs(before[FREQUENCIES] - after[FREQUENCIES]) < 0.05


def test_prediction_without_a_model_is_missing() -> None:
    """An extension that gives an impossible overhang, as a cause named in one fold may do."""
    model = Model(
        (make_observations(0.08),), (*JOINT, Move(address="longer", lower=-0.1, upper=0.1, moves={LENGTH: 1.0}))
    )
    fit = refit(model, {"longer": 0.0})
    far = replace(fit, x=np.append(fit.x[:-1], -0.09))
    assert predict(far, Model((make_observations(0.06),), model.unknowns)) == Prediction()


def folds(*pairs: tuple[float, float]) -> list[Fold]:
    """Return folds of one unit each."""

    def units(value: float) -> Prediction:
        return Prediction({SPECTRAL: np.array([[100.0 * value**2, 100.0]]), SCORE: np.array([[value, 1.0]])})

    return [Fold(f"{i}", "named", (), units(b), units(a)) for i, (b, a) in enumerate(pairs)]


def test_intervals() -> None:
    better = gain_of(SPECTRAL, folds((1.0, 0.5), (1.1, 0.6), (0.9, 0.4)))
    assert better is not None
    assert 0.0 < better.interval[0] < 0.5 < better.interval[1]
    assert (better.units, better.correlation, better.better) == (3, 0.0, 3)
    assert [(one["before"], one["after"]) for one in better.folds] == [(1.0, 0.5), (1.1, 0.6), (0.9, 0.4)]
    score = gain_of(SCORE, folds((-100.0, -50.0), (-110.0, -62.0), (-90.0, -41.0)))
    assert score is not None
    assert 40.0 < score.interval[0] < 49.0 < score.interval[1] < 60.0
    # The jackknife of a mean is the interval of the mean.
    found = np.array([50.0, 48.0, 49.0])
    half_width = 4.3027 * np.std(found, ddof=1) / np.sqrt(3.0)
    np.testing.assert_allclose(score.interval, [49.0 - half_width, 49.0 + half_width], rtol=1e-4)
    nothing = gain_of(SPECTRAL, folds((1.0, 1.0), (2.0, 2.0)))
    assert nothing is not None
    assert nothing.interval == (0.0, 0.0)
    alone = gain_of(SPECTRAL, folds((1.0, 0.5)))
    assert alone is not None
    assert alone.interval == (-math.inf, math.inf)
    assert gain_of("else", folds((1.0, 0.5))) is None


def test_intervals_of_units_in_folds() -> None:
    """Means of a user-defined metric: with and without a correlation of the units of one fold."""

    def found(differences: np.ndarray) -> Gain:
        table = [
            Fold(f"{i}", "named", (), Prediction({"own": np.column_stack([3.0 + d, np.ones(d.size)])}), after)
            for i, d in enumerate(differences)
        ]
        gain = gain_of("own", table)
        assert gain is not None
        assert gain.held_out_before - gain.held_out_after == pytest.approx(np.mean(differences))
        assert np.mean(gain.interval) == pytest.approx(np.mean(differences))
        return gain

    after = Prediction({"own": np.array([[3.0, 1.0]] * 3)})
    alone = np.array([[0.4, 0.5, 0.6], [0.6, 0.4, 0.5], [0.5, 0.6, 0.4]])
    # No differences between folds: the variance within them, with eight degrees of freedom.
    gain = found(alone)
    assert (gain.units, gain.unit, gain.correlation) == (9, "records", 0.0)
    assert np.diff(gain.interval) == pytest.approx(2.0 * 2.3060 * 0.1 / 3.0, rel=1e-3)
    # Folds that differ and nothing within: three values, two degrees of freedom.
    gain = found(np.array([[0.4] * 3, [0.5] * 3, [0.6] * 3]))
    assert gain.correlation == pytest.approx(1.0)
    assert np.diff(gain.interval) == pytest.approx(2.0 * 4.3027 * 0.1 / math.sqrt(3.0), rel=1e-3)
    # Mean squares of 0.06 between and 0.01 within the folds.
    gain = found(alone + np.sqrt(0.02) * np.array([[-1.0], [0.0], [1.0]]))
    assert gain.correlation == pytest.approx((0.06 - 0.01) / (0.06 + 2.0 * 0.01))
    effective = 9.0 / (1.0 + 2.0 * gain.correlation)
    half_width = stats.t.ppf(0.975, effective - 1.0) * math.sqrt(0.06 / 9.0)
    assert np.diff(gain.interval) == pytest.approx(2.0 * half_width)


def materials(tool: float, density: float) -> list[Tolerance]:
    """Return relative tolerances of modulus and density of both parts."""
    return [
        Tolerance(name=f"{part} {field}", moves={f"{part}.segment[*].{field}": deviation}, relative=True)
        for part in ("tool", "holder")
        for field, deviation in (("youngs_modulus", tool), ("density", density))
    ]


def test_a_cause_that_predicts_no_better_is_suspected_only() -> None:
    """The frequency axis is 0.8 % off, which a gain imitates beside the tolerances."""
    rng = np.random.default_rng(1)
    overhangs = (0.05, 0.07, 0.09)
    data = [
        Observation(
            assembly=make_assembly(x),
            frequency_hz=LINES,
            receptance=make_assembly(x).receptance(1.008 * LINES)
            * np.exp(0.03 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))),
            standard_deviation=0.03,
            label=f"{x}",
        )
        for x in overhangs
    ]
    tolerances = [*materials(0.01, 0.003), *clamping(*overhangs)]
    causes = ["calibration_gain", "sensor_mass", "joint_cross_term"]
    assert diagnose(data, JOINT, tolerances=tolerances, causes=causes, max_causes=1).verdict == "named"
    verdict = diagnose(data, JOINT, tolerances=tolerances, causes=causes, max_causes=1, held_out=True)
    assert verdict.gain is not None
    assert verdict.gain.held_out_after > verdict.gain.held_out_before
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("suspected", ["calibration_gain"])
    (doubt,) = [reason for reason in verdict.reasons if reason.code == "not_better"]
    assert doubt.values["metric"] == SPECTRAL
    assert (doubt.values["before"], doubt.values["after"]) == (
        verdict.gain.held_out_before,
        verdict.gain.held_out_after,
    )


def test_a_forgotten_sensor_is_named_and_the_interval_of_the_improvement_excludes_zero() -> None:
    overhangs = (0.06, 0.08, 0.1)
    sensor = [PointMass(mass=1e-3)]
    data = [
        make_observations(x, seed=i, factor=make_assembly(x, 1.0, sensor).receptance(LINES) / plain.receptance(LINES))
        for i, (x, plain) in enumerate((x, make_assembly(x)) for x in overhangs)
    ]
    tolerances = [*materials(0.01, 0.005), *clamping(*overhangs)]
    causes = ["sensor_mass", "calibration_gain"]
    verdict = diagnose(data, JOINT, tolerances=tolerances, causes=causes, max_causes=1, held_out=True)
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["sensor_mass"])
    assert verdict.gain is not None
    assert verdict.gain.units > 3
    assert 0.0 < verdict.gain.interval[0] < verdict.gain.held_out_before - verdict.gain.held_out_after
    correlation = f"{verdict.gain.correlation:.2f}"
    assert f"from {verdict.gain.units} modes with a correlation of {correlation} within a fold" in verdict.summary(1000)


@pytest.mark.parametrize("where", [None, 1], ids=["in all", "in one"])
def test_a_cause_that_predicts_better_or_acts_in_one_configuration_is_named(where: int | None) -> None:
    """A gain in one configuration cannot improve the prediction of another one."""
    data = [make_observations(x, seed=i) for i, x in enumerate((0.06, 0.08, 0.1))]
    data = [
        altered(one, receptance=one.receptance * (1.06 if where in (None, i) else 1.0)) for i, one in enumerate(data)
    ]
    tolerances = [*materials(0.01, 0.005), *clamping(0.06, 0.08, 0.1)]
    verdict = diagnose(
        data, JOINT, tolerances=tolerances, causes=["calibration_gain", "sensor_mass"], max_causes=1, held_out=True
    )
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["calibration_gain"])
    assert verdict.causes[0].variant == ("all" if where is None else f"configuration {data[where].label}")
    assert verdict.explanation is not None
    assert verdict.gain is not None
    # Had the prediction become worse, or had no fold the cause:
    for after, code in ((0.06, "not_better"), (0.05, "not_predicted")):
        fold = {"configuration": "0.06", "verdict": "named", "causes": [], "before": 0.05, "after": after}
        gain = replace(verdict.gain, held_out_before=0.05, held_out_after=after, folds=(fold,))
        doubt = doubt_prediction(verdict.selection.base, verdict.explanation, gain)
        assert (None if doubt is None else doubt.code) == (code if where is None else None)


def test_an_interruption_while_a_fold_is_predicted_keeps_the_results() -> None:
    data = [make_observations(x, seed=i) for i, x in enumerate((0.06, 0.08, 0.1))]
    predicted: list[str] = []

    def interrupting(held_out: HeldOut) -> float:
        predicted.append(held_out.observation.label)
        if len(predicted) > 1:
            raise KeyboardInterrupt
        return 1.0

    verdict = diagnose(data, JOINT, causes=["sensor_mass"], held_out=True, metrics={"interrupting": interrupting})
    assert (verdict.verdict, verdict.final) == ("adequate", False)
    assert [fold["configuration"] for fold in verdict.gains[-1].folds] == predicted[:1]


def test_bad_metrics() -> None:
    with pytest.raises(TypeError, match="expected a name and a function"):
        diagnose([make_observations(0.06)], JOINT, metrics={"depth": 3.0})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="exists already"):
        diagnose([make_observations(0.06)], JOINT, metrics={SCORE: lambda one: 0.0})
