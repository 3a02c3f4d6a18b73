"""What an observation or a prediction is of, and its parameters as functions of the unknowns.

A parameter of an assembly is v = b exp(E u) + S u, where u are the values of all unknowns, b is one of them, a mean of
two or the value that the assembly has, E holds the logarithms of conditions (the unknown is an exponent) and the
standard deviations of relative errors, S those of absolute ones (the unknown is an error).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.factors import FACTORS
from receptance.identification.unknowns import covered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["Place", "Placed"]


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
