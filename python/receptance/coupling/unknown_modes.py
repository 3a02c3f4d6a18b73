"""Unknown modes of a spindle in assembled measurements: bounds and starts of their numbers.

A spindle that was never measured alone ends assemblies of tool and holder as a `ModalPart` whose numbers are fitted
together with the joint. Such a fit has many local optima, so its start is built up mode by mode. The first modes are
those with a peak in the measured FRFs, fitted by continuation. Each further mode is the one that reduces the residuals
most to first order, and all numbers are fitted again after it.

To first order the mode (y, theta) at w_r changes the logarithm of each receptance H by

    (H_yy y^2 + H_tt theta^2 + H_yt y theta) / (H (w_r^2 - w^2 + 2 i zeta w_r w)),

where H_yy, H_tt and H_yt are the derivatives of H with respect to the residuals of the terminal. Effects that the
numbers fitted so far can have as well are removed by projection.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from receptance._peaks import local_maxima
from receptance.fit.observation import Observation, Unit, altered
from receptance.fit.parameters import Parameters
from receptance.fit.problem import Problem, Task
from receptance.fit.search import fit_staged
from receptance.fit.unknowns import Tolerance, Unknown
from receptance.model.assembly import Assembly
from receptance.model.terminals import RESIDUALS

_DAMPING = (1e-3, 0.03, 0.3)
"""Lower bound, start and upper bound of damping ratios."""
_FREQUENCY = 2.0
"""Factor between bounds and start of a given natural frequency: holder and tool change those of the spindle."""
_BEYOND = 4.0
"""Factor between the ends of the measured band and the bounds of other natural frequencies."""
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
_SAME_LINE = 1e-6
"""Relative distance within which a start is at a peak."""
_LINES = 200
"""Largest number of lines of each FRF while modes are added."""
_CANDIDATES = 80
"""Natural frequencies at which a further mode is tried."""
_RATIOS = (0.02, 0.08)
"""Damping ratios of these modes."""
_ANGLES = 24
"""Ratios of theta to y of these modes."""
_TRIED = 3
"""Number of the best candidates that are fitted."""
_APART = 0.1
"""Least relative distance of the natural frequencies of two of them."""
_EVALUATIONS = 40
"""Largest number of evaluations of each of these fits."""
_MODE = re.compile(r"(.+)\.mode\[(\d+)\]\.(\w+)")


def bounds_of_modes(
    name: str,
    given: Sequence[Mapping[str, float]],
    residuals: Mapping[str, float],
    observations: Sequence[Observation],
) -> list[Unknown]:
    """Return the numbers of a modal part as unknowns, with bounds and starts from FRFs of assemblies with the part.

    `given` are known numbers of each mode in SI units, which become starts, as do the residuals. The unknowns are
    frequency, damping ratio, y and theta of each mode, and the residuals. The start of a natural frequency that is not
    given is one of the lowest peaks of the mean FRF.
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
        below, above = float(lines[0]) / _BEYOND, float(lines[-1]) * _BEYOND
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


@dataclass(frozen=True)
class _Modes:
    """The unknowns of the modal part `name`: of each mode the unknowns by field."""

    name: str
    modes: tuple[dict[str, Unknown], ...]

    @classmethod
    def among(cls, name: str, unknowns: Sequence[Unknown]) -> _Modes:
        """Return the unknowns of a part by mode."""
        modes: dict[int, dict[str, Unknown]] = {}
        for unknown in unknowns:
            match = _MODE.fullmatch(unknown.address)
            if match is not None and match[1] == name and not unknown.tied and unknown.configurations is None:
                modes.setdefault(int(match[2]), {})[match[3]] = unknown
        return cls(name, tuple(modes[index] for index in sorted(modes)))

    def may_grow(self, index: int) -> bool:
        """Return whether all numbers of a mode are unknown and its shape may be zero."""
        mode = self.modes[index]
        if not {"frequency_hz", "damping_ratio", "y", "theta"} <= mode.keys():
            return False
        return all(mode[key].scale == "linear" and mode[key].lower < 0.0 < mode[key].upper for key in ("y", "theta"))


