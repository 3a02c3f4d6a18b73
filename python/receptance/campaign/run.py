"""A campaign: structures, measurements and unknowns, and the analyses that they allow."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance._text import did_you_mean, instead_of, one_of
from receptance.campaign.build import Built
from receptance.campaign.measurements import data_files
from receptance.campaign.problems import CampaignError, Issue, errors_about
from receptance.campaign.read import campaign_fields, read_campaign, silent
from receptance.campaign.tolerances import inherited_tolerances
from receptance.campaign.values import Deviation
from receptance.errors import ReceptanceError
from receptance.fit import Identification, Unknown, identify
from receptance.fit.observation import Observation
from receptance.fit.parameters import Site
from receptance.fit.unknowns import Law
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.model.joints import PointJoint
from receptance.model.terminals import ModalPart
from receptance.report import Column, Provenance, Renderable, Table

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.campaign.comparison import Comparison
    from receptance.campaign.prediction import Prediction
    from receptance.campaign.schema import CampaignTable
    from receptance.campaign.stability import CampaignCut
    from receptance.coupling import InverseCouplings
    from receptance.diagnosis import Cause, Metric, Verdict
    from receptance.diagnosis.model import Model
    from receptance.fit.unknowns import Tolerance
    from receptance.predict import Candidate, NextMeasurement, Transfer
    from receptance.predict.ranking import Target
    from receptance.stability import Stability
    from receptance.sweep import Candidates

_MOST_DRAWN = 3
"""Most assemblies that a notebook shows."""
_NO_CANDIDATES = """no candidates to rank; write a table for each measurement that you could take, such as
  [candidates."another overhang"]
  kind = "frf"
  assembly = "long"
  step = "4 Hz"
  upper = "6 kHz"
  standard_deviation = "1 %"
where the assembly is one of this file, measured or not"""
_NO_CUT = """there is no cut; write one, such as
  [cuts.slot]
  kind = "milling"
  teeth = 4
  k_t = "800 MPa"
  k_n = "250 MPa"
  x = { assembly = "long" }
