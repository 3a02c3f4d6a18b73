"""Measurements that could be taken, simulated: how far one would tell the reported explanations apart.

If an explanation is the truth, another one is fitted to the new data together with those that are there, on few lines;
what is asked is by how much its chi-square grows. Noise is left out of the new data, and counts in their weights: the
answer is an expectation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from receptance.assembly import Assembly
from receptance.coordinates import Coordinate
from receptance.diagnosis.causes import Step, parameters_of
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.foresight import Foresight, with_causes
from receptance.diagnosis.joint_causes import overhang_of
from receptance.diagnosis.line_selection import thin
from receptance.diagnosis.model import Model, with_points
from receptance.errors import ReceptanceError
from receptance.identification.floor import Floor
from receptance.identification.laws import Tolerance
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, altered
from receptance.identification.residuals import InfeasibleError
from receptance.identification.task import Observation, place_of

__all__ = [
    "Alone",
    "FRFAgain",
    "Known",
    "Measurement",
    "Rival",
    "at_the_nose",
    "nothing",
    "other_force",
    "other_overhang",
    "same_again",
]

_LINES = 150
_QUANTITY = 1e3
"""Chi-square that another quantity costs where a known mass is measured."""
_RESOLUTION = 1e-3
"""Standard deviation of natural frequencies of a part alone, as a share."""
_MODES = 3
_HIGHEST = 2e4
_NEW = "measured next"


def nothing(selection: Selection) -> Explanation:
    """Return that no cause acts."""
    return Explanation((), selection.base, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Rival:
    """An explanation that is left, and what it makes of few lines."""

    explanation: Explanation
    base: Model

    @cached_property
    def few(self) -> Fit:
        """The fit on few lines of each receptance."""
        return refit(thin(self.explanation.fit.model, _LINES), self.explanation.fit.values)

    @cached_property
    def sizes(self) -> dict[str, tuple[float, float]]:
        """Sizes of its causes and their standard errors."""
        fit = self.explanation.fit
        low, high = fit.task.variables.limits
        normal = fit.jacobian.T @ fit.jacobian + np.diag(12.0 / (high - low) ** 2)
        scale = np.sqrt(np.diag(normal))
        variance = np.diag(np.linalg.inv(normal / np.outer(scale, scale))) / scale**2
        slopes = fit.task.variables.slopes(np.array(list(fit.values.values())))
        spreads = dict(zip(fit.values, np.sqrt(np.maximum(variance, 0.0)) * slopes, strict=True))
        causes = [cause for cause, _ in self.explanation.steps]
        return {n: (v, float(spreads[n])) for cause in causes for n, v in self.explanation.sizes(cause).items()}

    def predicts(self, new: Observation, tolerances: tuple[Tolerance, ...], without: frozenset[str]) -> np.ndarray:
        """Return the residual of an observation where the fit on few lines ended, without what some causes do."""
        fit, steps = _freed(self.explanation, self.few, without)
        model = replace(self.base, observations=(new,), tolerances=tolerances)
        return Foresight(fit, with_causes(model, steps)).unfitted[0]

    def answers(self, new: Observation, tolerances: tuple[Tolerance, ...], without: frozenset[str]) -> float:
        """Return by how much chi-square grows where it is fitted to one more observation."""
        steps = tuple(step for step in self.explanation.steps if step[0].id not in without)
        # What all observations have, the fit has already.
        particular = tuple(one for one in tolerances if one.configurations is not None)
        added = with_causes(replace(self.base, observations=(new,), tolerances=particular), steps)
        few = self.few.model
        before = tuple(dict.fromkeys(place_of(one, i).configuration for i, one in enumerate(few.observations)))
        parameters = parameters_of(few.unknowns)
        unknowns = tuple(
            replace(unknown, configurations=unknown.configurations or before)
            if unknown.name in parameters and parameters[unknown.name].cause in without
            else unknown
            for unknown in few.unknowns
        )
        joint = replace(
            few,
            observations=(*few.observations, *added.observations),
            unknowns=unknowns,
            tolerances=(*few.tolerances, *added.tolerances),
        )
        return max(refit(joint, self.few.values).chi_square - self.few.chi_square, 0.0)


class Measurement(Protocol):
    """Something that can be simulated."""

    def apart(self, truth: Rival, other: Rival) -> float:
        """Return by how much chi-square of another explanation grows if one is true; zero where it does not apply."""


@dataclass(frozen=True)
class Known:
    """Sizes of causes measured by themselves: a weight, a length, a gain.

    Attributes
    ----------
    accuracy : dict of str to float
        By parameter ("sensor_mass.mass"): standard deviation of the measurement in SI units.
    presence : frozenset of str
        Ids of causes without a size that it shows as well.
    """

    accuracy: Mapping[str, float]
    presence: frozenset[str] = frozenset()

    def apart(self, truth: Rival, other: Rival) -> float:
        """See `Measurement`."""
        found = _QUANTITY * bool(self.presence & (truth.explanation.ids ^ other.explanation.ids))
        parameters = {**truth.explanation.parameters, **other.explanation.parameters}
        for name in {**truth.sizes, **other.sizes}:
            accuracy = self.accuracy.get(parameters[name].key)
            if accuracy is None:
                continue
            null = parameters[name].null
            true, _ = truth.sizes.get(name, (null, 0.0))
            said, spread = other.sizes.get(name, (null, 0.0))
            found += (true - said) ** 2 / (accuracy**2 + spread**2)
        return found


@dataclass(frozen=True)
class FRFAgain:
    """One FRF more, at another place, under another condition, or without what a cause does.

    Attributes
    ----------
    change : callable
        Gets the model and the number of an FRF that was measured; returns the one that would be, or None.
    without : frozenset of str
        Ids of causes of which it is certainly free, which is why it is done.
    elsewhere : frozenset of str
        Ids of causes that act only where hits were before.
    """

    change: Callable[[Model, int], MeasuredFRF | None]
    without: frozenset[str] = frozenset()
    elsewhere: frozenset[str] = frozenset()

    def apart(self, truth: Rival, other: Rival) -> float:
        """See `Measurement`."""
        if self.without and not self.without & (truth.explanation.ids | other.explanation.ids):
            return 0.0
        base = truth.base
        index = next((i for i, one in enumerate(base.observations) if isinstance(one, MeasuredFRF)), None)
        wanted = None if index is None else self.change(base, index)
        if index is None or wanted is None:
            return 0.0
        own = _tolerances_of_new(base, index, anew=self.change is other_overhang)
        blank = altered(wanted, receptance=np.ones(wanted.frequency_hz.size, dtype=np.complex128))
        blank = altered(blank, configuration=_NEW, label=_NEW)
        try:
            spread = np.asarray(blank.standard_deviation)
            real, imaginary = truth.predicts(blank, own, self.without | self.elsewhere).reshape(2, -1) * spread
            values = np.exp(-real - 1j * imaginary)
            variance = np.square(spread) + Floor().variance(blank.frequency_hz.real, values)
            data = altered(blank, receptance=values, standard_deviation=np.sqrt(variance))
            (fewer,) = thin(replace(base, observations=(data,)), _LINES).observations
            return other.answers(fewer, own, self.without | self.elsewhere)
        except (InfeasibleError, ReceptanceError, ValueError):
            return 0.0


@dataclass(frozen=True)
class Alone:
    """Natural frequencies of the tool or of the holder alone, hanging free."""

    side: str

    def apart(self, truth: Rival, other: Rival) -> float:
        """See `Measurement`."""
        base = truth.base
        index = max(range(len(base.observations)), key=lambda i: _length_of(base, i))
        if not getattr(base.anatomies[index], self.side):
            return 0.0
        own = _tolerances_of_new(base, index, anew=False)
        try:
            given, said = (self._seen(base, index, one.explanation) for one in (truth, other))
            if given.modes != said.modes:
                return 0.0
            residual = Foresight(truth.few, replace(base, observations=(given,), tolerances=own)).unfitted
            data = given.frequency_hz * (1.0 + _RESOLUTION * residual[0])
            answered = altered(said, frequency_hz=data, standard_deviation_hz=_RESOLUTION * data)
            few = other.few.model
            particular = tuple(one for one in _there(own, answered) if one.configurations is not None)
            joint = replace(few, observations=(*few.observations, answered), tolerances=(*few.tolerances, *particular))
            return max(refit(joint, other.few.values).chi_square - other.few.chi_square, 0.0)
        except (InfeasibleError, ReceptanceError, ValueError):
            return 0.0

    def _seen(self, base: Model, index: int, explanation: Explanation) -> MeasuredFrequencies:
        """Return what would be observed of the side alone as an explanation has it."""
        one = base.observations[index]
        names = getattr(base.anatomies[index], self.side)
        whole = with_causes(replace(base, observations=(one,)), explanation.steps).observations[0].assembly
        own = [
            replace(point, name=name)
            for name, point in whole.attachments.items()
            # What causes hang on the tool is there only when it is measured, or clamped.
            if self.side == "holder" and point.part in names and name not in one.assembly.attachments
        ]
        alone = with_points(Assembly([whole.elements[name] for name in names]), *own)
        frequencies = alone.natural_frequencies(_HIGHEST)[:_MODES]
        return MeasuredFrequencies(
            assembly=alone,
            frequency_hz=frequencies,
            standard_deviation_hz=_RESOLUTION * frequencies,
            label=_NEW,
            configuration=_NEW,
            conditions=one.conditions,
        )


def _tolerances_of_new(base: Model, index: int, *, anew: bool) -> tuple[Tolerance, ...]:
    """Return the errors of what is measured next: those of a measurement taken, or new ones of the same size."""
    place = place_of(base.observations[index], index)
    found = []
    for one in base.tolerances:
        if place.among(one.configurations, one.labels):
            particular = one.configurations is not None or one.labels is not None
            name = f"{one.name}, {_NEW}" if anew and particular and _of_overhang(base, index, one) else one.name
            found.append(replace(one, name=name, configurations=(_NEW,), labels=None) if particular else one)
    return tuple(found)


def _of_overhang(base: Model, index: int, tolerance: Tolerance) -> bool:
    anatomy = base.anatomies[index]
    return bool(anatomy.joint) and overhang_of(base.observations[index].assembly, anatomy) in tolerance.moves


def _there(tolerances: tuple[Tolerance, ...], one: Observation) -> tuple[Tolerance, ...]:
    """Return tolerances of what an observation has."""
    place = place_of(one, 0)
    found = []
    for tolerance in tolerances:
        moves = {address: size for address, size in tolerance.moves.items() if place.covered(address)}
        found += [replace(tolerance, moves=moves)] if moves else []
    return tuple(found)


def _freed(one: Explanation, fit: Fit, without: frozenset[str]) -> tuple[Fit, tuple[Step, ...]]:
    """Return an explanation without causes: its fit with these at their null, and the others."""
    gone = [cause for cause, _ in one.steps if cause.id in without]
    if not gone:
        return fit, one.steps
    nulls = {name: one.parameters[name].null for cause in gone for name in one.sizes(cause)}
    values = np.array([nulls.get(name, value) for name, value in fit.values.items()])
    kept = tuple(step for step in one.steps if step[0].id not in without)
    return replace(fit, x=fit.task.variables.from_values(values)), kept


def same_again(model: Model, index: int) -> MeasuredFRF | None:
    """Return the same FRF once more."""
    return _frf(model, index)


def _frf(model: Model, index: int) -> MeasuredFRF:
    one = model.observations[index]
    assert isinstance(one, MeasuredFRF)
    spread = np.full(one.frequency_hz.size, float(np.median(np.asarray(one.standard_deviation))))
    return altered(one, standard_deviation=spread, correlated_lines=np.ones_like(spread), force=None)


def at_the_nose(model: Model, index: int) -> MeasuredFRF | None:
    """Return a direct FRF at the holder's nose."""
    anatomy = model.anatomies[index]
    if not anatomy.holder:
        return None
    nose = Coordinate(anatomy.holder[0], 0.0)
    return altered(_frf(model, index), response=nose, excitation=nose)


def other_overhang(model: Model, index: int) -> MeasuredFRF | None:
    """Return an FRF at an overhang longer than all that were measured, of a clamping of its own."""
    anatomy = model.anatomies[index]
    if not anatomy.joint:
        return None
    address = overhang_of(model.observations[index].assembly, anatomy)
    lengths = [one.assembly.get(address) for one in model.observations if address in one.assembly.parameters]
    longer = 1.3 * max(lengths)
    one = _frf(model, index)
    conditions = {**one.conditions}
    for name in ("overhang", address):
        if name in conditions:
            conditions[name] = longer
    assembly = one.assembly.replace({address: longer})
    return altered(one, assembly=assembly, conditions=conditions)


def other_force(model: Model, index: int) -> MeasuredFRF | None:
    """Return an FRF at three times the highest force level."""
    levels = [one.conditions["force"] for one in model.observations if "force" in one.conditions]
    if not levels:
        return None
    one = _frf(model, index)
    return altered(one, conditions={**one.conditions, "force": 3.0 * max(levels)})


def _length_of(model: Model, index: int) -> float:
    anatomy, one = model.anatomies[index], model.observations[index]
    return one.assembly.get(overhang_of(one.assembly, anatomy)) if anatomy.joint else 0.0
