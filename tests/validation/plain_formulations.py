"""The two textbook formulations in float64, and how many digits they keep where the core keeps them all.

Receptance coupling joins free parts from the far end on: H = H11 - H12 (H22 + K^-1 + H_rest)^-1 H21. Dynamic
stiffness adds the elements' matrices and solves. Both are exact on paper and use the same closed form of a
segment, with decaying waves, so nothing here overflows; what they lose is lost to cancellation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oracle import draw, exact
from oracle.stiffness import shear_coefficient
from oracle.tables import Tables, make
from receptance import _core
from validation import accuracy

ComplexArray = NDArray[np.complex128]

DECADES_HZ = ((1.0, 10.0), (10.0, 100.0), (100.0, 1e3), (1e3, 1e4), (1e4, 1e5))
FORMULATIONS = ("receptance coupling", "dynamic stiffness", "core")
DEFAULT_CHAINS = 60
LENGTHS, DIAMETERS = (1e-4, 0.5), (1e-3, 0.1)


def _constants(row: NDArray[np.float64]) -> tuple[complex, complex, float, float]:
    """Return shear and bending stiffness, mass and rotary inertia per length of a segment without a core."""
    _, _, _, outer, inner, modulus, density, nu, loss, *_ = row.tolist()
    area = np.pi / 4 * (outer - inner) * (outer + inner)
    second = area * (outer**2 + inner**2) / 16
    lossy = modulus * (1 + 1j * loss)
    kappa = shear_coefficient(inner / outer, nu, row[13])
    return kappa * lossy / (2 * (1 + nu)) * area, lossy * second, density * area, density * second


def _halves(row: NDArray[np.float64], w: float) -> list[tuple[ComplexArray, ComplexArray]]:
    """Return end motions and end loads, (2, 2) over quantity and wave, for y even and y odd about the middle."""
    shear, bending, mass, rotary = _constants(row)
    length, inertia = row[2], mass * w**2
    half = w**2 * (rotary / bending + mass / shear) / 2
    product = inertia / bending * (1 - rotary * w**2 / shear)
    root = np.sqrt(half**2 + product + 0j)
    squares = np.array([product / (half + root), -(half + root)])
    wave = np.sqrt(squares)
    decay = np.exp(-wave * length)
    cosh, sinh = (1 + decay) / 2, -np.expm1(-wave * length) / (2 * wave)
    slope = squares + inertia / shear
    even = np.array([cosh, slope * sinh]), np.array([-inertia * sinh, bending * slope * cosh])
    odd = np.array([squares * sinh, slope * cosh]), np.array([-inertia * cosh, bending * slope * squares * sinh])
    return [even, odd]


def _whole(even: ComplexArray, odd: ComplexArray) -> ComplexArray:
    """Return the matrix over (y1, theta1, y2, theta2) from those of the two symmetries at the right-hand end."""
    same, cross = (even + odd) / 2, (even - odd) / 2
    turn = np.diag([1.0, -1.0])
    return np.block([[turn @ same @ turn, turn @ cross], [cross @ turn, same]])


def segment_receptance(row: NDArray[np.float64], w: float) -> ComplexArray:
    """Return the free segment's receptance, shape (4, 4)."""
    return _whole(*(motion @ np.linalg.inv(load) for motion, load in _halves(row, w)))


def segment_stiffness(row: NDArray[np.float64], w: float) -> ComplexArray:
    """Return the segment's dynamic stiffness, shape (4, 4)."""
    return _whole(*(load @ np.linalg.inv(motion) for motion, load in _halves(row, w)))


def _spring(row: NDArray[np.float64], w: float) -> ComplexArray:
    k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta, loss = row[2:].tolist()
    k, c = np.array([[k_y, k_ytheta], [k_ytheta, k_theta]]), np.array([[c_y, c_ytheta], [c_ytheta, c_theta]])
    return (1 + 1j * loss) * k + 1j * w * c


def by_receptance_coupling(model: Tables, w: float) -> ComplexArray:
    """Return the tip's (2, 2) receptance of a chain, coupled segment by segment from the far end."""
    joints = {int(row[0]): row for row in model.joints}
    rest: ComplexArray | None = None
    for row in model.segments[::-1]:
        h = segment_receptance(row, w)
        if rest is None:
            rest = h[:2, :2]
            continue
        joint = joints.get(int(row[1]))
        gap = h[2:, 2:] + rest
        if joint is not None:
            gap = gap + np.linalg.inv(_spring(joint, w))
        rest = h[:2, :2] - h[:2, 2:] @ np.linalg.solve(gap, h[2:, :2])
    assert rest is not None
    return rest


