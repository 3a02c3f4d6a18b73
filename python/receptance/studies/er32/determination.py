"""How well 30 frequencies determine the inferred holder, and where the paper's numbers disagree with each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.studies.er32.holder import HolderModel, mode_slopes
from receptance.studies.er32.joints import IdentifiedJoint, follow_joint, joint_of
from receptance.studies.er32.tables import Published

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "Consistency",
    "Disagreement",
    "InferredQuantity",
    "check_inference",
    "find_disagreements",
    "overhang_scatter",
]

_KNOWN_WITHIN_PERCENT = 10.0


@dataclass(frozen=True)
class InferredQuantity:
    """A quantity of the inference with its standard error, linear about its value."""

    name: str
    value: float
    unit: str
    standard_error_percent: float
    at_bound: bool


@dataclass(frozen=True)
class Consistency:
    """How the inferred holder meets the frequencies that it was inferred from: consistency, not validation.

    `combinations_known` counts the independent combinations of the quantities (principal directions in logarithms)
    whose standard error is below `known_within_percent`; the others are decided by the bounds of the fit.
    `covariance` is that of the logarithms of the quantities.
    """

    frequencies: int
    rms_percent: float
    quantities: tuple[InferredQuantity, ...]
    combinations_known: int
    known_within_percent: float
    singular_values: tuple[float, ...]
    covariance: NDArray[np.float64]


def check_inference(model: HolderModel, published: Published) -> Consistency:
    """Residuals and derivatives at the frequencies that the holder was fitted to.

    Standard errors are linear, take the residual scatter as the error, and treat the quantities that the fit left
    at a bound as free; so they say what the frequencies alone determine.
    """
    residuals, rows = [], []
    cases = [(t.diameter_mm, t.overhang_mm, t.predicted_hz) for t in published.transfers]
    for mount in published.mounts:
        reading = published.reading(mount.diameter_mm, model.fitted_at_torque_nm)
        cases.append((mount.diameter_mm, mount.overhang_mm, reading.frequency_hz))
    for diameter, overhang, target in cases:
        setup = published.setup(diameter)
        length = published.mount(diameter).holder_length_mm
        assembly = model.assembly(diameter, overhang, length, setup.k_y, setup.k_theta)
        modes = range(1, len(target) + 1)
        frequency, slopes, _, _ = mode_slopes(model, assembly, modes, model.fitted)
        residuals.append(np.log(frequency / target))
        rows.append(slopes)
    residual, matrix = np.concatenate(residuals), np.concatenate(rows)
    count, unknowns = matrix.shape
    scatter = float(np.sqrt(np.sum(residual**2) / (count - unknowns)))
    _, singular, directions = np.linalg.svd(matrix, full_matrices=False)
    spread = scatter * directions / singular[:, None]
    covariance = spread.T @ spread
    errors = np.sqrt(np.diag(covariance))
    return Consistency(
        frequencies=count,
        rms_percent=100.0 * float(np.sqrt(np.mean(np.expm1(residual) ** 2))),
        quantities=tuple(
            InferredQuantity(name, *model.value(name), 100.0 * float(error), name in model.at_bounds_of_fit)
            for name, error in zip(model.fitted, errors, strict=True)
        ),
        combinations_known=int(np.sum(100.0 * scatter / singular < _KNOWN_WITHIN_PERCENT)),
        known_within_percent=_KNOWN_WITHIN_PERCENT,
        singular_values=tuple(singular.tolist()),
        covariance=covariance,
    )


@dataclass(frozen=True)
class Disagreement:
    """A number that the paper gives twice, with what follows for the joint where that can be computed."""

    what: str
    diameter_mm: float
    unit: str
    first: float
    first_source: str
    second: float
    second_source: str
    k_y_change_percent: float | None = None
    k_theta_change_percent: float | None = None


def find_disagreements(
    model: HolderModel, published: Published, joints: Sequence[IdentifiedJoint]
) -> tuple[Disagreement, ...]:
    """Compare what the paper says twice: stiffnesses in the text and in table 5, overhangs in tables 1, 2 and 5."""
    found = []
    for printed in published.text:
        setup = published.setup(printed.diameter_mm)
        pairs = (("k_y", "N/m", printed.k_y, setup.k_y), ("k_theta", "N m/rad", printed.k_theta, setup.k_theta))
        for what, unit, text, table in pairs:
            if text != table:
                found.append(
                    Disagreement(what, printed.diameter_mm, unit, text, printed.where, table, "tables 4 and 5")
                )
    for diameter, first, first_source, second in _overhangs(published):
        if first == second:
            continue
        changes: tuple[float | None, float | None] = (None, None)
        mount = published.mount(diameter)
        if first_source == "table 1":
            joint = joint_of(joints, diameter, published.recommended_torque_nm)
            other = model.assembly(diameter, second, mount.holder_length_mm, joint.k_y, joint.k_theta)
            reading = published.reading(diameter, published.recommended_torque_nm)
            moved = follow_joint(other, reading.frequency_hz)
            changes = (100.0 * float(moved[0] / joint.k_y - 1.0), 100.0 * float(moved[1] / joint.k_theta - 1.0))
        found.append(Disagreement("overhang", diameter, "mm", first, first_source, second, "table 5", *changes))
    return tuple(found)


def overhang_scatter(published: Published) -> float:
    """Standard deviation in mm of one printed overhang, from those that the paper prints twice."""
    differences = np.array([second - first for _, first, _, second in _overhangs(published)])
    return float(np.sqrt(np.mean(differences**2) / 2.0))


def _overhangs(published: Published) -> list[tuple[float, float, str, float]]:
    """Overhangs given twice: diameter, in table 1 or 2, which table, in table 5."""
    pairs = [
        (s.diameter_mm, published.mount(s.diameter_mm).overhang_mm, "table 1", s.overhang_medium_mm)
        for s in published.machine
    ]
    for transfer in published.long_tools:
        long = published.setup(transfer.diameter_mm).overhang_long_mm
        if long is not None:
            pairs.append((transfer.diameter_mm, transfer.overhang_mm, "table 2", long))
    return pairs
