"""Cones of the core against Taylor series in 30 digits: receptances, poles, derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import mpmath as mp
import numpy as np
import pytest
from numpy.typing import NDArray

from oracle.cones import CONSTANTS, DIGITS, Cone, determinant, pieces, receptance
from receptance import Assembly, Coordinate, Material, Part, Segment

SEED = 20261139
STEEL, CARBIDE = (210e9, 7850.0, 0.3, 0.003), (580e9, 14500.0, 0.22, 0.002)
LINES = (1.0, 40.0, 1e3, 5e3, 2e4, 5e4)
CONES = {
    "nose with a bore": Cone(0.05, (0.04, 0.06), (0.012, 0.012), STEEL),
    "solid": Cone(0.06, (0.03, 0.06), ring=STEEL),
    "solid, slender": Cone(0.15, (0.012, 0.02), ring=CARBIDE),
    "bore that tapers to nothing": Cone(0.07, (0.04, 0.05), (0.03, 0.0), STEEL),
    "filled": Cone(0.05, (0.04, 0.06), (0.012, 0.02), STEEL, CARBIDE),
    "thin wall": Cone(0.08, (0.04, 0.06), (0.039, 0.0592), STEEL, shear="hutchinson"),
    "ten to one": Cone(0.05, (0.005, 0.05), ring=STEEL),
    "bore against the cone": Cone(0.1, (0.06, 0.03), (0.01, 0.025), STEEL),
    "without damping": Cone(0.06, (0.05, 0.025), (0.01, 0.0), (210e9, 7850.0, 0.3, 0.0)),
}
Motion = Literal["bending", "axial", "torsion"]


def _material(layer: tuple[Any, ...]) -> Material:
    return Material(**dict(zip(CONSTANTS, layer, strict=True)))


def _segment(cone: Cone) -> Segment:
    return Segment(
        length=cone.length,
        outer_diameter=cone.outer[0],
        inner_diameter=cone.inner[0],
        end_outer_diameter=cone.outer[1],
        end_inner_diameter=cone.inner[1],
        material=_material(cone.ring),
        core=_material(cone.core) if cone.core else None,
        shear=cone.shear,  # type: ignore[arg-type]
    )


def _assembly(*cones: Cone, motion: Motion = "bending") -> Assembly:
    return Assembly([Part([_segment(cone) for cone in cones], name="part")], motion=motion)


def _points(motion: Motion, *positions: float | str) -> list[Coordinate]:
    ways: tuple[Literal["y", "theta"], ...] = ("y", "theta") if motion == "bending" else ("y",)
    return [Coordinate("part", x, way) for x in positions for way in ways]  # type: ignore[arg-type]


def _floats(matrix: mp.matrix) -> NDArray[np.complex128]:
    return np.array(matrix.tolist(), dtype=np.complex128)


def _difference(cones: list[Cone], lines: tuple[float, ...], motion: Motion) -> float:
    """Largest relative difference of an entry over both ends of a row of cones."""
    points = _points(motion, 0.0, "end")
    values = _assembly(*cones, motion=motion).receptance(lines, response=points, excitation=points)
    n, worst = len(points) // 2, 0.0
    for f, value in zip(lines, values, strict=True):
        exact = _floats(receptance(cones, f, motion))
        ends = np.r_[0:n, exact.shape[0] - n : exact.shape[0]]
        worst = max(worst, float(np.abs(value / exact[np.ix_(ends, ends)] - 1.0).max()))
    return worst


@pytest.mark.parametrize("name", CONES)
@pytest.mark.parametrize("motion", [pytest.param("bending", marks=pytest.mark.slow), "axial", "torsion"])
def test_both_ends_from_1_hz_to_50_khz(name: str, motion: Motion) -> None:
    worst = _difference([CONES[name]], LINES, motion)
    print(f"{name}, {motion}: {worst:.1e}")
    assert worst < 1e-11


@pytest.mark.parametrize("name", ["nose with a bore", "filled"])
def test_both_ends_at_some_lines(name: str) -> None:
    assert _difference([CONES[name]], (1.0, 2e4), "bending") < 1e-11


def _random_cone(rng: np.random.Generator) -> Cone:
    """A cone of any size, with ratios up to 10 of the outer diameters, perhaps with a bore and a core."""
    near = 10 ** rng.uniform(-2.3, -1.0)
    outer = (near, near * 10 ** rng.uniform(-1.0, 1.0))
    kind = rng.integers(3)
    inner = tuple(float(d * rng.uniform(0.02, 0.97)) if kind else 0.0 for d in outer)
    layers = [tuple(np.array(layer) * [*rng.uniform(0.8, 1.2, 3), rng.uniform(0, 5)]) for layer in (STEEL, CARBIDE)]
    ring, core = (tuple(map(float, layer)) for layer in layers)
    length = float(10 ** rng.uniform(-2.0, -0.5))
    shear = ("cowper", "hutchinson")[int(rng.integers(2))]
    return Cone(length, tuple(map(float, outer)), inner, ring, core if kind == 2 else None, shear)  # type: ignore[arg-type]


@pytest.mark.slow
def test_random_rows_of_cones() -> None:
    """A resonance of little damping near a line makes the comparison worse, as it does for cylinders."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    worst = []
    for _ in range(12):
        cones = [_random_cone(rng) for _ in range(rng.integers(1, 3))]
        line = float(10 ** rng.uniform(0.0, 4.7))
        worst.append(_difference(cones, (line,), "bending"))
    print("largest differences:", *(f"{value:.1e}" for value in sorted(worst)))
    assert max(worst) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("name", ["nose with a bore", "filled", "ten to one"])
