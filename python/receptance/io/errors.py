"""What is raised where a file is not what it should be."""

from __future__ import annotations

__all__ = ["FileFormatError"]


class FileFormatError(ValueError):
    """A file that cannot be read right; the message says where, what was found and what was expected.

    Parameters
    ----------
    problem : str
        What was found and what was expected, and how to help.
    file : str, optional
        Name of the file.
    line : int, optional
        Line of a text file, counted from 1.
    byte : int, optional
        Position in the file, counted from 0, where lines mean nothing.
    place : str, optional
        Anything else that names a place: a variable, a column.

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
        self,
        problem: str,
        *,
        file: str = "",
        line: int | None = None,
        byte: int | None = None,
        place: str = "",
    ) -> None:
        super().__init__(problem, file, line, byte, place)
        self.problem, self.file, self.line, self.byte, self.place = problem, file, line, byte, place

    def __str__(self) -> str:
        where = [self.file] if self.file else []
        if self.line is not None:
            where.append(f"line {self.line}")
        if self.byte is not None:
            where.append(f"byte {self.byte}")
        if self.place:
            where.append(self.place)
        return f"{', '.join(where)}: {self.problem}" if where else self.problem

    def __reduce__(self) -> tuple[object, ...]:
        # Keyword arguments do not survive the way exceptions are pickled by default.
        return _again, (self.problem, self.file, self.line, self.byte, self.place)

    def named(self, file: str) -> FileFormatError:
        """Return this error with the name of the file, if it had none."""
        return FileFormatError(self.problem, file=self.file or file, line=self.line, byte=self.byte, place=self.place)


def _again(problem: str, file: str, line: int | None, byte: int | None, place: str) -> FileFormatError:
    return FileFormatError(problem, file=file, line=line, byte=byte, place=place)
