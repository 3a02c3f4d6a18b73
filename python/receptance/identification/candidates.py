"""Measurements that could be taken, and what is to be known better: observations without data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.assembly import Assembly
from receptance.coordinates import Coordinate
from receptance.identification.floor import Floor
from receptance.identification.laws import Tolerance

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Candidate", "FrequencyTarget", "ReceptanceTarget", "natural_slopes"]


class _Somewhere:
    """An assembly in a configuration under conditions, with errors of its own."""

    assembly: Assembly
    label: str
    configuration: str
    conditions: Mapping[str, float]
    tolerances: tuple[Tolerance, ...]

    def _check(self) -> str:
        kind = type(self).__name__
        if not isinstance(self.label, str) or not self.label:
            raise TypeError(f"{kind}: label is {self.label!r}, expected text that says what it is")
        owner = f"{kind} {self.label!r}"
        if not isinstance(self.assembly, Assembly):
            raise TypeError(f"{owner}: assembly is {self.assembly!r}, expected an Assembly")
        given = (self.tolerances,) if isinstance(self.tolerances, Tolerance) else tuple(self.tolerances)
        for index, one in enumerate(given):
            if not isinstance(one, Tolerance):
                raise TypeError(f"{owner}: tolerances[{index}] is {one!r}, expected a Tolerance")
        object.__setattr__(self, "tolerances", given)
        object.__setattr__(self, "conditions", dict(self.conditions))
        object.__setattr__(self, "configuration", self.configuration or self.label)
        return owner


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate(_Somewhere):
    """A measurement that could be taken: an observation without data.

    Either a receptance on `frequency_hz`, or natural frequencies of some `modes`.

    Parameters
    ----------
    label : str
        What it is called.
    assembly : Assembly
        What would be measured. The values of what is identified do not matter.
    frequency_hz : array_like, optional
        `(n,)` lines of a receptance, in Hz.
    response, excitation : Coordinate, optional
        Where motion would be seen and where the load would act; by default y at the tip.
    standard_deviation : array_like, optional
        Of the real and of the imaginary part of the logarithm of the receptance, one number or `(n,)`; by default 1 %.
    floor : float or Floor, optional
        What no noise model covers, added in squares, as in `MeasuredFRF.from_frf`.
    modes : sequence of int, optional
        Elastic modes whose natural frequencies would be measured, the lowest is 1.
    standard_deviation_hz : array_like, optional
        Of these frequencies, in Hz.
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors that it brings: those of its clamping say. What has the name of an error of the fit is that one error;
        errors of the fit that its assembly has count in any case.
    configuration : str, optional
        Name of its configuration, for laws and tolerances; by default the label.
    conditions : mapping of str to float, optional
        Numbers that describe it, in SI units, for laws.
    cost : float, optional
        What it costs, in any unit, the same for all: the ranking is by what is gained for it.

    Raises
    ------
    TypeError, ValueError
        Neither lines nor modes or both, and lines, modes or deviations that are unusable.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Segment
    >>> from receptance.identification import Candidate
    >>> bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    >>> Candidate(label="blank", assembly=bar, frequency_hz=np.linspace(100.0, 4000.0, 40))
    Candidate('blank', receptance on 40 lines from 100 to 4000 Hz)
    """

    label: str
    assembly: Assembly
    frequency_hz: NDArray[Any] | None = None
    response: Coordinate = field(default_factory=Coordinate)
    excitation: Coordinate = field(default_factory=Coordinate)
    standard_deviation: ArrayLike = 0.01
    floor: float | Floor = 0.0
    modes: tuple[int, ...] | None = None
    standard_deviation_hz: ArrayLike | None = None
    tolerances: tuple[Tolerance, ...] = ()
    configuration: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    cost: float = 1.0

    def __post_init__(self) -> None:
        owner = self._check()
        object.__setattr__(self, "cost", _checks.positive(owner, "cost", self.cost))
        if (self.frequency_hz is None) == (self.modes is None):
            what = "neither frequency_hz nor modes" if self.modes is None else "frequency_hz and modes"
            raise ValueError(f"{owner}: there is {what}, expected one of the two")
        if self.modes is not None:
            if self.standard_deviation_hz is None:
                raise ValueError(f"{owner}: standard_deviation_hz is missing, expected one for its natural frequencies")
            object.__setattr__(self, "modes", _modes(owner, self.modes))
            spread = _deviation(owner, "standard_deviation_hz", self.standard_deviation_hz, len(self.modes))
            object.__setattr__(self, "standard_deviation_hz", spread)
            return
        lines = _lines(owner, self.frequency_hz)
        object.__setattr__(self, "frequency_hz", lines)
        for name in ("response", "excitation"):
            if not isinstance(getattr(self, name), Coordinate):
                raise TypeError(f"{owner}: {name} is {getattr(self, name)!r}, expected one Coordinate")
        if not isinstance(self.floor, Floor):
            object.__setattr__(self, "floor", Floor(relative=self.floor, frequency=0.0))
        spread = _deviation(owner, "standard_deviation", self.standard_deviation, lines.size)
        object.__setattr__(self, "standard_deviation", spread)

    def rows(self, assembly: Assembly, addresses: Sequence[str]) -> NDArray[np.float64]:
        """Return the derivatives of its weighted residuals by parameters of its assembly, `(n_residuals, m)`."""
        if self.frequency_hz is None:
            _, slopes = natural_slopes(assembly, self.modes or (), addresses)
            return slopes / np.asarray(self.standard_deviation_hz, dtype=np.float64)[:, None]
        h, dh = assembly.derivatives(
            self.frequency_hz, list(addresses), response=self.response, excitation=self.excitation
        )
        variance = np.asarray(self.standard_deviation, dtype=np.float64) ** 2
        if isinstance(self.floor, Floor) and self.floor:
            variance = variance + self.floor.variance(np.asarray(self.frequency_hz).real, h)
        relative = dh / (h * np.sqrt(variance))[:, None]
        return np.concatenate([relative.real, relative.imag])

    def __repr__(self) -> str:
        if self.frequency_hz is None:
            what = f"natural frequencies of modes {', '.join(map(str, self.modes or ()))}"
        else:
            low, high = self.frequency_hz[[0, -1]].real
            what = f"receptance on {self.frequency_hz.size} lines from {low:g} to {high:g} Hz"
        return f"Candidate({self.label!r}, {what})"


@dataclass(frozen=True, kw_only=True, eq=False)
class FrequencyTarget(_Somewhere):
    """Natural frequencies of an assembly that are to be predicted better.

    Parameters
    ----------
    label, assembly, configuration, conditions, tolerances
        As of a `Candidate`.
    modes : sequence of int, optional
        Which elastic modes, the lowest is 1.
    """

    label: str
    assembly: Assembly
    modes: tuple[int, ...] = (1,)
    tolerances: tuple[Tolerance, ...] = ()
    configuration: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        owner = self._check()
        object.__setattr__(self, "modes", _modes(owner, self.modes))

    def rows(self, assembly: Assembly, addresses: Sequence[str]) -> tuple[list[str], NDArray[Any], NDArray[np.float64]]:
        """Return names, values and derivatives `(n, m)` of what is predicted."""
        found, slopes = natural_slopes(assembly, self.modes, addresses)
        return [f"{self.label}: mode {mode} [Hz]" for mode in self.modes], found, slopes


@dataclass(frozen=True, kw_only=True, eq=False)
class ReceptanceTarget(_Somewhere):
    """A receptance that is to be predicted better: its logarithm, over some lines together.

    Parameters
    ----------
    label, assembly, configuration, conditions, tolerances, response, excitation
        As of a `Candidate`.
    frequency_hz : array_like
        `(n,)` lines in Hz.
    """

    label: str
    assembly: Assembly
    frequency_hz: NDArray[Any]
    response: Coordinate = field(default_factory=Coordinate)
    excitation: Coordinate = field(default_factory=Coordinate)
    tolerances: tuple[Tolerance, ...] = ()
    configuration: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        owner = self._check()
        object.__setattr__(self, "frequency_hz", _lines(owner, self.frequency_hz))

    def rows(self, assembly: Assembly, addresses: Sequence[str]) -> tuple[list[str], NDArray[Any], NDArray[np.float64]]:
        """Return the name and the derivatives of the logarithm, real and imaginary parts, `(2 n, m)`; no value."""
        h, dh = assembly.derivatives(
            self.frequency_hz, list(addresses), response=self.response, excitation=self.excitation
        )
        relative = dh / h[:, None]
        return [f"{self.label}: log receptance"], np.zeros(1), np.concatenate([relative.real, relative.imag])


def natural_slopes(
    assembly: Assembly, modes: Sequence[int], addresses: Sequence[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return natural frequencies of some modes in Hz, and their derivatives `(n, m)`."""
    found, slopes = assembly.lowest_natural_frequencies(max(modes), list(addresses))
    rows = np.array(modes) - 1
    return found[rows], slopes[rows]


