"""Ablation of the diagnosis: `python benches/ablation.py [--cases N] [--seed S] [--rules TEXT ...] [--json FILE]`.

Each rule and each group of thresholds is switched off in turn, and the diagnoses of the blind laboratory are compared
with those of the program as it is: the same cases (`--cases` first ones of its list, which has all effects, pairs,
effects outside the catalogue and none), in one process and on one thread. A rule that changes nothing beyond noise
costs a reader more than it gives. The columns: answers that changed; right ones lost and won, where an answer is right
if it reports what is hidden, and nothing else as certain; certain wrong ones (named or partly explained by causes that
are not hidden) before and after; the ratio of the processor time, without the rule to with it.
"""

from __future__ import annotations

import os

if __name__ == "__main__":
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import contextlib
import json
import math
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from blind.bridge import Answer, ask
from blind.generator import CATALOGUE, Case, draw_case, every
from receptance.diagnosis import engine, judgement, search
from receptance.diagnosis.causes import Parameter
from receptance.diagnosis.explanation import Explanation

CERTAIN = ("named", "partly explained")


@dataclass(frozen=True)
class Rule:
    """What is switched off: thresholds replaced by neutral values, or attributes of classes and modules."""

    name: str
    thresholds: Mapping[str, float] = field(default_factory=dict)
    attributes: tuple[tuple[Any, str, Any], ...] = ()


RULES = (
    Rule("look-alikes and other variants from the joint of the best", {"LOOK_ALIKE": 2.0}),
    Rule("restart where nothing is adequate", {}, ((search.Search, "_restart", lambda _: False),)),
    Rule("fits without convergence are continued", {}, ((search.Search, "_finish_best", lambda _: None),)),
    Rule("six further causes", {"ADDED_CAUSES": 10**6}),
    Rule("no prediction above a misfit of 20", {"SCREENING_LIMIT": math.inf}),
    Rule("predictions leave out single causes", {"PREDICTED_SHARE": -math.inf}),
    Rule("three variants of each cause", {"VARIANTS_FITTED": 10**6}),
    Rule("one variant of each cause (for 3)", {"VARIANTS_FITTED": 1}),
    Rule("four leading explanations (1)", {"LEADING_CAUSES": 1}),
    Rule("fits far behind the best are not finished", {"BEHIND": 1e9}),
    Rule("the distance behind grows with the gain", {"BEHIND_SHARE": 0.0}),
    Rule("a third of a race goes on", {"CONTINUED_SHARE": 1.0}),
    Rule("12 rivals go on (for 12: 1)", {"LEAST_CONTINUED": 1}),
    Rule("large sizes as starts", {"LARGE_SIZE": 1.0}),
    Rule("blocks of compressed data (120: 60)", {"BLOCKS": 60}),
    Rule("levels from their own starts", {"WORSE_LEVEL": math.inf}),
    Rule("the margin of 10 (5)", {"MARGIN": 5.0}),
    Rule("an alternative within 5 raises a doubt (0)", {"MARGIN_OF_ALTERNATIVE": 0.0}),
    Rule("half of the misfit", {"LEAST_SHARE": 0.0}),
    Rule("a discrepancy only above a misfit of 4", {"BEYOND_NOISE": 0.0}),
    Rule("three selections with a discrepancy (1)", {"DISCREPANCY_SELECTIONS": 1}),
    Rule("eight causes with discrepancies of their own (1)", {"DISCREPANCY_CAUSES": 1}),
    Rule("doubt: one configuration alone", {"ONE_CONFIGURATION": math.inf}),
    Rule("doubt: strained tolerances", {"STRAIN_CHANCE": 0.0}),
    Rule("doubt: few degrees of freedom", {"LEAST_FREEDOM": 0}),
    Rule("all doubts", {}, ((judgement, "_doubts", lambda *_: iter(())),)),
    Rule("partly explained: confirmed", {}, ((engine, "confirmed", lambda answer, _: answer),)),
    Rule("negligible sizes", {}, ((Explanation, "negligible", frozenset()),)),
    Rule("ordinary sizes of pairs", {}, ((Explanation, "extraordinary", ()),)),
    Rule("plausible sizes", {}, ((Parameter, "is_plausible", lambda *_: True),)),
)


