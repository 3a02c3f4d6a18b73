"""Simulated measurements: how much of the evidence for an explanation one more measurement would remove.

If one explanation is true, another one is fitted to the new data together with the existing ones, on few lines. The
result is the increase of its chi-square. The new data are noise-free, and noise is in their weights: the increase is an
expectation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from receptance.diagnosis.causes import Step, parameters_of
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.foresight import with_causes
from receptance.diagnosis.joint_causes import overhang_of
from receptance.diagnosis.line_selection import thin
from receptance.diagnosis.model import Model, with_points
from receptance.errors import ReceptanceError
from receptance.identification.from_frf import Floor
from receptance.identification.laws import Tolerance
from receptance.identification.mapping import Site
from receptance.identification.new_observations import Candidate, NewObservations, information_root
from receptance.identification.observations import MeasuredFRF
from receptance.identification.problem import InfeasibleError
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "DirectMeasurement",
    "Hypothetical",
    "Measurement",
    "Rival",
    "SimulatedMeasurement",
    "assembly_again",
    "at_the_nose",
    "base_explanation",
    "holder_alone",
    "other_force",
    "other_overhang",
    "tool_alone",
]

_LINES = 150
"""Lines of each receptance of the fits."""
_QUANTITY = 1e3
"""Increase of chi-square by a wrong quantity where a known mass is measured."""
_RESOLUTION = 1e-3
"""Standard deviation of natural frequencies of a part alone, as a share."""
_MODES = 3
"""Number of natural frequencies of a part alone."""
_HIGHEST = 2e4
"""Highest natural frequency of a part alone in Hz."""
_LONGER = 1.3
"""A longer overhang, as a multiple of the longest one that was measured."""
_HARDER = 3.0
"""A higher force, as a multiple of the highest one that was measured."""
_NEW = "measured next"
"""Label and configuration of the simulated measurement."""


def base_explanation(selection: Selection) -> Explanation:
    """Return the explanation without causes."""
    return Explanation((), selection.base, 0.0, 0.0)


class Hypothetical(NamedTuple):
    """A hypothetical measurement in the view of an explanation.

    Attributes
    ----------
    candidate : Candidate
        The measurement.
    steps : tuple of Step
        Causes that act on it and are not part of its assembly.
    """

    candidate: Candidate
    steps: tuple[Step, ...]

    def extend(self, base: Model, data: NDArray[Any] | None = None) -> Model:
        """Return it with its causes as the only observation of a model, on few lines where it has data."""
        observation = self.candidate.observation(data)
        model = replace(base, observations=(observation,), tolerances=self.candidate.tolerances)
        return with_causes(model if data is None else thin(model, _LINES), self.steps)


@dataclass(frozen=True, eq=False)
class Rival:
    """One of the remaining explanations, and its fit on few lines."""

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
        variables = fit.task.variables
        inverse = np.linalg.inv(information_root(fit.jacobian, variables))
        slopes = variables.slopes(np.array(list(fit.values.values())))
        spreads = dict(zip(fit.values, np.linalg.norm(inverse, axis=1) * slopes, strict=True))
        causes = [cause for cause, _ in self.explanation.steps]
        return {n: (v, float(spreads[n])) for cause in causes for n, v in self.explanation.sizes(cause).items()}

    def simulate(self, seen: Hypothetical, absent: frozenset[str]) -> NDArray[Any]:
        """Return the noise-free data of a measurement; causes with the ids `absent` do not act on it."""
        fit = self.few
        nulls = {
            name: self.explanation.parameters[name].null
            for cause, _ in self.explanation.steps
            if cause.id in absent
            for name in self.explanation.sizes(cause)
        }
        values = np.array([nulls.get(name, value) for name, value in fit.values.items()])
        x = fit.task.variables.from_values(values) if nulls else fit.x
        model = seen.extend(self.base)
        (one,) = model.observations
        (data,) = NewObservations(fit.task.parameters, [one], [model.tolerances]).calculated(x)
        # A cause that changes the quantity of the data has changed the placeholder data.
        return data / one.receptance if isinstance(one, MeasuredFRF) else data

    def chi_square_increase(self, seen: Hypothetical, data: NDArray[Any], absent: frozenset[str]) -> float:
        """Return the increase of chi-square where one more measurement is fitted as well."""
        few = self.few.model
        added = seen.extend(self.base, data)
        fitted = tuple(dict.fromkeys(one.site(i).configuration for i, one in enumerate(few.observations)))
        parameters = parameters_of(few.unknowns)
        unknowns = tuple(
            replace(unknown, configurations=unknown.configurations or fitted)
            if unknown.name in parameters and parameters[unknown.name].cause in absent
            else unknown
            for unknown in few.unknowns
        )
        # The fit already has the errors that all observations share.
        particular = tuple(one for one in added.tolerances if one.configurations is not None)
        joint = replace(
            few,
            observations=(*few.observations, *added.observations),
            unknowns=unknowns,
            tolerances=(*few.tolerances, *particular),
        )
        return max(refit(joint, self.few.values).chi_square - self.few.chi_square, 0.0)


class Measurement(Protocol):
    """A measurement that can be simulated."""

    def apart(self, truth: Rival, other: Rival) -> float:
        """Return the increase of chi-square of another explanation if one is true; zero where it does not apply."""


@dataclass(frozen=True)
class DirectMeasurement:
    """A direct measurement of the sizes of causes: a weight, a length, a gain.

    Attributes
    ----------
    accuracy : dict of str to float
        Standard deviation of the measurement in SI units, by parameter ("sensor_mass.mass").
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
            expected, spread = other.sizes.get(name, (null, 0.0))
            found += (true - expected) ** 2 / (accuracy**2 + spread**2)
        return found


