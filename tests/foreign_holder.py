"""Three CSV files of a foreign beam model: an end mill in the drawn holder at three overhangs, and the drawing.

Thin cylinders, each a finite element of NumPy: the radii of the holder are those of the numbers and arcs from which
`drawn_holder` draws it, the section of the flutes is an own polygon with its own integrals. No code of the package is
imported.

    python tests/foreign_holder.py FOLDER

writes the files of the packaged example drawing, apart from its campaign.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

import drawn_holder
from blind.generator.elements import cowper
from foreign_beam import GRAVITY, measured

FloatArray = NDArray[np.float64]

SEED = 20261129
JOINT = {"joint.k_y": 2.4e8, "joint.k_theta": 4.2e4, "joint.c_y": 250.0, "joint.c_theta": 0.05}
"""True joint in SI units."""
SENSOR_KG = 0.6e-3
OVERHANGS_MM = (45.0, 60.0, 75.0)
"""The last one is held out by the campaign."""
INSERTION_MM, FLUTES_MM = 36.0, 26.0
DIAMETER_MM, CORE_MM, FLUTES = 12.0, 7.2, 4
LINES_HZ = np.arange(300.0, 6500.5, 10.0)
NOISE = 0.01
"""Standard deviation of the noise of one hit, over the magnitude of the FRF."""
ELEMENT_MM = 0.05
FLUTE_SHEAR = 0.7672
"""Shear coefficient of the fluted section: that of the energy (Pilkey 2002), by sectionproperties 3.10.2 of the polygon
below with 60 points on each arc at a Poisson ratio of 0.213; Cowper's, which the package has by default, is larger."""


@dataclass(frozen=True)
class Material:
    """A material: modulus in Pa, density in kg/m^3."""

    modulus: float
    density: float
    poisson: float
    loss: float


# Not the listed values of the campaign: each differs by about half of the listed standard deviation.
CARBIDE = Material(585e9, 14490.0, 0.213, 0.0012)
STEEL = Material(208.5e9, 7855.0, 0.29, 0.0008)


def fluted_polygon(per_arc: int = 4000, core_mm: float = CORE_MM) -> FloatArray:
    """Return the corners of the section in m: the back of each tooth an arc from the core, each flute half a circle.

    With R, R_c the radii of diameter and core, the back is an arc about a point on the line to the edge at the distance
    a = (R^2 - R_c^2) / (2 R) from the axis, for four flutes.
    """
    outer, core = 0.5e-3 * DIAMETER_MM, 0.5e-3 * core_mm
    a = (outer**2 - core**2) / (2.0 * outer)
    # In polar coordinates about the axis, theta from the start of the sector to the edge at 90 deg.
    theta = np.linspace(0.0, 0.5 * math.pi, per_arc, endpoint=False)
    distance = a * np.sin(theta) + np.sqrt((outer - a) ** 2 - (a * np.cos(theta)) ** 2)
    back = distance * np.exp(1j * (theta - 0.5 * math.pi))
    turn = np.exp(-1j * np.linspace(0.0, math.pi, per_arc, endpoint=False))
    flute = 0.5 * (outer + core) + 0.5 * (outer - core) * turn
    tooth = np.concatenate([back, flute])
    corners = np.concatenate([tooth * 1j**number for number in range(FLUTES)])
    return np.stack([corners.real, corners.imag], axis=1)


def integrals(corners: FloatArray) -> tuple[float, float]:
    """Return area and second moment int y^2 dA of a polygon, by Green's theorem."""
    x, y = corners.T
    far_x, far_y = np.roll(x, -1), np.roll(y, -1)
    cross = x * far_y - far_x * y
    return float(cross.sum() / 2.0), float((cross * (y**2 + y * far_y + far_y**2)).sum() / 12.0)


def outer_radius(x_mm: FloatArray) -> FloatArray:
    """Return the radius of the drawn profile in mm."""
    radius = np.zeros_like(x_mm)
    for (x, r, bulge), (far_x, far_r, _) in zip(drawn_holder.PROFILE, drawn_holder.PROFILE[1:], strict=False):
        if far_x == x:
            continue
        inside = (x_mm > x) & (x_mm < far_x)
        share = (x_mm[inside] - x) / (far_x - x)
        if bulge:
            # A quarter of a circle that turns to the left: horizontal at its start, with the centre above it.
            radius[inside] = far_r - np.sqrt((far_r - r) ** 2 - (x_mm[inside] - x) ** 2)
        else:
            radius[inside] = r + share * (far_r - r)
    return radius


def bore_radius(x_mm: FloatArray) -> FloatArray:
    """Return the radius of the drawn bores in mm, zero outside of them."""
    return np.sum(
        [np.interp(x_mm, *zip(*bore, strict=True), left=0.0, right=0.0) for bore in drawn_holder.BORES], axis=0
    )


class Row:
    """A row of thin elements: stiffnesses in bending and shear, mass and rotary inertia, each per length."""

    def __init__(self, length_mm: float) -> None:
        count = round(length_mm / ELEMENT_MM)
        self.middle_mm = (np.arange(count) + 0.5) * length_mm / count
        self.length = 1e-3 * length_mm / count
        self.bending, self.shear = np.zeros((2, count), np.complex128)
        self.mass, self.rotary = np.zeros((2, count))

    def add(self, area: FloatArray, second: FloatArray, kappa: FloatArray, material: Material) -> None:
        """Add a section, which moves with those that are there."""
        modulus = material.modulus * (1.0 + 1j * material.loss)
        self.bending += modulus * second
        self.shear += kappa * area * modulus / (2.0 * (1.0 + material.poisson))
        self.mass += material.density * area
        self.rotary += material.density * second

    def rings(self, outer_mm: FloatArray, inner_mm: FloatArray, material: Material) -> None:
        """Add rings; those of diameter 0 are none."""
        outer, inner = 1e-3 * outer_mm, 1e-3 * inner_mm
        kappa = np.array(
            [cowper(a, b, material.poisson) if a > 0.0 else 0.0 for a, b in zip(outer, inner, strict=True)]
        )
        self.add(math.pi / 4.0 * (outer**2 - inner**2), math.pi / 64.0 * (outer**4 - inner**4), kappa, material)


