"""Quantities that a sweep keeps of each candidate."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.errors import ReceptanceError
from receptance.fit import Observation
from receptance.fit.observation import Unit, as_observations
from receptance.fit.parameters import ParameterMap
from receptance.fit.problem import residuals_at
from receptance.fit.unknowns import covered
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.stability import Milling, Turning, critical_depths
from receptance.stability.lobes import checked_lines, checked_speeds, limit_over_speed
from receptance.sweep.parametric_receptance import ParametricReceptance, parametric_receptance

_LINE_S, _MODES_S = 5e-9, 2e-4
"""Approximate time in s for one line of a joint, and for the natural frequencies of a model."""
_DEPTH_S, _SPEED_S = 6e-4, 3e-5
"""Approximate time in s for a stable depth, and for each further spindle speed."""

Evaluated = tuple[dict[str, "NDArray[Any]"], "NDArray[np.bool_]"]
"""Arrays by variable, with one row per candidate, and a mask of the feasible candidates."""
Evaluation = Callable[["NDArray[np.float64]"], Evaluated]


@dataclass(frozen=True, eq=False)
class Variable:
    """A quantity that a sweep keeps for each candidate."""

    name: str
    """Its name in the results."""
    dtype: str
    """Data type of its values."""
    unit: str
    """SI unit."""
    dimensions: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """Names and coordinates of its dimensions besides `candidate`."""
    meaning: str = ""
    """Long name."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values of one candidate."""
        return tuple(len(values) for values in self.dimensions.values())


PROGRAM = "of the program"
"""Version of outputs of this package, whose code has the version of the program."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """A function of the receptances of some candidates, with a name and a version that identify it in a store.

    A store cannot compare code. It records name and version, and is continued only by a reduction that has the same:
    raise the version when the function, or anything that it uses, changes its results.

    Raises
    ------
    TypeError, ValueError
        An object that cannot be called, or an empty text.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.sweep import FrequencyResponse, Reduction
    >>> largest = Reduction(lambda h: h.max(axis=1), name="largest", version="1")
    >>> print(largest)
    largest, version 1
    >>> output = FrequencyResponse(frequency_hz=np.linspace(100.0, 4000.0, 40), magnitude=True, reduce=largest)
    """

    function: Callable[[NDArray[Any]], NDArray[Any]]
    """Function from receptances (or magnitudes) `(m, n)` to one number each `(m,)`, such as the maximum. Workers need a
    function of a module."""
    name: str = field(kw_only=True)
    version: str = field(kw_only=True)
    """Name, and version of the results."""

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(f"Reduction: function is {self.function!r}, expected a function")
        for key in ("name", "version"):
            _check_text("Reduction", key, getattr(self, key))

    def __str__(self) -> str:
        return f"{self.name}, version {self.version}"


def _check_text(owner: str, key: str, value: object) -> None:
    if not isinstance(value, str):
        raise TypeError(f"{owner}: {key} is {value!r}, expected text")
    if not value:
        raise ValueError(f"{owner}: {key} is empty, expected some text")


class Output(ABC):
    """Base of the quantities that a sweep keeps.

    Subclasses implement the three abstract methods, state a `version`, and can be pickled if workers evaluate them.

    Raises
    ------
    TypeError, ValueError
        A subclass without a version of its own.
    """

    version: ClassVar[str]
    """Version of the results. A store compares the name of the class and this text, but no code: raise it when the
    class, or anything that it uses, changes its results."""
    per_assembly: ClassVar[bool] = True
    """Whether it is evaluated for each assembly of the sweep, or once for the assemblies of the output."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        # An inherited version would be that of other code.
        _check_text(f"the output {cls.__name__}", "version", vars(cls).get("version"))

    @property
    def candidate_s(self) -> float:
        """Approximate time in s per candidate on one thread, which limits the size of blocks; zero if negligible."""
        return 0.0

    @abstractmethod
    def variables(self) -> tuple[Variable, ...]:
        """Return the variables of the results."""

    def assemblies(self) -> tuple[Assembly, ...]:
        """Return the assemblies of the output itself, whose parameters a sweep may vary as well."""
        return ()

    @abstractmethod
    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        """Return the function from candidates `(m, p)` to results; terms that candidates share are evaluated here."""

    @abstractmethod
    def describe(self) -> list[Any]:
        """Return everything that defines the results: numbers, text, arrays, reductions, lists and mappings of them.

        A store compares these values, and name and version of the class.
        """


