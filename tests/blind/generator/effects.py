"""Hidden effects: those of the catalogue, effects outside it, and how large they are drawn.

An effect changes the numbers of the truth. An oracle fits its sizes; `fixed` describes how it acts.
`u` runs from 0, barely visible, to 1, large.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Where:
    """Where in a campaign numbers hold."""

    configuration: str
    overhang: float
    level: float
    plane: int = 1
    reference_overhang: float = 0.09
    reference_level: float = 100.0
    torque: float = 1.0
    reference_torque: float = 1.0


Numbers = dict[str, float]
Act = Callable[[Numbers, Mapping[str, float], Mapping[str, float], Where], None]


@dataclass(frozen=True)
class Effect:
    """One hidden effect: its sizes, in which way it acts, and whether in one configuration only."""

    id: str
    sizes: Mapping[str, float]
    fixed: Mapping[str, float] = field(default_factory=dict)
    believed: Mapping[str, float] = field(default_factory=dict)
    """Numbers that the engineer believes where this effect is studied: a rigid body, flutes."""
    configuration: str | None = None
    u: float = 0.0

    def apply(self, p: Numbers, where: Where, sizes: Mapping[str, float] | None = None) -> Numbers:
        """Return numbers that have the effect, with other sizes where given."""
        if self.configuration not in (None, where.configuration):
            return p
        changed = dict(p)
        ACTS[self.id](changed, self.sizes if sizes is None else sizes, self.fixed, where)
        return changed


def _between(u: float, low: float, high: float) -> float:
    return float(low * (high / low) ** u)


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


# How each effect changes the numbers.


def _cross(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    p["joint.k_ytheta"] += s["ratio"] * np.sqrt(p["joint.k_y"] * p["joint.k_theta"])
    p["joint.c_ytheta"] += f["damping"] * s["ratio"] * np.sqrt(p["joint.c_y"] * p["joint.c_theta"])


def _spread(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    p["spread.length"] = s["length"]
    p["spread.points"] = f["points"]
    p["spread.slope"] = f["slope"]
    if f["loose"]:
        p["spread.length"] = p["holder.0.length"]
        p["spread.loose"] = 1.0


def _law(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], ratio: float) -> None:
    for name in ("k_y", "k_theta", "c_y", "c_theta"):
        if f[name]:
            p[f"joint.{name}"] *= ratio ** (f[name] * s["exponent"])


def _amplitude(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    _law(p, s, f, w.level / w.reference_level)


def _clamping_law(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    _law(p, s, f, w.torque / w.reference_torque if f["torque"] else w.overhang / w.reference_overhang)


def _planes(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    _law(p, s, f, float(w.plane))


def _collet(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    p |= {"collet.mass": max(s["mass"], 1e-7), "collet.radius": f["radius"], "collet.split": f["split"]}


def _flutes(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    p.setdefault("flute.ratio", 1.0)
    p.setdefault("flute.length", f["length"])
    p["flute.ratio"] *= 1.0 + s["share"]


def _poisson(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    for kind in ("tool", "holder"):
        p[f"{kind}.poisson"] += s["poisson"]


def _material(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    p["tool.modulus"] *= np.exp(s["modulus"])
    p["tool.density"] *= np.exp(s["density"])
    p["tool.poisson"] += f["poisson"]


def _times(*names: str) -> Act:
    def act(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
        for name in names:
            p[name] *= 1.0 + s["share"]

    return act


def _plus(**names: str) -> Act:
    """Return an act that adds sizes to numbers; dots are written as two underscores."""

    def act(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
        for number, size in names.items():
            name = number.replace("__", ".")
            p[name] = p.get(name, 0.0) + s[size]

    return act


def _set(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    p |= {**f, **s}


def _section(p: Numbers, s: Mapping[str, float], f: Mapping[str, float], w: Where) -> None:
    p[f"holder.{int(f['section'])}.outer"] *= 1.0 + s["share"]


ACTS: dict[str, Act] = {
    "joint_cross_term": _cross,
    "joint_spread": _spread,
    "joint_hysteretic_loss": _plus(joint__loss="loss"),
    "joint_amplitude": _amplitude,
    "joint_overhang_law": _clamping_law,
    "xy_asymmetry": _planes,
    "collet_mass": _collet,
    "fluted_part": _flutes,
    "tool_modulus": _times("tool.modulus"),
    "tool_density": _times("tool.density"),
    "overhang_error": _plus(tool__overhang="length"),
    "holder_inertia": _times("holder.density"),
    "holder_modulus": _times("holder.modulus"),
    "flexible_body": _plus(holder__stiffer="decades"),
    "missing_mode": _set,
    "shear_neglected": _poisson,
    "tool_material": _material,
    "sensor_mass": _plus(sensor__mass="mass"),
    "hammer_offset": _plus(hit__offset="distance"),
    "time_delay": _plus(delay="delay"),
    "calibration_gain": _plus(gain="gain"),
    "exponential_window": _plus(window="rate"),
    "suspension": _set,
    "wrong_quantity": _set,
    "coarse_resolution": _set,
    "tip_absorber": _set,
    "wrong_section": _section,
    "ground_spring": _set,
    "cracked_tool": _set,
    "tapered_tool": _plus(tool__taper="taper"),
    "sensor_mounting": _set,
    "mass_on_shank": _set,
    "ring_on_nose": _set,
    "second_joint": _set,
}

CATALOGUE = tuple(ACTS)[:25]
OUTSIDE = tuple(ACTS)[25:]
MEASUREMENT = CATALOGUE[17:]
"""Catalogue's effects of the measurement; the others are of the structure."""


