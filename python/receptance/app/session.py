"""What a page has open: the campaign, its results, and the values that the user has moved; without any widget."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, get_args

from receptance.app.document import Document
from receptance.app.work import Work
from receptance.campaign import Campaign, Prediction, Trial, extended_text
from receptance.diagnosis import Verdict
from receptance.errors import ReceptanceError
from receptance.fit import Identification
from receptance.stability import Stability

Topic = Literal["document", "trial", "identified", "verdict", "prediction", "stability", "work"]
"""What may change; views are told by topic."""
TOPICS: tuple[Topic, ...] = get_args(Topic)
_EXTENDED = "extended.toml"
"""Name of the campaign with an accepted cause."""


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
        self.work: Work | None = None
        self.held: set[str] = set()
        """Names of unknowns that a fit holds."""
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
        self.document = document
        self.identified = self.verdict = self.prediction = self.stability = self.trial = None
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
            self.trial = trial.at(fitting)
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

    def diagnose(self) -> None:
        """Begin to diagnose; raises as `begin`."""
        self.begin("diagnose", lambda campaign: campaign.diagnose())

    def cut(self) -> None:
        """Begin to compute the stability of all cuts; raises as `begin`."""
        identified = self.identified
        self.begin("stability", lambda campaign: campaign.stability(identified))

    def finish(self) -> Work | None:
        """Take over the result of a calculation that has ended, and return it; None while it runs."""
        work = self.work
        if work is None or work.runs:
            return None
        self.work = None
        topics: list[Topic] = ["work"]
        if isinstance(work.result, Identification):
            self.identified = work.result
            causes = () if self.trial is None else self.trial.variants
            self._start_trial()
            if causes and self.trial is not None:
                self.trial = self.trial.with_causes(causes)
            topics += ["identified", "trial"]
        elif isinstance(work.result, Verdict):
            self.verdict = work.result
            topics.append("verdict")
        elif isinstance(work.result, Prediction):
            self.prediction = work.result
            topics.append("prediction")
        elif isinstance(work.result, Stability):
            self.stability = work.result
            topics.append("stability")
        self.tell(*topics)
        return work

    # Causes.

    def accept(self) -> Document:
        """Return the campaign that the diagnosis has extended, as a new file that is not saved yet.

        Raises
        ------
        ValueError
            There is no explanation, or a campaign file cannot describe it.
        """
        if self.verdict is None or self.document is None or self.campaign is None:
            raise ValueError("there is no diagnosis")
        folder = self.document.file.parent
        text = extended_text(self.campaign, self.verdict, folder)
        return Document(folder / _EXTENDED, text, "", self.threads)
