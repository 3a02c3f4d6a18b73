"""Universal files with data sets 164 (units) and 58 or 58b (functions), by the standard.

pyuff 2.5.8 is not used for writing, because it writes abscissae with six digits, declares the wrong number of binary
bytes for complex data, writes double-precision abscissae where the standard has single precision, silently replaces NaN
by zero and shifts columns behind long names. The tests use it as a second reader.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.frf import FRF
from receptance.io.description import QUALITY, arrays_of, coordinate_to_list
from receptance.io.measurements import Coherence, Measurement, TimeSeries
from receptance.io.uff.datasets import LOADS, MARK, MOTIONS, QUANTITIES, SEPARATE, Axis, Function, Point
from receptance.model.coordinates import Coordinate, UnknownPosition
from receptance.units import ROTATIONS

_POINT = re.compile(r"(?:(?P<name>\S(?:.{0,8}\S)?) )?(?P<node>[0-9]{1,10})(?::(?P<direction>[+-][1-6]))?")
_WIDTH = 80
"""Columns of an ID line."""
_MOTION_CODES = {form: code for code, form in MOTIONS.items()}
_CODES = {name: code for code, name in QUANTITIES.items() if code != LOADS[0]}
_ROTATION_CODES = {ROTATIONS[name]: code for name, code in _CODES.items()}
"""Specific data types of quantities at points of translation and of rotation."""
_EXACT_TOLERANCE = 1e-9
"""Largest relative error of an abscissa that is not reported."""


def uff_bytes(measurements: Sequence[Measurement], *, binary: bool) -> tuple[bytes, list[str]]:
    """Return the contents of a universal file, and the fields that it does not store.

    ASCII files hold 13 digits of the ordinate, binary files all digits. Evenly spaced abscissae have the digits of 13
    columns (nine or more), uneven ones eight digits in ASCII and single precision in binary.
    """
    lost: list[str] = []
    parts = [_units()]
    for measurement in measurements:
        if isinstance(measurement, TimeSeries):
            functions = _channels(measurement, lost)
        else:
            functions = _entries(measurement, lost)
        parts += [_data_set(function, binary, lost) for function in functions]
    return b"".join(parts), list(dict.fromkeys(lost))


def _units() -> bytes:
    factors = "".join(f"{value:25.17E}".replace("E", "D") for value in (1.0, 1.0, 1.0))
    return f"    -1\n   164\n         1{'SI: metre, newton':<20}         2\n{factors}\n{0.0:25.17E}\n    -1\n".encode()


def _entries(measurement: FRF | Coherence, lost: list[str]) -> Iterator[Function]:
    """Yield the functions of all responses and excitations: each FRF, and behind it its coherence."""
    frf = measurement if isinstance(measurement, FRF) else None
    coherence = frf.coherence if frf is not None else measurement.values
    label = _short(measurement.label, _WIDTH, "the label", lost)
    labels = measurement.labels or (None, None)
    coordinates = (frf.responses, frf.excitations) if frf is not None else (None, None)
    counts = measurement.values.shape[1:]
    nodes: dict[object, int] = {}
    points = [_points(labels[k], coordinates[k], counts[k], nodes, lost) for k in (0, 1)]
    values_text = "" if frf is None else _values_text(frf, lost)
    frequency, empty = Axis(18, "Frequency", "Hz"), Axis(0, "", "")
    for row, column in np.ndindex(*counts):
        ends = points[0][row], points[1][column]
        if frf is not None:
            texts = (label, "", "", _coordinates_text(frf.responses[row], frf.excitations[column], lost), values_text)
            motion, _, load = frf.units[row][column].rpartition("/")
            numerator = Axis(_MOTION_CODES[frf.form], frf.form.capitalize(), motion)
            axes = (frequency, numerator, Axis(13, "", load.strip("()")))
            yield Function(4, *ends, frf.frequency_hz, frf.values[:, row, column], axes, texts)
        if coherence is not None:
            axes = (frequency, Axis(0, "Coherence", "1"), empty)
            lines = measurement.frequency_hz
            separate = "" if frf is not None else _values_line({SEPARATE: 1})
            yield Function(6, *ends, lines, coherence[:, row, column], axes, (label, "", "", "", separate))


def _values_text(frf: FRF, lost: list[str]) -> str:
    """Return ID line 5 of an FRF."""
    lost += [name for name in QUALITY if name in arrays_of(frf)]
    lost += ["notes"] if frf.notes else []
    values = {
        "averages": frf.averages,
        "decay_rate": frf.decay_rate or None,
        "labels": 0 if frf.labels is None else None,
        "lines": _exact_lines(frf.frequency_hz),
    }
    return _values_line({name: value for name, value in values.items() if value is not None})


def _values_line(values: Mapping[str, Any]) -> str:
    """Return ID line 5, empty without values; the exact frequency lines are left out if the line is too long."""
    line = MARK + json.dumps(dict(values), separators=(",", ":"), sort_keys=True) if values else ""
    return line if len(line) <= _WIDTH else _values_line({k: v for k, v in values.items() if k != "lines"})


def _coordinates_text(response: Coordinate, excitation: Coordinate, lost: list[str]) -> str:
    """Return ID line 4 of an FRF; empty without positions."""
    if isinstance(response, UnknownPosition) and isinstance(excitation, UnknownPosition):
        return ""
    line = MARK + " ".join(json.dumps(coordinate_to_list(c), separators=(",", ":")) for c in (response, excitation))
    if len(line) > _WIDTH:
        lost.append("coordinates with long names of parts")
        return ""
    return line


def _channels(series: TimeSeries, lost: list[str]) -> Iterator[Function]:
    """Yield the functions of the channels of a time series."""
    if series.notes:
        lost.append("notes")
    label = _short(series.label, _WIDTH, "the label", lost)
    texts = (label, "", "", "", _values_line({"sample_rate_hz": series.sample_rate_hz}))
    for column, name in enumerate(series.channels):
        # The name is the label of a point, else that of the axis.
        point = _point_of_label(name)
        title = _short(name, 20, "a channel's name", lost) if point is None else ""
        point = point or Point("", 0, 0)
        code = (_ROTATION_CODES if abs(point.direction) > 3 else _CODES).get(series.quantities[column], 0)
        unit = _short(series.units[column], 20, "a unit", lost)
        axes = (Axis(17, "Time", "s"), Axis(code, title, unit), Axis(0, "", ""))
        yield Function(1, point, Point("", 0, 0), series.time_s, series.values[:, column], axes, texts)


def _points(
    labels: Sequence[str] | None,
    coordinates: Sequence[Coordinate] | None,
    count: int,
    nodes: dict[object, int],
    lost: list[str],
) -> list[Point]:
    """Return a unique point for each response or excitation; equal positions have equal nodes on both sides."""
    points: list[Point] = []
    for index in range(count):
        coordinate = coordinates[index] if coordinates is not None else UnknownPosition()
        rotation = coordinate.direction == "theta"
        point = _point_of_label(labels[index]) if labels is not None else None
        if point is None or point in points or (point.direction and rotation != (abs(point.direction) > 3)):
            if labels is not None:
                lost.append("labels that are not like '22:+3' or at most 10 characters")
            is_known = not isinstance(coordinate, UnknownPosition)
            key: object = (coordinate.part, coordinate.position) if is_known else object()
            point = Point("", nodes.setdefault(key, len(nodes) + 1), 6 if rotation else 2)
            if point in points:
                point = Point("", nodes.setdefault(object(), len(nodes) + 1), point.direction)
        points.append(point)
    return points


def _point_of_label(label: str) -> Point | None:
    """Return the point with this label, or None."""
    match = _POINT.fullmatch(label)
    if match:
        point = Point(match["name"] or "", int(match["node"]), int(match["direction"] or 0))
        if point.label == label and point.name != "NONE":
            return point
    if len(label) <= 10 and label == label.strip() and label.isprintable() and label != "NONE":
        return Point(label, 0, 0)
    return None


def _short(text: str, width: int, name: str, lost: list[str]) -> str:
    short = "".join(c if c.isprintable() else " " for c in text)[:width].strip()
    if short != text or text == "NONE":
        lost.append(f"{name} of more than {width} characters")
    return short


def _data_set(function: Function, binary: bool, lost: list[str]) -> bytes:
    even, first, step = _spacing(function, binary, lost)
    n, is_complex = function.ordinate.size, np.iscomplexobj(function.ordinate)
    body = _binary_body(function, even) if binary else _text_body(function, even)
    identity = f"    58b{1:6d}{2:6d}{11:12d}{len(body):12d}{0:6d}{0:6d}{0:12d}{0:12d}" if binary else "    58"
    ends = function.response, function.reference
    points = "".join(f" {end.name or 'NONE':<10}{end.node:10d}{end.direction:4d}" for end in ends)
    lines = [
        f"{'    -1':<80}",
        f"{identity:<80}",
        *(f"{text or 'NONE':<80}" for text in function.texts),
        f"{function.kind:5d}{0:10d}{0:5d}{0:10d}{points}",
        f"{6 if is_complex else 4:10d}{n:10d}{int(even):10d}{first:>13}{step:>13}{'0.00000E+00':>13}",
        *(
            f"{axis.kind:10d}{0:5d}{0:5d}{0:5d} {axis.label or 'NONE':<20} {axis.unit or 'NONE':<20}"
            for axis in (*function.axes, Axis(0, "", ""))
        ),
    ]
    return "\n".join(lines).encode() + b"\n" + body + f"{'    -1':<80}\n".encode()


def _spacing(function: Function, binary: bool, lost: list[str]) -> tuple[bool, str, str]:
    """Return whether the abscissa is written as evenly spaced, its first value and its increment."""
    lines = function.abscissa
    n, scale = lines.size, float(np.max(np.abs(lines)))
    best: tuple[float, str, str] = (np.inf, "", "")
    for step in (float(lines[-1] - lines[0]) / max(n - 1, 1), float(lines[1] - lines[0]) if n > 1 else 0.0):
        first, increment = _in_13(float(lines[0])), _in_13(step)
        error = float(np.max(np.abs(float(first) + float(increment) * np.arange(n) - lines)))
        if error < best[0] and (n == 1 or float(increment) > 0.0):
            best = (error, first, increment)
    if function.kind == 1 or best[0] <= _EXACT_TOLERANCE * scale:
        # Time series are even; ID line 5 holds their sample rate with all digits.
        return True, *best[1:]
    rounded = lines.astype(np.float32) if binary else np.array([float(_in_13(x)) for x in lines.tolist()])
    uneven = float(np.max(np.abs(rounded - lines)))
    if min(best[0], uneven) > _EXACT_TOLERANCE * scale:
        lost.append(f"frequency lines more exactly than {min(best[0], uneven):.1g} Hz")
    if best[0] <= uneven:
        return True, *best[1:]
    same = np.flatnonzero(np.diff(rounded) <= 0.0)
    if same.size:
        first_hz, second_hz = lines[same[0] : same[0] + 2].tolist()
        raise ValueError(
            f"a universal file cannot distinguish the lines {first_hz!r} and {second_hz!r} Hz: it has "
            f"{'single precision' if binary else '13 columns'} for each; write .npz, .mat, .h5 or .csv"
        )
    return False, "0.00000E+00", "0.00000E+00"


def _exact_lines(lines: NDArray[np.float64]) -> list[float] | None:
    """Return first line and increment of even lines that 13 columns do not hold exactly, else None."""
    n = lines.size
    if n < 2:
        return None
    first, step = float(lines[0]), float(lines[-1] - lines[0]) / (n - 1)
    error = np.max(np.abs(first + step * np.arange(n) - lines))
    if error > 4.0 * np.spacing(lines[-1]) or (float(_in_13(first)), float(_in_13(step))) == (first, step):
        return None
    return [first, step]


def _in_13(number: float) -> str:
    """Return a number in at most 13 columns as exactly as possible, with the decimal point of Fortran."""
    digits = len(str(int(abs(number)))) + (number < 0)
    texts = [repr(number), f"{number:.7E}", f"{number:.6E}", f"{number:.5E}", f"{number:.{max(12 - digits, 1)}f}"]
    fitting = [text for text in texts if len(text) <= 13 and "." in text]
    return min(fitting, key=lambda text: abs(float(text) - number))


def _binary_body(function: Function, even: bool) -> bytes:
    parts = ["re", "im"] if np.iscomplexobj(function.ordinate) else ["re"]
    # By the standard the abscissa always has single precision.
    fields = ([] if even else [("x", "<f4")]) + [(part, "<f8") for part in parts]
    table = np.zeros(function.ordinate.size, dtype=fields)
    if not even:
        table["x"] = function.abscissa
    table["re"] = function.ordinate.real
    if len(parts) == 2:
        table["im"] = function.ordinate.imag
    return table.tobytes()


def _text_body(function: Function, even: bool) -> bytes:
    numbers = (
        [function.ordinate.real, function.ordinate.imag] if np.iscomplexobj(function.ordinate) else [function.ordinate]
    )
    values = np.stack(numbers, axis=1)
    if even:
        flat = [f"{value:20.12E}" for value in values.ravel().tolist()]
        rows = ["".join(flat[k : k + 4]) for k in range(0, len(flat), 4)]
    else:
        points = [
            f"{_in_13(x):>13}" + "".join(f"{value:20.12E}" for value in row)
            for x, row in zip(function.abscissa.tolist(), values.tolist(), strict=True)
        ]
        per_line = 1 if len(numbers) == 2 else 2
        rows = ["".join(points[k : k + per_line]) for k in range(0, len(points), per_line)]
    return ("\n".join(rows) + "\n").encode()
