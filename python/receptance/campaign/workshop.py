"""What the steps of building a campaign share: mistakes collected, warnings kept, names looked up."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeVar

from receptance.campaign.problems import path_text
from receptance.campaign.suggestions import did_you_mean, one_of
from receptance.errors import ReceptanceError

if TYPE_CHECKING:
    from receptance.campaign.lines import Path
    from receptance.campaign.problems import Problems

__all__ = ["OWNERS", "Workshop"]

OWNERS = ("parts", "modal_parts", "joints", "attachments", "sensors")
"""Sections whose names are first words of addresses."""
_SINGULAR = {
    "assemblies": "an assembly",
    "attachments": "an attachment",
    "materials": "a material",
    "parts": "a part",
    "modal_parts": "a modal part",
}
_KINDS = (
    "Material",
    "Segment",
    "Section",
    "Part",
    "ModalPart",
    "Mode",
    "PointJoint",
    "SpreadJoint",
    "ColletJoint",
    "MicroslipJoint",
    "PointMass",
    "GroundSpring",
    "Resonator",
    "Assembly",
    "Unknown",
    "Candidate",
    "Milling",
    "Turning",
)
_Made = TypeVar("_Made")


class Workshop:
    """Builds things at places of the file: a mistake is added to the list, a warning becomes a note.

    Parameters
    ----------
    problems : Problems
        Mistakes are added here.
    named : dict of str to list of str
        All names of each section, of tables with mistakes too.
    broken : frozenset of str
        Sections that are missing or no tables: nothing is said of names that would stand there.
    """

    def __init__(self, problems: Problems, named: dict[str, list[str]], broken: frozenset[str] = frozenset()) -> None:
        self.problems = problems
        self.named = named
        self._broken = broken
        self.notes: list[str] = []
        self.warnings: list[str] = []
        """Those of the notes that came as warnings."""

    def make(self, path: Path, build: Callable[..., _Made], /, *arguments: Any, **options: Any) -> _Made | None:
        """Return what is built, or None after its mistake is added."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                made = build(*arguments, **options)
            except (ValueError, TypeError, OSError, ReceptanceError) as error:
                self.problems.add(path, _without_owner(str(error)))
                return None
        for warning in caught:
            self.note(path, str(warning.message))
            self.warnings.append(self.notes[-1])
        return made

    def note(self, path: Path, text: str) -> None:
        """Add what a person should know, once: a warning that sums several notes up gives way to them."""
        place = f"{path_text(path)}: "
        said = _without_owner(text)
        self.notes[:] = [note for note in self.notes if not (note.startswith(place) and said in note)]
        self.notes.append(f"{place}{said}")

    def known(self, path: Path, name: str, *sections: str) -> bool:
        """Return whether a name is in one of some sections; add a mistake if not."""
        known = [other for section in sections for other in self.named[section]]
        if name in known or self.blind(*sections):
            return True
        what = " or ".join(_SINGULAR.get(section, f"a {section.removesuffix('s')}") for section in sections)
        self.problems.add(path, f'is "{name}", which is not {what} of this file{expected(name, known)}')
        return False

    def blind(self, *sections: str) -> bool:
        """Return whether one of some sections is missing or no table."""
        return not self._broken.isdisjoint(sections)


def expected(name: str, known: Iterable[str]) -> str:
    """Return what was expected in place of a name, the near one first."""
    choices = list(known)
    return f", expected {one_of(choices)}{did_you_mean(name, choices)}"


def _without_owner(text: str) -> str:
    """Leave out the owner that a message of the library begins with: the path says it."""
    owner, colon, rest = text.partition(": ")
    return rest if colon and owner.split(" ", 1)[0] in _KINDS else text
