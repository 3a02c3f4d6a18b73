"""Cases of the laboratory of neighbours: a bench with nothing hidden, one ordinary error, and the records of it.

Every case has a twin: the same bench and the same hits without the error, rightly described. What the error changes is
the difference between the two.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np

from blind.generator import NEIGHBOUR, Bench, Case, Record, Truth, draw_bench
from blind.generator.case import all_numbers, where_of
from blind.generator.effects import Where
from blind.generator.records import Setup, Signal, measure

from .channel_errors import CHANNEL_ERRORS
from .clamping_errors import CLAMPING_ERRORS
from .covered_errors import COVERED_ERRORS
from .description_errors import DESCRIPTION_ERRORS
from .file_errors import FILE_ERRORS
from .hit_errors import HIT_ERRORS
from .kind import Change, Draw, Kind, restated

NEIGHBOURS = {
    kind.id: kind for kind in (*HIT_ERRORS, *CHANNEL_ERRORS, *DESCRIPTION_ERRORS, *CLAMPING_ERRORS, *FILE_ERRORS)
}
"""All kinds of ordinary errors that the catalogue does not contain, by id."""
COVERED = {kind.id: kind for kind in COVERED_ERRORS}
"""Kinds that it contains by now, by id."""
BENCH, ERROR, HITS, DISTURBED = 84, 85, 86, 87
"""Streams of random numbers: what is measured, the error, the hits of a record, and what the error does to each hit."""
STRIDE = 37
"""Steps through the kinds, so that neighbours in a list of cases differ in group."""
SILENCE = 1e-6
"""Noise of a record that has none, as a share of the usual one."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """The input of the diagnosis, and what was measured."""

    case: Case
    truth: Truth


@dataclass(frozen=True, kw_only=True)
class Neighbour:
    """A case with an ordinary error."""

    kind: Kind
    u: float
    seen: Measured
    twin: Measured


def every(count: int) -> list[str]:
    """Return the kinds of a batch, all in turn.

    Any beginning is a fair mixture of the groups. Each round begins one kind later, so that a shard that takes every
    second case has all kinds after two rounds.
    """
    ids = list(NEIGHBOURS)
    return [ids[(STRIDE * i + i // len(ids)) % len(ids)] for i in range(count)]


def draw_neighbour(
    seed: int, index: int, id: str, *, u: float | None = None, quick: bool = False, noise: bool = True
) -> Neighbour:
    """Return a case with an ordinary error, and its twin without, drawn anew from seed and index.

    Parameters
    ----------
    seed, index : int
        Seed and number of the case.
    id : str
        Which kind of error, one of `NEIGHBOURS` or `COVERED`.
    u : float, optional
        Size of the error from 0, no change, to 1, large; drawn where not given.
    quick : bool, optional
        Three overhangs, a narrower band and fewer lines, for tests.
    noise : bool, optional
        Whether the channels have noise. All else is equal.
    """
    kind = NEIGHBOURS.get(id) or COVERED[id]
    rng = np.random.default_rng([seed, index, ERROR])
    # As a square, so that half of the sizes are below a quarter: large errors are obvious.
    drawn = float(rng.uniform()) ** 2
    size = 1.0 if not kind.sized else drawn if u is None else u
    change = kind.draw(Draw(rng, size, _bench(seed, index, quick)))
    bench = _bench(seed, index, quick, tuple(change.common.items()))
    twin = _twin(seed, index, quick, tuple(change.common.items()), noise)
    return Neighbour(kind=kind, u=size, seen=_measured(bench, change, noise), twin=twin)


def _bench(seed: int, index: int, quick: bool, common: tuple[tuple[str, float], ...] = ()) -> Bench:
    bench = draw_bench(np.random.default_rng([seed, index, BENCH]), (seed, index), NEIGHBOUR, quick=quick)
    return replace(bench, nominal=restated(bench.nominal, dict(common)))


@functools.lru_cache(maxsize=8)
def _twin(seed: int, index: int, quick: bool, common: tuple[tuple[str, float], ...], noise: bool) -> Measured:
    """Return the records without an error; most kinds need nothing of their own and have the same ones."""
    return _measured(_bench(seed, index, quick, common), Change(), noise)


def _measured(bench: Bench, change: Change, noise: bool) -> Measured:
    """Return the records of a bench on which an error acts, with the description that the error leaves."""
    seed = bench.truth.seed
    truth = replace(bench.truth, numbers={})
    records = []
    for number, (c, plane, level) in enumerate(bench.series()):
        where = where_of(truth, c, level, plane)
        p = all_numbers(bench.nominal, truth, where)
        if change.structure is not None:
            change.structure(p, where)
        setup = truth.setups[level] if noise else _silent(truth.setups[level])
        if change.setup is not None:
            setup = change.setup(setup, where)
        disturb = None
        if change.hits is not None:
            rng = np.random.default_rng([*seed, DISTURBED, number])
            disturb = functools.partial(_disturbed, change, rng, where)
        estimate = measure(np.random.default_rng([*seed, HITS, number]), p, setup, disturb)
        if change.analysis is not None:
            estimate = change.analysis(estimate, p, where)
        truth.numbers[c.name, level, plane] = p  # type: ignore[index]
        label = f"{c.name} {number}"
        records.append(
            Record(label=label, configuration=c.name, level=level, plane=plane, form=bench.form, estimate=estimate)
        )
    if change.files is not None:
        records = change.files(records)
    nominal = bench.nominal if change.describe is None else change.describe(bench.nominal)
    case = Case(name="case {}-{}".format(*seed), nominal=nominal, records=tuple(records), new_tools=())
    return Measured(case=case, truth=truth)


def _silent(setup: Setup) -> Setup:
    return replace(setup, noise=SILENCE * setup.noise, hammer_noise=SILENCE * setup.hammer_noise)


def _disturbed(
    change: Change, rng: np.random.Generator, where: Where, number: int, force: Signal, response: Signal
) -> tuple[Signal, Signal]:
    assert change.hits is not None
    return change.hits(rng, number, force, response, where)
