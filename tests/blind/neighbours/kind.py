"""What a neighbour of the catalogue is: an ordinary error, how it is drawn, and what it changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from blind.generator import Bench, Nominal, Record
from blind.generator.effects import Numbers, Where
from blind.generator.records import Estimate, Setup, Signal

GROUPS = ("measurement", "description", "clamping", "file")
Structure = Callable[[Numbers, Where], None]
"""Changes the true numbers of one record."""
Analysis = Callable[[Estimate, Numbers, Where], Estimate]
"""Returns what the analyser, or the program that writes the file, makes of a record; with its true numbers."""
Hits = Callable[[np.random.Generator, int, Signal, Signal, Where], tuple[Signal, Signal]]
"""Returns force and response of a hit as they are recorded, from its number and from what both channels should have."""
Act = Callable[["Draw"], "Change"]


@dataclass(frozen=True, kw_only=True)
class Change:
    """What an error changes; what is not mentioned stays as it is."""

    common: Mapping[str, float] = field(default_factory=dict)
    """Numbers of the bench and of its description that the error needs: a sensor, flutes."""
    describe: Callable[[Nominal], Nominal] | None = None
    structure: Structure | None = None
    setup: Callable[[Setup, Where], Setup] | None = None
    hits: Hits | None = None
    analysis: Analysis | None = None
    files: Callable[[list[Record]], list[Record]] | None = None
    """Changes the finished records: which file is whose."""


@dataclass(frozen=True)
class Draw:
    """From what an error is drawn: random numbers, its size, and the bench that it befalls."""

    rng: np.random.Generator
    u: float
    bench: Bench

    @property
    def numbers(self) -> Mapping[str, float]:
        """Numbers of the bench as they are written down."""
        return self.bench.nominal.numbers

    @property
    def names(self) -> list[str]:
        """Names of the configurations."""
        return [c.name for c in self.bench.nominal.configurations]

    @property
    def shortest(self) -> float:
        """The shortest overhang in m."""
        return min(c.overhang for c in self.bench.nominal.configurations)

    @property
    def upper(self) -> float:
        """The higher force level in N."""
        return max(self.bench.truth.setups)

    def sign(self) -> float:
        """Return -1 or 1."""
        return float(self.rng.choice([-1.0, 1.0]))

    def within(self, low: float, high: float) -> float:
        """Return a number between two others."""
        return float(self.rng.uniform(low, high))

    def configuration(self) -> str:
        """Return the name of a configuration."""
        return str(self.rng.choice(self.names))

    def record(self) -> Callable[[Where], bool]:
        """Return what is true of one record only, of the first plane."""
        name, level = self.configuration(), float(self.rng.choice(list(self.bench.truth.setups)))
        return lambda where: (where.configuration, where.level, where.plane) == (name, level, 1)

    def order(self) -> dict[str, float]:
        """Return when each configuration was measured, from 0 to 1; the order is not that of the overhangs."""
        count = len(self.names)
        return dict(zip(map(str, self.rng.permutation(self.names)), np.linspace(0.0, 1.0, count), strict=True))


@dataclass(frozen=True)
class Kind:
    """One kind of ordinary error."""

    id: str
    group: str
    text: str
    """What happened, in one sentence."""
    draw: Act
    right: tuple[str, ...] = ()
    """Ids of causes that a user would accept, because following their remedy corrects the error or finds it."""
    sized: bool = True
    """Whether the size runs from 0, no change; otherwise the error is there or it is not, and the size is 1."""
    slight: str = ""
    """Why records with the error at its full size may agree with the model as well as those without, if so."""


def restated(nominal: Nominal, numbers: Mapping[str, float]) -> Nominal:
    """Return a description with other numbers; a sensor without mass is left out."""
    merged = {**nominal.numbers, **numbers}
    kept = {name: value for name, value in merged.items() if value or name != "sensor.mass"}
    return replace(nominal, numbers=kept)


def stated(**numbers: float) -> Callable[[Nominal], Nominal]:
    """Return what states other numbers than the true ones; dots are written as two underscores."""
    names = {name.replace("__", "."): value for name, value in numbers.items()}
    return lambda nominal: restated(nominal, names)


def patch(name: str, part: str, start: float, end: float, **fields: float) -> dict[str, float]:
    """Return numbers of another section on the tool or on the holder."""
    return _numbered("patch", name, part, start=start, end=end, **fields)


def point(name: str, part: str, place: float, **fields: float) -> dict[str, float]:
    """Return numbers of a body on the tool or on the holder."""
    return _numbered("point", name, part, place=place, **fields)


def _numbered(kind: str, name: str, part: str, **fields: float) -> dict[str, float]:
    fields = {"part": float(part == "holder"), **fields}
    return {f"{kind}.{name}.{field_}": float(value) for field_, value in fields.items()}


def added(numbers: Mapping[str, float]) -> Structure:
    """Return what adds numbers to those of every record."""

    def act(p: Numbers, where: Where) -> None:
        p.update(numbers)

    return act


def times(factors: Mapping[str, float], only: Callable[[Where], bool] | None = None) -> Structure:
    """Return what multiplies numbers, perhaps of some records only."""

    def act(p: Numbers, where: Where) -> None:
        if only is None or only(where):
            for name, factor in factors.items():
                p[name] *= factor

    return act


def in_configuration(name: str) -> Callable[[Where], bool]:
    """Return what is true of the records of one configuration."""
    return lambda where: where.configuration == name


def filtered(
    response: Callable[[NDArray[np.float64]], NDArray[np.inexact] | float],
    only: Callable[[Where], bool] | None = None,
) -> Analysis:
    """Return what multiplies the FRF by a function of the frequency in Hz, perhaps of some records only."""

    def act(e: Estimate, p: Numbers, where: Where) -> Estimate:
        if only is not None and not only(where):
            return e
        return replace(e, receptance=e.receptance * response(e.frequency_hz))

    return act
