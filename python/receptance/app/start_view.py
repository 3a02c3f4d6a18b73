"""The view "Start": measurement files are dropped, what they do not state is asked, and the campaign is written."""

from __future__ import annotations

import base64
import binascii
from html import escape
from typing import Any

from bokeh.layouts import column, row
from bokeh.models import Button, CustomJS, FileInput, LayoutDOM, MultiSelect, TextInput

from receptance import draft, report
from receptance.app import look
from receptance.app.view import PageOfView
from receptance.errors import ReceptanceError
from receptance.io.files import ENDINGS
from receptance.report.html import table_html
from receptance.session.start import CHANNELS, ChosenFile, Start
from receptance.session.uploads import HOLDER_ENDINGS, LARGEST_UPLOAD, ExistingFilesError, store


class _Field:
    """The input of an answer with its mistake below."""

    def __init__(self, view: StartView, name: str, label: str, example: str, file: str = "") -> None:
        self.input = TextInput(title=label, placeholder=example, name=f"{name} {file}".strip(), width=400)
        self.problem = look.text(role="status", classes=["problem"])
        self.problem.visible = False
        self.layout = column(self.input, self.problem, width=410)
        self.input.on_change("value", lambda attr, old, new: view.answered(name, new, file))

    def show(self, problem: str) -> None:
        """Show what is wrong, or nothing."""
        self.problem.text, self.problem.visible = escape(problem), bool(problem)


