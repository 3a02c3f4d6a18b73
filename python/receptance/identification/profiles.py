"""Profile likelihoods: how well the other parameters can make up for one that is held elsewhere.

The rise of -2 log L over its least value, with everything else fitted again, is chi-squared with one degree of
freedom at the true value (Wilks 1938), so the values where it is below the quantile are an interval. Unlike a standard
error it sees bounds, curvature and that a side may be open.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.identification.spread import quantile
from receptance.identification.statements import Tie, state
from receptance.report import Column, Provenance, Result, Results, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.identification.problem import End, Problem
    from receptance.identification.result import Identification

__all__ = ["Profile", "Profiles", "profile_likelihoods"]

_CLOSE = 0.01
"""Share of the quantile to which the end of an interval is found."""
_MOST = 40
"""Fits of one side, at most."""
_GROWTH = 3.0
"""By how much a step may grow along a flat side."""
_BETTER = 0.01
"""Decrease of the cost, in units of the scatter, beyond which a better optimum was found."""
_RESTARTS = 4
_ACCURACY = 1e-5
"""To which the cost of a fit on the way is minimised, in units of the scatter."""


@dataclass(frozen=True, kw_only=True)
class Profile(Result):
    """Profile likelihood of one parameter, and its interval.

    Attributes
    ----------
    name : str
        Its name in the fit.
    value : float
        Most likely value in SI units.
    lower, upper : float
        Ends of the interval in SI units; zero or -infinity, and infinity, where that side is open.
    lower_open, upper_open : bool
        Whether the data do not bound that side up to the bound of the fit.
    level : float
        Level of the interval.
    values : ndarray
        `(n,)` where the parameter was held, ascending, in SI units.
    rise : ndarray
        `(n,)` rise of -2 log L there, the rest fitted again.
    paths : ndarray
        `(n, p)` all fitted variables there.
    threshold : float
        Rise at the ends of the interval.
    statement : str
        What that means, in words.
    evaluations : int
        Evaluations of the model.
    notes : tuple of str
        Notes for the user.
    provenance : Provenance
        Versions of the software.
    """

    name: str
    value: float
    lower: float
    upper: float
    lower_open: bool
    upper_open: bool
    level: float
    values: NDArray[np.float64]
    rise: NDArray[np.float64]
    paths: NDArray[np.float64]
    threshold: float
    statement: str
    evaluations: int
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Profile likelihood"

    @property
    def bounded(self) -> bool:
        """Whether the data bound it on both sides."""
        return not (self.lower_open or self.upper_open)

    def confidence(self, value: float) -> float:
        """Return the probability below a value that the profile states, from its signed root; in SI units.

        The root is interpolated between the points of the profile, so beyond them it is 0 or 1.
        """
        from scipy.special import ndtr

        root = np.sqrt(self.rise) * np.sign(np.arange(self.rise.size) - int(np.argmin(self.rise)))
        scale = np.log10 if np.all(self.values > 0.0) else np.asarray
        if not self.values[0] <= value <= self.values[-1]:
            # On from the last two points: a root goes nearly straight.
            ends = slice(0, 2) if value < self.values[0] else slice(-2, None)
            if self.values.size < 2 or (value <= 0.0 and scale is np.log10):
                return 0.0 if value < self.values[0] else 1.0
            x, z = scale(self.values[ends]), root[ends]
            return float(ndtr(z[0] + (scale(value) - x[0]) * (z[1] - z[0]) / (x[1] - x[0])))
        return float(ndtr(np.interp(scale(value), scale(self.values), root)))

    def tables(self) -> list[Table]:
        """Return the interval and its meaning."""
        columns = ("parameter", Column("value"), Column(f"{100.0 * self.level:g} % interval"), "meaning")
        ends = (None if self.lower_open else self.lower, None if self.upper_open else self.upper)
        return [Table("Profile likelihoods, SI units", columns, [(self.name, self.value, ends, self.statement)])]

    def data(self) -> dict[str, Any]:
        """Return interval, meaning and points."""
        return {
            "statement": self.statement,
            "level": self.level,
            "interval": (self.lower, self.upper),
            "open": (self.lower_open, self.upper_open),
            "values": self.values,
            "rise": self.rise,
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the rise of -2 log L over the parameter, and the threshold of the interval; see `Result.plot`."""
        return Profiles({self.name: self}).plot(ax)

    def __repr__(self) -> str:
        return f"Profile({self.name}: {self.statement})"


