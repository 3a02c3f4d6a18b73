"""Random models and frequencies, seeded, over the whole range the core must be accurate in."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import tables as flat
from .elements import wave_number_bound
from .resonance import ENDS, cutoff, resonance_above
from .tables import Tables

Rng = np.random.Generator
Rows = list[list[float]]

LOWEST_HZ, HIGHEST_HZ = 1.0, 200e3
LARGEST_WAVES = 1e4
"""Largest wave number times length of any segment."""
SHORTEST, LONGEST = 1e-4, 2.0
THINNEST, THICKEST = 2e-5, 0.5
KINDS = {
    "chain": 0.32,
    "single": 0.14,
    "resonance": 0.18,
    "cutoff": 0.16,
    "wire": 0.08,
    "short": 0.08,
    "tree": 0.04,
}
REAL_MATERIALS = (
    (205e9, 7850.0, 0.29),
    (580e9, 14500.0, 0.23),
    (70e9, 2700.0, 0.33),
    (110e9, 8800.0, 0.34),
    (210e9, 7800.0, 0.30),
)


class Case(NamedTuple):
    """A model with the lines and the points to observe it at.

    Attributes
    ----------
    tables : Tables
        The model.
    w : ndarray of complex128
        Angular frequencies, ascending by their real parts, with one common imaginary part <= 0.
    excitations, responses : ndarray, shape (n, 2)
        Both ends' y and theta come first, tip then far end; inner nodes may follow.
    label : str
        What was drawn, for a message.
    """

    tables: Tables
    w: NDArray[np.complex128]
    excitations: NDArray[np.float64]
    responses: NDArray[np.float64]
    label: str


def case(rng: Rng) -> Case:
    """Draw a model, a few lines and observation points; the same generator state gives the same case."""
    kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
    lossy = bool(rng.random() < 0.5) and kind != "resonance"
    start_hz = _log_uniform(rng, LOWEST_HZ, HIGHEST_HZ)
    special = _special_segment(rng, kind, lossy)
    target: float | None = None
    label = kind
    if special is not None:
        target, label = _special_frequency(rng, kind, np.array(special), start_hz)
        if target is not None:
            start_hz = target / (2.0 * np.pi)

    alone = kind == "single" or (kind in ("resonance", "cutoff", "wire") and rng.random() < 0.5)
    n_segments = 1 if alone else int(rng.integers(2, 11 if rng.random() < 0.3 else 6))
    segments = _segments(rng, n_segments, lossy, short=kind == "short")
    if special is not None:
        segments[int(rng.integers(n_segments))] = special
    model, far = _assemble(rng, segments, start_hz, damped=lossy, branch=kind == "tree")

    w = _lines(rng, start_hz, target, model)
    if target is not None and target not in w.real:
        label += " (moved into range)"
    if rng.random() < 0.12 and kind != "resonance":
        w = w - 1j * min(_log_uniform(rng, 1.0, 1e3), 0.3 * w[0].real)
        label += ", complex frequency"
    points = [0, far]
    if model.n_nodes > 2 and rng.random() < 0.3:
        points.append(int(rng.choice([n for n in range(model.n_nodes) if n not in points])))
    observed = np.array([[node, direction] for node in points for direction in (flat.Y, flat.THETA)], dtype=float)
    label += f", {n_segments} segments, {len(model.joints)} joints, {'lossy' if lossy else 'lossless'}"
    return Case(model, w, observed, observed.copy(), f"{label}, from {w[0].real / (2.0 * np.pi):.6g} Hz")


def material(rng: Rng) -> tuple[float, float, float]:
    """Draw Young's modulus, density and Poisson's ratio: a real metal's or more extreme values."""
    if rng.random() < 0.7:
        modulus, density, nu = REAL_MATERIALS[rng.integers(len(REAL_MATERIALS))]
        return (
            modulus * rng.uniform(0.95, 1.05),
            density * rng.uniform(0.97, 1.03),
            nu * rng.uniform(0.97, 1.03),
        )
    return _log_uniform(rng, 1e8, 1.2e12), _log_uniform(rng, 500.0, 2e4), float(rng.uniform(0.0, 0.49))


