"""Small good files of every format, as this library and as others write them."""

from __future__ import annotations

import gzip
import io
import json
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from campaign_text import TEXT
from receptance import FRF, Coordinate, examples
from receptance.io import Coherence, TimeSeries, write

UNIT = {"unit": "m/s^2/N"}
VARIABLES = {"variables": {"frequency_hz": "f", "values": "H", "coherence": "coh"}, **UNIT}
TIME_VARIABLES = {"variables": {"time_s": "t", "a": "y"}, "unit": {"a": "g"}}
UNTIMED = ({"columns": ["hammer [N]", "tip [g]"], "sample_rate_hz": 1000.0},)
OPTIONS: tuple[dict[str, Any], ...] = (
    *[{}] * 10,
    UNIT,
    {"unit": "SI"},
    {"unit": "SI", "quantity": "mobility"},
    {"quantity": "accelerance", "unit": "g/lbf"},
    {"ignore_coherence": True},
    {"responses": Coordinate("tool", 0.0)},
    {"sample_rate_hz": 1000.0},
)


@dataclass(frozen=True)
class Base:
    """A good file to damage."""

    format: str
    name: str
    content: bytes
    options: tuple[dict[str, Any], ...] = OPTIONS
    arrays: bytes = b""
    """The same as an NPZ file, where the format holds named arrays."""


def measurements(rng: np.random.Generator) -> tuple[list[Any], FRF, TimeSeries]:
    """Return small measurements of every kind, a plain FRF and a time series."""
    lines = np.arange(1, 13) * 0.5
    values = rng.normal(size=(12, 2, 2)) + 1j * rng.normal(size=(12, 2, 2))
    matrix = FRF(
        frequency_hz=lines,
        values=values,
        form="accelerance",
        responses=[Coordinate("tool", 0.0), Coordinate("tool", 0.05, "theta")],
        excitations=["y", "theta"],
        coherence=rng.uniform(0.6, 1.0, size=values.shape),
        log_variance=rng.uniform(size=values.shape),
        degrees_of_freedom=18.0,
        usable=lines > 1.0,
        averages=5,
        decay_rate=2.5,
        labels=(["1:+2", "2:+6"], ["1:+2", "1:+6"]),
        label="matrix",
        notes=["one note"],
    )
    plain = FRF(frequency_hz=lines, values=values[:, 0, 0], label="plain")
    series = TimeSeries(
        values=rng.normal(size=(12, 2)), channels=["hammer", "tip"], units=["N", "m/s^2"], sample_rate_hz=1000.0
    )
    coherence = Coherence(frequency_hz=lines, values=rng.uniform(0.6, 1.0, size=12))
    return [matrix, plain, series, coherence], plain, series


def good_files(seed: int) -> list[Base]:
    """Return good files of every format, of this library and as others write them."""
    rng = np.random.default_rng(seed)
    things, plain, series = measurements(rng)
    found: list[Base] = []
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number, thing in enumerate([*things, things]):
            for ending in (".uff", ".ufb", ".npz", ".mat", ".h5", ".csv"):
                if not (isinstance(thing, list) and ending == ".csv"):
                    path = Path(folder) / f"own{number}{ending}"
                    write(path, thing)
                    found.append(Base(ending[1:], path.name, path.read_bytes()))
        for name, format_ in (("own.frf", "cutpro"), ("own.txt", "dataphysics")):
            write(Path(folder) / name, plain, format=format_)
            found.append(Base(format_, name, (Path(folder) / name).read_bytes()))
    found.extend(_of_others(plain, series, rng))
    for base in [base for base in found if base.format == "npz" and base.name.startswith("own")]:
        buffer = io.BytesIO()
        scipy.io.savemat(buffer, nested(items_of(without_checksum(base.content)), "."))
        found.append(Base("mat", base.name.replace(".npz", ".mat"), buffer.getvalue()))
    found.extend(
        Base("gz", f"{base.name}.gz", gzip.compress(base.content, mtime=0), base.options)
        for base in found
        if base.format in ("uff", "csv", "cutpro", "dataphysics", "lvm")
    )
    for text in (TEXT, examples.EXAMPLES["er32"].campaign):
        found.append(Base("campaign", "campaign.toml", text.encode(), ({},)))
    # Without a checksum, as in earlier versions, damage reaches the fields behind it.
    arrays = {base.name.split(".")[0]: without_checksum(base.content) for base in found if base.format == "npz"}
    return [
        replace(base, arrays=arrays[stem]) if (stem := base.name.split(".")[0]) in arrays else base for base in found
    ]


