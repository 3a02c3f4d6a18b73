"""Writing files."""

from __future__ import annotations

import gzip
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from receptance._files import write_whole
from receptance.errors import ReceptanceWarning
from receptance.frf import FRF
from receptance.io.coherence import Coherence
from receptance.io.formats import ENDINGS, FORMATS
from receptance.io.time_series import TimeSeries

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["write"]


def write(
    path: str | PathLike[str],
    things: FRF | TimeSeries | Coherence | Sequence[FRF | TimeSeries | Coherence],
    *,
    format: str | None = None,
    binary: bool | None = None,
) -> None:
    """Write measurements to a file, whole or not at all.

    NPZ, MAT and HDF5 hold everything bit for bit, CSV everything with all digits. A universal file holds several
    measurements with 13 digits (all in binary), but no variances; `.frf` and Data Physics' text one FRF without its
    quality.

    Parameters
    ----------
    path : path
        The ending says the format; with a further `.gz` a text is compressed.
    things : FRF, TimeSeries, Coherence or sequence
        What to write.
    format : str, optional
        As for `read`, where the ending does not say it.
    binary : bool, optional
        Of a universal file; by default only with the ending `.ufb`.

    Raises
    ------
    TypeError, ValueError
        Something that the format cannot hold at all, or an ending that says no format.
    OSError
        A file that cannot be written.

    Warns
    -----
    ReceptanceWarning
        What the format does not hold.

    Examples
    --------
    >>> from receptance import FRF
    >>> from receptance.io import read, write
    >>> frf = FRF(frequency_hz=[10.0, 20.0], values=[1e-6 - 1e-8j, 2e-6 - 3e-8j], averages=5)
    >>> write("tip.ufb", frf)
    >>> read("tip.ufb").averages
    5
    """
    path = Path(path)
    many = [things] if isinstance(things, (FRF, TimeSeries, Coherence)) else list(things)
    for thing in many:
        if not isinstance(thing, (FRF, TimeSeries, Coherence)):
            raise TypeError(f"cannot write {thing!r}, expected an FRF, a TimeSeries or a Coherence")
    if not many:
        raise ValueError("there is nothing to write")
    compressed = path.suffix.lower() == ".gz"
    ending = (path.with_suffix("") if compressed else path).suffix.lower()
    kind = format or ENDINGS.get(ending)
    if kind not in FORMATS:
        known = ", ".join(ENDINGS)
        raise ValueError(
            f"{path.name}: the ending says no format, expected one of {known}, or format=, one of {', '.join(FORMATS)}"
        )
    if binary is not None and kind != "uff":
        raise ValueError(f"binary is for universal files, {path.name} is a {FORMATS[kind]}")
    content, lost = _content(many, kind, binary if binary is not None else ending == ".ufb")
    if lost:
        warnings.warn(
            f"{path.name}: a {FORMATS[kind]} does not hold {'; '.join(lost)} (.npz, .mat, .h5 and .csv do)",
            ReceptanceWarning,
            stacklevel=2,
        )
    write_whole({path: gzip.compress(content, 6, mtime=0) if compressed else content})


def _content(things: Sequence[FRF | TimeSeries | Coherence], kind: str, binary: bool) -> tuple[bytes, list[str]]:
    if kind == "uff":
        from receptance.io.uff.write import uff_bytes

        return uff_bytes(things, binary=binary)
    if kind == "npz":
        from receptance.io.npz import npz_bytes

        return npz_bytes(things), []
    if kind == "mat":
        from receptance.io.mat import mat_bytes

        return mat_bytes(things), []
    if kind == "hdf5":
        from receptance.io.hdf5 import hdf5_bytes

        return hdf5_bytes(things), []
    if len(things) > 1:
        raise ValueError(f"a {FORMATS[kind]} holds one measurement, there are {len(things)}; write several files")
    if kind == "csv":
        from receptance.io.tables.write import csv_bytes

        return csv_bytes(things[0]), []
    frf = things[0]
    if not isinstance(frf, FRF):
        raise ValueError(f"a {FORMATS[kind]} holds an FRF, this is {frf!r}")
    if kind == "cutpro":
        from receptance.io.cutpro import cutpro_bytes

        return cutpro_bytes(frf)
    from receptance.io.dataphysics import dataphysics_bytes

    return dataphysics_bytes(frf)
