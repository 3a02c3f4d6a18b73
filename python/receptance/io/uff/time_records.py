"""Time records of a universal file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from receptance.io.build import sampled
from receptance.io.errors import FileFormatError
from receptance.io.options import SI, ReadOptions, several_channels
from receptance.io.time_series import TimeSeries
from receptance.io.uff.header import remembered
from receptance.io.uff.sets import Function
from receptance.io.uff.units import channel_unit, expect_abscissa

__all__ = ["cycles", "time_series"]


def cycles(functions: Sequence[Function]) -> list[list[Function]]:
    """Group time records that were sampled together; where all channels come again, that is the next record."""
    groups: list[list[Function]] = []
    for function in functions:
        if groups and np.array_equal(function.abscissa, groups[-1][0].abscissa):
            groups[-1].append(function)
        else:
            groups.append([function])
    found: list[list[Function]] = []
    for group in groups:
        names = [function.response.label for function in group]
        period = _period(names)
        if len(names) % period or not all(names):
            period = len(names)
        found.extend(group[k : k + period] for k in range(0, len(group), period))
    return found


def _period(names: Sequence[str]) -> int:
    """Return after how many names the same ones begin again, in a time proportional to their number."""
    # Of each beginning of the list: the length of the longest shorter beginning that it also ends with.
    borders = [0] * len(names)
    length = 0
    for index in range(1, len(names)):
        while length and names[index] != names[length]:
            length = borders[length - 1]
        length += names[index] == names[length]
        borders[index] = length
    return len(names) - borders[-1]


def time_series(functions: Sequence[Function], notes: Sequence[str], options: ReadOptions) -> TimeSeries:
    """Return channels that were sampled together."""
    names = _names(functions)
    if isinstance(options.unit, str) and options.unit != SI and len(names) > 1:
        raise functions[0].line.error(several_channels(names, options.unit))
    units: list[tuple[str, float]] = []
    told = list(notes)
    for function, name in zip(functions, names, strict=True):
        try:
            expect_abscissa(function, 17)
            unit, factor, note = channel_unit(function, name, options)
        except FileFormatError as error:
            raise function.line.error(error.problem) from None
        units.append((unit, factor))
        told.extend(f"{name}: {text}" for text in (*function.notes, note) if text)
        if np.iscomplexobj(function.ordinate):
            raise function.line.error(f"the time record {name!r} is complex, expected real numbers")
    first = functions[0]
    exact: float | None = remembered(first.texts).values.get("sample_rate_hz")
    try:
        # One sample has no step of its own.
        step = 1.0 / exact if exact is not None and first.abscissa.size == 1 else first.step
        rate, start = sampled(first.abscissa, options, step=step)
        if exact is not None and options.sample_rate_hz is None and abs(exact / rate - 1.0) < 1e-5:
            rate = exact
        return TimeSeries(
            values=np.stack([f.ordinate * factor for f, (_, factor) in zip(functions, units, strict=True)], axis=1),
            channels=names,
            units=[unit for unit, _ in units],
            sample_rate_hz=rate,
            start_s=start,
            label=first.texts[0],
            notes=told,
        )
    except ValueError as error:
        problem = error.problem if isinstance(error, FileFormatError) else str(error)
        raise first.line.error(problem) from None


def _names(functions: Sequence[Function]) -> list[str]:
    """Return names that differ: of the point, else the axis label, else a number."""
    names: dict[str, None] = {}
    counts: dict[str, int] = {}
    for number, function in enumerate(functions, 1):
        name = function.response.label or function.axes[1].label or f"channel {number}"
        repeated, unique = counts.get(name, 1), name
        while unique in names:
            repeated += 1
            unique = f"{name} ({repeated})"
        counts[name] = repeated
        names[unique] = None
    return list(names)
