"""An oracle that knows which effect is hidden and fits its sizes, with the laboratory's own model.

It says how much there was to gain, in the data and on a tool that was not measured, and whether another effect would
have looked the same. The engine under test has no part in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from blind.generator import MEASUREMENT, Case, Effect, Record, Truth, rig
from blind.generator.case import JOINT, Stated, true_numbers, where_of
from blind.generator.effects import draw_effect, null_of
from blind.generator.records import measure

FLOOR = 0.003
JITTER = 1e-4
NOISIEST = 0.12
"""Lines whose logarithm scatters more than this are no longer normal and left out."""
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Data:
    """One record as the oracle takes it."""

    record: Record
    overhang: float
    lines: FloatArray
    log: NDArray[np.complex128]
    spread: FloatArray
    pulse: float


@dataclass(frozen=True)
class Fitted:
    """Where a fit ended: the vector, chi-square with priors, and the number of observed numbers."""

    x: FloatArray
    chi_square: float
    count: int
    steps: int


def data_of(case: Case, truth: Truth, *, exact: bool = False) -> list[Data]:
    """Return the records with the spreads that noise and floor give them; `exact` takes the noise away."""
    overhangs = {c.name: c.overhang for c in (*case.nominal.configurations, *case.new_tools)}
    found = []
    for record in case.records:
        p = truth.numbers[record.configuration, record.level, record.plane]
        found.append(_data(record, overhangs[record.configuration], p, truth.setups[record.level].pulse, exact))
    return found


def _data(record: Record, overhang: float, p: Mapping[str, float], pulse: float, exact: bool) -> Data:
    e = record.estimate
    clean = rig.recorded(p, e.frequency_hz, e.decay_rate, pulse)
    slope = np.gradient(np.unwrap(np.angle(clean)) * 1j + np.log(np.abs(clean)), np.log(e.frequency_hz))
    spread = np.sqrt(e.log_variance * e.correlated_lines + FLOOR**2 + (JITTER * np.abs(slope)) ** 2)
    kept = spread < NOISIEST
    values = clean if exact else e.receptance
    return Data(record, overhang, e.frequency_hz[kept], np.log(values[kept]), spread[kept], pulse)


class Problem:
    """The laboratory's model with joint, errors and effects as unknowns, against data.

    Unknowns are logarithms of the joint's numbers, errors in standard deviations, and sizes of effects in units of
    their own scale.
    """

    def __init__(
        self, case: Case, truth: Truth, data: Sequence[Data], effects: Sequence[Effect] = (),
        *, fixed: Mapping[str, float] | None = None, own: Sequence[str] | None = None,
    ) -> None:  # fmt: skip
        self.case, self.truth, self.data = case, truth, data
        self.effects = tuple(effects)
        self.sizes = [(i, name) for i, effect in enumerate(self.effects) for name in effect.sizes]
        scales = [self.effects[i].sizes[name] for i, name in self.sizes]
        self.scales = np.array([abs(scale) or 1e-6 for scale in scales])
        measured = {one.record.configuration for one in data}
        stated = [t.name for t in case.nominal.tolerances if t.configuration is None or t.configuration in measured]
        every = [*stated, *(f"{name} @ {c}" for name in JOINT for c in sorted(measured))]
        self.errors = [name for name in every if own is None or name in own]
        self.joint = list(JOINT) if fixed is None else []
        self.fixed = dict(fixed or {})
        self.size = len(self.joint) + len(self.errors) + len(self.sizes)

    def start(self, *, null: bool = False) -> FloatArray:
        """Return the truth, perhaps with effects as good as absent."""
        x = [np.log(self.truth.joint[name]) for name in self.joint]
        x += [self.truth.errors.get(name, 0.0) for name in self.errors]
        for (i, name), scale in zip(self.sizes, self.scales, strict=True):
            effect = self.effects[i]
            value = null_of(effect.id, effect.sizes)[name] if null else effect.sizes[name]
            x.append(value / scale)
        return np.array(x)

    def owner(self, index: int) -> str | None:
        """Return the only configuration that an unknown changes, None where it changes all."""
        at = index - len(self.joint)
        if at < 0:
            return None
        if at >= len(self.errors):
            return self.effects[self.sizes[at - len(self.errors)][0]].configuration
        name = self.errors[at]
        if " @ " in name:
            return name.split(" @ ")[1]
        stated: Stated = next(t for t in self.case.nominal.tolerances if t.name == name)
        return stated.configuration

    def _numbers(self, x: FloatArray, one: Data) -> dict[str, float]:
        joint = {name: float(np.exp(value)) for name, value in zip(self.joint, x, strict=False)} or {
            name: self.fixed[name] for name in JOINT
        }
        errors = {**self.fixed, **dict(zip(self.errors, x[len(self.joint) :], strict=False))}
        values: list[dict[str, float]] = [{} for _ in self.effects]
        for (i, name), scale, value in zip(
            self.sizes, self.scales, x[len(self.joint) + len(self.errors) :], strict=True
        ):
            values[i][name] = float(scale * value)
        record = one.record
        where = where_of(self.truth, record.configuration, one.overhang, record.level, record.plane)
        effects = tuple(zip(self.effects, values, strict=True))
        return true_numbers(self.case.nominal, self.truth, joint, errors, effects, where)

    def part(self, x: FloatArray, one: Data) -> FloatArray:
        """Return the residuals of one record."""
        with np.errstate(all="ignore"):
            model = rig.recorded(self._numbers(x, one), one.lines, one.record.estimate.decay_rate, one.pulse)
            difference = one.log - np.log(model)
        turns = 2.0 * np.pi * np.round(difference.imag / 2.0 / np.pi)
        return np.concatenate([difference.real, difference.imag - turns]) / np.tile(one.spread, 2)

    def residual(self, x: FloatArray) -> FloatArray:
        """Return all residuals, errors last."""
        try:
            parts = [self.part(x, one) for one in self.data]
        except (np.linalg.LinAlgError, ValueError):
            return np.full(1, np.inf)
        first = len(self.joint)
        return np.concatenate([*parts, x[first : first + len(self.errors)]])

    def jacobian(self, x: FloatArray, r: FloatArray) -> FloatArray:
        """Return differences."""
        result = np.zeros((r.size, x.size))
        edges = np.cumsum([0, *(2 * one.lines.size for one in self.data)])
        first, last = len(self.joint), len(self.joint) + len(self.errors)
        for j in range(x.size):
            step = 1e-2 if first <= j < last else 1e-4
            away = x.copy()
            away[j] += step
            for k, one in enumerate(self.data):
                if self.owner(j) in (None, one.record.configuration):
                    rows = slice(edges[k], edges[k + 1])
                    change = self.part(away, one) - r[rows]
                    result[rows, j] = change / step
            if first <= j < last:
                result[edges[-1] + j - first, j] = 1.0
        return result

    def fit(self, x: FloatArray, most: int = 12, enough: float = 0.1) -> Fitted:
        """Return the least chi-square near a start, by Levenberg and Marquardt; the slope is kept while it serves."""
        r = self.residual(x)
        cost = float(r @ r)
        if not np.isfinite(cost):
            return Fitted(x, np.inf, r.size, 0)
        jacobian = self.jacobian(x, r)
        fresh, damping, steps = True, 1e-4, 0
        for steps in range(1, most + 1):  # noqa: B007 - it is reported
            normal = jacobian.T @ jacobian
            gradient = jacobian.T @ r
            size = np.sqrt(np.diag(normal)) + 1e-12
            scaled = normal / np.outer(size, size) + damping * np.eye(x.size)
            step = -np.linalg.solve(scaled, gradient / size) / size
            trial = self.residual(x + step)
            there = float(trial @ trial) if np.isfinite(trial).all() else np.inf
            gain = cost - there
            if gain > 0.0:
                x, r, cost = x + step, trial, there
                damping = max(damping * 0.1, 1e-8)
            if gain < enough:
                if gain <= 0.0:
                    damping = max(damping * 30.0, 1e-3)
                if fresh and abs(gain) < enough:
                    break
                if damping > 1e6:
                    break
            if gain < 0.3 * (cost + max(gain, 0.0)) and not fresh:
                jacobian, fresh = self.jacobian(x, r), True
            else:
                fresh = False if gain > 0.0 else fresh
                if gain <= 0.0 and not fresh:
                    jacobian, fresh = self.jacobian(x, r), True
        return Fitted(x, cost, r.size - len(self.errors), steps)


@dataclass(frozen=True)
class Oracle:
    """What there was to gain."""

    gain: float
    """Decrease of chi-square by the truth's own parameters, all effects together."""
    each: dict[str, float]
    """Decrease by each effect beside the others."""
    each_held_out: dict[str, float]
    """Nats on a new tool by each effect beside the others."""
    held_out: float
    """Nats on a new tool."""
    misfit: float
    """Chi-square of the fit without effects over its expectation."""
    misfit_true: float
    frequencies_before: dict[str, list[float]]
    frequencies_after: dict[str, list[float]]
    frequencies_true: dict[str, list[float]]

    local: bool = False
    """Whether the effect is in one configuration only, so that a new tool does not have it."""

    @property
    def large(self) -> bool:
        """Whether the effect counts as large enough to be found."""
        seen = self.local or self.held_out > 5.0
        both = all(self.each[id] > 30.0 and self.each_held_out[id] > 5.0 for id in self.each)
        return self.gain > 30.0 and seen and both


