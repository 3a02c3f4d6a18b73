"""Noise of a measured table of receptances, as part of the variance of the records whose assembly ends with it.

A table G that was measured has errors e on each of its lines, and all records of assemblies that end with it share
them. To first order the logarithm of the receptance H of a record r has the error a_r e, a_r = (dH/dG) / H. With the
covariance S of e the errors of the records have the covariance a_r S a_s^H, which is far from diagonal. The fit takes
records as independent, so that it needs a diagonal bound: for positive shares w_r with the sum 1 (Cauchy and Schwarz)

    [a_r S a_s^H]  <=  diag(a_r S a_r^H / w_r).

With w_r proportional to d_r = sqrt(a_r S a_r^H), the variance added to record r is d_r times the sum of d over all
records on that line. Where one record is at a resonance and the others are not, this is little more than its own
variance; several records that are equally sensitive get their number times it, as one measurement has no more
information than that. No interval is too narrow because of the bound, and a misfit is on average below one.

Sensitivities depend on the unknown joint. The force u at the plane of the table under a unit load has the direction of
the fitted base model and the size that the measured receptance implies: H_free - H = h^T u, with the free structure
before the table.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.fitting import evaluate, fit_base
from receptance.diagnosis.line_selection import select_lines
from receptance.diagnosis.model import Model, named
from receptance.diagnosis.thresholds import LARGEST_SENSITIVITY
from receptance.fit.observation import Observation, altered
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.terminals import RESIDUALS, MeasuredPart


def with_table_noise(model: Model) -> tuple[Model, tuple[str, ...]]:
    """Return the model with records whose variance includes the errors of their table, and notes.

    Parameters
    ----------
    model : Model
        Observations with standard deviations.
    """
    tables: list[MeasuredPart] = []
    for one in model.observations:
        table = _table(one)
        if table is not None and table not in tables:
            tables.append(table)
    notes = [
        f"the table {table.name!r} has no covariance: its noise counts as an error of the model; give `covariance`, or "
        "read it with `receptance.coupling.read_spindle` from a file with variances"
        for table in tables
        if table.covariance is None
    ]
    noisy = [table for table in tables if table.covariance is not None]
    if not noisy:
        return model, tuple(notes)
    fit = evaluate(model, fit_base(select_lines(model)[0]).values)
    values = fit.task.variables.to_values(fit.x)
    # By observation, its table and the lines of this, and the deviation due to it.
    found: dict[int, tuple[int, NDArray[np.intp], NDArray[np.float64]]] = {}
    sums = [np.zeros(table.frequency_hz.size) for table in noisy]
    for i, (one, mapping) in enumerate(zip(model.observations, fit.task.mappings, strict=True)):
        table = _table(one)
        if one.is_receptance and table in noisy:
            number = noisy.index(table)
            nearest = _nearest(table.frequency_hz, one.frequency_hz.real)
            deviation = _deviation(one, mapping.apply(one.assembly, values), table, nearest)
            np.add.at(sums[number], nearest, deviation)
            found[i] = number, nearest, deviation

    def widened(i: int, observation: Observation) -> Observation:
        if i not in found or not observation.is_receptance:
            return observation
        number, nearest, deviation = found[i]
        variance = np.square(np.asarray(observation.standard_deviation)) + deviation * sums[number][nearest]
        return altered(observation, standard_deviation=np.sqrt(variance))

    names = ", ".join(dict.fromkeys(table.name for table in noisy))
    notes.append(
        f"the variance of {len(found)} records includes the noise of {names}; they share it, so on each line it has "
        "the information of one measurement"
    )
    observations = tuple(widened(i, one) for i, one in enumerate(model.observations))
    return replace(model, observations=observations), tuple(notes)


def _table(observation: Observation) -> MeasuredPart | None:
    *_, end = observation.assembly.elements.values()
    return end if isinstance(end, MeasuredPart) else None


def _nearest(known_hz: NDArray[np.float64], lines_hz: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the number of the line of a table that is nearest to each line."""
    middles = 0.5 * (known_hz[1:] + known_hz[:-1])
    return np.searchsorted(middles, lines_hz)


def _deviation(
    observation: Observation, fitted: Assembly, table: MeasuredPart, nearest: NDArray[np.intp]
) -> NDArray[np.float64]:
    """Return the standard deviation of the logarithm of each line due to the errors of the table."""
    covariance = table.covariance
    assert covariance is not None
    end = list(fitted.elements)[-1]
    addresses, (response, excitation) = [f"{end}.{name}" for name in RESIDUALS], observation.coordinates
    h, slopes = fitted.derivatives(observation.frequency_hz, addresses, response=response, excitation=excitation)
    free = _before(fitted).receptance(observation.frequency_hz, response=response, excitation=excitation)
    force = (free - observation.receptance) / (free - h)
    force = np.clip(np.abs(force), 1.0 / LARGEST_SENSITIVITY, LARGEST_SENSITIVITY)
    # The change of the receptance is proportional to the force at the plane under the load, and to that under the
    # load at the other coordinate.
    relative = slopes * np.square(force / np.sqrt(np.abs(observation.receptance)))[:, None]
    variance = np.einsum("ni,nij,nj->n", relative, covariance[nearest], relative.conj()).real
    return np.asarray(np.sqrt(variance.clip(0.0)))


def _before(assembly: Assembly) -> Assembly:
    """Return the free structure between the tip and the table, without a joint in front of the table."""
    elements = named(assembly.elements)
    names = list(elements)[:-1]
    while not isinstance(elements[names[-1]], Part):
        names.pop()
    return Assembly([elements[name] for name in names], named(assembly.attachments).values(), motion=assembly.motion)
