"""One case: its draw, the verdict, and what the scoring needs of both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from blind.outcome import Outcome, sizes_covered
from real.cases import ANSWERS, CLEAR, LOOK_ALIKES, Draw, Fit, draw

SIZES: dict[str, tuple[str, Callable[[float], float]]] = {
    "sensor_mass": ("mass", float),
    "suspension": ("stiffness", float),
    "calibration_gain": ("gain", np.log1p),
    "time_delay": ("delay", float),
    "exponential_window": ("rate", float),
    "coarse_resolution": ("end", float),
}
"""Effects whose size the package states as one number, and how ours becomes it."""


def run_case(
    seed: int, index: int, structure: str, effect: str, ask: Callable[[Any], Any], fit: Fit, aim: float | None = None
) -> Outcome:
    """Draw a case, run the diagnosis, and compare with the truth."""
    drawn = draw(seed, index, structure, effect, fit, aim)
    return outcome_of(seed, index, structure, drawn, ask(drawn.case))


def outcome_of(seed: int, index: int, structure: str, drawn: Draw, answer: Any) -> Outcome:
    """Return the outcome of an answer; its `oracle` holds what the laboratory knows of the size."""
    effect = drawn.effect
    names = () if effect is None else (effect.id,)
    others = () if effect is None else (*ANSWERS[effect.id], *LOOK_ALIKES.get((structure, effect.id), ()))
    shifts = np.array(drawn.shifts)
    return Outcome(
        seed=seed,
        index=index,
        kind=structure,
        effects=names,
        sizes=() if effect is None else tuple(effect.sizes.values()),
        large=drawn.ratio > CLEAR,
        oracle={
            "ratio": drawn.ratio,
            "aim": None if effect is None else effect.aim,
            "support": drawn.support,
            "shift_percent": 100.0 * float(np.abs(shifts).max(initial=0.0)),
            "discrepancy_percent": 100.0 * drawn.discrepancy,
            "modes": len(drawn.modes_hz),
            "records": [record.label for record in drawn.case.records],
        },
        verdict=answer.verdict,
        reported=tuple(answer.reported),
        together=tuple(answer.together),
        same=tuple(id for id in answer.reported if id in others and id not in names),
        seconds=answer.seconds,
        misfit=answer.misfit,
        misfit_after=answer.misfit_after,
        share=None,
        covered=(),
        size_covered=() if effect is None else sizes_covered([effect], answer.sizes, SIZES),
        error=answer.error,
        candidates=list(answer.candidates),
        next_measurement=answer.next_measurement,
    )
