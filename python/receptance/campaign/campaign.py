"""A campaign: what was measured, on what, and what is to be found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

from receptance._files import write_whole
from receptance.assembly import Assembly
from receptance.campaign.builder import Built
from receptance.campaign.observations import Measurement
from receptance.campaign.quantities import Condition
from receptance.campaign.tolerances import Effects
from receptance.coordinates import Coordinate
from receptance.identification import Candidate, Unknown
from receptance.identification.mapping import Place
from receptance.report import Column, Provenance, Table

if TYPE_CHECKING:
    from receptance.campaign.comparison import Prediction
    from receptance.campaign.cuts import CampaignCut
    from receptance.campaign.format import CampaignTable
    from receptance.diagnosis import Cause, Metric, Verdict
    from receptance.identification import Identification, InverseCouplings, NextMeasurement, Transfer
    from receptance.stability import Stability

__all__ = ["Campaign"]


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A measuring campaign, read from a file with `receptance.campaign.load`.

    Attributes
    ----------
    file : Path
        Where it was read.
    table : CampaignTable
        The file as it stands, checked; numbers in SI units.
    assemblies : dict of str to Assembly
        Configurations by name, without sensors. Parameters among the unknowns have their start values.
    measurements : dict of str to Measurement
        Measurements by name.
    unknowns : tuple of Unknown
        What is to be identified.
    effects : dict
        Tolerances: by assembly, error and address the standard deviation in SI units. Errors of one name are one.
    conditions : dict
        By assembly and key: numbers that describe it.
    places : dict
        Response and excitation at which assemblies that were not measured are predicted.
    candidates : dict of str to Candidate
        Measurements that could be taken next.
    cuts : dict of str to CampaignCut
        Cuts whose stability is asked for.
    built : Built
        Materials, parts, joints and attachments, for assemblies that are not in the file.
    templates : dict of str to str
        Of measurements at the levels of a series: their names in the file, such as "axial {level}".
    notes : tuple of str
        What a person should know.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import campaign, examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("er32", folder)
    ...     er32 = campaign.load(folder)
    >>> er32
    Campaign('The ER32 collet holder, published natural frequencies', 13 assemblies, 13 measurements, 8 held out)
    >>> found = er32.identify()
    >>> round(found.values["joint_d12.k_theta"], -3)
    104000.0
    """

    file: FilePath
    table: CampaignTable
    assemblies: dict[str, Assembly]
    measurements: dict[str, Measurement]
    unknowns: tuple[Unknown, ...]
    effects: dict[str, Effects] = field(default_factory=dict)
    conditions: dict[str, dict[str, Condition]] = field(default_factory=dict)
    places: dict[str, tuple[Coordinate, Coordinate]] = field(default_factory=dict)
    candidates: dict[str, Candidate] = field(default_factory=dict)
    cuts: dict[str, CampaignCut] = field(default_factory=dict)
    built: Built = field(default_factory=Built, repr=False)
    templates: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Its title, or the name of its file."""
        return self.table.title or self.file.name

    def provenance(self, *, seed: int | None = None, settings: Mapping[str, Any] | None = None) -> Provenance:
        """Return the provenance of results of this campaign."""
        return Provenance(
            title=self.title,
            description=self.table.description.strip(),
            file=self.file.name,
            settings=settings or {},
            seed=seed,
        )

    @property
    def to_identify(self) -> dict[str, Measurement]:
        """Measurements that the fit sees."""
        return {name: measured for name, measured in self.measurements.items() if not measured.held_out}

    @property
    def held_out(self) -> dict[str, Measurement]:
        """Measurements that predictions are compared with."""
        return {name: measured for name, measured in self.measurements.items() if measured.held_out}

    @property
    def unmeasured(self) -> dict[str, Assembly]:
        """Assemblies without any measurement."""
        measured = {one.assembly for one in self.measurements.values()}
        return {name: assembly for name, assembly in self.assemblies.items() if name not in measured}

    def place_of(self, name: str) -> Place:
        """An assembly with its configuration and conditions, as laws and tolerances need to know it."""
        conditions = {key: one.value for key, one in self.conditions.get(name, {}).items()}
        return Place(self.assemblies[name], name, "", conditions)

    def tables(self) -> list[Table]:
        """Return what was measured; the levels of a series in a table of their own."""
        groups: dict[str, list[Measurement]] = {}
        rows = []
        for name, one in self.measurements.items():
            if name in self.templates:
                groups.setdefault(self.templates[name], []).append(one)
            else:
                assembly = one.assembly if one.assembly != name else ""
                rows.append((name, assembly, one.observation.describe(), one.sensor, one.role))
        tables = [Table("Measurements", ("name", "assembly", "data", "sensor", "role"), rows).without_empty()]
        series = []
        for template, own in groups.items():
            contents = dict.fromkeys(one.observation.describe() for one in own)
            data = next(iter(contents)) + (", and others" if len(contents) > 1 else "")
            series.append((template, len(own), sum(one.held_out for one in own), data))
        counts = (Column("levels", form="d"), Column("held out", form="d"))
        tables.append(Table("Measurements at levels", ("name", *counts, "data"), series))
        return [table for table in tables if table.rows]

    def identify(self, *, threads: int | None = None, progress: Callable[[str], None] | None = None) -> Identification:
        """Identify the unknowns on the measurements that are not held out.

        Parameters
        ----------
        threads : int, optional
            As in `Assembly.receptance`.
        progress : callable, optional
            Called with a line of text before each step.

        Raises
        ------
        CampaignError
            Nothing is unknown, nothing is measured, or more is unknown than measured. It is a ValueError.
        ReceptanceError
            The model has no value at any of the starts.
        """
        from receptance.campaign.identification import identify_campaign

        return identify_campaign(self, threads=threads, progress=progress)

    def invert(
        self,
        joint: str | None = None,
        *,
        limit: float = 0.2,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> InverseCouplings:
        """Solve for the stiffness of joints on each line by itself, by inverse coupling.

        From the FRFs that are not held out; where there are fewer than unknown terms, for k_theta, then k_y.

        Parameters
        ----------
        joint : str, optional
            Name of one; by default all that have unknown stiffnesses.
        limit : float, optional
            As in `receptance.identification.invert_coupling`.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            No such joint was measured with an FRF, or the FRFs have no lines in common.
        """
        from receptance.campaign.inversion import invert_campaign

        return invert_campaign(self, joint=joint, limit=limit, threads=threads, progress=progress)

    def next_measurement(
        self,
        identified: Identification | None = None,
        *,
        targets: Sequence[str] = (),
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> NextMeasurement:
        """Rank the candidates by how well unknowns or predictions are expected to be known with them.

        Parameters
        ----------
        identified : Identification, optional
            From `identify`, which runs first if it is not given.
        targets : sequence of str, optional
            Unknowns, or assemblies, whose natural frequencies are then meant; by default all unknowns.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            There are no candidates, an unknown target, or as in `identify`.
        """
        from receptance.campaign.next_step import next_of_campaign

        return next_of_campaign(self, identified, targets=targets, threads=threads, progress=progress)

    def predict(
        self,
        identified: Identification | None = None,
        *,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Prediction:
        """Predict what is held out and the assemblies that were not measured.

        Parameters
        ----------
        identified : Identification, optional
            From `identify`, which runs first if it is not given and anything is unknown.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            Nothing is held out and every assembly was measured; nothing of it can be predicted; or as in `identify`.
        """
        from receptance.campaign.prediction import predict_campaign

        return predict_campaign(self, identified, threads=threads, progress=progress)

    def stability(
        self,
        identified: Identification | None = None,
        *,
        cuts: Sequence[str] = (),
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Stability:
        """Return the depths up to which cuts are stable over spindle speed, with bands, and recommended speeds.

        Parameters
        ----------
        identified : Identification, optional
            From `identify`, which runs first if it is not given, anything is unknown and a tip is predicted.
        cuts : sequence of str, optional
            Names of some; by default all.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            There are no cuts, no such cut, no speeds; or as in `identify`.
        """
        from receptance.campaign.stability import stability_of_campaign

        return stability_of_campaign(self, identified, cuts=cuts, threads=threads, progress=progress)

    def transfer(
        self,
        *,
        splits: Literal["leave-one-out", "one-for-all"] = "leave-one-out",
        draws: int = 200,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Transfer:
        """Predict every measured assembly from the others, whatever the roles of the measurements.

        Parameters
        ----------
        splits : {"leave-one-out", "one-for-all"}, optional
            Each assembly from all others, or all others from each.
        draws : int, optional
            As in `receptance.identification.transfer`.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            Nothing is unknown, or fewer than two assemblies were measured; or as in `identify`.
        """
        from receptance.campaign.transfer import transfer_campaign

        return transfer_campaign(self, splits=splits, draws=draws, threads=threads, progress=progress)

    def diagnose(
        self,
        causes: Iterable[Cause | str] | None = None,
        *,
        metrics: Mapping[str, Metric] | None = None,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Verdict:
        """Say whether the model is adequate for what was measured, and what it lacks if not.

        All tolerances are fitted, with what is stated as what is known. Improvement is measured on what is held out,
        or, where nothing is, on assemblies that are left out in turn.

        Parameters
        ----------
        causes : sequence of Cause and str, optional
            Causes or their ids; by default all of `receptance.diagnosis.CATALOGUE`.
        metrics : mapping of str to callable, optional
            As in `receptance.diagnosis.diagnose`, on what is held out.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            Nothing is unknown, nothing is measured, or measurements have no standard deviations. It is a ValueError.
        """
        from receptance.campaign.diagnosis import diagnose_campaign

        return diagnose_campaign(self, causes=causes, metrics=metrics, threads=threads, progress=progress)

    def extended_text(self, verdict: Verdict, folder: str | FilePath) -> str:
        """Return the model that a diagnosis has extended as the text of a campaign file.

        `identify` and `predict` take it like any other campaign; the unknowns begin where the diagnosis ended.

        Parameters
        ----------
        verdict : Verdict
            From `diagnose` of this campaign.
        folder : path-like
            Folder of the file; data files are named from there.

        Raises
        ------
        ValueError
            There is no extended model, or a campaign file cannot describe it.
        """
        from receptance.campaign.extended import extended_text

        return extended_text(self, verdict, FilePath(folder))

    def write_extended(self, verdict: Verdict, path: str | FilePath) -> FilePath:
        """Write the model that a diagnosis has extended as a campaign file, completely or not at all.

        Parameters and errors are those of `extended_text`; returns the path.
        """
        target = FilePath(path)
        write_whole({target: self.extended_text(verdict, target.parent).encode("utf-8")})
        return target

    def __repr__(self) -> str:
        counts = [
            f"{len(self.assemblies)} assembl{'y' if len(self.assemblies) == 1 else 'ies'}",
            f"{len(self.measurements)} measurement{'' if len(self.measurements) == 1 else 's'}",
            f"{len(self.held_out)} held out",
        ]
        return f"Campaign({self.title!r}, {', '.join(counts)})"
