"""Time records and spectra in LabVIEW measurement files (.lvm), one or several segments of channels.

A file has a header of keys and values, then for each segment its own header, a line with the names of the channels and
rows of numbers. The first column, or one for each channel, has times (or frequencies), or is empty where the header
states the first one and the step. https://www.ni.com/docs/bundle/labview/page/labview-measurement-files.html
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.errors import warn_user
from receptance.io.build import ReadOptions
from receptance.io.column_names import LONGEST_NAME, TableColumn, is_unit, named_column
from receptance.io.errors import FileFormatError, check_time
from receptance.io.measurements import Measurement
from receptance.io.tables import NumberTable, measurements_in
from receptance.io.text import excerpt, number, numbered_lines, parse_lines, truncation_notes

_FIRST_LINE = "LabVIEW Measurement"
_END_OF_HEADER = "***End_of_Header***"
_SPECIAL = ("***Start_Special***", "***End_Special***")
"""Marks around lines of other programs."""
_SEPARATORS = {"Tab": "\t", "Comma": ","}
_AXES = {"Time": "time", "Frequency": "frequency"}
"""Axes by the dimension of the first column."""
_UNITS = {"time": "s", "frequency": "Hz"}
_DIGITS = 1e-4
"""Relative error of a written time step above which the sample rate is in doubt,"""
_WHOLE = 1e-6
"""unless it is a whole number of samples per second."""
_NO_SAMPLES = ("0", "")
_MAX_DIGITS = 6
"""Most digits of the number of channels."""

_Line = tuple[int, str]


@dataclass(frozen=True)
class _Header:
    """Keys of the file or of a segment, with the cells behind them and their line."""

    cells: dict[str, tuple[int, list[str]]]
    end: int
    """Line number of the end mark."""

    def text(self, key: str, default: str) -> str:
        """Return the first cell of a key."""
        _, cells = self.cells.get(key, (0, [default]))
        return next((cell for cell in cells if cell.strip()), default).strip()


def is_lvm(data: bytes) -> bool:
    """Return whether a file begins like a LabVIEW measurement file."""
    return data.removeprefix(b"\xef\xbb\xbf").startswith(_FIRST_LINE.encode())


def read_lvm(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the measurements of all segments; errors name the line."""
    content, lines = numbered_lines(data)
    lines = _without_special(lines)
    if not lines or not lines[0][1].startswith(_FIRST_LINE):
        raise FileFormatError(f"the first line is not {_FIRST_LINE!r}", line=1)
    separator = _separator(lines)
    file, rest = _header(lines[1:], separator)
    segments = []
    while rest:
        header, below = _header(rest, separator)
        if not below:
            raise FileFormatError("there are no names of channels below this header", line=header.end)
        # Keys begin with a letter, rows with a number, a sign or an empty cell.
        count = next((index for index, (_, text) in enumerate(below[1:]) if text[:1].isalpha()), len(below) - 1)
        segments.append(_Segment(file, header, below[0], below[1 : 1 + count], separator))
        rest = below[1 + count :]
    if not segments:
        raise FileFormatError(f"there is no segment of channels behind this {_END_OF_HEADER}", line=file.end)
    measurements = []
    for index, segment in enumerate(segments, 1):
        label = f"record {index} of {len(segments)}" if len(segments) > 1 else ""
        notes = truncation_notes(content, segment.rows) if index == len(segments) else []
        measurements += measurements_in(replace(segment.table(notes, options), label=label), options)
    return measurements


def _without_special(lines: Sequence[_Line]) -> list[_Line]:
    """Return the lines outside of blocks of other programs."""
    kept, inside = [], False
    for line, text in lines:
        start, end = (text.startswith(mark) for mark in _SPECIAL)
        if not (inside or start or end):
            kept.append((line, text))
        inside = start or (inside and not end)
    return kept


def _separator(lines: Sequence[_Line]) -> str:
    """Return the separator of cells, a tab if the header states none."""
    for line, text in lines:
        if text.startswith(_END_OF_HEADER):
            break
        if text.startswith("Separator"):
            name = text.removeprefix("Separator").strip("\t, ")
            if name not in _SEPARATORS:
                raise FileFormatError(f"the separator is {name!r}, expected {' or '.join(_SEPARATORS)}", line=line)
            return _SEPARATORS[name]
    return "\t"


