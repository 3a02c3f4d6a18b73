"""Conical segments: limits, symmetries, splits, natural frequencies with their count, identification, messages."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import pytest
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import eigh

from oracle.cones import Cone, section
from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    Material,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Unknown,
    identify,
    mode_shapes,
)
from receptance.sweep.parametric_receptance import parametric_receptance

SEED = 20261129
F = np.array([1.0, 100.0, 2e3, 9e3, 3e4, 5e4])
LOSSY = replace(STEEL, loss_factor=0.004)
CONES = {
    "solid": Segment(length=0.06, outer_diameter=0.03, end_outer_diameter=0.06, material=LOSSY),
    "bore": Segment(length=0.07, outer_diameter=0.06, end_outer_diameter=0.04, inner_diameter=0.01,
                    end_inner_diameter=0.03, material=LOSSY, shear="hutchinson"),
    "filled": Segment(length=0.05, outer_diameter=0.04, end_outer_diameter=0.06, inner_diameter=0.012,
                      material=LOSSY, core=CARBIDE),
    "only the bore": Segment(length=0.05, outer_diameter=0.04, inner_diameter=0.02, end_inner_diameter=0.0,
                             material=LOSSY),
}  # fmt: skip
MOTIONS = ("bending", "axial", "torsion")
Motion = Literal["bending", "axial", "torsion"]


def _whole(*segments: Segment, motion: Motion = "bending", inside: Any = ()) -> NDArray[np.complex128]:
    """Receptance over both ends, with coordinates inside that only divide the segments."""
    assembly = Assembly([Part(segments, name="part")], motion=motion)
    ways: Any = ("y", "theta") if motion == "bending" else ("y",)
    points = [Coordinate("part", x, way) for x in (0.0, "end", *inside) for way in ways]
    size = 2 * len(ways)
    return assembly.receptance(F, response=points, excitation=points)[:, :size, :size]


def _uniform(cone: Segment, share: float, length: float) -> Segment:
    outer, inner = cone.at(share)
    return replace(cone, length=length, outer_diameter=outer, inner_diameter=inner, end_outer_diameter=None,
                   end_inner_diameter=None)  # fmt: skip


def _turned(cone: Segment) -> Segment:
    (outer, inner), (end_outer, end_inner) = cone.ends
    return replace(cone, outer_diameter=end_outer, inner_diameter=end_inner, end_outer_diameter=outer,
                   end_inner_diameter=inner)  # fmt: skip


@pytest.mark.parametrize("motion", MOTIONS)
def test_equal_ends_are_a_cylinder(motion: Motion) -> None:
    tube = Segment(length=0.1, outer_diameter=0.05, inner_diameter=0.02, material=LOSSY)
    cone = replace(tube, end_outer_diameter=0.05, end_inner_diameter=0.02)
    np.testing.assert_allclose(_whole(cone, motion=motion), _whole(tube, motion=motion), rtol=1e-11)


@pytest.mark.parametrize("name", CONES)
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_turned_cone_is_the_reversed_one(name: str, motion: Motion) -> None:
    cone = CONES[name]
    back = _whole(_turned(cone), motion=motion)
    if motion == "bending":
        # The axis points the other way: ends change places and slopes change sign.
        order, sign = [2, 3, 0, 1], np.outer([1, -1, 1, -1], [1, -1, 1, -1])
        back = back[:, order][:, :, order] * sign
    else:
        back = back[:, ::-1, ::-1]
    np.testing.assert_allclose(_whole(cone, motion=motion), back, rtol=1e-11)


@pytest.mark.parametrize("name", CONES)
@pytest.mark.parametrize("motion", MOTIONS)
def test_coordinates_and_cuts_inside_change_nothing(name: str, motion: Motion) -> None:
    cone = CONES[name]
    whole = _whole(cone, motion=motion)
    inside = _whole(cone, motion=motion, inside=(0.1 * cone.length, 0.013, 0.9 * cone.length))
    np.testing.assert_allclose(inside, whole, rtol=1e-11)
    np.testing.assert_allclose(_whole(cone.between(0.0, 0.3), cone.between(0.3, 1.0), motion=motion), whole, rtol=1e-11)


def test_a_vanishing_attachment_inside_changes_nothing() -> None:
    part = Part([CONES["bore"]], name="part")
    mass = PointMass(part="part", position=0.031, mass=1e-18, name="mass")
    np.testing.assert_allclose(Assembly([part], [mass]).receptance(F), Assembly([part]).receptance(F), rtol=1e-11)


@pytest.mark.parametrize("name", CONES)
def test_cylinders_with_extrapolation_converge_to_it(name: str) -> None:
    """The error of n cylinders with the sections of their middles is a series in n^-2; three terms are removed."""
    cone, low = CONES[name], F <= 9e3
    counts = (40, 80, 160, 320)

    def divided(count: int) -> NDArray[np.complex128]:
        return _whole(*(_uniform(cone, (i + 0.5) / count, cone.length / count) for i in range(count)))[low]

    table = [divided(count) for count in counts]
    crude = np.abs(table[0] / _whole(cone)[low] - 1.0).max()
    for order in (1, 2, 3):
        table = [(4**order * fine - coarse) / (4**order - 1) for coarse, fine in pairwise(table)]
    error = np.abs(table[0] / _whole(cone)[low] - 1.0).max()
    print(f"{name}: {counts[0]} cylinders {crude:.1e}, extrapolated {error:.1e}")
    assert error < 1e-8 < crude


def _ritz(segment: Segment, degree: int = 36) -> NDArray[np.float64]:
    """Natural frequencies of the free cone in Hz from Legendre polynomials for y and theta: a matrix eigenproblem."""
    ring, core = ((m.youngs_modulus, m.density, m.poisson_ratio, 0.0) if m else None
                  for m in (segment.material, segment.core))  # fmt: skip
    outer, inner = zip(*segment.ends, strict=True)
    assert ring
    cone = Cone(segment.length, outer, inner, ring, core, segment.shear)
    x, weight = legendre.leggauss(degree + 30)
    shear, bending, mass, inertia = np.array([section(cone, 0.5 * (1.0 + at)) for at in x]).T * weight
    half = 0.5 * segment.length
    values = legendre.legvander(x, degree) * np.sqrt(np.arange(degree + 1) + 0.5)
    slopes = np.array([legendre.legval(x, legendre.legder(row)) for row in np.eye(degree + 1)]).T
    slopes = slopes * np.sqrt(np.arange(degree + 1) + 0.5) / half
    n = degree + 1
    # The shear strain is y' - theta.
    strain = np.hstack([slopes, -values])
    stiffness = half * (strain.T * shear) @ strain
    stiffness[n:, n:] += half * (slopes.T * bending) @ slopes
    kinetic = np.zeros((2 * n, 2 * n))
    kinetic[:n, :n] = half * (values.T * mass) @ values
    kinetic[n:, n:] = half * (values.T * inertia) @ values
    squares: NDArray[np.float64] = eigh(stiffness, kinetic, eigvals_only=True)
    return np.sqrt(np.abs(squares)) / (2.0 * np.pi)


@pytest.mark.parametrize("name", CONES)
def test_natural_frequencies_are_those_of_a_matrix_and_none_is_missed(name: str) -> None:
    upper = 200e3
    exact = _ritz(CONES[name])
    rigid = exact[exact < 10.0]
    assert rigid.size == 2
    exact = exact[(exact >= 10.0) & (exact < upper)]
    frequencies = Assembly([Part([CONES[name]])]).natural_frequencies(upper)
    assert frequencies.size == exact.size
    print(f"{name}: {exact.size} modes to {upper:g} Hz, {np.abs(frequencies / exact - 1.0).max():.1e}")
    np.testing.assert_allclose(frequencies, exact, rtol=1e-9)


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_long_row_has_as_many_modes_as_its_fine_cylinders(motion: Motion) -> None:
    """Slender and stout cones in a row; cylinders of a hundredth of the length each."""
    cones = [
        Segment(length=0.3, outer_diameter=0.01, end_outer_diameter=0.03, material=STEEL),
        Segment(length=0.1, outer_diameter=0.06, end_outer_diameter=0.03, material=STEEL),
        Segment(length=0.2, outer_diameter=0.03, end_outer_diameter=0.04, end_inner_diameter=0.02, material=CARBIDE),
    ]
    fine = [_uniform(cone, (i + 0.5) / 100, cone.length / 100) for cone in cones for i in range(100)]
    exact, divided = (Assembly([Part(row)], motion=motion).natural_frequencies(60e3) for row in (cones, fine))
    assert exact.size == divided.size
    np.testing.assert_allclose(exact, divided, rtol=2e-4)


def test_the_sum_of_the_modes_is_the_receptance() -> None:
    part = Part([CONES["bore"], Segment(length=0.08, outer_diameter=0.04, material=LOSSY)], name="part")
    free = Assembly([part])
    shapes = mode_shapes(free, 400e3)
    w = 2.0 * np.pi * np.array([2e3, 5e3])[:, None]
    wr = 2.0 * np.pi * shapes.frequency_hz
    rigid = _rigid(part, w)
    summed = rigid + np.sum(shapes.y[:, 0] ** 2 / (wr**2 - w**2 + 2j * shapes.damping_ratio * wr * w), axis=1)
    np.testing.assert_allclose(summed, free.receptance(w[:, 0] / (2.0 * np.pi)), rtol=0.02)


def _rigid(part: Part, w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Receptance of the rigid body at its near end, from mass, centre of gravity and inertia of many discs."""
    x, mass, inertia, start = [], [], [], 0.0
    for segment in part.segments:
        shares = (np.arange(2000) + 0.5) / 2000
        outer, inner = np.array([segment.at(share) for share in shares]).T
        disc = segment.material.density * np.pi / 4 * (outer**2 - inner**2) * segment.length / 2000
        x.append(start + shares * segment.length)
        mass.append(disc)
        inertia.append(disc * (outer**2 + inner**2) / 16)
        start += segment.length
    places, masses = np.concatenate(x), np.concatenate(mass)
    centre = np.average(places, weights=masses)
    moment = np.sum(masses * (places - centre) ** 2) + np.sum(np.concatenate(inertia))
    return -(1.0 / masses.sum() + centre**2 / moment) / w[:, 0] ** 2


