"""Random calls of the extension: a short part of what `random_calls.py` makes a million of."""

from __future__ import annotations

import os
import sys
import threading
from collections import Counter
from types import FrameType
from typing import Any

import pytest

from bindings.random_calls import calls, exported, run
from receptance import Assembly, Part, Segment
from receptance.model.beams import STEEL

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "1"))


def test_undamaged_calls_return() -> None:
    for function, arguments in calls().values():
        function(**arguments)


@pytest.mark.parametrize("name", exported())
def test_every_function_is_called_with_every_argument(name: str) -> None:
    entries = {entry: call for entry, call in calls().items() if entry.split(" ")[0] == name}
    assert entries, f"{name} is exported by the extension, but not called with damaged arguments"
    damaged = {argument for _, arguments in entries.values() for argument in arguments}
    assert exported()[name] <= damaged
    seen: list[str] = []

    def record(frame: FrameType, event: str, function: Any) -> None:
        del frame
        if event == "c_call" and function.__module__ in (None, "receptance._core"):
            seen.append(function.__qualname__)

    for function, arguments in entries.values():
        seen.clear()
        threading.setprofile(record)
        sys.setprofile(record)
        try:
            answer = function(**arguments)
        finally:
            sys.setprofile(None)
            threading.setprofile(None)  # type: ignore[arg-type]
        # The interpreter reports neither classes nor `len`.
        assert name in seen or type(answer).__name__ == name or name.endswith("__len__")


def test_damaged_calls_return_or_raise() -> None:
    print(f"seed {SEED}")
    counts, failures, _ = run(SEED, 0, 30_000)
    assert not failures, "\n".join(failures[:10])
    pooled: Counter[tuple[str, str]] = Counter()
    for (entry, outcome), count in counts.items():
        pooled[entry.split(" ")[0], outcome] += count
    for name, arguments in exported().items():
        assert pooled[name, "answered"] > 20, name
        # Only calls without arguments are never refused.
        assert pooled[name, "refused"] > 20 or not (arguments or "." in name), name


def test_too_many_modes_are_refused_before_allocation() -> None:
    bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    with pytest.raises(ValueError, match="2147483648 modes are asked for, expected at most 100000"):
        bar.lowest_natural_frequencies(2**31)
