"""A random machine: what is written down of it, its records, and apart from them the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foreign_beam import measured

from .effects import Effect, draw_effect, recorded
from .lobes import Cut
from .structure import Numbers, Place, section_count

HITS_REPEAT, FLOOR = 0.01, 0.005
"""Scatter of one hit relative to the FRF and to its median, and errors other than noise, both of which are stated."""
STEP_HZ = 4.0
SECTION = ("length", "small", "large", "inner", "core")
"""Numbers of a section of the holder: a cone, or a cylinder where both diameters are the same."""


@dataclass(frozen=True, kw_only=True)
class Record:
    """One FRF in m/N."""

    name: str
    overhang: int
    response: Place
    hit: Place
    frequency_hz: NDArray[np.float64]
    receptance: NDArray[np.complex128]
    coherence: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Machine:
    """What is written down of a machine, and its records."""

    seed: int
    numbers: Mapping[str, float]
    """As on drawings and data sheets; without joint and spindle."""
    deviations: Mapping[str, float]
    """Standard deviations of these numbers in their units."""
    overhangs: tuple[float, ...]
    """The first two are measured."""
    overhang_deviation: float
    records: tuple[Record, ...]
    truth: tuple[Numbers, ...]
    """True numbers of each overhang; for scoring alone."""
    cuts: tuple[tuple[int, Cut], ...] = ()
    """Milling cuts, each with the number of the overhang of its tool."""
    effect: Effect | None = None
    """What is hidden; for scoring alone. The numbers of `truth` are without it."""


def draw_machine(seed: int, effect: str | None = None, *, u: float | None = None, end_mill: bool = False) -> Machine:
    """Return a random machine with twelve records.

    By default its tool is a blank, and the description is right within its deviations. An end mill is described as
    users do, with flutes as a cylinder of 80 % of the diameter and the cone of the holder as two cylinders; it has a
    third overhang, which is not measured, and cuts. The hidden effect is one of `EFFECTS`, of a size `u` from 0 to 1
    that is drawn by default; all else is the same as without it.
    """
    rng = np.random.default_rng([seed, 37])
    stated = _stated(rng)
    diameter = stated["tool.diameter"]
    overhangs = tuple(round(float(x) * diameter, 4) for x in (rng.uniform(3.5, 4.3), rng.uniform(4.8, 5.6)))
    described, cuts = stated, ()
    if end_mill:
        mill = np.random.default_rng([seed, 38])
        stated = {**stated, **_flutes(mill, diameter)}
        described = _as_users(stated)
        overhangs = (*overhangs, round(float(mill.uniform(*overhangs)), 4))
        cuts = tuple((number, _cut(mill)) for number in (int(mill.integers(2)), 2))
    deviations = _deviations(stated)
    hidden = {**_joint(rng, diameter), **_spindle(rng)}
    common = {**stated, **hidden}
    for name, deviation in deviations.items():
        common = true_deviation(common, name, deviation * float(rng.standard_normal()))
    error = 5e-5
    truth = tuple({**common, "overhang": x + error * float(rng.standard_normal())} for x in overhangs)
    lines = STEP_HZ * np.arange(
        round(rng.uniform(100.0, 140.0) / STEP_HZ), round(rng.uniform(3600.0, 4000.0) / STEP_HZ)
    )
    length = sum(stated[f"holder.{i}.length"] for i in range(section_count(stated)))
    nose, body = 0.004, round(float(rng.uniform(0.45, 0.6)) * length, 4)
    hidden_effect = None if effect is None else draw_effect(np.random.default_rng([seed, 39]), effect, u)
    records = []
    for number, p in enumerate(truth[:2]):
        tip, middle = ("tool", 0.0), ("tool", round(0.5 * overhangs[number], 4))
        places = {"tip": tip, "mid": middle, "nose": ("holder", nose), "body": ("holder", body)}
        for seen, hits in (("tip", ("tip", "mid", "nose", "body")), ("nose", ("tip", "nose"))):
            exact = recorded(p, hidden_effect, number, places[seen], [places[hit] for hit in hits], lines)
            for column, hit in enumerate(hits):
                values, coherence = _hit(rng, exact[:, column])
                records.append(
                    Record(
                        name=f"o{number}_{seen}_{hit}",
                        overhang=number,
                        response=places[seen],
                        hit=places[hit],
                        frequency_hz=lines,
                        receptance=values,
                        coherence=coherence,
                    )
                )
    return Machine(
        seed=seed,
        numbers=described,
        deviations=_deviations(described),
        overhangs=overhangs,
        overhang_deviation=error,
        records=tuple(records),
        truth=truth,
        cuts=cuts,
        effect=hidden_effect,
    )


def _hit(rng: np.random.Generator, exact: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return an FRF and its coherence from ten hits; the floor is the same in all of them."""
    errors = FLOOR * (rng.standard_normal(exact.size) + 1j * rng.standard_normal(exact.size))
    there = exact * np.exp(errors)
    return measured(there, rng, HITS_REPEAT, HITS_REPEAT * float(np.median(np.abs(there))))


