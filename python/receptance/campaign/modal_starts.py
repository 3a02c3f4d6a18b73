"""Bounds and start values for modal parts with `identify = true`, from the measured FRFs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.campaign.build import addresses_of
from receptance.identification import MeasuredFRF, Unknown
from receptance.identification.unknowns import covered
from receptance.model.beams import Part
from receptance.model.terminals import RESIDUALS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.campaign.build import Builder, Built
    from receptance.campaign.measurements import Measurement
    from receptance.campaign.problems import KeyPath
    from receptance.campaign.schema import CampaignTable, ModalPartTable

__all__ = ["modal_unknowns"]

_DAMPING = (1e-3, 0.03, 0.3)
"""Lower bound, start and upper bound of damping ratios."""
_FREQUENCY = 2.0
"""Factor between bounds and start of natural frequencies: holder and tool change those of the spindle."""
_SHAPE = 10.0
"""Factor between bounds and start of y."""
_SLOPE = 5.0
"""Bound of theta, relative to y over the length of the part before the plane."""
_RESIDUAL = 10.0
"""Bound of residuals, relative to the static compliance of the modes at their start."""
_PROMINENCE = 0.2
"""Prominence of peaks of the logarithm of the mean FRF."""
_SAME = 0.1
"""Relative distance within which a peak belongs to a mode with a given frequency."""


def modal_unknowns(
    table: CampaignTable, built: Built, measurements: Mapping[str, Measurement], builder: Builder
) -> dict[str, Unknown]:
    """Return the unknowns of modal parts with `identify = true` that are not listed in `unknowns`."""
    found: dict[str, Unknown] = {}
    for name, part in table.modal_parts.items():
        if not part.identify:
            continue
        path: KeyPath = ("modal_parts", name)
        seen = [
            one.observation
            for one in measurements.values()
            if not one.held_out
            and isinstance(one.observation, MeasuredFRF)
            and name in one.observation.assembly.elements
        ]
        if not seen:
            builder.problems.add(
                (*path, "identify"),
                "is true, but there is no FRF for identification of an assembly that ends with this part, expected one",
            )
            continue
        rigid = [index for index, mode in enumerate(part.modes) if mode.frequency_hz == 0.0]
        if rigid:
            builder.problems.add(
                (*path, "modes", rigid[0]),
                "is a rigid-body mode, but the part has `identify = true`, which is for elastic modes; expected "
                "bounds of its numbers in `unknowns` instead",
            )
            continue
        automatic = _of_part(name, part, seen)
        given = {own for unknown in built.unknowns.values() for own in addresses_of(unknown)}
        found |= {address: unknown for address, unknown in automatic.items() if address not in given}
        for title, one in table.assemblies.items():
            for address in one.set:
                if title in built.assemblies and covered(address, built.assemblies[title]) & automatic.keys():
                    here: KeyPath = ("assemblies", title, "set", address)
                    builder.problems.add(
                        here, f"is set here, but `modal_parts.{name}.identify` is true, expected one of the two"
                    )
    return found


def _of_part(name: str, part: ModalPartTable, seen: list[MeasuredFRF]) -> dict[str, Unknown]:
    lines, logarithm = _mean(seen)
    frequencies = _frequencies([mode.frequency_hz for mode in part.modes], lines, logarithm)
    length = [one for one in seen[0].assembly.elements.values() if isinstance(one, Part)][-1].length
    lower, middle, upper = _DAMPING
    found: list[Unknown] = []
    compliance = 0.0
    for index, (mode, frequency) in enumerate(zip(part.modes, frequencies, strict=True)):
        own = f"{name}.mode[{index}]"
        damping = mode.damping_ratio if "damping_ratio" in mode.model_fields_set else middle
        # At its peak a mode has |H| = y^2 / (2 zeta w^2).
        w = 2.0 * np.pi * frequency
        peak = float(np.exp(np.interp(frequency, lines, logarithm)))
        size = abs(mode.y) or w * float(np.sqrt(2.0 * middle * peak))
        slope = max(_SLOPE * size / length, 2.0 * abs(mode.theta))
        turned = -1.0 if mode.y < 0.0 else 1.0  # the sign of a whole shape is free
        compliance += (size / w) ** 2
        found += [
            _around(f"{own}.frequency_hz", frequency, frequency / _FREQUENCY, frequency * _FREQUENCY),
            _around(f"{own}.damping_ratio", damping, min(lower, damping / 2.0), max(upper, 2.0 * damping)),
            _around(f"{own}.y", size, size / _SHAPE, size * _SHAPE),
            _around(f"{own}.theta", turned * mode.theta, -slope, slope),
        ]
    for residual, unit in zip(RESIDUALS, (1.0, 1.0 / length**2, 1.0 / length), strict=True):
        value = float(getattr(part, residual))
        reach = max(_RESIDUAL * compliance * unit, 2.0 * abs(value))
        found.append(_around(f"{name}.{residual}", value, -reach, reach))
    return {unknown.address: unknown for unknown in found}


def _around(address: str, start: float, lower: float, upper: float) -> Unknown:
    return Unknown(address=address, lower=float(lower), upper=float(upper), start=float(start))


def _mean(seen: list[MeasuredFRF]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return lines in Hz, and the mean logarithm of the magnitudes of all FRFs that cover each line."""
    own = [one.frequency_hz.real for one in seen]
    lines: NDArray[np.float64] = np.unique(np.concatenate(own))
    rows = []
    for at, one in zip(own, seen, strict=True):
        magnitude: NDArray[Any] = np.abs(one.receptance)
        rows.append(np.interp(lines, at, np.log(np.maximum(magnitude, 1e-300)), left=np.nan, right=np.nan))
    mean: NDArray[np.float64] = np.nanmean(rows, axis=0)
    return lines, mean


def _frequencies(given: list[float | None], lines: NDArray[np.float64], logarithm: NDArray[np.float64]) -> list[float]:
    """Return a frequency for each mode: the given one, or one of the lowest peaks in ascending order."""
    from scipy.signal import find_peaks

    known = [one for one in given if one is not None]
    missing = len(given) - len(known)
    # A free structure that joins the plane raises no natural frequency: the n-th of the assembly is at most that
    # of the spindle (separation of eigenvalues). So the lowest peaks are taken, not the highest.
    peaks = [float(f) for f in lines[find_peaks(logarithm, prominence=_PROMINENCE)[0]]]
    free = [f for f in peaks if all(abs(f - one) > _SAME * one for one in known)][:missing]
    # Modes without a peak are distributed over the band.
    rest = missing - len(free)
    free += [float(f) for f in np.geomspace(max(lines[0], 0.01 * lines[-1]), lines[-1], rest + 2)[1:-1]]
    waiting = iter(sorted(free))
    return [next(waiting) if one is None else one for one in given]
