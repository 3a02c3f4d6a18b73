"""Four joint parameters by SciPy's least squares on the complex log residual, the substructures hoisted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from .joint import Joint, Substructures, bilinear, joint_stiffness
from .segment import Complex, Real

BLOCK = 2048


class Fit(NamedTuple):
    """The fitted joint, and SciPy's result (x = log10 k_y, log10 k_theta, ln c_y, ln c_theta; nfev)."""

    joint: Joint
    result: OptimizeResult
    nfev: int


class LogResidual:
    """Residual log(H_measured / H_model) as (2n,) real and imaginary parts, and its Jacobian (2n, 4).

    The residual's values at a point are kept for the Jacobian at the same point, which SciPy
    always evaluates next.

    Parameters
    ----------
    angular_frequency : (n,) [rad/s].
    measured : (n,) measured tip receptance.
    planes : (12, n) hoisted coefficients, see ``Substructures``.
    loss_factor : the joint's fixed loss factor.
    """

    def __init__(
        self, angular_frequency: NDArray, measured: Complex, planes: Complex, loss_factor: float = 0.0
    ) -> None:
        self.w = np.asarray(angular_frequency)
        self.loss_factor = loss_factor
        # The measurement is folded into the denominator, its root into the joint's motion.
        self.planes = np.array(planes)
        self.planes[4:8] *= measured
        self.planes[8:] *= np.sqrt(np.asarray(measured))
        n = self.w.size
        self.stiffness = np.empty((2, n), dtype=np.complex128)
        self.over = np.empty(n, dtype=np.complex128)
        self.work = np.empty((4, min(BLOCK, n)), dtype=np.complex128)
        self.at: Real | None = None

    def joint(self, x: Real) -> Joint:
        """The joint at a scaled point."""
        return Joint(10 ** x[0], 10 ** x[1], np.exp(x[2]), np.exp(x[3]), self.loss_factor)

    def __call__(self, x: Real) -> Real:
        """Residual (2n,)."""
        n = self.w.size
        joint = self.joint(x)
        residual = np.empty(2 * n)
        for start in range(0, n, BLOCK):
            stop = min(start + BLOCK, n)
            planes = self.planes[:, start:stop]
            k1, k2 = self.stiffness[:, start:stop]
            over = self.over[start:stop]
            both, above, below, scratch = self.work[:, : stop - start]
            joint_stiffness(self.w[start:stop], joint, k1, k2)
            np.multiply(k1, k2, out=both)
            bilinear(planes[:4], k1, k2, both, above, scratch)
            bilinear(planes[4:8], k1, k2, both, below, scratch)
            # One reciprocal serves the ratio now and the Jacobian later.
            np.multiply(above, below, out=over)
            np.reciprocal(over, out=over)
            np.multiply(below, below, out=below)
            below *= over
            # NumPy's complex logarithm takes 96 ns, its two real halves 4.
            re, im = above.view(np.float64)[: stop - start], above.view(np.float64)[stop - start :]
            re[:], im[:] = below.real, below.imag
            np.arctan2(im, re, out=residual[n + start : n + stop])
            re *= re
            im *= im
            re += im
            np.log(re, out=re)
            np.multiply(re, 0.5, out=residual[start:stop])
        self.at = x.copy()
        return residual

    def jacobian(self, x: Real) -> Real:
        """Jacobian (2n, 4) of the residual, in column order."""
        if self.at is None or not np.array_equal(x, self.at):
            self(x)
        n = self.w.size
        joint = self.joint(x)
        columns = np.empty((4, 2 * n))
        lossy = 1 + 1j * self.loss_factor
        scales = (np.log(10) * joint.k_y * lossy, np.log(10) * joint.k_theta * lossy)
        dampings = (joint.c_y, joint.c_theta)
        for start in range(0, n, BLOCK):
            stop = min(start + BLOCK, n)
            motion, scratch = self.work[:2, : stop - start]
            for k, first in enumerate((8, 10)):
                np.multiply(self.stiffness[1 - k, start:stop], self.planes[first, start:stop], out=motion)
                motion += self.planes[first + 1, start:stop]
                motion *= motion
                motion *= self.over[start:stop]
                np.multiply(motion, self.w[start:stop], out=scratch)
                if self.loss_factor or np.iscomplexobj(self.w):
                    scratch *= 1j * dampings[k]
                    columns[k + 2, start:stop], columns[k + 2, n + start : n + stop] = (
                        scratch.real,
                        scratch.imag,
                    )
                    motion *= scales[k]
                    columns[k, start:stop], columns[k, n + start : n + stop] = motion.real, motion.imag
                    continue
                np.multiply(scratch.imag, -dampings[k], out=columns[k + 2, start:stop])
                np.multiply(scratch.real, dampings[k], out=columns[k + 2, n + start : n + stop])
                np.multiply(motion.real, scales[k].real, out=columns[k, start:stop])
                np.multiply(motion.imag, scales[k].real, out=columns[k, n + start : n + stop])
        return columns.T


def identify(
    angular_frequency: NDArray,
    measured: Complex,
    tool: Real,
    holder: Real,
    start: Joint,
    analytic: bool = True,
    method: str = "trf",
    planes: Complex | None = None,
) -> Fit:
    """Fit the joint to a measured tip receptance.

    Parameters
    ----------
    angular_frequency, measured : (n,).
    tool, holder : segment tables, not read when ``planes`` are given.
    start : first guess; its loss factor is kept.
    analytic : analytic Jacobian, or SciPy's '2-point' differences.
    method : SciPy's method.
    planes : hoisted coefficients (12, n).

    Returns
    -------
    Fit
    """
    w = np.asarray(angular_frequency)
    if planes is None:
        planes = Substructures(tool, holder, float(np.abs(w).max()))(w)
    residual = LogResidual(w, measured, planes, start.loss_factor)
    guess = np.array([np.log10(start.k_y), np.log10(start.k_theta), np.log(start.c_y), np.log(start.c_theta)])
    jacobian = residual.jacobian if analytic else "2-point"
    result = least_squares(residual, guess, jac=jacobian, method=method, x_scale="jac")
    return Fit(residual.joint(result.x), result, result.nfev)
