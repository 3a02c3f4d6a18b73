"""What a diagnosis says of the rigid holder on the study's own measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from receptance.identification.floor import Floor
from receptance.identification.laws import Law
from receptance.identification.observations import altered
from receptance.studies.bt50.observations import observations

if TYPE_CHECKING:
    from receptance.diagnosis import Candidate, Gain, Verdict
    from receptance.studies.bt50.rig import Motion
    from receptance.studies.bt50.settings import BT50Settings

__all__ = ["Diagnosable", "Diagnosed", "diagnosed", "unknowns_of"]

Diagnosable = Literal["axial", "radial", "both"]

_MOTIONS: dict[Diagnosable, tuple[Motion, ...]] = {
    "axial": ("axial",),
    "radial": ("radial",),
    "both": ("axial", "radial"),
}
_SPRINGS: dict[Motion, tuple[str, ...]] = {"axial": ("taper",), "radial": ("big_end", "small_end")}
_BOUNDS = {"k_y": (1e7, 1e12), "c_y": (1e1, 1e6)}
_LEVELS = 3
"""Levels that the diagnosis sees, low, middle and high; the others are left out."""


@dataclass(frozen=True, kw_only=True)
class Diagnosed:
    """The verdict on the rigid holder.

    Attributes
    ----------
    motion : {"axial", "radial", "both"}
        Which motion.
    seen_kn, left_out_kn : tuple of float
        Forces that the diagnosis saw, and those at which improvement was measured.
    verdict : Verdict
        What `receptance.diagnosis.diagnose` returned, with all causes of the catalogue.
    gains : tuple of Gain
        Improvement at the forces that were left out, in several metrics.
    """

    motion: Diagnosable
    seen_kn: tuple[float, ...]
    left_out_kn: tuple[float, ...]
    verdict: Verdict
    gains: tuple[Gain, ...]

    @property
    def certain(self) -> tuple[Candidate, ...]:
        """The causes that are in every explanation."""
        return tuple(one for one in self.verdict.causes if one.id not in self.verdict.ambiguous_between)


def unknowns_of(motion: Diagnosable) -> list[Law]:
    """Return stiffness and damping of each spring, free at every force."""
    return [
        Law(address=f"{name}.{field}", lower=low, upper=high, free=True, along="drawbar force")
        for own in _MOTIONS[motion]
        for name in _SPRINGS[own]
        for field, (low, high) in _BOUNDS.items()
    ]


def diagnosed(
    motion: Diagnosable,
    settings: BT50Settings | None = None,
    *,
    levels: int = _LEVELS,
    progress: Callable[[str], None] | None = None,
) -> Diagnosed:
    """Diagnose the rigid holder on some of the force levels, and measure what the answer gains on the others.

    Parameters
    ----------
    motion : {"axial", "radial", "both"}
        Along, across, or along and across together: one body, whose springs are those of either motion.
    settings : BT50Settings, optional
        The same settings give the same measurements as in `run`.
    levels : int, optional
        How many forces it sees, from the lowest on, evenly spaced; at least two.
    progress : callable, optional
        Is told what is being done.

    Raises
    ------
    ValueError
        An unknown motion; levels that are not from two up to as many as there are.
    """
    from receptance.diagnosis import diagnose
    from receptance.diagnosis.held_out import improvement

    if motion not in _MOTIONS:
        raise ValueError(f"diagnosed: motion is {motion!r}, expected one of {', '.join(_MOTIONS)}")
    observed = [
        altered(one, configuration=f"{own} {one.configuration}")
        for own in _MOTIONS[motion]
        for one in observations(own, settings, body="rigid", floor=Floor())
    ]
    forces = sorted({one.conditions["drawbar force"] for one in observed})
    if not 2 <= levels <= len(forces):
        raise ValueError(f"diagnosed: levels is {levels!r}, expected from 2 to the {len(forces)} that are measured")
    chosen = forces[:: (len(forces) - 1) // (levels - 1)][:levels]
    seen = [one for one in observed if one.conditions["drawbar force"] in chosen]
    # What lies beyond the last level is not predicted.
    rest = [
        one
        for one in observed
        if one.conditions["drawbar force"] not in chosen and one.conditions["drawbar force"] < chosen[-1]
    ]
    verdict = diagnose(seen, unknowns_of(motion), progress=progress)
    return Diagnosed(
        motion=motion,
        seen_kn=tuple(1e-3 * force for force in chosen),
        left_out_kn=tuple(dict.fromkeys(1e-3 * one.conditions["drawbar force"] for one in rest)),
        verdict=verdict,
        gains=improvement(verdict.selection, verdict.explanation, rest, ()).gains if rest else (),
    )
