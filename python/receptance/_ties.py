"""From an assembly to a model of the core as a function of addresses, for fits and sweeps that run in the core."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from receptance import _core
from receptance._addresses import interfaces_by_name
from receptance._flatten import MOTIONS
from receptance.assembly import Assembly
from receptance.beams import Part
from receptance.collet import ColletJoint
from receptance.joints import GroundSpring, PointJoint, PointMass, Resonator
from receptance.modal_parts import ModalPart
from receptance.spread import SpreadJoint
from receptance.terminals import MeasuredPart

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance._flatten import Flat
    from receptance.coordinates import Coordinate

__all__ = ["Tied", "tie"]

_KNOWN = (Part, PointJoint, ColletJoint, SpreadJoint, PointMass, GroundSpring, Resonator, ModalPart, MeasuredPart)
"""Elements whose table entries are sums of their parameters."""


class Tied(NamedTuple):
    """A model of the core, and how entries of its tables depend on addresses.

    Attributes
    ----------
    flat : Flat
        The tables of the assembly.
    motion : int
        The core's number of the motion.
    rates : ndarray
        `(k, 5)` table, row, column, number of the address, rate.
    present : ndarray
        `(m,)` value of each address in the assembly; zero for addresses that no table has.
    points : ndarray
        `(n, 2)` node and direction of the coordinates.
    powers : ndarray
        `(n, 4)` table, row, column and power of the frequency, for entries through which frequency acts.
    """

    flat: Flat
    motion: int
    rates: NDArray[np.float64]
    present: NDArray[np.float64]
    points: NDArray[np.float64]
    powers: NDArray[np.float64]

    def model(self, addresses: NDArray[np.float64], factors: NDArray[np.float64]) -> _core.TiedModel:
        """Return the model as a function of unknowns; `addresses` and `factors` as in `_core.Model.tied`."""
        with interfaces_by_name(self.flat):
            return self.flat.model(self.motion).tied(self.rates, self.present, addresses, factors, self.powers)

    @property
    def key(self) -> tuple[bytes, ...]:
        """Bytes that are equal for equal models."""
        arrays = (*self.flat.tables, self.rates, self.present, self.points, self.powers)
        measured = (array for _, part in self.flat.tabled for array in (part.frequency_hz, part.matrix))
        return (bytes([self.motion]), *(array.tobytes() for array in (*arrays, *measured)))


def tie(
    assembly: Assembly,
    addresses: Sequence[str],
    points: tuple[Coordinate, ...] = (),
    *,
    others: Collection[str] = (),
    powers: Mapping[str, float] | None = None,
) -> Tied | None:
    """Return the model as a function of addresses; None where an element is not that simple.

    `others` are addresses that no table has; `powers` are those through which frequency acts, with its power.
    """
    elements = {**assembly.elements, **assembly.attachments}
    if type(assembly) is not Assembly or any(type(one) not in _KNOWN for one in elements.values()):
        return None
    flat = assembly._flatten(points)
    rates = [
        (*entry[:3], index, entry[3])
        for index, address in enumerate(addresses)
        if address not in others
        for entry in assembly._entries(address, flat)
    ]
    present = [0.0 if address in others else assembly.get(address) for address in addresses]
    acting = [(*entry[:3], n) for address, n in (powers or {}).items() for entry in assembly._entries(address, flat)]
    return Tied(
        flat=flat,
        motion=MOTIONS[assembly.motion],
        rates=np.array(rates, dtype=np.float64).reshape(-1, 5),
        present=np.array(present, dtype=np.float64),
        points=assembly._points(flat, points),
        powers=np.array(acting, dtype=np.float64).reshape(-1, 4),
    )
