"""Which examples there are, and writing one of them out.

Campaign files are kept as they are read; simulated data are not kept but made from their seed when an example is
written out, so that the package stays small and nobody takes old data for what the model of today gives.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from receptance._files import write_whole
from receptance.examples.simulated import free_free, hammer, taper

__all__ = ["EXAMPLES", "Example", "write"]

Say = Callable[[str], None]


@dataclass(frozen=True)
class Example:
    """A campaign that comes with the package.

    Attributes
    ----------
    name : str
        What it is asked for by.
    title : str
        What it is, in a line.
    folder : str
        Where its files are kept in the package.
    data : callable or None
        Makes the data files; None where there are none.
    """

    name: str
    title: str
    folder: str
    data: Callable[..., Mapping[str, bytes]] | None = None

    @property
    def campaign(self) -> str:
        """The campaign file."""
        return (resources.files("receptance.examples") / self.folder / "campaign.toml").read_text(encoding="utf-8")

    def files(self, progress: Say | None = None) -> dict[str, bytes]:
        """Return the content of all its files by name."""
        kept = resources.files("receptance.examples") / self.folder
        found = {
            file.name: file.read_bytes() for file in kept.iterdir() if file.name.endswith((".toml", ".md", ".csv"))
        }
        if self.data is not None:
            found |= self.data(self.campaign, progress or (lambda _: None))
        return dict(sorted(found.items()))


EXAMPLES = {
    example.name: example
    for example in (
        Example(
            "er32",
            "published natural frequencies of five blanks in an ER32 holder; other overhangs held out",
            "er32",
        ),
        Example(
            "free-free",
            "a free-free hammer test at three overhangs, SIMULATED; the longest held out, a fourth not measured",
            "free_free",
            free_free,
        ),
        Example(
            "hammer",
            "raw time records of hammer hits at three overhangs, SIMULATED; the longest held out",
            "hammer",
            hammer,
        ),
        Example(
            "machine",
            "natural frequencies of two blanks in a machine, SIMULATED; a catalogue of tools, and cuts",
            "machine",
        ),
        Example(
            "taper",
            "a holder in its taper at 26 drawbar forces, along and across, SIMULATED; four forces held out",
            "taper",
            taper,
        ),
    )
}


def write(
    name: str, folder: str | Path, *, overwrite: bool = False, progress: Callable[[str], None] | None = None
) -> list[Path]:
    """Write an example out, data included: all of its files or none.

    Parameters
    ----------
    name : str
        One of `EXAMPLES`.
    folder : str or path
        Where to; made if it is not there.
    overwrite : bool, optional
        Whether files of the same names may be replaced.
    progress : callable, optional
        Called with a line of text before each step.

    Returns
    -------
    list of Path
        The files, the campaign first.

    Raises
    ------
    ValueError
        There is no such example.
    FileExistsError
        A file is there already.
    OSError
        A file that cannot be written; the message names it.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print([file.name for file in examples.write("er32", folder)])
    ['campaign.toml']
    """
    if name not in EXAMPLES:
        raise ValueError(f"there is no example {name!r}; the examples are {', '.join(EXAMPLES)}")
    target = Path(folder)
    if target.exists() and not target.is_dir():
        raise NotADirectoryError(f"cannot write to {target}: it is a file, expected a folder")
    contents = {target / file: content for file, content in EXAMPLES[name].files(progress).items()}
    there = [str(path) for path in contents if path.exists()]
    if there and not overwrite:
        raise FileExistsError(f"there is already {', '.join(there)}; choose another folder")
    made = _make_folders(target)
    try:
        write_whole(contents)
    except BaseException:
        for path in reversed(made):
            with contextlib.suppress(OSError):
                path.rmdir()
        raise
    return sorted(contents, key=lambda path: path.name != "campaign.toml")


def _make_folders(target: Path) -> list[Path]:
    """Make a folder and those above it; return the new ones, the outermost first."""
    new = [path for path in (target, *target.parents) if not path.exists()]
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OSError(f"cannot make the folder {target}: {error.strerror or error}") from error
    return new[::-1]
