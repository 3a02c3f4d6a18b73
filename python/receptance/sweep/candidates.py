"""Candidates of a sweep: values of parameters, each candidate determined by its number."""

from __future__ import annotations

import functools
import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Literal, Protocol

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import _checks

Method = Literal["random", "sobol", "latin hypercube"]

MOST_BYTES = 2 * 2**30
"""Largest memory of the candidates of a Latin hypercube, and of results without a store."""
_PER_STEP = 4
"""Random numbers per step of the Philox counter."""


class Distribution(Protocol):
    """A distribution with quantiles, such as a frozen distribution of `scipy.stats`."""

    def ppf(self, q: Any, /) -> Any:
        """Return the quantiles for probabilities q."""


class Candidates(ABC):
    """Values of named parameters, numbered from zero; a number gives the same candidate on any machine."""

    addresses: tuple[str, ...]
    """Addresses of the parameters, the columns of `values`."""
    count: int
    """Number of candidates."""

    @abstractmethod
    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return candidates `start` to `stop - 1`, `(stop - start, p)` in SI units."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Return the values that define the candidates, for comparison and for the metadata of a store."""

    def __len__(self) -> int:
        return self.count


class Grid(Candidates):
    """All combinations of values; the last parameter changes fastest.

    Parameters
    ----------
    values : mapping of str to array_like
        Values `(n_i,)` in SI units by address.

    Raises
    ------
    TypeError, ValueError
        An empty mapping, or values that are not finite numbers in one dimension.

    Examples
    --------
    >>> from receptance.sweep import Grid
    >>> grid = Grid({"joint.k_y": [1e7, 1e8], "joint.k_theta": [1e4, 1e5, 1e6]})
    >>> len(grid)
    6
    >>> grid.values(1, 3).tolist()
    [[10000000.0, 100000.0], [10000000.0, 1000000.0]]
    """

    def __init__(self, values: Mapping[str, ArrayLike]) -> None:
        axes = _columns("Grid", values)
        self.addresses, self.axes = tuple(axes), tuple(axes.values())
        self.count = math.prod(axis.size for axis in self.axes)

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        indices = np.unravel_index(np.arange(start, stop), [axis.size for axis in self.axes])
        return np.column_stack([axis[index] for axis, index in zip(self.axes, indices, strict=True)])

    def describe(self) -> dict[str, Any]:
        axes = {name: axis.tolist() for name, axis in zip(self.addresses, self.axes, strict=True)}
        return {"kind": "grid", "values": axes}


class Listed(Candidates):
    """A list of candidates.

    Parameters
    ----------
    values : mapping of str to array_like
        Values `(n,)` in SI units by address, of equal length.

    Raises
    ------
    TypeError, ValueError
        An empty mapping, different lengths, or values that are not finite numbers in one dimension.

    Examples
    --------
    >>> from receptance.sweep import Listed
    >>> len(Listed({"joint.k_y": [1e7, 2e7], "joint.k_theta": [1e4, 3e4]}))
    2
    """

    def __init__(self, values: Mapping[str, ArrayLike]) -> None:
        columns = _columns("Listed", values)
        sizes = {name: column.size for name, column in columns.items()}
        if len(set(sizes.values())) > 1:
            numbers = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise ValueError(f"Listed: the parameters have different numbers of values: {numbers}; expected the same")
        self.addresses, self.table = tuple(columns), np.column_stack(list(columns.values()))
        self.count = len(self.table)

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        return self.table[start:stop].copy()

    def describe(self) -> dict[str, Any]:
        return {"kind": "list", "addresses": list(self.addresses), "values": self.table.tolist()}