@dataclass(frozen=True, kw_only=True, eq=False)
class FrequencyResponse(Output):
    """The receptance of each candidate, or a function of it.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.sweep import FrequencyResponse
    >>> FrequencyResponse(frequency_hz=np.linspace(100.0, 4000.0, 40), magnitude=True).variables()[0].shape
    (40,)
    """

    frequency_hz: NDArray[np.inexact]
    """`(n,)` lines in Hz."""
    response: Coordinate | None = None
    excitation: Coordinate | None = None
    """Coordinates of the motion and of the load; by default y at the tip."""
    magnitude: bool = False
    """Keep the magnitude only, which halves the memory."""
    reduce: Reduction | None = None
    """Function of the receptances (or magnitudes) of each candidate, with its name and version; only its results are
    kept."""
    name: str = "receptance"
    """Name in the results."""
    unit: str = "m/N"
    """Unit of the result of `reduce`; by default that of the receptance."""

    version = PROGRAM

    def __post_init__(self) -> None:
        if self.reduce is not None and not isinstance(self.reduce, Reduction):
            raise TypeError(
                f"FrequencyResponse: reduce is {self.reduce!r}, expected Reduction(function, name=..., version=...)"
            )
        object.__setattr__(self, "frequency_hz", _checks.frequencies(self.frequency_hz))

    @property
    def candidate_s(self) -> float:
        return _LINE_S * self.frequency_hz.size

    def variables(self) -> tuple[Variable, ...]:
        if self.reduce is not None:
            return (Variable(self.name, "float64", self.unit, {}, "function of the receptance"),)
        dtype = "float64" if self.magnitude else "complex128"
        lines = {"frequency_hz": self.frequency_hz.real}
        meaning = "magnitude of the receptance" if self.magnitude else "receptance"
        return (Variable(self.name, dtype, self.unit, lines, meaning),)

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        model, columns = _prepared(assembly, addresses, self.frequency_hz, self.response, self.excitation, threads)
        evaluate = model.magnitude if self.magnitude else model.receptance

        def run(values: NDArray[np.float64]) -> Evaluated:
            h = evaluate(values[:, columns])
            feasible = np.asarray(np.isfinite(h).all(axis=1))
            if self.reduce is None:
                return {self.name: h}, feasible
            reduced = np.full(len(h), np.nan)
            if count := int(feasible.sum()):
                values = np.asarray(self.reduce.function(h[feasible]))
                if values.shape != (count,) or values.dtype.kind not in "iufb":
                    raise ValueError(
                        f"{self.name}: reduce returned {values.dtype} of shape {values.shape}, expected one real "
                        f"number for each of {count} candidates"
                    )
                reduced[feasible] = values
            return {self.name: reduced}, feasible

        return run

    def describe(self) -> list[Any]:
        return [self.name, self.frequency_hz, repr(self.response), repr(self.excitation), self.magnitude, self.reduce]


