"""Assemblies that may be the true ones: unknowns, their reaction to tolerances, and errors, the same for all of them.

An error belongs to a thing, so where two assemblies share it, a material say, or the joint, a draw moves both alike. An
error's draws follow from the seed and its name alone: assemblies can be drawn one after the other.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.propagation import NOWHERE, Propagation, Where, tolerances_of
from receptance.identification.mapping import Place
from receptance.identification.prediction import VariableDraws

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.campaign.tolerances import Effects

__all__ = ["Draws"]


class Draws:
    """Draws of all that is uncertain in predictions of a campaign.

    Parameters
    ----------
    propagation : Propagation
        Of the fit, or of nothing where nothing was identified.
    count : int
        How many.
    seed : int
        Of all of them.
    """

    def __init__(self, propagation: Propagation, count: int, seed: int = 0) -> None:
        self.propagation = propagation
        self.count = count
        self.seed = seed
        fit = propagation.fit
        self._values = np.zeros((count, 0))
        if fit is not None:
            drawing, random = VariableDraws(fit), np.random.default_rng(seed)
            # What the fit makes of errors of its observations moves with these very errors.
            shared = [self.error(name) for name in propagation.errors]
            errors = np.stack(shared, axis=1) if shared else np.zeros((count, 0))
            moved = errors @ propagation.reaction.T
            self._values = np.array([drawing.values(random, row) for row in moved])

    def error(self, name: str) -> NDArray[np.float64]:
        """Return the draws of an error, `(count,)` standard normal."""
        return np.random.default_rng([self.seed, zlib.crc32(name.encode())]).standard_normal(self.count)

    def assemblies(self, assembly: Assembly, effects: Effects, at: Where = NOWHERE) -> list[Assembly | None]:
        """Return an assembly with each draw, None where there is none: a joint that is no longer passive, say."""
        if self.propagation.fit is None:
            addresses = list(dict.fromkeys(address for moved in effects.values() for address in moved))
            errors = np.array([self.error(name) for name in effects]).reshape(len(effects), self.count)
            slopes = np.array([[moved.get(a, 0.0) for a in addresses] for moved in effects.values()])
            values = np.array([assembly.get(a) for a in addresses]) + errors.T @ slopes.reshape(len(effects), -1)
            return [_with(assembly, dict(zip(addresses, row, strict=True))) for row in values.tolist()]
        fresh: list[str] = []
        place = Place(assembly, at.configuration, "", at.conditions)
        placed = self.propagation.fit.task.parameters.at(place, tolerances_of(effects), fresh)
        own = np.array([self.error(name) for name in fresh]).reshape(len(fresh), self.count).T
        vectors = np.concatenate([self._values, own], axis=1)
        return [_with(assembly, dict(zip(placed.addresses, placed.values(v).tolist(), strict=True))) for v in vectors]


def _with(assembly: Assembly, values: dict[str, float]) -> Assembly | None:
    try:
        return assembly.replace(values)
    except ValueError:
        return None