def _lines(owner: str, lines: ArrayLike | None) -> NDArray[Any]:
    found = np.atleast_1d(_checks.unmasked(owner, "frequency_hz", lines))
    good = found.ndim == 1 and found.size and found.dtype.kind in "iufc" and np.isfinite(found).all()
    if not good or not np.all(found.real > 0.0) or not np.all(np.diff(found.real) > 0.0):
        raise ValueError(f"{owner}: frequency_hz is {lines!r}, expected ascending lines above zero")
    return found.astype(np.complex128 if found.dtype.kind == "c" else np.float64)


def _modes(owner: str, modes: Sequence[int]) -> tuple[int, ...]:
    found = tuple(modes)
    whole = all(isinstance(m, (int, np.integer)) and not isinstance(m, bool) and m >= 1 for m in found)
    if not found or not whole or len(set(found)) < len(found):
        raise ValueError(f"{owner}: modes is {modes!r}, expected different whole numbers from 1")
    return tuple(int(m) for m in found)


def _deviation(owner: str, name: str, value: ArrayLike, count: int) -> NDArray[np.float64]:
    found = _checks.unmasked(owner, name, value, np.float64)
    if found.ndim > 1 or (found.ndim == 1 and found.size != count):
        raise ValueError(f"{owner}: {name} has shape {found.shape}, expected one number or {count}")
    if not (np.isfinite(found).all() and np.all(found > 0.0)):
        raise ValueError(f"{owner}: {name} is {value!r}, expected numbers above zero")
    return np.broadcast_to(found, (count,)).copy()
