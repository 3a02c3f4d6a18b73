"""Passive linear structures: the receptance is symmetric, and no power is generated."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from properties.strategies import assemblies, between_ends, both_ends, frequencies, logarithmic, parts, scaled
from receptance import Assembly, Coordinate, Part

LEVER = 0.05


def spread(assembly: Assembly, shares: list[float]) -> list[Coordinate]:
    """Return both ends, both sides of the joint and places inside the parts."""
    points = both_ends(assembly)
    for direction in ("y", "theta"):
        points += [Coordinate("tool", "end", direction), Coordinate("holder", 0.0, direction)]
        for name, share in zip(("tool", "holder"), shares, strict=True):
            part = assembly.elements[name]
            assert isinstance(part, Part)
            points.append(Coordinate(name, share * part.length, direction))
    return points


@given(part=parts(), f=frequencies())
def test_free_part_is_reciprocal(part: Part, f: np.ndarray) -> None:
    h = between_ends(part, f)
    size = np.sqrt(np.abs(np.einsum("nii,njj->nij", h, h)))
    assert np.all(np.abs(h - h.transpose(0, 2, 1)) <= 1e-9 * np.maximum(np.abs(h), 1e-3 * size))


@given(assembly=assemblies(), f=frequencies(), shares=st.tuples(st.floats(0.05, 0.95), st.floats(0.05, 0.95)))
def test_assembly_is_reciprocal_across_the_joint_and_inside(
    assembly: Assembly, f: np.ndarray, shares: tuple[float, float]
) -> None:
    points = spread(assembly, list(shares))
    h = assembly.receptance(f, response=points, excitation=points)
    size = np.sqrt(np.abs(np.einsum("nii,njj->nij", h, h)))
    assert np.all(np.abs(h - h.transpose(0, 2, 1)) <= 1e-9 * np.maximum(np.abs(h), 1e-3 * size))


@given(assembly=assemblies(), f=frequencies())
def test_matrix_call_equals_calls_for_single_pairs(assembly: Assembly, f: np.ndarray) -> None:
    """Reciprocity by separate calls: the tip under a load at the holder's end, and the other way round."""
    tip, end = Coordinate(), Coordinate("holder", "end", "theta")
    there = assembly.receptance(f, response=tip, excitation=end)
    back = assembly.receptance(f, response=end, excitation=tip)
    np.testing.assert_allclose(there, back, rtol=1e-6)
    both = assembly.receptance(f, response=[tip, end], excitation=[tip, end])
    np.testing.assert_allclose(both[:, 0, 1], there, rtol=1e-10)
    np.testing.assert_allclose(both[:, 1, 0], back, rtol=1e-10)


@given(assembly=assemblies(lossy=True), f=frequencies())
def test_drive_points_dissipate_energy(assembly: Assembly, f: np.ndarray) -> None:
    points = both_ends(assembly)
    h = assembly.receptance(f, response=points, excitation=points)
    assert np.all(np.einsum("nii->ni", h).imag < 0)


@given(
    assembly=assemblies(),
    f=frequencies(),
    seed=st.integers(0, 2**32 - 1),
    shares=st.tuples(st.floats(0.05, 0.95), st.floats(0.05, 0.95)),
)
def test_every_load_dissipates_power(assembly: Assembly, f: np.ndarray, seed: int, shares: tuple[float, float]) -> None:
    """-Im(f^H H f) is the power put in over w/2: it is not negative for any loads on any places."""
    points = spread(assembly, list(shares))
    h = assembly.receptance(f, response=points, excitation=points)
    direction = np.array([point.direction == "theta" for point in points])
    h = h * np.where(direction, 1 / LEVER, 1.0)[:, None] * np.where(direction, 1 / LEVER, 1.0)
    rng = np.random.default_rng(seed)
    for _ in range(5):
        load = rng.normal(size=len(points)) + 1j * rng.normal(size=len(points))
        power = -np.einsum("i,nij,j->n", load.conj(), h, load).imag
        size = np.einsum("i,nij,j->n", np.abs(load), np.abs(h), np.abs(load))
        assert np.all(power >= -1e-9 * size)


@given(assembly=assemblies(lossy=True, grounded=True), f=frequencies(), decay=logarithmic(1.0, 30.0))
def test_a_decaying_line_is_analytic_in_the_frequency(assembly: Assembly, f: np.ndarray, decay: float) -> None:
    """Lines may be complex: H is analytic in w, so its differences along both axes of the plane agree."""
    points = both_ends(assembly)
    w = f[:1] + 0j
    # Poles of a passive structure are at least the decay away: an error of truncation of 2e-4 at most.
    step = np.minimum(1e-4 * w.real, 1e-2 * decay / (2 * np.pi))
    sides = [assembly.receptance(line - 1j * decay / (2 * np.pi), response=points, excitation=points)
             for line in (w + step, w - step, w + 1j * step, w - 1j * step)]  # fmt: skip
    along, across = (sides[0] - sides[1]) / 2, (sides[2] - sides[3]) / 2j
    size = np.abs(scaled(sides[0], LEVER)).max()
    assert np.abs(scaled(along - across, LEVER)).max() <= 1e-3 * np.abs(scaled(along, LEVER)).max() + 1e-9 * size