@dataclass(frozen=True, kw_only=True, eq=False)
class NaturalFrequencies(Output):
    """The lowest natural frequencies of each candidate in Hz; NaN if there are fewer below the limit."""

    upper_hz: float
    """Upper limit in Hz."""
    modes: int = 3
    """Number of frequencies to keep."""
    name: str = "natural_frequency"
    """Name in the results."""

    version = PROGRAM

    def __post_init__(self) -> None:
        _checks.positive("NaturalFrequencies", "upper_hz", self.upper_hz, unit="Hz")
        _checks.whole_number("NaturalFrequencies", "modes", self.modes)

    @property
    def candidate_s(self) -> float:
        return _MODES_S

    def variables(self) -> tuple[Variable, ...]:
        return (Variable(self.name, "float64", "Hz", {"mode": np.arange(1, self.modes + 1)}, "natural frequencies"),)

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        assert assembly is not None
        columns = _columns(assembly, addresses)
        varied = [addresses[i] for i in columns]

        def run(values: NDArray[np.float64]) -> Evaluated:
            frequencies = np.full((len(values), self.modes), np.nan)
            feasible = np.zeros(len(values), dtype=np.bool_)
            for i, row in enumerate(values[:, columns].tolist()):
                try:
                    candidate = assembly.replace(dict(zip(varied, row, strict=True)))
                    lowest = candidate.natural_frequencies(self.upper_hz)[: self.modes]
                except (ValueError, ReceptanceError):
                    continue
                frequencies[i, : lowest.size] = lowest
                feasible[i] = True
            return {self.name: frequencies}, feasible

        return run

    def describe(self) -> list[Any]:
        return [self.name, self.upper_hz, self.modes]


@dataclass(frozen=True, kw_only=True, eq=False)
class StableDepth(Output):
    """Limit of the stable depth of cut of each candidate in m, with the same receptance in x and y."""

    cut: Milling | Turning
    """The cut."""
    frequency_hz: NDArray[np.float64]
    """`(n,)` real lines in Hz, several within the half-power bandwidth of each resonance."""
    speeds_rpm: NDArray[np.float64] | None = None
    """Spindle speeds `(k,)`; by default the depth that is stable at all speeds."""
    directions: Literal["x", "y", "both"] = "both"
    """Directions in which the tip is flexible."""
    name: str = "stable_depth"
    """Name in the results."""

    version = PROGRAM

    def __post_init__(self) -> None:
        object.__setattr__(self, "frequency_hz", checked_lines("StableDepth", self.frequency_hz))
        if not isinstance(self.cut, (Milling, Turning)):
            raise TypeError(f"StableDepth: cut is {self.cut!r}, expected Milling or Turning")
        if isinstance(self.cut, Milling):
            self.cut.require_even("StableDepth")
        _checks.one_of("StableDepth", "directions", self.directions, ("x", "y", "both"))
        if self.speeds_rpm is not None:
            object.__setattr__(self, "speeds_rpm", checked_speeds("StableDepth", self.speeds_rpm))

    @property
    def candidate_s(self) -> float:
        return _DEPTH_S + (0.0 if self.speeds_rpm is None else _SPEED_S * self.speeds_rpm.size)

    def variables(self) -> tuple[Variable, ...]:
        speeds = {} if self.speeds_rpm is None else {"spindle_speed_rpm": self.speeds_rpm}
        return (Variable(self.name, "float64", "m", speeds, "stable depth of cut"),)

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        model, columns = _prepared(assembly, addresses, self.frequency_hz, None, None, threads)

        def run(values: NDArray[np.float64]) -> Evaluated:
            h = model.receptance(values[:, columns])
            feasible = np.asarray(np.isfinite(h).all(axis=1))
            shape = () if self.speeds_rpm is None else self.speeds_rpm.shape
            depths = np.full((len(h), *shape), np.nan)
            for i in np.flatnonzero(feasible):
                depths[i] = self._depth(h[i])
            return {self.name: depths}, feasible

        return run

    def _depth(self, h: NDArray[np.complex128]) -> NDArray[np.float64] | float:
        milling = isinstance(self.cut, Milling)
        matrix = np.zeros((h.size, 2, 2) if milling else (h.size, 1, 1), np.complex128)
        for axis, direction in enumerate(("x", "y") if milling else ("x",)):
            if not milling or self.directions in (direction, "both"):
                matrix[:, axis, axis] = h
        depth, phase = critical_depths(self.cut, self.frequency_hz, matrix)
        if self.speeds_rpm is None:
            return float(depth.min())
        teeth = self.cut.teeth if isinstance(self.cut, Milling) else 1
        return limit_over_speed(teeth, self.speeds_rpm, self.frequency_hz, depth, phase)[0]

    def describe(self) -> list[Any]:
        return [self.name, repr(self.cut), self.frequency_hz, self.speeds_rpm, self.directions]


