"""Random calls of the extension: a short part of what `random_calls.py` makes a million of."""

from __future__ import annotations

import os

import pytest

from bindings.random_calls import calls, run
from receptance import Assembly, Part, Segment
from receptance.model.beams import STEEL

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "1"))


def test_undamaged_calls_return() -> None:
    for function, arguments in calls().values():
        function(**arguments)


def test_damaged_calls_return_or_raise() -> None:
    print(f"seed {SEED}")
    counts, failures, _ = run(SEED, 0, 30_000)
    assert not failures, "\n".join(failures[:10])
    for name in calls():
        assert counts[name, "answered"] > 50, name
        assert counts[name, "refused"] > 50, name


def test_too_many_modes_are_refused_before_allocation() -> None:
    bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    with pytest.raises(ValueError, match="2147483648 modes are asked for, expected at most 100000"):
        bar.lowest_natural_frequencies(2**31)
