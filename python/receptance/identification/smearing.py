"""A measured receptance as one of the same structure with much more damping.

A causal response is analytic below the real axis, so its value at the complex line f (1 - i b) is the mean of its
values on the real lines under a Lorentzian of half-width b f (Poisson's integral). There peaks are broad, phases turn
slowly, and a model whose resonances are some b off still has a slope towards the right ones; the model itself is
simply evaluated at the complex line. Acceleration per load is averaged, which stays finite towards both ends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF

if TYPE_CHECKING:
    from receptance.identification.task import Observation

__all__ = ["smeared"]

_MARGIN = 2.0
"""Widths that the lines keep off the upper end."""
_FEWEST = 8
"""Least number of lines for a stage."""


def smeared(observation: Observation, width: float, lines: int) -> Observation | None:
    """Return an observation with resonances about `width` broad, relative to their frequency, on some lines.

    Standard deviations become half the width, on every line and frequency. None where the lines are too far apart, or
    the band too narrow, for such a mean, or where the assembly ends with a table, which has no value at complex lines.
    """
    if isinstance(observation, MeasuredFrequencies):
        return MeasuredFrequencies(
            assembly=observation.assembly,
            frequency_hz=observation.frequency_hz,
            modes=observation.modes,
            standard_deviation_hz=0.5 * width * observation.frequency_hz,
            label=observation.label,
            configuration=observation.configuration,
            conditions=observation.conditions,
        )
    f = observation.frequency_hz.real
    if f.size < _FEWEST or observation.assembly.tabulated:
        return None
    steps = np.gradient(f)
    # The mean needs lines above the upper end, which are missing, so lines near it are excluded; below zero the
    # response follows by symmetry.
    top = float(f[-1]) / (1.0 + _MARGIN * width)
    if top <= f[0]:
        return None
    places = np.geomspace(float(f[0]), top, lines)
    places = places[width * places >= np.interp(places, f, steps)]
    if places.size < _FEWEST:
        return None
    accelerance = observation.receptance * observation.frequency_hz**2
    half = width * places[:, None]
    weights = steps * half / ((f - places[:, None]) ** 2 + half**2)
    mirrored = steps * half / ((f + places[:, None]) ** 2 + half**2)
    total = weights.sum(axis=1) + mirrored.sum(axis=1)
    at = places * (1.0 - 1j * width) + 1j * np.interp(places, f, observation.frequency_hz.imag)
    values = (weights @ accelerance + mirrored @ accelerance.conj()) / total / at**2
    return MeasuredFRF(
        assembly=observation.assembly,
        frequency_hz=at,
        receptance=values,
        response=observation.response,
        excitation=observation.excitation,
        standard_deviation=0.5 * width,
        label=observation.label,
        configuration=observation.configuration,
        conditions=observation.conditions,
    )
