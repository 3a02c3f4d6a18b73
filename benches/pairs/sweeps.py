"""Pairs of sweeps: many joints in one assembly, many whole models, each beside hoisted, blocked NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

import numpy_reference as reference
from numpy_reference.cases import JOINT, tool_and_holder
from receptance.sweep.parametric_receptance import ParametricReceptance, parametric_receptance

from .models import JOINT_FIELDS, Array, coupled, joint_addresses, sweep
from .pair import Pair, largest_difference

SEED, DECADES = 0, 2.0
CANDIDATES, LINES, MODELS = 512, 2_000, 64
NOISE = 0.02
SHARE = 0.05
"""By how much lengths and diameters of whole models differ at most."""


def sweep_pairs(lines: int = LINES, candidates: int = CANDIDATES) -> Iterator[Pair]:
    """Yield the pairs of sweeps over joints and over whole models."""
    for kind in ("elastic", "viscous"):
        yield from _joint_pairs(kind, lines, candidates)
    yield _models_pair(lines, max(candidates * MODELS // CANDIDATES, 2))


def joints(kind: str, candidates: int) -> Array:
    """Return rows of joints (m, 4) within two decades around the assembly's own, without dashpots where elastic."""
    own = np.array([getattr(JOINT, field) for field in JOINT_FIELDS])
    rows = own * 10.0 ** np.random.default_rng(SEED).uniform(-DECADES, DECADES, (candidates, own.size))
    if kind == "elastic":
        rows[:, 2:] = 0.0
    return np.ascontiguousarray(rows)


def measured(w: Array) -> Array:
    """Return the receptance that misfits compare with."""
    noise = np.random.default_rng(SEED).standard_normal((2, w.size))
    h, _ = reference.tip_receptance(w, reference.Substructures(*tool_and_holder(), w[-1]), JOINT)
    return np.asarray(h * np.exp(NOISE * (noise[0] + 1j * noise[1])))


@cache
def swept(lines: int, threads: int) -> ParametricReceptance:
    """Return what evaluates joints; tool and holder are evaluated once, as the reference does."""
    return parametric_receptance(coupled(), joint_addresses(), sweep(lines)[0], threads=threads)


def _joint_pairs(kind: str, lines: int, candidates: int) -> Iterator[Pair]:
    _, w = sweep(lines)
    rows, data, weights = joints(kind, candidates), measured(w), np.full(lines, 1.0 / NOISE)
    parts = reference.Substructures(*tool_and_holder(), w[-1])
    planes, room = parts(w), np.empty((candidates, lines), dtype=np.complex128)
    plain = reference.JointSweep(w, parts, kind == "viscous")
    fitted = reference.JointSweep(w, parts, kind == "viscous", data)
    many = f"{candidates} joints at {lines:,} lines"

    def one_by_one() -> Array:
        for row, out in zip(rows, room, strict=True):
            reference.tip_receptance(w, planes, reference.Joint(*row), out=(out, None))
        return room

    shared = {"lines": candidates * lines, "tolerance": 1e-9}
    for threads in (1, 2):
        own = swept(lines, threads)
        on = ", two threads" if threads > 1 else ""
        for against, other in (
            ("2x2 algebra of one joint after the other, hoisted, blocked", one_by_one),
            ("matrix products with BLAS, hoisted, blocked", lambda: plain.receptances(rows, room)),
        ):
            yield Pair(
                subject=f"sweep of {kind} joints, receptance ({many}){on}",
                against=against,
                ours=lambda own=own: own.receptance(rows),
                reference=other,
                difference=largest_difference,
                threads=threads,
                **shared,
            )
        yield Pair(
            subject=f"sweep of {kind} joints, misfit ({many}){on}",
            against="matrix products with BLAS, real logarithms, hoisted, blocked",
            ours=lambda own=own: own.misfit(rows, data, weights),
            reference=lambda: fitted.misfits(rows, weights),
            difference=largest_difference,
            threads=threads,
            **shared,
        )


def _models_pair(lines: int, candidates: int) -> Pair:
    """Return the pair of whole models: length of the tool's first segment and diameter of its second."""
    f, w = sweep(lines)
    addresses = ("tool.segment[0].length", "tool.segment[1].outer_diameter", "joint.k_y")
    own = np.array([coupled().get(address) for address in addresses])
    rows = own * np.random.default_rng(SEED).uniform(1 - SHARE, 1 + SHARE, (candidates, own.size))
    ours = parametric_receptance(coupled(), addresses, f, threads=1)
    room = np.empty((candidates, lines), dtype=np.complex128)

    def one_by_one() -> Array:
        for (length, diameter, k_y), out in zip(rows, room, strict=True):
            tool, holder = tool_and_holder()
            tool[0, 2], tool[1, 3] = length, diameter
            parts = reference.Substructures(tool, holder, w[-1])
            reference.tip_receptance(w, parts, JOINT._replace(k_y=k_y), out=(out, None))
        return room

    return Pair(
        subject=f"sweep of whole models, receptance ({candidates} models at {lines:,} lines)",
        against="power series with set-up, limited range, one model after the other",
        ours=lambda: ours.receptance(rows),
        reference=one_by_one,
        difference=largest_difference,
        tolerance=1e-8,
        lines=candidates * lines,
        segments=9,
    )
