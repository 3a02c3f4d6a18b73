"""What a sweep keeps of each candidate."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance._candidates import candidates_of
from receptance.coordinates import Coordinate
from receptance.errors import ReceptanceError
from receptance.identification.unknowns import covered
from receptance.stability import Milling, Turning, critical_depths
from receptance.stability.zeroth_order import limit_over_speed

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.assembly import Assembly

__all__ = [
    "Evaluated",
    "Evaluation",
    "FrequencyResponse",
    "NaturalFrequencies",
    "Output",
    "StableDepth",
    "Variable",
    "own_parameters",
    "shared_candidates",
]

LINE_S, MODES_S = 5e-9, 2e-4
"""About what a line of a joint takes, and the natural frequencies of a model."""
_DEPTH_S, _SPEED_S = 6e-4, 3e-5
"""About what a stable depth takes, and one more spindle speed."""

Evaluated = tuple[dict[str, "NDArray[Any]"], "NDArray[np.bool_]"]
"""Arrays by variable, each with one row a candidate, and which candidates have a model."""
Evaluation = Callable[["NDArray[np.float64]"], Evaluated]


@dataclass(frozen=True, eq=False)
class Variable:
    """A quantity that a sweep keeps, without its dimension `candidate`.

    Attributes
    ----------
    name : str
        Its name in the results.
    dtype : str
        Of its numbers.
    unit : str
        SI.
    dimensions : mapping of str to ndarray
        Names and coordinates of its own dimensions.
    meaning : str
        For people.
    """

    name: str
    dtype: str
    unit: str
    dimensions: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    meaning: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        """Of one candidate."""
        return tuple(len(values) for values in self.dimensions.values())


class Output(ABC):
    """What is kept of each candidate. An output of your own has these four methods, and pickles if workers run it."""

    per_assembly = True
    """Whether it is evaluated on each assembly of the sweep; else on assemblies of its own, once."""

    @property
    def candidate_s(self) -> float:
        """About what a candidate takes on one thread, so that blocks are soon done; zero if next to nothing."""
        return 0.0

    @abstractmethod
    def variables(self) -> tuple[Variable, ...]:
        """Return what it keeps."""

    @abstractmethod
    def assemblies(self) -> tuple[Assembly, ...]:
        """Return its own assemblies, whose parameters a sweep may vary."""

    @abstractmethod
    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        """Return the function from candidates `(m, p)` to what is kept; what they share is evaluated here, once."""

    @abstractmethod
    def describe(self) -> list[Any]:
        """Return what defines its results: numbers, text, arrays, functions; its own code is compared as well."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FrequencyResponse(Output):
    """The receptance of each candidate, or what a function makes of it.

    Parameters
    ----------
    frequency_hz : array_like
        `(n,)` lines in Hz.
    response, excitation : Coordinate, optional
        Where motion is seen and the load acts; by default y at the tip.
    magnitude : bool, optional
        Keep the magnitude alone, half the memory.
    reduce : callable, optional
        From receptances (or magnitudes) `(m, n)` to one number each `(m,)`: the largest say, so that the receptances
        need not be kept. A function of a module, where other processes are to run it. A store compares its code and the
        values that it refers to.
    name : str, optional
        In the results.
    unit : str, optional
        Of what `reduce` returns; by default that of the receptance.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.sweep import FrequencyResponse
    >>> FrequencyResponse(frequency_hz=np.linspace(100.0, 4000.0, 40), magnitude=True).variables()[0].shape
    (40,)
    """

    frequency_hz: NDArray[Any]
    response: Coordinate | None = None
    excitation: Coordinate | None = None
    magnitude: bool = False
    reduce: Callable[[NDArray[Any]], NDArray[Any]] | None = None
    name: str = "receptance"
    unit: str = "m/N"

    def __post_init__(self) -> None:
        object.__setattr__(self, "frequency_hz", _checks.frequencies(self.frequency_hz))

    @property
    def candidate_s(self) -> float:
        """About what a candidate takes; see `Output`."""
        return LINE_S * self.frequency_hz.size

    def variables(self) -> tuple[Variable, ...]:
        """Return what it keeps."""
        if self.reduce is not None:
            return (Variable(self.name, "float64", self.unit, {}, "of the receptance"),)
        dtype = "float64" if self.magnitude else "complex128"
        lines = {"frequency_hz": self.frequency_hz.real}
        meaning = "magnitude of the receptance" if self.magnitude else "receptance"
        return (Variable(self.name, dtype, self.unit, lines, meaning),)

    def assemblies(self) -> tuple[Assembly, ...]:
        """Return its own assemblies: none."""
        return ()

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        """Return the function from candidates to what is kept."""
        found, columns = shared_candidates(
            assembly, addresses, self.frequency_hz, self.response, self.excitation, threads
        )
        evaluated = found.magnitude if self.magnitude else found.receptance

        def run(values: NDArray[np.float64]) -> Evaluated:
            h = evaluated(np.ascontiguousarray(values[:, columns]))
            good = np.isfinite(h).all(axis=1)
            if self.reduce is None:
                return {self.name: h}, good
            kept = np.full(len(h), np.nan)
            if good.any():
                kept[good] = _one_each(self, np.asarray(self.reduce(h[good])), int(good.sum()))
            return {self.name: kept}, good

        return run

    def describe(self) -> list[Any]:
        """Return what defines it."""
        return [self.name, self.frequency_hz, repr(self.response), repr(self.excitation), self.magnitude, self.reduce]


