"""From answers to the table: every share with its exact binomial interval, nothing hidden behind a pass mark."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import stats

from blind.generator import CATALOGUE, OUTSIDE, draw_case, shuffled
from blind.oracle import consult, same_answer

LEVEL = 0.95
CERTAIN = 1.5
"""Base misfit, as a multiple of what noise explains, from which something foreign must not be named."""


@dataclass(frozen=True)
class Outcome:
    """One case: what was hidden, what the oracle gains, what was answered."""

    seed: int
    index: int
    kind: str
    effects: tuple[str, ...]
    sizes: tuple[float, ...]
    """How large the effects were drawn, from 0 to 1."""
    large: bool
    oracle: dict[str, Any]
    verdict: str
    reported: tuple[str, ...]
    together: tuple[str, ...]
    same: tuple[str, ...]
    """Reported ids that would have looked the same as the truth."""
    seconds: float
    misfit: float
    misfit_after: float
    share: float | None
    """Improvement on new tools as a share of the oracle's."""
    covered: tuple[bool, ...]
    """Of natural frequencies of new tools by 95 % intervals."""
    size_covered: tuple[bool, ...]
    layer: bool = False
    error: str = ""
    candidates: list[Any] = field(default_factory=list)
    next_measurement: str = ""
    shuffled: tuple[str, ...] = ()
    """Verdict and reported ids under other names and without remarks, where that was asked."""
    resolved: bool | None = None
    """Whether the advised measurement led from an ambiguous verdict to the right name."""

    @property
    def found(self) -> tuple[str, ...]:
        """Reported ids that are right or as good as right."""
        return tuple(id for id in self.reported if id in self.effects or id in self.same)

    @property
    def in_set(self) -> bool:
        """Whether every effect, or what looks the same, is reported."""
        if not self.effects:
            return False
        return all(id in self.reported for id in self.effects) or (len(self.effects) == 1 and bool(self.found))

    @property
    def named_right(self) -> bool:
        """Whether all of the effects and nothing else is named."""
        return self.verdict == "named" and self.in_set and len(self.found) == len(self.reported)

    @property
    def named_wrong(self) -> bool:
        """Whether something is named that is not there."""
        return self.verdict == "named" and len(self.found) < len(self.reported)


def run_case(
    seed: int, index: int, kind: str, effects: Sequence[str], ask: Callable[[Any], Any], *, quick: bool = False,
    u: float | None = None, oracle: bool = True,
) -> Outcome:  # fmt: skip
    """Draw a case, have it answered, and open the truth."""
    case, truth = draw_case(seed, index, kind, tuple(effects), quick=quick, u=u)
    answer = ask(case)
    names = tuple(effect.id for effect in truth.effects)
    resolved = _resolved(ask, case, names, answer) if answer.verdict == "ambiguous" and names else None
    again = ask(shuffled(case)) if kind == "misleading" else None
    told = consult(case, truth) if oracle else None
    wrong = [id for id in answer.reported if id not in names]
    local = any(effect.configuration for effect in truth.effects)
    same = tuple(
        id for id in wrong if oracle and names and not local and id in CATALOGUE and same_answer(case, truth, id)
    )
    frequencies = {c.name: truth.frequencies(c.name) for c in case.new_tools}
    return Outcome(
        seed=seed,
        index=index,
        kind=kind,
        effects=names,
        sizes=tuple(effect.u for effect in truth.effects),
        large=told.large if told else True,
        oracle={} if told is None else dataclasses.asdict(told),
        verdict=answer.verdict,
        reported=tuple(answer.reported),
        together=tuple(answer.together),
        same=same,
        seconds=answer.seconds,
        misfit=answer.misfit,
        misfit_after=answer.misfit_after,
        share=_share(told, answer) if told else None,
        covered=_coverage(frequencies, answer.predictions),
        size_covered=_sizes_covered(truth, answer),
        layer=case.nominal.layer,
        error=answer.error,
        candidates=list(answer.candidates),
        next_measurement=answer.next_measurement,
        resolved=resolved,
        shuffled=() if again is None else (again.verdict, *sorted(again.reported)),
    )


