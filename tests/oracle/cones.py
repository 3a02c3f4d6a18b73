"""Receptances of conical Timoshenko beams as Taylor series in 30 digits; nothing is shared with the core.

Along a beam of varying section

    y' = theta + V / S,   theta' = M / B,   V' = -m w^2 y,   M' = -V - r w^2 theta

with S, B, m and r those of the section in each place. The diameters are linear in x, so that S, B, m and r are rational
functions; their Taylor series about the start of a step, and from them those of the state, follow term by term. A step
is a fixed share of the distance to the nearest place at which a section or a wall vanishes, which bounds the radius of
convergence, and at most a share of the shortest wave.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

import mpmath as mp

Series = list[Any]
Layer = tuple[float, float, float, float]
"""Young's modulus, density, Poisson's ratio and loss factor."""

DIGITS = 30
TERMS = 46
SHARE = 0.2
"""Step over the distance to the nearest singular place: 0.2^46 is below 1e-32."""
COWPER, HUTCHINSON = "cowper", "hutchinson"


@dataclass(frozen=True)
class Cone:
    """A cone of a ring, and a core in its bore where there is one; diameters at both ends in m."""

    length: Any
    outer: tuple[Any, Any]
    inner: tuple[Any, Any] = (0.0, 0.0)
    ring: tuple[Any, ...] = (210e9, 7850.0, 0.3, 0.0)
    core: tuple[Any, ...] | None = None
    shear: str = COWPER

    def with_value(self, name: str, value: Any) -> Cone:
        """Return the cone with another value of a parameter, named as in the package."""
        ends = {"outer_diameter": ("outer", 0), "end_outer_diameter": ("outer", 1)}
        ends |= {"inner_diameter": ("inner", 0), "end_inner_diameter": ("inner", 1)}
        field, place = ends.get(name, (name, -1))
        if place < 0 and name != "length":
            layer, _, quantity = name.rpartition(".")
            field, place = layer or "ring", CONSTANTS.index(quantity)
        if place < 0:
            return replace(self, length=value)
        values = list(getattr(self, field))
        values[place] = value
        changes: dict[str, Any] = {field: tuple(values)}
        return replace(self, **changes)

    def value(self, name: str) -> Any:
        """Return the value of a parameter."""
        ends = {"outer_diameter": self.outer[0], "end_outer_diameter": self.outer[1], "length": self.length}
        ends |= {"inner_diameter": self.inner[0], "end_inner_diameter": self.inner[1]}
        if name in ends:
            return ends[name]
        layer, _, quantity = name.rpartition(".")
        return getattr(self, layer or "ring")[CONSTANTS.index(quantity)]


CONSTANTS = ("youngs_modulus", "density", "poisson_ratio", "loss_factor")


def _product(a: Series, b: Series) -> Series:
    """Product of two series, as long as `TERMS`."""
    out = [mp.mpf(0)] * min(len(a) + len(b) - 1, TERMS)
    for i, left in enumerate(a):
        for j, right in enumerate(b[: len(out) - i]):
            out[i + j] += left * right
    return out


def _sum(a: Series, b: Series) -> Series:
    short, long = sorted((a, b), key=len)
    return [value + (short[i] if i < len(short) else 0) for i, value in enumerate(long)]


def _scaled(factor: Any, a: Series) -> Series:
    return [factor * value for value in a]


def _quotient(a: Series, b: Series) -> Series:
    """Quotient of two series, `TERMS` long."""
    out: Series = []
    for k in range(TERMS):
        value = a[k] if k < len(a) else mp.mpf(0)
        for j in range(1, min(k, len(b) - 1) + 1):
            value -= b[j] * out[k - j]
        out.append(value / b[0])
    return out


def _shear(outer: Series, inner: Series, nu: Any, model: str) -> Series:
    """Shear coefficient of a ring; with D and d for diameters, numerator and denominator times D^4."""
    big, small = _product(outer, outer), _product(inner, inner)
    q2, q1, q0 = _product(small, small), _product(big, small), _product(big, big)
    square = _sum(_sum(q0, _scaled(2, q1)), q2)
    if model == COWPER:
        below = _sum(_scaled(7 + 6 * nu, square), _scaled(20 + 12 * nu, q1))
        return _quotient(_scaled(6 * (1 + nu), square), below)
    parts = [(7 + 12 * nu + 4 * nu**2, q0), (34 + 48 * nu + 16 * nu**2, q1), (7 + 12 * nu + 4 * nu**2, q2)]
    below = [mp.mpf(0)]
    for factor, power in parts:
        below = _sum(below, _scaled(factor, power))
    return _quotient(_scaled(6 * (1 + nu) ** 2, square), below)


def _layers(cone: Cone, x: Any) -> list[tuple[Series, Series, tuple[Any, ...]]]:
    """Outer and inner diameter about a place, and the constants, of ring and core."""
    linear = [[near + (far - near) * x / cone.length, (far - near) / cone.length]
              for near, far in ([mp.mpf(v) for v in cone.outer], [mp.mpf(v) for v in cone.inner])]  # fmt: skip
    out = [(linear[0], linear[1], cone.ring)]
    return out if cone.core is None else [*out, (linear[1], [mp.mpf(0)], cone.core)]


def _section(cone: Cone, x: Any) -> tuple[Series, Series, Series, Series, Series]:
    """Series of S, B, E A, m and r about a place."""
    zero: Series = [mp.mpf(0)]
    shear, bending, axial, mass, inertia = zero, zero, zero, zero, zero
    for outer, inner, (modulus, density, nu, loss) in _layers(cone, x):
        complex_modulus = mp.mpf(modulus) * (1 + 1j * mp.mpf(loss))
        nu = mp.mpf(nu)
        big, small = _product(outer, outer), _product(inner, inner)
        area = _scaled(mp.pi / 4, _sum(big, _scaled(-1, small)))
        moment = _scaled(mp.pi / 64, _sum(_product(big, big), _scaled(-1, _product(small, small))))
        kappa = _shear(outer, inner, nu, cone.shear)
        shear = _sum(shear, _scaled(complex_modulus / 2 / (1 + nu), _product(kappa, area)))
        bending = _sum(bending, _scaled(complex_modulus, moment))
        axial = _sum(axial, _scaled(complex_modulus, area))
        mass = _sum(mass, _scaled(mp.mpf(density), area))
        inertia = _sum(inertia, _scaled(mp.mpf(density), moment))
    return shear, bending, axial, mass, inertia


def _torsion(cone: Cone, x: Any) -> tuple[Series, Series]:
    """Series of G I_p and rho I_p about a place."""
    stiffness: Series = [mp.mpf(0)]
    inertia: Series = [mp.mpf(0)]
    for outer, inner, (modulus, density, nu, loss) in _layers(cone, x):
        big, small = _product(outer, outer), _product(inner, inner)
        polar = _scaled(mp.pi / 32, _sum(_product(big, big), _scaled(-1, _product(small, small))))
        rigid = mp.mpf(modulus) * (1 + 1j * mp.mpf(loss)) / 2 / (1 + mp.mpf(nu))
        stiffness = _sum(stiffness, _scaled(rigid, polar))
        inertia = _sum(inertia, _scaled(mp.mpf(density), polar))
    return stiffness, inertia


def _step(cone: Cone, x: Any, w: Any) -> Any:
    """Length of the next step."""
    distance = mp.inf
    gap = (cone.outer[0] - cone.inner[0], cone.outer[1] - cone.inner[1])
    both = (cone.outer[0] + cone.inner[0], cone.outer[1] + cone.inner[1])
    for near, far in (cone.outer, gap, both, cone.inner if cone.core else (1, 1)):
        slope = (mp.mpf(far) - near) / cone.length
        if slope != 0:
            distance = min(distance, abs((near + slope * x) / slope))
    # Roots of the denominator of the shear coefficient lie at complex q near -1: D = +-i d.
    for sign in (1j, -1j):
        near, far = (o + sign * i for o, i in zip(cone.outer, cone.inner, strict=True))
        slope = (mp.mpc(far) - near) / cone.length
        if slope != 0:
            distance = min(distance, abs((near + slope * x) / slope))
    least = min(cone.outer)
    modulus = max(layer[1] / layer[0] for layer in (cone.ring, cone.core or cone.ring))
    wave = mp.sqrt(abs(w) * mp.sqrt(modulus) * 4 / least) + abs(w) * mp.sqrt(3 * modulus)
    return min(SHARE * distance, 3 / wave if wave else mp.inf, cone.length - x)


def _at(series: Series, h: Any) -> Any:
    value = mp.mpf(0)
    for coefficient in reversed(series):
        value = value * h + coefficient
    return value


def _advance(cone: Cone, motion: str, x: Any, h: Any, w2: Any, columns: list[list[Any]]) -> list[list[Any]]:
    """States at the end of a step from x, from those at its start."""
    if motion != "bending":
        stiffness, inertia = _torsion(cone, x) if motion == "torsion" else _section(cone, x)[2:4]
        compliance = _quotient([mp.mpf(1)], stiffness)
        return [_rod(compliance, inertia, h, w2, start) for start in columns]
    shear, bending, _, mass, inertia = _section(cone, x)
    alpha, beta = _quotient([mp.mpf(1)], shear), _quotient([mp.mpf(1)], bending)
    return [_beam(alpha, beta, mass, inertia, h, w2, start) for start in columns]


def _term(coefficients: Series, state: Series, k: int) -> Any:
    """Term k of the product of two series."""
    return mp.fdot((coefficients[j], state[k - j]) for j in range(min(k + 1, len(coefficients))))


def _rod(compliance: Series, inertia: Series, h: Any, w2: Any, start: list[Any]) -> list[Any]:
    u, n = [start[0]], [start[1]]
    for k in range(TERMS):
        rates = _term(compliance, n, k), -w2 * _term(inertia, u, k)
        u.append(rates[0] / (k + 1))
        n.append(rates[1] / (k + 1))
    return [_at(u, h), _at(n, h)]


def _beam(
    alpha: Series, beta: Series, mass: Series, inertia: Series, h: Any, w2: Any, start: list[Any]
) -> list[Any]:  # fmt: skip
    y, theta, v, m = ([value] for value in start)
    for k in range(TERMS):
        rates = (
            theta[k] + _term(alpha, v, k),
            _term(beta, m, k),
            -w2 * _term(mass, y, k),
            -v[k] - w2 * _term(inertia, theta, k),
        )
        for series, rate in zip((y, theta, v, m), rates, strict=True):
            series.append(rate / (k + 1))
    return [_at(series, h) for series in (y, theta, v, m)]


@cache
def transfer(cone: Cone, frequency_hz: Any, motion: str = "bending") -> mp.matrix:
    """Return the matrix from the state at the near end to that at the far end, `(y, theta, V, M)` or `(u, n)`."""
    with mp.workdps(DIGITS):
        w = 2 * mp.pi * mp.mpmathify(frequency_hz)
        size = 4 if motion == "bending" else 2
        columns = [[mp.mpc(i == j) for i in range(size)] for j in range(size)]
        x = mp.mpf(0)
        while x < cone.length * (1 - mp.mpf(10) ** (5 - DIGITS)):
            h = _step(cone, x, w)
            columns = _advance(cone, motion, x, h, w * w, columns)
            x += h
        return mp.matrix(columns).T


def receptance(chain: Sequence[Cone], frequency_hz: Any, motion: str = "bending") -> mp.matrix:
    """Return the receptance of a free row of cones over all its nodes, y and theta in turn; rods have u only.

    The load on the near end of a cone is minus the internal force there, that on the far end the internal force itself.
    """
    with mp.workdps(DIGITS):
        n = 2 if motion == "bending" else 1
        stiffness = mp.matrix(n * (len(chain) + 1))
        for number, cone in enumerate(chain):
            whole = transfer(cone, frequency_hz, motion)
            uu, un, nu, nn = whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:]
            rigid = un**-1
            blocks = [[rigid * uu, -rigid], [nu - nn * rigid * uu, nn * rigid]]
            for i, j, a, b in product(range(2), range(2), range(n), range(n)):
                stiffness[n * (number + i) + a, n * (number + j) + b] += blocks[i][j][a, b]
        return stiffness**-1


def determinant(cone: Cone, frequency_hz: Any) -> Any:
    """Return the determinant that is zero at a complex natural frequency of a free cone."""
    with mp.workdps(DIGITS):
        return mp.det(transfer(cone, frequency_hz)[2:, :2])


def section(cone: Cone, share: float) -> tuple[float, float, float, float]:
    """Return S, B, m and r at a share of the length, without damping."""
    shear, bending, _, mass, inertia = _section(cone, mp.mpf(share) * cone.length)
    return tuple(float(mp.re(series[0])) for series in (shear, bending, mass, inertia))  # type: ignore[return-value]


def pieces(cone: Cone, lengths: Sequence[Any]) -> list[Cone]:
    """Return the cone cut so that its pieces have these lengths; the last one ends where the cone ends."""

    def at(ends: tuple[Any, Any], x: Any) -> Any:
        return mp.mpf(ends[0]) + (mp.mpf(ends[1]) - ends[0]) * x / cone.length

    out, x = [], mp.mpf(0)
    with mp.workdps(DIGITS):
        for length in [*lengths, None]:
            far = mp.mpf(cone.length) if length is None else x + length
            outer, inner = ((at(ends, x), at(ends, far)) for ends in (cone.outer, cone.inner))
            out.append(replace(cone, length=far - x, outer=outer, inner=inner))
            x = far
    return out
