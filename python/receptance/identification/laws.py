"""Relations of parameters between configurations, tolerances, and combinations of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from receptance import _checks
from receptance.identification.unknowns import Prior, Unknown, listed

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Law", "Move", "Power", "Tolerance", "error_of"]

_ERROR_BOUND = 8.0
"""Bounds of an error of a tolerance, in standard deviations."""


# A diagnosis needs the same errors in some hundred models.
@lru_cache(maxsize=1 << 12)
def error_of(name: str) -> Unknown:
    """Return the unknown of an error, in its standard deviations."""
    return Unknown(
        address=name,
        lower=-_ERROR_BOUND,
        upper=_ERROR_BOUND,
        start=0.0,
        scale="linear",
        prior=Prior(mean=0.0, standard_deviation=1.0),
    )


@dataclass(frozen=True, kw_only=True)
class Power:
    """A power law (x / reference)^exponent of a condition, with an unknown exponent.

    Parameters
    ----------
    of : str
        Name of a condition of the observations ("torque", "drawbar force"), or an address of their assemblies
        ("tool.segment[0].length").
    reference : float
        Value of the condition in SI units at which the parameter equals its unknown.
    lower, upper : float, optional
        Bounds of the exponent.
    start : float, optional
        Start of the first fit.
    prior : Prior, optional
        Prior of the exponent.

    Raises
    ------
    TypeError, ValueError
        A reference of zero or less, or invalid bounds.
    """

    of: str
    reference: float
    lower: float = -4.0
    upper: float = 4.0
    start: float = 0.0
    prior: Prior | None = None

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

    The value in a configuration is that of the unknown, times powers of conditions, times an individual part.

    Parameters
    ----------
    address, lower, upper, start, scale, prior, configurations, name
        As in `Unknown`; they refer to the value at the references of the powers.
    powers : Power or sequence of Power, optional
        Powers of conditions. Their exponents are called `<name> ~ <condition>`.
    free : bool, optional
        Whether each configuration has its own value, called `<name> @ <configuration>`, with the same bounds, start and
        prior.
    along : str, optional
        Name of a condition, for a free law. A configuration that was not fitted has the value that is interpolated
        linearly between its two neighbours in this condition.
    starts : mapping of str to float, optional
        Starts of a free law in some configurations; the others start at `start`.
    individual : float, optional
        Standard deviation of the natural logarithm of an individual factor of every configuration: 0.05 if the
        stiffness varies by 5 % between clampings. The factor is called `<name> @ <configuration>` and is counted in
        these standard deviations. A configuration is one clamping here.
    follows : mapping of str to float, optional
        Further parameters by address that vary in proportion: they are multiplied by the powers and the individual
        factor, raised to the given number. The number is 0.5 with each of two stiffnesses for their coupling term.

    Raises
    ------
    TypeError, ValueError
        As in `Unknown`; a free law with powers, an individual part or following parameters.

    Examples
    --------
    >>> from receptance.identification import Law, Power
    >>> law = Law(address="joint.k_y", lower=1e6, upper=1e10, powers=Power(of="torque", reference=40.0))
    >>> [unknown.name for unknown in law.expanded(["20 Nm", "40 Nm"])]
    ['joint.k_y', 'joint.k_y ~ torque']
    """

    powers: tuple[Power, ...] = ()
    free: bool = False
    along: str = ""
    starts: Mapping[str, float] = field(default_factory=dict)
    individual: float = 0.0
    follows: Mapping[str, float] = field(default_factory=dict)

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
            own = [self.base(self.name_in(configuration), (configuration,)) for configuration in configurations]
            return [
                replace(unknown, start=min(max(self.starts.get(name, start), self.lower), self.upper))
                for name, unknown in zip(configurations, own, strict=True)
                if (start := unknown.start) is not None
            ]
        found = [self.base(self.name, self.configurations)]
        found += [power.exponent(self.name) for power in self.powers]
        if self.individual:
            found += [error_of(self.name_in(configuration)) for configuration in configurations]
        return found

    def name_in(self, configuration: str) -> str:
        """Return the name of the value or of the individual part of one configuration."""
        return f"{self.name} @ {configuration}"

    def base(self, name: str, configurations: tuple[str, ...] | None) -> Unknown:
        """Return the unknown of the value at the references."""
        fields = ("address", "lower", "upper", "start", "scale", "prior", "multiple", "also")
        given = {field: getattr(self, field) for field in fields}
        return replace(Unknown(**given), name=name, configurations=configurations)


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """An error of a dimension or material: the diameter of a blank, a modulus, the overhang of a clamping.

    It is fitted in units of its standard deviation, with a standard normal prior. Tolerances with the same name are one
    error in all observations and addresses.

    Parameters
    ----------
    name : str
        Name of the error.
    moves : mapping of str to float
        Addresses, possibly with `segment[*]`, and their standard deviations, in SI units or of the natural logarithm if
        `relative`. A negative number has the opposite sign of the error.
    relative : bool, optional
        Whether the standard deviations are relative: 0.01 is 1 %.
    configurations : str or sequence of str, optional
        Configurations or labels of the observations that have the error; by default all that have the address.
    labels : str or sequence of str, optional
        Labels of the observations that have the error.

    Raises
    ------
    TypeError, ValueError
        No name, no address, or standard deviations that are zero or not finite.

    Examples
    --------
    >>> from receptance.identification import Tolerance
    >>> modulus = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.02}, relative=True)
    >>> overhang = Tolerance(name="60 mm clamped", moves={"tool.segment[0].length": 1e-4}, configurations="60 mm")
    """

    name: str
    moves: Mapping[str, float]
    relative: bool = False
    configurations: tuple[str, ...] | None = None
    labels: tuple[str, ...] | str | None = None

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
        configurations, labels = (listed(owner, names) for names in (self.configurations, self.labels))
        _checks.set_fields(self, {"moves": moves, "configurations": configurations, "labels": labels})


@dataclass(frozen=True, kw_only=True)
class Move(Unknown):
    """An unknown that changes several parameters together, in addition to other unknowns and errors.

    A parameter v becomes v exp(n u) if `relative`, else v + n u, with the unknown u and the given number n. Examples
    are a relative error of all moduli of a tool, a shift of the boundary between two segments, and the exponent of a
    force level.

    Parameters
    ----------
    address, lower, upper, start, prior, configurations, name
        As in `Unknown`, but the address is a free name. The scale is linear.
    moves : mapping of str to float
        Addresses, possibly with `segment[*]`, and the numbers n.
    relative : bool, optional
        Whether the unknown is a natural logarithm.
    of : str, optional
        Name of a condition, or an address: n is multiplied by log(condition / reference) in observations that have it.
    reference : float, optional
        Value of this condition without a change.

    Raises
    ------
    TypeError, ValueError
        As in `Unknown`; no address.

    Examples
    --------
    >>> from receptance.identification import Move
    >>> moves = {"tool.segment[*].youngs_modulus": 1.0}
    >>> modulus = Move(address="tool E", lower=-0.1, upper=0.1, moves=moves, relative=True)
    >>> modulus.start
    0.0
    """

    moves: Mapping[str, float]
    relative: bool = False
    of: str = ""
    reference: float = 1.0

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
