"""The first mode of the long tools: its bias, what chance gives, and what it would take to remove it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.studies.er32.determination import Consistency
from receptance.studies.er32.holder import HolderModel, mode_slopes
from receptance.studies.er32.joints import IdentifiedJoint, Resolution, joint_of
from receptance.studies.er32.tables import Published, Transfer

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ChanceModel", "LongToolBias", "Propagation", "find_bias", "propagate", "sign_test"]

_FIRST_MODE = 1


@dataclass(frozen=True)
class ChanceModel:
    """Standard deviations that say what chance means here.

    Readings are uniform over the step they are printed in, independent of each other. Every overhang errs on its
    own, in the identifying and in the long assembly. The holder and the carbide err once for all tools together.
    The defaults for the carbide are the standard deviations of uniform distributions over the common ranges 550 to
    630 GPa and 13 800 to 15 000 kg/m3, for the steel over 200 to 210 GPa; the holder's shape is inferred, so 2 % of
    every dimension and 10 % of the two factors of the nose.
    """

    overhang_mm: float = 0.1
    carbide_modulus_percent: float = 3.9
    carbide_density_percent: float = 2.4
    steel_modulus_percent: float = 1.4
    steel_density_percent: float = 0.5
    holder_dimension_percent: float = 2.0
    nose_factor_percent: float = 10.0

    def deviation(self, name: str) -> float:
        """Relative standard deviation of a shared quantity."""
        owner, quantity = name.split(" ", 1)
        if owner in ("carbide", "steel"):
            return 0.01 * float(getattr(self, f"{owner}_{quantity}_percent"))
        return 0.01 * (self.nose_factor_percent if quantity.endswith("factor") else self.holder_dimension_percent)


@dataclass(frozen=True)
class Propagation:
    """Linear propagation to the long tools' first modes; everything relative except the overhang, which is in mm.

    `shared` is `(n_tools, n_shared)` with the joint identified anew for every change, `joint` `(n_tools, 2)` for k_y
    and k_theta of the long clamping alone, `overhang` and `identifying_overhang` `(n_tools,)` for the long and for
    the identifying assembly, `reading` `(n_tools, 2)` for the two frequencies that identify.
    """

    names: tuple[str, ...]
    shared: NDArray[np.float64]
    joint: NDArray[np.float64]
    overhang: NDArray[np.float64]
    identifying_overhang: NDArray[np.float64]
    reading: NDArray[np.float64]


@dataclass(frozen=True)
class LongToolBias:
    """Bias of the first mode of the long tools, 100 (predicted / measured - 1), and what chance gives.

    `deviations_percent` are standard deviations of the mean bias by source; `p_value` is two-sided, for the mean
    bias, a normal distribution and all sources together; `p_value_without_shared` leaves out what all tools share,
    and `p_value_with_inference` puts the standard errors and correlations of the inference in the place of the
    stated tolerances of carbide and holder.
    """

    diameter_mm: tuple[float, ...]
    overhang_mm: tuple[float, ...]
    percent: tuple[float, ...]
    published_percent: tuple[float, ...]
    tool_deviation_percent: tuple[float, ...]
    mean_percent: float
    deviations_percent: dict[str, float]
    mean_deviation_percent: float
    mean_correlation: float
    p_value: float
    p_value_without_shared: float
    p_value_with_inference: float
    inference_deviation_percent: float
    sign_test_p_value: float


def propagate(
    model: HolderModel, published: Published, joints: Sequence[IdentifiedJoint], torque_nm: float
) -> Propagation:
    """Derivatives of the long tools' predicted first modes with respect to everything that may err.

    The joint follows its two identifying frequencies: d ln k = J^-1 (d ln f - dependence of f on the rest).
    """
    parts: list[tuple[NDArray[np.float64], ...]] = []
    for long in published.long_tools:
        joint = joint_of(joints, long.diameter_mm, torque_nm)
        mount = published.mount(long.diameter_mm)
        stiffness = (joint.k_y, joint.k_theta)
        identifying = model.assembly(long.diameter_mm, mount.overhang_mm, mount.holder_length_mm, *stiffness)
        assembly = model.assembly(long.diameter_mm, long.overhang_mm, mount.holder_length_mm, *stiffness)
        _, shared_1, joint_1, overhang_1 = mode_slopes(model, identifying, (1, 2), model.shared)
        _, shared_2, joint_2, overhang_2 = mode_slopes(model, assembly, (_FIRST_MODE,), model.shared)
        follow = np.linalg.solve(joint_1.T, joint_2[0])
        parts.append(
            (shared_2[0] - follow @ shared_1, joint_2[0], overhang_2, -np.atleast_1d(follow @ overhang_1), follow)
        )
    shared, stiff, overhang, before, reading_slopes = (np.array([part[i] for part in parts]) for i in range(5))
    return Propagation(model.shared, shared, stiff, overhang.ravel(), before.ravel(), reading_slopes)


def find_bias(
    published: Published,
    predicted_hz: Mapping[float, float],
    slopes: Propagation,
    chance: ChanceModel,
    resolution: Resolution,
    consistency: Consistency,
    torque_nm: float,
) -> LongToolBias:
    """Bias of the long tools' first mode beside what chance gives.

    Parameters
    ----------
    published : Published
        The tables.
    predicted_hz : mapping
        Predicted first mode of the long tool by diameter in mm.
    slopes : Propagation
        From `propagate`.
    chance : ChanceModel
        Tolerances.
    resolution : Resolution
        Reading errors.
    consistency : Consistency
        How well the holder and the carbide are inferred.
    torque_nm : float
        Torque at which the joints were identified.
    """
    tools = published.long_tools
    percent = np.array([_percent(predicted_hz[tool.diameter_mm], tool) for tool in tools])
    paper = [_percent(tool.predicted_hz[_FIRST_MODE - 1], tool) for tool in tools]
    sources = {
        "reading": _reading_covariance(published, tools, slopes, resolution, torque_nm),
        "overhang": np.diag(chance.overhang_mm**2 * (slopes.overhang**2 + slopes.identifying_overhang**2)),
    }
    for owner in ("carbide", "steel", "holder"):
        chosen = [i for i, name in enumerate(slopes.names) if _owner(name) == owner]
        scaled = slopes.shared[:, chosen] * [chance.deviation(slopes.names[i]) for i in chosen]
        sources[owner] = scaled @ scaled.T
    total = sum(sources.values(), np.zeros_like(sources["reading"]))
    count = len(tools)
    alone = sources["reading"] + sources["overhang"]
    mean = float(percent.mean())
    deviations = np.sqrt(np.diag(total))
    chosen = [slopes.names.index(quantity.name) for quantity in consistency.quantities]
    inferred = slopes.shared[:, chosen] @ consistency.covariance @ slopes.shared[:, chosen].T
    with_inference = _mean_deviation(alone + sources["steel"] + inferred)
    correlation = total / np.outer(deviations, deviations)
    return LongToolBias(
        diameter_mm=tuple(tool.diameter_mm for tool in tools),
        overhang_mm=tuple(tool.overhang_mm for tool in tools),
        percent=tuple(percent.tolist()),
        published_percent=tuple(paper),
        tool_deviation_percent=tuple((100.0 * deviations).tolist()),
        mean_percent=mean,
        deviations_percent={name: _mean_deviation(matrix) for name, matrix in sources.items()},
        mean_deviation_percent=_mean_deviation(total),
        mean_correlation=float((correlation.sum() - count) / (count * (count - 1))),
        p_value=_two_sided(mean, _mean_deviation(total)),
        p_value_without_shared=_two_sided(mean, _mean_deviation(alone)),
        p_value_with_inference=_two_sided(mean, with_inference),
        inference_deviation_percent=_mean_deviation(inferred),
        sign_test_p_value=sign_test(percent.tolist()),
    )


def sign_test(values: Sequence[float]) -> float:
    """Two-sided sign test: how likely as uneven a split of signs is where both are as likely; zeros do not count.

    Examples
    --------
    >>> from receptance.studies.er32.bias import sign_test
    >>> sign_test([-1.0, -2.0, -0.5, -0.1])
    0.125
    """
    signs = [value for value in values if value != 0.0]
    count, positive = len(signs), sum(value > 0.0 for value in signs)
    tail = sum(math.comb(count, i) for i in range(min(positive, count - positive) + 1))
    return min(1.0, 2.0 * tail / 2.0**count)


def _reading_covariance(
    published: Published, tools: Sequence[Transfer], slopes: Propagation, resolution: Resolution, torque_nm: float
) -> NDArray[np.float64]:
    variances = []
    for row, tool in zip(slopes.reading, tools, strict=True):
        identifying = np.array(published.reading(tool.diameter_mm, torque_nm).frequency_hz)
        errors = row * resolution.standard_deviation(identifying) / identifying
        measured = tool.measured_hz[_FIRST_MODE - 1]
        own = float(resolution.standard_deviation([measured])[0]) / measured
        variances.append(float(np.sum(errors**2)) + own**2)
    return np.diag(variances)


def _owner(name: str) -> str:
    owner = name.split(" ", 1)[0]
    return owner if owner in ("carbide", "steel") else "holder"


def _percent(predicted: float, tool: Transfer) -> float:
    return 100.0 * (predicted / tool.measured_hz[_FIRST_MODE - 1] - 1.0)


def _mean_deviation(covariance: NDArray[np.float64]) -> float:
    """Return the standard deviation of the mean, in percent, from a relative covariance."""
    return 100.0 * float(np.sqrt(covariance.sum())) / len(covariance)


def _two_sided(value: float, deviation: float) -> float:
    return math.erfc(abs(value) / deviation / math.sqrt(2.0)) if deviation > 0.0 else 0.0
