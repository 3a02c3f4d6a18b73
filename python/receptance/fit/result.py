"""The result of an identification: values, uncertainty, residuals and advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance._text import first_of
from receptance.fit.adequacy import Adequacy
from receptance.fit.covariance import confidence_multiplier
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.discrepancy_fit import expected_chi_square
from receptance.fit.observation import Unit
from receptance.fit.parameters import Site
from receptance.fit.prediction import Scatter
from receptance.fit.predictor import PredictedAssembly, Predictor
from receptance.fit.problem import Task
from receptance.fit.search import Start
from receptance.fit.unknowns import Law, Tolerance, Unknown
from receptance.model.assembly import Assembly
from receptance.report import ACCEPTED, Column, Provenance, Rejection, Result, Results, Table
from receptance.report.table import Cell, amount, amount_interval, number

_CORRELATED = 0.9
"""Least magnitude of a correlation that is listed in the summary."""
_MOST_CORRELATIONS = 6
"""Number of correlations that are listed, the strongest first; `to_dict` has the matrix."""
_NO_RESIDUAL = 1e-3
"""Smaller root mean squares are rounding errors and are printed as "below 0.001"."""
_LEAST_FREEDOM = 3.0
"""Least degrees of freedom of a discrepancy: with two, Student's t distribution has no variance."""
_NOT_DETERMINED = 1e3
"""A larger ratio of standard error to value is printed as infinite."""


