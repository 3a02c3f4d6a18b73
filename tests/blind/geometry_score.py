"""The score of conical holders and fluted tools, described crudely or as they are. Fixed before any batch was run.

A reported cause is right if it is hidden, or looks the same by the oracle; where the description is crude also if it
names the description (`DESCRIBES`), because its remedy leads to the section that is described wrongly. Every case is
one of these:

wrong
    The verdict is "named" or "partly explained", and a cause is reported that is not right. Of two causes together both
    have to be right.
effect
    Such a verdict, and all that is reported is right and holds every hidden effect or what looks the same.
description
    Such a verdict, and all that is reported is right and names the description, but a hidden effect is left out, or
    nothing is hidden.
part
    Such a verdict, and all that is reported is right, but one effect of two is left out.
misleading, open
    The verdict is "suspected" or "ambiguous", and nothing that is reported is right, or something is.
adequate, unexplained, undecided, failed
    The verdict; "unexplained" and "undecided" (the data cannot decide it) are no wrong names.

The oracle knows cones and flutes as they are: whether an effect is large, and whether a cause looks the same, does not
depend on the description. Cases of both descriptions have the same records.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from blind.generator import GEOMETRIES
from blind.outcome import Outcome
from blind.score import Line, _hits, _line, trusted

DESCRIBES = ("fluted_part", "tip_diameter")
"""Causes whose remedy leads to a section that is described wrongly: flutes, or another diameter towards the tip."""
NAMING = ("named", "partly explained")
OPEN = ("suspected", "ambiguous")
ANSWERS = (
    "wrong",
    "effect",
    "description",
    "part",
    "misleading",
    "open",
    "adequate",
    "unexplained",
    "undecided",
    "failed",
)


def answer_of(o: Outcome) -> str:
    """Return which of `ANSWERS` an outcome is."""
    described = DESCRIBES if o.knowledge == "crude" else ()
    right = [id for id in o.reported if id in (*o.effects, *o.same, *described)]
    if o.verdict in NAMING:
        if len(right) < len(o.reported):
            return "wrong"
        if o.in_set:
            return "effect"
        return "description" if any(id in described for id in o.reported) else "part"
    if o.verdict in OPEN:
        return "open" if right else "misleading"
    return o.verdict


def is_wrong(o: Outcome) -> bool:
    """Return whether a cause is named, alone or for a part of the misfit, that is not right."""
    return answer_of(o) == "wrong"


def table(outcomes: Iterable[Outcome]) -> tuple[list[Line], list[str]]:
    """Return the lines of the table, those of each description together, and results other than shares as text."""
    every = [o for o in outcomes if o.knowledge in GEOMETRIES]
    lines: list[Line] = []
    texts: list[str] = []
    for level in GEOMETRIES:
        cases = [o for o in every if o.knowledge == level]
        if cases:
            lines += _lines(level, cases)
            seconds = [o.seconds for o in cases]
            texts.append(
                f"{level}: misfit before any cause, median {np.median([o.misfit for o in cases]):.2f}; time of a "
                f"diagnosis: median {np.median(seconds):.1f} s, largest {max(seconds):.1f} s"
            )
    return lines, texts


def _lines(level: str, cases: Sequence[Outcome]) -> list[Line]:
    nothing = [o for o in cases if not o.effects]
    foreign = [o for o in cases if o.kind == "outside"]
    single = [o for o in cases if len(o.effects) == 1 and o not in foreign]
    large, small = [o for o in single if o.large], [o for o in single if not o.large]
    pairs = [o for o in cases if len(o.effects) > 1]
    groups = (
        ("nothing hidden", nothing, "<= 5 %"),
        ("one effect, large enough", large, "<= 2 %"),
        ("one effect, smaller", small, "<= 2 %"),
        ("two effects", pairs, "<= 5 %"),
        ("outside the catalogue", foreign, "<= 5 %"),
        ("all cases", cases, "<= 2 %"),
    )
    lines = [_line(f"{level}, {name}: named wrong", group, is_wrong, target) for name, group, target in groups]
    if level == "right":
        lines.append(
            _line("right, nothing hidden: called anything", nothing, lambda o: o.verdict != "adequate", "<= 5 %")
        )
    lines.append(_line(f"{level}, one effect, large enough: in the reported set", large, lambda o: o.in_set))
    for name, group in (("nothing hidden", nothing), ("one effect, large enough", large)):
        lines += [
            _line(f"{level}, {name}: {answer}", group, lambda o, answer=answer: answer_of(o) == answer)  # type: ignore[misc]
            for answer in ANSWERS[1:-1]
        ]
    failed = _line(f"{level}: diagnoses that failed", cases, lambda o: o.verdict == "failed", "none")
    return [*lines, failed, _hits(f"{level}: new tools' natural frequencies in 95 % intervals", trusted(cases), "95 %")]


def by_answer(outcomes: Sequence[Outcome]) -> list[str]:
    """Return one line for each description and effect: the answers, and which causes were named that are not right."""
    texts = []
    for level in GEOMETRIES:
        cases = [o for o in outcomes if o.knowledge == level]
        for effects in sorted({o.effects for o in cases}):
            group = [o for o in cases if o.effects == effects]
            answers = [answer_of(o) for o in group]
            counts = ", ".join(f"{answers.count(answer)} {answer}" for answer in ANSWERS if answer in answers)
            others = sorted({id for o in group if is_wrong(o) for id in o.reported if id not in (*o.effects, *o.same)})
            name = " and ".join(effects) or "nothing"
            texts.append(f"   {level:<6}{name:<40}{counts}{'; named: ' + ', '.join(others) if others else ''}")
    return texts


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the whole table as text."""
    lines, rest = table(outcomes)
    return "\n".join([*map(str, lines), *rest, "by effect:", *by_answer(outcomes)])
