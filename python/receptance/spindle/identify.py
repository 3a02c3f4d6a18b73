"""Identification of the receptances of a spindle by inverse coupling with known blanks."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.identification.common_lines import check_observations, common_lines, masked_lines
from receptance.identification.observations import MeasuredFRF
from receptance.identification.pointwise_joint import TERMS, Equations, linear_solution, quadratic_solutions, refine
from receptance.spindle.blanks import Blanks, check_bands, check_blanks
from receptance.spindle.receptance import SpindleReceptance

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
    """Identify the receptances of a spindle at its connection plane from responses of known blanks, line by line.

    Namazi, Altintas, Abe and Rajapakse (2007) measure the tip of a blank, obtain its rotations by finite differences
    and subtract the blank. Let H and Y be the receptances of the free blank between the coordinates and at the plane,
    and r, e those between the plane and each coordinate. The coupled blank has

        H_measured = H - r^T (G + Y)^-1 e,

    one complex equation in the three terms of G for each pair of coordinates. Rotations need not be measured: hits and
    responses at two points of one blank (both drive points and one cross receptance) give three equations, which are
    linear in (G + Y)^-1 and have no truncation error because the blank between the points is known. Several blanks are
    combined by least squares. The observations may include the results of `rotations`.

    Parameters
    ----------
    observations : MeasuredFRF or sequence of MeasuredFRF
        At least three responses in the spindle, with standard deviations. The assembly of each is its blank alone, with
        attached masses such as a sensor; the spindle is connected to the far end of its last part.
    limit : float, optional
        Largest relative standard deviation of each term on usable lines; that of the coupling is relative to
        sqrt(|G_yy G_tt|).
    allow_mismatch : bool, optional
        Warn instead of raising an error if the blanks contradict their responses.
    threads : int, optional
        As in `Assembly.receptance`.

    Returns
    -------
    SpindleReceptance
        The matrix with its covariance and condition number on each line, and the usable lines.

    Raises
    ------
    TypeError, ValueError
        Fewer than three observations, or observations that do not determine the three terms; no standard deviations;
        bands without a common part; an assembly with ground springs or a spindle; blanks that contradict their
        responses: the spindle would be a source of energy, or no spindle explains all responses.

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
            "each; hit and measure at two points of the blank (both drive points and the cross receptance)"
        )
    check_bands(observed)
    observed, lines, rows, dropped = common_lines(observed)
    equations = Blanks.of(observed, lines, threads).equations(observed, rows)
    x, ambiguous, chance = _solve(equations, share)
    with np.errstate(all="ignore"):
        good = np.isfinite(x).all(axis=1) & np.isfinite(equations.cost(np.where(np.isfinite(x), x, 1.0)))
    x = np.where(good[:, None], x, 0.0)
    with np.errstate(all="ignore"):
        rank = np.where(good, equations.rank(x), 0)
    if rank.max(initial=0) < len(TERMS):
        raise ValueError(
            f"the {len(observed)} receptances determine only {rank.max(initial=0)} of the spindle's three terms: "
            "responses to one load are not sufficient; hit at a second point, or use another blank"
        )
    good &= rank == len(TERMS)
    found = _result(equations, observed, lines, x, good, share, (ambiguous, chance), dropped)
    if reason := _mismatch(found, equations):
        if not allow_mismatch:
            raise ValueError(f"{reason}; allow_mismatch=True turns this error into a warning")
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
        reaction, scale = equations.sensitivity(x), equations.scale(x)
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
        notes.append(f"{dropped} lines are omitted because not all measurements have them")
    if not good.all():
        notes.append(masked_lines(lines[~good], good.size))
    if not usable.all():
        notes.append(
            f"{int(usable.sum())} of {usable.size} lines are usable: on the others the standard deviation of a term is "
            f"above {100.0 * share:g} % there or on neighbouring lines, or two spindles explain the responses"
        )
    if (ambiguous & good).any():
        notes.append(
            f"{int((ambiguous & good).sum())} lines are ambiguous and not usable: two spindles explain the responses, "
            "and neither the other lines nor the energy decide; measure another blank or a second point"
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


_APART = 1e-6
"""Relative distance below which two solutions are equal."""
_WIDTH = 0.03
"""Relative change of frequency over which the receptance of a spindle may change by its magnitude."""
_LEAST = 0.05
"""Smallest expected relative change between neighbouring lines."""
_MOST = 60.0
"""Largest cost of one step or one line, which limits the influence of outliers."""
_NEVER = 1e9
"""Cost of a solution that does not exist."""
_ODDS = 12.0
"""Difference of twice the log-likelihood from which a branch is chosen: odds of e^6."""
_NEAR = 4.0
"""Distance of two solutions in standard deviations below which the equations are nonlinear over the noise."""
_AROUND = 8
"""Number of lines on either side in the median of the precision."""


def _solve(equations: Equations, limit: float) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the terms `(n, 3)`, the ambiguous lines, and the lines whose precision is accidental.

    The two solutions of a line explain it equally well. The choice is made for all lines together by the most likely
    path over frequency: a spindle changes little between lines, and it is passive.
    """
    with np.errstate(all="ignore"):
        starts = [
            linear_solution(_subset(equations, pairs)) for pairs in _by_blank(equations) if len(pairs) >= len(TERMS)
        ]
        exact = equations.rigid.shape[1] == len(TERMS)
        none = np.zeros(len(equations.rigid), dtype=np.bool_)
        if starts and exact:
            return starts[0], none, none
        ends = starts or quadratic_solutions(equations)
        if not exact:
            ends = [refine(equations, start) for start in ends]
        if len(ends) == 1:
            return ends[0], none, none
        return _most_likely_path(equations, ends, limit)


def _by_blank(equations: Equations) -> list[list[int]]:
    """Return the observations of each blank."""
    groups: list[list[int]] = []
    for pair in range(equations.rigid.shape[1]):
        own = equations.surroundings[:, pair]
        for group in groups:
            if np.array_equal(equations.surroundings[:, group[0]], own):
                group.append(pair)
                break
        else:
            groups.append([pair])
    return groups


def _subset(equations: Equations, pairs: list[int]) -> Equations:
    """Return the equations of some of the observations."""
    by_pair = ("rigid", "measured", "response", "excitation", "surroundings", "deviation")
    own = {one.name: getattr(equations, one.name) for one in fields(equations)}
    return Equations(**{name: value[:, pairs] if name in by_pair else value for name, value in own.items()})


def _most_likely_path(
    eq: Equations, ends: list[NDArray[np.complex128]], limit: float
) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the most likely path through the solutions, its ambiguous lines, and lines of accidental precision."""
    found = np.stack(ends, axis=1)
    scale = np.stack([eq.scale(x) for x in ends], axis=1)
    costs = np.stack([eq.cost(x) for x in ends], axis=1)
    reaction = np.stack([eq.sensitivity(x) for x in ends], axis=1) * eq.deviation[:, None, None, :] / scale[..., None]
    covariance = reaction @ reaction.conj().swapaxes(-1, -2)
    # Keeps the covariance positive definite under rounding.
    covariance = covariance + 1e-12 * np.einsum("nkii->nk", covariance)[..., None, None] * np.eye(len(TERMS))
    whole = np.asarray(np.isfinite(covariance).all(axis=(2, 3)) & np.isfinite(costs))
    covariance = np.where(whole[..., None, None], covariance, np.eye(len(TERMS)))
    found, scale = np.where(whole[..., None], found, 0.0), np.where(whole[..., None], scale, 1.0)
    best = costs.min(axis=1, keepdims=True)
    own = np.where(whole & np.isfinite(best), costs - np.where(np.isfinite(best), best, 0.0), 0.0)
    if not np.any(eq.angular_frequency.imag):
        own = own + np.stack([_activity(eq, found, covariance, scale, i) for i in range(len(ends))], axis=1)
    own = np.where(whole, np.minimum(own, _MOST), _NEVER)
    w = eq.angular_frequency.real
    steps = _steps(found, covariance, scale, np.clip(np.diff(w) / (_WIDTH * w[1:]), _LEAST, 1.0))
    forward, backward = own.copy(), np.zeros_like(own)
    for line in range(1, len(own)):
        forward[line] += np.min(forward[line - 1][:, None] + steps[line - 1], axis=0)
    for line in range(len(own) - 2, -1, -1):
        backward[line] = np.min(steps[line] + own[line + 1] + backward[line + 1], axis=1)
    total = forward + backward
    chosen, lines = np.argmin(total, axis=1), np.arange(len(own))
    x, cov = found[lines, chosen], covariance[lines, chosen]
    off = (found - x[:, None]) / scale[lines, chosen][:, None]
    apart = whole & (np.abs(off).max(axis=-1) > _APART)
    distance = np.einsum("nki,nki->nk", off.conj(), np.linalg.solve(cov[:, None], off[..., None])[..., 0]).real
    likely = apart & ((total - total[lines, chosen][:, None] < _ODDS) | (distance < _NEAR**2))
    ambiguous = np.any(likely & (own - own[lines, chosen][:, None] < _ODDS), axis=1)
    relative = np.sqrt(np.einsum("nii->ni", cov).real.max(axis=1))
    padded = np.pad(relative, _AROUND, mode="edge")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1), axis=1)
    return np.where(whole[lines, chosen][:, None], x, np.nan), ambiguous, around > limit