def segment(
    rng: Rng, *, length: float, outer_diameter: float, lossy: bool, between: tuple[int, int] = (0, 1)
) -> list[float]:
    """Draw the rest of a segment: a bore, a core, materials, losses, the shear coefficient."""
    hollow = rng.random() < 0.4
    inner = outer_diameter * float(rng.uniform(0.05, 0.95)) if hollow else 0.0
    return flat.segment(
        *between,
        length,
        outer_diameter,
        material(rng),
        inner_diameter=inner,
        loss_factor=_log_uniform(rng, 1e-4, 0.1) if lossy else 0.0,
        core=material(rng) if hollow and rng.random() < 0.3 else None,
        core_loss_factor=_log_uniform(rng, 1e-4, 0.1) if lossy else 0.0,
        shear_model=flat.HUTCHINSON if rng.random() < 0.3 else flat.COWPER,
    )


def spring(rng: Rng, w: float, *, damped: bool) -> list[float]:
    """Draw (k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta, loss factor), both matrices definite."""
    k_y = _log_uniform(rng, 1e3, 1e10) if rng.random() < 0.8 else _log_uniform(rng, 1e10, 1e13)
    k_theta = k_y * _log_uniform(rng, 1e-4, 0.1) ** 2
    k_ytheta = _correlation(rng) * math.sqrt(k_y * k_theta)
    c_y = c_theta = c_ytheta = loss = 0.0
    if damped and rng.random() < 0.6:
        c_y = k_y / w * _log_uniform(rng, 1e-4, 1.0)
        c_theta = k_theta / w * _log_uniform(rng, 1e-4, 1.0)
        c_ytheta = _correlation(rng) * math.sqrt(c_y * c_theta)
    if damped and rng.random() < 0.4:
        loss = _log_uniform(rng, 1e-4, 0.3)
    return [k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta, loss]


def _log_uniform(rng: Rng, low: float, high: float) -> float:
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


def _correlation(rng: Rng) -> float:
    """Draw k_ytheta over its limit: often none, now and then almost the limit."""
    which = rng.random()
    if which < 0.45:
        return 0.0
    if which < 0.9:
        return float(rng.uniform(-0.95, 0.95))
    return float(rng.choice([-1.0, 1.0])) * (1.0 - _log_uniform(rng, 1e-6, 1e-2))


def _special_segment(rng: Rng, kind: str, lossy: bool) -> list[float] | None:
    """Draw the segment that a kind of case is about."""
    if kind == "resonance":
        length = _log_uniform(rng, 5e-4, 1.0)
        return segment(rng, length=length, outer_diameter=_diameter(rng, length, 0.3, 300.0), lossy=False)
    if kind == "cutoff":
        row = segment(rng, length=_log_uniform(rng, 1e-4, 0.5), outer_diameter=1.0, lossy=lossy)
        # the cut-off goes with one over the diameter: choose it, then keep the diameter in range
        factor = cutoff(np.array(row)) / (2.0 * np.pi) / _log_uniform(rng, 1e4, 0.9 * HIGHEST_HZ)
        diameter = min(max(factor, THINNEST), THICKEST)
        row[3], row[4] = diameter, row[4] * diameter
        return row
    if kind == "wire":
        length = _log_uniform(rng, 0.05, LONGEST)
        return segment(rng, length=length, outer_diameter=_diameter(rng, length, 100.0, 1e5), lossy=lossy)
    return None


def _special_frequency(rng: Rng, kind: str, row: NDArray, start_hz: float) -> tuple[float | None, str]:
    """Return the angular frequency that a special segment is to be seen at, and its kind."""
    lowest, highest = 2.0 * np.pi * LOWEST_HZ, 2.0 * np.pi * HIGHEST_HZ
    if kind == "cutoff":
        at = cutoff(row)
        which = rng.random()
        if which < 0.1:
            return at, "cutoff itself"
        if which < 0.25:
            return min(at * float(rng.uniform(1.0, 5.0)), highest), "above the cutoff"
        distance = float(rng.choice([-1.0, 1.0])) * _log_uniform(rng, 1e-12, 1e-1)
        return at * (1.0 + distance), f"cutoff {distance:+.0e}"
    if kind == "wire":
        waves = _log_uniform(rng, 50.0, 0.7 * LARGEST_WAVES)
        requested = waves / row[2]
        # bending dominates in a wire; the rest is put right by the limit on waves
        w = requested**2 / wave_number_bound(row, 1.0) ** 2
        return min(max(w, lowest), highest), "wire"
    ends = ENDS[rng.choice(len(ENDS), p=[0.25, 0.35, 0.4])]
    w = 2.0 * np.pi * start_hz
    while wave_number_bound(row, w) * row[2] > 200.0:
        w /= 2.0
    while wave_number_bound(row, w) * row[2] < 1.0 and w < highest:
        w *= 2.0
    found = resonance_above(row, w, ends, highest)
    if found is None:
        return None, f"no {ends} resonance in range"
    return found, f"{ends} resonance"


