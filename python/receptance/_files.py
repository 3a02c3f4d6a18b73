"""Atomic writing of files, and reading within a limit of size."""

from __future__ import annotations

import contextlib
import difflib
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from receptance._text import printable

LARGEST = 1 << 30
"""Most bytes read of one file, compressed or expanded: 1 GiB."""


def inert(text: str) -> str:
    r"""Return a text for a cell of a table, quoted if a spreadsheet would take it for a formula.

    Control characters are escaped.

    Examples
    --------
    >>> from receptance._files import inert
    >>> inert("T12"), inert("=1+2"), inert("T" + chr(27) + "[2J")
    ('T12', "'=1+2", 'T\\x1b[2J')
    """
    return f"'{printable(text)}" if text.startswith(("=", "+", "-", "@", "\t", "\r", "\n")) else printable(text)


def not_found(what: str, path: Path, otherwise: str = "") -> FileNotFoundError:
    """Return the error about a file that does not exist, with the nearest name in its folder, else another hint."""
    folder = path.parent
    if not folder.is_dir():
        return FileNotFoundError(f"there is no folder {folder}")
    names: list[str] = []
    with contextlib.suppress(OSError):  # a folder whose names may not be read
        names = [one.name for one in folder.iterdir() if one.name != path.name]
    near = difflib.get_close_matches(path.name, names, n=1)
    hint = f"did you mean {folder / near[0]}?" if near else otherwise
    return FileNotFoundError(f"there is no {what} {path}{'; ' if hint else ''}{hint}")


def open_file(path: Path) -> BinaryIO:
    """Open a file for reading; folders, and pipes and devices, which may not end, are refused with an OSError."""
    # Without O_NONBLOCK opening a pipe waits for a writer.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        descriptor = os.open(os.fspath(path), flags)
    except FileNotFoundError:
        raise not_found("file", path) from None
    try:
        mode = os.fstat(descriptor).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(f"cannot read {path}: it is a folder, expected a file")
        if not stat.S_ISREG(mode):
            raise OSError(f"cannot read {path}: it is a pipe or a device, expected a file")
        return os.fdopen(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_whole(path: Path) -> bytes:
    """Return the contents of a file of at most `LARGEST` bytes; errors are those of `open_file`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from receptance._files import read_whole
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "a.txt").write_bytes(b"whole")
    ...     read_whole(Path(folder) / "a.txt")
    b'whole'
    """
    with open_file(path) as file:
        # The stated size may be wrong in file systems with generated contents.
        pieces = [file.read(min(os.fstat(file.fileno()).st_size + 1, LARGEST + 1))]
        size = len(pieces[0])
        while size <= LARGEST and (piece := file.read(1 << 20)):
            pieces.append(piece)
            size += len(piece)
    if size > LARGEST:
        raise OSError(f"cannot read {path}: it is larger than {LARGEST >> 20} MiB, the limit for one file")
    return pieces[0] if len(pieces) == 1 else b"".join(pieces)


def check_target(path: Path) -> None:
    """Raise an OSError if a file cannot be written, for a check before a long computation."""
    folder = path.resolve().parent
    if path.is_dir():
        raise IsADirectoryError(f"cannot write {path}: it is a folder")
    if not folder.is_dir():
        raise NotADirectoryError(f"cannot write {path}: there is no folder {path.parent}")
    target = path if path.exists() and not path.is_file() else folder
    if not os.access(target, os.W_OK) or (path.is_file() and not os.access(path, os.W_OK)):
        raise PermissionError(f"cannot write {path}: no permission")


@contextlib.contextmanager
def created_folder(target: Path) -> Iterator[None]:
    """Create a folder with its parents, or raise an OSError; after an error the new ones are removed."""
    new = [path for path in (target, *target.parents) if not path.exists()]
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(f"cannot create the folder {target}: {error.strerror or error}") from error
    try:
        yield
    except BaseException:
        for path in new:
            with contextlib.suppress(OSError):
                path.rmdir()
        raise


def new_path(folder: Path, stem: str, ending: str) -> Path:
    """Return the path of a file that does not exist: `stem` with an ending, with a number where that exists.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from receptance._files import new_path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     first = new_path(Path(folder), "lobes", ".svg")
    ...     first.touch()
    ...     first.name, new_path(Path(folder), "lobes", ".svg").name
    ('lobes.svg', 'lobes-2.svg')
    """
    path, number = folder / f"{stem}{ending}", 1
    while path.exists() or path.is_symlink():
        number += 1
        path = folder / f"{stem}-{number}{ending}"
    return path


def write_whole(contents: Mapping[Path, bytes]) -> None:
    """Write files under temporary names next to their targets, then rename all of them.

    After an error, an OSError that names the file for example, or an interruption the targets are unchanged and no
    temporary file is left.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from receptance._files import write_whole
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_whole({Path(folder) / "a.txt": b"whole"})
    ...     (Path(folder) / "a.txt").read_text()
    'whole'
    """
    waiting: dict[Path, Path] = {}
    try:
        for path, content in contents.items():
            check_target(path)
            try:
                _stage(path, content, waiting)
            except OSError as error:
                raise OSError(f"cannot write {path}: {error.strerror or error}") from error
        try:
            # A loop in C, which no signal divides: it renames all files or none.
            list(map(os.replace, waiting.keys(), waiting.values()))
        except OSError as error:
            raise OSError(f"cannot write {error.filename2}: {error.strerror or error}") from error
    finally:
        for temporary in waiting:
            with contextlib.suppress(OSError):
                temporary.unlink()


def _stage(path: Path, content: bytes, waiting: dict[Path, Path]) -> None:
    if path.exists() and not path.is_file():
        # A pipe or a terminal (/dev/stdout) cannot be replaced by renaming.
        path.write_bytes(content)
        return
    # The target of a link is replaced, not the link.
    target = path.resolve()
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    waiting[temporary] = target
    with temporary.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    if target.exists():
        temporary.chmod(target.stat().st_mode & 0o7777)