@dataclass(frozen=True, kw_only=True, eq=False)
class NaturalFrequencies(Output):
    """The lowest natural frequencies of each candidate, in Hz; NaN where there are fewer below the limit.

    Parameters
    ----------
    upper_hz : float
        Limit in Hz.
    modes : int, optional
        How many are kept.
    name : str, optional
        In the results.
    """

    upper_hz: float
    modes: int = 3
    name: str = "natural_frequency"

    def __post_init__(self) -> None:
        _checks.positive("NaturalFrequencies", "upper_hz", self.upper_hz, unit="Hz")
        if isinstance(self.modes, bool) or not isinstance(self.modes, (int, np.integer)) or self.modes < 1:
            raise ValueError(f"NaturalFrequencies: modes is {self.modes!r}, expected a whole number of at least one")

    @property
    def candidate_s(self) -> float:
        """About what a candidate takes; see `Output`."""
        return MODES_S

    def variables(self) -> tuple[Variable, ...]:
        """Return what it keeps."""
        return (Variable(self.name, "float64", "Hz", {"mode": np.arange(1, self.modes + 1)}, "natural frequencies"),)

    def assemblies(self) -> tuple[Assembly, ...]:
        """Return its own assemblies: none."""
        return ()

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        """Return the function from candidates to what is kept."""
        assert assembly is not None
        columns, own = own_parameters(assembly, addresses)

        def run(values: NDArray[np.float64]) -> Evaluated:
            kept = np.full((len(values), self.modes), np.nan)
            good = np.zeros(len(values), dtype=np.bool_)
            for i, row in enumerate(values[:, columns].tolist()):
                try:
                    found = assembly.replace(dict(zip(own, row, strict=True))).natural_frequencies(self.upper_hz)
                except (ValueError, ReceptanceError):
                    continue
                kept[i, : found.size] = found[: self.modes]
                good[i] = True
            return {self.name: kept}, good

        return run

    def describe(self) -> list[Any]:
        """Return what defines it."""
        return [self.name, self.upper_hz, self.modes]


