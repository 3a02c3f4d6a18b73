"""Errors that go the same way: a mode that is off alike in all short, middling or slender tools."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis.joint_causes import overhang_of
from receptance.identification.task import place_of

if TYPE_CHECKING:
    from receptance.diagnosis.by_mode import ModeResidual
    from receptance.diagnosis.model import Model

__all__ = ["Bias", "bias_of", "slenderness_of"]

_FEWEST = 3
_RARE = 0.05
"""Chance up to which errors are believed to go the same way."""
_LEAST = 0.02
"""Percent below which nobody cares."""


@dataclass(frozen=True)
class Bias:
    """Natural frequencies of one mode that are off the same way.

    Attributes
    ----------
    mode : int
        Which.
    slenderness : (float, float)
        Overhang over diameter of the tools that it is of, from and to.
    configurations : tuple of str
        Theirs.
    mean_percent : float
        Calculated less measured, on average.
    deviation_percent : float
        Standard deviation of single ones.
    """

    mode: int
    slenderness: tuple[float, float]
    configurations: tuple[str, ...]
    mean_percent: float
    deviation_percent: float

    def __str__(self) -> str:
        low, high = self.slenderness
        count = len(self.configurations)
        way = "low" if self.mean_percent < 0.0 else "high"
        return (
            f"mode {self.mode} of the {count} tools that stick out {low:.1f} to {high:.1f} diameters is calculated "
            f"{abs(self.mean_percent):.2g} % too {way} on average, {count} of {count} the same way"
        )


def slenderness_of(model: Model) -> dict[str, float]:
    """Return overhang over diameter of each configuration whose tool has one."""
    found: dict[str, float] = {}
    for index, (one, anatomy) in enumerate(zip(model.observations, model.anatomies, strict=True)):
        if anatomy.joint and anatomy.tool:
            length = overhang_of(one.assembly, anatomy)
            diameter = one.assembly.get(f"{length.rpartition('.')[0]}.outer_diameter")
            found[place_of(one, index).configuration] = one.assembly.get(length) / diameter
    return found


def bias_of(modes: Sequence[ModeResidual], slenderness: Mapping[str, float]) -> Bias | None:
    """Return the errors that most clearly go the same way: of all tools, or of a half or a third by slenderness."""
    known = [one for one in modes if one.configuration in slenderness and np.isfinite(one.frequency_percent)]
    order = sorted({one.configuration for one in known}, key=lambda name: slenderness[name])
    names = np.array(order, dtype=object)
    groups = [tuple(map(str, part)) for count in (1, 2, 3) for part in np.array_split(names, count)]
    tried: list[tuple[float, Bias]] = []
    for number in sorted({one.mode for one in known}):
        # Measured less modelled is what they hold.
        errors = {one.configuration: -one.frequency_percent for one in known if one.mode == number}
        for group in groups:
            own = {name: errors[name] for name in group if name in errors}
            if len(own) >= _FEWEST:
                tried.append(_tested(number, own, slenderness))
    if not tried:
        return None
    chance, best = min(tried, key=lambda one: one[0])
    # Each group and mode was a chance to find something.
    return best if chance * len(tried) < _RARE and abs(best.mean_percent) >= _LEAST else None


def _tested(number: int, errors: Mapping[str, float], slenderness: Mapping[str, float]) -> tuple[float, Bias]:
    """Return the chance that errors of either sign would go the same way so clearly, and what they are."""
    from scipy.special import stdtr  # the light part of scipy.stats

    values = np.array(list(errors.values()))
    mean, spread = float(np.mean(values)), float(np.std(values, ddof=1))
    alike = bool(np.all(np.sign(values) == np.sign(mean)))
    sure = abs(mean) / max(spread / np.sqrt(values.size), 1e-9)
    reach = [slenderness[name] for name in errors]
    bias = Bias(number, (min(reach), max(reach)), tuple(errors), mean, spread)
    return (2.0 * float(stdtr(values.size - 1, -sure)) if alike else 1.0), bias
