"""Errors of a spindle or holder that is given as data, as part of the variance of the records that end with it.

A table G that was measured has errors e on each of its lines, and all records of assemblies that end with it share
them. To first order the logarithm of the receptance H of a record r has the error a_r e, a_r = (dH/dG) / H. With the
covariance S of e the errors of the records have the covariance a_r S a_s^H, which is far from diagonal. The fit takes
records as independent, so that it needs a diagonal bound: for positive shares w_r with the sum 1 (Cauchy and Schwarz)

    [a_r S a_s^H]  <=  diag(a_r S a_r^H / w_r).

With w_r proportional to d_r = sqrt(a_r S a_r^H), the variance added to record r is d_r times the sum of d over all
records on that line. Where one record is at a resonance and the others are not, this is little more than its own
variance; several records that are equally sensitive get their number times it, as one measurement has no more
information than that. No interval is too narrow because of the bound, and a misfit is on average below one.

The discrepancy of a part that is given by modes is the same with neighbouring lines in place of records: those within a
quarter in the logarithm of frequency share it.

Sensitivities depend on the unknown joint. The force u at the plane of the part under a unit load has the direction of
the fitted model and the size that the measured receptance implies: H_free - H = h^T u, with the free structure before
the part.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.fit.observation import Observation, altered
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.terminals import RESIDUALS, Terminal
from receptance.report.table import percent


@dataclass(frozen=True)
class SpindleErrors:
    """The errors of parts at the ends of assemblies, as a share of the variance of records."""

    records: int
    """Number of records whose variance includes them."""
    parts: tuple[str, ...]
    share: float
    """Their share of the variance on the median line."""

    def __str__(self) -> str:
        text = (
            f"the variance of {self.records} {'record' if self.records == 1 else 'records'} includes the errors of "
            f"{', '.join(self.parts)}, {percent(self.share)} of it on the median line"
        )
        shared = "; the records share them, so on each line they have the information of one measurement"
        return text if self.records == 1 else text + shared


_LARGEST_FORCE = 30.0
"""Largest factor between the force at the plane that the data imply and that of the fitted model."""


def has_spindle_errors(observations: Sequence[Observation]) -> bool:
    """Return whether a receptance is of an assembly that ends with a part with errors that no parameter describes."""
    return any(_end_with_errors(observation) is not None for observation in observations)


def with_spindle_errors(
    observations: Sequence[Observation], fitted: Sequence[Assembly]
) -> tuple[tuple[Observation, ...], SpindleErrors | None]:
    """Return observations whose variance includes the errors of the parts at their ends, and these; None without any.

    Parameters
    ----------
    observations : sequence of Observation
        With standard deviations.
    fitted : sequence of Assembly
        The assembly of each with values near the best ones.
    """
    parts: list[Terminal] = []
    # By observation its part, the group of each line that shares an error, and the deviation due to it.
    found: dict[int, tuple[int, NDArray[np.intp], NDArray[np.float64]]] = {}
    for i, (observation, assembly) in enumerate(zip(observations, fitted, strict=True)):
        part = _end_with_errors(observation)
        if part is None:
            continue
        if part not in parts:
            parts.append(part)
        deviation = _deviation(observation, assembly, part)
        found[i] = parts.index(part), part.error_groups(observation.frequency_hz.real), deviation
    if not found:
        return tuple(observations), None
    sums: dict[int, NDArray[np.float64]] = {}
    for number in range(len(parts)):
        members = [(numbers, deviation) for at, numbers, deviation in found.values() if at == number]
        groups, deviations = (np.concatenate(column) for column in zip(*members, strict=True))
        sums[number] = np.bincount(groups, weights=deviations).astype(np.float64)
    shares: list[NDArray[np.float64]] = []

    def widened(i: int, observation: Observation) -> Observation:
        if i not in found:
            return observation
        number, groups, deviation = found[i]
        added = deviation * sums[number][groups]
        variance = np.square(np.asarray(observation.standard_deviation)) + added
        shares.append(added / variance)
        return altered(observation, standard_deviation=np.sqrt(variance))

    result = tuple(widened(i, observation) for i, observation in enumerate(observations))
    names = tuple(dict.fromkeys(part.name or part.role for part in parts))
    return result, SpindleErrors(len(found), names, float(np.median(np.concatenate(shares))))


def _end_with_errors(observation: Observation) -> Terminal | None:
    *_, end = observation.assembly.elements.values()
    if not observation.is_receptance or not isinstance(end, Terminal):
        return None
    return end if end.error_root(observation.frequency_hz[:1]) is not None else None


def _deviation(observation: Observation, fitted: Assembly, part: Terminal) -> NDArray[np.float64]:
    """Return the standard deviation of the logarithm of each line due to the errors of the part at the end."""
    lines, (response, excitation) = observation.frequency_hz, observation.coordinates
    root = part.error_root(lines)
    assert root is not None
    addresses = [f"{list(fitted.elements)[-1]}.{name}" for name in RESIDUALS]
    h, slopes = fitted.derivatives(lines, addresses, response=response, excitation=excitation)
    free = _before(fitted).receptance(lines, response=response, excitation=excitation)
    force = (free - observation.receptance) / (free - h)
    force = np.clip(np.abs(force), 1.0 / _LARGEST_FORCE, _LARGEST_FORCE)
    # The change of the receptance is proportional to the force at the plane under the load, and to that under the
    # load at the other coordinate.
    relative = slopes * np.square(force / np.sqrt(np.abs(observation.receptance)))[:, None]
    return np.asarray(np.linalg.norm(np.einsum("ni,nij->nj", relative, root), axis=1))


def _before(assembly: Assembly) -> Assembly:
    """Return the free structure between the tip and the part at the end, without a joint in front of that."""
    elements, attachments = _named(assembly.elements), _named(assembly.attachments)
    names = list(elements)[:-1]
    while not isinstance(elements[names[-1]], Part):
        names.pop()
    return Assembly([elements[name] for name in names], attachments.values(), motion=assembly.motion)


def _named(elements: Mapping[str, Any]) -> dict[str, Any]:
    return {name: replace(element, name=name) for name, element in elements.items()}
