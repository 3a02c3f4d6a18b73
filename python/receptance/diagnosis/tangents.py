"""Derivatives of the residuals of a fit with respect to the unknowns of variants of causes.

They are taken at the values of the fit and at the starting values of the variant's own unknowns. Most variants of a
model change nothing at these values, so that one evaluation serves all of them: their unknowns are columns of one
linear map from small changes to the parameters of the assemblies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.diagnosis.thresholds import COLUMNS_TOGETHER
from receptance.identification.mapping import ParameterMap, Parameters
from receptance.identification.problem import InfeasibleError, Observed, slopes_at

__all__ = ["slopes_of"]

_ROUNDING = 1e-12
"""Relative difference of two values of a parameter that are the same."""


class _Place(NamedTuple):
    """Parameters of one observation, `(m,)`, and their derivatives by the own unknowns of a variant, `(m, k)`."""

    addresses: tuple[str, ...]
    values: NDArray[np.float64]
    slopes: NDArray[np.float64]


class _Own(NamedTuple):
    """A variant at the values of the fit: its place in the list of variants, and one place for each observation."""

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
    groups: dict[Model, list[int]] = {}
    for number, model in enumerate(models):
        groups.setdefault(_without(model, names), []).append(number)
    for base, numbers in groups.items():
        group = _VariantGroup(base, fit, names)
        for batch in group.batches([(number, models[number]) for number in numbers]):
            for number, slopes in group.evaluate(batch):
                found[number] = slopes
    return found


def _without(model: Model, names: set[str]) -> Model:
    """Return the model before unknowns other than some were added, as far as they were added last."""
    shorter = model.shorter
    while shorter is not None and model.unknowns[-1].name not in names:
        model, shorter = shorter, shorter.shorter
    return model


class _VariantGroup:
    """Variants that add unknowns to one model.

    Parameters
    ----------
    base : Model
        That model.
    fit : Fit
        The fit.
    names : set of str
        Names of the unknowns of the fit.
    """

    def __init__(self, base: Model, fit: Fit, names: set[str]) -> None:
        self._base, self._fit, self._names = base, fit, names
        self._maps = base.task.mappings
        self._unknowns = self._values(base.task.parameters)
        values = {one: one.values(self._unknowns) for one in dict.fromkeys(self._maps)}
        self._present = [values[one] for one in self._maps]

    def batches(self, models: Sequence[tuple[int, Model]]) -> Iterator[list[_Own]]:
        """Yield variants that are evaluated together: those that change nothing at their starts, and each other one."""
        together: list[_Own] = []
        for number, model in models:
            further = self._further(model)
            own = _Own(number, self._all_places(model) if further is None else self._own_places(further))
            if further is None or not all(self._is_same(i, place) for i, place in enumerate(own.places)):
                yield [own]
                continue
            if together and sum(one.columns for one in together) + own.columns > COLUMNS_TOGETHER:
                yield together
                together = []
            together.append(own)
        if together:
            yield together

    def evaluate(self, batch: Sequence[_Own]) -> Iterator[tuple[int, NDArray[np.float64] | None]]:
        """Yield the numbers of variants, and the derivatives by their own unknowns."""
        base = self._base
        joined: dict[tuple[int, ...], ParameterMap] = {}
        mappings = []
        for own, present, places in zip(
            self._maps, self._present, zip(*(b.places for b in batch), strict=True), strict=True
        ):
            key = (id(own), *map(id, places))
            if key not in joined:
                joined[key] = _join(own.addresses, present, places)
            mappings.append(joined[key])
        observed = [Observed(*one) for one in zip(base.observations, mappings, base.task.units, strict=True)]
        try:
            slopes = slopes_at(observed, base.threads)
        except InfeasibleError:
            if len(batch) == 1:
                yield batch[0].number, None
            else:
                for one in batch:
                    yield from self.evaluate([one])
            return
        begin = 0
        for one in batch:
            yield one.number, slopes[:, begin : begin + one.columns]
            begin += one.columns

    def _values(self, parameters: Parameters) -> NDArray[np.float64]:
        """Return the values of unknowns: those of the fit, and the starts of others."""
        values = self._fit.values
        return np.array([values.get(one.name, one.start or 0.0) for one in parameters.unknowns], dtype=np.float64)

    def _further(self, model: Model) -> Parameters | None:
        """Return the parameters as functions of a variant's own unknowns, if these alone have been added."""
        if any(unknown.name not in self._names for unknown in self._base.unknowns):
            return None
        return self._base.task.parameters.further(model.unknowns[len(self._base.unknowns) :])

    def _own_places(self, further: Parameters) -> list[_Place]:
        """Return the parameters that a variant's own unknowns move."""
        values = self._values(further)
        sites = [one.site(i) for i, one in enumerate(self._base.observations)]
        pairs = list(zip(self._maps, further.of(sites), strict=True))
        found: dict[tuple[ParameterMap, ParameterMap], _Place] = {}
        for pair in pairs:
            if pair not in found:
                own, shifts = pair[0].around(pair[1], self._unknowns)
                found[pair] = _Place(own.addresses, own.values(values) + shifts, own.jacobian(values))
        return [found[pair] for pair in pairs]

    def _all_places(self, model: Model) -> list[_Place]:
        """Return all parameters of a variant whose unknowns are not independent of those of the fit."""
        values = self._values(model.task.parameters)
        fresh = {unknown.name for unknown in model.unknowns} - self._names
        columns = np.array([unknown.name in fresh for unknown in model.task.parameters.unknowns])
        maps = model.task.mappings
        found = {
            one: _Place(one.addresses, one.values(values), one.jacobian(values)[:, columns])
            for one in dict.fromkeys(maps)
        }
        return [found[one] for one in maps]

    def _is_same(self, number: int, place: _Place) -> bool:
        """Return whether an observation has the same parameters as in the model without the variant's own unknowns."""
        own, site = self._maps[number], self._base.observations[number].site(number)
        before = own.numbers
        for address, value in zip(place.addresses, place.values.tolist(), strict=True):
            row = before.get(address)
            present = site.value(address) if row is None else float(self._present[number][row])
            if abs(value - present) > _ROUNDING * abs(present):
                return False
        return True


def _join(addresses: Sequence[str], present: NDArray[np.float64], places: Sequence[_Place]) -> ParameterMap:
    """Return the parameters of one observation as linear functions of small changes of the unknowns of variants.

    `addresses` and `present` are the parameters without the variants and their values.
    """
    rows = {address: i for i, address in enumerate(addresses)}
    values = present.tolist()
    for place in places:
        for address, value in zip(place.addresses, place.values.tolist(), strict=True):
            if rows.setdefault(address, len(values)) == len(values):
                values.append(value)
            else:
                values[rows[address]] = value
    slopes = np.zeros((len(values), sum(place.slopes.shape[1] for place in places)))
    begin = 0
    for place in places:
        end = begin + place.slopes.shape[1]
        slopes[[rows[address] for address in place.addresses], begin:end] = place.slopes
        begin = end
    return ParameterMap.linear(tuple(rows), np.array(values), slopes)
