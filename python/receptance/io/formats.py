"""Formats: their names, their endings, and how a file shows which one it is."""

from __future__ import annotations

from pathlib import Path

from receptance.io.dataphysics import looks_like_dataphysics
from receptance.io.errors import FileFormatError
from receptance.io.uff.sets import looks_like_uff

__all__ = ["ENDINGS", "FORMATS", "GZIP", "HDF5_MARK", "format_of"]

FORMATS = {
    "uff": "universal file (data set 58)",
    "csv": "table with a header",
    "npz": "NumPy",
    "mat": "MATLAB",
    "hdf5": "HDF5",
    "cutpro": "CutPro .frf",
    "dataphysics": "Data Physics ASCII export",
}
ENDINGS = {
    ".uff": "uff",
    ".unv": "uff",
    ".ufb": "uff",
    ".58": "uff",
    ".csv": "csv",
    ".npz": "npz",
    ".mat": "mat",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".frf": "cutpro",
}
HDF5_MARK = b"\x89HDF\r\n\x1a\n"
GZIP = b"\x1f\x8b"


def format_of(path: Path, start: bytes) -> str:
    """Return the format by the contents, by the ending where these say nothing."""
    if start.startswith(GZIP):
        return "gzip"
    if start.startswith(HDF5_MARK) or start[512:520] == HDF5_MARK:
        return "hdf5"
    if start.startswith(b"PK\x03\x04"):
        return "npz"
    if start.startswith(b"MATLAB "):
        return "mat"
    if looks_like_uff(start):
        return "uff"
    if looks_like_dataphysics(start):
        return "dataphysics"
    if not start:
        raise FileFormatError("the file is empty")
    kind = ENDINGS.get(path.suffix.lower(), "csv" if path.suffix.lower() in (".txt", ".tsv", ".asc", ".dat") else "")
    if not kind:
        known = ", ".join(f"{name} ({text})" for name, text in FORMATS.items())
        raise FileFormatError(f"neither contents nor ending say what format this is; give format=, one of {known}")
    return kind