def test_mass_is_that_of_many_discs() -> None:
    for cone in CONES.values():
        discs = sum(_uniform(cone, (i + 0.5) / 3000, cone.length / 3000).mass for i in range(3000))
        assert cone.mass == pytest.approx(discs, rel=1e-7)


def _tool(end: float) -> Assembly:
    neck = Segment(length=0.05, outer_diameter=0.01, end_outer_diameter=end, material=CARBIDE)
    holder = Part([Segment(length=0.1, outer_diameter=0.05, material=LOSSY)], name="holder")
    joint = PointJoint(k_y=3e8, k_theta=4e4, c_y=200.0, c_theta=0.3, name="joint")
    return Assembly([Part([neck], name="tool"), joint, holder])


@pytest.mark.parametrize("start", [0.012, 0.03])
def test_an_unknown_end_is_identified(start: float) -> None:
    lines = np.linspace(200.0, 6e3, 300)
    observation = Observation(
        assembly=_tool(start), frequency_hz=lines, receptance=_tool(0.0187).receptance(lines), standard_deviation=0.01
    )
    unknowns = [
        Unknown(address="tool.segment[0].end_outer_diameter", lower=0.011, upper=0.04),
        Unknown(address="joint.k_theta", lower=1e3, upper=1e6),
    ]
    values = identify([observation], unknowns).values
    assert values["tool.segment[0].end_outer_diameter"] == pytest.approx(0.0187, rel=1e-6)
    assert values["joint.k_theta"] == pytest.approx(4e4, rel=1e-5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"end_outer_diameter": 0.0}, "end_outer_diameter is 0, expected more than zero m"),
        ({"end_outer_diameter": float("nan")}, "end_outer_diameter is nan, expected a finite number of m"),
        ({"end_inner_diameter": -0.001}, "end_inner_diameter is -0.001, expected zero or more m"),
        (
            {"end_outer_diameter": 0.015},
            r"bore at the far end is 0.02 m \(end_inner_diameter\), expected less than the",
        ),
        ({"end_inner_diameter": 0.05}, "bore at the far end is 0.05 m .* outer diameter 0.05 m there"),
        ({"core": CARBIDE, "end_inner_diameter": 0.0}, "core is given and end_inner_diameter is 0, expected a bore"),
    ],
)
def test_messages_name_the_end(change: dict[str, Any], words: str) -> None:
    tube: dict[str, Any] = {"length": 0.1, "outer_diameter": 0.05, "inner_diameter": 0.02, "material": STEEL}
    with pytest.raises(ValueError, match=f"Segment: .*{words}"):
        Segment(**{**tube, **change})