def _resolved(ask: Callable[..., Any], case: Any, names: tuple[str, ...], answer: Any) -> bool:
    """Return whether the advised measurement resolves an ambiguous verdict to the right name.

    What it shows by itself (a weight, a length, a gain) is known afterwards: either it is the effect, or it is none and
    the diagnosis is repeated without it.
    """
    if not answer.separates:
        return False
    if set(names) & set(answer.separates):
        return set(names) <= set(answer.separates)
    second = ask(case, without=answer.separates)
    return second.verdict == "named" and set(second.reported) == set(names)


def _error(predicted: dict[str, list[float]], true: dict[str, list[float]]) -> float | None:
    """Return the rms error of natural frequencies over the new tools, in %."""
    found = []
    for name, frequencies in true.items():
        own = predicted.get(name)
        if own is None:
            return None
        if not own:
            return None
        # By the nearest one: a mode too many or too few would shift all the others.
        away = np.abs(np.array(own)[None, :] / np.array(frequencies)[:, None] - 1.0).min(axis=1)
        found += list(100.0 * away)
    return float(np.sqrt(np.mean(np.square(found)))) if found else None


def _share(told: Any, answer: Any) -> float | None:
    """Return how much of the oracle's improvement on new tools was reached; None where there was hardly any."""
    true = told.frequencies_true
    before, best = (_error(one, true) for one in (told.frequencies_before, told.frequencies_after))
    after = _error({name: pair[0] for name, pair in answer.predictions.items()}, true)
    if before is None or best is None or after is None or before - best < 0.02:
        return None
    return float((before - after) / (before - best))


def _coverage(true: dict[str, Any], predictions: dict[str, Any]) -> tuple[bool, ...]:
    covered = []
    for name, frequencies in true.items():
        if name not in predictions:
            continue
        values, errors = predictions[name]
        if len(values) != len(frequencies):
            covered.append(False)
            continue
        covered += [
            bool(abs(v - f) <= stats.norm.ppf(0.975) * e) for v, e, f in zip(values, errors, frequencies, strict=True)
        ]
    return tuple(covered)


_SIZES: dict[str, tuple[str, Callable[[float], float]]] = {
    "sensor_mass": ("mass", float),
    "hammer_offset": ("distance", float),
    "time_delay": ("delay", float),
    "overhang_error": ("length", float),
    "joint_hysteretic_loss": ("loss", float),
    "exponential_window": ("rate", float),
    "calibration_gain": ("gain", np.log1p),
    "tool_modulus": ("share", np.log1p),
    "tool_density": ("share", np.log1p),
    "holder_modulus": ("share", np.log1p),
    "holder_inertia": ("share", np.log1p),
    "joint_amplitude": ("exponent", float),
    "joint_overhang_law": ("exponent", float),
    "collet_mass": ("mass", float),
}
"""Effects whose size the package states as one number, and how ours becomes it."""


def _sizes_covered(truth: Any, answer: Any) -> tuple[bool, ...]:
    """Return whether intervals of rightly named effects hold the true sizes."""
    if answer.verdict != "named":
        return ()
    covered = []
    for effect in truth.effects:
        stated = answer.sizes.get(effect.id)
        if effect.id in _SIZES and stated:
            name, change = _SIZES[effect.id]
            value = change(effect.sizes[name])
            _, low, high = next(iter(stated.values()))
            covered.append(bool(low <= value <= high))
    return tuple(covered)


@dataclass(frozen=True)
class Line:
    """One line of the table: hits among trials, and what was asked for."""

    name: str
    hits: int
    trials: int
    target: str = ""
    note: str = ""

    @property
    def interval(self) -> tuple[float, float]:
        """Exact 95 % interval of the share."""
        if not self.trials:
            return 0.0, 1.0
        low, high = stats.binomtest(self.hits, self.trials).proportion_ci(LEVEL)
        return float(low), float(high)

    def __str__(self) -> str:
        if not self.trials:
            return f"{self.name:<62} no case{'':<33} {self.target}"
        low, high = self.interval
        share = 100.0 * self.hits / self.trials
        text = f"{self.hits:4d} of {self.trials:4d} = {share:5.1f} % ({100 * low:5.1f} to {100 * high:5.1f} %)"
        return f"{self.name:<62} {text}  {self.target}{'  ' + self.note if self.note else ''}"


