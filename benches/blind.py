"""The blind laboratory: `python benches/blind.py --cases N --seed S [--json FILE] [--shard i/n] [--resume FILE]
[--budget MIN]`.

Hides an effect in every case (none in a third of them), runs the diagnosis, compares it with the truth and prints the
score table, with exact binomial intervals. Every case is drawn anew from the seed and its number, so shards and a
resumed run give the same cases as one long run. The file of `--resume` has one JSON line for each finished case;
several shards are scored together with `--score FILE FILE ...`. Any beginning of the list of cases is a fair mixture,
so `--budget` may end a run early: after so many minutes no case is begun any more, and the table says how many ran.
`--effects ID ...` hides one of these effects in every case, in turn, instead of the mixture: to study one kind alone.
`--only NAME ...` runs those cases of the list that have one of these kinds or effects; they keep their numbers.
`--advice` scores the advised measurements alone and asks the oracle of ambiguous cases only.
`--holder LEVEL ...` runs the same list of cases with less knowledge of the holder, and each level has a table of its
own; `tests/blind/generator/knowledge.py` says how the levels are drawn.
`--geometry LEVEL ...` makes the holders conical and the tools fluted, described crudely by cylinders or as they are;
the rules of its score are in `tests/blind/geometry_score.py`, and `--score` needs the option as well.
`--neighbours` makes ordinary errors that the catalogue does not contain, all kinds of `tests/blind/neighbours` in turn,
and counts how often they are named or partly explained wrongly; `--only` then chooses among these kinds, and `--score`
needs the option as well. Kinds that the catalogue contains by now are run in turn if `--only` names them.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more.
if __name__ == "__main__":
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import functools
import itertools
import sys
import time
from pathlib import Path

# The laboratory is the package `blind` under tests, and this file must not shadow it.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from blind.bridge import ask
from blind.files import add_options, append, read, run_batch
from blind.generator import CATALOGUE, GEOMETRIES, KINDS, LEVELS, NEIGHBOUR, OUTSIDE, alone, every
from blind.geometry_score import report as report_of_geometry
from blind.geometry_score import table as of_geometry
from blind.neighbours import COVERED, NEIGHBOURS
from blind.neighbours import every as every_neighbour
from blind.neighbours.outcome import run_neighbour
from blind.neighbours.score import report as report_of_neighbours
from blind.neighbours.score import table as of_neighbours
from blind.outcome import Outcome, run_case
from blind.score import of_advice, report, report_of_advice, table


def main(arguments: list[str] | None = None) -> int:
    """Run, print the table, write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_options(parser, cases=30)
    parser.add_argument(
        "--holder",
        choices=LEVELS,
        nargs="+",
        default=[""],
        help="what is known of the holder, by default its dimensions with ordinary tolerances; each case is run at "
        "all levels that are given",
    )
    parser.add_argument(
        "--geometry",
        choices=GEOMETRIES,
        nargs="+",
        default=[],
        help="conical holders and fluted tools, described by cylinders that are stated as exact, or as they are; each "
        "case is run with all descriptions that are given",
    )
    parser.add_argument("--effects", choices=CATALOGUE, nargs="+", metavar="ID", help="one of these in every case")
    parser.add_argument(
        "--only",
        choices=(*KINDS, *CATALOGUE, *OUTSIDE, *NEIGHBOURS, *COVERED),
        nargs="+",
        metavar="NAME",
        help="cases of these kinds or effects",
    )
    parser.add_argument("--advice", action="store_true", help="score the measurements that are advised, and no more")
    parser.add_argument("--neighbours", action="store_true", help="ordinary errors that the catalogue does not contain")
    parser.add_argument("--quick", action="store_true", help="three overhangs and a narrower band")
    parser.add_argument("--threads", type=int, default=1, help="of one diagnosis; shards are the better use of cores")
    options = parser.parse_args(arguments)
    if options.neighbours and (options.advice or options.effects or options.holder != [""]):
        parser.error("--neighbours has no --advice, --effects and --holder")
    if options.geometry and (options.neighbours or options.advice or options.holder != [""]):
        parser.error("--geometry has no --neighbours, --advice and --holder")
    if options.only and options.neighbours != set(options.only).issubset({*NEIGHBOURS, *COVERED}):
        parser.error("--only chooses among the kinds of neighbours with --neighbours, and among the others without it")
    scored = (report_of_advice, of_advice) if options.advice else (report, table)
    if options.neighbours:
        scored = (report_of_neighbours, of_neighbours)
    if options.geometry:
        scored = (report_of_geometry, of_geometry)
    run_batch(options, functools.partial(run, options), *scored)
    return 0


def run(options: argparse.Namespace, seed: int) -> list[Outcome]:
    """Return the outcomes of a shard, those that were finished before included."""
    outcomes = [o for o in read([options.resume]) if o.seed == seed] if options.resume else []
    levels = options.geometry or options.holder
    outcomes = [o for o in outcomes if o.knowledge in levels and options.neighbours == (o.kind == NEIGHBOUR)]
    done = {(o.knowledge, o.index) for o in outcomes}
    own, count = options.shard
    begun = time.perf_counter()
    plan = alone(options.cases, options.effects) if options.effects else every(options.cases)
    if options.neighbours:
        covered = [id for id in options.only or () if id in COVERED]
        ids = itertools.islice(itertools.cycle(covered), options.cases) if covered else every_neighbour(options.cases)
        plan = [(NEIGHBOUR, (id,)) for id in ids]
    chosen = [
        (index, case)
        for index, case in enumerate(plan)
        if not options.only or not set(options.only).isdisjoint((case[0], *case[1]))
    ]
    cases = [(level, *case) for case in chosen for level in levels]
    for level, index, (kind, effects) in cases:
        if index % count != own - 1 or (level, index) in done:
            continue
        if time.perf_counter() - begun > 60.0 * options.budget:
            sys.stdout.write("the budget is used up\n")
            break
        asked = functools.partial(ask, threads=options.threads)
        if options.neighbours:
            one = run_neighbour(seed, index, *effects, asked, quick=options.quick)
        else:
            how = {"quick": options.quick, "geometry" if options.geometry else "knowledge": level}
            how |= {"advice": options.advice}
            one = run_case(seed, index, kind, effects, asked, **how)
        outcomes.append(one)
        sizes = ", ".join(f"{id} {u:.2f}" for id, u in zip(one.effects, one.sizes, strict=True)) or "nothing"
        sizes += f" (in the data: {', '.join(one.within)})" if one.within else ""
        large = "large" if one.large else "small"
        sys.stdout.write(
            f"{index:4d} {level}{' ' if level else ''}{kind:<17} {sizes:<40} {large}  ->  {one.verdict} "
            f"{', '.join(one.reported)}  misfit {one.misfit:.2f} to {one.misfit_after:.2f}, {one.seconds:.0f} s of "
            f"{time.perf_counter() - begun:.0f} s{'  ' + one.error if one.error else ''}\n"
        )
        sys.stdout.flush()
        if options.resume:
            append(options.resume, one)
    return outcomes


if __name__ == "__main__":
    sys.exit(main())
