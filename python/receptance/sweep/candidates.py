"""Candidates of a sweep: which values of which parameters, each one found from its number alone."""

from __future__ import annotations

import functools
import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, get_args

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Candidates", "Distribution", "Grid", "Listed", "Sampled"]

Method = Literal["random", "sobol", "latin hypercube"]

_MOST_BYTES = 2 * 2**30
_PER_STEP = 4
"""Numbers that one step of the Philox counter gives."""


class Distribution(Protocol):
    """What `Sampled` asks of a distribution; those of `scipy.stats` have it when they are frozen."""

    def ppf(self, q: Any, /) -> Any:
        """Return the quantiles of shares q."""


class Candidates(ABC):
    """Values of named parameters, numbered from zero: any run of numbers gives the same ones, on any machine."""

    addresses: tuple[str, ...]
    """Addresses of the parameters, the columns of `values`."""

    @property
    @abstractmethod
    def count(self) -> int:
        """How many there are."""

    @abstractmethod
    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return candidates `start` to `stop - 1`, `(stop - start, p)` in SI units."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return what defines them, for comparison and for the record."""

    def __len__(self) -> int:
        return self.count


@dataclass(frozen=True, eq=False, init=False)
class Grid(Candidates):
    """All combinations of values, the last parameter changes fastest.

    Parameters
    ----------
    values : mapping of str to array_like
        For each address its values `(n_i,)` in SI units.

    Raises
    ------
    TypeError, ValueError
        Nothing given, or values that are not finite numbers in one dimension.

    Examples
    --------
    >>> from receptance.sweep import Grid
    >>> grid = Grid({"joint.k_y": [1e7, 1e8], "joint.k_theta": [1e4, 1e5, 1e6]})
    >>> len(grid)
    6
    >>> grid.values(1, 3).tolist()
    [[10000000.0, 100000.0], [10000000.0, 1000000.0]]
    """

    addresses: tuple[str, ...]
    axes: tuple[NDArray[np.float64], ...]

    def __init__(self, values: Mapping[str, ArrayLike]) -> None:
        axes = _columns("Grid", values)
        object.__setattr__(self, "addresses", tuple(axes))
        object.__setattr__(self, "axes", tuple(axes.values()))

    @property
    def count(self) -> int:
        """How many there are."""
        return math.prod(axis.size for axis in self.axes)

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return candidates `start` to `stop - 1`; see `Candidates`."""
        places = np.unravel_index(np.arange(start, stop), [axis.size for axis in self.axes])
        return np.column_stack([axis[place] for axis, place in zip(self.axes, places, strict=True)])

    def describe(self) -> dict[str, Any]:
        """Return what defines them."""
        axes = {name: axis.tolist() for name, axis in zip(self.addresses, self.axes, strict=True)}
        return {"kind": "grid", "values": axes}


@dataclass(frozen=True, eq=False, init=False)
class Listed(Candidates):
    """Given candidates, one a row.

    Parameters
    ----------
    values : mapping of str to array_like
        For each address its values `(n,)` in SI units, equally many for all.

    Raises
    ------
    TypeError, ValueError
        Nothing given, different lengths, or values that are not finite numbers in one dimension.

    Examples
    --------
    >>> from receptance.sweep import Listed
    >>> len(Listed({"joint.k_y": [1e7, 2e7], "joint.k_theta": [1e4, 3e4]}))
    2
    """

    addresses: tuple[str, ...]
    table: NDArray[np.float64]

    def __init__(self, values: Mapping[str, ArrayLike]) -> None:
        columns = _columns("Listed", values)
        sizes = {name: column.size for name, column in columns.items()}
        if len(set(sizes.values())) > 1:
            found = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise ValueError(f"Listed: the parameters have different numbers of values: {found}; expected the same")
        object.__setattr__(self, "addresses", tuple(columns))
        object.__setattr__(self, "table", np.column_stack(list(columns.values())))

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.table)

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return candidates `start` to `stop - 1`; see `Candidates`."""
        return self.table[start:stop].copy()

    def describe(self) -> dict[str, Any]:
        """Return what defines them."""
        return {"kind": "list", "addresses": list(self.addresses), "values": self.table.tolist()}


