"""MAT files of MATLAB (version 5, as `save -v7` and scipy.io write them)."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from receptance.frf import FRF
from receptance.io.coherence import Coherence
from receptance.io.isolated import load
from receptance.io.named import items_of, things_of, wanted_names
from receptance.io.options import ReadOptions
from receptance.io.time_series import TimeSeries

__all__ = ["mat_bytes", "read_mat"]


def mat_bytes(things: Sequence[FRF | TimeSeries | Coherence]) -> bytes:
    """Return the contents of a MAT file: one struct for each measurement (frf1, time1, ...); nothing is lost."""
    import scipy.io

    structs: dict[str, dict[str, Any]] = {}
    for name, value in items_of(things, separator=".").items():
        owner, _, field = name.partition(".")
        structs.setdefault(owner, {})[field] = value
    buffer: Any = io.BytesIO()
    scipy.io.savemat(buffer, structs, do_compression=True)
    return bytes(buffer.getvalue())


def read_mat(path: Path, options: ReadOptions) -> list[FRF | TimeSeries | Coherence]:
    """Return the measurements in a MAT file: those this library wrote, else the variables that `variables` names."""
    contents = load(path, "mat", wanted_names(options))
    return things_of(contents.arrays | contents.texts, options, separator=".", listed=contents.listed)
