"""Unknown modes of a spindle in assembled measurements: bounds and starts of their numbers.

A spindle that was never measured alone ends assemblies of tool and holder as a `ModalPart` whose numbers are fitted
together with the joint. Such a fit has many local optima, and steps with a hundred variables are slow, so its start is
built up. Where the records determine the receptances of the spindle line by line, the parameters before its plane are
fitted first, whatever the spindle is (`spindle_elimination`), and the modes are those of these receptances
(`mode_growth`). With fewer records the modes are those that explain the records with the parameters held, from several
starts of these, and a fit of everything on some of the lines tells which start is best. The number of modes is stated,
or the evidence of the records chooses it (`stabilisation`).

Shapes are complex: dampers at bearings couple the modes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import local_maxima
from receptance.coupling.line_equations import Equations
from receptance.coupling.mode_growth import (
    QUANTITIES,
    FittedModes,
    ModeGrowth,
    SpindleLines,
    SpindleResiduals,
    of_records,
)
from receptance.coupling.spindle_elimination import SpindleRecords, few
from receptance.coupling.stabilisation import Stabilisation, criterion, up_to_least
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, Unit, altered
from receptance.fit.parameters import Parameters
from receptance.fit.problem import End, Task, one_blas_thread
from receptance.fit.unknowns import Tolerance, Unknown
from receptance.model.assembly import Assembly
from receptance.model.terminals import MODE_ADDRESS, RESIDUALS, ModalPart

_DAMPING = (1e-3, 0.03, 0.3)
"""Lower bound, start and upper bound of damping ratios."""
_FREQUENCY = 2.0
"""Factor between bounds and start of a given natural frequency: holder and tool change those of the spindle."""
_BELOW = 4.0
"""Factor between the first line and the lower bound of other natural frequencies."""
_BEYOND = 1.5
"""Factor between their upper bound and the last line. A mode far beyond has the effect of a residual, and a fit with
both moves along a valley."""
_FAR = 3.0
"""A second such factor where the records determine the spindle line by line. With one of them modes may end in the
wrong places or at their bound, and errors of the holder make up for it; the better fit is used."""
_ABOVE = 1.05
"""Ratio of a natural frequency to the last line from which a mode is above the lines."""
_KEPT = (4, 5)
"""Imaginary parts of the shape, which such a mode keeps as they are described."""
_SHAPE = 10.0
"""Bounds of y, relative to the largest start."""
_SLOPE = 5.0
"""Bound of theta, relative to y over the length of the part before the plane."""
_RESIDUAL = 10.0
"""Bound of residuals, relative to the static compliance of the modes at their start."""
_PROMINENCE = 0.2
"""Prominence of peaks of the logarithm of the mean FRF."""
_SAME = 0.1
"""Relative distance within which a peak belongs to a mode with a given frequency."""
_UNWEIGHTED = 0.01
"""Relative standard deviation of observations without one."""
_TRIED_LINES = 150
"""Largest number of lines on which a further mode is tried."""
_NEAR = 2.0
"""Ratio of chi-square of modes to that of any spindle below which the records are linear about the modes."""
_LINES = 200
"""Lines of each FRF in the fit of everything."""
_EVALUATIONS = 60
"""Largest number of evaluations of the modes alone, and of everything, in this fit."""
_LEAST = 1e-2
"""Decrease of the cost at which this fit has converged."""


class ModeChoice(NamedTuple):
    """Which fit of the modes of an unknown spindle is used."""

    further: int = 0
    """Number of modes beyond that which the records show, where they choose it, if so many are fitted."""
    rank: int = 0
    """Rank of the fit among those with either limit of natural frequencies: 0 is the better one."""


FEWEST_MODES = ModeChoice()
"""The better fit without further modes."""


def bounds_of_modes(
    name: str,
    given: Sequence[Mapping[str, float]],
    residuals: Mapping[str, float],
    observations: Sequence[Observation],
) -> list[Unknown]:
    """Return the numbers of a modal part as unknowns, with bounds and starts from FRFs of assemblies with the part.

    `given` are known numbers of each mode in SI units, which become starts, as do the residuals. The unknowns are
    frequency, damping ratio and complex shape of each mode, and the residuals. The start of a natural frequency that is
    not given is one of the lowest peaks of the mean FRF.
    """
    lines, logarithm = _mean(observations)
    frequencies = _frequencies([mode.get("frequency_hz") for mode in given], lines, logarithm)
    length = _length(observations[0].assembly)
    lowest, middle, highest = _DAMPING
    # At its peak a mode has |H| = y^2 / (2 zeta w^2).
    w = 2.0 * np.pi * np.array(frequencies)
    sizes = w * np.sqrt(2.0 * middle * np.exp(np.interp(frequencies, lines, logarithm)))
    sizes = np.array([abs(mode.get("y", 0.0)) or size for mode, size in zip(given, sizes.tolist(), strict=True)])
    reach = _SHAPE * float(sizes.max())
    unknowns: list[Unknown] = []
    for index, (mode, frequency, size) in enumerate(zip(given, frequencies, sizes.tolist(), strict=True)):
        address = f"{name}.mode[{index}]"
        below, above = float(lines[0]) / _BELOW, float(lines[-1]) * _BEYOND
        if "frequency_hz" in mode:
            below, above = frequency / _FREQUENCY, frequency * _FREQUENCY
        damping = mode.get("damping_ratio", middle)
        # The sign of a whole shape is free.
        turned = -1.0 if mode.get("y", 0.0) < 0.0 else 1.0
        theta = turned * mode.get("theta", 0.0)
        slope = max(_SLOPE * reach / length, 2.0 * abs(theta))
        unknowns += [
            _around(f"{address}.frequency_hz", frequency, below, above),
            _around(f"{address}.damping_ratio", damping, min(lowest, damping / 2.0), max(highest, 2.0 * damping)),
            _around(f"{address}.y", size, -reach, reach),
            _around(f"{address}.theta", theta, -slope, slope),
            _around(f"{address}.y_imaginary", turned * mode.get("y_imaginary", 0.0), -reach, reach),
            _around(f"{address}.theta_imaginary", turned * mode.get("theta_imaginary", 0.0), -slope, slope),
        ]
    compliance = float(np.sum((sizes / w) ** 2))
    for residual, unit in zip(RESIDUALS, (1.0, 1.0 / length**2, 1.0 / length), strict=True):
        value = residuals.get(residual, 0.0)
        limit = max(_RESIDUAL * compliance * unit, 2.0 * abs(value))
        unknowns.append(_around(f"{name}.{residual}", value, -limit, limit))
    return unknowns


def _around(address: str, start: float, lower: float, upper: float) -> Unknown:
    return Unknown(address=address, lower=float(lower), upper=float(upper), start=float(start))


def _length(assembly: Assembly) -> float:
    """Return the length in m of the last part before the modal part."""
    return float([*assembly.parts.values()][-1].length)


def _mean(observations: Sequence[Observation]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return lines in Hz, and the mean logarithm of the magnitudes of all FRFs that cover each line."""
    grids = [observation.frequency_hz.real for observation in observations]
    lines: NDArray[np.float64] = np.unique(np.concatenate(grids))
    rows = []
    for grid, observation in zip(grids, observations, strict=True):
        magnitude: NDArray[np.inexact] = np.abs(observation.receptance)
        rows.append(np.interp(lines, grid, np.log(np.maximum(magnitude, 1e-300)), left=np.nan, right=np.nan))
    mean: NDArray[np.float64] = np.nanmean(rows, axis=0)
    return lines, mean


