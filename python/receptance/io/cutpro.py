"""CutPro-style `.frf`: frequency in Hz, real and imaginary part of the receptance in m/N, without a header."""

from __future__ import annotations

import re

from receptance.frf import FRF
from receptance.io.build import in_si, joined, make_frf
from receptance.io.errors import FileFormatError
from receptance.io.options import ReadOptions, resolve_frf
from receptance.io.text import check_ascending, check_count, decode, doubts_of_end, numbered_lines, rows_of_numbers
from receptance.units import parse_unit

__all__ = ["cutpro_bytes", "read_cutpro"]

_UNIT = "m/N"
_COUNT = re.compile(r"(?P<label>.*?) ?\[(?P<rows>[0-9]{1,9}) rows\]\s*")
_COLUMNS = ("frequency", "real part", "imaginary part")


def cutpro_bytes(frf: FRF) -> tuple[bytes, list[str]]:
    """Return the contents of a `.frf` file, and what it does not hold of the FRF."""
    if frf.shape[1:] != (1, 1):
        raise ValueError(
            f"a .frf file holds one response and one excitation, this FRF has {frf.shape[1]} and {frf.shape[2]}; "
            "select one"
        )
    if frf.unit.split("/")[0] != "m" or not frf.unit.endswith("/N"):
        raise ValueError(f"a .frf file holds displacement per force, this FRF is in {frf.unit}")
    lost = [name for name in ("coherence", "log_variance", "usable", "labels") if getattr(frf, name) is not None]
    if frf.decay_rate:
        lost.append("decay_rate (the values belong to complex lines)")
    if frf.form != "receptance":
        lost.append(f"the {frf.form} itself: it is written as a receptance")
    frf = frf.to("receptance")
    rows = [
        f"{line!r}\t{value.real!r}\t{value.imag!r}"
        for line, value in zip(frf.frequency_hz.tolist(), frf.values[:, 0, 0].tolist(), strict=True)
    ]
    # Words behind the first row belong to the format; the number of rows shows whether the file is whole.
    rows[0] += "\t" + f"{' '.join(frf.label.split())} [{len(rows)} rows]".lstrip()
    return ("\n".join(rows) + "\n").encode(), lost


def read_cutpro(data: bytes, options: ReadOptions) -> list[FRF]:
    """Return the FRF in a `.frf` file: three columns, blanks or tabs between them, words behind the first row.

    Raises
    ------
    FileFormatError
        A row that is not three numbers, or frequencies that do not ascend; the message names the line.
    """
    whole = decode(data)
    lines = numbered_lines(whole)
    if not lines:
        raise FileFormatError("there are no rows, expected frequency, real and imaginary part")
    line, first = lines[0]
    *_, label = [*first.split(None, 3), "", "", "", ""][:4]
    table = rows_of_numbers([(line, " ".join(first.split(None, 3)[:3])), *lines[1:]], _COLUMNS)
    check_ascending(table[:, 0].tolist(), [line for line, _ in lines])
    count = _COUNT.fullmatch(label)
    notes: list[str] = []
    if count:
        label = count["label"]
        check_count(whole, len(lines), int(count["rows"]), lines[-1][0])
    else:
        notes = doubts_of_end(whole, lines)
    resolved = resolve_frf(options, declared=parse_unit(_UNIT), form=None, directions=None)
    return [
        make_frf(
            frequency_hz=table[:, 0],
            values=in_si(joined(table[:, 1], table[:, 2]), resolved.factor),
            form=resolved.kind.form,
            directions=([resolved.kind.response], [resolved.kind.excitation]),
            label=label.strip(),
            notes=[*notes, *resolved.notes],
            options=options,
        )
    ]
