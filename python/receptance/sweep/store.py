"""Where the results of a sweep go: into memory, or block by block into a Zarr store that outlives the run."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import shutil
import warnings
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from receptance.errors import ReceptanceWarning
from receptance.sweep.chunks import Chunks
from receptance.sweep.definition import CANDIDATE, VALID, Definition
from receptance.sweep.disk import Lock, SweepError, flush

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from receptance.sweep.outputs import Variable

__all__ = ["Memory", "Store", "Target", "as_grid", "open_sweep"]

_RECORD = "receptance_sweep"
_FINISHED = "_finished"
_FORMAT = 1
_MOST_BYTES = 2 * 2**30


class Target(Protocol):
    """Where blocks go."""

    block: int
    """Candidates of a block."""
    finished: NDArray[np.bool_]
    """Which blocks are there already."""

    def write(self, number: int, arrays: dict[str, NDArray[Any]]) -> None:
        """Take the results of a block."""

    def close(self) -> None:
        """Make sure that all that was taken is kept."""

    def dataset(self) -> xr.Dataset:
        """Return what is kept."""


class Memory:
    """Results in memory."""

    def __init__(self, definition: Definition, block: int | None) -> None:
        self._layout = layout(definition)
        self._definition = definition
        count = definition.candidates.count
        size = sum(np.dtype(dtype).itemsize * count * int(np.prod(shape)) for dtype, shape in self._layout.values())
        if size > _MOST_BYTES:
            raise SweepError(
                f"sweep: the results of {count:,} candidates take {size / 1e9:.1f} GB; give store= for a folder that "
                "they are written to, or keep less of each"
            )
        self.block = block or definition.block_size()
        self.finished = np.zeros(-(-count // self.block), dtype=np.bool_)
        self._arrays = {name: np.empty((count, *shape), dtype) for name, (dtype, shape) in self._layout.items()}

    def write(self, number: int, arrays: dict[str, NDArray[Any]]) -> None:
        """Take the results of a block."""
        first = number * self.block
        for name, values in arrays.items():
            self._arrays[name][first : first + len(values)] = values
        self.finished[number] = True

    def close(self) -> None:
        """There is nothing to close."""

    def dataset(self) -> xr.Dataset:
        """Return what is kept."""
        import xarray as xr

        variables = {v.name: v for v in self._definition.variables()}
        found = xr.Dataset()
        for name, values in self._arrays.items():
            dims = (CANDIDATE, *(variables[name].dimensions if name in variables else ()))
            found[name] = xr.DataArray(values, dims=dims, attrs=_attributes(variables.get(name)))
            if name in variables:
                found = found.assign_coords(dict(variables[name].dimensions))
        return _labelled(found, record(self._definition, self.block))


class Store:
    """Results in a Zarr store, made if it is not there, else gone on with."""

    def __init__(self, path: str | os.PathLike[str], definition: Definition, block: int | None) -> None:
        self._definition = definition
        self._path = Path(path)
        self._lock = Lock(self._path)
        try:
            if not self._path.exists():
                _create(self._path, definition, block or definition.block_size())
            self._group = _opened(self._path, "r+")
            self.block = _checked(self._path, self._group, definition, block)
        except BaseException:
            self._lock.close()
            raise
        self.finished = np.asarray(self._group[_FINISHED][:], dtype=np.bool_)
        rows = min(self.block, definition.candidates.count)
        self._chunks = Chunks(self._path, layout(definition), rows, self._finish)

    def write(self, number: int, arrays: dict[str, NDArray[Any]]) -> None:
        """Take the results of a block; every few seconds what was taken is made sure of."""
        self._chunks.write(number, arrays)

    def _finish(self, numbers: list[int]) -> None:
        self.finished[numbers] = True
        self._group[_FINISHED][:] = self.finished
        flush([self._path / _FINISHED / "c" / "0"], self._path / _FINISHED)

    def close(self) -> None:
        """Make sure that all that was taken is kept, and let others write."""
        try:
            self._chunks.close()
        finally:
            self._lock.close()

    def dataset(self) -> xr.Dataset:
        """Return what is kept, read when it is asked for."""
        return open_sweep(self._path)


def layout(definition: Definition) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Return dtype and shape of one candidate for everything that is kept."""
    found: dict[str, tuple[str, tuple[int, ...]]] = dict.fromkeys(definition.candidates.addresses, ("float64", ()))
    found |= {v.name: (v.dtype, v.shape) for v in definition.variables()}
    found[VALID] = ("bool", ())
    return found


def record(definition: Definition, block: int) -> dict[str, Any]:
    """Return what is written down of a sweep."""
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
        # Text is no array of Zarr's yet.
        "labels": {
            name: values.tolist()
            for variable in definition.variables()
            for name, values in variable.dimensions.items()
            if values.dtype.kind not in "iuf"
        },
        "fingerprints": definition.fingerprints(),
    }


def open_sweep(path: str | os.PathLike[str]) -> xr.Dataset:
    """Return the results of a sweep that were written to a store; they are read when they are asked for.

    Parameters
    ----------
    path : path
        The store.

    Returns
    -------
    xarray.Dataset
        As `sweep` returns it. Of a run that has not come to its end, candidates that are missing are NaN and not
        `valid`, and a `ReceptanceWarning` says how many.

    Raises
    ------
    SweepError
        There is no sweep.
    """
    import xarray as xr

    if not Path(path).is_dir():
        raise SweepError(f"there is no sweep at {path}")
    said = _said(Path(path), _opened(Path(path), "r"))
    found = xr.open_zarr(Path(path), consolidated=False, chunks=None)
    finished = found[_FINISHED].values.astype(bool)
    if not finished.all():
        missing = _candidates_of(np.flatnonzero(~finished), said["block"], said["count"])
        warnings.warn(
            f"{path}: {missing:,} of {said['count']:,} candidates are missing: the sweep did not come to its end; "
            "run it again with the same store to go on",
            ReceptanceWarning,
            stacklevel=2,
        )
    return _labelled(found.drop_vars(_FINISHED), said)