def by_dynamic_stiffness(model: Tables, w: float) -> ComplexArray:
    """Return the tip's (2, 2) receptance from the assembled stiffness, scaled to a unit diagonal."""
    whole = np.zeros((2 * model.n_nodes, 2 * model.n_nodes), dtype=np.complex128)
    for row in model.segments:
        index = np.ix_(*[np.array([2 * row[0], 2 * row[0] + 1, 2 * row[1], 2 * row[1] + 1], dtype=int)] * 2)
        whole[index] += segment_stiffness(row, w)
    for row in model.joints:
        k = _spring(row, w)
        index = np.ix_(*[np.array([2 * row[0], 2 * row[0] + 1, 2 * row[1], 2 * row[1] + 1], dtype=int)] * 2)
        whole[index] += np.block([[k, -k], [-k, k]])
    scale = 1 / np.sqrt(np.abs(np.diag(whole)))
    solved = np.linalg.solve(scale[:, None] * whole * scale, np.diag(scale)[:, :2])
    return scale[:2, None] * solved[:2]


def by_core(model: Tables, w: float) -> ComplexArray:
    """Return the tip's (2, 2) receptance from the library."""
    tip = np.array([[0.0, 0.0], [0.0, 1.0]])
    line = np.array([w], dtype=np.complex128)
    return _core.Model(0, *model).receptance(_core.Lines(line), tip, tip, np.zeros((0, 3)), 1)[0][0]


def random_chain(rng: np.random.Generator) -> Tables:
    """Draw a chain: two to eight segments from thin rings to long shanks, up to two joints, with or without loss."""
    count, lossy = int(rng.integers(2, 9)), bool(rng.random() < 0.5)
    joined = set(rng.choice(count - 1, size=min(2, count - 1), replace=False).tolist())
    segments, joints, node = [], [], 0
    for number in range(count):
        length, diameter = (float(np.exp(rng.uniform(*np.log(span)))) for span in (LENGTHS, DIAMETERS))
        row = draw.segment(rng, length=length, outer_diameter=diameter, lossy=lossy, between=(node, node + 1))
        row[9:13] = [0.0] * 4
        segments.append(row)
        node += 1
        if number in joined:
            spring = draw.spring(rng, 2 * np.pi * 1e3, damped=lossy)
            # Ordinary joints: the textbook formulations are compared in their usual range.
            spring[:3] = [
                float(np.exp(rng.uniform(*np.log((1e6, 1e9))))),
                float(np.exp(rng.uniform(*np.log((1e3, 1e6))))),
                0.0,
            ]
            joints.append([node, node + 1, *spring])
            node += 1
    return make(segments, joints)


@dataclass
class Evidence:
    """Share of cases within the rule for each formulation, by decade of frequency."""

    seed: int
    chains: int
    share: dict[str, list[float]]
    worst: dict[str, list[float]]

    def as_json(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {
            "seed": self.seed, "chains": self.chains, "decades_hz": [list(decade) for decade in DECADES_HZ],
            "share_within_rule": self.share, "worst_error": self.worst,
        }  # fmt: skip

    def text(self) -> str:
        """Return the results as a text table."""
        heads = "".join(f"{f'{low:g}-{high:g} Hz':>22}" for low, high in DECADES_HZ)
        lines = [
            f"tip receptance of {self.chains} random chains (seed {self.seed}): share of cases within the rule "
            "(worst relative error)",
            f"{'':20}{heads}",
        ]
        for name in FORMULATIONS:
            cells = (f"{100 * s:.0f} % ({e:.0e})" for s, e in zip(self.share[name], self.worst[name], strict=True))
            lines.append(f"{name:20}" + "".join(f"{cell:>22}" for cell in cells))
        return "\n".join(lines)


def compare(seed: int, chains: int = DEFAULT_CHAINS) -> Evidence:
    """Compare the three formulations with the reference, one line a decade for each random chain."""
    methods = dict(zip(FORMULATIONS, (by_receptance_coupling, by_dynamic_stiffness, by_core), strict=True))
    within = {name: np.zeros(len(DECADES_HZ)) for name in methods}
    worst = {name: np.zeros(len(DECADES_HZ)) for name in methods}
    tip = np.array([[0.0, 0.0], [0.0, 1.0]])
    for number in range(chains):
        rng = np.random.default_rng([seed, 1, number])
        model = random_chain(rng)
        for decade, (low, high) in enumerate(DECADES_HZ):
            w = 2 * np.pi * float(np.exp(rng.uniform(np.log(low), np.log(high))))
            reference = exact.receptance_complex128(model, w, tip, tip)
            sensitivity = exact.sensitivity(model, w, tip, tip, accuracy.FEW_DRAWS, rng)
            allowed = np.maximum(accuracy.TOLERANCE, accuracy.SENSITIVITY_FACTOR * sensitivity)
            for name, method in methods.items():
                error = accuracy.relative_error(method(model, w), reference)
                within[name][decade] += np.all(error <= allowed)
                worst[name][decade] = max(worst[name][decade], error.max())
    return Evidence(
        seed, chains,
        {name: (value / chains).tolist() for name, value in within.items()},
        {name: value.tolist() for name, value in worst.items()},
    )  # fmt: skip
