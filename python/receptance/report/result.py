"""The protocol of results: the methods that a class defines, and those that it inherits; their source and data."""

from __future__ import annotations

import math
import platform
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np

from receptance import _core, report
from receptance._text import first_of
from receptance.report.rejection import ACCEPTED, Rejection
from receptance.report.table import Fact, Table, joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST_SOURCES = 3
"""Number of sources, such as measurements, whose notes are printed; `to_dict` contains all notes."""


def grouped_notes(notes: Sequence[str]) -> Iterator[str]:
    """Yield notes; several notes of one source, the text before a colon, follow the name of the source.

    Examples
    --------
    >>> from receptance.report.result import grouped_notes
    >>> list(grouped_notes(["a.csv: 3 lines skipped", "a.csv: 10 averages", "seed 0"]))
    ['a.csv:', '  3 lines skipped', '  10 averages', 'seed 0']
    """
    sources: dict[str, list[str]] = {}
    for note in notes:
        source, colon, text = note.partition(": ")
        if colon:
            sources.setdefault(source, []).append(text)
    several = [source for source, texts in sources.items() if len(texts) > 1]
    shown = set(several[:_MOST_SOURCES])
    started: set[str] = set()
    for note in notes:
        source, colon, _ = note.partition(": ")
        if not colon or source not in several:
            yield note
        elif source in shown and source not in started:
            started.add(source)
            yield f"{source}:"
            yield from (f"  {text}" for text in sources[source])
    rest = len(several) - len(shown)
    if rest:
        having = "source has" if rest == 1 else "sources have"
        yield f"{rest} more {having} notes: `to_dict` and --json have all of them"


