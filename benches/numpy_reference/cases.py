"""The assemblies that the checks and the timings share: contract tables, made by hand from a fixed seed."""

from __future__ import annotations

import numpy as np

from .joint import Joint
from .segment import Real

HIGHEST = 2 * np.pi * 10_000.0
JOINT = Joint(5e7, 2e5, 100.0, 0.5)
GUESS = Joint(1e8, 4e5, 200.0, 1.0)


def segment_row(
    node: int,
    length: float,
    outer: float,
    inner: float = 0.0,
    material: tuple[float, float, float, float] = (200e9, 7800.0, 0.29, 0.0),
    core: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
    shear_model: float = 0.0,
) -> list[float]:
    """One row of the segment table; materials are E, density, Poisson's ratio, loss factor."""
    return [node, node + 1, length, outer, inner, *material, *core, shear_model]


def ten_segments(total: float = 0.2) -> Real:
    """A carbide tool of four segments in a steel holder of six, ``total`` long [m]."""
    length = np.random.default_rng(1).uniform(0.5, 1.5, 10)
    length *= total / length.sum()
    carbide, steel = (580e9, 14_300.0, 0.22, 0.002), (205e9, 7_800.0, 0.3, 0.004)
    tool = [segment_row(i, length[i], 0.012, 0.0, carbide) for i in range(4)]
    holder = [
        segment_row(i, length[i], outer, 0.012, steel)
        for i, outer in enumerate((0.02, 0.025, 0.032, 0.04, 0.05, 0.063), start=4)
    ]
    return np.array(tool + holder)


def tool_and_holder(total: float = 0.2) -> tuple[Real, Real]:
    """Three tool segments and six holder segments, each numbered from its own tip side."""
    table = ten_segments(total)
    tool, holder = table[:3].copy(), table[4:].copy()
    holder[:, :2] -= 4
    return tool, holder