@contextlib.contextmanager
def without(rule: Rule) -> Iterator[None]:
    """Switch a rule off."""
    modules = [module for name, module in sys.modules.items() if name.startswith("receptance.diagnosis")]
    places = [
        (module, name, value) for name, value in rule.thresholds.items() for module in modules if name in vars(module)
    ]
    places += rule.attributes
    if not places:
        raise SystemExit(f"{rule.name}: no module has {', '.join(rule.thresholds)}")
    before = [(place, name, vars(place)[name]) for place, name, _ in places]
    try:
        for place, name, value in places:
            setattr(place, name, value)
        yield
    finally:
        for place, name, value in before:
            setattr(place, name, value)


@dataclass(frozen=True)
class Diagnosis:
    """The answer of one case."""

    answer: tuple[str, tuple[str, ...]]
    is_right: bool
    is_wrong: bool


def diagnose(cases: list[tuple[Case, tuple[str, ...]]]) -> tuple[list[Diagnosis], float]:
    """Return the answers of cases, and the processor time in s."""
    begun = time.process_time()
    answers: list[tuple[Answer, tuple[str, ...]]] = [(ask(case), effects) for case, effects in cases]
    seconds = time.process_time() - begun
    return [_judged(answer, effects) for answer, effects in answers], seconds


def _judged(answer: Answer, effects: tuple[str, ...]) -> Diagnosis:
    reported = tuple(sorted(answer.reported))
    is_wrong = answer.verdict in CERTAIN and not set(effects) >= set(reported)
    known = set(effects) <= set(CATALOGUE)
    is_right = not is_wrong and (set(effects) <= set(reported) if effects else answer.verdict == "adequate")
    # An effect that the catalogue does not contain has no name.
    is_right = is_right if known else not reported
    return Diagnosis((answer.verdict, reported), is_right, is_wrong)


def main() -> int:
    """Run, and print a row for each rule as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=20261123)
    parser.add_argument("--rules", nargs="+", metavar="TEXT", help="rules whose name has one of these texts")
    parser.add_argument("--json", type=Path, help="rows and answers")
    options = parser.parse_args()
    rules = [rule for rule in RULES if not options.rules or any(text in rule.name for text in options.rules)]
    cases = []
    for number, (kind, effects) in enumerate(every(options.cases)):
        case, truth = draw_case(options.seed, number, kind, tuple(effects))
        cases.append((case, tuple(effect.id for effect in truth.effects)))
    with_all, seconds = diagnose(cases)
    right, wrong = sum(each.is_right for each in with_all), sum(each.is_wrong for each in with_all)
    print(f"{len(cases)} cases, seed {options.seed}: {right} right, {wrong} certain and wrong, {seconds:.0f} s")
    print(f"{'switched off':<58} {'changed':>7} {'lost':>4} {'won':>4} {'wrong':>9} {'time':>5}", flush=True)
    rows = []
    for rule in rules:
        with without(rule):
            answers, others = diagnose(cases)
        pairs = list(zip(with_all, answers, strict=True))
        row = {
            "rule": rule.name,
            "changed": sum(a.answer != b.answer for a, b in pairs),
            "lost": sum(a.is_right and not b.is_right for a, b in pairs),
            "won": sum(b.is_right and not a.is_right for a, b in pairs),
            "wrong": (wrong, sum(each.is_wrong for each in answers)),
            "time": others / seconds,
            "answers": [
                {"case": i, "effects": cases[i][1], "before": a.answer, "after": b.answer}
                for i, (a, b) in enumerate(pairs)
                if a.answer != b.answer
            ],
        }
        rows.append(row)
        print(
            f"{rule.name:<58} {row['changed']:>7} {row['lost']:>4} {row['won']:>4} "
            f"{wrong:>3} to {sum(each.is_wrong for each in answers):>2} {others / seconds:>5.2f}",
            flush=True,
        )
        if options.json:
            options.json.write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