def _of_others(plain: FRF, series: TimeSeries, rng: np.random.Generator) -> Iterator[Base]:
    lines, values = plain.frequency_hz, plain.values[:, 0, 0]
    foreign = {"f": lines, "H": values, "coh": rng.uniform(0.6, 1.0, size=12), "t": np.arange(12) / 50.0, "y": lines}
    options = (VARIABLES, TIME_VARIABLES, {}, VARIABLES | {"ignore_coherence": True})
    for compressed in (False, True):
        buffer = io.BytesIO()
        scipy.io.savemat(buffer, {**foreign, "s": {"a": lines, "text": "abc"}}, do_compression=compressed)
        yield Base("mat", "foreign.mat", buffer.getvalue(), options)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **foreign)
    yield Base("npz", "foreign.npz", buffer.getvalue(), options)
    point = np.dtype([("node", "u8"), ("direction", "i1")])
    data = np.zeros(2, dtype=[("abscissa", "f8", 12), ("ordinate", "c16", 12), ("coordinate", point, 2)])
    data["abscissa"], data["ordinate"] = lines, values
    data["coordinate"]["node"], data["coordinate"]["direction"] = [[1, 1], [2, 1]], 3
    buffer = io.BytesIO()
    np.savez(buffer, data=data, function_type=4)
    yield Base("npz", "sdynpy.npz", buffer.getvalue(), (UNIT, {}))
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        stored = [file.create_dataset(f"#refs#/{name}", data=foreign[name]) for name in ("f", "H", "coh")]
        cells = file.create_dataset("C", (1, 3), dtype=h5py.ref_dtype)
        cells[0] = [one.ref for one in stored]
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
    in_cells = {"frequency_hz": "C[0]", "values": "C[1]", "coherence": "C[2]"}
    content = b"MATLAB 7.3 MAT-file".ljust(512) + buffer.getvalue()[512:]
    yield Base("h5", "foreign.h5", content, ({"variables": in_cells, **UNIT}, {}))
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for name, array in foreign.items():
            file.create_dataset(name, data=array, compression="gzip" if name == "H" else None)
        file.create_group("g").attrs["x"] = 1
    yield Base("h5", "foreign.h5", buffer.getvalue(), options)
    for kind in (2, 4, 5, 6):
        for even in (0, 1):
            for binary in (False, True):
                yield Base(
                    "uff", f"layout{kind}{even}{binary}.uff", uff_layout(kind, even, lines, values, binary=binary)
                )
    for delimiter, comma in ((";", True), ("\t", False), (",", False)):
        text = (
            delimiter.join(["frequency (Hz)", "mobility re [mm/s/N]", "mobility im [mm/s/N]", "coherence [%]"]) + "\n"
        )
        rows = [[f"{f:.6g}", f"{v.real:.9E}", f"{v.imag:.9E}", "95"] for f, v in zip(lines, values, strict=True)]
        table = "\n".join(delimiter.join(row) for row in rows)
        yield Base("csv", "foreign.csv", (text + (table.replace(".", ",") if comma else table)).encode("latin-1"))
    rows = [f"{f:.6g}\t{v.real:.6E}{v.imag:+.6E}i\t0.95" for f, v in zip(lines, values, strict=True)]
    yield Base("csv", "complex.csv", ("omega [rad/s]\tH1 [mm/N]\tKohärenz [-]\n" + "\n".join(rows)).encode())
    rows = [
        f"{f:.6g},{20 * np.log10(abs(v)):.4f},{np.angle(v, deg=True):.3f}" for f, v in zip(lines, values, strict=True)
    ]
    header = "Window,Uniform\nf [Hz],magnitude [dB re 1 um/N],phase [deg]\n"
    yield Base("csv", "level.csv", (header + "\n".join(rows)).encode())
    rows = [f"{k % 6 / 1000.0:.4f};{y:.5f}" for k, y in enumerate(series.values[:, 0])]
    yield Base("csv", "hits.csv", ("time [s];hammer [N]\n" + "\n".join(rows).replace(".", ",")).encode())
    yield Base("csv", "untimed.csv", "\n".join(f"{x:.5f} {y:.5f}" for x, y in series.values).encode(), UNTIMED)
    for columns, comma in (("No", False), ("One", True), ("Multi", False)):
        yield Base("lvm", f"{columns.lower()}.lvm", labview(series, columns, comma=comma))
    for array, given in (
        (np.column_stack([lines, values]), {"columns": ["f [Hz]", "H1 [m/N]"]}),
        (np.column_stack([lines, values.real, values.imag]), {"columns": ["f [Hz]", "real [m/N]", "imag [m/N]"]}),
        (series.values, UNTIMED[0]),
    ):
        buffer = io.BytesIO()
        np.save(buffer, array)
        yield Base("npy", "array.npy", buffer.getvalue(), (given, given, given, {}))
    table = "\r\n".join(f"{t:.4f},{y:.5f}" for t, y in zip(series.time_s, series.values[:, 0], strict=True))
    yield Base("csv", "time.csv", ("time [ms],hammer [lbf]\r\n" + table).encode())


