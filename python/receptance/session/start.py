"""A new campaign as a page makes it: the files that are chosen, and the answers as texts; without any widget."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from receptance import draft
from receptance._files import write_whole
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.io import FileFormatError
from receptance.io.contents import FileContents
from receptance.io.files import ENDINGS
from receptance.model.assembly import Assembly
from receptance.session.document import CAMPAIGN_FILE

CHANNELS = {"force": "Force channel of time records", "motion": "Motion channel of time records"}
"""Questions about time records with several channels of a kind."""


@dataclass(frozen=True)
class ChosenFile:
    """A file of the folder, with its contents or what is wrong with it."""

    name: str
    contents: FileContents | None = None
    measurements: tuple[draft.MeasuredFile, ...] = ()
    error: str = ""
    open_question: str = ""
    """Name of the question without whose answer it is not read."""


class Start:
    """Files and answers of a new campaign in a folder; nothing is written before `write`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from receptance import examples
    >>> from receptance.session.start import Start
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("forgotten-sensor", folder)
    ...     start = Start(Path(folder))
    ...     start.choose(["tool_40mm.csv"])
    ...     start.answer("tool", "12 mm")
    ...     [asked.question.name for asked in start.answers.missing]
    ['overhang', 'tool_material', 'holder', 'holder_material', 'insertion', 'sensor', 'support']
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.target = folder / CAMPAIGN_FILE
        self.files: list[ChosenFile] = []
        self.texts: dict[str, str | dict[str, str]] = {}
        self._draft: draft.Draft | None = None

    @property
    def available(self) -> list[str]:
        """Names of the files of the folder that may hold measurements, by their endings."""
        try:
            files = [path for path in self.folder.iterdir() if path.is_file()]
        except OSError:
            return []
        return sorted(path.name for path in files if path.suffix.lower() in ENDINGS and self._is_below(path))

    def _is_below(self, path: Path) -> bool:
        return path.resolve().is_relative_to(self.folder.resolve())

    def choose(self, names: Sequence[str]) -> None:
        """Read files of the folder; those that were read already are kept."""
        read = {file.name: file for file in self.files}
        self.files = [read[name] if name in read and not read[name].error else self._read(name) for name in names]
        self._draft = None

    def forget(self, names: Sequence[str]) -> None:
        """Read files anew, which have been replaced."""
        self.files = [self._read(file.name) if file.name in names else file for file in self.files]

    def _read(self, name: str) -> ChosenFile:
        contents, path = None, self.folder / name
        stated = {key: text for key, text in self.texts.items() if isinstance(text, str)}
        try:
            if not self._is_below(path):
                raise PermissionError(f"{name} is not below the folder that was opened")
            contents, options = draft.read_file(path, {}, stated)
            channels = {key: stated.get(key) for key in CHANNELS}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ReceptanceWarning)
                measured = draft.measured_files(path, contents.measurements, options, channels, self.folder)
        except (FileFormatError, draft.ChannelError) as error:
            is_open = error.option in draft.READING_QUESTIONS or error.option in CHANNELS
            return ChosenFile(name, contents, (), str(error), error.option if is_open else "")
        except (ValueError, TypeError, OSError, ReceptanceError) as error:
            return ChosenFile(name, contents, (), str(error))
        return ChosenFile(name, contents, tuple(measured))

    @property
    def open_reading(self) -> list[str]:
        """Names of the questions that reading asks, answered or not."""
        names = (*draft.READING_QUESTIONS, *CHANNELS)
        return [name for name in names if name in self.texts or any(file.open_question == name for file in self.files)]

    @property
    def measurements(self) -> list[draft.MeasuredFile]:
        """The measurements of all files that can be read."""
        return draft.with_different_names(m for file in self.files for m in file.measurements)

    def answer(self, name: str, text: str, file: str = "") -> None:
        """Take over the text of an answer, about a measurement if it is named; an empty text removes it."""
        text = text.strip()
        if file:
            of_each = self.texts.setdefault(name, {})
            assert isinstance(of_each, dict)
            of_each |= {file: text}
            if not text:
                del of_each[file]
            if not of_each:
                del self.texts[name]
        elif text:
            self.texts[name] = text
        else:
            self.texts.pop(name, None)
        self._draft = None
        if name in draft.READING_QUESTIONS or name in CHANNELS:
            self.files = [self._read(item.name) for item in self.files]

    @property
    def answers(self) -> draft.Answers:
        """All questions that files and answers leave open, with the values of the answers."""
        return draft.review(self.measurements, self._asked_texts(), self.target, folder=self.folder)

    def _asked_texts(self) -> Mapping[str, str | dict[str, str]]:
        """Return the texts without places that were stated for a spindle, if it is none."""
        if self.texts.get("support") == "spindle":
            return self.texts
        return {name: text for name, text in self.texts.items() if name not in ("response", "hit")}

    def outlines(self, answers: draft.Answers) -> dict[str, Assembly]:
        """Return the assemblies as far as they are stated; raises as `draft.outlines`."""
        return draft.outlines(answers, self.folder)

    def make(self) -> draft.Draft:
        """Return the draft; raises as `make_draft`, and a ValueError where a file is not read or none is chosen."""
        if self._draft is None:
            if wrong := [file.name for file in self.files if file.error]:
                raise ValueError(f"{', '.join(wrong)} cannot be read; answer what is asked about it, or leave it out")
            if not self.files:
                raise ValueError("no file is chosen")
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ReceptanceWarning)
                self._draft = draft.make_draft(self.measurements, self._asked_texts(), self.target, folder=self.folder)
        return self._draft

    def write(self, *, replace: bool = False) -> Path:
        """Write the campaign, completely or not at all, and return its file.

        Raises
        ------
        FileExistsError
            There is a campaign, which may not be replaced.
        ValueError, OSError
            As `make`; or the file cannot be written.
        """
        made = self.make()
        if (self.target.exists() or self.target.is_symlink()) and not replace:
            raise FileExistsError(f"{self.target.name} exists already")
        write_whole({self.target: made.text.encode()})
        return self.target
