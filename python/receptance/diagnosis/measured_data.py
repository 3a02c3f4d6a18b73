"""What is done with measured data before the model is fitted to them.

Lines that a diagnosis cannot use are left out, and errors of a spindle or holder that is given as data are added to the
variance. Records that contradict each other are listed: they are of one structure at the same places and further apart
than their noise. No model explains both, so that their difference is an error of a measurement, or a change between the
two. Hit and response may be exchanged: a receptance is the same either way. Copies of a record, held-out ones included,
are listed as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from receptance.diagnosis.changes import DirectedPlace, is_copy, place_of
from receptance.diagnosis.fitting import evaluate, fit_base
from receptance.diagnosis.model import Model
from receptance.diagnosis.text import Reason
from receptance.fit.adequacy import misfit_limit
from receptance.fit.line_selection import FEWEST_LINES, usable_lines
from receptance.fit.observation import Observation
from receptance.fit.spindle_errors import has_spindle_errors, with_spindle_errors
from receptance.model.terminals import MeasuredPart

DOUBTFUL_DATA = ("contradiction", "same_values")
"""Reasons that make everything else doubtful; they are said above the answer."""
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


def copies(observations: Sequence[Observation]) -> Iterator[Reason]:
    """Yield the pairs of FRFs of two configurations with the same values, of which one is a copy."""
    for first, second in combinations((record for record in observations if record.is_receptance), 2):
        if is_copy(first, second):
            yield Reason("same_values", {"first": first.label, "second": second.label})


def _should_be_equal(first: Observation, second: Observation) -> bool:
    """Return whether two records are of one structure, at the same places and under the same conditions."""
    response, excitation = _ends(first)
    same_places = _ends(second) in ((response, excitation), (excitation, response))
    same_state = first.configuration == second.configuration and first.conditions == second.conditions
    return same_places and same_state and first.ends == second.ends and first.assembly == second.assembly


def _ends(record: Observation) -> tuple[DirectedPlace, DirectedPlace]:
    return place_of(record, record.response), place_of(record, record.excitation)


def select_lines(model: Model) -> tuple[Model, tuple[Reason, ...]]:
    """Return the model with the lines that a diagnosis can use, and the reasons why others are left out.

    Raises
    ------
    ValueError
        No measurement has enough such lines.
    """
    reasons: list[Reason] = []
    dropped: dict[str, int] = {}
    kept: list[Observation] = []
    lost = total = 0
    usable = usable_lines(model.observations, model.configuration_of)
    for name, observation, good in zip(model.configuration_of, model.observations, usable, strict=True):
        if not observation.is_receptance or good is None:
            kept.append(observation)
            continue
        count = int(np.count_nonzero(good))
        total += good.size
        lost += good.size - count
        if count < min(FEWEST_LINES, good.size):
            dropped[observation.label or name] = count
            continue
        kept.append(observation if good.all() else observation.select(good))
    if lost:
        reasons.append(Reason("lines_left_out", {"lost": lost, "total": total}))
    if dropped:
        reasons.append(Reason("records_left_out", {"records": dropped}))
        if not kept:
            raise ValueError(str(reasons[-1]))
    return (model.select(tuple(kept)) if dropped else replace(model, observations=tuple(kept))), tuple(reasons)


def with_table_noise(model: Model) -> tuple[Model, tuple[Reason, ...]]:
    """Return the model with records whose variance includes the errors of what ends their assemblies, and reasons.

    Parameters
    ----------
    model : Model
        Observations with standard deviations.
    """
    exact: list[MeasuredPart] = []
    for observation in model.observations:
        *_, end = observation.assembly.elements.values()
        if isinstance(end, MeasuredPart) and end.covariance is None and end not in exact:
            exact.append(end)
    reasons = [Reason("table_without_covariance", {"table": table.name}) for table in exact]
    if not has_spindle_errors(model.observations):
        return model, tuple(reasons)
    fit = evaluate(model, fit_base(select_lines(model)[0]).values)
    values = fit.task.variables.to_values(fit.x)
    pairs = zip(model.observations, fit.task.mappings, strict=True)
    fitted = [mapping.apply(observation.assembly, values) for observation, mapping in pairs]
    observations, errors = with_spindle_errors(model.observations, fitted)
    reasons += [] if errors is None else [Reason("spindle_errors", {"errors": errors})]
    return replace(model, observations=observations), tuple(reasons)
