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
_SURE = 3.0
"""Mean over its standard error from which errors go the same way by more than chance."""
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
    names_of = np.array(order, dtype=object)
    groups = [set(map(str, part)) for count in (1, 2, 3) for part in np.array_split(names_of, count)]
    best: tuple[float, Bias] | None = None
    for number in sorted({one.mode for one in known}):
        for names in groups:
            # Measured less modelled is what they hold.
            own = {one.configuration: -one.frequency_percent for one in known if one.mode == number}
            errors = {name: error for name, error in own.items() if name in names}
            values = np.array(list(errors.values()))
            if values.size < _FEWEST or abs(np.sum(np.sign(values))) < values.size:
                continue
            mean, spread = float(np.mean(values)), float(np.std(values, ddof=1))
            sure = abs(mean) / max(spread / np.sqrt(values.size), 1e-9)
            if sure < _SURE or abs(mean) < _LEAST or (best is not None and sure * abs(mean) <= best[0]):
                continue
            reach = [slenderness[name] for name in errors]
            bias = Bias(number, (min(reach), max(reach)), tuple(errors), mean, spread)
            best = (sure * abs(mean), bias)
    return None if best is None else best[1]