class StartView:
    """The view "Start"."""

    title = "Start"

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        self.start = Start(page.session.folder)
        self.fields: dict[tuple[str, str], _Field] = {}
        self._pending: dict[str, bytes] = {}
        self._arrived: dict[str, list[str]] = {"filename": [], "value": []}
        accept = ",".join((*ENDINGS, *HOLDER_ENDINGS))
        self.drop = FileInput(
            title="Drop your measurement files", multiple=True, accept=accept, width=400, css_classes=["drop"]
        )
        self.drop.on_change("value", self._dropped)
        self.drop.on_change("filename", self._dropped)
        self.chosen = MultiSelect(title="Files of the campaign", options=self._options(), value=[], size=6, width=400)
        self.chosen.on_change("value", lambda attr, old, new: self._choose(new))
        self.conflict = look.text(role="alert")
        self.conflict.visible = False
        self.replace: Button = look.button("Replace", self.replace_files, width=150)
        self.keep: Button = look.button("Keep the old ones", self.keep_files, width=150)
        self._of_conflict = row(self.replace, self.keep, visible=False)
        self._questions = column(width=410)
        self.figure = look.text(classes=["drawing"])
        self.summary, self.contents = look.text(role="status"), look.text()
        self.write: Button = look.button("Write campaign", self.write_campaign, primary=True, width=150)
        self.overwrite: Button = look.button("Replace campaign.toml", self.replace_campaign, width=180)
        self.overwrite.visible = False
        self.layout: LayoutDOM = row(
            column(self.drop, self.conflict, self._of_conflict, self.chosen, self._questions,
                   row(self.write, self.overwrite), width=420),
            column(self.figure, self.summary, self.contents, sizing_mode="stretch_width"),
            sizing_mode="stretch_width",
        )  # fmt: skip
        self.show()

    # Files.

    def _options(self) -> list[tuple[str, str]]:
        return [(name, name) for name in self.start.available]

    def _dropped(self, attr: str, old: Any, new: Any) -> None:
        # Both arrive one after the other, and are emptied by `clear`.
        self._arrived[attr] = new or []
        names, values = self._arrived["filename"], self._arrived["value"]
        if not names or len(names) != len(values):
            return
        self._arrived = {"filename": [], "value": []}
        try:
            contents = {name: base64.b64decode(value, validate=True) for name, value in zip(names, values, strict=True)}
        except binascii.Error as error:
            self._page.say(f"the files did not arrive: {error}")
            return
        self.drop.clear()
        self.receive(contents)

    def receive(self, contents: dict[str, bytes], *, replace: bool = False) -> None:
        """Store files that were dropped, and choose them; files that exist need a choice."""
        self._pending = {}
        try:
            names = store(self.start.folder, contents, replace=replace)
        except ExistingFilesError as error:
            self._pending = contents
            self.conflict.text, self.conflict.visible = escape(str(error)), True
            self._of_conflict.visible = True
            return
        except (ValueError, OSError) as error:
            self._page.say(str(error))
            return
        self._close_conflict()
        self._page.say("")
        self.start.forget(names)
        self.chosen.options = self._options()
        drawings = [name for name in names if name.lower().endswith(HOLDER_ENDINGS)]
        value = list(dict.fromkeys([*self.chosen.value, *(name for name in names if name not in drawings)]))
        if value == self.chosen.value:
            self.show()
        self.chosen.value = value
        if drawings and "holder" not in self.start.texts:
            self.fields["holder", ""].input.value = drawings[0]

    def _close_conflict(self) -> None:
        self._pending, self.conflict.text = {}, ""
        self.conflict.visible = self._of_conflict.visible = False

    def replace_files(self) -> None:
        """Write the dropped files over those of the folder."""
        self.receive(self._pending, replace=True)

    def keep_files(self) -> None:
        """Use the files of the folder in place of dropped ones with their names."""
        kept = [name for name in self._pending if name in self.start.available]
        rest = {name: content for name, content in self._pending.items() if name not in kept}
        self._close_conflict()
        if rest:
            self.receive(rest)
        self.chosen.value = list(dict.fromkeys([*self.chosen.value, *kept]))

    def _choose(self, names: list[str]) -> None:
        self.start.choose(names)
        for asked in self.start.answers.missing:
            if asked.file and asked.suggested:
                self.start.answer(asked.question.name, asked.suggested, asked.file)
        self.show()

    # Answers.

    def answered(self, name: str, text: str, file: str) -> None:
        """Take over an answer, and show what follows from it."""
        self.start.answer(name, text, file)
        for asked in self.start.answers.missing:
            if asked.file and asked.suggested and asked.question.name != name:
                self.start.answer(asked.question.name, asked.suggested, asked.file)
        self.show()

    def show(self) -> None:
        """Show files, open questions, the assemblies and what is assumed."""
        answers = self.start.answers
        self.contents.text = "".join(map(_contents_html, self.start.files))
        self._show_questions(answers if self.start.files else None)
        made, problem = None, ""
        if self.start.files:
            try:
                made = self.start.make()
            except draft.DraftError as error:
                problem = look.items(map(str, error.mistakes))
                for mistake in error.mistakes:
                    for (name, file), field in self.fields.items():
                        if name == mistake.name and file in ("", mistake.of):
                            field.show(mistake.text)
            except (ValueError, OSError, ReceptanceError) as error:
                problem = look.items(str(error).splitlines())
        self.write.disabled = made is None
        self.overwrite.visible = False
        self._draw(answers, made)
        self.summary.text = problem if made is None else _summary_html(made)

    def _show_questions(self, answers: draft.Answers | None) -> None:
        wanted: dict[tuple[str, str], tuple[str, str, str]] = {}
        for name in self.start.open_reading:
            question = draft.READING_QUESTIONS.get(name)
            label, example = (CHANNELS[name], "") if question is None else (question.text, question.example)
            wanted[name, ""] = (label, example, "")
        for asked in () if answers is None else answers.asked:
            key = (asked.question.name, asked.file)
            wanted[key] = (asked.text, asked.question.example, asked.problem)
        self.fields = {
            key: self.fields.get(key) or _Field(self, key[0], label, example, key[1])
            for key, (label, example, _) in wanted.items()
        }
        for (name, file), field in self.fields.items():
            text = self.start.texts.get(name, "")
            text = text.get(file, "") if isinstance(text, dict) else text
            if field.input.value.strip() != text:
                field.input.value = text
            label, _, problem = wanted[name, file]
            field.input.title = label
            field.show(problem and f"this {problem}")
        layouts = [field.layout for field in self.fields.values()]
        if layouts != self._questions.children:
            self._questions.children = layouts

    def _draw(self, answers: draft.Answers, made: draft.Draft | None) -> None:
        try:
            drawn = {"Assemblies of the campaign": made.campaign} if made else self.start.outlines(answers)
            figures = [report.figure.as_svg(each.plot(), f"{name} to scale") for name, each in list(drawn.items())[:3]]
            self.figure.text = "".join(figures)
        except (ValueError, OSError, ReceptanceError) as error:
            self.figure.text = escape(str(error))

    # The campaign.

    def write_campaign(self) -> None:
        """Write the campaign, unless there is one."""
        try:
            self._written(replace=False)
        except FileExistsError as error:
            self._page.say(str(error))
            self.overwrite.visible = True

    def replace_campaign(self) -> None:
        """Write the campaign over another one."""
        self._written(replace=True)

    def _written(self, *, replace: bool) -> None:
        try:
            file = self.start.write(replace=replace)
            self._session.open(file.name)
        except FileExistsError:
            raise
        except (ValueError, OSError, ReceptanceError) as error:
            self._page.say(str(error))
            return
        self.overwrite.visible = False
        self._page.say(f"written: {file.name}")
        self._page.turn_to("model" if self._session.trial is not None else "file")


def _contents_html(file: ChosenFile) -> str:
    parts = [f"<h3>{escape(file.name)}</h3>"]
    if file.contents is not None:
        parts = [f"<h3>{escape(file.contents.title)}</h3>", f"<p>{escape(file.contents.description)}</p>"]
        parts += [table_html(table) for table in file.contents.tables()]
        parts.append(look.items(file.contents.notes))
    if file.error:
        parts.append(f'<p role="alert"><b>{escape(file.error)}</b></p>')
    return "".join(parts)


def _summary_html(made: draft.Draft) -> str:
    notes = report.result.grouped_notes(made.notes)
    lists = {"Assumed, and commented in the file": made.assumed, "Missing": made.missing, "Notes": notes}
    return "".join(f"<b>{escape(name)}</b>{look.items(texts)}" for name, texts in lists.items() if texts)


def upload_limit() -> CustomJS:
    """Return the script that refuses files above the limit before they are sent, which would end the connection."""
    return CustomJS(args={"limit": LARGEST_UPLOAD}, code=look.resource("uploads.js"))
