"""What a cause is: a declared nested change of the one forward model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Literal, get_args

from receptance import _checks
from receptance.diagnosis.model import IndescribableError, Model, UndecidableError
from receptance.identification.laws import Move
from receptance.identification.unknowns import Prior, Unknown

__all__ = ["Cause", "Group", "IndescribableError", "Parameter", "UndecidableError", "Variant", "changed"]

Group = Literal["structure", "measurement"]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One number of a cause.

    Parameters
    ----------
    name : str
        One word.
    unit : str
        SI unit, for people; empty for shares, exponents and logarithms.
    lower, upper : float
        Bounds of the fit.
    typical : float
        An ordinary size, from which one of the fits starts.
    null : float, optional
        Value at which the cause is not there.
    plausible : (float, float), optional
        Range outside which nobody would believe it; by default the bounds.
    secondary : bool, optional
        Whether it only says where or how the cause acts: it means nothing while the other ones are null, and fits
        start from its typical value.
    prior : Prior, optional
        What is known of it beforehand.
    least : float, optional
        Distance from null below which nobody would call it a cause, however well the data show it: beside another
        cause that explains the data it is then left out.
    """

    name: str
    unit: str
    lower: float
    upper: float
    typical: float
    null: float = 0.0
    plausible: tuple[float, float] | None = None
    secondary: bool = False
    prior: Prior | None = None
    least: float = 0.0

    def __post_init__(self) -> None:
        owner = f"Parameter {self.name!r}"
        for name in ("lower", "upper", "typical", "null"):
            object.__setattr__(self, name, _checks.number(owner, name, getattr(self, name)))
        object.__setattr__(self, "least", _checks.not_negative(owner, "least", self.least))
        if not self.lower <= min(self.typical, self.start) or not max(self.typical, self.start) <= self.upper:
            raise ValueError(f"{owner}: typical {self.typical:g} or null {self.null:g} lies outside the bounds")
        if self.plausible is None:
            object.__setattr__(self, "plausible", (self.lower, self.upper))

    @property
    def start(self) -> float:
        """Where a fit begins: null, or the typical value of what is secondary."""
        return self.typical if self.secondary else self.null

    @property
    def one_sided(self) -> bool:
        """Whether its null is a bound."""
        return not self.secondary and self.null in (self.lower, self.upper)

    def believable(self, value: float) -> bool:
        """Return whether a value lies in the plausible range."""
        low, high = self.plausible or (self.lower, self.upper)
        return low <= value <= high

    def unknown(self, address: str, configurations: str | None = None, part: str = "") -> Unknown:
        """Return it as the unknown of an address; `part` tells several of one kind apart."""
        return Unknown(
            address=address,
            lower=self.lower,
            upper=self.upper,
            start=self.start,
            scale="linear",
            prior=self.prior,
            configurations=None if configurations is None else (configurations,),
            name=self._title(configurations, part),
        )

    def move(
        self,
        moves: Mapping[str, float],
        *,
        relative: bool = False,
        configurations: str | None = None,
        of: str = "",
        reference: float = 1.0,
        part: str = "",
    ) -> Move:
        """Return it as an unknown that moves several parameters, see `receptance.identification.Move`."""
        return Move(
            address=self._title(configurations, part),
            lower=self.lower,
            upper=self.upper,
            start=self.start,
            prior=self.prior,
            configurations=None if configurations is None else (configurations,),
            name=self._title(configurations, part),
            moves=moves,
            relative=relative,
            of=of,
            reference=reference,
        )

    def _title(self, configurations: str | None, part: str) -> str:
        return self.name + (f" {part}" if part else "") + (f" @ {configurations}" if configurations else "")


@dataclass(frozen=True, eq=False)
class Variant:
    """One way in which a cause can act: its name, and the model that has it.

    `fresh` says that the data have changed so much that the fit begins anew; `limited` has those parameters of the
    cause that have other plausible ranges in this way of acting; `local` that it acts only where its name says;
    `distant` that it changes so much that it is only tried where the model is not adequate without it;
    `meaning` and `remedy` take the place of the cause's own where this way of acting knows more.
    """

    name: str
    model: Model
    fresh: bool = False
    limited: tuple[Parameter, ...] = ()
    local: bool = False
    distant: bool = False
    meaning: str = ""
    remedy: str = ""

    def of(self, cause: Cause) -> Cause:
        """Return the cause as it is in this way of acting: plausible ranges, meaning and remedy."""
        own = {one.name: one for one in self.limited}
        return replace(
            cause,
            parameters=tuple(own.get(one.name, one) for one in cause.parameters),
            meaning=self.meaning or cause.meaning,
            remedy=self.remedy or cause.remedy,
        )


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Something that the simulation may get wrong.

    Parameters
    ----------
    id : str
        One word.
    group : {"structure", "measurement"}
        Whether it belongs to the thing, and so to all predictions, or to how it was measured.
    parameters : sequence of Parameter
        Its numbers; unknowns of the change are made of these.
    change : callable
        Gets the cause's parameters as a mapping by name, and a `Model`; yields `Variant` after `Variant`, ways in
        which it can act. Raises `UndecidableError` where the data cannot speak about it. It only describes, and
        fits nothing.
    meaning : str
        What it is in the workshop.
    remedy : str
        What to do about it.

    Examples
    --------
    >>> from receptance.diagnosis import CATALOGUE
    >>> CATALOGUE["tool_density"].meaning
    'the tool is heavier or lighter than its material says'
    """

    id: str
    group: Group
    parameters: tuple[Parameter, ...]
    change: Callable[[Mapping[str, Parameter], Model], Iterable[Variant]]
    meaning: str
    remedy: str

    def __post_init__(self) -> None:
        if not isinstance(self.id, str) or not self.id.isidentifier():
            raise ValueError(f"Cause: id is {self.id!r}, expected one word of letters, digits and underscores")
        if self.group not in get_args(Group):
            raise ValueError(
                f"Cause {self.id!r}: group is {self.group!r}, expected one of {', '.join(get_args(Group))}"
            )
        named = tuple(replace(one, name=f"{self.id}.{one.name.split('.')[-1]}") for one in self.parameters)
        object.__setattr__(self, "parameters", named)

    def variants(self, model: Model) -> list[Variant]:
        """Return the ways in which it can act on a model."""
        return list(self.change({one.name.split(".")[1]: one for one in self.parameters}, model))

    def parameter_of(self, unknown: str) -> Parameter:
        """Return the parameter behind an unknown of a variant."""
        return next(one for one in self.parameters if one.name == unknown.split(" ")[0])


def changed(cause: Cause, name: str, model: Model) -> Model:
    """Return other observations as a variant of a cause changes them; unknowns and tolerances go with them.

    A law across configurations, which one configuration alone cannot have, changes no assembly.

    Raises
    ------
    IndescribableError
        The observations have a place or an assembly with which the change cannot be described.
    """
    try:
        variants = cause.variants(model)
    except IndescribableError:
        raise
    except UndecidableError:
        return model
    chosen = [variant for variant in variants if variant.name == name]
    if not chosen and any(v.local for v in variants):
        raise IndescribableError(f"{cause.id} {name}: the assembly has no such place")
    if not chosen and len({str(v.model.observations[0].assembly.parameters) for v in variants}) == 1:
        # Where it acts was named by what was measured there; the structure is the same.
        chosen = variants[:1]
    return replace(chosen[0].model, unknowns=model.unknowns) if chosen else model