def consult(case: Case, truth: Truth) -> Oracle:
    """Return what the oracle says of a case."""
    data = data_of(case, truth)
    full = Problem(case, truth, data, truth.effects)
    best = full.fit(full.start(), most=4)
    base_problem = Problem(case, truth, data)
    base = base_problem.fit(best.x[: base_problem.size]) if truth.effects else best
    each, each_held_out = {}, {}
    score = _on_new_tool(case, truth, full, best) if truth.effects else 0.0
    if len(truth.effects) > 1:
        for effect in truth.effects:
            others = Problem(case, truth, data, [one for one in truth.effects if one is not effect])
            kept = [j for j, (i, _) in enumerate(full.sizes) if truth.effects[i] is not effect]
            start = np.concatenate([best.x[: base_problem.size], best.x[base_problem.size :][kept]])
            without = others.fit(start)
            each[effect.id] = without.chi_square - best.chi_square
            each_held_out[effect.id] = 0.5 * (_on_new_tool(case, truth, others, without) - score)
    held_out = 0.5 * (_on_new_tool(case, truth, base_problem, base) - score) if truth.effects else 0.0
    predicted = [_frequencies(case, truth, one, fit) for one, fit in ((base_problem, base), (full, best))]
    return Oracle(
        gain=base.chi_square - best.chi_square,
        each=each,
        each_held_out=each_held_out,
        held_out=held_out,
        misfit=base.chi_square / base.count,
        misfit_true=best.chi_square / best.count,
        frequencies_before=predicted[0],
        frequencies_after=predicted[1],
        frequencies_true={c.name: truth.frequencies(c.name).tolist() for c in case.new_tools},
        local=any(effect.configuration for effect in truth.effects),
    )


