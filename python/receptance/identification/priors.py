"""What is known of parameters before the measurement: Gaussian priors, as rows of the least-squares problem."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.residuals import Pair, Unit
    from receptance.identification.unknowns import Unknown

__all__ = ["Prior", "PriorResidual"]


@dataclass(frozen=True, kw_only=True)
class Prior:
    """What is known of an unknown beforehand: a Gaussian on the scale of the fit.

    Parameters
    ----------
    mean : float
        Most likely value, in SI units.
    standard_deviation : float
        In SI units where the value itself is fitted; where its logarithm is, of the natural logarithm: 0.1 is about
        10 %, log(3) a factor of three.

    Raises
    ------
    TypeError, ValueError
        A mean that is not finite, or a standard deviation that is not above zero.

    Examples
    --------
    >>> import math
    >>> from receptance.identification import Prior, Unknown
    >>> about = Prior(mean=1e8, standard_deviation=math.log(3))
    >>> Unknown(address="joint.k_y", lower=1e6, upper=1e10, prior=about).prior.mean
    100000000.0
    """

    mean: float
    standard_deviation: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "mean", _checks.number("Prior", "mean", self.mean))
        spread = _checks.positive("Prior", "standard_deviation", self.standard_deviation)
        object.__setattr__(self, "standard_deviation", spread)


class PriorResidual:
    """One residual for every unknown with a prior: how many standard deviations it is off."""

    unit: Unit = "standard deviations"

    def __init__(self, unknowns: Sequence[Unknown]) -> None:
        pairs = [(i, unknown.prior) for i, unknown in enumerate(unknowns) if unknown.prior is not None]
        self._columns = np.array([i for i, _ in pairs], dtype=np.intp)
        self._spread = np.array([prior.standard_deviation for _, prior in pairs])
        self._logarithmic = np.array([unknowns[i].scale == "log" for i, _ in pairs], dtype=np.bool_)
        means = [math.log(prior.mean) if unknowns[i].scale == "log" else prior.mean for i, prior in pairs]
        self._means = np.array(means)
        self._count = len(unknowns)

    @property
    def size(self) -> int:
        """Number of priors."""
        return self._columns.size

    def evaluate(self, values: NDArray[np.float64], slopes: NDArray[np.float64]) -> Pair:
        """Return residuals and their derivatives; see `residuals.Residual`."""
        own = values[self._columns]
        jacobian = np.zeros((self.size, self._count))
        scale = np.where(self._logarithmic, own, 1.0) * self._spread
        jacobian[np.arange(self.size), self._columns] = slopes[self._columns] / scale
        return self.value(values), jacobian

    def value(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return residuals alone."""
        own = values[self._columns].copy()
        np.log(own, out=own, where=self._logarithmic)
        result: NDArray[np.float64] = (own - self._means) / self._spread
        return result
