"""What a store needs of the file system: data that a power cut leaves, and one writer."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

__all__ = ["Lock", "SweepError", "flush", "renamed"]


class SweepError(ValueError):
    """A store that cannot take this sweep, or results too large for memory."""


def flush(files: Iterable[Path], root: Path) -> None:
    """Have the disk take files below `root`, and the names of all of them and in `root`."""
    folders: dict[Path, None] = {root: None}
    for file in files:
        _flush(file, os.O_RDWR)
        folder = file.parent
        while folder not in folders:
            folders[folder] = None
            folder = folder.parent
    for one in folders:
        # Folders cannot be opened everywhere.
        with contextlib.suppress(OSError):
            _flush(one, os.O_RDONLY)


def _flush(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextlib.contextmanager
def renamed(path: Path) -> Iterator[Path]:
    """Give another name, for a file or a folder that gets its own name when it is complete, else is removed.

    The name is always the same, so that what a killed process left is removed by the next one. Errors of the system
    name the file, which those of a full disk do not.
    """
    temporary = path.with_name(f".{path.name}.part")
    try:
        _remove(temporary)
        yield temporary
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            _remove(temporary)
        if isinstance(error, OSError) and error.filename is None and error.errno is not None:
            raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
        raise


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


class Lock:
    """A lock on a store, which the system takes back from a process that ends in any way.

    Parameters
    ----------
    path : Path
        The store, without symbolic links: all names of a store have one lock.
    """

    def __init__(self, path: Path) -> None:
        self._path = path.with_name(f".{path.name}.lock")
        self._handle: int | None = None
        try:
            import fcntl
        except ImportError:  # not on Windows
            return
        if not path.parent.is_dir():
            return
        while self._handle is None:
            try:
                handle = os.open(self._path, os.O_RDWR | os.O_CREAT)
            except OSError as error:
                raise SweepError(
                    f"sweep: cannot write to the folder {path.parent}: {error.strerror}; give a store in another folder"
                    + (" (`receptance.sweep.open_sweep` reads one without writing)" if path.exists() else "")
                ) from error
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(handle)
                raise SweepError(f"sweep: another run writes to {path} now") from None
            # The run that held it may have removed the file since it was opened here.
            if _is(handle, self._path):
                self._handle = handle
            else:
                os.close(handle)

    def close(self) -> None:
        """Let others write."""
        if self._handle is not None:
            with contextlib.suppress(OSError):
                self._path.unlink()
            os.close(self._handle)
            self._handle = None


def _is(handle: int, path: Path) -> bool:
    """Whether a path is that of an open file."""
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False
