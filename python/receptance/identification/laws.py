"""How a parameter goes across configurations: one value, a power of a condition, or a value for each."""

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

_FARTHEST = 8.0
"""Standard deviations beyond which no error of a tolerance is looked for."""


# A diagnosis asks for the same errors in every one of some hundred models.
@lru_cache(maxsize=1 << 12)
def error_of(name: str) -> Unknown:
    """Return the unknown for an error, in standard deviations of it."""
    return Unknown(
        address=name,
        lower=-_FARTHEST,
        upper=_FARTHEST,
        start=0.0,
        scale="linear",
        prior=Prior(mean=0.0, standard_deviation=1.0),
    )


@dataclass(frozen=True, kw_only=True)
class Power:
    """A power law (x / reference)^exponent of a condition, with the exponent to be identified.

    Parameters
    ----------
    of : str
        Name of a condition of the observations ("torque", "drawbar force"), or an address of their assemblies, whose
        value counts as it stands there ("tool.segment[0].length").
    reference : float
        Value of the condition, in SI units, at which the law has the value of its unknown.
    lower, upper : float, optional
        Bounds of the exponent.
    start : float, optional
        Where the first fit starts.
    prior : Prior, optional
        What is known of the exponent beforehand.

    Raises
    ------
    TypeError, ValueError
        A reference that is not above zero, and unusable bounds.
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
        object.__setattr__(self, "reference", reference)
        self.exponent("")

    def exponent(self, name: str) -> Unknown:
        """Return the unknown for the exponent."""
        title = f"{name} ~ {self.of}"
        return Unknown(
            address=title, lower=self.lower, upper=self.upper, start=self.start, scale="linear", prior=self.prior
        )


@dataclass(frozen=True, kw_only=True)
class Law(Unknown):
    """A parameter to be identified, and how it goes across configurations.

    Its value in a configuration is that of the unknown, times its powers of conditions, times an individual part.

    Parameters
    ----------
    address, lower, upper, start, scale, prior, configurations, name
        As in `Unknown`; of the value at the references of the powers.
    powers : Power or sequence of Power, optional
        None for a constant. The exponent is called `<name> ~ <condition>`.
    free : bool, optional
        A value for each configuration, called `<name> @ <configuration>`; bounds, start and prior are the same.
    along : str, optional
        Of a free one: name of a condition. A configuration that took no part in the fit has the value between those
        of its two neighbours in that condition, on a straight line.
    starts : mapping of str to float, optional
        Of a free one: where the first fit starts in some configurations; in the others at `start`.
    individual : float, optional
        Standard deviation of the natural logarithm of the part that every configuration has of its own: 0.05 where
        clamping again changes a stiffness by 5 %. That part is called `<name> @ <configuration>` and is
        counted in these standard deviations. A configuration is one clamping here.
    follows : mapping of str to float, optional
        Further parameters by address that vary with it: they are multiplied by its powers and its individual part,
        raised to the number that is given here. 0.5 with each of two stiffnesses for the term that couples them.

    Raises
    ------
    TypeError, ValueError
        As in `Unknown`; a law that is free and has powers or individual parts.

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
        object.__setattr__(self, "follows", share)
        if self.free and share:
            raise ValueError(f"{owner}: it is free, and what follows it would have no law, expected one of the two")
        powers = (self.powers,) if isinstance(self.powers, Power) else tuple(self.powers)
        for index, power in enumerate(powers):
            if not isinstance(power, Power):
                raise TypeError(f"{owner}: powers[{index}] is {power!r}, expected a Power")
        object.__setattr__(self, "powers", powers)
        object.__setattr__(self, "individual", _checks.not_negative(owner, "individual", self.individual))
        if self.free and (powers or self.individual):
            raise ValueError(f"{owner}: it is free and has powers or individual parts, expected one of the two")
        if not isinstance(self.along, str) or (self.along and not self.free):
            raise ValueError(f"{owner}: along is {self.along!r}, expected the name of a condition, of a free law only")

    @property
    def plain(self) -> bool:
        """Whether it is one number for all observations, and called by its address."""
        return super().plain and not (self.powers or self.free or self.individual)

    def expanded(self, configurations: Sequence[str]) -> list[Unknown]:
        """Return all the unknowns of the law over these configurations."""
        if self.free:
            own = [self.base(self.name_in(one), (one,)) for one in configurations]
            return [
                replace(unknown, start=min(max(self.starts.get(name, start), self.lower), self.upper))
                for name, unknown in zip(configurations, own, strict=True)
                if (start := unknown.start) is not None
            ]
        found = [self.base(self.name, self.configurations)]
        found += [power.exponent(self.name) for power in self.powers]
        if self.individual:
            found += [error_of(self.name_in(one)) for one in configurations]
        return found

    def name_in(self, configuration: str) -> str:
        """Return the name of the value, or of the individual part, of one configuration."""
        return f"{self.name} @ {configuration}"

    def base(self, name: str, configurations: tuple[str, ...] | None) -> Unknown:
        """Return the unknown for the value at the references."""
        fields = ("address", "lower", "upper", "start", "scale", "prior", "multiple", "also")
        given = {field: getattr(self, field) for field in fields}
        return replace(Unknown(**given), name=name, configurations=configurations)


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """An error of a thing: this blank's diameter, that material's modulus, the overhang of this clamping.

    It is fitted as a standard normal number, which counts its standard deviations, with that as its prior. What has
    the same name is one error, in whatever observations and addresses.

    Parameters
    ----------
    name : str
        What the error belongs to.
    moves : mapping of str to float
        Address, perhaps with `segment[*]`, and the standard deviation that the error gives it: in SI units, or of
        the natural logarithm where `relative`. A negative number moves the other way.
    relative : bool, optional
        Whether the standard deviations are shares: 0.01 is 1 %.
    configurations : str or sequence of str, optional
        Only observations of these configurations (or with these labels) have it; by default all that have the address.
    labels : str or sequence of str, optional
        Only observations with these labels have it.

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
            raise TypeError(f"Tolerance: name is {self.name!r}, expected text that says what the error belongs to")
        owner = f"Tolerance {self.name!r}"
        moves = {address: _checks.number(owner, f"moves[{address!r}]", sd) for address, sd in dict(self.moves).items()}
        if not moves:
            raise ValueError(f"{owner}: moves is empty, expected an address and its standard deviation")
        for address, deviation in moves.items():
            if deviation == 0.0:
                raise ValueError(f"{owner}: the standard deviation of {address} is 0, expected something else")
        object.__setattr__(self, "moves", moves)
        object.__setattr__(self, "configurations", listed(owner, self.configurations))
        object.__setattr__(self, "labels", listed(owner, self.labels))


@dataclass(frozen=True, kw_only=True)
class Move(Unknown):
    """An unknown that moves several parameters at once, whatever else they are made of.

    A parameter becomes v exp(n u) where `relative`, else v + n u, with the unknown u and the number n given here; v is
    what it would be without. So one unknown is a share of all moduli of a tool, lengthens one segment as it
    shortens the next, or is the exponent of a force level.

    Parameters
    ----------
    address, lower, upper, start, prior, configurations, name
        As in `Unknown`; the address is a name of your choice here. The value itself is fitted.
    moves : mapping of str to float
        Address, perhaps with `segment[*]`, and how much of the unknown it gets.
    relative : bool, optional
        Whether the unknown is a natural logarithm.
    of : str, optional
        Name of a condition, or an address: n is multiplied by log(condition / reference), where the
        observation has it.
    reference : float, optional
        Value of that condition at which nothing changes.

    Raises
    ------
    TypeError, ValueError
        As in `Unknown`; nothing that is moved.

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
            object.__setattr__(self, "scale", "linear")
        super().__post_init__()
        owner = f"Move {self.address!r}"
        moves = {address: _checks.number(owner, f"moves[{address!r}]", n) for address, n in dict(self.moves).items()}
        if not moves:
            raise ValueError(f"{owner}: moves is empty, expected an address and a number")
        if self.scale != "linear":
            raise ValueError(f"{owner}: scale is {self.scale!r}, expected 'linear'")
        object.__setattr__(self, "moves", moves)
        object.__setattr__(self, "reference", _checks.positive(owner, "reference", self.reference))

    @property
    def reached(self) -> tuple[str, ...]:
        """Addresses that it changes."""
        return tuple(self.moves)

    @property
    def plain(self) -> bool:
        """It never is one number of an assembly."""
        return False
