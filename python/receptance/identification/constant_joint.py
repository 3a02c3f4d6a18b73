"""The one joint k + i w c that suits all lines of an inverse coupling."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.line_solutions import GRID, STEPS, TERMS, Equations

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["coarse_joints", "constant_joint"]

_FOLLOWED = 6
"""Points of a grid that are followed."""


def constant_joint(
    equations: Equations, start: NDArray[np.float64], lines: NDArray[np.bool_]
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Return the k + i w c near a start `(m, 2)` that suits the lines best: misfit, stiffnesses, dashpots `(m,)`.

    Least squares of the logarithm, with Levenberg and Marquardt's steps; stiffnesses stay on their side of zero.
    """
    w, count = equations.angular_frequency, len(equations.terms)

    def evaluate(v: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        h, slope = equations.evaluate(v[:count] + 1j * w[:, None] * v[count:])
        residual = np.log(h / equations.measured) / equations.deviation
        slope = slope / (h * equations.deviation)[..., None]
        slope = np.concatenate([slope, 1j * w[:, None, None] * slope], axis=-1)[lines].reshape(-1, 2 * count)
        flat = residual[lines].reshape(-1)
        return np.concatenate([flat.real, flat.imag]), np.concatenate([slope.real, slope.imag])

    v, damping = start.T.reshape(-1), 1e-3
    sided = np.array([term != "k_ytheta" for term in equations.terms], dtype=np.float64)
    with np.errstate(all="ignore"):
        residual, slope = evaluate(v)
        for _ in range(STEPS):
            size = np.linalg.norm(slope, axis=0)
            if not (np.isfinite(size).all() and np.isfinite(residual).all() and np.all(size > 0.0)):
                break
            normal = (slope / size).T @ (slope / size) + damping * np.eye(2 * count)
            step = -np.linalg.solve(normal, (slope / size).T @ residual) / size
            new, at = evaluate(v + step)
            signs = np.all(sided * v[:count] * (v + step)[:count] >= 0.0)
            if signs and np.sum(new**2) < np.sum(residual**2):
                done = np.sum(residual**2) - np.sum(new**2) < 1e-6 * np.sum(residual**2)
                v, residual, slope, damping = v + step, new, at, max(0.1 * damping, 1e-12)
                if done:
                    break
            else:
                damping *= 10.0
    total = float(np.sum(residual**2))
    return (total if np.isfinite(total) else np.inf), v[:count], v[count:]


def coarse_joints(equations: Equations, lines: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """Return the few points of a grid of constant joints that suit the lines best, as starts `(m, 2)`."""
    around = np.median(np.abs(equations.surroundings), axis=(0, 1))
    free = [term for term in equations.terms if term != "k_ytheta"]
    w = equations.angular_frequency
    chosen = equations.on(lines)
    starts, costs = [], []
    for shares in np.stack(np.meshgrid(*[GRID] * len(free)), -1).reshape(-1, len(free)):
        values = dict(zip(free, shares, strict=True))
        k = np.array([values[t] * around[TERMS[t]] if t in values else 0.0 for t in equations.terms])
        start = np.stack([k, 0.02 * k / float(np.median(w.real))], axis=1)
        h, _ = chosen.evaluate(start[:, 0] + 1j * w[lines][:, None] * start[:, 1])
        cost = np.sum(np.abs(np.log(h / chosen.measured) / chosen.deviation) ** 2)
        starts.append(start)
        costs.append(cost if np.isfinite(cost) else np.inf)
    return [starts[i] for i in np.argsort(costs)[:_FOLLOWED]]
