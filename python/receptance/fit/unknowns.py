"""Parameters to identify, their relations between configurations, tolerances, and the fitted variables."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import special

from receptance import _checks, units
from receptance.model.addresses import QUANTITIES
from receptance.model.assembly import Assembly

_LARGEST_SHARE = 1.0 - 2.0**-53
"""Largest share whose normal quantile is finite."""
_ERROR_BOUND = 8.0
"""Bounds of an error of a tolerance, in standard deviations."""
Scale = Literal["log", "linear"]

PARAMETERS = {
    **QUANTITIES,
    # Of the measuring chain, see `receptance.fit.parameters`:
    "log_gain": units.LOGARITHM,
    "delay": units.DELAY,
    "decay_rate": units.DECAY_RATE,
    "decay_rate_of_velocity": units.DECAY_RATE,
    "decay_rate_of_displacement": units.DECAY_RATE,
    "end": units.TIME,
    **dict.fromkeys(
        ("frequency_offset", "frequency_offset_of_velocity", "frequency_offset_of_displacement"), units.FREQUENCY_SHIFT
    ),
    "level_exponent": units.LEVEL_EXPONENT,
    "level_slope": units.DELAY,
    "phase": units.PHASE,
    "low_pass": units.DELAY,
    "high_pass": units.CORNER,
}
"""Quantities of all parameters by the last word of their addresses."""


@dataclass(frozen=True, kw_only=True)
class Prior:
    """Gaussian prior of an unknown, on the scale of the fit.

    Raises
    ------
    TypeError, ValueError
        A mean that is not finite, or a standard deviation that is not above zero.

    Examples
    --------
    >>> import math
    >>> from receptance.fit import Prior, Unknown
    >>> about = Prior(mean=1e8, standard_deviation=math.log(3))
    >>> Unknown(address="joint.k_y", lower=1e6, upper=1e10, prior=about).prior.mean
    100000000.0
    """

    mean: float
    """Mean in SI units."""
    standard_deviation: float
    """In SI units on a linear scale. On a log scale of the natural logarithm: 0.1 is about 10 %, log(3) is a factor of
    three."""

    def __post_init__(self) -> None:
        mean = _checks.number("Prior", "mean", self.mean)
        deviation = _checks.positive("Prior", "standard_deviation", self.standard_deviation)
        _checks.set_fields(self, {"mean": mean, "standard_deviation": deviation})


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """A parameter to be identified.

    Raises
    ------
    TypeError, ValueError
        Bounds that are not finite, are reversed or exclude the start; on a log scale, a lower bound or a mean of the
        prior of zero or less.

    Examples
    --------
    >>> from receptance.fit import Unknown
    >>> Unknown(address="joint.k_theta", lower=1e3, upper=1e7).start
    100000.0
    """

    address: str
    """As in `Assembly.parameters`, or with `segment[*]`; the unknown is shared by all observations whose assembly has
    the address."""
    lower: float
    upper: float
    """Lower and upper bound in SI units."""
    start: float | None = None
    """Start of the first fit; by default the middle of the bounds on the scale of the fit."""
    scale: Scale | None = None
    """Whether log10 of the value or the value itself is fitted; by default the logarithm if the lower bound is above
    zero."""
    prior: Prior | None = None
    """Prior; by default uniform within the bounds."""
    configurations: tuple[str, ...] | None = None
    """Configurations or labels of the observations that have the unknown, one name or several; by default all."""
    labels: tuple[str, ...] | str | None = None
    """Labels of the observations that have the unknown, one or several; by default all."""
    name: str = ""
    """Name in results; by default the address, with the configurations or labels if they are given."""
    multiple: float = 1.0
    """Ratio of the parameter at the address to the unknown."""
    also: Mapping[str, float] = field(default_factory=dict)
    """Other addresses and the ratios of their parameters to the unknown. An observed assembly must have at least one of
    all addresses; the others may be in predicted assemblies."""

    def __post_init__(self) -> None:
        if not isinstance(self.address, str):
            raise TypeError(f"Unknown: address is {self.address!r}, expected text like 'joint.k_theta'")
        owner = f"Unknown {self.address!r}"
        lower, upper = (_checks.number(owner, name, getattr(self, name)) for name in ("lower", "upper"))
        if lower >= upper:
            raise ValueError(f"{owner}: lower is {lower:g} and upper {upper:g}, expected lower below upper")
        scale = self.scale if self.scale is not None else ("log" if lower > 0.0 else "linear")
        _checks.one_of(owner, "scale", scale, Scale)
        if scale == "log" and lower <= 0.0:
            raise ValueError(f"{owner}: lower is {lower:g}, expected more than zero on a log scale")
        if self.start is None:
            start = math.sqrt(lower) * math.sqrt(upper) if scale == "log" else 0.5 * lower + 0.5 * upper
            start = min(max(start, lower), upper)
        else:
            start = _checks.number(owner, "start", self.start)
        if not lower <= start <= upper:
            raise ValueError(f"{owner}: start is {start:g}, outside the bounds {lower:g} to {upper:g}")
        if self.prior is not None:
            if not isinstance(self.prior, Prior):
                raise TypeError(f"{owner}: prior is {self.prior!r}, expected a Prior")
            if scale == "log" and self.prior.mean <= 0.0:
                raise ValueError(f"{owner}: the prior's mean is {self.prior.mean:g}, expected more than zero")
        configurations, labels = (names_of_configurations(owner, names) for names in (self.configurations, self.labels))
        limits = ", ".join([*(configurations or ()), *(labels or ())])
        title = self.name or self.address + (f" @ {limits}" if limits else "")
        _checks.set_fields(self, {"lower": lower, "upper": upper, "start": start, "scale": scale})
        _checks.set_fields(self, {"configurations": configurations, "labels": labels, "name": title})

    @property
    def tied(self) -> bool:
        """Whether it determines other parameters than the one at its address, or a multiple."""
        return bool(self.also) or self.multiple != 1.0

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of the parameters that it changes."""
        return (self.address, *self.also)

    @property
    def unit(self) -> str:
        """SI unit of its value; empty for plain numbers: exponents, ratios and logarithms.

        Examples
        --------
        >>> from receptance.fit import Unknown
        >>> Unknown(address="joint.k_theta", lower=1e3, upper=1e7).unit
        'N m/rad'
        """
        # Names of exponents and of errors contain spaces.
        if self.multiple != 1.0 or " " in self.address:
            return ""
        quantity = PARAMETERS.get(self.address.rpartition(".")[2])
        return "" if quantity is None else quantity.unit


