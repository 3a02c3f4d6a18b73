"""Checks of measured blanks, and receptances of the free blanks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.pointwise_joint import TERMS, Equations
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring
from receptance.model.terminals import Terminal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.observations import MeasuredFRF
    from receptance.model.assembly import Assembly

__all__ = ["Blanks", "check_bands", "check_blanks", "plane_of"]


def plane_of(assembly: Assembly) -> tuple[Coordinate, Coordinate]:
    """Return the coordinates y and theta at the connection plane, the far end of the last part."""
    last = list(assembly.elements)[-1]
    return Coordinate(last, "end", "y"), Coordinate(last, "end", "theta")


def check_blanks(observed: tuple[MeasuredFRF, ...]) -> None:
    """Raise `ValueError` if an assembly is not a free blank in bending."""
    for index, one in enumerate(observed):
        assembly, owner = one.assembly, one.label or f"observations[{index}]"
        if isinstance(list(assembly.elements.values())[-1], Terminal):
            raise ValueError(
                f"{owner}: its assembly ends with a spindle, expected the blank alone, whose receptance is subtracted"
            )
        if assembly.motion != "bending":
            raise ValueError(f"{owner}: its assembly is in {assembly.motion} motion, expected bending")
        grounded = [name for name, point in assembly.attachments.items() if isinstance(point, GroundSpring)]
        if grounded:
            raise ValueError(f"{owner}: its assembly has the ground spring {grounded[0]!r}, expected a free blank")


def check_bands(observed: tuple[MeasuredFRF, ...]) -> None:
    """Raise `ValueError` if the bands of the observations have no common part."""
    bands = [(one.frequency_hz[0].real, one.frequency_hz[-1].real) for one in observed]
    first, last = int(np.argmin([high for _, high in bands])), int(np.argmax([low for low, _ in bands]))
    if bands[last][0] > bands[first][1]:
        raise ValueError(
            f"the bands do not overlap: {observed[first]!r} and {observed[last]!r}; each line needs "
            "all observations, so measure every blank in the same band"
        )


@dataclass(frozen=True)
class Blanks:
    """Receptances of free blanks between their coordinates and the connection plane.

    Attributes
    ----------
    lines : ndarray
        `(n,)` frequency lines in Hz.
    free : ndarray
        `(n, p)` receptance between the coordinates of each observation, SI units.
    response, excitation : ndarray
        `(n, p, 2)` receptance between y and theta at the plane and either coordinate.
    plane : ndarray
        `(n, p, 2, 2)` receptance at the plane over (y, theta).
    """

    lines: NDArray[Any]
    free: NDArray[np.complex128]
    response: NDArray[np.complex128]
    excitation: NDArray[np.complex128]
    plane: NDArray[np.complex128]

    @classmethod
    def of(cls, observed: tuple[MeasuredFRF, ...], lines: NDArray[Any], threads: int | None) -> Blanks:
        """Evaluate each distinct blank once, at all its coordinates."""
        count = len(observed)
        free = np.empty((lines.size, count), dtype=np.complex128)
        sides = np.empty((2, lines.size, count, 2), dtype=np.complex128)
        plane = np.empty((lines.size, count, 2, 2), dtype=np.complex128)
        left = list(range(count))
        while left:
            assembly = observed[left[0]].assembly
            same = [i for i in left if observed[i].assembly == assembly]
            ends = plane_of(assembly)
            points = list(
                dict.fromkeys([*ends, *(p for i in same for p in (observed[i].response, observed[i].excitation))])
            )
            h = assembly.receptance(lines, response=points, excitation=points, threads=threads)
            for i in same:
                out, into = points.index(observed[i].response), points.index(observed[i].excitation)
                free[:, i] = h[:, out, into]
                sides[0, :, i], sides[1, :, i] = h[:, out, :2], h[:, :2, into]
                plane[:, i] = h[:, :2, :2]
            left = [i for i in left if i not in same]
        return cls(lines, free, sides[0], sides[1], plane)

    def equations(self, observed: tuple[MeasuredFRF, ...], rows: list[NDArray[np.intp]]) -> Equations:
        """Return the equations for the receptance of the spindle, which have the form of those of a joint."""
        pairs = list(zip(observed, rows, strict=True))
        return Equations(
            rigid=self.free,
            measured=np.stack([one.receptance[row] for one, row in pairs], axis=1),
            response=-self.response,
            excitation=self.excitation,
            surroundings=self.plane,
            deviation=np.stack([np.asarray(one.standard_deviation)[row] for one, row in pairs], axis=1),
            known=np.zeros((self.lines.size, 2, 2), dtype=np.complex128),
            angular_frequency=2.0 * np.pi * self.lines.astype(np.complex128),
            terms=tuple(TERMS),
        )
