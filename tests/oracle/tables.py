"""The flattened model: four tables of float64 rows, and helpers to write them by hand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

SEGMENT_COLUMNS = (
    "a", "b", "length", "outer_diameter", "inner_diameter",
    "youngs_modulus", "density", "poisson_ratio", "loss_factor",
    "core_youngs_modulus", "core_density", "core_poisson_ratio", "core_loss_factor", "shear_model",
)  # fmt: skip
CONE_COLUMNS = (*SEGMENT_COLUMNS, "end_outer_diameter", "end_inner_diameter")
"""A segment that may be a cone; the tables here hold cylinders, `cones` computes cones by itself."""
JOINT_COLUMNS = ("a", "b", "k_y", "k_theta", "k_ytheta", "c_y", "c_theta", "c_ytheta", "loss_factor")
MASS_COLUMNS = ("node", "mass", "inertia")
GROUND_COLUMNS = ("node", "k_y", "k_theta", "k_ytheta", "c_y", "c_theta", "c_ytheta", "loss_factor")
COLUMNS = (SEGMENT_COLUMNS, JOINT_COLUMNS, MASS_COLUMNS, GROUND_COLUMNS)
NODE_COLUMNS = (2, 2, 1, 1)
"""How many leading columns of each table are node numbers."""

SEGMENTS, JOINTS, MASSES, GROUNDS = range(4)
COWPER, HUTCHINSON = 0.0, 1.0
Y, THETA = 0, 1


class Tables(NamedTuple):
    """The model as the core takes it, in the order of the core's arguments.

    Attributes
    ----------
    segments, joints, masses, grounds : ndarray of float64
        One row an element, columns as in `COLUMNS`; node numbers are stored as floats.
    """

    segments: FloatArray
    joints: FloatArray
    masses: FloatArray
    grounds: FloatArray

    @property
    def n_nodes(self) -> int:
        """One more than the largest node number."""
        largest = [table[:, :n].max() for table, n in zip(self, NODE_COLUMNS, strict=True) if len(table)]
        return int(max(largest)) + 1


def is_continuous(table: int, column: int) -> bool:
    """Whether a column holds a physical quantity rather than a node number or a choice."""
    in_table = NODE_COLUMNS[table] <= column < len(COLUMNS[table])
    return in_table and COLUMNS[table][column] != "shear_model"


def make(segments: ArrayLike = (), joints: ArrayLike = (), masses: ArrayLike = (), grounds: ArrayLike = ()) -> Tables:
    """Return `Tables` from any sequences of rows, empty tables with their right number of columns."""
    given = (segments, joints, masses, grounds)
    return Tables(*(
        np.ascontiguousarray(np.asarray(rows, dtype=np.float64).reshape(-1, len(columns)))
        for rows, columns in zip(given, COLUMNS, strict=True)
    ))  # fmt: skip


def segment(
    a: int,
    b: int,
    length: float,
    outer_diameter: float,
    material: tuple[float, float, float],
    *,
    inner_diameter: float = 0.0,
    loss_factor: float = 0.0,
    core: tuple[float, float, float] | None = None,
    core_loss_factor: float = 0.0,
    shear_model: float = COWPER,
) -> list[float]:
    """Return one row of the segment table; a material is (Young's modulus, density, Poisson's ratio)."""
    core_constants = core if core is not None else (0.0, 0.0, 0.0)
    return [a, b, length, outer_diameter, inner_diameter, *material, loss_factor, *core_constants,
            core_loss_factor, shear_model]  # fmt: skip


def joint(
    a: int,
    b: int,
    k_y: float,
    k_theta: float,
    k_ytheta: float = 0.0,
    c: tuple[float, float, float] = (0.0, 0.0, 0.0),
    loss_factor: float = 0.0,
) -> list[float]:
    """Return one row of the joint table; `c` is (c_y, c_theta, c_ytheta)."""
    return [a, b, k_y, k_theta, k_ytheta, *c, loss_factor]
