"""Advice: the next measurement, from a menu with costs, that separates the remaining explanations best.

If one explanation is true, another one is fitted to the simulated data together with the existing ones, on few lines.
The increase of its chi-square is the evidence that the measurement would remove (model discrimination, Hunter and
Reiner 1965, Designs for discriminating between two rival models). The simulated data are noise-free, and noise is in
their weights: the increase is an expectation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.causes import Step, transfer
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.findings import ProposedMeasurement
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.held_out import predictor_of
from receptance.diagnosis.joint_causes import overhang_of
from receptance.diagnosis.judgement import Judgement
from receptance.diagnosis.line_selection import thin
from receptance.diagnosis.model import Model, named, with_points
from receptance.diagnosis.thresholds import (
    HARDER,
    HIGHEST_ALONE,
    LONGER,
    MARGIN,
    MODES_ALONE,
    QUANTITY_SHOWN,
    RESOLUTION_ALONE,
    SIMULATION_LINES,
)
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation
from receptance.fit.parameters import Site
from receptance.fit.problem import InfeasibleError
from receptance.fit.unknowns import Tolerance
from receptance.fit.weights import Floor
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.predict.candidate import Candidate

_NEW = "measured next"
"""Label and configuration of the simulated measurement."""


class Hypothetical(NamedTuple):
    """A hypothetical measurement in the view of an explanation."""

    candidate: Candidate
    """The measurement."""
    steps: tuple[Step, ...]
    """Causes that act on it and are not part of its assembly."""

    def extend(self, base: Model, data: NDArray[Any] | None = None) -> Model:
        """Return it with its causes as the only observation of a model, on few lines where it has data."""
        observation = self.candidate.observation
        observation = observation.with_values(np.ones(observation.frequency_hz.size) if data is None else data)
        model = replace(base, observations=(observation,), tolerances=self.candidate.tolerances)
        return transfer(model if data is None else thin(model, SIMULATION_LINES), self.steps)


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One of the remaining explanations, of which one is true, and the model without causes."""

    explanation: Explanation
    base: Model

    @cached_property
    def fit(self) -> Fit:
        """The fit on few lines of each receptance."""
        return refit(thin(self.explanation.fit.model, SIMULATION_LINES), self.explanation.fit.values)

    @cached_property
    def sizes(self) -> dict[str, tuple[float, float]]:
        """Sizes of its causes and their standard errors."""
        fit, predictor = self.explanation.fit, predictor_of(self.explanation.fit)
        inverse = np.linalg.inv(predictor.information_root)
        slopes = predictor.variables.slopes(predictor.values)
        errors = dict(zip(fit.values, np.linalg.norm(inverse, axis=1) * slopes, strict=True))
        return {name: (fit.values[name], float(errors[name])) for name in self.explanation.parameters}

    def predict(self, measurement: Hypothetical, absent: frozenset[str]) -> NDArray[Any]:
        """Return the noise-free data of a measurement; causes with the ids `absent` do not act on it."""
        parameters = self.explanation.parameters
        nulls = {name: parameter.null for name, parameter in parameters.items() if parameter.cause in absent}
        values = np.array(list((self.fit.values | nulls).values()))
        model = measurement.extend(self.base)
        (observation,) = model.observations
        (data,) = replace(predictor_of(self.fit), values=values).of([observation], [model.tolerances]).mean()
        # A cause that changes the quantity of the data has changed the placeholder data.
        return data / observation.receptance if observation.is_receptance else data

    def chi_square_increase(self, measurement: Hypothetical, data: NDArray[Any], absent: frozenset[str]) -> float:
        """Return the increase of chi-square where one more measurement is fitted as well."""
        model = self.fit.model
        added = measurement.extend(self.base, data)
        parameters = self.explanation.parameters
        unknowns = tuple(
            replace(unknown, configurations=unknown.configurations or model.configurations)
            if unknown.name in parameters and parameters[unknown.name].cause in absent
            else unknown
            for unknown in model.unknowns
        )
        # The fit already has the errors that all observations share.
        particular = tuple(tolerance for tolerance in added.tolerances if tolerance.configurations is not None)
        joint = replace(
            model,
            observations=(*model.observations, *added.observations),
            unknowns=unknowns,
            tolerances=(*model.tolerances, *particular),
        )
        return max(refit(joint, self.fit.values).chi_square - self.fit.chi_square, 0.0)


