"""Reading and writing of measurement files: detection of the format, and the public functions."""

from __future__ import annotations

import gzip
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar, Unpack

import numpy as np

from receptance import _checks
from receptance._files import open_file, read_whole, write_whole
from receptance.errors import warn_user
from receptance.frf import FRF
from receptance.io.build import ReadKeywords, ReadOptions
from receptance.io.csv_files import csv_bytes, read_csv
from receptance.io.errors import FileFormatError, decompress, error_location, time_limit
from receptance.io.lvm import is_lvm, read_lvm
from receptance.io.mat_hdf5 import hdf5_bytes, is_hdf5, is_mat, mat_bytes, read_hdf5, read_mat
from receptance.io.measurements import Coherence, Measurement, TimeSeries, low_coherence_notes
from receptance.io.numpy_files import is_npy, is_npz, npz_bytes, read_npy, read_npz
from receptance.io.text_frf import cutpro_bytes, dataphysics_bytes, is_dataphysics, read_cutpro, read_dataphysics
from receptance.io.uff.datasets import is_uff
from receptance.io.uff.read import read_uff
from receptance.io.uff.write import uff_bytes


@dataclass(frozen=True)
class _Format:
    """A file format: reader, file name extensions, and a function that recognises it by the first bytes of a file.

    Readers are given the contents, or the path if another process opens the file.
    """

    title: str
    read: Callable[[Any, ReadOptions], list[Measurement]]
    endings: tuple[str, ...] = ()
    recognises: Callable[[bytes], bool] | None = None
    by_path: bool = False
    written: bool = True


FORMATS = {
    "uff": _Format("universal file (data set 58)", read_uff, (".uff", ".unv", ".ufb", ".58"), is_uff),
    "csv": _Format("table with a header", read_csv, (".csv",)),
    "npz": _Format("NumPy", read_npz, (".npz",), is_npz),
    "mat": _Format("MATLAB", read_mat, (".mat",), is_mat, by_path=True),
    "hdf5": _Format("HDF5", read_hdf5, (".h5", ".hdf5"), is_hdf5, by_path=True),
    "cutpro": _Format("CutPro .frf", read_cutpro, (".frf",)),
    "dataphysics": _Format("Data Physics ASCII export", read_dataphysics, (), is_dataphysics),
    "lvm": _Format("LabVIEW measurement file", read_lvm, (".lvm",), is_lvm, written=False),
    "npy": _Format("NumPy array", read_npy, (".npy",), is_npy, written=False),
}
"""Formats by their name in `read` and `write`."""
_ENDINGS = {ending: name for name, one in FORMATS.items() for ending in one.endings}
_TABLE_ENDINGS = (".txt", ".tsv", ".asc", ".dat")
"""Further extensions of tables, which are read but not written."""
ENDINGS = (*_ENDINGS, *_TABLE_ENDINGS)
"""Endings of files that are read."""
_ARRAY_WRITERS = {"npz": npz_bytes, "mat": mat_bytes, "hdf5": hdf5_bytes}
_GZIP_SIGNATURE = b"\x1f\x8b"
_START = 4096
"""Bytes by which the format is recognised."""
_MAX_LISTED = 6
"""Most measurements listed in a message."""

_OF_COHERENCE = (
    "this is the coherence of an FRF, whose options are coherence_columns and coherence_variables (on the command line "
    "--coherence-columns and --coherence-variable)"
)

_Measurement = TypeVar("_Measurement", bound=Measurement)