def test_texts_are_no_diameters() -> None:
    text: Any = "60 mm"
    with pytest.raises(TypeError, match="end_outer_diameter is '60 mm', expected a finite number"):
        Segment(length=0.1, outer_diameter=0.05, end_outer_diameter=text, material=STEEL)


def _row(rng: np.random.Generator) -> list[Segment]:
    """Return a cylinder and a cone in random order, with a conical bore or none."""
    near, far = rng.uniform(0.01, 0.05, 2)
    bore = rng.choice([0.0, 0.3])
    cone = Segment(length=rng.uniform(0.02, 0.08), outer_diameter=near, end_outer_diameter=far,
                   inner_diameter=bore * near, end_inner_diameter=bore * far, material=LOSSY)  # fmt: skip
    row = [cone, Segment(length=rng.uniform(0.01, 0.04), outer_diameter=far, material=LOSSY)]
    return row if rng.uniform() < 0.5 else row[::-1]


def _two_parts(rng: np.random.Generator) -> Assembly:
    joint = PointJoint(k_y=10 ** rng.uniform(7, 9), k_theta=10 ** rng.uniform(4, 6), name="joint")
    return Assembly([Part(_row(rng), name="tool"), joint, Part(_row(rng), name="holder")])


def test_many_lines_are_few_lines() -> None:
    """Many lines share one series of the branches, few are swept from slice to slice."""
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    for _ in range(20):
        assembly = _two_parts(rng)
        for part, x in (("tool", 0.0), ("holder", "end"), ("holder", 0.005)):
            point: Any = Coordinate(part, x)
            lines = np.linspace(20.0, 10 ** rng.uniform(3.0, 4.3), 300)
            many = assembly.receptance(lines, response=point, excitation=point)
            swept = [assembly.receptance(some, response=point, excitation=point) for some in np.array_split(lines, 3)]
            size = np.abs(np.concatenate(swept))
            # Beside an antiresonance the digits of the neighbours count.
            size = np.maximum(size, 1e-2 * np.median(size))
            assert np.all(np.abs(many - np.concatenate(swept)) <= 1e-11 * size)


