"""The joint of every tool at every torque from two natural frequencies (table 4), and its trends.

Intervals contain every joint whose natural frequencies would be printed like the measured ones; an open end is None.
They contain neither the error of the model nor the scatter between clampings.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

import receptance as rc
from er32_tables import Published, Reading, assembly

Interval = tuple[float | None, float | None]

BOUNDS = {"joint.k_y": (1e6, 1e13), "joint.k_theta": (1e2, 1e9)}
"""Bounds of the search in N/m and N m/rad."""
JOINT = tuple(BOUNDS)
_LARGEST_STEP = 2.0
"""Largest step of Newton's method in the logarithm of a stiffness: the slopes are not valid further away."""

_STEEL = range(4)
SHARED: dict[str, tuple[str, ...]] = {
    "carbide modulus": ("tool.segment[0].youngs_modulus",),
    "carbide density": ("tool.segment[0].density",),
    "steel modulus": tuple(f"holder.segment[{i}].youngs_modulus" for i in _STEEL),
    "steel density": tuple(f"holder.segment[{i}].density" for i in _STEEL),
    "nose length": ("holder.segment[0].length",),
    "nose diameter": ("holder.segment[0].outer_diameter",),
    "nose modulus factor": ("holder.segment[0].youngs_modulus",),
    "nose density factor": ("holder.segment[0].density",),
    "body length": ("holder.segment[1].length",),
    "body diameter": ("holder.segment[1].outer_diameter",),
    "flange length": ("holder.segment[2].length",),
    "flange diameter": ("holder.segment[2].outer_diameter",),
    "taper diameter": ("holder.segment[3].outer_diameter",),
    "taper bore": ("holder.segment[3].inner_diameter",),
}
"""Quantities that all tools share, with the parameters proportional to them.

The nose stands for collet, nut and shank; its modulus and density are the steel's times a factor. The holder's length
is published, so the taper's length compensates the others.
"""
_REST = "holder.segment[3].length"


@dataclass(frozen=True)
class Resolution:
    """Step in which frequencies are printed: `fine_hz` below `change_hz`, `coarse_hz` from there on."""

    fine_hz: float = 1.0
    coarse_hz: float = 10.0
    change_hz: float = 10e3

    def __post_init__(self) -> None:
        if not (0.0 < self.fine_hz < np.inf and 0.0 < self.coarse_hz < np.inf):
            raise ValueError(f"the resolution is {self.fine_hz:g} and {self.coarse_hz:g} Hz, expected positive numbers")

    def half_step(self, frequency_hz: ArrayLike) -> NDArray[np.float64]:
        """Return the largest error of a printed frequency in Hz."""
        return np.where(np.asarray(frequency_hz) < self.change_hz, self.fine_hz, self.coarse_hz) / 2.0

    def standard_deviation(self, frequency_hz: ArrayLike) -> NDArray[np.float64]:
        """Return the standard deviation of an error that is uniform over the step, in Hz."""
        return np.asarray(self.half_step(frequency_hz) / np.sqrt(3.0))


def shared_value(name: str) -> tuple[float, str]:
    """Return the value of a shared quantity and its unit."""
    model = assembly(12.7, 62.3)
    value = model.get(SHARED[name][-1])
    if name.endswith("factor"):
        return value / model.get(SHARED["steel " + name.split()[1]][-1]), ""
    if name.endswith("modulus"):
        return value / 1e9, "GPa"
    return (value, "kg/m3") if name.endswith("density") else (1e3 * value, "mm")


def with_factors(
    model: rc.Assembly, factors: Mapping[str, float], other: Mapping[str, float] | None = None
) -> rc.Assembly:
    """Return an assembly with shared quantities multiplied by factors, and other parameters at given values."""
    values = dict(other or {})
    for name, factor in factors.items():
        for address in SHARED[name]:
            old = values.get(address, model.get(address))
            values[address] = old * factor
            if name.endswith("length"):
                values[_REST] = values.get(_REST, model.get(_REST)) + old - values[address]
    return model.replace(values)


