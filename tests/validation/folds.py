"""Folds of the diagnosis against complete selections: `python tests/validation/folds.py --cases N --seed S`.

For improvements on held-out configurations the explanations close to the best one are fitted again, from the values of
the fit to all data. Here the complete selection is repeated without each configuration, on cases of the blind
laboratory, and answer, causes, and the distances before and after are compared. Distances are counted as different if
they differ by more than 2 %.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from blind import bridge
from blind.generator import draw_case, every
from receptance.diagnosis import CATALOGUE, diagnose, held_out
from receptance.diagnosis.explanation import Selection
from receptance.diagnosis.selection import select

SAME = 0.02
"""Relative difference of two distances up to which they are equal."""


def folds(seed: int, number: int, *, repeated: bool, quick: bool) -> Any:
    """Return the folds of a case; with `repeated` each is a complete selection."""
    kind, effects = list(every(number + 1))[number]
    case, _ = draw_case(seed, number, kind, tuple(effects), quick=quick)
    warm = held_out.select_without

    def again(selection: Selection, configurations: Any) -> Selection:
        return select(selection.base.model.without(configurations), tuple(CATALOGUE.values()))

    held_out.select_without = again if repeated else warm  # type: ignore[assignment]
    measured = {one.name for one in case.nominal.configurations}
    tolerances = [
        one
        for one, stated in zip(bridge.tolerances_of(case.nominal), case.nominal.tolerances, strict=True)
        if stated.configuration is None or stated.configuration in measured
    ]
    try:
        found = diagnose(
            bridge.observations_of(case),
            bridge.unknowns_of(case.nominal),
            tolerances=tolerances,
            held_out=True,
            threads=1,
        )
    finally:
        held_out.select_without = warm
    return found.gain.folds if found.gain is not None else ()


def main() -> None:
    """Compare, print the differences and their number."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=20261124)
    parser.add_argument("--full", action="store_true", help="cases with all their lines instead of the quick ones")
    options = parser.parse_args()
    total = answers = distances = 0
    for number in range(options.first, options.first + options.cases):
        pairs = [folds(options.seed, number, repeated=one, quick=not options.full) for one in (False, True)]
        for warm, whole in zip(*pairs, strict=True):
            total += 1
            differs = (warm["verdict"], warm["causes"]) != (whole["verdict"], whole["causes"])
            away = [abs(warm[name] / whole[name] - 1.0) > SAME for name in ("before", "after")]
            answers += differs
            distances += any(away)
            if differs or any(away):
                sys.stdout.write(f"case {number}: {warm}\n    repeated: {whole}\n")
                sys.stdout.flush()
    sys.stdout.write(
        f"seed {options.seed}, {options.cases} cases, {total} folds: the answer differs in {answers}, a distance by "
        f"more than {100.0 * SAME:.0f} % in {distances}\n"
    )


if __name__ == "__main__":
    main()
