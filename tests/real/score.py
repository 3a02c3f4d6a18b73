"""The score of effects hidden in real measurements. The rule was fixed before any batch was run.

The verdict is a word of the package. Words that name no cause are `QUIET`; "suspected" and "ambiguous" report causes
without naming one; any other word names ("named", "partly explained", or whatever a later version says).

- Nothing hidden: a verdict that names a cause is a false call. "Adequate", "unexplained" and "undecided" are right.
  "Suspected" and "ambiguous" are no false calls and have a line of their own.
- An effect hidden, rightly: every cause that is reported is the hidden effect or one of its declared look-alikes
  (`cases.ANSWERS`, `cases.LOOK_ALIKES`), and the verdict names it, or is "ambiguous" among these alone.
- An effect hidden, wrongly: the verdict names a cause that is neither.
- Anything else is no answer: "unexplained", "suspected", "adequate".
- Sizes: whether the 95 % interval that is stated with a rightly named effect holds the hidden size. Sizes of bodies
  are as exact as the drive point, some 5 %; see `structures`.

Effects with a ratio above `cases.CLEAR` count for the targets: rightly at least 85 %, wrongly at most 3 %, nothing
hidden called at most 5 %. Those of them that the data can support (`cases.LEAST_SUPPORT`) have a line of their own: of
the others the structure cannot support a claim. A failed diagnosis counts as no answer and has a line. Shares have
exact (Clopper and Pearson) 95 % binomial intervals. The cases are different records, bands, configurations and sizes of
two structures: intervals are those of this population, not of structures in general.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from blind.outcome import Outcome
from blind.score import Line
from real.cases import ANSWERS, LEAST_SUPPORT, LOOK_ALIKES

QUIET = ("adequate", "unexplained", "undecided", "failed")
OPEN = ("suspected", "ambiguous")
WIDTH = 80


def names_a_cause(o: Outcome) -> bool:
    """Return whether the verdict names a cause."""
    return o.verdict not in (*QUIET, *OPEN)


def rightly(o: Outcome) -> bool:
    """Return whether exactly the hidden effect, or a declared look-alike, is the answer."""
    only = bool(o.found) and len(o.found) == len(o.reported)
    return bool(o.effects) and only and (names_a_cause(o) or o.verdict == "ambiguous")


def wrongly(o: Outcome) -> bool:
    """Return whether a cause is named that is neither hidden nor a look-alike."""
    return names_a_cause(o) and (not o.reported or len(o.found) < len(o.reported))


def supported(o: Outcome) -> bool:
    """Return whether the data can support the claim of a clear effect."""
    return o.large and o.oracle["support"] >= LEAST_SUPPORT


def table(outcomes: Iterable[Outcome]) -> tuple[list[Line], list[str]]:
    """Return the lines of the table, and results other than shares as text."""
    cases = list(outcomes)
    nothing = [o for o in cases if not o.effects]
    hidden = [o for o in cases if o.effects]
    clear, small = [o for o in hidden if o.large], [o for o in hidden if not o.large]
    able = [o for o in clear if supported(o)]

    def line(name: str, group: Sequence[Outcome], hits: Iterable[bool], target: str = "") -> Line:
        return Line(name, sum(hits), len(group), target)

    lines = [
        line("nothing hidden: a cause named", nothing, map(wrongly, nothing), "<= 5 %"),
        line("  suspected or ambiguous", nothing, (o.verdict in OPEN for o in nothing)),
        line("clear effect: rightly", clear, map(rightly, clear), ">= 85 %"),
        line("  where the data can support it", able, map(rightly, able), ">= 85 %"),
        line("clear effect: wrongly", clear, map(wrongly, clear), "<= 3 %"),
        line("  first candidate is right", clear, map(_first_is_right, clear)),
        line("  suspected or ambiguous, right among", clear, (o.verdict in OPEN and bool(o.found) for o in clear)),
        line("  unexplained", clear, (o.verdict == "unexplained" for o in clear)),
        line("  adequate", clear, (o.verdict == "adequate" for o in clear)),
        line("smaller effect: rightly", small, map(rightly, small)),
        line("smaller effect: wrongly", small, map(wrongly, small), "<= 3 %"),
    ]
    sizes = [hit for o in hidden if rightly(o) for hit in o.size_covered]
    lines += [
        Line("95 % intervals cover the hidden size", sum(sizes), len(sizes), "95 %"),
        line("diagnoses that failed", cases, (o.verdict == "failed" for o in cases), "none"),
    ]
    seconds = [o.seconds for o in cases] or [0.0]
    rest = [
        f"misfit of the plain model, nothing hidden: {_range([o.misfit for o in nothing])}",
        f"time of a diagnosis: median {np.median(seconds):.1f} s, largest {max(seconds):.1f} s",
    ]
    return lines, rest


def _first_is_right(o: Outcome) -> bool:
    right = (*ANSWERS[o.effects[0]], *LOOK_ALIKES.get((o.kind, o.effects[0]), ()))
    return bool(o.candidates) and o.candidates[0][0] in right


def _range(values: Sequence[float]) -> str:
    return f"median {np.median(values):.3g}, {min(values):.3g} to {max(values):.3g}" if values else "no case"


def row(line: Line) -> str:
    """Return a line of the table in 80 columns."""
    if not line.trials:
        return f"{line.name:<38} no case{'':<26}{line.target}".rstrip()
    low, high = line.interval
    share = 100.0 * line.hits / line.trials
    counts = f"{line.hits}/{line.trials}"
    text = f"{line.name:<37}{counts:>8} {share:5.1f} % ({100 * low:5.1f} to {100 * high:5.1f}) {line.target}"
    return text.rstrip()


def by_effect(outcomes: Sequence[Outcome]) -> list[str]:
    """Return one line for each structure and effect."""
    texts = []
    for kind, id in dict.fromkeys((o.kind, o.effects[0] if o.effects else "") for o in outcomes):
        own = [o for o in outcomes if (o.kind, o.effects[0] if o.effects else "") == (kind, id)]
        verdicts = {v: sum(o.verdict == v for o in own) for v in sorted({o.verdict for o in own})}
        counts = ", ".join(f"{n} {v}" for v, n in verdicts.items())
        first = sum(bool(o.effects) and _first_is_right(o) for o in own)
        right = f"right {sum(map(rightly, own))} wrong {sum(map(wrongly, own))} first {first}"
        clear = f"{sum(o.large for o in own)} clear, {sum(map(supported, own))} supported"
        texts += [f"  {kind:<11} {id or 'nothing':<18}{len(own):3d} ({clear}):", f"    {right}; {counts}"]
    return texts


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the whole table as text of 80 columns."""
    lines, rest = table(outcomes)
    return "\n".join([*map(row, lines), *rest, "by structure and effect:", *by_effect(outcomes)])