def _activity(
    eq: Equations,
    found: NDArray[np.complex128],
    covariance: NDArray[np.complex128],
    scale: NDArray[np.float64],
    which: int,
) -> NDArray[np.float64]:
    """Return minus twice the logarithm of the probability that a solution is passive, `(n,)`."""
    from scipy.special import log_ndtr

    size = scale[:, which]
    matrix, spread = eq.stiffness(found[:, which]), covariance[:, which] * (size[:, :, None] * size[:, None, :])
    usable = np.isfinite(matrix).all(axis=(1, 2)) & (np.abs(np.einsum("nii->ni", matrix)) > 0.0).all(axis=1)
    energy, deviation = _gained(np.where(usable[:, None, None], matrix, np.eye(2)), spread)
    result: NDArray[np.float64] = np.where(usable, -2.0 * log_ndtr(-energy / np.maximum(deviation, 1e-300)), 0.0)
    return result


def _steps(
    found: NDArray[np.complex128],
    covariance: NDArray[np.complex128],
    scale: NDArray[np.float64],
    expected: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the costs of the steps from each solution of a line to each of the next, `(n - 1, k, k)`.

    The cost is minus twice the log-likelihood of the data of the next line, given the solution before and its noise.
    """
    count = found.shape[1]
    result = np.empty((len(found) - 1, count, count))
    for before in range(count):
        for after in range(count):
            size, past = scale[1:, after], scale[:-1, before]
            ratio = past / size
            last = covariance[:-1, before] * (ratio[:, :, None] * ratio[:, None, :])
            change = (0.5 * expected[:, None] * (1.0 + ratio)) ** 2
            spread = last + covariance[1:, after] + change[:, :, None] * np.eye(len(TERMS))
            off = (found[1:, after] - found[:-1, before]) / size
            finite = np.asarray(np.isfinite(spread).all(axis=(1, 2)) & np.isfinite(off).all(axis=1))
            spread = np.where(finite[:, None, None], spread, np.eye(len(TERMS)))
            off = np.where(finite[:, None], off, 0.0)
            squares = np.einsum("ni,ni->n", off.conj(), np.linalg.solve(spread, off[..., None])[..., 0]).real
            growth = np.linalg.slogdet(spread)[1] - np.linalg.slogdet(covariance[1:, after])[1]
            cost = np.minimum(squares, _MOST) + growth
            result[:, before, after] = np.where(finite & np.isfinite(cost), cost, 0.0)
    return result


_UNSUITED = 3.0
"""Root mean square of the residuals of several blanks, in standard deviations, that noise does not reach."""
_SIGNIFICANT = 4.0
_FEW = 0.02
"""Share of the usable lines on which a spindle may be a source of energy by chance."""


def _active(found: SpindleReceptance) -> NDArray[np.bool_]:
    """Return the mask of lines on which the spindle is a source of energy beyond its uncertainty."""
    result = np.zeros(len(found.frequency_hz), dtype=np.bool_)
    rows = np.flatnonzero(found.usable)
    if not rows.size:
        return result
    energy, deviation = _gained(found.matrix[rows], found.covariance[rows])
    result[rows] = energy > _SIGNIFICANT * deviation + 1e-9
    return result


def _gained(
    matrix: NDArray[np.complex128], covariance: NDArray[np.complex128]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the largest relative energy gain over all loads, negative for a passive spindle, and its deviation."""
    root = np.sqrt(np.abs(np.einsum("nii->ni", matrix)))
    _, shapes = np.linalg.eigh(matrix.imag / (root[:, :, None] * root[:, None, :]))
    shape = shapes[:, :, -1] / root
    weights = np.stack([shape[:, 0] ** 2, shape[:, 1] ** 2, 2.0 * shape[:, 0] * shape[:, 1]], axis=1)
    entries = np.stack([matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 0, 1]], axis=1)
    energy = np.einsum("ni,ni->n", weights, entries.imag)
    variance = np.einsum("ni,nij,nj->n", weights, covariance, weights).real
    return energy, np.sqrt(np.maximum(variance, 0.0))


