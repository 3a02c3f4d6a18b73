"""Tool, point joint and holder: tip receptance, its four derivatives, and what identification hoists.

With joint stiffnesses k1 = k_y(w), k2 = k_theta(w) (no k_ytheta), the tip receptance is a ratio of two
bilinear forms, H = num / den, num = k1 k2 n0 + k2 n1 + k1 n2 + n3, den = k1 k2 d0 + k2 d1 + k1 d2 + d3, and
the joint's relative motion under a unit tip force is d_y = (k2 x0 + x1) / den, d_theta = (k1 y0 + y1) / den.
The twelve coefficients are entire functions of w^2 of tool and holder alone; dH/dk1 = -d_y^2, dH/dk2 =
-d_theta^2. Coupling receptances instead would lose digits at low frequency.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .chain import chain_generators
from .segment import Complex, Real
from .series import SPAN_LIMIT, Series, degree_for, minors_generator, propagate

JOINT_BLOCK = 2048


class Substructures:
    """Series of the twelve coefficients; order n0 n1 n2 n3 d0 d1 d2 d3 x0 x1 y0 y1.

    Parameters
    ----------
    tool, holder : segment tables; each numbered 0-1-2-... from its own tip side.
    highest : largest requested |w| [rad/s].
    """

    def __init__(self, tool: Real, holder: Real, highest: float) -> None:
        front, front_span = chain_generators(_renumbered(tool), highest)
        back, back_span = chain_generators(_renumbered(holder), highest)
        if front_span + back_span > SPAN_LIMIT:
            raise ValueError(f"wave span {front_span + back_span:.1f} beyond {SPAN_LIMIT}")
        degree = degree_for(front_span + back_span)
        behind = np.zeros((6, degree, 1), dtype=np.complex128)
        behind[0, 0] = 1
        for fixed, inertial in reversed(back):
            behind = propagate(minors_generator(fixed), minors_generator(inertial), behind)
        yt, yv, ym, tv, tm, vm = behind[:, :, 0]
        # Minors on the joint's tool side, y + V-load / k1 and theta + M-load / k2 in place of y, theta: the
        # parts with 1, 1/k1, 1/k2 and 1/(k1 k2), columns of one propagation through the tool.
        zero = np.zeros_like(yt)
        parts = np.array(
            [
                [yt, yv, ym, tv, tm, vm],
                [-tv, zero, vm, zero, zero, zero],
                [ym, zero, zero, -vm, zero, zero],
                [vm, zero, zero, zero, zero, zero],
            ]
        )
        ahead = np.ascontiguousarray(parts.transpose(1, 2, 0))
        states = np.zeros((4, degree, 4), dtype=np.complex128)
        states[:, 0] = np.eye(4)
        for fixed, inertial in reversed(front):
            ahead = propagate(minors_generator(fixed), minors_generator(inertial), ahead)
            states = propagate(fixed, inertial, states)
        # Load at the joint under unit tip force: minors of a load row at the joint with the moment row at the
        # tip.
        to_y, to_t, to_v, to_m = states[3].T
        motions = [
            _times((-yv, to_y), (-tv, to_t), (vm, to_m)),
            _times((vm, to_t)),
            -_times((ym, to_y), (tm, to_t), (vm, to_v)),
            -_times((vm, to_y)),
        ]
        coefficients = np.array([*ahead[2].T, *ahead[5].T, *motions])
        self.series = Series(coefficients, highest)
        self.tip_series = Series(coefficients[:8], highest, self.series.powers)

    def __call__(
        self,
        angular_frequency: NDArray,
        out: Complex | None = None,
        block: int = JOINT_BLOCK,
        motions: bool = True,
    ) -> Complex:
        """The twelve coefficients as planes, (12, n); without ``motions`` only the first eight."""
        w = np.asarray(angular_frequency)
        result = np.empty((12, w.size), dtype=np.complex128) if out is None else out
        series = self.series if motions else self.tip_series
        size = min(block, w.size)
        # The smaller series has as many powers and fewer functions: the larger one's buffers serve it too.
        scratch, rows, _ = self.series.buffers(size, w.dtype)
        rows = rows.ravel()
        for start in range(0, w.size, block):
            square = w[start : start + block] / self.series.reference
            square *= square
            n = square.size
            values = series.lines(square, scratch, rows[: n * series.functions].reshape(n, -1))
            np.copyto(result[: series.functions, start : start + n], values.T)
        return result


def _renumbered(table: Real) -> Real:
    table = np.array(table, dtype=np.float64, ndmin=2)
    table[:, :2] -= table[0, 0]
    return table


def _times(*pairs: tuple[Complex, Complex]) -> Complex:
    """Sum of products of power series, cut to their length."""
    return sum(np.convolve(a, b)[: a.size] for a, b in pairs)


class Joint(NamedTuple):
    """A diagonal point joint: stiffnesses [N/m, N m/rad], dampings [N s/m, N m s/rad], a loss factor."""

    k_y: float
    k_theta: float
    c_y: float
    c_theta: float
    loss_factor: float = 0.0


class _Lines:
    """Scratch of one block."""

    def __init__(self, lines: int) -> None:
        self.planes = np.empty((12, lines), dtype=np.complex128)
        self.work = np.empty((6, lines), dtype=np.complex128)


def joint_stiffness(w: NDArray, joint: Joint, k1: Complex, k2: Complex) -> None:
    """k_y(w) and k_theta(w), written in place."""
    np.multiply(w, 1j * joint.c_y, out=k1)
    k1 += joint.k_y * (1 + 1j * joint.loss_factor)
    np.multiply(w, 1j * joint.c_theta, out=k2)
    k2 += joint.k_theta * (1 + 1j * joint.loss_factor)


def bilinear(c: Complex, k1: Complex, k2: Complex, both: Complex, out: Complex, scratch: Complex) -> None:
    """k1 k2 c0 + k2 c1 + k1 c2 + c3 with ``both`` = k1 k2."""
    np.multiply(both, c[0], out=out)
    np.multiply(k2, c[1], out=scratch)
    out += scratch
    np.multiply(k1, c[2], out=scratch)
    out += scratch
    out += c[3]


def tip_receptance(
    angular_frequency: NDArray,
    substructures: Substructures | Complex,
    joint: Joint,
    derivatives: bool = False,
    out: tuple[Complex, Complex | None] | None = None,
    block: int = JOINT_BLOCK,
) -> tuple[Complex, Complex | None]:
    """Tip receptance H_yy of tool, joint and holder, with its derivatives if requested.

    Parameters
    ----------
    angular_frequency : (n,) real or complex [rad/s].
    substructures : their series, or the twelve planes (12, n) evaluated before, when only the joint changes.
    joint : the joint.
    derivatives : whether to return dH with respect to (k_y, k_theta, c_y, c_theta).
    out : H (n,) and dH (n, 4) to write to.

    Returns
    -------
    H (n,) and dH (n, 4) or None.
    """
    w = np.asarray(angular_frequency)
    n = w.size
    if out is None:
        result = np.empty(n, dtype=np.complex128)
        slopes = np.empty((n, 4), dtype=np.complex128) if derivatives else None
    else:
        result, slopes = out
    hoisted = isinstance(substructures, np.ndarray)
    lines = _Lines(min(block, n))
    lossy = 1 + 1j * joint.loss_factor
    for start in range(0, n, block):
        stop = min(start + block, n)
        line, size = w[start:stop], stop - start
        if hoisted:
            planes = substructures[:, start:stop]
        else:
            planes = substructures(line, lines.planes[:, :size], block, motions=derivatives)
        k1, k2, both, below, scratch, motion = lines.work[:, :size]
        joint_stiffness(line, joint, k1, k2)
        np.multiply(k1, k2, out=both)
        bilinear(planes[4:8], k1, k2, both, below, scratch)
        np.reciprocal(below, out=below)
        above = result[start:stop]
        bilinear(planes[:4], k1, k2, both, above, scratch)
        above *= below
        if not derivatives:
            continue
        # Through -i d, so that one square gives -d^2 with its sign.
        below *= 1j
        for column, (stiffness, first) in enumerate(((k2, 8), (k1, 10))):
            np.multiply(stiffness, planes[first], out=motion)
            motion += planes[first + 1]
            motion *= below
            np.multiply(motion, motion, out=motion)
            slope = slopes[start:stop]
            np.multiply(motion, line, out=scratch)
            np.multiply(scratch, 1j, out=slope[:, column + 2])
            if joint.loss_factor:
                motion *= lossy
            slope[:, column] = motion
    return result, slopes
