"""An oracle that fits the sizes of the hidden effect with the model of the generator.

It returns the possible gain, in the data and on a tool that was not measured, and whether another effect explains the
data equally well. It does not use the engine under test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from blind.generator import MEASUREMENT, Case, Effect, Record, Truth, rig
from blind.generator.case import JOINT, true_numbers, where_of
from blind.generator.effects import draw_effect
from blind.generator.records import measure
from blind.problem import Data, Fitted, FloatArray, Problem, data_from, data_of

CURVED = ("joint_spread", "missing_mode", "collet_mass", "flexible_body", "suspension", "hammer_offset")
"""Effects whose fit from nothing may end elsewhere than from some size."""


@dataclass(frozen=True)
class Oracle:
    """The possible gain."""

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
        detectable = self.local or self.held_out > 5.0
        both = all(self.each[id] > 30.0 and self.each_held_out[id] > 5.0 for id in self.each)
        return self.gain > 30.0 and detectable and both


def consult(case: Case, truth: Truth) -> Oracle:
    """Return the result of the oracle for a case."""
    data = data_of(case, truth)
    full = Problem(case, truth, data, truth.effects)
    best = full.fit(full.start(), most=12)
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
    there = where_of(truth, tool, level, plane)
    p = true_numbers(case.nominal, truth, truth.joint, truth.errors, hidden, there)
    rng = np.random.default_rng([*truth.seed, 77])
    estimate = measure(rng, p, truth.setups[level])
    record = Record(
        label=tool.name, configuration=tool.name, level=level, plane=plane, form="receptance",
        estimate=estimate,
    )  # fmt: skip
    data = data_from(record, tool, p, truth.setups[level].pulse, False)
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
        where = where_of(truth, tool, truth.references[1], 1)
        joint = {name: values[name] for name in JOINT}
        p = true_numbers(case.nominal, truth, joint, values, tuple((e, None) for e in effects), where)
        found[tool.name] = rig.natural_frequencies(p, 9000.0).tolist()
    return found


def same_answer(case: Case, truth: Truth, id: str, beside: Sequence[str] = (), *, tries: int = 12) -> bool:
    """Return whether another effect, beside some of the truth's own, fits the truth without noise to within three nats.

    Of the truth's own effects, that is: what deviations within tolerances cost is not laid to the other one's charge.
    The ways in which the other one may act, and where it may start, are drawn; the most promising ones are fitted.
    """
    data = data_of(case, truth, exact=True)
    own = Problem(case, truth, data, truth.effects)
    best = own.fit(own.start(), most=20)
    limit = best.chi_square + 6.0
    kept = [effect for effect in truth.effects if effect.id in beside]
    base = Problem(case, truth, data, kept)
    start = base.fit(base.start(), most=20)
    if start.chi_square < limit:
        return True
    # An effect in one configuration may be indistinguishable from another one there.
    places = sorted({effect.configuration for effect in truth.effects if effect.configuration})
    return imitated(base, kept, id, limit, (start.x, best.x[: base.size]), places, tries)


def imitated(
    base: Problem, kept: Sequence[Effect], id: str, limit: float, joints: Sequence[FloatArray],
    places: Sequence[str] = (), tries: int = 12,
) -> bool:  # fmt: skip
    """Return whether an effect fits the data of a problem without it to a chi-square below a limit.

    Parameters
    ----------
    base : Problem
        The problem without the effect.
    kept : sequence of Effect
        Effects that the problem has beside it.
    id : str
        The effect.
    limit : float
        Chi-square that is to be reached.
    joints : sequence of ndarray
        Where the unknowns of the base start.
    places : sequence of str, optional
        Configurations in one of which alone the effect may act, beside all of them.
    tries : int, optional
        In how many ways the effect may act.
    """
    case, truth, data = base.case, base.truth, base.data
    ranked = []
    ways = _ways(case, truth, id, tries)
    if id == "missing_mode":
        worst = _worst(base, joints[0])
        ways = [replace(one, sizes={**one.sizes, "fixture.hz": hz}) for one in ways[:3] for hz in worst]
    ways += [replace(one, configuration=place) for one in ways for place in places]
    for effect in ways:
        problem = Problem(case, truth, data, [*kept, effect])
        for null in (True, False)[: 1 + (id in CURVED)]:
            for joint in joints:
                x = np.concatenate([joint, problem.start(null=null)[base.size :]])
                ranked.append((problem.promise(x), len(ranked), problem, x))
    best_first = [(problem, x) for _, _, problem, x in sorted(ranked)[:4]]
    return any(problem.fit(x, most=25, hopeless=limit).chi_square < limit for problem, x in best_first)


def _worst(problem: Problem, x: FloatArray) -> list[float]:
    """Return where in frequency the records differ most from a model, one for each configuration."""
    found = {}
    for one in problem.data:
        size = np.sum(np.square(problem.part(x, one).reshape(2, -1)), axis=0)
        found[one.record.configuration] = float(one.lines[np.argmax(size)])
    return list(found.values())


def _ways(case: Case, truth: Truth, id: str, tries: int) -> list[Effect]:
    """Return effects of a kind that act in different ways, of middling size."""
    rng = np.random.default_rng([*truth.seed, 78])
    drawn = [draw_effect(rng, id, (attempt % 5 + 0.5) / 5.0, case.nominal.numbers) for attempt in range(4 * tries)]
    # Two that differ only in size have the same optimum.
    others = {tuple(sorted(effect.fixed.items())) or i % 3: effect for i, effect in enumerate(drawn)}
    return list(others.values())[:tries]
