"""The core against the reference of fifty and more digits; `accuracy` states the rule, the summary what was reached."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import pytest

from oracle import draw, exact, tables
from oracle.resonance import ENDS, Ends, cutoff, resonance_above
from oracle.tables import Tables, make, segment
from receptance import _core
from validation import accuracy, plain_formulations
from validation.accuracy import DRIVE, INNER, TRANSFER, Report

FRESH_CASES = 40
QUICK_CASES = 100
SLOW_CASES = 400
"""Models of the fast part: enough for every kind and every column; `accuracy_report.py` takes any number."""
BOUNDS = {TRANSFER: 1e-6, INNER: 1e-5}
"""The entries that are not drive points at the ends. Of two reciprocal entries one is right; the other's way back
from the root can cancel where a part is very light or very soft for its frequency."""

MOST_OVER = 20.0
"""How many times what is allowed the one drive-point line of a fresh seed may be off."""
ONCE_WRONG = {2666582922: [30], 777001: [1349], 777002: [1987], 888001: [139, 1118]}
"""Models by seed that broke the rule when they were first drawn."""

REFERENCE_BEAMS = {
    "steel": (segment(0, 1, 0.125, 0.010, (200e9, 7800.0, 0.29)), (2837.30, 7597.40, 14325.63, 22605.17)),
    "carbide": (segment(0, 1, 0.120, 0.020, (580e9, 14500.0, 0.24)), (7318.47, 18268.10, 32037.50, 47216.83)),
    "tube": (
        segment(0, 1, 0.100, 0.050, (210e9, 7850.0, 0.3), inner_diameter=0.020),
        (15830.80, 26338.44, 38263.16, 38945.42),
    ),
}
POINTS = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]])
Summarise = Callable[[str, str, object], None]


def assert_rule(report: Report, *, rare: bool = False) -> None:
    """Every entry at both ends, and of the others nearly all, none of them far off.

    The base seed served in development, so its clean record is no estimate. On a new seed, `rare`
    allows one line a little over: of 18,000 models on nine such seeds no drive point was, one derivative line in some
    thousand is. Inner nodes and transfer derivatives are counted by models: what takes the digits of one line of a
    model takes those of its others as well.
    """
    where = f"seed {report.seed} (accuracy_report.py --seed {report.seed} --cases {report.cases} repeats this)\n"
    assert not report.refused, where + "\n".join(report.refused)
    for name, tally in report.rows():
        if name.endswith(DRIVE):
            assert tally.lines_over <= (1 if rare else 0), f"{name}, {where}" + "\n".join(tally.offenders)
            # A derivative that nearly vanishes between y and theta may be off by far more than its allowance.
            most = 1.0 if not rare else MOST_OVER if name.startswith("receptance") else np.inf
            assert tally.worst_ratio <= most, f"{name}, {where}" + "\n".join(tally.offenders)
    for place, bound in BOUNDS.items():
        tally = report.receptance[place]
        allowed = 1 + int(0.002 * tally.lines)
        assert len(tally.models_over) <= allowed, f"{place}, {where}" + "\n".join(tally.offenders)
        assert tally.worst_over <= bound, f"{place}, {where}" + "\n".join(tally.offenders)
    slope = report.derivative[TRANSFER]
    assert len(slope.models_over) <= 1 + int(0.002 * slope.lines), where + "\n".join(slope.offenders)


@pytest.fixture(scope="module", params=[QUICK_CASES, pytest.param(SLOW_CASES, marks=pytest.mark.slow)])
def report(request: pytest.FixtureRequest, summarise: Summarise) -> Report:
    found = accuracy.run(accuracy.base_seed(), request.param)
    summarise("accuracy", found.text(), found.as_json())
    return found


def test_random_models_meet_the_accuracy_rule(report: Report) -> None:
    assert_rule(report)


def test_draw_covers_every_kind_and_column(report: Report) -> None:
    kinds = set(report.receptance[DRIVE].worst_ratio_by_kind)
    assert kinds >= {
        "chain",
        "single",
        "cutoff",
        "wire",
        "short",
        "tree",
        "free-free",
        "clamped-free",
        "clamped-clamped",
    }
    everything = {
        (table, column)
        for table, columns in enumerate(tables.COLUMNS)
        for column in range(len(columns))
        if tables.is_continuous(table, column)
    }
    assert report.parameters == everything
    assert report.receptance[DRIVE].lines > 2 * report.cases


@pytest.mark.parametrize("seed", ONCE_WRONG)
def test_former_failures_of_the_accuracy_rule(seed: int) -> None:
    """A wire on a block at its free resonance, a mass beside a coupled spring, a ring far above its cut-off."""
    assert_rule(accuracy.run(seed, 2000, ONCE_WRONG[seed]), rare=True)


def test_random_models_of_a_new_seed_meet_the_accuracy_rule(summarise: Summarise) -> None:
    seed = int.from_bytes(os.urandom(4), "little")
    print(f"fresh seed {seed}")
    found = accuracy.run(seed, FRESH_CASES)
    summarise("accuracy, fresh seed", found.text(), found.as_json())
    assert_rule(found, rare=True)


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("beam", list(REFERENCE_BEAMS))
def test_resonances_of_lossless_segments(beam: str, ends: Ends) -> None:
    """At the float64 nearest to a resonance, where a free or a clamped description has a pole, and beside it."""
    model = make([REFERENCE_BEAMS[beam][0]])
    rng = np.random.default_rng(accuracy.base_seed())
    w, found = 2 * np.pi * 500.0, []
    for _ in range(4):
        root = resonance_above(model.segments[0], w, ends, 2 * np.pi * 200e3)
        assert root is not None
        found.append(root)
        w = root * (1 + 1e-6)
    if ends == "free-free":
        np.testing.assert_allclose(np.array(found) / (2 * np.pi), REFERENCE_BEAMS[beam][1], rtol=0, atol=0.01)
    lines = np.unique([w * (1 + d) for w in found for d in (0.0, 1e-15, -1e-15, 1e-12, -1e-9, 1e-6)])
    assert_lines(model, lines, rng)


@pytest.mark.parametrize("beam", list(REFERENCE_BEAMS))
@pytest.mark.parametrize("loss", [0.0, 0.01])
def test_exactly_at_and_around_the_cut_off(beam: str, loss: float) -> None:
    row = list(REFERENCE_BEAMS[beam][0])
    row[8] = loss
    model = make([row])
    turning = cutoff(model.segments[0])
    steps = [0.0, *(sign * 10.0**-power for power in range(1, 16) for sign in (1.0, -1.0))]
    lines = np.unique([turning * (1 + step) for step in steps])
    assert turning in lines
    assert_lines(model, lines, np.random.default_rng(accuracy.base_seed()))


def test_exactly_zero_wave_number() -> None:
    """With these constants S/r is 16 exactly, so the cut-off is hit and not only approached."""
    model = make([segment(0, 1, 2.0, 1.0, (7.0, 3.0, 0.0))])
    assert cutoff(model.segments[0]) == 4.0
    assert_lines(model, np.array([4.0]), np.random.default_rng(accuracy.base_seed()))


def assert_lines(model: Tables, lines: np.ndarray, rng: np.random.Generator) -> None:
    """Every entry at both ends of one segment, transfer too, without exceptions."""
    h, _ = _core.Model(0, *model).receptance(_core.Lines(lines.astype(complex)), POINTS, POINTS, np.zeros((0, 3)), 1)
    assert np.all(np.isfinite(h))
    for w, found in zip(lines, h, strict=True):
        error, allowed = accuracy.receptance_errors(model, w, found, POINTS, rng)
        assert np.all(error <= allowed), f"{w / (2 * np.pi)!r} Hz: {np.max(error / allowed):.3g} of what is allowed"


def test_whole_branches_by_their_series(summarise: Summarise) -> None:
    """Many lines are taken by one series a branch, which the few lines of a model above are not."""
    seed = accuracy.base_seed()
    alone = np.array([[0.0, 0.0]])
    shares = []
    for number in range(160):
        rng = np.random.default_rng([seed, number])
        case = draw.case(rng)
        ends = np.array([[0.0, 0.0], [0.0, 1.0]])
        few, many = (
            _core.Model(0, *case.tables).receptance(_core.Lines(w), ends, ends, np.zeros((0, 3)), 1)[0]
            for w in (case.w, np.resize(case.w, 300))
        )
        if np.array_equal(few, many[: len(few)]):
            continue  # no series applies here
        one = _core.Model(0, *case.tables).receptance(
            _core.Lines(np.resize(case.w, 300)), alone, alone, np.zeros((0, 3)), 1
        )[0]
        np.testing.assert_allclose(one[:, 0, 0], many[:, 0, 0], rtol=1e-13)
        for w, found in zip(case.w, many, strict=False):
            error, allowed = accuracy.receptance_errors(case.tables, w, found, ends, rng)
            assert np.all(error <= allowed), f"seed {seed}, model {number}: {case.label}"
            shares.append(float(np.max(error / allowed)))
    assert len(shares) > 100
    text = f"{len(shares)} lines by series of whole branches, largest share of what is allowed {max(shares):.2g}"
    summarise("branches", text, {"lines": len(shares), "largest_share": max(shares)})


@pytest.mark.parametrize("chains", [10, pytest.param(plain_formulations.DEFAULT_CHAINS, marks=pytest.mark.slow)])
def test_core_is_more_accurate_than_textbook_formulations(chains: int, summarise: Summarise) -> None:
    """Evidence for the pivoted impedance of the core, with a check of the comparison."""
    found = plain_formulations.compare(accuracy.base_seed(), chains)
    summarise("formulations", found.text(), found.as_json())
    coupling, stiffness, core = (np.array(found.share[name]) for name in plain_formulations.FORMULATIONS)
    low = [high <= 100.0 for _, high in plain_formulations.DECADES_HZ]
    assert np.all(core == 1.0)
    assert np.mean(1.0 - coupling[low]) > 0.1
    assert np.mean(1.0 - stiffness[low]) > 0.1
    # The same closed forms, so all three agree without cancellation.
    assert coupling[-1] > 0.5
    assert stiffness[-1] > 0.5


STIFF = [(1e6, 1e20), (1e6, 1e30), (1e6, 1e40), (1e30, 1e3), (1e40, 1e38)]
"""Stiffnesses in y and in theta, one far above the other or both far above the parts."""


@pytest.mark.parametrize("element", ["joint", "ground"])
@pytest.mark.parametrize("correlation", [0.5, -0.9])
@pytest.mark.parametrize(("k_y", "k_theta"), STIFF)
def test_coupling_beside_a_stiff_direction_keeps_the_digits(
    element: str, correlation: float, k_y: float, k_theta: float
) -> None:
    """The centre of such a spring lies up to 1e17 m beyond its node."""
    row = [k_y, k_theta, correlation * np.sqrt(k_y * k_theta), 1e-5 * k_y, 1e-5 * k_theta, 0.0, 0.01]
    soft = [1e8, 1e5, 0.0, 0.0, 0.0, 0.0, 0.0]
    steel = (200e9, 7800.0, 0.29)
    parts = [(0, 1, 0.08, 0.016), (1, 2, 0.05, 0.016), (3, 4, 0.1, 0.03)]
    rows = (row, soft) if element == "joint" else (soft, row)
    model = make([segment(*part, steel) for part in parts], [[2, 3, *rows[0]]], [], [[4, *rows[1]]])
    w = 2.0 * np.pi * np.array([50.0, 700.0, 2500.0, 9000.0])
    points = np.array([[0.0, 0.0], [0.0, 1.0], [4.0, 0.0], [4.0, 1.0]])
    core = _core.Model(0, *model)
    found, _ = core.receptance(_core.Lines(w), points, points, np.empty((0, 3)), 1)
    np.testing.assert_allclose(found, exact.receptance_complex128(model, w, points, points), rtol=1e-10)
    table, first = (tables.JOINTS, 2) if element == "joint" else (tables.GROUNDS, 1)
    parameters = np.array([[table, 0, first + k] for k in range(3)] + [[tables.SEGMENTS, 0, 2]], dtype=float)
    tip = points[:1]
    _, slope = core.receptance(_core.Lines(w), tip, tip, parameters, 1)
    np.testing.assert_allclose(slope, exact.derivative_complex128(model, w, tip, tip, parameters), rtol=1e-10)
