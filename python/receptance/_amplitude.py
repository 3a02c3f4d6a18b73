"""Receptances with joints in micro-slip: at stated levels, or on each line at the level that a force brings about.

The core takes what slip adds to the stiffness of a joint on each line. With d the relative motion of the two sides of a
joint in one direction, dH = -d_r d_e dK (T9), of which the core's derivative with respect to the damping has all but
the factor i w; so every parameter of the added stiffness costs the core nothing more.

Under a force of amplitude F the levels obey l = F |d(l)| / a_ref. They are found with the compliance G of the linear
structure between the sides of the joints, d = (1 + G K_added(l))^-1 d_0, and differentiated as an implicit function.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance._flatten import JOINTS, MICROSLIP, MICROSLIP_FIELDS
from receptance.errors import GrossSlipError
from receptance.microslip import largest_share, loss_ratio, loss_ratio_slope

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance._flatten import Flat
    from receptance.microslip import MicroslipJoint

__all__ = ["Slots", "added_stiffness", "evaluate", "force_amplitudes", "natural_weights"]

Solve = Callable[
    ["NDArray[np.float64]", "NDArray[np.float64]", "NDArray[np.float64]", "NDArray[np.complex128]"],
    tuple["NDArray[np.complex128]", "NDArray[np.complex128]"],
]
"""Excitations, responses, table entries and added stiffness to receptance and derivatives."""

_SMALL = 1e-3
"""Share of the stiffness that may be lost where the search for a level begins."""
_LONGEST = 1.0
"""A step changes no level by more than this factor of e."""
_MOST_STEPS = 200
_MOST_HALVES = 20
_CONVERGED = 1e-11
_BALANCED = 1e-8
_LEAST_LEVEL = 1e-30
_DAMPING_COLUMN = 5


class Slots:
    """Translation and rotation of all joints in micro-slip, one after the other: `s` of them."""

    def __init__(self, joints: Sequence[MicroslipJoint]) -> None:
        def each(pair: Callable[[MicroslipJoint], tuple[float, float]]) -> NDArray[np.float64]:
            return np.array([pair(joint) for joint in joints]).reshape(-1)

        self.count = 2 * len(joints)
        self.k = each(lambda j: (j.k_y, j.k_theta))
        self.slip = each(lambda j: (j.slip_y, j.slip_theta))
        self.level = each(lambda j: (j.level, j.level))
        self.reference = each(lambda j: (j.reference_y, j.reference_theta))
        self.exponent = each(lambda j: (j.exponent, j.exponent))
        self.loss_factor = each(lambda j: (j.loss_factor, j.loss_factor))
        self.most = each(lambda j: (largest_share(j.exponent),) * 2)
        self._ratio = 1.0 - 1j * each(lambda j: (loss_ratio(j.exponent),) * 2)
        self._ratio_slope = -1j * each(lambda j: (loss_ratio_slope(j.exponent),) * 2)

    def shares(self, levels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the shares of the stiffness that are lost, `(n, s)`."""
        return self.slip * levels**self.exponent

    def added(self, levels: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return what slip adds to the stiffness, `(n, s)`."""
        return -self.k * self.shares(levels) * self._ratio

    def slope(self, levels: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return its derivative with respect to the level; at the level 0 that from above, where there is one."""
        safe = np.where(levels > 0.0, levels, 1.0)
        at_zero = np.where(self.exponent == 1.0, 1.0, np.where(self.exponent < 1.0, np.inf, 0.0))
        rate = np.where(levels > 0.0, self.exponent * safe ** (self.exponent - 1.0), at_zero)
        return -self.k * np.where(self.slip > 0.0, self.slip * rate, 0.0) * self._ratio

    def partial(self, index: int, field: str, levels: NDArray[np.float64], stated: bool) -> NDArray[np.complex128]:
        """Return the derivative of the stiffness with respect to a field of one joint while levels stay, `(n, s)`."""
        result = np.zeros(levels.shape, dtype=np.complex128)
        both = slice(2 * index, 2 * index + 2)
        one = 2 * index + (field.endswith("theta"))
        power = levels**self.exponent
        if field in ("k_y", "k_theta"):
            result[:, one] = 1.0 + 1j * self.loss_factor[one] - self.shares(levels)[:, one] * self._ratio[one]
        elif field in ("slip_y", "slip_theta"):
            result[:, one] = -self.k[one] * power[:, one] * self._ratio[one]
        elif field == "exponent":
            logarithm = np.log(np.where(levels > 0.0, levels, 1.0))
            rate = logarithm * self._ratio + self._ratio_slope
            result[:, both] = (-self.k * self.shares(levels) * rate)[:, both]
        elif field == "level" and stated:
            rate = self.slope(levels)[:, both]
            if not np.isfinite(rate).all():
                raise ValueError("a level of 0 has no derivative where the exponent is below 1")
            result[:, both] = rate
        return result


def force_amplitudes(force: ArrayLike | None, w: NDArray[Any], excitations: int) -> NDArray[np.float64] | None:
    """Return amplitudes in N on each line, or None.

    Raises
    ------
    ValueError
        Forces that are not positive numbers, one or one a line, several excitations, or complex lines.
    """
    if force is None:
        return None
    array = _checks.unmasked("", "force", force)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"force has dtype {array.dtype}, expected real numbers in N")
    if array.shape not in ((), w.shape):
        raise ValueError(f"force has shape {array.shape}, expected one number or {w.shape}")
    if excitations != 1:
        raise ValueError(f"force belongs to one excitation, and there are {excitations}")
    if np.any(w.imag):
        raise ValueError("a stepped sine of a given force has real lines; complex ones belong to a decaying window")
    for value in array.reshape(-1)[~(array.reshape(-1) > 0.0) | ~np.isfinite(array.reshape(-1))]:
        _checks.positive("receptance", "force", value, unit="N")
    return np.broadcast_to(array.astype(np.float64), w.shape)


