"""What stands between a structure and the numbers that were recorded, as parameters of an observation.

A measured receptance is H(w - i sigma) (1 + sigma / (i w))^q exp(g - i w tau): a calibration gain exp(g), a time delay
tau between the channels, and the rate sigma of an exponential window on both of them. The window acts on what was
recorded, and who does not know of it divides by (i w)^q where (i w + sigma)^q is due: q is 2 for accelerations, 1 for
velocities, 0 for displacements. Their addresses begin with `observation.`; they are zero unless something else is asked
of a fit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = ["DECAY_RATES", "DELAY", "END", "FACTORS", "LOG_GAIN", "frequency_powers", "frequency_weights"]

LOG_GAIN = "observation.log_gain"
"""Natural logarithm of measured over true magnitude."""
DELAY = "observation.delay"
"""Time in s by which the response's channel lags behind."""
DECAY_RATES = {
    "observation.decay_rate": 2,
    "observation.decay_rate_of_velocity": 1,
    "observation.decay_rate_of_displacement": 0,
}
"""Rate in 1/s of an exponential window on both channels, and how often what was recorded is integrated."""
END = "observation.end"
"""Time in s after the hit at which the record ended, of an observation that says that it did (see `early_end`)."""
FACTORS = (LOG_GAIN, DELAY, *DECAY_RATES, END)

_POWERS = {"density": 2.0, "mass": 2.0, "inertia": 2.0, "c_y": 1.0, "c_theta": 1.0, "c_ytheta": 1.0}
_MODAL_POWERS = dict.fromkeys(("frequency_hz", "y", "theta", "y_imaginary", "theta_imaginary"), -1.0)
"""Of the numbers of a mode: its receptance is phi^2 / w^2 times a function of w over its natural frequency."""


def frequency_powers(assembly: Assembly) -> dict[str, float]:
    """Return the addresses beside which frequency enters, and its power there."""
    powers = {}
    for name in assembly.parameters:
        owner, quantity = name.rsplit(".", 1)
        powers[name] = (_MODAL_POWERS if ".mode[" in owner else _POWERS).get(quantity, 0.0)
    return {name: power for name, power in powers.items() if power}


def frequency_weights(assembly: Assembly) -> tuple[list[str], NDArray[np.float64]]:
    """Return addresses a and numbers n v with w dH/dw = sum n v dH/da.

    Frequency enters a structure beside its densities, masses and dashpots, as w^2 m and w c, and in modal parts as
    phi / w and w / w_r, so that its derivative follows from theirs, and no difference has to be taken.
    """
    chosen = {name: power * assembly.get(name) for name, power in frequency_powers(assembly).items()}
    kept = {name: weight for name, weight in chosen.items() if weight}
    return list(kept), np.array(list(kept.values()))
