"""Receptances of a spindle line by line, with their uncertainty, by inverse coupling with known blanks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance import _checks
from receptance.coupling.blanks import blank_equations, check_blanks
from receptance.coupling.common_lines import check_observations, common_lines
from receptance.coupling.line_equations import (
    TERMS,
    Equations,
    linear_solution,
    masked_lines,
    quadratic_solutions,
    refine,
)
from receptance.errors import warn_user
from receptance.fit.observation import Observation, altered
from receptance.fit.parameters import Parameters
from receptance.fit.unknowns import Tolerance
from receptance.frf import FRF
from receptance.model.terminals import ENTRIES, MeasuredPart
from receptance.report import Column, Provenance, Result, Table
from receptance.report.table import percent


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpindleReceptance(Result):
    """Receptances of a spindle at its connection plane, as identified by `identify_spindle`."""

    frequency_hz: NDArray[np.inexact]
    """`(n,)` lines in Hz, complex if the responses have an exponential window."""
    matrix: NDArray[np.complex128]
    """`(n, 2, 2)` receptance over (y, theta): y/F, y/M, theta/F and theta/M, SI units."""
    covariance: NDArray[np.complex128]
    """`(n, 3, 3)` Hermitian covariance of the errors of y/F, theta/M and y/M, for the real and for the imaginary parts;
    first order in the noise of the responses and in the tolerances of the blanks."""
    condition: NDArray[np.float64]
    """`(n,)` condition number: largest amplification of a relative error of the responses."""
    usable: NDArray[np.bool_]
    """`(n,)` lines on which the relative standard deviation of each term is below `limit` and valid for the noise, and
    which are not ambiguous."""
    limit: float
    """Largest relative standard deviation of usable lines."""
    ambiguous: NDArray[np.bool_]
    """`(n,)` lines on which two spindles explain the responses and the other lines do not decide between them."""
    rms: float
    """Root mean square of the residuals of more than three responses, in standard deviations of noise and tolerances;
    NaN for three responses."""
    labels: tuple[str, ...]
    """Labels of the measurements."""
    mismatch: str = ""
    """Why the blanks contradict their responses; empty if they do not."""
    notes: tuple[str, ...] = field(default=())
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Spindle receptances line by line"
    plotted_by = "receptance.coupling.figure:draw_spindle"

    @property
    def standard_deviation(self) -> NDArray[np.float64]:
        """Standard deviation `(n, 2, 2)` of the real and of the imaginary part, each."""
        deviation = np.sqrt(np.einsum("nii->ni", self.covariance).real)
        result = np.empty(self.matrix.shape)
        for column, (i, j) in enumerate(ENTRIES):
            result[:, i, j] = result[:, j, i] = deviation[:, column]
        return result

    @property
    def decay_rate(self) -> float:
        """Decay rate in 1/s of the window of the responses."""
        return float(-2.0 * np.pi * np.asarray(self.frequency_hz).imag[0]) + 0.0

    def part(self, *, name: str = "spindle") -> MeasuredPart:
        """Return the usable lines as the far end of an assembly, with their covariance.

        Raises
        ------
        ValueError
            No line is usable.
        """
        rows = self._usable_rows()
        return MeasuredPart(
            frequency_hz=np.asarray(self.frequency_hz).real[rows],
            matrix=self.matrix[rows],
            covariance=self.covariance[rows],
            decay_rate=self.decay_rate,
            name=name,
        )

    def as_frf(self) -> FRF:
        """Return the usable lines as an FRF over (y, theta) with the variance of its logarithm, for files."""
        rows = self._usable_rows()
        deviation = self.standard_deviation[rows] / np.abs(self.matrix[rows])
        return FRF(
            frequency_hz=np.asarray(self.frequency_hz).real[rows],
            values=self.matrix[rows],
            responses=["y", "theta"],
            excitations=["y", "theta"],
            decay_rate=self.decay_rate,
            log_variance=deviation**2,
            label="spindle",
            source=f"identify_spindle from {', '.join(self.labels)}",
            notes=self.notes,
        )

    def _usable_rows(self) -> NDArray[np.intp]:
        rows = np.flatnonzero(self.usable)
        if not rows.size:
            raise ValueError(
                f"no line is usable: the relative standard deviation of a term is above {100.0 * self.limit:g} % on "
                "every line; reduce the noise, use a longer or stiffer blank, or increase limit"
            )
        return rows

    def tables(self) -> list[Table]:
        """Return magnitude and standard deviation of each term on the usable lines."""
        columns = (
            "term",
            Column("usable lines", form="d"),
            Column("from, to", "Hz", "g"),
            Column("smallest magnitude", form=".3g"),
            Column("largest", form=".3g"),
            Column("median standard\ndeviation", "%", ".2g"),
        )
        lines = np.asarray(self.frequency_hz).real[self.usable]
        if not lines.size:
            return []
        rows = []
        for name, (i, j) in zip(_NAMES, ENTRIES, strict=True):
            size = np.abs(self.matrix[self.usable, i, j])
            share = 100.0 * float(np.median(self.standard_deviation[self.usable, i, j] / size))
            ends = (float(lines[0]), float(lines[-1]))
            rows.append((name, lines.size, ends, float(size.min()), float(size.max()), share))
        return [Table("Receptances at the connection plane, SI units", columns, rows)]

    def sentences(self) -> list[str]:
        """Return the number of usable lines."""
        return [f"{int(self.usable.sum())} of {self.usable.size} lines are usable, measured: {', '.join(self.labels)}."]

    def data(self) -> dict[str, Any]:
        """Return each term on each line with its standard deviation."""
        names = ("y_over_force", "theta_over_moment", "y_over_moment")
        terms = {}
        for name, (i, j) in zip(names, ENTRIES, strict=True):
            value = self.matrix[:, i, j]
            deviation = self.standard_deviation[:, i, j]
            terms[name] = {"real": value.real, "imaginary": value.imag, "standard_deviation": deviation}
        return {
            "measured": self.labels,
            "frequency_hz": np.asarray(self.frequency_hz).real,
            "decay_rate": self.decay_rate,
            "terms": terms,
            "condition": self.condition,
            "usable": self.usable,
            "limit": self.limit,
            "rms": self.rms,
        }

    def __repr__(self) -> str:
        lines = np.asarray(self.frequency_hz).real
        return (
            f"SpindleReceptance({int(self.usable.sum())} of {lines.size} lines from {lines[0]:g} to {lines[-1]:g} Hz "
            "are usable)"
        )


def identify_spindle(
    observations: Observation | Sequence[Observation],
    *,
    limit: float = 0.2,
    tolerances: Tolerance | Sequence[Tolerance] = (),
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
    observations : Observation or sequence of Observation
        At least three responses in the spindle, with standard deviations. The assembly of each is its blank alone, with
        attached masses such as a sensor; the spindle is connected to the far end of its last part.
    limit : float, optional
        Largest relative standard deviation of each term on usable lines; that of the coupling is relative to
        sqrt(|G_yy G_tt|).
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors of the blanks. They enter the covariance of each line; that they are the same on all lines only the
        covariance of `fit_spindle` contains.
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
    >>> from receptance import STEEL, Assembly, Coordinate, Observation, ModalPart, Mode, Part, Segment
    >>> from receptance.coupling import identify_spindle
    >>> blank = Part([Segment(length=0.1, outer_diameter=0.05, material=STEEL)], name="blank")
    >>> modes = [Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.2, theta=1.0)]
    >>> true = ModalPart(modes=modes, residual_y=5e-9, residual_theta=5e-7, residual_ytheta=2e-8)
    >>> lines, tip, near = np.arange(200.0, 2000.0, 10.0), Coordinate("blank", 0.0), Coordinate("blank", 0.07)
    >>> def measure(response, excitation):
    ...     h = Assembly([blank, true]).receptance(lines, response=response, excitation=excitation)
    ...     return Observation(assembly=Assembly([blank]), frequency_hz=lines, receptance=h, standard_deviation=1e-9,
    ...         response=response, excitation=excitation)
    >>> spindle = identify_spindle([measure(tip, tip), measure(near, tip), measure(near, near)])
    >>> bool(np.allclose(spindle.matrix, true.receptance(lines), rtol=1e-6)), bool(spindle.usable.all())
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
    observed, lines, rows, dropped = common_lines(observed)
    equations = blank_equations(observed, lines, rows, threads)
    x, ambiguous = _solve(equations)
    x, rank = equations.determined(x)
    if rank.max(initial=0) < len(TERMS):
        raise ValueError(
            f"the {len(observed)} receptances determine only {rank.max(initial=0)} of the spindle's three terms: "
            "responses to one load are not sufficient; hit at a second point, or use another blank"
        )
    good = rank == len(TERMS)
    errors = _checks.items("tolerances", tolerances, Tolerance, least=0)
    moved = _moved_by_errors(observed, lines, rows, x, equations, errors, threads)
    spindle = _result(equations, observed, lines, x, good, ambiguous & good, share, moved)
    notes = [note for observation in observed for note in observation.notes]
    if dropped:
        notes.append(f"{dropped} lines are omitted because not all measurements have them")
    notes += spindle.notes
    reason = _mismatch(spindle, equations)
    if reason:
        if not allow_mismatch:
            raise ValueError(f"{reason}; allow_mismatch=True turns this error into a warning")
        warn_user(reason)
        notes.append(reason)
    return replace(spindle, mismatch=reason, notes=tuple(dict.fromkeys(notes)))


def _moved_by_errors(
    observed: tuple[Observation, ...],
    lines: NDArray[np.inexact],
    rows: list[NDArray[np.intp]],
    x: NDArray[np.complex128],
    equations: Equations,
    errors: tuple[Tolerance, ...],
    threads: int | None,
) -> NDArray[np.complex128]:
    """Return the change of the logarithms of the modelled responses by one deviation of each error, `(n, p, t)`.

    The spindle is the same; half the difference of both signs of the error.
    """
    sites = [observation.site(index) for index, observation in enumerate(observed)]
    parameters = Parameters((), errors, sites)
    # Tolerances of one name are one error.
    count, maps = len(parameters.errors), parameters.of(sites)
    result = np.zeros((*equations.measured.shape, count), dtype=np.complex128)
    with np.errstate(all="ignore"):
        for column, unit in enumerate(np.eye(count)):
            sides = []
            for sign in (1.0, -1.0):
                pairs = zip(observed, maps, strict=True)
                moved = tuple(altered(one, assembly=one_map.apply(one.assembly, sign * unit)) for one, one_map in pairs)
                sides.append(blank_equations(moved, lines, rows, threads).evaluate(x)[0])
            result[..., column] = 0.5 * np.log(sides[0] / sides[1])
    return np.where(np.isfinite(result), result, 0.0)


def _result(
    equations: Equations,
    observed: tuple[Observation, ...],
    lines: NDArray[np.inexact],
    x: NDArray[np.complex128],
    good: NDArray[np.bool_],
    ambiguous: NDArray[np.bool_],
    share: float,
    by_errors: NDArray[np.complex128],
) -> SpindleReceptance:
    """Return the spindle with its covariance, usable lines and notes on the lines that are not usable.

    `by_errors` is the change of the modelled responses by the errors of the blanks, `(n, p, t)`.
    """
    with np.errstate(all="ignore"):
        good, relative, condition = equations.conditions(x, good)
        scale = equations.scale(x)
        moved = np.where(good[:, None, None], relative * scale[..., None] * equations.deviation[:, None, :], np.nan)
        covariance = moved @ np.conj(moved).transpose(0, 2, 1)
        change = -np.einsum("nmp,npt->nmt", relative * scale[..., None], by_errors)
        of_blanks = change @ np.conj(change).transpose(0, 2, 1)
        covariance = covariance + of_blanks
        deviation = np.sqrt(np.einsum("nii->ni", covariance).real)
        usable = good & (deviation <= share * scale).all(axis=1) & ~ambiguous
        usable[usable] = _valid_to_first_order(equations.select(usable), x[usable])
        redundant = equations.rigid.shape[1] - len(TERMS)
        cost = float(np.sum(equations.cost(x)[good]))
        # The part of the change by an error that no spindle follows is in the residuals as well.
        value, slope = equations.evaluate(x)
        rest = by_errors + np.einsum("npm,nmt->npt", slope / value[..., None], change)
        expected = float(np.sum(np.abs(rest / equations.deviation[..., None])[good] ** 2))
    notes = []
    if by_errors.any() and usable.any():
        parts = np.einsum("nii->ni", of_blanks).real[usable] / np.einsum("nii->ni", covariance).real[usable]
        shares = ", ".join(f"{percent(part)} of {name}" for name, part in zip(_NAMES, np.median(parts, 0), strict=True))
        notes.append(
            f"share of the tolerances of the blanks in the variance, median over the usable lines: {shares}. The table "
            "takes them as independent between lines; where they are large, identify modes, whose covariance has them "
            "as they are"
        )
    if not good.all():
        notes.append(masked_lines(lines[~good], good.size))
    if not usable.all():
        notes.append(
            f"{int(usable.sum())} of {usable.size} lines are usable: on the others the standard deviation of a term is "
            f"above {100.0 * share:g} %, the noise is too large for a standard deviation, or two spindles explain the "
            "responses"
        )
    if ambiguous.any():
        notes.append(
            f"{int(ambiguous.sum())} lines are ambiguous and not usable: two spindles explain the responses, "
            "and neither the other lines nor the energy decide; measure another blank or a second point"
        )
    return SpindleReceptance(
        frequency_hz=lines,
        matrix=np.where(good[:, None, None], equations.stiffness(x), np.nan),
        covariance=covariance,
        condition=condition,
        usable=usable,
        limit=share,
        ambiguous=ambiguous,
        rms=float(np.sqrt(cost / (2.0 * redundant * max(int(good.sum()), 1) + expected)))
        if redundant
        else float("nan"),
        labels=tuple(observation.title(i) for i, observation in enumerate(observed)),
        notes=tuple(notes),
    )


_NAMES = ("y/F", "theta/M", "y/M")
"""Names of the terms in the order of the covariance."""
_EQUAL = 1e-6
"""Relative distance below which two solutions are equal."""
_WIDTH = 0.03
"""Relative change of frequency over which the receptance of a spindle may change by its magnitude."""
_SMALLEST_CHANGE = 0.05
"""Smallest expected relative change between neighbouring lines."""
_LARGEST_COST = 60.0
"""Largest cost of one step or one line, which limits the influence of outliers."""
_NO_SOLUTION = 1e9
"""Cost of a solution that does not exist."""
_ODDS = 12.0
"""Difference of twice the log-likelihood from which a branch is chosen: odds of e^6."""
_NOISE = np.sqrt(2.0 * len(TERMS))
"""Typical distance of the responses from the true ones, in standard deviations: real and imaginary parts of as many as
there are terms."""
_EXCESS = 1.5
"""Squared distance to which noise may move a solution, relative to that to first order."""


def _solve(equations: Equations) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return the terms `(n, 3)` and the ambiguous lines.

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
            return starts[0], none
        solutions = starts or quadratic_solutions(equations)
        if not exact:
            solutions = [refine(equations, start) for start in solutions]
        if len(solutions) == 1:
            return solutions[0], none
        return _most_likely_path(equations, solutions)


def _valid_to_first_order(equations: Equations, x: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Return on which lines noise moves a solution about as far as its covariance states, `(n,)`.

    Where the responses hardly depend on the spindle, noise moves the solution to where they would: close to the
    negative receptance of the blank, at which both resonate. There it seems precise, on many lines in the same way. So
    the responses are moved by as much as noise moves them, along each principal axis of the covariance, and the
    equations are solved again. A covariance of first order is valid if no solution moves much farther than it states.
    """
    if not len(x):
        return np.zeros(0, dtype=np.bool_)
    with np.errstate(all="ignore"):
        scale = equations.scale(x)
        reaction = equations.sensitivity(x) * equations.deviation[:, None, :] / scale[..., None]
        finite = np.asarray(np.isfinite(reaction).all(axis=(1, 2)))
        ends, sizes, causes = np.linalg.svd(np.where(finite[:, None, None], reaction, 0.0), full_matrices=False)
        farthest = np.where(finite, 0.0, np.inf)
        for cause in np.moveaxis(causes.conj(), 1, 0):
            for side in (1.0, -1.0, 1j, -1j):
                measured = equations.measured * np.exp(side * _NOISE * cause * equations.deviation)
                others = _solutions_near(replace(equations, measured=measured), x)
                off = np.stack([(other - x) / scale for other in others], axis=1)
                components = np.einsum("nmi,nkm->nki", ends.conj(), off) / sizes[:, None, :]
                farthest = np.maximum(farthest, np.min(np.sum(np.abs(components) ** 2, axis=2), axis=1))
        return np.asarray(farthest <= _EXCESS * _NOISE**2)


