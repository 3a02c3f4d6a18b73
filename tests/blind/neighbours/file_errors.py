"""Errors of files: copied, exchanged, in other units, rounded, cut, filled, smoothed.

Sizes are from no change to:

- one record of an earlier session: joint off by 20 % (standard deviations), a sensor of 1 g more, a gain off by 5 %;
- real and imaginary parts with fixed decimals, the last one 3e-4 of the largest value; levels in steps of 1 dB with
  phases in steps of 5 degrees; frequencies in steps of 6 Hz, for lines at least 8 Hz apart;
- time records cut 30 ms after the hit and filled with zeros; lines of one file from 60 % of the band on filled with the
  last value or with a tiny one; one value lost in every file, at the end or as early as at 30 % of the band;
- lines interpolated between every fifth one; a moving average over nine lines; twelve corrupted lines in one record;
- the files of one configuration as means with those of another one; lines from 40 to 60 % of the band on from another
  measurement with a gain of 6 %.

What has no size: a file copied over another one; one record in g, pounds, inches
or millimetres; displacements calculated with Hz for rad/s; one frequency axis in rad/s, or divided by 2 pi twice;
a file of magnitudes or of reciprocals; degrees read as radians in one file; exchanged columns; phases of
another configuration.

A wrong overhang is a right answer where the records are of another overhang than stated, whatever mixed them up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from blind.generator import Record, rig
from blind.generator.effects import Numbers, Where
from blind.generator.records import RATE, Estimate, Signal

from .kind import Change, Draw, Kind, filtered

UNITS = (9.80665, 4.44822, 25.4, 1000.0)
"""Accelerations in g, forces in pounds, displacements in inches or millimetres."""
TINY = 1e-12
"""Share of the largest value that a program writes in place of nothing."""
ORDERS = {"receptance": 0, "mobility": 1, "accelerance": 2}
Values = NDArray[np.complex128]


def in_file(d: Draw, change: Callable[[Values], Values]) -> Callable[[Estimate, Numbers, Where], Estimate]:
    """Return what changes the values as they stand in the files."""
    order = ORDERS[d.bench.form]

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        s = (2j * np.pi * e.frequency_hz + e.decay_rate) ** order
        return replace(e, receptance=change(e.receptance * s) / s)

    return analysis


def _only(d: Draw, analysis: Callable[[Estimate, Numbers, Where], Estimate]) -> Change:
    """Return the change of one record."""
    here = d.record()
    return Change(analysis=lambda e, p, where: analysis(e, p, where) if here(where) else e)


def pair(d: Draw) -> tuple[str, str]:
    first, second = d.rng.choice(d.names, 2, replace=False)
    return str(first), str(second)


def _copied_file(d: Draw) -> Change:
    source, target = pair(d)

    def files(records: list[Record]) -> list[Record]:
        kept = {(r.level, r.plane): r.estimate for r in records if r.configuration == source}
        return [replace(r, estimate=kept[r.level, r.plane]) if r.configuration == target else r for r in records]

    return Change(files=files)


def _earlier_session(d: Draw) -> Change:
    here, gain = d.record(), 1.0 + 0.05 * d.u * d.sign()
    names = ("joint.k_y", "joint.k_theta", "joint.c_y", "joint.c_theta")
    factors = np.exp(0.2 * d.u * d.rng.standard_normal(len(names)))

    def structure(p: Numbers, where: Where) -> None:
        if here(where):
            for name, factor in zip(names, factors, strict=True):
                p[name] *= float(factor)
            p["sensor.mass"] = p.get("sensor.mass", 0.0) + 1e-3 * d.u

    return Change(structure=structure, analysis=filtered(lambda f: gain, here))


def _fixed_decimals(d: Draw) -> Change:
    share = 10.0 ** (-7.0 + 3.5 * d.u)

    def rounded(values: Values) -> Values:
        # A program writes 0.00 for small values; the least step stands for them, because a logarithm needs something.
        step = share * float(np.abs(values).max())
        written = step * (np.round(values.real / step) + 1j * np.round(values.imag / step))
        return np.where(written == 0.0, step, written)

    return Change(analysis=in_file(d, rounded))


def _decibels(d: Draw) -> Change:
    level, angle = d.u + 1e-9, np.deg2rad(5.0 * d.u + 1e-9)

    def rounded(values: Values) -> Values:
        decibels = level * np.round(20.0 * np.log10(np.abs(values)) / level)
        phase = angle * np.round(np.angle(values) / angle)
        return np.asarray(10.0 ** (decibels / 20.0) * np.exp(1j * phase))

    return Change(analysis=in_file(d, rounded))


def _rounded_frequencies(d: Draw) -> Change:
    step = 6.0 * d.u + 1e-9

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        return replace(e, frequency_hz=step * np.round(e.frequency_hz / step))

    return Change(analysis=analysis)


def _other_unit(d: Draw) -> Change:
    factor = float(d.rng.choice(UNITS)) ** d.sign()
    return _only(d, filtered(lambda f: factor))


def _hertz_in_conversion(d: Draw) -> Change:
    # Accelerances divided by f squared: displacements (2 pi)^2 times as large.
    return Change(analysis=filtered(lambda f: (2.0 * np.pi) ** 2))


def _other_axis(d: Draw) -> Change:
    factor = (2.0 * np.pi) ** d.sign()

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        return replace(e, frequency_hz=e.frequency_hz * factor)

    return _only(d, analysis)


def _magnitudes(d: Draw) -> Change:
    return _only(d, in_file(d, lambda values: np.abs(values).astype(np.complex128)))


def _reciprocal(d: Draw) -> Change:
    return _only(d, in_file(d, lambda values: 1.0 / values))


def _degrees_as_radians(d: Draw) -> Change:
    return _only(d, in_file(d, lambda values: np.abs(values) * np.exp(1j * np.rad2deg(np.angle(values)))))


def _exchanged_columns(d: Draw) -> Change:
    return Change(analysis=in_file(d, lambda values: 1j * values.conj()))


def _cut_time_records(d: Draw) -> Change:
    # As long as any record, where nothing is cut.
    end = rig.HIT + 0.03 / max(d.u, 1e-3)

    def hits(
        rng: np.random.Generator, number: int, force: Signal, response: Signal, where: Where
    ) -> tuple[Signal, Signal]:
        kept = np.arange(force.size) < end * RATE
        return force * kept, response * kept

    return Change(hits=hits)


def _filled_lines(d: Draw) -> Change:
    tiny = d.rng.random() < 0.5

    def filled(values: Values) -> Values:
        last = round((1.0 - 0.4 * d.u) * (values.size - 1))
        fill = TINY * np.abs(values).max() if tiny else values[last]
        return np.concatenate([values[: last + 1], np.full(values.size - last - 1, fill)])

    return _only(d, in_file(d, filled))


def _lost_line(d: Draw) -> Change:
    def shortened(values: Values) -> Values:
        lost = round((1.0 - 0.7 * d.u) * (values.size - 1))
        return np.append(np.delete(values, lost), values[-1])

    return Change(analysis=in_file(d, shortened))


def _interpolated(d: Draw) -> Change:
    step = 1 + round(4.0 * d.u)

    def between(values: Values) -> Values:
        every = np.arange(values.size)
        kept = np.unique([*every[::step], every[-1]])
        return np.asarray(np.interp(every, kept, values[kept]))

    return Change(analysis=in_file(d, between))


def _smoothed(d: Draw) -> Change:
    reach = round(4.0 * d.u)

    def average(values: Values) -> Values:
        padded = np.pad(values, reach, mode="edge")
        return np.asarray(np.convolve(padded, np.full(2 * reach + 1, 1.0 / (2 * reach + 1)), mode="valid"))

    return Change(analysis=in_file(d, average))


def _corrupted_lines(d: Draw) -> Change:
    places, factors = d.rng.random(12), d.rng.choice([-1.0, 0.1, 3.0, 10.0], 12)

    def corrupted(values: Values) -> Values:
        changed = values.copy()
        for place, factor in list(zip(places, factors, strict=True))[: round(12.0 * d.u)]:
            changed[int(place * values.size)] *= factor
        return changed

    return _only(d, in_file(d, corrupted))


def _with_another(d: Draw, combine: Callable[[Values, Values], Values]) -> Change:
    """Combine the values of one configuration with those of another one on the same lines."""
    target, source = pair(d)

    def files(records: list[Record]) -> list[Record]:
        others = {(r.level, r.plane): r.estimate for r in records if r.configuration == source}

        def changed(r: Record) -> Record:
            e, other = r.estimate, others[r.level, r.plane]
            values = np.interp(e.frequency_hz, other.frequency_hz, other.receptance)
            return replace(r, estimate=replace(e, receptance=combine(e.receptance, values)))

        return [changed(r) if r.configuration == target else r for r in records]

    return Change(files=files)


def _averaged_files(d: Draw) -> Change:
    share = 0.5 * d.u
    return _with_another(d, lambda values, others: values + share * (others - values))


def _phases_of_another(d: Draw) -> Change:
    return _with_another(d, lambda values, others: np.abs(values) * np.exp(1j * np.angle(others)))


def _joined_bands(d: Draw) -> Change:
    share, gain = d.within(0.4, 0.6), 1.0 + 0.06 * d.u * d.sign()

    def step(f: NDArray[np.float64]) -> Values:
        return np.where(f > f[0] + share * (f[-1] - f[0]), gain, 1.0).astype(np.complex128)

    return Change(analysis=filtered(step))


FILE_ERRORS = (
    Kind("copied_file", "file", "The files of one configuration were copied over those of another one.", _copied_file,
         right=("overhang_error",), sized=False),
    Kind("earlier_session", "file", "One record is of an earlier session.", _earlier_session),
    Kind("fixed_decimals", "file", "The files have few decimals.", _fixed_decimals),
    Kind("decibels", "file", "The files have rounded levels in decibels and rounded phases.", _decibels),
    Kind("rounded_frequencies", "file", "The frequencies in the files are rounded.", _rounded_frequencies),
    Kind("other_unit", "file", "One file is in other units.", _other_unit, right=("calibration_gain",), sized=False),
    Kind("hertz_in_conversion", "file", "Displacements were calculated with Hz in place of rad/s.",
         _hertz_in_conversion, right=("calibration_gain",), sized=False),
    Kind("other_axis", "file", "One file has its frequencies in rad/s, or divides Hz by 2 pi.", _other_axis,
         sized=False),
    Kind("magnitudes", "file", "One file has magnitudes without phases.", _magnitudes, sized=False),
    Kind("reciprocal", "file", "One file holds the reciprocal, as of a dynamic stiffness.", _reciprocal, sized=False),
    Kind("degrees_as_radians", "file", "The phases of one file are in degrees and read as radians.",
         _degrees_as_radians, sized=False),
    Kind("exchanged_columns", "file", "Real and imaginary parts are exchanged.", _exchanged_columns, sized=False),
    Kind("cut_time_records", "file", "The time records were cut and filled with zeros.", _cut_time_records,
         right=("coarse_resolution",)),
    Kind("filled_lines", "file", "The upper lines of one file are filled.", _filled_lines),
    Kind("lost_line", "file", "A program lost one value of every file, and later ones stand one line too low.",
         _lost_line),
    Kind("interpolated", "file", "The lines of the files are interpolated.", _interpolated),
    Kind("smoothed", "file", "The files are moving averages.", _smoothed),
    Kind("corrupted_lines", "file", "Some lines of one file are corrupted.", _corrupted_lines),
    Kind("averaged_files", "file", "The files of one configuration are means with those of another one.",
         _averaged_files),
    Kind("joined_bands", "file", "The upper lines are of another measurement, which has another gain.", _joined_bands),
    Kind("phases_of_another", "file", "The phases of one configuration are those of another one.", _phases_of_another,
         sized=False),
)  # fmt: skip
