"""The protocol of results: what a class declares, and what all of them offer."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from receptance import provenance
from receptance.report.plain import plain
from receptance.report.table import Table, joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Provenance", "Result", "Results"]

_versions = cache(provenance.versions)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where a result comes from.

    Attributes
    ----------
    title, description, file : str
        Title, description and file name of the campaign; empty where there is none.
    settings : dict
        Settings of the campaign that the result depends on; empty where there is none.
    seed : int or None
        Seed of all random numbers; None where none were drawn.
    versions : dict of str to str
        Versions of the software.
    """

    title: str = ""
    description: str = field(default="", repr=False)
    file: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict, repr=False)
    seed: int | None = None
    versions: Mapping[str, str] = field(default_factory=_versions, repr=False)

    def sentence(self) -> str:
        """Return seed and versions as a line of text."""
        seed = "" if self.seed is None else f"seed {self.seed}; "
        return seed + ", ".join(f"{name} {value}" for name, value in self.versions.items())


class Result:
    """Base of all results: a class declares tables, sentences and data, and is rendered here.

    A class has the attributes `provenance` and `notes` (sentences that a user should know) and overrides `tables`,
    `sentences`, `data` and `plot`; `warnings` where there is something to act on.
    """

    heading: ClassVar[str] = "Result"
    """Kind of the result, as it is printed."""

    if TYPE_CHECKING:

        @property
        def provenance(self) -> Provenance:
            """Where the result comes from."""

        @property
        def notes(self) -> Sequence[str]:
            """Sentences that a user should know."""

    @property
    def title(self) -> str:
        """Title of the campaign, if there is one, and kind of the result."""
        return f"{self.provenance.title}: {self.heading.lower()}" if self.provenance.title else self.heading

    def tables(self) -> list[Table]:
        """Return the tables of the result."""
        return []

    def sentences(self) -> list[str]:
        """Return the findings, a sentence each."""
        return []

    def warnings(self) -> Sequence[str]:
        """Return what the user should act on, a sentence each."""
        return ()

    def data(self) -> dict[str, Any]:
        """Return what is particular to this result in `to_dict`, in which arrays and dataclasses may stand."""
        raise NotImplementedError

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the result.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes in whose place the result is drawn; several panels share that place. By default a new figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure. A new one belongs to no window; save it with `savefig`.
        """
        raise NotImplementedError

    def to_dict(self) -> dict[str, Any]:
        """Return the result as values that JSON can hold; a number that is not finite is None."""
        origin = self.provenance
        found: dict[str, Any] = {"campaign": origin.title, "file": origin.file} if origin.file else {}
        found |= {**self.data(), "notes": self.notes}
        if origin.settings:
            found["settings"] = origin.settings
        if origin.seed is not None:
            found["seed"] = origin.seed
        whole: dict[str, Any] = plain({**found, "versions": origin.versions})
        return whole

    def summary(self, width: int = 100) -> str:
        """Return the result as text: findings, tables, warnings and notes.

        Parameters
        ----------
        width : int, optional
            Number of characters on a line, at least 40. Numbers are never cut; wide tables are printed in parts.
        """
        from receptance.report.terminal import as_text

        return as_text(self, width)

    def _repr_html_(self) -> str:
        from receptance.report.html import as_html

        return as_html(self)


_Inner = TypeVar("_Inner", bound=Result)


class Results(Result, Mapping[str, _Inner], Generic[_Inner]):
    """Results of one kind by name, such as the joints of a campaign; a mapping and itself a result.

    Parameters
    ----------
    items : mapping of str to Result
        The results.
    provenance : Provenance, optional
        Where they come from.
    notes : sequence of str, optional
        Sentences that a user should know, of all of them.
    """

    key: ClassVar[str] = "results"
    """Name of the results in `to_dict`."""

    def __init__(
        self, items: Mapping[str, _Inner], *, provenance: Provenance | None = None, notes: Sequence[str] = ()
    ) -> None:
        self._items = dict(items)
        self._provenance = provenance or Provenance()
        self._notes = tuple(notes)

    @property
    def provenance(self) -> Provenance:
        """Where the results come from."""
        return self._provenance

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences that a user should know."""
        return self._notes

    def tables(self) -> list[Table]:
        """Return the tables of all results; those with the same title and columns are one."""
        return joined(table for one in self.values() for table in one.tables())

    def sentences(self) -> list[str]:
        """Return the findings of all results."""
        return [sentence for one in self.values() for sentence in one.sentences()]

    def warnings(self) -> list[str]:
        """Return what the user should act on, of all results."""
        return list(dict.fromkeys(text for one in self.values() for text in one.warnings()))

    def data(self) -> dict[str, Any]:
        """Return the data of all results by name."""
        return {self.key: {name: {**one.data(), "notes": one.notes} for name, one in self.items()}}

    def __getitem__(self, name: str) -> _Inner:
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._items!r})"