def _columns(assembly: Assembly, addresses: Sequence[str]) -> list[int]:
    """Return the columns of the candidates that are parameters of an assembly."""
    return [i for i, address in enumerate(addresses) if covered(address, assembly)]


def _prepared(
    assembly: Assembly | None,
    addresses: Sequence[str],
    lines: ArrayLike,
    response: Coordinate | None,
    excitation: Coordinate | None,
    threads: int | None,
) -> tuple[ParametricReceptance, list[int]]:
    """Return the model of the candidates of an assembly, and the columns of the parameters of the assembly."""
    assert assembly is not None
    columns = _columns(assembly, addresses)
    model = parametric_receptance(assembly, [addresses[i] for i in columns], lines, response, excitation, threads)
    return model, columns


class Misfit(Output):
    """Sum of squared residuals of each candidate, as `identify` minimises it.

    The residual of a receptance is ln(measured / model) / standard deviation on each line, that of a natural frequency
    (model - measured) / standard deviation, so the sum is chi-square. Without standard deviations the residuals are
    the logarithm and the relative difference.

    Parameters
    ----------
    observations : Observation, or a sequence of them
        Measurements, each with its own assembly.
    name : str, optional
        Name in the results.
    """

    version = PROGRAM
    per_assembly = False

    def __init__(
        self,
        observations: Observation | Sequence[Observation],
        *,
        name: str = "misfit",
    ) -> None:
        self.observations = as_observations(observations)
        self.name = name

    @property
    def candidate_s(self) -> float:
        return sum(
            _LINE_S * observation.frequency_hz.size if observation.is_receptance else _MODES_S
            for observation in self.observations
        )

    def variables(self) -> tuple[Variable, ...]:
        return (Variable(self.name, "float64", "", {}, "sum of squared residuals, of all observations"),)

    def assemblies(self) -> tuple[Assembly, ...]:
        """Return the assemblies of the observations."""
        return tuple(observation.assembly for observation in self.observations)

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        misfits = [
            _frf_misfit(observation, addresses, threads)
            if observation.is_receptance
            else _frequency_misfit(observation, addresses)
            for observation in self.observations
        ]

        def run(values: NDArray[np.float64]) -> Evaluated:
            total = np.zeros(len(values))
            for misfit in misfits:
                total += misfit(values)
            return {self.name: total}, np.isfinite(total)

        return run

    def describe(self) -> list[Any]:
        content: list[Any] = [self.name]
        for item in self.observations:
            content.append(item.frequency_hz)
            if item.is_receptance:
                points = [repr(item.response), repr(item.excitation)]
                content += [item.receptance, item.standard_deviation, *points, item.force]
            else:
                content += [list(item.modes), item.standard_deviation]
                content += [item.damping_ratio, item.standard_deviation_damping] if item.damped.size else []
        return content


def _frf_misfit(
    frf: Observation, addresses: Sequence[str], threads: int | None
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    if frf.force is not None:
        raise ValueError(f"{frf!r} has a stepped force, which sweeps do not support; give the level of the joint")
    model, columns = _prepared(frf.assembly, addresses, frf.frequency_hz, frf.response, frf.excitation, threads)
    weights = None if frf.standard_deviation is None else 1.0 / frf.standard_deviation
    return lambda values: model.misfit(values[:, columns], frf.receptance, weights)


def _frequency_misfit(
    measured: Observation, addresses: Sequence[str]
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    unit: Unit = "relative" if measured.standard_deviation is None else "standard deviations"
    mapping = ParameterMap.plain(measured.assembly, addresses)
    return lambda values: np.asarray(np.sum(residuals_at(measured, mapping, unit, values) ** 2, axis=1))