where the assembly is one of this file, measured or not"""
_MODE_OF = re.compile(r"mode\[(\d+)\]")
_SPEEDS = {"mean force": 400, "semi-discretisation": 30}
"""Number of spindle speeds by default, by `stability.method`."""


@dataclass(frozen=True, kw_only=True)
class Campaign(Renderable):
    """A measuring campaign, read from a file with `Campaign.load`.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import campaign, examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("er32", folder)
    ...     er32 = campaign.Campaign.load(folder)
    >>> er32
    Campaign('The ER32 collet holder, published natural frequencies', 13 assemblies, 13 measurements, 8 held out)
    >>> found = er32.identify()
    >>> round(found.values["joint_d12.k_theta"], -3)
    104000.0
    """

    file: Path
    """The campaign file."""
    table: CampaignTable
    """Contents of the file, checked; numbers in SI units."""
    assemblies: dict[str, Assembly]
    """Configurations by name, without sensors. Unknown parameters have their start values."""
    measurements: dict[str, Observation]
    """Measurements by name, with the assembly including the sensor; their configuration is the assembly's name."""
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
        cls, path: str | Path, *, threads: int | None = None, progress: Callable[[str], None] | None = None
    ) -> Campaign:
        """Read a campaign file and the data files that it names.

        Parameters
        ----------
        path : str or path
            The TOML file, or a folder with a `campaign.toml`. Paths of data files are relative to it.
        threads : int, optional
            Threads of all analyses of the campaign, as in `Assembly.receptance`.
        progress : callable, optional
            Called with a line of text before each measurement is read, and before each step of an analysis.

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
        return cls(**read_campaign(path, threads=threads, progress=progress))

    @classmethod
    def from_contents(cls, file: Path, data: dict[str, Any], text: str = "") -> Campaign:
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

    def base_model(self, seen: Mapping[str, Observation] | None = None) -> tuple[Model, list[str]]:
        """Return the model for a diagnosis, and notes on unknowns that are left out.

        Parameters
        ----------
        seen : mapping of str to Observation, optional
            Measurements that are used; by default those that are not held out.
        """
        from receptance.diagnosis.model import Model

        seen = self.to_identify if seen is None else seen
        unknowns, left_out = observed_unknowns(self, seen)
        observations = tuple(seen.values())
        tolerances = tuple(self.errors_of(seen))
        return Model(observations, tuple(unknowns), tolerances, seed=self.table.settings.seed), left_out

    @property
    def title(self) -> str:
        """Title, or else the name of the file."""
        return self.table.title or self.file.name

    def with_seed(self, seed: int) -> Campaign:
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

    @property
    def to_identify(self) -> dict[str, Observation]:
        """Measurements that are used in the fit."""
        held_out = self.held_out
        return {name: observation for name, observation in self.measurements.items() if name not in held_out}

    @property
    def held_out(self) -> dict[str, Observation]:
        """Measurements that predictions are compared with."""
        names = {name for name, table in self.table.measurements.items() if table.role == "hold out"}
        return {name: observation for name, observation in self.measurements.items() if name in names}

    def files_of(self, name: str) -> tuple[str, ...]:
        """Return the names of the data files of a measurement."""
        return data_files(self.table.measurements[name])

    def errors_of(self, names: Iterable[str]) -> list[Tolerance]:
        """Return the errors of measurements, each of its measurement alone; errors of the same name are one error."""
        return [replace(one, labels=name) for name in names for one in self.errors[name]]

    @property
    def unmeasured(self) -> dict[str, Assembly]:
        """Assemblies without any measurement."""
        measured = {observation.configuration for observation in self.measurements.values()}
        return {name: assembly for name, assembly in self.assemblies.items() if name not in measured}

    @property
    def highest_frequency(self) -> float | None:
        """Upper limit of predictions in Hz: `prediction.upper`, else the highest measured frequency, else None."""
        measured = [float(observation.frequency_hz[-1].real) for observation in self.measurements.values()]
        upper = self.table.prediction.upper
        return max(measured, default=None) if upper is None else upper

    def site(self, name: str) -> Site:
        """Return an assembly with its configuration and conditions, for laws and tolerances."""
        return Site(self.assemblies[name], name, "", self.table.assemblies[name].conditions)

    def inherited_tolerances(
        self, assembly: Assembly, parts: Mapping[str, dict[str, Deviation]]
    ) -> tuple[Tolerance, ...]:
        """Return the errors of an assembly of elements of this campaign that is not in the file.

        Parameters
        ----------
        assembly : Assembly
            Parts, joints and attachments of the campaign, and other parts of its materials.
        parts : mapping of str to dict
            Names of the other parts, and the standard deviations of their dimensions by address.
        """
        return inherited_tolerances(assembly, self.table, self.built, parts)

    def select_cuts(self, names: Sequence[str] = ()) -> list[CampaignCut]:
        """Return cuts by name; by default all.

        Raises
        ------
        CampaignError
            There are no cuts, or there is no such cut.
        """
        if not self.cuts:
            raise CampaignError.about(self.file, _NO_CUT)
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
        settings = self.table.stability
        if settings.speeds is None:
            text = 'there are no spindle speeds, expected `speeds = ["4000 rpm", "24000 rpm"]` under [stability]'
            raise CampaignError.about(self.file, text)
        low, high = settings.speeds
        step = settings.step if settings.step is not None else (high - low) / _SPEEDS[settings.method]
        return low + step * np.arange(int((high - low) / step * (1.0 + 1e-12)) + 1, dtype=np.float64)

    @property
    def description(self) -> str:
        """Description of the file."""
        return self.table.description.strip()

    def drawing(self) -> Figure:
        """Return the figure that a notebook shows: the first assemblies to scale."""
        from receptance.model.figure import Drawing, draw_assemblies

        return draw_assemblies([Drawing(one, name) for name, one in list(self.assemblies.items())[:_MOST_DRAWN]])

    def tables(self) -> list[Table]:
        """Return the measurements; those of a series in a table of their own."""
        groups: dict[str, list[str]] = {}
        rows = []
        for name, observation in self.measurements.items():
            if name in self.templates:
                groups.setdefault(self.templates[name], []).append(name)
            else:
                table = self.table.measurements[name]
                assembly = table.assembly if table.assembly != name else ""
                rows.append((name, assembly, observation.describe(), table.sensor, table.role))
        tables = [Table("Measurements", ("name", "assembly", "data", "sensor", "role"), rows).without_empty()]
        series = []
        for template, own in groups.items():
            contents = dict.fromkeys(self.measurements[name].describe() for name in own)
            data = next(iter(contents)) + (", and others" if len(contents) > 1 else "")
            series.append((template, len(own), sum(name in self.held_out for name in own), data))
        counts = (Column("levels", form="d"), Column("held out", form="d"))
        tables.append(Table("Measurements at levels", ("name", *counts, "data"), series))
        return [table for table in tables if table.rows]

    def fitted(self) -> tuple[list[Unknown], list[str], list[Tolerance]]:
        """Return the unknowns of a fit, notes on those that are left out, and the errors.

        Raises
        ------
        CampaignError
            There are no unknowns or no measurements, or measurements have no weights.
        """
        seen = self.to_identify
        self._check_unknowns()
        if not seen:
            text = 'there is no measurement for identification, expected one with the role "identify"'
            raise CampaignError.about(self.file, text)
        unknowns, left_out = observed_unknowns(self, seen)
        return unknowns, left_out, weighted_tolerances(self, seen)

    def identify(self) -> Identification:
        """Identify the unknowns on the measurements that are not held out.

        Raises
        ------
        CampaignError
            There are no unknowns or no measurements, or more unknowns than measured values. It is a ValueError.
        ReceptanceError
            The model cannot be evaluated at any of the starts.
        """
        unknowns, left_out, tolerances = self.fitted()
        settings = self.table.settings
        observations = list(self.to_identify.values())
        lines = sum(o.frequency_hz.size for o in observations)
        by_level, unknowns, options = fit_options(self, observations, unknowns)
        self.progress(f"fitting {len(unknowns)} parameters to {lines} lines and modes from {options['starts']} starts")
        with errors_about(self.file):
            fit = identify(observations, unknowns, tolerances=tolerances, seed=settings.seed, **options)
        series = None
        if self.table.series is not None:
            from receptance.campaign.series import over_levels

            series = over_levels(self, fit)
        fit = replace(
            fit,
            series=series,
            groups=self.templates,
            provenance=self.provenance(seed=settings.seed, settings=settings.data()),
        )
        notes = [*self.notes, *left_out, *(n for n in fit.notes if not any(o.endswith(n) for o in self.notes))]
        if fit.errors:
            notes.append(
                f"{len(fit.errors)} errors of dimensions and materials are fitted with their tolerances as priors"
            )
        if by_level:
            notes.append(
                "each level was fitted separately first, then all together from these values; profile intervals are "
                "not computed for a series"
            )
            if not fit.series:
                from receptance.campaign.series import LEAST_LEVELS

                notes.append(
                    f"trends and laws are not fitted: they need at least {LEAST_LEVELS} different levels, none negative"
                )
        profiled = None
        if settings.profiles and not by_level and fit.known_scatter and settings.objective == "log":
            try:
                profiled = fit.profiles(progress=self.progress)
            except ReceptanceError as error:
                # The fit is a result without profiles as well; its linear intervals remain.
                notes.append(f"profile intervals are not computed: {error}")
        return replace(fit, notes=notes, profiled=profiled)

    def invert(
        self,
        joint: str | None = None,
        *,
        limit: float = 0.2,
    ) -> InverseCouplings:
        """Solve for the stiffness of joints on each frequency line, by inverse coupling.

        The FRFs that are not held out are used. With fewer FRFs than unknown terms, k_theta is solved for first, then
        k_y.

        Parameters
        ----------
        joint : str, optional
            Name of a joint; by default all joints with unknown stiffnesses.
        limit : float, optional
            As in `receptance.coupling.invert_coupling`.

        Raises
        ------
        CampaignError
            No such joint was measured with an FRF, or the FRFs have no lines in common.
        """
        from receptance.coupling import InverseCoupling, InverseCouplings, invert_coupling
        from receptance.coupling.line_equations import TERMS

        groups = joints_to_invert(self, joint)
        found: dict[str, InverseCoupling] = {}
        notes: list[str] = []
        provenance = self.provenance()
        for name, (owner, measured) in groups.items():
            self.progress(f"solving for {name}, {len(found) + 1} of {len(groups)}")
            unknown = [t for t in _ORDER if f"{owner}.{t}" in self.table.unknowns]
            terms = unknown[: len(measured)]
            if len(terms) < len(unknown):
                left = ", ".join(f"{owner}.{term}" for term in unknown[len(terms) :])
                count = f"{len(measured)} FRF{'' if len(measured) == 1 else 's'}"
                notes.append(
                    f"{name}: {count} can determine as many terms on each line; {left} is fixed at its start value"
                )
            with errors_about(self.file, f"{name}: "):
                one = invert_coupling(
                    list(measured.values()),
                    joint=owner,
                    terms=[term for term in TERMS if term in terms],
                    tolerances=self.errors_of(measured),
                    limit=limit,
                    threads=self.threads,
                )
            found[name] = replace(one, name=name, provenance=provenance)
            notes += [f"{name}: {note}" for note in one.notes]
        return InverseCouplings(found, provenance=provenance, notes=tuple(dict.fromkeys(notes)))

    def compare(
        self,
        candidates: Candidates,
        *,
        given: Mapping[str, float] | None = None,
        store: str | os.PathLike[str] | None = None,
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

        Raises
        ------
        CampaignError
            No measured assembly has a parameter; or as in `identify`.
        SweepError
            As in `receptance.sweep.sweep`.
        """
        from receptance.campaign.comparison import compare_candidates

        return compare_candidates(self, candidates, given=given, store=store)

    def next_measurement(
        self,
        identified: Identification | None = None,
        *,
        targets: Sequence[str] = (),
    ) -> NextMeasurement:
        """Rank the candidates by the expected uncertainty of unknowns or predictions after each of them.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given.
        targets : sequence of str, optional
            Names of unknowns, or of assemblies for their natural frequencies; by default all unknowns.

        Raises
        ------
        CampaignError
            There are no candidates, a target does not exist, or as in `identify`.
        """
        from receptance.predict import next_measurement

        if not self.candidates:
            raise CampaignError.about(self.file, _NO_CANDIDATES)
        known = identified or self.identify()
        chosen = [_target(name, self, known) for name in targets]
        with errors_about(self.file):
            found = next_measurement(
                known,
                list(self.candidates.values()),
                targets=chosen or None,
                level=self.table.prediction.level,
                profiles=known.profiled or {},
                progress=self.progress,
            )
        return replace(found, provenance=self.provenance(seed=known.seed))

    def predict(self, identified: Identification | None = None) -> Prediction:
        """Predict held-out measurements and assemblies without measurements.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given and there are unknowns.

        Raises
        ------
        CampaignError
            No measurement is held out and every assembly was measured; no prediction is possible; or as in `identify`.
        """
        from receptance.campaign.prediction import predict_campaign

        return predict_campaign(self, identified)

    def stability(self, identified: Identification | None = None, *, cuts: Sequence[str] = ()) -> Stability:
        """Compute stable depths of cut over spindle speed with bands, and recommended speeds.

        Parameters
        ----------
        identified : Identification, optional
            Result of `identify`; computed if it is not given, there are unknowns and a tip is predicted.
        cuts : sequence of str, optional
            Names of cuts; by default all.

        Raises
        ------
        CampaignError
            There are no cuts or no speeds, a cut does not exist, or as in `identify`.
        """
        from receptance.campaign.stability import stability_of_campaign

        return stability_of_campaign(self, identified, cuts=cuts)

    def transferred(self) -> list[Tolerance]:
        """Return the errors of all measurements, whose assemblies `transfer` predicts; raise if it cannot."""
        self._check_unknowns()
        if len({observation.configuration for observation in self.measurements.values()}) < 2:
            text = "fewer than two assemblies were measured, expected at least two, to predict one from the others"
            raise CampaignError.about(self.file, text)
        return weighted_tolerances(self, self.measurements)

    def transfer(
        self,
        *,
        splits: Literal["leave-one-out", "one-for-all"] = "leave-one-out",
        draws: int = 200,
    ) -> Transfer:
        """Predict every measured assembly from the others; roles of measurements are ignored.

        Parameters
        ----------
        splits : {"leave-one-out", "one-for-all"}, optional
            Each assembly from all others, or all others from each.
        draws : int, optional
            As in `receptance.predict.transfer`.

        Raises
        ------
        CampaignError
            There are no unknowns, fewer than two assemblies were measured, or as in `identify`.
        """
        from receptance.predict import transfer

        tolerances = self.transferred()
        notes = list(self.notes)
        if self.held_out:
            notes.append('the role "hold out" is ignored, because each assembly is held out once')
        settings, observations = self.table.settings, list(self.measurements.values())
        _, unknowns, options = fit_options(self, observations, self.unknowns)
        with errors_about(self.file):
            found = transfer(
                observations,
                unknowns,
                tolerances=tolerances,
                splits=splits,
                level=self.table.prediction.level,
                draws=draws,
                seed=settings.seed,
                progress=self.progress,
                **options,
            )
        provenance = self.provenance(settings=settings.data())
        return replace(found, campaign_notes=tuple(dict.fromkeys(notes)), provenance=provenance)

    def diagnose(
        self,
        causes: Iterable[Cause | str] | None = None,
        *,
        fast: bool = False,
        metrics: Mapping[str, Metric] | None = None,
    ) -> Verdict:
        """Test whether the model explains the measurements, and find the cause if it does not.

        Errors of dimensions and materials are fitted with their tolerances as priors. A cause is judged by how much it
        improves predictions: of held-out measurements, or of assemblies that are left out in turn if none is held out.

        Parameters
        ----------
        causes : sequence of Cause and str, optional
            Causes or their ids; by default all of `receptance.diagnosis.CATALOGUE`.
        fast, metrics
            As in `receptance.diagnosis.diagnose`; metrics are of held-out measurements as well.

        Raises
        ------
        CampaignError
            There are no unknowns or no measurements, or measurements have no standard deviations. It is a ValueError.
        """
        from receptance.diagnosis import diagnose
        from receptance.diagnosis.held_out import improvement
        from receptance.diagnosis.thresholds import LEAST_FREEDOM
        from receptance.diagnosis.truncation import truncation_time

        self._check_unknowns()
        if not self.measurements:
            raise CampaignError.about(self.file, "there are no measurements, expected `measurements`")
        notes = list(self.notes)
        seen, held_out = dict(self.to_identify), dict(self.held_out)
        numbers = sum(one.independent_values for one in seen.values())
        if held_out and numbers - len(self.unknowns) < LEAST_FREEDOM:
            notes.append(
                f"{numbers:.3g} measured values for {len(self.unknowns)} unknowns are too few to test the model, so "
                "held-out measurements are used in the diagnosis; improvement is computed for assemblies left out in "
                "turn"
            )
            notes += _held_out_error(self)
            seen, held_out = dict(self.measurements), {}
        if not seen:
            text = 'there is no measurement for the diagnosis, expected one with the role "identify"'
            raise CampaignError.about(self.file, text)
        model, left_out = self.base_model(seen)
        started = started_by_mode(self, model.observations, model.unknowns)
        if started is not None:
            model = replace(model, unknowns=tuple(started))
        settings = self.table.settings
        with errors_about(self.file):
            verdict = diagnose(
                model.observations,
                model.unknowns,
                tolerances=model.tolerances,
                causes=causes,
                seed=settings.seed,
                threads=self.threads,
                held_out=not held_out,
                fast=fast,
                metrics=metrics,
                progress=self.progress,
            )
        if held_out and verdict.final:
            observations = tuple(held_out.values())
            unseen = replace(
                verdict.selection.base.model,
                observations=observations,
                # Held-out records may end at another time, or not at all.
                truncation=truncation_time([observation for observation in observations if observation.is_receptance]),
                tolerances=tuple(self.errors_of(held_out)),
            )
            found = improvement(verdict.selection, verdict.explanation, unseen, metrics)
            verdict = replace(verdict.with_improvement(found), held_out=unseen)
        notes += [*left_out, *verdict.notes]
        if started is not None:
            notes += _notes_on_modes(self, verdict)
        return replace(verdict, notes=tuple(dict.fromkeys(notes)), provenance=self.provenance())

    def _check_unknowns(self) -> None:
        if not self.unknowns:
            raise CampaignError.about(self.file, "there are no unknowns, expected `unknowns`")

    def __repr__(self) -> str:
        counts = [
            f"{len(self.assemblies)} assembl{'y' if len(self.assemblies) == 1 else 'ies'}",
            f"{len(self.measurements)} measurement{'' if len(self.measurements) == 1 else 's'}",
            f"{len(self.held_out)} held out",
        ]
        return f"Campaign({self.title!r}, {', '.join(counts)})"


