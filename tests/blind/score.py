"""The score table: every share with its exact binomial interval."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from blind.generator import OUTSIDE
from blind.outcome import Outcome

LEVEL = 0.95
CERTAIN = 1.5
"""Base misfit, as a multiple of what noise explains, from which something foreign must not be named."""

STRANGE = ("ground_spring", "sensor_mounting", "second_joint")
"""Effects outside the catalogue that are none of the changes without a name that the package tries."""


@dataclass(frozen=True)
class Line:
    """One line of the table: hits among trials, and the required share."""

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
    """Return the lines of the table, and results other than shares as text; each level of knowledge has its own."""
    every = list(outcomes)
    parts = [
        _table([o for o in every if o.knowledge == level]) if not level else of_level(level, every)
        for level in dict.fromkeys(o.knowledge for o in every)
    ]
    return [line for lines, _ in parts for line in lines], [text for _, texts in parts for text in texts]


def of_level(level: str, outcomes: Sequence[Outcome]) -> tuple[list[Line], list[str]]:
    """Return the lines and texts of the cases of one level of knowledge of the holder.

    Where the holder is data, an effect that the data contain is not hidden, and one that has no place in such a model
    (`Outcome.elsewhere`) must not be taken for another: to name a mode of the holder as changed is right where it is
    stated by its modes.
    """
    cases = [o for o in outcomes if o.knowledge == level]
    nothing = [o for o in cases if not o.effects]
    plain = [o for o in nothing if not o.within]
    contained = [o for o in nothing if o.within]
    foreign = [o for o in cases if o.effects and (o.kind == "outside" or o.elsewhere)]
    known = [o for o in cases if o.effects and o not in foreign]
    single = [o for o in known if len(o.effects) == 1]
    large, small = [o for o in single if o.large], [o for o in single if not o.large]
    pairs = [o for o in known if len(o.effects) > 1]
    elsewhere = [o for o in foreign if o.elsewhere]
    lines = [
        _line("nothing hidden: called anything", plain, lambda o: o.verdict != "adequate", "<= 5 %"),
        _line("   an error of the holder, which the data contain: the same", contained, _called, "<= 5 %"),
        _line("one effect, large enough: in the reported set", large, lambda o: o.in_set),
        _line("one effect, large enough: rightly and uniquely named", large, lambda o: o.one_answer),
        _line("   the same, under one name", large, lambda o: o.named_right),
        _line("one effect, large enough: named wrong", large, lambda o: o.named_wrong, "<= 2 %"),
        _line("one effect, large enough: unexplained", large, lambda o: o.verdict == "unexplained"),
        _line("one effect, large enough: called adequate", large, lambda o: o.verdict == "adequate"),
        _line("one effect, smaller: named wrong", small, lambda o: o.named_wrong, "<= 2 %"),
        _line("one effect, smaller: adequate or rightly found", small, lambda o: o.verdict == "adequate" or o.in_set),
        _line("two effects: named wrong", pairs, lambda o: o.named_wrong, "<= 5 %"),
        _line("two effects, both large enough: both reported", [o for o in pairs if o.large], lambda o: o.in_set),
        _line("the holder changed, or a joint along its bore: named", elsewhere, _named_amiss, "<= 5 %"),
        _line("outside the catalogue: named", [o for o in foreign if not o.elsewhere], _named_and_not_same, "<= 5 %"),
        _line("all cases: named wrong", cases, _wrong, "<= 2 %"),
        _line("diagnoses that failed", cases, lambda o: o.verdict == "failed", "none"),
    ]
    if level == "drawing":
        lines = [line for line in lines if line.trials or "holder" not in line.name]
        lines.append(_hits("new tools' natural frequencies in 95 % intervals", trusted(cases), "95 %"))
    seconds = [o.seconds for o in cases]
    text = f"{level}: time of a diagnosis: median {np.median(seconds):.1f} s, largest {max(seconds):.1f} s"
    return [replace(line, name=f"{level}: {line.name}") for line in lines], [text]


def _called(o: Outcome) -> bool:
    return o.verdict != "adequate"


def _named_amiss(o: Outcome) -> bool:
    right = ("spindle_mode",) if o.knowledge == "modes" else ()
    return o.verdict == "named" and not set(o.reported) <= {*right, *o.effects, *o.same}


def _wrong(o: Outcome) -> bool:
    """Return whether a cause is named that is not there, nor looks the same as what is."""
    if o.elsewhere:
        return _named_amiss(o)
    return o.named_wrong


def _table(cases: Sequence[Outcome]) -> tuple[list[Line], list[str]]:
    """Return the table of cases whose holder has ordinary tolerances."""

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
        _line("one effect, large enough: rightly and uniquely named", large, lambda o: o.one_answer, ">= 85 %"),
        _line("   the same, under one name: nothing that looks the same beside", large, lambda o: o.named_right),
        _line("one effect, large enough: named wrong", large, lambda o: o.named_wrong, "<= 2 %"),
        _line("one effect, large enough: unexplained", large, lambda o: o.verdict == "unexplained"),
        _line("one effect, large enough: called adequate", large, lambda o: o.verdict == "adequate"),
        _line("one effect, smaller: named wrong", small, lambda o: o.named_wrong),
        _line("one effect, smaller: adequate or rightly found", small, lambda o: o.verdict == "adequate" or o.in_set),
    ]
    for kind, title in (("one_configuration", "in one configuration only"), ("misleading", "with misleading remarks")):
        own = [o for o in of(kind) if o.large]
        lines.append(_line(f"{title}, large enough: rightly named", own, lambda o: o.named_right))
    open_ = [o for o in cases if o.resolved is not None and o.large and o.kind != "outside"]
    lines.append(_line("ambiguous, large enough: the advised measurement resolves", open_, _resolved, ">= 70 %"))
    asked_twice = [o for o in cases if o.shuffled]
    lines.append(_line("other names, order, no remarks: another verdict", asked_twice, _moved, "none"))
    layered = [o for o in cases if o.layer]
    lines.append(_line("joint described as a layer: named wrong", layered, lambda o: o.named_wrong))
    lines.append(
        _line("spread joint, large: right or unexplained", [o for o in spread if o.large], _right_or_open, "all")
    )
    lines.append(_line("spread joint: named something else", spread, lambda o: o.named_wrong, "none"))
    foreign = of("outside")
    clear = [o for o in foreign if o.oracle.get("misfit", np.inf) >= CERTAIN * o.oracle.get("misfit_true", 1.0)]
    marginal = [o for o in foreign if o not in clear]
    lines += [
        _line("outside the catalogue, clear misfit: named", clear, _named, "<= 5 %"),
        _line("   the same, where no other cause looks the same", clear, _named_and_not_same),
        _line(
            "   the same, of kinds that the package does not describe", _strange(clear), lambda o: o.verdict == "named"
        ),
        _line("outside the catalogue, marginal: suspected", marginal, lambda o: o.verdict == "suspected", "<= 20 %"),
        _line("outside the catalogue, marginal: named", marginal, _named),
    ]
    pairs = [o for o in of("pair") if o.large]
    lines += [
        _line("two effects, both large enough: both reported", pairs, lambda o: o.in_set, ">= 80 %"),
        _line("two effects, both large enough: named wrong", pairs, lambda o: o.named_wrong, "<= 5 %"),
        _line("partly explained by a cause: it is hidden", of_partly(cases), lambda o: o.in_set),
        _line("diagnoses that failed", cases, lambda o: o.verdict == "failed", "none"),
    ]
    lines += [
        _hits("new tools' natural frequencies in 95 % intervals", trusted(cases), "95 %"),
        *(_hits(f"   {name}", group, "") for name, group in _by_truth(cases).items()),
        _hits("   one frequency of each case, at random", trusted(cases), "95 %", one_each=True),
    ]
    sizes = [hit for o in cases if o.named_right for hit in o.size_covered]
    lines.append(Line("95 % intervals of rightly named sizes cover", sum(sizes), len(sizes), "reported"))
    return lines, _rest(cases, large, plain)


def of_advice(cases: Sequence[Outcome]) -> tuple[list[Line], list[str]]:
    """Return the table of the advice alone; the oracle was asked of ambiguous cases only."""
    ambiguous = [o for o in cases if o.resolved is not None]
    right = [o for o in ambiguous if o.in_set]
    large = [o for o in ambiguous if o.large]
    lines = [
        _line("ambiguous, of all cases", cases, lambda o: o.verdict == "ambiguous"),
        _line("ambiguous, large enough: the advised measurement resolves", large, _resolved, ">= 80 %"),
        _line("ambiguous, of any size: the advised measurement resolves", ambiguous, _resolved),
        _line("   the same, where the hidden effect is in the set", right, _resolved),
        _line("ambiguous: the hidden effect is in the set", ambiguous, lambda o: o.in_set),
    ]
    actions = dict.fromkeys(o.next_measurement for o in ambiguous)
    texts = [str(_line(f"   {action or 'nothing'}", [o for o in ambiguous if o.next_measurement == action], _resolved))
             for action in actions]  # fmt: skip
    return lines, ["advised, and resolved:", *texts]


def _resolved(o: Outcome) -> bool:
    return bool(o.resolved)


def report_of_advice(outcomes: Sequence[Outcome]) -> str:
    """Return the table of the advice alone as text."""
    lines, rest = of_advice(outcomes)
    return "\n".join([*map(str, lines), *rest])


def of_partly(cases: Iterable[Outcome]) -> list[Outcome]:
    """Return the cases whose verdict is that a cause explains the data partly."""
    return [o for o in cases if o.verdict == "partly explained"]


def trusted(cases: Iterable[Outcome]) -> list[Outcome]:
    """Return the cases with valid predictions: those whose model is explained."""
    return [o for o in cases if o.verdict in ("adequate", "named") and o.covered]


def _by_truth(cases: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    own = trusted(cases)
    return {
        "nothing hidden": [o for o in own if not o.effects and o.verdict == "adequate"],
        "rightly named": [o for o in own if o.named_right],
        "something hidden, called adequate": [o for o in own if o.effects and o.verdict == "adequate"],
        "named something that is not there": [o for o in own if o.named_wrong],
    }


def _hits(name: str, cases: Sequence[Outcome], target: str, *, one_each: bool = False) -> Line:
    """Return how many intervals cover; frequencies of one case are not independent, one of each case is."""
    if one_each:
        found = [o.covered[np.random.default_rng([o.seed, o.index]).integers(len(o.covered))] for o in cases]
    else:
        found = [hit for o in cases for hit in o.covered]
    return Line(name, sum(found), len(found), target)


def _right_or_open(o: Outcome) -> bool:
    return o.verdict == "unexplained" or (bool(o.reported) and len(o.found) == len(o.reported))


def _moved(o: Outcome) -> bool:
    return o.shuffled != (o.verdict, *sorted(o.reported))


def _named(o: Outcome) -> bool:
    return o.verdict == "named"


def _strange(cases: Sequence[Outcome]) -> list[Outcome]:
    return [o for o in cases if o.effects[0] in STRANGE]


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
    own = _hits("", trusted(cases), "", one_each=True)
    if own.trials:
        p = stats.binomtest(own.hits, own.trials, 0.95).pvalue
        texts.append(
            f"coverage of new tools, one frequency of each case: exact binomial test against 95 %, p = {p:.3f} "
            "(asked: above 0.01)"
        )
    texts.append("power: share rightly named, under one name, against the oracle's gain in chi-square")
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
        counts = ", ".join(f"{n} {v}" for v, n in verdicts.items())
        texts.append(
            f"   {id:<24} {len(own):3d} cases, {len(big):3d} large: {sum(o.in_set for o in big):3d} in set, "
            f"{sum(o.named_right for o in big):3d} named; {counts}{'; wrong: ' + ', '.join(wrong) if wrong else ''}"
        )
    return texts


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the whole table as text."""
    lines, rest = table(outcomes)
    shown = [one for one in outcomes if not one.elsewhere]
    return "\n".join([*map(str, lines), *rest, "by effect:", *by_effect(shown)])
