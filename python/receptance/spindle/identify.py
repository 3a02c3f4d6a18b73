"""Inverse coupling with the blank removed: what a spindle must be for the blanks in it to answer as they did."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.identification.inversion_input import check_observations, common_lines, masked_lines
from receptance.identification.line_solutions import TERMS, Equations
from receptance.identification.observations import MeasuredFRF
from receptance.spindle.blanks import Blanks, check_bands, check_blanks
from receptance.spindle.plausible import mismatch
from receptance.spindle.receptance import SpindleReceptance
from receptance.spindle.solving import solved

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["identify_spindle"]


def identify_spindle(
    observations: MeasuredFRF | Sequence[MeasuredFRF],
    *,
    limit: float = 0.2,
    allow_mismatch: bool = False,
    threads: int | None = None,
) -> SpindleReceptance:
    """Find a spindle's receptances at its connection plane from responses of known blanks in it, line by line.

    Namazi, Altintas, Abe and Rajapakse (2007) measure the tip of a blank, make its rotations of finite differences and
    take the blank off. With H and Y the receptance of the free blank between the coordinates and at the plane, and r, e
    those from the plane to each coordinate, the coupled blank has

        H_measured = H - r^T (G + Y)^-1 e,

    one complex equation in the three terms of G for each pair of coordinates. Nobody needs to measure a rotation: hits
    and responses at two places of one blank (both drive points and one cross receptance) are three equations, which
    are linear in (G + Y)^-1, and have no truncation error, as the blank between the places is known. Several blanks are
    taken together by least squares. Rotations made by `rotations` may be among the observations.

    Parameters
    ----------
    observations : MeasuredFRF or sequence of MeasuredFRF
        Responses in the spindle, with standard deviations; the assembly of each is its blank alone, as it is, with
        what sits on it (a sensor's mass), the spindle joining the far end of its last part. At least three.
    limit : float, optional
        Standard deviation, as a share of each term, up to which a line is usable; relative to sqrt(|G_yy G_tt|) for
        the coupling.
    allow_mismatch : bool, optional
        Warn instead of refusing where the blanks cannot be those that were measured.
    threads : int, optional
        As in `Assembly.receptance`.

    Returns
    -------
    SpindleReceptance
        The matrix with its covariance and condition number on each line, and which lines are usable.

    Raises
    ------
    TypeError, ValueError
        Fewer than three observations, or such that cannot tell the three terms apart; no standard deviations; bands
        that do not overlap; an assembly that is held or ends with a spindle; blanks that do not match their responses:
        the spindle would have to feed energy into them, or no spindle answers as several of them did.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Coordinate, MeasuredFRF, ModalPart, Mode, Part, Segment
    >>> from receptance.spindle import identify_spindle
    >>> blank = Part([Segment(length=0.1, outer_diameter=0.05, material=STEEL)], name="blank")
    >>> modes = [Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.2, theta=1.0)]
    >>> true = ModalPart(modes=modes, residual_y=5e-9, residual_theta=5e-7, residual_ytheta=2e-8)
    >>> lines, tip, near = np.arange(200.0, 2000.0, 10.0), Coordinate("blank", 0.0), Coordinate("blank", 0.07)
    >>> def measure(response, excitation):
    ...     h = Assembly([blank, true]).receptance(lines, response=response, excitation=excitation)
    ...     return MeasuredFRF(assembly=Assembly([blank]), frequency_hz=lines, receptance=h, standard_deviation=1e-9,
    ...         response=response, excitation=excitation)
    >>> found = identify_spindle([measure(tip, tip), measure(near, tip), measure(near, near)])
    >>> bool(np.allclose(found.matrix, true.receptance(lines), rtol=1e-6)), bool(found.usable.all())
    (True, True)
    """
    observed = check_observations(observations)
    share = _checks.positive("identify_spindle", "limit", limit)
    check_blanks(observed)
    if len(observed) < len(TERMS):
        raise ValueError(
            f"a spindle has three unknown terms on each line, and there are {len(observed)} receptances, one equation "
            "each; hit and measure at two places of the blank (both drive points and the one from the other)"
        )
    check_bands(observed)
    observed, lines, rows, dropped = common_lines(observed)
    equations = Blanks.of(observed, lines, threads).equations(observed, rows)
    x, ambiguous, chance = solved(equations, share)
    with np.errstate(all="ignore"):
        good = np.isfinite(x).all(axis=1) & np.isfinite(equations.cost(np.where(np.isfinite(x), x, 1.0)))
    x = np.where(good[:, None], x, 0.0)
    with np.errstate(all="ignore"):
        rank = np.where(good, equations.rank(x), 0)
    if rank.max(initial=0) < len(TERMS):
        raise ValueError(
            f"the {len(observed)} receptances cannot tell the spindle's three terms apart, only "
            f"{rank.max(initial=0)} of them: all responses to one load are not enough; hit at a second place, or take "
            "another blank"
        )
    good &= rank == len(TERMS)
    found = _result(equations, observed, lines, x, good, share, (ambiguous, chance), dropped)
    if reason := mismatch(found, equations):
        if not allow_mismatch:
            raise ValueError(f"{reason}; allow_mismatch=True goes on all the same")
        warnings.warn(reason, ReceptanceWarning, stacklevel=2)
        found = found.with_note(reason)
    return found


def _result(
    equations: Equations,
    observed: tuple[MeasuredFRF, ...],
    lines: NDArray[Any],
    x: NDArray[np.complex128],
    good: NDArray[np.bool_],
    share: float,
    doubtful: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    dropped: int,
) -> SpindleReceptance:
    ambiguous, chance = doubtful
    with np.errstate(all="ignore"):
        reaction, scale = equations.reaction(x), equations.scale(x)
        relative = reaction / scale[..., None]
        good = good & np.isfinite(relative).all(axis=(1, 2))
        relative = np.where(good[:, None, None], relative, 0.0)
        condition = np.where(good, np.linalg.norm(relative, ord=2, axis=(1, 2)), np.inf)
        moved = np.where(good[:, None, None], reaction * equations.deviation[:, None, :], np.nan)
        covariance = moved @ np.conj(moved).transpose(0, 2, 1)
        deviation = np.sqrt(np.einsum("nii->ni", covariance).real)
        usable = good & (deviation <= share * scale).all(axis=1) & ~ambiguous & ~chance
        unknown = equations.rigid.shape[1] - len(TERMS)
        cost = float(np.sum(equations.cost(x)[good]))
    notes = [note for one in observed for note in one.notes]
    if dropped:
        notes.append(f"{dropped} lines are left out that not all measurements have")
    if not good.all():
        notes.append(masked_lines(lines[~good], good.size))
    if not usable.all():
        notes.append(
            f"{int(usable.sum())} of {usable.size} lines are usable: on the others the standard deviation of some term "
            f"is above {100.0 * share:g} % of it, there or on the lines around, or two spindles explain the responses"
        )
    if (ambiguous & good).any():
        notes.append(
            f"{int((ambiguous & good).sum())} lines are ambiguous and not usable: two spindles explain the responses, "
            "and neither the other lines nor the energy decide; measure one blank more, or a second place"
        )
    return SpindleReceptance(
        frequency_hz=lines,
        matrix=np.where(good[:, None, None], equations.stiffness(x), np.nan),
        covariance=covariance,
        condition=condition,
        usable=usable,
        limit=share,
        ambiguous=ambiguous & good,
        rms=float(np.sqrt(cost / (2.0 * unknown * max(int(good.sum()), 1)))) if unknown else float("nan"),
        labels=tuple(o.label or f"observation {i}" for i, o in enumerate(observed)),
        notes=tuple(dict.fromkeys(notes)),
    )
