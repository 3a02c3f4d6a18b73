"""Starting values of fits: of causes, and of models with values that are free at every level of a condition.

Free values at many levels, as of the drawbar force, are too many to be fitted together from their starting values. One
level is fitted first, the others from the values of their neighbours, and shared unknowns start at the median of all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from receptance.diagnosis.fitting import Fit, fit_base, refit
from receptance.diagnosis.model import Model
from receptance.diagnosis.screening import Direction
from receptance.diagnosis.thresholds import LARGE_SIZE, WORSE_LEVEL
from receptance.fit.observation import Observation
from receptance.fit.unknowns import Law


def starts_of(direction: Direction, fit: Fit) -> list[list[dict[str, float]]]:
    """Return starting values for fits of a cause: null and the linear estimate, then large sizes of either sign.

    Secondary parameters also start at their typical values, because the linear estimate of these is inaccurate. Where
    the cause has no linear effect on the fit, the only start is null.
    """
    values, parameters = fit.values, direction.parameters
    null = {name: parameter.start for name, parameter in parameters.items()}
    if direction.far:
        return [[{**values, **null}]]
    if direction.variant.begin is not None:
        null |= direction.variant.begin(direction.model, {**values, **null})
    starts = [null]
    if direction.estimate:
        starts.append({**null, **direction.estimate})
        starts.append({name: null[name] if one.secondary else starts[-1][name] for name, one in parameters.items()})
    near = [start for i, start in enumerate(starts) if start not in starts[:i]]
    large = [{name: one.at(times) for name, one in parameters.items()} for times in (LARGE_SIZE, -LARGE_SIZE)]
    large = [one for i, one in enumerate(large) if one not in near + large[:i]]
    return [[{**values, **one} for one in group] for group in (near, large) if group]


def starts_from_singles(base: Fit, singles: Sequence[Fit], root: Fit) -> list[dict[str, float]]:
    """Return starting values for a fit of several causes from fits of the added cause alone.

    The joint of such a fit may be closer to the solution than that of the other causes.
    """
    others = {name: value for name, value in root.values.items() if name not in base.values}
    return [{**root.values, **single.values, **others} for single in singles]


@dataclass(frozen=True)
class _Level:
    """A configuration with free values of laws."""

    name: str
    """Name of the configuration."""
    laws: tuple[Law, ...]
    """Laws with a free value in it."""
    model: Model
    """The model of its observations."""

    @property
    def condition(self) -> tuple[float, ...]:
        """Values of the conditions of its laws."""
        conditions = self.model.observations[0].conditions
        return tuple(float(conditions.get(law.along, 0.0)) for law in self.laws)

    def values_for(self, values: Mapping[str, float], other: _Level) -> dict[str, float]:
        """Return values of this level as starting values of another one."""
        return {**values, **{law.name_in(other.name): values[law.name_in(self.name)] for law in self.laws}}


Report = Callable[[str], None]


def _no_report(text: str) -> None:
    """Report nothing."""


def has_levels(model: Model) -> bool:
    """Return whether a model has values that are free in several configurations, and some in each of them."""
    return bool(_group_levels(model))


def fit_levels(model: Model, report: Report = _no_report) -> Fit:
    """Return the model fitted from its own starting values: level by level where it has levels.

    Parameters
    ----------
    model : Model
        The model.
    report : callable, optional
        Called with a progress message before each fit.
    """
    kinds = _group_levels(model)
    if not kinds:
        report("the model as it is")
        return fit_base(model)
    first: list[tuple[int, Fit]] = []
    for kind in kinds:
        middle = len(kind) // 2
        report(f"the model as it is, {kind[middle].name}")
        first.append((middle, fit_base(kind[middle].model)))
    return _fit_all_levels(model, kinds, first, report)


def fit_again(before: Fit) -> Fit | None:
    """Return a fitted model fitted again from its own starting values.

    None is returned where the model has levels and explains no level of one kind by itself. The kinds with the largest
    residuals are tried first.
    """
    residuals = before.by_configuration
    kinds = sorted(_group_levels(before.model), key=lambda kind: -max(residuals[level.name] for level in kind))
    if not kinds:
        return fit_base(before.model)
    first: list[tuple[int, Fit]] = []
    for kind in kinds:
        # The fit of one level may end in a local minimum where that of another one does not.
        tried = dict.fromkeys((len(kind) // 2, 0, len(kind) - 1))
        adequate = ((i, fit) for i in tried if (fit := fit_base(kind[i].model)).adequacy.passed)
        found = next(adequate, None)
        if found is None:
            return None
        first.append(found)
    return _fit_all_levels(before.model, kinds, first, _no_report)


def _fit_all_levels(
    model: Model, kinds: Sequence[Sequence[_Level]], first: Sequence[tuple[int, Fit]], report: Report
) -> Fit:
    """Return the model fitted to all levels together, from the fits of single levels.

    `first` has the index and the fit of the first level of each kind.
    """
    found = [fit.values for _, fit in first]
    for kind, (at, fit) in zip(kinds, first, strict=True):
        for levels in (kind[at:], kind[at::-1]):
            found += _continue(levels, fit, report)
    names = dict.fromkeys(name for values in found for name in values)
    start = {name: float(np.median([values[name] for values in found if name in values])) for name in names}
    report("the model as it is, all levels together")
    return refit(model, start)


def _continue(levels: Sequence[_Level], before: Fit, report: Report) -> Iterator[dict[str, float]]:
    """Yield the values of all levels but the first, each fitted from those of its neighbour."""
    for last, level in pairwise(levels):
        report(f"the model as it is, {level.name}")
        fit = refit(level.model, last.values_for(before.values, level))
        if fit.misfit > WORSE_LEVEL * max(before.misfit, 1.0):
            fit = min(fit, fit_base(level.model), key=lambda one: one.chi_square)
        yield fit.values
        before = fit


def _group_levels(model: Model) -> list[list[_Level]]:
    """Return the levels in ascending order, grouped by their free laws; none where no group has two levels."""
    laws = [unknown for unknown in model.unknowns if isinstance(unknown, Law) and unknown.free]
    if not laws or len(model.receptances) < len(model.observations):
        return []
    observations: dict[str, list[Observation]] = {}
    for name, observation in zip(model.configuration_of, model.observations, strict=True):
        observations.setdefault(name, []).append(observation)
    known = {unknown.name for unknown in model.task.parameters.unknowns}
    kinds: dict[tuple[str, ...], list[_Level]] = {}
    for name, own in observations.items():
        present = tuple(law for law in laws if law.name_in(name) in known)
        if not present:
            return []
        kinds.setdefault(tuple(law.name for law in present), []).append(_Level(name, present, model.select(own)))
    if max(len(levels) for levels in kinds.values()) < 2:
        return []
    return [sorted(levels, key=lambda level: level.condition) for levels in kinds.values()]
