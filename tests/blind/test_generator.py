"""Correctness of the generator, and its independence of the package."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from blind.generator import CATALOGUE, KINDS, OUTSIDE, draw_case, every, rig, shuffled
from blind.generator.case import true_numbers, where_of
from blind.generator.elements import Ring, Structure, cowper, hutchinson
from blind.generator.records import measure
from blind.neighbours.kind import patch as named_patch
from blind.neighbours.kind import point as named_point
from blind.seeds import fresh_seed

pytestmark = pytest.mark.slow

HERE = Path(__file__).resolve().parent
SEED = fresh_seed()


def free_bar(length, diameter, bore, modulus, density, nu, refinement=1.0):
    structure = Structure(refinement)
    ring = Ring(diameter, bore, modulus, density, nu, 0.0, cowper(diameter, bore, nu))
    structure.beam(structure.station(), length, [ring])
    return structure.natural_frequencies(60e3)


def patch(part, start, end, **fields):
    return named_patch("other", part, start, end, **fields)


def point(part, place, **fields):
    return named_point("body", part, place, **fields)


def some_numbers(rng_seed=0, **changes):
    _, truth = draw_case(rng_seed, 0, "nothing", quick=True)
    return {**next(iter(truth.numbers.values())), **changes}


def test_generator_does_not_import_the_package():
    code = "import sys; import blind.generator; sys.exit(any(m.split('.')[0] == 'receptance' for m in sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=HERE.parent, env={"PYTHONPATH": str(HERE.parent), "PATH": ""}, check=False
    )
    assert done.returncode == 0
    for source in (HERE / "generator").glob("*.py"):
        text = source.read_text(encoding="utf-8")
        assert not re.search(r"(import|from)\s+receptance|import_module", text), source.name


def test_only_the_bridge_imports_the_package():
    for source in HERE.rglob("*.py"):
        if source.name not in ("bridge.py", "bridge_geometry.py") and source != Path(__file__):
            found = re.findall(r"^\s*(?:from|import)\s+receptance.*$", source.read_text(encoding="utf-8"), re.MULTILINE)
            assert not found, (source.name, found)


@pytest.mark.parametrize(
    ("bar", "known"),
    [
        ((0.125, 0.010, 0.0, 200e9, 7800.0, 0.29), (2837.30, 7597.40, 14325.63, 22605.17)),
        ((0.120, 0.020, 0.0, 580e9, 14500.0, 0.24), (7318.47, 18268.10, 32037.50, 47216.83)),
        ((0.100, 0.050, 0.020, 210e9, 7850.0, 0.3), (15830.80, 26338.44, 38263.16, 38945.42)),
    ],
)
def test_free_beams_have_their_known_frequencies(bar, known):
    assert free_bar(*bar, refinement=2.0)[:4] == pytest.approx(known, rel=1e-6)


def test_hutchinsons_coefficient_of_a_solid_section():
    nu = 0.3
    assert hutchinson(0.02, 0.0, nu) == pytest.approx(6 * (1 + nu) ** 2 / (7 + 12 * nu + 4 * nu**2))


EXTRAS = [
    {},
    {"spread.length": 0.03, "spread.points": 4.0, "spread.slope": -0.6},
    {"spread.length": 0.03, "spread.points": 40.0, "spread.loose": 1.0, "holder.0.length": 0.03},
    {"collet.mass": 0.03, "collet.split": 0.4, "collet.radius": 0.012},
    {"sensor.mass": 1e-3, "hit.offset": 2e-3, "middle.place": 0.4, "middle.mass": 2e-3},
    {
        "fixture.mass": 0.2,
        "fixture.hz": 1500.0,
        "fixture.zeta": 0.01,
        "rope.k": 2e5,
        "rope.zeta": 0.03,
        "rope.place": 0.4,
    },
    {"crack.place": 0.5, "crack.k": 1e5, "flute.length": 0.02, "flute.ratio": 0.9, "tool.taper": 0.02},
    {"holder.stiffer": 3.0, "ground.k": 1e7, "ground.c": 10.0, "ground.place": 0.6, "joint.loss": 0.03},
    {"rope.k": 2e5, "rope.zeta": 0.03, "rope.place": 0.4},
    {"screw.section": 1.0, "screw.k": 1e6},
    {"sensor.mass": 1e-3, "wax.hz": 6000.0, "wax.zeta": 0.05},
    {
        "point.tie.part": 0.0, "point.tie.place": 0.03, "point.tie.mass": 2e-3, "point.tie.k": 1e5, "point.tie.c": 3.0,
        "point.ring.part": 1.0, "point.ring.place": 0.05, "point.ring.mass": 0.05, "point.ring.hz": 1500.0,
        "point.ring.zeta": 0.1,
    },
    {
        "tool.bore": 0.005, "patch.neck.part": 0.0, "patch.neck.start": 0.02, "patch.neck.end": 0.035,
        "patch.neck.outer": 0.9, "patch.heavy.part": 1.0, "patch.heavy.start": 0.06, "patch.heavy.end": 0.09,
        "patch.heavy.density": 1.2, "patch.heavy.modulus": 1.3, "patch.short.part": 1.0, "patch.short.start": 0.02,
        "patch.short.end": 0.03, "patch.short.core": 0.0,
    },
]  # fmt: skip


@pytest.mark.parametrize("extra", EXTRAS, ids=lambda extra: next(iter(extra), "plain"))
def test_mesh_error_is_small_against_noise_and_floor(extra):
    # Half the elements, twice the modes: 1e-4 is a thirtieth of the floor, on any line.
    p = some_numbers(**extra)
    lines = np.linspace(150.0, 7000.0, 400)
    once = rig.poles(p).receptance(lines)
    structure, tip, hit = rig.build(p, 2.0)
    unit = np.eye(structure.size)
    twice = structure.poles(unit[:, [2 * hit]], unit[:, [2 * tip]], modes=48).receptance(lines)
    assert np.max(np.abs(np.log(once / twice))) < 1e-4
    # And against solving the matrices line by line.
    k, m, c = structure.matrices()
    for i in (0, 150, 399):
        w = 2.0 * np.pi * lines[i]
        direct = np.linalg.solve(k - w**2 * m + 1j * w * c, unit[:, 2 * hit])[2 * tip]
        assert direct == pytest.approx(twice[i], rel=1e-5)


def test_points_of_a_layer_converge():
    p = some_numbers(**{"spread.length": 0.04, "spread.loose": 1.0, "holder.0.length": 0.04})
    found = [rig.natural_frequencies({**p, "spread.points": float(n)}, 6e3) for n in (20, 40, 80)]
    coarse, fine = (np.abs(one / found[2] - 1.0).max() for one in found[:2])
    assert fine < 3e-4
    assert coarse / fine == pytest.approx(5.0, rel=0.1)  # second order: (16 - 1) / (4 - 1)


def test_a_spread_joint_tends_to_a_point():
    p = some_numbers()
    point = rig.natural_frequencies(p, 6e3)[0]
    # The bending compliance beside the spring depends on the length.
    away = [
        abs(rig.natural_frequencies({**p, "spread.length": length, "spread.points": 3.0}, 6e3)[0] / point - 1.0)
        for length in (8e-3, 2e-3, 5e-4)
    ]
    assert away[0] > 2.0 * away[1] > 4.0 * away[2]


def recorded(p):
    return rig.recorded(p, np.arange(150.0, 6000.0, 25.0))


def test_points_and_patches_are_what_they_stand_for():
    p = some_numbers()
    overhang, holder = p["tool.overhang"], [p[f"holder.{i}.length"] for i in range(3)]
    same = [
        ({"flute.length": 0.02, "flute.ratio": 0.9}, patch("tool", 0.0, 0.02, outer=0.9)),
        ({"holder.1.outer": 1.1 * p["holder.1.outer"]}, patch("holder", holder[0], sum(holder[:2]), outer=1.1)),
        ({"holder.2.inner": 0.006}, patch("holder", sum(holder[:2]), 1.0, bore=0.006)),
        ({"middle.mass": 3e-3, "middle.place": 0.4}, point("tool", 0.4 * overhang, mass=3e-3)),
        ({"nose.ring": 0.1}, point("holder", holder[0], mass=0.1, inertia=2e-5)),
        (
            {"ground.k": 1e7, "ground.c": 30.0, "ground.place": 0.5},
            point("holder", 0.5 * sum(holder), k=1e7, c=30.0),
        ),
        (
            {"absorber.mass": 2e-3, "absorber.hz": 900.0, "absorber.zeta": 0.02},
            point("tool", 0.0, mass=2e-3, hz=900.0, zeta=0.02),
        ),
        # A sensor that is held stiffly, or whose centre is at the tip.
        ({"sensor.mass": 1e-3}, {"sensor.mass": 1e-3, "wax.hz": 5e5, "wax.zeta": 0.01}),
        ({"sensor.mass": 1e-3}, {"sensor.mass": 1e-3, "sensor.arm": 0.0}),
    ]
    for plain, other in same:
        changed = recorded({**p, **plain})
        assert np.abs(np.log(changed / recorded(p))).max() > 0.01
        assert np.abs(np.log(changed / recorded({**p, **other}))).max() < 3e-4, other
    # A shank of no material has no effect, one without a core has.
    tool = {f"tool.{name}": 1e-6 * p[f"tool.{name}"] for name in ("modulus", "density")}
    empty = patch("holder", 0.0, holder[0], core=0.0)
    frequencies = [rig.natural_frequencies({**p, **tool, **extra}, 9e3) for extra in ({}, empty)]
    assert frequencies[0][-1] == pytest.approx(frequencies[1][-1], rel=1e-5)
    assert abs(rig.natural_frequencies({**p, **empty}, 9e3)[0] / rig.natural_frequencies(p, 9e3)[0] - 1.0) > 1e-4


def test_sensor_on_an_arm_sees_the_slope():
    # With a tool that goes on stiffly and without mass the end of the arm is the tip.
    p = some_numbers(**{"sensor.mass": 0.0})
    longer = {**p, "tool.overhang": p["tool.overhang"] + 0.008, "hit.offset": 0.008}
    longer |= patch("tool", 0.0, 0.008, modulus=100.0, density=1e-6)
    assert np.abs(np.log(recorded({**p, "sensor.arm": -0.008}) / recorded(longer))).max() < 3e-3
    assert np.abs(np.log(recorded(p) / recorded(longer))).max() > 0.05


def test_one_mode_is_damped():
    p = some_numbers()
    plain, lossy = (rig.poles({**p, **extra}) for extra in ({}, {"lossy.mode": 1.0, "lossy.zeta": 0.01}))
    ratios = -lossy.rates.real / np.abs(lossy.rates) + plain.rates.real / np.abs(plain.rates)
    changed = np.flatnonzero(np.abs(ratios) > 1e-6)
    assert len(changed) == 2
    assert ratios[changed] == pytest.approx([0.01, 0.01], rel=0.01)
    ringing = np.sort(plain.rates.imag[plain.rates.imag > 700.0])
    assert np.abs(plain.rates.imag[changed]) == pytest.approx([ringing[1], ringing[1]], rel=1e-4)


def test_hits_are_disturbed_before_they_are_analysed():
    _, truth = draw_case(3, 0, "nothing", quick=True)
    p, setup = next(iter(truth.numbers.values())), next(iter(truth.setups.values()))

    def estimate(disturb=None, **changes):
        return measure(np.random.default_rng(1), p, replace(setup, **changes), disturb)

    plain, same = estimate(), estimate(lambda number, force, response: (force, response))
    assert same.receptance == pytest.approx(plain.receptance, rel=1e-9)
    assert estimate(lambda number, force, response: (2.0 * force, response)).receptance == pytest.approx(
        0.5 * plain.receptance, rel=1e-9
    )
    numbers = []
    estimate(lambda number, force, response: (numbers.append(number), (force, response))[1])
    assert numbers == list(range(setup.hits))
    # Noise that refers to another pulse is the same noise in volts.
    soft, usual = (estimate(pulse=10.0 * setup.pulse, usual_pulse=pulse) for pulse in (setup.pulse, 0.0))
    assert np.median(soft.log_variance) > 10.0 * np.median(usual.log_variance)
    assert estimate(usual_pulse=setup.pulse).receptance == pytest.approx(plain.receptance, rel=1e-9)


def test_estimates_scatter_by_their_stated_deviation(summarise):
    squares = []
    for i in range(12):
        id = ("time_delay", "sensor_mass", "calibration_gain", "exponential_window")[i % 4]
        case, truth = draw_case(SEED, i, "single", (id,), quick=True)
        for record in case.records:
            e = record.estimate
            p = truth.numbers[record.configuration, record.level, record.plane]
            exact = rig.recorded(p, e.frequency_hz, e.decay_rate, truth.setups[record.level].pulse)
            known = e.log_variance * e.correlated_lines
            error = np.log(e.receptance / exact)
            good = known < 0.12**2
            if e.decay_rate == 0.0 and record.level == 100.0:
                # Lines on which the noise exceeds the truncation error.
                good &= e.log_variance > 0.003**2
                # A square over an estimate of its variance with nu degrees of freedom is nu / (nu - 2) on average.
                average = e.degrees_of_freedom / (e.degrees_of_freedom - 2.0)
                squares.append(np.mean(np.abs(error[good]) ** 2 / 2.0 / e.log_variance[good]) / average)
            # The floor covers the remaining difference.
            assert np.mean(np.abs(error[good]) ** 2 / 2.0 / (known[good] + 0.003**2)) < 1.25
            assert np.median(np.sqrt(e.log_variance)) < 0.02
    summarise("blind laboratory", f"seed {SEED}: squares of estimates {np.mean(squares):.3f}", np.mean(squares))
    assert np.mean(squares) == pytest.approx(1.0, abs=0.05), SEED


def test_truncated_record_lacks_the_truncated_part():
    for i in range(4):
        case, truth = draw_case(SEED, i, "single", ("coarse_resolution",), u=1.0, quick=True)
        for record in case.records:
            e = record.estimate
            p = truth.numbers[record.configuration, record.level, record.plane]
            errors = []
            for one in (p, {**p, "record": 0.0}):
                exact = rig.recorded(one, e.frequency_hz, e.decay_rate, truth.setups[record.level].pulse)
                known = e.log_variance * e.correlated_lines + 0.003**2
                errors.append(float(np.sum((np.abs(np.log(e.receptance / exact)) ** 2 / known)[known < 0.12**2])))
            assert errors[0] < max(0.2 * errors[1], 3.0 * e.frequency_hz.size), (SEED, i)


def test_seed_determines_the_case():
    (a, s), (b, _), (c, _) = (draw_case(seed, 3, "pair", quick=True) for seed in (SEED, SEED, SEED + 1))
    assert pickle.dumps(a) == pickle.dumps(b)
    assert pickle.dumps(a) != pickle.dumps(c)
    assert len(s.effects) == 2


@pytest.mark.parametrize("id", [*CATALOGUE, *OUTSIDE])
def test_measured_change_grows_with_effect_size(id, monkeypatch):
    # Only the numbers of the last record count, not its simulated hits.
    monkeypatch.setattr("blind.generator.case.recorded", lambda rng, nominal, truth, *place, **_: place)
    changes = []
    for u in (0.1, 0.9):
        case, truth = draw_case(11, 4, "single", (id,), u=u, quick=True)
        configuration, level, plane = case.records[-1]
        where = where_of(truth, configuration, level, plane)
        absent = true_numbers(case.nominal, truth, truth.joint, truth.errors, (), where)
        before, after = (
            rig.recorded(one, np.arange(200.0, 4500.0, 10.0))
            for one in (absent, truth.numbers[configuration.name, level, plane])
        )
        changes.append(float(np.sqrt(np.mean(np.abs(np.log(after / before)) ** 2))))
    if id not in ("wrong_quantity", "joint_spread", "tool_material"):
        assert changes[1] > 1.3 * changes[0], changes
    assert changes[1] > 3e-3, changes


def test_case_excludes_the_truth():
    case, truth = draw_case(SEED, 1, "pair", quick=True)
    text = repr(replace(case, records=()))
    for effect in truth.effects:
        assert effect.id not in text
    known = set(case.nominal.numbers)
    assert not any(name.startswith("joint.k_y") and case.nominal.numbers[name] for name in known)


def test_batches_have_the_stated_shares():
    plan = every(450)
    kinds = [kind for kind, _ in plan]
    assert set(kinds) == set(KINDS)
    hidden = [kind for kind in kinds if not kind.startswith("nothing")]
    assert len(hidden) == 300
    assert {effects[0] for kind, effects in plan if kind == "single"} == set(CATALOGUE)
    assert {effects[0] for kind, effects in plan if kind == "outside"} == set(OUTSIDE)


def test_shuffled_cases_hold_the_same_measurements():
    case, _ = draw_case(SEED, 2, "misleading", quick=True)
    assert all(record.notes for record in case.records)
    other = shuffled(case)
    overhangs = [{c.name: c.overhang for c in one.nominal.configurations} for one in (case, other)]
    assert sorted(overhangs[0].values()) == sorted(overhangs[1].values())
    assert not set(overhangs[0]) & set(overhangs[1])
    # Some configurations have several records at a level.
    found = [
        sorted((overhangs[i][r.configuration], r.level, abs(r.estimate.receptance.sum())) for r in one.records)
        for i, one in enumerate((case, other))
    ]
    assert found[0] == found[1]
    assert not any(record.notes for record in other.records)
    assert {t.configuration for t in other.nominal.tolerances} - {None} == {
        *overhangs[1],
        *(t.name for t in other.new_tools),
    }
