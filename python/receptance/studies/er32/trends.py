"""Stiffness over clamping torque and over tool diameter, with intervals from the resolution of the readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from receptance.studies.er32.joints import IdentifiedJoint, Interval

__all__ = ["DiameterLaw", "Step", "TorqueTrend", "Trends", "find_trends"]

Quantity = Literal["k_y", "k_theta"]
QUANTITIES: tuple[Quantity, ...] = ("k_y", "k_theta")
_LEVEL = 0.95


@dataclass(frozen=True)
class Step:
    """Change of a stiffness from one state to the next, in percent, with what the resolution leaves open."""

    start: float
    end: float
    percent: float
    interval: Interval

    @property
    def exceeds(self) -> bool:
        """Whether no reading within the resolution makes the change vanish."""
        return _excludes_zero(self.interval)


@dataclass(frozen=True)
class TorqueTrend:
    """Change of a stiffness over the whole range of torque.

    `change_percent` and `interval` are those of a straight line fitted to the logarithm of the stiffness at all
    torques; `end_values` is the change from the lowest to the highest torque without the values between.
    """

    quantity: Quantity
    diameter_mm: float
    change_percent: float
    interval: Interval
    steps: tuple[Step, ...]
    end_values: Step

    @property
    def exceeds(self) -> bool:
        """Whether no reading within the resolution makes the change vanish."""
        return _excludes_zero(self.interval)


@dataclass(frozen=True)
class DiameterLaw:
    """Power law of a stiffness over tool diameter at one torque.

    `interval` comes from the resolution alone. `scatter_interval` is the 95 % interval that the scatter of the tools
    about the law gives; it is what a power law deserves where the scatter is much more than the resolution.
    """

    quantity: Quantity
    torque_nm: float
    exponent: float
    interval: Interval
    scatter_percent: float
    scatter_interval: tuple[float, float]
    steps: tuple[Step, ...]

    @property
    def exceeds(self) -> bool:
        """Whether the exponent differs from zero by more than the resolution and the scatter explain."""
        return _excludes_zero(self.interval) and _excludes_zero(self.scatter_interval)


@dataclass(frozen=True)
class Trends:
    """All trends."""

    torque_range_nm: tuple[float, float]
    torque: tuple[TorqueTrend, ...]
    diameter: tuple[DiameterLaw, ...]


def find_trends(joints: Sequence[IdentifiedJoint], torque_nm: float) -> Trends:
    """Trends over torque for each tool, and over diameter at one torque.

    The ends of every interval are those that the readings reach when all of them err within the resolution in the
    worst direction; nothing is assumed of their distribution.
    """
    torques = sorted({joint.torque_nm for joint in joints})
    diameters = sorted({joint.diameter_mm for joint in joints})
    over_torque = []
    over_diameter = []
    for quantity in QUANTITIES:
        for diameter in diameters:
            states = sorted((j for j in joints if j.diameter_mm == diameter), key=lambda j: j.torque_nm)
            over_torque.append(_torque_trend(quantity, diameter, states))
        states = sorted((j for j in joints if j.torque_nm == torque_nm), key=lambda j: j.diameter_mm)
        over_diameter.append(_diameter_law(quantity, torque_nm, states))
    return Trends((torques[0], torques[-1]), tuple(over_torque), tuple(over_diameter))


def _torque_trend(quantity: Quantity, diameter: float, states: Sequence[IdentifiedJoint]) -> TorqueTrend:
    torque = np.array([state.torque_nm for state in states])
    centred = torque - torque.mean()
    weights = centred / np.sum(centred**2) * np.ptp(torque)
    value, interval = _combine(quantity, states, weights.tolist())
    percent, ends = _as_percent(value, interval)
    steps = _steps(quantity, states, torque.tolist())
    (whole,) = _steps(quantity, [states[0], states[-1]], [float(torque[0]), float(torque[-1])])
    return TorqueTrend(quantity, diameter, percent, ends, steps, whole)


def _diameter_law(quantity: Quantity, torque_nm: float, states: Sequence[IdentifiedJoint]) -> DiameterLaw:
    from scipy.stats import t as student  # slow to import

    diameters = [state.diameter_mm for state in states]
    x = np.log(diameters)
    centred = x - x.mean()
    weights = centred / np.sum(centred**2)
    exponent, interval = _combine(quantity, states, weights.tolist())
    y = np.log([getattr(state, quantity) for state in states])
    left = y - y.mean() - exponent * centred
    variance = float(np.sum(left**2)) / (len(states) - 2)
    reach = float(student.ppf(0.5 + _LEVEL / 2.0, len(states) - 2) * np.sqrt(variance / np.sum(centred**2)))
    return DiameterLaw(
        quantity=quantity,
        torque_nm=torque_nm,
        exponent=exponent,
        interval=interval,
        scatter_percent=100.0 * float(np.expm1(np.sqrt(variance))),
        scatter_interval=(exponent - reach, exponent + reach),
        steps=_steps(quantity, states, diameters),
    )


def _steps(quantity: Quantity, states: Sequence[IdentifiedJoint], at: Sequence[float]) -> tuple[Step, ...]:
    found = []
    for i in range(len(states) - 1):
        percent, interval = _as_percent(*_combine(quantity, states[i : i + 2], [-1.0, 1.0]))
        found.append(Step(at[i], at[i + 1], percent, interval))
    return tuple(found)


def _combine(quantity: Quantity, states: Sequence[IdentifiedJoint], weights: Sequence[float]) -> tuple[float, Interval]:
    """Weighted sum of the logarithms, with the ends that the intervals of the states allow."""
    value = 0.0
    low: float | None = 0.0
    high: float | None = 0.0
    for state, weight in zip(states, weights, strict=True):
        value += weight * float(np.log(getattr(state, quantity)))
        ends: Interval = getattr(state, f"{quantity}_interval")
        below, above = ends if weight > 0.0 else (ends[1], ends[0])
        low = None if low is None or below is None else low + weight * float(np.log(below))
        high = None if high is None or above is None else high + weight * float(np.log(above))
    return value, (low, high)


def _as_percent(value: float, interval: Interval) -> tuple[float, Interval]:
    low, high = (None if end is None else 100.0 * float(np.expm1(end)) for end in interval)
    return 100.0 * float(np.expm1(value)), (low, high)


def _excludes_zero(interval: Interval) -> bool:
    low, high = interval
    return (low is not None and low > 0.0) or (high is not None and high < 0.0)