def _diameter(rng: Rng, length: float, stoutest: float, slenderest: float) -> float:
    return min(max(length / _log_uniform(rng, stoutest, slenderest), THINNEST), THICKEST)


def _segments(rng: Rng, n: int, lossy: bool, *, short: bool) -> Rows:
    """Draw segments of one machine-like assembly, or of anything."""
    rows = []
    machine_like = rng.random() < 0.5
    for _ in range(n):
        if short and rng.random() < 0.7:
            length, diameter = _log_uniform(rng, SHORTEST, 2e-3), _log_uniform(rng, 1e-3, 0.05)
        elif machine_like:
            length, diameter = _log_uniform(rng, 1e-3, 0.2), _log_uniform(rng, 4e-3, 0.08)
        else:
            length = _log_uniform(rng, SHORTEST, LONGEST)
            diameter = _diameter(rng, length, 0.02, 2e3)
        rows.append(segment(rng, length=length, outer_diameter=diameter, lossy=lossy))
    return rows


def _assemble(rng: Rng, segments: Rows, start_hz: float, *, damped: bool, branch: bool) -> tuple[Tables, int]:
    """Join segments in a row, with joints between some; return the tables and the far end's node."""
    w = 2.0 * np.pi * start_hz
    joints: Rows = []
    masses: Rows = []
    grounds: Rows = []
    n_joints = int(rng.integers(0, min(3, len(segments) - 1) + 1))
    joined = set(rng.choice(len(segments) - 1, size=n_joints, replace=False).tolist()) if n_joints else set()
    node = 0
    for number, row in enumerate(segments):
        row[:2] = [node, node + 1]
        node += 1
        if number in joined:
            joints.append([node, node + 1, *spring(rng, w, damped=damped)])
            node += 1
            if n_joints < 3 and rng.random() < 0.15:
                # a collet: a rigid body between two joints
                masses.append(_point_mass(rng, node))
                joints.append([node, node + 1, *spring(rng, w, damped=damped)])
                node += 1
    far = node
    if rng.random() < 0.2:
        masses.append(_point_mass(rng, int(rng.integers(far + 1))))
    if rng.random() < 0.2:
        grounds.append([far if rng.random() < 0.6 else int(rng.integers(far + 1)), *spring(rng, w, damped=damped)])
    if branch:
        _add_branch(rng, segments, joints, w, far, damped=damped)
    return flat.make(segments, joints, masses, grounds), far


def _add_branch(rng: Rng, segments: Rows, joints: Rows, w: float, far: int, *, damped: bool) -> None:
    """Attach one or two segments beside an inner node, directly or by a joint, towards either end."""
    at, node = int(rng.integers(1, far)) if far > 1 else 0, far + 1
    if rng.random() < 0.5:
        joints.append([at, node, *spring(rng, w, damped=damped)])
        at, node = node, node + 1
    towards_tip = rng.random() < 0.5
    for row in _segments(rng, int(rng.integers(1, 3)), damped, short=False):
        row[:2] = [node, at] if towards_tip else [at, node]
        segments.append(row)
        at, node = node, node + 1


def _point_mass(rng: Rng, node: int) -> list[float]:
    mass = _log_uniform(rng, 1e-6, 10.0)
    return [node, mass, mass * _log_uniform(rng, 1e-4, 0.1) ** 2 if rng.random() < 0.8 else 0.0]


def _lines(rng: Rng, start_hz: float, target: float | None, model: Tables) -> NDArray[np.complex128]:
    """Return ascending lines: the target, or the start, and others near it or anywhere."""
    w = [target if target is not None else 2.0 * np.pi * start_hz]
    for _ in range(int(rng.integers(0, 4))):
        if rng.random() < 0.5:
            w.append(w[0] * float(rng.uniform(0.9, 1.1)))
        else:
            w.append(2.0 * np.pi * _log_uniform(rng, LOWEST_HZ, HIGHEST_HZ))

    def waves(line: float) -> float:
        return max(wave_number_bound(row, line) * row[2] for row in model.segments)

    w = [min(max(line, 2.0 * np.pi * LOWEST_HZ), 2.0 * np.pi * HIGHEST_HZ) for line in w]
    while waves(max(w)) > LARGEST_WAVES:
        # only the lines that are too high: what was aimed at keeps its last digit
        w = [line / 2.0 if waves(line) > LARGEST_WAVES else line for line in w]
    return np.unique(np.array(w)).astype(np.complex128)
