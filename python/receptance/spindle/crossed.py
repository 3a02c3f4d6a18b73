"""A spindle that couples x and y: both planes at once, from responses in one direction to hits in the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.coordinates import Coordinate
from receptance.identification.inversion_input import check_observations, common_lines
from receptance.identification.observations import MeasuredFRF
from receptance.spindle.blanks import Blanks, check_bands, check_blanks, plane_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["CrossedSpindle", "identify_crossed_spindle"]

_AXES = ("xx", "yy", "xy", "yx")
# Unknowns of X = (G + Y)^-1 over (x, theta_x, y, theta_y): three of each plane, four between them.
_ENTRIES = {
    "xx": ((0, 0), (1, 1), (0, 1)),
    "yy": ((2, 2), (3, 3), (2, 3)),
    "xy": ((0, 2), (0, 3), (1, 2), (1, 3)),
}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CrossedSpindle:
    """A spindle's receptances in both planes and between them, line by line.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` lines, complex where an exponential window was used.
    matrix : ndarray
        `(n, 4, 4)` symmetric, over (x, theta_x, y, theta_y): motion per force or moment, theta_x the slope dx/dz of the
        plane of x.
    reaction : ndarray
        `(n, 4, 4, m)` how each entry moves with one standard deviation of each of the m responses.
    condition : ndarray
        `(n,)` by how much a relative error of the responses can grow.
    usable : ndarray
        `(n,)` where the standard deviation of each entry is below `limit` of sqrt(|G_ii G_jj|).
    limit : float
        That share.
    """

    frequency_hz: NDArray[Any]
    matrix: NDArray[np.complex128]
    reaction: NDArray[np.complex128]
    condition: NDArray[np.float64]
    usable: NDArray[np.bool_]
    limit: float

    @property
    def standard_deviation(self) -> NDArray[np.float64]:
        """`(n, 4, 4)` of the real and of the imaginary part, each."""
        result: NDArray[np.float64] = np.sqrt(np.sum(np.abs(self.reaction) ** 2, axis=-1))
        return result

    def tip(
        self, front: Assembly, *, place: Coordinate | None = None
    ) -> tuple[NDArray[Any], NDArray[np.complex128], NDArray[np.float64]]:
        """Couple what is in the spindle, alike in both planes, to it; by default for its tip.

        Parameters
        ----------
        front : Assembly
            Tool, joint and holder; the spindle joins the far end of the last part.
        place : Coordinate, optional
            Where motion and load are.

        Returns
        -------
        lines, receptance, standard_deviation : ndarray
            The usable lines `(n,)`, `(n, 2, 2)` over (x, y) as `receptance.stability` takes it, and the standard
            deviation of its real and imaginary parts, each.
        """
        rows = np.flatnonzero(self.usable)
        lines = np.asarray(self.frequency_hz)[rows]
        points = [place or Coordinate(), *plane_of(front)]
        h = front.receptance(lines, response=points, excitation=points)
        both = np.eye(2)
        # From the axis of the tip to (axis, y or theta) of the plane: what is in the spindle is alike in both.
        reach = np.einsum("ab,ni->nabi", both, h[:, 0, 1:]).reshape(-1, 2, 4)
        plane = np.einsum("ab,nij->naibj", both, h[:, 1:, 1:]).reshape(-1, 4, 4)
        taken = np.linalg.inv(self.matrix[rows] + plane)
        found = h[:, :1, :1] * both - reach @ taken @ reach.transpose(0, 2, 1)
        through = reach @ taken
        moved = np.einsum("nai,nijm,nbj->nabm", through, self.reaction[rows], through)
        return lines, found, np.sqrt(np.sum(np.abs(moved) ** 2, axis=-1))

    def __repr__(self) -> str:
        lines = np.asarray(self.frequency_hz).real
        count = int(self.usable.sum())
        return f"CrossedSpindle({count} of {lines.size} lines from {lines[0]:g} to {lines[-1]:g} Hz are usable)"


def identify_crossed_spindle(
    observations: Mapping[str, MeasuredFRF | Sequence[MeasuredFRF]], *, limit: float = 0.2, threads: int | None = None
) -> CrossedSpindle:
    """Find the receptances of a spindle in x, in y and between them, from one blank that is alike in both planes.

    With hits and responses at two places of the blank each plane gives three responses, and x from y four more; all are
    linear in X = (G + Y)^-1 over (x, theta_x, y, theta_y), Y the blank's own in both planes (S1 of the documentation).

    Parameters
    ----------
    observations : mapping of str to MeasuredFRF or sequence of MeasuredFRF
        By "xx", "yy" and "xy" or "yx": the direction of the response, then that of the hit. The coordinates say the
        places; what they call y is the direction in question. All of one blank, with standard deviations.
    limit : float, optional
        As for `identify_spindle`, for all entries relative to sqrt(|G_ii G_jj|).
    threads : int, optional
        As in `Assembly.receptance`.

    Raises
    ------
    TypeError, ValueError
        A direction that is missing or unknown, several blanks, or too few independent responses of a direction: three
        in each plane, four between them.
    """
    share = _checks.positive("identify_crossed_spindle", "limit", limit)
    axes, observed = _listed(observations)
    observed, lines, rows, _ = common_lines(observed)
    blanks = Blanks.of(observed, lines, threads)
    equations = blanks.equations(observed, rows)
    noise = np.abs(equations.measured) * equations.deviation
    x = np.zeros((lines.size, 4, 4), dtype=np.complex128)
    moved = np.zeros((lines.size, 4, 4, len(observed)), dtype=np.complex128)
    for block, entries in _ENTRIES.items():
        chosen = [i for i, axis in enumerate(axes) if axis == block or axis[::-1] == block]
        own = [axes[i] == block for i in chosen]
        # y from x is x from y with the places exchanged.
        same = np.array(own)[:, None]
        left = np.where(same, blanks.response[:, chosen], blanks.excitation[:, chosen])
        right = np.where(same, blanks.excitation[:, chosen], blanks.response[:, chosen])
        products = [left[..., i % 2] * right[..., j % 2] for i, j in entries]
        if block != "xy":
            products[2] = products[2] + left[..., 1] * right[..., 0]
        free = blanks.free[:, chosen] if block != "xy" else 0.0
        solve = _solved(np.stack(products, axis=-1), noise[:, chosen], block)
        values = np.einsum("nkm,nm->nk", solve, free - equations.measured[:, chosen])
        for k, (i, j) in enumerate(entries):
            x[:, i, j] = x[:, j, i] = values[:, k]
            moved[:, i, j, chosen] = moved[:, j, i, chosen] = -solve[:, k] * noise[:, chosen]
    inverse = np.linalg.inv(x)
    plane = np.einsum("ab,nij->naibj", np.eye(2), blanks.plane[:, 0]).reshape(-1, 4, 4)
    matrix = inverse - plane
    reaction = -np.einsum("nij,njkm,nkl->nilm", inverse, moved, inverse)
    root = np.sqrt(np.abs(np.einsum("nii->ni", matrix)))
    size = root[:, :, None] * root[:, None, :]
    relative = (reaction / size[..., None] / equations.deviation[:, None, None, :]).reshape(lines.size, 16, -1)
    deviation = np.sqrt(np.sum(np.abs(reaction) ** 2, axis=-1))
    return CrossedSpindle(
        frequency_hz=lines,
        matrix=matrix,
        reaction=reaction,
        condition=np.linalg.norm(relative, ord=2, axis=(1, 2)),
        usable=(deviation <= share * size).all(axis=(1, 2)),
        limit=share,
    )


def _listed(
    observations: Mapping[str, MeasuredFRF | Sequence[MeasuredFRF]],
) -> tuple[list[str], tuple[MeasuredFRF, ...]]:
    """Return directions and observations, checked."""
    unknown = [axis for axis in observations if axis not in _AXES]
    if unknown:
        raise ValueError(f"observations has the directions {unknown[0]!r}, expected {', '.join(_AXES)}")
    for block, entries in _ENTRIES.items():
        count = sum(len(check_observations(observations[axis])) for axis in {block, block[::-1]} & observations.keys())
        if count < len(entries):
            raise ValueError(
                f"there are {count} responses of {block}, expected at least {len(entries)}: at two places of the blank "
                f"{'each response to each hit' if block == 'xy' else 'both drive points and the one between them'}; "
                "without any between x and y use identify_spindle for each"
            )
    pairs = [(axis, one) for axis, given in observations.items() for one in check_observations(given)]
    observed = tuple(one for _, one in pairs)
    check_blanks(observed)
    check_bands(observed)
    if any(one.assembly != observed[0].assembly for one in observed):
        raise ValueError("the responses are of several blanks, expected those of one")
    return [axis for axis, _ in pairs], observed


def _solved(products: NDArray[np.complex128], noise: NDArray[np.float64], block: str) -> NDArray[np.complex128]:
    """Return the matrices `(n, k, m)` that give the unknowns of a block by weighted least squares."""
    weighted = products / noise[..., None]
    size = np.linalg.norm(weighted, axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    scaled = weighted / size
    if np.max(np.linalg.matrix_rank(scaled, tol=1e-9)) < products.shape[-1]:
        raise ValueError(f"the responses of {block} cannot tell its terms apart: hit and measure at two places each")
    found = np.linalg.pinv(scaled, rcond=1e-13) / size.transpose(0, 2, 1)
    result: NDArray[np.complex128] = found / noise[:, None, :]
    return result
