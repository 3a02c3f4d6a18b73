"""The commands of `benches/laboratory.py`: processes with limits, resumed runs, tables; one small case of each."""

from __future__ import annotations

import dataclasses
import importlib.util
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from blind.outcome import Outcome
from machine_laboratory import batch, blind, converge, depths
from machine_laboratory.generator import EFFECTS, FOREIGN, draw_machine
from machine_laboratory.oracle import consult
from receptance import campaign

BENCH = Path(__file__).resolve().parents[2] / "benches" / "laboratory.py"


@pytest.fixture(scope="module")
def bench():
    spec = importlib.util.spec_from_file_location("bench_of_machines", BENCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _results(work, cases, **how):
    return [result for _, result in batch.run(work, cases, **{"jobs": 1, "limit": 60.0, **how})]


def test_each_case_has_its_own_process():
    done = dict(zip("ab", _results(dict, [{"seconds": 1.0}, {"seconds": 2.0}], jobs=2), strict=True))
    assert sorted(result["seconds"] for result in done.values()) == [1.0, 2.0]
    assert all(result["megabytes"] > 1.0 for result in done.values())


def test_a_case_that_raises_dies_or_hangs_has_failed():
    (raised,) = _results(json.loads, [{"s": "{"}])
    assert raised["failure"].startswith("JSONDecodeError")
    (died,) = _results(os._exit, [{"status": 3}])
    assert died["failure"] == "the process ended with 3"
    (hung,) = _results(subprocess.check_call, [{"args": ["sleep", "9"]}], limit=0.2)
    assert hung == {"failure": "no result after 4 s", "processor": 0.2}
    (busy,) = _results(pow, [{"base": 3, "exp": 10**8}], limit=1.0)
    assert busy == {"failure": "more than 1 s", "processor": 1.0}


def test_rows_of_a_killed_run_are_read(tmp_path):
    path = tmp_path / "rows.jsonl"
    assert batch.read_rows(path) == []
    batch.append_row(path, {"index": 0})
    path.write_text(path.read_text(encoding="utf-8") + '{"index": ', encoding="utf-8")
    batch.append_row(path, {"index": 1})
    assert batch.read_rows(path) == [{"index": 0}, {"index": 1}]


# Tables, with results that are made -----------------------------------------------------------------------------------


def _faked(monkeypatch, module, made):
    """Replace the processes of a command, and return the list of the cases that are begun."""
    begun = []

    def run(work, cases, *, jobs, limit):
        for case in cases:
            begun.append((work, case["index"]))
            yield case, {"seconds": 2.0, "processor": 2.0, "megabytes": 90.0, **made(work, case)}

    monkeypatch.setattr(module, "run", run)
    return begun


def _fit(cost, *, inside=True):
    joint = ("joint.k_y", "joint.k_theta")
    values = {"ratio": 1.01, "inside": inside, "width": 0.05}
    return {
        "cost": cost,
        "rms": 1.0,
        "converged": True,
        "number": 8,
        "evaluations": 9,
        **{key: dict.fromkeys(joint, value) for key, value in values.items()},
    }


def test_convergence_is_counted_against_the_best_known_cost(bench, monkeypatch, capsys, tmp_path):
    def made(work, case):
        if work is converge.fit_near:
            assert case["modes"] == 8
            return _fit(100.0 if case["start"] else 101.0)
        fits = [_fit(100.05), _fit(102.0, inside=False), {"failure": "more than 5 s"}, _fit(99.0)]
        return fits[case["index"]]

    begun = _faked(monkeypatch, converge, made)
    arguments = ["converge", "--seed", "4", "--cases", "4"]
    arguments += ["--resume", str(tmp_path / "fits.jsonl"), "--best", str(tmp_path / "best.jsonl")]
    assert bench.main(arguments) == 0
    out = capsys.readouterr().out
    assert "seed 4, 4 machines" in out
    assert "optimum within 0.1 % of the best         2 of   4" in out
    assert "k_theta inside its 95 % interval         2 of   3" in out
    assert "better than the fits from near the truth: 1; failed: 1" in out
    assert max(map(len, out.splitlines())) <= 80
    assert len(begun) == 4 + 3 * 2
    bench.main(arguments)
    assert len(begun) == 4 + 3 * 2
    again = capsys.readouterr().out
    assert again.splitlines()[-8:] == out.splitlines()[-8:]


def test_depths_above_the_limit_and_refused_ones_are_counted(bench, monkeypatch, capsys, tmp_path):
    def cut(measured, ratios, rejected=False):
        return {"measured": measured, "ratios": ratios, "rejected": rejected, "banded": True, "reason": ""}

    def made(work, case):
        cuts = (
            [cut(True, [0.8, 0.9, 1.2], True), cut(False, [])]
            if case["index"]
            else [cut(True, [0.7]), cut(False, [1.3])]
        )
        return {"rms": 1.0, "converged": True, "usable": True, "cuts": cuts}

    begun = _faked(monkeypatch, depths, made)
    arguments = ["depths", "--seed", "4", "--cases", "2", "--resume", str(tmp_path / "depths.jsonl")]
    assert bench.main(arguments) == 0
    out = capsys.readouterr().out
    assert "depths above the true limit              2 of   5" in out
    assert "   of the measured tool                  1 of   4" in out
    assert "cuts without a number (refused)          1 of   4" in out
    assert "   1: the cut" in out
    assert "machines with a depth above the limit    2 of   2" in out
    assert "loss against the true limit: median 10.0 %" in out
    assert max(map(len, out.splitlines())) <= 80
    bench.main(arguments)
    assert len(begun) == 2


def test_a_depth_is_refused_for_the_reason_that_comes_first():
    refused = {"ratios": []}
    assert depths.refusal({"usable": True, "converged": True}, {"ratios": [0.9]}) == ""
    rows = [(False, False), (True, False), (True, True)]
    reasons = [depths.refusal({"converged": converged, "usable": usable}, refused) for converged, usable in rows]
    assert tuple(reasons) == depths.REFUSALS


def test_verdicts_are_scored(bench, monkeypatch, capsys, tmp_path):
    plan = blind.hidden(30)
    assert sum(not effects for effects in plan) == 10
    assert {effects[0] for effects in blind.hidden(60) if effects} == set(EFFECTS)

    def made(work, case):
        if case["index"] == 1:
            return {"failure": "more than 5 s"}
        effects = plan[case["index"]]
        known = bool(effects) and effects[0] not in FOREIGN
        reported = effects if known else ("time_delay",) if effects else ()
        verdict = "named" if effects else "adequate"
        plain = {"sizes": (), "together": (), "same": (), "covered": (), "size_covered": (), "share": None}
        outcome = Outcome(
            seed=case["seed"], index=case["index"], kind=blind._kind(effects), effects=effects, large=True,
            oracle={"gain": 99.0, "gain_unknown": 9.0}, verdict=verdict, reported=reported, seconds=3.0, misfit=2.0,
            misfit_after=1.0, knowledge=blind.LEVEL, **plain,
        )  # fmt: skip
        return {"outcome": outcome}

    begun = _faked(monkeypatch, blind, made)
    arguments = ["blind", "--seed", "4", "--cases", "30", "--resume", str(tmp_path / "verdicts.jsonl")]
    assert bench.main(arguments) == 0
    out = capsys.readouterr().out
    single = sum(bool(effects) and effects[0] not in FOREIGN for effects in plan)
    foreign = sum(bool(effects) and effects[0] in FOREIGN for effects in plan)
    known = bool(plan[1]) and plan[1][0] not in FOREIGN
    assert f"large: in the reported set {single - known:15d} of {single:3d}" in out
    assert f"nothing hidden: called anything {0:10d} of  10" in out
    assert f"foreign: named {foreign - (not known):27d} of {foreign:3d}" in out
    assert f"diagnoses that failed {1:20d} of  30" in out
    assert max(map(len, out.splitlines())) <= 80
    bench.main(arguments)
    assert len(begun) == 30


def test_commands_and_effects_that_do_not_exist_are_refused(bench, capsys):
    for arguments in (["convergence"], ["blind", "--effects", "sensor_maas"], []):
        with pytest.raises(SystemExit):
            bench.main(arguments)
    assert "sensor_maas" in capsys.readouterr().err


def test_help_shows_each_command_with_its_meaning(bench, capsys):
    with pytest.raises(SystemExit):
        bench.main(["--help"])
    assert "stable with 95 % are below" in " ".join(capsys.readouterr().out.split())


# The oracle, and one small case of each command -----------------------------------------------------------------------


@pytest.mark.slow
def test_an_oracle_with_an_unknown_spindle_gains_less():
    for effect, same in (("tool_modulus", {"tool_material"}), ("spindle_mode", set())):
        oracle, alike = consult(draw_machine(37, effect, u=1.0), ("tool_material", "time_delay", "sensor_mass"))
        assert oracle.gain >= oracle.gain_unknown > 30.0
        assert set(alike) == same
    assert dataclasses.astuple(consult(draw_machine(37))[0]) == (0.0, 0.0)


@pytest.mark.slow
def test_a_machine_is_identified():
    row = converge.fit(seed=37, index=0, modes=5, threads=1, profiles=False)
    assert row["cost"] > 0.0
    assert 0.5 < row["ratio"]["joint.k_theta"] < 2.0


@pytest.mark.slow
def test_depths_are_recommended():
    row = depths.recommend(seed=37, index=0, modes=5, threads=1)
    assert [cut["measured"] for cut in row["cuts"]] == [True, False]
    assert all(ratio > 0.0 for cut in row["cuts"] for ratio in cut["ratios"])


@pytest.mark.slow
def test_depths_are_safe_and_stated():
    """Machines each of which once had unsafe depths or none: by modes above the lines, few lines, modes below."""
    rows = [depths.recommend(seed=370041, index=index, modes=9, threads=1) for index in (5, 6, 10)]
    cuts = [cut for row in rows for cut in row["cuts"]]
    ratios = [ratio for cut in cuts for ratio in cut["ratios"]]
    assert not any(row["adequate"] for row in rows)
    assert sum(not cut["ratios"] for cut in cuts) <= 1
    assert sum(ratio > 1.0 for ratio in ratios) <= 0.05 * len(ratios)
    assert max(ratios) < 1.02
    assert np.median(ratios) > 0.9


@pytest.mark.slow
def test_a_machine_is_diagnosed(monkeypatch):
    # Few modes and one cause: what is tested is the way from the machine to the score.
    diagnose = campaign.Campaign.diagnose
    monkeypatch.setattr(campaign.Campaign, "diagnose", lambda self: diagnose(self, ["time_delay"], fast=True))
    outcome = blind.diagnose(seed=37, index=0, effects=("calibration_gain",), modes=1, threads=1)["outcome"]
    assert (outcome.kind, outcome.effects, outcome.knowledge) == ("single", ("calibration_gain",), blind.LEVEL)
    assert outcome.large
    assert outcome.misfit > 1.0
    assert outcome.verdict
    assert not outcome.in_set
    assert "calibration_gain" in blind.table([outcome])[-1]
