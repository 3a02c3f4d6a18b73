"""Derivatives of the residuals of a fit with respect to the unknowns of variants of causes.

They are taken at the values of the fit and at the starting values of the variant's own unknowns. Most variants of a
model change nothing at these values, so that one evaluation serves all of them: their unknowns are columns of one
linear map from small changes to the parameters of the assemblies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import COLUMNS_TOGETHER
from receptance.identification.mapping import ParameterMap
from receptance.identification.problem import InfeasibleError, Observed, slopes_at
from receptance.identification.task import Task

__all__ = ["slopes_of"]

_ROUNDING = 1e-12
"""Relative difference of two values of a parameter that are the same."""


class _Place(NamedTuple):
    """The parameters of one observation, `(m,)`, and their derivatives by the own unknowns of a variant, `(m, k)`."""

    addresses: tuple[str, ...]
    values: NDArray[np.float64]
    slopes: NDArray[np.float64]

    @property
    def mapping(self) -> ParameterMap:
        """The parameters as linear functions of small changes of these unknowns."""
        return ParameterMap.linear(self.addresses, self.values, self.slopes)


@dataclass(frozen=True)
class _Own:
    """A variant at the values of the fit.

    Attributes
    ----------
    number : int
        Its place in the list of variants.
    places : list of _Place
        One for each observation. The first parameters are those of the model without the variant's own unknowns.
    """

    number: int
    places: list[_Place]

    @property
    def columns(self) -> int:
        """Number of its own unknowns."""
        return int(self.places[0].slopes.shape[1])


def slopes_of(fit: Fit, models: Sequence[Model]) -> list[NDArray[np.float64] | None]:
    """Return the derivatives of the observed residuals with respect to the own unknowns of each model, `(n, k)`.

    Parameters
    ----------
    fit : Fit
        The fit at whose values they are taken.
    models : sequence of Model
        Models with further unknowns, in the order in which the columns are returned. Unknowns of the fit that a model
        does not have are left out.

    Returns
    -------
    list of ndarray
        None where the model has no value.
    """
    names = {unknown.name for unknown in fit.model.unknowns}
    found: list[NDArray[np.float64] | None] = [None] * len(models)
    groups: dict[int, list[int]] = {}
    without = [_without(model, names) for model in models]
    for number, model in enumerate(without):
        groups.setdefault(id(model), []).append(number)
    for numbers in groups.values():
        base = without[numbers[0]]
        for batch in _batches(fit, base, [(number, models[number]) for number in numbers], names):
            for number, slopes in _evaluate(base, batch):
                found[number] = slopes
    return found


def _without(model: Model, names: set[str]) -> Model:
    """Return the model before unknowns other than some were added, as far as they were added last."""
    shorter = model.shorter
    while shorter is not None and model.unknowns[-1].name not in names:
        model, shorter = shorter, shorter.shorter
    return model


def _batches(fit: Fit, base: Model, models: Sequence[tuple[int, Model]], names: set[str]) -> Iterator[list[_Own]]:
    """Yield variants that are evaluated together: those that change nothing at their starts, and each other one."""
    values = _values(fit, base.task)
    before = [own.values(values) for own in base.task.mappings]
    together: list[_Own] = []
    for number, model in models:
        own = _Own(number, _places(fit, model, names))
        if not all(_is_same(base, i, place, before[i]) for i, place in enumerate(own.places)):
            yield [own]
            continue
        if sum(one.columns for one in together) + own.columns > COLUMNS_TOGETHER and together:
            yield together
            together = []
        together.append(own)
    if together:
        yield together


def _values(fit: Fit, task: Task) -> NDArray[np.float64]:
    """Return the values of the unknowns of a task: those of the fit, and the starts of others."""
    unknowns = task.parameters.unknowns
    return np.array([fit.values.get(one.name, one.start or 0.0) for one in unknowns], dtype=np.float64)


def _places(fit: Fit, model: Model, names: set[str]) -> list[_Place]:
    task, own = model.task, {unknown.name for unknown in model.unknowns} - names
    values = _values(fit, task)
    fresh = np.array([unknown.name in own for unknown in task.parameters.unknowns])
    found = {
        id(one): _Place(one.addresses, one.values(values), one.jacobian(values)[:, fresh])
        for one in dict.fromkeys(task.mappings)
    }
    return [found[id(one)] for one in task.mappings]


def _is_same(base: Model, number: int, place: _Place, before: NDArray[np.float64]) -> bool:
    """Return whether an observation has the same parameters as in the model without the variant's own unknowns."""
    site = base.observations[number].site(number)
    rest = [site.value(address) for address in place.addresses[before.size :]]
    same = np.concatenate([before, rest])
    return bool(np.all(np.abs(place.values - same) <= _ROUNDING * np.abs(same)))


def _evaluate(base: Model, batch: Sequence[_Own]) -> Iterator[tuple[int, NDArray[np.float64] | None]]:
    """Yield the numbers of variants, and the derivatives by their own unknowns."""
    joined: dict[tuple[int, ...], ParameterMap] = {}
    mappings = []
    for places in zip(*(one.places for one in batch), strict=True):
        key = tuple(map(id, places))
        if key not in joined:
            joined[key] = (_join(places) if len(places) > 1 else places[0]).mapping
        mappings.append(joined[key])
    observed = [Observed(*one) for one in zip(base.observations, mappings, base.task.units, strict=True)]
    try:
        slopes = slopes_at(observed, base.threads)
    except InfeasibleError:
        if len(batch) == 1:
            yield batch[0].number, None
        else:
            for one in batch:
                yield from _evaluate(base, [one])
        return
    begin = 0
    for one in batch:
        yield one.number, slopes[:, begin : begin + one.columns]
        begin += one.columns


def _join(places: Sequence[_Place]) -> _Place:
    """Return the parameters of one observation with the columns of several variants side by side."""
    rows: dict[str, int] = {}
    values: list[float] = []
    for place in places:
        for address, value in zip(place.addresses, place.values.tolist(), strict=True):
            if address not in rows:
                rows[address] = len(values)
                values.append(value)
    slopes = np.zeros((len(values), sum(place.slopes.shape[1] for place in places)))
    begin = 0
    for place in places:
        end = begin + place.slopes.shape[1]
        slopes[[rows[address] for address in place.addresses], begin:end] = place.slopes
        begin = end
    return _Place(tuple(rows), np.array(values), slopes)
