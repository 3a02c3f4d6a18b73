"""The campaign file that a page has open: its text, its mistakes, and how it is saved."""

from __future__ import annotations

import hashlib
import tomllib
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from receptance._files import read_whole, write_whole
from receptance.campaign import Campaign, CampaignError, Issue
from receptance.errors import ReceptanceError, ReceptanceWarning

CAMPAIGN_FILE = "campaign.toml"


class ConflictError(Exception):
    """The file on disk is not the one that was opened: another program, or another page, has changed it."""


@dataclass(frozen=True)
class Document:
    """A campaign file as text that is edited and saved; methods return changed copies.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import examples
    >>> from receptance.session.document import Document
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("er32", folder)
    ...     document = Document.open(folder)
    ...     shorter = document.with_value(("title",), "Another title")
    ...     shorter.campaign.title, shorter.is_changed, document.is_changed
    ('Another title', True, False)
    """

    file: Path
    text: str
    """The text as it is edited."""
    saved: str
    """The text that was read or written last."""
    threads: int | None = field(default=None, compare=False)

    @classmethod
    def open(cls, path: str | Path, *, threads: int | None = None) -> Document:
        """Return the campaign of a file or a folder.

        Raises
        ------
        OSError, ValueError
            It cannot be read, or is not text.
        """
        path = Path(path)
        file = path / CAMPAIGN_FILE if path.is_dir() else path
        try:
            text = read_whole(file).decode("utf-8-sig").replace("\r\n", "\n")
        except UnicodeDecodeError as error:
            raise ValueError(f"{file} is not UTF-8 text (byte {error.start})") from None
        return cls(file, text, text, threads)

    @property
    def is_changed(self) -> bool:
        """Whether the text differs from the file."""
        return self.text != self.saved

    def with_text(self, text: str) -> Document:
        """Return the document with another text, right or wrong."""
        return replace(self, text=text)

    def with_value(self, path: Sequence[str | int], value: Any) -> Document:
        """Return the document with the value at a key; comments and order of the file stay.

        Raises
        ------
        ValueError
            The text is no TOML, or has no table at the beginning of the path.
        """
        try:
            contents = tomlkit.parse(self.text)
            table: Any = contents
            for key in path[:-1]:
                table = table[key]
            table[path[-1]] = value
        except (TOMLKitError, KeyError, IndexError, TypeError) as error:
            where = ".".join(map(str, path))
            raise ValueError(f"{self.file.name} has no {where}: {error}") from None
        return replace(self, text=tomlkit.dumps(contents))

    @cached_property
    def _read(self) -> Campaign | CampaignError:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ReceptanceWarning)  # its notes have the same texts
                campaign = Campaign.from_contents(self.file, tomllib.loads(self.text), self.text)
                return replace(campaign, threads=self.threads)
        except tomllib.TOMLDecodeError as error:
            return CampaignError(self.file, [Issue((), f"no TOML: {error}")])
        except CampaignError as error:
            return error
        except (OSError, ValueError, ReceptanceError) as error:
            return CampaignError(self.file, [Issue((), str(error))])

    @property
    def campaign(self) -> Campaign | None:
        """The campaign of the text; None where it has mistakes."""
        return self._read if isinstance(self._read, Campaign) else None

    @property
    def mistakes(self) -> tuple[Issue, ...]:
        """The mistakes of the text."""
        return () if isinstance(self._read, Campaign) else tuple(self._read.problems)

    def save(self) -> Document:
        """Write the text to the file, completely or not at all, and return the saved document.

        Raises
        ------
        ConflictError
            The file has changed since it was read.
        OSError
            It cannot be written.
        """
        if self.file.exists() and _digest(read_whole(self.file)) != _digest(self.saved.encode()):
            raise ConflictError(
                f"{self.file.name} has changed on the disk since it was opened: another page or program wrote it. "
                "Reload the page to read it again, or copy your changes first"
            )
        write_whole({self.file: self.text.encode()})
        return replace(self, saved=self.text)


def _digest(content: bytes) -> str:
    text = content.decode("utf-8-sig", errors="replace").replace("\r\n", "\n")
    return hashlib.sha256(text.encode()).hexdigest()
