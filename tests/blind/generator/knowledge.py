"""What the engineer knows of the holder: four levels, from a drawing to a measurement on a reference blank.

drawing
    Dimensions and materials of the holder (length, outer and inner diameter of each section, modulus, density,
    Poisson's ratio and loss factor) are stated with a standard deviation of 1 %, and each one is off by a draw of it.
measured
    All that is behind the joint, the shank in its bore included, is a matrix of receptances over (y, theta) at the
    mouth, on lines every 4 Hz over the band of the records. y/F, theta/M and y/M are the means of ten hits with 0.3 to
    0.8 % of noise in each mean, and the variance is estimated from the scatter of the hits.
modes
    The same structure as modes: its two rigid-body modes, the elastic ones below 45 kHz and the residual of the others.
    Each number is off by a draw from a stated covariance: frequencies 0.1 %, y and theta 0.5 % with a correlation of
    one half, damping ratios 10 %, residuals 3 %.
blank
    Hits on a reference blank: a plain cylinder of the tool's own material and diameter, 45 to 60 mm long, shrunk into
    the holder without a joint, its material and dimensions known exactly. It is hit and measured at its tip and at two
    thirds of its length: three receptances with the noise of the tool's records. The program finds the holder from
    them by its own inverse coupling.

The holder is the actual one, so a measurement of it contains what a drawing gets wrong (`ERRORS`): then nothing is
hidden, and the right answer is "adequate". What changes after the measurement (`CHANGES`) has no place in a model whose
holder is data: then a cause that is named is wrong, except a changed mode of the holder where modes are stated. A joint
that is spread along the bore (`INSIDE`) has no place in it either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import rig
from .elements import Structure
from .records import Estimate, Setup, measure

LEVELS = ("drawing", "measured", "modes", "blank")
TOLERANCE = 0.01
ERRORS = ("holder_inertia", "holder_modulus", "flexible_body", "wrong_section")
"""Effects that a drawing of the holder gets wrong; its measurement contains them."""
CHANGES = ("missing_mode", "suspension", "ground_spring", "ring_on_nose", "second_joint")
"""Effects that come after the measurement of the holder."""
INSIDE = ("joint_spread",)
SPACING_HZ = 4.0
HITS = 10
POOLED = 4
"""Neighbouring lines to each side over which the variance is pooled."""
HIGHEST_MODE_HZ = 45e3
FREQUENCY, SHAPE, DAMPING, RESIDUAL, CORRELATION = 1e-3, 5e-3, 0.1, 0.03, 0.5
"""Relative standard deviations of the modes' numbers, and the correlation of y and theta of a mode."""

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
ENTRIES = ((0, 0), (1, 1), (0, 1))


@dataclass(frozen=True, kw_only=True)
class Table:
    """A measured matrix over (y, theta): `(n, 2, 2)`, with the variance of its logarithm."""

    frequency_hz: FloatArray
    matrix: ComplexArray
    log_variance: FloatArray
    decay_rate: float


@dataclass(frozen=True, kw_only=True)
class Modes:
    """Modes with their covariance: rows of frequency in Hz, damping ratio, y and theta, then three residuals.

    `covariance` is that of the rows one after another and of the residuals.
    """

    rows: FloatArray
    residuals: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, kw_only=True)
class Blank:
    """Hits on the reference blank: its numbers, and estimates at places of motion and hit, in m from its tip."""

    length: float
    numbers: Mapping[str, float]
    places: tuple[tuple[float, float], ...]
    estimates: tuple[Estimate, ...]


Known = Table | Modes | Blank


def holder_matrix(p: Mapping[str, float], lines: ComplexArray | FloatArray) -> ComplexArray:
    """Return the receptance of all that is behind the joint at the mouth, `(n, 2, 2)` over (y, theta)."""
    structure = Structure()
    rig.holder_alone(structure, p)
    unit = np.eye(structure.size)[:, :2]
    found = structure.poles(unit, unit)
    result = np.empty((lines.size, 2, 2), dtype=np.complex128)
    for i in range(2):
        for j in range(2):
            result[:, i, j] = found.receptance(lines, motion=i, force=j)
    return result


def known_of(rng: np.random.Generator, level: str, p: Mapping[str, float], setup: Setup) -> Known | None:
    """Return what is known of a holder with these numbers; None for a drawing."""
    if level == "measured":
        return _table(rng, p, setup)
    if level == "modes":
        return _modes(rng, p)
    return _blank(rng, p, setup) if level == "blank" else None