load = Campaign.load
"""`Campaign.load`, as a function."""


_ORDER = ("k_theta", "k_y", "k_ytheta")
"""Terms of a joint in the order in which they are solved for if there are fewer FRFs than terms."""


def fit_options(
    campaign: Campaign, observations: Sequence[Observation], unknowns: Sequence[Unknown]
) -> tuple[bool, list[Unknown], dict[str, Any]]:
    """Return whether the levels of a series are fitted separately first, unknowns with start values, and options."""
    settings = campaign.table.settings
    by_level = campaign.table.series is not None and any(
        isinstance(unknown, Law) and unknown.free for unknown in unknowns
    )
    started = started_by_mode(campaign, observations, unknowns)
    by_mode = started is not None
    if started is None and by_level:
        from receptance.campaign.series import started_by_level

        started = started_by_level(campaign, observations, unknowns)
    return (
        by_level,
        list(unknowns) if started is None else started,
        {
            "objective": settings.objective,
            "band_width_percent": 100.0 * settings.band_width,
            "starts": 1 if by_level or by_mode else settings.starts,
            "max_evaluations": settings.max_evaluations,
            "threads": campaign.threads,
            "strategy": "direct" if by_level or by_mode else settings.strategy,
        },
    )


def started_by_mode(
    campaign: Campaign, observations: Sequence[Observation], unknowns: Sequence[Unknown]
) -> list[Unknown] | None:
    """Return unknowns with the starts of a fit to which the modes of modal parts were added; None without such modes.

    Modes with a row of their own among the unknowns have the start of that row.
    """
    table = campaign.table
    started: list[Unknown] | None = None
    for name, part in table.modal_parts.items():
        given = {match[1] for address in table.unknowns if (match := _MODE_OF.match(address.removeprefix(f"{name}.")))}
        if not part.identify or len(given) == len(part.modes):
            continue
        from receptance.coupling.unknown_modes import start_modes

        campaign.progress(f"adding the {len(part.modes)} modes of {name} one at a time")
        with errors_about(campaign.file):
            started = start_modes(
                observations,
                unknowns if started is None else started,
                name,
                starts=table.settings.starts,
                seed=table.settings.seed,
                threads=campaign.threads,
            )
    return started


