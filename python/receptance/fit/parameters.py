"""The map from unknowns to parameters of the assemblies, with its Jacobian.

A parameter of an assembly is v = b exp(E u) + S u. Here u are the values of all unknowns, and b is one of them, a
weighted mean of two, or the value of the assembly. E contains logarithms of conditions, for exponents, and standard
deviations of relative errors; S contains standard deviations of absolute errors.

A measured receptance is H(w - i sigma) (1 + sigma / (i w))^q exp(g - i w tau), with the parameters of its measuring
chain: a calibration gain exp(g), a delay tau between the channels, and the rate sigma of an exponential window on both.
The window acts on the recorded quantity; software that ignores it divides by (i w)^q instead of (i w + sigma)^q, where
q is 2 for accelerations, 1 for velocities and 0 for displacements. Stated frequencies that are too high by d give
H(w - d) ((w - d) / w)^q. Amplifiers and filters add an exponent a and a slope b of the level, a constant phase p, a low
pass of first order with the time constant T and a high pass with the corner c:
(w / w0)^a exp(b w + i p) / (1 + i w T) / (1 + c / (i w)), with w0 at 1 kHz. A negative T or c is a filter in the
channel of the force, with its inverse.
"""

from __future__ import annotations

import copy
import math
from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.fit.unknowns import Law, Move, Tolerance, Unknown, as_unknowns, covered, error_of
from receptance.model.assembly import Assembly

LOG_GAIN = "observation.log_gain"
"""Natural logarithm of measured over true magnitude."""
DELAY = "observation.delay"
"""Delay of the channel of the response in s."""
DECAY_RATES = {
    "observation.decay_rate": 2,
    "observation.decay_rate_of_velocity": 1,
    "observation.decay_rate_of_displacement": 0,
}
"""Rates in 1/s of an exponential window on both channels, and the number of integrations of the recorded quantity."""
END = "observation.end"
"""Time in s after the hit at which a truncated record ended."""
FREQUENCY_OFFSETS = {
    "observation.frequency_offset": 2,
    "observation.frequency_offset_of_velocity": 1,
    "observation.frequency_offset_of_displacement": 0,
}
"""By how many Hz the stated frequencies are too high, and the number of integrations of the recorded quantity."""
LEVEL_EXPONENT = "observation.level_exponent"
"""Exponent of the frequency in the level."""
LEVEL_SLOPE = "observation.level_slope"
"""Slope in s of the natural logarithm of the level over the angular frequency."""
PHASE = "observation.phase"
"""Angle in rad by which the response leads at all frequencies."""
LOW_PASS = "observation.low_pass"
"""Time constant in s of a low pass of first order."""
HIGH_PASS = "observation.high_pass"
"""Corner in rad/s of a high pass of first order."""
FACTORS = (
    LOG_GAIN,
    DELAY,
    *DECAY_RATES,
    END,
    *FREQUENCY_OFFSETS,
    LEVEL_EXPONENT,
    LEVEL_SLOPE,
    PHASE,
    LOW_PASS,
    HIGH_PASS,
)
"""Parameters of the measuring chain, in the order of the core; zero unless they are fitted."""


@dataclass(frozen=True)
class Site:
    """An assembly in a configuration under conditions, observed or predicted."""

    assembly: Assembly
    configuration: str = ""
    label: str = ""
    conditions: Mapping[str, float] = field(default_factory=dict)
    factors: tuple[str, ...] = ()

    def covered(self, address: str) -> frozenset[str]:
        """Return the parameters of the assembly or of the observation that match an address."""
        return frozenset((address,)) if address in self.factors else covered(address, self.assembly)

    def value(self, address: str) -> float:
        """Return the value of a parameter of the assembly; parameters of an observation are zero."""
        return 0.0 if address in self.factors else self.assembly.get(address)

    def among(self, configurations: tuple[str, ...] | None, labels: tuple[str, ...] | str | None = None) -> bool:
        """Return whether configuration or label is among the configurations, and the label among the labels."""
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
            raise ValueError(
                f"{owner}: {self.configuration or self.assembly!r} has no condition {name!r} and no such address; its "
                f"conditions are: {', '.join(self.conditions) or 'none'}"
            )
        if not value > 0.0:
            raise ValueError(f"{owner}: the condition {name!r} is {value:g}, expected more than zero for a power law")
        return value


