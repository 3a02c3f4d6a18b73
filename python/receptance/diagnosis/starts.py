"""Starting values of fits: of causes, and of models with values that are free at every level of a condition.

Free values at many levels, as of the drawbar force, are too many to be fitted together from their starting values. One
level is fitted first, the others from the values of their neighbours, and shared unknowns start at the median of all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from receptance.diagnosis.adequacy import judge
from receptance.diagnosis.fitting import Fit, fit_base, refit
from receptance.diagnosis.model import Model
from receptance.diagnosis.screening import Direction
from receptance.diagnosis.thresholds import JOINT_FACTORS, LARGE_SIZE, WORSE_LEVEL
from receptance.identification.laws import Law
from receptance.identification.observations import MeasuredFRF, Observation

__all__ = ["fit_anew", "fit_levels", "has_levels", "starts_of", "starts_together"]


def starts_of(direction: Direction, fit: Fit) -> list[dict[str, float]]:
    """Return starting values for fits of a cause: null, the linear estimate, and large sizes of either sign.

    Secondary parameters also start at their typical values, because the linear estimate of these is inaccurate. A cause
    without parameters is fitted from several multiples of the joint stiffnesses.
    """
    values = fit.values
    if not direction.parameters:
        joints = {a for field in ("k_y", "k_theta", "k_ytheta") for a in fit.model.joint_addresses(field)}
        stiff = [u.name for u in fit.task.parameters.unknowns if u.address in joints]
        return [{**values, **{name: times * values[name] for name in stiff}} for times in JOINT_FACTORS]
    parameters = direction.parameters
    null = {name: one.start for name, one in parameters.items()}
    starts = [null]
    if direction.estimate:
        starts.append({**null, **direction.estimate})
        starts.append({name: null[name] if one.secondary else starts[-1][name] for name, one in parameters.items()})
    for times in (LARGE_SIZE, -LARGE_SIZE):
        large = {
            name: one.typical
            if one.secondary
            else min(max(one.null + times * (one.typical - one.null), one.lower), one.upper)
            for name, one in parameters.items()
        }
        starts.append(large)
    different = [one for i, one in enumerate(starts) if one not in starts[:i]]
    return [{**values, **one} for one in different]


def starts_together(base: Fit, alone: Sequence[Fit], root: Fit) -> list[dict[str, float]]:
    """Return starting values for a fit of several causes from fits of the added cause alone.

    The joint of such a fit may be closer to the solution than that of the other causes.
    """
    own = {name: value for name, value in root.values.items() if name not in base.values}
    return [{**root.values, **one.values, **own} for one in alone]


@dataclass(frozen=True)
class _Level:
    """A configuration with free values of laws.

    Attributes
    ----------
    name : str
        Name of the configuration.
    laws : tuple of Law
        Laws with a free value in it.
    along : tuple of float
        Values of their conditions.
    observations : tuple of MeasuredFRF and MeasuredFrequencies
        Its observations.
    """

    name: str
    laws: tuple[Law, ...]
    along: tuple[float, ...]
    observations: tuple[Observation, ...]

    def of(self, model: Model) -> Model:
        """Return the model of its observations."""
        return model.select(self.observations)

    def values_for(self, values: Mapping[str, float], other: _Level) -> dict[str, float]:
        """Return values of this level as starting values of another one."""
        return {**values, **{law.name_in(other.name): values[law.name_in(self.name)] for law in self.laws}}


def _ignore(text: str) -> None:
    """Ignore a progress message."""


def has_levels(model: Model) -> bool:
    """Return whether a model has values that are free in several configurations, and some in each of them."""
    return bool(_group_levels(model))


def fit_levels(model: Model, *, seed: int = 0, threads: int | None = None, say: Callable[[str], None] = _ignore) -> Fit:
    """Return the model fitted from its own starting values: level by level where it has levels.

    Parameters
    ----------
    model : Model
        The model.
    seed : int
        Seed of the fits.
    threads : int, optional
        As in `Assembly.receptance`.
    say : callable, optional
        Called with a progress message before each fit.
    """
    fit = _fit_by_level(model, _group_levels(model), False, seed, threads, say)
    if fit is None:
        say("the model as it is")
        fit = fit_base(model, seed=seed, threads=threads)
    return fit


def fit_anew(before: Fit, *, seed: int = 0, threads: int | None = None) -> Fit | None:
    """Return a fitted model fitted again from its own starting values.

    None is returned where the model has levels and explains no level of one kind by itself. The kinds with the largest
    residuals are tried first.
    """
    left = before.by_configuration
    kinds = sorted(_group_levels(before.model), key=lambda kind: -max(left[level.name] for level in kind))
    if not kinds:
        return fit_base(before.model, seed=seed, threads=threads)
    return _fit_by_level(before.model, kinds, True, seed, threads)


def _fit_by_level(
    model: Model,
    kinds: Sequence[Sequence[_Level]],
    gate: bool,
    seed: int,
    threads: int | None,
    say: Callable[[str], None] = _ignore,
) -> Fit | None:
    """Return a model fitted level by level, then on all levels together.

    None is returned without levels, and with `gate` where no level of a kind passes the test of adequacy.
    """
    first_fits: list[tuple[int, Fit]] = []
    for kind in kinds:
        # The fit of one level may end in a local minimum where that of another one does not.
        tried = dict.fromkeys((len(kind) // 2, 0, len(kind) - 1)) if gate else [len(kind) // 2]
        for at in tried:
            say(f"the model as it is, {kind[at].name}")
            first = fit_base(kind[at].of(model), seed=seed, threads=threads)
            if not gate or judge(first).passed:
                first_fits.append((at, first))
                break
        else:
            return None
    found = [first.values for _, first in first_fits]
    for kind, (at, first) in zip(kinds, first_fits, strict=True):
        for direction in (kind[at:], kind[at::-1]):
            found += _continue(model, direction, first, seed, threads, say)
    if not found:
        return None
    names = dict.fromkeys(name for values in found for name in values)
    start = {name: float(np.median([values[name] for values in found if name in values])) for name in names}
    say("the model as it is, all levels together")
    return refit(model, start, threads=threads)


def _continue(
    model: Model,
    levels: Sequence[_Level],
    before: Fit,
    seed: int,
    threads: int | None,
    say: Callable[[str], None],
) -> Iterable[dict[str, float]]:
    """Yield the values of all levels but the first, each fitted from those of its neighbour."""
    for last, level in pairwise(levels):
        own = level.of(model)
        say(f"the model as it is, {level.name}")
        fit = refit(own, last.values_for(before.values, level), threads=threads)
        if fit.misfit > WORSE_LEVEL * max(before.misfit, 1.0):
            far = fit_base(own, seed=seed, threads=threads)
            fit = min(fit, far, key=lambda one: one.chi_square)
        yield fit.values
        before = fit


def _group_levels(model: Model) -> list[list[_Level]]:
    """Return the levels in ascending order, grouped by their free laws; none where no group has two levels."""
    laws = [one for one in model.unknowns if isinstance(one, Law) and one.free]
    if not laws or not all(isinstance(one, MeasuredFRF) for one in model.observations):
        return []
    own: dict[str, list[Observation]] = {}
    for index, one in enumerate(model.observations):
        own.setdefault(one.site(index).configuration, []).append(one)
    kinds: dict[tuple[str, ...], list[_Level]] = {}
    known = {unknown.name for unknown in model.task().parameters.unknowns}
    for name, observations in own.items():
        present = tuple(law for law in laws if law.name_in(name) in known)
        if not present:
            return []
        along = tuple(float(observations[0].conditions.get(law.along, 0.0)) for law in present)
        level = _Level(name, present, along, tuple(observations))
        kinds.setdefault(tuple(law.name for law in present), []).append(level)
    if max(len(levels) for levels in kinds.values()) < 2:
        return []
    return [sorted(levels, key=lambda level: level.along) for levels in kinds.values()]