def null_of(id: str, sizes: Mapping[str, float]) -> dict[str, float]:
    """Return sizes at which an effect is negligible, as starts of fits."""
    nowhere = {"fixture.mass": 1e-4, "rope.k": 1.0}
    if id == "joint_spread":
        return {"length": 2e-3}
    if id == "missing_mode":
        return {**sizes, "fixture.mass": nowhere["fixture.mass"]}
    return {name: nowhere.get(name, 0.0) for name in sizes}


def draw_effect(rng: np.random.Generator, id: str, u: float, p: Mapping[str, float]) -> Effect:
    """Return an effect of a size, acting on a structure with these numbers."""
    sizes, fixed, believed = _DRAWS[id](rng, u, p)
    return Effect(id, sizes, fixed, believed, u=u)


Drawn = tuple[dict[str, float], dict[str, float], dict[str, float]]
_Draw = Callable[[np.random.Generator, float, Mapping[str, float]], Drawn]


def _share(low: float, high: float, name: str = "share") -> _Draw:
    return lambda rng, u, p: ({name: _sign(rng) * _between(u, low, high)}, {}, {})


def _one_way(low: float, high: float, name: str) -> _Draw:
    return lambda rng, u, p: ({name: _between(u, low, high)}, {}, {})


def _draw_cross(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {"ratio": _sign(rng) * _between(u, 0.01, 0.5)}, {"damping": float(rng.integers(2))}, {}


def _draw_spread(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    loose = float(rng.random() < 0.5)
    length = p["holder.0.length"] if loose else _between(u, 0.006, 0.9 * p["holder.0.length"])
    fixed = {
        "points": float(rng.choice([2, 4, 24])),
        "slope": float(rng.choice([0.0, 0.0, -0.6])),
        "loose": loose,
    }
    return {"length": length}, fixed, {}


def _draw_law(low: float, high: float) -> _Draw:
    def draw(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
        which = int(rng.integers(3))
        fixed = {"k_y": float(which != 0), "k_theta": float(which != 1)}
        fixed["c_y"], fixed["c_theta"] = (-fixed["k_y"], -fixed["k_theta"]) if rng.random() < 0.5 else (0.0, 0.0)
        return {"exponent": _sign(rng) * _between(u, low, high)}, fixed, {}

    return draw


def _draw_clamping_law(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    sizes, fixed, _ = _draw_law(0.02, 0.8)(rng, u, p)
    # By the torque of the clamping nut, where torques were noted, about as often as by the overhang.
    return sizes, fixed | {"torque": float(p.get("torques", 0.0) and rng.random() < 0.5)}, {}


def _draw_collet(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    fixed = {"radius": rng.uniform(0.4, 0.8) * p["tool.diameter"], "split": rng.uniform(0.3, 0.7)}
    return {"mass": _between(u, 0.002, 0.08)}, fixed, {}


def _draw_flutes(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    length = rng.uniform(0.018, 0.035)
    if rng.random() < 0.5:
        believed = {"flute.length": length, "flute.ratio": rng.uniform(0.82, 0.92)}
        return {"share": _sign(rng) * _between(u, 0.003, 0.06)}, {"length": length}, believed
    return {"share": -_between(u, 0.003, 0.15)}, {"length": length}, {}


def _draw_flexible(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {"decades": -3.0 + _between(1.0 - u, 0.01, 1.6)}, {}, {"holder.stiffer": 3.0}


def _draw_mode(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    hz = float(np.exp(rng.uniform(np.log(400.0), np.log(5000.0))))
    return {"fixture.mass": _between(u, 2e-4, 0.5), "fixture.hz": hz, "fixture.zeta": rng.uniform(0.005, 0.03)}, {}, {}


def _draw_shear(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    size = _between(u, 0.03, 1.1)
    return {"poisson": size}, {}, {f"{kind}.poisson": p[f"{kind}.poisson"] - size for kind in ("tool", "holder")}


def _draw_material(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    # A carbide tool modelled as steel, or heavy alloy; this effect has no small size.
    believed = [(210e9, 7850.0, 0.3), (360e9, 17600.0, 0.28)][int(rng.integers(2))]
    sizes = {
        name: float(np.log(p[f"tool.{name}"] / value))
        for name, value in zip(("modulus", "density"), believed, strict=False)
    }
    names = ("tool.modulus", "tool.density", "tool.poisson")
    return sizes, {"poisson": p["tool.poisson"] - believed[2]}, dict(zip(names, believed, strict=True))


def _draw_rope(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    fixed = {"rope.zeta": rng.uniform(0.01, 0.05), "rope.place": rng.uniform(0.2, 1.0)}
    return {"rope.k": 1.5 * (2.0 * np.pi * _between(u, 15.0, 110.0)) ** 2}, fixed, {}


def _draw_quantity(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {}, {"quantity": float(rng.choice([1.0, 1.0, 2.0, -1.0]))}, {}


def _draw_record(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    # A whole even number of samples, as an analyser takes.
    return {}, {"record": 2.0 * round(12800.0 / _between(u, 4.0, 24.0)) / 25600.0}, {}


def _draw_absorber(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    hz = float(np.exp(rng.uniform(np.log(600.0), np.log(4000.0))))
    return (
        {"absorber.mass": _between(u, 2e-5, 0.015), "absorber.hz": hz},
        {"absorber.zeta": rng.uniform(0.01, 0.05)},
        {},
    )


def _draw_section(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {"share": _sign(rng) * _between(u, 0.01, 0.12)}, {"section": float(rng.integers(3))}, {}


def _draw_ground(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    k = _between(u, 2e6, 2e8)
    return {"ground.k": k}, {"ground.c": 1e-5 * k, "ground.place": rng.uniform(0.3, 0.8)}, {}


def _draw_crack(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {"crack.k": _between(1.0 - u, 2e4, 3e6)}, {"crack.place": rng.uniform(0.3, 0.7)}, {}


def _draw_mounting(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {"mount.hz": _between(1.0 - u, 9000.0, 40000.0)}, {"mount.zeta": 0.03}, {}


def _draw_screw(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {"screw.k": _between(1.0 - u, 3e5, 5e7)}, {"screw.section": float(rng.integers(1, 3))}, {}


def _draw_middle(rng: np.random.Generator, u: float, p: Mapping[str, float]) -> Drawn:
    return {"middle.mass": _between(u, 1e-3, 0.02)}, {"middle.place": rng.uniform(0.3, 0.7)}, {}


_DRAWS: dict[str, _Draw] = {
    "joint_cross_term": _draw_cross,
    "joint_spread": _draw_spread,
    "joint_hysteretic_loss": _one_way(0.002, 0.08, "loss"),
    "joint_amplitude": _draw_law(0.004, 0.25),
    "joint_overhang_law": _draw_clamping_law,
    "xy_asymmetry": _draw_law(0.01, 0.4),
    "collet_mass": _draw_collet,
    "fluted_part": _draw_flutes,
    "tool_modulus": _share(0.006, 0.08),
    "tool_density": _share(0.004, 0.06),
    "overhang_error": _share(1e-4, 1.5e-3, "length"),
    "holder_inertia": _share(0.006, 0.1),
    "holder_modulus": _share(0.008, 0.1),
    "flexible_body": _draw_flexible,
    "missing_mode": _draw_mode,
    "shear_neglected": _draw_shear,
    "tool_material": _draw_material,
    "sensor_mass": _one_way(1e-4, 5e-3, "mass"),
    "hammer_offset": _one_way(2e-4, 6e-3, "distance"),
    "time_delay": lambda rng, u, p: ({"delay": _sign(rng) * _between(u, 3e-7, 2e-5)}, {}, {}),
    "calibration_gain": _share(0.004, 0.1, "gain"),
    "exponential_window": _one_way(0.5, 40.0, "rate"),
    "suspension": _draw_rope,
    "wrong_quantity": _draw_quantity,
    "coarse_resolution": _draw_record,
    "tip_absorber": _draw_absorber,
    "wrong_section": _draw_section,
    "ground_spring": _draw_ground,
    "cracked_tool": _draw_crack,
    "tapered_tool": _share(0.005, 0.08, "taper"),
    "sensor_mounting": _draw_mounting,
    "mass_on_shank": _draw_middle,
    "ring_on_nose": _one_way(0.01, 0.3, "nose.ring"),
    "second_joint": _draw_screw,
}