def _line(name: str, cases: Sequence[Outcome], hit: Callable[[Outcome], bool], target: str = "") -> Line:
    return Line(name, sum(map(hit, cases)), len(cases), target)


def table(outcomes: Iterable[Outcome]) -> tuple[list[Line], list[str]]:
    """Return the lines of the table, and what cannot be a share as text."""
    cases = list(outcomes)

    def of(*kinds: str) -> list[Outcome]:
        return [one for one in cases if one.kind in kinds]

    lines = [
        _line(f"nothing hidden, {name} holders: called anything", group, lambda o: o.verdict != "adequate", "<= 5 %")
        for name, group in (("exact", of("nothing_exact")), ("toleranced", of("nothing")))
    ]
    hidden = of("single", "misleading", "one_configuration")
    spread = [o for o in hidden if o.effects == ("joint_spread",)]
    plain = [o for o in hidden if o.effects != ("joint_spread",)]
    large, small = [o for o in plain if o.large], [o for o in plain if not o.large]
    lines += [
        _line("one effect, large enough: in the reported set", large, lambda o: o.in_set, ">= 95 %"),
        _line("one effect, large enough: rightly and uniquely named", large, lambda o: o.named_right, ">= 85 %"),
        _line("one effect, large enough: named wrong", large, lambda o: o.named_wrong, "<= 2 %"),
        _line("one effect, large enough: unexplained", large, lambda o: o.verdict == "unexplained"),
        _line("one effect, large enough: called adequate", large, lambda o: o.verdict == "adequate"),
        _line("one effect, smaller: named wrong", small, lambda o: o.named_wrong),
        _line("one effect, smaller: adequate or rightly found", small, lambda o: o.verdict == "adequate" or o.in_set),
    ]
    for kind, title in (("one_configuration", "in one configuration only"), ("misleading", "with misleading remarks")):
        own = [o for o in of(kind) if o.large]
        lines.append(_line(f"{title}, large enough: rightly named", own, lambda o: o.named_right))
    open_ = [o for o in cases if o.resolved is not None and o.large]
    lines.append(
        _line("ambiguous, large enough: the advised measurement resolves", open_, lambda o: bool(o.resolved), ">= 70 %")
    )
    asked_twice = [o for o in cases if o.shuffled]
    lines.append(_line("other names, order, no remarks: another verdict", asked_twice, _moved, "none"))
    layered = [o for o in cases if o.layer]
    lines.append(_line("joint described as a layer: named wrong", layered, lambda o: o.named_wrong))
    lines.append(
        _line("spread joint, large: right or unexplained", [o for o in spread if o.large], _right_or_open, "all")
    )
    foreign = of("outside")
    clear = [o for o in foreign if o.misfit >= CERTAIN * o.oracle.get("misfit_true", 1.0)]
    marginal = [o for o in foreign if o not in clear]
    lines += [
        _line("outside the catalogue, clear misfit: named", clear, lambda o: o.verdict == "named", "<= 5 %"),
        _line("   the same, where no other cause looks the same", clear, _named_and_not_same),
        _line("outside the catalogue, marginal: suspected", marginal, lambda o: o.verdict == "suspected", "<= 20 %"),
        _line("outside the catalogue, marginal: named", marginal, lambda o: o.verdict == "named"),
    ]
    pairs = [o for o in of("pair") if o.large]
    lines += [
        _line("two effects, both large enough: both reported", pairs, lambda o: o.in_set, ">= 80 %"),
        _line("two effects, both large enough: named wrong", pairs, lambda o: o.named_wrong, "<= 5 %"),
        _line("diagnoses that failed", cases, lambda o: o.verdict == "failed", "none"),
    ]
    covered = [hit for o in cases if o.verdict in ("adequate", "named") for hit in o.covered]
    sizes = [hit for o in cases if o.named_right for hit in o.size_covered]
    lines.append(Line("95 % intervals of new tools' natural frequencies cover", sum(covered), len(covered), "95 %"))
    lines.append(Line("95 % intervals of rightly named sizes cover", sum(sizes), len(sizes), "reported"))
    return lines, _rest(cases, large, plain)


