"""Derivatives of the residuals of a fit with respect to the unknowns of variants of causes.

They are taken at the values of the fit and at the starting values of the variant's own unknowns. Most variants of a
model change nothing at these values, so that one evaluation serves all of them: their unknowns are columns of one
linear map from small changes to the parameters of the assemblies. Variants that differ in the values of one added
element, as the frequencies of a resonator, are evaluated together on copies of it: at its null a cause has no effect,
so that the copies do not act on each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model, with_points
from receptance.diagnosis.thresholds import COLUMNS_TOGETHER
from receptance.fit.observation import Observation
from receptance.fit.parameters import ParameterMap, Parameters
from receptance.fit.problem import InfeasibleError, slopes_at
from receptance.model.assembly import Assembly

_ROUNDING = 1e-12
"""Relative difference of two values of a parameter that are the same."""


class _Place(NamedTuple):
    """Parameters of one observation, `(m,)`, and their derivatives by the own unknowns of a variant, `(m, k)`."""

    addresses: tuple[str, ...]
    values: NDArray[np.float64]
    slopes: NDArray[np.float64]


class _Own(NamedTuple):
    """A variant at the values of the fit: its place in the list of variants, and one place for each observation.

    `added` is the name of the only element that the variant moves, where the cause has added it.
    """

    number: int
    places: list[_Place]
    added: str = ""

    @property
    def columns(self) -> int:
        """Number of its own unknowns."""
        return int(self.places[0].slopes.shape[1])


def slopes_of(fit: Fit, models: Sequence[Model], threads: int | None = 1) -> list[NDArray[np.float64] | None]:
    """Return the derivatives of the observed residuals with respect to the own unknowns of each model, `(n, k)`.

    The residuals are those of the data compressed about the fit, `Fit.compressed_problem`.

    Parameters
    ----------
    fit : Fit
        The fit at whose values they are taken.
    models : sequence of Model
        Models with further unknowns, in the order in which the columns are returned. Unknowns of the fit that a model
        does not have are left out.
    threads : int, optional
        As in `Assembly.receptance`.

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
        group = _VariantGroup(base, fit, names, threads)
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
    threads : int or None
        As of `slopes_of`.
    """

    def __init__(self, base: Model, fit: Fit, names: set[str], threads: int | None) -> None:
        self._base, self._fit, self._names, self._threads = base, fit, names, threads
        self._maps = base.task.mappings
        self._unknowns = self._values(base.task.parameters)
        self._parts = {one: one.parts(self._unknowns) for one in dict.fromkeys(self._maps)}
        values = {one: parts.scaled + parts.shifts for one, parts in self._parts.items()}
        self._present = [values[one] for one in self._maps]
        self._copied: dict[tuple[str, int], tuple[Observation, ...]] = {}

    def batches(self, models: Sequence[tuple[int, Model]]) -> Iterator[list[_Own]]:
        """Yield variants that are evaluated together.

        These are the variants that change nothing at their starts, those that move the same added element, and each
        other one by itself.
        """
        together: dict[str, list[_Own]] = {}
        for number, model in models:
            further = self._further(model)
            own = _Own(number, self._all_places(model) if further is None else self._own_places(further))
            is_same = further is not None and all(self._is_same(i, place) for i, place in enumerate(own.places))
            if further is not None and not is_same:
                own = own._replace(added=self._added(own))
            if not (is_same or own.added):
                yield [own]
                continue
            batch = together.setdefault(own.added, [])
            if batch and sum(one.columns for one in batch) + own.columns > COLUMNS_TOGETHER:
                yield together.pop(own.added)
                batch = together.setdefault(own.added, [])
            batch.append(own)
        yield from together.values()

    def evaluate(self, batch: Sequence[_Own]) -> Iterator[tuple[int, NDArray[np.float64] | None]]:
        """Yield the numbers of variants, and the derivatives by their own unknowns."""
        base, added = self._base, batch[0].added
        observations = self._with_copies(added, len(batch)) if added else base.observations
        joined: dict[tuple[int, ...], ParameterMap] = {}
        mappings = []
        for own, present, places in zip(
            self._maps, self._present, zip(*(b.places for b in batch), strict=True), strict=True
        ):
            key = (id(own), *map(id, places))
            if key not in joined:
                copies = [place if i == 0 else _renamed(place, added, i) for i, place in enumerate(places)]
                joined[key] = _join(own.addresses, present, copies if added else places)
            mappings.append(joined[key])
        try:
            slopes = slopes_at(self._fit.compress(observations), mappings, base.task.units, self._threads)
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

    def _added(self, own: _Own) -> str:
        """Return the name of the only element that a variant moves, if the cause has added it; otherwise nothing."""
        base = self._base
        names = {address.split(".", 1)[0] for place in own.places for address in place.addresses}
        # A further body adds a natural frequency, so that measured ones would be numbered otherwise.
        if len(names) != 1 or len(base.receptances) < len(base.observations):
            return ""
        (name,) = names
        before = any(name in observation.assembly.attachments for observation in self._fit.model.observations)
        moved = any(address.split(".", 1)[0] == name for own in self._maps for address in own.addresses)
        pairs = zip(base.observations, own.places, strict=True)
        attached = all(name in one.assembly.attachments for one, place in pairs if place.addresses)
        return name if attached and not before and not moved else ""

    def _with_copies(self, name: str, count: int) -> tuple[Observation, ...]:
        """Return the observations with an attachment several times: the first one keeps its name."""
        if (name, count) not in self._copied:
            changed = self._base if count == 1 else self._base.rebuild(partial(_copy, name, count))
            self._copied[name, count] = changed.observations
        return self._copied[name, count]

    def _values(self, parameters: Parameters) -> NDArray[np.float64]:
        """Return the values of unknowns: those of the fit, and the starts of others."""
        values = self._fit.values
        return np.array(
            [values.get(unknown.name, unknown.start or 0.0) for unknown in parameters.unknowns], dtype=np.float64
        )

    def _further(self, model: Model) -> Parameters | None:
        """Return the parameters as functions of a variant's own unknowns, if these alone have been added."""
        if any(unknown.name not in self._names for unknown in self._base.unknowns):
            return None
        return self._base.task.parameters.further(model.unknowns[len(self._base.unknowns) :])

    def _own_places(self, further: Parameters) -> list[_Place]:
        """Return the parameters that a variant's own unknowns move."""
        values = self._values(further)
        sites = [observation.site(i) for i, observation in enumerate(self._base.observations)]
        pairs = list(zip(self._maps, further.of(sites), strict=True))
        found: dict[tuple[ParameterMap, ParameterMap], _Place] = {}
        for pair in pairs:
            if not pair[1].addresses:
                # Most observations, where the unknowns are of one configuration.
                found[pair] = _Place((), np.zeros(0), np.zeros((0, values.size)))
            elif pair not in found:
                own, shifts = pair[0].around(pair[1], self._parts[pair[0]])
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
        if not place.addresses:
            return True
        own, site = self._maps[number], self._base.observations[number].site(number)
        before = own.numbers
        for address, value in zip(place.addresses, place.values.tolist(), strict=True):
            row = before.get(address)
            present = site.value(address) if row is None else float(self._present[number][row])
            if abs(value - present) > _ROUNDING * abs(present):
                return False
        return True


def _copy(name: str, count: int, assembly: Assembly) -> Assembly:
    """Return an assembly with an attachment several times, if it has it."""
    if name not in assembly.attachments:
        return assembly
    one = assembly.attachments[name]
    return with_points(assembly, *(replace(one, name=f"{name}_{i}") for i in range(1, count)))


def _renamed(place: _Place, name: str, number: int) -> _Place:
    """Return the place of a variant on the copy of its element with a number."""
    return place._replace(addresses=tuple(f"{name}_{number}{one.removeprefix(name)}" for one in place.addresses))


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
