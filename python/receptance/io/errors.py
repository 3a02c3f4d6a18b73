"""The error of files that cannot be read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


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

    Attributes
    ----------
    problem, file, line, byte, place
        As given.

    Examples
    --------
    >>> from receptance.io import FileFormatError
    >>> print(FileFormatError("the ordinate type is 'x', expected 2, 4, 5 or 6", file="hit.uff", line=9))
    hit.uff, line 9: the ordinate type is 'x', expected 2, 4, 5 or 6
    """

    def __init__(
        self, problem: str, file: str = "", line: int | None = None, byte: int | None = None, place: str = ""
    ) -> None:
        # With all arguments in `args` the error can be pickled.
        super().__init__(problem, file, line, byte, place)
        self.problem, self.file, self.line, self.byte, self.place = problem, file, line, byte, place

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
    """Add a file name to the errors raised in the block, and line, byte or place to errors without any of these.

    Examples
    --------
    >>> from receptance.io.errors import FileFormatError, error_location
    >>> with error_location(file="hit.uff", line=9):
    ...     raise FileFormatError("the spacing is 3, expected 0 or 1")
    Traceback (most recent call last):
    receptance.io.errors.FileFormatError: hit.uff, line 9: the spacing is 3, expected 0 or 1
    """
    try:
        yield
    except FileFormatError as error:
        if error.line is not None or error.byte is not None or error.place:
            line, byte, place = error.line, error.byte, error.place
        raise FileFormatError(error.problem, file=error.file or file, line=line, byte=byte, place=place) from None