@dataclass(frozen=True, kw_only=True, eq=False)
class StableDepth(Output):
    """Depth of cut in m up to which each candidate is stable, with the same receptance in x and y.

    Parameters
    ----------
    cut : Milling or Turning
        The cut.
    frequency_hz : array_like
        `(n,)` real lines in Hz, dense enough to follow the resonances.
    speeds_rpm : array_like, optional
        Spindle speeds `(k,)`; without them the depth that is stable at any speed.
    directions : {"x", "y", "both"}, optional
        In which directions the tip yields.
    name : str, optional
        In the results.
    """

    cut: Milling | Turning
    frequency_hz: NDArray[np.float64]
    speeds_rpm: NDArray[np.float64] | None = None
    directions: str = "both"
    name: str = "stable_depth"

    def __post_init__(self) -> None:
        lines = _checks.frequencies(self.frequency_hz)
        if lines.dtype.kind == "c" or lines.size < 2:
            raise ValueError("StableDepth: frequency_hz must be two or more real lines")
        object.__setattr__(self, "frequency_hz", lines)
        if not isinstance(self.cut, (Milling, Turning)):
            raise TypeError(f"StableDepth: cut is {self.cut!r}, expected Milling or Turning")
        if self.directions not in ("x", "y", "both"):
            raise ValueError(f"StableDepth: directions is {self.directions!r}, expected 'x', 'y' or 'both'")
        if self.speeds_rpm is not None:
            speeds = np.atleast_1d(np.asarray(self.speeds_rpm, np.float64))
            if speeds.ndim != 1 or not speeds.size or not (np.isfinite(speeds) & (speeds > 0.0)).all():
                raise ValueError("StableDepth: speeds_rpm must be finite and more than zero, one dimension")
            object.__setattr__(self, "speeds_rpm", speeds)

    @property
    def candidate_s(self) -> float:
        """About what a candidate takes; see `Output`."""
        return _DEPTH_S + (0.0 if self.speeds_rpm is None else _SPEED_S * self.speeds_rpm.size)

    def variables(self) -> tuple[Variable, ...]:
        """Return what it keeps."""
        speeds = {} if self.speeds_rpm is None else {"spindle_speed_rpm": self.speeds_rpm}
        return (Variable(self.name, "float64", "m", speeds, "depth of cut that is stable"),)

    def assemblies(self) -> tuple[Assembly, ...]:
        """Return its own assemblies: none."""
        return ()

    def prepare(self, assembly: Assembly | None, addresses: Sequence[str], threads: int | None) -> Evaluation:
        """Return the function from candidates to what is kept."""
        found, columns = shared_candidates(assembly, addresses, self.frequency_hz, None, None, threads)

        def run(values: NDArray[np.float64]) -> Evaluated:
            h = found.receptance(np.ascontiguousarray(values[:, columns]))
            good = np.isfinite(h).all(axis=1)
            shape = () if self.speeds_rpm is None else self.speeds_rpm.shape
            kept = np.full((len(h), *shape), np.nan)
            for i in np.flatnonzero(good):
                kept[i] = self._depth(h[i])
            return {self.name: kept}, good

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
        """Return what defines it."""
        return [self.name, repr(self.cut), self.frequency_hz, self.speeds_rpm, self.directions]


def own_parameters(assembly: Assembly, addresses: Sequence[str]) -> tuple[list[int], list[str]]:
    """Return the columns and addresses of the parameters that an assembly has."""
    columns = [i for i, address in enumerate(addresses) if covered(address, assembly)]
    return columns, [addresses[i] for i in columns]


def shared_candidates(
    assembly: Assembly | None, addresses: Sequence[str], lines: ArrayLike, response: Coordinate | None,
    excitation: Coordinate | None, threads: int | None,
) -> tuple[Any, list[int]]:  # fmt: skip
    """Return what candidates of an assembly share, and the columns of those of the parameters that it has."""
    assert assembly is not None
    columns, own = own_parameters(assembly, addresses)
    found = candidates_of(assembly, tuple(own), lines, response=response, excitation=excitation, threads=threads)
    return found, columns


def _one_each(output: FrequencyResponse, reduced: NDArray[Any], count: int) -> NDArray[np.float64]:
    if reduced.shape != (count,) or reduced.dtype.kind not in "iufb":
        raise ValueError(
            f"{output.name}: reduce returned {reduced.dtype} of shape {reduced.shape}, expected one real number for "
            f"each of {count} candidates"
        )
    return reduced.astype(np.float64)
