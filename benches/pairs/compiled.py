"""Pairs against closed forms in scalar loops that numba compiles, where it is installed."""

from __future__ import annotations

from collections.abc import Iterator

from numpy_reference import compiled
from numpy_reference.cases import ten_segments
from receptance import Coordinate

from .models import between_ends, chain, part, sweep
from .pair import Pair, largest_difference
from .receptances import STIFFNESS_FROM_HZ

skipped = compiled.missing
"""Why there are none, nothing where there are."""


def compiled_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs, none without numba."""
    if skipped():
        return
    f, w = sweep(lines)
    table = ten_segments()
    tip = [Coordinate(direction="y"), Coordinate(direction="theta")]
    digits = f >= STIFFNESS_FROM_HZ
    yield Pair(
        subject="ten-segment chain, tip 2x2",
        against="closed form, a scalar loop compiled by numba",
        ours=lambda: chain().receptance(f, response=tip, excitation=tip, threads=1),
        reference=lambda: compiled.compiled_tip(w, table),
        difference=lambda a, b: largest_difference(a[digits], b[digits]),
        tolerance=1e-8,
        lines=lines,
        segments=len(table),
    )
    rod = part(table[:1], "rod")
    yield Pair(
        subject="one segment, both ends 4x4",
        against="closed form, a scalar loop compiled by numba",
        ours=lambda: between_ends(rod, f),
        reference=lambda: compiled.compiled_segment(w, table[0]),
        difference=lambda a, b: largest_difference(a[digits], b[digits]),
        tolerance=1e-8,
        lines=lines,
        segments=1,
    )
