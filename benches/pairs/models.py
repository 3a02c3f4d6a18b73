"""The structures of the pairs as the library has them; the reference has the same as tables."""

from __future__ import annotations

from functools import cache
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from numpy_reference.cases import JOINT, ten_segments, tool_and_holder
from receptance import Assembly, Coordinate, Material, Part, PointJoint, Section, Segment, SpreadJoint

Array = NDArray[Any]

LOWEST_HZ, HIGHEST_HZ = 10.0, 10_000.0
# The four joint parameters in the reference's order.
JOINT_FIELDS = ("k_y", "k_theta", "c_y", "c_theta")
# The varied quantities of a segment and their columns in the reference's table.
SEGMENT_COLUMNS = {"length": 2, "outer_diameter": 3, "youngs_modulus": 5, "density": 6, "poisson_ratio": 7}
SEGMENT_PARAMETERS = 40


def sweep(count: int) -> tuple[Array, Array]:
    """Return frequency lines in Hz and in rad/s."""
    frequency_hz = np.linspace(LOWEST_HZ, HIGHEST_HZ, count)
    return frequency_hz, 2 * np.pi * frequency_hz


def part(table: Array, name: str) -> Part:
    """Return the part that a segment table of the reference describes (coreless, Cowper's shear coefficient)."""
    if np.any(table[:, 9:]):
        raise ValueError("the table has cores or another shear coefficient")
    return Part(
        [
            Segment(
                length=row[2],
                outer_diameter=row[3],
                inner_diameter=row[4],
                material=Material(youngs_modulus=row[5], density=row[6], poisson_ratio=row[7], loss_factor=row[8]),
            )
            for row in table
        ],
        name=name,
    )


def between_ends(free: Part, f: Array) -> Array:
    """Return the receptance of a free part over y and theta of both ends, `(n, 4, 4)`."""
    points = [Coordinate(position=position, direction=way) for position in (0.0, "end") for way in ("y", "theta")]
    return Assembly([free]).receptance(f, response=points, excitation=points, threads=1)


@cache
def chain() -> Assembly:
    """Return the ten-segment chain."""
    return Assembly([part(ten_segments(), "chain")])


@cache
def coupled() -> Assembly:
    """Return tool, joint and holder."""
    tool, holder = tool_and_holder()
    joint = PointJoint(**{field: getattr(JOINT, field) for field in JOINT_FIELDS}, name="joint")
    return Assembly([part(tool, "tool"), joint, part(holder, "holder")])


@cache
def spread(points: int | None) -> Assembly:
    """Return tool and holder with the joint spread along an insertion of 40 mm, as a layer or at points."""
    tool, holder = tool_and_holder()
    steel = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.29, loss_factor=0.01)
    joint = SpreadJoint(
        length=0.04,
        shank=Section(outer_diameter=0.012, material=steel),
        sleeve=Section(outer_diameter=0.04, inner_diameter=0.012, material=steel),
        points=points,
        **{field: getattr(JOINT, field) for field in JOINT_FIELDS},
        name="joint",
    )
    return Assembly([part(tool, "tool"), joint, part(holder, "holder")])


def joint_addresses() -> list[str]:
    """Return the addresses of the four joint parameters, in the reference's order."""
    return [f"joint.{field}" for field in JOINT_FIELDS]


def segment_addresses(assembly: Assembly) -> list[str]:
    """Return the addresses of the first `SEGMENT_PARAMETERS` parameters of segments."""
    found = (name for name in assembly.parameters if ".segment[" in name and name.rpartition(".")[2] in SEGMENT_COLUMNS)
    return list(islice(found, SEGMENT_PARAMETERS))