def as_grid(results: xr.Dataset) -> xr.Dataset:
    """Return the results of a `Grid` with one dimension for each parameter, in the place of `candidate`.

    Raises
    ------
    SweepError
        The candidates are no grid.
    """
    import xarray as xr

    sizes = json.loads(results.attrs.get("grid", "null"))
    if not sizes:
        raise SweepError("as_grid: these candidates are no grid")
    shape, names = tuple(sizes.values()), tuple(sizes)
    # A parameter goes through its values while those before it stay.
    axes = {}
    for i, name in enumerate(names):
        axes[name] = np.moveaxis(results[name].values.reshape(shape), i, -1).reshape(-1, shape[i])[0]
    kept = {}
    for name, variable in results.data_vars.items():
        values = variable.values.reshape(*shape, *variable.shape[1:])
        kept[name] = xr.DataArray(values, dims=(*names, *variable.dims[1:]), attrs=variable.attrs)
    others = {str(name): c for name, c in results.coords.items() if CANDIDATE not in c.dims}
    return xr.Dataset(kept, coords={**axes, **others}, attrs=results.attrs)


def _labelled(found: xr.Dataset, said: dict[str, Any]) -> xr.Dataset:
    found = found.set_coords(said["addresses"]).assign_coords(said["labels"])
    attributes = {
        "receptance": said["receptance"],
        "addresses": json.dumps(said["addresses"]),
        "candidates": json.dumps(said["candidates"]),
        "grid": json.dumps(said["grid"]),
    }
    return (
        found.assign_attrs(attributes)
        if _RECORD not in found.attrs
        else found.drop_attrs(deep=False).assign_attrs(attributes)
    )


def _attributes(variable: Variable | None) -> dict[str, Any]:
    return {} if variable is None else {"units": variable.unit, "long_name": variable.meaning}


def _candidates_of(blocks: NDArray[np.int64], block: int, count: int) -> int:
    return int(sum(min(block, count - number * block) for number in blocks))


def _create(path: Path, definition: Definition, block: int) -> None:
    """Make the empty store under another name, then rename it: there is never half of one."""
    import zarr

    if not path.parent.is_dir():
        raise SweepError(f"sweep: cannot make the store {path}: there is no folder {path.parent}")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    count = definition.candidates.count
    blocks = -(-count // block)
    variables = {v.name: v for v in definition.variables()}
    try:
        group = zarr.open_group(temporary, mode="w")
        for name, (dtype, shape) in layout(definition).items():
            own = variables.get(name)
            group.create_array(
                name,
                shape=(count, *shape),
                chunks=(min(block, count), *shape),
                dtype=dtype,
                # What was never written is no number.
                fill_value={"float64": np.nan, "complex128": complex(np.nan, np.nan), "bool": False}[dtype],
                compressors=None,
                dimension_names=(CANDIDATE, *(own.dimensions if own else ())),
                attributes=_attributes(own),
            )
        for variable in variables.values():
            for name, values in variable.dimensions.items():
                if name not in group and values.dtype.kind in "iuf":
                    group.create_array(name, data=values, dimension_names=(name,), compressors=None)
        group.create_array(_FINISHED, data=np.zeros(blocks, np.uint8), chunks=(blocks,), dimension_names=("block",))
        group.attrs[_RECORD] = record(definition, block)
        os.replace(temporary, path)
    finally:
        if temporary.exists():
            shutil.rmtree(temporary, ignore_errors=True)


def _opened(path: Path, mode: Literal["r", "r+"]) -> Any:
    import zarr
    from zarr.errors import GroupNotFoundError

    try:
        return zarr.open_group(path, mode=mode)
    except (GroupNotFoundError, NotADirectoryError):
        raise SweepError(f"{path} holds no sweep") from None


def _said(path: Path, group: Any) -> dict[str, Any]:
    said = dict(group.attrs).get(_RECORD)
    if not isinstance(said, dict) or said.get("format") != _FORMAT:
        raise SweepError(f"{path} holds no sweep of this version of the program")
    return said


def _checked(path: Path, group: Any, definition: Definition, block: int | None) -> int:
    """Return the size of a block of a store that holds this very sweep."""
    said, own = _said(path, group), definition.fingerprints()
    if said["fingerprints"] != own:
        other = [name for name in {**said["fingerprints"], **own} if said["fingerprints"].get(name) != own.get(name)]
        raise SweepError(
            f"{path} holds another sweep: it differs in {', '.join(other)}; give another store or remove it"
        )
    if block is not None and block != said["block"]:
        raise SweepError(f"{path} was begun with blocks of {said['block']} candidates, not {block}; leave block out")
    return int(said["block"])


@contextlib.contextmanager
def target(path: str | os.PathLike[str] | None, definition: Definition, block: int | None) -> Iterator[Memory | Store]:
    """Open where results go; what was taken is kept however it ends."""
    found = Memory(definition, block) if path is None else Store(path, definition, block)
    try:
        yield found
    finally:
        found.close()
