"""The scoring rule, on outcomes made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from blind.bridge import Answer
from real.cases import Case, Draw, Effect
from real.outcome import outcome_of
from real.score import rightly, table, wrongly

NAN = float("nan")
EMPTY = Case("modelab", ())


def outcome(effect, verdict, *reported, ratio=10.0, structure="modelab", sizes=None, index=0, support=20.0):
    """Return the outcome of an answer to a hidden effect, or to nothing."""
    hidden = None if effect is None else effect if isinstance(effect, Effect) else Effect(effect)
    answer = Answer(
        verdict, reported, (), sizes or {}, True, 50.0, NAN, 1.0, {}, {}, candidates=[(c, 1.0, 1.0) for c in reported]
    )
    drawn = Draw(EMPTY, EMPTY, hidden, ratio=ratio if hidden else 0.0, support=support)
    return outcome_of(1, index, structure, drawn, answer)


@pytest.mark.parametrize("verdict", ["named", "partly explained", "a word of a later version"])
def test_any_other_word_names(verdict):
    right = outcome("sensor_mass", verdict, "sensor_mass")
    assert rightly(right)
    assert not wrongly(right)
    wrong = outcome("sensor_mass", verdict, "calibration_gain")
    assert wrongly(wrong)
    assert not rightly(wrong)
    false_call = outcome(None, verdict, "sensor_mass")
    assert wrongly(false_call)
    assert not rightly(false_call)
    # A name beside the right one is wrong, and so is a verdict that names without a name.
    both = outcome("sensor_mass", verdict, "sensor_mass", "calibration_gain")
    assert wrongly(both)
    assert not rightly(both)
    assert wrongly(outcome("sensor_mass", verdict))


def test_look_alikes_are_declared_for_one_structure():
    assert rightly(outcome("frequency_scale", "named", "tool_modulus"))
    assert wrongly(outcome("frequency_scale", "named", "tool_density"))
    assert wrongly(outcome("frequency_scale", "named", "tool_modulus", structure="brake_reuss"))
    assert wrongly(outcome("sensor_mass", "named", "tool_modulus"))
    assert rightly(outcome("reversed_polarity", "named", "wrong_quantity", structure="brake_reuss"))
    assert wrongly(outcome("reversed_polarity", "named", "wrong_quantity"))


def test_ambiguous_among_right_answers_is_right():
    assert rightly(outcome("frequency_scale", "ambiguous", "frequency_scale", "tool_modulus"))
    assert not rightly(outcome("frequency_scale", "ambiguous", "frequency_scale", "sensor_mass"))
    assert not rightly(outcome("sensor_mass", "suspected", "sensor_mass"))
    assert not rightly(outcome("sensor_mass", "unexplained"))
    assert not rightly(outcome(None, "ambiguous", "sensor_mass"))


def test_sizes_count_where_the_effect_is_named_rightly():
    mass = Effect("sensor_mass", {"mass": 0.05})
    holds = outcome(mass, "named", "sensor_mass", sizes={"sensor_mass": {"mass": (0.05, 0.04, 0.06)}})
    misses = outcome(mass, "named", "sensor_mass", sizes={"sensor_mass": {"mass": (0.07, 0.06, 0.08)}})
    other = outcome(mass, "named", "time_delay", sizes={"time_delay": {"delay": (0.0, -1.0, 1.0)}})
    quiet = outcome(mass, "suspected", "sensor_mass", sizes={"sensor_mass": {"mass": (0.05, 0.04, 0.06)}})
    gain = outcome(
        Effect("calibration_gain", {"gain": -0.5}), "named", "calibration_gain",
        sizes={"calibration_gain": {"log_gain": (np.log(0.5), np.log(0.4), np.log(0.6))}},
    )  # fmt: skip
    assert (holds.size_covered, misses.size_covered, gain.size_covered) == ((True,), (False,), (True,))
    line = by_name([holds, misses, other, quiet, gain])["95 % intervals cover the hidden size"]
    assert (line.hits, line.trials) == (2, 3)


def by_name(outcomes):
    return {line.name: line for line in table(outcomes)[0]}


def counts(outcomes, name):
    line = by_name(outcomes)[name]
    return line.hits, line.trials


def test_table_counts_each_case_once():
    cases = [
        outcome(None, "adequate"),
        outcome(None, "unexplained"),
        outcome(None, "suspected", "time_delay"),
        outcome(None, "named", "time_delay"),
        outcome("sensor_mass", "named", "sensor_mass"),
        outcome("sensor_mass", "partly explained", "sensor_mass"),
        outcome("sensor_mass", "named", "time_delay"),
        outcome("sensor_mass", "unexplained"),
        outcome("sensor_mass", "suspected", "sensor_mass"),
        outcome("sensor_mass", "failed"),
        outcome("sensor_mass", "unexplained", support=13.8),
        outcome("sensor_mass", "adequate", ratio=2.9),
        outcome("sensor_mass", "named", "sensor_mass", ratio=2.9),
        outcome("sensor_mass", "named", "time_delay", ratio=2.9),
    ]
    assert counts(cases, "nothing hidden: a cause named") == (1, 4)
    assert counts(cases, "  suspected or ambiguous") == (1, 4)
    assert counts(cases, "clear effect: rightly") == (2, 7)
    assert counts(cases, "  where the data can support it") == (2, 6)
    assert counts(cases, "clear effect: wrongly") == (1, 7)
    assert counts(cases, "  first candidate is right") == (3, 7)
    assert counts(cases, "  suspected or ambiguous, right among") == (1, 7)
    assert counts(cases, "  unexplained") == (2, 7)
    assert counts(cases, "  adequate") == (0, 7)
    assert counts(cases, "smaller effect: rightly") == (1, 3)
    assert counts(cases, "smaller effect: wrongly") == (1, 3)
    assert counts(cases, "diagnoses that failed") == (1, 14)