def _header(lines: Sequence[_Line], separator: str) -> tuple[_Header, Sequence[_Line]]:
    """Return the keys up to the end of a header, and the lines below it."""
    cells: dict[str, tuple[int, list[str]]] = {}
    for index, (line, text) in enumerate(lines):
        check_time()
        key, *values = text.split(separator)
        if key.startswith(_END_OF_HEADER):
            return _Header(cells, line), lines[index + 1 :]
        cells[key.strip()] = line, values
    raise FileFormatError(
        f"the file ends within a header, expected its last line {_END_OF_HEADER}",
        line=lines[-1][0] if lines else None,
    )


@dataclass(frozen=True)
class _Segment:
    """Channels of one acquisition: header, line with the names of the channels, and rows of numbers."""

    file: _Header
    header: _Header
    names: _Line
    rows: Sequence[_Line]
    separator: str

    def table(self, notes: Sequence[str], options: ReadOptions) -> NumberTable:
        """Return the channels that have samples as a table, with its first column or the stated step."""
        if not self.rows:
            raise FileFormatError("there are no rows of numbers below these names", line=self.names[0])
        stride = 2 if self.file.text("X_Columns", "No") == "Multi" else 1
        channels, dropped = self._channels(stride)
        end = self._count() * stride + (stride == 1)
        """Cells before the comment."""
        rows, comments = self._without_comments(end)
        offset = 1
        if self.file.text("X_Columns", "No") == "No":
            first = self.rows[0][1].split(self.separator)[0]
            offset = 0 if first.strip() else 1
            axes = []
        else:
            axes = [0] if stride == 1 else [stride * channel for channel in channels]
        wanted = [*axes, *(offset + stride * channel for channel in channels)]

        def split(line: int, text: str) -> list[str]:
            cells = text.split(self.separator)
            # Cells that belong to no channel are refused with the row.
            return [cells[index] for index in wanted if index < len(cells)] if len(cells) <= end + 1 else cells

        names = [self._cell(self.names[1].split(self.separator), 1 + stride * channel) for channel in channels]
        values = parse_lines(
            rows,
            split,
            ["the value of the axis"] * len(axes) + [f"channel {name!r}" for name in names],
            decimal_comma=self._decimal_comma(),
            quote_first_row=True,
        )
        self._check_count(len(rows), channels, stride)
        if axes and not np.array_equal(np.repeat(values[:, :1], len(axes), axis=1), values[:, : len(axes)]):
            raise FileFormatError("the channels have different times, expected the same for all", line=self.names[0])
        dimension = self.header.text("X_Dimension", "Time")
        if dimension not in _AXES:
            raise FileFormatError(
                f"the first column is {dimension!r}, expected {' or '.join(_AXES)}", line=self._line("X_Dimension")
            )
        role = _AXES[dimension]
        labels = [
            self._cell(self.header.cells.get("Y_Unit_Label", (0, []))[1], stride * channel) for channel in channels
        ]
        columns = [_column(name, label, role) for name, label in zip(names, labels, strict=True)]
        table = NumberTable(
            columns=tuple(columns),
            values=values[:, len(axes) :],
            header=self.names[0],
            lines=tuple(line for line, _ in rows),
            about=None,
            notes=(*notes, *dropped, *comments),
        )
        if axes:
            return _with_axis(table, role, values[:, 0])
        start, step, error = self._steps(channels, stride)
        if role == "frequency":
            return _with_axis(table, role, start + step * np.arange(len(rows), dtype=np.float64))
        if error > _DIGITS * step and options.sample_rate_hz is None and abs(1.0 / step - round(1.0 / step)) > _WHOLE:
            doubt = (
                f"the time step {step:g} s is written with few digits: the sample rate, {1.0 / step:.6g} Hz, may be "
                f"wrong by {100.0 * error / step:.1g} %; give it: sample_rate_hz= (on the command line --sample-rate)"
            )
            warn_user(doubt)
            table = replace(table, notes=(*table.notes, doubt))
        return replace(table, start_s=start, step_s=step, step_error_s=error)

    def _count(self) -> int:
        text = self.header.text("Channels", "")
        if not (text.isascii() and text.isdigit() and 0 < len(text) <= _MAX_DIGITS and int(text)):
            raise FileFormatError(
                f"the number of channels is {text!r}, expected a whole number from 1 on", line=self._line("Channels")
            )
        return int(text)

    def _line(self, key: str) -> int:
        return self.header.cells.get(key, (self.header.end, []))[0]

    @staticmethod
    def _cell(cells: Sequence[str], index: int) -> str:
        return cells[index].strip() if index < len(cells) else ""

    def _channels(self, stride: int) -> tuple[list[int], list[str]]:
        """Return the numbers of the channels that have samples, and a note on the others."""
        names = self.names[1].split(self.separator)
        if self._count() * stride >= len(names) + (stride == 2):
            raise FileFormatError(
                f"there are {len(names)} names, expected those of {self._count()} channels", line=self.names[0]
            )
        samples = self.header.cells.get("Samples", (0, []))[1]
        channels = [
            channel for channel in range(self._count()) if self._cell(samples, stride * channel) not in _NO_SAMPLES
        ]
        empty = [self._cell(names, 1 + stride * channel) for channel in range(self._count()) if channel not in channels]
        if not channels:
            raise FileFormatError("no channel has samples", line=self._line("Samples"))
        return channels, [f"channel {name!r} has no samples" for name in empty]

    def _check_count(self, rows: int, channels: Sequence[int], stride: int) -> None:
        """Raise if there are fewer rows than stated, or more in a segment of its own."""
        samples = self.header.cells.get("Samples", (0, []))[1]
        stated = {self._cell(samples, stride * channel) for channel in channels} - {""}
        if len(stated) > 1:
            raise FileFormatError(
                f"the channels have {' and '.join(sorted(stated))} samples, expected as many for all",
                line=self._line("Samples"),
            )
        several = self.file.text("Multi_Headings", "No") == "Yes"
        for text in stated:
            count = number(text, self._line("Samples"), "the number of samples", decimal_comma=True)
            if rows < count or (several and rows != count):
                raise FileFormatError(
                    f"the header states {count:g} samples and there are {rows} rows: the file was truncated or changed",
                    line=self.rows[-1][0],
                )

    def _without_comments(self, end: int) -> tuple[Sequence[_Line], list[str]]:
        """Return the rows without the comments behind `end` cells, and a note on those."""
        rows, comments = [], []
        for line, text in self.rows:
            cells = text.split(self.separator, end)
            comment = cells[end].strip(self.separator + " ") if len(cells) > end else ""
            if comment:
                comments.append((line, comment))
            rows.append((line, text if not comment else self.separator.join(cells[:end])))
        if not comments:
            return self.rows, []
        line, comment = comments[0]
        more = f" and {len(comments) - 1} more comments" if len(comments) > 1 else ""
        return rows, [f"line {line} has the comment {excerpt(comment)}{more}"]

    def _decimal_comma(self) -> bool:
        """Return whether decimals may have a comma; old files do not state the decimal sign."""
        return self.separator != "," and self.file.text("Decimal_Separator", ",") == ","

    def _steps(self, channels: Sequence[int], stride: int) -> tuple[float, float, float]:
        """Return first value and step of the axis, the same for all channels, and the error of the written step."""
        found = []
        for key, default in (("X0", "0"), ("Delta_X", "")):
            line, cells = self.header.cells.get(key, (self.header.end, []))
            texts = {self._cell(cells, stride * channel) or default for channel in channels}
            if len(texts) > 1:
                raise FileFormatError(
                    f"{key} is {' and '.join(sorted(texts))}, expected the same for all channels", line=line
                )
            found.append((texts.pop(), line, key))
        start, step = (number(text, line, key, decimal_comma=True) for text, line, key in found)
        if not (math.isfinite(start) and 0.0 < step < math.inf):
            raise FileFormatError(
                f"X0 is {start:g} and Delta_X {step:g}, expected finite numbers and a step above zero",
                line=self._line("Delta_X"),
            )
        written = Decimal(found[1][0].replace(",", ".").upper().replace("D", "E"))
        return start, step, 0.5 * float(Decimal(1).scaleb(int(written.as_tuple().exponent)))


def _column(name: str, label: str, role: str) -> TableColumn:
    """Return the meaning of a channel; LabVIEW capitalises names of units, as in `Newtons`."""
    if len(name) + len(label) > LONGEST_NAME:
        raise FileFormatError(
            f"a channel has a name and a unit of {len(name) + len(label)} characters, expected short ones"
        )
    unit = label.lower() if not is_unit(label) and is_unit(label.lower()) else label
    column = named_column(name, unit)
    return replace(column, role="channel") if role == "time" else column


def _with_axis(table: NumberTable, role: str, axis: NDArray[Any]) -> NumberTable:
    """Return a table with a first column of times or frequencies."""
    return replace(
        table,
        columns=(TableColumn("X_Value", _UNITS[role], role), *table.columns),
        values=np.column_stack([axis, table.values]),
    )