class Sampled(Candidates):
    """Candidates drawn from independent distributions.

    Candidate i depends on the seed and i only (in a Latin hypercube on the count as well), so it is the same in every
    block, process and machine.

    Parameters
    ----------
    distributions : mapping of str to distribution
        Distributions in SI units by address, of `scipy.stats` or with a method `ppf`.
    count : int
        Number of candidates.
    seed : int
        Seed of the random numbers.
    method : {"random", "sobol", "latin hypercube"}, optional
        Independent draws; a scrambled Sobol sequence, which fills the ranges evenly, preferably with a power of two as
        count; or a Latin hypercube, in which each of `count` equally likely intervals of every parameter contains
        exactly one candidate. A Latin hypercube needs 8 bytes of memory per candidate and parameter.

    Raises
    ------
    TypeError, ValueError
        An empty mapping, an object without quantiles, a count below one, a Latin hypercube of more than 2 GiB.

    Examples
    --------
    >>> from scipy import stats
    >>> from receptance.sweep import Sampled
    >>> drawn = Sampled({"joint.k_y": stats.loguniform(1e7, 1e9)}, count=1000, seed=1)
    >>> bool((drawn.values(0, 1000)[700:710] == drawn.values(700, 710)).all())
    True
    """

    def __init__(
        self,
        distributions: Mapping[str, Distribution],
        *,
        count: int,
        seed: int,
        method: Method = "random",
    ) -> None:
        by_address = _by_address("Sampled", distributions)
        for name, distribution in by_address.items():
            if not callable(getattr(distribution, "ppf", None)):
                raise TypeError(
                    f"Sampled: {name} is {distribution!r}, expected a distribution such as scipy.stats.loguniform(1e7, "
                    "1e9)"
                )
        self.addresses, self.distributions = tuple(by_address), tuple(by_address.values())
        self.count = _checks.whole_number("Sampled", "count", count)
        self.seed = _checks.whole_number("Sampled", "seed", seed, least=0)
        _checks.one_of("Sampled", "method", method, Method)
        if method == "latin hypercube" and 8 * count * len(by_address) > MOST_BYTES:
            raise ValueError(
                f"Sampled: a Latin hypercube of {count:,} candidates of {len(by_address)} parameters takes "
                f"{8e-9 * count * len(by_address):.1f} GB, expected at most {1e-9 * MOST_BYTES:.1f}; use "
                "method='sobol'"
            )
        self.method: Method = method

    def values(self, start: int, stop: int) -> NDArray[np.float64]:
        if self.method == "latin hypercube":
            shares = _latin_hypercube(len(self.addresses), self.count, self.seed)[start:stop]
        else:
            shares = self._sobol(start, stop) if self.method == "sobol" else self._random(start, stop)
        # The quantiles of 0 and 1 may be infinite.
        shares = np.clip(shares, 2.0**-54, 1.0 - 2.0**-53)
        pairs = zip(self.distributions, shares.T, strict=True)
        return np.column_stack([np.asarray(distribution.ppf(share), np.float64) for distribution, share in pairs])

    def describe(self) -> dict[str, Any]:
        # Quantiles identify distributions of any class. They are rounded because processors may differ in the last
        # bits.
        shares = np.linspace(0.01, 0.99, 9)
        quantiles = {
            name: [float(f"{value:.12g}") for value in np.asarray(distribution.ppf(shares), np.float64)]
            for name, distribution in zip(self.addresses, self.distributions, strict=True)
        }
        return {
            "kind": "sample",
            "method": self.method,
            "count": self.count,
            "seed": self.seed,
            "quantiles": quantiles,
        }

    def _random(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return probabilities; each candidate uses a whole number of steps of the counter."""
        steps = -(-len(self.addresses) // _PER_STEP)
        counter = np.random.Philox(key=self.seed)
        counter.advance(start * steps)
        shares = np.random.Generator(counter).random((stop - start, steps * _PER_STEP))
        return shares[:, : len(self.addresses)]

    def _sobol(self, start: int, stop: int) -> NDArray[np.float64]:
        sequence = scipy.stats.qmc.Sobol(len(self.addresses), scramble=True, rng=np.random.default_rng(self.seed))
        if start:
            sequence.fast_forward(start)
        with warnings.catch_warnings():
            # SciPy warns that a part of a sequence is not balanced.
            warnings.simplefilter("ignore", UserWarning)
            return np.asarray(sequence.random(stop - start))


@functools.lru_cache(maxsize=1)
def _latin_hypercube(parameters: int, count: int, seed: int) -> NDArray[np.float64]:
    """Return probabilities `(count, parameters)`, cached because all blocks of a sweep share them."""
    shares: NDArray[np.float64] = scipy.stats.qmc.LatinHypercube(parameters, rng=np.random.default_rng(seed)).random(
        count
    )
    shares.flags.writeable = False
    return shares


def _by_address(owner: str, values: Any) -> dict[str, Any]:
    if not isinstance(values, Mapping) or not values:
        raise TypeError(f"{owner}: the argument is {values!r}, expected values by address, {{'joint.k_y': ...}}")
    return {str(name): value for name, value in values.items()}


def _columns(owner: str, values: Mapping[str, ArrayLike]) -> dict[str, NDArray[np.float64]]:
    columns = {}
    for name, value in _by_address(owner, values).items():
        array = np.atleast_1d(_checks.unmasked(owner, name, value))
        if array.dtype.kind not in "iuf" or array.ndim != 1 or not array.size:
            raise TypeError(f"{owner}: {name} is {value!r}, expected numbers in one dimension")
        columns[name] = np.array([_checks.number(owner, f"{name}[{i}]", v) for i, v in enumerate(array.tolist())])
    return columns
