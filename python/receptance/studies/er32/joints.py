"""The joint of every tool at every torque, from two natural frequencies each (table 4)."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.identification import MeasuredFrequencies, Unknown, identify
from receptance.studies.er32.holder import JOINT, HolderModel, mode_slopes
from receptance.studies.er32.tables import Mount, Published, Reading

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["IdentifiedJoint", "Interval", "Resolution", "follow_joint", "identify_joints", "joint_of"]

Interval = tuple[float | None, float | None]
"""Lower and upper end; None where it is open."""

BOUNDS = {"joint.k_y": (1e6, 1e13), "joint.k_theta": (1e2, 1e9)}
"""Where the joint is sought, N/m and N m/rad."""
_TOLERANCE = 1e-10


@dataclass(frozen=True)
class Resolution:
    """How finely frequencies are printed: in steps of `fine_hz` below `change_hz` and of `coarse_hz` from there on.

    Examples
    --------
    >>> from receptance.studies.er32.joints import Resolution
    >>> Resolution().half_step([2004.0, 10110.0])
    array([0.5, 5. ])
    """

    fine_hz: float = 1.0
    coarse_hz: float = 10.0
    change_hz: float = 10e3

    def half_step(self, frequency_hz: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the most that a printed frequency can be off, in Hz."""
        steps: NDArray[np.float64] = np.where(np.asarray(frequency_hz) < self.change_hz, self.fine_hz, self.coarse_hz)
        return steps / 2.0

    def standard_deviation(self, frequency_hz: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the standard deviation of an error that is uniform over the step, in Hz."""
        deviation: NDArray[np.float64] = self.half_step(frequency_hz) / np.sqrt(3.0)
        return deviation


@dataclass(frozen=True)
class IdentifiedJoint:
    """Joint of one tool at one torque.

    The intervals hold every joint whose two natural frequencies would have been printed as they were; an open end
    is None. They say nothing of the model's own error, nor of how a second clamping would have come out.
    `k_y_percent_per_mm` and `k_theta_percent_per_mm` are the change per mm of overhang more, at the same frequencies.
    """

    diameter_mm: float
    torque_nm: float
    k_y: float
    k_theta: float
    k_y_interval: Interval
    k_theta_interval: Interval
    k_y_percent_per_mm: float
    k_theta_percent_per_mm: float
    correlation: float
    published_k_y: float
    published_k_theta: float
    starts: int
    starts_agreeing: int
    converged: bool
    advice: tuple[str, ...]

    @property
    def k_y_difference_percent(self) -> float:
        """Ours against the paper's."""
        return 100.0 * (self.k_y / self.published_k_y - 1.0)

    @property
    def k_theta_difference_percent(self) -> float:
        """Ours against the paper's."""
        return 100.0 * (self.k_theta / self.published_k_theta - 1.0)


def identify_joints(
    model: HolderModel, published: Published, resolution: Resolution, *, starts: int, seed: int
) -> tuple[IdentifiedJoint, ...]:
    """Identify k_y and k_theta of all five tools at all four torques.

    Parameters
    ----------
    model : HolderModel
        The holder.
    published : Published
        The tables.
    resolution : Resolution
        What the intervals come from.
    starts, seed : int
        Of `receptance.identification.identify`.
    """
    return tuple(
        _identify(model, published.mount(reading.diameter_mm), reading, resolution, starts, seed)
        for reading in published.readings
    )


def joint_of(joints: Sequence[IdentifiedJoint], diameter_mm: float, torque_nm: float) -> IdentifiedJoint:
    """Return the joint of a tool at a torque."""
    return next(j for j in joints if (j.diameter_mm, j.torque_nm) == (diameter_mm, torque_nm))


def _identify(
    model: HolderModel, mount: Mount, reading: Reading, resolution: Resolution, starts: int, seed: int
) -> IdentifiedJoint:
    first = {address: float(np.sqrt(low * high)) for address, (low, high) in BOUNDS.items()}
    assembly = model.assembly(mount.diameter_mm, mount.overhang_mm, mount.holder_length_mm, *first.values())
    found = identify(
        MeasuredFrequencies(
            assembly=assembly,
            frequency_hz=reading.frequency_hz,
            standard_deviation_hz=resolution.standard_deviation(reading.frequency_hz),
            label=f"{reading.diameter_mm:g} mm at {reading.torque_nm:g} N m",
        ),
        [Unknown(address=address, lower=low, upper=high) for address, (low, high) in BOUNDS.items()],
        starts=starts,
        seed=seed,
    )
    k_y, k_theta = (found.values[address] for address in JOINT)
    fitted = assembly.replace(found.values)
    intervals = _intervals(fitted, reading, resolution)
    _, _, joint_slopes, overhang_slopes = mode_slopes(model, fitted, (1, 2), ())
    per_mm = -100.0 * np.linalg.solve(joint_slopes, overhang_slopes)
    order = [list(found.addresses).index(address) for address in JOINT]
    return IdentifiedJoint(
        diameter_mm=reading.diameter_mm,
        torque_nm=reading.torque_nm,
        k_y=k_y,
        k_theta=k_theta,
        k_y_interval=intervals[0],
        k_theta_interval=intervals[1],
        k_y_percent_per_mm=float(per_mm[0]),
        k_theta_percent_per_mm=float(per_mm[1]),
        correlation=float(found.correlation[order[0], order[1]]),
        published_k_y=reading.k_y,
        published_k_theta=reading.k_theta,
        starts=starts,
        starts_agreeing=found.agreeing,
        converged=found.converged,
        advice=tuple(found.advice),
    )


def _intervals(assembly: Assembly, reading: Reading, resolution: Resolution) -> tuple[Interval, Interval]:
    """Follow the joint to the corners of the box that the printed frequencies leave."""
    centre = np.array(reading.frequency_hz)
    half = resolution.half_step(centre)
    corners = [follow_joint(assembly, centre + half * signs) for signs in itertools.product((-1.0, 1.0), repeat=2)]
    ends: list[Interval] = []
    for address, values in zip(JOINT, np.array(corners).T, strict=True):
        low, high = BOUNDS[address]
        ends.append(
            (
                None if values.min() <= low * (1.0 + 1e-6) else float(values.min()),
                None if values.max() >= high * (1.0 - 1e-6) else float(values.max()),
            )
        )
    return ends[0], ends[1]


def follow_joint(assembly: Assembly, frequency_hz: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Move an identified joint to where the first two natural frequencies are others; (k_y, k_theta).

    As many frequencies as unknowns: Newton's method in logarithms, kept within the bounds of the search. A value
    at a bound means that no joint within them gives these frequencies.
    """
    wanted = np.log(np.asarray(frequency_hz, dtype=np.float64))
    low, high = np.log(np.array([BOUNDS[address] for address in JOINT])).T
    x = np.log([assembly.get(address) for address in JOINT])
    for _ in range(60):
        moved = assembly.replace(dict(zip(JOINT, np.exp(x).tolist(), strict=True)))
        frequency, slope = moved.lowest_natural_frequencies(2, JOINT)
        matrix = slope * np.exp(x) / frequency[:, None]
        step, *_ = np.linalg.lstsq(matrix, wanted - np.log(frequency), rcond=None)
        # A step of more than a factor e^2 is more than the slopes can be trusted for.
        step *= min(1.0, 2.0 / max(float(np.max(np.abs(step))), 1e-300))
        following = np.clip(x + step, low, high)
        moved_by = float(np.max(np.abs(following - x)))
        x = following
        if moved_by < _TOLERANCE:
            break
    result_k: NDArray[np.float64] = np.exp(x)
    return result_k
