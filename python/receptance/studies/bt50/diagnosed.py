"""What a diagnosis says of the rigid holder on the study's own measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from receptance.identification.floor import Floor
from receptance.identification.laws import Law
from receptance.studies.bt50.observations import observations

if TYPE_CHECKING:
    from receptance.diagnosis import Candidate, Gain, Verdict
    from receptance.studies.bt50.rig import Motion
    from receptance.studies.bt50.settings import BT50Settings

__all__ = ["Diagnosed", "diagnosed", "unknowns_of"]

_SPRINGS: dict[Motion, tuple[str, ...]] = {"axial": ("taper",), "radial": ("big_end", "small_end")}
_BOUNDS = {"k_y": (1e7, 1e12), "c_y": (1e1, 1e6)}
_LEVELS = 3
"""Levels that the diagnosis sees, low, middle and high; the others are left out."""


@dataclass(frozen=True, kw_only=True)
class Diagnosed:
    """The verdict on the rigid holder.

    Attributes
    ----------
    motion : {"axial", "radial"}
        Which motion.
    seen_kn, left_out_kn : tuple of float
        Forces that the diagnosis saw, and those at which improvement was measured.
    verdict : Verdict
        What `receptance.diagnosis.diagnose` returned, with all causes of the catalogue.
    gains : tuple of Gain
        Improvement at the forces that were left out, in several metrics.
    """

    motion: str
    seen_kn: tuple[float, ...]
    left_out_kn: tuple[float, ...]
    verdict: Verdict
    gains: tuple[Gain, ...]

    @property
    def certain(self) -> tuple[Candidate, ...]:
        """The causes that are in every explanation."""
        return tuple(one for one in self.verdict.causes if one.id not in self.verdict.ambiguous_between)


def unknowns_of(motion: Motion) -> list[Law]:
    """Return stiffness and damping of each spring, free at every force."""
    return [
        Law(address=f"{name}.{field}", lower=low, upper=high, free=True, along="drawbar force")
        for name in _SPRINGS[motion]
        for field, (low, high) in _BOUNDS.items()
    ]


def diagnosed(
    motion: Motion, settings: BT50Settings | None = None, *, progress: Callable[[str], None] | None = None
) -> Diagnosed:
    """Diagnose the rigid holder on some of the force levels, and measure what the answer gains on the others.

    Parameters
    ----------
    motion : {"axial", "radial"}
        Along or across.
    settings : BT50Settings, optional
        The same settings give the same measurements as in `run`.
    progress : callable, optional
        Is told what is being done.
    """
    from receptance.diagnosis import diagnose
    from receptance.diagnosis.held_out import improvement

    observed = observations(motion, settings, body="rigid", floor=Floor())
    forces = list(dict.fromkeys(one.conditions["drawbar force"] for one in observed))
    chosen = forces[:: (len(forces) - 1) // (_LEVELS - 1)][:_LEVELS]
    seen = [one for one in observed if one.conditions["drawbar force"] in chosen]
    # What lies beyond the last level is not predicted.
    rest = [one for one in observed if one not in seen and one.conditions["drawbar force"] < chosen[-1]]
    verdict = diagnose(seen, unknowns_of(motion), progress=progress)
    return Diagnosed(
        motion=motion,
        seen_kn=tuple(1e-3 * force for force in chosen),
        left_out_kn=tuple(dict.fromkeys(1e-3 * one.conditions["drawbar force"] for one in rest)),
        verdict=verdict,
        gains=improvement(verdict.selection, verdict.explanation, rest, ()).gains,
    )