def evaluate(
    solve: Solve,
    flat: Flat,
    w: NDArray[np.complex128],
    excitations: NDArray[np.float64],
    responses: NDArray[np.float64],
    rows: NDArray[np.float64],
    force: NDArray[np.float64] | None,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return receptance `(n, r, e)` and derivatives `(n, r, e, m)` with respect to table entries `rows`."""
    slots = Slots([joint for _, _, joint in flat.microslips])
    if force is None:
        levels = np.broadcast_to(slots.level, (w.size, slots.count))
        h, dh = solve(excitations, responses, _asked(flat, rows), _on_joints(flat, slots.added(levels)))
        return h, _partials(dh, slots, rows, levels, w, stated=True)[0]
    sides = np.array([[flat.joints[row][end], y] for row, _, _ in flat.microslips for end in (0, 1) for y in (0, 1)])
    levels = _levels(solve, flat, slots, excitations, sides, force, w)
    everywhere = np.vstack([responses, sides])
    h, dh = solve(excitations, everywhere, _asked(flat, rows), _on_joints(flat, slots.added(levels)))
    count = len(responses)
    if not len(rows):
        return h[:, :count], dh[:, :count]
    whole = np.concatenate([dh[:, :count], _between(dh[:, count:])], axis=1)
    partials, through = _partials(whole, slots, rows, levels, w, stated=False)
    motion = _between(h[:, count:])[:, :, 0]
    slope = _level_slopes(partials[:, count:, 0], through[:, count:, 0], motion, slots, rows, levels, force)
    moved = through[:, :count] * slots.slope(levels)[:, None, None, :]
    return h[:, :count], partials[:, :count] + np.einsum("nres,nsm->nrem", moved, slope)


def added_stiffness(flat: Flat, lines: int) -> NDArray[np.complex128]:
    """Return what slip at the stated levels adds to all joints on so many lines, as the core takes it."""
    slots = Slots([joint for _, _, joint in flat.microslips])
    return _on_joints(flat, slots.added(np.broadcast_to(slots.level, (lines, slots.count))))


def natural_weights(
    flat: Flat, rows: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the joint table at the stated levels, the entries to ask the core for, and their weights for `rows`."""
    table = flat.tables.joints.copy()
    slots = Slots([joint for _, _, joint in flat.microslips])
    levels = slots.level[None, :]
    left = 1.0 - slots.shares(levels)[0]
    for number, (row, _, _) in enumerate(flat.microslips):
        table[row, 2:4] *= left[2 * number : 2 * number + 2]
    own = rows[:, 0] == MICROSLIP
    stiffness = [[JOINTS, row, 2 + y] for row, _, _ in flat.microslips for y in (0, 1)]
    asked = np.vstack([rows[~own], np.array(stiffness, dtype=np.float64)])
    weights = np.zeros((len(asked), len(rows)))
    weights[np.arange(np.count_nonzero(~own)), np.flatnonzero(~own)] = 1.0
    for column in np.flatnonzero(own):
        index, field = int(rows[column, 1]), MICROSLIP_FIELDS[int(rows[column, 2])]
        weights[len(asked) - slots.count :, column] = slots.partial(index, field, levels, True)[0].real
    return table, asked, weights


def _asked(flat: Flat, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the core's entries, and last the dampings of the joints, whose derivatives the others are made of."""
    if not len(rows):
        return rows
    damping = [[JOINTS, row, _DAMPING_COLUMN + y] for row, _, _ in flat.microslips for y in (0, 1)]
    return np.vstack([rows[rows[:, 0] != MICROSLIP], np.array(damping, dtype=np.float64)])


def _on_joints(flat: Flat, added: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return what slip adds to all joints, as the core takes it."""
    whole = np.zeros((len(added), len(flat.joints), 2), dtype=np.complex128)
    for number, (row, _, _) in enumerate(flat.microslips):
        whole[:, row] = added[:, 2 * number : 2 * number + 2]
    return whole.reshape(-1)


def _between(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return relative motions from the motions of the sides, which are the second axis: two of each joint, twice."""
    n, sides, *rest = values.shape
    paired = values.reshape(n, sides // 4, 2, 2, *rest)
    result: NDArray[np.complex128] = (paired[:, :, 0] - paired[:, :, 1]).reshape(n, sides // 2, *rest)
    return result


def _partials(
    dh: NDArray[np.complex128],
    slots: Slots,
    rows: NDArray[np.float64],
    levels: NDArray[np.float64],
    w: NDArray[np.complex128],
    *,
    stated: bool,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Return derivatives for `rows` at these levels, and those with respect to the stiffness of each slot."""
    if not len(rows):
        return dh, dh
    plain = dh[..., : -slots.count]
    through = dh[..., -slots.count :] / (1j * w)[:, None, None, None]
    own = rows[:, 0] == MICROSLIP
    result = np.zeros((*dh.shape[:3], len(rows)), dtype=np.complex128)
    result[..., ~own] = plain
    for column in np.flatnonzero(own):
        index, field = int(rows[column, 1]), MICROSLIP_FIELDS[int(rows[column, 2])]
        stiffness = slots.partial(index, field, levels, stated)
        result[..., column] = np.einsum("nres,ns->nre", through, stiffness)
    return result, through


def _level_slopes(
    partials: NDArray[np.complex128],
    through: NDArray[np.complex128],
    motion: NDArray[np.complex128],
    slots: Slots,
    rows: NDArray[np.float64],
    levels: NDArray[np.float64],
    force: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the derivatives of the levels, `(n, s, m)`: (1 - dg/dl) dl = dg with g = F |d| / a_ref."""
    factor = _force_over_reference(slots, force)
    size = np.abs(motion)
    towards = factor * np.conj(motion) / np.where(size > 0.0, size, 1.0)
    direct = (towards[:, :, None] * partials).real
    for column, (table, index, field) in enumerate(rows.astype(int)):
        if table == MICROSLIP and MICROSLIP_FIELDS[field].startswith("reference_"):
            slot = 2 * index + MICROSLIP_FIELDS[field].endswith("theta")
            if slots.reference[slot] > 0.0:
                direct[:, slot, column] -= levels[:, slot] / slots.reference[slot]
    stiffness = np.where(levels > 0.0, slots.slope(np.maximum(levels, _LEAST_LEVEL)), 0.0)
    coupling = (towards[:, :, None] * through * stiffness[:, None, :]).real
    return np.asarray(np.linalg.solve(np.eye(slots.count) - coupling, direct), dtype=np.float64)


def _force_over_reference(slots: Slots, force: NDArray[np.float64]) -> NDArray[np.float64]:
    reference = np.where(slots.reference > 0.0, slots.reference, np.inf)
    result: NDArray[np.float64] = force[:, None] / reference
    return result


def _levels(
    solve: Solve,
    flat: Flat,
    slots: Slots,
    excitations: NDArray[np.float64],
    sides: NDArray[np.float64],
    force: NDArray[np.float64],
    w: NDArray[np.complex128],
) -> NDArray[np.float64]:
    """Return the levels under a force, `(n, s)`."""
    names = [f"{name}.reference_{y}" for _, name, _ in flat.microslips for y in ("y", "theta")]
    for name, slip, reference in zip(names, slots.slip, slots.reference, strict=True):
        if slip > 0.0 and reference == 0.0:
            raise ValueError(f"{name} is zero, expected the amplitude of the level 1: a force is given, and no level")
    none = np.zeros((0, 3))
    nothing = np.zeros((w.size, slots.count), dtype=np.complex128)
    h, _ = solve(np.vstack([excitations, sides]), sides, none, _on_joints(flat, nothing))
    between = _between(h)
    start = between[:, :, 0]
    compliance = np.swapaxes(_between(np.swapaxes(between[:, :, 1:], 1, 2)), 1, 2)
    factor = _force_over_reference(slots, force)
    levels, off = solved(slots, start, compliance, factor)
    shares = slots.shares(levels) / slots.most
    bad = np.flatnonzero((off > _BALANCED) | (shares > 1.0).any(axis=1))
    if bad.size:
        line = bad[0]
        slot = int(np.argmax(shares[line]))
        what = f"joint {flat.microslips[slot // 2][1]!r}"
        under = f"at {w[line].real / (2.0 * np.pi):g} Hz under {force[line]:g} N"
        if shares[line, slot] <= 1.0:
            raise GrossSlipError(f"{what} has no level {under} that the force and its motion agree on")
        raise GrossSlipError(
            f"{what} slides as a whole in {('y', 'theta')[slot % 2]} {under}: more than {slots.most[slot]:.3g} of the "
            "stiffness would be lost"
        )
    return levels


def solved(
    slots: Slots, start: NDArray[np.complex128], compliance: NDArray[np.complex128], factor: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the levels under a force, and how far off each line ends, relative.

    Newton's method on log l - log |d(l)| = log (F / a_ref), from a level at which the structure is still linear, with
    steps cut until they help: with one mode and one direction the left side only grows with l.

    Parameters
    ----------
    slots : Slots
        The joints.
    start, compliance : ndarray
        `(n, s)` relative motions of the linear structure under a unit load, `(n, s, s)` its compliance there.
    factor : ndarray
        `(n, s)` force over reference amplitude.
    """
    linear = np.maximum(factor * np.abs(start), _LEAST_LEVEL)
    share = np.max(np.where(factor > 0.0, slots.shares(linear), 0.0), axis=1)
    first = np.minimum(1.0, _SMALL / np.maximum(share, _LEAST_LEVEL))[:, None] ** (1.0 / slots.exponent)
    x = np.log(first.min(axis=1, keepdims=True) * linear)
    off = np.full(len(x), np.inf)
    left = np.arange(len(x))
    value, slope = _balance(slots, start, compliance, factor, x)
    for _ in range(_MOST_STEPS):
        off[left] = np.abs(value).max(axis=1)
        kept = off[left] > _CONVERGED
        if not kept.any():
            break
        left, value, slope = left[kept], value[kept], slope[kept]
        step = -(_inverse(slope) @ value[:, :, None])[:, :, 0]
        step = step * np.minimum(1.0, _LONGEST / np.maximum(np.abs(step).max(axis=1), _LEAST_LEVEL))[:, None]
        x[left], value, slope = _stepped((slots, start[left], compliance[left], factor[left]), x[left], step, value)
    return np.where(factor > 0.0, np.exp(x), 0.0), off


Lines = tuple[Slots, "NDArray[np.complex128]", "NDArray[np.complex128]", "NDArray[np.float64]"]


def _stepped(
    lines: Lines, x: NDArray[np.float64], step: NDArray[np.float64], value: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return where each line is after as much of its step, 1, 1/2, 1/4 and so on, as helps, and the balance there."""
    slots, start, compliance, factor = lines
    size = np.linalg.norm(value, axis=1)
    new = x + step
    found, slope = _balance(slots, start, compliance, factor, new)
    share = 1.0
    for _ in range(_MOST_HALVES):
        left = np.flatnonzero(np.linalg.norm(found, axis=1) > (1.0 - 1e-4 * share) * size)
        if not left.size:
            break
        share *= 0.5
        new[left] = x[left] + share * step[left]
        found[left], slope[left] = _balance(slots, start[left], compliance[left], factor[left], new[left])
    return new, found, slope


def _balance(
    slots: Slots,
    start: NDArray[np.complex128],
    compliance: NDArray[np.complex128],
    factor: NDArray[np.float64],
    x: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return log l - log |d(l)| - log (F / a_ref) at x = log l, `(n, s)`, and its derivative `(n, s, s)`."""
    levels = np.exp(x)
    unit = np.eye(slots.count)
    inverse = _inverse(unit + compliance * slots.added(levels)[:, None, :])
    motion = (inverse @ start[:, :, None])[:, :, 0]
    motion = np.where(np.abs(motion) > _LEAST_LEVEL, motion, _LEAST_LEVEL)
    counted = factor > 0.0
    value = np.where(counted, x - np.log(np.abs(motion) * np.where(counted, factor, 1.0)), 0.0)
    moved = -(inverse @ compliance) * (motion * slots.slope(levels) * levels)[:, None, :]
    slope = np.where(counted[:, :, None], unit - (moved / motion[:, :, None]).real, unit)
    return value, slope


def _inverse(matrices: NDArray[Any]) -> NDArray[Any]:
    """Return inverses, `(n, s, s)`; of two rows by hand, which is many times faster than one call a matrix."""
    if matrices.shape[1] != 2:
        return np.asarray(np.linalg.inv(matrices))
    (a, b), (c, d) = np.moveaxis(matrices, 0, -1)
    return np.moveaxis(np.array([[d, -b], [-c, a]]) / (a * d - b * c), -1, 0)
