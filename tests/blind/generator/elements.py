"""Finite elements of Timoshenko beams, and structures of them on springs, masses and dashpots.

Displacement and slope of an element are polynomials of one degree through the same points, integrated fully. At degree
five nothing locks, and an element of half a wave length has an error far under 1e-6; pieces that are no longer than
they are thick, between the springs of a spread joint, need less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import linalg

DEGREE, LOW_DEGREE = 5, 2
LONGEST, SHORT = 0.035, 0.004
"""Longest element, and longest one of the low degree, in m; the shortest wave below 8 kHz is some 60 mm long."""

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Matrices = tuple[ComplexArray, FloatArray, FloatArray]
"""Stiffness, mass, viscous damping."""


@dataclass(frozen=True)
class Ring:
    """A circular ring of one material; several around each other that share their motion make a section."""

    outer: float
    inner: float
    modulus: float
    density: float
    poisson: float
    loss: float
    shear: float
    """Shear coefficient."""
    area: float = 1.0
    """Factor of the area; it and the next two are 1 except where a section is no ring."""
    moment: float = 1.0
    """Factor of the second moment that bends."""
    inertia: float = 1.0
    """Factor of the second moment that turns."""


def cowper(outer: float, inner: float, nu: float) -> float:
    """Return Cowper's shear coefficient of a ring."""
    q = (1.0 + (inner / outer) ** 2) ** 2
    m = (inner / outer) ** 2
    return 6.0 * (1.0 + nu) * q / ((7.0 + 6.0 * nu) * q + (20.0 + 12.0 * nu) * m)


def hutchinson(outer: float, inner: float, nu: float) -> float:
    """Return Hutchinson's shear coefficient of a ring, a the outer and b the inner radius."""
    a2, b2 = outer**2 / 4.0, inner**2 / 4.0
    top = 6.0 * (a2 + b2) ** 2 * (1.0 + nu) ** 2
    c = 7.0 * a2**2 + 34.0 * a2 * b2 + 7.0 * b2**2
    d = 12.0 * a2**2 + 48.0 * a2 * b2 + 12.0 * b2**2
    e = 4.0 * a2**2 + 16.0 * a2 * b2 + 4.0 * b2**2
    return top / (c + nu * d + nu**2 * e)