def _peaks(lines: NDArray[np.float64], logarithm: NDArray[np.float64]) -> list[float]:
    return [float(f) for f in lines[local_maxima(logarithm, _PROMINENCE)[0]]]


def _frequencies(
    given: Sequence[float | None], lines: NDArray[np.float64], logarithm: NDArray[np.float64]
) -> list[float]:
    """Return a frequency for each mode: the given one, or one of the lowest peaks in ascending order."""
    stated = [frequency for frequency in given if frequency is not None]
    missing = len(given) - len(stated)
    # A free structure that joins the plane raises no natural frequency: the n-th of the assembly is at most that
    # of the spindle (separation of eigenvalues). So the lowest peaks are taken, not the highest.
    free = [f for f in _peaks(lines, logarithm) if all(abs(f - other) > _SAME * other for other in stated)][:missing]
    # Modes without a peak are distributed over the band.
    rest = missing - len(free)
    free += [float(f) for f in np.geomspace(max(lines[0], 0.01 * lines[-1]), lines[-1], rest + 2)[1:-1]]
    waiting = iter(free)
    return [next(waiting) if frequency is None else frequency for frequency in given]


@one_blas_thread()
def start_modes(
    observations: Sequence[Observation],
    unknowns: Sequence[Unknown],
    name: str,
    *,
    by_evidence: bool = False,
    choice: ModeChoice = FEWEST_MODES,
    tolerances: Sequence[Tolerance] = (),
    starts: int = 1,
    seed: int = 0,
    threads: int | None = None,
) -> tuple[list[Unknown], list[Tolerance], Stabilisation | None]:
    """Return unknowns and tolerances with starts for a fit of the modes of the part `name` and of all others.

    The observations all have standard deviations or none; the unknowns include those of `bounds_of_modes`. `starts` is
    the number of starts, drawn with the seed, of the parameters before the plane where the records do not determine the
    spindle line by line. Observations without a common line leave the starts as they are.

    The third result has the modes by their number, None without a common line. With `by_evidence` the unknowns are
    those of as many modes as the records show, and of further ones by `choice`; the others of the part have no effect.
    Then a common line is needed (`ReceptanceError`).
    """
    observed = list(observations)
    if not all(observation.weighted for observation in observed):
        # Without weights only the relative sizes of residuals count, here all alike.
        observed = [altered(o, standard_deviation=_UNWEIGHTED * _sizes(o)) for o in observed]
    modal = [unknown for unknown in unknowns if unknown.address.startswith(f"{name}.")]
    others = [unknown for unknown in unknowns if unknown not in modal]
    records = SpindleRecords.of(observed, others, name, tolerances, threads)
    if records is None:
        if by_evidence:
            raise ReceptanceError(
                f"the number of modes of {name} cannot be chosen, because its records have no common lines; "
                "expected records of one band, or a number of modes"
            )
        return list(unknowns), list(tolerances), None
    terminal = records.terminal
    if not isinstance(terminal, ModalPart):
        raise TypeError(f"{name!r} is {terminal!r}, expected a modal part")
    part = _Modes(name, terminal, {unknown.address: unknown for unknown in modal})

    spindle = records.eliminated(seed)
    if spindle is not None:
        near = _NEAR * spindle.chi_square
        # Modes have fewer numbers than a spindle on each line, so their chi-square is larger.
        count, explained = records.independent_values, near / records.share_of_residuals
        fits: list[tuple[FittedModes, Stabilisation]] = []
        for beyond in (_BEYOND, _FAR):
            steps = part.steps(records.lines_hz, _residuals_on(spindle), records.about, near, beyond)
            fits.append(
                _fit_of_modes(
                    part.name, steps, records, observed, by_evidence=by_evidence, further=choice.further, near=explained
                )
            )
        fits.sort(key=lambda result: criterion(result[0], count))
        fit, chosen = fits[choice.rank]
        # Modes far from the records move everything before the plane beyond the range of its linear effect.
        about = records.about(fit.before, fit.entries) if fit.chi_square < near else None
        start = records.named(spindle.x if about is None else about.x)
        errors = [replace(tolerance, start=start[tolerance.name]) for tolerance in tolerances]
        return _turned([*_started(others, start), *part.started(fit)], name), errors, chosen
    records = records.thinned()
    sites = [observation.site(i) for i, observation in enumerate(observed)]
    units: list[Unit] = ["standard deviations"] * len(observed)
    ends = []
    for x in records.starts(starts, seed):
        values = records.named(x)
        steps = part.steps(records.lines_hz, _of_equations(records.equations(x)))
        fit, chosen = _fit_of_modes(
            part.name, steps, records, observed, by_evidence=by_evidence, further=choice.further
        )
        begun = [*_started(others, values), *part.started(fit)]
        errors = [replace(tolerance, start=values.get(tolerance.name, 0.0)) for tolerance in tolerances]
        task = Task(tuple(observed), Parameters(begun, errors, sites), tuple(units), threads=threads)
        end = _fitted(task, name)
        size = 2.0 * end.cost + fit.free * float(np.log(records.independent_values))
        ends.append((size, end, task, begun, chosen))
    _, end, task, begun, chosen = min(ends, key=lambda each: each[0])
    values = dict(zip(task.variables.names, task.variables.to_values(end.x).tolist(), strict=True))
    errors = [replace(tolerance, start=values[tolerance.name]) for tolerance in tolerances]
    return _turned(part.ascending(_started(begun, values)), name), errors, chosen