@dataclass(frozen=True, kw_only=True)
class Identification(Result):
    """Identified parameters, their uncertainty, residuals and advice.

    Dictionaries by address use the name of an unknown that has one: exponents of laws, parts of single configurations,
    and errors of tolerances, which are in units of their standard deviations.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Observation, Part, Segment, Tolerance, identify
    >>> bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> rung = Observation.from_modes(assembly=bar, frequency_hz=bar.natural_frequencies(3e4), standard_deviation_hz=5)
    >>> length = Tolerance(name="length", moves={"bar.segment[0].length": 1e-4})
    >>> fit = identify(rung, {"bar.segment[0].youngs_modulus": (1e11, 3e11)}, tolerances=length)
    >>> low, high = fit.interval("bar.segment[0].youngs_modulus")
    >>> low < 2.1e11 < high
    True
    >>> f"{fit.scatter().shares['length'][0]:.0%} of the variance goes with the length"
    '98% of the variance goes with the length'
    >>> longer = fit.at(bar.replace({"bar.segment[0].length": 0.12}))
    >>> low, high = longer.receptance(np.linspace(100.0, 5000.0, 50)).band()
    >>> bool(np.all(low < high))
    True
    """

    values: dict[str, float]
    """Identified values in SI units by address."""
    standard_errors: dict[str, float]
    """Standard error of each value in SI units, to first order; infinite if the data do not determine it."""
    covariance: NDArray[np.float64]
    """`(p, p)` of the fitted variables: log10 of the value if the scale is "log", else the value."""
    correlation: NDArray[np.float64]
    """`(p, p)` of the fitted variables."""
    residuals: list[NDArray[np.float64]]
    """Residuals of each observation, in `units` ("standard deviations", "percent", "logarithm" or "relative"); of a
    receptance first the real parts, then the imaginary parts."""
    converged: bool
    """Whether the best start converged."""
    advice: list[str]
    """Problems of the fit and remedies, the rejection first; empty if there are none."""
    notes: list[str]
    starts: tuple[Start, ...]
    """Every start, in the order of running."""
    agreeing: int
    """Number of starts that reached the best optimum."""
    seed: int
    """Seed of the drawn starts."""
    task: Task = field(repr=False)
    """Observations and parameters of the fit, for later analyses."""
    adequacy: Adequacy | None = None
    """Agreement of the model with the data and their stated standard deviations; None without these."""
    rejection: Rejection = ACCEPTED
    """Why the values must not be used, or are those of a fit that allows for an error of the model; false if the fit is
    accepted. Results that are computed with the values repeat it."""
    profiled: Results[Any] | None = None
    """Profile likelihoods, if they were computed together with the fit."""
    series: Results[Any] | None = None
    """Parameters over the levels of a series by name, if the campaign has one."""
    stabilised: Results[Any] | None = None
    """Modes of unknown spindles by their number, and how it was chosen, by name; None without unknown modes."""
    groups: Mapping[str, str] = field(default_factory=dict, repr=False)
    """Group of a measurement by label; the measurements of a group share a row in the table of residuals."""
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Identified parameters"
    plotted_by = "receptance.fit.figure:draw_identification"

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """The fitted unknowns, in the order of all other results: laws expanded, errors of tolerances last."""
        return self.task.parameters.unknowns

    @property
    def units(self) -> list[Unit]:
        """Unit of the residuals of each observation."""
        return list(self.task.units)

    @property
    def labels(self) -> list[str]:
        """Label of each observation, or its number."""
        return [observation.title(i) for i, observation in enumerate(self.task.observed)]

    @property
    def rms(self) -> float:
        """Root mean square of all residuals."""
        return _rms(np.concatenate(self.residuals))

    @property
    def degrees_of_freedom(self) -> int:
        """Number of residuals and priors minus number of unknowns."""
        priors = sum(unknown.prior is not None for unknown in self.unknowns)
        return sum(part.size for part in self.residuals) + priors - len(self.unknowns)

    @property
    def known_scatter(self) -> bool:
        """Whether standard deviations were given. If not, the scatter is estimated from the residuals."""
        return "standard deviations" in self.task.units

    @property
    def scatter_freedom(self) -> float | None:
        """Degrees of freedom from which the scatter was estimated; None where it was given.

        Without standard deviations they are `degrees_of_freedom`. With a discrepancy they are the independent errors of
        modes minus the unknowns, at least three: few, so that the size of the discrepancy is uncertain.
        """
        if self.discrepancy is not None:
            return max(expected_chi_square(self.task), _LEAST_FREEDOM)
        return None if self.known_scatter else float(self.degrees_of_freedom)

    @property
    def residual_variance(self) -> float:
        """Variance of a residual: 1 with given standard deviations, otherwise estimated from the residuals."""
        return self.variance_of_residuals(0.5 * float(np.sum(np.concatenate(self.residuals) ** 2)))

    def variance_of_residuals(self, cost: float) -> float:
        """Return the variance of a residual with another least cost, half the sum of squares."""
        return 1.0 if self.known_scatter else 2.0 * cost / max(self.degrees_of_freedom, 1)

    @property
    def discrepancy(self) -> Discrepancy | None:
        """Error of the model that the fit allows for where the model is not adequate, see `identify`; else None.

        `residuals` and `rms` are relative to the stated standard deviations.
        """
        return self.task.discrepancy

    @property
    def assemblies(self) -> list[Assembly]:
        """The assembly of each observation with the identified values."""
        values = np.array(list(self.values.values()))
        pairs = zip(self.task.mappings, self.task.observed, strict=True)
        return [mapping.apply(observation.assembly, values) for mapping, observation in pairs]

    @property
    def evaluations(self) -> int:
        """Evaluations of the model in all starts."""
        return sum(start.evaluations for start in self.starts)

    @property
    def addresses(self) -> tuple[str, ...]:
        """Names of all unknowns, by default addresses, in the order of `covariance` and `correlation`."""
        return tuple(unknown.name for unknown in self.unknowns)

    @property
    def vector(self) -> NDArray[np.float64]:
        """Fitted variables, `(p,)`."""
        return self.task.variables.from_values(np.array(list(self.values.values())))

    @property
    def errors(self) -> tuple[str, ...]:
        """Names of the unknowns that are errors of tolerances."""
        return self.task.parameters.errors

    @property
    def data_errors(self) -> dict[str, float]:
        """Standard error of each value from the noise of the data alone, with exact dimensions and materials."""
        variables = self.task.variables
        slopes = variables.slopes(np.array(list(self.values.values())))
        return dict(zip(self.addresses, (self.scatter().data * slopes).tolist(), strict=True))

    def interval(self, address: str, level: float = 0.95, *, exact: bool = False) -> tuple[float, float]:
        """Confidence interval of a value, in SI units.

        It is symmetric in the fitted variable: value / factor to value * factor on a log scale. It is unbounded if the
        data do not determine the value. The interval is linear in the errors and ignores the bounds; see
        `profile_likelihoods` and `confidence_multiplier`. With `exact`, dimensions and materials are exact, so that
        only the noise of the data counts.

        Raises
        ------
        ValueError
            An address that was not identified, or a level not between 0 and 1.
        """
        index = self.index(address)
        scatter = self.scatter()
        half = self.confidence_multiplier(level) * float((scatter.data if exact else scatter.total)[index])
        value = self.values[address]
        if self.unknowns[index].scale == "linear":
            return value - half, value + half
        with np.errstate(over="ignore"):
            factor = float(np.power(10.0, np.float64(half)))
        return (value / factor if np.isfinite(factor) else 0.0), value * factor

    def confidence_multiplier(self, level: float = 0.95) -> float:
        """Half width of a confidence interval in standard errors.

        It is the quantile of the normal distribution if standard deviations were given, else that of Student's t
        distribution, see `scatter_freedom`.
        """
        return confidence_multiplier(level, self.scatter_freedom)

    def scatter(self) -> Scatter:
        """Standard deviations of the fitted variables, `(p,)`, and the share of each error in them.

        `data` is the part from the noise of the data alone, with exact dimensions and materials. The variables are
        those of `covariance`: log10 of the value if the scale is "log".
        """
        return self.predictor.scatter(np.eye(len(self.unknowns)))

    @cached_property
    def predictor(self) -> Predictor:
        """Predictor of other assemblies from the posterior of the fit."""
        values = np.array(list(self.values.values()))
        # Variables that the data do not determine have no covariance; combinations of them may be determined.
        is_incomplete = self.known_scatter and not np.isfinite(self.covariance).all()
        return Predictor(
            self.task.parameters,
            values,
            self.covariance,
            self.scatter_freedom,
            self.task.threads,
            root=self.task.problem().curvature_root(self.vector) if is_incomplete else None,
            discrepancy=self.discrepancy,
        )

    def at(
        self,
        assembly: Assembly,
        *,
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        tolerances: Sequence[Tolerance] | None = None,
    ) -> PredictedAssembly:
        """Return another assembly, observed or not, with the identified values, and predictions of it.

        Parameters
        ----------
        configuration, conditions : optional
            Its configuration, and its conditions in SI units, for laws and tolerances.
        tolerances : sequence of Tolerance, optional
            Its errors; by default those of the fit. Errors that were not fitted are zero in the assembly, and standard
            normal in standard errors and draws.

        Returns
        -------
        PredictedAssembly
            With the attribute `assembly`, and the methods `natural_frequencies` and `receptance`.

        Raises
        ------
        ValueError
            The assembly has none of the identified parameters, or a law has no value for it.
        """
        predicted = self.predictor.at(Site(assembly, configuration, "", conditions or {}), tolerances)
        if not predicted.uncertain:
            raise ValueError(f"{assembly!r} has none of the identified parameters {', '.join(self.addresses)}")
        return predicted

    def determined(self, address: str) -> bool:
        """Return whether the 95 % interval of a value ends within the bounds of the unknown on at least one side."""
        return any(end is not None for end in self.ends(address))

    def tables(self) -> list[Table]:
        """Return parameters, profile intervals, errors of tolerances, residuals and chosen numbers of modes."""
        tables = [self._parameter_table(), self._error_table(), *self._residual_tables()]
        if self.stabilised is not None:
            tables += self.stabilised.tables()
        if self.profiled is not None:
            tables[1:1] = self.profiled.tables()
        if self.series is not None:
            tables[1:1] = self.series.tables()
        return [table for table in tables if table.rows]

    def sentences(self) -> list[str]:
        """Return convergence and correlated parameters."""
        others = (each.sentences() for each in (self.stabilised, self.series) if each)
        return [f"{self._headline()}.", *self._correlations(), *(text for texts in others for text in texts)]

    def warnings(self) -> list[str]:
        """Return the advice beside the rejection."""
        return [text for text in self.advice if text not in tuple(self.rejection)]

    def data(self) -> dict[str, Any]:
        """Return parameters, errors, correlations, residuals and starts."""
        of_data, shares = self.data_errors, self.scatter().shares
        return {
            "converged": self.converged,
            "parameters": {
                name: {
                    "value": value,
                    "standard_error": self.standard_errors[name],
                    "standard_error_of_data": of_data[name],
                    "interval_95": self.interval(name),
                    "shares_of_variance": {error: share[index] for error, share in shares.items()},
                    "determined": self.determined(name),
                }
                for index, (name, value) in enumerate(self.values.items())
                if name not in self.errors
            },
            "errors": {
                name: {"value": self.values[name], "standard_error": self.standard_errors[name]} for name in self.errors
            },
            "profiles": {}
            if self.profiled is None
            else {name: profile.data() for name, profile in self.profiled.items()},
            **({} if self.series is None else {"series": self.series.data()}),
            **({} if self.stabilised is None else {"number_of_modes": self.stabilised.data()}),
            "correlation": {"parameters": self.addresses, "matrix": self.correlation},
            "covariance_of_fitted_variables": self.covariance,
            "scales": {unknown.address: unknown.scale for unknown in self.unknowns},
            "measurements": [
                {
                    "name": label,
                    "assembly": observed.configuration,
                    "unit": unit,
                    "count": residual.size,
                    "rms": _rms(residual),
                    "residuals": residual,
                }
                for label, observed, unit, residual in zip(
                    self.labels, self.task.observed, self.units, self.residuals, strict=True
                )
            ],
            "rms": self.rms,
            "degrees_of_freedom": self.degrees_of_freedom,
            "known_scatter": self.known_scatter,
            "adequacy": None if self.adequacy is None else self.adequacy.data(),
            "discrepancy": None if self.discrepancy is None else self.discrepancy.data(),
            "starts": len(self.starts),
            "starts_agreeing": self.agreeing,
            "evaluations": self.evaluations,
            "advice": self.advice,
        }

    def __repr__(self) -> str:
        errors = self.standard_errors
        texts = [f"{x}={value:.4g} +- {errors[x]:.1g}" for x, value in self.values.items() if x not in self.errors]
        return f"Identification({first_of(texts)}; {self._headline()})"

    def _parameter_table(self) -> Table:
        errors = [self.standard_errors, self.data_errors] if self.errors else [self.standard_errors]
        names = ["standard error", "from noise\nof the data"][: len(errors)]
        numbers = (Column("value"), *(Column(name) for name in names), Column("95 % interval"))
        # A profile has the more accurate interval in a table of its own.
        profiled = () if self.profiled is None else tuple(self.profiled)
        rows: list[list[Cell]] = []
        laws = self._laws_of_series()
        for name, value in self.values.items():
            if name in self.errors or name in laws:
                continue
            unknown = self.unknowns[self.index(name)]
            shown = [
                error[name] if error[name] < _NOT_DETERMINED * abs(value) or not value else np.inf for error in errors
            ]
            rows.append(
                [name, amount(value, unknown.unit, 5), *(_error(unknown, value, deviation) for deviation in shown)]
            )
            if name in profiled:
                rows[-1].append(None)
            else:
                determined = self.determined(name)
                rows[-1].append(amount_interval(self.ends(name), unknown.unit) if determined else number(np.inf))
        return Table("Identified parameters", ("parameter", *numbers), rows).without_empty()

    def ends(self, address: str) -> tuple[float | None, float | None]:
        """Return the ends of the 95 % interval of a value; None beyond the bounds, where no values were fitted."""
        unknown = self.unknowns[self.index(address)]
        low, high = self.interval(address)
        return low if low > unknown.lower else None, high if high < unknown.upper else None

    def _error_table(self) -> Table:
        columns = ("error", Column("value", form="+.2f"), Column("standard error", form=".2f"))
        rows = [(name, self.values[name], self.standard_errors[name]) for name in self.errors]
        return Table("Errors of dimensions and materials, in standard deviations", columns, rows)

    def _residual_tables(self) -> list[Table]:
        common = len(set(self.units)) == 1
        alone: list[list[Cell]] = []
        groups: dict[tuple[str, Unit | None], list[tuple[float, str]]] = {}
        for label, observed, of_one, residual in zip(
            self.labels, self.task.observed, self.units, self.residuals, strict=True
        ):
            rms, unit = _rms(residual), None if common else of_one
            if label in self.groups:
                groups.setdefault((self.groups[label], unit), []).append((rms, label))
                continue
            shown = rms if rms >= _NO_RESIDUAL else f"below {_NO_RESIDUAL:g}"
            alone.append([label, observed.describe(), residual.size, shown, unit])
        together: list[list[Cell]] = []
        for (group, unit), members in groups.items():
            sizes = [rms for rms, _ in members]
            together.append(
                [group, len(members), min(sizes), float(np.median(sizes)), max(sizes), max(members)[1], unit]
            )
        title = f"Residuals, in {self.units[0]}" if common else "Residuals"
        numbers = (Column("residuals", form="d"), Column("rms", form=".3g"))
        by_rms = (Column(name, form=".3g") for name in ("least rms", "median", "most"))
        by_group: tuple[Column | str, ...] = ("measurements", Column("number", form="d"), *by_rms, "of", "unit")
        return [
            Table(title, ("measurement", "data", *numbers, "unit"), alone).without_empty(),
            Table(f"{title}, by group", by_group, together).without_empty(),
        ]

    def _correlations(self) -> list[str]:
        """List strong correlations; those of two parameters at several levels are merged."""
        pairs: dict[str, list[float]] = {}
        laws = self._laws_of_series()
        for i, second in enumerate(self.addresses):
            for j, first in enumerate(self.addresses[:i]):
                if abs(self.correlation[i, j]) > _CORRELATED:
                    if second in laws:
                        first, second = laws.get(first, first), laws[second]
                    pairs.setdefault(f"{first} and {second}", []).append(float(self.correlation[i, j]))
        order = sorted(pairs.items(), key=lambda pair: -max(map(abs, pair[1])))
        texts = [
            f"{names}: {values[0]:+.3f}"
            if len(values) == 1
            else f"{names} at {len(values)} levels: {min(values):+.3f} to {max(values):+.3f}"
            for names, values in order[:_MOST_CORRELATIONS]
        ]
        more = f"; and {len(order) - len(texts)} more" if len(order) > len(texts) else ""
        return [f"Correlations beyond {_CORRELATED:g}: {'; '.join(texts)}{more}."] if texts else []

    def _laws_of_series(self) -> dict[str, str]:
        """Return the name of the law of each parameter at a level of the series, which has its own tables."""
        laws = [law for law in self.task.parameters.given if isinstance(law, Law) and law.name in (self.series or ())]
        levels = {observation.configuration for observation in self.task.observed}
        return {name: law.name for law in laws for name in (law.name, *map(law.name_in, levels))}

    def _headline(self) -> str:
        state = "converged" if self.converged else "not converged"
        count = len(self.starts)
        starts = "one start" if count == 1 else f"{self.agreeing} of {count} starts reached the best optimum"
        return f"{state}, {starts}, {self.evaluations} evaluations, rms {number(self.rms, '.3g')}"

    def index(self, address: str) -> int:
        """Return the position of an unknown in `addresses`; raise if it was not identified."""
        if address not in self.values:
            raise ValueError(f"{address!r} was not identified, only {', '.join(self.addresses)}")
        return self.addresses.index(address)


def _error(unknown: Unknown, value: float, error: float) -> str:
    """Return a standard error as text: in percent where the scale is logarithmic."""
    if not np.isfinite(error) or unknown.scale == "linear" or value == 0.0:
        return amount(error, unknown.unit, 2)
    return f"{amount(100.0 * error / value, digits=2)} %"


def _rms(residual: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(residual**2)))