def _notes_on_modes(campaign: Campaign, verdict: Verdict) -> list[str]:
    """Return notes on what a diagnosis with unknown modes of a spindle can decide."""
    count = sum(len(part.modes) for part in campaign.table.modal_parts.values() if part.identify)
    notes = []
    if verdict.final and (hidden := verdict.selection.absorbed):
        notes.append(
            f"these data do not show causes of typical size that the joint and the {count} unknown modes imitate: "
            f"{', '.join(hidden)}; measure another overhang, or the spindle alone, to decide them"
        )
    if not verdict.adequacy.passed:
        notes.append(
            f"{count} unknown modes may be too few: before a cause is searched for, try `modes = {count + 2}`, which "
            "changes the description of the spindle alone"
        )
    return notes


def weighted_tolerances(campaign: Campaign, seen: Mapping[str, Observation]) -> list[Tolerance]:
    """Return the errors of all measurements; the objective must have a likelihood, and measurements weights."""
    tolerances = campaign.errors_of(seen)
    if not tolerances:
        return []
    if campaign.table.settings.objective == "percentage":
        raise CampaignError(
            campaign.file,
            [
                Issue(
                    ("settings", "objective"),
                    'is "percentage", which has no likelihood, so that errors of dimensions and materials cannot be '
                    'fitted; expected "log", or no tolerances',
                )
            ],
        )
    unweighted = [name for name, measured in seen.items() if not measured.weighted]
    if unweighted:
        expected = (
            "has no standard deviation, which a fit of errors of dimensions and materials needs; expected "
            '`standard_deviation`, such as "2 %", or no tolerances'
        )
        raise CampaignError(campaign.file, [Issue(("measurements", name), expected) for name in unweighted])
    return tolerances


