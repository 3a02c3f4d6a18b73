"""Diagnosis of real and made records, and `benches/real.py`."""

from __future__ import annotations

import functools
import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blind.bridge import Answer
from blind.seeds import fresh_seed
from real import exact
from real.bridge import ask, fit, observations_of, simulated, tolerances_of, unknowns_of
from real.cases import DRIVE, Case, Draw, Effect, Record, available
from real.discrepancy import describe
from real.outcome import outcome_of, run_case
from real.structures import DECAY_RATE, HIT_PLACES, MEASURED

pytestmark = pytest.mark.slow

SEED = fresh_seed()
BENCH = Path(__file__).resolve().parents[2] / "benches" / "real.py"
HZ = np.arange(60.0, 700.0, 4.0)


def made_case(body=0.0, gain=1.0):
    """Return records of the engineer's own model, with a body at the sensor and a gain."""
    empty = np.zeros(HZ.size, dtype=np.complex128)
    plan = [("bare", DRIVE, 0.0), ("bare", 1, 0.0), ("with 0.4 kg", 7, 0.4)]
    records = tuple(
        Record(f"{name}, {hit}", name, HZ, empty, np.full(HZ.size, 0.01), HIT_PLACES[hit], known, DECAY_RATE)
        for name, hit, known in plan
    )
    case = Case("modelab", records)
    rng = np.random.default_rng(4)
    drive = simulated(case, records[0])
    s = exact.laplace(HZ, DECAY_RATE)
    filled = []
    for record in records:
        bare = simulated(case, replace(record, known_mass=0.0))
        values = gain * exact.with_body(bare, drive, s, mass=record.known_mass + body)
        noise = 0.01 * (rng.normal(size=HZ.size) + 1j * rng.normal(size=HZ.size))
        filled.append(replace(record, accelerance=values * np.exp(noise)))
    return replace(case, records=tuple(filled))


def test_tolerances_address_the_model():
    case = made_case()
    observations = observations_of(case)
    assert [len(one.frequency_hz) for one in observations] == [HZ.size] * 3
    assert len(unknowns_of(case)) == 1
    stated = tolerances_of(case)
    assert [t.name for t in stated if t.labels] == ["place of bare, 1", "place of with 0.4 kg, 7"]
    for tolerance in stated:
        for address in tolerance.moves:
            loaded = observations[2:] if address == "load.mass" else observations
            for one in loaded:
                assert one.assembly.get(address.replace("[*]", "[0]")) > 0.0


def test_the_plain_fit_of_made_records():
    found = fit(made_case())
    assert found.misfit == pytest.approx(1.0, abs=0.15)
    assert [own.size for own in found.deviations] == [HZ.size] * 3
    assert [own.size for own in found.residuals] == [2 * HZ.size] * 3
    assert fit(made_case(gain=1.3)).misfit > 20.0


@pytest.mark.parametrize(
    ("case", "effect"),
    [
        (made_case(body=0.02), Effect("sensor_mass", {"mass": 0.02})),
        (made_case(gain=1.2), Effect("calibration_gain", {"gain": 0.2})),
        (made_case(), None),
    ],
    ids=["mass", "gain", "nothing"],
)
def test_effects_are_found_where_the_model_is_right(case, effect):
    """The laboratory's signs, units and sizes are those of the package."""
    few = functools.partial(ask, causes=["sensor_mass", "calibration_gain", "time_delay", "tool_modulus"])
    found = outcome_of(1, 0, "modelab", Draw(case, case, effect, ratio=10.0), few(case))
    assert found.verdict == ("named" if effect else "adequate"), found
    assert found.reported == found.effects
    assert found.size_covered == ((True,) if effect else ())


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "effect"), [("modelab", "wrong_quantity"), ("brake_reuss", "")])
def test_one_case_of_each_structure(structure, effect, summarise):
    if not available(structure):
        pytest.skip(f"the measured files of {structure} are not in {MEASURED}")
    one = run_case(SEED, 0, structure, effect, ask, fit)
    text = f"{structure}, {effect or 'nothing'}: {one.verdict} {', '.join(one.reported)}, misfit {one.misfit:.3g}"
    summarise(f"real measurements, {structure} {effect}", f"seed {SEED}\n{text}", text)
    assert one.verdict != "failed", (SEED, one.error)
    assert one.misfit > 1.25, "no model fits these data to the noise"
    assert bool(one.effects) == bool(effect)


