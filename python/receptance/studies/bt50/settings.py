"""What can be chosen of the study."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BT50Settings"]


@dataclass(frozen=True, kw_only=True)
class BT50Settings:
    """What can be chosen.

    Parameters
    ----------
    step_kn : int, optional
        Every how many kN from 0 to 25: 1 as in the paper, or 2.
    seed : int, optional
        Of hits and noise.

    Raises
    ------
    ValueError
        Another step, or a seed that is negative.

    Examples
    --------
    >>> from receptance.studies.bt50 import BT50Settings
    >>> BT50Settings(step_kn=2)
    BT50Settings(step_kn=2, seed=0)
    """

    step_kn: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        if isinstance(self.step_kn, bool) or not isinstance(self.step_kn, int) or self.step_kn not in (1, 2):
            raise ValueError(
                f"bt50: step_kn is {self.step_kn!r}, expected 1 or 2: laws need six levels, and as many between"
            )
        if isinstance(self.seed, bool) or not isinstance(self.seed, int) or self.seed < 0:
            raise ValueError(f"bt50: seed is {self.seed!r}, expected a whole number from 0 on")