def _stated(rng: np.random.Generator) -> dict[str, float]:
    """Return tool, holder, sensor and materials as they are written down."""
    diameter = float(rng.choice([0.012, 0.016, 0.020]))
    p = {
        "tool.diameter": diameter,
        "tool.modulus": round(rng.uniform(560.0, 620.0), 0) * 1e9,
        "tool.density": round(rng.uniform(14000.0, 14800.0), -1),
        "tool.poisson": 0.22,
        "tool.loss": 0.0015,
        "holder.modulus": round(rng.uniform(203.0, 211.0), 0) * 1e9,
        "holder.density": round(rng.uniform(7780.0, 7880.0), -1),
        "holder.poisson": 0.29,
        "holder.loss": 0.0015,
        "sensor.mass": round(rng.uniform(0.5e-3, 1.5e-3), 4),
    }
    steps = 8
    cone = round(rng.uniform(0.036, 0.048), 3) / steps
    small, large = diameter + round(rng.uniform(0.011, 0.016), 3), round(rng.uniform(0.044, 0.052), 3)
    slope = (large - small) / steps
    for i in range(steps):
        p |= {
            f"holder.{i}.length": cone,
            f"holder.{i}.small": small + slope * i,
            f"holder.{i}.large": small + slope * (i + 1),
        }
        p |= {f"holder.{i}.inner": diameter, f"holder.{i}.core": 1.0}
    body, flange = round(rng.uniform(0.03, 0.045), 4), round(rng.uniform(0.024, 0.032), 4)
    for i, length, outer, inner in ((steps, body, large, 0.012), (steps + 1, flange, 0.063, 0.02)):
        p |= {f"holder.{i}.length": length, f"holder.{i}.small": outer, f"holder.{i}.large": outer}
        p |= {f"holder.{i}.inner": inner, f"holder.{i}.core": 0.0}
    return p


def _flutes(rng: np.random.Generator, diameter: float) -> dict[str, float]:
    """Return flutes, whose area and second moment are relative to those of the shank."""
    area = float(rng.uniform(0.54, 0.66))
    # No section has less than the square of its area.
    second = area**2 * float(rng.uniform(1.05, 1.35))
    return {
        "flute.length": round(float(rng.uniform(1.4, 2.4)) * diameter, 3),
        "flute.area": area,
        "flute.second": second,
    }


def _as_users(p: Mapping[str, float]) -> dict[str, float]:
    """Return the description of an end mill in its holder as users write it."""
    found = {name: value for name, value in p.items() if not name.startswith(("holder.", "flute."))}
    found |= {name: p[name] for name in p if name.startswith("holder.") and name.count(".") == 1}
    found |= {"flute.length": p["flute.length"], "flute.diameter": 0.8 * p["tool.diameter"]}
    sections = [{key: p[f"holder.{i}.{key}"] for key in SECTION} for i in range(section_count(p))]
    pieces = [section for section in sections if section["core"]]
    small, large = pieces[0]["small"], pieces[-1]["large"]
    length = sum(piece["length"] for piece in pieces)
    halves = [
        {**pieces[0], "length": 0.5 * length, "small": d, "large": d}
        for d in (0.75 * small + 0.25 * large, 0.25 * small + 0.75 * large)
    ]
    for i, section in enumerate([*halves, *sections[len(pieces) :]]):
        found |= {f"holder.{i}.{key}": value for key, value in section.items()}
    return found


