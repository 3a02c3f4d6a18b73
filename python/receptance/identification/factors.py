"""What stands between a structure and the numbers that were recorded, as parameters of an observation.

A measured receptance is H(w - i sigma) (1 + sigma / (i w))^q exp(g - i w tau): a calibration gain exp(g), a time delay
tau between the channels, and the rate sigma of an exponential window on both of them. The window acts on what was
recorded, and who does not know of it divides by (i w)^q where (i w + sigma)^q is due: q is 2 for accelerations, 1 for
velocities, 0 for displacements. Their addresses begin with `observation.`; they are zero unless something else is asked
of a fit.
"""

from __future__ import annotations

__all__ = ["DECAY_RATES", "DELAY", "END", "FACTORS", "LOG_GAIN"]

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
"""Time in s after the hit at which a truncated record ended."""
FACTORS = (LOG_GAIN, DELAY, *DECAY_RATES, END)
"""All of them, in the order of the core."""