def read(path: str | PathLike[str], **options: Unpack[ReadKeywords]) -> Measurement:
    """Return the only measurement in a file: an FRF, a time series or a coherence.

    The format is detected from the contents. Quantity and unit are taken from the file or the options, never guessed.

    Parameters
    ----------
    path : path
        The file; text formats may be compressed with gzip.
    format : str, optional
        "uff", "csv", "npz", "mat", "hdf5", "cutpro", "dataphysics", "lvm" or "npy".
    quantity : str, optional
        "receptance", "mobility" or "accelerance", for an FRF whose file does not state it, or states it wrongly.
    unit : str or mapping, optional
        Unit of the numbers in the file, such as "m/s^2/N" or "g/lbf"; for time series one unit, or a mapping from
        channel to unit; "SI" if the file states the quantity.
    responses, excitations : Coordinate or sequence, optional
        Where motion was measured and loads acted, if the file does not state it.
    coherence : path, optional
        Another file with the coherence of the FRF.
    coherence_variables, coherence_columns : optional
        As `variables` and `columns`, for that file.
    ignore_coherence : bool, optional
        Read an FRF without its coherence.
    conjugate, reverse : bool, optional
        Replace an FRF by its complex conjugate, if it is written for e^(-i w t), or change its sign, if the sensor or
        the hammer was reversed; as `FRF.conjugated` and `FRF.flipped`.
    variables : mapping, optional
        For NPZ, MAT and HDF5 files of other programs, the names of the variables: for an FRF of "frequency_hz", of
        "values" (or "real" and "imaginary", or "magnitude" and "phase_deg" or "phase_rad") and of "coherence", for a
        time series of "time_s" and each channel. "NAME[:,1]" is the second column of a variable.
    columns : sequence of str, optional
        Header of a table without header, and names of the columns of an array (.npy).
    sample_rate_hz : float, optional
        For time series whose file does not state it, or not with enough digits; tables may then lack the times.

    Raises
    ------
    FileFormatError
        A file that cannot be read; the message names the place, the finding and the remedy. It is a ValueError.
    TypeError, ValueError
        Invalid options.
    OSError
        A file that cannot be opened, a pipe or a device, or more than 1 GiB.

    Warns
    -----
    ReceptanceWarning
        A low coherence, a text that may be truncated, and the warnings of `FRF`.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.io import read, write
    >>> write("tip.csv", FRF(frequency_hz=[10.0, 20.0], values=[1e-6 - 1e-8j, 2e-6 - 3e-8j]))
    >>> read("tip.csv")
    FRF(receptance in m/N, 1 x 1, 2 lines from 10 to 20 Hz)
    """
    measurements = read_all(path, **options)
    return _only(path, measurements, measurements, "measurements")


def read_frf(path: str | PathLike[str], **options: Unpack[ReadKeywords]) -> FRF:
    """Return the only FRF in a file and ignore other contents; see `read`.

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
    measurements = read_all(path, **options)
    frfs = [measurement for measurement in measurements if isinstance(measurement, FRF)]
    frf = _only(path, frfs, measurements, "FRFs")
    left = [measurement for measurement in measurements if isinstance(measurement, Coherence)]
    if frf.coherence is None and left:
        note = (
            "the file also holds a coherence that was not assigned to the FRF, because its points or lines differ, or "
            f"it was written separately: {_listing(left)}; if it belongs to the FRF, read_all returns it for "
            "frf.with_(coherence=...)"
        )
        warn_user(f"{Path(path).name}: {note}")
        # The instance was created by the reader and is not shared yet.
        _checks.set_fields(frf, {"notes": (*frf.notes, note)})
    return frf


def read_time_series(path: str | PathLike[str], **options: Unpack[ReadKeywords]) -> TimeSeries:
    """Return the only time series in a file and ignore other contents; see `read`.

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
    measurements = read_all(path, **options)
    series = [measurement for measurement in measurements if isinstance(measurement, TimeSeries)]
    return _only(path, series, measurements, "time series")


def _only(
    path: str | PathLike[str], matching: Sequence[_Measurement], measurements: Sequence[Measurement], kind: str
) -> _Measurement:
    """Return the only measurement of a kind, or raise with a list of all measurements in the file."""
    if len(matching) != 1:
        raise FileFormatError(
            f"the file holds {len(matching) or 'no'} {kind}, expected one: {_listing(measurements)}; read_all returns "
            "all of them",
            file=Path(path).name,
        )
    return matching[0]


def _listing(measurements: Sequence[Measurement]) -> str:
    shown = [f"{index}: {measurement!r}" for index, measurement in enumerate(measurements[:_MAX_LISTED])]
    return "; ".join(shown + ["..."] * (len(measurements) > _MAX_LISTED))


def read_all(path: str | PathLike[str], **options: Unpack[ReadKeywords]) -> list[Measurement]:
    """Return all measurements in a file; see `read` for the options.

    Examples
    --------
    >>> from receptance import FRF
    >>> from receptance.io import read_all, write
    >>> frfs = [FRF(frequency_hz=[10.0, 20.0], values=[1e-6, 2e-6], label=label) for label in ("before", "after")]
    >>> write("both.uff", frfs)
    >>> [frf.label for frf in read_all("both.uff")]
    ['before', 'after']
    """
    path = Path(path)
    format = options.pop("format", None)
    coherence_file = options.pop("coherence", None)
    of_coherence = {name: options.pop(f"coherence_{name}", None) for name in ("variables", "columns")}  # type: ignore[misc]
    checked, checked_of_coherence = ReadOptions.checked(options), ReadOptions.checked(of_coherence)
    if format is not None:
        _checks.one_of("", "format", format, FORMATS)
    for name, value in of_coherence.items():
        if value is not None and coherence_file is None:
            raise ValueError(f"coherence_{name} is given without coherence, the file that it describes")
    with error_location(file=path.name):
        measurements = _read(path, format, checked)
        if coherence_file is not None:
            if not any(isinstance(measurement, FRF) for measurement in measurements):
                raise FileFormatError(
                    f"coherence was given, but there is no FRF in the file: it holds {measurements[0]!r}"
                )
            measurements = [
                _with_coherence(measurement, Path(coherence_file), checked_of_coherence)
                if isinstance(measurement, FRF)
                else measurement
                for measurement in measurements
            ]
    return measurements


