"""The contents of a campaign: structures, measurements and unknowns, as read from its file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from receptance._text import instead_of
from receptance.campaign.build import Built, blanks_of
from receptance.campaign.cuts import CampaignCut
from receptance.campaign.measured_lines import MeasuredLines
from receptance.campaign.measurements import data_files
from receptance.campaign.problems import CampaignError, Issue
from receptance.campaign.read import campaign_fields, read_campaign, silent
from receptance.campaign.schema import CampaignTable
from receptance.fit import Tolerance, Unknown
from receptance.fit.observation import Observation
from receptance.fit.parameters import Site
from receptance.frf import FRF
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.predict import Candidate
from receptance.report import Column, Provenance, Renderable, Table

_NO_CUT = """there is no cut; write one, such as
  [cuts.slot]
  kind = "milling"
  teeth = 4
  k_t = "800 MPa"
  k_n = "250 MPa"
  x = { assembly = "long" }
where the assembly is one of this file, measured or not"""
_SPEEDS = {"mean force": 400, "semi-discretisation": 30}
"""Number of spindle speeds by default, by `stability.method`."""


@dataclass(frozen=True, kw_only=True)
class CampaignData(Renderable):
    """What a campaign file contains, with its data; `Campaign` has the analyses."""

    plotted_by = "receptance.campaign.figure:draw_campaign"
    drawn_in_notebooks = True

    file: Path
    """The campaign file."""
    table: CampaignTable
    """Contents of the file, checked; numbers in SI units."""
    assemblies: dict[str, Assembly]
    """Configurations by name, without sensors. Unknown parameters have their start values."""
    measurements: dict[str, Observation]
    """Measurements by name, with the assembly including the sensor; their configuration is the assembly's name."""
    on_blanks: dict[str, Observation] = field(default_factory=dict)
    """Measurements of blanks in a spindle, by name, with the blank alone; only `Campaign.spindle` uses them."""
    frfs: dict[str, FRF] = field(default_factory=dict, repr=False)
    """Measured FRFs by name, on all lines, whether they are used or not; see `measured_lines`."""
    unknowns: tuple[Unknown, ...]
    """Parameters to identify."""
    tolerances: dict[str, tuple[Tolerance, ...]] = field(default_factory=dict)
    """Errors of each assembly. Errors with the same name are one error."""
    errors: dict[str, tuple[Tolerance, ...]] = field(default_factory=dict)
    """Errors of each measurement: of its assembly and of what is attached to it."""
    places: dict[str, tuple[Coordinate, Coordinate]] = field(default_factory=dict)
    """Response and excitation at which assemblies without measurements are predicted."""
    candidates: dict[str, Candidate] = field(default_factory=dict)
    """Candidates for the next measurement."""
    cuts: dict[str, CampaignCut] = field(default_factory=dict)
    """Cuts whose stable depth is computed."""
    built: Built = field(default_factory=Built, repr=False)
    """Materials, parts, joints and attachments, for assemblies that are not in the file."""
    contents: dict[str, Any] = field(default_factory=dict, repr=False)
    """Contents of the file as they are written, with a table for each level of a series."""
    templates: dict[str, str] = field(default_factory=dict)
    """Measurements of a series, and the names of their tables in the file, such as "axial {level}"."""
    notes: tuple[str, ...] = ()
    threads: int | None = field(default=None, compare=False)
    """As in `Assembly.receptance`, for all analyses."""
    progress: Callable[[str], None] = field(default=silent, compare=False, repr=False)
    """Called with a line of text before each step of an analysis."""

    @classmethod
    def load(
        cls,
        path: str | Path,
        *,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
        unidentified: bool = False,
    ) -> Self:
        """Read a campaign file and the data files that it names.

        Parameters
        ----------
        path : str or path
            The TOML file, or a folder with a `campaign.toml`. Paths of data files are relative to it.
        threads : int, optional
            Threads of all analyses of the campaign, as in `Assembly.receptance`.
        progress : callable, optional
            Called with a line of text before each measurement is read, and before each step of an analysis.
        unidentified : bool, optional
            Whether spindles with blanks may lack their file, as before `Campaign.spindle`; assemblies that end with one
            are then left out, with their measurements.

        Returns
        -------
        Campaign
            Assemblies, measurements and unknowns.

        Raises
        ------
        CampaignError
            The file has mistakes; `.problems` lists all of them with place and line. It is a ValueError.
        OSError
            The file does not exist or cannot be opened.

        Warns
        -----
        ReceptanceWarning
            Suspicious data; the `notes` of the campaign list them as well.

        Examples
        --------
        >>> import tempfile
        >>> from receptance import campaign, examples
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     _ = examples.write("er32", folder)
        ...     er32 = campaign.Campaign.load(folder)
        >>> sorted(er32.assemblies)[:2]
        ['d11_long', 'd11_medium']
        """
        return cls(**read_campaign(path, threads=threads, progress=progress, unidentified=unidentified))

    @classmethod
    def from_contents(cls, file: Path, data: dict[str, Any], text: str = "") -> Self:
        """Return the campaign of the contents of a file, which need not exist.

        Parameters
        ----------
        file : Path
            The file; its folder is that of the data files.
        data : dict
            Contents of the TOML file.
        text : str, optional
            Its text, for the lines in messages.
        """
        return cls(**campaign_fields(file, data, text))

    @property
    def title(self) -> str:
        """Title, or else the name of the file."""
        return self.table.title or self.file.name

    def with_seed(self, seed: int) -> Self:
        """Return the campaign with another seed of the starts of fits and of the draws of stability."""
        settings = self.table.settings.with_(seed=seed)
        stability = self.table.stability.with_(seed=seed)
        return replace(self, table=self.table.with_(settings=settings, stability=stability))

    def provenance(self, *, seed: int | None = None, settings: Mapping[str, Any] | None = None) -> Provenance:
        """Return the provenance of results of this campaign."""
        return Provenance(
            title=self.title,
            description=self.description,
            file=self.file.name,
            settings=settings or {},
            seed=seed,
        )

    def error(self, text: str, *path: str) -> CampaignError:
        """Return an error about the file as a whole, or about a key."""
        return CampaignError(self.file, [Issue(path, text)])

    @property
    def to_identify(self) -> dict[str, Observation]:
        """Measurements that are used in the fit."""
        held_out = self.held_out
        return {name: observation for name, observation in self.measurements.items() if name not in held_out}

    @property
    def blanks(self) -> dict[str, str]:
        """Assemblies that are a blank in a spindle, and their spindles."""
        return blanks_of(self.table)

    @property
    def held_out(self) -> dict[str, Observation]:
        """Measurements that predictions are compared with."""
        names = {name for name, table in self.table.measurements.items() if table.role == "hold out"}
        return {name: observation for name, observation in self.measurements.items() if name in names}

    def files_of(self, name: str) -> tuple[str, ...]:
        """Return the names of the data files of a measurement."""
        return data_files(self.table.measurements[name])

    def measured_lines(self, name: str) -> MeasuredLines:
        """Return all lines of a measured FRF, and why some are not used; a KeyError for other measurements."""
        table = self.table.measurements[name]
        used = self.measurements[name]
        return MeasuredLines.of(self.frfs[name], used, getattr(table, "bands", None), getattr(table, "integrate", 0))

    def errors_of(self, names: Iterable[str]) -> list[Tolerance]:
        """Return the errors of measurements, each of its measurement alone; errors of the same name are one error."""
        return [replace(one, labels=name) for name in names for one in self.errors[name]]

    @property
    def unmeasured(self) -> dict[str, Assembly]:
        """Assemblies without any measurement."""
        measured = {observation.configuration for observation in self.measurements.values()}
        excluded = measured | self.blanks.keys()
        return {name: assembly for name, assembly in self.assemblies.items() if name not in excluded}

    @property
    def highest_frequency(self) -> float | None:
        """Upper limit of predictions in Hz: `prediction.upper`, else the highest measured frequency, else None."""
        upper, measured = self.table.prediction.upper, self.measured_band
        return upper if upper is not None or measured is None else measured[1]

    @property
    def measured_band(self) -> tuple[float, float] | None:
        """Lowest and highest measured frequency in Hz; None without measurements."""
        ends = [observation.frequency_hz[[0, -1]].real for observation in self.measurements.values()]
        return (float(np.min(ends)), float(np.max(ends))) if ends else None

    def site(self, name: str) -> Site:
        """Return an assembly with its configuration and conditions, for laws and tolerances."""
        return Site(self.assemblies[name], name, "", self.table.assemblies[name].conditions)

    def select_cuts(self, names: Sequence[str] = ()) -> list[CampaignCut]:
        """Return cuts by name; by default all.

        Raises
        ------
        CampaignError
            There are no cuts, or there is no such cut.
        """
        if not self.cuts:
            raise self.error(_NO_CUT)
        for name in names:
            if name not in self.cuts:
                raise self.error(f'there is no cut "{name}"{instead_of(name, self.cuts)}')
        return [self.cuts[name] for name in names] if names else list(self.cuts.values())

    def spindle_speeds(self) -> NDArray[np.float64]:
        """Return the spindle speeds in rpm for which stable depths are computed.

        Raises
        ------
        CampaignError
            The file has no `stability.speeds`.
        """
        settings = self.table.stability
        if settings.speeds is None:
            raise self.error(
                'there are no spindle speeds, expected `speeds = ["4000 rpm", "24000 rpm"]` under [stability]'
            )
        low, high = settings.speeds
        step = settings.step if settings.step is not None else (high - low) / _SPEEDS[settings.method]
        return low + step * np.arange(int((high - low) / step * (1.0 + 1e-12)) + 1, dtype=np.float64)

    @property
    def description(self) -> str:
        """Description of the file."""
        return self.table.description.strip()

    def tables(self) -> list[Table]:
        """Return the measurements; those of a series in a table of their own."""
        groups: dict[str, list[str]] = {}
        rows = []
        for name, observation in (*self.measurements.items(), *self.on_blanks.items()):
            if name in self.templates:
                groups.setdefault(self.templates[name], []).append(name)
            else:
                table = self.table.measurements[name]
                assembly = table.assembly if table.assembly != name else ""
                role = f"blank, {table.role}" if name in self.on_blanks else table.role
                rows.append((name, assembly, observation.describe(), table.sensor, role))
        tables = [Table("Measurements", ("name", "assembly", "data", "sensor", "role"), rows).without_empty()]
        series = []
        for template, group in groups.items():
            contents = dict.fromkeys({**self.measurements, **self.on_blanks}[name].describe() for name in group)
            data = next(iter(contents)) + (", and others" if len(contents) > 1 else "")
            series.append((template, len(group), sum(name in self.held_out for name in group), data))
        counts = (Column("levels", form="d"), Column("held out", form="d"))
        tables.append(Table("Measurements at levels", ("name", *counts, "data"), series))
        return [table for table in tables if table.rows]

    def __repr__(self) -> str:
        counts = [
            f"{len(self.assemblies)} assembl{'y' if len(self.assemblies) == 1 else 'ies'}",
            f"{len(self.measurements)} measurement{'' if len(self.measurements) == 1 else 's'}",
            f"{len(self.held_out)} held out",
        ]
        return f"Campaign({self.title!r}, {', '.join(counts)})"