Bounds: TypeAlias = tuple[float, float] | tuple[float, float, float] | Mapping[str, Any]
"""Lower and upper bound of an unknown, its start if it is given, or keyword arguments of `Unknown`."""
Unknowns: TypeAlias = Unknown | Sequence[Unknown] | Mapping[str, Bounds]
"""Parameters to identify as arguments: objects, or bounds by address."""


def as_unknowns(unknowns: Unknowns, *, least: int = 1) -> tuple[Unknown, ...]:
    """Return unknowns that are given as objects, or as bounds by address, at least `least` of them.

    Examples
    --------
    >>> from receptance.fit.unknowns import as_unknowns
    >>> [one.start for one in as_unknowns({"joint.k_y": (1e7, 1e9), "joint.c_y": {"lower": 0.0, "upper": 500.0}})]
    [100000000.0, 250.0]
    """
    if not isinstance(unknowns, Mapping):
        return _checks.items("unknowns", unknowns, Unknown, least=least)
    objects = []
    for address, bounds in unknowns.items():
        if isinstance(bounds, Unknown):
            raise TypeError(f"unknowns[{address!r}] is an Unknown, expected bounds, or give a list of Unknown")
        if isinstance(bounds, Mapping):
            objects.append(Unknown(address=address, **bounds))
            continue
        numbers: tuple[Any, ...] = tuple(bounds) if isinstance(bounds, (tuple, list, np.ndarray)) else ()
        if len(numbers) not in (2, 3):
            raise TypeError(
                f"unknowns[{address!r}] is {bounds!r}, expected (lower, upper), (lower, upper, start), or a dictionary "
                "with lower, upper and other arguments of Unknown"
            )
        lower, upper, start = (*numbers, None)[:3]
        objects.append(Unknown(address=address, lower=lower, upper=upper, start=start))
    return _checks.items("unknowns", objects, Unknown, least=least)


def names_of_configurations(owner: str, configurations: str | Sequence[str] | None) -> tuple[str, ...] | None:
    """Return names of configurations as a tuple; None means all."""
    if configurations is None:
        return None
    names = (configurations,) if isinstance(configurations, str) else tuple(configurations)
    if not names or not all(isinstance(name, str) and name for name in names):
        raise ValueError(f"{owner}: configurations is {configurations!r}, expected names of configurations, or None")
    return names


