"""A virtual BT50 rig by finite elements: an elastic holder on contact that is spread over its taper.

It does not use the library. The holder has the taper of JIS B 6339 BT50 (gauge diameter 69.85 mm, 7/24, 101.8 mm
long, flange 100 mm) and is cut into short elements whose section follows the cone; rods for the motion along, two-node
Timoshenko beams for the motion across. Each node on the taper stands on a spring and a dashpot to a rigid spindle; they
are not evenly spread (the ends carry more, and the big end more than the small one). How the contact depends on the
drawbar force is made up, so that what the paper reports of its measurements comes about: axially 4.8e9 to 5.0e9 N/m if
the holder is taken as rigid, with a slope that rises, across with a slope that falls, damping rising along and falling
across. `python tests/bt50_rig.py` writes the table that the examples read.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

import finite_elements

FloatArray = NDArray[np.float64]

YOUNG, DENSITY, NU = 208e9, 7850.0, 0.29
NOSE = ((0.045, 0.060), (0.035, 0.100), (0.003, 0.06985))
"""From the tip, length and diameter in m: the nose of a collet chuck, the flange, the gap to the gauge line."""
GAUGE, TAPER_LENGTH = 0.06985, 0.1018
SMALL = GAUGE - TAPER_LENGTH * 7.0 / 24.0
STUD = (0.035, 0.025)
BIG_END = sum(length for length, _ in NOSE)
SMALL_END = BIG_END + TAPER_LENGTH
FORCES_KN = tuple(float(f) for f in range(26))
ELEMENT = 0.001
HIT_ACROSS = 0.010
SEEN_ACROSS = (0.010, 0.050)
HIGHEST_HZ = 60e3
MODES = 40


def axial_contact(force_kn: float) -> tuple[float, float]:
    """Stiffness in N/m and damping in N s/m along, of the whole taper."""
    x = force_kn / 25.0
    return 5.41e9 * (1.0 + 0.048 * x**1.6), 1300.0 + 1100.0 * x**0.8


def radial_contact(force_kn: float) -> tuple[float, float]:
    """The same across."""
    x = force_kn / 25.0
    return 2.4e9 * (1.0 + 0.35 * x**0.6), 13000.0 - 4500.0 * x**0.7


@dataclass(frozen=True)
class Mesh:
    """Nodes along the holder, sections of the elements between them, and the nodes' shares of the contact."""

    element: float = ELEMENT

    @cached_property
    def nodes(self) -> FloatArray:
        edges = np.cumsum([0.0, *(length for length, _ in NOSE), TAPER_LENGTH, STUD[0]])
        pieces = [np.linspace(a, b, max(2, round((b - a) / self.element) + 1))[:-1] for a, b in pairwise(edges)]
        places = (HIT_ACROSS, *SEEN_ACROSS)
        return np.unique(np.round(np.concatenate([*pieces, edges[-1:], places]), 9))

    @cached_property
    def diameters(self) -> FloatArray:
        middle = 0.5 * (self.nodes[1:] + self.nodes[:-1])
        cone = GAUGE - (middle - BIG_END) * 7.0 / 24.0
        edges = np.cumsum([length for length, _ in NOSE])
        outside = np.array([diameter for _, diameter in NOSE])[
            np.minimum(np.searchsorted(edges, middle), len(NOSE) - 1)
        ]
        return np.where(middle < BIG_END, outside, np.where(middle < SMALL_END, cone, STUD[1]))

    @cached_property
    def shares(self) -> FloatArray:
        """Of the contact; they sum to one."""
        s = (0.5 * (self.nodes[1:] + self.nodes[:-1]) - BIG_END) / TAPER_LENGTH
        weight = np.where((s > 0.0) & (s < 1.0), (0.8 + 0.6 * (2.0 * s - 1.0) ** 2) * (1.25 - 0.5 * s), 0.0)
        of_elements = weight * np.diff(self.nodes)
        found = np.zeros(self.nodes.size)
        found[1:] += 0.5 * of_elements
        found[:-1] += 0.5 * of_elements
        return found / found.sum()

    def rods(self) -> tuple[FloatArray, FloatArray]:
        """Mass and stiffness of the free holder along."""
        n = self.nodes.size
        mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
        for i, (length, area) in enumerate(zip(np.diff(self.nodes), np.pi / 4.0 * self.diameters**2, strict=True)):
            both = slice(i, i + 2)
            stiffness[both, both] += YOUNG * area / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
            mass[both, both] += DENSITY * area * length / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        return mass, stiffness

    def beams(self) -> tuple[FloatArray, FloatArray]:
        """Mass and stiffness of the free holder across: displacement and slope at each node."""
        n = 2 * self.nodes.size
        mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
        for i, (length, d) in enumerate(zip(np.diff(self.nodes), self.diameters, strict=True)):
            own = slice(2 * i, 2 * i + 4)
            k, m = finite_elements.element(length, d, young=YOUNG, density=DENSITY, nu=NU)
            stiffness[own, own] += k
            mass[own, own] += m
        return mass, stiffness


