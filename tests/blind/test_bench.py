"""`benches/blind.py`: shards, runs that were killed, budgets, scoring of files."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import pytest

from blind.generator import NEIGHBOUR
from blind.neighbours import NEIGHBOURS
from blind.outcome import Outcome

BENCH = Path(__file__).resolve().parents[2] / "benches" / "blind.py"


@pytest.fixture
def bench(monkeypatch):
    spec = importlib.util.spec_from_file_location("bench_of_blind", BENCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.ran, module.effects = [], []

    def run_case(seed, index, kind, effects, ask, *, quick=False, knowledge="", advice=False):
        module.ran.append(index)
        module.effects.append(tuple(effects))
        effects = effects or (() if kind.startswith("nothing") else ("time_delay",))
        return Outcome(
            seed=seed, index=index, kind=kind, effects=tuple(effects), sizes=(0.5,) * len(effects), large=bool(effects),
            oracle={"gain": 100.0, "misfit": 2.0, "misfit_true": 1.0}, verdict="named" if effects else "adequate",
            reported=tuple(effects), together=(), same=(), seconds=1.0, misfit=2.0, misfit_after=1.0, share=0.9,
            covered=(True, True), size_covered=(True,), shuffled=("named", *effects) if kind == "misleading" else (),
        )  # fmt: skip

    def run_neighbour(seed, index, id, ask, *, quick=False):
        wrong = index % 5 == 0
        return replace(
            run_case(seed, index, NEIGHBOUR, (id,), ask, quick=quick), verdict="named" if wrong else "unexplained",
            reported=("tool_density",) if wrong else (),
        )  # fmt: skip

    monkeypatch.setattr(module, "run_case", run_case)
    monkeypatch.setattr(module, "run_neighbour", run_neighbour)
    return module


def test_shards_partition_one_run_and_are_scored_together(bench, tmp_path, capsys):
    files = [tmp_path / f"{i}.jsonl" for i in (1, 2)]
    for i, file in enumerate(files, 1):
        bench.main(["--cases", "21", "--seed", "3", "--shard", f"{i}/2", "--resume", str(file)])
    assert sorted(bench.ran) == list(range(21))
    out = tmp_path / "table.json"
    assert bench.main(["--score", *map(str, files), "--json", str(out)]) == 0
    assert "seed 3: 21 cases, 14 with something hidden, 7 with nothing" in capsys.readouterr().out
    document = json.loads(out.read_text(encoding="utf-8"))
    assert document["seed"] == 3
    assert len(document["cases"]) == 21
    named = next(line for line in document["lines"] if line["name"] == "one effect, large enough: in the reported set")
    assert named["hits"] == named["trials"]
    assert named["interval"][1] == 1.0


def test_killed_run_resumes(bench, tmp_path):
    file = tmp_path / "cases.jsonl"
    arguments = ["--cases", "9", "--seed", "4", "--resume", str(file)]
    bench.main(arguments)
    whole = file.read_text(encoding="utf-8").splitlines()
    assert len(whole) == 9
    # Killed while the fifth line was being written.
    file.write_text("\n".join([*whole[:4], whole[4][:50]]), encoding="utf-8")
    bench.ran.clear()
    bench.main(arguments)
    assert bench.ran == [4, 5, 6, 7, 8]
    assert sorted(one.index for one in bench.read([file])) == list(range(9))
    # Cases of another seed in the file are not taken for this one's.
    bench.ran.clear()
    bench.main(["--cases", "2", "--seed", "5", "--resume", str(file)])
    assert bench.ran == [0, 1]


def test_cases_of_some_effects_or_kinds(bench):
    bench.main(["--cases", "5", "--seed", "4", "--effects", "sensor_mass", "collet_mass"])
    assert bench.effects == [("sensor_mass",), ("collet_mass",)] * 2 + [("sensor_mass",)]
    # Cases that are chosen from the mixture keep their numbers, so they are the same ones.
    bench.ran.clear()
    bench.main(["--cases", "30", "--seed", "4", "--only", "nothing_exact", "time_delay"])
    every = bench.every(30)
    assert bench.ran == [i for i, (kind, ids) in enumerate(every) if kind == "nothing_exact" or "time_delay" in ids]
    with pytest.raises(SystemExit):
        bench.main(["--effects", "time_dilay"])


def test_neighbours_run_in_turn_and_resume(bench, tmp_path, capsys):
    file = tmp_path / "cases.jsonl"
    # Cases of the mixture in the same file are not taken for them.
    bench.main(["--cases", "3", "--seed", "4", "--resume", str(file)])
    arguments = ["--neighbours", "--seed", "4", "--resume", str(file)]
    bench.ran.clear(), bench.effects.clear()
    bench.main([*arguments, "--cases", "6"])
    bench.main([*arguments, "--cases", "10"])
    assert bench.ran == list(range(10))
    assert bench.effects == [(id,) for id in bench.every_neighbour(10)]
    out = capsys.readouterr().out
    lines = {line[:62].strip(): line[62:].split("=")[0].split() for line in out.splitlines() if " = " in line}
    assert lines["all: named or partly explained wrongly"] == ["2", "of", "10"]
    # Kinds that are chosen keep their numbers in the list.
    bench.ran.clear()
    chosen = bench.every_neighbour(10)[7]
    bench.main(["--neighbours", "--seed", "4", "--cases", str(2 * len(NEIGHBOURS)), "--only", chosen])
    assert [bench.every_neighbour(2 * len(NEIGHBOURS))[i] for i in bench.ran] == [chosen, chosen]
    with pytest.raises(SystemExit):
        bench.main(["--only", chosen])
    for option in (["--advice"], ["--effects", "time_delay"], ["--holder", "modes"], ["--only", "time_delay"]):
        with pytest.raises(SystemExit):
            bench.main([*arguments, *option])


def test_descriptions_of_cones_run_side_by_side_and_resume(bench, monkeypatch, tmp_path, capsys):
    levels = []

    def run_case(seed, index, kind, effects, ask, *, quick=False, geometry="", advice=False):
        levels.append((index, geometry))
        wrong = geometry == "crude" and not effects
        return Outcome(
            seed=seed, index=index, kind=kind, effects=tuple(effects), sizes=(0.5,) * len(effects), large=True,
            oracle={}, verdict="named" if wrong or effects else "adequate", together=(), same=(), seconds=1.0,
            reported=("holder_modulus",) if wrong else tuple(effects), misfit=2.0, misfit_after=1.0, share=None,
            covered=(), size_covered=(), knowledge=geometry,
        )  # fmt: skip

    monkeypatch.setattr(bench, "run_case", run_case)
    file = tmp_path / "cases.jsonl"
    arguments = ["--geometry", "crude", "right", "--seed", "4", "--resume", str(file)]
    bench.main([*arguments, "--cases", "2"])
    bench.main([*arguments, "--cases", "6"])
    assert levels == [(i, level) for i in range(6) for level in ("crude", "right")]
    capsys.readouterr()
    bench.main(["--geometry", "crude", "right", "--score", str(file)])
    out = capsys.readouterr().out
    lines = {line[:62].strip(): line[62:].split("=")[0].split() for line in out.splitlines() if " = " in line}
    assert lines["crude, nothing hidden: named wrong"] == ["2", "of", "2"]
    assert lines["right, nothing hidden: named wrong"] == ["0", "of", "2"]
    for option in (["--advice"], ["--neighbours"], ["--holder", "modes"]):
        with pytest.raises(SystemExit):
            bench.main([*arguments, *option])


def test_advice_is_scored_over_ambiguous_cases(bench, monkeypatch, capsys):
    def run_case(seed, index, kind, effects, ask, *, quick=False, knowledge="", advice=False):
        assert advice
        resolved = (None, True, False)[index % 3]
        return Outcome(
            seed=seed, index=index, kind=kind, effects=tuple(effects), sizes=(0.5,), large=index < 6, oracle={},
            verdict="named" if resolved is None else "ambiguous", reported=("sensor_mass", "hammer_offset"),
            together=(), same=(), seconds=1.0, misfit=2.0, misfit_after=1.0, share=None, covered=(), size_covered=(),
            resolved=resolved, next_measurement="weigh the sensor and state its mass",
        )  # fmt: skip

    monkeypatch.setattr(bench, "run_case", run_case)
    bench.main(["--cases", "9", "--seed", "4", "--advice", "--effects", "sensor_mass"])
    out = capsys.readouterr().out
    lines = {line[:62].strip(): line[62:].split("=")[0].split() for line in out.splitlines() if " = " in line}
    assert lines["ambiguous, of all cases"] == ["6", "of", "9"]
    assert lines["ambiguous, large enough: the advised measurement resolves"] == ["2", "of", "4"]
    assert lines["ambiguous, of any size: the advised measurement resolves"] == ["3", "of", "6"]
