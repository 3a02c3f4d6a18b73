"""Cases: the draw, the exactness of their records, and the sizes, on a beam that is not measured."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from real import cases, exact, structures
from real.cases import ANSWERS, DRIVE, PLAN, Case, Effect, Plain, Setup, draw, modelab_case
from real.made_beam import HZ, accelerance, made_beam
from real.structures import DECAY_RATE, Level

pytestmark = pytest.mark.slow

HERE = Path(__file__).resolve().parent
SETUP = Setup(((DRIVE, 0.0), (1, 0.0), (6, 0.4)), 700.0)


@pytest.fixture(scope="module")
def beam():
    return made_beam(DRIVE)


@pytest.fixture
def made(beam, monkeypatch):
    levels = tuple(
        Level(f"level {i}", np.linspace(79.0, 81.0, 41), np.exp(1j * np.linspace(0.1, 3.0, 41)), np.full(41, 0.1 * i))
        for i in range(1, 9)
    )
    monkeypatch.setattr(cases, "modelab", lambda: beam)
    monkeypatch.setattr(cases, "brake_reuss", lambda: levels)


def plain_fit(case: Case) -> Plain:
    """Return a plain model that misses all frequencies by 0.1 % and all lines by three standard deviations."""
    return Plain(
        frequencies_hz=tuple(1.001 * HZ),
        deviations=tuple(np.full(r.frequency_hz.size, 0.01) for r in case.records),
        residuals=tuple(np.full(2 * r.frequency_hz.size, 3.0) for r in case.records),
        misfit=9.0,
    )


def true_accelerance(record, hit, rate=DECAY_RATE, **body):
    return accelerance(exact.laplace(record.frequency_hz, rate), DRIVE, **body)[hit]


def test_records_of_configurations_are_those_of_the_loaded_beam(beam):
    case = modelab_case(beam, SETUP, None)
    assert [r.configuration for r in case.records] == ["bare", "bare", "with 0.4 kg"]
    for (hit, known), record in zip(SETUP.hits, case.records, strict=True):
        true = true_accelerance(record, hit, mass=known)
        assert np.median(np.abs(record.accelerance / true - 1.0)) < 2e-3
        assert np.median(np.abs(true_accelerance(record, hit, mass=known + 0.1) / true - 1.0)) > 1e-2
        assert np.all(np.diff(record.frequency_hz) == pytest.approx(2.5))


@pytest.mark.parametrize(
    ("effect", "body", "rate"),
    [
        (Effect("sensor_mass", {"mass": 0.1}), {"mass": 0.1}, DECAY_RATE),
        (Effect("suspension", {"stiffness": 3e5}), {"stiffness": 3e5}, DECAY_RATE),
        (Effect("exponential_window", {"rate": 20.0}), {}, DECAY_RATE + 20.0),
    ],
)
def test_hidden_effects_are_exact(beam, effect, body, rate):
    case, plain = modelab_case(beam, SETUP, effect), modelab_case(beam, SETUP, None)
    for (hit, known), record, without in zip(SETUP.hits, case.records, plain.records, strict=True):
        whole = {**body, "mass": known + body.get("mass", 0.0)}
        true = true_accelerance(record, hit, rate, **whole)
        away = np.abs(record.accelerance / true - 1.0)
        assert np.median(away) < 2e-3
        # The noise of 1e-3 matters beside antiresonances alone.
        assert np.mean(away < 0.05) > 0.97
        assert np.max(np.abs(without.accelerance / true - 1.0)) > 0.3
        assert record.decay_rate == DECAY_RATE


def test_an_axis_states_everything_by_its_own_clock(beam):
    case = modelab_case(beam, SETUP, Effect("frequency_scale", {"share": 0.02}))
    plain = modelab_case(beam, SETUP, None)
    for record, without in zip(case.records, plain.records, strict=True):
        np.testing.assert_allclose(record.frequency_hz, 1.02 * without.frequency_hz)
        np.testing.assert_array_equal(record.accelerance, without.accelerance)
        assert record.decay_rate == pytest.approx(1.02 * DECAY_RATE)


def test_drive_point_that_reads_too_little(beam):
    """Bodies act as they would with the right drive point, which is known from the mirrored hit; the record is left."""
    assert beam.drive_gain == pytest.approx(1.0, abs=0.01)
    faulty = replace(beam, accelerance=np.where(np.arange(9)[:, None] == DRIVE, 0.8, 1.0) * beam.accelerance)
    assert faulty.drive_gain == pytest.approx(1.25, rel=0.01)
    right, found = (modelab_case(one, SETUP, Effect("sensor_mass", {"mass": 0.2})) for one in (beam, faulty))
    for place, (a, b) in enumerate(zip(right.records, found.records, strict=True)):
        ratio = np.median(np.abs(b.accelerance / a.accelerance))
        assert ratio == pytest.approx(0.8 if place == 0 else 1.0, abs=5e-3)
    shifts = [[exact.shifted_mode(mode, 0.1)[1] for mode in one.modes] for one in (beam, faulty)]
    assert shifts[0] == pytest.approx(shifts[1], rel=1e-4)


@pytest.mark.usefixtures("made")
@pytest.mark.parametrize("effect", [e for e in ANSWERS if e in cases.BOUNDS])
@pytest.mark.parametrize("aim", [1.0, 4.0])
def test_sizes_reach_their_aim(effect, aim):
    found = draw(5, 1, "modelab", effect, plain_fit, aim=aim)
    name, low, high = cases.BOUNDS[effect]
    size = abs(found.effect.sizes[name])
    assert size > 0.0
    inside = 1.01 * low < size < 0.99 * high or effect == "calibration_gain"
    assert not inside or found.ratio == pytest.approx(aim, rel=0.02)
    assert found.effect.aim == aim
    assert bool(np.any(found.shifts)) == (effect in ("sensor_mass", "suspension", "frequency_scale"))


@pytest.mark.usefixtures("made")
def test_seed_determines_the_case():
    for structure, effect in (("modelab", "sensor_mass"), ("brake_reuss", "wrong_quantity"), ("modelab", "")):
        a, b, c = (draw(seed, 3, structure, effect, plain_fit) for seed in (7, 7, 8))
        assert pickle.dumps(a) == pickle.dumps(b)
        assert pickle.dumps(a) != pickle.dumps(c)


@pytest.mark.usefixtures("made")
@pytest.mark.parametrize(("structure", "effect"), sorted(set(PLAN)))
def test_every_planned_effect_is_in_the_records_and_not_in_the_text(structure, effect):
    found = draw(11, 2, structure, effect, plain_fit)
    assert 2 <= len(found.case.records) <= 4
    changed = [
        not (np.array_equal(a.accelerance, b.accelerance) and np.array_equal(a.frequency_hz, b.frequency_hz))
        for a, b in zip(found.case.records, found.plain.records, strict=True)
    ]
    assert all(changed) if effect else not any(changed)
    text = " ".join(f"{r.label} {r.configuration} {r.conditions}" for r in found.case.records)
    assert not any(id in text for id in ANSWERS)
    assert [r.label for r in found.case.records] == [r.label for r in found.plain.records]


def test_only_the_bridge_imports_the_package():
    code = "import sys; import real.cases; sys.exit(any(m.split('.')[0] == 'receptance' for m in sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=HERE.parent, env={"PYTHONPATH": str(HERE.parent), "PATH": ""}, check=False
    )
    assert done.returncode == 0
    for source in HERE.glob("*.py"):
        if source.name not in ("bridge.py", "coverage.py") and not source.name.startswith("test_"):
            text = source.read_text(encoding="utf-8")
            assert not re.search(r"^\s*(import|from)\s+receptance", text, re.MULTILINE), source.name


def test_absent_files_are_told(monkeypatch, tmp_path):
    monkeypatch.setattr("real.structures.MEASURED", tmp_path)
    monkeypatch.setattr(cases, "modelab", structures.modelab.__wrapped__)
    monkeypatch.setattr(cases, "brake_reuss", structures.brake_reuss.__wrapped__)
    for structure in ("modelab", "brake_reuss"):
        assert not cases.available(structure)
        with pytest.raises(FileNotFoundError, match="is not in the folder of measured files"):
            draw(1, 0, structure, "", plain_fit)