def _solutions_near(equations: Equations, x: NDArray[np.complex128]) -> list[NDArray[np.complex128]]:
    """Return the solutions of equations that resemble those with the solution `x`."""
    if equations.rigid.shape[1] > len(TERMS):
        return [refine(equations, x)]
    return [linear_solution(equations)] if equations.one_structure else quadratic_solutions(equations)


def _by_blank(equations: Equations) -> list[list[int]]:
    """Return the observations of each blank."""
    groups: list[list[int]] = []
    for pair in range(equations.rigid.shape[1]):
        for group in groups:
            if np.array_equal(equations.surroundings[:, group[0]], equations.surroundings[:, pair]):
                group.append(pair)
                break
        else:
            groups.append([pair])
    return groups


def _subset(equations: Equations, pairs: list[int]) -> Equations:
    """Return the equations of some of the observations."""
    by_pair = ("rigid", "measured", "response", "excitation", "surroundings", "deviation")
    return replace(equations, **{name: getattr(equations, name)[:, pairs] for name in by_pair})


def _most_likely_path(
    eq: Equations, solutions: list[NDArray[np.complex128]]
) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return the most likely path through the solutions, and its ambiguous lines."""
    terms = np.stack(solutions, axis=1)
    scale = np.stack([eq.scale(x) for x in solutions], axis=1)
    misfit = np.stack([eq.cost(x) for x in solutions], axis=1)
    sensitivity = np.stack([eq.sensitivity(x) for x in solutions], axis=1)
    reaction = sensitivity * eq.deviation[:, None, None, :] / scale[..., None]
    covariance = reaction @ reaction.conj().swapaxes(-1, -2)
    # Keeps the covariance positive definite under rounding.
    covariance = covariance + 1e-12 * np.einsum("nkii->nk", covariance)[..., None, None] * np.eye(len(TERMS))
    finite = np.asarray(np.isfinite(covariance).all(axis=(2, 3)) & np.isfinite(misfit))
    covariance = np.where(finite[..., None, None], covariance, np.eye(len(TERMS)))
    terms, scale = np.where(finite[..., None], terms, 0.0), np.where(finite[..., None], scale, 1.0)
    best = misfit.min(axis=1, keepdims=True)
    costs = np.where(finite & np.isfinite(best), misfit - np.where(np.isfinite(best), best, 0.0), 0.0)
    if not np.any(eq.angular_frequency.imag):
        activity = [_activity(eq, terms[:, i], covariance[:, i], scale[:, i]) for i in range(len(solutions))]
        costs = costs + np.stack(activity, axis=1)
    costs = np.where(finite, np.minimum(costs, _LARGEST_COST), _NO_SOLUTION)
    w = eq.angular_frequency.real
    steps = _steps(terms, covariance, scale, np.clip(np.diff(w) / (_WIDTH * w[1:]), _SMALLEST_CHANGE, 1.0))
    forward, backward = costs.copy(), np.zeros_like(costs)
    for line in range(1, len(costs)):
        forward[line] += np.min(forward[line - 1][:, None] + steps[line - 1], axis=0)
    for line in range(len(costs) - 2, -1, -1):
        backward[line] = np.min(steps[line] + costs[line + 1] + backward[line + 1], axis=1)
    total = forward + backward
    chosen, lines = np.argmin(total, axis=1), np.arange(len(costs))
    x = terms[lines, chosen]
    off = (terms - x[:, None]) / scale[lines, chosen][:, None]
    apart = finite & (np.abs(off).max(axis=-1) > _EQUAL)
    likely = apart & (total - total[lines, chosen][:, None] < _ODDS)
    ambiguous = np.any(likely & (costs - costs[lines, chosen][:, None] < _ODDS), axis=1)
    return np.where(finite[lines, chosen][:, None], x, np.nan), ambiguous


def _activity(
    eq: Equations, terms: NDArray[np.complex128], covariance: NDArray[np.complex128], scale: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return minus twice the logarithm of the probability that a solution is passive, `(n,)`."""
    matrix, covariance = eq.stiffness(terms), covariance * (scale[:, :, None] * scale[:, None, :])
    usable = np.isfinite(matrix).all(axis=(1, 2)) & (np.abs(np.einsum("nii->ni", matrix)) > 0.0).all(axis=1)
    energy, deviation = _energy_gain(np.where(usable[:, None, None], matrix, np.eye(2)), covariance)
    return np.where(usable, -2.0 * special.log_ndtr(-energy / np.maximum(deviation, 1e-300)), 0.0)


