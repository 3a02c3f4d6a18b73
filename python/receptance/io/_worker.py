"""Reads MAT and HDF5 files for `isolated.py`, in a process that may die of them; run as a script, without receptance.

On standard input come lines of JSON, {"kind", "path", "names", "size", "largest", "seconds", "bytes_per_second"}; for
each goes out the length of a header (8 bytes), the header as JSON and the arrays one after the other.
"""

from __future__ import annotations

import json
import re
import signal
import struct
import sys
from collections.abc import Iterator
from typing import Any, BinaryIO

import numpy as np

OWN = re.compile(r"(?:frf|time|coherence)[0-9]+")
"""Names under which this library keeps measurements."""
_DEEPEST, _MOST, _MOST_ELEMENTS = 5, 10_000, 1000
_MEMORY = 4 << 30
_ELSEWHERE = "in another file, which is not read"


class _RefusedError(Exception):
    """What cannot be read, in words."""


def _names_wanted(name: str, wanted: list[str] | None) -> bool:
    """Return whether a top-level variable is to be loaded."""
    return bool(OWN.fullmatch(name)) if wanted is None else name in _bases(wanted)


def _bases(wanted: list[str]) -> list[str]:
    """Return the top-level variables that hold what is wanted."""
    return [re.split(r"[./[]", name)[0] for name in wanted]


def _mat(path: str, wanted: list[str] | None) -> Iterator[tuple[str, Any]]:
    import scipy.io

    try:
        try:
            held: list[tuple[str, tuple[int, ...], str]] = list(scipy.io.whosmat(path))
        except TypeError:
            # whosmat cannot list objects of MATLAB such as strings and tables; loadmat leaves them out.
            loaded = scipy.io.loadmat(path, variable_names=None if wanted is None else _bases(wanted))
            held = [
                (name, value.shape, "struct" if value.dtype.names else str(value.dtype))
                for name, value in loaded.items()
                if isinstance(value, np.ndarray) and not isinstance(value, scipy.io.matlab.MatlabOpaque)
            ]
        # Structs are opened too where nothing is asked for, to list what is in them.
        names = [name for name, _, kind in held if _names_wanted(name, wanted) or (wanted is None and kind == "struct")]
        loaded = scipy.io.loadmat(path, variable_names=names, simplify_cells=True) if names else {}
    except NotImplementedError as error:
        raise _RefusedError(f"it holds something that is not read: {error}") from None
    for name, shape, kind in held:
        if name in loaded:
            yield from _flat(name, loaded[name], 0)
        else:
            yield name, f"{'x'.join(map(str, shape))} {kind}"


def _flat(name: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict) and depth < _DEEPEST:
        for key, inner in value.items():
            yield from _flat(f"{name}.{key}", inner, depth + 1)
    elif (isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object)) and depth < _DEEPEST:
        # Arrays of structs and cell arrays.
        for index, inner in enumerate(list(value)[:_MOST_ELEMENTS]):
            yield from _flat(f"{name}[{index}]", inner, depth + 1)
    elif isinstance(value, (str, np.ndarray, np.generic, int, float, complex, bool)):
        yield name, value if isinstance(value, str) else np.asarray(value)


def _hdf5(request: dict[str, Any]) -> Iterator[tuple[str, Any]]:
    import h5py  # type: ignore[import-untyped]

    wanted = request["names"]
    with h5py.File(request["path"], "r") as file:
        found: list[tuple[str, Any]] = []
        for name, thing in _members(h5py, file, "", 0):
            if len(found) >= _MOST:
                raise _RefusedError(f"it holds more than {_MOST} data sets")
            found.append((name, thing))
        loaded = [
            # External storage and virtual data sets take their numbers from other files, any that can be opened.
            not _elsewhere(thing)
            and thing.shape is not None
            and (OWN.fullmatch(name.split("/")[0]) is not None if wanted is None else name in wanted)
            for name, thing in found
        ]
        # Space that is only promised, not there, is not allocated: a data set without chunks has any size.
        total = sum(thing.nbytes for (_, thing), load in zip(found, loaded, strict=True) if load)
        _check_size(total, request["largest"])
        _limit(request["seconds"] + total / request["bytes_per_second"])
        for (name, thing), load in zip(found, loaded, strict=True):
            value = _value(thing) if load else None
            yield name, _listed(thing) if value is None else value


def _elsewhere(thing: Any) -> bool:
    return thing.is_virtual or bool(thing.external)


