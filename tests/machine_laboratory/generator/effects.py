"""Hidden effects of a machine: what the campaign describes otherwise, and how it changes the records.

The name of an effect is that of the cause which is the right answer. `u` runs from 0, barely visible, to 1, large.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from blind.generator.elements import ComplexArray

from .structure import Numbers, Place, receptances, section_count

TURNED = math.radians(20.0)
"""Angle between sensor and hit where the hits are off."""


@dataclass(frozen=True)
class Effect:
    """One hidden effect and its size, in SI units or as a share."""

    id: str
    size: float
    fixed: Mapping[str, float] = field(default_factory=dict)
    u: float = 0.0


_SIZES: dict[str, tuple[float, float, bool]] = {
    "sensor_mass": (2e-4, 6e-3, False),
    "hammer_offset": (5e-4, 6e-3, False),
    "calibration_gain": (0.006, 0.1, True),
    "time_delay": (1e-6, 3e-5, True),
    "exponential_window": (1.0, 40.0, False),
    "wrong_quantity": (1.0, 1.0, False),
    "reversed_polarity": (1.0, 1.0, False),
    "overhang_error": (2e-4, 2e-3, True),
    "tool_modulus": (0.01, 0.1, True),
    "tool_density": (0.006, 0.08, True),
    "fluted_part": (0.005, 0.15, False),
    "frequency_scale": (3e-4, 6e-3, True),
    "joint_overhang_law": (0.1, 1.5, True),
    "spindle_mode": (0.03, 0.3, False),
    "xy_asymmetry": (0.05, 0.5, True),
    "flange_absorber": (0.02, 0.6, False),
    "body_diameter": (0.01, 0.12, True),
}
"""Smallest and largest size of each effect, and whether it has a sign."""
EFFECTS = tuple(_SIZES)
FOREIGN = ("flange_absorber", "body_diameter")
"""Effects that no cause of the program describes."""


def draw_effect(rng: np.random.Generator, id: str, u: float | None = None) -> Effect:
    """Return an effect of a size that is drawn where it is not given."""
    size = float(rng.uniform()) if u is None else u
    low, high, signed = _SIZES[id]
    sign = float(rng.choice([-1.0, 1.0])) if signed else 1.0
    fixed = {
        "number": float(rng.integers(2)),
        "at_nose": float(rng.integers(2)),
        "quantity": float(rng.choice([1.0, 2.0])),
        "exponent_y": float(rng.integers(2)),
        "axis": float(rng.uniform(0.0, 0.5 * math.pi)),
        "length": float(rng.uniform(0.018, 0.03)),
        "hz": float(np.exp(rng.uniform(np.log(400.0), np.log(3000.0)))),
        "zeta": float(rng.uniform(0.01, 0.05)),
    }
    return Effect(id, sign * low * (high / low) ** size, fixed, size)


def changed(p: Numbers, effect: Effect, number: int) -> dict[str, float]:
    """Return the numbers of an overhang with an effect of the structure; others leave them as they are."""
    q = dict(p)
    size, fixed = effect.size, effect.fixed
    match effect.id:
        case "sensor_mass":
            q["sensor.mass"] += size
        case "overhang_error" if number == fixed["number"]:
            q["overhang"] += size
        case "tool_modulus" | "tool_density":
            q[effect.id.replace("_", ".")] *= 1.0 + size
        case "fluted_part":
            q |= {"flute.length": fixed["length"], "flute.area": (1.0 - size) ** 2, "flute.second": (1.0 - size) ** 4}
        case "joint_overhang_law" if number == 1:
            # The longer tool; the ratio of the overhangs is about 1.3.
            factor = 1.3**size
            for name in ("k_theta", *(["k_y"] if fixed["exponent_y"] else [])):
                q[f"joint.{name}"] *= factor
        case "spindle_mode" if number == 1:
            q["front.k_y"] *= 1.0 - size
        case "flange_absorber":
            q |= {"absorber.mass": size, "absorber.hz": fixed["hz"], "absorber.zeta": fixed["zeta"]}
        case "body_diameter":
            for end in ("small", "large"):
                q[f"holder.{section_count(p) - 2}.{end}"] *= 1.0 + size
    return q


def recorded(
    p: Numbers, effect: Effect | None, number: int, response: Place, hits: Sequence[Place], lines: NDArray[np.float64]
) -> ComplexArray:
    """Return the receptances `(n, hits)` that a measurement without noise reports, with an effect if there is one."""
    if effect is None:
        return receptances(p, response, hits, lines)
    q = changed(p, effect, number)
    size, fixed = effect.size, effect.fixed
    s = 2j * np.pi * lines
    seen = s
    match effect.id:
        case "hammer_offset":
            hits = [("tool", size) if hit == ("tool", 0.0) else hit for hit in hits]
        case "exponential_window":
            seen = s + size
        case "frequency_scale":
            seen = s * (1.0 + size)
    # Both channels see the window, and the analyser divides the acceleration by the stated lines.
    values = receptances(q, response, hits, seen / 2j / np.pi)
    match effect.id:
        case "exponential_window":
            values = values * ((seen / s) ** 2)[:, None]
        case "calibration_gain":
            values = values * (1.0 + size)
        case "time_delay":
            values = values * np.exp(-s * size)[:, None]
        case "wrong_quantity":
            values = values * (s ** fixed["quantity"])[:, None]
        case "reversed_polarity" if fixed["at_nose"] == (response[0] == "holder"):
            values = -values
        case "xy_asymmetry":
            # The axes of the spindle are turned against the sensor, and the hits against it.
            across = receptances(_other_axis(q, size), response, hits, lines)
            sensor, hit = fixed["axis"], fixed["axis"] + TURNED
            values = math.cos(sensor) * math.cos(hit) * values + math.sin(sensor) * math.sin(hit) * across
    return values


def _other_axis(p: Numbers, size: float) -> dict[str, float]:
    """Return the numbers across the measured axis, in which bearings and housing are stiffer or softer."""
    stiff = {name: p[name] * math.exp(size) for name in p if name.startswith(("front.k_", "housing.k_"))}
    return {**p, **stiff, "rear.k_y": p["rear.k_y"] * math.exp(0.5 * size)}