def _steps(
    terms: NDArray[np.complex128],
    covariance: NDArray[np.complex128],
    scale: NDArray[np.float64],
    expected: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the costs of the steps from each solution of a line to each of the next, `(n - 1, k, k)`.

    The cost is minus twice the log-likelihood of the data of the next line, given the solution before and its noise.
    """
    count = terms.shape[1]
    result = np.empty((len(terms) - 1, count, count))
    for before in range(count):
        for after in range(count):
            size = scale[1:, after]
            ratio = scale[:-1, before] / size
            noise = covariance[:-1, before] * (ratio[:, :, None] * ratio[:, None, :])
            change = (0.5 * expected[:, None] * (1.0 + ratio)) ** 2
            spread = noise + covariance[1:, after] + change[:, :, None] * np.eye(len(TERMS))
            off = (terms[1:, after] - terms[:-1, before]) / size
            finite = np.asarray(np.isfinite(spread).all(axis=(1, 2)) & np.isfinite(off).all(axis=1))
            spread = np.where(finite[:, None, None], spread, np.eye(len(TERMS)))
            off = np.where(finite[:, None], off, 0.0)
            squares = np.einsum("ni,ni->n", off.conj(), np.linalg.solve(spread, off[..., None])[..., 0]).real
            growth = np.linalg.slogdet(spread)[1] - np.linalg.slogdet(covariance[1:, after])[1]
            cost = np.minimum(squares, _LARGEST_COST) + growth
            result[:, before, after] = np.where(finite & np.isfinite(cost), cost, 0.0)
    return result


_LARGEST_RMS = 3.0
"""Root mean square of the residuals of several blanks, in standard deviations, that noise does not reach."""
_SIGNIFICANT = 4.0
"""Energy gain, in standard deviations, beyond which a spindle is a source of energy."""
_ACTIVE_SHARE = 0.02
"""Share of the usable lines, or one line, on which a spindle may be a source of energy by chance."""


def _energy_gain(
    matrix: NDArray[np.complex128], covariance: NDArray[np.complex128]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the largest relative energy gain over all loads, negative for a passive spindle, and its deviation."""
    root = np.sqrt(np.abs(np.einsum("nii->ni", matrix)))
    _, shapes = np.linalg.eigh(matrix.imag / (root[:, :, None] * root[:, None, :]))
    shape = shapes[:, :, -1] / root
    weights = np.stack([shape[:, 0] ** 2, shape[:, 1] ** 2, 2.0 * shape[:, 0] * shape[:, 1]], axis=1)
    entries = np.stack([matrix[:, i, j] for i, j in ENTRIES], axis=1)
    energy = np.einsum("ni,ni->n", weights, entries.imag)
    variance = np.einsum("ni,nij,nj->n", weights, covariance, weights).real
    return energy, np.sqrt(np.maximum(variance, 0.0))


def _mismatch(spindle: SpindleReceptance, equations: Equations) -> str:
    """Return the reason why the blanks contradict their responses; empty if they do not."""
    if spindle.rms > _LARGEST_RMS:
        x = equations.terms_of(spindle.matrix[spindle.usable])
        usable = equations.select(spindle.usable)
        off = np.abs(usable.evaluate(x)[0] / usable.measured - 1.0) / usable.deviation
        worst = int(np.argmax(np.median(off, axis=0))) if x.size else 0
        return (
            f"no spindle explains the responses of all blanks: the rms is {spindle.rms:.3g} standard deviations, most "
            f"of it in {spindle.labels[worst]!r}; check the dimensions of the blanks, the positions and quantities of "
            "the channels, changes of the spindle between measurements, and the standard deviations"
        )
    if np.iscomplexobj(spindle.frequency_hz) or not spindle.usable.any():
        return ""
    energy, deviation = _energy_gain(spindle.matrix[spindle.usable], spindle.covariance[spindle.usable])
    active = energy > _SIGNIFICANT * deviation + 1e-9
    if active.sum() > max(1.0, _ACTIVE_SHARE * active.size):
        lines = np.asarray(spindle.frequency_hz)[spindle.usable][active]
        return (
            f"the spindle would be a source of energy on {lines.size} of {active.size} usable lines, the first at "
            f"{lines[0]:g} Hz: the blank contradicts its responses; check its length, diameter and material, and the "
            "position, sign and quantity of each channel"
        )
    return _negative_stiffness(spindle)


_LOWEST = 2.0
"""The lowest lines are those up to this multiple of the first."""
_FEWEST_LOWEST = 8
_LEAST_SHARE = 0.5
"""Share of the lowest lines that are usable below which they are too few by chance to be judged."""
_MASS_LIKE = 0.8
"""A negative receptance that shrinks below this share over the lowest lines is that of a mass, which falls as 1/f^2."""


def _negative_stiffness(spindle: SpindleReceptance) -> str:
    """Return the reason why a spindle would have a negative static stiffness; empty if it does not.

    Below its modes a structure is a spring, above some of them also a mass, whose negative receptance falls as 1/f^2.
    """
    lines, rows = np.asarray(spindle.frequency_hz).real, np.flatnonzero(spindle.usable)
    if spindle.usable[(lines >= lines[rows[0]]) & (lines <= _LOWEST * lines[rows[0]])].mean() < _LEAST_SHARE:
        return ""
    lowest = rows[lines[rows] <= _LOWEST * lines[rows[0]]]
    rows = lowest if lowest.size >= _FEWEST_LOWEST else rows[:_FEWEST_LOWEST]
    if rows.size < _FEWEST_LOWEST or lines[rows[-1]] > 2.0 * _LOWEST * lines[rows[0]]:
        return ""
    real, covariance = spindle.matrix[rows].real, spindle.covariance[rows]
    middle = np.median(real, axis=0)
    root = np.sqrt(np.abs(np.diag(middle)))
    _, shapes = np.linalg.eigh(middle / np.outer(root, root))
    shape = shapes[:, 0] / root
    flexibility = np.einsum("i,nij,j->n", shape, real, shape)
    weights = np.array([shape[0] ** 2, shape[1] ** 2, 2.0 * shape[0] * shape[1]])
    deviation = np.sqrt(np.einsum("i,nij,j->n", weights, covariance, weights).real)
    mean, scatter = float(np.mean(flexibility)), float(np.sqrt(np.mean(deviation**2) / rows.size))
    quarters = [float(np.median(quarter)) for quarter in np.array_split(flexibility, 4)]
    mass_like = max(quarters) > 0.0 or quarters[-1] > _MASS_LIKE * quarters[0]
    if mean > -_SIGNIFICANT * scatter or mass_like:
        return ""
    return (
        f"the spindle would have a negative static stiffness: at {lines[rows[0]]:g} to {lines[rows[-1]]:g} Hz y/F is "
        f"{middle[0, 0]:.2g} m/N and theta/M {middle[1, 1]:.2g} rad/(N m). The blank is described as more flexible "
        "than it is: check its diameters, modulus and length, and the position and quantity of each channel"
    )
