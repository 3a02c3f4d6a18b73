"""Many joints between one tool and one holder: receptances and misfits, everything else hoisted.

N and D of `joint` with k = k0 + i w c are sums of at most eight functions of the line, real factors of which the joint
has: for many joints on many lines that is a real matrix product, which NumPy hands to BLAS. Lines and joints go in
blocks that stay in the cache, and nothing is allocated within them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .joint import Substructures
from .segment import Complex, Real

# Lines and joints of a block: N and D of both take half a megabyte.
LINES, JOINTS = 1024, 16


class JointSweep:
    """Receptances of many joints (m, 4): k_y, k_theta, c_y, c_theta.

    Parameters
    ----------
    angular_frequency : (n,) real.
    substructures : tool and holder.
    viscous : whether any joint has dashpots.
    measured : (n,) what misfits compare with, 1 if not given.
    """

    def __init__(
        self, angular_frequency: Real, substructures: Substructures, viscous: bool, measured: Complex | None = None
    ) -> None:
        w = np.asarray(angular_frequency, dtype=np.float64)
        planes = np.empty((12, w.size), dtype=np.complex128)
        substructures(w, planes, w.size)
        # With k1 = k_y + i w c_y and k2 likewise: columns of k_y k_theta, k_theta, k_y, 1, then those of the dashpots.
        above, below = planes[:4].copy(), planes[4:8].copy()
        if measured is not None:
            below *= measured
        sides = []
        for f in (above, below):
            columns = [f[0], f[1], f[2], f[3]]
            if viscous:
                columns += [1j * w * f[0], -(w**2) * f[0], 1j * w * f[1], 1j * w * f[2]]
            sides.append(np.array(columns))
        self._viscous = viscous
        self._lines = w.size
        # By blocks of lines: (columns, real and imaginary parts of all lines of N, then of D).
        self._blocks = [
            np.ascontiguousarray(np.hstack([side[:, start : start + LINES] for side in sides])).view(np.float64)
            for start in range(0, w.size, LINES)
        ]
        self._both = np.empty((JOINTS, 4 * LINES))
        self._room = np.empty((3, JOINTS, LINES))

    def _factors(self, joints: Real) -> Real:
        ky, kt, cy, ct = joints.T
        columns = [ky * kt, kt, ky, np.ones(len(joints))]
        if self._viscous:
            columns += [ky * ct + kt * cy, cy * ct, ct, cy]
        return np.ascontiguousarray(np.array(columns).T)

    def _quotients(self, joints: Real, starts: range):
        """Yield N and D of each block, with the slices of joints and lines."""
        factors = self._factors(joints)
        for first in range(0, len(joints), JOINTS):
            rows = slice(first, min(first + JOINTS, len(joints)))
            own = factors[rows]
            for start, block in zip(starts, self._blocks, strict=True):
                count = block.shape[1] // 4
                both = np.matmul(own, block, out=self._both.ravel()[: len(own) * block.shape[1]].reshape(len(own), -1))
                both = both.view(np.complex128)
                yield rows, slice(start, start + count), both[:, :count], both[:, count:]

    def receptances(self, joints: Real, out: Complex) -> Complex:
        """Write receptances (m, n)."""
        for rows, lines, above, below in self._quotients(joints, range(0, self._lines, LINES)):
            np.divide(above, below, out=out[rows, lines])
        return out

    def misfits(self, joints: Real, weights: Real) -> NDArray[np.float64]:
        """Return sums of |weight ln(measured / H)|^2, (m,), with `measured` folded into D."""
        total = np.zeros(len(joints))
        for rows, lines, above, below in self._quotients(joints, range(0, self._lines, LINES)):
            size, angle = self._room[:2, : above.shape[0], : above.shape[1]]
            np.divide(below, above, out=below)
            a, b = below.real, below.imag
            # Real functions, which have vector instructions: the complex logarithm takes three times as long.
            np.arctan2(b, a, out=angle)
            np.multiply(a, a, out=size)
            scratch = self._room[2, : above.shape[0], : above.shape[1]]
            np.multiply(b, b, out=scratch)
            size += scratch
            np.log(size, out=size)
            size *= 0.5
            np.multiply(size, size, out=size)
            np.multiply(angle, angle, out=angle)
            size += angle
            total[rows] += size @ weights[lines] ** 2
        return total