def _fit_of_modes(
    name: str,
    steps: Iterator[FittedModes],
    records: SpindleRecords,
    observed: Sequence[Observation],
    *,
    by_evidence: bool,
    further: int,
    near: float = float("inf"),
) -> tuple[FittedModes, Stabilisation]:
    """Return the fit that is used, see `Stabilisation.used`, and the fits with each number of modes."""
    frf = next(o for o in observed if o.is_receptance and name in o.assembly.elements)
    fits = up_to_least(steps, records.independent_values, near) if by_evidence else tuple(steps)
    stabilisation = Stabilisation(
        name=name,
        fits=fits,
        count=records.count,
        values=records.independent_values,
        lines_hz=frf.frequency_hz.real,
        magnitude=np.abs(frf.receptance),
        measured=frf.label,
        stated=None if by_evidence else len(fits) - 1,
        further=further,
    )
    return fits[stabilisation.used], stabilisation


def _residuals_on(records: SpindleLines) -> Callable[[NDArray[np.intp]], SpindleResiduals]:
    """Return a function that returns the residuals of the records on some of their lines."""
    return lambda lines: records.select(lines).residuals()


def _of_equations(equations: Equations) -> Callable[[NDArray[np.intp]], SpindleResiduals]:
    """Return the same for records with everything before the plane held."""
    return lambda lines: of_records(equations.select(lines))