def _read(path: Path, format: str | None, options: ReadOptions) -> list[Measurement]:
    with open_file(path) as file:
        start = file.read(_START)
    if compressed := start.startswith(_GZIP_SIGNATURE):
        data = decompress(read_whole(path))
        kind = format or _detect_format(path.with_suffix(""), data[:_START])
    else:
        kind = format or _detect_format(path, start)
        data = b"" if FORMATS[kind].by_path else read_whole(path)
    reader = FORMATS[kind].read
    if not FORMATS[kind].by_path:
        with time_limit(len(data)):
            measurements = reader(data, options)
    elif compressed:
        with tempfile.TemporaryDirectory() as folder:
            expanded = Path(folder) / "expanded"
            expanded.write_bytes(data)
            measurements = reader(expanded, options)
    else:
        measurements = reader(path, options)
    _check_options_apply(measurements, kind, options)
    for measurement in measurements:
        changes: dict[str, Any] = {}
        if not measurement.source:
            changes["source"] = f"{path.name} ({FORMATS[kind].title})"
        if isinstance(measurement, FRF) and measurement.coherence is not None:
            # A file of this library may contain the note already.
            notes = [*measurement.notes, *low_coherence_notes(measurement.coherence)]
            changes["notes"] = tuple(dict.fromkeys(notes))
        # The instance was created by the reader and is not shared yet.
        _checks.set_fields(measurement, changes)
    return measurements


def file_format(path: str | PathLike[str]) -> str:
    """Return the format of a file, a key of `FORMATS`, from its contents, else its extension."""
    path = Path(path)
    with open_file(path) as file:
        start = file.read(_START)
    if start.startswith(_GZIP_SIGNATURE):
        path, start = path.with_suffix(""), decompress(read_whole(path))[:_START]
    with error_location(file=path.name):
        return _detect_format(path, start)


def _detect_format(path: Path, start: bytes) -> str:
    """Return the format from the first bytes, or from the extension where these are ambiguous."""
    for kind, one in FORMATS.items():
        if one.recognises is not None and one.recognises(start):
            return kind
    if not start:
        raise FileFormatError("the file is empty, expected an FRF, a coherence or a time record")
    ending = path.suffix.lower()
    kind = _ENDINGS.get(ending, "csv" if ending in _TABLE_ENDINGS else "")
    if not kind:
        known = ", ".join(f"{name} ({one.title})" for name, one in FORMATS.items())
        raise FileFormatError(
            "the format is recognised neither by the contents nor by the extension; give format= (on the command line "
            f"--from), one of {known}"
        )
    return kind


def _check_options_apply(measurements: Sequence[Measurement], kind: str, options: ReadOptions) -> None:
    """Raise if an option was given that does not apply to the contents of the file."""
    series = [measurement for measurement in measurements if isinstance(measurement, TimeSeries)]
    has_frf = any(isinstance(measurement, FRF) for measurement in measurements)
    for name, applies, contents in (
        *((name, has_frf, "FRF") for name in ("quantity", "responses", "excitations", "conjugate", "reverse")),
        ("sample_rate_hz", bool(series), "time series"),
    ):
        if getattr(options, name) not in (None, False) and not applies:
            raise FileFormatError(
                f"{name} was given, but there is no {contents} in the file: it holds {measurements[0]!r}"
            )
    if isinstance(options.unit, Mapping):
        channels = dict.fromkeys(channel for record in series for channel in record.channels)
        unknown = [name for name in options.unit if name not in channels]
        if unknown:
            listed = ", ".join(map(repr, channels)) or f"none: it holds {measurements[0]!r}"
            raise FileFormatError(f"unit names the channel {unknown[0]!r}; the channels of the file are {listed}")
    for name, kinds in (("variables", ("npz", "mat", "hdf5")), ("columns", ("csv", "npy"))):
        if getattr(options, name) is not None and kind not in kinds:
            raise FileFormatError(f"{name} was given, but the file is a {FORMATS[kind].title}")