@dataclass(frozen=True)
class Poles:
    """H(s) = rest + sum of A / (s - p) + conj(A) / (s - conj(p)) at each response."""

    poles: NDArray[np.complex128]
    residues: NDArray[np.complex128]
    """`(n_modes, n_responses)`."""
    rest: FloatArray
    """`(n_responses,)`, of the modes above."""

    def receptance(self, frequency_hz: FloatArray) -> NDArray[np.complex128]:
        s = 2j * np.pi * np.asarray(frequency_hz)[:, None, None]
        terms = self.residues / (s - self.poles[:, None]) + self.residues.conj() / (s - self.poles.conj()[:, None])
        return terms.sum(axis=1) + self.rest


def poles_of(mesh: Mesh, motion: str, force_kn: float) -> Poles:
    """Poles of the rig up to HIGHEST_HZ for the hit of a motion, "axial" or "radial"."""
    axial = motion == "axial"
    mass, stiffness = mesh.rods() if axial else mesh.beams()
    k, c = axial_contact(force_kn) if axial else radial_contact(force_kn)
    step = 1 if axial else 2
    own = np.arange(mesh.nodes.size) * step
    stiffness[own, own] += k * mesh.shares
    damping = np.zeros(len(mass))
    damping[own] = c * mesh.shares
    places = (0.0,) if axial else SEEN_ACROSS
    hit = own[np.argmin(np.abs(mesh.nodes - (0.0 if axial else HIT_ACROSS)))]
    rows = [own[np.argmin(np.abs(mesh.nodes - x))] for x in places]
    squares, shapes = linalg.eigh(stiffness, mass, subset_by_index=[0, MODES - 1])
    n = squares.size
    first_order = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(squares), -(shapes.T * damping) @ shapes]])
    values, right = np.linalg.eig(first_order)
    drive = np.linalg.solve(right, np.concatenate([np.zeros(n), shapes[hit]]))
    residues = (shapes[rows] @ right[:n] * drive).T
    keep = np.flatnonzero((values.imag > 0.0) & (np.abs(values) < 2.0 * np.pi * HIGHEST_HZ))
    keep = keep[np.argsort(np.abs(values[keep]))]
    load = np.zeros(len(mass))
    load[hit] = 1.0
    static = linalg.solve(stiffness, load, assume_a="pos")[rows]
    poles, residues = values[keep], residues[keep]
    return Poles(poles, residues, static + 2.0 * np.sum((residues / poles[:, None]).real, axis=0))


def table() -> str:
    """The rows of the packaged file."""
    lines = [
        "# Virtual BT50 rig, not measured: poles and residues by finite elements, written by tests/bt50_rig.py.",
        "# receptance = rest + sum of residue / (s - pole) + conjugates, s = i w; mode 0 is the rest (modes above "
        f"{HIGHEST_HZ / 1e3:g} kHz).",
        "# axial: hit and seen at the end face; radial: hit at "
        f"{1e3 * HIT_ACROSS:g} mm and seen at {' and '.join(f'{1e3 * x:g}' for x in SEEN_ACROSS)} mm from the tip.",
        "force_kn,motion,mode,pole_real,pole_imag,residue_1_real,residue_1_imag,residue_2_real,residue_2_imag",
    ]
    mesh = Mesh()
    for force in FORCES_KN:
        for motion in ("axial", "radial"):
            found = poles_of(mesh, motion, force)
            rows = [(0j, found.rest.astype(complex)), *zip(found.poles, found.residues, strict=True)]
            for mode, (pole, residues) in enumerate(rows):
                numbers = [pole.real, pole.imag]
                for residue in residues:
                    numbers += [residue.real, residue.imag]
                cells = [f"{value:.10g}" for value in numbers] + [""] * (6 - len(numbers))
                lines.append(",".join([f"{force:g}", motion, str(mode), *cells]))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(table())
