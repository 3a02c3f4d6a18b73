"""Damage specific to the formats: header fields, numbers, units, sizes, types, shapes, and bytes anywhere."""

from __future__ import annotations

import copy
import gzip
import io
import json
import random
import re
import tomllib
import zipfile
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import scipy.io

from properties.damaged_campaigns import damaged_contents, dumped
from properties.good_files import Base, items_of, nested

__all__ = ["damaged"]

ODD_NUMBERS = [
    *(
        b"",
        b"nan",
        b"-inf",
        b"1e400",
        b"-1",
        b"0",
        b"1",
        b"2",
        b"5",
        b"6",
        b"1_0",
        b"1D5",
        b"1.2-105",
        b"0x10",
        b"1.5.2",
    ),
    *(
        b"-0.0",
        b"1e-320",
        b"--1",
        b"1,5",
        b"*****",
        b"2147483647",
        b"-2147483648",
        b"9" * 20,
        b"+",
        b".",
        b"E5",
        b"\xff",
    ),
]
PLAUSIBLE_NUMBERS = [
    b"0",
    b"1",
    b"2",
    b"4",
    b"5",
    b"6",
    b"11",
    b"12",
    b"13",
    b"18",
    b"24",
    b"-3",
    b"1.0",
    b"0.5",
    b"1D-3",
]
ODD_UNITS = [
    *(
        b"",
        b"NONE",
        b"m^9^9^9",
        b"((((((((((((((((",
        b"9**9**9",
        b"g",
        b"g/N",
        b"m/s^2/N",
        b"rad/(N m)",
        b"dB",
        b"%",
        b"kg",
    ),
    *(
        b"1",
        b"m" * 70,
        b"m/",
        b"/N",
        b"m/s\xb2",
        "m/s²".encode(),
        b"__import__('os')",
        b"V",
        b"mm",
        b"Hz",
        b"s",
        b"0/0",
    ),
]
ODD_VALUES: list[Any] = [
    *(
        None,
        True,
        0,
        -1,
        1,
        2**70,
        1e400,
        float("nan"),
        -0.0,
        "",
        "x",
        "end",
        "y",
        "theta",
        [],
        {},
        [[]],
        [[], []],
        ["a"],
    ),
    *(
        "N",
        "\x00",
        "é" * 50,
        [["a"], ["b"]],
        ["tool", None, "y"],
        [["tool", "end", "y"]],
        "accelerance",
        {"receptance": 1},
    ),
]
FIELDS = [(0, 5), (0, 6), (0, 10), (10, 10), (20, 10), (30, 13), (43, 13), (41, 10), (51, 4), (66, 10)]
"""First column and width of fields in the header of a universal file."""
REPLACEMENTS = [
    (b",", b";"),
    (b",", b"\t"),
    (b".", b","),
    (b"E", b"D"),
    (b"\n", b"\r\n"),
    (b"\n", b"\r"),
    (b" ", b"\t"),
]
LINES = [
    b"***End_of_Header***",
    b"Channels\t2",
    b"X_Value\ta\tb",
    b"    -1",
    b"",
    b"    58",
    b"   164",
    b"\xff\xfe",
    b"# comment",
    b'"',
    b"    58b",
]
ODD_HEADERS = [
    *((rb"\(\d*,?[^)]*\)", odd) for odd in (b"(99999999999, 9)", b"(-1,)", b"(2,) * 9", b"()", b"(12L,)")),
    *((rb"'<[a-zA-Z]\d+'", odd) for odd in (b"'|O'", b"'<f2'", b"'|V8'", b"[('a', '<f8')]", b"'<M8[s]'", b"'>c16'")),
    *(
        (rb"\(\d*", b"(" * 300),
        (rb"False", b"True"),
        (rb"'descr'", b"'x'"),
        (rb"\{", b"\x00"),
        (rb"NUMPY\x01", b"NUMPY\x03"),
    ),
]
"""What to replace in the header of an NPY file."""
ODD_ARRAYS: list[Callable[[], Any]] = [
    lambda: np.zeros((0,)),
    lambda: np.zeros((3, 0, 2)),
    lambda: np.array(5.0),
    lambda: np.full(12, np.nan),
    lambda: np.arange(12)[::-1],
    lambda: np.arange(12.0),
    lambda: np.ones(12, dtype=np.float16),
    lambda: np.array(["a"] * 12),
    lambda: np.array([1, "x", None], dtype=object),
    lambda: np.ones((12, 3), dtype=np.complex64),
    lambda: np.ones((1, 12), dtype=">f8"),
    lambda: np.ones(12, dtype=bool),
    lambda: np.full((12, 1, 1), 1e308 + 1e308j),
    lambda: np.arange(12, dtype=np.uint64) + np.uint64(2**63),
    lambda: np.array("just a text"),
    lambda: np.zeros((2, 2, 2, 2, 2)),
]