def test_many_joints_between_cones_share_one_series() -> None:
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    lines = np.linspace(100.0, 4e3, 200)
    names = ("joint.k_y", "joint.k_theta", "joint.c_theta")
    for part, x in (("tool", 0.0), ("holder", "end")):
        for way in ("y", "theta"):
            assembly = _two_parts(rng)
            point: Any = Coordinate(part, x, way)  # type: ignore[arg-type]
            reduced = assembly.reduced_to_joint("joint", lines, response=point, excitation=point, threads=1)
            assert reduced.planes() is None
            joints = 10.0 ** rng.uniform([6.0, 3.0, -2.0], [10.0, 7.0, 1.0], (4, 3))
            swept = parametric_receptance(assembly, names, lines, point, point).receptance(joints)
            for values, found in zip(joints, swept, strict=True):
                other = assembly.replace(dict(zip(names, values.tolist(), strict=True)))
                # Few lines at a time: no series.
                few = [other.receptance(some, response=point, excitation=point) for some in np.array_split(lines, 2)]
                size = np.abs(np.concatenate(few))
                size = np.maximum(size, 1e-2 * np.median(size))
                assert np.all(np.abs(found - np.concatenate(few)) <= 1e-10 * size)


def test_extreme_but_valid_cones_are_finite() -> None:
    """Walls that nearly vanish, needles, and soft materials."""
    soft = Material(youngs_modulus=1e6, density=1000.0, poisson_ratio=0.45, loss_factor=0.3)
    for cone in (
        Segment(length=0.05, outer_diameter=0.04, end_outer_diameter=1e-4, material=LOSSY),
        Segment(length=0.05, outer_diameter=0.04, inner_diameter=0.02, end_inner_diameter=0.0399999, material=LOSSY),
        Segment(length=0.2, outer_diameter=0.01, end_outer_diameter=0.02, material=soft),
    ):
        assert np.all(np.isfinite(_whole(cone)))


@pytest.mark.parametrize("motion", MOTIONS)
def test_derivatives_of_every_motion_agree_with_differences(motion: Motion) -> None:
    cone = replace(CONES["filled"], end_inner_diameter=0.01, core=replace(CARBIDE, loss_factor=0.002))
    lines = [2e3, 3e4]

    def assembly(values: dict[str, float]) -> Assembly:
        return Assembly([Part([cone.with_values(values)], name="nose")], motion=motion)

    names = list(cone.places)
    receptance, slopes = assembly({}).derivatives(lines, [f"nose.segment[0].{name}" for name in names])
    for name, slope in zip(names, np.moveaxis(slopes, -1, 0), strict=True):
        value = cone.columns[cone.places[name]]
        step = 1e-3 * value
        steps = [assembly({name: value + count * step}).receptance(lines) for count in (1, -1, 2, -2)]
        # A central difference of fourth order: what it leaves out is 1e-12 times powers of the distance to resonances.
        difference = (8.0 * (steps[0] - steps[1]) - (steps[2] - steps[3])) / (12.0 * step)
        size = np.abs(difference) + np.abs(receptance) / value
        assert np.all(np.abs(slope.reshape(difference.shape) - difference) <= 1e-7 * size), name
