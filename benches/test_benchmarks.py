"""Every pair under pytest-benchmark, after its two sides have agreed.

``--benchmark-disable`` leaves the agreement, on the share of the lines that ``ratios.py --quick`` takes.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import ratios
import roofline
import scaling
import sweeping
from pairs import Pair, all_pairs, largest_difference


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Give `test_pair` all pairs, of few lines and without their sides where no time is measured."""
    if "pair" in metafunc.fixturenames:
        timed = not metafunc.config.getoption("benchmark_disable")
        pairs = all_pairs(1 if timed else ratios.QUICK_SHARE)
        metafunc.parametrize("pair", pairs, ids=[pair.name for pair in pairs])
        metafunc.parametrize("side", ["ours", "reference"] if timed else ["both"])


def test_pair(benchmark: BenchmarkFixture, pair: Pair, side: str) -> None:
    if side != "reference":
        pair.check()
    benchmark.group = pair.name
    # Both sides have run already where no time is measured.
    benchmark(getattr(pair, side) if benchmark.enabled else lambda: None)


def _pair(ours: float, reference: float) -> Pair:
    return Pair(
        subject="a number",
        against="another",
        ours=lambda: np.array([ours]),
        reference=lambda: np.array([reference]),
        difference=largest_difference,
        tolerance=1e-9,
    )


@pytest.mark.parametrize("ours", [1.0 + 1e-8, np.nan, np.inf])
def test_disagreeing_pair_is_not_timed(ours: float) -> None:
    with pytest.raises(AssertionError, match="a number: another: the two sides differ"):
        ratios.measure(_pair(ours, 1.0), rounds=1, least=0.0)


def test_each_side_is_timed_in_every_round() -> None:
    now = 0.0
    # The first duration is that of the comparison before the rounds.
    durations = {"ours": iter([9.0, 1.0, 2.0, 4.0]), "reference": iter([9.0, 3.0, 1.0, 8.0])}

    def side(name: str) -> np.ndarray:
        nonlocal now
        now += next(durations[name])
        return np.ones(1)

    pair = replace(_pair(1.0, 1.0), ours=lambda: side("ours"), reference=lambda: side("reference"), most_rounds=3)
    row = ratios.measure(pair, rounds=5, least=0.0, clock=lambda: now)
    assert list(durations["ours"]) == list(durations["reference"]) == []
    assert (row.ours_s, row.reference_s, row.ratio) == (2.0, 3.0, 1.5)
    # Quartiles of the ratios 3, 0.5 and 2 of the rounds.
    assert row.quartiles == (1.25, 2.5)


def test_names_are_unique() -> None:
    names = [pair.name for pair in all_pairs(ratios.QUICK_SHARE)]
    assert len(set(names)) == len(names)


def test_ratios_prints_and_writes_the_chosen_pairs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "ratios.json"
    assert ratios.main(["--quick", "--rounds", "1", "--only", "identification", "--json", str(target)]) == 0
    rows = json.loads(target.read_text())
    names = [pair.name for pair in all_pairs(ratios.QUICK_SHARE)]
    assert [row["name"] for row in rows] == [name for name in names if "identification" in name]
    printed = capsys.readouterr().out
    for row in rows:
        above, below = row["ratio_is"].split(" / ")
        assert row["ratio"] == pytest.approx(row[above] / row[below])
        assert row["threads"] in (1, 2)
        assert f"{row['ratio']:.2f}" in printed
    assert "SciPy's own" in printed
    assert list(tmp_path.iterdir()) == [target]


def test_the_roofline_prints_and_writes_every_kernel(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "roofline.json"
    assert roofline.main(["--quick", "--json", str(target)]) == 0
    rows = json.loads(target.read_text())
    printed = capsys.readouterr().out
    assert all(row["name"] in printed for row in rows)
    assert len(rows) == 2 + 2 * len(roofline.AFTER)


def test_scaling_is_drawn(tmp_path: Path) -> None:
    plot, points = tmp_path / "scaling.png", tmp_path / "scaling.json"
    assert scaling.main(["--quick", "--plot", str(plot), "--json", str(points)]) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert len({point["panel"] for point in json.loads(points.read_text())}) == 4


@pytest.mark.parametrize(
    "arguments", [["--rounds", "0"], ["--json", "no such folder/ratios.json"], ["--only", "nothing"]]
)
def test_impossible_requests_fail_first(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        ratios.main(arguments)
    assert stopped.value.code == 2
    assert arguments[0] in capsys.readouterr().err


def test_sweep_is_independent_of_thread_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "sweeping.json"
    assert sweeping.main(["--quick", "--json", str(target)]) == 0
    assert "two threads" in capsys.readouterr().out
    assert [row["candidates"] for row in json.loads(target.read_text())] == [200, 2000, 2000]