@pytest.mark.slow
@pytest.mark.parametrize("number", [13, 93])
def test_a_wrong_quantity_whose_level_the_model_has_fitted_is_reported(number):
    # The mass of this beam is free: on wrong data it fits the level, so that the right quantity is no closer at first.
    if not available("brake_reuss"):
        pytest.skip(f"the measured files of brake_reuss are not in {MEASURED}")
    outcome = run_case(20270306, number, "brake_reuss", "wrong_quantity", ask, fit)
    assert (outcome.verdict, outcome.reported) == ("partly explained", ("wrong_quantity",))


@pytest.mark.slow
def test_the_plain_model_is_that_of_an_engineer():
    """The drive point alone is far off: the other records are within some tenths of a decibel, modes within 0.05 %."""
    if not available("modelab"):
        pytest.skip(f"the measured files of modelab are not in {MEASURED}")
    found = describe("modelab")
    assert max(abs(percent) for percent in found.frequency_percent) < 0.05
    by_label = {one.label: one for one in found.records}
    assert abs(by_label.pop("bare, hit at 0.5 m").decibels_between + 1.3) < 0.3
    assert all(one.rms_between < 1.0 for one in by_label.values())


@pytest.fixture
def bench(monkeypatch):
    spec = importlib.util.spec_from_file_location("bench_of_real", BENCH)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.ran = []

    def run_one(seed, index, structure, effect, ask, fit):
        module.ran.append(index)
        hidden = Effect(effect) if effect else None
        answer = Answer(
            "partly explained" if effect else "unexplained", (effect,) if effect else (), (), {}, True, 9.0, 2.0, 1.0,
            {}, {},
        )  # fmt: skip
        empty = Case(structure, ())
        return outcome_of(seed, index, structure, Draw(empty, empty, hidden, ratio=5.0), answer)

    monkeypatch.setattr(module, "run_case", run_one)
    monkeypatch.setattr(module, "available", lambda structure: structure == "modelab")
    return module


def test_bench_skips_what_is_absent_and_scores_files(bench, tmp_path, capsys):
    files = [tmp_path / f"{i}.jsonl" for i in (1, 2)]
    for i, file in enumerate(files, 1):
        assert bench.main(["--cases", "20", "--seed", "3", "--shard", f"{i}/2", "--resume", str(file)]) == 0
    text = capsys.readouterr().out
    assert "seed 3" in text
    assert "skipped: brake_reuss: its measured files are not in" in text
    assert "not used: clamped_rods" in text
    assert sorted(bench.ran) == [i for i in range(20) if i not in (7, 13, 19)]
    bench.ran.clear()
    bench.main(["--cases", "20", "--seed", "3", "--resume", str(files[0]), "--shard", "1/2"])
    assert not bench.ran
    out = tmp_path / "table.json"
    assert bench.main(["--score", *map(str, files), "--json", str(out)]) == 0
    document = json.loads(out.read_text(encoding="utf-8"))
    lines = {line["name"]: line for line in document["lines"]}
    assert (lines["clear effect: rightly"]["hits"], lines["clear effect: rightly"]["trials"]) == (12, 12)
    assert lines["nothing hidden: a cause named"]["hits"] == 0
    assert len(document["cases"]) == 17


def named(id):
    return Answer("named", (id,), (), {}, True, 9.0, 2.0, 1.0, {}, {})
