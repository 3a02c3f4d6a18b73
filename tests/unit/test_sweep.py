"""Sweeps: candidates, outputs, results with labels."""

from __future__ import annotations

import os
import pickle
from typing import Any

import numpy as np
import pytest
from scipy import stats

from receptance import STEEL, Assembly, Observation, Part, PointJoint, Segment, damped_modes
from receptance.campaign.comparison import expected_misfit
from receptance.stability import Milling, stability_lobes
from receptance.sweep import (
    FrequencyResponse,
    Grid,
    Listed,
    Misfit,
    NaturalFrequencies,
    Reduction,
    Sampled,
    StableDepth,
    SweepError,
    as_grid,
    sweep,
)

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "11"))
LINES = np.linspace(200.0, 4000.0, 60)


def pair(length: float = 0.1) -> Assembly:
    tool = Segment(length=length, outer_diameter=0.02, material=STEEL)
    holder = Segment(length=0.12, outer_diameter=0.04, material=STEEL)
    joint = PointJoint(k_y=1e8, k_theta=1e5, c_y=100.0, c_theta=0.1, name="joint")
    return Assembly([Part([tool], name="tool"), joint, Part([holder], name="holder")])


GRID = Grid({"joint.k_y": np.geomspace(1e7, 1e9, 4), "tool.segment[0].length": [0.08, 0.1, 0.12]})


def largest(h: Any) -> Any:
    return np.abs(h).max(axis=1)


LARGEST = Reduction(largest, name="largest", version="1")


def test_last_grid_parameter_varies_fastest() -> None:
    found = as_grid(sweep(pair(), GRID, FrequencyResponse(frequency_hz=LINES)))
    assert found["receptance"].dims == ("joint.k_y", "tool.segment[0].length", "frequency_hz")
    for i, k_y in enumerate(GRID.axes[0]):
        for j, length in enumerate(GRID.axes[1]):
            one = pair().replace({"joint.k_y": k_y, "tool.segment[0].length": length}).receptance(LINES)
            np.testing.assert_allclose(found["receptance"].values[i, j], one, rtol=1e-9)
    np.testing.assert_array_equal(found["joint.k_y"].values, GRID.axes[0])
    np.testing.assert_array_equal(found["tool.segment[0].length"].values, GRID.axes[1])


def test_results_do_not_depend_on_blocks_and_threads() -> None:
    outputs = [FrequencyResponse(frequency_hz=LINES), NaturalFrequencies(upper_hz=9000.0)]
    several = [sweep(pair(), GRID, outputs, block=block, threads=n) for block, n in ((1, 1), (5, 2), (100, 1))]
    for other in several[1:]:
        for name in several[0].variables:
            np.testing.assert_array_equal(other[name].values, several[0][name].values)


def test_every_output_of_a_candidate_is_that_of_its_assembly() -> None:
    cut = Milling(teeth=2, k_t=6e8, k_n=2e8)
    speeds = np.linspace(5000.0, 20000.0, 7)
    outputs = [
        NaturalFrequencies(upper_hz=9000.0, modes=2),
        FrequencyResponse(frequency_hz=LINES, reduce=LARGEST, name="largest"),
        FrequencyResponse(frequency_hz=LINES, magnitude=True, name="magnitude"),
        StableDepth(cut=cut, frequency_hz=LINES, speeds_rpm=speeds),
        StableDepth(cut=cut, frequency_hz=LINES, name="least_depth"),
    ]
    found = sweep(pair(), Listed({"joint.k_theta": [3e4, 2e5]}), outputs)
    for i, k_theta in enumerate((3e4, 2e5)):
        one = pair().replace({"joint.k_theta": k_theta})
        h = one.receptance(LINES)
        np.testing.assert_allclose(found["natural_frequency"].values[i], one.natural_frequencies(9000.0)[:2], rtol=1e-9)
        np.testing.assert_allclose(found["largest"].values[i], np.abs(h).max(), rtol=1e-9)
        np.testing.assert_allclose(found["magnitude"].values[i], np.abs(h), rtol=1e-9)
        both = np.zeros((LINES.size, 2, 2), complex)
        both[:, 0, 0] = both[:, 1, 1] = h
        lobes = stability_lobes(cut, LINES, both, speeds_rpm=speeds)
        np.testing.assert_allclose(found["stable_depth"].values[i], lobes.depth, rtol=1e-8)
        assert found["least_depth"].values[i] <= found["stable_depth"].values[i].min() * (1.0 + 1e-9)


