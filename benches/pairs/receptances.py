"""Pairs of receptances: one segment, a chain, tool and holder with a joint and its derivatives."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache

import numpy as np

import cones
import numpy_reference as reference
from numpy_reference.cases import JOINT, ten_segments, tool_and_holder
from receptance import Coordinate, Segment, _core

from .models import (
    SEGMENT_COLUMNS,
    Array,
    between_ends,
    chain,
    coupled,
    joint_addresses,
    part,
    segment_addresses,
    spread,
    sweep,
)
from .pair import Pair, largest_difference

# Below, the reference's closed-form dynamic stiffness has lost digits and is no reference.
STIFFNESS_FROM_HZ = 100.0


def segment_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs of one segment."""
    f, w = sweep(lines)
    table = ten_segments()[:1]
    rod = part(table, "rod")
    for against, other in (
        ("closed form", lambda: reference.segment_receptance(w, table[0])),
        ("power series with set-up, limited range", lambda: reference.BothEndsSeries(table, w[-1])(w)),
    ):
        yield Pair(
            subject="one segment, both ends 4x4",
            against=against,
            ours=lambda: between_ends(rod, f),
            reference=other,
            difference=largest_difference,
            tolerance=1e-9,
            lines=lines,
            segments=1,
        )


def chain_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs of the ten-segment chain."""
    f, w = sweep(lines)
    table = ten_segments()
    tip = [Coordinate(direction="y"), Coordinate(direction="theta")]
    prepared = reference.TipSeries(table, w[-1])
    digits = f >= STIFFNESS_FROM_HZ
    for against, other, difference, tolerance in (
        (
            "closed-form 2x2 stiffness Riccati",
            lambda: reference.tip_by_stiffness(w, table),
            lambda a, b: largest_difference(a[digits], b[digits]),
            1e-8,
        ),
        (
            "transfer Riccati, each segment, with set-up",
            lambda: reference.TransferChain(table, w[-1], merge=False)(w),
            largest_difference,
            1e-9,
        ),
        (
            "whole-chain power series with set-up, limited range",
            lambda: reference.chain_tip_receptance(w, table),
            largest_difference,
            1e-9,
        ),
        (
            "whole-chain power series, its set-up (not ours) left out",
            lambda: prepared(w),
            largest_difference,
            1e-9,
        ),
    ):
        yield Pair(
            subject="ten-segment chain, tip 2x2",
            against=against,
            ours=lambda: chain().receptance(f, response=tip, excitation=tip, threads=1),
            reference=other,
            difference=difference,
            tolerance=tolerance,
            lines=lines,
            segments=len(table),
        )
    # Cost of the checks and of the conversion from objects to tables.
    complex_w, both = w.astype(np.complex128), np.array([[0.0, 0.0], [0.0, 1.0]])
    none = [np.empty((0, columns)) for columns in (9, 3, 8)]
    no_parameters = np.empty((0, 3))

    def extension_alone() -> Array:
        return _core.Model(0, table, *none).receptance(_core.Lines(complex_w), both, both, no_parameters, 1)[0]

    yield Pair(
        subject="ten-segment chain, tip 2x2, the compiled extension alone",
        against="whole-chain power series with set-up, limited range",
        ours=extension_alone,
        reference=lambda: reference.chain_tip_receptance(w, table),
        difference=largest_difference,
        tolerance=1e-9,
        lines=lines,
        segments=len(table),
    )


def long_chain_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs of the ten-segment chain on many lines, on one thread and on two."""
    f, w = sweep(lines)
    table = ten_segments()
    tip = [Coordinate(direction="y"), Coordinate(direction="theta")]
    digits = f >= STIFFNESS_FROM_HZ
    for threads, on in ((1, ""), (2, ", two threads")):
        yield Pair(
            subject=f"ten-segment chain, tip 2x2, many lines{on}",
            against="closed-form 2x2 stiffness Riccati",
            ours=lambda threads=threads: chain().receptance(f, response=tip, excitation=tip, threads=threads),
            reference=lambda: reference.tip_by_stiffness(w, table),
            difference=lambda a, b: largest_difference(a[digits], b[digits]),
            tolerance=1e-8,
            lines=lines,
            segments=len(table),
            threads=threads,
        )


