"""Diagnosis of machines with one hidden effect, none, or a foreign one.

An effect counts as large if an oracle that knows the spindle gains chi-square by it. The second gain is that with an
unknown spindle: what its modes absorb is the difference.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from blind.files import append, read
from blind.outcome import Outcome
from machine_laboratory.batch import Row, indices, run, seed_of, share
from machine_laboratory.generator import EFFECTS, FOREIGN, Machine, draw_machine, write
from machine_laboratory.oracle import GAIN, consult

KNOWN = tuple(id for id in EFFECTS if id not in FOREIGN)
LEVEL = "machine"
"""Level of knowledge in the outcomes: a spindle whose modes are unknown."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--effects", choices=EFFECTS, nargs="+", metavar="ID", help="one of these in every machine")


def main(options: argparse.Namespace) -> int:
    """Run all machines and print a line for each, then the table."""
    seed = seed_of(options)
    chosen = indices(options)
    plan = hidden(options.cases, options.effects or ())
    outcomes = {
        one.index: one
        for one in (read([options.resume]) if options.resume else [])
        if one.seed == seed and one.index in chosen and one.effects == plan[one.index]
    }
    sys.stdout.write("".join(f"{_line(one)}\n" for one in outcomes.values()))
    left = [
        {"seed": seed, "index": i, "effects": plan[i], "modes": options.modes, "threads": options.threads}
        for i in chosen
        if i not in outcomes
    ]
    for case, result in run(diagnose, left, jobs=options.jobs, limit=options.limit):
        one = _failed(case, result) if "failure" in result else result["outcome"]
        outcomes[one.index] = one
        if options.resume:
            append(options.resume, one)
        sys.stdout.write(f"{_line(one)}\n")
        sys.stdout.flush()
    sys.stdout.write("\n".join(table([outcomes[i] for i in sorted(outcomes)])) + "\n")
    return 0