def _started(unknowns: Sequence[Unknown], values: Mapping[str, float]) -> list[Unknown]:
    """Return unknowns that start at the values by name, within their bounds."""
    return [
        replace(unknown, start=float(np.clip(values[unknown.name], unknown.lower, unknown.upper)))
        if unknown.name in values
        else unknown
        for unknown in unknowns
    ]


def _turned(unknowns: Sequence[Unknown], name: str) -> list[Unknown]:
    """Return unknowns of which each shape starts with a positive y, as far as bounds are symmetric."""
    shapes: dict[str, dict[str, Unknown]] = {}
    for unknown in unknowns:
        match = MODE_ADDRESS.fullmatch(unknown.address)
        if match and match[1] == name and match[3] in QUANTITIES[2:]:
            shapes.setdefault(match[2], {})[match[3]] = unknown
    turned = {
        unknown.name: replace(unknown, start=-(unknown.start or 0.0))
        for shape in shapes.values()
        if "y" in shape and (shape["y"].start or 0.0) < 0.0
        if all(unknown.lower == -unknown.upper for unknown in shape.values())
        for unknown in shape.values()
    }
    return [turned.get(unknown.name, unknown) for unknown in unknowns]


def _sizes(observation: Observation) -> NDArray[np.float64]:
    """Return what a relative deviation of an observation refers to: one for a receptance, else its frequencies."""
    frequency = observation.frequency_hz.real
    return np.ones(frequency.size) if observation.is_receptance else frequency


