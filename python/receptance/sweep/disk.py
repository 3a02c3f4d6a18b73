"""What a store needs of the file system: data that a power cut leaves, and one writer."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

__all__ = ["Lock", "SweepError", "flush"]


class SweepError(ValueError):
    """A store that cannot take this sweep, or results too large for memory."""


def flush(path: Path) -> None:
    """Have the disk take a file and its name."""
    for one, flags in ((path, os.O_RDONLY), (path.parent, os.O_RDONLY)):
        # A chunk of nothing but fill values has no file; folders cannot be opened everywhere.
        with contextlib.suppress(OSError):
            handle = os.open(one, flags)
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
