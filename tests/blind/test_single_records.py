"""One of several records of a foreign laboratory is wrong: the cause is named in that record and in no other.

Every run draws new cases from a seed that it prints; RECEPTANCE_TEST_SEED repeats one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from blind.bridge import Answer, ask
from blind.generator.effects import ACTS, Where, draw_effect
from blind.neighbours import COVERED, NEIGHBOURS, Kind, draw_neighbour
from blind.neighbours.kind import Change, Draw
from blind.seeds import fresh_seed

SEED = fresh_seed()
CHAIN = (
    "sensor_mass",
    "hammer_offset",
    "time_delay",
    "calibration_gain",
    "exponential_window",
    "wrong_quantity",
    "coarse_resolution",
)
"""Effects of the laboratory that can act in one record."""


def in_one_record(id: str) -> Kind:
    """Return an effect of the laboratory that acts in one record only."""

    def draw(d: Draw) -> Change:
        only = d.record()
        effect = draw_effect(d.rng, id, d.u, d.numbers)

        def structure(p: dict[str, float], where: Where) -> None:
            if only(where):
                ACTS[id](p, effect.sizes, effect.fixed, where)

        return Change(structure=structure)

    return Kind(id, "measurement", "One record only.", draw)


def wrong_clock(d: Draw) -> Change:
    """The clock of one record is off."""
    only, scale = d.record(), 1.0 + 0.015 * d.u * d.sign()

    def analysis(e, p, where):
        # The analyser divides accelerations by the frequencies that it states.
        return replace(e, frequency_hz=e.frequency_hz / scale, receptance=e.receptance * scale**2) if only(where) else e

    return Change(analysis=analysis)


RECORDS = {
    **{id: in_one_record(id) for id in CHAIN},
    "frequency_scale": Kind("frequency_scale", "measurement", "The clock of one record is off.", wrong_clock),
    "reversed_polarity": COVERED["reversed_record"],
}


def answers_on(monkeypatch: pytest.MonkeyPatch, id: str, seed: int, u: float = 1.0) -> Iterator[tuple[Answer, str]]:
    """Yield the answers of the program to three cases, and the labels of the wrong records.

    One of a thousand cases has such errors of the tolerances that it is not adequate without the wrong record either:
    it is left out.
    """
    monkeypatch.setitem(NEIGHBOURS, id, RECORDS[id])
    for i in range(3):
        neighbour = draw_neighbour(seed, list(RECORDS).index(id) + 100 * i, id, u=u, quick=True)
        if ask(neighbour.twin.case).verdict != "adequate":
            continue
        pairs = zip(neighbour.seen.case.records, neighbour.twin.case.records, strict=True)
        (wrong,) = [
            seen.label
            for seen, twin in pairs
            if not np.array_equal(seen.estimate.receptance, twin.estimate.receptance)
            or not np.array_equal(seen.estimate.frequency_hz, twin.estimate.frequency_hz)
        ]
        answer = ask(neighbour.seen.case)
        print(f"RECEPTANCE_TEST_SEED={seed}: {id} in {wrong}: {answer.verdict} {answer.reported} {answer.variants}")
        yield answer, wrong


@pytest.mark.parametrize(
    "id",
    [
        "reversed_polarity",
        "calibration_gain",
        "time_delay",
        *(
            pytest.param(id, marks=pytest.mark.slow)
            for id in RECORDS
            if id not in ("reversed_polarity", "calibration_gain", "time_delay")
        ),
    ],
)
def test_the_cause_is_found_in_that_record(id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One record has little weight: up to two of three errors may not show, but none has another name."""
    for answer, wrong in answers_on(monkeypatch, id, SEED):
        if answer.reported:
            assert answer.reported == (id,)
            assert answer.verdict in ("named", "suspected"), answer.notes
            assert all(variant.endswith(f"record {wrong}") for variant in answer.variants)
            return
    pytest.fail("no error was reported")
