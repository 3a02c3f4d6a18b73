"""The commands `example`, `identify`, `predict`, `transfer`, `diagnose` and `schema`."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from receptance.cli.running import (
    InputError,
    InterruptedAnswer,
    Json,
    Plot,
    Targets,
    input_errors,
    output,
    with_progress,
)
from receptance.errors import ReceptanceError, ReceptanceWarning

if TYPE_CHECKING:
    from receptance.campaign import Campaign
    from receptance.diagnosis import Verdict

__all__ = ["File", "diagnose", "example", "identify", "load_campaign", "predict", "schema", "transfer"]

ANSWER_IS_NO = 3
"""Exit code where a verdict was asked to fail on."""

_MOST_FILES = 6

File = Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="A campaign file, or a folder with a campaign.toml.")]


def example(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Which one; see --list.")] = None,
    folder: Annotated[Path | None, typer.Argument(metavar="DIR", help="Where to; by default a folder NAME.")] = None,
    list_them: Annotated[bool, typer.Option("--list", help="Name the examples and stop.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that are there already.")] = False,
) -> None:
    """Write out a complete campaign, data included, to try and to change."""
    from receptance import examples

    console = output()
    if list_them:
        width = max(map(len, examples.EXAMPLES))
        for one in examples.EXAMPLES.values():
            console.print(f"{one.name:{width}s}  {one.title}", soft_wrap=True)
        return
    if name is None:
        raise InputError(f"name an example: {', '.join(examples.EXAMPLES)}")
    target = folder or Path(name)
    with input_errors():
        files = with_progress(lambda say: examples.write(name, target, overwrite=overwrite, progress=say))
    for file in files[:_MOST_FILES]:
        console.print(f"Written: {file}", soft_wrap=True)
    if len(files) > _MOST_FILES:
        console.print(f"Written: {len(files) - _MOST_FILES} more files in {target}", soft_wrap=True)
    console.print(f"Next: receptance identify {files[0]}", soft_wrap=True)


def schema(
    markdown: Annotated[bool, typer.Option("--markdown", help="The same as tables for people.")] = False,
) -> None:
    """Print the JSON Schema of campaign files."""
    from receptance.campaign import field_tables, json_schema

    text = field_tables() if markdown else json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"
    output().out(text, end="", highlight=False)


def identify(
    campaign: File,
    json_file: Json = None,
    plot: Plot = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 3 where the fit has not converged or has advice.")
    ] = False,
) -> None:
    """Identify the unknown parameters of a campaign, with intervals."""
    targets = Targets(json_file, plot)
    from receptance.campaign import CampaignError

    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)  # they are among the notes, which are printed
        read = load_campaign(campaign, targets)
        found = with_progress(lambda say: read.identify(progress=say))
    targets.show(found, read.tables(), profiles=None if found.profiled is None else found.profiled.plot)
    if strict and (found.advice or not found.converged):
        raise typer.Exit(ANSWER_IS_NO)


def predict(
    campaign: File,
    json_file: Json = None,
    plot: Plot = None,
    at_most: Annotated[
        float | None,
        typer.Option(
            "--at-most",
            metavar="PERCENT",
            min=0.0,
            help="Exit with 3 where a held-out natural frequency or peak is predicted further off.",
        ),
    ] = None,
) -> None:
    """Predict what a campaign holds out, compared with it, and the assemblies that were not measured."""
    targets = Targets(json_file, plot)
    from receptance.campaign import CampaignError

    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        if at_most is not None and not read.held_out:
            raise InputError("--at-most compares with what is held out, and this campaign holds out no measurement")
        found = with_progress(lambda say: read.predict(progress=say))
    targets.show(found)
    if at_most is not None:
        worst = max(map(abs, found.errors_percent), default=float("inf"))
        missed = sum(peak.predicted_hz is None for frf in found.frfs for peak in frf.peaks)
        unknown = sum(name in found.not_predicted for name in read.held_out)
        no = worst > at_most or missed > 0 or unknown > 0
        lost = f", {missed} measured peaks have no prediction" if missed else ""
        lost += f", {unknown} measurements could not be predicted" if unknown else ""
        targets.console().print(f"At most {at_most:g} %: {'no' if no else 'yes'}, the worst is {worst:.2f} %{lost}")
        if no:
            raise typer.Exit(ANSWER_IS_NO)


def transfer(
    campaign: File,
    json_file: Json = None,
    plot: Plot = None,
    splits: Annotated[
        str, typer.Option("--splits", help="leave-one-out: each assembly from all others; one-for-all: all from each.")
    ] = "leave-one-out",
) -> None:
    """Predict every measured assembly of a campaign from the others, all splits, compared with what was measured."""
    targets = Targets(json_file, plot)
    from receptance.campaign import CampaignError

    if splits not in ("leave-one-out", "one-for-all"):
        raise InputError(f"--splits is {splits!r}, expected leave-one-out or one-for-all")
    way: Literal["leave-one-out", "one-for-all"] = "one-for-all" if splits == "one-for-all" else "leave-one-out"
    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        found = with_progress(lambda say: read.transfer(splits=way, progress=say))
    if plot is not None and not found.modes and not found.frfs:
        raise InputError(f"nothing could be predicted, so there is no figure: {'; '.join(found.not_predicted)}")
    targets.show(found)


def diagnose(
    campaign: File,
    json_file: Json = None,
    plot: Plot = None,
    causes: Annotated[
        list[str] | None, typer.Option("--cause", metavar="ID", help="Only this cause; may be given several times.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE.html", help="Write the report as one HTML file.")
    ] = None,
    extended: Annotated[
        Path | None,
        typer.Option("--extended", metavar="FILE.toml", help="Write the extended model as a campaign of its own."),
    ] = None,
    metrics: Annotated[
        list[str] | None,
        typer.Option("--metric", metavar="NAME", help="What to measure besides on held-out data: stable_depth."),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 3 where the verdict is anything but adequate.")
    ] = False,
) -> None:
    """Say whether the model is adequate for what was measured, and what it lacks if not.

    Ctrl-C ends it with what is known so far, said to be not final, and exit code 130.
    """
    targets = Targets(json_file, plot, report, extended)
    from receptance.campaign import CampaignError
    from receptance.campaign.metrics import named_metrics

    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        read = load_campaign(campaign, targets)
        wanted = named_metrics(read, metrics or ())
        found = with_progress(lambda say: read.diagnose(causes or None, metrics=wanted, progress=say))

    def page() -> str:
        from receptance.diagnosis.report import diagnosis_html

        return diagnosis_html(found, title=read.title)

    final = found.final
    text, why_not = (None, "the diagnosis was interrupted" if extended else "")
    if final:
        text, why_not = _extended(read, found, extended)
    targets.show(found, report=page, extended=text)
    if why_not:
        targets.console().print(f"{extended} was not written: {why_not}", soft_wrap=True)
    if not final:
        raise InterruptedAnswer("interrupted, the answer is not final")
    if strict and found.verdict != "adequate":
        raise typer.Exit(ANSWER_IS_NO)


def _extended(campaign: Campaign, found: Verdict, target: Path | None) -> tuple[str | None, str]:
    """Return the text of the extended campaign, or why there is none."""
    if target is None:
        return None, ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            return campaign.extended_text(found, target.parent), ""
        except ValueError as error:
            return None, str(error)


def load_campaign(path: Path, targets: Targets) -> Campaign:
    """Read the campaign; nothing that it reads may be written over."""
    from receptance.campaign import load

    found = with_progress(lambda say: load(path, progress=say))
    targets.keep_off(found.file, "the campaign file")
    for measured in found.measurements.values():
        for name in measured.files:
            targets.keep_off(found.file.parent / name, "a data file of the campaign")
    for cut in found.cuts.values():
        for tip in (cut.x, cut.y):
            if tip is not None and tip.file:
                targets.keep_off(found.file.parent / tip.file, "a data file of the campaign")
    return found