def damaged(base: Base, others: list[Base], rng: random.Random) -> bytes:
    """Return the contents of a file, damaged once or several times."""
    content = base.content
    kind = base.format
    if kind == "campaign" and rng.random() < 0.6:
        contents = tomllib.loads(content.decode())
        return dumped(damaged_contents(contents, np.random.default_rng(rng.randrange(2**32)))).encode()
    if kind == "gz" and rng.random() < 0.8:
        inner = Base(base.name.split(".")[-2], base.name, gzip.decompress(content))
        return gzip.compress(_damaged_text(inner.content, rng), 1, mtime=0)
    if kind in ("npz", "mat", "h5") and rng.random() < (0.8 if kind == "npz" else 0.5):
        rebuilt = {"npz": _rebuilt_npz, "mat": _rebuilt_mat, "h5": _rebuilt_hdf5}[kind](base, rng)
        if rebuilt is not None:
            content = rebuilt
            if rng.random() < 0.7:
                return content
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        if kind == "npy" and rng.random() < 0.5:
            content = _odd_npy(content, rng)
        elif kind in ("uff", "ufb", "csv", "cutpro", "dataphysics", "lvm", "campaign") and rng.random() < 0.75:
            content = _damaged_text(content, rng)
        else:
            content = _damaged_bytes(content, rng.choice(others).content, rng)
    return content


def _damaged_bytes(content: bytes, other: bytes, rng: random.Random) -> bytes:
    data = bytearray(content)
    place = rng.randrange(len(data) + 1) if rng.random() < 0.5 else rng.randrange(min(len(data), 600) + 1)
    length = rng.choice((1, 2, 4, 8, 16, 80, 300))
    how = rng.randrange(9)
    if how == 0:
        data[place : place + 1] = bytes([rng.randrange(256)])
    elif how == 1 and place < len(data):
        data[place] ^= 1 << rng.randrange(8)
    elif how == 2:
        del data[place : place + length]
    elif how == 3:
        data[place:place] = data[place : place + length]
    elif how == 4:
        data[place:place] = rng.randbytes(length)
    elif how == 5:
        del data[place:]
    elif how == 6:
        start = rng.randrange(len(other) + 1)
        data[place : place + length] = other[start : start + length]
    elif how == 7:
        aligned = place & ~3
        number = rng.choice((0, 1, 2, 5, 6, 7, 9, 13, 14, 15, 2**31 - 1, 2**32 - 1, len(data), 2**24))
        data[aligned : aligned + 4] = number.to_bytes(4, rng.choice(("little", "big")))
    else:
        aligned = place & ~7
        data[aligned : aligned + 8] = rng.choice((0, 2**64 - 1, 2**40, len(data), 2**63)).to_bytes(8, "little")
    return bytes(data)


def _damaged_text(content: bytes, rng: random.Random) -> bytes:
    how = rng.randrange(9)
    lines = content.split(b"\n")
    index = rng.randrange(len(lines)) if rng.random() < 0.4 else rng.randrange(min(len(lines), 22))
    line = lines[index]
    if how == 0:
        # A number, kept in its columns or not.
        found = list(re.finditer(rb"[-+.0-9EeDd]+", line))
        if found:
            match, odd = rng.choice(found), rng.choice(rng.choice((ODD_NUMBERS, PLAUSIBLE_NUMBERS)))
            odd = odd.rjust(match.end() - match.start()) if rng.random() < 0.7 else odd
            lines[index] = line[: match.start()] + odd + line[match.end() :]
    elif how == 1:
        # A field of fixed columns.
        start, width = rng.choice(FIELDS)
        odd = rng.choice(rng.choice((ODD_NUMBERS, PLAUSIBLE_NUMBERS))).rjust(width)[:width]
        lines[index] = line.ljust(start)[:start] + odd + line[start + width :]
    elif how == 2:
        odd = rng.choice(ODD_UNITS)
        if b"[" in line:
            lines[index] = re.sub(rb"\[[^\]]*\]", lambda _: b"[" + odd + b"]", line, count=rng.choice((0, 1)))
        else:
            lines[index] = line[:47].ljust(47) + odd
    elif how == 3:
        lines.pop(index)
    elif how == 4:
        lines.insert(index, lines[rng.randrange(len(lines))])
    elif how == 5:
        lines.insert(index, rng.choice(LINES))
    elif how == 6:
        return content.replace(*rng.choice(REPLACEMENTS), rng.choice((-1, 1, 5)))
    elif how == 7 and b"# receptance: {" in content:
        return re.sub(
            rb"# receptance: (\{.*\})",
            lambda m: b"# receptance: " + _odd_json(m[1].decode("latin-1"), rng).encode(),
            content,
        )
    else:
        return _damaged_bytes(content, content, rng)
    return b"\n".join(lines)


