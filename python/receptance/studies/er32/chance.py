"""Chance by simulation of the whole procedure, and what each single cause would have to be to remove the bias."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from receptance.studies.er32.bias import ChanceModel, LongToolBias, Propagation
from receptance.studies.er32.holder import HolderModel
from receptance.studies.er32.joints import BOUNDS, IdentifiedJoint, Resolution, follow_joint, joint_of
from receptance.studies.er32.tables import Published
from receptance.studies.er32.transfer import Stiffness, predict_transfers, rms

__all__ = ["Cause", "Simulation", "rank_causes", "simulate_chance"]


@dataclass(frozen=True)
class Simulation:
    """Mean bias of the long tools' first mode under chance alone, from the whole procedure done again and again.

    `share_as_large` is the share of draws whose mean is at least as far from zero as the one observed;
    `joints_at_bound` counts identified joints that ended at a bound of the search.
    """

    draws: int
    seed: int
    deviation_percent: float
    share_as_large: float
    joints_at_bound: int


@dataclass(frozen=True)
class Cause:
    """A single cause and the change that would bring the mean bias of the long tools to zero.

    The change is linear; `rms_percent` is over all measured modes of table 2 with the joint identified anew and the
    change in place, None where the change is too large for that. `deviations` is the change in standard deviations
    of the stated model, None where the model states none.
    """

    name: str
    change: float
    unit: str
    deviations: float | None
    rms_percent: float | None


def simulate_chance(
    model: HolderModel,
    published: Published,
    joints: Sequence[IdentifiedJoint],
    bias: LongToolBias,
    chance: ChanceModel,
    resolution: Resolution,
    *,
    torque_nm: float,
    draws: int,
    seed: int,
) -> Simulation:
    """Err by chance, identify all joints anew, predict the long tools; `draws` times.

    The true assemblies are those of the model with the identified joints; what errs is the holder, the carbide, the
    overhangs and the readings that are given to the identification.
    """
    random = np.random.default_rng(seed)
    deviations = np.array([chance.deviation(name) for name in model.shared])
    at_bound = 0
    means = []
    nominal = {}
    for long in published.long_tools:
        mount = published.mount(long.diameter_mm)
        joint = joint_of(joints, long.diameter_mm, torque_nm)
        assembly = model.assembly(long.diameter_mm, long.overhang_mm, mount.holder_length_mm, joint.k_y, joint.k_theta)
        nominal[long] = float(assembly.lowest_natural_frequencies(1)[0][0])
    for _ in range(draws):
        factors = np.exp(deviations * random.standard_normal(deviations.size))
        wrong = model.varied(dict(zip(model.shared, factors.tolist(), strict=True)))
        errors = []
        for long, true_hz in nominal.items():
            mount = published.mount(long.diameter_mm)
            joint = joint_of(joints, long.diameter_mm, torque_nm)
            frequency = np.array(published.reading(long.diameter_mm, torque_nm).frequency_hz)
            read = frequency + resolution.half_step(frequency) * random.uniform(-1.0, 1.0, 2)
            overhangs = np.array([mount.overhang_mm, long.overhang_mm]) + chance.overhang_mm * random.standard_normal(2)
            arguments = (mount.holder_length_mm, joint.k_y, joint.k_theta)
            found = follow_joint(wrong.assembly(long.diameter_mm, overhangs[0], *arguments), read)
            at_bound += _at_bound(found)
            assembly = wrong.assembly(long.diameter_mm, overhangs[1], mount.holder_length_mm, *found.tolist())
            predicted = float(assembly.lowest_natural_frequencies(1)[0][0])
            half = float(resolution.half_step([long.measured_hz[0]])[0])
            errors.append(100.0 * (predicted / (true_hz + half * random.uniform(-1.0, 1.0)) - 1.0))
        means.append(float(np.mean(errors)))
    share = float(np.mean(np.abs(means) >= abs(bias.mean_percent)))
    return Simulation(draws, seed, float(np.sqrt(np.mean(np.square(means)))), share, at_bound)


def _at_bound(joint: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    limits = np.array(list(BOUNDS.values()))
    return bool(np.any(joint <= limits[:, 0] * (1.0 + 1e-6)) or np.any(joint >= limits[:, 1] * (1.0 - 1e-6)))


_LARGE = 0.3
"""The slopes say nothing of changes beyond this share, so table 2 is not predicted with them."""


def rank_causes(
    model: HolderModel,
    published: Published,
    joints: Sequence[IdentifiedJoint],
    bias: LongToolBias,
    slopes: Propagation,
    chance: ChanceModel,
    *,
    torque_nm: float,
) -> tuple[Cause, ...]:
    """For each single cause the change that removes the mean bias, the least surprising first.

    Removing the bias in this way is no proof: one number always takes out one mean. The rms over all measured modes
    beside it says whether the rest of table 2 agrees with the change.
    """
    offset = float(np.mean(np.log1p(0.01 * np.array(bias.percent))))
    stiffness = {j.diameter_mm: (j.k_y, j.k_theta) for j in joints if j.torque_nm == torque_nm}
    lengths = {t.diameter_mm: t.overhang_mm for t in published.long_tools}
    causes = []
    for name, slope in zip(slopes.names, slopes.shared.mean(axis=0), strict=True):
        change = -offset / float(slope) if slope else np.inf
        after = None
        if abs(change) <= _LARGE:
            after = _rms_with(model.varied({name: 1.0 + change}), published, stiffness, torque_nm)
        causes.append(Cause(name, 100.0 * change, "%", abs(change) / chance.deviation(name), after))
    for index, quantity in enumerate(("k_y", "k_theta")):
        change = -offset / float(slopes.joint[:, index].mean())
        after = None
        if abs(change) <= _LARGE:
            moved = {
                d: tuple(k * (1.0 + change * (i == index)) for i, k in enumerate(ks)) for d, ks in stiffness.items()
            }
            after = _rms_of_long(model, published, stiffness, {d: (k[0], k[1]) for d, k in moved.items()}, lengths)
        causes.append(Cause(f"{quantity} of every long clamping", 100.0 * change, "%", None, after))
    shift = -offset / float(slopes.overhang.mean())
    # All tools in the same direction: the error of their mean is what the model gives odds for.
    deviations = abs(shift) / chance.overhang_mm * len(lengths) ** 0.5 if chance.overhang_mm else None
    longer = {d: length + shift for d, length in lengths.items()}
    causes.append(
        Cause(
            "overhang of every long tool",
            shift,
            "mm",
            deviations,
            _rms_of_long(model, published, stiffness, stiffness, longer),
        )
    )
    return tuple(sorted(causes, key=lambda c: (c.deviations is None, c.deviations or 0.0, abs(c.change))))


def _rms_with(
    model: HolderModel, published: Published, stiffness: Mapping[float, Stiffness], torque_nm: float
) -> float:
    """Error of table 2 with another model, the joints identified anew."""
    again = {}
    for diameter, start in stiffness.items():
        mount = published.mount(diameter)
        assembly = model.assembly(diameter, mount.overhang_mm, mount.holder_length_mm, *start)
        found = follow_joint(assembly, published.reading(diameter, torque_nm).frequency_hz)
        again[diameter] = (float(found[0]), float(found[1]))
    return rms([row.error_percent for row in predict_transfers(model, published, again)])


def _rms_of_long(
    model: HolderModel,
    published: Published,
    stiffness: Mapping[float, Stiffness],
    long_stiffness: Mapping[float, Stiffness],
    long_overhang: Mapping[float, float],
) -> float:
    """Error of table 2 where the long assemblies alone have another joint or overhang."""
    errors = [
        row.error_percent
        for row in predict_transfers(model, published, stiffness)
        if row.overhang_mm != published.long_overhang(row.diameter_mm)
    ]
    for long in published.long_tools:
        length = published.mount(long.diameter_mm).holder_length_mm
        assembly = model.assembly(
            long.diameter_mm, long_overhang[long.diameter_mm], length, *long_stiffness[long.diameter_mm]
        )
        ours = assembly.lowest_natural_frequencies(len(long.measured_hz))[0]
        errors += (100.0 * (ours / np.array(long.measured_hz) - 1.0)).tolist()
    return rms(errors)
