"""What a store needs of the file system: data that a power cut leaves, and one writer."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from pathlib import Path

__all__ = ["Lock", "SweepError", "flush"]


class SweepError(ValueError):
    """A store that cannot take this sweep, or results too large for memory."""


def flush(files: Iterable[Path], root: Path) -> None:
    """Have the disk take files below `root`, and their names."""
    folders: dict[Path, None] = {}
    for file in files:
        _flush(file, os.O_RDWR)
        folder = file.parent
        while folder not in folders:
            folders[folder] = None
            folder = folder.parent if folder != root else root
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


class Lock:
    """A lock on a store, which the system takes back from a process that ends in any way."""

    def __init__(self, path: Path) -> None:
        self._path = path.with_name(f".{path.name}.lock")
        self._handle: int | None = None
        try:
            import fcntl
        except ImportError:  # not on Windows
            return
        if not path.parent.is_dir():
            return
        handle = os.open(self._path, os.O_RDWR | os.O_CREAT)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            raise SweepError(f"sweep: another run writes to {path} now") from None
        self._handle = handle

    def close(self) -> None:
        """Let others write."""
        if self._handle is not None:
            with contextlib.suppress(OSError):
                self._path.unlink()
            os.close(self._handle)
            self._handle = None
