"""Pairs of natural frequencies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy_reference as reference
from numpy_reference.cases import ten_segments

from .models import chain
from .pair import Pair, largest_difference

UPPER_HZ = (10_000.0, 30_000.0)


def mode_pairs() -> Iterator[Pair]:
    """Yield the pairs of the ten-segment chain's natural frequencies."""
    table = ten_segments()
    for upper in UPPER_HZ:
        yield Pair(
            subject=f"natural frequencies below {upper / 1e3:g} kHz, ten-segment chain",
            against="roots of a whole-chain power series, counted",
            ours=lambda upper=upper: chain().natural_frequencies(upper),
            reference=lambda upper=upper: reference.natural_frequencies(table, upper),
            difference=largest_difference,
            tolerance=1e-9,
            segments=len(table),
            remark=lambda ours, _: f"{ours.size} modes",
        )