def _fitted(task: Task, name: str) -> End:
    """Return the end of a fit on some lines: of the modes alone, then of everything."""
    variables, problem = task.variables, task.problem()
    few = problem.thinned(_LINES) or problem
    modes = np.array([title.startswith(f"{name}.") for title in variables.names])
    end = few.fit_one(variables.start, _EVALUATIONS, free=modes, least=_LEAST)
    return few.fit_one(end.x, _EVALUATIONS, least=_LEAST)


@dataclass(frozen=True)
class _Modes:
    """The numbers of a modal part, of which some are unknowns."""

    name: str
    part: ModalPart
    unknowns: Mapping[str, Unknown]
    """Unknowns of the part by address."""

    def steps(
        self,
        lines_hz: NDArray[np.inexact],
        residuals_on: Callable[[NDArray[np.intp]], SpindleResiduals],
        about: Callable[[NDArray[np.float64], NDArray[np.complex128]], SpindleLines | None] | None = None,
        near: float = 0.0,
        beyond: float = _BEYOND,
    ) -> Iterator[FittedModes]:
        """Yield the fits of no mode, of one and so on.

        The imaginary part of the shape of a mode above the lines is held as it is described.

        Parameters
        ----------
        lines_hz : ndarray
            `(n,)` lines.
        residuals_on : callable
            Returns the residuals on some of the lines.
        about : callable, optional
            Returns the records about variables before the plane and entries of the spindle, or None where the model
            has no value. Further fits are about those of a fit whose chi-square is below `near`.
        beyond : float
            Factor between the last line and the highest natural frequency of a mode.
        """
        may_leave = about is None
        on_all, on_some = self._growths(lines_hz, residuals_on, beyond, may_leave=may_leave)
        fit = on_all.first([getattr(self.part, quantity) for quantity in RESIDUALS])
        yield fit
        for _ in self.part.modes:
            fit = on_all.fitted(on_some.with_next(fit))
            lines = about(fit.before, fit.entries) if about is not None and fit.chi_square < near else None
            if lines is not None:
                residuals_on = _residuals_on(lines)
                on_all, on_some = self._growths(lines_hz, residuals_on, beyond, may_leave=may_leave)
                fit = on_all.fitted(fit)
            yield fit

    def _growths(
        self,
        lines_hz: NDArray[np.inexact],
        residuals_on: Callable[[NDArray[np.intp]], SpindleResiduals],
        beyond: float,
        *,
        may_leave: bool,
    ) -> tuple[ModeGrowth, ModeGrowth]:
        """Return the growth of modes on all lines, and on those on which further modes are tried.

        `may_leave` is whether a mode may cross the end of the lines. Where the records do not determine the spindle
        line by line it must, because it may start far from its place.
        """
        residuals = [getattr(self.part, quantity) for quantity in RESIDUALS]
        limits = np.array([self._bounds(name, value) for name, value in zip(RESIDUALS, residuals, strict=True)])
        below, above = self._on_both_sides(float(lines_hz.real[-1]), beyond)

        def growth(lines: NDArray[np.intp]) -> ModeGrowth:
            return ModeGrowth(
                lines_hz=lines_hz[lines],
                residuals_of=residuals_on(lines),
                bounds=self._bounds_of_modes,
                below=None if may_leave else below,
                above=above,
                residual_bounds=limits,
            )

        return growth(np.arange(lines_hz.size)), growth(few(lines_hz.size, _TRIED_LINES))

    def started(self, fit: FittedModes) -> list[Unknown]:
        """Return the unknowns of the fitted modes, which start there."""
        modes, chosen = _in_order(fit.modes, fit.bounds, self._bounds_of_modes)
        numbers = dict(zip((f"{self.name}.{quantity}" for quantity in RESIDUALS), fit.residuals.tolist(), strict=True))
        sides: dict[str, tuple[float, float]] = {}
        for index, (row, pairs) in enumerate(zip(modes.tolist(), chosen.tolist(), strict=True)):
            for quantity, value, (low, high) in zip(QUANTITIES, row, pairs, strict=True):
                address = f"{self.name}.mode[{index}].{quantity}"
                numbers[address], sides[address] = value, (low, high)
        unknowns = []
        for address, unknown in self.unknowns.items():
            low, high = sides.get(address, (unknown.lower, unknown.upper))
            if address in numbers and low < high:
                unknowns.append(
                    replace(unknown, lower=low, upper=high, start=float(np.clip(numbers[address], low, high)))
                )
        return unknowns

    def ascending(self, unknowns: Sequence[Unknown]) -> list[Unknown]:
        """Return unknowns in which modes with equal bounds, as described, start in ascending order of their frequency.

        Each keeps its numbers and its own bounds under another address.
        """
        starts = {
            int(match[2]): unknown.start or 0.0
            for unknown in unknowns
            if (match := MODE_ADDRESS.fullmatch(unknown.address))
            and match[1] == self.name
            and match[3] == QUANTITIES[0]
        }
        indices = sorted(starts)
        modes = np.array([[starts[index], float(index)] for index in indices]).reshape(-1, 2)
        order, _ = _in_order(modes, modes, self._bounds_of_modes[indices])
        number = {int(before): after for (_, before), after in zip(order.tolist(), indices, strict=True)}

        def renamed(unknown: Unknown) -> Unknown:
            match = MODE_ADDRESS.fullmatch(unknown.address)
            if match is None or match[1] != self.name or int(match[2]) not in number:
                return unknown
            return replace(unknown, address=f"{self.name}.mode[{number[int(match[2])]}].{match[3]}")

        def place(unknown: Unknown) -> float:
            match = MODE_ADDRESS.fullmatch(unknown.address)
            if match is not None and match[1] == self.name:
                return float(match[2])
            return np.inf if unknown.address in self.unknowns else -1.0

        return sorted(map(renamed, unknowns), key=place)

    @cached_property
    def _described(self) -> NDArray[np.float64]:
        """Numbers of each mode as described, `(m, 6)`."""
        return np.array([[getattr(mode, quantity) for quantity in QUANTITIES] for mode in self.part.modes])

    @cached_property
    def _bounds_of_modes(self) -> NDArray[np.float64]:
        """Bounds of these numbers, `(m, 6, 2)`; equal where a number is no unknown."""
        pairs = [
            self._bounds(f"mode[{index}].{quantity}", value)
            for index, row in enumerate(self._described.tolist())
            for quantity, value in zip(QUANTITIES, row, strict=True)
        ]
        return np.array(pairs).reshape(*self._described.shape, 2)

    def _bounds(self, quantity: str, value: float) -> tuple[float, float]:
        unknown = self.unknowns.get(f"{self.name}.{quantity}")
        return (value, value) if unknown is None else (unknown.lower, unknown.upper)

    def _on_both_sides(self, last: float, beyond: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the bounds of each mode below the limit that belongs to a last line, and those of one above it.

        They are the same for a mode whose numbers are in part described, or whose bounds are on one side. A mode
        without stated bounds may be as many times `beyond` the last line.
        """
        limit = _ABOVE * last
        below = self._bounds_of_modes.copy()
        above = below.copy()
        for index, (low, high) in enumerate(below[:, 0]):
            if np.all(below[index, :, 0] < below[index, :, 1]) and low < limit < high:
                below[index, 0, 1] = above[index, 0, 0] = limit
                above[index, _KEPT] = self._described[index, _KEPT, None]
                if np.isclose(high, _BEYOND * last, rtol=1e-6):
                    above[index, 0, 1] = beyond * last
        return below, above


def _in_order(
    modes: NDArray[np.float64], limits: NDArray[np.float64], bounds: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return modes and their bounds, those of equal bounds at first in ascending order."""
    modes, limits = modes.copy(), limits.copy()
    for index in range(len(modes)):
        alike = [i for i in range(len(modes)) if np.array_equal(bounds[i], bounds[index])]
        if alike[0] == index:
            ascending = [alike[i] for i in np.argsort(modes[alike, 0])]
            modes[alike], limits[alike] = modes[ascending], limits[ascending]
    return modes, limits