@dataclass(frozen=True, eq=False, init=False)
class Sampled(Candidates):
    """Candidates drawn from distributions, independent of one another.

    Candidate i follows from the seed and i alone (in a Latin hypercube from the count as well), so that it is the same
    in whichever block, process or machine it is drawn.

    Parameters
    ----------
    distributions : mapping of str to distribution
        For each address a distribution in SI units, of `scipy.stats` or with a method `ppf`.
    count : int
        How many.
    seed : int
        Of the draws.
    method : {"random", "sobol", "latin hypercube"}, optional
        Independent draws, a scrambled Sobol sequence, which fills the ranges evenly and is best with a power of two, or
        a Latin hypercube: each of `count` equally likely intervals of every parameter holds exactly one candidate. A
        Latin hypercube is drawn as a whole and takes 8 bytes of memory for each candidate and parameter.

    Raises
    ------
    TypeError, ValueError
        Nothing given, what is no distribution, a count below one, a Latin hypercube of more than 2 GiB.

    Examples
    --------
    >>> from scipy import stats
    >>> from receptance.sweep import Sampled
    >>> drawn = Sampled({"joint.k_y": stats.loguniform(1e7, 1e9)}, count=1000, seed=1)
    >>> bool((drawn.values(0, 1000)[700:710] == drawn.values(700, 710)).all())
    True
    """

    addresses: tuple[str, ...]
    distributions: tuple[Distribution, ...]
    number: int
    seed: int
    method: Method

    def __init__(
        self,
        distributions: Mapping[str, Distribution],
        *,
        count: int,
        seed: int,
        method: Method = "random",
    ) -> None:
        given = _named("Sampled", distributions)
        for name, one in given.items():
            if not callable(getattr(one, "ppf", None)):
                raise TypeError(
                    f"Sampled: {name} is {one!r}, expected a distribution such as scipy.stats.loguniform(1e7, 1e9)"
                )
        for name, value, least in (("count", count, 1), ("seed", seed, 0)):
            if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
                raise ValueError(f"Sampled: {name} is {value!r}, expected a whole number of at least {least}")
        if method not in get_args(Method):
            raise ValueError(f"Sampled: method is {method!r}, expected one of {', '.join(map(repr, get_args(Method)))}")
        if method == "latin hypercube" and 8 * count * len(given) > _MOST_BYTES:
            raise ValueError(
                f"Sampled: a Latin hypercube of {count:,} candidates of {len(given)} parameters takes "
                f"{8e-9 * count * len(given):.1f} GB, expected at most {1e-9 * _MOST_BYTES:.1f}; use method='sobol'"
            )
        object.__setattr__(self, "addresses", tuple(given))
        object.__setattr__(self, "distributions", tuple(given.values()))
        object.__setattr__(self, "number", int(count))
        object.__setattr__(self, "seed", int(seed))
        object.__setattr__(self, "method", method)

    @property
    def count(self) -> int:
        """How many there are."""
        return self.number

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return candidates `start` to `stop - 1`; see `Candidates`."""
        if self.method == "latin hypercube":
            shares = _latin_hypercube(len(self.addresses), self.number, self.seed)[start:stop]
        else:
            shares = self._even(start, stop) if self.method == "sobol" else self._independent(start, stop)
        # The ends of a range may be infinite.
        shares = np.clip(shares, 2.0**-54, 1.0 - 2.0**-53)
        drawn = [
            np.asarray(one.ppf(share), np.float64) for one, share in zip(self.distributions, shares.T, strict=True)
        ]
        return np.column_stack(drawn)

    def describe(self) -> dict[str, Any]:
        """Return what defines them."""
        # Quantiles tell distributions of any kind apart, and stay the same where their names change; rounded, since
        # processors may differ in the last bits.
        shares = np.linspace(0.01, 0.99, 9)
        quantiles = {
            name: [float(f"{value:.12g}") for value in np.asarray(one.ppf(shares), np.float64)]
            for name, one in zip(self.addresses, self.distributions, strict=True)
        }
        return {
            "kind": "sample",
            "method": self.method,
            "count": self.number,
            "seed": self.seed,
            "quantiles": quantiles,
        }

    def _independent(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return shares from whole steps of a counter for each candidate."""
        steps = -(-len(self.addresses) // _PER_STEP)
        counter = np.random.Philox(key=self.seed)
        counter.advance(start * steps)
        shares = np.random.Generator(counter).random((stop - start, steps * _PER_STEP))
        return shares[:, : len(self.addresses)]

    def _even(self, start: int, stop: int) -> NDArray[np.float64]:
        from scipy.stats import qmc

        sequence = qmc.Sobol(len(self.addresses), scramble=True, rng=np.random.default_rng(self.seed))
        if start:
            sequence.fast_forward(start)
        with warnings.catch_warnings():
            # That a part of a sequence is not balanced is meant.
            warnings.simplefilter("ignore", UserWarning)
            shares: NDArray[np.float64] = sequence.random(stop - start)
        return shares


@functools.lru_cache(maxsize=1)
def _latin_hypercube(parameters: int, count: int, seed: int) -> NDArray[np.float64]:
    """Return shares `(count, parameters)`; kept, as all blocks of a sweep take theirs from one draw."""
    from scipy.stats import qmc

    shares: NDArray[np.float64] = qmc.LatinHypercube(parameters, rng=np.random.default_rng(seed)).random(count)
    shares.flags.writeable = False
    return shares


def _named(owner: str, given: Any) -> dict[str, Any]:
    if not isinstance(given, Mapping) or not given:
        raise TypeError(f"{owner}: {given!r} was given, expected values by address, {{'joint.k_y': ...}}")
    return {str(name): value for name, value in given.items()}


def _columns(owner: str, values: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.float64]]:
    columns = {}
    for name, value in _named(owner, values).items():
        array = np.atleast_1d(_checks.unmasked(owner, name, value))
        if array.dtype.kind not in "iuf" or array.ndim != 1 or not array.size:
            raise TypeError(f"{owner}: {name} is {value!r}, expected numbers in one dimension")
        columns[name] = np.array([_checks.number(owner, f"{name}[{i}]", v) for i, v in enumerate(array.tolist())])
    return columns
