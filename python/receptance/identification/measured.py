"""From an FRF to what a fit takes: one entry, as receptance, on lines that are usable, with its spread."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.coordinates import Coordinate
from receptance.errors import ReceptanceWarning
from receptance.frf import FRF, Unplaced
from receptance.frf.low_frequency import low_frequency_rise
from receptance.frf.variance import with_variance
from receptance.identification.floor import Floor
from receptance.identification.steadying import steadied, weakly_known

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["UNUSED_COHERENCE", "observe", "unused_coherence"]

UNUSED_COHERENCE = "the coherence is not used"
"""How the note on a coherence begins that gives no standard deviations."""
_FEW = 10.0
"""Degrees of freedom below which a line's standard deviation is itself mostly noise: 25 % and more."""
_EXPLAINED = 4.0
"""Times the variance that is stated, up to which scatter of the lowest lines is the noise that it states."""


def observe(
    frf: FRF,
    response: Coordinate | str | int | None,
    excitation: Coordinate | str | int | None,
    low_hz: float | None,
    high_hz: float | None,
    floor: float | Floor,
    label: str | None,
) -> dict[str, Any]:
    """Return the fields of a `MeasuredFRF`; see `MeasuredFRF.from_frf`."""
    if not isinstance(frf, FRF):
        raise TypeError(f"MeasuredFRF.from_frf: frf is {frf!r}, expected an FRF")
    owner = repr(frf)
    name = frf.label if label is None else label
    if isinstance(floor, Floor):
        least = floor
    else:
        least = Floor(relative=_checks.not_negative("MeasuredFRF.from_frf", "floor", floor), frequency=0.0)
    entry, places, notes = _entry(frf, response, excitation)
    entry = with_variance(entry)
    if entry.log_variance is None and entry.coherence is not None:
        notes.append(unused_coherence(entry.averages))
        warnings.warn(f"{owner}: {notes[-1]}", ReceptanceWarning, stacklevel=4)
    # Over the band first: the line at 0 Hz then causes no note where it is not asked for.
    entry = entry.select(low_hz=low_hz, high_hz=high_hz).masked().to("receptance")
    known = entry.frequency_hz > 0.0
    if entry.log_variance is not None:
        infinite = np.isinf(entry.log_variance[:, 0, 0]) & known
        if infinite.any():
            notes.append(f"{np.count_nonzero(infinite)} lines of infinite variance are left out")
            known &= ~infinite
    if not known.any():
        raise ValueError(f"{owner}: no line is left for {name or 'an observation'}: at 0 Hz, or of infinite variance")
    spread = _spread(owner, entry, known, least, notes)
    notes += _of_low_frequency(entry.frequency_hz[known], entry.values[known, 0, 0], spread, places[0] == places[1])
    return {
        "frequency_hz": entry.complex_frequency_hz[known],
        "receptance": entry.values[known, 0, 0],
        "response": places[0],
        "excitation": places[1],
        "standard_deviation": spread,
        "correlated_lines": entry.correlated_lines[known],
        "label": name,
        "form": frf.form,
        "notes": (*entry.notes, *notes),
    }


def unused_coherence(averages: int | None) -> str:
    """Return why a coherence gives no standard deviations, and what to write."""
    if averages is None:
        return (
            f"{UNUSED_COHERENCE}, because it is not known how many records were averaged: give that number, "
            "`averages = 10` say, and standard deviations follow from the coherence"
        )
    return (
        f"{UNUSED_COHERENCE}, because averages is {averages}: the coherence of a single record is 1 whatever was "
        "measured; give a standard deviation"
    )


def _of_low_frequency(
    lines: NDArray[np.float64], values: NDArray[np.complex128], spread: NDArray[np.float64] | None, drive_point: bool
) -> list[str]:
    """Return a note on lowest lines that are integrated noise or drift, unless the standard deviations cover it."""
    rise = low_frequency_rise(lines, values, drive_point=drive_point)
    if rise is None:
        return []
    if spread is not None and rise.noise_share > 0.0:
        own = lines <= rise.highest_hz
        power = np.abs(lines[own] ** 2 * values[own]) ** 2
        # Both parts of the logarithm scatter by the standard deviation.
        stated = float(np.sum(2.0 * spread[own] ** 2 * power) / np.sum(power))
        if _EXPLAINED * stated > rise.noise_share:
            return []
    return [f"{rise}. A fit takes them as they are: leave them out, from about {rise.clear_hz:g} Hz on there is little"]


def _entry(
    frf: FRF, response: Coordinate | str | int | None, excitation: Coordinate | str | int | None
) -> tuple[FRF, list[Coordinate], list[str]]:
    """Return the wanted entry alone, where its response and excitation are, and what is to be said of that."""
    picks, notes = [], []
    for name, wanted in (("responses", response), ("excitations", excitation)):
        side = getattr(frf, name)
        if len(side) > 1 and wanted is None:
            raise ValueError(f"{frf!r} has {len(side)} {name}: say which with {name[:-1]}=, a coordinate or a number")
        picks.append(0 if len(side) == 1 and (wanted is None or isinstance(wanted, Coordinate)) else wanted)
    entry = frf.select(responses=picks[0], excitations=picks[1])
    places = []
    for name, wanted, found in (
        ("response", response, entry.responses[0]),
        ("excitation", excitation, entry.excitations[0]),
    ):
        place = wanted if isinstance(wanted, Coordinate) else found
        if place.direction != found.direction:
            raise ValueError(f"{frf!r}: its {name} is in direction {found.direction!r}, which {place!r} is not")
        if isinstance(place, Unplaced):
            notes.append(f"where the {name} is, is not known: taken at the tip")
            place = Coordinate(direction=place.direction)
        elif place != found and not isinstance(found, Unplaced):
            notes.append(f"the {name} is taken at {place!r}, the FRF says {found!r}")
        places.append(place)
    return entry, places, notes


def _spread(
    owner: str, entry: FRF, known: NDArray[np.bool_], floor: Floor, notes: list[str]
) -> NDArray[np.float64] | None:
    """Return the standard deviations of lines that count as independent, `(n,)`, or None where nothing is known."""
    lines, values = entry.frequency_hz[known], entry.values[known, 0, 0]
    if entry.log_variance is None:
        if not floor:
            return None
        notes.append(f"the FRF has no variance: the floor of {floor} is all there is")
        return np.sqrt(floor.variance(lines, values))
    alike = entry.correlated_lines[known]
    noise = steadied(lines, values, entry.log_variance[known, 0, 0], alike) * alike
    if entry.degrees_of_freedom is not None:
        noise *= weakly_known(entry.degrees_of_freedom[known, 0, 0])
    spread: NDArray[np.float64] = np.sqrt(noise + floor.variance(lines, values, noise))
    if floor:
        share = float(np.median(noise / spread**2))
        notes.append(f"floor of {floor} added to the noise, which is {100.0 * share:.0f} % of the median variance")
    exact = np.flatnonzero(spread == 0.0)
    if exact.size:
        raise ValueError(
            f"{owner}: the variance is zero on {exact.size} lines, first at {lines[exact[0]]:g} Hz "
            "(a coherence of exactly 1), so they would decide everything; give a floor, floor=0.003 say"
        )
    if entry.degrees_of_freedom is not None:
        freedom = float(np.median(entry.degrees_of_freedom[known]))
        if freedom < _FEW:
            notes.append(
                f"standard deviations from {freedom:.3g} degrees of freedom are mostly noise themselves: pool the "
                "variance over neighbouring lines"
            )
    return spread
