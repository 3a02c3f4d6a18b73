"""Universal files made up for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from receptance import FRF

SI = ["    -1", "   164", f"         1{'SI':<20}         2", f"{1.0:25.17E}" * 3, f"{0.0:25.17E}", "    -1"]
MM = [
    "    -1",
    "   164",
    f"         5{'mm':<20}         2",
    f"{1e3:25.17E}{1.0:25.17E}{1.0:25.17E}",
    f"{0.0:25.17E}",
    "    -1",
]
BODY = ["  1.00000E+00 -1.00000E+00  2.00000E+00 -2.00000E+00"]


def data_set(
    body: list[str] | bytes = BODY,
    *,
    function: int = 4,
    response: tuple[int, int] = (1, 2),
    reference: tuple[int, int] = (2, 2),
    ordinate: int = 5,
    count: int = 2,
    even: int = 1,
    axes: tuple[tuple[int, str, str], ...] = ((18, "", ""), (12, "", ""), (13, "", "")),
    identity: str = "    58",
    texts: tuple[str, ...] = ("NONE",) * 5,
    step: str = "1.00000E+00",
) -> bytes:
    """Return one data set 58; by default a complex single-precision accelerance on two lines."""
    ends = "".join(f" {'NONE':<10}{node:10d}{direction:4d}" for node, direction in (response, reference))
    lines = [
        "    -1",
        identity,
        *texts,
        f"{function:5d}{0:10d}{0:5d}{0:10d}{ends}",
        f"{ordinate:10d}{count:10d}{even:10d}  1.00000E+00{step:>13}  0.00000E+00",
        *(f"{kind:10d}    0    0    0 {label or 'NONE':<20} {unit or 'NONE':<20}" for kind, label, unit in axes),
        "         0    0    0    0 NONE                 NONE",
    ]
    data = body if isinstance(body, bytes) else ("\n".join(body) + "\n").encode()
    return "\n".join(lines).encode() + b"\n" + data + b"    -1\n"


def file(tmp_path: Path, *parts: bytes | list[str], name: str = "made.uff") -> Path:
    path = tmp_path / name
    path.write_bytes(b"".join(part if isinstance(part, bytes) else ("\n".join(part) + "\n").encode() for part in parts))
    return path


def values(thing: Any) -> list[complex]:
    assert isinstance(thing, FRF)
    found: list[complex] = thing.values[:, 0, 0].tolist()
    return found