def _values(problem: Problem, fit: Fitted) -> tuple[dict[str, float], list[Effect]]:
    """Return joint and errors, and the effects with their sizes, of a fit."""
    n = len(problem.joint)
    found = {name: float(np.exp(v)) for name, v in zip(problem.joint, fit.x, strict=False)}
    found |= {name: float(v) for name, v in zip(problem.errors, fit.x[n:], strict=False)}
    effects = list(problem.effects)
    sizes = fit.x[n + len(problem.errors) :]
    for (i, name), scale, value in zip(problem.sizes, problem.scales, sizes, strict=True):
        effects[i] = replace(effects[i], sizes={**effects[i].sizes, name: float(scale * value)})
    return found, effects


def _on_new_tool(case: Case, truth: Truth, problem: Problem, fit: Fitted) -> float:
    """Return chi-square on a tool that was not measured, whose own errors are fitted, all else being held."""
    tool = case.new_tools[0]
    # Measured like the others, where an effect of amplitude or plane shows.
    level, plane = max(truth.setups), max(record.plane for record in case.records)
    hidden = tuple((effect, None) for effect in truth.effects)
    there = where_of(truth, tool.name, tool.overhang, level, plane)
    p = true_numbers(case.nominal, truth, truth.joint, truth.errors, hidden, there)
    rng = np.random.default_rng([*truth.seed, 77])
    estimate = measure(rng, p, truth.setups[level])
    record = Record(
        label=tool.name, configuration=tool.name, level=level, plane=plane, form="receptance",
        estimate=estimate,
    )  # fmt: skip
    data = _data(record, tool.overhang, p, truth.setups[level].pulse, False)
    values, effects = _values(problem, fit)
    own = [f"overhang {tool.name}", *(f"{name} @ {tool.name}" for name in JOINT)]
    single = [effect for effect in effects if effect.configuration is None]
    held = Problem(case, truth, [data], (), fixed=values, own=own)
    held.effects = tuple(single)

    def numbers(x: FloatArray, one: Data) -> dict[str, float]:
        errors = {**values, **dict(zip(own, x, strict=True))}
        joint = {name: values[name] for name in JOINT}
        return true_numbers(case.nominal, truth, joint, errors, tuple((e, None) for e in single), there)

    held._numbers = numbers  # type: ignore[method-assign]
    return held.fit(np.zeros(len(own)), most=8).chi_square


def _frequencies(case: Case, truth: Truth, problem: Problem, fit: Fitted) -> dict[str, list[float]]:
    """Return the natural frequencies that a fit predicts for the new tools."""
    values, effects = _values(problem, fit)
    effects = [effect for effect in effects if effect.id not in MEASUREMENT]
    found = {}
    for tool in case.new_tools:
        where = where_of(truth, tool.name, tool.overhang, truth.references[1], 1)
        joint = {name: values[name] for name in JOINT}
        p = true_numbers(case.nominal, truth, joint, values, tuple((e, None) for e in effects), where)
        found[tool.name] = rig.natural_frequencies(p, 9000.0).tolist()
    return found


def same_answer(case: Case, truth: Truth, id: str, tries: int = 5) -> bool:
    """Return whether another effect, alone, fits the truth without noise to within three nats.

    Of the truth's own effects, that is: what deviations within tolerances cost is not laid to the other one's charge.
    """
    data = data_of(case, truth, exact=True)
    own = Problem(case, truth, data, list(truth.effects))
    least = own.fit(own.start(null=False), most=20).chi_square
    rng = np.random.default_rng([*truth.seed, 78])
    for attempt in range(tries):
        effect = draw_effect(rng, id, (attempt + 0.5) / tries, case.nominal.numbers)
        if not effect.sizes:
            continue
        problem = Problem(case, truth, data, [effect])
        if problem.fit(problem.start(null=attempt == 0), most=10).chi_square < least + 6.0:
            return True
    return False