def _odd_json(text: str, rng: random.Random) -> str:
    try:
        about = json.loads(text)
    except ValueError:
        return text
    for _ in range(rng.choice((1, 1, 2))):
        owner: Any = about
        while isinstance(owner, (dict, list)) and owner:
            key = rng.choice(list(owner)) if isinstance(owner, dict) else rng.randrange(len(owner))
            if isinstance(owner[key], (dict, list)) and owner[key] and rng.random() < 0.6:
                owner = owner[key]
                continue
            if rng.random() < 0.15 and isinstance(owner, dict):
                del owner[key]
            else:
                owner[key] = copy.deepcopy(rng.choice(ODD_VALUES))
            break
    return json.dumps(about)


def _rebuilt_items(items: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """Return named arrays and texts of which some are others, or missing, or more."""
    changed = dict(items)
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(list(changed) or ["x"])
        how = rng.randrange(5)
        if how == 0:
            changed.pop(name, None)
        elif how == 1:
            changed[name] = rng.choice(ODD_ARRAYS)()
        elif how == 2:
            changed[rng.choice((name + "x", "frf9.about", "time1", "frf1", "a" * 40))] = changed.get(name, 1.0)
        else:
            texts = [key for key, value in changed.items() if isinstance(value, str)]
            if texts:
                key = rng.choice(texts)
                changed[key] = _odd_json(changed[key], rng)
    return changed


def _rebuilt_npz(base: Base, rng: random.Random) -> bytes | None:
    buffer = io.BytesIO()
    if rng.random() < 0.5:
        with (
            zipfile.ZipFile(io.BytesIO(base.content)) as old,
            zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new,
        ):
            for member in old.infolist():
                content = old.read(member)
                if rng.random() < 0.3:
                    content = _odd_npy(content, rng)
                new.writestr(member.filename, content)
        return buffer.getvalue()
    arrays = {name: np.asarray(value) for name, value in _rebuilt_items(items_of(base.arrays), rng).items()}
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _odd_npy(content: bytes, rng: random.Random) -> bytes:
    pattern, odd = rng.choice(ODD_HEADERS)
    return re.sub(pattern, lambda _: odd, content, count=1)


def _rebuilt_mat(base: Base, rng: random.Random) -> bytes | None:
    buffer = io.BytesIO()
    items = _rebuilt_items(items_of(base.arrays), rng)
    try:
        scipy.io.savemat(buffer, nested(items, "."), do_compression=rng.random() < 0.5)
    except (TypeError, ValueError, UnicodeError):
        return None
    return buffer.getvalue()


def _rebuilt_hdf5(base: Base, rng: random.Random) -> bytes | None:
    buffer = io.BytesIO()
    items = _rebuilt_items(items_of(base.arrays), rng)
    try:
        with h5py.File(buffer, "w") as file:
            for name, value in items.items():
                if rng.random() < 0.05:
                    file.create_dataset(name.replace(".", "/") + "_", shape=(10**7, 100), dtype="f8", chunks=True)
                file[name.replace(".", "/")] = value
                if rng.random() < 0.05:
                    file[name.replace(".", "/")].attrs["MATLAB_class"] = np.bytes_("double")
            if rng.random() < 0.1:
                file["soft"] = h5py.SoftLink("/frf1")
                file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")
    except (TypeError, ValueError, OSError, RuntimeError):
        return None
    return buffer.getvalue()
