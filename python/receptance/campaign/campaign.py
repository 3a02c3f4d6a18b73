"""A campaign: structures, measurements and unknowns, and the analyses that they allow."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance._text import instead_of
from receptance.campaign.builder import Built
from receptance.campaign.measurements import Measurement
from receptance.campaign.problems import CampaignError
from receptance.campaign.quantities import Condition, Deviation
from receptance.campaign.tolerances import Effects, inherited_effects
from receptance.identification import Candidate, Unknown
from receptance.identification.mapping import Site
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.report import Column, Provenance, Table

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from receptance.campaign.comparison import Comparison
    from receptance.campaign.cuts import CampaignCut
    from receptance.campaign.format import CampaignTable
    from receptance.campaign.prediction import Prediction
    from receptance.diagnosis import Cause, Metric, Verdict
    from receptance.identification import Identification, InverseCouplings, NextMeasurement, Transfer
    from receptance.stability import Stability
    from receptance.sweep import Candidates

__all__ = ["Campaign"]

_SPEEDS = {"mean force": 400, "semi-discretisation": 30}
"""Number of spindle speeds by default, by `stability.method`."""


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A measuring campaign, read from a file with `receptance.campaign.load`.

    Attributes
    ----------
    file : Path
        The campaign file.
    table : CampaignTable
        Contents of the file, checked; numbers in SI units.
    assemblies : dict of str to Assembly
        Configurations by name, without sensors. Unknown parameters have their start values.
    measurements : dict of str to Measurement
        Measurements by name.
    unknowns : tuple of Unknown
        Parameters to identify.
    effects : dict
        Errors of each assembly: by assembly, error and address the standard deviation in SI units. Errors with the same
        name are one error.
    conditions : dict of str to dict of str to Condition
        Conditions of each assembly, such as a torque.
    places : dict of str to tuple of Coordinate
        Response and excitation at which assemblies without measurements are predicted.
    candidates : dict of str to Candidate
        Candidates for the next measurement.
    cuts : dict of str to CampaignCut
        Cuts whose stable depth is computed.
    built : Built
        Materials, parts, joints and attachments, for assemblies that are not in the file.
    templates : dict of str to str
        Measurements of a series, and the names of their tables in the file, such as "axial {level}".
    notes : tuple of str
        Notes for the user.

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

    file: Path
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
        """Title, or else the name of the file."""
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
        """Measurements that are used in the fit."""
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

    @property
    def highest_frequency(self) -> float | None:
        """Upper limit of predictions in Hz: `prediction.upper`, else the highest measured frequency, else None."""
        measured = [float(one.observation.frequency_hz[-1].real) for one in self.measurements.values()]
        asked = self.table.prediction.upper
        return max(measured, default=None) if asked is None else asked

    def site(self, name: str) -> Site:
        """Return an assembly with its configuration and conditions, for laws and tolerances."""
        conditions = {key: one.value for key, one in self.conditions.get(name, {}).items()}
        return Site(self.assemblies[name], name, "", conditions)

    def inherited_effects(self, assembly: Assembly, parts: Mapping[str, dict[str, Deviation]]) -> Effects:
        """Return the errors of an assembly of elements of this campaign that is not in the file.

        Parameters
        ----------
        assembly : Assembly
            Parts, joints and attachments of the campaign, and other parts of its materials.
        parts : mapping of str to dict
            Names of the other parts, and the standard deviations of their dimensions by address.
        """
        return inherited_effects(assembly, self.table, self.built, parts)

    def select_cuts(self, names: Sequence[str] = ()) -> list[CampaignCut]:
        """Return cuts by name; by default all.

        Raises
        ------
        CampaignError
            There are no cuts, or there is no such cut.
        """
        if not self.cuts:
            raise CampaignError.about(self.file, "there is no cut, expected [cuts.NAME]")
        for name in names:
            if name not in self.cuts:
                raise CampaignError.about(self.file, f'there is no cut "{name}"{instead_of(name, self.cuts)}')
        return [self.cuts[name] for name in names] if names else list(self.cuts.values())

    def spindle_speeds(self) -> NDArray[np.float64]:
        """Return the spindle speeds in rpm for which stable depths are computed.

        Raises
        ------
        CampaignError
            The file has no `stability.speeds`.
        """
        asked = self.table.stability
        if asked.speeds is None:
            text = 'there are no spindle speeds, expected `speeds = ["4000 rpm", "24000 rpm"]` under [stability]'
            raise CampaignError.about(self.file, text)
        low, high = asked.speeds
        step = asked.step if asked.step is not None else (high - low) / _SPEEDS[asked.method]
        return low + step * np.arange(int((high - low) / step * (1.0 + 1e-12)) + 1, dtype=np.float64)

    def tables(self) -> list[Table]:
        """Return the measurements; those of a series in a table of their own."""
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
            There are no unknowns or no measurements, or more unknowns than measured values. It is a ValueError.
        ReceptanceError
            The model cannot be evaluated at any of the starts.
        """
        from receptance.campaign.run import identify_campaign

        return identify_campaign(self, threads=threads, progress=progress)

    def invert(
        self,
        joint: str | None = None,
        *,
        limit: float = 0.2,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> InverseCouplings:
        """Solve for the stiffness of joints on each frequency line, by inverse coupling.

        The FRFs that are not held out are used. With fewer FRFs than unknown terms, k_theta is solved for first, then
        k_y.

        Parameters
        ----------
        joint : str, optional
            Name of a joint; by default all joints with unknown stiffnesses.
        limit : float, optional
            As in `receptance.identification.invert_coupling`.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            No such joint was measured with an FRF, or the FRFs have no lines in common.
        """
        from receptance.campaign.run import invert_campaign

        return invert_campaign(self, joint=joint, limit=limit, threads=threads, progress=progress)

    def compare(
        self,
        candidates: Candidates,
        *,
        given: Mapping[str, float] | None = None,
        store: str | os.PathLike[str] | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Comparison:
        """Compare many values of parameters with the measurements that are not held out.

        Unknowns that neither vary nor have a given value are identified first, together with those that vary, and keep
        their identified values.

        Parameters
        ----------
        candidates : Grid, Listed or Sampled
            Values of parameters, by address; see `receptance.sweep`.
        given : mapping of str to float, optional
            Values of other parameters in SI units, by address.
        store : path, optional
            As in `receptance.sweep.sweep`.
        progress : callable, optional
            As in `identify`.

        Raises
        ------
        CampaignError
            No measured assembly has a parameter; or as in `identify`.
        SweepError
            As in `receptance.sweep.sweep`.
        """
        from receptance.campaign.comparison import compare_candidates

        return compare_candidates(self, candidates, given=given, store=store, progress=progress)

    def next_measurement(
        self,
        identified: Identification | None = None,
        *,
        targets: Sequence[str] = (),
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> NextMeasurement:
        """Rank the candidates by the expected uncertainty of unknowns or predictions after each of them.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given.
        targets : sequence of str, optional
            Names of unknowns, or of assemblies for their natural frequencies; by default all unknowns.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            There are no candidates, a target does not exist, or as in `identify`.
        """
        from receptance.campaign.run import rank_candidates

        return rank_candidates(self, identified, targets=targets, threads=threads, progress=progress)

    def predict(
        self,
        identified: Identification | None = None,
        *,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Prediction:
        """Predict held-out measurements and assemblies without measurements.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given and there are unknowns.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            No measurement is held out and every assembly was measured; no prediction is possible; or as in `identify`.
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
        """Compute stable depths of cut over spindle speed with bands, and recommended speeds.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given, there are unknowns and a tip is predicted.
        cuts : sequence of str, optional
            Names of cuts; by default all.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            There are no cuts or no speeds, a cut does not exist, or as in `identify`.
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
        """Predict every measured assembly from the others; roles of measurements are ignored.

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
            There are no unknowns, fewer than two assemblies were measured, or as in `identify`.
        """
        from receptance.campaign.run import transfer_campaign

        return transfer_campaign(self, splits=splits, draws=draws, threads=threads, progress=progress)

    def diagnose(
        self,
        causes: Iterable[Cause | str] | None = None,
        *,
        metrics: Mapping[str, Metric] | None = None,
        threads: int | None = None,
        progress: Callable[[str], None] | None = None,
    ) -> Verdict:
        """Test whether the model explains the measurements, and find the cause if it does not.

        Errors of dimensions and materials are fitted with their tolerances as priors. A cause is judged by how much it
        improves predictions: of held-out measurements, or of assemblies that are left out in turn if none is held out.

        Parameters
        ----------
        causes : sequence of Cause and str, optional
            Causes or their ids; by default all of `receptance.diagnosis.CATALOGUE`.
        metrics : mapping of str to callable, optional
            As in `receptance.diagnosis.diagnose`, for held-out measurements.
        threads, progress
            As in `identify`.

        Raises
        ------
        CampaignError
            There are no unknowns or no measurements, or measurements have no standard deviations. It is a ValueError.
        """
        from receptance.campaign.run import diagnose_campaign

        return diagnose_campaign(self, causes=causes, metrics=metrics, threads=threads, progress=progress)

    def __repr__(self) -> str:
        counts = [
            f"{len(self.assemblies)} assembl{'y' if len(self.assemblies) == 1 else 'ies'}",
            f"{len(self.measurements)} measurement{'' if len(self.measurements) == 1 else 's'}",
            f"{len(self.held_out)} held out",
        ]
        return f"Campaign({self.title!r}, {', '.join(counts)})"