def observed_unknowns(campaign: Campaign, seen: Mapping[str, Observation]) -> tuple[list[Unknown], list[str]]:
    """Return the unknowns that some fitted measurement depends on, and notes on the others."""
    places = [measured.site(index) for index, measured in enumerate(seen.values())]
    kept, notes = [], []
    for unknown in campaign.unknowns:
        own = [place for place in places if place.among(unknown.configurations)]
        if any(place.covered(address) for place in own for address in unknown.addresses):
            kept.append(unknown)
        else:
            notes.append(f"{unknown.address} is not identified: no measurement of its assemblies is for identification")
    if not kept:
        raise CampaignError.about(campaign.file, "no measurement for identification depends on an unknown")
    return kept, notes


def joints_to_invert(campaign: Campaign, joint: str | None = None) -> dict[str, tuple[str, dict[str, Observation]]]:
    """Return by name a joint and its FRFs; joints that differ between assemblies are listed for each assembly."""
    from receptance.coupling.line_equations import TERMS

    unknown = campaign.table.unknowns
    owners = list(dict.fromkeys(a.split(".", 1)[0] for a in unknown if a.split(".", 1)[-1] in TERMS))
    owners = [name for name in owners if joint is None or name == joint]
    groups: dict[str, tuple[str, dict[str, Observation]]] = {}
    for owner in owners:
        own = [unknown[a] for a in unknown if a.startswith(f"{owner}.")]
        changing = any(one.free or one.power_of or one.individual for one in own)
        for name, one in campaign.to_identify.items():
            if not one.is_receptance or not isinstance(one.assembly.elements.get(owner), PointJoint):
                continue
            ends = [name for name, end in one.assembly.elements.items() if isinstance(end, ModalPart)]
            if any(address.startswith(f"{ends[0]}.") for u in campaign.unknowns for address in u.addresses if ends):
                raise CampaignError.about(
                    campaign.file,
                    f"{ends[0]}, the modal part behind {owner}, has unknowns, but inverse coupling needs its "
                    "receptance; identify the campaign instead, or write the identified modes into the file "
                    "and remove them from the unknowns",
                )
            title = f"{owner} @ {one.configuration}" if changing else owner
            groups.setdefault(title, (owner, {}))[1][name] = one
    if not groups:
        which = "point joint" if joint is None else f'joint "{joint}"'
        raise CampaignError.about(
            campaign.file, f"no {which} with unknown stiffnesses was measured with an FRF for identification"
        )
    return groups