def test_complex_natural_frequencies(name: str) -> None:
    """The matrix from motions to forces is singular there: steps of the secant method hardly move."""
    cone = CONES[name]
    assembly = _assembly(cone)
    undamped = assembly.natural_frequencies(60e3)
    assert undamped.size
    poles, _ = assembly.complex_frequencies(undamped)
    for pole in poles[:3]:
        with mp.workdps(DIGITS):
            root = mp.findroot(lambda f: determinant(cone, f), (mp.mpc(pole), mp.mpc(pole) * (1 + mp.mpf(1e-9))),
                               tol=1e-8, verify=False, maxsteps=6)  # fmt: skip
        assert abs(complex(root) / pole - 1.0) < 1e-10


ROW = [
    Cone(0.03, (0.02, 0.03), (0.004, 0.008), STEEL),
    Cone(0.06, (0.03, 0.055), (0.012, 0.006), STEEL, CARBIDE),
]
INSIDE = (0.012, 0.05, 0.071)
"""Places of coordinates: one in the first cone, two in the second one."""


def _row(name: str = "", step: Any = 0) -> list[Cone]:
    """Pieces of the row between the coordinates, one parameter shifted by a share of it; the coordinates stay."""
    cones = list(ROW)
    if name:
        number = int(name.split("[")[1][0])
        quantity = name.split("].")[1]
        value = mp.mpf(cones[number].value(quantity))
        cones[number] = cones[number].with_value(quantity, value * (1 + step))
    first, second = cones
    inner = [INSIDE[1] - mp.mpf(first.length), mp.mpf(INSIDE[2]) - INSIDE[1]]
    return [*pieces(first, [mp.mpf(INSIDE[0])]), *pieces(second, inner)]


def _addresses() -> list[str]:
    shared = ["length", "outer_diameter", "inner_diameter", "end_outer_diameter", "end_inner_diameter", *CONSTANTS]
    core = [f"core.{constant}" for constant in CONSTANTS]
    return [f"part.segment[0].{name}" for name in shared] + [f"part.segment[1].{name}" for name in (*shared, *core)]


@pytest.mark.slow
def test_every_address_of_a_cone_has_these_derivatives() -> None:
    """Central differences of the series, their step 1e-8 of the parameter: exact to sixteen digits or so."""
    addresses = _addresses()
    assembly = _assembly(*ROW)
    assert sorted(addresses) == sorted(assembly.parameters)
    points = _points("bending", 0.0, INSIDE[0], INSIDE[1], INSIDE[2], "end")
    # The node between both segments is no coordinate.
    nodes = [0, 1, 2, 3, 6, 7, 8, 9, 10, 11]
    for line in (300.0, 3e4):
        _, slopes = assembly.derivatives([line], addresses, response=points, excitation=points)
        for number, address in enumerate(addresses):
            with mp.workdps(DIGITS):
                step = mp.mpf(10) ** -8
                up, down = (receptance(_row(address, sign * step), line) for sign in (1, -1))
                value = ROW[int(address.split("[")[1][0])].value(address.split("].")[1])
                exact = _floats((up - down) / (2 * step * mp.mpf(value)))[np.ix_(nodes, nodes)]
            own = slopes[0, ..., number]
            # Each entry has the units of its two coordinates.
            scale = np.sqrt(np.outer(np.abs(np.diag(exact)), np.abs(np.diag(exact)))) + np.abs(exact)
            worst = float((np.abs(own - exact) / scale).max())
            print(f"{line:g} Hz, {address}: {worst:.1e}")
            assert worst < 1e-8


@pytest.mark.slow
def test_natural_frequencies_have_these_derivatives() -> None:
    """That of the implicit function that the determinant defines, by differences, without damping."""
    cone = replace(ROW[1], ring=(*STEEL[:3], 0.0), core=(*CARBIDE[:3], 0.0))
    assembly = _assembly(cone)
    names = [name for name in _addresses() if name.startswith("part.segment[1]") and "loss" not in name]
    names = [name.replace("[1]", "[0]") for name in names]
    frequency, slopes = assembly.natural_frequency_derivatives(40e3, names)

    def slope(along: Callable[[Any], Any], step: Any) -> Any:
        return (along(step) - along(-step)) / (2 * step)

    with mp.workdps(DIGITS):
        first, step = mp.mpf(frequency[0]), mp.mpf(10) ** -8
        by_frequency = slope(lambda h: determinant(cone, first + h), first * step)
        for number, name in enumerate(names):
            quantity = name.split("].")[1]
            value = mp.mpf(cone.value(quantity))
            moved = slope(lambda h, q=quantity, v=value: determinant(cone.with_value(q, v + h), first), value * step)
            assert slopes[0, number] == pytest.approx(float(mp.re(-moved / by_frequency)), rel=1e-8), name
