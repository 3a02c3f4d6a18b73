"""The bias of the first mode of the long tools: its distribution under chance, and changes that would remove it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

import receptance as rc
from er32_joints import BOUNDS, JOINT, SHARED, Resolution, follow_joint, joint_of, mode_slopes, with_factors
from er32_tables import Published, Stiffness, assembly, rms

_LARGE = 0.3
"""Relative change beyond which the linear slopes are not used to predict table 2."""


@dataclass(frozen=True)
class ChanceModel:
    """Standard deviations that define chance.

    Readings are uniform over the step in which they are printed. Every overhang has an independent error, in the
    identifying and in the long assembly. The errors of holder and carbide are shared by all tools. The defaults for
    the carbide are the standard deviations of uniform distributions over the common ranges 550 to 630 GPa and 13 800
    to 15 000 kg/m3, for the steel over 200 to 210 GPa; the holder's shape is inferred, so 2 % for every dimension
    and 10 % for the two factors of the nose.
    """

    overhang_mm: float = 0.1
    carbide_modulus_percent: float = 3.9
    carbide_density_percent: float = 2.4
    steel_modulus_percent: float = 1.4
    steel_density_percent: float = 0.5
    holder_dimension_percent: float = 2.0
    nose_factor_percent: float = 10.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.overhang_mm < np.inf:
            raise ValueError(f"the error of an overhang is {self.overhang_mm:g} mm, expected at least 0")

    def deviation(self, name: str) -> float:
        """Return the relative standard deviation of a shared quantity."""
        owner, quantity = name.split(" ", 1)
        if owner in ("carbide", "steel"):
            return 0.01 * float(getattr(self, f"{owner}_{quantity}_percent"))
        return 0.01 * (self.nose_factor_percent if quantity.endswith("factor") else self.holder_dimension_percent)


@dataclass(frozen=True)
class Slopes:
    """Relative derivatives of the first modes of the long tools; the joint follows the identifying frequencies.

    `shared` is `(n_tools, n_shared)`; `joint` `(n_tools, 2)` for the joint of the long assembly alone; `overhang` and
    `identifying_overhang` `(n_tools,)` per mm for the long and the identifying assembly; `reading` `(n_tools, 2)` for
    the identifying frequencies.
    """

    shared: NDArray[np.float64]
    joint: NDArray[np.float64]
    overhang: NDArray[np.float64]
    identifying_overhang: NDArray[np.float64]
    reading: NDArray[np.float64]


def find_slopes(published: Published, joints: Sequence[dict[str, Any]]) -> Slopes:
    """Return the derivatives of the long tools' first modes: d ln k = J^-1 (d ln f - dependence of f on the rest)."""
    parts = []
    for long in published.long_tools:
        mount = published.mount(long.diameter_mm)
        joint = joint_of(joints, long.diameter_mm, published.torque_nm)
        stiffness = (joint["k_y"], joint["k_theta"])
        identifying = assembly(long.diameter_mm, mount.overhang_mm, *stiffness)
        _, shared, by_joint, overhang = mode_slopes(identifying, (1, 2), list(SHARED))
        transferred = assembly(long.diameter_mm, long.overhang_mm, *stiffness)
        _, shared_long, joint_long, overhang_long = mode_slopes(transferred, (1,), list(SHARED))
        follow = np.linalg.solve(by_joint.T, joint_long[0])
        parts.append((shared_long[0] - follow @ shared, joint_long[0], overhang_long[0], -follow @ overhang, follow))
    return Slopes(*(np.array(column) for column in zip(*parts, strict=True)))


