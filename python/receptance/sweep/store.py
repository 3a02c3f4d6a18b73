"""Results of a sweep: in memory, or in a Zarr store that is written block by block."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from receptance.errors import require, warn_user
from receptance.sweep.candidates import MOST_BYTES
from receptance.sweep.definition import CANDIDATE, Definition, SweepError
from receptance.sweep.outputs import Variable

if TYPE_CHECKING:
    import xarray as xr

_RECORD = "receptance_sweep"
_FORMAT = 4
_CHECKSUM = "checksum"
"""Name of the array with one checksum for each block. It is written last, so that a block with a checksum is whole."""
_ABSENT = -1
"""The checksum of a block that was not written."""
_SAME = 1e-9
"""Relative difference up to which candidates are equal; processors may differ in the last bits."""
_EXPECTED = "expected a store written by a sweep, or a new name"


class Memory:
    """Results in memory, in blocks of `block` candidates; `finished` is the mask of finished blocks."""

    def __init__(self, definition: Definition, block: int | None) -> None:
        self._definition = definition
        count = definition.candidates.count
        size = sum(np.dtype(v.dtype).itemsize * count * int(np.prod(v.shape)) for v in definition.kept())
        if size > MOST_BYTES:
            raise SweepError(
                f"sweep: the results of {count:,} candidates need {size / 1e9:.1f} GB of memory; give store= with a "
                "folder for the results, or keep fewer values per candidate"
            )
        self.block = block or definition.block_size()
        self.finished = np.zeros(-(-count // self.block), dtype=np.bool_)
        self._arrays = {v.name: np.empty((count, *v.shape), v.dtype) for v in definition.kept()}

    def write(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Keep the results of a block."""
        for name, values in arrays.items():
            self._arrays[name][number * self.block :][: len(values)] = values

    def dataset(self) -> xr.Dataset:
        """Return the results."""
        import xarray as xr

        kept = self._definition.kept()
        variables = {v.name: (_dimensions(v), self._arrays[v.name], _attributes(v)) for v in kept}
        results = xr.Dataset(variables, _axes(self._definition), _description(self._definition))
        return results.set_coords(self._definition.candidates.addresses)


