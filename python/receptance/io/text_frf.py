"""FRFs in three columns of text: CutPro's `.frf` and the ASCII export of Data Physics' SignalCalc.

Both hold frequency in Hz, real and imaginary part. A `.frf` file is a receptance in m/N without a header, with free
text behind the first row; an export has nine header lines with channels and units.
"""

from __future__ import annotations

import re
from dataclasses import replace

from receptance.frf import FRF
from receptance.io.build import ReadOptions
from receptance.io.column_names import TableColumn, is_unit
from receptance.io.description import arrays_of
from receptance.io.errors import FileFormatError
from receptance.io.measurements import Measurement
from receptance.io.tables import NumberTable, measurements_in
from receptance.io.text import decode, numbered_lines, parse_lines, truncation_notes

_COLUMNS = (
    TableColumn("frequency", "Hz", "frequency"),
    TableColumn("real part", None, "real"),
    TableColumn("imaginary part", None, "imaginary"),
)
_CUTPRO_ROWS = re.compile(r"(?P<label>.*?) ?\[(?P<rows>[0-9]{1,9}) rows\]\s*")
"""Label with the number of rows, as written by this library."""
_EXPORT_CHANNELS = "Ref Chan:Resp Chan"
_EXPORT_COLUMNS = ("Frequency", "Real", "Imaginary")
_EXPORT_HEADER = 9
_EXPORT_ROWS = re.compile(r"Channel Comment\t(?P<rows>[0-9]{1,9}) rows : ")
"""Comment with the number of rows, as written by this library."""
_EXPORT_UNITS = re.compile(r"\((?P<response>[^()]+)\)\((?P<reference>[^()]+)\)")


def cutpro_bytes(frf: FRF) -> tuple[bytes, list[str]]:
    """Return the contents of a `.frf` file, and the fields that it does not store."""
    lost = _lost(frf, "labels")
    if frf.unit.split("/")[0] != "m" or not frf.unit.endswith("/N"):
        raise ValueError(f"a .frf file holds displacement per force, this FRF is in {frf.unit}")
    if frf.form != "receptance":
        lost.append(f"the {frf.form} itself: it is written as a receptance")
    rows = _rows(frf.to("receptance"))
    # Free text behind the first row is part of the format; the number of rows reveals a truncated file.
    rows[0] += "\t" + f"{' '.join(frf.label.split())} [{len(rows)} rows]".lstrip()
    return ("\n".join(rows) + "\n").encode(), lost