def _cut(rng: np.random.Generator) -> Cut:
    k_t = 1e6 * float(rng.choice([700.0, 900.0, 1500.0, 2000.0]))
    return Cut(
        teeth=int(rng.integers(2, 5)),
        k_t=k_t,
        k_n=k_t * round(float(rng.uniform(0.2, 0.4)), 2),
        immersion=float(rng.choice([0.25, 0.5, 1.0])),
        feed=str(rng.choice(["down", "up"])),
    )


def _deviations(p: Mapping[str, float]) -> dict[str, float]:
    """Return the standard deviations of dimensions and materials that are stated with them."""
    found = {"tool.diameter": 5e-6}
    if "flute.length" in p:
        found["flute.length"] = 5e-4
    if "flute.diameter" in p:
        found["flute.diameter"] = 0.01 * p["flute.diameter"]
    for kind in ("tool", "holder"):
        found |= {f"{kind}.modulus": 0.005 * p[f"{kind}.modulus"], f"{kind}.density": 0.003 * p[f"{kind}.density"]}
    for i in range(section_count(p)):
        name = f"holder.{i}"
        # The outer diameter of a piece of a cone is its mean one.
        found |= {f"{name}.length": 1e-4, f"{name}.large": 5e-4 * (p[f"{name}.small"] + p[f"{name}.large"])}
        if not p[f"{name}.core"]:
            found[f"{name}.inner"] = 0.003 * p[f"{name}.inner"]
    return found


def true_deviation(p: Numbers, name: str, by: float) -> dict[str, float]:
    """Return numbers of which one deviates; both ends of a section do so by as much."""
    both = name.endswith(".large")
    return {**p, **{key: p[key] + by for key in (name, *([name.replace("large", "small")] if both else []))}}


def _joint(rng: np.random.Generator, diameter: float) -> dict[str, float]:
    """Return the joint of tool and holder."""
    share = float(np.interp(diameter, [0.012, 0.020], [0.0, 0.4]))
    k_y, k_theta = 10.0 ** rng.uniform(7.6, 8.9), 10.0 ** (4.0 + share + rng.uniform(0.0, 1.3 - share))
    at = 2.0 * np.pi * 1500.0
    c_y, c_theta = (k * 10.0 ** rng.uniform(-1.8, -1.1) / at for k in (k_y, k_theta))
    return {"joint.k_y": k_y, "joint.k_theta": k_theta, "joint.c_y": c_y, "joint.c_theta": c_theta}


def _spindle(rng: np.random.Generator) -> dict[str, float]:
    """Return taper, shaft, bearings and housing."""
    u = rng.uniform
    p = {
        "spindle.modulus": 210e9,
        "spindle.density": 7850.0,
        "spindle.poisson": 0.3,
        "spindle.loss": 0.003,
        "taper.k_y": 10.0 ** u(9.0, 9.5),
        "taper.k_theta": 10.0 ** u(6.0, 6.5),
        "shaft.bore": 0.03,
    }
    for i, (length, outer) in enumerate(((u(0.04, 0.07), 0.09), (u(0.18, 0.3), u(0.065, 0.08)), (u(0.05, 0.08), 0.06))):
        p |= {f"shaft.{i}.length": length, f"shaft.{i}.outer": outer}
    for name in ("front", "rear"):
        k = 10.0 ** u(np.log10(2e7), np.log10(5e8))
        p |= {f"{name}.k_y": k, f"{name}.k_theta": 10.0 ** u(4.5, 5.3)}
        p |= {f"{name}.c_y": k * u(0.03, 0.1) / (2.0 * np.pi * 1500.0), f"{name}.c_theta": u(2.0, 8.0)}
    for name in ("k_y", "k_theta"):
        p[name.replace("k_", "taper.c_")] = u(0.02, 0.04) * p[f"taper.{name}"] / (2.0 * np.pi * 2000.0)
    mass = u(30.0, 90.0)
    inertia = mass * u(0.08, 0.15) ** 2
    p |= {"housing.mass": mass, "housing.inertia": inertia}
    for name, of, low, high in (("y", mass, 90.0, 260.0), ("theta", inertia, 200.0, 500.0)):
        w = 2.0 * np.pi * u(low, high)
        p |= {f"housing.k_{name}": of * w**2, f"housing.c_{name}": 2.0 * u(0.02, 0.06) * w * of}
    return {name: float(value) for name, value in p.items()}