# A diagnosis needs the same errors in some hundred models.
@lru_cache(maxsize=1 << 12)
def error_of(name: str, start: float = 0.0) -> Unknown:
    """Return the unknown of an error, in its standard deviations."""
    return Unknown(
        address=name,
        lower=-_ERROR_BOUND,
        upper=_ERROR_BOUND,
        start=start,
        scale="linear",
        prior=Prior(mean=0.0, standard_deviation=1.0),
    )


@dataclass(frozen=True, kw_only=True)
class Power:
    """A power law (x / reference)^exponent of a condition, with an unknown exponent.

    Raises
    ------
    TypeError, ValueError
        A reference of zero or less, or invalid bounds.
    """

    of: str
    """Name of a condition of the observations ("torque", "drawbar force"), or an address of their assemblies
    ("tool.segment[0].length")."""
    reference: float
    """Value of the condition in SI units at which the parameter equals its unknown."""
    lower: float = -4.0
    upper: float = 4.0
    """Lower and upper bound of the exponent."""
    start: float = 0.0
    """Start of the first fit."""
    prior: Prior | None = None
    """Prior of the exponent."""

    def __post_init__(self) -> None:
        if not isinstance(self.of, str) or not self.of:
            raise TypeError(f"Power: of is {self.of!r}, expected the name of a condition or an address")
        reference = _checks.positive(f"Power of {self.of!r}", "reference", self.reference)
        _checks.set_fields(self, {"reference": reference})
        self.exponent("")

    def exponent(self, name: str) -> Unknown:
        """Return the unknown of the exponent for a law with this name."""
        title = f"{name} ~ {self.of}"
        return Unknown(
            address=title, lower=self.lower, upper=self.upper, start=self.start, scale="linear", prior=self.prior
        )