def read_cutpro(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the FRF in a `.frf` file: three columns separated by blanks or tabs, and text behind the first row."""
    text, lines = numbered_lines(data)
    if not lines:
        raise FileFormatError("there are no rows, expected frequency, real and imaginary part")
    line, first = lines[0]
    *_, label = [*first.split(None, 3), "", "", "", ""][:4]
    rows = [(line, " ".join(first.split(None, 3)[:3])), *lines[1:]]
    declared = _CUTPRO_ROWS.fullmatch(label)
    label = declared["label"] if declared else label
    return measurements_in(_table(text, rows, lines, declared, unit="m/N", label=label.strip()), options)


def is_dataphysics(data: bytes) -> bool:
    """Return whether the first two lines are those of an export."""
    lines = data[:400].decode("latin-1").splitlines()
    return len(lines) > 1 and lines[0].startswith("Units:") and lines[1].startswith(_EXPORT_CHANNELS)


def dataphysics_bytes(frf: FRF) -> tuple[bytes, list[str]]:
    """Return the contents of an export, and the fields that it does not store."""
    lost = _lost(frf, "averages")
    (response,), (reference,) = frf.labels if frf.labels is not None else (("",), ("",))
    if ":" in reference or (response + reference) != "".join((response + reference).split()):
        lost.append("labels with blanks or colons")
        response, reference = "", ""
    motion, _, load = frf.unit.rpartition("/")
    header = [
        "Units: Ratio",
        f"{_EXPORT_CHANNELS}\t{reference}:{response}",
        f"Channel Name\t{' '.join(frf.label.split())} : ",
        f"Channel Comment\t{frf.frequency_hz.size} rows : ",
        "",
        "\t ".join(_EXPORT_COLUMNS),
        "",
        "Units:",
        f"Hz\t({motion.replace('^2', '²')})({load.strip('()')})\t ",
    ]
    return "\r\n".join([*header, *_rows(frf), ""]).encode("latin-1", "replace"), lost


def read_dataphysics(data: bytes, options: ReadOptions) -> list[Measurement]:
    """Return the FRF, in real and imaginary part, in an export; errors name the line."""
    if not is_dataphysics(data):
        # The contents are not quoted, because the file may be anything.
        raise FileFormatError(
            f"the first two lines are not those of an export, 'Units:' and {_EXPORT_CHANNELS!r}", line=1
        )
    text = decode(data)
    lines = re.split(r"\r\n|\n|\r", text)
    if len(lines) < _EXPORT_HEADER + 1:
        raise FileFormatError(
            f"the file has {len(lines)} lines, expected {_EXPORT_HEADER} of a header and the data", line=len(lines)
        )
    kind = lines[0].removeprefix("Units:").strip()
    if kind != "Ratio":
        raise FileFormatError(f"the units are {kind!r}; only a ratio of two channels, an FRF, is read", line=1)
    reference, _, response = lines[1].removeprefix(_EXPORT_CHANNELS).strip().partition(":")
    columns = tuple(name.strip() for name in lines[5].split("\t"))
    if columns != _EXPORT_COLUMNS:
        raise FileFormatError(f"the columns are {', '.join(columns)}, expected {', '.join(_EXPORT_COLUMNS)}", line=6)
    units = [field.strip() for field in lines[8].split("\t")]
    if units[0] != "Hz":
        raise FileFormatError(f"the frequency is in {units[0]!r}, expected Hz", line=9)
    match = _EXPORT_UNITS.fullmatch(units[1]) if len(units) > 1 else None
    unit = f"({match['response']})/({match['reference']})" if match else None
    if unit is not None and options.unit is not None and not is_unit(unit):
        unit = None
    rows = [(line, row) for line, row in enumerate(lines[_EXPORT_HEADER:], _EXPORT_HEADER + 1) if row.strip()]
    if not rows:
        raise FileFormatError("there are no rows of numbers behind the header", line=_EXPORT_HEADER)
    label = lines[2].removeprefix("Channel Name").strip().rstrip(":").strip()
    table = _table(text, rows, rows, _EXPORT_ROWS.fullmatch(lines[3]), unit=unit, label=label, header=9)
    (frf,) = measurements_in(table, options)
    if isinstance(frf, FRF) and (response.strip() or reference.strip()):
        frf = frf.with_(labels=((response.strip(),), (reference.strip(),)))
    return [frf]


def _lost(frf: FRF, further: str) -> list[str]:
    """Return the fields that are not stored; raise for several responses or excitations."""
    if frf.shape[1:] != (1, 1):
        raise ValueError(
            f"this format holds one response and one excitation, this FRF has {frf.shape[1]} and {frf.shape[2]}; "
            "select one"
        )
    lost = [name for name in arrays_of(frf) if name not in ("frequency_hz", "values")]
    lost += [further] if getattr(frf, further) is not None else []
    return lost + (["decay_rate (the values belong to complex lines)"] if frf.decay_rate else [])


def _rows(frf: FRF) -> list[str]:
    return [
        f"{line!r}\t{value.real!r}\t{value.imag!r}"
        for line, value in zip(frf.frequency_hz.tolist(), frf.values[:, 0, 0].tolist(), strict=True)
    ]


def _table(
    text: str,
    rows: list[tuple[int, str]],
    lines: list[tuple[int, str]],
    declared: re.Match[str] | None,
    *,
    unit: str | None,
    label: str,
    header: int = 0,
) -> NumberTable:
    """Return the columns, with a note on a text that may be truncated; a declared number of rows is checked."""
    values = parse_lines(rows, lambda _, row: row.split(), [f"the {column.name}" for column in _COLUMNS])
    return NumberTable(
        columns=tuple(column if column.unit else replace(column, unit=unit) for column in _COLUMNS),
        values=values,
        header=header,
        lines=tuple(line for line, _ in rows),
        about=None,
        notes=tuple(truncation_notes(text, lines, int(declared["rows"]) if declared else None)),
        label=label,
    )
