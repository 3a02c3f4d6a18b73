"""Records that contradict each other: of one structure at the same places, and further apart than their noise.

No model explains both, so that their difference is an error of a measurement, or a change between the two. Hit and
response may be exchanged: a receptance is the same either way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from receptance.diagnosis.scopes import DirectedPlace, place_of
from receptance.diagnosis.text import Reason
from receptance.fit.adequacy import misfit_limit
from receptance.fit.observation import Observation

_FAR = 3.0
"""Difference of two lines, in standard deviations, from which they are listed among those that differ."""


def contradictions(observations: Sequence[Observation]) -> Iterator[Reason]:
    """Yield the pairs of records of one configuration, at the same places, that differ by more than their noise.

    Their conditions have to be equal, because a joint may depend on them. Lines that both records have are compared.
    """
    for first, second in combinations((record for record in observations if record.is_receptance), 2):
        if not _should_be_equal(first, second):
            continue
        lines, a, b = np.intersect1d(first.frequency_hz, second.frequency_hz, return_indices=True)
        if not lines.size:
            continue
        ratio = second.receptance[b] / first.receptance[a]
        size = np.hypot(first.standard_deviations[a], second.standard_deviations[b])
        distance = np.hypot(np.log(np.abs(ratio)), np.angle(ratio)) / size
        misfit = 0.5 * float(np.mean(np.square(distance)))
        correlated = np.maximum(first.correlated_lines[a], second.correlated_lines[b])
        if misfit <= misfit_limit(2.0 * float(np.sum(1.0 / correlated))):
            continue
        middle = np.sum(ratio / np.abs(ratio))
        phase = np.angle(middle) + np.median(np.angle(ratio / middle))
        differs = lines.real[distance > _FAR] if np.any(distance > _FAR) else lines.real
        yield Reason(
            "contradiction",
            {
                "first": first.label,
                "second": second.label,
                # Medians of magnitude, and of phase around its mean, of the second over the first one.
                "ratio": float(np.median(np.abs(ratio))),
                "phase_deg": float(np.degrees(phase)),
                "percent": 100.0 * differs.size / lines.size,
                "low_hz": float(differs.min()),
                "high_hz": float(differs.max()),
                # Mean square of the difference over its expectation from noise and floor.
                "misfit": misfit,
            },
        )


def _should_be_equal(first: Observation, second: Observation) -> bool:
    """Return whether two records are of one structure, at the same places and under the same conditions."""
    response, excitation = _ends(first)
    same_places = _ends(second) in ((response, excitation), (excitation, response))
    same_state = first.configuration == second.configuration and first.conditions == second.conditions
    return same_places and same_state and first.ends == second.ends and first.assembly == second.assembly


def _ends(record: Observation) -> tuple[DirectedPlace, DirectedPlace]:
    return place_of(record, record.response), place_of(record, record.excitation)
