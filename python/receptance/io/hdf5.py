"""HDF5 files, and MATLAB's version 7.3, which is one."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from receptance.frf import FRF
from receptance.io.coherence import Coherence
from receptance.io.isolated import load
from receptance.io.named import items_of, things_of, wanted_names
from receptance.io.options import ReadOptions
from receptance.io.time_series import TimeSeries

__all__ = ["hdf5_bytes", "read_hdf5"]


def hdf5_bytes(things: Sequence[FRF | TimeSeries | Coherence]) -> bytes:
    """Return the contents of an HDF5 file: one group for each measurement (frf1, time1, ...); nothing is lost."""
    import h5py  # type: ignore[import-untyped]

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", track_order=True) as file:
        for name, value in items_of(things, separator="/").items():
            if isinstance(value, np.ndarray):
                # The checksum tells a damaged file from a measurement.
                file.create_dataset(name, data=value, chunks=value.shape, fletcher32=True)
            else:
                file.create_dataset(name, data=value)
    return buffer.getvalue()


def read_hdf5(path: Path, options: ReadOptions) -> list[FRF | TimeSeries | Coherence]:
    """Return the measurements in an HDF5 file: those this library wrote, else the data sets that `variables` names."""
    contents = load(path, "hdf5", wanted_names(options))
    return things_of(contents.arrays | contents.texts, options, separator="/", listed=contents.listed)
