"""Spindles that couple x and y: both planes and their coupling from one blank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.coupling.blanks import blank_equations, check_blanks, plane_of
from receptance.coupling.common_lines import check_observations, common_lines
from receptance.fit.observation import Observation
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate

_AXES = ("xx", "yy", "xy", "yx")
# Unknowns of X = (G + Y)^-1 over (x, theta_x, y, theta_y): three in each plane, four between the planes.
_ENTRIES = {
    "xx": ((0, 0), (1, 1), (0, 1)),
    "yy": ((2, 2), (3, 3), (2, 3)),
    "xy": ((0, 2), (0, 3), (1, 2), (1, 3)),
}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CrossedSpindle:
    """Receptances of a spindle in both planes and between them, line by line."""

    frequency_hz: NDArray[np.inexact]
    """`(n,)` lines in Hz, complex if the responses have an exponential window."""
    matrix: NDArray[np.complex128]
    """`(n, 4, 4)` symmetric receptance over (x, theta_x, y, theta_y); theta_x is the slope dx/dz in the plane of x."""
    reaction: NDArray[np.complex128]
    """`(n, 4, 4, m)` change of each entry for one standard deviation of each of the m responses."""
    condition: NDArray[np.float64]
    """`(n,)` condition number: largest amplification of a relative error of the responses."""
    usable: NDArray[np.bool_]
    """`(n,)` lines on which the standard deviation of each entry is below `limit` times sqrt(|G_ii G_jj|)."""
    limit: float
    """Largest relative standard deviation of usable lines."""

    @property
    def standard_deviation(self) -> NDArray[np.float64]:
        """Standard deviation `(n, 4, 4)` of the real and of the imaginary part, each."""
        return np.asarray(np.sqrt(np.sum(np.abs(self.reaction) ** 2, axis=-1)))

    def tip(
        self, front: Assembly, *, coordinate: Coordinate | None = None
    ) -> tuple[NDArray[np.inexact], NDArray[np.complex128], NDArray[np.float64]]:
        """Couple tool and holder, with equal properties in both planes, to the spindle.

        Parameters
        ----------
        front : Assembly
            Tool, joint and holder; the spindle joins the far end of the last part.
        coordinate : Coordinate, optional
            Coordinate of motion and load; by default the tip.

        Returns
        -------
        lines, receptance, standard_deviation : ndarray
            The usable lines `(n,)` in Hz, the receptance `(n, 2, 2)` over (x, y) in m/N as `receptance.stability`
            expects it, and the standard deviation of its real and imaginary parts, each.
        """
        rows = np.flatnonzero(self.usable)
        lines = np.asarray(self.frequency_hz)[rows]
        points = [coordinate or Coordinate(), *plane_of(front)]
        h = front.receptance(lines, response=points, excitation=points)
        both = np.eye(2)
        # From each axis at the tip to (axis, y or theta) at the connection plane.
        reach = np.einsum("ab,ni->nabi", both, h[:, 0, 1:]).reshape(-1, 2, 4)
        plane = np.einsum("ab,nij->naibj", both, h[:, 1:, 1:]).reshape(-1, 4, 4)
        coupling = reach @ np.linalg.inv(self.matrix[rows] + plane)
        receptance = h[:, :1, :1] * both - coupling @ reach.transpose(0, 2, 1)
        change = np.einsum("nai,nijm,nbj->nabm", coupling, self.reaction[rows], coupling)
        return lines, receptance, np.sqrt(np.sum(np.abs(change) ** 2, axis=-1))

    def __repr__(self) -> str:
        lines = np.asarray(self.frequency_hz).real
        count = int(self.usable.sum())
        return f"CrossedSpindle({count} of {lines.size} lines from {lines[0]:g} to {lines[-1]:g} Hz are usable)"


def identify_crossed_spindle(
    observations: Mapping[str, Observation | Sequence[Observation]], *, limit: float = 0.2, threads: int | None = None
) -> CrossedSpindle:
    """Identify the receptances of a spindle in x, in y and between them from one axisymmetric blank.

    With hits and responses at two points of the blank each plane gives three responses, and the responses in x to hits
    in y four more. All are linear in X = (G + Y)^-1 over (x, theta_x, y, theta_y), where Y is the receptance of the
    blank in both planes ((S1) in docs/spindle.md).

    Parameters
    ----------
    observations : mapping of str to Observation or sequence of Observation
        By "xx", "yy" and "xy" or "yx": direction of the response, then direction of the hit. The coordinates give the
        positions; their direction "y" is the direction in the key. All of one blank, with standard deviations.
    limit : float, optional
        Largest standard deviation of usable lines, relative to sqrt(|G_ii G_jj|).
    threads : int, optional
        As in `Assembly.receptance`.

    Raises
    ------
    TypeError, ValueError
        A missing or unknown direction, several blanks, or too few independent responses: three are needed in each
        plane, four between them.
    """
    share = _checks.positive("identify_crossed_spindle", "limit", limit)
    axes, observed = _checked(observations)
    observed, lines, rows, _ = common_lines(observed)
    equations = blank_equations(observed, lines, rows, threads)
    response, excitation = -equations.response, equations.excitation
    noise = np.abs(equations.measured) * equations.deviation
    x = np.zeros((lines.size, 4, 4), dtype=np.complex128)
    change = np.zeros((lines.size, 4, 4, len(observed)), dtype=np.complex128)
    for block, entries in _ENTRIES.items():
        chosen = [i for i, axis in enumerate(axes) if axis == block or axis[::-1] == block]
        # By reciprocity "yx" is "xy" with the points exchanged.
        same = np.array([axes[i] == block for i in chosen])[:, None]
        left = np.where(same, response[:, chosen], excitation[:, chosen])
        right = np.where(same, excitation[:, chosen], response[:, chosen])
        products = [left[..., i % 2] * right[..., j % 2] for i, j in entries]
        if block != "xy":
            products[2] = products[2] + left[..., 1] * right[..., 0]
        free = equations.rigid[:, chosen] if block != "xy" else 0.0
        pseudoinverse = _pseudoinverse(np.stack(products, axis=-1), noise[:, chosen], block)
        values = np.einsum("nkm,nm->nk", pseudoinverse, free - equations.measured[:, chosen])
        for k, (i, j) in enumerate(entries):
            x[:, i, j] = x[:, j, i] = values[:, k]
            change[:, i, j, chosen] = change[:, j, i, chosen] = -pseudoinverse[:, k] * noise[:, chosen]
    inverse = np.linalg.inv(x)
    plane = np.einsum("ab,nij->naibj", np.eye(2), equations.surroundings[:, 0]).reshape(-1, 4, 4)
    matrix = inverse - plane
    reaction = -np.einsum("nij,njkm,nkl->nilm", inverse, change, inverse)
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


def _checked(
    observations: Mapping[str, Observation | Sequence[Observation]],
) -> tuple[list[str], tuple[Observation, ...]]:
    """Return directions and observations after checking them."""
    unknown = [axis for axis in observations if axis not in _AXES]
    if unknown:
        raise ValueError(f"observations has the direction {unknown[0]!r}, expected one of {', '.join(_AXES)}")
    for block, entries in _ENTRIES.items():
        count = sum(len(check_observations(observations[axis])) for axis in {block, block[::-1]} & observations.keys())
        if count < len(entries):
            raise ValueError(
                f"there are {count} responses of {block}, expected at least {len(entries)}: at two points of the blank "
                f"{'each response to each hit' if block == 'xy' else 'both drive points and the cross receptance'}; "
                "without coupling of x and y use identify_spindle for each plane"
            )
    pairs = [(axis, observation) for axis, item in observations.items() for observation in check_observations(item)]
    observed = tuple(observation for _, observation in pairs)
    check_blanks(observed)
    if any(observation.assembly != observed[0].assembly for observation in observed):
        raise ValueError("the observations have different assemblies, expected one blank")
    return [axis for axis, _ in pairs], observed


def _pseudoinverse(products: NDArray[np.complex128], noise: NDArray[np.float64], block: str) -> NDArray[np.complex128]:
    """Return the weighted pseudoinverses `(n, k, m)` of a block, from responses to unknowns."""
    weighted = products / noise[..., None]
    size = np.linalg.norm(weighted, axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    scaled = weighted / size
    if np.max(np.linalg.matrix_rank(scaled, tol=1e-9)) < products.shape[-1]:
        raise ValueError(f"the responses of {block} do not determine its terms: hit and measure at two points each")
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-13) / size.transpose(0, 2, 1) / noise[:, None, :])
