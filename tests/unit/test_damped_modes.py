"""Complex modes of assemblies: against closed forms, the receptance itself, and differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from oracle import elements, tables
from oracle.tables import Tables
from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    Material,
    Part,
    PointJoint,
    PointMass,
    Section,
    Segment,
    SpreadJoint,
    damped_modes,
)

SEED = 20261121
PARAMETERS = [
    "joint.k_theta",
    "joint.c_theta",
    "front.c_y",
    "rear.k_y",
    "tool.segment[0].length",
    "holder.segment[*].density",
]


def machine(overhang: float = 0.07, **changes: float) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.09, outer_diameter=0.04, material=STEEL)], name="holder")
    spindle = Part([Segment(length=0.4, outer_diameter=0.065, inner_diameter=0.03, material=STEEL)], name="spindle")
    joint = PointJoint(k_y=2e8, k_theta=4e4, c_y=60.0, c_theta=0.5, name="joint")
    taper = PointJoint(k_y=6e8, k_theta=1.5e6, c_y=500.0, c_theta=5.0, name="taper")
    springs = [
        GroundSpring(part="spindle", position=0.08, k_y=2.5e8, c_y=1500.0, name="front"),
        GroundSpring(part="spindle", position=0.32, k_y=1.5e8, c_y=1500.0, name="rear"),
    ]
    return Assembly([tool, joint, holder, taper, spindle], springs).replace(changes)


def test_a_mass_on_a_spring() -> None:
    """A short, stiff, nearly massless bar with a mass at its end: m, k and c are all there is."""
    rigid = Material(youngs_modulus=1e18, density=1e-3, poisson_ratio=0.3)
    bar = Part([Segment(length=0.01, outer_diameter=0.01, material=rigid)], name="bar")
    held = GroundSpring(part="bar", k_y=2e6, k_theta=1e12, c_y=40.0, name="held")
    modes = damped_modes(
        Assembly([bar], [held, PointMass(part="bar", mass=0.5, name="mass")]), 1e3, ["held.k_y", "held.c_y"]
    )
    w = np.sqrt(2e6 / 0.5)
    zeta = 40.0 / (2.0 * 0.5 * w)
    assert len(modes) == 1
    np.testing.assert_allclose(modes.frequency_hz, w / (2.0 * np.pi), rtol=1e-6)
    np.testing.assert_allclose(modes.damping_ratio, zeta, rtol=1e-6)
    np.testing.assert_allclose(modes.modal_constant, 1.0 / 0.5, rtol=1e-5)
    # k_y: w^2 = k / m, zeta = c / 2 sqrt(k m); c_y: zeta in proportion.
    np.testing.assert_allclose(modes.log_slopes[0, :2, 0] * 2e6, [0.5, -0.5], rtol=1e-5)
    np.testing.assert_allclose(modes.log_slopes[0, :2, 1] * 40.0, [0.0, 1.0], atol=1e-6)


def test_the_modes_make_up_the_receptance() -> None:
    """Poles and residues of all modes, with a smooth remainder."""
    own = machine()
    modes = damped_modes(own, 15e3)
    f = np.linspace(100.0, 6000.0, 1200)
    g = own.receptance(f)
    terms = modes.residue / (2.0 * np.pi * (f[:, None] - modes.poles_hz))
    mirrored = -modes.residue.conj() / (2.0 * np.pi * (f[:, None] + modes.poles_hz.conj()))
    rest = g - (terms + mirrored).sum(axis=1)
    assert modes.missed == 0
    assert np.abs(rest).max() < 0.02 * np.abs(g).max()
    # The remainder has no peak: a parabola describes it.
    scaled = f / f[-1]
    fit = np.polynomial.polynomial.Polynomial.fit(scaled, rest.real, 6)
    assert np.abs(rest.real - fit(scaled)).max() < 2e-5 * np.abs(g).max()


@pytest.mark.parametrize("place", [None, Coordinate("holder", 0.03, "y")], ids=["tip", "transfer"])
def test_derivatives_against_differences(place: Coordinate | None) -> None:
    own = machine()
    modes = damped_modes(own, 5e3, PARAMETERS, response=place)
    assert len(modes) >= 4
    for column, address in enumerate(PARAMETERS):
        step = 1e-5 * own.get(address)
        pair = [damped_modes(own.replace({address: own.get(address) + s}), 5e3, response=place) for s in (step, -step)]
        found = np.stack(
            [
                np.log(getattr(pair[0], name) / getattr(pair[1], name)) / (2.0 * step)
                for name in ("frequency_hz", "damping_ratio", "dynamic_stiffness")
            ],
            axis=1,
        )
        expected = modes.log_slopes[:, :, column]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5 * np.abs(expected).max())


def test_all_visible_poles_of_random_machines_are_found() -> None:
    """Against a rational function through the receptance (AAA), moderate damping."""
    interpolate = pytest.importorskip("scipy.interpolate")
    if not hasattr(interpolate, "AAA"):
        pytest.skip("this SciPy has no AAA to compare with")
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    f = np.linspace(20.0, 6000.0, 1200)
    for _ in range(4):
        factors = np.exp(0.4 * rng.standard_normal(8))
        names = [
            "joint.k_y",
            "joint.k_theta",
            "joint.c_theta",
            "taper.k_theta",
            "taper.c_theta",
            "front.k_y",
            "front.c_y",
            "rear.c_y",
        ]
        base = machine(rng.uniform(0.03, 0.15))
        own = base.replace({name: base.get(name) * factor for name, factor in zip(names, factors, strict=True)})
        rational = interpolate.AAA(f, own.receptance(f), rtol=1e-12, max_terms=60)
        poles, residues = rational.poles(), rational.residues()
        visible = (poles.real > 0.0) & (poles.imag > 0.0) & (np.abs(poles) < 5500.0) & (np.abs(residues) > 1e-9)
        found = damped_modes(own, 6000.0)
        for pole, residue in zip(poles[visible], residues[visible], strict=True):
            nearest = int(np.argmin(np.abs(found.poles_hz - pole)))
            assert abs(found.poles_hz[nearest] - pole) < 1e-6 * abs(pole)
            assert abs(found.residue[nearest] / (2.0 * np.pi) - residue) < 1e-4 * abs(residue)


def strongly_damped(rng: np.random.Generator) -> tuple[Assembly, Tables]:
    """A machine with dashpots up to many times critical, as an assembly and as the reference takes it."""
    chain: list[Any] = []
    rows: dict[str, list[list[float]]] = {"segments": [], "joints": [], "grounds": []}
    springs: list[GroundSpring] = []
    node = -1
    count = int(rng.integers(2, 5))
    for part in range(count):
        node += 1
        name = f"part{part}"
        diameter = float(rng.uniform(0.01, 0.03)) * (1 + part)
        lengths = rng.uniform(1.0, 5.0, int(rng.integers(1, 3))) * diameter
        segments = [Segment(length=length, outer_diameter=diameter, material=STEEL) for length in lengths.tolist()]
        first = node
        for segment in segments:
            material = (STEEL.youngs_modulus, STEEL.density, STEEL.poisson_ratio)
            rows["segments"].append(tables.segment(node, node + 1, segment.length, diameter, material))
            node += 1
        chain.append(Part(segments, name=name))
        for at in [first, node] if part == count - 1 else [node] if rng.random() < 0.3 else []:
            k, c = spring(rng, diameter)
            place = 0.0 if at == first else "end"
            springs.append(
                GroundSpring(part=name, position=place, k_y=k[0], k_theta=k[1], c_y=c[0], c_theta=c[1], name=f"g{at}")
            )
            rows["grounds"].append([at, *k, 0.0, *c, 0.0, 0.0])
        if part < count - 1:
            k, c = spring(rng, diameter)
            chain.append(PointJoint(k_y=k[0], k_theta=k[1], c_y=c[0], c_theta=c[1], name=f"joint{part}"))
            rows["joints"].append(tables.joint(node, node + 1, *k, c=(*c, 0.0)))
    return Assembly(chain, springs), tables.make(**rows)


def spring(rng: np.random.Generator, diameter: float) -> tuple[list[float], list[float]]:
    """Stiffness and dashpot, the latter from a hundredth to thirty times k / w at 1 kHz."""
    k_y = float(10.0 ** rng.uniform(6.0, 9.0))
    k = [k_y, k_y * diameter**2 * float(10.0 ** rng.uniform(-1.0, 0.5))]
    return k, [value / (2.0 * np.pi * 1e3) * float(10.0 ** rng.uniform(-2.0, 1.5)) for value in k]


def test_strong_dashpots_against_a_quadratic_eigenproblem() -> None:
    """Against finite elements, without waves or determinants: as many poles, and the same ones."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    limit = 5e3
    lowest, poles = [], 0
    for draw in range(25):
        own, reference = strongly_damped(rng)
        expected = elements.complex_frequencies(reference, 1.5 * limit)
        expected = expected[expected.imag <= 0.9 * np.abs(expected)]
        found = damped_modes(own, limit)
        # Of those within rounding of the limit the reference has the same number or not.
        inside = expected[np.abs(expected) <= limit * (1.0 + 1e-6)]
        assert found.missed == 0, f"draw {draw}"
        assert len(found) == len(inside), f"draw {draw}: {found.poles_hz} instead of {inside}"
        np.testing.assert_allclose(found.poles_hz, inside, rtol=1e-6, err_msg=f"draw {draw}")
        lowest.append(found.damping_ratio[0])
        poles += len(found)
    assert poles > 100
    # Lightly damped lowest poles of machines with strong dashpots are among them.
    assert np.any(np.abs(np.array(lowest) - 0.01) < 0.005)