def joint_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs of tool, joint and holder, and the cost of derivatives."""
    f, w = sweep(lines)
    tool, holder = tool_and_holder()
    segments = len(tool) + len(holder)
    assembly, joint = coupled(), joint_addresses()
    own = segment_addresses(assembly)

    def plain() -> Array:
        return assembly.receptance(f, threads=1)

    def slopes(addresses: list[str]) -> tuple[Array, Array]:
        return assembly.derivatives(f, addresses, threads=1)

    def numpy(derivatives: bool) -> tuple[Array, Array | None]:
        return reference.tip_receptance(w, reference.Substructures(tool, holder, w[-1]), JOINT, derivatives)

    subject, against = "tool, joint and holder, tip", "power series with set-up, limited range"
    yield Pair(
        subject=subject,
        against=against,
        ours=plain,
        reference=lambda: numpy(False),
        difference=lambda a, b: largest_difference(a, b[0]),
        tolerance=1e-9,
        lines=lines,
        segments=segments,
    )
    yield Pair(
        subject=f"{subject}, with 4 joint derivatives",
        against=against,
        ours=lambda: slopes(joint),
        reference=lambda: numpy(True),
        difference=lambda a, b: max(largest_difference(x, y) for x, y in zip(a, b, strict=True)),
        tolerance=1e-8,
        lines=lines,
        segments=segments,
    )
    # Not against NumPy: the time that derivatives add.
    yield Pair(
        subject="cost of four joint derivatives",
        against="ours with / ours without",
        ours=lambda: slopes(joint),
        reference=plain,
        difference=lambda a, b: largest_difference(a[0], b),
        tolerance=1e-12,
        lines=lines,
        segments=segments,
        is_cost=True,
    )
    yield Pair(
        subject=f"cost of {len(own)} segment derivatives",
        against="ours with / ours without",
        ours=lambda: slopes(own),
        reference=plain,
        difference=lambda a, b: max(largest_difference(a[0], b), against_differences()),
        tolerance=1e-5,
        lines=lines,
        segments=segments,
        is_cost=True,
    )


def spread_pairs(lines: int) -> Iterator[Pair]:
    """Yield the cost of the derivatives of a joint along an insertion; the receptance alone is the other side."""
    f, _ = sweep(lines)
    for points, what in ((None, "a layer"), (4, "four points"), (12, "twelve points")):
        assembly = spread(points)
        own = [name for name in assembly.parameters if name.startswith("joint.")]
        yield Pair(
            subject=f"cost of {len(own)} derivatives of {what} along an insertion",
            against="ours with / ours without",
            ours=lambda assembly=assembly, own=own: assembly.derivatives(f, own, threads=1),
            reference=lambda assembly=assembly: assembly.receptance(f, threads=1),
            difference=lambda a, b: largest_difference(a[0], b),
            tolerance=1e-12,
            lines=lines,
            segments=None,
            is_cost=True,
        )


def cone_pairs(lines: int) -> Iterator[Pair]:
    """Yield the cost of a cone, six cylinders being the other side; the assembly is made in every call."""
    for highest, derivatives in ((5e3, ()), (5e3, cones.DERIVATIVES), (50e3, ()), (50e3, cones.DERIVATIVES)):
        f = np.linspace(10.0, highest, lines)
        own = [f"part.segment[*].{quantity}" for quantity in derivatives]

        def call(*row: Segment, f: Array = f, own: list[str] = own) -> Array:
            assembly = cones.free(*row)
            return assembly.derivatives(f, own, threads=1)[0] if own else assembly.receptance(f, threads=1)

        for name, cone in cones.CONES.items():
            six = cones.cylinders(cone, cones.CYLINDERS)
            yield Pair(
                subject=f"cost of a cone to {highest / 1e3:g} kHz" + (f", {len(own)} derivatives" if own else ""),
                against=f"ours / six cylinders, {name}",
                ours=lambda call=call, cone=cone: call(cone),
                reference=lambda call=call, six=six: call(*six),
                # Six cylinders are another structure: the cone is compared with many, extrapolated.
                difference=lambda _ours, _six, cone=cone: cones.inaccuracy(cone),
                tolerance=1e-9,
                lines=lines,
                segments=1,
                is_cost=True,
            )


@cache
def against_differences() -> float:
    """Return how far our derivatives are from differences of the NumPy reference, over the largest of each."""
    assembly, (f, w) = coupled(), sweep(20)
    addresses = segment_addresses(assembly)
    _, slopes = assembly.derivatives(f, addresses, threads=1)

    def difference(part: int, row: int, column: int, step: float) -> Array:
        ends = []
        for sign in (1, -1):
            tables = tool_and_holder()
            tables[part][row, column] += sign * step
            ends.append(reference.tip_receptance(w, reference.Substructures(*tables, w[-1]), JOINT)[0])
        return (ends[0] - ends[1]) / (2 * step)

    worst = 0.0
    for index, address in enumerate(addresses):
        name, row, field = re.fullmatch(r"(\w+)\.segment\[(\d+)\]\.(\w+)", address).groups()
        place = (("tool", "holder").index(name), int(row), SEGMENT_COLUMNS[field])
        step = 1e-3 * tool_and_holder()[place[0]][place[1:]]
        # Two central differences, extrapolated to a step of zero.
        found = (4 * difference(*place, step / 2) - difference(*place, step)) / 3
        worst = max(worst, float(np.max(np.abs(found - slopes[:, index])) / np.max(np.abs(found))))
    return worst
