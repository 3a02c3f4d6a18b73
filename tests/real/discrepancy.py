"""What the engineer's model leaves of the plain records: how much, where, and over which length in frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from real.bridge import fit, observations_of
from real.cases import HIGHEST_HZ, Case, Setup, level_record, modelab_case
from real.exact import Lines, Values, shifted_mode
from real.structures import HIT_PLACES, brake_reuss, modelab

DECIBELS = 20.0 / np.log(10.0)
NEAR_HZ = 8.0
"""Distance from a natural frequency up to which a line is near it: some five half-power widths with the window."""
LAGS = (4, 12, 24, 40)
"""Lags in lines."""
DEEP_HZ = 12.0
"""The same for antiresonances, the lowest points of a record."""


@dataclass(frozen=True)
class Left:
    """What is left of one record: measured over modelled, as decibels and radians."""

    label: str
    misfit: float
    decibels_between: float
    """Median between resonances and antiresonances: a gain would be here."""
    rms_between: float
    rms_near: float
    rms_deep: float
    radians: float
    """Median absolute phase between."""
    length_hz: float
    """Lag at which the autocorrelation of the complex logarithm falls below 1/e; see `length`."""


@dataclass(frozen=True)
class Discrepancy:
    """The plain model of a structure against all its records."""

    structure: str
    misfit: float
    frequency_percent: tuple[float, ...]
    """Natural frequencies, modelled less measured."""
    records: tuple[Left, ...]
    correlation: tuple[tuple[float, float], ...]
    """Lags in Hz and the correlation of the complex logarithm over all records, about zero."""
    between_records: float
    """Mean correlation of two records on the same lines, about zero."""


def describe(structure: str, without: tuple[int, ...] = ()) -> Discrepancy:
    """Return what is left of all records of a structure; `without` leaves out some, by number."""
    case = _whole(structure, without)
    found = fit(case)
    modes: list[float] = []
    percent: tuple[float, ...] = ()
    if structure == "modelab":
        beam = modelab()
        assert beam is not None
        modes = [shifted_mode(mode)[0] for mode in beam.modes]
        percent = tuple(100.0 * (f / hz - 1.0) for f, hz in zip(found.frequencies_hz, modes, strict=False))
    rows, logarithms = [], []
    observations = observations_of(case)
    for one, deviation, residual in zip(observations, found.deviations, found.residuals, strict=True):
        real, imaginary = residual.reshape(2, -1) * deviation
        rho = real + 1j * imaginary
        logarithms.append(limited(rho))
        hz = np.real(one.frequency_hz)
        height = np.abs(one.receptance) * hz**2
        rows.append(_left(one.label, hz, height, rho, modes, float(np.mean(residual**2))))
    spacing = float(np.mean(np.diff(hz)))
    lags = [lag for lag in LAGS if lag < hz.size // 2]
    correlation = tuple((lag * spacing, _correlation(logarithms, lag)) for lag in lags)
    return Discrepancy(structure, found.misfit, percent, tuple(rows), correlation, _between(logarithms))


def _whole(structure: str, without: tuple[int, ...]) -> Case:
    """Return all records of a structure up to the end of its band."""
    if structure == "modelab":
        beam = modelab()
        if beam is None:
            raise FileNotFoundError("the ModeLAB beam is not in the folder of measured files")
        hits = tuple((hit, 0.0) for hit in range(len(HIT_PLACES)) if hit not in without)
        return modelab_case(beam, Setup(hits, HIGHEST_HZ[-1]), None)
    levels = brake_reuss()
    if levels is None:
        raise FileNotFoundError("the Brake-Reuss beam is not in the folder of measured files")
    return Case(structure, tuple(level_record(one) for i, one in enumerate(levels) if i not in without))


def _left(label: str, hz: Lines, height: Lines, rho: Values, modes: list[float], misfit: float) -> Left:
    """Return what is left of one record; lines of no kind give zeros."""
    lowest = np.flatnonzero((height[1:-1] < height[:-2]) & (height[1:-1] < height[2:])) + 1
    near = _close(hz, np.array(modes), NEAR_HZ)
    # A band within one resonance has no antiresonances; its lowest points are scatter.
    deep = _close(hz, hz[lowest] if modes else hz[:0], DEEP_HZ)
    between = ~near & ~deep
    decibels = DECIBELS * rho.real

    def rms(own: NDArray[np.bool_]) -> float:
        return float(np.sqrt(np.mean(decibels[own] ** 2))) if own.any() else 0.0

    return Left(
        label=label,
        misfit=misfit,
        decibels_between=float(np.median(decibels[between])),
        rms_between=rms(between),
        rms_near=rms(near),
        rms_deep=rms(deep & ~near),
        radians=float(np.median(np.abs(rho.imag[between]))),
        length_hz=length(hz, rho),
    )


def _close(hz: Lines, places: Lines, distance: float) -> NDArray[np.bool_]:
    if not places.size:
        return np.zeros(hz.size, dtype=bool)
    found: NDArray[np.bool_] = np.abs(hz[:, None] - places[None, :]).min(axis=1) <= distance
    return found


def limited(rho: Values) -> Values:
    """Return values limited to three times their median size, so that single antiresonances do not decide."""
    size = np.maximum(np.abs(rho), 1e-300)
    return rho * np.minimum(1.0, 3.0 * np.median(size) / size)


def _correlation(logarithms: list[Values], lag: int) -> float:
    products = np.concatenate([(own[lag:] * np.conj(own[:-lag])).real for own in logarithms])
    return float(np.mean(products) / np.mean(np.abs(np.concatenate(logarithms)) ** 2))


def _between(logarithms: list[Values]) -> float:
    """Return the mean correlation of two records; those of another number of lines are left out."""
    size = logarithms[0].size
    units = np.array([own / np.linalg.norm(own) for own in logarithms if own.size == size])
    products = (units @ units.conj().T).real
    return float(np.mean(products[np.triu_indices(len(units), 1)]))


def length(hz: Lines, rho: Values) -> float:
    """Return the lag in Hz at which the autocorrelation about the mean falls below 1/e; lines are evenly spaced."""
    centred = limited(rho - np.median(rho.real) - 1j * np.median(rho.imag))
    power = np.mean(np.abs(centred) ** 2)
    for lag in range(1, hz.size // 2):
        if np.mean(centred[lag:] * np.conj(centred[:-lag])).real < power / np.e:
            return float(lag * np.mean(np.diff(hz)))
    return float(hz[-1] - hz[0])


def text(found: Discrepancy) -> str:
    """Return the discrepancy as a table of 80 columns."""
    lines = [f"{found.structure}: plain model, nothing hidden, misfit {found.misfit:.3g}"]
    if found.frequency_percent:
        percent = ", ".join(f"{value:+.3f}" for value in found.frequency_percent)
        lines.append(f"natural frequencies, modelled over measured: {percent} %")
    lines.append(f"{'measured over modelled':<23} misfit median   rms  at modes  at antires.  phase length")
    lines.append(f"{'':<23}        {'dB':>6}    dB        dB           dB    rad     Hz")
    for one in found.records:
        sizes = f"{one.decibels_between:+6.2f} {one.rms_between:5.2f} {one.rms_near:9.2f} {one.rms_deep:12.2f}"
        lines.append(f"{one.label[-23:]:<23} {one.misfit:6.3g} {sizes} {one.radians:6.3f} {one.length_hz:6.3g}")
    lags = ", ".join(f"{value:.2f} ({lag:.3g})" for lag, value in found.correlation)
    lines.append(f"correlation (Hz): {lags}; records {found.between_records:+.2f}")
    return "\n".join(lines)
