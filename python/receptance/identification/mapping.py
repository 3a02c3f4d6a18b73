"""From the fitted vector to the parameters of each assembly, with derivatives.

A parameter of an assembly is v = b exp(E u) + S u, where u are the values of all unknowns, b is one of them, a mean of
two or the value of the assembly, E holds the logarithms of conditions (the unknown is an exponent) and the standard
deviations of relative errors, S those of absolute ones (the unknown is an error).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.factors import FACTORS
from receptance.identification.laws import Law, Move, Tolerance, error_of
from receptance.identification.residuals import InfeasibleError, Pair, Residual, Unit
from receptance.identification.unknowns import Unknown, covered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["Addresses", "MappedResidual", "Parameters", "Place", "Placed"]


@dataclass(frozen=True)
class Place:
    """What an observation or a prediction is of: an assembly in a configuration under conditions."""

    assembly: Assembly
    configuration: str = ""
    label: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    factors: tuple[str, ...] = ()

    def covered(self, address: str) -> frozenset[str]:
        """Return the parameters of the assembly, or of the observation, that an address stands for."""
        return frozenset((address,)) if address in self.factors else covered(address, self.assembly)

    def value(self, address: str) -> float:
        """Return the value of a parameter as described; those of an observation are zero."""
        return 0.0 if address in self.factors else self.assembly.get(address)

    def among(self, configurations: tuple[str, ...] | None, labels: tuple[str, ...] | str | None = None) -> bool:
        """Return whether it belongs to these configurations, and has one of these labels."""
        if labels is not None and self.label not in labels:
            return False
        return configurations is None or self.configuration in configurations or self.label in configurations

    def condition(self, name: str, owner: str) -> float:
        """Return the value of a condition, or of an address of the assembly."""
        if name in self.conditions:
            value = float(self.conditions[name])
        elif covered(name, self.assembly):
            value = self.assembly.get(name)
        else:
            known = ", ".join(self.conditions) or "none"
            raise ValueError(
                f"{owner}: {self.configuration or self.assembly!r} has no condition {name!r} and no such address; its "
                f"conditions are: {known}"
            )
        if not value > 0.0:
            raise ValueError(f"{owner}: the condition {name!r} is {value:g}, expected more than zero for a power law")
        return value


@dataclass(frozen=True)
class Placed:
    """The parameters of one assembly as functions of all unknowns.

    Attributes
    ----------
    addresses : tuple of str
        What moves, `m` of them; each is one parameter, `segment[*]` is spelled out.
    base : ndarray
        `(m,)` which unknown is the value before errors, -1 for none.
    scale : ndarray
        `(m,)` by how much that unknown is multiplied.
    fixed : ndarray
        `(m,)` value where it is none.
    exponents, shifts : ndarray
        `(m, p)` E and S.
    second, share : ndarray
        `(m,)` another unknown that is added to the value before errors, -1 for none, and how many times: what lies
        between two configurations has part of both.
    """

    addresses: tuple[str, ...]
    base: NDArray[np.intp]
    scale: NDArray[np.float64]
    fixed: NDArray[np.float64]
    exponents: NDArray[np.float64]
    shifts: NDArray[np.float64]
    second: NDArray[np.intp]
    share: NDArray[np.float64]

    def _before(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values before errors."""
        first = np.where(self.base >= 0, self.scale * unknowns[self.base], self.fixed)
        found: NDArray[np.float64] = first + np.where(self.second >= 0, self.share * unknowns[self.second], 0.0)
        return found

    def values(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values of the addresses in SI units, `(m,)`."""
        result: NDArray[np.float64] = (
            self._before(unknowns) * np.exp(self.exponents @ unknowns) + self.shifts @ unknowns
        )
        return result

    def jacobian(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return their derivatives with respect to the values of the unknowns, `(m, p)`."""
        factor = np.exp(self.exponents @ unknowns)
        result = (self._before(unknowns) * factor)[:, None] * self.exponents + self.shifts
        for column, scale in ((self.base, self.scale), (self.second, self.share)):
            own = np.flatnonzero(column >= 0)
            result[own, column[own]] += factor[own] * scale[own]
        return result

    def apply(self, assembly: Assembly, unknowns: NDArray[np.float64]) -> Assembly:
        """Return the assembly with the values of its addresses."""
        values = dict(zip(self.addresses, self.values(unknowns).tolist(), strict=True))
        return assembly.replace({address: value for address, value in values.items() if address not in FACTORS})


class Parameters:
    """All unknowns of a fit, and how they make the parameters of every assembly.

    Parameters
    ----------
    wanted : sequence of Unknown
        Unknowns and laws; none where assemblies have errors alone.
    tolerances : sequence of Tolerance
        Errors.
    places : sequence of Place
        What was observed.

    Attributes
    ----------
    unknowns : tuple of Unknown
        Values and exponents in the order of `wanted`, then errors: the fitted vector.
    count : int
        How many of them are not errors.
    plain : bool
        Whether every unknown is one number for all observations, without priors and errors.

    Raises
    ------
    TypeError, ValueError
        Unknowns or tolerances that no observation has, two unknowns of one parameter, a missing condition.
    """

    def __init__(self, wanted: Sequence[Unknown], tolerances: Sequence[Tolerance], places: Sequence[Place]) -> None:
        self.wanted = tuple(wanted)
        self.tolerances = tuple(tolerances)
        self.notes = self._check(places)
        values: list[Unknown] = []
        errors: dict[str, Unknown] = {}
        for unknown in self.wanted:
            if not isinstance(unknown, Law):
                values.append(unknown)
                continue
            seen = dict.fromkeys(p.configuration for p in places if p.among(unknown.configurations))
            own = [name for name in seen if _has(unknown.address, [p for p in places if p.configuration == name])]
            for one in unknown.expanded(own):
                if unknown.individual and one.name in {f"{unknown.name} @ {name}" for name in own}:
                    errors[one.name] = one
                else:
                    values.append(one)
        for tolerance in self.tolerances:
            errors.setdefault(tolerance.name, error_of(tolerance.name))
        self.unknowns = (*values, *errors.values())
        self.count = len(values)
        names = [unknown.name for unknown in self.unknowns]
        if double := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"the name {double[0]!r} is given to two unknowns; give one of them another name")
        self.plain = not self.tolerances and all(
            unknown.plain and unknown.address not in FACTORS for unknown in self.wanted
        )
        self._index = {name: i for i, name in enumerate(names)}
        self._levels = {one.name: self._levels_of(one, places) for one in self.wanted if isinstance(one, Law)}
        self._placed = [(place, self.at(place)) for place in places]

    def of(self, places: Sequence[Place]) -> list[Placed]:
        """Return the parameters of places; those for which this was made are at hand."""
        known = [*self._placed, *[(None, None)] * (len(places) - len(self._placed))]
        return [
            own if own is not None and place == other else self.at(place)
            for place, (other, own) in zip(places, known, strict=False)
        ]

    def _levels_of(self, law: Law, places: Sequence[Place]) -> dict[str, float]:
        """Return the condition along which a free law goes, of all configurations of the fit."""
        if not law.along:
            return {}
        own = [place for place in places if f"{law.name} @ {place.configuration}" in self._index]
        for place in own:
            if law.along not in place.conditions:
                known = ", ".join(place.conditions) or "none"
                raise ValueError(
                    f"Law {law.address!r}: {place.configuration!r} has no condition {law.along!r}; its conditions are: "
                    f"{known}"
                )
        return {place.configuration: float(place.conditions[law.along]) for place in own}

    @property
    def errors(self) -> tuple[str, ...]:
        """Names of the errors."""
        return tuple(unknown.name for unknown in self.unknowns[self.count :])

    def at(self, place: Place, tolerances: Sequence[Tolerance] | None = None, fresh: list[str] | None = None) -> Placed:
        """Return the parameters of a place as functions of the unknowns.

        Parameters
        ----------
        place : Place
            One that was observed, or another one.
        tolerances : sequence of Tolerance, optional
            Errors of that place; by default those of the fit.
        fresh : list of str, optional
            Is filled with the names of errors that the fit does not know; they follow the unknowns, so that the maps
            are of `p + len(fresh)` numbers, the new ones standard normal and independent.
        """
        index = dict(self._index)
        bases: dict[str, int] = {}
        scales: dict[str, float] = {}
        seconds: dict[str, tuple[int, float]] = {}
        exponents: dict[str, dict[int, float]] = {}
        shifts: dict[str, dict[int, float]] = {}

        def error(name: str) -> int:
            if name not in index:
                if fresh is None:
                    raise ValueError(f"the fit knows no error {name!r}")
                index[name] = len(index)
                fresh.append(name)
            return index[name]

        for unknown in self.wanted:
            if not place.among(unknown.configurations):
                continue
            if isinstance(unknown, Move):
                self._move(unknown, place, exponents if unknown.relative else shifts)
                continue
            own_addresses = dict.fromkeys(sorted(place.covered(unknown.address)), unknown.multiple)
            own_addresses |= {other: n for other, n in unknown.also.items() if place.covered(other)}
            varying: dict[int, float] = {}
            if isinstance(unknown, Law) and own_addresses:
                varying = _varying(unknown, place, index, error)
            for address, multiple in own_addresses.items():
                if isinstance(unknown, Law):
                    exponents.setdefault(address, {}).update(varying)
                    if unknown.free:
                        first, second, share = self._free(unknown, place)
                        bases[address], scales[address] = first, multiple * (1.0 - share)
                        seconds[address] = (second, multiple * share)
                        continue
                bases[address] = index[unknown.name]
                scales[address] = multiple
            for address, power in unknown.follows.items() if varying and isinstance(unknown, Law) else ():
                row = exponents.setdefault(address, {}) if place.covered(address) else {}
                for column, slope in varying.items():
                    row[column] = row.get(column, 0.0) + power * slope
        for tolerance in self.tolerances if tolerances is None else tolerances:
            if not place.among(tolerance.configurations, tolerance.labels):
                continue
            for pattern, deviation in tolerance.moves.items():
                for address in sorted(place.covered(pattern)):
                    table = exponents if tolerance.relative else shifts
                    row = table.setdefault(address, {})
                    column = error(tolerance.name)
                    row[column] = row.get(column, 0.0) + deviation
        addresses = tuple(dict.fromkeys([*bases, *exponents, *shifts]))
        return Placed(
            addresses=addresses,
            base=np.array([bases.get(address, -1) for address in addresses], dtype=np.intp),
            scale=np.array([scales.get(address, 1.0) for address in addresses]),
            fixed=np.array([0.0 if a in bases else place.value(a) for a in addresses]),
            exponents=_matrix(exponents, addresses, len(index)),
            shifts=_matrix(shifts, addresses, len(index)),
            second=np.array([seconds.get(address, (-1, 0.0))[0] for address in addresses], dtype=np.intp),
            share=np.array([seconds.get(address, (-1, 0.0))[1] for address in addresses]),
        )

    def _free(self, law: Law, place: Place) -> tuple[int, int, float]:
        """Return the unknown of a place, or the two between which it lies, and the share of the second one."""
        own = self._index.get(f"{law.name} @ {place.configuration}")
        if own is not None:
            return own, -1, 0.0
        if not law.along:
            raise ValueError(
                f"{law.address} is free in each configuration, and {place.configuration!r} was not among those of the "
                "fit"
            )
        levels = sorted((level, self._index[f"{law.name} @ {name}"]) for name, level in self._levels[law.name].items())
        if law.along not in place.conditions:
            raise ValueError(f"Law {law.address!r}: {place.configuration!r} has no condition {law.along!r}")
        at = float(place.conditions[law.along])
        after = next((i for i, (level, _) in enumerate(levels) if level >= at), 0)
        if levels[after][0] == at:
            return levels[after][1], -1, 0.0
        if after == 0:
            raise ValueError(
                f"{law.address} is known for {law.along!r} from {levels[0][0]:g} to {levels[-1][0]:g}, and "
                f"{place.configuration!r} is at {at:g}"
            )
        (low, first), (high, second) = levels[after - 1], levels[after]
        return first, second, (at - low) / (high - low)

    def _move(self, unknown: Move, place: Place, table: dict[str, dict[int, float]]) -> None:
        column, size = self._index[unknown.name], 1.0
        if unknown.of:
            if unknown.of not in place.conditions and not covered(unknown.of, place.assembly):
                return
            size = math.log(place.condition(unknown.of, f"Move {unknown.name!r}") / unknown.reference)
        for pattern, coefficient in unknown.moves.items():
            for address in sorted(place.covered(pattern)):
                row = table.setdefault(address, {})
                row[column] = row.get(column, 0.0) + size * coefficient

    def _check(self, places: Sequence[Place]) -> list[str]:
        """Return what is to be said of addresses that other assemblies may have; raise for what is wrong."""
        for index, unknown in enumerate(self.wanted):
            if not isinstance(unknown, Unknown):
                raise TypeError(f"unknowns[{index}] is {unknown!r}, expected an Unknown")
        for index, tolerance in enumerate(self.tolerances):
            if not isinstance(tolerance, Tolerance):
                raise TypeError(f"tolerances[{index}] is {tolerance!r}, expected a Tolerance")
        for place in places:
            owner: dict[str, str] = {}
            for unknown in self.wanted:
                for name in place.covered(unknown.address) if place.among(unknown.configurations) else ():
                    if name in owner:
                        raise ValueError(f"the unknowns {owner[name]!r} and {unknown.name!r} are both {name!r}")
                    owner[name] = unknown.name
        known = dict.fromkeys(name for place in places for name in place.assembly.parameters)
        notes: list[str] = []
        Names = tuple[str, ...] | None
        rows: list[tuple[str, tuple[str, ...], Names, Names | str]] = [
            (f"Unknown {one.address!r}", one.reached, one.configurations, None) for one in self.wanted
        ]
        rows += [
            (f"Tolerance {one.name!r}", tuple(one.moves), one.configurations, one.labels) for one in self.tolerances
        ]
        rows += [
            (f"Law {one.address!r}, with what follows it", tuple(one.follows), one.configurations, None)
            for one in self.wanted
            if isinstance(one, Law) and one.follows
        ]
        among: dict[tuple[Names, Names | str], list[Place]] = {}
        for title, addresses, configurations, labels in rows:
            # Most rows are of the same places.
            if (configurations, labels) not in among:
                among[configurations, labels] = [one for one in places if one.among(configurations, labels)]
            there = among[configurations, labels]
            if not there:
                names = ", ".join(dict.fromkeys(p.configuration or p.label or "(no name)" for p in places))
                raise ValueError(
                    f"{title}: no observation is of {', '.join(labels or configurations or ())}; there are {names}"
                )
            missing = [address for address in addresses if not _has(address, there)]
            if missing and len(missing) == len(addresses):
                first = missing[0].split(".", 1)[0] + "."
                near = [name for name in known if name.startswith(first)] or list(known)
                raise ValueError(
                    f"{title}: no observation's assembly has {'it' if len(addresses) == 1 else missing[0]}; there are "
                    f"{', '.join(near)}"
                )
            # Others may have it: an assembly that is held out, or one that is predicted.
            notes += [
                f"{title}: no observation's assembly has {one}; it matters for predictions alone" for one in missing
            ]
        return notes