class Profiles(Results[Profile]):
    """Profile likelihoods by name of the parameter."""

    heading = "Profile likelihoods"
    key = "profiles"

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the rise of -2 log L over each parameter, and the threshold of its interval; see `Result.plot`."""
        from receptance.identification.figures.profiles import draw_profiles

        return draw_profiles(self, ax)


def profile_likelihoods(
    found: Identification,
    names: str | Sequence[str] | None = None,
    *,
    level: float = 0.95,
    progress: Callable[[str], None] | None = None,
) -> Profiles:
    """Profile parameters of a fit; see `Identification.profiles`."""
    wanted = (names,) if isinstance(names, str) else names
    chosen = [n for n in found.addresses if n not in found.errors] if wanted is None else list(wanted)
    for name in chosen:
        if name not in found.values:
            raise ValueError(f"{name!r} was not identified, only {', '.join(found.addresses)}")
    if "percent" in found.units:
        _refuse_percentages(found)
    start = found.task.variables.from_values(np.array(list(found.values.values())))
    for _ in range(_RESTARTS):
        run = _Run(found, level, start)
        try:
            return Profiles({name: _told(run, name, progress) for name in chosen}, provenance=found.provenance)
        except BetterOptimumError as error:
            start = error.better.x
            text = "a better optimum than that of the fit was found while profiling: identify with more starts"
            warnings.warn(text, ReceptanceWarning, stacklevel=3)
    raise ReceptanceError(f"profiling found a better optimum {_RESTARTS} times: identify with more starts")


def _told(run: _Run, name: str, progress: Callable[[str], None] | None) -> Profile:
    if progress is not None:
        progress(f"profiling {name}")
    return run.profile(name)


def _refuse_percentages(found: Identification) -> None:
    from receptance.identification.observations import MeasuredFRF

    if any(isinstance(o, MeasuredFRF) for o in found.task.observed):
        raise ValueError(
            "the percentage objective is no likelihood, so it has no profile: identify with the objective 'log'"
        )


class _Run:
    """The fits around one optimum."""

    def __init__(self, found: Identification, level: float, start: NDArray[np.float64]) -> None:
        self.found = found
        self.level = level
        self.problem: Problem = found.task.problem()
        self.variables = self.problem.variables
        self.limits = self.variables.limits
        self.best = self.problem.fit_one(start, least=1e-12)
        self.scatter = 1.0 if found.known_scatter else 2.0 * self.best.cost / max(found.degrees_of_freedom, 1)
        reach = quantile(level, None if found.known_scatter else found.degrees_of_freedom)
        self.threshold = reach**2

    def profile(self, name: str) -> Profile:
        index = self.found.addresses.index(name)
        before = self.problem.evaluations
        sides = [self._side(index, side) for side in (-1.0, 1.0)]
        unknown = self.variables.unknowns[index]
        points = [*reversed(sides[0].points), (self.best.x, 0.0), *sides[1].points]
        paths = np.array([point[0] for point in points])
        ends = [self._value(index, side.end) for side in sides]
        is_open = [side.open for side in sides]
        lower = ends[0] if not is_open[0] else (0.0 if unknown.scale == "log" else -np.inf)
        upper = ends[1] if not is_open[1] else np.inf
        return Profile(
            name=name,
            value=self._value(index, self.best.x[index]),
            lower=lower,
            upper=upper,
            lower_open=is_open[0],
            upper_open=is_open[1],
            level=self.level,
            values=np.array([self._value(index, point[index]) for point in paths]),
            rise=np.array([point[1] for point in points]),
            paths=paths,
            threshold=self.threshold,
            statement=state(
                self._value(index, self.best.x[index]),
                lower,
                upper,
                self.level,
                name=name,
                scale=str(unknown.scale),
                tie=self._tie(index, paths),
            ),
            evaluations=self.problem.evaluations - before,
        )

    def _value(self, index: int, variable: float) -> float:
        vector = self.best.x.copy()
        vector[index] = variable
        return float(self.variables.to_values(vector)[index])

    def _side(self, index: int, side: float) -> _Side:
        """Walk to one side until the rise passes the threshold, then close in on where it does."""
        bound = float(self.limits[0 if side < 0.0 else 1][index])
        root = float(np.sqrt(self.threshold))
        inside = (self.best, 0.0)
        outside: tuple[End, float] | None = None
        points: list[tuple[NDArray[np.float64], float]] = []
        step = self._first_step(index) * root
        wall = np.inf
        for _ in range(_MOST):
            here = float(inside[0].x[index])
            if outside is None:
                at = here + side * step
                if side * (at - bound) >= 0.0:
                    at = bound
                if abs(at - here) >= 0.999 * wall:
                    at = here + side * 0.5 * wall
            else:
                at = _between((here, inside[1]), (float(outside[0].x[index]), outside[1]), root)
            fit = self._held(index, at, inside[0] if outside is None else _nearest(at, index, inside[0], outside[0]))
            if not np.isfinite(fit.cost):
                wall = abs(at - here)
                if wall <= 1e-3 * step or wall <= 1e-9:
                    break
                continue
            wall = np.inf if outside is not None else (np.inf if wall == np.inf else wall - abs(at - here))
            rise = 2.0 * (fit.cost - self.best.cost) / self.scatter if self.scatter > 0.0 else np.inf
            z = float(np.sqrt(max(rise, 0.0)))
            points.append((fit.x, max(rise, 0.0)))
            if at == bound and z < root:
                return _Side(_ordered(points, index, side), bound, True)
            # Just below the threshold is no end as long as nothing above it was seen: a flat side goes on from there.
            if abs(z - root) <= _CLOSE * root and (z >= root or outside is not None):
                return _Side(_ordered(points, index, side), float(fit.x[index]), False)
            if z < root:
                before, inside = inside, (fit, z)
                grown = (root - z) / max(z - before[1], 1e-3 * root) * abs(at - here)
                step = min(max(1.05 * grown, 0.2 * step), _GROWTH * max(step, abs(at - here)))
            else:
                outside = (fit, z)
            if outside is not None:
                gap = abs(float(outside[0].x[index]) - float(inside[0].x[index]))
                if gap <= 1e-7 * max(self.limits[1][index] - self.limits[0][index], 1e-300):
                    break
        if outside is None:
            return _Side(_ordered(points, index, side), float(inside[0].x[index]), True)
        end = _between((float(inside[0].x[index]), inside[1]), (float(outside[0].x[index]), outside[1]), root)
        return _Side(_ordered(points, index, side), end, False)

    def _first_step(self, index: int) -> float:
        """Return the standard error of a variable, or a tenth of its range where there is none or it is more."""
        most = 0.1 * float(self.limits[1][index] - self.limits[0][index])
        others = np.arange(self.best.x.size) != index
        normal = self.best.curvature
        slope = self._follow(normal, index)
        curvature = float(normal[index, index] + normal[index, others] @ slope) / self.scatter if self.scatter else 0.0
        if not curvature > 0.0:
            return most
        return min(1.0 / float(np.sqrt(curvature)), most)

    @staticmethod
    def _follow(normal: NDArray[np.float64], index: int) -> NDArray[np.float64]:
        """Return how the other variables follow one that moves, to first order."""
        others = np.arange(len(normal)) != index
        matrix = normal[np.ix_(others, others)]
        scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
        scale = np.where(scale > 0.0, scale, 1.0)
        ridge = 1e-9 * np.eye(len(matrix))
        result: NDArray[np.float64] = (
            -np.linalg.solve(matrix / np.outer(scale, scale) + ridge, normal[others, index] / scale) / scale
        )
        return result

    def _held(self, index: int, at: float, near: End) -> End:
        """Fit everything else with one variable held, from where the last fit says that the others go."""
        free = np.ones(near.x.size, dtype=np.bool_)
        free[index] = False
        guess = near.x.copy()
        guess[free] += self._follow(near.curvature, index) * (at - near.x[index])
        guess[index] = at
        plain = near.x.copy()
        plain[index] = at
        least = _ACCURACY * (self.scatter if self.scatter > 0.0 else 1.0)
        fit = self.problem.fit_one(guess, free=free, least=least, of_all=True)
        if not np.isfinite(fit.cost):
            fit = self.problem.fit_one(plain, free=free, least=least, of_all=True)
        if fit.cost < self.best.cost - _BETTER * max(self.scatter, 1e-300):
            better = self.problem.fit_one(fit.x, least=1e-12)
            if better.converged:
                raise BetterOptimumError(better)
        return fit

    def _tie(self, index: int, paths: NDArray[np.float64]) -> Tie | None:
        """Return the parameter that goes along most where this one moves, in spreads that it has on its own."""
        own = 1.0 / np.sqrt(np.maximum(np.diag(self.best.curvature) / max(self.scatter, 1e-300), 1e-300))
        moved = paths[:, : self.found.task.parameters.count]
        way = np.ptp(moved, axis=0) / own[: moved.shape[1]]
        reach = np.ptp(moved, axis=0) / (self.limits[1] - self.limits[0])[: moved.shape[1]]
        way[index] = 0.0
        candidates = np.where(reach > 0.02, way, 0.0)
        if not candidates.size or candidates.max() < 10.0:
            return None
        other = int(candidates.argmax())
        return Tie(self.found.addresses[other], float(way[other]))


class BetterOptimumError(Exception):
    """A fit on the way went below the optimum that was to be profiled."""

    def __init__(self, better: End) -> None:
        super().__init__("a better optimum was found while profiling")
        self.better = better


@dataclass(frozen=True)
class _Side:
    points: list[tuple[NDArray[np.float64], float]]
    end: float
    open: bool


def _ordered(
    points: list[tuple[NDArray[np.float64], float]], index: int, side: float
) -> list[tuple[NDArray[np.float64], float]]:
    """Return points from the optimum outwards."""
    return sorted(points, key=lambda point: side * float(point[0][index]))


def _nearest(at: float, index: int, first: End, second: End) -> End:
    return first if abs(first.x[index] - at) <= abs(second.x[index] - at) else second


def _between(inside: tuple[float, float], outside: tuple[float, float], root: float) -> float:
    """Return where the root of the rise, taken as straight, meets the threshold; well inside the bracket."""
    share = (root - inside[1]) / (outside[1] - inside[1])
    return inside[0] + min(max(share, 0.05), 0.95) * (outside[0] - inside[0])