@dataclass(frozen=True)
class SimulatedMeasurement:
    """One more FRF, or natural frequencies of a part alone.

    Attributes
    ----------
    describe : callable
        Gets the base model and the causes that act on the measurement, and returns the measurement; None where the
        model does not have it.
    without : frozenset of str
        Ids of the causes that the measurement excludes, and for which it is made.
    elsewhere : frozenset of str
        Ids of causes that act only at the places that were hit before.
    """

    describe: Callable[[Model, tuple[Step, ...]], Hypothetical | None]
    without: frozenset[str] = frozenset()
    elsewhere: frozenset[str] = frozenset()

    def apart(self, truth: Rival, other: Rival) -> float:
        """See `Measurement`."""
        if self.without and not self.without & (truth.explanation.ids | other.explanation.ids):
            return 0.0
        absent = self.without | self.elsewhere
        try:
            given, seen = (self._seen(one, absent) for one in (truth, other))
            if given is None or seen is None or given.candidate.modes != seen.candidate.modes:
                return 0.0
            return other.chi_square_increase(seen, truth.simulate(given, absent), absent)
        except (InfeasibleError, ReceptanceError, ValueError):
            return 0.0

    def _seen(self, rival: Rival, absent: frozenset[str]) -> Hypothetical | None:
        return self.describe(rival.base, tuple(step for step in rival.explanation.steps if step[0].id not in absent))


