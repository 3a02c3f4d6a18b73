"""What a page has open: the campaign, its results, and the values that the user has moved; without any widget."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal, get_args

from receptance._files import new_path
from receptance.campaign import Campaign, CampaignCheck, Prediction, Trial, extended_text
from receptance.campaign.write import with_campaign_lines
from receptance.catalogue import Catalogue, CatalogueSummary, predict_catalogue, summary_of
from receptance.diagnosis import Cause, Verdict
from receptance.diagnosis.presentation import beyond_chance
from receptance.diagnosis.verdict import CandidateCause
from receptance.errors import ReceptanceError, ReceptanceWarning
from receptance.fit import Identification
from receptance.report import Result
from receptance.session.document import Document
from receptance.session.export import Kind, write_result
from receptance.session.work import Work
from receptance.stability import Stability

Topic = Literal["document", "trial", "identified", "verdict", "prediction", "stability", "catalogue", "work"]
"""What may change; views are told by topic."""
TOPICS: tuple[Topic, ...] = get_args(Topic)
_RESULTS: dict[type[Result], Topic] = {
    Identification: "identified",
    Verdict: "verdict",
    Prediction: "prediction",
    Stability: "stability",
    CatalogueSummary: "catalogue",
}
"""Topics of the results of calculations, which are also the names of their attributes."""
_EXTENDED = "extended"
"""Name of the campaign with an accepted cause, without ending."""


class Session:
    """The state of a page.

    Results are those of the text as it is: a change of the text removes them.
    """

    def __init__(self, folder: Path, *, threads: int | None = None) -> None:
        self.folder = folder.resolve()
        self.threads = threads
        self.document: Document | None = None
        self.identified: Identification | None = None
        self.trial: Trial | None = None
        self.verdict: Verdict | None = None
        self.prediction: Prediction | None = None
        self.stability: Stability | None = None
        self.catalogue: CatalogueSummary | None = None
        self.work: Work | None = None
        self.held: set[str] = set()
        """Names of unknowns that a fit holds."""
        self._untouched: Trial | None = None
        """The trial as it began."""
        self._missing: dict[str, str] | None = None
        self._listeners: dict[Topic, list[Callable[[], None]]] = {topic: [] for topic in TOPICS}

    # Listeners.

    def on(self, *topics: Topic, call: Callable[[], None]) -> None:
        """Call a function after each change of a topic."""
        for topic in topics:
            self._listeners[topic].append(call)

    def tell(self, *topics: Topic) -> None:
        """Call the functions of topics, each once."""
        for call in dict.fromkeys(call for topic in topics for call in self._listeners[topic]):
            call()

    # The document.

    @property
    def campaign(self) -> Campaign | None:
        """The campaign as it is edited; None without one, or with mistakes."""
        return None if self.document is None else self.document.campaign

    @property
    def missing(self) -> dict[str, str]:
        """What the campaign lacks for each command, by its name; empty for one that can run, and without a campaign."""
        if self._missing is None:
            campaign = self.campaign
            self._missing = {} if campaign is None else CampaignCheck(campaign).missing
        return self._missing

    def open(self, file: str | Path) -> None:
        """Open a campaign file or a folder with one, below the folder of the session.

        Raises
        ------
        PermissionError
            The file is not below the folder.
        OSError, ValueError
            It cannot be read.
        """
        path = (self.folder / file).resolve()
        if not path.is_relative_to(self.folder):
            raise PermissionError(f"{file} is not below {self.folder}, the folder that was opened")
        self.edit(Document.open(path, threads=self.threads))

    def edit(self, document: Document) -> None:
        """Show another document, or another text; values that were moved are taken over where they fit."""
        moved = {} if self.trial is None else dict(self.trial.values)
        # Of a calculation with another text nothing is shown.
        self.stop()
        self.work = None
        self.document = document
        self.identified = self.verdict = self.prediction = self.stability = self.catalogue = self.trial = None
        self._missing = None
        self._start_trial(moved)
        self.tell(*TOPICS)

    def save(self) -> None:
        """Write the text to its file; raises as `Document.save`."""
        if self.document is not None:
            self.document = self.document.save()
            self.tell("document")

    # Values.

    def _start_trial(self, values: dict[str, float] | None = None) -> None:
        campaign = self.campaign
        self.trial = None
        if campaign is None or not campaign.unknowns or not campaign.to_identify:
            return
        try:
            trial = campaign.trial(self.identified).with_overhangs()
            fitting = {u.name: values[u.name] for u in trial.unknowns
                       if values and u.name in values and u.lower <= values[u.name] <= u.upper}  # fmt: skip
            self.trial = self._untouched = trial.at(fitting)
        except (ValueError, ReceptanceError):
            self.trial = None  # `receptance check` tells what is missing

    def move(self, values: dict[str, float]) -> None:
        """Give unknowns other values; raises as `Trial.at`."""
        if self.trial is not None:
            self.set_trial(self.trial.at(values))

    def set_trial(self, trial: Trial) -> None:
        """Show another trial."""
        self.trial = trial
        self.tell("trial")

    def restart(self) -> None:
        """Go back to the values of the last identification, or to the start values, without causes."""
        self._start_trial()
        self.tell("trial")

    def fit(self) -> None:
        """Move all unknowns that are not held to the optimum; raises as `Trial.fit`."""
        if self.trial is not None:
            self.set_trial(self.trial.fit(self.held & {unknown.name for unknown in self.trial.unknowns}))

    # Long calculations.

    def begin(self, name: str, analysis: Callable[[Campaign], Any]) -> None:
        """Begin a calculation with the campaign; views poll `finish`.

        Raises
        ------
        ValueError
            There is no campaign without mistakes, or another calculation runs.
        """
        if self.campaign is None:
            raise ValueError("there is no campaign without mistakes")
        if self.work is not None:
            raise ValueError(f"{self.work.name} still runs; stop it first")
        self.work = Work(name, self.campaign, analysis)
        self.tell("work")

    def identify(self) -> None:
        """Begin to identify; raises as `begin`."""
        self.begin("identify", lambda campaign: campaign.identify())

    def predict(self) -> None:
        """Begin to predict; raises as `begin`."""
        identified = self.identified
        self.begin("predict", lambda campaign: campaign.predict(identified))

    def diagnose(self, causes: Iterable[Cause | str] | None = None) -> None:
        """Begin to diagnose, with all causes by default; raises as `begin`."""
        self.begin("diagnose", lambda campaign: with_campaign_lines(campaign, campaign.diagnose(causes)))

    def cut(self) -> None:
        """Begin to compute the stability of all cuts; raises as `begin`."""
        identified = self.identified
        self.begin("stability", lambda campaign: campaign.stability(identified))

    def predict_catalogue(self) -> None:
        """Begin to predict all tools of the catalogue; raises as `begin`."""
        identified = self.identified

        def analysis(campaign: Campaign) -> CatalogueSummary:
            catalogue = Catalogue(campaign)
            return summary_of(catalogue, predict_catalogue(catalogue, identified))

        self.begin("catalogue", analysis)

    def stop(self) -> None:
        """Stop a calculation that runs, with the answer so far."""
        if self.work is not None:
            self.work.stop()

    def finish(self) -> Work | None:
        """Take over the result of a calculation that has ended, and return it; None while it runs."""
        work = self.work
        if work is None or work.runs:
            return None
        self.work = None
        topics: list[Topic] = ["work"]
        topic = _RESULTS.get(type(work.result))
        if topic is not None:
            setattr(self, topic, work.result)
            topics.append(topic)
        fit = work.result if topic == "identified" else getattr(work.result, "identified", None)
        if topic == "identified" or (self.identified is None and isinstance(fit, Identification)):
            # Other results have the fit that they were made with.
            self.identified = fit
            topics.append("identified")
            if topic == "identified" or self.trial is self._untouched:
                causes = () if self.trial is None else self.trial.variants
                self._start_trial()
                if causes and self.trial is not None:
                    self.trial = self.trial.with_causes(causes)
                topics.append("trial")
        self.tell(*topics)
        return work

    # Causes.

    @property
    def leading(self) -> tuple[CandidateCause, ...]:
        """The causes that explain more than noise does by chance, the highest evidence first."""
        return () if self.verdict is None else tuple(beyond_chance(self.verdict))

    def show_cause(self, cause: CandidateCause | None) -> None:
        """Show the model with a fitted cause as it was fitted, or the fitted model without one.

        Raises
        ------
        ValueError
            There is no diagnosis.
        UndecidableError
            A measurement that is held out cannot have the cause.
        """
        if self.verdict is None:
            raise ValueError("there is no diagnosis")
        self._start_trial()
        if self.trial is not None:
            fit = self.verdict.selection.base if cause is None else cause.explanation.fit
            variants = () if cause is None else cause.explanation.variants
            self.set_trial(self.trial.as_fitted(variants, fit.values))

    def accept(self) -> Document:
        """Return the campaign that the diagnosis has extended, as a new file that is not saved yet.

        Raises
        ------
        ValueError
            There is no explanation, the diagnosis was stopped, or a campaign file cannot describe it.
        """
        if self.verdict is None or self.document is None or self.campaign is None:
            raise ValueError("there is no diagnosis")
        if not self.verdict.final:
            raise ValueError("the diagnosis was interrupted")
        folder = self.document.file.parent
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReceptanceWarning)  # they were given when the data were read
            text = extended_text(self.campaign, self.verdict, folder)
        return Document(new_path(folder, _EXTENDED, ".toml"), text, "", self.threads)

    # Files.

    def export(self, result: Result, kind: Kind) -> list[Path]:
        """Write a figure, report or tables of a result beside the campaign, under new names, and return the files.

        Raises
        ------
        OSError
            A file cannot be written.
        ValueError
            There is no campaign, or no such content.
        """
        if self.document is None or self.campaign is None:
            raise ValueError("there is no campaign without mistakes")
        measured = self.campaign.tables() if result is self.identified else ()
        stem = f"{self.document.file.stem}-{result.heading.lower()}"
        return write_result(result, kind, self.document.file.parent, stem, measured)