def start_modes(
    observations: Sequence[Observation],
    unknowns: Sequence[Unknown],
    name: str,
    *,
    tolerances: Sequence[Tolerance] = (),
    starts: int = 1,
    seed: int = 0,
    threads: int | None = None,
) -> list[Unknown]:
    """Return unknowns whose starts are those of a fit in which the modes of a modal part were added one at a time.

    The observations all have standard deviations or none; the unknowns include those of `bounds_of_modes`. `starts` is
    the number of starts, drawn with the seed, of the fit with the modes that have a peak.
    """
    observed = tuple(_thinned(observation) for observation in observations)
    part = _Modes.among(name, unknowns)
    frfs = [
        observation
        for observation in observations
        if observation.is_receptance and name in observation.assembly.elements
    ]
    peaks = _peaks(*_mean(frfs))
    without_peak = [
        index
        for index, mode in enumerate(part.modes)
        if part.may_grow(index)
        and not any(abs(_start_of(mode["frequency_hz"]) - peak) < _SAME_LINE * peak for peak in peaks)
    ]
    task = _task(observed, unknowns, tolerances, threads)
    columns = {name: column for column, name in enumerate(task.variables.names)}
    growth = _Growth(task, task.problem(), part, columns)
    # A fit that begins with all peaks may have a tool's peak among them; one that begins with a mode has fewer hints.
    after_first = [index for index in range(len(part.modes)) if part.may_grow(index)][1:]
    ends = []
    for waiting in (without_peak, after_first) if without_peak != after_first else (after_first,):
        first = _begun(observed, unknowns, part, waiting, tolerances, starts, seed, threads)
        absent = {part.modes[index][key].name: 0.0 for index in waiting for key in ("y", "theta")}
        x = growth.at({**first, **absent})
        for count, index in enumerate(waiting):
            x = growth.add(x, index, waiting[count + 1 :])
        ends.append((growth.problem.cost(x), x))
    return growth.started(min(ends, key=lambda end: end[0])[1], unknowns)


def _thinned(observation: Observation) -> Observation:
    if not observation.is_receptance or observation.frequency_hz.size <= _LINES:
        return observation
    count = observation.frequency_hz.size
    return observation.select(np.unique(np.linspace(0, count - 1, _LINES).round().astype(np.intp)))


def _start_of(unknown: Unknown) -> float:
    """Return the start, which every unknown has once it is made."""
    assert unknown.start is not None
    return unknown.start


def _task(
    observed: Sequence[Observation],
    unknowns: Sequence[Unknown],
    tolerances: Sequence[Tolerance],
    threads: int | None,
) -> Task:
    parameters = Parameters(unknowns, tolerances, [observation.site(i) for i, observation in enumerate(observed)])
    weighted = all(observation.weighted for observation in observed)
    units: list[Unit] = ["standard deviations" if weighted else observation.unit for observation in observed]
    return Task(tuple(observed), parameters, tuple(units), threads=threads)


def _begun(
    observed: Sequence[Observation],
    unknowns: Sequence[Unknown],
    part: _Modes,
    waiting: Sequence[int],
    tolerances: Sequence[Tolerance],
    starts: int,
    seed: int,
    threads: int | None,
) -> dict[str, float]:
    """Return the values of a fit by continuation without the waiting modes, from narrow bounds around the starts."""
    absent = {unknown.name for index in waiting for unknown in part.modes[index].values()}
    narrow: dict[str, Unknown] = {}
    for index, mode in enumerate(part.modes):
        if index in waiting or not part.may_grow(index):
            continue
        frequency, y, theta = mode["frequency_hz"], mode["y"], mode["theta"]
        f, size = _start_of(frequency), abs(_start_of(y)) or y.upper / _SHAPE
        narrow[frequency.name] = replace(
            frequency, lower=max(frequency.lower, f / _FREQUENCY), upper=min(frequency.upper, f * _FREQUENCY)
        )
        narrow[y.name] = replace(
            y, lower=size / _SHAPE, upper=min(y.upper, size * _SHAPE), start=min(size, y.upper), scale="log"
        )
        slope = max(theta.upper * min(size * _SHAPE / y.upper, 1.0), 2.0 * abs(_start_of(theta)))
        narrow[theta.name] = replace(theta, lower=max(theta.lower, -slope), upper=min(theta.upper, slope))
    zero = {f"{part.name}.mode[{index}].{key}": 0.0 for index in waiting for key in ("y", "theta")}
    without = []
    for observation in observed:
        shapes = {address: value for address, value in zero.items() if address in observation.assembly.parameters}
        without.append(altered(observation, assembly=observation.assembly.replace(shapes)))
    kept = [narrow.get(unknown.name, unknown) for unknown in unknowns if unknown.name not in absent]
    task = _task(without, kept, tolerances, threads)
    problem = task.problem()
    runs = fit_staged(task, problem, starts, seed, 200, 1e-6)
    return min(runs, key=lambda run: run.cost).values


