"""Advice: the next measurement, from a menu with costs, that separates the remaining explanations best.

If one explanation is true, another one is fitted to its simulated data of the measurement together with the data of the
diagnosis. The increase of its chi-square is the evidence that the measurement would remove (`predict.gain`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.causes import transfer
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.judgement import Judgement
from receptance.diagnosis.model import Model, named, with_points
from receptance.diagnosis.prediction import predictor_of
from receptance.diagnosis.thresholds import MARGIN
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, altered
from receptance.fit.predictor import Predictor
from receptance.fit.problem import End
from receptance.model.assembly import Assembly
from receptance.predict.gain import fit_jointly, worth
from receptance.predict.menu import Candidate, Menu


@dataclass(frozen=True, kw_only=True)
class ProposedMeasurement:
    """The measurement that is proposed next."""

    action: str
    """The measurement."""
    reason: str
    """Result of its simulation."""
    separates: tuple[str, ...] = ()
    """Ids of the causes whose presence it is expected to decide, whichever reported explanation is true."""
    resolves: float = 0.0
    """Share of the reported explanations that it distinguishes from all others, if they are true."""
    cost: float = 0.0
    """Effort, in hits on the machine."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One of the remaining explanations, of which one is true, and the model without causes."""

    explanation: Explanation
    base: Model

    @cached_property
    def whole(self) -> Predictor:
        """The predictor of its fit."""
        return predictor_of(self.explanation.fit)

    @cached_property
    def sizes(self) -> dict[str, tuple[float, float]]:
        """Sizes of its causes beyond their nulls and the standard errors; a cause without a size has 1."""
        whole, parameters = self.whole, self.explanation.parameters
        errors = np.linalg.norm(np.linalg.inv(whole.information_root), axis=1) * whole.variables.slopes(whole.values)
        rows = zip(whole.variables.names, whole.values.tolist(), errors.tolist(), strict=True)
        sizes = {name: (value - parameters[name].null, error) for name, value, error in rows if name in parameters}
        without = self.explanation.ids - {parameter.cause for parameter in parameters.values()}
        return sizes | dict.fromkeys(without, (1.0, 0.0))

    @cached_property
    def fitted(self) -> tuple[Observation, ...]:
        """The data of the diagnosis, on few lines of each receptance."""
        return self.explanation.fit.model.on_few_lines

    @cached_property
    def end(self) -> End:
        """The fit to these alone."""
        return fit_jointly(self.whole, self.fitted)

    def predict(self, item: MenuItem) -> NDArray[Any] | None:
        """Return the noise-free data of a measurement if the explanation is true; None where it cannot be made."""
        model = self._measured(item)
        if model is None:
            return None
        (observation,) = model.observations
        (data,) = self._predictor(item).of([observation], [model.tolerances]).mean()
        # A cause that changes the quantity of the data has changed the placeholder data.
        return data / observation.receptance if observation.is_receptance else data

    def chi_square_increase(self, item: MenuItem, data: NDArray[Any]) -> float:
        """Return the increase of chi-square by the data of a simulated measurement, on few lines."""
        model = self._measured(item, data)
        if model is None:
            return 0.0
        end = fit_jointly(self._predictor(item), self.fitted, model.observations, [model.tolerances])
        return max(2.0 * (end.cost - self.end.cost), 0.0)

    def _predictor(self, item: MenuItem) -> Predictor:
        """Return the predictor of the fit on few lines, with the causes that act on a measurement."""
        names = [name for name, parameter in self.explanation.parameters.items() if parameter.cause in item.absent]
        values = self.whole.variables.to_values(self.end.x)
        return replace(self.whole, values=values, parameters=self.whole.parameters.without_effect(names))

    def _measured(self, item: MenuItem, data: NDArray[Any] | None = None) -> Model | None:
        """Return a measurement with its causes as the only observation of a model; without data with ones."""
        model = self.base
        variants = [variant for variant in self.explanation.variants if variant.cause.id not in item.absent]
        if item.describe in (Menu.tool_alone, Menu.holder_alone, Menu.blank_in_spindle):
            # The parts themselves are as the causes have changed them.
            model, variants = self.explanation.fit.model, []
        assert item.describe is not None
        candidate = item.describe(Menu(model.observations, model.unknowns, model.tolerances))
        if candidate is None or (data is not None and data.size != candidate.observation.frequency_hz.size):
            return None
        observation = candidate.observation
        if item.describe is Menu.holder_alone:
            observation = altered(observation, assembly=self._with_added_points(observation.assembly))
        observation = observation.with_values(np.ones(observation.frequency_hz.size) if data is None else data)
        measured = replace(self.base, observations=(observation,), tolerances=candidate.tolerances)
        return transfer(measured if data is None else measured.thinned, variants)

    def _with_added_points(self, holder: Assembly) -> Assembly:
        """Return the holder alone with what causes have attached to it.

        Masses that they attach to the tool are there only while it is measured or clamped.
        """
        before = {name for observation in self.base.observations for name in observation.assembly.attachments}
        points = {
            name: point
            for observation in self.explanation.fit.model.observations
            for name, point in named(observation.assembly.attachments).items()
            if name not in before and point.part in holder.elements
        }
        return with_points(holder, *points.values())