def hidden(cases: int, effects: Sequence[str] = ()) -> list[tuple[str, ...]]:
    """Return the hidden effects of a batch: none in a third of the cases, the others in turn.

    Any beginning has nearly the same shares.
    """
    if effects:
        return [(effects[i % len(effects)],) for i in range(cases)]
    # The step has no divisor with the number of effects, so that neighbours differ in kind.
    taken = [(EFFECTS[(5 * i) % len(EFFECTS)],) for i in range(cases)]
    return [() if i % 3 == 2 else taken[i - (i + 1) // 3] for i in range(cases)]


def machine_of(seed: int, index: int, effects: Sequence[str]) -> Machine:
    """Return a machine of a batch."""
    own = int(np.random.SeedSequence([seed, index, 6]).generate_state(1)[0])
    return draw_machine(own, effects[0] if effects else None)


def diagnose(seed: int, index: int, effects: Sequence[str], modes: int | str, threads: int) -> Row:
    """Diagnose a machine and compare the verdict with the truth."""
    from blind.bridge import answer_from
    from receptance import campaign

    machine = machine_of(seed, index, effects)
    with tempfile.TemporaryDirectory() as folder:
        loaded = campaign.load(write(machine, Path(folder), modes=modes), threads=threads)
        begun = time.process_time()
        verdict = loaded.diagnose()
        answer = answer_from(verdict, time.process_time() - begun)
    wrong = [id for id in answer.reported if id not in effects]
    oracle, same = consult(machine, wrong)
    outcome = Outcome(
        seed=seed,
        index=index,
        kind=_kind(effects),
        effects=tuple(effects),
        sizes=() if machine.effect is None else (machine.effect.u,),
        large=oracle.gain > GAIN,
        oracle=dataclasses.asdict(oracle),
        verdict=answer.verdict,
        reported=answer.reported,
        together=answer.together,
        same=same,
        seconds=answer.seconds,
        misfit=answer.misfit,
        misfit_after=answer.misfit_after,
        share=None,
        covered=(),
        size_covered=(),
        candidates=list(answer.candidates),
        notes=answer.notes,
        next_measurement=answer.next_measurement,
        knowledge=LEVEL,
    )
    return {"outcome": outcome}


def _kind(effects: Sequence[str]) -> str:
    return "nothing" if not effects else "outside" if effects[0] in FOREIGN else "single"


def _failed(case: Row, result: Row) -> Outcome:
    """Return the outcome of a diagnosis that raised or exceeded its limit."""
    nan = float("nan")
    return Outcome(
        seed=case["seed"],
        index=case["index"],
        kind=_kind(case["effects"]),
        effects=tuple(case["effects"]),
        sizes=(),
        large=True,
        oracle={},
        verdict="failed",
        reported=(),
        together=(),
        same=(),
        seconds=result.get("processor", nan),
        misfit=nan,
        misfit_after=nan,
        share=None,
        covered=(),
        size_covered=(),
        error=result["failure"],
        knowledge=LEVEL,
    )


# The table ------------------------------------------------------------------------------------------------------------


def _line(one: Outcome) -> str:
    """Return a line of the table of cases."""
    if one.verdict == "failed":
        return f"{one.index:4d}  {', '.join(one.effects) or 'nothing':<19} {one.error[:54]}"
    text = f"{one.verdict} {', '.join(one.reported)}"
    return (
        f"{one.index:4d}  {', '.join(one.effects) or 'nothing':<19} {'large' if one.large else 'small':<5} "
        f"{one.misfit:6.2f} {one.seconds:4.0f} s  {text[:34]}"
    )


def table(outcomes: Sequence[Outcome]) -> list[str]:
    """Return the lines of the score."""
    nothing = [one for one in outcomes if one.kind == "nothing"]
    single = [one for one in outcomes if one.kind == "single"]
    foreign = [one for one in outcomes if one.kind == "outside"]
    large = [one for one in single if one.large]
    seen = [one for one in large if one.oracle.get("gain_unknown", 0.0) > GAIN]

    def line(name: str, cases: Sequence[Outcome], hits: Sequence[bool], target: str = "") -> str:
        return share(name, [hit for hit in hits if hit], cases, target)

    lines = [
        line("large: in the reported set", large, [one.in_set for one in large], ">= 85 %"),
        line("   seen with an unknown spindle", seen, [one.in_set for one in seen]),
        line("large: rightly and uniquely named", large, [one.named_right for one in large]),
        line("large: called adequate", large, [one.verdict == "adequate" for one in large]),
        line("all: named wrong", outcomes, [_named_wrong(one) for one in outcomes], "<= 2 %"),
        line("nothing hidden: called anything", nothing, [one.verdict != "adequate" for one in nothing], "<= 5 %"),
        line("foreign: named", foreign, [one.verdict == "named" for one in foreign], "<= 5 %"),
        line("diagnoses that failed", outcomes, [one.verdict == "failed" for one in outcomes], "none"),
    ]
    seconds = [one.seconds for one in outcomes if np.isfinite(one.seconds)]
    if seconds:
        lines.append(f"processor time of a diagnosis: median {np.median(seconds):.0f} s, largest {max(seconds):.0f} s")
    lines.append("effect              cases large  in set named  verdicts of all")
    for id in EFFECTS:
        own = [one for one in outcomes if one.effects == (id,)]
        big = [one for one in own if one.large]
        verdicts = [one.verdict for one in own]
        counts = ", ".join(f"{verdicts.count(v)} {v}" for v in dict.fromkeys(verdicts))
        found, named = sum(one.in_set for one in big), sum(one.named_right for one in big)
        if own:
            lines.append(f"{id:<19} {len(own):5d} {len(big):5d} {found:7d} {named:5d}  {counts}")
    return lines


def _named_wrong(one: Outcome) -> bool:
    """Return whether a cause is named that is not there, nor looks the same as what is."""
    return one.verdict == "named" and len(one.found) < len(one.reported)
