"""The generator of machines against analytic cases, and a campaign that it writes."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from blind.generator.elements import Ring, Structure, cowper
from machine_laboratory.generator import EFFECTS, FOREIGN, Cut, draw_machine, spindle_modes, stable_limit, write
from machine_laboratory.generator.effects import recorded
from machine_laboratory.generator.machine import SECTION, true_deviation
from machine_laboratory.generator.spindle import plane_receptance, summed_modes
from machine_laboratory.generator.structure import REFINEMENT, build, fluted, material, receptances, section_count
from receptance import Assembly, Material, MeasuredPart, Part, PointJoint, PointMass, Segment, campaign
from receptance.stability import Milling, stability_lobes

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "37"))
TIP, NOSE = ("tool", 0.0), ("holder", 0.004)


@pytest.fixture(scope="module")
def machine():
    return draw_machine(SEED)


@pytest.mark.parametrize(
    ("ring", "length", "expected"),
    [
        ((0.01, 0.0, 200e9, 7800.0, 0.29), 0.125, (2837.30, 7597.40, 14325.63)),
        ((0.02, 0.0, 580e9, 14500.0, 0.24), 0.12, (7318.47, 18268.10)),
        ((0.05, 0.02, 210e9, 7850.0, 0.3), 0.1, (15830.80, 26338.44)),
    ],
)
def test_free_bars_have_known_frequencies(ring, length, expected):
    outer, inner, modulus, density, nu = ring
    s = Structure()
    s.beam(s.station(), length, [Ring(outer, inner, modulus, density, nu, 0.0, cowper(outer, inner, nu))])
    found = s.natural_frequencies(1.1 * expected[-1])
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=4e-5)


def test_the_mesh_and_the_poles_are_exact_to_a_part_in_ten_thousand(machine):
    p = machine.truth[1]
    lines = np.array([120.0, 700.0, 1503.0, 2600.0, 3800.0])
    found = receptances(p, NOSE, [TIP], lines)[:, 0]
    s, stations, _ = build(p, [TIP, NOSE], refinement=2.0 * REFINEMENT)
    s.mass(stations[NOSE], p["sensor.mass"])
    stiffness, inertia, damping = s.matrices()
    load = np.zeros(s.size)
    load[2 * stations[TIP]] = 1.0
    w = 2.0 * np.pi * lines
    direct = [np.linalg.solve(stiffness + 1j * x * damping - x * x * inertia, load)[2 * stations[NOSE]] for x in w]
    np.testing.assert_allclose(found, direct, rtol=1e-4)


def test_a_machine_is_reciprocal_and_loses_energy(machine):
    p = {**machine.truth[0], "sensor.mass": 0.0}
    lines = machine.records[0].frequency_hz
    at_tip, at_nose = (receptances(p, seen, [TIP, NOSE], lines) for seen in (TIP, NOSE))
    np.testing.assert_allclose(at_tip[:, 1], at_nose[:, 0], rtol=1e-7)
    assert np.all(at_tip[:, 0].imag < 0.0)
    assert np.all(at_nose[:, 1].imag < 0.0)
    # The matrix of both points is dissipative, not its diagonal alone.
    lost = -np.stack([at_tip, at_nose], axis=1).imag
    assert np.all(np.linalg.eigvalsh(lost) > -1e-9 * np.abs(lost).max())


def test_the_sensor_lowers_frequencies(machine):
    p = machine.truth[0]
    heavy, light = (build(p, [TIP])[0] for _ in range(2))
    heavy.mass(0, 0.01)
    below = light.natural_frequencies(4000.0)
    assert np.all(heavy.natural_frequencies(4000.0)[: below.size] <= below)


def test_modes_of_the_spindle_sum_up_to_its_receptance(machine):
    p, lines = machine.truth[0], machine.records[0].frequency_hz
    true = plane_receptance(p, lines)

    def error(count):
        rows, rest = spindle_modes(p, count, lines)
        assert np.all(np.diff(rows[:, 0]) >= 0.0)
        assert np.all(rows[:, 2] >= 0.0)
        found = summed_modes(rows, lines) + rest
        return np.sqrt(np.mean(np.abs(found / true - 1.0) ** 2))

    assert error(9) < 0.02 < 0.5 * error(5)


def test_flutes_have_their_area_and_second_moment():
    p = {**draw_machine(SEED, end_mill=True).truth[0]}
    ring, shank = fluted(p), material(p, "tool", p["tool.diameter"])
    area, second = (lambda r, n=n: r.outer**n - r.inner**n for n in (2, 4))
    assert area(ring) / area(shank) == pytest.approx(p["flute.area"])
    assert second(ring) / second(shank) == pytest.approx(p["flute.second"])


def test_the_package_has_the_same_physics(machine):
    """With the true spindle as a table, and the cone in steps."""
    p, lines = machine.truth[0], machine.records[0].frequency_hz
    yy, tt, yt = plane_receptance(p, lines).T
    table = np.stack([np.stack([yy, yt], axis=1), np.stack([yt, tt], axis=1)], axis=1)

    def of(kind):
        names = ("youngs_modulus", "density", "poisson_ratio", "loss_factor")
        values = (p[f"{kind}.{name}"] for name in ("modulus", "density", "poisson", "loss"))
        return Material(**dict(zip(names, values, strict=True)))

    segments = []
    for i in range(section_count(p)):
        length, small, large, inner, core = (p[f"holder.{i}.{key}"] for key in SECTION)
        count = 1 if small == large else 4
        for piece in range(count):
            outer = small + (large - small) * (piece + 0.5) / count
            bore = p["tool.diameter"] if core else inner
            shape = {"length": length / count, "outer_diameter": outer, "inner_diameter": bore}
            segments.append(Segment(**shape, material=of("holder"), core=of("tool") if core else None))
    joint = PointJoint(**{name: p[f"joint.{name}"] for name in ("k_y", "k_theta", "c_y", "c_theta")}, name="joint")
    tool = Part([Segment(length=p["overhang"], outer_diameter=p["tool.diameter"], material=of("tool"))], name="tool")
    spindle = MeasuredPart(frequency_hz=lines, matrix=table, name="spindle")
    sensor = PointMass(mass=p["sensor.mass"], part="tool", name="sensor")
    found = Assembly([tool, joint, Part(segments, name="holder"), spindle], [sensor]).receptance(lines)
    assert np.max(np.abs(np.log(found / receptances(p, TIP, [TIP], lines)[:, 0]))) < 2e-3


def test_dimensions_deviate_by_their_tolerances():
    scores = []
    for seed in range(8):
        machine = draw_machine(1000 * SEED + seed)
        p = machine.truth[0]
        scores += [(p[name] - machine.numbers[name]) / sd for name, sd in machine.deviations.items()]
        for q, stated in zip(machine.truth, machine.overhangs, strict=True):
            scores.append((q["overhang"] - stated) / machine.overhang_deviation)
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], len(scores))
    assert low < np.sum(np.square(scores)) < high


def test_noise_is_what_is_stated(machine):
    record = machine.records[0]
    exact = receptances(machine.truth[0], TIP, [TIP], record.frequency_hz)[:, 0]
    error = np.log(record.receptance / exact)
    size = np.abs(exact)
    variance = 0.005**2 + 0.01**2 * (1.0 + (np.median(size) / size) ** 2) / 20.0
    low, high = stats.chi2.ppf([1e-4, 1.0 - 1e-4], 2 * error.size)
    assert low < np.sum(np.abs(error) ** 2 / variance) < high
    noise = 0.01**2 * (1.0 + (np.median(size) / size) ** 2)
    assert np.mean((1.0 - record.coherence) / noise) == pytest.approx(0.9, rel=0.1)


# Zeroth-order stability -----------------------------------------------------------------------------------------------


def _one_direction(lines):
    mass, natural, zeta = 0.03993, 2.0 * math.pi * 922.0, 0.011
    w = 2.0 * np.pi * lines
    receptance = np.zeros((lines.size, 2, 2), dtype=np.complex128)
    receptance[:, 0, 0] = 1.0 / (mass * (natural**2 - w**2 + 2j * zeta * natural * w))
    return receptance


def test_least_limit_of_a_slot_is_known():
    lines = np.arange(900.0, 980.0, 0.02)
    cut = Cut(teeth=2, k_t=6e8, k_n=2e8, immersion=1.0, feed="down")
    receptance = _one_direction(lines)
    limits = [stable_limit(cut, lines, receptance, speed) for speed in np.arange(5000.0, 7000.0, 5.0)]
    depth, chatter = min(limits)
    assert 1e3 * depth == pytest.approx(0.29805, rel=1e-4)
    assert chatter == pytest.approx(932.1, abs=0.1)


def test_a_cut_never_chatters_without_a_resonance():
    lines = np.arange(500.0, 1500.0, 1.0)
    cut = Cut(teeth=2, k_t=6e8, k_n=2e8, immersion=1.0, feed="down")
    stiff = np.zeros((lines.size, 2, 2), dtype=np.complex128)
    assert stable_limit(cut, lines, stiff, 9000.0)[0] == math.inf


@pytest.mark.parametrize("feed", ["down", "up"])
@pytest.mark.parametrize("immersion", [0.25, 0.5, 1.0])
def test_limits_of_the_package_agree(machine, feed, immersion):
    lines = np.arange(60.0, 6000.0, 0.5)
    tip = receptances(machine.truth[1], TIP, [TIP], lines)[:, 0]
    matrix = tip[:, None, None] * np.diag([1.0, 0.7])
    cut = {"teeth": 3, "k_t": 9e8, "k_n": 3e8, "immersion": immersion, "feed": feed}
    speeds = np.linspace(4000.0, 20000.0, 5)
    expected = stability_lobes(Milling(**cut), lines, matrix, speeds_rpm=speeds).depth
    found = [stable_limit(Cut(**cut), lines, matrix, speed)[0] for speed in speeds]
    np.testing.assert_allclose(found, expected, rtol=3e-3)


# Campaigns ------------------------------------------------------------------------------------------------------------


def test_a_machine_is_written_and_loaded(machine, tmp_path):
    loaded = campaign.load(write(machine, tmp_path, modes=7))
    assert len(loaded.to_identify) == 12
    record = machine.records[5]
    seen = loaded.to_identify[record.name]
    np.testing.assert_allclose(seen.receptance, record.receptance, rtol=1e-10)
    assert (seen.response.part, seen.response.position) == record.response
    assert seen.assembly.parts["tool"].length == pytest.approx(machine.overhangs[0])
    assert loaded.table.modal_parts["spindle"].identify
    errors = {error.name for error in loaded.errors_of(loaded.to_identify)}
    assert len(errors) == len(machine.deviations) + len(machine.overhangs)


def test_users_describe_an_end_mill_otherwise(tmp_path):
    machine = draw_machine(SEED, end_mill=True)
    loaded = campaign.load(write(machine, tmp_path, modes=7))
    flutes, shank = loaded.assemblies["o2"].parts["tool"].segments
    assert flutes.outer_diameter == pytest.approx(0.8 * shank.outer_diameter)
    assert flutes.length + shank.length == pytest.approx(machine.overhangs[2])
    assert len(loaded.assemblies["o2"].parts["holder"].segments) == 4
    assert section_count(machine.truth[0]) == 10
    assert set(loaded.cuts) == {f"c{number}" for number, _ in machine.cuts}
    assert machine.overhangs[0] < machine.overhangs[2] < machine.overhangs[1]
    cut = machine.cuts[1][1]
    assert all(getattr(loaded.cuts["c2"].cut, name) == value for name, value in vars(cut).items())


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_is_in_the_records_and_not_in_the_description(effect, tmp_path):
    plain, weak, strong = draw_machine(SEED), *(draw_machine(SEED, effect, u=u) for u in (0.0, 1.0))
    assert weak.numbers == strong.numbers == plain.numbers

    def away(machine):
        return max(
            np.sqrt(np.mean(np.abs(a.receptance / b.receptance - 1.0) ** 2))
            for a, b in zip(machine.records, plain.records, strict=True)
        )

    assert 1e-4 < away(weak) <= away(strong)
    described, hidden = (write(one, tmp_path, modes=5).read_text(encoding="utf-8") for one in (plain, strong))
    assert described == hidden
    assert set(FOREIGN) < set(EFFECTS)


def test_polarity_is_that_of_one_channel(machine):
    p, lines = machine.truth[0], np.array([500.0, 1000.0])
    effect = draw_machine(SEED, "reversed_polarity").effect
    ratios = {
        seen: recorded(p, effect, 0, seen, [TIP], lines) / recorded(p, None, 0, seen, [TIP], lines)
        for seen in (TIP, NOSE)
    }
    turned = NOSE if effect.fixed["at_nose"] else TIP
    np.testing.assert_allclose(ratios.pop(turned), -1.0)
    np.testing.assert_allclose([*ratios.values()], 1.0)


def test_a_section_deviates_at_both_ends(machine):
    p = true_deviation(machine.truth[0], "holder.2.large", 1e-3)
    assert p["holder.2.small"] - machine.truth[0]["holder.2.small"] == pytest.approx(1e-3)


def test_the_generator_does_not_import_the_library():
    texts = [path.read_text(encoding="utf-8") for path in (Path(__file__).parent / "generator").glob("*.py")]
    assert texts
    assert not any("import receptance" in text or "from receptance" in text for text in texts)
