"""A joint whose stiffness falls and whose loss grows with the amplitude of its motion: micro-slip."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np

from receptance import units
from receptance.fields import Field, Number
from receptance.joints import PointJoint, _Spring

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["MicroslipJoint"]


def largest_share(exponent: float) -> float:
    """Return the share of the stiffness that is lost when the last of the interface begins to slide.

    There the slope of the backbone f(u) = k u (1 - c u^p) is zero at the amplitude: c (1+p) a^p = 1.
    """
    return 8.0 / math.pi * _sine_integral(exponent) / (2.0 + exponent)


def loss_ratio(exponent: float) -> float:
    """Return the loss stiffness over the lost stiffness, p / (2 (1+p) I_p); 4 / (3 pi) for p = 1."""
    return exponent / (2.0 * (1.0 + exponent) * _sine_integral(exponent))


def loss_ratio_slope(exponent: float) -> float:
    """Return the derivative of `loss_ratio` with respect to the exponent."""
    from scipy.special import digamma

    p = exponent
    return loss_ratio(p) * (1.0 / p - 1.0 / (1.0 + p) - float(digamma(p + 1.5) - digamma(p + 2.0)))


def _sine_integral(exponent: float) -> float:
    """Return I_p, the integral of sin^(2+2p) from 0 to pi/2."""
    return 0.5 * math.sqrt(math.pi) * math.exp(math.lgamma(exponent + 1.5) - math.lgamma(exponent + 2.0))


@dataclass(frozen=True, kw_only=True)
class MicroslipJoint(_Spring):
    """A joint in micro-slip: the further its sides move, the more of the interface slides.

    Each direction is an Iwan element of power-law distribution, whose loop follows Masing's rules from the backbone
    f(u) = k u (1 - c u^p) (Iwan 1966; Segalman 2005). Its first harmonic under a motion of amplitude a is the complex
    stiffness

        K(a) = k (1 + i loss_factor) - k s l^p (1 - i beta_p) + i w c,        l = a / a_ref

    so that one number, s, says how the stiffness falls and how the loss grows: beta_p is 4/(3 pi) for p = 1. The level
    l is either stated (`level`, one for a hammer record), or found on each line from the force of a stepped sine, see
    `Assembly.receptance`.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        As `PointJoint`; an exponent out of range, or a level at which the whole interface slides: the share that is
        lost is then 1/2 for p = 1, and nothing here describes what follows.

    Examples
    --------
    >>> from receptance import MicroslipJoint
    >>> joint = MicroslipJoint(k_y=5e8, k_theta=1e5, slip_theta=0.1, level=2.0)
    >>> joint.stiffness([1000.0])[0, 1, 1].round(1)
    np.complex128(80000+8488.3j)
    """

    slip_y: Annotated[float, Number(units.SHARE, "share s of k_y that is lost at the level 1")] = 0.0
    slip_theta: Annotated[float, Number(units.SHARE, "share s of k_theta that is lost at the level 1")] = 0.0
    exponent: Annotated[
        float,
        Number(
            units.EXPONENT,
            "exponent p of the lost share over the level; with 1 the loss per cycle grows with the third power of the "
            "amplitude, and most bolted and clamped joints have less",
        ),
    ] = 1.0
    level: Annotated[
        float,
        Number(
            units.LEVEL,
            "amplitude of the joint's motion over the reference, unless a force is given; 0 for small amplitudes",
        ),
    ] = 0.0
    reference_y: Annotated[
        float, Number(units.AMPLITUDE, "amplitude of the relative motion at the level 1; needed with a given force")
    ] = 0.0
    reference_theta: Annotated[
        float, Number(units.ANGLE, "amplitude of the relative rotation at the level 1; needed with a given force")
    ] = 0.0
    name: Annotated[str, Field("first word of the addresses of its parameters, as in `joint.slip_y`")] = field(
        default="", compare=False
    )

    amplitude_of: ClassVar[tuple[str, ...]]
    """Names of its parameters beyond those of a `PointJoint`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        owner = self.owner
        most = largest_share(self.exponent)
        for which, share in zip(("y", "theta"), self.shares, strict=True):
            if getattr(self, f"k_{which}") == 0.0:
                raise ValueError(f"{owner}: k_{which} is zero, expected a stiffness that slip can take from")
            if share > most:
                raise ValueError(
                    f"{owner}: the level {self.level:g} takes a share of {share:.3g} from k_{which}, expected at most "
                    f"{most:.3g}: beyond that the whole interface slides"
                )
        y, theta = (1.0 - share for share in self.shares)
        if self.k_ytheta**2 > self.k_y * y * self.k_theta * theta * (1.0 + 1e-12):
            raise ValueError(
                f"{owner}: k_ytheta is {self.k_ytheta:g}, more than what is left of k_y and k_theta at the level "
                f"{self.level:g} allows: sqrt(k_y k_theta) is {math.sqrt(self.k_y * y * self.k_theta * theta):g}"
            )

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of k_y and of k_theta that are lost at the stated level."""
        power = self.level**self.exponent
        return self.slip_y * power, self.slip_theta * power

    @property
    def added(self) -> NDArray[np.complex128]:
        """What slip adds to the stiffness in y and in theta at the stated level, `(2,)`."""
        factor = -(1.0 - 1j * loss_ratio(self.exponent))
        result: NDArray[np.complex128] = factor * np.array(self.shares) * np.array([self.k_y, self.k_theta])
        return result

    def stiffness(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Dynamic stiffness at the stated level, `(n, 2, 2)` over (y, theta)."""
        result = super().stiffness(frequency_hz)
        result[:, [0, 1], [0, 1]] += self.added
        return result


MicroslipJoint.amplitude_of = MicroslipJoint.columns_of[len(PointJoint.columns_of) :]