def find_bias(
    published: Published,
    transfers: Sequence[dict[str, Any]],
    slopes: Slopes,
    chance: ChanceModel,
    resolution: Resolution,
    inferred: NDArray[np.float64],
) -> dict[str, Any]:
    """Return the bias of the long tools' first mode and its distribution under chance.

    `inferred` is the covariance of the logarithms of the inferred quantities: all of `SHARED` but the steel's. In the
    result, `percent` is 100 (predicted / measured - 1) by tool, and `deviations_percent` the standard deviation of the
    mean by source. P values are two-sided, for the mean and a normal distribution: with all sources, without the shared
    ones, and with the covariance of the inference in place of the tolerances of carbide and holder.
    """
    tools = published.long_tools
    rows = [
        next(r for r in transfers if (r["diameter_mm"], r["overhang_mm"], r["mode"]) == (*tool[:2], 1))
        for tool in tools
    ]
    percent = [row["error_percent"] for row in rows]
    mean = float(np.mean(percent))
    sources = {
        "reading": _reading_covariance(published, slopes, resolution),
        "overhang": np.diag(chance.overhang_mm**2 * (slopes.overhang**2 + slopes.identifying_overhang**2)),
    }
    for owner in ("carbide", "steel", "holder"):
        columns = [i for i, name in enumerate(SHARED) if _owner(name) == owner]
        scaled = slopes.shared[:, columns] * [chance.deviation(list(SHARED)[i]) for i in columns]
        sources[owner] = scaled @ scaled.T
    total = sum(sources.values(), np.zeros_like(sources["reading"]))
    separate = sources["reading"] + sources["overhang"]
    fitted = slopes.shared[:, [i for i, name in enumerate(SHARED) if _owner(name) != "steel"]]
    inference = fitted @ inferred @ fitted.T
    deviations = np.sqrt(np.diag(total))
    correlation = total / np.outer(deviations, deviations)
    count = len(tools)
    return {
        "diameter_mm": [tool.diameter_mm for tool in tools],
        "overhang_mm": [tool.overhang_mm for tool in tools],
        "percent": percent,
        "published_percent": [row["published_error_percent"] for row in rows],
        "tool_deviation_percent": (100.0 * deviations).tolist(),
        "mean_percent": mean,
        "deviations_percent": {name: _mean_deviation(matrix) for name, matrix in sources.items()},
        "mean_deviation_percent": _mean_deviation(total),
        "mean_correlation": float((correlation.sum() - count) / (count * (count - 1))),
        "p_value": _two_sided(mean, _mean_deviation(total)),
        "p_value_without_shared": _two_sided(mean, _mean_deviation(separate)),
        "p_value_with_inference": _two_sided(mean, _mean_deviation(separate + sources["steel"] + inference)),
        "inference_deviation_percent": _mean_deviation(inference),
        "sign_test_p_value": sign_test(percent),
    }


def sign_test(values: Sequence[float]) -> float:
    """Return the two-sided p value of the sign test; zeros do not count."""
    signs = np.sign([value for value in values if value != 0.0])
    return float(binomtest(int(np.sum(signs > 0.0)), signs.size).pvalue) if signs.size else 1.0


def _reading_covariance(published: Published, slopes: Slopes, resolution: Resolution) -> NDArray[np.float64]:
    variances = []
    for row, tool in zip(slopes.reading, published.long_tools, strict=True):
        identifying = np.array(published.reading(tool.diameter_mm).frequency_hz)
        errors = row * resolution.standard_deviation(identifying) / identifying
        measured = float(resolution.standard_deviation(tool.measured_hz[0])) / tool.measured_hz[0]
        variances.append(float(np.sum(errors**2)) + measured**2)
    return np.diag(variances)


def _owner(name: str) -> str:
    owner = name.split(" ", 1)[0]
    return owner if owner in ("carbide", "steel") else "holder"


def _mean_deviation(covariance: NDArray[np.float64]) -> float:
    """Return the standard deviation of the mean in percent from a relative covariance."""
    return 100.0 * float(np.sqrt(covariance.sum())) / len(covariance)


def _two_sided(value: float, deviation: float) -> float:
    return math.erfc(abs(value) / deviation / math.sqrt(2.0)) if deviation > 0.0 else 0.0


def simulate_chance(
    published: Published,
    stiffness: Stiffness,
    mean_percent: float,
    chance: ChanceModel,
    resolution: Resolution,
    *,
    draws: int,
    seed: int,
) -> dict[str, Any]:
    """Simulate the whole procedure: draw errors, identify all joints, predict the long tools.

    The true assemblies are those with the identified joints. Errors of holder, carbide, overhangs and readings enter
    the identification. `share_as_large` is the share of draws whose mean bias is at least as large as the one observed.
    """
    random = np.random.default_rng(seed)
    deviations = np.array([chance.deviation(name) for name in SHARED])
    limits = np.array(list(BOUNDS.values())).T * [[1.0 + 1e-6], [1.0 - 1e-6]]
    tools = [
        (
            assembly(long.diameter_mm, long.overhang_mm, *stiffness[long.diameter_mm]),
            np.array([published.mount(long.diameter_mm).overhang_mm, long.overhang_mm]),
            np.array(published.reading(long.diameter_mm).frequency_hz),
            long.measured_hz[0],
        )
        for long in published.long_tools
    ]
    true_hz = [float(long.lowest_natural_frequencies(1)[0][0]) for long, *_ in tools]
    at_bound, means = 0, []
    for _ in range(draws):
        factors = dict(zip(SHARED, np.exp(deviations * random.standard_normal(deviations.size)).tolist(), strict=True))
        errors = []
        for (true_long, overhangs, frequency, measured_hz), true in zip(tools, true_hz, strict=True):
            reading = frequency + resolution.half_step(frequency) * random.uniform(-1.0, 1.0, 2)
            lengths = (1e-3 * (overhangs + chance.overhang_mm * random.standard_normal(2))).tolist()
            identifying, long = (
                with_factors(true_long, factors, {"tool.segment[0].length": length}) for length in lengths
            )
            joint = follow_joint(identifying, reading)
            at_bound += bool(np.any(joint <= limits[0]) or np.any(joint >= limits[1]))
            with_joint = long.replace(dict(zip(JOINT, joint.tolist(), strict=True)))
            predicted = float(with_joint.lowest_natural_frequencies(1)[0][0])
            half = float(resolution.half_step(measured_hz))
            errors.append(100.0 * (predicted / (true + half * random.uniform(-1.0, 1.0)) - 1.0))
        means.append(float(np.mean(errors)))
    return {
        "draws": draws,
        "seed": seed,
        "deviation_percent": rms(means),
        "share_as_large": float(np.mean(np.abs(means) >= abs(mean_percent))),
        "joints_at_bound": at_bound,
    }