@dataclass(frozen=True)
class MenuItem:
    """A measurement that can be advised: of the sizes of causes, or one that is simulated."""

    action: str
    """Instruction to the user."""
    cost: float
    """Effort, about that of so many hits on the machine."""
    accuracy: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a direct measurement of sizes in SI units, by parameter ("sensor_mass.mass")."""
    presence: frozenset[str] = frozenset()
    """Ids of causes without a size that it shows as well."""
    describe: Callable[[Model, tuple[Step, ...]], Hypothetical | None] | None = None
    """Gets the base model and the causes that act on a simulated measurement, and returns it; None where the model does
    not have it."""
    without: frozenset[str] = frozenset()
    """Ids of the causes that the measurement excludes, and for which it is made."""
    elsewhere: frozenset[str] = frozenset()
    """Ids of causes that act only at the places that were hit before."""

    def discriminate(self, truth: Hypothesis, other: Hypothesis) -> float:
        """Return the expected increase of chi-square of another hypothesis if one is true.

        It is zero where the measurement does not apply.
        """
        return self._by_sizes(truth, other) if self.describe is None else self._by_simulation(truth, other)

    def _by_sizes(self, truth: Hypothesis, other: Hypothesis) -> float:
        increase = QUANTITY_SHOWN * bool(self.presence & (truth.explanation.ids ^ other.explanation.ids))
        parameters = {**truth.explanation.parameters, **other.explanation.parameters}
        for name in {**truth.sizes, **other.sizes}:
            accuracy = self.accuracy.get(parameters[name].key)
            if accuracy is None:
                continue
            null = parameters[name].null
            true, _ = truth.sizes.get(name, (null, 0.0))
            expected, error = other.sizes.get(name, (null, 0.0))
            increase += (true - expected) ** 2 / (accuracy**2 + error**2)
        return increase

    def _by_simulation(self, truth: Hypothesis, other: Hypothesis) -> float:
        if self.without and not self.without & (truth.explanation.ids | other.explanation.ids):
            return 0.0
        absent = self.without | self.elsewhere
        try:
            true, assumed = (self._describe(hypothesis, absent) for hypothesis in (truth, other))
            if (
                true is None
                or assumed is None
                or true.candidate.observation.modes != assumed.candidate.observation.modes
            ):
                return 0.0
            return other.chi_square_increase(assumed, truth.predict(true, absent), absent)
        except (InfeasibleError, ReceptanceError, ValueError):
            return 0.0

    def _describe(self, hypothesis: Hypothesis, absent: frozenset[str]) -> Hypothetical | None:
        steps = tuple(step for step in hypothesis.explanation.steps if step.cause.id not in absent)
        return None if self.describe is None else self.describe(hypothesis.base, steps)


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
    longest = max(
        observation.assembly.get(address)
        for observation in model.observations
        if address in observation.assembly.parameters
    )
    longer = LONGER * longest
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
    levels = [
        observation.conditions["force"] for observation in model.observations if "force" in observation.conditions
    ]
    if index is None or not levels:
        return None
    conditions = {**model.observations[index].conditions, "force": HARDER * max(levels)}
    return Hypothetical(_frf(model, index, conditions=conditions), steps)


def part_alone(side: str, model: Model, steps: tuple[Step, ...]) -> Hypothetical | None:
    """Return natural frequencies of the "tool" with the longest overhang, or of the "holder", alone and free-free.

    The causes are in their assembly.
    """
    index = max(range(len(model.observations)), key=lambda i: _overhang(model, i))
    one, names = model.observations[index], getattr(model.anatomies[index], side)
    if not names:
        return None
    whole = transfer(replace(model, observations=(one,)), steps).observations[0].assembly
    own = [
        point
        for name, point in named(whole.attachments).items()
        # Masses that causes attach to the tool are there only while it is measured or clamped.
        if side == "holder" and point.part in names and name not in one.assembly.attachments
    ]
    assembly = with_points(Assembly([whole.elements[name] for name in names]), *own)
    frequencies = assembly.natural_frequencies(HIGHEST_ALONE)[:MODES_ALONE]
    place = Site(assembly)
    tolerances = []
    for error in _tolerances_of_new(model, index):
        moves = {address: size for address, size in error.moves.items() if place.covered(address)}
        tolerances += [replace(error, moves=moves)] if moves else []
    observation = Observation.from_modes(
        label=_NEW,
        assembly=assembly,
        modes=range(1, frequencies.size + 1),
        standard_deviation_hz=RESOLUTION_ALONE * frequencies,
        conditions=one.conditions,
    )
    return Hypothetical(Candidate(observation=observation, tolerances=tuple(tolerances)), ())


def _first_frf(model: Model) -> int | None:
    return next((i for i, observation in enumerate(model.observations) if observation.is_receptance), None)


def _frf(model: Model, index: int, *, tolerances: tuple[Tolerance, ...] | None = None, **changes: Any) -> Candidate:
    """Return an FRF like one that was measured, with changes."""
    one = model.observations[index]
    assert one.is_receptance
    fields: dict[str, Any] = {
        "assembly": one.assembly,
        "response": one.response,
        "excitation": one.excitation,
        "conditions": one.conditions,
    }
    observation = Observation(
        label=_NEW,
        frequency_hz=one.frequency_hz,
        standard_deviation=float(np.median(np.asarray(one.standard_deviation))),
        floor=Floor(),
        **(fields | changes),
    )
    own = _tolerances_of_new(model, index) if tolerances is None else tolerances
    return Candidate(observation=observation, tolerances=own)


def _tolerances_of_new(model: Model, index: int) -> tuple[Tolerance, ...]:
    """Return the errors of an observation as those of the new measurement."""
    place = model.observations[index].site(index)
    own = [tolerance for tolerance in model.tolerances if place.among(tolerance.configurations, tolerance.labels)]
    return tuple(
        one if one.configurations is None and one.labels is None else replace(one, configurations=(_NEW,), labels=None)
        for one in own
    )


def _overhang(model: Model, index: int) -> float:
    anatomy, one = model.anatomies[index], model.observations[index]
    return one.assembly.get(overhang_of(one.assembly, anatomy)) if anatomy.joint else 0.0


MENU = (
    MenuItem("weigh the blank", 1.0, {"tool_density.log_density": 5e-4, "tool_material.log_density": 5e-4}),
    MenuItem("weigh the sensor and state its mass", 1.0, {"sensor_mass.mass": 2e-5}),
    MenuItem("weigh collet and nut", 1.0, {"collet_mass.mass": 2e-3}),
    MenuItem("weigh the holder", 1.0, {"holder_inertia.log_density": 1e-3, "holder_inertia.mass": 2e-3}),
    MenuItem("measure the overhangs again with a caliper", 1.0, {"overhang_error.length": 3e-5}),
    MenuItem("look up which exponential window the analyser had", 1.0, {"exponential_window.decay_rate": 0.1}),
    MenuItem("measure a generator of known frequency with the analyser", 1.0, {"frequency_scale.log_scale": 1e-4}),
    MenuItem(
        "measure frequency and decay of the swing on the suspension",
        1.0,
        {"suspension.stiffness": 2e3, "suspension.damping": 2.0},
    ),
    MenuItem(
        "repeat one measurement without the exponential window",
        2.0,
        describe=assembly_again,
        without=frozenset({"exponential_window"}),
    ),
    MenuItem("hit once exactly at a marked place", 2.0, describe=assembly_again, without=frozenset({"hammer_offset"})),
    MenuItem(
        "measure a free mass that is known",
        3.0,
        {"calibration_gain.log_gain": 3e-3, "time_delay.delay": 2e-7},
        presence=frozenset({"wrong_quantity", "reversed_polarity"}),
    ),
    MenuItem(
        "hang it softer and repeat one measurement", 3.0, describe=assembly_again, without=frozenset({"suspension"})
    ),
    MenuItem("measure an FRF at the holder's nose", 3.0, describe=at_the_nose, elsewhere=frozenset({"hammer_offset"})),
    MenuItem("measure at a longer overhang", 3.0, describe=other_overhang),
    MenuItem("hit at three times the force", 3.0, describe=other_force),
    MenuItem("measure the blank alone, free-free", 4.0, describe=partial(part_alone, "tool")),
    MenuItem("measure the holder alone, free-free", 4.0, describe=partial(part_alone, "holder")),
    MenuItem(
        "measure a plain blank of the tool's size", 4.0, describe=assembly_again, without=frozenset({"fluted_part"})
    ),
)
"""The menu of the advice."""


@dataclass(frozen=True)
class _Valued:
    """A measurement, or two, with its value for the decision between the remaining explanations."""

    action: str
    """Instruction to the user."""
    cost: float
    """Effort."""
    increases: Mapping[tuple[int, int], float]
    """Increase of chi-square of the second explanation if the first one is true."""
    separates: tuple[str, ...]
    """Ids of the causes that it confirms or refutes in any case."""
    resolves: float
    """Share of the explanations that are found if they are true."""

    @property
    def worth(self) -> float:
        """Resolved share for its cost; if none is resolved, the smallest increase of chi-square."""
        return (self.resolves + 1e-3 * math.tanh(min(self.increases.values()) / MARGIN)) / math.sqrt(self.cost)


def advise(selection: Selection, judgement: Judgement) -> ProposedMeasurement | None:
    """Return the choice, or two of them, that resolve most for their cost; None if no choice is left.

    Each choice is simulated with each explanation as the truth. It separates another one from the truth where the
    evidence of the other is then expected to be lower by more than the margin, even two standard deviations below the
    expectation.
    """
    if judgement.answer in ("adequate", "named", "partly explained"):
        return None
    if judgement.answer == "undecided":
        return ProposedMeasurement(
            action=f"measure further modes, or {selection.base.model.separable[1]}",
            reason="the data have too few degrees of freedom to test the model",
        )
    if len(selection.base.model.configurations) == 1:
        sources, another = selection.base.model.separable
        return ProposedMeasurement(
            action=f"measure {another}", reason=f"one configuration does not distinguish {sources}"
        )
    if selection.base.one_mode:
        return ProposedMeasurement(
            action="measure up to a second mode", reason="one mode cannot separate the joint from the parts"
        )
    if judgement.answer == "unexplained":
        return ProposedMeasurement(
            action="measure blank and holder alone, free-free",
            reason="no known cause explains the data: this shows which part differs from its model",
        )
    remaining = list(judgement.reported)
    if len(remaining) == 1:
        remaining.append(Explanation((), selection.base, 0.0, 0.0))
    ids = judgement.ambiguous_between or tuple(cause.id for cause, _ in judgement.reported[0].steps)
    best = _best(remaining, selection.base.model, ids)
    if best is None or best.worth <= 0.0:
        return None
    return ProposedMeasurement(
        action=best.action,
        reason=_reason(best, len(remaining)),
        separates=best.separates,
        resolves=best.resolves,
        cost=best.cost,
    )


def _best(remaining: Sequence[Explanation], base: Model, ids: Sequence[str]) -> _Valued | None:
    """Return the measurement of the highest value, or two of them where one alone leaves a question open."""
    hypotheses = [Hypothesis(one, base) for one in remaining]
    pairs = list(itertools.permutations(range(len(remaining)), 2))
    best: _Valued | None = None
    singles: list[_Valued] = []
    for choice in sorted(MENU, key=lambda one: one.cost):
        # A choice that resolves everything is not exceeded by more expensive ones.
        if best is not None and best.worth >= 1.0 / math.sqrt(choice.cost):
            break
        increases = {(a, b): choice.discriminate(hypotheses[a], hypotheses[b]) for a, b in pairs}
        singles.append(_value(choice.action, choice.cost, increases, remaining, ids))
        best = max(singles, key=lambda one: one.worth)
    if best is None or best.resolves == 1.0:
        return best
    useful = [single for single in singles if max(single.increases.values()) > MARGIN]
    for one, other in itertools.combinations(useful, 2):
        # The increases of chi-square of two measurements add up at least.
        increases = {pair: one.increases[pair] + other.increases[pair] for pair in pairs}
        both = _value(f"{one.action}, and {other.action}", one.cost + other.cost, increases, remaining, ids)
        best = max(best, both, key=lambda found: found.worth)
    return best


def _value(
    action: str,
    cost: float,
    increases: Mapping[tuple[int, int], float],
    remaining: Sequence[Explanation],
    ids: Sequence[str],
) -> _Valued:
    separated = {(a, b): _separates(x, remaining[a], remaining[b]) for (a, b), x in increases.items()}
    numbers = range(len(remaining))
    resolved = [all(separated[a, b] for b in numbers if b != a) for a in numbers]
    separates = []
    for name in ids:
        having = [a for a in numbers if name in remaining[a].ids]
        lacking = [a for a in numbers if name not in remaining[a].ids]
        if lacking and all(separated[a, b] and separated[b, a] for a in having for b in lacking):
            separates.append(name)
    return _Valued(action, cost, increases, tuple(separates), sum(resolved) / len(remaining))


def _separates(increase: float, truth: Explanation, other: Explanation) -> bool:
    # The standard deviation of the increase is twice its square root.
    return increase - 2.0 * math.sqrt(increase) > MARGIN + max(other.evidence - truth.evidence, 0.0)


def _reason(best: _Valued, count: int) -> str:
    if best.resolves == 0.0:
        return (
            "in the simulation no measurement of the menu separates the remaining explanations; this one changes their "
            "evidence most"
        )
    if best.resolves == 1.0:
        return "in the simulation it identifies each of the remaining explanations"
    number = round(best.resolves * count)
    causes = f" ({', '.join(best.separates)})" if best.separates else ""
    return f"in the simulation it identifies {number} of the {count} remaining explanations{causes}"