def assembly_again(model: Model, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return the first FRF once more."""
    index = _first_frf(model)
    return None if index is None else Hypothetical(_frf(model, index), steps)


def at_the_nose(model: Model, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return a direct FRF at the nose of the holder."""
    index = _first_frf(model)
    if index is None or not model.anatomies[index].holder:
        return None
    nose = Coordinate(model.anatomies[index].holder[0], 0.0)
    return Hypothetical(_frf(model, index, response=nose, excitation=nose), steps)


def other_overhang(model: Model, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return an FRF at a longer overhang than all that were measured, with a clamping of its own."""
    index = _first_frf(model)
    if index is None or not model.anatomies[index].joint:
        return None
    one = model.observations[index]
    address = overhang_of(one.assembly, model.anatomies[index])
    longest = max(one.assembly.get(address) for one in model.observations if address in one.assembly.parameters)
    longer = _LONGER * longest
    tolerances = tuple(
        replace(error, name=f"{error.name}, {_NEW}") if error.configurations and address in error.moves else error
        for error in _tolerances_of_new(model, index)
    )
    conditions = {name: longer if name in ("overhang", address) else x for name, x in one.conditions.items()}
    assembly = one.assembly.replace({address: longer})
    return Hypothetical(_frf(model, index, assembly=assembly, conditions=conditions, tolerances=tolerances), steps)


def other_force(model: Model, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return an FRF at a higher force than all that were measured."""
    index = _first_frf(model)
    levels = [one.conditions["force"] for one in model.observations if "force" in one.conditions]
    if index is None or not levels:
        return None
    conditions = {**model.observations[index].conditions, "force": _HARDER * max(levels)}
    return Hypothetical(_frf(model, index, conditions=conditions), steps)


def tool_alone(model: Model, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return natural frequencies of the tool with the longest overhang alone, free-free."""
    return _alone(model, "tool", steps)


def holder_alone(model: Model, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return natural frequencies of the holder alone, free-free."""
    return _alone(model, "holder", steps)


def _alone(model: Model, side: str, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return natural frequencies of the parts on one side of the joint, with the causes in their assembly."""
    index = max(range(len(model.observations)), key=lambda i: _overhang(model, i))
    one, names = model.observations[index], getattr(model.anatomies[index], side)
    if not names:
        return None
    whole = with_causes(replace(model, observations=(one,)), steps).observations[0].assembly
    own = [
        replace(point, name=name)
        for name, point in whole.attachments.items()
        # Masses that causes attach to the tool are there only while it is measured or clamped.
        if side == "holder" and point.part in names and name not in one.assembly.attachments
    ]
    assembly = with_points(Assembly([whole.elements[name] for name in names]), *own)
    frequencies = assembly.natural_frequencies(_HIGHEST)[:_MODES]
    place = Site(assembly)
    tolerances = []
    for error in _tolerances_of_new(model, index):
        moves = {address: size for address, size in error.moves.items() if place.covered(address)}
        tolerances += [replace(error, moves=moves)] if moves else []
    candidate = Candidate(
        label=_NEW,
        assembly=assembly,
        modes=tuple(range(1, frequencies.size + 1)),
        standard_deviation_hz=_RESOLUTION * frequencies,
        tolerances=tuple(tolerances),
        conditions=one.conditions,
    )
    return Hypothetical(candidate, ())


def _first_frf(model: Model) -> int | None:
    return next((i for i, one in enumerate(model.observations) if isinstance(one, MeasuredFRF)), None)


def _frf(model: Model, index: int, **changes: Any) -> Candidate:
    """Return an FRF like one that was measured, with changes."""
    one = model.observations[index]
    assert isinstance(one, MeasuredFRF)
    fields: dict[str, Any] = {
        "assembly": one.assembly,
        "response": one.response,
        "excitation": one.excitation,
        "conditions": one.conditions,
        "tolerances": _tolerances_of_new(model, index),
    }
    return Candidate(
        label=_NEW,
        frequency_hz=one.frequency_hz,
        standard_deviation=float(np.median(np.asarray(one.standard_deviation))),
        floor=Floor(),
        **(fields | changes),
    )


def _tolerances_of_new(model: Model, index: int) -> tuple[Tolerance, ...]:
    """Return the errors of an observation as those of the new measurement."""
    place = model.observations[index].site(index)
    own = [one for one in model.tolerances if place.among(one.configurations, one.labels)]
    return tuple(
        one if one.configurations is None and one.labels is None else replace(one, configurations=(_NEW,), labels=None)
        for one in own
    )


def _overhang(model: Model, index: int) -> float:
    anatomy, one = model.anatomies[index], model.observations[index]
    return one.assembly.get(overhang_of(one.assembly, anatomy)) if anatomy.joint else 0.0