def _table(rng: np.random.Generator, p: Mapping[str, float], setup: Setup) -> Table:
    lines = np.arange(SPACING_HZ * np.floor(setup.low_hz / SPACING_HZ), setup.high_hz + 8.0 * SPACING_HZ, SPACING_HZ)
    exact = holder_matrix(p, lines + setup.decay_rate / (2j * np.pi))
    noise = float(rng.uniform(0.003, 0.008)) * np.sqrt(HITS)
    matrix, variance = np.empty_like(exact), np.empty(exact.shape)
    window = np.ones(2 * POOLED + 1) / (2 * POOLED + 1)
    for i, j in ENTRIES:
        normal = rng.normal(size=(2, HITS, lines.size))
        hits = exact[:, i, j] * (1.0 + noise * (normal[0] + 1j * normal[1]))
        mean = hits.mean(axis=0)
        # Half of the squared scatter is that of the real part, and of the imaginary part.
        scatter = 0.5 * np.sum(np.abs(hits - mean) ** 2, axis=0) / (HITS - 1) / HITS / np.abs(mean) ** 2
        matrix[:, i, j] = matrix[:, j, i] = mean
        pooled = np.convolve(np.pad(scatter, POOLED, "edge"), window, "valid")
        variance[:, i, j] = variance[:, j, i] = pooled
    return Table(frequency_hz=lines, matrix=matrix, log_variance=variance, decay_rate=setup.decay_rate)


def _modes(rng: np.random.Generator, p: Mapping[str, float]) -> Modes:
    rows, residuals = modes_of(p)
    blocks = [_covariance(row) for row in rows]
    # The residual of y over M is as uncertain as the other two together allow.
    scale = np.array([abs(residuals[0]), abs(residuals[1]), np.sqrt(abs(residuals[0] * residuals[1]))])
    blocks.append(np.diag((RESIDUAL * scale) ** 2))
    size = sum(len(block) for block in blocks)
    covariance = np.zeros((size, size))
    begin = 0
    for block in blocks:
        covariance[begin : begin + len(block), begin : begin + len(block)] = block
        begin += len(block)
    values, vectors = np.linalg.eigh(covariance / (outer := _outer(np.diag(covariance))))
    draw = np.sqrt(np.diag(outer)) * (vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(size)))
    stated = np.concatenate([rows.ravel(), residuals]) + draw
    return Modes(rows=stated[: rows.size].reshape(rows.shape), residuals=stated[rows.size :], covariance=covariance)


def _outer(variances: FloatArray) -> FloatArray:
    deviation = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    return np.outer(deviation, deviation)


def _covariance(row: FloatArray) -> FloatArray:
    frequency, damping, y, theta = row
    found = np.zeros((4, 4))
    found[0, 0], found[1, 1] = (FREQUENCY * frequency) ** 2, (DAMPING * damping) ** 2
    found[2, 2], found[3, 3] = (SHAPE * y) ** 2, (SHAPE * theta) ** 2
    found[2, 3] = found[3, 2] = CORRELATION * SHAPE**2 * y * theta
    return found


def modes_of(p: Mapping[str, float], highest_hz: float = HIGHEST_MODE_HZ) -> tuple[FloatArray, FloatArray]:
    """Return rows of frequency, damping ratio, y and theta of the modes of the holder, and the residuals."""
    structure = Structure()
    rig.holder_alone(structure, p)
    squares, shapes, damping = structure.modes()
    frequency = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
    rigid = np.arange(frequency.size) < 2
    frequency[rigid], damping[rigid] = 0.0, 0.0
    kept = frequency < highest_hz
    rows = np.column_stack([frequency, damping, shapes[0], shapes[1]])[kept]
    rest = ~kept
    residuals = np.array([np.sum(shapes[i, rest] * shapes[j, rest] / squares[rest]) for i, j in ENTRIES])
    return rows, residuals


def _blank(rng: np.random.Generator, p: Mapping[str, float], setup: Setup) -> Blank:
    length = float(np.round(rng.uniform(0.045, 0.060), 4))
    near = float(np.round(2.0 / 3.0 * length, 4))
    names = ("tool.diameter", "tool.modulus", "tool.density", "tool.poisson", "tool.loss", "shear.hutchinson")
    own = {name: value for name, value in p.items() if name in names or name.startswith("holder.")}
    # Shrunk in: so stiff that it counts as rigid.
    rigid = {"joint.k_y": 1e13, "joint.k_theta": 3e9, "joint.k_ytheta": 0.0, "joint.loss": 0.0}
    own |= rigid | {"joint.c_y": 0.0, "joint.c_theta": 0.0, "joint.c_ytheta": 0.0, "tool.overhang": length}
    hits: Sequence[dict[str, float]] = ({}, {"hit.offset": near}, {"both.offset": near})
    return Blank(
        length=length,
        numbers={name: own[name] for name in names},
        places=((0.0, 0.0), (0.0, near), (near, near)),
        estimates=tuple(measure(rng, own | where, setup) for where in hits),
    )