@dataclass(frozen=True, kw_only=True)
class Law(Unknown):
    """A parameter to identify, and the relation of its values in several configurations.

    The value in a configuration is that of the unknown, times powers of conditions, times an individual part. The
    fields of `Unknown` refer to the value at the references of the powers.

    Raises
    ------
    TypeError, ValueError
        As in `Unknown`; a free law with powers, an individual part or following parameters.

    Examples
    --------
    >>> from receptance.fit import Law, Power
    >>> law = Law(address="joint.k_y", lower=1e6, upper=1e10, powers=Power(of="torque", reference=40.0))
    >>> [unknown.name for unknown in law.expanded(["20 Nm", "40 Nm"])]
    ['joint.k_y', 'joint.k_y ~ torque']
    """

    powers: tuple[Power, ...] = ()
    """Powers of conditions. Their exponents are called `<name> ~ <condition>`."""
    free: bool = False
    """Whether each configuration has its own value, called `<name> @ <configuration>`, with the same bounds, start and
    prior."""
    along: str = ""
    """Name of a condition, for a free law. A configuration that was not fitted has the value that is interpolated
    linearly between its two neighbours in this condition."""
    starts: Mapping[str, float] = field(default_factory=dict)
    """Starts of a free law in some configurations; the others start at `start`."""
    individual: float = 0.0
    """Standard deviation of the natural logarithm of an individual factor of every configuration: 0.05 if the stiffness
    varies by 5 % between clampings. The factor is called `<name> @ <configuration>` and is counted in these standard
    deviations. A configuration is one clamping here."""
    follows: Mapping[str, float] = field(default_factory=dict)
    """Further parameters by address that vary in proportion: they are multiplied by the powers and the individual
    factor, raised to the given number. The number is 0.5 with each of two stiffnesses for their coupling term."""

    def __post_init__(self) -> None:
        super().__post_init__()
        owner = f"Law {self.address!r}"
        share = {str(a): _checks.number(owner, f"follows[{a!r}]", n) for a, n in dict(self.follows).items()}
        if self.free and share:
            raise ValueError(f"{owner}: it is free and has parameters that follow it, expected one of the two")
        powers = (self.powers,) if isinstance(self.powers, Power) else tuple(self.powers)
        for index, power in enumerate(powers):
            if not isinstance(power, Power):
                raise TypeError(f"{owner}: powers[{index}] is {power!r}, expected a Power")
        individual = _checks.not_negative(owner, "individual", self.individual)
        _checks.set_fields(self, {"follows": share, "powers": powers, "individual": individual})
        if self.free and (powers or self.individual):
            raise ValueError(f"{owner}: it is free and has powers or individual parts, expected one of the two")
        if not isinstance(self.along, str) or (self.along and not self.free):
            raise ValueError(f"{owner}: along is {self.along!r}, expected the name of a condition, of a free law only")

    def expanded(self, configurations: Sequence[str]) -> list[Unknown]:
        """Return the unknowns of the law for these configurations."""
        if self.free:
            return [self.base(self.name_in(name), (name,), self.starts.get(name)) for name in configurations]
        unknowns = [self.base(self.name, self.configurations)]
        unknowns += [power.exponent(self.name) for power in self.powers]
        if self.individual:
            unknowns += [error_of(self.name_in(configuration)) for configuration in configurations]
        return unknowns

    def name_in(self, configuration: str) -> str:
        """Return the name of the value or of the individual part of one configuration."""
        return f"{self.name} @ {configuration}"

    def base(self, name: str, configurations: tuple[str, ...] | None, start: float | None = None) -> Unknown:
        """Return the unknown of the value at the references; another start is moved within the bounds."""
        start = self.start if start is None else min(max(start, self.lower), self.upper)
        fields = ("address", "lower", "upper", "scale", "prior", "labels", "multiple", "also")
        values = {field: getattr(self, field) for field in fields}
        return Unknown(**values, start=start, name=name, configurations=configurations)


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """An error of a dimension or material: the diameter of a blank, a modulus, the overhang of a clamping.

    It is fitted in units of its standard deviation, with a standard normal prior. Tolerances with the same name are one
    error in all observations and addresses.

    Raises
    ------
    TypeError, ValueError
        No name, no address, or standard deviations that are zero or not finite.

    Examples
    --------
    >>> from receptance.fit import Tolerance
    >>> modulus = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.02}, relative=True)
    >>> overhang = Tolerance(name="60 mm clamped", moves={"tool.segment[0].length": 1e-4}, configurations="60 mm")
    """

    name: str
    """Name of the error."""
    moves: Mapping[str, float]
    """Addresses, possibly with `segment[*]`, and their standard deviations, in SI units or of the natural logarithm if
    `relative`. A negative number has the opposite sign of the error."""
    relative: bool = False
    """Whether the standard deviations are relative: 0.01 is 1 %."""
    configurations: tuple[str, ...] | None = None
    """Configurations or labels of the observations that have the error, one name or several; by default all that have
    the address."""
    labels: tuple[str, ...] | str | None = None
    """Labels of the observations that have the error, one or several; by default all."""
    start: float = 0.0
    """Start of a fit, in standard deviations."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise TypeError(f"Tolerance: name is {self.name!r}, expected the name of the error")
        owner = f"Tolerance {self.name!r}"
        moves = {address: _checks.number(owner, f"moves[{address!r}]", sd) for address, sd in dict(self.moves).items()}
        if not moves:
            raise ValueError(f"{owner}: moves is empty, expected an address and its standard deviation")
        for address, deviation in moves.items():
            if deviation == 0.0:
                raise ValueError(f"{owner}: the standard deviation of {address} is 0, expected another number")
        configurations, labels = (names_of_configurations(owner, names) for names in (self.configurations, self.labels))
        _checks.set_fields(self, {"moves": moves, "configurations": configurations, "labels": labels})


@dataclass(frozen=True, kw_only=True)
class Move(Unknown):
    """An unknown that changes several parameters together, in addition to other unknowns and errors.

    A parameter v becomes v exp(n u) if `relative`, else v + n u, with the unknown u and the given number n. Examples
    are a relative error of all moduli of a tool, a shift of the boundary between two segments, and the exponent of a
    force level. The address is a free name, and the scale is linear.

    Raises
    ------
    TypeError, ValueError
        As in `Unknown`; no address.

    Examples
    --------
    >>> from receptance.fit import Move
    >>> moves = {"tool.segment[*].youngs_modulus": 1.0}
    >>> modulus = Move(address="tool E", lower=-0.1, upper=0.1, moves=moves, relative=True)
    >>> modulus.start
    0.0
    """

    moves: Mapping[str, float]
    """Addresses, possibly with `segment[*]`, and the numbers n."""
    relative: bool = False
    """Whether the unknown is a natural logarithm."""
    of: str = ""
    """Name of a condition, or an address: n is multiplied by log(condition / reference) in observations that have
    it."""
    reference: float = 1.0
    """Value of this condition without a change."""

    def __post_init__(self) -> None:
        if self.scale is None:
            _checks.set_fields(self, {"scale": "linear"})
        super().__post_init__()
        owner = f"Move {self.address!r}"
        moves = {address: _checks.number(owner, f"moves[{address!r}]", n) for address, n in dict(self.moves).items()}
        if not moves:
            raise ValueError(f"{owner}: moves is empty, expected an address and a number")
        if self.scale != "linear":
            raise ValueError(f"{owner}: scale is {self.scale!r}, expected 'linear'")
        reference = _checks.positive(owner, "reference", self.reference)
        _checks.set_fields(self, {"moves": moves, "reference": reference})

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of the parameters that it changes."""
        return tuple(self.moves)

    @property
    def unit(self) -> str:
        """Empty: its value is a multiple of the numbers in `moves`."""
        return ""


