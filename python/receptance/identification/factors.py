"""What stands between a structure and the numbers that were recorded, as parameters of an observation.

A measured receptance is H(w - i sigma) exp(g - i w tau): a calibration gain exp(g), a time delay tau between the
channels, and the rate sigma of an exponential window on both of them. Their addresses begin with `observation.`; they are
zero unless something else is asked of a fit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["DECAY_RATE", "DELAY", "FACTORS", "LOG_GAIN", "frequency_weights"]

LOG_GAIN = "observation.log_gain"
"""Natural logarithm of measured over true magnitude."""
DELAY = "observation.delay"
"""Time in s by which the response's channel lags behind."""
DECAY_RATE = "observation.decay_rate"
"""Rate in 1/s of an exponential window on both channels."""
FACTORS = (LOG_GAIN, DELAY, DECAY_RATE)

_POWERS = {"density": 2.0, "mass": 2.0, "inertia": 2.0, "c_y": 1.0, "c_theta": 1.0, "c_ytheta": 1.0}


def frequency_weights(assembly: Assembly) -> tuple[list[str], NDArray[np.float64]]:
    """Return addresses a and numbers n v with w dH/dw = sum n v dH/da.

    Frequency enters a structure beside its densities, masses and dashpots alone, as w^2 m and w c, so that its
    derivative follows from theirs, and no difference has to be taken.
    """
    powers = {name: _POWERS.get(name.rsplit(".", 1)[-1], 0.0) for name in assembly.parameters}
    chosen = {name: power * assembly.get(name) for name, power in powers.items() if power}
    kept = {name: weight for name, weight in chosen.items() if weight}
    return list(kept), np.array(list(kept.values()))