_SparseRows = dict[str, dict[int, float]]
"""Coefficients by address and column."""


class _Parts(NamedTuple):
    """Values of the parameters b exp(E u) + S u, each `(m,)`: exp(E u), b exp(E u) and S u."""

    factor: NDArray[np.float64]
    scaled: NDArray[np.float64]
    shifts: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ParameterMap:
    """The parameters of one assembly as functions of all unknowns."""

    addresses: tuple[str, ...]
    """The `m` variable parameters; `segment[*]` is expanded."""
    fixed: NDArray[np.float64]
    """`(m,)` value of b without an unknown; zero with one."""
    multiples: NDArray[np.float64]
    """`(m, p)` factors of the unknowns in b, at most two: two neighbouring configurations are interpolated."""
    exponents: NDArray[np.float64]
    """`(m, p)` E."""
    shifts: NDArray[np.float64]
    """`(m, p)` S."""

    @classmethod
    def plain(cls, assembly: Assembly, addresses: Sequence[str]) -> ParameterMap:
        """Return the parameters of addresses, each an unknown; the assemblies may lack some of them."""
        numbers = {name: i for i, address in enumerate(addresses) for name in sorted(covered(address, assembly))}
        multiples = np.eye(len(addresses))[list(numbers.values())]
        none = np.zeros_like(multiples)
        return cls(tuple(numbers), np.zeros(len(numbers)), multiples, none, none)

    @classmethod
    def linear(cls, addresses: Sequence[str], values: NDArray[np.float64], slopes: NDArray[np.float64]) -> ParameterMap:
        """Return parameters `values + slopes @ unknowns`."""
        none = np.zeros_like(slopes)
        return cls(tuple(addresses), values, none, none, slopes)

    @cached_property
    def bases(self) -> NDArray[np.intp]:
        """`(m, 2)` indices of the unknowns in b; -1 for none."""
        rows, columns = np.nonzero(self.multiples)
        first, last = np.full((2, len(self.addresses)), -1)
        first[rows[::-1]], last[rows] = columns[::-1], columns
        return np.column_stack([first, np.where(last == first, -1, last)])

    @cached_property
    def _is_based(self) -> NDArray[np.bool_]:
        """`(m,)` mask of the parameters with an unknown in b."""
        mask: NDArray[np.bool_] = np.any(self.multiples, axis=1)
        return mask

    @cached_property
    def based(self) -> frozenset[str]:
        """Addresses with an unknown in b."""
        return frozenset(
            name for name, is_based in zip(self.addresses, self._is_based.tolist(), strict=True) if is_based
        )

    @cached_property
    def table(self) -> NDArray[np.float64]:
        """`(m, 4 + 2 p)` rows of the core: base, its factor or value, second, share, exponents and shifts."""
        rows, (first, second) = np.arange(len(self.addresses)), self.bases.T
        padded = np.column_stack([self.multiples, np.zeros(rows.size)])
        value = np.where(first >= 0, padded[rows, first], self.fixed)
        columns = [first, value, second, padded[rows, second], self.exponents, self.shifts]
        return np.ascontiguousarray(np.column_stack(columns), dtype=np.float64)

    def values(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values of the addresses in SI units, `(m,)`."""
        _, scaled, shifts = self.parts(unknowns)
        return scaled + shifts

    def jacobian(self, unknowns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return their derivatives with respect to the values of the unknowns, `(m, p)`."""
        factor, scaled, _ = self.parts(unknowns)
        result: NDArray[np.float64] = factor[:, None] * self.multiples + scaled[:, None] * self.exponents + self.shifts
        return result

    def widened(self, count: int) -> ParameterMap:
        """Return the same functions of more unknowns, `count` of them, of which the further ones have no effect."""
        more = ((0, 0), (0, count - self.exponents.shape[1]))
        matrices = (np.pad(matrix, more) for matrix in (self.multiples, self.exponents, self.shifts))
        return ParameterMap(self.addresses, self.fixed, *matrices)

    def parts(self, unknowns: NDArray[np.float64]) -> _Parts:
        """Return the parts of the values of the addresses."""
        factor: NDArray[np.float64] = np.exp(self.exponents @ unknowns)
        return _Parts(factor, (self.fixed + self.multiples @ unknowns) * factor, self.shifts @ unknowns)

    def around(self, more: ParameterMap, parts: _Parts) -> tuple[ParameterMap, NDArray[np.float64]]:
        """Return the parameters of `more`, as of `joined`, as functions of its unknowns, where these have some values.

        `parts` are those of this map at its own unknowns. The functions are without the shifts by these, which are
        returned as well.
        """
        rows = np.array([self.numbers.get(address, -1) for address in more.addresses], dtype=np.intp)
        shared = rows >= 0
        factor, fixed, shifts = np.ones(rows.size), more.fixed.copy(), np.zeros(rows.size)
        factor[shared], fixed[shared], shifts[shared] = (part[rows[shared]] for part in parts)
        fixed[more._is_based] = 0.0
        return replace(more, fixed=fixed, multiples=more.multiples * factor[:, None]), shifts

    def joined(self, more: ParameterMap, at: int) -> ParameterMap:
        """Return the functions of further unknowns too, which are inserted before the unknown of index `at`.

        `more` are the parameters of the same assembly as functions of the further unknowns alone. It has no base for a
        parameter that has one already.
        """
        count = more.exponents.shape[1]
        fresh = [i for i, address in enumerate(more.addresses) if address not in self.numbers]
        size = len(self.addresses) + len(fresh)
        rows = np.array([self.numbers.get(address, -1) for address in more.addresses], dtype=np.intp)
        rows[fresh] = np.arange(len(self.addresses), size)
        fixed = np.concatenate([self.fixed, more.fixed[fresh]])
        fixed[rows[more._is_based]] = 0.0

        def matrix(before: NDArray[np.float64], further: NDArray[np.float64]) -> NDArray[np.float64]:
            result = np.zeros((size, before.shape[1] + count))
            result[: len(before), :at] = before[:, :at]
            result[: len(before), at + count :] = before[:, at:]
            result[rows, at : at + count] = further
            return result

        return ParameterMap(
            addresses=(*self.addresses, *(more.addresses[i] for i in fresh)),
            fixed=fixed,
            multiples=matrix(self.multiples, more.multiples),
            exponents=matrix(self.exponents, more.exponents),
            shifts=matrix(self.shifts, more.shifts),
        )

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Row of each address."""
        return {address: i for i, address in enumerate(self.addresses)}

    def apply(self, assembly: Assembly, unknowns: NDArray[np.float64]) -> Assembly:
        """Return the assembly with the values of its addresses."""
        values = dict(zip(self.addresses, self.values(unknowns).tolist(), strict=True))
        return assembly.replace({address: value for address, value in values.items() if address not in FACTORS})


class Parameters:
    """All unknowns of a fit, and their map to the parameters of every assembly.

    `unknowns`, the fitted vector, are the values and exponents in the order of `given`, `count` in number, then the
    errors. There is a site for each observation. Unknowns or tolerances without an observation, two unknowns of one
    parameter and a missing condition are a TypeError or ValueError.
    """

    def __init__(
        self, unknowns: Sequence[Unknown], tolerances: Tolerance | Sequence[Tolerance], sites: Sequence[Site]
    ) -> None:
        self.given = as_unknowns(unknowns, least=0)
        self.tolerances = _checks.items("tolerances", tolerances, Tolerance, least=0)
        told_apart = self._told_apart
        keys = [_key(site, told_apart) for site in sites]
        # Records of one configuration have the same parameters, unless an unknown depends on a label or a condition.
        different = dict(zip(keys, sites, strict=True))
        self.notes = self._check(list(different.values()))
        values: list[Unknown] = []
        errors: dict[str, Unknown] = {}
        for unknown in self.given:
            if not isinstance(unknown, Law):
                values.append(unknown)
                continue
            having = [
                site
                for site in sites
                if site.among(unknown.configurations, unknown.labels) and site.covered(unknown.address)
            ]
            configurations = list(dict.fromkeys(site.configuration for site in having))
            expanded = unknown.expanded(configurations)
            # The individual parts are last, one for each configuration.
            count = len(expanded) - (len(configurations) if unknown.individual else 0)
            values += expanded[:count]
            errors |= {error.name: error for error in expanded[count:]}
        for tolerance in self.tolerances:
            errors.setdefault(tolerance.name, error_of(tolerance.name, tolerance.start))
        self.unknowns = (*values, *errors.values())
        self.count = len(values)
        names = [unknown.name for unknown in self.unknowns]
        if double := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"the name {double[0]!r} is given to two unknowns; give one of them another name")
        self._index = {name: i for i, name in enumerate(names)}
        self._levels = {law.name: self._levels_of(law, sites) for law in self.given if isinstance(law, Law)}
        maps = {key: self.at(site) for key, site in different.items()}
        self._maps = [(site, maps[key]) for key, site in zip(keys, sites, strict=True)]

    def plus(self, more: Sequence[Unknown]) -> Parameters:
        """Return the parameters with more unknowns after the given ones; only these are checked and mapped."""
        if not more:
            return self
        further = self.further(more)
        if further is None:
            return Parameters((*self.given, *more), self.tolerances, [site for site, _ in self._maps])
        result = copy.copy(self)
        result.given = (*self.given, *more)
        result.notes = [*self.notes, *further.notes]
        result.unknowns = (*self.unknowns[: self.count], *further.unknowns, *self.unknowns[self.count :])
        result.count = self.count + further.count
        result._index = {unknown.name: i for i, unknown in enumerate(result.unknowns)}
        pairs = [(before, after) for (_, before), (_, after) in zip(self._maps, further._maps, strict=True)]
        maps = {pair: pair[0].joined(pair[1], self.count) for pair in dict.fromkeys(pairs)}
        result._maps = [(site, maps[pair]) for (site, _), pair in zip(self._maps, pairs, strict=True)]
        return result

    def further(self, more: Sequence[Unknown]) -> Parameters | None:
        """Return the parameters of the same sites as functions of more unknowns alone.

        None is returned where these are laws, or not independent of the given unknowns, which may be an error. The
        unknowns are checked as by the constructor.
        """
        if any(isinstance(unknown, Law) for unknown in more):
            return None
        result = Parameters(more, (), [site for site, _ in self._maps])
        pairs = zip(self._maps, result._maps, strict=True)
        if not result._index.keys().isdisjoint(self._index) or any(
            before.based & after.based for (_, before), (_, after) in pairs
        ):
            return None
        return result

    def without_effect(self, names: Collection[str]) -> Parameters:
        """Return the parameters for sites where some of the unknowns, by name, have no effect."""
        result = copy.copy(self)
        result.given = tuple(unknown for unknown in self.given if unknown.name not in names)
        return result

    def of(self, sites: Sequence[Site]) -> list[ParameterMap]:
        """Return the parameters of sites; those of the observed sites are cached."""
        observed = [*self._maps, *[(None, None)] * (len(sites) - len(self._maps))]
        return [
            mapping if mapping is not None and site == same else self.at(site)
            for site, (same, mapping) in zip(sites, observed, strict=False)
        ]

    def _levels_of(self, law: Law, sites: Sequence[Site]) -> dict[str, float]:
        """Return the values of the condition `along` of a free law, by configuration of the fit."""
        if not law.along:
            return {}
        fitted = [site for site in sites if law.name_in(site.configuration) in self._index]
        for site in fitted:
            if law.along not in site.conditions:
                raise ValueError(
                    f"Law {law.address!r}: {site.configuration!r} has no condition {law.along!r}; its conditions are: "
                    f"{', '.join(site.conditions) or 'none'}"
                )
        return {site.configuration: float(site.conditions[law.along]) for site in fitted}

    @property
    def _told_apart(self) -> frozenset[str]:
        """Labels and conditions that unknowns and errors name."""
        names: set[str] = set()
        for unknown in self.given:
            names |= {*(unknown.configurations or ()), *(unknown.labels or ())}
            if isinstance(unknown, Move):
                names.add(unknown.of)
            elif isinstance(unknown, Law):
                names |= {unknown.along, *(power.of for power in unknown.powers)}
        for tolerance in self.tolerances:
            names |= {*(tolerance.configurations or ()), *(tolerance.labels or ())}
        return frozenset(names)

    @property
    def errors(self) -> tuple[str, ...]:
        """Names of the errors of tolerances and of individual parts."""
        return tuple(unknown.name for unknown in self.unknowns[self.count :])

    def at(
        self, site: Site, tolerances: Sequence[Tolerance] | None = None, fresh: list[str] | None = None
    ) -> ParameterMap:
        """Return the parameters of a site, observed or not, as functions of the unknowns.

        The errors are those of the fit, or `tolerances`. Names of errors that were not fitted are appended to `fresh`.
        They follow the unknowns: the map has `p + len(fresh)` columns, and the new unknowns are standard normal and
        independent.
        """
        index = {**self._index, **{name: len(self._index) + i for i, name in enumerate(fresh or ())}}

        def error(name: str) -> int:
            if name not in index:
                if fresh is None:
                    raise ValueError(f"the error {name!r} was not fitted")
                index[name] = len(index)
                fresh.append(name)
            return index[name]

        multiples: _SparseRows = {}
        exponents: _SparseRows = defaultdict(lambda: defaultdict(float))
        shifts: _SparseRows = defaultdict(lambda: defaultdict(float))
        for unknown in self.given:
            if not site.among(unknown.configurations, unknown.labels):
                continue
            if isinstance(unknown, Move):
                self._add_move(unknown, site, exponents if unknown.relative else shifts)
                continue
            ratios = dict.fromkeys(sorted(site.covered(unknown.address)), unknown.multiple)
            ratios |= {other: n for other, n in unknown.also.items() if site.covered(other)}
            if not ratios:
                continue
            terms = [(index[unknown.name], 1.0)] if unknown.name in index else []
            if isinstance(unknown, Law):
                if unknown.free:
                    terms = self._free_terms(unknown, site)
                varying = _varying(unknown, site, index, error)
                powers = [(address, 1.0) for address in ratios]
                powers += [(address, power) for address, power in unknown.follows.items() if site.covered(address)]
                for address, power in powers:
                    for column, slope in varying.items():
                        exponents[address][column] += power * slope
            multiples |= {address: {i: n * share for i, share in terms} for address, n in ratios.items()}
        for tolerance in self.tolerances if tolerances is None else tolerances:
            if site.among(tolerance.configurations, tolerance.labels):
                rows = exponents if tolerance.relative else shifts
                for pattern, deviation in tolerance.moves.items():
                    for address in sorted(site.covered(pattern)):
                        rows[address][error(tolerance.name)] += deviation
        addresses = tuple(dict.fromkeys([*multiples, *exponents, *shifts]))
        if not addresses:
            return _nothing(len(index))
        return ParameterMap(
            addresses,
            np.array([0.0 if address in multiples else site.value(address) for address in addresses]),
            *(_dense(rows, addresses, len(index)) for rows in (multiples, exponents, shifts)),
        )

    def extended(
        self, sites: Sequence[Site], tolerances: Sequence[Sequence[Tolerance]]
    ) -> tuple[list[ParameterMap], tuple[str, ...]]:
        """Return the parameters of sites that were not fitted, with errors of each, and the names of errors not fitted.

        Errors of one name are one error, in the fit and in all sites.
        """
        fresh: list[str] = []
        maps = [self.at(site, tolerance, fresh) for site, tolerance in zip(sites, tolerances, strict=True)]
        return [mapping.widened(len(self.unknowns) + len(fresh)) for mapping in maps], tuple(fresh)

    def _free_terms(self, law: Law, site: Site) -> list[tuple[int, float]]:
        """Return the unknown of a free law at a site, or two neighbouring ones, with their weights."""
        number = self._index.get(law.name_in(site.configuration))
        if number is not None:
            return [(number, 1.0)]
        if not law.along:
            raise ValueError(f"{law.address} is free in each configuration, and {site.configuration!r} was not fitted")
        if law.along not in site.conditions:
            raise ValueError(f"Law {law.address!r}: {site.configuration!r} has no condition {law.along!r}")
        levels = sorted((level, self._index[law.name_in(name)]) for name, level in self._levels[law.name].items())
        at = float(site.conditions[law.along])
        if not levels[0][0] <= at <= levels[-1][0]:
            raise ValueError(
                f"{law.address} is known for {law.along!r} from {levels[0][0]:g} to {levels[-1][0]:g}, and "
                f"{site.configuration!r} is at {at:g}"
            )
        after = next(i for i, (level, _) in enumerate(levels) if level >= at)
        if levels[after][0] == at:
            return [(levels[after][1], 1.0)]
        (low, below), (high, above) = levels[after - 1], levels[after]
        share = (at - low) / (high - low)
        return [(below, 1.0 - share), (above, share)]

    def _add_move(self, unknown: Move, site: Site, rows: _SparseRows) -> None:
        column, size = self._index[unknown.name], 1.0
        if unknown.of:
            if unknown.of not in site.conditions and not covered(unknown.of, site.assembly):
                return
            size = math.log(site.condition(unknown.of, f"Move {unknown.name!r}") / unknown.reference)
        for pattern, coefficient in unknown.moves.items():
            for address in sorted(site.covered(pattern)):
                rows[address][column] += size * coefficient

    def _check(self, sites: Sequence[Site]) -> list[str]:
        """Check unknowns and tolerances against the sites; return notes on addresses that none of them has."""
        for site in sites:
            owner: dict[str, str] = {}
            for unknown in self.given:
                for name in site.covered(unknown.address) if site.among(unknown.configurations, unknown.labels) else ():
                    if name in owner:
                        raise ValueError(f"the unknowns {owner[name]!r} and {unknown.name!r} both determine {name!r}")
                    owner[name] = unknown.name
        notes: list[str] = []
        Names = tuple[str, ...] | None
        rows: list[tuple[str, tuple[str, ...], Names, Names | str]] = [
            (f"Unknown {unknown.address!r}", unknown.addresses, unknown.configurations, unknown.labels)
            for unknown in self.given
        ]
        rows += [
            (f"Tolerance {tolerance.name!r}", tuple(tolerance.moves), tolerance.configurations, tolerance.labels)
            for tolerance in self.tolerances
        ]
        rows += [
            (
                f"Law {unknown.address!r}, with what follows it",
                tuple(unknown.follows),
                unknown.configurations,
                unknown.labels,
            )
            for unknown in self.given
            if isinstance(unknown, Law) and unknown.follows
        ]
        among: dict[tuple[Names, Names | str], list[Site]] = {}
        for title, addresses, configurations, labels in rows:
            # Most rows have the same sites.
            if (configurations, labels) not in among:
                among[configurations, labels] = [site for site in sites if site.among(configurations, labels)]
            chosen = among[configurations, labels]
            if not chosen:
                names = ", ".join(dict.fromkeys(p.configuration or p.label or "(no name)" for p in sites))
                raise ValueError(
                    f"{title}: no observation is of {', '.join(labels or configurations or ())}; there are {names}"
                )
            missing = [address for address in addresses if not _has(address, chosen)]
            if missing and len(missing) == len(addresses):
                addresses_of_all = dict.fromkeys(name for site in sites for name in site.assembly.parameters)
                first = missing[0].split(".", 1)[0] + "."
                near = [name for name in addresses_of_all if name.startswith(first)] or list(addresses_of_all)
                raise ValueError(
                    f"{title}: no observation's assembly has {'it' if len(addresses) == 1 else missing[0]}; there are "
                    f"{', '.join(near)}"
                )
            # Assemblies that are held out or predicted may have it.
            notes += [f"{title}: no observation's assembly has {name}; it affects predictions only" for name in missing]
        return notes


@cache
def _nothing(count: int) -> ParameterMap:
    """Return the map of a site without parameters, which most sites have of an unknown of one configuration."""
    return ParameterMap.linear((), np.zeros(0), np.zeros((0, count)))


def _key(site: Site, named: Collection[str]) -> tuple[Hashable, ...]:
    """Return a key that sites with the same parameters share, where unknowns name some labels and conditions."""
    label = site.label if site.label in named else ""
    conditions = tuple((name, value) for name, value in site.conditions.items() if name in named)
    return id(site.assembly), site.configuration, label, conditions, site.factors


def _has(address: str, sites: Sequence[Site]) -> bool:
    return any(site.covered(address) for site in sites)


def _dense(rows: _SparseRows, addresses: Sequence[str], width: int) -> NDArray[np.float64]:
    """Return the rows of addresses as a matrix."""
    result = np.zeros((len(addresses), width))
    present = [(i, row) for i, address in enumerate(addresses) if (row := rows.get(address))]
    if not present:
        return result
    numbers = [i for i, row in present for _ in row]
    result[numbers, [j for _, row in present for j in row]] = [value for _, row in present for value in row.values()]
    return result


def _varying(law: Law, site: Site, index: Mapping[str, int], error: Callable[[str], int]) -> dict[int, float]:
    """Return the exponents of a law at a site by column: its powers of conditions and its individual part."""
    slopes: dict[int, float] = {}
    for power in law.powers:
        ratio = site.condition(power.of, f"Law {law.address!r}") / power.reference
        slopes[index[f"{law.name} ~ {power.of}"]] = math.log(ratio)
    if law.individual:
        slopes[error(law.name_in(site.configuration))] = law.individual
    return slopes
