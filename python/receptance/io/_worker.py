"""Script that reads MAT and HDF5 files for `mat_hdf5.py` in a separate process, without importing receptance.

Requests and answers are pickles on standard input and output. A request is {"kind", "path", "names", "size", "largest",
"seconds", "bytes_per_second"}. An answer is the text of an error, or three mappings by name: arrays, texts of
measurements of this library, and shape and type of all variables.
"""

from __future__ import annotations

import itertools
import pickle
import re
import signal
import sys
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

_MEASUREMENT_NAME = re.compile(r"(?:frf|time|coherence)[0-9]+")
"""Names of measurements written by this library."""
_MAX_DEPTH, _MAX_DATA_SETS, _MAX_ELEMENTS = 5, 10_000, 1000
"""Limits of nesting, of data sets in a file, and of elements of an array of structs."""
_MAX_REFERENCES = 1_000_000
"""Most cells of an array; more are not followed."""
_MEMORY = 4 << 30
"""Bytes of memory allowed beside eight times the size of the file."""
_EXTERNAL = "in another file, which is not read"


class _RefusedError(Exception):
    """A file that is not read, with the reason."""


def _is_requested(name: str, names: list[str] | None) -> bool:
    """Return whether a variable is loaded: the names in the request, or without these the variables of this library."""
    return bool(_MEASUREMENT_NAME.fullmatch(re.split(r"[./]", name)[0])) if names is None else name in names


def _bases(names: list[str]) -> list[str]:
    """Return the top-level variables of the requested names."""
    return [re.split(r"[./[]", name)[0] for name in names]


def _mat(path: str, names: list[str] | None) -> Iterator[tuple[str, Any]]:
    import scipy.io

    try:
        try:
            variables: list[tuple[str, tuple[int, ...], str]] = list(scipy.io.whosmat(path))
        except TypeError:
            # whosmat fails on MATLAB objects such as strings and tables, which loadmat skips.
            loaded = scipy.io.loadmat(path, variable_names=None if names is None else _bases(names))
            variables = [
                (name, value.shape, "struct" if value.dtype.names else str(value.dtype))
                for name, value in loaded.items()
                if isinstance(value, np.ndarray) and not isinstance(value, scipy.io.matlab.MatlabOpaque)
            ]
        # Without a request, structs are loaded as well, to list their fields.
        structs = [name for name, _, kind in variables if kind == "struct"] if names is None else []
        bases = None if names is None else _bases(names)
        to_load = [name for name, _, _ in variables if name in structs or _is_requested(name, bases)]
        loaded = scipy.io.loadmat(path, variable_names=to_load, simplify_cells=True) if to_load else {}
    except NotImplementedError as error:
        raise _RefusedError(f"unsupported contents: {error}") from None
    for name, shape, kind in variables:
        if name in loaded:
            yield from _flatten(name, loaded[name], 0)
        else:
            yield name, f"{'x'.join(map(str, shape))} {kind}"


def _flatten(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict) and depth < _MAX_DEPTH:
        for key, inner in value.items():
            yield from _flatten(f"{name}.{key}", inner, depth + 1)
    elif (isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object)) and depth < _MAX_DEPTH:
        # Arrays of structs and cell arrays.
        for index, inner in enumerate(list(value)[:_MAX_ELEMENTS]):
            yield from _flatten(f"{name}[{index}]", inner, depth + 1)
    elif isinstance(value, (str, np.ndarray, np.generic, int, float, complex, bool)):
        yield name, value if isinstance(value, str) else np.asarray(value)


