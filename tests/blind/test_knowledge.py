"""Levels of knowledge of the holder: their data agree with the package, and the score follows the rules."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from blind.bridge import ask, holder_of, observations_of, tolerances_of
from blind.generator import LEVELS, Modes, Table, draw_case
from blind.generator.case import true_numbers, where_of
from blind.generator.knowledge import ENTRIES, holder_matrix, modes_of
from blind.outcome import Outcome, run_case
from blind.score import of_level, table

pytestmark = pytest.mark.slow

SEED = 20261202
"""Fixed: how well a blank shows a holder differs much between draws, and `benches/blind.py --holder` counts them."""
DATA = LEVELS[1:]
JOINT = ["joint_hysteretic_loss", "calibration_gain", "time_delay", "tool_density", "holder_modulus"]


def true_holder(case, truth):
    """Return the actual numbers of the holder of a case without effects that came later."""
    where = where_of(truth, case.nominal.configurations[0], case.records[0].level, 1)
    return true_numbers(case.nominal, truth, truth.joint, truth.errors, (), where)


@pytest.mark.parametrize("level", DATA)
def test_data_of_a_holder_are_those_of_its_finite_elements(level):
    case, truth = draw_case(SEED, 1, "nothing", quick=True, knowledge=level)
    holder = holder_of(case)
    record = case.records[0].estimate
    lines = record.frequency_hz
    if level == "measured":
        assert holder.end.covers(lines).all(), SEED
    if level == "blank":
        # Most lines of a free holder are poorly determined by a slender blank.
        lines = holder.end.frequency_hz
        assert lines.size > 30, SEED
    complex_lines = lines - 1j * record.decay_rate / (2.0 * np.pi) if record.decay_rate else lines
    exact = holder_matrix(true_holder(case, truth), complex_lines)
    stated = holder.end.receptance(complex_lines)
    # Relative to a typical size, because errors at antiresonances are large.
    size = np.abs(exact) + 0.02 * np.abs(exact).max(axis=0)
    off = np.median(np.abs(stated - exact) / size, axis=0)
    assert np.all(off < (0.1 if level == "blank" else 0.015)), (SEED, off)
    assert np.all(off > 1e-6), "the data have no noise"
    observed = observations_of(case, holder)
    assert len(observed) == len(case.records)
    names = {address.split(".")[0] for one in tolerances_of(case.nominal, holder) for address in one.moves}
    assert names == ({"tool", "holder"} if level == "modes" else {"tool"})


def test_modes_are_complete_within_their_uncertainty():
    case, truth = draw_case(SEED, 2, "nothing", quick=True, knowledge="modes")
    p = true_holder(case, truth)
    rows, residuals = modes_of(p)
    lines = np.linspace(150.0, 7000.0, 60)
    s = 2j * np.pi * lines
    found = np.zeros((lines.size, 2, 2), dtype=np.complex128)
    for frequency, damping, *shape in rows:
        w = 2.0 * np.pi * frequency
        found += np.outer(shape, shape) / (w * w + 2.0 * damping * w * s + s * s)[:, None, None]
    found += np.array([[residuals[0], residuals[2]], [residuals[2], residuals[1]]])
    exact = holder_matrix(p, lines)
    for i, j in ENTRIES:
        size = np.abs(exact[:, i, j]) + 0.02 * np.abs(exact[:, i, j]).max()
        assert np.max(np.abs(found[:, i, j] - exact[:, i, j]) / size) < 0.02, (SEED, i, j)
    assert isinstance(case.known, Modes)
    deviation = np.sqrt(np.diag(case.known.covariance))
    exact_numbers = np.concatenate([rows.ravel(), residuals])
    stated = np.concatenate([case.known.rows.ravel(), case.known.residuals])
    kept = deviation > 0.0
    assert np.array_equal(stated[~kept], exact_numbers[~kept])
    assert np.max(np.abs(stated - exact_numbers)[kept] / deviation[kept]) < 5.0, SEED


def test_numbers_of_a_drawing_are_off_by_one_per_cent():
    case, truth = draw_case(SEED, 3, "nothing_exact", quick=True, knowledge="drawing")
    stated = [one for one in case.nominal.tolerances if one.name.startswith("holder")]
    assert len(stated) == 12
    assert {share for one in stated for share in one.moves.values()} == {0.01}
    actual = true_holder(case, truth)
    assert all(actual[one.name] != case.nominal.numbers[one.name] for one in stated)
    assert len(tolerances_of(case.nominal)) == len(case.nominal.tolerances)
    assert case.known is None


def test_ordinary_cases_are_unchanged():
    ordinary, truth = draw_case(SEED, 4, "single", ("time_delay",), quick=True)
    for level in ("measured", "modes"):
        data, of_data = draw_case(SEED, 4, "single", ("time_delay",), quick=True, knowledge=level)
        assert data.nominal.configurations == ordinary.nominal.configurations
        assert not any(one.name.startswith("holder") for one in data.nominal.tolerances)
        assert of_data.effects == truth.effects
    assert (ordinary.knowledge, ordinary.known, truth.within) == ("", None, ())


@pytest.mark.slow
def test_data_contain_errors_of_the_holder_and_not_later_changes():
    hidden, truth = draw_case(SEED, 5, "single", ("holder_modulus",), u=0.9, quick=True)
    case, contained = draw_case(SEED, 5, "single", ("holder_modulus",), u=0.9, quick=True, knowledge="measured")
    assert (truth.within, contained.within, contained.effects) == ((), ("holder_modulus",), ())
    assert hidden.nominal.numbers["holder.modulus"] != case.nominal.numbers["holder.modulus"]
    answer = ask(case, causes=JOINT)
    assert answer.verdict == "adequate", (SEED, answer)
    case, changed = draw_case(SEED, 6, "outside", ("ring_on_nose",), u=0.9, quick=True, knowledge="measured")
    assert [effect.id for effect in changed.effects] == ["ring_on_nose"]
    assert isinstance(case.known, Table)
    p = true_holder(case, changed)
    exact = holder_matrix(p, case.known.frequency_hz + case.known.decay_rate / (2j * np.pi))
    assert np.median(np.abs(case.known.matrix[:, 0, 0] / exact[:, 0, 0] - 1.0)) < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("level", LEVELS)
def test_a_large_effect_of_the_measurement_is_found_at_every_level(level):
    asked = functools.partial(ask, causes=JOINT)
    hidden = run_case(SEED, 0, "single", ("time_delay",), asked, quick=True, u=0.95, oracle=False, knowledge=level)
    assert hidden.in_set, (SEED, hidden)
    none = run_case(SEED, 10, "nothing", (), asked, quick=True, oracle=False, knowledge=level)
    assert none.verdict in ("adequate", "suspected"), (SEED, none)


def outcome(kind, effects, verdict, reported=(), **given):
    fields = {
        "seed": 0, "index": 0, "kind": kind, "effects": effects, "sizes": (0.5,) * len(effects), "large": True,
        "oracle": {"gain": 100.0, "misfit_true": 1.0}, "verdict": verdict, "reported": reported, "together": (),
        "same": (), "seconds": 1.0, "misfit": 2.0, "misfit_after": 1.0, "share": None, "covered": (),
        "size_covered": (), "knowledge": "measured",
    }  # fmt: skip
    return Outcome(**(fields | given))


def test_levels_are_scored_by_their_rules():
    def hits(*outcomes):
        return {
            line.name.split(": ", 1)[1].strip(): (line.hits, line.trials) for line in of_level("measured", outcomes)[0]
        }

    changed = outcome("single", ("suspension",), "named", ("sensor_mass",))
    assert changed.elsewhere
    assert not replace(changed, knowledge="drawing").elsewhere
    rows = hits(changed, replace(changed, verdict="unexplained", reported=()))
    assert rows["the holder changed, or a joint along its bore: named"] == (1, 2)
    assert rows["all cases: named wrong"] == (1, 2)
    assert rows["one effect, large enough: in the reported set"] == (0, 0)
    contained = outcome("single", (), "suspected", ("tool_density",), within=("holder_modulus",))
    assert hits(contained)["an error of the holder, which the data contain: the same"] == (1, 1)
    moved = outcome("single", ("missing_mode",), "named", ("spindle_mode",), knowledge="modes")
    lines, _ = of_level("modes", [moved])
    assert next(line for line in lines if line.name.endswith("along its bore: named")).hits == 0
    right = outcome("single", ("time_delay",), "named", ("time_delay",))
    assert hits(right)["one effect, large enough: rightly and uniquely named"] == (1, 1)
    # Each level has lines of its own, and ordinary cases keep theirs.
    names = [line.name for line in table([right, moved, replace(right, knowledge="")])[0]]
    assert len(names) == len(set(names))
    assert {name.split(":")[0] for name in names} > {"measured", "modes", "diagnoses that failed"}