def _listed(thing: Any) -> str:
    # The shape of a virtual data set may be that of the files that it is made of.
    if _elsewhere(thing):
        return _ELSEWHERE
    return f"{'x'.join(map(str, thing.shape or ())) or 'scalar'} {thing.dtype}"


def _check_size(size: int, largest: int) -> None:
    if size > largest:
        raise _RefusedError(
            f"its arrays take more than {largest >> 20} MiB when expanded, the most that is read of one file; split "
            "the file"
        )


def _members(h5py: Any, group: Any, owner: str, depth: int) -> Iterator[tuple[str, Any]]:
    for name in group:
        # Links elsewhere, and links into other files, are not followed.
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        thing = group[name]
        if isinstance(thing, h5py.Dataset):
            yield owner + name, thing
        elif isinstance(thing, h5py.Group) and depth < _DEEPEST:
            yield from _members(h5py, thing, f"{owner}{name}/", depth + 1)


def _value(thing: Any) -> Any:
    """Return a data set's numbers or text, None for anything else."""
    if thing.dtype.kind == "O" and thing.shape == ():
        text = thing.asstr()[()] if thing.dtype.metadata and thing.dtype.metadata.get("vlen") in (str, bytes) else None
        return text if isinstance(text, str) else None
    if thing.dtype.kind not in "biufc" and thing.dtype.names != ("real", "imag"):
        return None
    array = thing[()]
    if thing.dtype.names is not None:
        array = array["real"] + 1j * array["imag"]
    # MATLAB writes its arrays the other way round.
    return np.ascontiguousarray(np.asarray(array).T if "MATLAB_class" in thing.attrs else np.asarray(array))


def _answer(request: dict[str, Any]) -> tuple[bytes, list[Any]]:
    """Return the header and the arrays that follow it."""
    listed: dict[str, str] = {}
    texts: dict[str, str] = {}
    arrays: list[tuple[str, Any]] = []
    wanted = request["names"]
    for name, value in _mat(request["path"], wanted) if request["kind"] == "mat" else _hdf5(request):
        own = OWN.fullmatch(re.split(r"[./]", name)[0]) is not None
        loaded = own if wanted is None else name in wanted
        if isinstance(value, np.ndarray) and value.dtype.kind in "biufc":
            if loaded:
                arrays.append((name, np.ascontiguousarray(value)))
            listed[name] = f"{'x'.join(map(str, value.shape)) or 'scalar'} {value.dtype.name}"
        elif isinstance(value, str) and own and loaded:
            texts[name] = value
        else:
            listed[name] = value[:60] if isinstance(value, str) else f"{value.size} {value.dtype}"
    _check_size(sum(array.nbytes for _, array in arrays), request["largest"])
    header = {
        "arrays": [[name, array.dtype.str, array.shape] for name, array in arrays],
        "texts": texts,
        "listed": listed,
    }
    return _framed(header), [array for _, array in arrays]


def _framed(header: dict[str, Any]) -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text


def _limit(seconds: float) -> None:
    """End this process after so much processor time; a file in which a reader runs in circles ends there."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_PROF, seconds)


def _limit_memory(size: int) -> None:
    try:
        import resource
    except ImportError:
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = _MEMORY + 8 * size
    resource.setrlimit(resource.RLIMIT_AS, (wanted if hard == resource.RLIM_INFINITY else min(wanted, hard), hard))


def serve(incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Answer requests until there are no more."""
    for line in incoming:
        request = json.loads(line)
        if request["kind"] == "mat":
            import scipy.io  # noqa: F401 (before the time counts)
        elif request["kind"] == "hdf5":
            import h5py  # noqa: F401
        _limit_memory(request["size"])
        _limit(request["seconds"])
        arrays: list[Any] = []
        try:
            answer, arrays = _answer(request)
        except _RefusedError as error:
            answer = _framed({"error": str(error)})
        except MemoryError:
            answer = _framed({"error": f"it takes more than {_MEMORY >> 20} MiB of memory, the most that is allowed"})
        except Exception as error:
            answer = _framed({"error": f"{type(error).__name__}: {error}"[:500]})
        _limit(0.0)
        outgoing.write(answer)
        for array in arrays:
            outgoing.write(memoryview(array.reshape(-1).view(np.uint8)))
        outgoing.flush()


if __name__ == "__main__":
    serve(sys.stdin.buffer, sys.stdout.buffer)
