"""The benchmark of cones: costs under pytest-benchmark, and the command at a small size."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

import cones
import magnus


@pytest.mark.parametrize("name", cones.CONES)
@pytest.mark.parametrize("cylinders", [0, 1, cones.CYLINDERS])
def test_a_cone_beside_cylinders(benchmark: BenchmarkFixture, name: str, cylinders: int) -> None:
    """The assembly is made in every call; 0 cylinders are the cone itself."""
    cone = cones.CONES[name]
    lines = np.linspace(10.0, 5e3, cones.LINES)
    row = cones.cylinders(cone, cylinders) if cylinders else [cone]
    benchmark.group = name
    values = benchmark(lambda: cones.free(*row).receptance(lines, threads=1))
    assert np.all(np.isfinite(values))


@pytest.mark.parametrize("name", cones.CONES)
def test_the_timed_cone_is_accurate(name: str) -> None:
    assert cones.inaccuracy(cones.CONES[name]) < 1e-9


def test_the_command_prints_and_writes_both_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "cones.json"
    assert cones.main(["--quick", "--json", str(target)]) == 0
    content = json.loads(target.read_text())
    printed = capsys.readouterr().out
    assert len(content["costs"]) == 4 * len(cones.CONES)
    assert str(content["seed"]) in printed
    crude = {row["cylinders"]: row for row in content["crude"]}
    # Each halving of the cylinders brings the frequencies nearer, the cones have the truth.
    shifts = [abs(crude[count]["frequencies_percent"][0]) for count in cones.COUNTS]
    assert shifts == sorted(shifts, reverse=True)
    assert crude[0]["frequencies_percent"] == pytest.approx([0.0] * 3, abs=1e-9)
    assert abs(crude[0]["k_theta_percent"]) < abs(crude[1]["k_theta_percent"])


def test_the_magnus_integrator_is_of_fourth_order(capsys: pytest.CaptureFixture[str]) -> None:
    assert magnus.main(["--slices", "6"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1 + len(magnus.LINES) * len(cones.CONES)
    for cone in cones.CONES.values():
        exact = cones.free(cone).receptance([1e3]).item()
        crude, fine = (abs(magnus.receptance(cone, 1e3, count) / exact - 1.0) for count in (16, 32))
        assert 12.0 < crude / fine < 24.0
