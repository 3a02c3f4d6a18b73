"""Diagnosis of a tool in a holder that is given as data: a noisy table of receptances, or modes with a covariance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    MeasuredPart,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Segment,
)
from receptance.coupling import mode_tolerances, read_spindle, write_spindle
from receptance.diagnosis import diagnose
from receptance.diagnosis.measured_data import with_table_noise
from receptance.diagnosis.model import Model
from receptance.fit import Law, Tolerance

LINES = np.arange(160.0, 5000.0, 20.0)
LOSSY = replace(STEEL, loss_factor=0.002)
HOLDER = Part(
    [
        Segment(length=0.04, outer_diameter=0.036, material=LOSSY),
        Segment(length=0.096, outer_diameter=0.045, inner_diameter=0.012, material=LOSSY),
    ],
    name="holder",
)
PLANE = [Coordinate("holder", 0.0, "y"), Coordinate("holder", 0.0, "theta")]
EXACT = Assembly([HOLDER]).receptance(LINES, response=PLANE, excitation=PLANE)
TABLE_NOISE = 0.005
JOINT = [
    Law(address="joint.k_y", lower=1e6, upper=1e10),
    Law(address="joint.k_theta", lower=1e3, upper=1e7),
    Law(address="joint.c_y", lower=0.1, upper=1e5),
    Law(address="joint.c_theta", lower=1e-4, upper=1e2),
]
TOLERANCES = [
    Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True),
    Tolerance(name="density", moves={"tool.segment[*].density": 0.003}, relative=True),
]
IN_THE_HOLDER = {"joint_spread", "holder_inertia", "holder_modulus", "missing_mode", "suspension"}


def table(rng: np.random.Generator, noise: float = TABLE_NOISE) -> MeasuredPart:
    """Return the holder as measured, with relative noise of each entry on each line."""
    normal = rng.normal(size=(2, LINES.size, 3))
    errors = 1.0 + noise * (normal[0] + 1j * normal[1])
    matrix, covariance = EXACT.copy(), np.zeros((LINES.size, 3, 3), dtype=np.complex128)
    for k, (i, j) in enumerate(((0, 0), (1, 1), (0, 1))):
        matrix[:, i, j] = EXACT[:, i, j] * errors[:, k]
        covariance[:, k, k] = (TABLE_NOISE * np.abs(EXACT[:, i, j])) ** 2
    matrix[:, 1, 0] = matrix[:, 0, 1]
    return MeasuredPart(frequency_hz=LINES, matrix=matrix, covariance=covariance, name="holder")


def machine(overhang: float, end: Part | MeasuredPart | ModalPart, *points: PointMass) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.016, material=CARBIDE)], name="tool")
    return Assembly([tool, PointJoint(k_y=2e8, k_theta=5e4, c_y=300.0, c_theta=0.2, name="joint"), end], points)


def measured(
    end: MeasuredPart | ModalPart, rng: np.random.Generator, *points: PointMass, lines: NDArray | None = None
) -> list[Observation]:
    """Return tips at three overhangs and two levels with 1 % noise; the model ends with the data `end`."""
    found = []
    for overhang in (0.06, 0.08, 0.1):
        for level in (100.0, 300.0):
            normal = rng.normal(size=(2, LINES.size))
            exact = machine(overhang, HOLDER, *points).receptance(LINES if lines is None else lines)
            found.append(
                Observation(
                    assembly=machine(overhang, end),
                    frequency_hz=LINES,
                    receptance=exact * np.exp(0.01 * (normal[0] + 1j * normal[1])),
                    standard_deviation=0.01,
                    label=f"{overhang:g} m, {level:g} N",
                    configuration=f"{overhang:g} m",
                    conditions={"force": level},
                )
            )
    return found


def test_noise_of_a_table_is_no_error_of_the_model() -> None:
    rng = np.random.default_rng(1)
    verdict = diagnose(measured(table(rng), rng), JOINT, tolerances=TOLERANCES)
    assert verdict.verdict == "adequate"
    assert set(verdict.undecidable) > IN_THE_HOLDER
    (reason,) = (one for one in verdict.reasons if one.code == "holder_by_data")
    assert set(reason.values["causes"]) == IN_THE_HOLDER
    assert not IN_THE_HOLDER & {one.id for one in verdict.candidates}


def test_a_cause_is_named_beside_a_table_with_noise() -> None:
    rng = np.random.default_rng(2)
    causes = ["sensor_mass", "calibration_gain", "tool_density", "collet_mass", "joint_spread"]
    observed = measured(table(rng), rng, PointMass(mass=2e-3))
    verdict = diagnose(observed, JOINT, tolerances=TOLERANCES, causes=causes)
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["sensor_mass"])
    _, low, high = verdict.causes[0].parameters["sensor_mass.mass"]
    assert low < 2e-3 < high


def test_the_variance_bounds_the_errors_that_records_share() -> None:
    # No combination of records may scatter more than its stated variance; without the noise of the table they do.
    rng = np.random.default_rng(3)
    stated, widened = [], []
    for _ in range(12):
        observed = tuple(measured(table(rng), rng))
        changed, reasons = with_table_noise(Model(observed, tuple(JOINT), tuple(TOLERANCES)))
        assert [(one.code, one.values["errors"].parts) for one in reasons] == [("spindle_errors", ("holder",))]
        assert reasons[0].values["errors"].records == 6
        for rows, records in ((stated, observed), (widened, changed.observations)):
            rows.append([np.log(a.receptance / a.assembly.receptance(LINES)) / a.standard_deviation for a in records])

    def largest_variance(rows: list[list[NDArray[np.complex128]]]) -> float:
        together = np.concatenate([np.array(one) for one in rows], axis=1)
        parts = np.concatenate([together.real, together.imag], axis=1)
        return float(np.linalg.eigvalsh(parts @ parts.T / parts.shape[1])[-1])

    assert largest_variance(stated) > 2.0
    assert 0.7 < largest_variance(widened) < 1.05


def test_an_undeclared_window_is_not_taken_for_a_cause_beside_a_table() -> None:
    rng = np.random.default_rng(4)
    windowed = measured(table(rng, 0.0), rng, lines=LINES - 15j / (2.0 * np.pi))
    verdict = diagnose(windowed, JOINT, tolerances=TOLERANCES)
    assert verdict.verdict not in ("named", "adequate")
    assert "complex frequencies" in verdict.undecidable["exponential_window"]


def test_causes_in_the_holder_are_not_tried_where_modes_describe_it() -> None:
    modes = [Mode(frequency_hz=0.0, damping_ratio=0.0, y=1.0, theta=0.0), *STATED.modes]
    end = replace(STATED, modes=tuple(modes))
    rng = np.random.default_rng(5)
    lines = np.arange(300.0, 3000.0, 20.0)
    exact = machine(0.08, end).receptance(lines)
    noise = 0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
    data = Observation(
        assembly=machine(0.08, end), frequency_hz=lines, receptance=exact * np.exp(noise), standard_deviation=0.01
    )
    deviation = 1e-3 * np.array([data.assembly.get(f"holder.{address}") for address in end.addresses])
    verdict = diagnose(data, JOINT, tolerances=mode_tolerances(end, np.diag(deviation**2)))
    assert verdict.verdict == "adequate"
    assert set(verdict.undecidable) > IN_THE_HOLDER
    assert "exponential_window" not in verdict.undecidable


STATED = ModalPart(
    modes=[Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.2, theta=1.0)],
    residual_y=2e-9,
    residual_theta=3e-7,
    name="holder",
)


def test_tolerances_of_modes_have_their_covariance() -> None:
    rng = np.random.default_rng(6)
    size = len(STATED.addresses)
    root = rng.normal(size=(size, 4)) * 10.0 ** rng.uniform(-9.0, 1.0, size)[:, None]
    root[3] = 0.0
    found = mode_tolerances(STATED, root @ root.T)
    assert len(found) == 4
    columns = [[one.moves.get(f"holder.{address}", 0.0) for address in STATED.addresses] for one in found]
    again = np.array(columns).T
    scale = np.where(root.any(axis=1), np.linalg.norm(root, axis=1), 1.0)
    np.testing.assert_allclose(
        again @ again.T / np.outer(scale, scale), root @ root.T / np.outer(scale, scale), atol=1e-8
    )
    assert mode_tolerances(STATED, np.zeros((size, size))) == ()


def test_mistakes_of_a_covariance_of_modes() -> None:
    size = len(STATED.addresses)
    with pytest.raises(ValueError, match=r"has shape \(2, 2\), expected \(9, 9\): rows in the order of"):
        mode_tolerances(STATED, np.eye(2))
    with pytest.raises(ValueError, match="has no name"):
        mode_tolerances(replace(STATED, name=""), np.eye(size))
    with pytest.raises(ValueError, match="not symmetric"):
        mode_tolerances(STATED, np.eye(size) + np.eye(size, k=1))
    with pytest.raises(ValueError, match="negative eigenvalue"):
        mode_tolerances(STATED, np.eye(size) - 2.0 * (np.ones((size, size)) - np.eye(size)))
    with pytest.raises(ValueError, match="not finite"):
        mode_tolerances(STATED, np.full((size, size), np.nan))


def test_lines_outside_a_table_are_told_with_file_and_band(tmp_path: Path) -> None:
    write_spindle(tmp_path / "holder.npz", table(np.random.default_rng(7)))
    end = read_spindle(tmp_path / "holder.npz", name="holder")
    assembly = machine(0.08, end)
    with pytest.raises(ValueError, match=r"holder.npz\) is known from 160 to 4980 Hz.*`low_hz=160, high_hz=4980` of"):
        Observation(assembly=assembly, frequency_hz=[100.0, 200.0, 6000.0], receptance=[1e-8, 1e-8, 1e-8])
