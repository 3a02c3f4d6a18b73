"""Files that are dropped on a page: their names, their limit, and how they reach the folder that was opened."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from pathlib import Path

from receptance._files import read_whole, write_whole
from receptance._text import shown
from receptance.io.files import ENDINGS

LARGEST_UPLOAD = 60 << 20
"""Most bytes of files that are dropped together: 60 MiB, which a message of the browser carries as text."""
HOLDER_ENDINGS = (".dxf",)
"""Endings of drawings of a holder, beside tables."""
_OTHER = re.compile(r"[^\w .()+,=@-]")
_LONGEST_NAME = 150


class ExistingFilesError(FileExistsError):
    """Files of the folder with other contents would be replaced; `names` are theirs."""

    def __init__(self, names: Collection[str]) -> None:
        self.names = tuple(names)
        super().__init__(f"{', '.join(names)} {'exists' if len(names) == 1 else 'exist'} with other contents")


def safe_name(name: str) -> str:
    r"""Return a name for a file of the folder: without folders, hidden names and special characters.

    Raises
    ------
    ValueError
        The ending is that of no measurement file and no drawing.

    Examples
    --------
    >>> from receptance.session.uploads import safe_name
    >>> safe_name("../../tool:60mm.csv"), safe_name("C:\\data\\.hit.uff")
    ('tool_60mm.csv', 'hit.uff')
    """
    last = _OTHER.sub("_", re.split(r"[/\\]", name)[-1]).strip(" .")
    stem, dot, ending = last.rpartition(".")
    if f"{dot}{ending}".lower() not in (*ENDINGS, *HOLDER_ENDINGS) or not stem:
        endings = " ".join((*ENDINGS, *HOLDER_ENDINGS))
        raise ValueError(f"{shown(name)} is no measurement file and no drawing, expected an ending of: {endings}")
    return f"{stem[: _LONGEST_NAME - len(ending)]}{dot}{ending}"


def store(folder: Path, contents: Mapping[str, bytes], *, replace: bool = False) -> list[str]:
    """Write files into a folder, all or none, and return their names there.

    Raises
    ------
    ExistingFilesError
        Files with other contents exist, and may not be replaced.
    ValueError
        A name, an empty file, or too many bytes.
    OSError
        The folder cannot be written to.
    """
    size = sum(map(len, contents.values()))
    if size > LARGEST_UPLOAD:
        raise ValueError(
            f"the files have {size / (1 << 20):.0f} MiB, expected at most {LARGEST_UPLOAD >> 20} MiB together; "
            "copy them into the folder, and choose them"
        )
    files = {safe_name(name): content for name, content in contents.items()}
    if len(files) < len(contents):
        raise ValueError(f"two of {', '.join(contents)} have the same name, expected different names")
    if empty := [name for name, content in files.items() if not content]:
        raise ValueError(f"{', '.join(empty)}: the file is empty, expected a measurement")
    new = {}
    for name, content in files.items():
        path = folder / name
        if path.is_symlink():
            raise ValueError(f"{name} is a link in the folder, which is not replaced; give the file another name")
        if not path.exists() or read_whole(path) != content:
            new[name] = content
    existing = [name for name in new if (folder / name).exists()]
    if existing and not replace:
        raise ExistingFilesError(existing)
    write_whole({folder / name: content for name, content in new.items()})
    return list(files)