def uff_layout(kind: int, even: int, lines: np.ndarray, values: np.ndarray, *, binary: bool) -> bytes:
    """Return a universal file with one FRF in one of the eight layouts, units by data set 164, labels not ASCII."""
    parts = [values.real, values.imag] if kind in (5, 6) else [values.real]
    double = kind in (4, 6)
    if binary:
        form = ([] if even else [("x", "<f4")]) + [(f"p{k}", "<f8" if double else "<f4") for k in range(len(parts))]
        table = np.zeros(lines.size, dtype=form)
        if not even:
            table["x"] = lines
        for k, part in enumerate(parts):
            table[f"p{k}"] = part
        body = table.tobytes()
        identity = f"    58b     1     2          11{len(body):12d}     0     0           0           0"
    else:
        wide = "20.12E" if double else "13.5E"
        numbers = [
            ("" if even else f"{x:13.5E}") + "".join(f"{p[i]:{wide}}" for p in parts) for i, x in enumerate(lines)
        ]
        per_line = {(2, 0): 3, (2, 1): 6, (4, 0): 2, (4, 1): 4, (5, 0): 2, (5, 1): 3, (6, 0): 1, (6, 1): 2}[kind, even]
        rows = ["".join(numbers[k : k + per_line]).replace("E", "D") for k in range(0, len(numbers), per_line)]
        body = ("\n".join(rows) + "\n").encode()
        identity = "    58"
    units = [f"         5{'mm newton':<20}         2", "  1.0000D+03  1.0000D+00  1.0000D+00", "  0.0000D+00"]
    text = [
        *("    -1", "   164", *(line.replace("0D", "0" * 13 + "D") for line in units), "    -1"),
        *("    -1", identity, "NONE", "NONE", "21-Nov-25 10:00:00", "NONE", "NONE"),
        "    4         1    1         0 NONE               1   2 NONE              22   2",
        f"{kind:10d}{lines.size:10d}{even:10d}  5.00000E-01  5.00000E-01  0.00000E+00",
        "        18    0    0    0 Frequency            Hz",
        "        12    1    0    0 Accélération         NONE",
        "        13    0    1    0 Force                NONE",
        "         0    0    0    0 NONE                 NONE",
    ]
    return "\n".join(text).encode("latin-1") + b"\n" + body + b"    -1\n"


def labview(series: TimeSeries, columns: str, *, comma: bool) -> bytes:
    """Return a LabVIEW measurement file with two segments of a time series; `columns` are those of the times."""
    stride = 2 if columns == "Multi" else 1

    def key(name: str, *cells: str) -> str:
        return "\t".join([name, *(text for cell in cells for text in [cell, ""][:stride]), ""])

    lines = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Separator\tTab",
        f"Decimal_Separator\t{',' if comma else '.'}",
    ]
    lines += ["Multi_Headings\tYes", f"X_Columns\t{columns}", "Time_Pref\tAbsolute", "***End_of_Header***\t", "\t"]
    for start in ("0.000000", "3.500000"):
        lines += [
            key("Channels", "2"),
            key("Samples", *[str(len(series))] * 2),
            key("Y_Unit_Label", "Newtons", "m/s^2"),
        ]
        lines += [key("X_Dimension", "Time", "Time"), key("X0", start, start), key("Delta_X", "0.001000", "0.001000")]
        names = ["hammer", "X_Value", "tip"] if columns == "Multi" else ["hammer", "tip"]
        lines += ["***End_of_Header***\t\t", "\t".join(["X_Value", *names, "Comment"])]
        for time, (force, motion) in zip(series.time_s, series.values, strict=True):
            first = "" if columns == "No" else f"{float(start) + time:.6f}"
            row = (
                [first, f"{force:.6f}", first, f"{motion:.6f}"]
                if columns == "Multi"
                else [first, f"{force:.6f}", f"{motion:.6f}"]
            )
            lines.append("\t".join(row))
        lines.append("")
    text = "\r\n".join(lines)
    return (text.replace(".", ",") if comma else text).replace("Decimal_Separator\t,,", "Decimal_Separator\t,").encode()


def items_of(content: bytes) -> dict[str, Any]:
    """Return the arrays and texts in an NPZ file."""
    with np.load(io.BytesIO(content)) as arrays:
        return {name: str(array[()]) if array.dtype.kind == "U" else array for name, array in arrays.items()}


def without_checksum(content: bytes) -> bytes:
    """Return an NPZ file whose JSON texts state no checksum; other files are returned as they are."""
    items = items_of(content)
    for name, value in items.items():
        if isinstance(value, str) and name.endswith("about"):
            about = {key: field for key, field in json.loads(value).items() if key not in ("checksum", "measurements")}
            items[name] = json.dumps(about)
    buffer = io.BytesIO()
    np.savez(buffer, **items)
    return buffer.getvalue()


def nested(items: dict[str, Any], separator: str) -> dict[str, Any]:
    """Return structs of what stands before and after the separator."""
    structs: dict[str, Any] = {}
    for name, value in items.items():
        owner, _, last = name.partition(separator)
        if last and isinstance(structs.setdefault(owner[:31], {}), dict):
            structs[owner[:31]][last[:31]] = value
        elif not last:
            structs[owner[:31]] = value
    return structs