@cache
def shape_functions(degree: int, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights of a number of Gauss points on -1 to 1, and values and slopes of the shapes at the points."""
    inner = legendre.Legendre.basis(degree).deriv().roots()
    nodes = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])
    points, weights = legendre.leggauss(count)
    vandermonde = legendre.legvander(nodes, degree)
    to_legendre = np.linalg.inv(vandermonde)
    values = legendre.legvander(points, degree) @ to_legendre
    slopes = np.stack([legendre.legval(points, legendre.legder(column)) for column in to_legendre.T], axis=1)
    return weights, values, slopes


@cache
def _integrals(degree: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the integrals of shape times shape, slope times slope, and slope times shape."""
    weights, values, slopes = shape_functions(degree, degree + 1)
    w = weights[:, None]
    return values.T @ (w * values), slopes.T @ (w * slopes), slopes.T @ (w * values)


def rigidities(rings: Sequence[Ring]) -> tuple[complex, complex, float, float]:
    """Return shear and bending stiffness of a section, and its mass and rotary inertia per length."""
    shear = bending = 0j
    mass = rotary = 0.0
    for ring in rings:
        area = math.pi / 4.0 * (ring.outer**2 - ring.inner**2) * ring.area
        second = math.pi / 64.0 * (ring.outer**4 - ring.inner**4)
        complex_modulus = ring.modulus * (1.0 + 1j * ring.loss)
        shear += ring.shear * area * complex_modulus / (2.0 * (1.0 + ring.poisson))
        bending += complex_modulus * second * ring.moment
        mass += ring.density * area
        rotary += ring.density * second * ring.inertia
    return shear, bending, mass, rotary


def _element(length: float, rings: Sequence[Ring], degree: int) -> tuple[ComplexArray, FloatArray]:
    """Return stiffness and mass of an element, displacements of all nodes first, then slopes."""
    shear, bending, mass, rotary = rigidities(rings)
    nn, dd, dn = _integrals(degree)
    half = 0.5 * length
    n = degree + 1
    stiffness = np.zeros((2 * n, 2 * n), dtype=np.complex128)
    inertia = np.zeros((2 * n, 2 * n))
    stiffness[:n, :n] = shear * dd / half
    stiffness[:n, n:] = -shear * dn
    stiffness[n:, :n] = -shear * dn.T
    stiffness[n:, n:] = shear * nn * half + bending * dd / half
    inertia[:n, :n] = mass * nn * half
    inertia[n:, n:] = rotary * nn * half
    return stiffness, inertia


@dataclass
class Structure:
    """A structure under construction: beams on stations, springs between them, masses; then its response.

    Every station has a displacement and a slope, numbered 2 s and 2 s + 1 for station s.
    """

    refinement: float = 1.0
    size: int = 0
    _stiffness: list[tuple[NDArray[np.intp], ComplexArray]] = field(default_factory=list)
    _inertia: list[tuple[NDArray[np.intp], FloatArray]] = field(default_factory=list)
    _dampers: list[tuple[NDArray[np.intp], FloatArray]] = field(default_factory=list)

    def station(self) -> int:
        """Return a new station."""
        self.size += 2
        return self.size // 2 - 1

    def beam(self, start: int, length: float, rings: Sequence[Ring]) -> int:
        """Add a uniform beam from a station on, and return the station at its other end."""
        count = max(1, math.ceil(self.refinement * length / LONGEST))
        degree = LOW_DEGREE if length / count <= SHORT / self.refinement else DEGREE
        matrices = _element(length / count, rings, degree)
        return self.elements(start, count, degree, lambda _: matrices)

    def elements(
        self, start: int, count: int, degree: int, matrices: Callable[[int], tuple[ComplexArray, FloatArray]]
    ) -> int:
        """Add elements in a row, of stiffness and mass by their number, and return the station at their other end."""
        at = start
        for number in range(count):
            stiffness, inertia = matrices(number)
            stations = [at, *(self.station() for _ in range(degree))]
            index = np.array([2 * s for s in stations] + [2 * s + 1 for s in stations])
            self._stiffness.append((index, stiffness))
            self._inertia.append((index, inertia))
            at = stations[-1]
        return at

    def spring(self, a: int, b: int | None, stiffness: ComplexArray, damping: FloatArray | None = None) -> None:
        """Add a spring between two stations, or to ground; 2 x 2 over displacement and slope."""
        signs = np.array([[1.0]]) if b is None else np.array([[1.0, -1.0], [-1.0, 1.0]])
        whole = None if damping is None else np.kron(signs, damping)
        self.element((a,) if b is None else (a, b), np.kron(signs, stiffness), whole)

    def element(self, stations: Sequence[int], stiffness: ComplexArray, damping: FloatArray | None = None) -> None:
        """Add stiffness and damping over displacement and slope of stations."""
        ends = np.array([2 * station + i for station in stations for i in (0, 1)])
        self._stiffness.append((ends, stiffness.astype(np.complex128)))
        if damping is not None and np.any(damping):
            self._dampers.append((ends, damping))

    def mass(self, station: int, mass: float, inertia: float = 0.0, arm: float = 0.0) -> None:
        """Add a mass to a station, perhaps on a rigid arm along the beam."""
        matrix = mass * np.array([[1.0, arm], [arm, arm**2]]) + np.diag([0.0, inertia])
        self._inertia.append((np.array([2 * station, 2 * station + 1]), matrix))

    def matrices(self) -> Matrices:
        """Return stiffness with its losses, mass, and viscous damping."""
        stiffness = np.zeros((self.size, self.size), dtype=np.complex128)
        inertia, damping = np.zeros((self.size, self.size)), np.zeros((self.size, self.size))
        for whole, parts in ((stiffness, self._stiffness), (inertia, self._inertia), (damping, self._dampers)):
            for index, part in parts:
                whole[np.ix_(index, index)] += part
        return stiffness, inertia, damping

    def natural_frequencies(self, upper_hz: float) -> FloatArray:
        """Return the undamped natural frequencies from 20 Hz to a limit."""
        stiffness, inertia, _ = self.matrices()
        squares = linalg.eigh(stiffness.real, inertia, eigvals_only=True)
        found = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
        return found[(found > 20.0) & (found < upper_hz)]

    def modes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return squared angular frequencies, mass-normalised shapes as columns, and damping ratios from the losses."""
        stiffness, inertia, _ = self.matrices()
        squares, shapes = linalg.eigh(stiffness.real, inertia)
        lost = np.einsum("ij,ik,kj->j", shapes, stiffness.imag, shapes)
        return squares, shapes, 0.5 * lost / np.maximum(squares, 1e-300)

    def poles(self, forces: FloatArray, motions: FloatArray, modes: int = 12) -> Poles:
        """Return the response as a sum over poles, forces and motions given as columns over all unknowns.

        The basis is the lowest undamped modes and the contribution of the higher ones to the static response to the
        forces, the motions and the dashpots, so that the sum is as exact as the mesh up to half the highest kept mode.
        """
        stiffness, inertia, damping = self.matrices()
        squares, shapes = linalg.eigh(stiffness.real, inertia)
        kept = min(modes, self.size)
        low, high = shapes[:, :kept], shapes[:, kept:]
        loads = [forces, motions]
        for index, _ in self._dampers:
            loads.append(np.eye(self.size)[:, index])
        rest = high @ ((high.T @ np.hstack(loads)) / squares[kept:, None])
        # Modes are mass-orthonormal, so only the remaining vectors need orthonormalisation.
        gram = rest.T @ inertia @ rest
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        values, vectors = linalg.eigh(gram / np.outer(scale, scale))
        good = values > 1e-9 * values[-1]
        basis = np.hstack([low, rest / scale @ (vectors[:, good] / np.sqrt(values[good]))])
        k, c = basis.T @ stiffness @ basis, basis.T @ damping @ basis
        m = basis.T @ inertia @ basis
        k, c = np.linalg.solve(m, k), np.linalg.solve(m, c)
        n = len(k)
        state = np.zeros((2 * n, 2 * n), dtype=np.complex128)
        state[:n, n:] = np.eye(n)
        state[n:, :n], state[n:, n:] = -k, -c
        # Balance displacements against velocities: otherwise rigid motion loses its digits.
        unit = 2.0 * np.pi * 3000.0
        state[:n, n:] *= unit
        state[n:, :] /= unit
        state[n:, n:] *= unit
        rates, right = linalg.eig(state)
        loads = np.hstack([forces, motions])
        entry = np.vstack([np.zeros((n, loads.shape[1])), np.linalg.solve(m, basis.T @ loads) / unit])
        left = np.linalg.solve(right, entry)
        seen = (motions.T @ basis) @ right[:n]
        count = forces.shape[1]
        return Poles(rates, seen, left[:, :count], left[:, count:], basis, right[:n])


@dataclass(frozen=True)
class Poles:
    """A response over poles: observed motions and the participation of forces."""

    rates: ComplexArray
    seen: ComplexArray
    excited: ComplexArray
    mirrored: ComplexArray
    """How forces where the motions are seen excite them."""
    basis: FloatArray
    shapes: ComplexArray
    """In the basis."""

    def receptance(
        self, frequency_hz: NDArray[np.float64] | ComplexArray, motion: int = 0, force: int = 0
    ) -> ComplexArray:
        """Return displacement per force on real or complex lines."""
        s = 2j * np.pi * np.asarray(frequency_hz)
        residues = self.seen[motion] * self.excited[:, force]
        return (1.0 / (s[:, None] - self.rates)) @ residues

    def slopes(
        self, frequency_hz: NDArray[np.float64] | ComplexArray, changes: Sequence[Matrices], motion: int = 0,
        force: int = 0,
    ) -> ComplexArray:  # fmt: skip
        """Return the first-order changes of the receptance by changes of stiffness, mass and damping, column by column.

        With A x = f and A z = m, both in the basis, d(m.x) = -z.dA.x.
        """
        s = 2j * np.pi * np.asarray(frequency_hz)
        near = 1.0 / (s[:, None] - self.rates)
        x = (near * self.excited[:, force]) @ self.shapes.T
        z = (near * self.mirrored[:, motion]) @ self.shapes.T
        result = np.zeros((s.size, len(changes)), dtype=np.complex128)
        for j, parts in enumerate(changes):
            for part, weight in zip(parts, (1.0, s**2, s), strict=True):
                if np.any(part):
                    result[:, j] -= weight * np.sum((z @ (self.basis.T @ part @ self.basis)) * x, axis=1)
        return result
