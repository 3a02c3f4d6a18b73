"""Causes: declared changes of the model under diagnosis, their parameters and their variants."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

from receptance import _checks
from receptance.diagnosis.model import IndescribableError, Model, UndecidableError
from receptance.fit.unknowns import Move, Prior, Unknown
from receptance.model.addresses import MotionError

Group = Literal["structure", "measurement"]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of a cause.

    Parameters
    ----------
    name : str
        One word, unique within the cause.
    unit : str
        SI unit, as text; empty for ratios, exponents and logarithms.
    lower, upper : float
        Bounds of the fit.
    typical : float
        A typical size, from which one of the fits starts.
    null : float, optional
        Value at which the cause has no effect.
    plausible : (float, float), optional
        Plausible range; by default the bounds.
    secondary : bool, optional
        Whether it only describes where or how the cause acts. It has no effect while the other parameters are null, and
        fits start from its typical value.
    prior : Prior, optional
        Prior distribution.
    negligible : float, optional
        Distance from null below which the cause is negligible, however well the data show it. Beside another cause
        that explains the data it is then left out.
    ordinary : float, optional
        Distance from null up to which the size is ordinary. With a larger one the cause is named only if no other
        cause acts beside it, because an effect outside the catalogue is easily imitated by two causes.
    cause : str, optional
        Id of the cause, set by `Cause`.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: float
    null: float = 0.0
    plausible: tuple[float, float] = (-math.inf, math.inf)
    secondary: bool = False
    prior: Prior | None = None
    negligible: float = 0.0
    ordinary: float = math.inf
    cause: str = ""

    def __post_init__(self) -> None:
        owner = f"Parameter {self.name!r}"
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ValueError(f"{owner}: expected one word of letters, digits and underscores")
        for name in ("lower", "upper", "typical", "null"):
            object.__setattr__(self, name, _checks.number(owner, name, getattr(self, name)))
        object.__setattr__(self, "negligible", _checks.not_negative(owner, "negligible", self.negligible))
        if not self.lower <= min(self.typical, self.start) or not max(self.typical, self.start) <= self.upper:
            raise ValueError(f"{owner}: typical {self.typical:g} or null {self.null:g} lies outside the bounds")
        try:
            low, high = (float(value) for value in self.plausible)
        except (TypeError, ValueError):
            low, high = math.nan, math.nan
        if not low <= high:
            raise ValueError(f"{owner}: plausible is {self.plausible!r}, expected two numbers, the smaller one first")
        if (low, high) == (-math.inf, math.inf):
            object.__setattr__(self, "plausible", (self.lower, self.upper))

    @property
    def key(self) -> str:
        """Id of the cause and name: `sensor_mass.mass`."""
        return f"{self.cause}.{self.name}"

    @property
    def penalised(self) -> bool:
        """Whether evidence has a penalty for it; a secondary one with a prior is no more free than an error."""
        return not (self.secondary and self.prior)

    @property
    def start(self) -> float:
        """Starting value of a fit: null, or the typical value of a secondary parameter."""
        return self.typical if self.secondary else self.null

    @property
    def one_sided(self) -> bool:
        """Whether its null is a bound."""
        return not self.secondary and self.null in (self.lower, self.upper)

    def at(self, times: float) -> float:
        """Return the value at a multiple of the typical size; a secondary parameter keeps its typical value."""
        if self.secondary:
            return self.typical
        return min(max(self.null + times * (self.typical - self.null), self.lower), self.upper)

    def is_plausible(self, lowest: float, highest: float | None = None) -> bool:
        """Return whether a value, or a part of the interval from a lowest to a highest value, is plausible."""
        low, high = self.plausible
        return low <= (lowest if highest is None else highest) and lowest <= high

    def unknown(self, address: str, configurations: str | None = None, part: str = "", **changes: Any) -> CauseUnknown:
        """Return the parameter as the unknown of an address.

        Parameters
        ----------
        address : str
            As in `receptance.Unknown`.
        configurations : str, optional
            The only configuration that has it; by default all.
        part : str, optional
            A word for its name in the result, where there are several of one kind.
        **changes
            Other arguments of `Unknown`: `lower`, `upper`, `start`, `scale`, `multiple`, `also`.
        """
        return CauseUnknown(
            **{**self._declared(configurations, part), "address": address, "scale": "linear", **changes}
        )

    def move(
        self, moves: Mapping[str, float], *, configurations: str | None = None, part: str = "", **changes: Any
    ) -> CauseMove:
        """Return the parameter as an unknown that moves several model parameters.

        Parameters
        ----------
        moves : mapping of str to float
            As in `receptance.fit.Move`.
        configurations, part
            As in `unknown`.
        **changes
            Other arguments of `Move`: `relative`, `of`, `reference`, `lower`, `upper`, `start`.
        """
        declared = self._declared(configurations, part)
        return CauseMove(**{**declared, "address": declared["name"], "moves": moves, **changes})

    def _declared(self, configurations: str | None, part: str) -> dict[str, Any]:
        name = self.key + (f" {part}" if part else "") + (f" @ {configurations}" if configurations else "")
        return {
            "parameter": self,
            "name": name,
            "lower": self.lower,
            "upper": self.upper,
            "start": self.start,
            "prior": self.prior,
            "configurations": None if configurations is None else (configurations,),
        }


@dataclass(frozen=True, kw_only=True)
class _OfCause:
    """What the unknowns of causes have in addition to others: `parameter` is the one that they represent."""

    parameter: Parameter

    @property
    def unit(self) -> str:
        """SI unit of its value, as declared."""
        return self.parameter.unit


@dataclass(frozen=True, kw_only=True)
class CauseUnknown(_OfCause, Unknown):
    """An unknown that a cause adds."""


@dataclass(frozen=True, kw_only=True)
class CauseMove(_OfCause, Move):
    """An unknown that a cause adds for several model parameters."""


def parameters_of(unknowns: Iterable[Unknown]) -> dict[str, Parameter]:
    """Return the parameters of causes among unknowns, by the names of the unknowns."""
    return {unknown.name: unknown.parameter for unknown in unknowns if isinstance(unknown, _OfCause)}


@dataclass(frozen=True, eq=False)
class Variant:
    """One way in which a cause can act: a change of models.

    Variants of the same name and of causes of the same id are equal.
    """

    name: str
    """Identifies it among the variants of its cause."""
    change: Callable[[Model], Model] = field(repr=False)
    """Returns a model with the cause and its parameters among the unknowns. It gets the model in which the cause acts:
    the one that is diagnosed, with or without other causes, or one of other observations. It raises `UndecidableError`
    where that model cannot have the cause."""
    far: bool = False
    """Whether it differs from the model without it even where its parameters are null, so that the joint has to change
    first."""
    begin: Callable[[Model, Mapping[str, float]], dict[str, float]] | None = field(default=None, repr=False)
    """Returns values of its parameters, by the names of their unknowns, at which a fit starts in place of null. It gets
    the model with the variant and the values of the other unknowns. It is needed where chi-square has many minima."""
    meaning: str = ""
    """What it is; by default the meaning of the cause."""
    remedy: str = ""
    """Remedy for the user; by default that of the cause."""
    choices: int = field(default=1, init=False)
    """Among how many variants the data choose, for which evidence has a penalty; set by `Cause.variants`."""
    cause: Cause = field(init=False, repr=False)
    """The cause; set by `Cause.variants`."""

    def __post_init__(self) -> None:
        if not callable(self.change):
            raise TypeError(f"Variant {self.name!r}: change is {self.change!r}, expected a function of a model")

    @property
    def id(self) -> tuple[str, str]:
        """Id of the cause and name."""
        return self.cause.id, self.name

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Variant) and self.id == other.id

    def __hash__(self) -> int:
        return hash(self.id)

    def of(self, cause: Cause, choices: int = 1) -> Variant:
        """Return it as a variant of a cause."""
        variant = replace(self, meaning=self.meaning or cause.meaning, remedy=self.remedy or cause.remedy)
        object.__setattr__(variant, "cause", cause)
        object.__setattr__(variant, "choices", choices)
        return variant

    def apply(self, model: Model) -> Model:
        """Return a model with the cause, its parameters among the unknowns.

        Raises
        ------
        UndecidableError
            The model cannot have the cause; as `IndescribableError` if it has no such place, or no such elements.
        TypeError
            A new unknown is not made of a `Parameter`.
        """
        try:
            extended = self.change(model)
        except MotionError as error:
            raise IndescribableError(error.reason) from error
        before = {unknown.name for unknown in model.unknowns}
        for unknown in extended.unknowns:
            if unknown.name not in before and not isinstance(unknown, _OfCause):
                raise TypeError(
                    f"Cause {self.cause.id!r}: the unknown {unknown.name!r} of {self.name!r} is not made of one of its "
                    "parameters, expected Parameter.unknown(...) or Parameter.move(...)"
                )
        return extended


@dataclass(frozen=True, kw_only=True)
class Cause:
    """A possible error of a simulation.

    Parameters
    ----------
    id : str
        One word.
    group : {"structure", "measurement"}
        Whether it belongs to the structure, and so to all predictions, or to the measurement.
    parameters : sequence of Parameter
        Its parameters; the unknowns of its variants are made of these.
    change : callable
        Gets the parameters as a mapping by name, and a `Model`; yields a `Variant` for each way of acting. Raises
        `UndecidableError` where the data cannot show the cause. It only lists the variants; they change models.
    meaning : str
        The cause in the words of the workshop.
    remedy : str
        Remedy for the user.
    remedy_in_spindle : str, optional
        Remedy for a holder in a spindle; by default the same.
    title : str, optional
        Name in texts and figures; by default the id with spaces.
    changes_data : bool, optional
        Whether it changes the measured data, so that the model is fitted from its own starting values.
    large : bool, optional
        Whether the change is so large that it is tried only where the model is inadequate.
    unspecific : bool, optional
        Whether other errors of a structure have a similar effect. With a model discrepancy it is not reported.
    anywhere : bool, optional
        Whether its variants are places all over the structure, none more likely than another. Evidence then has a
        penalty for the choice among them.
    contains : sequence of str, optional
        Ids of causes that are special cases of it. An alternative raises no doubt about these.

    Raises
    ------
    ValueError
        An id that is not one word, or an unknown group.

    Examples
    --------
    >>> from receptance.diagnosis import CATALOGUE
    >>> CATALOGUE["tool_density"].meaning
    'the tool is heavier or lighter than its material implies'
    """

    id: str
    parameters: tuple[Parameter, ...]
    change: Callable[[Mapping[str, Parameter], Model], Iterable[Variant]]
    meaning: str
    remedy: str
    remedy_in_spindle: str = ""
    title: str = ""
    group: Group = "structure"
    changes_data: bool = False
    large: bool = False
    unspecific: bool = False
    anywhere: bool = False
    contains: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.id, str) or not self.id.isidentifier():
            raise ValueError(f"Cause: id is {self.id!r}, expected one word of letters, digits and underscores")
        if self.group not in get_args(Group):
            raise ValueError(
                f"Cause {self.id!r}: group is {self.group!r}, expected one of {', '.join(get_args(Group))}"
            )
        object.__setattr__(self, "title", self.title or self.id.replace("_", " "))
        object.__setattr__(self, "parameters", tuple(replace(one, cause=self.id) for one in self.parameters))

    def variants(self, model: Model) -> list[Variant]:
        """Return the ways in which it can act on a model.

        Raises
        ------
        UndecidableError
            The data cannot show it.
        """
        variants = list(self.change({parameter.name: parameter for parameter in self.parameters}, model))
        return [variant.of(self, len(variants) if self.anywhere else 1) for variant in variants]

    def extensions(self, model: Model) -> list[tuple[Variant, Model]]:
        """Return the variants that a model can have, each with the model that it gives.

        Raises
        ------
        UndecidableError
            The data cannot show it, or the model can have none of its variants; then for the reason of the first.
        """
        extended: list[tuple[Variant, Model]] = []
        reason: UndecidableError | None = None
        for variant in self.variants(model):
            try:
                extended.append((variant, variant.apply(model)))
            except UndecidableError as error:
                reason = reason or error
        if reason is not None and not extended:
            raise reason
        return extended


def extend(model: Model, variants: Iterable[Variant]) -> Model:
    """Return the model with causes and their parameters; raises as `Variant.apply`."""
    for variant in variants:
        model = variant.apply(model)
    return model


def transfer(model: Model, variants: Iterable[Variant]) -> Model:
    """Return a model of observations that were not fitted as causes change them, without their parameters.

    Observations that cannot have a cause, a joint for example, are as they are.

    Raises
    ------
    IndescribableError
        The observations have a place or an assembly with which a change cannot be described.
    """
    for variant in variants:
        try:
            model = replace(variant.apply(model), unknowns=model.unknowns)
        except IndescribableError:
            raise
        except UndecidableError:
            continue
    return model