def tool(overhang_mm: float) -> Row:
    """Return the end mill outside of the holder."""
    row = Row(overhang_mm)
    fluted = row.middle_mm < FLUTES_MM
    area, second = integrals(fluted_polygon())
    row.add(fluted * area, fluted * second, fluted * FLUTE_SHEAR, CARBIDE)
    row.rings(np.where(fluted, 0.0, DIAMETER_MM), np.zeros(fluted.size), CARBIDE)
    return row


def holder() -> Row:
    """Return the holder with the shank in its bore."""
    row = Row(drawn_holder.PROFILE[-1][0])
    bore = 2.0 * bore_radius(row.middle_mm)
    row.rings(2.0 * outer_radius(row.middle_mm), bore, STEEL)
    row.rings(np.where(row.middle_mm < INSERTION_MM, DIAMETER_MM, 0.0), np.zeros(bore.size), CARBIDE)
    return row


def bands(rows: list[Row]) -> tuple[NDArray[np.complex128], FloatArray]:
    """Return stiffness and mass `(7, n)` of rows that are not connected, as diagonals for `solve_banded`.

    An element has linear displacements and slopes, the shear strain in its middle, and the flexibility h^2 / (12 E I)
    added to that of shear, with which the element is exact for loads at its ends (MacNeal, Computers & Structures 8,
    1978, 175).
    """
    size = 2 * sum(row.mass.size + 1 for row in rows)
    stiffness, mass = np.zeros((7, size), np.complex128), np.zeros((7, size))
    first = 0
    for row in rows:
        h = row.length
        shear = 1.0 / (1.0 / row.shear + h**2 / (12.0 * row.bending))
        strain = np.array([-1.0 / h, -0.5, 1.0 / h, -0.5])  # y' - theta
        curvature = np.array([0.0, -1.0 / h, 0.0, 1.0 / h])
        for i in range(4):
            for j in range(4):
                columns = first + j + 2 * np.arange(row.mass.size)
                np.add.at(
                    stiffness,
                    (3 + i - j, columns),
                    h * (shear * strain[i] * strain[j] + row.bending * curvature[i] * curvature[j]),
                )
                if (i - j) % 2 == 0:
                    share = h / 3.0 if i == j else h / 6.0
                    np.add.at(mass, (3 + i - j, columns), share * (row.rotary if i % 2 else row.mass))
        first += 2 * (row.mass.size + 1)
    return stiffness, mass


def accelerance(overhang_mm: float, lines_hz: FloatArray = LINES_HZ) -> NDArray[np.complex128]:
    """Return acceleration over force at the tip in g/N, with the sensor there; the holder hangs free."""
    rows = [tool(overhang_mm), holder()]
    stiffness, mass = bands(rows)
    mass[3, 0] += SENSOR_KG
    mouth = 2 * rows[0].mass.size
    load = np.zeros((mass.shape[1], 5))
    load[0, 0] = 1.0
    load[[mouth, mouth + 1, mouth + 2, mouth + 3], [1, 2, 3, 4]] = 1.0
    across = np.array([[1.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]])
    ends = [0, mouth, mouth + 1, mouth + 2, mouth + 3]
    response = np.empty(lines_hz.size, np.complex128)
    for number, w in enumerate(2.0 * np.pi * lines_hz):
        # Parts apart from each other; the joint closes the gap between them.
        parts = solve_banded((3, 3), stiffness - w**2 * mass, load)[ends]
        joint = np.diag(
            [JOINT["joint.k_y"] + 1j * w * JOINT["joint.c_y"], JOINT["joint.k_theta"] + 1j * w * JOINT["joint.c_theta"]]
        )
        gap = across @ parts[1:, 0]
        inner = np.linalg.inv(joint) + across @ parts[1:, 1:] @ across.T
        response[number] = -(w**2) * (parts[0, 0] - parts[0, 1:] @ across.T @ np.linalg.solve(inner, gap)) / GRAVITY
    return response


def table(overhang_mm: float, generator: np.random.Generator) -> str:
    """Return the contents of the file of one overhang."""
    values, coherence = measured(accelerance(overhang_mm), generator, noise=NOISE)
    rows = [
        f"{f:g},{h.real:.5e},{h.imag:.5e},{c:.6f}" for f, h, c in zip(LINES_HZ, values, coherence, strict=True)
    ]  # fmt: skip
    return "\n".join(["Frequency [Hz],Real [g/N],Imag [g/N],Coherence", *rows]) + "\n"


def write(folder: Path, seed: int = SEED) -> list[Path]:
    """Write the drawing and the three files, and return their paths."""
    generator = np.random.default_rng(seed)
    paths = [drawn_holder.write(folder / "holder.dxf")]
    for overhang in OVERHANGS_MM:
        paths.append(folder / f"mill_{overhang:g}mm.csv")
        paths[-1].write_text(table(overhang, generator), encoding="utf-8")
    return paths


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    for path in write(parser.parse_args().folder):
        print(path)
