"""Results of a sweep: in memory, or in a Zarr store that is written block by block."""

from __future__ import annotations

import contextlib
import json
import os
import warnings
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from receptance._extras import require
from receptance.errors import warn_user
from receptance.sweep.candidates import MOST_BYTES
from receptance.sweep.definition import CANDIDATE, VALID, Definition
from receptance.sweep.disk import Chunks, Lock, SweepError, flush, renamed

if TYPE_CHECKING:
    import xarray as xr

    from receptance.sweep.outputs import Variable

_RECORD = "receptance_sweep"
_FORMAT = 3
_SAME = 1e-9
"""Relative difference up to which candidates are equal; processors may differ in the last bits."""
_EXPECTED = "expected a store written by a sweep, or a new name"


class Memory:
    """Results in memory, in blocks of `block` candidates; `finished` is the mask of finished blocks."""

    def __init__(self, definition: Definition, block: int | None) -> None:
        self._layout = _layout(definition)
        self._definition = definition
        count = definition.candidates.count
        size = sum(np.dtype(dtype).itemsize * count * int(np.prod(shape)) for dtype, shape in self._layout.values())
        if size > MOST_BYTES:
            raise SweepError(
                f"sweep: the results of {count:,} candidates need {size / 1e9:.1f} GB of memory; give store= with a "
                "folder for the results, or keep fewer values per candidate"
            )
        self.block = block or definition.block_size()
        self.finished = np.zeros(-(-count // self.block), dtype=np.bool_)
        self._arrays = {name: np.empty((count, *shape), dtype) for name, (dtype, shape) in self._layout.items()}

    def write(self, number: int, arrays: dict[str, NDArray[Any]]) -> None:
        """Store the results of a block."""
        first = number * self.block
        for name, values in arrays.items():
            self._arrays[name][first : first + len(values)] = values
        self.finished[number] = True

    def close(self) -> None:
        """No operation for results in memory."""

    def dataset(self) -> xr.Dataset:
        """Return the results."""
        import xarray as xr

        variables = {v.name: v for v in self._definition.variables()}
        results = xr.Dataset()
        for name, values in self._arrays.items():
            dims = (CANDIDATE, *(variables[name].dimensions if name in variables else ()))
            results[name] = xr.DataArray(values, dims=dims, attrs=_attributes(variables.get(name)))
            if name in variables:
                results = results.assign_coords(dict(variables[name].dimensions))
        return _labelled(results, _record(self._definition, self.block))


class Store:
    """Results in a Zarr store, which is created or, if it holds the same sweep, completed; attributes as `Memory`."""

    def __init__(self, path: str | os.PathLike[str], definition: Definition, block: int | None) -> None:
        self._definition = definition
        self._named = Path(path)
        # Links to the folder share its lock and its files.
        self._path = Path(os.path.realpath(path))
        self._lock = Lock(self._path)
        try:
            if not self._path.exists():
                for folder in (self._named.parent, self._path.parent):
                    if not folder.is_dir():
                        raise SweepError(f"sweep: cannot make the store {self._named}: there is no folder {folder}")
                _create(self._path, definition, block or definition.block_size())
            self.block = _checked(self._named, definition, block)
            rows = min(self.block, definition.candidates.count)
            self._chunks = Chunks(self._path, _layout(definition), rows)
            self.finished = self._sound_blocks()
        except BaseException:
            self._lock.close()
            raise

    def _sound_blocks(self) -> NDArray[np.bool_]:
        """Return the mask of finished blocks; blocks with a damaged or missing chunk do not count."""
        count = self._definition.candidates.count
        faults = [self._chunks.check(number) for number in range(-(-count // self.block))]
        damaged = [text for texts in faults for text in texts or ()]
        if damaged:
            more = f", and {len(damaged) - 1:,} more" if len(damaged) > 1 else ""
            repeated = _count_in(np.array([i for i, texts in enumerate(faults) if texts]), self.block, count)
            warn_user(f"{self._named}: the chunk {damaged[0]}{more}; {repeated:,} candidates are evaluated again")
        finished = np.array([texts == [] for texts in faults], dtype=np.bool_)
        for number in set(np.flatnonzero(finished)[[0, -1]].tolist() if finished.any() else ()):
            self._check_candidates(number)
        return finished

    def _check_candidates(self, number: int) -> None:
        """Raise if the store has other candidates although their description is the same."""
        first, candidates = number * self.block, self._definition.candidates
        values = candidates.values(first, min(first + self.block, candidates.count))
        for address, expected in zip(candidates.addresses, values.T, strict=True):
            stored = self._chunks.read(address, number)[: len(expected)]
            other = np.flatnonzero(~np.isclose(stored, expected, rtol=_SAME, atol=0.0, equal_nan=True))
            if other.size:
                i = int(other[0])
                raise SweepError(
                    f"{self._named} holds a different sweep: its candidate {first + i} has {address} = "
                    f"{stored[i]:.12g}, not {expected[i]:.12g} (another distribution, or another version of SciPy); "
                    "give another store or remove it"
                )

    def write(self, number: int, arrays: dict[str, NDArray[Any]]) -> None:
        """Store the results of a block; they are flushed to the disk every second."""
        self._chunks.write(number, arrays)

    def close(self) -> None:
        """Complete all writes and release the lock."""
        try:
            self._chunks.close()
        finally:
            self._lock.close()

    def dataset(self) -> xr.Dataset:
        """Return the results, loaded lazily."""
        return open_sweep(self._named)


def _layout(definition: Definition) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Return data type and shape of one candidate for all variables of the store."""
    layout: dict[str, tuple[str, tuple[int, ...]]] = dict.fromkeys(definition.candidates.addresses, ("float64", ()))
    layout |= {v.name: (v.dtype, v.shape) for v in definition.variables()}
    layout[VALID] = ("bool", ())
    return layout


def _record(definition: Definition, block: int) -> dict[str, Any]:
    """Return the metadata of a store."""
    described = definition.candidates.describe()
    grid = {name: len(values) for name, values in described["values"].items()} if described["kind"] == "grid" else None
    return {
        "format": _FORMAT,
        "receptance": version("receptance"),
        "count": definition.candidates.count,
        "block": block,
        "addresses": list(definition.candidates.addresses),
        "candidates": {k: v for k, v in described.items() if k != "values"},
        "grid": grid,
        # The Zarr format has no specification of text arrays yet.
        "labels": {
            name: values.tolist()
            for variable in definition.variables()
            for name, values in variable.dimensions.items()
            if values.dtype.kind not in "iuf"
        },
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
        The path holds no sweep. A damaged or missing chunk raises the error when it is read; the message names the
        store and the chunk.
    """
    require("sweep", "open_sweep")
    import xarray as xr

    if not Path(path).is_dir():
        raise SweepError(f"there is no sweep at {path}")
    metadata = _metadata(Path(path))
    count, size = metadata["count"], metadata["block"]
    finished = {file.name for file in Path(path, VALID, "c").glob("*")}
    unfinished = np.array([i for i in range(-(-count // size)) if str(i) not in finished], dtype=np.int64)
    with _reading(path):
        results = xr.open_zarr(_checked_store(Path(path), metadata), consolidated=True, chunks=None)
    if unfinished.size:
        missing = _count_in(unfinished, size, count)
        warn_user(
            f"{path}: {missing:,} of {count:,} candidates are missing: the sweep was not finished; run it again with "
            "the same store to complete it"
        )
    return _labelled(results, metadata)


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


def _labelled(results: xr.Dataset, metadata: dict[str, Any]) -> xr.Dataset:
    """Return results with the parameters as coordinates and the metadata of the sweep as attributes."""
    results = results.set_coords(metadata["addresses"]).assign_coords(metadata["labels"])
    attributes = {
        "receptance": metadata["receptance"],
        "addresses": json.dumps(metadata["addresses"]),
        "candidates": json.dumps(metadata["candidates"]),
        "grid": json.dumps(metadata["grid"]),
    }
    return results.drop_attrs(deep=False).assign_attrs(attributes)


def _attributes(variable: Variable | None) -> dict[str, Any]:
    return {} if variable is None else {"units": variable.unit, "long_name": variable.meaning}


def _count_in(blocks: NDArray[np.int64], block: int, count: int) -> int:
    return int(sum(min(block, count - number * block) for number in blocks))


def _create(path: Path, definition: Definition, block: int) -> None:
    """Create the empty store under a temporary name and rename it, so that it is complete or absent."""
    import zarr
    from zarr.codecs import Crc32cCodec

    identity = {"fingerprints": definition.fingerprints(), "code": definition.code()}
    count = definition.candidates.count
    variables = {v.name: v for v in definition.variables()}
    with renamed(path) as temporary:
        group = zarr.open_group(temporary, mode="w")
        for name, (dtype, shape) in _layout(definition).items():
            variable = variables.get(name)
            group.create_array(
                name,
                shape=(count, *shape),
                chunks=(min(block, count), *shape),
                dtype=dtype,
                # Values that were not written are NaN.
                fill_value={"float64": np.nan, "complex128": complex(np.nan, np.nan), "bool": False}[dtype],
                compressors=Crc32cCodec(),
                dimension_names=(CANDIDATE, *(variable.dimensions if variable else ())),
                attributes=_attributes(variable),
            )
        for variable in variables.values():
            for name, values in variable.dimensions.items():
                if name not in group and values.dtype.kind in "iuf":
                    group.create_array(
                        name,
                        data=values,
                        chunks=values.shape,
                        dimension_names=(name,),
                        compressors=Crc32cCodec(),
                        # Otherwise a missing chunk would mean zeros.
                        config={"write_empty_chunks": True},
                    )
        blocked = list(_layout(definition))
        group.attrs[_RECORD] = {**_record(definition, block), "blocked": blocked, **identity}
        with warnings.catch_warnings():
            # Zarr warns that consolidated metadata are not in the specification; other readers ignore them.
            warnings.simplefilter("ignore")
            zarr.consolidate_metadata(temporary)
        flush([file for file in temporary.rglob("*") if file.is_file()], temporary)
    flush([], path.parent)


@contextlib.contextmanager
def _reading(path: str | os.PathLike[str]) -> Iterator[None]:
    """Add the path of the store to errors of reading it."""
    from zarr.errors import GroupNotFoundError

    try:
        yield
    except (GroupNotFoundError, NotADirectoryError):
        raise SweepError(f"{path} holds no sweep; {_EXPECTED}") from None
    except SweepError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise SweepError(
            f"{path}: the description of the sweep ({path}/zarr.json) is damaged: {error}; remove the store and run "
            "the sweep again"
        ) from error


def _checked_store(path: Path, metadata: dict[str, Any]) -> Any:
    from receptance.sweep.reading import CheckedStore

    return CheckedStore(path, last=VALID, blocked=tuple(metadata["blocked"]))


def _metadata(path: Path) -> dict[str, Any]:
    """Return the metadata of a store."""
    import zarr

    with _reading(path):
        metadata = dict(zarr.open_group(path, mode="r").attrs).get(_RECORD)
    if not isinstance(metadata, dict):
        raise SweepError(f"{path} holds no sweep; {_EXPECTED}")
    if metadata.get("format") != _FORMAT:
        raise SweepError(
            f"{path} has an unsupported format of sweeps: it has format {metadata.get('format')}, expected "
            f"{_FORMAT}; give another store or remove it"
        )
    return metadata


def _checked(path: Path, definition: Definition, block: int | None) -> int:
    """Return the block size of a store after checking that it holds this sweep."""
    import zarr

    metadata, fingerprints = _metadata(path), definition.fingerprints()
    if metadata["receptance"] != version("receptance"):
        raise SweepError(
            f"{path} was started with receptance {metadata['receptance']}, and this is {version('receptance')}, whose "
            "results may differ; continue with that version, or give another store (`open_sweep` reads any version)"
        )
    stored = metadata["fingerprints"]
    if stored != fingerprints:
        other = [name for name in {**stored, **fingerprints} if stored.get(name) != fingerprints.get(name)]
        before, now = metadata["code"], definition.code()
        for i, name in enumerate(other):
            if before.get(name) != now.get(name):
                other[i] += (
                    f" (by {before.get(name, 'the program')} in the store, by {now.get(name, 'the program')} now)"
                )
        raise SweepError(
            f"{path} holds a different sweep: it differs in {', '.join(other)}; give another store or remove it"
        )
    if block is not None and block != metadata["block"]:
        raise SweepError(f"{path} was started with blocks of {metadata['block']} candidates, not {block}; omit block")
    with _reading(path):
        group = zarr.open_group(_checked_store(path, metadata), mode="r")
        axes = {name for variable in definition.variables() for name in variable.dimensions}
        for name, array in group.arrays():
            if name in axes:
                array[:]  # raises an error for a damaged chunk
    return int(metadata["block"])
