"""Parameters over drawbar force: trends with significance, laws selected by an information criterion, figures."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.fit.covariance import confidence_multiplier
from receptance.report import Column, Provenance, Result, Table
from receptance.report.table import Cell

Direction = Literal["rises", "falls", "not determined"]
LawName = Literal["constant", "linear", "power"]

_PARAMETERS: dict[LawName, int] = {"constant": 1, "linear": 2, "power": 3}
"""Number of fitted parameters of each law."""
_EXPONENTS = (0.05, 8.0)
"""Range of the exponents; steeper laws are steps."""
_GRID = 400
"""Number of exponents of the search."""


@dataclass(frozen=True, kw_only=True)
class ForceLaw:
    """A law of a parameter over force: constant K0, linear K0 + a F, or power K0 + a F^n."""

    name: LawName
    """Name of the law."""
    start: float
    """K0, the value without force."""
    change: float
    """Difference between the values at the highest force and without force."""
    exponent: float
    """n: 0 for the constant, 1 for the linear law."""
    reference: float
    """The highest force, in the unit of the forces."""
    chi_squared: float
    """Weighted sum of squared residuals."""
    criterion: float
    """Corrected Akaike information criterion; the smallest is best."""

    def at(self, force: ArrayLike) -> NDArray[np.float64]:
        """Return the values of the law at forces in the unit of `reference`."""
        x = _checks.unmasked("", "force", force, np.float64) / self.reference
        if self.name == "constant":
            return np.full(x.shape, self.start)
        return np.asarray(self.start + self.change * x**self.exponent)


@dataclass(frozen=True, kw_only=True)
class Trend:
    """Direction of a change, with its interval and significance."""

    direction: Direction
    """Direction, if the interval excludes zero."""
    change: float
    """Change of the value, or of the slope, over the whole range of force."""
    interval: tuple[float, float]
    """Confidence interval of the change."""
    p_value: float
    """Probability of a change of at least this size by chance."""

    @property
    def significance(self) -> str:
        """The p-value as text."""
        return "p < 0.001" if self.p_value < 1e-3 else f"p = {self.p_value:.2g}"

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.direction} by {self.change:.3g} ({low:.3g} to {high:.3g}, p = {self.p_value:.2g})"


@dataclass(frozen=True, kw_only=True)
class ForceSeries(Result):
    """A parameter over drawbar force.

    Parameters
    ----------
    name : str
        Name of the parameter.
    force : array_like
        `(n,)` ascending forces from zero, at least six.
    values, standard_errors : array_like
        `(n,)` values of the parameter and their standard errors.
    notes : tuple of str, optional
        Notes for the user.
    provenance : Provenance, optional
        Versions of the software.

    Raises
    ------
    ValueError, TypeError
        Fewer than six values, different lengths, forces that do not ascend, errors that are not positive.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.coupling import ForceSeries
    >>> force = np.arange(26.0)
    >>> values = 5e9 + 2e8 * (force / 25) ** 1.6 + 2e6 * np.random.default_rng(2).normal(size=26)
    >>> series = ForceSeries(name="k_z1", force=force, values=values, standard_errors=np.full(26, 2e6))
    >>> series.trend().direction, series.slope_trend().direction, series.law.name
    ('rises', 'rises', 'power')
    >>> low, high = series.exponent_interval
    >>> 1.4 < low < 1.6 < high < 1.8
    True
    """

    name: str
    force: NDArray[np.float64]
    values: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Parameter over force"
    plotted_by = "receptance.coupling.figure:draw_force_series"

    def __post_init__(self) -> None:
        owner = f"ForceSeries {self.name!r}"
        for quantity in ("force", "values", "standard_errors"):
            values = np.array(getattr(self, quantity), dtype=np.float64)
            if values.ndim != 1 or values.size < 6 or not np.isfinite(values).all():
                raise ValueError(f"{owner}: {quantity} has shape {values.shape}, expected at least six finite numbers")
            _checks.set_fields(self, {quantity: values})
        if not self.force.size == self.values.size == self.standard_errors.size:
            raise ValueError(f"{owner}: force, values and standard_errors have different lengths")
        if np.any(np.diff(self.force) <= 0.0) or self.force[0] < 0.0:
            raise ValueError(f"{owner}: force is not ascending from zero or more; sort the values by force")
        if np.any(self.standard_errors <= 0.0):
            raise ValueError(f"{owner}: standard_errors must be more than zero")

    @property
    def scatter(self) -> float:
        """Ratio of the scatter about the best law to the standard errors; above 1 it widens the intervals."""
        law = self.law
        return float(np.sqrt(law.chi_squared / (self.force.size - _PARAMETERS[law.name])))

    @cached_property
    def laws(self) -> tuple[ForceLaw, ...]:
        """The constant, the linear and the power law."""
        return fit_laws(self.force, self.values, self.standard_errors)

    @property
    def law(self) -> ForceLaw:
        """The law with the smallest criterion."""
        return min(self.laws, key=lambda law: law.criterion)

    @property
    def exponent_interval(self) -> tuple[float, float]:
        """95 % profile likelihood interval of n in K0 + a F^n, limited to 0.05 to 8."""
        best = self.laws[2]
        limit = best.chi_squared + (confidence_multiplier(0.95, None) * max(self.scatter, 1.0)) ** 2

        def excess(exponents: ArrayLike) -> NDArray[np.float64]:
            return _linear(self.force, self.values, self.standard_errors, exponents)[2] - limit

        ends = []
        for end in _EXPONENTS:
            # The search goes outwards from the best exponent, to find the nearest crossing.
            steps = np.geomspace(best.exponent, end, _GRID) if best.exponent != end else np.array([end])
            outside = np.flatnonzero(excess(steps) > 0.0)
            first = int(outside[0]) if outside.size else 0
            crossing = (
                scipy.optimize.brentq(lambda n: float(excess(n)), steps[first - 1], steps[first]) if first else end
            )
            ends.append(float(crossing))
        return ends[0], ends[1]

    def trend(self, level: float = 0.95) -> Trend:
        """Return the trend of the parameter: the slope of a weighted straight line times the range of force."""
        return self._trend(1, level)

    def slope_trend(self, level: float = 0.95) -> Trend:
        """Return the trend of the slope: the curvature of a weighted parabola times the range of force."""
        return self._trend(2, level)

    def _trend(self, degree: int, level: float) -> Trend:
        x = (self.force - self.force[0]) / np.ptp(self.force)
        design = np.vander(x, degree + 1, increasing=True) / self.standard_errors[:, None]
        inverse = np.linalg.inv(design.T @ design)
        coefficients = inverse @ design.T @ (self.values / self.standard_errors)
        residuals = self.values / self.standard_errors - design @ coefficients
        freedom = x.size - degree - 1
        # Deviations from the line beyond the noise widen the interval.
        scale = max(float(residuals @ residuals) / freedom, 1.0)
        # The slope of the parabola changes from b to b + 2 c.
        factor = float(degree)
        change, error = factor * float(coefficients[-1]), factor * float(np.sqrt(scale * inverse[-1, -1]))
        half_width = confidence_multiplier(level, freedom) * error
        p = 2.0 * float(scipy.stats.t.sf(abs(change) / error, freedom))
        direction: Direction = "not determined"
        if abs(change) > half_width:
            direction = "rises" if change > 0.0 else "falls"
        return Trend(direction=direction, change=change, interval=(change - half_width, change + half_width), p_value=p)

    def tables(self) -> list[Table]:
        """Return trend, trend of the slope, best law and exponent."""
        columns = (
            "parameter",
            "trend",
            Column("p", form=".1g"),
            "its slope",
            Column("p", form=".1g"),
            "best law",
            Column("n in K0 + a F^n", form=".2f"),
            Column("95 % interval", form=".2f"),
            Column("scatter", form=".1f"),
        )
        trend, slope = self.trend(), self.slope_trend()
        row: tuple[Cell, ...] = (
            self.name,
            trend.direction,
            trend.p_value,
            slope.direction,
            slope.p_value,
            self.law.name,
            self.laws[2].exponent,
            self.exponent_interval,
            self.scatter,
        )
        note = "scatter: ratio of the scatter about the law to the standard errors"
        return [Table("Trends with force", columns, [row], note)]

    def sentences(self) -> list[str]:
        """Return a sentence on trend and law."""
        return [f"{self.sentence()}."]

    def data(self) -> dict[str, Any]:
        """Return values, trends with their evidence, and laws."""
        return {
            "statement": self.sentence(),
            "force": self.force,
            "values": self.values,
            "standard_errors": self.standard_errors,
            "trend": self.trend(),
            "slope_trend": self.slope_trend(),
            "law": self.law,
            "laws": self.laws,
            "exponent_interval": self.exponent_interval,
            "scatter": self.scatter,
        }

    def sentence(self) -> str:
        """Return a sentence on trends, best law and exponent."""
        low, high = self.exponent_interval
        meaning = "consistent with a straight line (n = 1)"
        if low > 1.0:
            meaning = "above 1: the slope increases with force"
        elif high < 1.0:
            meaning = "below 1: the slope decreases with force"
        ends = f"n between {low:.2f} and {high:.2f}"
        if low == _EXPONENTS[0] or high == _EXPONENTS[1]:
            ends += " (open)"
        trend, slope = self.trend(), self.slope_trend()
        share = 100.0 / float(np.mean(self.values))
        text = f"{self.name} {trend.direction}"
        if trend.direction != "not determined":
            text += f" by {abs(share * trend.change):.2g} % of its mean ({trend.significance})"
        text += f", its slope {slope.direction if slope.direction != 'not determined' else 'is not determined'}"
        text += f" ({slope.significance})"
        law = self.law
        best = law.name if law.name != "power" else f"K0 + a F^n, n = {law.exponent:.2f}"
        return f"{text}; best law {best}; in K0 + a F^n {ends}, {meaning}"


def fit_laws(force: ArrayLike, values: ArrayLike, standard_errors: ArrayLike) -> tuple[ForceLaw, ForceLaw, ForceLaw]:
    """Fit constant, linear and power law by weighted least squares.

    For a given exponent the power law is linear, so the exponent is searched on a grid and refined between its
    neighbours, which needs no start value. Laws are compared by the corrected Akaike criterion (Hurvich and Tsai 1989);
    if the scatter about the power law exceeds the standard errors, these are scaled to it.
    """
    arrays = {"force": force, "values": values, "standard_errors": standard_errors}
    x, y, e = (_checks.unmasked("fit_laws", name, values, np.float64) for name, values in arrays.items())
    mean = float(np.sum(y / e**2) / np.sum(1.0 / e**2))
    grid = np.geomspace(*_EXPONENTS, _GRID)
    profile = _linear(x, y, e, grid)[2]
    best = int(np.argmin(profile))
    bounds = (grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)])
    refined = scipy.optimize.minimize_scalar(
        lambda n: float(_linear(x, y, e, n)[2]), bounds=bounds, method="bounded", options={"xatol": 1e-6}
    )
    exponent = float(refined.x) if refined.fun < profile[best] else float(grid[best])
    starts, changes, squares = _linear(x, y, e, [1.0, exponent])
    n = x.size
    scale = max(float(squares[1]) / max(n - 3, 1), 1.0)

    def law(name: LawName, start: float, change: float, exponent: float, chi_squared: float) -> ForceLaw:
        p = _PARAMETERS[name]
        return ForceLaw(
            name=name,
            start=float(start),
            change=float(change),
            exponent=exponent,
            reference=float(x[-1]),
            chi_squared=float(chi_squared),
            criterion=float(chi_squared / scale + 2.0 * p + 2.0 * p * (p + 1.0) / max(n - p - 1, 1)),
        )

    return (
        law("constant", mean, 0.0, 0.0, np.sum(((y - mean) / e) ** 2)),
        law("linear", starts[0], changes[0], 1.0, squares[0]),
        law("power", starts[1], changes[1], exponent, squares[1]),
    )


def _linear(
    force: NDArray[np.float64], values: NDArray[np.float64], errors: NDArray[np.float64], exponents: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return K0, the change at the highest force, and the weighted sum of squares for each exponent."""
    shape = (force / force[-1]) ** np.asarray(exponents, dtype=np.float64)[..., None]
    weights = 1.0 / errors**2
    total = weights.sum()
    mean_shape = (shape @ weights) / total
    mean = float(values @ weights) / total
    # Centred on the weighted means to avoid differences of large sums.
    centred, deviation = shape - mean_shape[..., None], values - mean
    change = (centred * deviation) @ weights / (centred**2 @ weights)
    residual = deviation - change[..., None] * centred
    return mean - change * mean_shape, change, residual**2 @ weights