def test_misfit_is_twice_the_cost_of_identify() -> None:
    truth = pair()
    rng = np.random.default_rng(5)
    noise = 0.01 * (rng.standard_normal(60) + 1j * rng.standard_normal(60))
    frf = Observation(
        assembly=pair(),
        frequency_hz=LINES,
        receptance=truth.receptance(LINES) * np.exp(noise),
        standard_deviation=np.linspace(0.01, 0.02, 60),
    )
    modes = Observation.from_modes(
        assembly=pair(0.12), frequency_hz=pair(0.12).natural_frequencies(6000.0)[:2] * 1.001, standard_deviation_hz=2.0
    )
    values = Listed({"joint.k_theta": [5e4, 1e5], "joint.k_y": [2e8, 1e8]})
    found = sweep(truth, values, Misfit([frf, modes]))["misfit"].values
    for i in range(2):
        change = dict(zip(values.addresses, values.table[i], strict=True))
        h = pair().replace(change).receptance(LINES)
        lines = np.sum(np.abs(np.log(frf.receptance / h) / frf.standard_deviation) ** 2)
        f = pair(0.12).replace(change).natural_frequencies(6000.0)[:2]
        expected = lines + np.sum(((f - modes.frequency_hz) / 2.0) ** 2)
        np.testing.assert_allclose(found[i], expected, rtol=1e-9)
    assert found[1] < found[0]


def test_damping_ratios_count_in_the_misfit_and_in_its_expectation() -> None:
    """The misfit of noise is the number of measured values, and other damping ratios are another sweep."""

    def measured(ratio: float) -> Observation:
        return Observation.from_modes(
            assembly=pair(), frequency_hz=pair().natural_frequencies(2e4)[:2], standard_deviation_hz=1.0,
            damping_ratio=[ratio, np.nan], standard_deviation_damping=1e-3,
        )  # fmt: skip

    true = damped_modes(pair(), 2e4).damping_ratio[0]
    one, other = measured(0.01), measured(0.02)
    assert expected_misfit([one])[0] == 3.0
    for each in (one, other):
        assert each.damping_ratio is not None
        found = sweep(pair(), Listed({"joint.k_y": [1e8]}), Misfit(each))["misfit"].values[0]
        assert found == pytest.approx(((true - each.damping_ratio[0]) / 1e-3) ** 2, abs=1.0)
    assert str(Misfit(one).describe()) != str(Misfit(other).describe())


def test_invalid_candidates_are_marked_and_the_sweep_continues() -> None:
    found = sweep(
        pair(), Listed({"tool.segment[0].outer_diameter": [0.02, -0.02, 0.03]}),
        [FrequencyResponse(frequency_hz=LINES), NaturalFrequencies(upper_hz=5000.0)],
    )  # fmt: skip
    assert found["valid"].values.tolist() == [True, False, True]
    assert np.isnan(found["receptance"].values[1]).all()
    assert np.isnan(found["natural_frequency"].values[1]).all()
    assert np.isfinite(found["receptance"].values[[0, 2]]).all()


def test_several_assemblies_add_a_dimension() -> None:
    found = sweep(
        {"short": pair(0.08), "long": pair(0.12)},
        Listed({"joint.k_y": [1e8, 2e8]}),
        NaturalFrequencies(upper_hz=4000.0),
    )
    assert found["natural_frequency"].dims == ("candidate", "assembly", "mode")
    one = found["natural_frequency"].sel(assembly="long").values[1, 0]
    assert one == pytest.approx(pair(0.12).replace({"joint.k_y": 2e8}).natural_frequencies(4000.0)[0], rel=1e-12)