def _held_out_error(campaign: Campaign) -> list[str]:
    """Return a note on the error of the base model for the held-out measurements."""
    from receptance.diagnosis.by_mode import bias_of, slenderness_of
    from receptance.diagnosis.fitting import fit_base
    from receptance.diagnosis.held_out import FREQUENCIES, metrics_of

    model, _ = campaign.base_model()
    out = replace(
        model,
        observations=tuple(campaign.held_out.values()),
        tolerances=tuple(campaign.errors_of(campaign.held_out)),
    )
    try:
        errors, modes = metrics_of(fit_base(model), out, scored=False)
    except (ValueError, ReceptanceError):
        return []
    if FREQUENCIES not in errors:
        return []
    bias = bias_of(modes, slenderness_of(out))
    text = "identified without the held-out measurements, the model predicts their natural frequencies with an rms "
    return [f"{text}error of {errors[FREQUENCIES]:.2f} %" + ("" if bias is None else f"; {bias}")]


def _target(name: str, campaign: Campaign, fit: Identification) -> Target:
    """Return the name of an unknown, or the natural frequencies of an assembly up to `highest_frequency`."""
    from receptance.predict import Candidate

    if name in fit.values:
        return name
    if name not in campaign.assemblies:
        choices = [*(n for n in fit.addresses if n not in fit.errors), *campaign.assemblies]
        text = f'the target "{name}" is neither an identified parameter nor an assembly, expected {one_of(choices)}'
        raise CampaignError.about(campaign.file, text + did_you_mean(name, choices))
    errors = campaign.tolerances.get(name, ())
    conditions = campaign.site(name).conditions
    predicted = fit.at(campaign.assemblies[name], configuration=name, conditions=conditions, tolerances=errors)
    upper = campaign.highest_frequency
    assert upper is not None  # a fit has measurements
    modes = predicted.assembly.natural_frequencies(upper)
    if not modes.size:
        raise CampaignError.about(campaign.file, f'the target "{name}" has no natural frequency below {upper:g} Hz')
    observation = Observation.from_modes(
        label=name,
        assembly=campaign.assemblies[name],
        modes=range(1, modes.size + 1),
        configuration=name,
        conditions=conditions,
    )
    return Candidate(observation=observation, tolerances=errors)