def versions() -> dict[str, str]:
    """Return the versions of the package, Python, NumPy and SciPy, and the instruction set of the core, by name.

    Examples
    --------
    >>> from receptance.report import versions
    >>> sorted(versions())
    ['instruction_set', 'numpy', 'python', 'receptance', 'scipy']
    """
    return {
        "receptance": _version("receptance"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": _version("scipy"),
        "instruction_set": _core.instruction_set(),
    }


def _version(package: str) -> str:
    from importlib import metadata  # slow to import

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed as a package"


_versions_once = cache(versions)


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Source of a result."""

    title: str = ""
    """Title of the campaign; empty without one, like the following two."""
    description: str = field(default="", repr=False)
    file: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Settings of the campaign that the result depends on; empty without a campaign."""
    seed: int | None = None
    """Seed of all random numbers; None if none were drawn."""
    versions: Mapping[str, str] = field(default_factory=_versions_once, repr=False)
    """Versions of the software."""

    def sentence(self) -> str:
        """Return seed and versions as a line of text."""
        seed = "" if self.seed is None else f"seed {self.seed}; "
        return seed + ", ".join(f"{name} {value}" for name, value in self.versions.items())


def plain(value: Any) -> Any:
    """Return a value as dictionaries, lists, text, numbers and None.

    A number that is not finite becomes None, a complex number a pair, a dataclass a dictionary of its fields.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.report.result import plain
    >>> plain({"a": np.array([1.0, np.inf]), "b": (1 + 2j,)})
    {'a': [1.0, None], 'b': [[1.0, 2.0]]}
    """
    if isinstance(value, np.generic):
        value = value.item()
    # Most values are numbers of arrays, and the check for a mapping takes longest.
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if is_dataclass(value):
        return {attribute.name: plain(getattr(value, attribute.name)) for attribute in fields(value)}
    return value


class Renderable(ABC):
    """Base of everything that is shown as text and as HTML: a subclass defines the content, which is rendered here.

    A subclass has the attribute `notes` (sentences for the user), defines `title`, and overrides the other methods that
    apply to it.
    """

    plotted_by: ClassVar[str] = ""
    """Function that draws this, as `package.module:function`; empty if there is no figure.

    It is loaded when a figure is drawn, so that results do not import matplotlib.
    """
    drawn_in_notebooks: ClassVar[bool] = False
    """Whether a notebook shows the figure below the title."""

    if TYPE_CHECKING:

        @property
        def notes(self) -> Sequence[str]:
            """Notes for the user, a sentence each."""

    @property
    @abstractmethod
    def title(self) -> str:
        """Title."""

    @property
    def description(self) -> str:
        """Text below the title."""
        return ""

    @property
    def origin(self) -> str:
        """Last line: seed and versions of the software."""
        return ""

    def facts(self) -> list[Fact]:
        """Return the answer as findings with labels, which are shown before sentences and tables."""
        return []

    def tables(self) -> list[Table]:
        """Return the tables."""
        return []

    def sentences(self) -> list[str]:
        """Return the findings, a sentence each."""
        return []

    def warnings(self) -> Sequence[str]:
        """Return recommendations for the user, a sentence each; they are shown above all numbers."""
        return ()

    @property
    def rejection(self) -> Rejection:
        """Why the numbers must not be used, or are widened: text, figures, HTML and JSON begin with it.

        Numbers that come from a fit have the rejection of the fit.
        """
        return ACCEPTED

    @property
    def next_step(self) -> str:
        """Next step for the user, shown below the tables; empty without one."""
        return ""

    def grouped_notes(self) -> Iterator[str]:
        """Yield the notes as `grouped_notes` does."""
        return grouped_notes(self.notes)

    def summary(self, width: int = 100) -> str:
        """Return the content as text: rejection, warnings, findings, tables, next step and notes.

        Parameters
        ----------
        width : int, optional
            Number of characters per line, at least 40. Numbers are never cut; wide tables are split.
        """
        return report.terminal.as_text(self, width)

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw the content.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes that are replaced by the figure; several panels share their place. By default a new figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure; save it with `savefig`.

        Raises
        ------
        TypeError
            There is no figure of this type.
        """
        return self._plot(ax)

    def _plot(self, ax: Axes | None, **options: Any) -> Figure:
        if not self.plotted_by:
            raise TypeError(f"plot: there is no figure of a {type(self).__name__}")
        figure: Figure = resolve_name(self.plotted_by)(self, ax, **options)
        return figure

    def _repr_html_(self) -> str:
        return report.html.as_html(self, self.plot() if self.drawn_in_notebooks else None)


@dataclass(frozen=True)
class PageSection:
    """A section of the page of a result: paragraphs, figures with their titles, side by side, and tables."""

    title: str
    texts: Sequence[str] = ()
    figures: Sequence[tuple[str, Figure]] = ()
    tables: Sequence[Table] = ()


class Result(Renderable):
    """Base of all results: a subclass defines tables, sentences and data, which are rendered here.

    A subclass has the attributes `provenance` and `notes`, defines `data` and `plotted_by`, and overrides the other
    methods that apply to it.
    """

    heading: ClassVar[str] = "Result"
    """Type of the result in its title."""

    if TYPE_CHECKING:

        @property
        def provenance(self) -> Provenance:
            """Source of the result."""

    @property
    def title(self) -> str:
        """Title of the campaign, if there is one, and type of the result."""
        return f"{self.provenance.title}: {self.heading.lower()}" if self.provenance.title else self.heading

    @property
    def description(self) -> str:
        """Description of the campaign."""
        return self.provenance.description

    @property
    def origin(self) -> str:
        """Seed and versions of the software; empty without a campaign."""
        return self.provenance.sentence() if self.provenance.file else ""

    @property
    def badge(self) -> str:
        """The answer in one or two words, below the title of the page; empty without one."""
        return ""

    def key_figures(self) -> Sequence[tuple[str, Sequence[str]]]:
        """Return the few numbers that a reader of the page looks for first: names, and values before and after."""
        return ()

    def sections(self) -> Sequence[PageSection]:
        """Return the sections of the page below the answer, in place of the figure of `plot`."""
        return ()

    @abstractmethod
    def data(self) -> dict[str, Any]:
        """Return the values of this result for `to_dict`; arrays and dataclasses are allowed."""

    def to_html(self, title: str = "", *, measured: Sequence[Table] = ()) -> str:
        """Return the result as one HTML page without scripts, which needs no network.

        Parameters
        ----------
        title : str, optional
            Heading, by default that of the result.
        measured : sequence of Table, optional
            Tables of the data, such as `Campaign.tables()`, shown below the result.

        Returns
        -------
        str
            The page; write it to a file with the ending `.html`, encoded as UTF-8.
        """
        return report.html.result_page(self, title, measured)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as values that JSON supports; a number that is not finite is None."""
        origin = self.provenance
        values: dict[str, Any] = {**self.rejection.data()}
        values |= {"campaign": origin.title, "file": origin.file} if origin.file else {}
        values |= {**self.data(), "notes": self.notes}
        if origin.settings:
            values["settings"] = origin.settings
        if origin.seed is not None:
            values["seed"] = origin.seed
        whole: dict[str, Any] = plain({**values, "versions": origin.versions})
        return whole


_Inner = TypeVar("_Inner", bound=Result)


class Results(Result, Mapping[str, _Inner], Generic[_Inner]):
    """Results of one type by name, such as the joints of a campaign; a mapping and a result, with notes on all."""

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
        """Source of the results."""
        return self._provenance

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user, a sentence each."""
        return self._notes

    def tables(self) -> list[Table]:
        """Return the tables of all results; tables with the same title and columns are joined."""
        return joined(table for result in self.values() for table in result.tables())

    def sentences(self) -> list[str]:
        """Return the findings of all results."""
        return [sentence for result in self.values() for sentence in result.sentences()]

    def warnings(self) -> list[str]:
        """Return the recommendations of all results."""
        return list(dict.fromkeys(text for result in self.values() for text in result.warnings()))

    @property
    def rejection(self) -> Rejection:
        """The rejections of all results."""
        return sum((result.rejection for result in self.values()), ACCEPTED)

    def data(self) -> dict[str, Any]:
        """Return the data of all results by name."""
        return {self.key: {name: {**result.data(), "notes": result.notes} for name, result in self.items()}}

    def __getitem__(self, name: str) -> _Inner:
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({{{first_of([f'{name!r}: {item!r}' for name, item in self._items.items()])}}})"