@pytest.mark.parametrize("method", ["random", "sobol", "latin hypercube"])
def test_draw_depends_only_on_seed_and_number(method: Any) -> None:
    print(f"seed {SEED}")
    seed = SEED
    distributions = {
        f"joint.{name}": stats.loguniform(1.0, 100.0) for name in ("k_y", "k_theta", "c_y", "c_theta", "a")
    }
    drawn = Sampled(distributions, count=4096, seed=seed, method=method)
    whole = drawn.values(0, 4096)
    for start, stop in ((0, 1), (1, 2), (17, 1000), (4095, 4096)):
        np.testing.assert_array_equal(drawn.values(start, stop), whole[start:stop])
    again = pickle.loads(pickle.dumps(drawn))
    np.testing.assert_array_equal(again.values(100, 200), whole[100:200])
    assert whole.min() >= 1.0
    assert whole.max() <= 100.0
    shares = stats.loguniform(1.0, 100.0).cdf(whole)
    # Five columns of 4096 draws: the share of chance is 1e-6 each.
    assert all(stats.kstest(column, "uniform").pvalue > 1e-6 for column in shares.T)
    assert abs(np.corrcoef(shares.T)[np.triu_indices(5, 1)]).max() < 0.1
    other = Sampled(distributions, count=4096, seed=seed + 1, method=method)
    assert not np.array_equal(other.values(0, 10), whole[:10])


def test_a_latin_hypercube_has_one_candidate_in_each_interval_of_every_parameter() -> None:
    distributions = {"joint.k_y": stats.loguniform(1e7, 1e9), "joint.k_theta": stats.norm(1e5, 1e3)}
    drawn = Sampled(distributions, count=1000, seed=7, method="latin hypercube")
    for one, column in zip(distributions.values(), drawn.values(0, 1000).T, strict=True):
        assert np.array_equal(np.sort(np.floor(1000.0 * one.cdf(column))), np.arange(1000.0))
    found = sweep(pair(), drawn, NaturalFrequencies(upper_hz=4000.0, modes=1), block=300)
    np.testing.assert_array_equal(found["joint.k_y"].values, drawn.values(0, 1000)[:, 0])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sweep(pair(), Grid({"joint.k_z": [1.0]}), NaturalFrequencies(upper_hz=1e3)), "joint.k_z"),
        (lambda: sweep(pair(), GRID, []), "outputs is empty"),
        (lambda: sweep(pair(), GRID, [NaturalFrequencies(upper_hz=1e3)] * 2), "twice"),
        (lambda: sweep(pair(), {"joint.k_y": [1.0]}, NaturalFrequencies(upper_hz=1e3)), "Grid"),  # type: ignore[arg-type]
        (lambda: sweep(pair(), GRID, NaturalFrequencies(upper_hz=1e3), block=0), "block is 0"),
        (lambda: Grid({}), "expected values by address"),
        (lambda: Grid({"joint.k_y": [1.0, np.nan]}), r"joint.k_y\[1\] is nan"),
        (lambda: Listed({"a": [1.0], "b": [1.0, 2.0]}), "different numbers"),
        (lambda: Sampled({"a": 3.0}, count=1, seed=0), "expected a distribution"),  # type: ignore[dict-item]
        (lambda: NaturalFrequencies(upper_hz=-1.0), "upper_hz"),
        (lambda: StableDepth(cut=3, frequency_hz=LINES), "expected Milling"),  # type: ignore[arg-type]
        (
            lambda: sweep(
                pair(),
                GRID,
                FrequencyResponse(frequency_hz=LINES, reduce=Reduction(np.abs, name="modulus", version="1")),
            ),
            "reduce returned",
        ),
        (
            lambda: FrequencyResponse(frequency_hz=LINES, reduce=largest),  # type: ignore[arg-type]
            r"expected Reduction\(function, name=..., version=...\)",
        ),
        (lambda: Reduction(largest, name="a", version=2), "Reduction: version is 2, expected text"),  # type: ignore[arg-type]
        (lambda: type("Own", (NaturalFrequencies,), {}), "the output Own: version is None, expected text"),
    ],
)
def test_mistakes_give_messages(make: Any, words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        make()


def test_results_too_large_for_memory_are_refused_before_any_work() -> None:
    many = Sampled({"joint.k_y": stats.loguniform(1e7, 1e9)}, count=10**7, seed=0)
    with pytest.raises(SweepError, match="give store="):
        sweep(pair(), many, FrequencyResponse(frequency_hz=LINES), progress=pytest.fail)


def test_progress_is_reported_after_each_block() -> None:
    reported: list[Any] = []
    sweep(pair(), GRID, NaturalFrequencies(upper_hz=2e3), block=5, progress=reported.append)
    assert [one.done for one in reported] == [5, 10, 12]
    assert reported[-1].remaining_seconds == 0.0