def rank_causes(
    published: Published, stiffness: Stiffness, percent: Sequence[float], slopes: Slopes, chance: ChanceModel
) -> list[dict[str, Any]]:
    """Return for each single cause the change that removes the mean bias, the most probable change first.

    The change is linear. It is no evidence for the cause, because one free number always removes one mean.
    `rms_percent` is the error of all of table 2 with the change, the joints identified again, None for a change beyond
    30 %; `deviations` is the change in standard deviations of the chance model, None if the model has none.
    """
    offset = float(np.mean(np.log1p(0.01 * np.array(percent))))
    lengths = {t.diameter_mm: t.overhang_mm for t in published.long_tools}
    causes = []

    def add(name: str, change: float, unit: str, deviations: float | None, after: float | None) -> None:
        causes.append({"name": name, "change": change, "unit": unit, "deviations": deviations, "rms_percent": after})

    for name, slope in zip(SHARED, slopes.shared.mean(axis=0).tolist(), strict=True):
        change = -offset / slope if slope else np.inf
        after = _rms_with(published, stiffness, {name: 1.0 + change}) if abs(change) <= _LARGE else None
        add(name, 100.0 * change, "%", abs(change) / chance.deviation(name), after)
    for index, quantity in enumerate(("k_y", "k_theta")):
        change = -offset / float(slopes.joint[:, index].mean())
        moved = {d: [k * (1.0 + change * (i == index)) for i, k in enumerate(ks)] for d, ks in stiffness.items()}
        after = _rms_of_long(published, stiffness, moved, lengths) if abs(change) <= _LARGE else None
        add(f"{quantity} of every long clamping", 100.0 * change, "%", None, after)
    shift = -offset / float(slopes.overhang.mean())
    # The shift is the same for all tools, so it is compared with the standard deviation of their mean.
    deviations = abs(shift) / chance.overhang_mm * len(lengths) ** 0.5 if chance.overhang_mm else None
    longer = {d: length + shift for d, length in lengths.items()}
    add("overhang of every long tool", shift, "mm", deviations, _rms_of_long(published, stiffness, stiffness, longer))
    return sorted(causes, key=lambda c: (c["deviations"] is None, c["deviations"] or 0.0, abs(c["change"])))


def _rms_with(published: Published, stiffness: Stiffness, factors: Mapping[str, float]) -> float:
    """Return the error of table 2 with shared quantities changed and the joints identified again."""
    errors: list[float] = []
    for transfer in published.transfers:
        diameter = transfer.diameter_mm
        identifying = assembly(diameter, published.mount(diameter).overhang_mm, *stiffness[diameter])
        joint = follow_joint(with_factors(identifying, factors), published.reading(diameter).frequency_hz)
        errors += _errors(with_factors(assembly(diameter, transfer.overhang_mm, *joint), factors), transfer.measured_hz)
    return rms(errors)


def _rms_of_long(
    published: Published, stiffness: Stiffness, long_stiffness: Stiffness, long_overhang: Mapping[float, float]
) -> float:
    """Return the error of table 2 with another joint or overhang of the long assemblies alone."""
    errors: list[float] = []
    for transfer in published.transfers:
        diameter, overhang, joint = transfer.diameter_mm, transfer.overhang_mm, stiffness[transfer.diameter_mm]
        if transfer in published.long_tools:
            overhang, joint = long_overhang[diameter], long_stiffness[diameter]
        errors += _errors(assembly(diameter, overhang, *joint), transfer.measured_hz)
    return rms(errors)


def _errors(model: rc.Assembly, measured_hz: Sequence[float]) -> list[float]:
    """Return the errors of the lowest natural frequencies in percent."""
    predicted = model.lowest_natural_frequencies(len(measured_hz))[0]
    return list(100.0 * (predicted / np.array(measured_hz) - 1.0))
