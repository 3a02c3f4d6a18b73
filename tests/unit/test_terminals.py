"""Parts known by their receptances at one plane: as the end of an assembly, against the beams that they replace."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import pytest

from receptance import (
    CARBIDE,
    FRF,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    MeasuredPart,
    MicroslipJoint,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointJoint,
    PointMass,
    ResonanceError,
    Segment,
    Unknown,
    identify,
)
from receptance.coupling import spindle_of

LOSSY = replace(STEEL, loss_factor=0.002)
TOOL = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
HOLDER = Part([Segment(length=0.129, outer_diameter=0.045, material=LOSSY)], name="holder")
JOINT = PointJoint(k_y=6.3e8, k_theta=1e5, c_y=300.0, c_theta=0.1, name="joint")
TAPER = PointJoint(k_y=2e9, k_theta=3e6, loss_factor=0.01, name="taper")
SHAFT = Part([Segment(length=0.3, outer_diameter=0.07, material=LOSSY)], name="shaft")
BEARINGS = [
    GroundSpring(k_y=2e8, c_y=1000.0, part="shaft", position=0.05, name="front"),
    GroundSpring(k_y=2e8, c_y=800.0, k_theta=1e5, part="shaft", position=0.25, name="rear"),
]
LINES = np.geomspace(20.0, 8000.0, 400)
PLANE = [Coordinate("shaft", 0.0, "y"), Coordinate("shaft", 0.0, "theta")]
PLACES = [Coordinate(), Coordinate("tool", 0.0, "theta"), Coordinate("holder", 0.05), Coordinate("holder", "end")]
MODES = [
    Mode(frequency_hz=650.0, damping_ratio=0.03, y=0.25, theta=1.1),
    Mode(frequency_hz=1700.0, damping_ratio=0.02, y=0.3, theta=-4.0, y_imaginary=0.05, theta_imaginary=0.4),
]
MODAL = ModalPart(modes=MODES, residual_y=2e-9, residual_theta=2e-7, residual_ytheta=1e-8, name="spindle")


def table(lines: np.ndarray = LINES, decay_rate: float = 0.0) -> MeasuredPart:
    """Return the shaft as it would be measured."""
    shaft = Assembly([SHAFT], BEARINGS)
    matrix = shaft.receptance(lines - 1j * decay_rate / (2.0 * np.pi), response=PLANE, excitation=PLANE)
    return MeasuredPart(frequency_hz=lines, matrix=matrix, decay_rate=decay_rate, name="spindle")


@pytest.mark.parametrize("decay_rate", [0.0, 20.0])
@pytest.mark.parametrize("between", [(TAPER,), ()])
def test_shaft_by_its_receptances_equals_the_shaft(decay_rate: float, between: tuple[PointJoint, ...]) -> None:
    whole = Assembly([TOOL, JOINT, HOLDER, *between, SHAFT], BEARINGS)
    ended = Assembly([TOOL, JOINT, HOLDER, *between, table(decay_rate=decay_rate)])
    lines = LINES - 1j * decay_rate / (2.0 * np.pi)
    addresses = ["joint.k_theta", "tool.segment[0].length", "holder.segment[0].outer_diameter"]
    h, slope = whole.derivatives(lines, addresses, response=PLACES, excitation=PLACES)
    found, own = ended.derivatives(lines, addresses, response=PLACES, excitation=PLACES)
    np.testing.assert_allclose(found, h, rtol=1e-11)
    np.testing.assert_allclose(own, slope, rtol=1e-9)
    for threads in (1, 2):
        again = ended.receptance(lines, response=PLACES, excitation=PLACES, threads=threads)
        assert np.array_equal(again, found)


def test_a_ground_spring_is_a_terminal() -> None:
    spring: dict[str, Any] = {"k_y": 2e8, "k_theta": 5e5, "k_ytheta": 3e6, "c_y": 800.0, "c_theta": 2.0}
    matrix = np.linalg.inv(PointJoint(**spring).stiffness(LINES))
    ended = Assembly([TOOL, JOINT, HOLDER, MeasuredPart(frequency_hz=LINES, matrix=matrix)])
    held = Assembly([TOOL, JOINT, HOLDER], [GroundSpring(**spring, part="holder", position="end")])
    h = held.receptance(LINES, response=PLACES, excitation=PLACES)
    np.testing.assert_allclose(ended.receptance(LINES, response=PLACES, excitation=PLACES), h, rtol=1e-11)


def test_point_mass_at_the_interface_plane() -> None:
    # At the root of the sweep, and behind a joint in micro-slip, whose derivatives go another way.
    slipping = MicroslipJoint(k_y=6.3e8, k_theta=1e5, c_y=9.0, slip_theta=0.1, level=1.0, name="joint")
    mass = PointMass(mass=0.3, inertia=1e-4, part="holder", position="end", name="ring")
    addresses = ["joint.slip_theta", "ring.mass", "spindle.residual_y", "spindle.mode[0].theta"]
    ended = Assembly([TOOL, slipping, HOLDER, MODAL], [mass])
    h, slope = ended.derivatives(LINES, addresses, response=PLACES, excitation=PLACES)
    np.testing.assert_allclose(h, h.transpose(0, 2, 1), rtol=1e-9)
    np.testing.assert_allclose(slope, differences(ended, addresses), rtol=2e-5, atol=2e-7 * np.abs(slope).max())


def differences(assembly: Assembly, addresses: list[str]) -> np.ndarray:
    """Return central differences."""
    columns = []
    for address in addresses:
        value = assembly.get(address)
        step = 1e-5 * abs(value) if value else 1e-13 if "residual" in address else 1e-5
        ends = [
            assembly.replace({address: value + side * step}).receptance(LINES, response=PLACES, excitation=PLACES)
            for side in (1.0, -1.0)
        ]
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.stack(columns, axis=-1)


def test_modes_have_derivatives() -> None:
    ended = Assembly([TOOL, JOINT, HOLDER, TAPER, MODAL])
    addresses = [address for address in ended.parameters if address.startswith("spindle.")]
    assert addresses[:6] == [f"spindle.mode[0].{name}" for name in Mode.columns_of]
    assert addresses[-3:] == ["spindle.residual_y", "spindle.residual_theta", "spindle.residual_ytheta"]
    assert ended.get("spindle.mode[1].theta") == -4.0
    _, slope = ended.derivatives(LINES, addresses, response=PLACES, excitation=PLACES)
    expected = differences(ended, addresses)
    size = np.abs(slope).max(axis=0)
    assert np.max(np.abs(slope - expected).max(axis=0) / size) < 5e-6


def test_residual_equals_the_derivative_by_the_table() -> None:
    """Also one line alone: dH is the same linear function of what changes in the table, line by line."""
    measured = table()
    ended = Assembly([TOOL, JOINT, HOLDER, TAPER, measured])
    names = [f"spindle.residual_{entry}" for entry in ("y", "theta", "ytheta")]
    h, slope = ended.derivatives(LINES, names)
    rng = np.random.default_rng(3)
    change = 1e-6 * rng.normal(size=(LINES.size, 3)) * np.array([1e-9, 1e-7, 1e-8])
    matrix = measured.matrix.copy()
    for column, (i, j) in enumerate([(0, 0), (1, 1), (0, 1)]):
        matrix[:, i, j] += change[:, column]
        matrix[:, j, i] = matrix[:, i, j]
    moved = Assembly([TOOL, JOINT, HOLDER, TAPER, replace(measured, matrix=matrix)]).receptance(LINES)
    expected = np.einsum("nm,nm->n", slope, change)
    np.testing.assert_allclose(moved - h, expected, rtol=1e-2, atol=1e-12 * np.abs(h).max())


def test_modes_against_exact_arithmetic() -> None:
    """The pair of poles of a mode, w_d = w_r sqrt(1 - zeta^2), in 40 digits: residues psi psi^T / (2 i w_d)."""
    mpmath.mp.dps = 40
    lines = np.array([20.0, 649.0, 1700.5 - 2.0j, 8000.0 - 30.0j])
    h = ModalPart(modes=MODES).receptance(lines)
    for line, matrix in zip(lines, h, strict=True):
        s = 2j * mpmath.pi * mpmath.mpmathify(complex(line))
        expected = mpmath.matrix(2, 2)
        for mode in MODES:
            own, zeta = 2 * mpmath.pi * mpmath.mpf(mode.frequency_hz), mpmath.mpf(mode.damping_ratio)
            swing = own * mpmath.sqrt(1 - zeta**2)
            # phi + i chi with the pole of positive imaginary part, its conjugate with the other one.
            psi = [mpmath.mpc(mode.y, mode.y_imaginary), mpmath.mpc(mode.theta, mode.theta_imaginary)]
            for i in range(2):
                for j in range(2):
                    residue = psi[i] * psi[j] / (2j * swing)
                    pole = mpmath.mpc(-zeta * own, swing)
                    expected[i, j] += residue / (s - pole) + mpmath.conj(residue) / (s - mpmath.conj(pole))
        for i in range(2):
            for j in range(2):
                assert abs(complex(expected[i, j]) - matrix[i, j]) < 1e-12 * abs(matrix).max()


def test_modes_and_tables_are_fitted() -> None:
    lines = LINES[100:380:4]
    for spindle, name in ((MODAL, "spindle.mode[1].damping_ratio"), (table(), "spindle.residual_y")):
        true = Assembly([TOOL, JOINT, HOLDER, TAPER, spindle])
        data = Observation(assembly=true, frequency_hz=lines, receptance=true.receptance(lines))
        value = true.get(name)
        unknowns = [
            Unknown(address="joint.k_theta", lower=1e4, upper=1e6, start=1.05e5),
            Unknown(address=name, lower=value - 2e-2, upper=value + 2e-2, start=value + 2e-3, scale="linear")
            if value
            else Unknown(address=name, lower=-1e-9, upper=1e-9, start=1e-10, scale="linear"),
        ]
        found = identify(data, unknowns, starts=1)
        assert found.values["joint.k_theta"] == pytest.approx(1e5, rel=1e-6)
        assert found.values[name] == pytest.approx(value, rel=1e-6, abs=1e-13)


def test_a_window_on_a_structure_with_modes() -> None:
    """The derivative by the rate of a window is one by the frequency, on which modes depend as well."""
    lines, rate = LINES[100:380:4], 25.0
    true = Assembly([TOOL, JOINT, HOLDER, MODAL])
    s = 2j * np.pi * lines
    recorded = true.receptance(lines - 1j * rate / (2.0 * np.pi)) * (1.0 + rate / s) ** 2
    data = Observation(assembly=true, frequency_hz=lines, receptance=recorded)
    unknowns = [
        Unknown(address="joint.k_theta", lower=1e4, upper=1e6, start=1.2e5),
        Unknown(address="observation.decay_rate", lower=0.0, upper=100.0, start=10.0, scale="linear"),
    ]
    found = identify(data, unknowns, starts=1)
    assert found.values["observation.decay_rate"] == pytest.approx(rate, rel=1e-6)
    problem, x = found.task.problem(), found.task.variables.start
    slope, step = problem.jacobian(x)[:, 1].copy(), np.array([0.0, 1e-3])
    expected = (problem.value(x + step) - problem.value(x - step)) / (2.0 * step[1])
    assert np.max(np.abs(slope - expected)) < 1e-6 * np.max(np.abs(expected))


def test_table_is_interpolated_between_dense_lines() -> None:
    fine = np.arange(100.0, 3000.0, 2.0)
    between = fine[:-1] + 0.7
    spindle = table(fine)
    np.testing.assert_allclose(spindle.receptance(between), table(between).matrix, rtol=3e-3)
    assert np.array_equal(spindle.receptance(fine), spindle.matrix)
    with pytest.raises(ValueError, match=r"'spindle': interpolation to \d+ Hz has an error of about .* %"):
        table(np.arange(100.0, 3000.0, 100.0)).receptance(np.arange(150.0, 2900.0, 100.0))
    gap = (fine < 500.0) | (fine > 520.0)
    with pytest.raises(ValueError, match="is not known between 498 and 522 Hz, at the line at 511 Hz"):
        table(fine[gap]).receptance([300.5, 511.0])


@pytest.mark.parametrize("spindle", [table(), replace(MODAL, band_hz=(20.0, 8000.0))])
def test_extrapolation_is_refused(spindle: MeasuredPart | ModalPart) -> None:
    ended = Assembly([TOOL, JOINT, HOLDER, spindle])
    with pytest.raises(ValueError, match=r"'spindle' is known from 20 to 8000 Hz, and the line at 9000 Hz is outside"):
        ended.receptance([100.0, 9000.0])
    with pytest.raises(ValueError, match="10 Hz is outside"):
        ended.receptance([10.0, 50.0])


def test_a_table_belongs_to_its_window() -> None:
    with pytest.raises(ValueError, match="a decay rate of 0 1/s, expected that of the table, 20 1/s"):
        Assembly([TOOL, table(decay_rate=20.0)]).receptance(LINES)


def test_from_a_file_s_frf() -> None:
    spindle = table()
    frf = FRF(
        frequency_hz=LINES,
        values=spindle.matrix,
        responses=["y", "theta"],
        excitations=["y", "theta"],
    )
    np.testing.assert_allclose(spindle_of(frf.to("accelerance"), name="spindle").matrix, spindle.matrix)
    with pytest.raises(ValueError, match="the responses y and the excitations y, theta, expected y, theta"):
        spindle_of(frf.select(responses=0))


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (
            lambda: Assembly([TOOL, MODAL, HOLDER]),
            ValueError,
            r"chain\[1\] is a ModalPart, which is known at one plane",
        ),
        (lambda: Assembly([MODAL]), ValueError, "must begin and end with a Part, or end with a MeasuredPart or"),
        (lambda: Assembly([TOOL, MODAL], motion="axial"), ValueError, "which has no axial motion"),
        (lambda: Assembly([TOOL, MODAL]).natural_frequencies(1e3), ValueError, "use the peaks of a receptance"),
        (lambda: Assembly([TOOL, MODAL]).get("spindle.mode[2].y"), ValueError, "there is no parameter"),
        (lambda: ModalPart(modes=[]), ValueError, "modes is empty"),
        (lambda: ModalPart(modes=MODES, band_hz=(100.0, 50.0)), ValueError, "expected an ascending pair"),
        (
            lambda: Mode(frequency_hz=0.0, damping_ratio=0.0, y=1.0, theta=0.0, y_imaginary=0.1),
            ValueError,
            "does not oscillate, expected a shape without imaginary parts",
        ),
        (
            lambda: ModalPart(modes=[replace(MODES[0], damping_ratio=0.0)]).receptance([650.0]),
            ResonanceError,
            "650 Hz .*an undamped resonance met exactly",
        ),
        (
            lambda: MeasuredPart(frequency_hz=LINES, matrix=np.ones((4, 2, 2))),
            ValueError,
            r"matrix has shape \(4, 2, 2\), expected \(400, 2, 2\)",
        ),
        (
            lambda: MeasuredPart(frequency_hz=[1.0], matrix=[[[1.0, 2.0], [3.0, 4.0]]]),
            ValueError,
            r"y/M is 2\+0j and theta/F 3\+0j, expected equal values \(reciprocity\)",
        ),
        (
            lambda: MeasuredPart(frequency_hz=[1.0], matrix=[[[1.0, np.nan], [0.0, 4.0]]]),
            ValueError,
            r"matrix\[0, 0, 1\] is",
        ),
    ],
)
def test_errors_describe_the_mistake(make: Any, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        make()


def test_values_of_a_modal_part_are_replaced_by_address() -> None:
    mode = Mode(frequency_hz=650.0, damping_ratio=0.02, y=1.2, theta=0.5)
    part = ModalPart(modes=(mode,), name="spindle").with_values({"mode[0].frequency_hz": 700.0, "residual_y": 1e-9})
    assert (part.modes[0].frequency_hz, part.modes[0].y, part.residual_y) == (700.0, 1.2, 1e-9)
    with pytest.raises(ValueError, match=r"no parameter 'mode\[1\].y'"):
        part.with_values({"mode[1].y": 1.0})
