"""From an assembly to the core's tables as functions of addresses, for fits that run in the core."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from receptance.assembly import Assembly
from receptance.beams import Part
from receptance.collet import ColletJoint
from receptance.joints import GroundSpring, PointJoint, PointMass
from receptance.spread import SpreadJoint

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate

__all__ = ["Tied", "tie"]

_KNOWN = (Part, PointJoint, ColletJoint, SpreadJoint, PointMass, GroundSpring)
"""Elements whose table entries are sums of their parameters."""


class Tied(NamedTuple):
    """The tables of an assembly: `tables` and, added to their entries, rate times value of addresses.

    Attributes
    ----------
    tables : tuple of ndarray
        Segments, joints, masses, grounds and overlaps, less what the addresses make of them.
    rates : ndarray
        `(k, 5)` table, row, column, number of the address, rate.
    points : ndarray
        `(n, 2)` node and direction of the coordinates.
    powers : ndarray
        `(n, 4)` table, row, column and power of the frequency, for entries through which frequency acts.
    """

    tables: tuple[NDArray[np.float64], ...]
    rates: NDArray[np.float64]
    points: NDArray[np.float64]
    powers: NDArray[np.float64]


def tie(
    assembly: Assembly,
    addresses: Sequence[str],
    points: tuple[Coordinate, ...] = (),
    *,
    others: Collection[str] = (),
    powers: Mapping[str, float] | None = None,
) -> Tied | None:
    """Return the tables as functions of addresses; None where an element is not that simple.

    `others` are addresses that no table has; `powers` are those through which frequency acts, with its power.
    """
    elements = {**assembly.elements, **assembly.attachments}
    if type(assembly) is not Assembly or any(type(one) not in _KNOWN for one in elements.values()):
        return None
    if assembly.motion != "bending":
        return None
    flat = assembly._flatten(points)
    # Those of an assembly are made once and belong to it.
    tables = tuple(table.copy() for table in (*flat.tables(), flat.beside()))
    rates = [
        (*entry[:3], index, entry[3])
        for index, address in enumerate(addresses)
        if address not in others
        for entry in assembly._entries(address, flat)
    ]
    for table, row, column, index, rate in rates:
        tables[table][row, column] -= rate * assembly.get(addresses[index])
    acting = [(*entry[:3], n) for address, n in (powers or {}).items() for entry in assembly._entries(address, flat)]
    return Tied(
        tables=tables,
        rates=np.array(rates, dtype=np.float64).reshape(-1, 5),
        points=assembly._points(flat, points),
        powers=np.array(acting, dtype=np.float64).reshape(-1, 4),
    )