class Store:
    """Results in a Zarr store, which is created or, if it holds the same sweep, completed; attributes as `Memory`.

    Two runs of the same sweep may write to one store: they write the same, and Zarr replaces a chunk as a whole.
    """

    def __init__(self, path: str | os.PathLike[str], definition: Definition, block: int | None) -> None:
        import zarr

        self._path, self._candidates = Path(path), definition.candidates
        if not self._path.exists():
            _create(self._path, definition, block or definition.block_size())
        self.block = _same_block(self._path, definition, block)
        # Zarr leaves out chunks of fill values otherwise, and these are not distinguished from lost ones.
        with _reading(path), zarr.config.set({"array.write_empty_chunks": True}):
            group: Any = zarr.open_group(path, mode="r+")
            self._arrays = {variable.name: group[variable.name] for variable in definition.kept()}
            self._checksums = group[_CHECKSUM]
            axes = _opened(path).coords
            for name, values in _axes(definition).items():
                if not np.array_equal(axes[name].values, values):
                    raise SweepError(f"{path}: {name} is damaged or missing; remove the store and run the sweep again")
        self.finished = self._whole_blocks()

    def _rows(self, number: int) -> slice:
        return slice(number * self.block, min((number + 1) * self.block, self._candidates.count))

    def _whole_blocks(self) -> NDArray[np.bool_]:
        """Return the mask of finished blocks; blocks with a damaged or missing chunk do not count."""
        finished = np.zeros(-(-self._candidates.count // self.block), dtype=np.bool_)
        damaged = []
        for number in range(finished.size):
            try:
                checksum = int(self._checksums[number])
                arrays = {} if checksum == _ABSENT else self._read(number)
                whole = checksum in (_ABSENT, _checksum(number, arrays))
            except (ValueError, TypeError, IndexError, RuntimeError):  # Zarr, of a chunk that it cannot decode
                whole = False
            if not whole:
                damaged.append(self._rows(number))
            elif arrays:
                if not finished.any():
                    self._check_candidates(self._rows(number), arrays)
                finished[number] = True
        if damaged:
            more = f", and {len(damaged) - 1:,} more blocks" if len(damaged) > 1 else ""
            repeated = sum(rows.stop - rows.start for rows in damaged)
            warn_user(
                f"{self._path}: candidates {damaged[0].start} to {damaged[0].stop - 1} are damaged: the checksum does "
                f"not agree with the content{more}; {repeated:,} candidates are evaluated again"
            )
        return finished

    def _read(self, number: int) -> dict[str, NDArray[Any]]:
        return {name: np.asarray(array[self._rows(number)]) for name, array in self._arrays.items()}

    def _check_candidates(self, rows: slice, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Raise if the store has other candidates although their description is the same."""
        for address, values in zip(
            self._candidates.addresses, self._candidates.values(rows.start, rows.stop).T, strict=True
        ):
            stored = arrays[address]
            other = np.flatnonzero(~np.isclose(stored, values, rtol=_SAME, atol=0.0, equal_nan=True))
            if other.size:
                i = int(other[0])
                raise SweepError(
                    f"{self._path} holds a different sweep: its candidate {rows.start + i} has {address} = "
                    f"{stored[i]:.12g}, not {values[i]:.12g} (another distribution, or another version of SciPy); "
                    "give another store or remove it"
                )

    def write(self, number: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write the results of a block."""
        kept = {name: np.asarray(arrays[name], array.dtype) for name, array in self._arrays.items()}
        try:
            for name, values in kept.items():
                self._arrays[name][self._rows(number)] = values
            self._checksums[number] = _checksum(number, kept)
        except OSError as error:  # such as that of a full disk, which names no file
            raise OSError(error.errno, error.strerror, str(self._path)) from error

    def dataset(self) -> xr.Dataset:
        """Return the results, loaded lazily."""
        return open_sweep(self._path)


def _checksum(number: int, arrays: Mapping[str, NDArray[Any]]) -> int:
    """Return a checksum of the values of a block and of its number."""
    checksum = number
    for values in arrays.values():
        checksum = zlib.crc32(values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes(), checksum)
    return checksum


def _create(path: Path, definition: Definition, block: int) -> None:
    """Create the empty store under a temporary name and rename it, so that it is complete or absent."""
    import xarray as xr
    import zarr
    from zarr.codecs import Crc32cCodec

    target = Path(os.path.realpath(path))
    for folder in (path.parent, target.parent):
        if not folder.is_dir():
            raise SweepError(f"sweep: cannot make the store {path}: there is no folder {folder}")
    count = definition.candidates.count
    # Fixed-length text has no specification in Zarr's third format.
    axes = {name: v.astype(object) if v.dtype.kind == "U" else v for name, v in _axes(definition).items()}
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as beside:
        temporary = Path(beside, "store")
        xr.Dataset(coords=axes).to_zarr(temporary, zarr_format=3, consolidated=False)
        group = zarr.open_group(temporary, mode="r+")
        for variable in definition.kept():
            group.create_array(
                variable.name,
                shape=(count, *variable.shape),
                chunks=(min(block, count), *variable.shape),
                dtype=variable.dtype,
                fill_value=np.nan if np.dtype(variable.dtype).kind in "fc" else None,
                compressors=Crc32cCodec(),
                dimension_names=_dimensions(variable),
                attributes=_attributes(variable),
            )
        blocks = -(-count // block)
        group.create_array(
            _CHECKSUM,
            shape=(blocks,),
            chunks=(1,),
            dtype="int64",
            fill_value=_ABSENT,
            compressors=Crc32cCodec(),
            dimension_names=("block",),
        )
        identity = {"fingerprints": definition.fingerprints(), "code": definition.code()}
        group.attrs.update({**_description(definition), _RECORD: {"format": _FORMAT, "block": block, **identity}})
        try:
            temporary.rename(target)
        except OSError:
            if not target.exists():  # another run has created it
                raise


def _axes(definition: Definition) -> dict[str, NDArray[Any]]:
    """Return the coordinates of all dimensions besides `candidate`."""
    return {name: values for variable in definition.variables() for name, values in variable.dimensions.items()}


def _dimensions(variable: Variable) -> tuple[str, ...]:
    return (CANDIDATE, *variable.dimensions)


def _attributes(variable: Variable) -> dict[str, Any]:
    return {"units": variable.unit, "long_name": variable.meaning} if variable.meaning else {}


def _description(definition: Definition) -> dict[str, str]:
    """Return the attributes of the results."""
    described = definition.candidates.describe()
    grid = {name: len(values) for name, values in described["values"].items()} if described["kind"] == "grid" else None
    return {
        "receptance": version("receptance"),
        "addresses": json.dumps(list(definition.candidates.addresses)),
        "candidates": json.dumps({key: value for key, value in described.items() if key != "values"}),
        "grid": json.dumps(grid),
    }


def open_sweep(path: str | os.PathLike[str]) -> xr.Dataset:
    """Return the results of a sweep in a store, loaded lazily.

    Parameters
    ----------
    path : path
        The store.

    Returns
    -------
    xarray.Dataset
        As `sweep` returns it. Missing candidates of an unfinished run are NaN and not `valid`, and a
        `ReceptanceWarning` states their number.

    Raises
    ------
    SweepError
        The path holds no sweep, or chunks of it are missing. A damaged chunk raises a ValueError of Zarr when it is
        read; `sweep` with the same store repairs both.
    """
    require("sweep", "open_sweep")
    import xarray as xr
    import zarr

    if not Path(path).is_dir():
        raise SweepError(f"there is no sweep at {path}")
    block = _record(path)["block"]
    with _reading(path):
        results = _opened(path)
        finished = results[_CHECKSUM].values != _ABSENT
        written = np.repeat(finished, block)[: results.sizes[CANDIDATE]]
        for name, array in zarr.open_group(path, mode="r").arrays():
            blocks = finished.sum() if CANDIDATE in results[name].dims else array.nchunks
            if name != _CHECKSUM and array.nchunks_initialized > blocks:
                # A run that was killed leaves a block of which not all outputs are written.
                done = xr.DataArray(written, dims=CANDIDATE)
                results[name] = results[name] & done if results[name].dtype == bool else results[name].where(done)
            if name != _CHECKSUM and array.nchunks_initialized < blocks:
                raise SweepError(
                    f"{path}: chunks of {name} are missing; run the same sweep with this store again to evaluate them"
                )
    count = results.sizes[CANDIDATE]
    missing = sum(min(block, count - number * block) for number in np.flatnonzero(~finished).tolist())
    if missing:
        warn_user(
            f"{path}: {missing:,} of {count:,} candidates are missing: the sweep was not finished; run it again with "
            "the same store to complete it"
        )
    addresses = json.loads(results.attrs["addresses"])
    del results.attrs[_RECORD]
    return results.drop_vars(_CHECKSUM).set_coords(addresses)


def as_grid(results: xr.Dataset) -> xr.Dataset:
    """Return the results of a `Grid` with one dimension per parameter instead of `candidate`.

    Raises
    ------
    SweepError
        The candidates are not a grid.
    """
    require("sweep", "as_grid")
    import xarray as xr

    sizes = json.loads(results.attrs.get("grid", "null"))
    if not sizes:
        raise SweepError("as_grid: the candidates are not a grid; sweep over a Grid")
    shape, names = tuple(sizes.values()), tuple(sizes)
    # Along the axis of a parameter the others are constant.
    axes = {}
    for i, name in enumerate(names):
        axes[name] = np.moveaxis(results[name].values.reshape(shape), i, -1).reshape(-1, shape[i])[0]
    variables = {}
    for name, variable in results.data_vars.items():
        values = variable.values.reshape(*shape, *variable.shape[1:])
        variables[name] = xr.DataArray(values, dims=(*names, *variable.dims[1:]), attrs=variable.attrs)
    others = {str(name): c for name, c in results.coords.items() if CANDIDATE not in c.dims}
    return xr.Dataset(variables, coords={**axes, **others}, attrs=results.attrs)


def _opened(path: str | os.PathLike[str]) -> xr.Dataset:
    """Return all variables of a store, loaded lazily."""
    import xarray as xr

    results: xr.Dataset = xr.open_zarr(path, consolidated=False, chunks=None)
    return results


@contextlib.contextmanager
def _reading(path: str | os.PathLike[str]) -> Iterator[None]:
    """Add the path of the store to errors of reading it."""
    from zarr.errors import GroupNotFoundError

    try:
        yield
    except SweepError:
        raise
    except (GroupNotFoundError, NotADirectoryError):
        raise SweepError(f"{path} holds no sweep; {_EXPECTED}") from None
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SweepError(
            f"{path} is damaged: {error}; run the same sweep with this store again, or remove it"
        ) from error


def _record(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return what identifies the sweep of a store."""
    import zarr

    with _reading(path):
        attributes = dict(zarr.open_group(path, mode="r").attrs)
    record = attributes.get(_RECORD)
    if not isinstance(record, dict):
        raise SweepError(f"{path} holds no sweep; {_EXPECTED}")
    if record.get("format") != _FORMAT:
        raise SweepError(
            f"{path} has an unsupported format of sweeps: it has format {record.get('format')}, expected "
            f"{_FORMAT}; give another store or remove it"
        )
    return {**record, "receptance": attributes["receptance"]}


def _same_block(path: Path, definition: Definition, block: int | None) -> int:
    """Return the block size of a store after checking that it holds this sweep."""
    record, fingerprints = _record(path), definition.fingerprints()
    if record["receptance"] != version("receptance"):
        raise SweepError(
            f"{path} was started with receptance {record['receptance']}, and this is {version('receptance')}, whose "
            "results may differ; continue with that version, or give another store (`open_sweep` reads any version)"
        )
    stored = record["fingerprints"]
    if stored != fingerprints:
        other = [name for name in {**stored, **fingerprints} if stored.get(name) != fingerprints.get(name)]
        before, now = record["code"], definition.code()
        for i, name in enumerate(other):
            if before.get(name) != now.get(name):
                other[i] += (
                    f" (by {before.get(name, 'the program')} in the store, by {now.get(name, 'the program')} now)"
                )
        raise SweepError(
            f"{path} holds a different sweep: it differs in {', '.join(other)}; give another store or remove it"
        )
    if block is not None and block != record["block"]:
        raise SweepError(f"{path} was started with blocks of {record['block']} candidates, not {block}; omit block")
    return int(record["block"])
