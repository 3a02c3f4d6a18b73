"""Why cones are power series: what a Magnus integrator of fourth order would need, ``python benches/magnus.py``.

The integrator without commutators (Blanes and Moan, Appl. Numer. Math. 56 (2006) 1519) passes a slice by two
exponentials of constant matrices, each of which is a cylinder of half the slice's length with a mean of the
coefficients in its two Gauss points: no new algebra, and the cost of two cylinders a slice. The table has the
relative difference of the receptance at the near end, one line each, from that of the core, which agrees with a
solution in 30 digits to 1e-12.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

import cones
from receptance import Segment

SLICES = (6, 16, 32, 64, 96)
LINES = (1e3, 50e3)
NEAR, FAR = 0.25 - np.sqrt(3.0) / 6.0, 0.25 + np.sqrt(3.0) / 6.0
"""Weights of the two Gauss points in an exponent."""


def coefficients(cone: Segment, share: float, w: float) -> NDArray[np.complex128]:
    """Return A of s' = A s at a share of the length, s = (y, theta, V, M), with Cowper's shear coefficient."""
    outer, inner = cone.at(share)
    material = cone.material
    area, moment = np.pi / 4.0 * (outer**2 - inner**2), np.pi / 64.0 * (outer**4 - inner**4)
    nu, square = material.poisson_ratio, (inner / outer) ** 2
    ring = (1.0 + square) ** 2
    kappa = 6.0 * (1.0 + nu) * ring / ((7.0 + 6.0 * nu) * ring + (20.0 + 12.0 * nu) * square)
    modulus = material.youngs_modulus * (1.0 + 1j * material.loss_factor)
    out = np.zeros((4, 4), dtype=np.complex128)
    out[0, 1], out[0, 2] = 1.0, 2.0 * (1.0 + nu) / (kappa * modulus * area)
    out[1, 3] = 1.0 / (modulus * moment)
    out[2, 0] = -(w**2) * material.density * area
    out[3, 1], out[3, 2] = -(w**2) * material.density * moment, -1.0
    return out


def receptance(cone: Segment, frequency_hz: float, slices: int) -> complex:
    """Return y per load at the near end of a free cone by the integrator."""
    transfer, h = np.eye(4, dtype=np.complex128), 1.0 / slices
    for number in range(slices):
        gauss = [number + 0.5 - np.sqrt(3.0) / 6.0, number + 0.5 + np.sqrt(3.0) / 6.0]
        first, second = (coefficients(cone, h * point, 2.0 * np.pi * frequency_hz) for point in gauss)
        for exponent in (FAR * first + NEAR * second, NEAR * first + FAR * second):
            transfer = expm(h * cone.length * exponent) @ transfer
    # No forces at the far end; the load at the near end is minus the internal force.
    motion = np.linalg.solve(transfer[2:, :2], transfer[2:, 2])
    return complex(motion[0])


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description="A Magnus integrator of fourth order along cones.")
    parser.add_argument("--slices", type=int, nargs="+", default=SLICES, metavar="N", help="numbers of slices")
    options = parser.parse_args(arguments)
    print(f"{'slices (each costs two cylinders)':<36}" + "".join(f"{count:>9}" for count in options.slices))
    for name, cone in cones.CONES.items():
        exact = cones.free(cone).receptance(LINES).ravel()
        for line, value in zip(LINES, exact, strict=True):
            errors = [abs(receptance(cone, line, count) / value - 1.0) for count in options.slices]
            print(f"{name:<28}{line:>6g} Hz" + "".join(f"{error:>9.0e}" for error in errors))
    return 0


if __name__ == "__main__":
    sys.exit(main())
