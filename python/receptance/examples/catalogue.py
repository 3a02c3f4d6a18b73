"""List of the examples, and a function that writes one of them.

The package contains the campaign files. Simulated data are computed from their seed when an example is written, which
keeps the package small and the data consistent with the current model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from receptance._files import created_folder, write_whole
from receptance._text import instead_of, shown
from receptance.examples.simulated import free_free, machine_records, taper, time_records

Say = Callable[[str], None]


@dataclass(frozen=True)
class Example:
    """A campaign that is part of the package."""

    name: str
    """Name of the example."""
    title: str
    """Description in one line."""
    folder: str
    """Folder of its files in the package."""
    data: Callable[..., Mapping[str, bytes]] | None = None
    """Function that computes the data files; None without data files."""
    first_command: str = "identify"
    """The command to begin with."""

    @property
    def campaign(self) -> str:
        """Content of the campaign file."""
        return (resources.files("receptance.examples") / self.folder / "campaign.toml").read_text(encoding="utf-8")

    def files(self, progress: Say | None = None) -> dict[str, bytes]:
        """Return the contents of all files by name."""
        packaged = resources.files("receptance.examples") / self.folder
        endings = (".toml", ".md", ".csv", ".dxf")
        found = {file.name: file.read_bytes() for file in packaged.iterdir() if file.name.endswith(endings)}
        if self.data is not None:
            found |= self.data(self.campaign, progress or (lambda _: None))
        return dict(sorted(found.items()))


EXAMPLES = {
    example.name: example
    for example in (
        Example(
            "bt50",
            "a rigid holder in its taper at seven drawbar forces, after a publication, SIMULATED; four held out",
            "bt50",
            taper,
        ),
        Example(
            "drawing",
            "an end mill with flutes in a holder read from its DXF drawing, a foreign model, SIMULATED; one held out",
            "drawing",
        ),
        Example(
            "er32",
            "published natural frequencies of five blanks in an ER32 holder; other overhangs held out",
            "er32",
        ),
        Example(
            "forgotten-sensor",
            "a hammer test of a foreign model, SIMULATED, with a sensor that the campaign does not state",
            "forgotten_sensor",
        ),
        Example(
            "free-free",
            "a free-free hammer test at three overhangs, SIMULATED; the longest held out, a fourth not measured",
            "free_free",
            free_free,
        ),
        Example(
            "gauge",
            "hits on a gauge blank and on a tool in one machine, SIMULATED: spindle, joint and lobes",
            "gauge",
            machine_records,
            first_command="spindle",
        ),
        Example(
            "hammer",
            "raw time records of hammer hits at three overhangs, SIMULATED; the longest held out",
            "hammer",
            time_records,
        ),
        Example(
            "machine",
            "natural frequencies of two blanks in a machine, SIMULATED; a catalogue of tools, and cuts",
            "machine",
        ),
        Example(
            "taper",
            "a holder in its taper at 26 drawbar forces, axial and radial, SIMULATED; four forces held out",
            "taper",
            taper,
        ),
    )
}


def write(
    name: str, folder: str | Path, *, overwrite: bool = False, progress: Callable[[str], None] | None = None
) -> list[Path]:
    """Write an example with its data: all of its files or none.

    Parameters
    ----------
    name : str
        Key of `EXAMPLES`.
    folder : str or path
        Target folder, created if it does not exist.
    overwrite : bool, optional
        Whether existing files may be replaced.
    progress : callable, optional
        Called with a line of text before each step.

    Returns
    -------
    list of Path
        The files, the campaign first.

    Raises
    ------
    ValueError
        An unknown name.
    FileExistsError
        A file exists already.
    OSError
        A file cannot be written; the message names it.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print([file.name for file in examples.write("er32", folder)])
    ['campaign.toml']
    """
    if name not in EXAMPLES:
        raise ValueError(f"there is no example {shown(name)}{instead_of(name, EXAMPLES)}")
    target = Path(folder)
    if target.exists() and not target.is_dir():
        raise NotADirectoryError(f"cannot write to {target}: it is a file, expected a folder")
    contents = {target / file: content for file, content in EXAMPLES[name].files(progress).items()}
    existing = [str(path) for path in contents if path.exists() or path.is_symlink()]
    if existing and not overwrite:
        exist = f"exist{'' if len(existing) > 1 else 's'} already"
        raise FileExistsError(
            f"{', '.join(existing)} {exist}; choose another folder, or overwrite (on the command line --overwrite)"
        )
    with created_folder(target):
        write_whole(contents)
    return sorted(contents, key=lambda path: path.name != "campaign.toml")