def _hdf5(request: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    import h5py  # type: ignore[import-untyped]

    with h5py.File(request["path"], "r") as file:
        data_sets = list(itertools.islice(_members(h5py, file, "", 0), _MAX_DATA_SETS + 1))
        if len(data_sets) > _MAX_DATA_SETS:
            raise _RefusedError(f"it holds more than {_MAX_DATA_SETS} data sets")
        requested = {
            name: item
            for name, item in data_sets
            # External storage and virtual data sets read other files, which is refused.
            if not _is_external(item) and item.shape is not None and _is_requested(name, request["names"])
        }
        # Declared sizes are checked before allocation: data sets without chunks may declare any size.
        total = sum(item.nbytes for item in requested.values())
        _check_size(total, request["largest"])
        _limit(request["seconds"] + total / request["bytes_per_second"])
        for name, item in data_sets:
            value = _value(item) if name in requested else None
            yield name, _describe(item) if value is None else value


def _is_external(item: Any) -> bool:
    return item.is_virtual or bool(item.external)


def _describe(item: Any) -> str:
    # The shape of a virtual data set may depend on other files.
    if _is_external(item):
        return _EXTERNAL
    return f"{'x'.join(map(str, item.shape or ())) or 'scalar'} {item.dtype}"


def _check_size(size: int, largest: int) -> None:
    if size > largest:
        raise _RefusedError(
            f"its arrays take more than {largest >> 20} MiB when expanded, the limit for one file; split the file"
        )


def _members(h5py: Any, group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    for name in group:
        # Soft links and links into other files are not followed.
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        yield from _contents(h5py, group[name], prefix + name, depth)


def _contents(h5py: Any, item: Any, name: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the data sets in an item: itself, those of a group, or those of the cells of MATLAB's version 7.3."""
    if isinstance(item, h5py.Group):
        # The contents of cells are in this group, and have the names of their cells.
        if depth < _MAX_DEPTH and name != "#refs#":
            yield from _members(h5py, item, f"{name}/", depth + 1)
    elif isinstance(item, h5py.Dataset):
        if h5py.check_ref_dtype(item.dtype) is not h5py.Reference or not _is_cell(item) or depth >= _MAX_DEPTH:
            yield name, item
            return
        cells = np.atleast_1d(np.asarray(item[()]).T.squeeze())
        for index in itertools.islice(np.ndindex(cells.shape), _MAX_ELEMENTS):
            if cells[index]:
                place = name + "".join(f"[{number}]" for number in index)
                yield from _contents(h5py, item.file[cells[index]], place, depth + 1)


def _is_cell(item: Any) -> bool:
    return not _is_external(item) and item.shape is not None and 0 < item.size <= _MAX_REFERENCES


def _value(item: Any) -> Any:
    """Return the numbers or the text of a data set, None for other types."""
    if item.dtype.kind == "O" and item.shape == ():
        text = item.asstr()[()] if item.dtype.metadata and item.dtype.metadata.get("vlen") in (str, bytes) else None
        return text if isinstance(text, str) else None
    if item.dtype.kind not in "biufc" and item.dtype.names != ("real", "imag"):
        return None
    array = item[()]
    if item.dtype.names is not None:
        array = array["real"] + 1j * array["imag"]
    # MATLAB stores arrays transposed.
    return np.ascontiguousarray(np.asarray(array).T if "MATLAB_class" in item.attrs else np.asarray(array))


def _answer(request: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str], dict[str, str]]:
    """Return the arrays, the texts and the list of variables of an answer."""
    arrays: dict[str, Any] = {}
    texts: dict[str, str] = {}
    listed: dict[str, str] = {}
    names = request["names"]
    for name, value in _mat(request["path"], names) if request["kind"] == "mat" else _hdf5(request):
        requested = _is_requested(name, names)
        if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
            if requested:
                arrays[name] = np.ascontiguousarray(value)
            listed[name] = f"{'x'.join(map(str, value.shape)) or 'scalar'} {value.dtype.name}"
        elif isinstance(value, str) and requested and names is None:
            texts[name] = value
        else:
            listed[name] = value[:60] if isinstance(value, str) else f"{value.size} {value.dtype}"
    _check_size(sum(array.nbytes for array in arrays.values()), request["largest"])
    return arrays, texts, listed


def _limit(seconds: float) -> None:
    """End this process after some processor time."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def _limit_memory(size: int) -> None:
    try:
        import resource
    except ImportError:
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = _MEMORY + 8 * size
    resource.setrlimit(resource.RLIMIT_AS, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))


def serve(incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Answer requests until the input ends."""
    while incoming.peek(1):  # type: ignore[attr-defined]
        request = pickle.load(incoming)
        if request["kind"] == "mat":
            import scipy.io  # noqa: F401 (before the time limit starts)
        elif request["kind"] == "hdf5":
            import h5py  # noqa: F401
        _limit_memory(request["size"])
        _limit(request["seconds"])
        answer: Any
        try:
            answer = _answer(request)
        except _RefusedError as error:
            answer = str(error)
        except MemoryError:
            answer = f"it takes more than {_MEMORY >> 20} MiB of memory, the limit"
        except Exception as error:
            answer = f"{type(error).__name__}: {error}"[:500]
        _limit(0.0)
        pickle.dump(answer, outgoing, protocol=5)
        outgoing.flush()


if __name__ == "__main__":
    serve(sys.stdin.buffer, sys.stdout.buffer)
