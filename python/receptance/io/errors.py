"""The error of files that cannot be read, and limits of reading one: expanded bytes, lines, numbers, processor time."""

from __future__ import annotations

import gzip
import io
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from receptance._files import LARGEST


class FileFormatError(ValueError):
    """A file that cannot be read; the message names the place, the finding and the expectation.

    Parameters
    ----------
    problem : str
        Finding, expectation and remedy.
    file : str, optional
        Name of the file.
    line : int, optional
        Line of a text file, counted from 1.
    byte : int, optional
        Position in the file, counted from 0, in binary data.
    place : str, optional
        Another place, such as a variable or a column.
    option : str, optional
        Keyword argument of `read` that states what the file does not, such as "unit".

    Attributes
    ----------
    problem, file, line, byte, place, option
        As given.

    Examples
    --------
    >>> from receptance.io import FileFormatError
    >>> print(FileFormatError("the ordinate type is 'x', expected 2, 4, 5 or 6", file="hit.uff", line=9))
    hit.uff, line 9: the ordinate type is 'x', expected 2, 4, 5 or 6
    """

    def __init__(
        self,
        problem: str,
        file: str = "",
        line: int | None = None,
        byte: int | None = None,
        place: str = "",
        option: str = "",
    ) -> None:
        # With all arguments in `args` the error can be pickled.
        super().__init__(problem, file, line, byte, place, option)
        self.problem, self.file, self.line, self.byte, self.place, self.option = self.args

    def __str__(self) -> str:
        location = [self.file] if self.file else []
        if self.line is not None:
            location.append(f"line {self.line}")
        if self.byte is not None:
            location.append(f"byte {self.byte}")
        if self.place:
            location.append(self.place)
        return f"{', '.join(location)}: {self.problem}" if location else self.problem


@contextmanager
def error_location(
    *, file: str = "", line: int | None = None, byte: int | None = None, place: str = ""
) -> Iterator[None]:
    """Add a file name to the errors raised in the block, and line, byte or place to errors without any of these."""
    try:
        yield
    except FileFormatError as error:
        if error.line is not None or error.byte is not None or error.place:
            line, byte, place = error.line, error.byte, error.place
        raise FileFormatError(error.problem, error.file or file, line, byte, place, error.option) from None


MAX_NUMBERS = 1 << 25
"""Most numbers in a text."""
_BASE_SECONDS = 0.3
"""Processor time allowed for an empty file."""
BYTES_PER_SECOND = 1e6
"""Lower limit of the reading speed; ten times as much is usual."""
_MAX_SECONDS = 300.0
"""Most processor time allowed for one file."""
_IMPORT_SECONDS = 10.0
"""Processor time allowed for imports by a reader in this process."""
_PIECE = 1 << 20

_deadline: ContextVar[tuple[float, float]] = ContextVar("deadline", default=(float("inf"), float("inf")))


def allowed_seconds(size: int) -> float:
    """Return the processor time allowed for reading a number of expanded bytes."""
    return min(_BASE_SECONDS + size / BYTES_PER_SECOND, _MAX_SECONDS)


def check_size(size: int, name: str = "the contents") -> None:
    """Raise if expanded data exceed the limit of bytes."""
    if size > LARGEST:
        raise FileFormatError(
            f"{name} take more than {LARGEST >> 20} MiB when expanded, the limit for one file; split the file"
        )


def check_count(count: int, most: int, name: str) -> None:
    """Raise if a text exceeds a limit of lines or numbers."""
    if count > most:
        raise FileFormatError(
            f"the text has {count} {name} or more, expected at most {most}; split the file, or store the numbers in a "
            "NumPy file (.npz)"
        )


@contextmanager
def time_limit(size: int) -> Iterator[None]:
    """Limit the processor time for reading a number of bytes; readers call `check_time` within the context."""
    allowed = allowed_seconds(size) + _IMPORT_SECONDS
    token = _deadline.set((time.thread_time() + allowed, allowed))
    try:
        yield
    finally:
        _deadline.reset(token)


def check_time() -> None:
    """Raise if the time limit is exceeded; readers call it while they process a file."""
    end, allowed = _deadline.get()
    if time.thread_time() > end:
        raise FileFormatError(
            f"reading was stopped after {allowed:.0f} s of processor time, the limit for a file of this size; "
            "split the file, or store the numbers in a NumPy file (.npz)"
        )


def decompress(data: bytes) -> bytes:
    """Return the expanded contents of all members of a gzip file, at most `LARGEST` bytes."""
    pieces: list[bytes] = []
    size = 0
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
            while piece := stream.read(_PIECE):
                pieces.append(piece)
                size += len(piece)
                check_size(size)
    except gzip.BadGzipFile as error:
        raise FileFormatError(f"the gzip data are damaged, or followed by other data: {error}") from None
    except zlib.error as error:
        raise FileFormatError(f"the gzip data are damaged: {error}") from None
    except EOFError:
        raise FileFormatError("the gzip data are truncated") from None
    return b"".join(pieces)