@pytest.mark.parametrize("points", [None, 3])
def test_spread_joints_without_damping(points: int | None) -> None:
    """The count of complex poles and the count of undamped modes agree; with dashpots all are found as well."""
    tool = Part([Segment(length=0.06, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.09, outer_diameter=0.04, material=STEEL)], name="holder")
    shank = Section(outer_diameter=0.012, material=CARBIDE)
    sleeve = Section(outer_diameter=0.035, inner_diameter=0.012, material=STEEL)
    joint = SpreadJoint(length=0.03, k_y=2e8, k_theta=2e4, shank=shank, sleeve=sleeve, points=points, name="joint")
    own = Assembly([tool, joint, holder], [GroundSpring(part="holder", position="end", k_y=1e8, k_theta=1e5, name="g")])
    modes = damped_modes(own, 30e3)
    assert modes.missed == 0
    np.testing.assert_allclose(modes.poles_hz, own.natural_frequencies(30e3), rtol=1e-8)
    strong = own.replace({"joint.c_y": 3e4, "joint.c_theta": 3.0, "g.c_y": 5e4, "g.c_theta": 20.0})
    modes = damped_modes(strong, 30e3)
    assert modes.missed == 0
    assert len(modes) >= 5
    around = modes.poles_hz[:, None] * (1.0 + 1e-6 * np.exp(2j * np.pi * np.arange(4) / 4))
    lines = np.sort(around.ravel())
    g = strong.receptance(lines)
    nearest = np.abs(lines[:, None] - modes.poles_hz[None, :]).argmin(axis=1)
    pole = np.mean(np.abs(g * (lines - modes.poles_hz[nearest])) / np.abs(modes.residue[nearest] / (2.0 * np.pi)))
    assert pole == pytest.approx(1.0, abs=1e-2)


def test_errors_and_excluded_poles() -> None:
    with pytest.raises(ValueError, match="upper_hz is -1"):
        damped_modes(machine(), -1.0)
    with pytest.raises(ValueError, match=r"no parameter 'joint\.k_z'"):
        damped_modes(machine(), 1e3, ["joint.k_z"])
    none = damped_modes(machine(), 10.0, PARAMETERS)
    assert len(none) == 0
    assert none.log_slopes.shape == (0, 3, len(PARAMETERS))
