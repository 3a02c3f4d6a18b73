"""Checks of measured blanks, and the equations between their responses and the spindle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from receptance.coupling.line_equations import TERMS, Equations
from receptance.fit.observation import Observation
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring
from receptance.model.terminals import Terminal


def plane_of(assembly: Assembly) -> tuple[Coordinate, Coordinate]:
    """Return the coordinates y and theta at the connection plane, the far end of the last part."""
    part = list(assembly.elements)[-1]
    return Coordinate(part, "end", "y"), Coordinate(part, "end", "theta")


def check_blanks(observed: tuple[Observation, ...]) -> None:
    """Raise `ValueError` if an assembly is not a free blank in bending."""
    for index, observation in enumerate(observed):
        assembly, owner = observation.assembly, observation.label or f"observations[{index}]"
        if isinstance(list(assembly.elements.values())[-1], Terminal):
            raise ValueError(
                f"{owner}: its assembly ends with a spindle, expected the blank alone, whose receptance is subtracted"
            )
        if assembly.motion != "bending":
            raise ValueError(f"{owner}: its assembly is in {assembly.motion} motion, expected bending")
        grounded = [name for name, point in assembly.attachments.items() if isinstance(point, GroundSpring)]
        if grounded:
            raise ValueError(f"{owner}: its assembly has the ground spring {grounded[0]!r}, expected a free blank")


def blank_equations(
    observed: tuple[Observation, ...], lines: NDArray[np.inexact], rows: list[NDArray[np.intp]], threads: int | None
) -> Equations:
    """Return the equations for the receptance of the spindle, which have the form of those of a joint.

    The assemblies of the observations are the free blanks; `rows` are the indices of the common lines `(n,)` in each
    observation. The force in a rigid joint corresponds to the receptance between the connection plane and a coordinate
    of the free blank (with opposite sign for the response), the dynamic stiffness to the receptance at the plane. Each
    distinct blank is evaluated once, at all its coordinates.
    """
    count = len(observed)
    free = np.empty((lines.size, count), dtype=np.complex128)
    response = np.empty((lines.size, count, 2), dtype=np.complex128)
    excitation = np.empty((lines.size, count, 2), dtype=np.complex128)
    plane = np.empty((lines.size, count, 2, 2), dtype=np.complex128)
    remaining = list(range(count))
    while remaining:
        blank = observed[remaining[0]].assembly
        same = [i for i in remaining if observed[i].assembly == blank]
        coordinates = [point for i in same for point in (observed[i].response, observed[i].excitation)]
        points = list(dict.fromkeys([*plane_of(blank), *coordinates]))
        h = blank.receptance(lines, response=points, excitation=points, threads=threads)
        for i in same:
            out, into = points.index(observed[i].response), points.index(observed[i].excitation)
            free[:, i] = h[:, out, into]
            response[:, i], excitation[:, i] = h[:, out, :2], h[:, :2, into]
            plane[:, i] = h[:, :2, :2]
        remaining = [i for i in remaining if i not in same]
    pairs = list(zip(observed, rows, strict=True))
    return Equations(
        rigid=free,
        measured=np.stack([observation.receptance[row] for observation, row in pairs], axis=1),
        response=-response,
        excitation=excitation,
        surroundings=plane,
        deviation=np.stack([np.asarray(observation.standard_deviation)[row] for observation, row in pairs], axis=1),
        known=np.zeros((lines.size, 2, 2), dtype=np.complex128),
        angular_frequency=2.0 * np.pi * lines.astype(np.complex128),
        terms=tuple(TERMS),
    )