@dataclass(frozen=True)
class _Growth:
    """The problem with all modes, to which they are added."""

    task: Task
    problem: Problem
    part: _Modes
    columns: Mapping[str, int]
    """Columns of the fitted vector by name of the unknown."""

    def at(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the fitted vector at values by name; the others are at their start."""
        variables = self.task.variables
        all_values = variables.to_values(variables.start)
        for name, value in values.items():
            all_values[self.columns[name]] = value
        return np.clip(variables.from_values(all_values), *variables.limits)

    def add(self, x: NDArray[np.float64], index: int, waiting: Sequence[int]) -> NDArray[np.float64]:
        """Return the vector after the mode `index` was added; those in `waiting` stay absent."""
        free = np.ones(x.size, dtype=np.bool_)
        free[[self.columns[unknown.name] for other in waiting for unknown in self.part.modes[other].values()]] = False
        before = free.copy()
        before[[self.columns[unknown.name] for unknown in self.part.modes[index].values()]] = False
        x = self.problem.fit(x[None], 2 * _EVALUATIONS, free=before, tolerance=1e-6)[0].x
        begun = self._candidates(x, index, before)
        if not begun:
            return x
        ends = self.problem.fit(np.array(begun), _EVALUATIONS, free=free, tolerance=1e-4)
        best = min(ends, key=lambda end: end.cost)
        return best.x if best.cost < self.problem.cost(x) else x

    def _candidates(self, x: NDArray[np.float64], index: int, active: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
        """Return vectors with the mode at the natural frequencies at which it reduces the residuals most."""
        mode = self.part.modes[index]
        residual, jacobian = self.problem.residual(x), self.problem.jacobian(x)
        if not np.isfinite(residual).all():
            return []
        basis, _ = np.linalg.qr(jacobian[:, active])
        entries = jacobian[:, [self.columns[f"{self.part.name}.{key}"] for key in RESIDUALS]]
        left = residual - basis @ (basis.T @ residual)
        frequency, y, theta = mode["frequency_hz"], mode["y"], mode["theta"]
        angles = np.pi * (np.arange(_ANGLES) / _ANGLES - 0.5)
        shapes = np.stack([np.cos(angles), theta.upper / y.upper / _SLOPE * np.sin(angles)], axis=1)
        products = np.stack([shapes[:, 0] ** 2, shapes[:, 1] ** 2, shapes[:, 0] * shapes[:, 1]], axis=1)
        tried: list[tuple[float, float, float, NDArray[np.float64]]] = []
        for f in np.geomspace(frequency.lower, frequency.upper, _CANDIDATES).tolist():
            for ratio in _RATIOS:
                columns = self._over(entries, 2.0 * np.pi * f, ratio)
                columns = columns - basis @ (basis.T @ columns)
                slope = products @ (columns.T @ left)
                square = np.einsum("ai,ij,aj->a", products, columns.T @ columns, products)
                gain = np.where(slope < 0.0, slope**2 / np.maximum(square, 1e-300), 0.0)
                best = int(np.argmax(gain))
                if gain[best] > 0.0:
                    size = np.sqrt(-slope[best] / square[best])
                    tried.append((float(gain[best]), f, ratio, size * shapes[best]))
        tried.sort(key=lambda candidate: -candidate[0])
        kept: list[tuple[float, NDArray[np.float64]]] = []
        for _, f, ratio, shape in tried:
            if len(kept) == _TRIED:
                break
            if all(abs(np.log(f / other)) > _APART for other, _ in kept):
                values = {"frequency_hz": f, "damping_ratio": ratio, "y": shape[0], "theta": shape[1]}
                vector = x.copy()
                for key, value in values.items():
                    column = self.columns[mode[key].name]
                    vector[column] = np.log10(value) if self.task.variables.logarithmic[column] else value
                kept.append((f, np.clip(vector, *self.task.variables.limits)))
        return [vector for _, vector in kept]

    def _over(self, entries: NDArray[np.float64], angular: float, ratio: float) -> NDArray[np.float64]:
        """Return derivatives with respect to residuals over w_r^2 - w^2 + 2 i zeta w_r w, line by line."""
        result = np.zeros_like(entries)
        begin = 0
        for observation, size in zip(self.task.observed, self.problem.sizes, strict=True):
            if observation.is_receptance:
                half = begin + size // 2
                w = 2.0 * np.pi * observation.frequency_hz
                below = angular**2 - w**2 + 2j * ratio * angular * w
                # The first half are real parts, the second half imaginary ones.
                values = (entries[begin:half] + 1j * entries[half : begin + size]) / below[:, None]
                result[begin : begin + size] = np.concatenate([values.real, values.imag])
            begin += size
        return result

    def started(self, x: NDArray[np.float64], unknowns: Sequence[Unknown]) -> list[Unknown]:
        """Return the unknowns with their values as starts: y positive, and modes of equal bounds in ascending order."""
        values = self.problem.named(x)
        numbers = [{key: values[unknown.name] for key, unknown in mode.items()} for mode in self.part.modes]
        grown = [index for index in range(len(numbers)) if self.part.may_grow(index)]
        for index in grown:
            if numbers[index]["y"] < 0.0:
                for key in numbers[index].keys() & {"y", "theta", "y_imaginary", "theta_imaginary"}:
                    numbers[index][key] *= -1.0
        alike: dict[tuple[float, ...], list[int]] = {}
        for index in grown:
            mode = self.part.modes[index]
            bounds = [bound for key in sorted(mode) for bound in (mode[key].lower, mode[key].upper)]
            alike.setdefault(tuple(bounds), []).append(index)
        for places in alike.values():
            ordered = sorted((numbers[index] for index in places), key=lambda row: row["frequency_hz"])
            for index, row in zip(places, ordered, strict=True):
                numbers[index] = row
        for mode, row in zip(self.part.modes, numbers, strict=True):
            values |= {mode[key].name: value for key, value in row.items()}
        return [
            replace(unknown, start=float(np.clip(values[unknown.name], unknown.lower, unknown.upper)))
            if unknown.name in values
            else unknown
            for unknown in unknowns
        ]