def _mismatch(found: SpindleReceptance, equations: Equations) -> str:
    """Return the reason why the blanks contradict their responses; empty if they do not."""
    if found.rms > _UNSUITED:
        x = np.stack([found.matrix[:, 0, 0], found.matrix[:, 1, 1], found.matrix[:, 0, 1]], axis=1)[found.usable]
        some = equations.select(found.usable)
        off = np.abs(some.evaluate(x)[0] / some.measured - 1.0) / some.deviation
        worst = int(np.argmax(np.median(off, axis=0))) if x.size else 0
        return (
            f"no spindle explains the responses of all blanks: the rms is {found.rms:.3g} standard deviations, most "
            f"of it in {found.labels[worst]!r}; check the dimensions of the blanks, the positions and quantities of "
            "the channels, changes of the spindle between measurements, and the standard deviations"
        )
    if np.iscomplexobj(found.frequency_hz):
        return ""
    wrong = _active(found)
    share = float(wrong.sum()) / max(int(found.usable.sum()), 1)
    if share > _FEW:
        lines = np.asarray(found.frequency_hz)[wrong]
        return (
            f"the spindle would be a source of energy on {int(wrong.sum())} of {int(found.usable.sum())} "
            f"usable lines, the first at {lines[0]:g} Hz: the blank contradicts its responses; check its length, "
            "diameter and material, and the position, sign and quantity of each channel"
        )
    return ""
