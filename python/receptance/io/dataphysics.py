"""FRFs as SignalCalc of Data Physics exports them in ASCII: nine header lines, then frequency, real, imaginary part."""

from __future__ import annotations

import re

from receptance.frf import FRF
from receptance.io.build import in_si, joined, make_frf
from receptance.io.errors import FileFormatError
from receptance.io.options import ReadOptions, resolve_frf
from receptance.io.text import check_ascending, check_count, decode, doubts_of_end, rows_of_numbers
from receptance.units import UnitError, parse_unit

__all__ = ["dataphysics_bytes", "looks_like_dataphysics", "read_dataphysics"]

_CHANNELS = "Ref Chan:Resp Chan"
_COLUMNS = ("Frequency", "Real", "Imaginary")
_HEADER = 9
_COUNT = re.compile(r"Channel Comment\t(?P<rows>[0-9]{1,9}) rows : ")
"""In files of this library."""
_RATIO = re.compile(r"\((?P<response>[^()]+)\)\((?P<reference>[^()]+)\)")


def looks_like_dataphysics(data: bytes) -> bool:
    """Return whether the first two lines are those of an export."""
    lines = data[:400].decode("latin-1").splitlines()
    return len(lines) > 1 and lines[0].startswith("Units:") and lines[1].startswith(_CHANNELS)


def dataphysics_bytes(frf: FRF) -> tuple[bytes, list[str]]:
    """Return the contents of an export, and what it does not hold of the FRF."""
    if frf.shape[1:] != (1, 1):
        raise ValueError(
            f"this format holds one response and one excitation, this FRF has {frf.shape[1]} and {frf.shape[2]}; "
            "select one"
        )
    lost = [name for name in ("coherence", "log_variance", "usable", "averages") if getattr(frf, name) is not None]
    if frf.decay_rate:
        lost.append("decay_rate (the values belong to complex lines)")
    (response,), (reference,) = frf.labels if frf.labels is not None else (("",), ("",))
    if ":" in reference or (response + reference) != "".join((response + reference).split()):
        lost.append("labels with blanks or colons")
        response, reference = "", ""
    motion, _, load = frf.unit.partition("/N") if frf.unit.endswith("/N") else frf.unit.partition("/(")
    load = "N" if frf.unit.endswith("/N") else "N m"
    header = [
        "Units: Ratio",
        f"{_CHANNELS}\t{reference}:{response}",
        f"Channel Name\t{' '.join(frf.label.split())} : ",
        f"Channel Comment\t{frf.frequency_hz.size} rows : ",
        "",
        "\t ".join(_COLUMNS),
        "",
        "Units:",
        f"Hz\t({motion.replace('^2', '²')})({load})\t ",
    ]
    rows = [
        f"{line!r}\t{value.real!r}\t{value.imag!r}"
        for line, value in zip(frf.frequency_hz.tolist(), frf.values[:, 0, 0].tolist(), strict=True)
    ]
    return "\r\n".join([*header, *rows, ""]).encode("latin-1", "replace"), lost


def read_dataphysics(data: bytes, options: ReadOptions) -> list[FRF]:
    """Return the FRF in an export.

    Raises
    ------
    FileFormatError
        A header of something else than an FRF in real and imaginary part, or a row that is not three numbers; the
        message names the line.
    """
    if not looks_like_dataphysics(data):
        # What stands there is not shown: the file may be anything.
        raise FileFormatError(f"the first two lines are not those of an export, 'Units:' and {_CHANNELS!r}", line=1)
    whole = decode(data)
    lines = re.split(r"\r\n|\n|\r", whole)
    if len(lines) < _HEADER + 1:
        raise FileFormatError(
            f"the file has {len(lines)} lines, expected {_HEADER} of a header and the data", line=len(lines)
        )
    kind = lines[0].removeprefix("Units:").strip()
    if kind != "Ratio":
        raise FileFormatError(f"the units are {kind!r}; only a ratio of two channels, an FRF, is read", line=1)
    reference, _, response = lines[1].removeprefix(_CHANNELS).strip().partition(":")
    columns = tuple(name.strip() for name in lines[5].split("\t"))
    if columns != _COLUMNS:
        raise FileFormatError(f"the columns are {', '.join(columns)}, expected {', '.join(_COLUMNS)}", line=6)
    declared = None
    units = [text.strip() for text in lines[8].split("\t")]
    if units[0] != "Hz":
        raise FileFormatError(f"the frequency is in {units[0]!r}, expected Hz", line=9)
    match = _RATIO.fullmatch(units[1]) if len(units) > 1 else None
    if match:
        # Of a ratio the unit above and the unit below stand side by side.
        try:
            declared = parse_unit(f"({match['response']})/({match['reference']})")
        except UnitError as error:
            if options.unit is None:
                raise FileFormatError(f"{error}; give it with unit=", line=9) from None
    rows = [(line, text) for line, text in enumerate(lines[_HEADER:], _HEADER + 1) if text.strip()]
    if not rows:
        raise FileFormatError("there are no rows of numbers behind the header", line=_HEADER)
    count = _COUNT.fullmatch(lines[3])
    notes: list[str] = []
    if count:
        check_count(whole, len(rows), int(count["rows"]), rows[-1][0])
    else:
        notes = doubts_of_end(whole, rows)
    table = rows_of_numbers(rows, ("frequency", "real part", "imaginary part"))
    check_ascending(table[:, 0].tolist(), [line for line, _ in rows])
    try:
        resolved = resolve_frf(options, declared=declared, form=None, directions=None)
    except FileFormatError as error:
        raise FileFormatError(error.problem, line=9) from None
    return [
        make_frf(
            frequency_hz=table[:, 0],
            values=in_si(joined(table[:, 1], table[:, 2]), resolved.factor),
            form=resolved.kind.form,
            directions=([resolved.kind.response], [resolved.kind.excitation]),
            labels=((response.strip(),), (reference.strip(),)) if response.strip() or reference.strip() else None,
            label=lines[2].removeprefix("Channel Name").strip().rstrip(":").strip(),
            notes=[*notes, *resolved.notes],
            options=options,
        )
    ]