def _right_or_open(o: Outcome) -> bool:
    return o.verdict in ("unexplained", "adequate") or (bool(o.reported) and len(o.found) == len(o.reported))


def _moved(o: Outcome) -> bool:
    return o.shuffled != (o.verdict, *sorted(o.reported))


def _named_and_not_same(o: Outcome) -> bool:
    return o.verdict == "named" and not o.same


def _rest(cases: list[Outcome], large: list[Outcome], plain: list[Outcome]) -> list[str]:
    texts = []
    sets = [len(o.reported) for o in large if o.reported]
    if sets:
        texts.append(f"mean size of the reported sets {np.mean(sets):.2f} ({len(sets)} sets)")
    shares = [o.share for o in large if o.share is not None]
    if shares:
        low, high = _median_interval(shares)
        texts.append(
            f"improvement on new tools, share of the oracle's: median {100 * np.median(shares):.0f} % "
            f"({100 * low:.0f} to {100 * high:.0f} %), {len(shares)} cases (asked: at least 80 %)"
        )
    covered = [hit for o in cases if o.verdict in ("adequate", "named") for hit in o.covered]
    if covered:
        p = stats.binomtest(sum(covered), len(covered), 0.95).pvalue
        texts.append(f"coverage of new tools: exact binomial test against 95 %, p = {p:.3f} (asked: above 0.01)")
    texts.append("power: share rightly and uniquely named against the oracle's gain in chi-square")
    edges = [0.0, 10.0, 30.0, 100.0, 300.0, 1e3, 1e4, np.inf]
    for low, high in itertools.pairwise(edges):
        own = [o for o in plain if low <= max(o.oracle.get("gain", np.inf), 0.0) < high]
        if own:
            line = _line(f"   gain {low:g} to {high:g}", own, lambda o: o.named_right)
            adequate = sum(o.verdict == "adequate" for o in own)
            texts.append(f"{line} adequate {adequate}")
    seconds = [o.seconds for o in cases]
    texts.append(
        f"time of a diagnosis: median {np.median(seconds):.1f} s, 95 % below {np.quantile(seconds, 0.95):.1f} s, "
        f"largest {max(seconds):.1f} s"
    )
    return texts


def _median_interval(values: Sequence[float]) -> tuple[float, float]:
    """Return a 95 % interval of the median from order statistics."""
    ordered = np.sort(values)
    low = int(stats.binom.ppf(0.025, ordered.size, 0.5))
    return float(ordered[max(low - 1, 0)]), float(ordered[min(ordered.size - low, ordered.size - 1)])


def by_effect(outcomes: Sequence[Outcome]) -> list[str]:
    """Return one line for each effect: how often it was large, in the set, named, and what else was named."""
    texts = []
    single = [o for o in outcomes if len(o.effects) == 1]
    for id in dict.fromkeys(
        o.effects[0] for o in sorted(single, key=lambda o: (o.effects[0] in OUTSIDE, o.effects[0]))
    ):
        own = [o for o in single if o.effects[0] == id]
        big = [o for o in own if o.large]
        wrong = sorted({other for o in own if o.named_wrong for other in o.reported if other not in o.found})
        verdicts = {v: sum(o.verdict == v for o in big) for v in dict.fromkeys(o.verdict for o in big)}
        said = ", ".join(f"{n} {v}" for v, n in verdicts.items())
        texts.append(
            f"   {id:<24} {len(own):3d} cases, {len(big):3d} large: {sum(o.in_set for o in big):3d} in set, "
            f"{sum(o.named_right for o in big):3d} named; {said}{'; wrong: ' + ', '.join(wrong) if wrong else ''}"
        )
    return texts


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the whole table as text."""
    lines, rest = table(outcomes)
    return "\n".join([*map(str, lines), *rest, "by effect:", *by_effect(outcomes)])
