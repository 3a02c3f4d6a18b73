"""Fits from far of models with values that are free at every level of something, as of drawbar force.

Free values of many levels are too many to be found from far together; at one level there are a few. One level is fitted
from far, the others from their neighbours' values, and what they share begins in the middle of what they say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from receptance.diagnosis.adequacy import judge
from receptance.diagnosis.fitting import Fit, fit_base, refit
from receptance.diagnosis.model import Model
from receptance.identification.laws import Law
from receptance.identification.observations import MeasuredFRF
from receptance.identification.task import Observation, place_of

__all__ = ["fit_again", "fit_from_far", "has_levels"]

_WORSE = 1.5
"""A level that its neighbour's values leave so many times worse than that one is fitted from far as well."""


@dataclass(frozen=True)
class _Level:
    """A configuration: the free laws that it has, where they go along, and what was observed."""

    name: str
    laws: tuple[str, ...]
    along: tuple[float, ...]
    observations: tuple[Observation, ...]

    def of(self, model: Model) -> Model:
        return model.of(self.observations)

    def renamed(self, values: Mapping[str, float], other: _Level) -> dict[str, float]:
        """Return values of this level as those where another one begins."""
        return {**values, **{f"{law} @ {other.name}": values[f"{law} @ {self.name}"] for law in self.laws}}


def _silent(text: str) -> None:
    pass


def has_levels(model: Model) -> bool:
    """Return whether a model has values that are free at several levels, each of which has some."""
    return bool(_kinds(model))


def fit_from_far(
    model: Model, *, seed: int = 0, threads: int | None = None, say: Callable[[str], None] = _silent
) -> Fit:
    """Return the model fitted from far: by level where it has levels, else all together; `say` is told of each fit."""
    fit = _by_level(model, _kinds(model), False, seed, threads, say)
    if fit is None:
        say("the model as it is")
        fit = fit_base(model, seed=seed, threads=threads)
    return fit


def fit_again(before: Fit, *, seed: int = 0, threads: int | None = None) -> Fit | None:
    """Return a model fitted from far again; None where it has levels and is not seen to explain one by itself.

    Where the fit before left most is where that shows first.
    """
    left = before.by_configuration
    kinds = sorted(_kinds(before.model), key=lambda kind: -max(left[level.name] for level in kind))
    if not kinds:
        return fit_base(before.model, seed=seed, threads=threads)
    return _by_level(before.model, kinds, True, seed, threads)


def _by_level(
    model: Model,
    kinds: Sequence[Sequence[_Level]],
    gate: bool,
    seed: int,
    threads: int | None,
    say: Callable[[str], None] = _silent,
) -> Fit | None:
    """Return a model fitted level after level, then all together; None without levels, and if one fails the gate."""
    begun: list[tuple[int, Fit]] = []
    for kind in kinds:
        # Where one level's fit goes astray another one's need not.
        tried = dict.fromkeys((len(kind) // 2, 0, len(kind) - 1)) if gate else [len(kind) // 2]
        for at in tried:
            say(f"the model as it is, {kind[at].name}")
            first = fit_base(kind[at].of(model), seed=seed, threads=threads)
            if not gate or judge(first).passed:
                begun.append((at, first))
                break
        else:
            return None
    found = [first.values for _, first in begun]
    for kind, (at, first) in zip(kinds, begun, strict=True):
        for onwards in (kind[at:], kind[at::-1]):
            found += _carried_on(model, onwards, first, seed, threads, say)
    if not found:
        return None
    names = dict.fromkeys(name for values in found for name in values)
    start = {name: float(np.median([values[name] for values in found if name in values])) for name in names}
    say("the model as it is, all levels together")
    return refit(model, start, threads=threads)


def _carried_on(
    model: Model,
    levels: Sequence[_Level],
    before: Fit,
    seed: int,
    threads: int | None,
    say: Callable[[str], None],
) -> Iterable[dict[str, float]]:
    """Yield the values of all levels but the first, each fitted from those of the one before."""
    for last, level in pairwise(levels):
        own = level.of(model)
        say(f"the model as it is, {level.name}")
        fit = refit(own, last.renamed(before.values, level), threads=threads)
        if fit.misfit > _WORSE * max(before.misfit, 1.0):
            far = fit_base(own, seed=seed, threads=threads)
            fit = min(fit, far, key=lambda one: one.chi_square)
        yield fit.values
        before = fit


def _kinds(model: Model) -> list[list[_Level]]:
    """Return the levels in their order, those with the same free laws together; none where one level says it all."""
    laws = [one for one in model.unknowns if isinstance(one, Law) and one.free]
    if not laws or not all(isinstance(one, MeasuredFRF) for one in model.observations):
        return []
    own: dict[str, list[Observation]] = {}
    for index, one in enumerate(model.observations):
        own.setdefault(place_of(one, index).configuration, []).append(one)
    kinds: dict[tuple[str, ...], list[_Level]] = {}
    known = {unknown.name for unknown in model.task().parameters.unknowns}
    for name, observations in own.items():
        there = [law for law in laws if f"{law.name} @ {name}" in known]
        if not there:
            return []
        along = tuple(float(observations[0].conditions.get(law.along, 0.0)) for law in there)
        level = _Level(name, tuple(law.name for law in there), along, tuple(observations))
        kinds.setdefault(level.laws, []).append(level)
    if max(len(levels) for levels in kinds.values()) < 2:
        return []
    return [sorted(levels, key=lambda level: level.along) for levels in kinds.values()]