@dataclass(frozen=True)
class MenuItem:
    """A measurement that can be advised: of the sizes of causes, or one that is simulated."""

    action: str
    """Instruction to the user."""
    cost: float
    """Effort, about that of so many hits on the machine."""
    accuracy: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a direct measurement of sizes in SI units, by parameter ("sensor_mass.mass"), or by the id
    of a cause without a size."""
    describe: Callable[[Menu], Candidate | None] | None = None
    """Returns the simulated measurement; None where the model does not have it."""
    without: frozenset[str] = frozenset()
    """Ids of the causes that the measurement excludes, and for which it is made."""
    elsewhere: frozenset[str] = frozenset()
    """Ids of causes that act only at the places that were hit before."""
    in_spindle: bool | None = None
    """Whether it is for a holder in a spindle, or for one that is not; None for both."""

    def discriminate(self, truth: Hypothesis, other: Hypothesis) -> float:
        """Return the expected increase of chi-square of another hypothesis if one is true.

        It is zero where the measurement does not apply.
        """
        ids = truth.explanation.ids | other.explanation.ids
        if self.describe is not None:
            if self.without and not self.without & ids:
                return 0.0
            try:
                data = truth.predict(self)
                return 0.0 if data is None else other.chi_square_increase(self, data)
            except (ReceptanceError, ValueError):
                return 0.0
        increase = 0.0
        parameters = {**truth.explanation.parameters, **other.explanation.parameters}
        for name in {**truth.sizes, **other.sizes}:
            accuracy = self.accuracy.get(parameters[name].key if name in parameters else name)
            if accuracy is not None:
                (true, _), (expected, error) = (each.sizes.get(name, (0.0, 0.0)) for each in (truth, other))
                increase += (true - expected) ** 2 / (accuracy**2 + error**2)
        return increase

    @property
    def absent(self) -> frozenset[str]:
        """Ids of the causes that do not act on a simulated measurement."""
        return self.without | self.elsewhere


MENU = (
    MenuItem("weigh the blank", 1.0, {"tool_density.log_density": 5e-4, "tool_material.log_density": 5e-4}),
    MenuItem("weigh the sensor and state its mass", 1.0, {"sensor_mass.mass": 2e-5}),
    MenuItem("weigh collet and nut", 1.0, {"collet_mass.mass": 2e-3}),
    MenuItem("weigh the holder", 1.0, {"holder_inertia.log_density": 1e-3, "holder_inertia.mass": 2e-3}),
    MenuItem("measure the overhangs again with a caliper", 1.0, {"overhang_error.length": 3e-5}),
    MenuItem("look up which exponential window the analyser had", 1.0, {"exponential_window.decay_rate": 0.1}),
    MenuItem(
        "measure a generator of known frequency with the analyser",
        1.0,
        {"frequency_scale.log_scale": 1e-4, "frequency_scale.offset": 0.1},
    ),
    MenuItem(
        "measure frequency and decay of the swing on the suspension",
        1.0,
        {"suspension.stiffness": 2e3, "suspension.damping": 2.0},
        in_spindle=False,
    ),
    MenuItem(
        "repeat one measurement without the exponential window",
        2.0,
        describe=Menu.again,
        without=frozenset({"exponential_window"}),
    ),
    MenuItem("hit once exactly at a marked place", 2.0, describe=Menu.again, without=frozenset({"hammer_offset"})),
    MenuItem(
        "measure a free mass that is known",
        3.0,
        {
            "calibration_gain.log_gain": 3e-3,
            "time_delay.delay": 2e-7,
            "wrong_quantity": 0.03,
            "reversed_polarity": 0.03,
        },
    ),
    MenuItem(
        "hang it softer and repeat one measurement",
        3.0,
        describe=Menu.again,
        without=frozenset({"suspension"}),
        in_spindle=False,
    ),
    MenuItem("hit the gauge blank again in the warm spindle", 3.0, describe=Menu.blank_in_spindle, in_spindle=True),
    MenuItem(
        "measure an FRF at the holder's nose", 3.0, describe=Menu.at_the_nose, elsewhere=frozenset({"hammer_offset"})
    ),
    MenuItem("measure at a longer overhang", 3.0, describe=Menu.longer_overhang),
    MenuItem("hit at three times the force", 3.0, describe=Menu.higher_force),
    MenuItem("measure the blank alone, free-free", 4.0, describe=Menu.tool_alone),
    MenuItem("measure the holder alone, free-free", 4.0, describe=Menu.holder_alone, in_spindle=False),
    MenuItem("measure a plain blank of the tool's size", 4.0, describe=Menu.again, without=frozenset({"fluted_part"})),
)
"""The menu of the advice."""


def menu_of(model: Model) -> list[MenuItem]:
    """Return the measurements that can be made on what a model describes, cheapest first."""
    possible = [item for item in MENU if item.in_spindle in (None, model.in_spindle)]
    return sorted(possible, key=lambda item: item.cost)


def advise(selection: Selection, judgement: Judgement) -> ProposedMeasurement | None:
    """Return the choice, or two of them, that resolve most for their cost; None if no choice is left.

    Each choice is simulated with each explanation as the truth. It separates another one from the truth where the
    evidence of the other is then expected to be lower by more than the margin, even two standard deviations below the
    expectation.
    """
    model = selection.base.model
    sources, another = model.separable
    if judgement.answer in ("adequate", "named", "partly explained"):
        return None
    if judgement.answer == "undecided":
        return ProposedMeasurement(
            action=f"measure further modes, or {another}",
            reason="the data have too few degrees of freedom to test the model",
        )
    if len(model.configurations) == 1:
        reason = f"one configuration does not distinguish {sources}"
        return ProposedMeasurement(action=f"measure {another}", reason=reason)
    if selection.base.one_mode:
        return ProposedMeasurement(
            action="measure up to a second mode", reason="one mode cannot separate the joint from the parts"
        )
    if judgement.answer == "unexplained":
        action = "measure blank and holder alone, free-free"
        if model.in_spindle:
            action = "hit the gauge blank again in the warm spindle, and measure the blank of the tool alone, free-free"
        return ProposedMeasurement(
            action=action, reason="no known cause explains the data: this shows which part differs from its model"
        )
    remaining = list(judgement.reported)
    if len(remaining) == 1:
        remaining.append(Explanation((), selection.base, 0.0, 0.0))
    ids = judgement.ambiguous_between or tuple(variant.cause.id for variant in judgement.reported[0].variants)
    return _best(remaining, model, ids)


def _best(remaining: Sequence[Explanation], base: Model, ids: Sequence[str]) -> ProposedMeasurement | None:
    """Return the measurement of the highest worth, or two of them where one alone leaves a question open."""
    hypotheses = [Hypothesis(explanation, base) for explanation in remaining]
    pairs = list(itertools.permutations(range(len(remaining)), 2))
    best: tuple[float, ProposedMeasurement] | None = None
    simulated: list[tuple[MenuItem, dict[tuple[int, int], float]]] = []
    for item in menu_of(base):
        # A choice that resolves everything is not exceeded by more expensive ones.
        if best is not None and best[0] >= worth(1.0, item.cost):
            break
        increases = {(a, b): item.discriminate(hypotheses[a], hypotheses[b]) for a, b in pairs}
        simulated.append((item, increases))
        best = _better(best, item.action, item.cost, increases, remaining, ids)
    if best is not None and best[1].resolves < 1.0:
        useful = [(item, increases) for item, increases in simulated if max(increases.values()) > MARGIN]
        for (item, increases), (other, further) in itertools.combinations(useful, 2):
            # The increases of chi-square of two measurements add up at least.
            both = {pair: increases[pair] + further[pair] for pair in pairs}
            action = f"{item.action}, and {other.action}"
            best = _better(best, action, item.cost + other.cost, both, remaining, ids)
    return None if best is None or best[0] <= 0.0 else best[1]


def _better(
    best: tuple[float, ProposedMeasurement] | None,
    action: str,
    cost: float,
    increases: Mapping[tuple[int, int], float],
    remaining: Sequence[Explanation],
    ids: Sequence[str],
) -> tuple[float, ProposedMeasurement]:
    """Return the best proposal so far with its worth, or a further one that is worth more.

    The worth is that of the share of the explanations that it resolves; if it resolves none, of the smallest increase
    of chi-square. `increases` are those of the second explanation if the first one is true, and `ids` the causes that
    are to be confirmed or refuted.
    """
    separated = {(a, b): _separates(x, remaining[a], remaining[b]) for (a, b), x in increases.items()}
    count, numbers = len(remaining), range(len(remaining))
    resolved = sum(all(separated[a, b] for b in numbers if b != a) for a in numbers)
    value = worth(resolved / count + 1e-3 * math.tanh(min(increases.values()) / MARGIN), cost)
    if best is not None and value <= best[0]:
        return best
    separates = []
    for name in ids:
        having = [a for a in numbers if name in remaining[a].ids]
        lacking = [a for a in numbers if name not in remaining[a].ids]
        if lacking and all(separated[a, b] and separated[b, a] for a in having for b in lacking):
            separates.append(name)
    if resolved == count:
        result = "it identifies each of the remaining explanations"
    elif resolved:
        causes = f" ({', '.join(separates)})" if separates else ""
        result = f"it identifies {resolved} of the {count} remaining explanations{causes}"
    else:
        result = "no measurement of the menu separates the remaining explanations; this one changes their evidence most"
    return value, ProposedMeasurement(
        action=action,
        reason=f"in the simulation {result}",
        separates=tuple(separates),
        resolves=resolved / count,
        cost=cost,
    )


def _separates(increase: float, truth: Explanation, other: Explanation) -> bool:
    # The standard deviation of the increase is twice its square root.
    return increase - 2.0 * math.sqrt(increase) > MARGIN + max(other.evidence - truth.evidence, 0.0)