@dataclass(frozen=True)
class Variables:
    """The fitted vector: log10 of the value, or the value, of each unknown."""

    unknowns: tuple[Unknown, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names in the order of the vector."""
        return tuple(unknown.name for unknown in self.unknowns)

    @cached_property
    def logarithmic(self) -> NDArray[np.bool_]:
        """Mask of the variables that are logarithms."""
        return np.array([unknown.scale == "log" for unknown in self.unknowns], dtype=np.bool_)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Lower and upper bounds of the values, `(2, p)`."""
        return np.array([[unknown.lower, unknown.upper] for unknown in self.unknowns]).reshape(-1, 2).T

    @cached_property
    def limits(self) -> NDArray[np.float64]:
        """Lower and upper bounds of the variables, `(2, p)`."""
        return np.array([self.from_values(side) for side in self.bounds])

    @cached_property
    def priors(self) -> NDArray[np.float64]:
        """The priors as residuals a x - b of variables x: rows of the variable's number, a and b, `(k, 3)`."""
        rows = []
        for i, unknown in enumerate(self.unknowns):
            if unknown.prior is not None:
                deviation, mean = unknown.prior.standard_deviation, unknown.prior.mean
                logarithmic = unknown.scale == "log"
                slope, offset = (math.log(10.0), math.log(mean)) if logarithmic else (1.0, mean)
                rows.append((i, slope / deviation, offset / deviation))
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    @cached_property
    def start(self) -> NDArray[np.float64]:
        """The given start."""
        return self.from_values(np.array([unknown.start for unknown in self.unknowns], dtype=np.float64))

    def from_values(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variables of values in SI units."""
        result = values.copy()
        np.log10(values, out=result, where=self.logarithmic)
        return result

    def to_values(self, variables: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values in SI units."""
        result = variables.copy()
        np.power(10.0, variables, out=result, where=self.logarithmic)
        # Ten to the logarithm of a bound may exceed it by rounding.
        return np.clip(result, *self.bounds)

    def vector_of(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Return the variables of values by name, within their bounds; those without a value are at their start."""
        chosen = [float(values.get(u.name, u.start or 0.0)) for u in self.unknowns]
        return self.from_values(np.clip(np.array(chosen, dtype=np.float64), *self.bounds))

    def slopes(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the values with respect to the variables."""
        return np.where(self.logarithmic, values * math.log(10.0), 1.0)

    def draw(self, starts: int, seed: int) -> NDArray[np.float64]:
        """Return start vectors `(starts, p)`: the given one, then a Latin hypercube.

        The hypercube is uniform within the bounds, or normal for an unknown with a prior.
        """
        if starts == 1:
            return self.start[None, :]
        low, high = self.limits
        (rng,) = np.random.default_rng(seed).spawn(1)
        share = rng.uniform(size=(starts - 1, len(self.unknowns)))
        # Not `scipy.stats.qmc`, which takes longer to import than many fits.
        ranks = np.tile(np.arange(1, starts), (len(self.unknowns), 1))
        for rank in ranks:
            rng.shuffle(rank)
        share = (ranks.T - share) / (starts - 1)
        drawn = low + (high - low) * share
        normal = special.ndtri(np.minimum(share, _LARGEST_SHARE))
        numbers, slopes, offsets = self.priors.T
        numbers = numbers.astype(np.intp)
        drawn[:, numbers] = (offsets + normal[:, numbers]) / slopes
        return np.vstack([self.start, np.clip(drawn, low, high)])


def covered(address: str, assembly: Assembly) -> frozenset[str]:
    """Return the parameters of the assembly that match an address, several with `segment[*]`."""
    matches = assembly.matches.get(address)
    if matches is None:
        matches = assembly.matches[address] = _covered(address, assembly.parameters)
    return matches


def _covered(address: str, parameters: tuple[str, ...]) -> frozenset[str]:
    if "[*]" not in address:
        return frozenset((address,) if address in parameters else ())
    pattern = re.compile(re.escape(address).replace(r"\[\*\]", r"\[\d+\]"))
    return frozenset(name for name in parameters if pattern.fullmatch(name))