def mode_slopes(
    model: rc.Assembly, modes: Sequence[int], names: Sequence[str] = ()
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return natural frequencies of an assembly in Hz, `(m,)`, for mode numbers from 1, and their derivatives.

    These are the relative changes of a frequency per relative change of shared quantities, `(m, n)`, and of k_y and
    k_theta, `(m, 2)`, and per mm of overhang, `(m,)`.
    """
    addresses = list(
        dict.fromkeys([*JOINT, "tool.segment[0].length", _REST, *(a for name in names for a in SHARED[name])])
    )
    rows = [mode - 1 for mode in modes]
    lowest, slopes = model.lowest_natural_frequencies(max(modes), addresses)
    frequency = lowest[rows]
    column = {address: slopes[rows, i] / frequency for i, address in enumerate(addresses)}
    shared = np.zeros((len(rows), len(names)))
    for i, name in enumerate(names):
        for address in SHARED[name]:
            slope = column[address] - column[_REST] if name.endswith("length") else column[address]
            shared[:, i] += model.get(address) * slope
    joint = np.stack([model.get(address) * column[address] for address in JOINT], axis=1)
    return frequency, shared, joint, 1e-3 * column["tool.segment[0].length"]


def follow_joint(model: rc.Assembly, frequency_hz: ArrayLike) -> NDArray[np.float64]:
    """Return the joint (k_y, k_theta) for which the first two natural frequencies have given values.

    Newton's method in logarithms from the joint of the assembly, within `BOUNDS`. A value at a bound means that no
    joint within the bounds has these frequencies.
    """
    target = np.log(np.asarray(frequency_hz, dtype=np.float64))
    low, high = np.log(np.array(list(BOUNDS.values()))).T
    x = np.log([model.get(address) for address in JOINT])
    for _ in range(60):
        joint = dict(zip(JOINT, np.exp(x).tolist(), strict=True))
        frequency, slope = model.replace(joint).lowest_natural_frequencies(2, JOINT)
        matrix = slope * np.exp(x) / frequency[:, None]
        step, *_ = np.linalg.lstsq(matrix, target - np.log(frequency), rcond=None)
        step *= min(1.0, _LARGEST_STEP / max(float(np.max(np.abs(step))), 1e-300))
        previous, x = x, np.clip(x + step, low, high)
        if np.max(np.abs(x - previous)) < 1e-10:
            break
    return np.asarray(np.exp(x))


def identify_joints(published: Published, resolution: Resolution, *, starts: int, seed: int) -> list[dict[str, Any]]:
    """Identify k_y and k_theta for every row of table 4; `percent_per_mm` is the change per mm of overhang."""
    return [_identified(published, reading, resolution, starts, seed) for reading in published.readings]


def joint_of(joints: Sequence[dict[str, Any]], diameter_mm: float, torque_nm: float) -> dict[str, Any]:
    """Return the joint of a tool at a torque."""
    return next(j for j in joints if (j["diameter_mm"], j["torque_nm"]) == (diameter_mm, torque_nm))


def _identified(
    published: Published, reading: Reading, resolution: Resolution, starts: int, seed: int
) -> dict[str, Any]:
    frequency = np.array(reading.frequency_hz)
    middle = [float(np.sqrt(low * high)) for low, high in BOUNDS.values()]
    model = assembly(reading.diameter_mm, published.mount(reading.diameter_mm).overhang_mm, *middle)
    measured = rc.Observation.from_modes(
        assembly=model,
        frequency_hz=frequency,
        standard_deviation_hz=resolution.standard_deviation(frequency),
        label=f"{reading.diameter_mm:g} mm at {reading.torque_nm:g} N m",
    )
    unknowns = [rc.Unknown(address=address, lower=low, upper=high) for address, (low, high) in BOUNDS.items()]
    fit = rc.identify(measured, unknowns, starts=starts, seed=seed)
    fitted = model.replace(fit.values)
    _, _, joint_slopes, overhang_slopes = mode_slopes(fitted, (1, 2))
    per_mm = -100.0 * np.linalg.solve(joint_slopes, overhang_slopes)
    half = resolution.half_step(frequency)
    corners = [follow_joint(fitted, frequency + half * signs) for signs in itertools.product((-1.0, 1.0), repeat=2)]
    row: dict[str, Any] = {
        "diameter_mm": reading.diameter_mm,
        "torque_nm": reading.torque_nm,
        "correlation": float(fit.correlation[0, 1]),
        "starts": starts,
        "starts_agreeing": fit.agreeing,
        "converged": fit.converged,
        "advice": list(fit.advice),
    }
    for i, (address, (low, high)) in enumerate(BOUNDS.items()):
        name, value = address.removeprefix("joint."), fit.values[address]
        lower, upper = float(np.min(corners, axis=0)[i]), float(np.max(corners, axis=0)[i])
        printed = getattr(reading, name)
        row |= {
            name: value,
            f"{name}_interval": [
                None if lower <= low * (1.0 + 1e-6) else lower,
                None if upper >= high * (1.0 - 1e-6) else upper,
            ],
            f"{name}_percent_per_mm": float(per_mm[i]),
            f"published_{name}": printed,
            f"{name}_difference_percent": 100.0 * (value / printed - 1.0),
        }
    return row


def find_trends(joints: Sequence[dict[str, Any]], torque_nm: float) -> dict[str, Any]:
    """Return trends of both stiffnesses over torque by tool, and over diameter at one torque.

    The change over torque is that of a straight line fitted to the logarithm of the stiffness at all torques. The ends
    of an interval are reached when all readings err within the resolution in the worst direction. The power law of the
    diameter also has the 95 % interval from the scatter of the tools about it.
    """
    torques = sorted({joint["torque_nm"] for joint in joints})
    over_torque, over_diameter = [], []
    for quantity in ("k_y", "k_theta"):
        for diameter in sorted({joint["diameter_mm"] for joint in joints}):
            states = sorted((j for j in joints if j["diameter_mm"] == diameter), key=lambda j: float(j["torque_nm"]))
            x = np.array([state["torque_nm"] for state in states])
            centred = x - x.mean()
            value, interval = _weighted_sum(quantity, states, centred / np.sum(centred**2) * np.ptp(x))
            over_torque.append(
                {
                    "quantity": quantity,
                    "diameter_mm": diameter,
                    "change_percent": _percent(value),
                    "interval": [_percent(end) for end in interval],
                    "exceeds": _excludes_zero(interval),
                    "steps": _steps(quantity, states, "torque_nm"),
                    "end_values": _steps(quantity, [states[0], states[-1]], "torque_nm")[0],
                }
            )
        states = sorted((j for j in joints if j["torque_nm"] == torque_nm), key=lambda j: float(j["diameter_mm"]))
        over_diameter.append(_diameter_law(quantity, torque_nm, states))
    return {"torque_range_nm": [torques[0], torques[-1]], "torque": over_torque, "diameter": over_diameter}


def _diameter_law(quantity: str, torque_nm: float, states: Sequence[dict[str, Any]]) -> dict[str, Any]:
    x = np.log([state["diameter_mm"] for state in states])
    y = np.log([state[quantity] for state in states])
    centred = x - x.mean()
    exponent, interval = _weighted_sum(quantity, states, centred / np.sum(centred**2))
    freedom = len(states) - 2
    variance = float(np.sum((y - y.mean() - exponent * centred) ** 2)) / freedom
    half_width = float(stats.t.ppf(0.975, freedom)) * float(np.sqrt(variance / np.sum(centred**2)))
    scatter = (exponent - half_width, exponent + half_width)
    return {
        "quantity": quantity,
        "torque_nm": torque_nm,
        "exponent": exponent,
        "interval": list(interval),
        "scatter_percent": 100.0 * float(np.expm1(np.sqrt(variance))),
        "scatter_interval": list(scatter),
        "exceeds": _excludes_zero(interval) and _excludes_zero(scatter),
        "steps": _steps(quantity, states, "diameter_mm"),
    }


def _steps(quantity: str, states: Sequence[dict[str, Any]], over: str) -> list[dict[str, Any]]:
    """Return the change from each state to the next in percent, with its interval."""
    steps = []
    for pair in itertools.pairwise(states):
        value, interval = _weighted_sum(quantity, pair, [-1.0, 1.0])
        steps.append(
            {
                "start": pair[0][over],
                "end": pair[1][over],
                "percent": _percent(value),
                "interval": [_percent(end) for end in interval],
                "exceeds": _excludes_zero(interval),
            }
        )
    return steps


def _weighted_sum(quantity: str, states: Sequence[dict[str, Any]], weights: ArrayLike) -> tuple[float, Interval]:
    """Return a weighted sum of logarithms, with the ends that the intervals of the states permit."""
    value = 0.0
    ends: list[float | None] = [0.0, 0.0]
    for state, weight in zip(states, np.asarray(weights).tolist(), strict=True):
        value += weight * float(np.log(state[quantity]))
        interval = state[f"{quantity}_interval"]
        for side, end in enumerate(interval if weight > 0.0 else interval[::-1]):
            total = ends[side]
            ends[side] = None if total is None or end is None else total + weight * float(np.log(end))
    return value, (ends[0], ends[1])


def _percent(logarithm: float | None) -> float | None:
    return None if logarithm is None else 100.0 * float(np.expm1(logarithm))


def _excludes_zero(interval: Interval) -> bool:
    low, high = interval
    return (low is not None and low > 0.0) or (high is not None and high < 0.0)