def _has(address: str, places: Sequence[Place]) -> bool:
    return any(place.covered(address) for place in places)


def _matrix(rows: Mapping[str, Mapping[int, float]], addresses: Sequence[str], width: int) -> NDArray[np.float64]:
    result = np.zeros((len(addresses), width))
    for i, address in enumerate(addresses):
        for column, value in rows.get(address, {}).items():
            result[i, column] = value
    return result


@dataclass(frozen=True)
class Addresses:
    """The addresses that an observation's own residual has for its unknowns, one each."""

    addresses: tuple[str, ...]


class MappedResidual:
    """A residual in the parameters of its assembly, as one in the unknowns of the whole fit."""

    def __init__(self, inner: Residual, placed: Placed) -> None:
        self.inner = inner
        self.unit: Unit = inner.unit
        self.placed = placed
        self._ones = np.ones(len(placed.addresses))

    @property
    def size(self) -> int:
        """Number of residuals."""
        return self.inner.size

    def evaluate(self, values: NDArray[np.float64], slopes: NDArray[np.float64]) -> Pair:
        """Return residuals and their derivatives; see `residuals.Residual`."""
        own = self._own(values)
        residual, slope = self.inner.evaluate(own, self._ones)
        return residual, slope @ (self.placed.jacobian(values) * slopes)

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals alone."""
        return self.inner.value(self._own(values))

    def _own(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        with np.errstate(over="ignore"):
            own = self.placed.values(values)
        if not np.isfinite(own).all():
            raise InfeasibleError("a law or an error leaves the range of numbers")
        return own


def _varying(law: Law, place: Place, index: Mapping[str, int], error: Callable[[str], int]) -> dict[int, float]:
    """Return by column what multiplies a law's value in a place: its powers of conditions and its individual part."""
    found: dict[int, float] = {}
    for power in law.powers:
        ratio = place.condition(power.of, f"Law {law.address!r}") / power.reference
        found[index[f"{law.name} ~ {power.of}"]] = math.log(ratio)
    if law.individual:
        found[error(f"{law.name} @ {place.configuration}")] = law.individual
    return found
