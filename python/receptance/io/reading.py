"""Reading files: which format it is, and what is in it."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from receptance._files import open_file, read_whole
from receptance.errors import ReceptanceWarning
from receptance.frf import FRF
from receptance.io.build import outside
from receptance.io.coherence import Coherence, describe_low
from receptance.io.errors import FileFormatError
from receptance.io.formats import FORMATS, GZIP, HDF5_MARK, format_of
from receptance.io.limits import check_lines, inflated, timed
from receptance.io.options import ReadKeywords, ReadOptions
from receptance.io.time_series import TimeSeries

if TYPE_CHECKING:
    from os import PathLike

__all__ = ["read", "read_all", "read_frf", "read_time_series"]

_BY_PATH = ("mat", "hdf5")


def read(
    path: str | PathLike[str], *, format: str | None = None, **options: Unpack[ReadKeywords]
) -> FRF | TimeSeries | Coherence:
    """Return the one measurement in a file: an FRF, a time series or a coherence.

    The format follows from the contents. Quantity and unit come from the file or from the options, never from a guess.

    Parameters
    ----------
    path : path
        The file; text formats may be compressed with gzip.
    format : str, optional
        "uff", "csv", "npz", "mat", "hdf5", "cutpro" or "dataphysics".
    quantity : str, optional
        "receptance", "mobility" or "accelerance", of an FRF whose file does not say it or says it wrongly.
    unit : str or mapping, optional
        Unit of the numbers in the file, such as "m/s^2/N" or "g/lbf"; of time records one, or a mapping from channel
        to unit; "SI" where the file says the quantity.
    responses, excitations : Coordinate or sequence, optional
        Where motion was seen and loads acted, which hardly any file says.
    coherence : path, optional
        Another file with the coherence of the FRF.
    ignore_coherence : bool, optional
        Read an FRF without its coherence, where that is worth nothing.
    variables : mapping, optional
        For NPZ, MAT and HDF5 files of other programs, which of their variables is what: "frequency_hz" and "values"
        (or "real" and "imaginary", or "magnitude" and "phase_deg" or "phase_rad") and "coherence" of an FRF, "time_s"
        and the names of the channels of time records. "NAME[:,1]" is the second column of a variable.
    columns : sequence of str, optional
        Header of a table that has none.
    sample_rate_hz : float, optional
        Of time records whose file does not say it, or not with enough digits.

    Raises
    ------
    FileFormatError
        A file that cannot be read right; the message says where, what was found, and how to help. It is a ValueError.
    TypeError, ValueError
        Options that are wrong.
    OSError
        A file that cannot be opened, a pipe or a device, or more than 1 GiB.

    Warns
    -----
    ReceptanceWarning
        A poor coherence, a text that may have been cut off, and whatever an `FRF` warns of.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.io import read, write
    >>> write("tip.csv", FRF(frequency_hz=[10.0, 20.0], values=[1e-6 - 1e-8j, 2e-6 - 3e-8j]))
    >>> read("tip.csv")
    FRF(receptance in m/N, 1 x 1, 2 lines from 10 to 20 Hz)
    """
    found = read_all(path, format=format, **options)
    if len(found) > 1:
        listed = "; ".join(f"{index}: {thing!r}" for index, thing in enumerate(found[:6]))
        raise FileFormatError(
            f"the file holds {len(found)} measurements ({listed}{', ...' if len(found) > 6 else ''}); read_all returns "
            "all of them",
            file=Path(path).name,
        )
    return found[0]


def read_frf(path: str | PathLike[str], *, format: str | None = None, **options: Unpack[ReadKeywords]) -> FRF:
    """Return the one FRF in a file, whatever else is in it; see `read`.

    Raises
    ------
    FileFormatError
        As `read`, and a file with no FRF or with several.

    Examples
    --------
    >>> from receptance import FRF
    >>> from receptance.io import read_frf, write
    >>> write("tip.npz", FRF(frequency_hz=[10.0, 20.0], values=[1e-6, 2e-6], form="mobility"))
    >>> read_frf("tip.npz").form
    'mobility'
    """
    found = read_all(path, format=format, **options)
    frfs = [thing for thing in found if isinstance(thing, FRF)]
    _expect_one(path, frfs, found, "FRF")
    return frfs[0]


def read_time_series(
    path: str | PathLike[str], *, format: str | None = None, **options: Unpack[ReadKeywords]
) -> TimeSeries:
    """Return the one time series in a file, whatever else is in it; see `read`.

    Raises
    ------
    FileFormatError
        As `read`, and a file with no time series or with several.

    Examples
    --------
    >>> from receptance.io import TimeSeries, read_time_series, write
    >>> hit = TimeSeries(values=[[0.0, 0.0], [9.0, 1.0]], channels=["f", "a"], units=["N", "g"], sample_rate_hz=51200.0)
    >>> write("hit.h5", hit)
    >>> read_time_series("hit.h5").quantities
    ('force', 'acceleration')
    """
    found = read_all(path, format=format, **options)
    series = [thing for thing in found if isinstance(thing, TimeSeries)]
    _expect_one(path, series, found, "time series")
    return series[0]


def _expect_one(path: str | PathLike[str], wanted: Sequence[Any], found: Sequence[Any], what: str) -> None:
    if len(wanted) != 1:
        listed = "; ".join(repr(thing) for thing in found[:6])
        raise FileFormatError(
            f"there is {'no' if not wanted else 'more than one'} {what} in the file; it holds {listed}",
            file=Path(path).name,
        )


def read_all(
    path: str | PathLike[str], *, format: str | None = None, **options: Unpack[ReadKeywords]
) -> list[FRF | TimeSeries | Coherence]:
    """Return all measurements in a file; see `read` for the options.

    Examples
    --------
    >>> from receptance import FRF
    >>> from receptance.io import read_all, write
    >>> two = [FRF(frequency_hz=[10.0, 20.0], values=[1e-6, 2e-6], label=label) for label in ("before", "after")]
    >>> write("both.uff", two)
    >>> [frf.label for frf in read_all("both.uff")]
    ['before', 'after']
    """
    path = Path(path)
    partner = options.pop("coherence", None)
    checked = ReadOptions.checked(options)
    if format is not None and format not in FORMATS:
        raise ValueError(f"format is {format!r}, expected one of {', '.join(FORMATS)}")
    try:
        found = _read(path, format, checked)
        if partner is not None:
            if not any(isinstance(thing, FRF) for thing in found):
                raise FileFormatError(f"coherence was given, but there is no FRF in the file: it holds {found[0]!r}")
            found = [_with_coherence(thing, Path(partner)) if isinstance(thing, FRF) else thing for thing in found]
    except FileFormatError as error:
        raise error.named(path.name) from None
    return found


def _read(path: Path, format: str | None, options: ReadOptions) -> list[FRF | TimeSeries | Coherence]:
    with open_file(path) as file:
        start = file.read(4096)
    kind = format or format_of(path, start)
    if kind in _BY_PATH and not start.startswith(GZIP):
        found = _by_path(path, kind, start, options)
    else:
        data = read_whole(path)
        if data.startswith(GZIP):
            data = inflated(data)
            kind = format or format_of(path.with_suffix(""), data[:4096])
        if kind in _BY_PATH:
            with tempfile.TemporaryDirectory() as folder:
                whole = Path(folder) / "inflated"
                whole.write_bytes(data)
                found = _by_path(whole, kind, data[:4096], options)
        else:
            with timed(len(data)):
                found = _by_data(data, kind, options)
    _check_used(found, kind, options)
    return [_sourced(thing, f"{path.name} ({FORMATS[kind]})") for thing in found]


def _by_path(path: Path, kind: str, start: bytes, options: ReadOptions) -> list[FRF | TimeSeries | Coherence]:
    if kind == "mat":
        from receptance.io.mat import read_mat

        if not start.startswith(b"MATLAB 5.0"):
            raise FileFormatError("this is not a MAT file of version 5 to 7 (save it with -v7)", byte=0)
        return read_mat(path, options)
    from receptance.io.hdf5 import read_hdf5

    if not (start.startswith(HDF5_MARK) or start[512:520] == HDF5_MARK):
        raise FileFormatError("this is not an HDF5 file: it does not begin like one", byte=0)
    return read_hdf5(path, options)


def _by_data(data: bytes, kind: str, options: ReadOptions) -> list[FRF | TimeSeries | Coherence]:
    if kind == "npz":
        from receptance.io.npz import read_npz

        return read_npz(data, options)
    check_lines(data)
    if kind == "uff":
        from receptance.io.uff.read import read_uff

        return read_uff(data, options)
    if kind == "csv":
        from receptance.io.tables.read import read_csv

        return read_csv(data, options)
    if kind == "cutpro":
        from receptance.io.cutpro import read_cutpro

        return list(read_cutpro(data, options))
    from receptance.io.dataphysics import read_dataphysics

    return list(read_dataphysics(data, options))


def _check_used(found: Sequence[FRF | TimeSeries | Coherence], kind: str, options: ReadOptions) -> None:
    """Raise where an option was given that says nothing of this file."""
    series = [thing for thing in found if isinstance(thing, TimeSeries)]
    frfs = any(isinstance(thing, FRF) for thing in found)
    for names, there, what in (
        (("quantity", "responses", "excitations"), frfs, "FRF"),
        (("sample_rate_hz",), series, "time record"),
    ):
        for name in names:
            if getattr(options, name) is not None and not there:
                raise FileFormatError(f"{name} was given, but there is no {what} in the file: it holds {found[0]!r}")
    if isinstance(options.unit, Mapping):
        channels = {channel: None for thing in series for channel in thing.channels}
        unknown = [name for name in options.unit if name not in channels]
        if unknown:
            listed = ", ".join(map(repr, channels)) or f"none: it holds {found[0]!r}"
            raise FileFormatError(f"unit names the channel {unknown[0]!r}; the channels of the file are {listed}")
    for name, kinds in (("variables", ("npz", "mat", "hdf5")), ("columns", ("csv",))):
        if getattr(options, name) is not None and kind not in kinds:
            raise FileFormatError(f"{name} was given, but the file is a {FORMATS[kind]}")


def _sourced(thing: FRF | TimeSeries | Coherence, source: str) -> FRF | TimeSeries | Coherence:
    if not thing.source:
        # Frozen, and made just now: nobody else has seen it without.
        object.__setattr__(thing, "source", source)
    return thing


def _with_coherence(frf: FRF, path: Path) -> FRF:
    """Return an FRF with the coherence in another file."""
    if frf.coherence is not None:
        raise FileFormatError(f"the file has a coherence of its own, but coherence={str(path)!r} was given")
    try:
        candidates = [thing for thing in _read(path, None, ReadOptions()) if isinstance(thing, Coherence)]
    except FileFormatError as error:
        raise error.named(path.name) from None
    fitting = [
        thing
        for thing in candidates
        if thing.values.shape == frf.values.shape
        and np.allclose(thing.frequency_hz, frf.frequency_hz, rtol=1e-6)
        and (thing.labels is None or frf.labels is None or thing.labels == frf.labels)
    ]
    if len(fitting) != 1:
        listed = "; ".join(repr(thing) for thing in candidates[:6]) or "none"
        raise FileFormatError(
            f"of the coherences in it {'none' if not fitting else 'more than one'} has the lines and points of "
            f"{frf!r}; they are {listed}",
            file=path.name,
        )
    poor = describe_low(fitting[0].values)
    if poor:
        warnings.warn(poor, ReceptanceWarning, stacklevel=outside())
    notes = (*frf.notes, f"coherence of {path.name}", *([poor] if poor else []))
    return frf.with_(coherence=fitting[0].values, notes=notes)
