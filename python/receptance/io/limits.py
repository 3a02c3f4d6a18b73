"""What reading one file may take at most, the same for all formats: bytes after expansion, lines, processor time."""

from __future__ import annotations

import gzip
import io
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from receptance._files import LARGEST
from receptance.io.errors import FileFormatError

__all__ = ["LARGEST", "check_fields", "check_lines", "check_size", "check_time", "inflated", "seconds", "timed"]

MOST_LINES = 1 << 24
"""Lines of a text; each takes 100 bytes of memory and more, however short it is."""
MOST_FIELDS = 1 << 26
"""Numbers in a text; each takes 60 bytes of memory while it is read."""
_START = 0.3
BYTES_PER_SECOND = 1e6
"""A slow machine reads more than this, ten times as much is usual."""
_LONGEST = 300.0
_LOADING = 10.0
"""Seconds for the modules that a reader in this process loads first."""
_PIECE = 1 << 20

_deadline: ContextVar[tuple[float, float]] = ContextVar("deadline", default=(float("inf"), float("inf")))


def seconds(size: int) -> float:
    """Return the processor time that reading so many bytes, after expansion, may take."""
    return min(_START + size / BYTES_PER_SECOND, _LONGEST)


def check_size(size: int, what: str = "the contents") -> None:
    """Raise where something expands to more bytes than are read of one file."""
    if size > LARGEST:
        raise FileFormatError(
            f"{what} take more than {LARGEST >> 20} MiB when expanded, the most that is read of one file; split "
            "the file"
        )


def check_lines(data: bytes) -> None:
    """Raise where a text has more lines than are read."""
    count = data.count(b"\n") or data.count(b"\r")
    if count > MOST_LINES:
        raise FileFormatError(
            f"the text has {count} lines, at most {MOST_LINES} are read of one file; split the file, or give the "
            "numbers in a NumPy file (.npz)"
        )


def check_fields(count: int) -> None:
    """Raise where a text has more numbers than are read."""
    if count > MOST_FIELDS:
        raise FileFormatError(
            f"the table has more than {MOST_FIELDS} numbers, the most that are read of one text; split the file, or "
            "give the numbers in a NumPy file (.npz)"
        )


@contextmanager
def timed(size: int) -> Iterator[None]:
    """Limit the processor time that reading so many bytes takes in here, as far as the readers call `check_time`."""
    allowed = seconds(size) + _LOADING
    token = _deadline.set((time.thread_time() + allowed, allowed))
    try:
        yield
    finally:
        _deadline.reset(token)


def check_time() -> None:
    """Raise where the time is over; readers call it where they go through a file."""
    end, allowed = _deadline.get()
    if time.thread_time() > end:
        raise FileFormatError(
            f"reading was ended after {allowed:.0f} s of processor time, the limit for a file of this size; "
            "split the file, or give the numbers in a NumPy file (.npz)"
        )


def inflated(data: bytes) -> bytes:
    """Return what gzip compressed: all members of the file, at most `LARGEST` bytes together.

    Raises
    ------
    FileFormatError
        A damaged or truncated file, something behind the last member, or too large contents.
    """
    pieces: list[bytes] = []
    size = 0
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
            while piece := stream.read(_PIECE):
                pieces.append(piece)
                size += len(piece)
                check_size(size)
    except gzip.BadGzipFile as error:
        raise FileFormatError(f"the gzip compression is damaged, or something else follows it: {error}") from None
    except zlib.error as error:
        raise FileFormatError(f"the gzip compression is damaged: {error}") from None
    except EOFError:
        raise FileFormatError("the gzip compression cannot be undone: it is cut off") from None
    return b"".join(pieces)