def _with_coherence(frf: FRF, path: Path, options: ReadOptions) -> FRF:
    """Return an FRF with the coherence of another file."""
    if frf.coherence is not None:
        raise FileFormatError(f"the file contains a coherence, but coherence={str(path)!r} was given")
    try:
        with error_location(file=path.name):
            measurements = _read(path, None, options)
    except FileFormatError as error:
        raise FileFormatError(
            f"{error.problem}; {_OF_COHERENCE}", error.file, error.line, error.byte, error.place
        ) from None
    coherences = [measurement for measurement in measurements if isinstance(measurement, Coherence)]
    matching = [
        coherence
        for coherence in coherences
        if coherence.values.shape == frf.values.shape
        and np.allclose(coherence.frequency_hz, frf.frequency_hz, rtol=1e-6)
        and (coherence.labels is None or frf.labels is None or coherence.labels == frf.labels)
    ]
    if len(matching) != 1:
        raise FileFormatError(
            f"{'none' if not matching else 'more than one'} of its coherences has the lines and points of {frf!r}; "
            f"they are {_listing(coherences) or 'none'}",
            file=path.name,
        )
    notes = (*frf.notes, f"coherence of {path.name}", *low_coherence_notes(matching[0].values))
    return frf.with_(coherence=matching[0].values, notes=notes)


def write(
    path: str | PathLike[str],
    measurements: Measurement | Sequence[Measurement],
    *,
    format: str | None = None,
    binary: bool | None = None,
) -> None:
    """Write measurements to a file, completely or not at all.

    NPZ, MAT and HDF5 store all fields bit for bit, CSV all fields with all digits. A universal file stores several
    measurements with 13 digits (all digits in binary), but no variances; `.frf` and Data Physics' text store one FRF
    without coherence and variance.

    Parameters
    ----------
    path : path
        The extension determines the format; text is compressed with a further `.gz`.
    measurements : FRF, TimeSeries, Coherence or sequence
        Contents of the file.
    format : str, optional
        As for `read`, if the extension does not determine it.
    binary : bool, optional
        For universal files; by default only with the extension `.ufb`.

    Raises
    ------
    TypeError, ValueError
        Contents that the format cannot store, or an unknown extension.
    OSError
        A file that cannot be written.

    Warns
    -----
    ReceptanceWarning
        Fields that the format does not store.

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
    contents = [measurements] if isinstance(measurements, Measurement) else list(measurements)
    for measurement in contents:
        if not isinstance(measurement, Measurement):
            raise TypeError(f"cannot write {measurement!r}, expected an FRF, a TimeSeries or a Coherence")
    if not contents:
        raise ValueError("measurements is empty, expected at least one to write")
    compressed = path.suffix.lower() == ".gz"
    ending = (path.with_suffix("") if compressed else path).suffix.lower()
    kind = format or _ENDINGS.get(ending)
    written = [name for name, one in FORMATS.items() if one.written]
    if kind not in written:
        endings = ", ".join(ending for ending, name in _ENDINGS.items() if name in written)
        raise ValueError(
            f"{path.name}: {'is read and not written' if kind in FORMATS else 'unknown extension'}, expected one of "
            f"{endings}, or format=, one of {', '.join(written)}"
        )
    if binary is not None and kind != "uff":
        raise ValueError(f"binary applies to universal files, {path.name} is a {FORMATS[kind].title}")
    content, lost = _content(contents, kind, binary if binary is not None else ending == ".ufb")
    if lost:
        warn_user(f"{path.name}: a {FORMATS[kind].title} does not hold {'; '.join(lost)} (.npz, .mat, .h5 and .csv do)")
    write_whole({path: gzip.compress(content, 6, mtime=0) if compressed else content})


def _content(measurements: Sequence[Measurement], kind: str, binary: bool) -> tuple[bytes, list[str]]:
    """Return the contents of a file, and the fields that it does not store."""
    if kind == "uff":
        return uff_bytes(measurements, binary=binary)
    if kind in _ARRAY_WRITERS:
        return _ARRAY_WRITERS[kind](measurements), []
    if len(measurements) > 1:
        raise ValueError(
            f"a {FORMATS[kind].title} holds a single measurement, there are {len(measurements)}; write several files"
        )
    if kind == "csv":
        return csv_bytes(measurements[0]), []
    frf = measurements[0]
    if not isinstance(frf, FRF):
        raise ValueError(f"a {FORMATS[kind].title} holds an FRF, this is {frf!r}")
    return cutpro_bytes(frf) if kind == "cutpro" else dataphysics_bytes(frf)
