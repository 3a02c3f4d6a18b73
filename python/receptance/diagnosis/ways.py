"""Which ways of acting of each cause are tried."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from receptance.diagnosis.adequacy import judge
from receptance.diagnosis.causes import Cause, UndecidableError, Variant
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.diagnosis.screening import Direction
from receptance.identification.observations import MeasuredFRF

__all__ = ["chosen_of", "ways_of"]

_WAYS = 3
"""Variants of one cause that are fitted, the most promising ones first."""
_FRESH_FROM = 0.3
"""Other quantities are only tried where the logarithm of the receptance is off by more than this, in the median."""


def ways_of(model: Model, causes: Sequence[Cause], fit: Fit) -> tuple[list[tuple[Cause, Variant]], dict[str, str]]:
    """Return the ways in which causes can act on a model with that fit, and why others cannot be decided."""
    found: list[tuple[Cause, Variant]] = []
    undecidable: dict[str, str] = {}
    inadequate = not judge(fit).passed
    for cause in causes:
        try:
            own = cause.variants(model)
        except UndecidableError as error:
            undecidable[cause.id] = str(error)
            continue
        own = [one for one in own if not one.fresh or _far_off(fit)]
        found += [(one.of(cause), one) for one in own if inadequate or not one.distant]
    return found, undecidable


def _far_off(fit: Fit) -> bool:
    """Return whether receptances are off by factors, as only another quantity makes them."""
    parts = fit.problem.parts(fit.residual)
    off = [
        float(np.median(np.abs(residual.reshape(2, -1)) * one.standard_deviation))
        for one, residual in zip(fit.model.observations, parts, strict=True)
        if isinstance(one, MeasuredFRF)
    ]
    return bool(off) and max(off) > _FRESH_FROM


def chosen_of(found: Sequence[Direction], penalty: float) -> list[Direction]:
    """Return the variants that are fitted: of each cause those that promise most evidence."""

    def promised(one: Direction) -> float:
        return one.score - penalty * one.count

    by_cause: dict[str, list[Direction]] = {}
    for one in found:
        by_cause.setdefault(one.cause.id, []).append(one)
    chosen = []
    for own in by_cause.values():
        ranked = sorted(own, key=lambda one: -promised(one))
        # What has no number of its own promises nothing to first order, and is fitted in any case.
        chosen += [one for one in ranked if not one.names]
        chosen += [one for one in ranked if one.names][:_WAYS]
    return sorted(chosen, key=lambda one: -promised(one))
