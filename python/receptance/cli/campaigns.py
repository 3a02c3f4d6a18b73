"""The commands that analyse a campaign, and `example` and `schema`."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

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
from receptance.cli.show import NoWindow, open_figure
from receptance.errors import ReceptanceError, ReceptanceWarning

if TYPE_CHECKING:
    from receptance.campaign import Campaign, Prediction
    from receptance.diagnosis import Verdict

__all__ = [
    "CampaignFile",
    "check",
    "diagnose",
    "example",
    "identify",
    "invert",
    "load_campaign",
    "next_measurement",
    "predict",
    "run_on_campaign",
    "schema",
    "stability",
    "transfer",
]

_NO = 3
"""Exit code for a negative result of --strict or --at-most."""
_MOST_FILES = 6
_Found = TypeVar("_Found")

CampaignFile = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Campaign file, or folder with a campaign.toml.")
]


def load_campaign(path: Path, targets: Targets, progress: Callable[[str], None]) -> Campaign:
    """Read a campaign, and check that no file that it reads would be overwritten."""
    from receptance.campaign import load

    found = load(path, progress=progress)
    targets.protect(found.file, "the campaign file")
    files = [name for measured in found.measurements.values() for name in measured.files]
    files += [tip.file for cut in found.cuts.values() for tip in (cut.x, cut.y) if tip is not None and tip.file]
    for name in files:
        targets.protect(found.file.parent / name, "a data file of the campaign")
    return found


def run_on_campaign(path: Path, targets: Targets, work: Callable[[Campaign], _Found]) -> tuple[Campaign, _Found]:
    """Read a campaign and analyse it, with a progress display; mistakes in the input become `InputError`.

    Warnings are not shown, because they are among the notes of the result.
    """
    from receptance.campaign import CampaignError

    def run(say: Callable[[str], None]) -> tuple[Campaign, _Found]:
        read = load_campaign(path, targets, say)
        return read, work(read)

    with warnings.catch_warnings(), input_errors(CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        return with_progress(run)


def example(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of the example, see --list.")] = None,
    folder: Annotated[Path | None, typer.Argument(metavar="DIR", help="Folder; by default NAME.")] = None,
    list_them: Annotated[bool, typer.Option("--list", help="List the examples and exit.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
) -> None:
    """Write a complete example campaign with its data to a folder."""
    from receptance import examples

    console = output()
    if list_them:
        width = max(map(len, examples.EXAMPLES))
        for one in examples.EXAMPLES.values():
            console.print(f"{one.name:{width}s}  {one.title}", soft_wrap=True)
        return
    if name is None:
        raise InputError(f"no example given, expected one of {', '.join(examples.EXAMPLES)}")
    target = folder or Path(name)
    with input_errors():
        files = with_progress(lambda say: examples.write(name, target, overwrite=overwrite, progress=say))
    for file in files[:_MOST_FILES]:
        console.print(f"Written: {file}", soft_wrap=True)
    if len(files) > _MOST_FILES:
        console.print(f"Written: {len(files) - _MOST_FILES} more files in {target}", soft_wrap=True)
    console.print(f"Next: receptance identify {files[0]}", soft_wrap=True)


def check(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    no_window: NoWindow = False,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 3 if identify or diagnose cannot run, or something is missing.")
    ] = False,
) -> None:
    """Say what a campaign contains and lacks, and draw its assemblies.

    The figure is opened in the default viewer, or saved with --plot.
    """
    from receptance.campaign import CampaignCheck

    targets = Targets(json_file, plot)
    _, found = run_on_campaign(campaign, targets, CampaignCheck)
    targets.show(found)
    if plot is None and not no_window and json_file is None:
        open_figure(targets.console(), found.plot, "check")
    if strict and (found.missing["identify"] or found.missing["diagnose"] or found.warnings()):
        raise typer.Exit(_NO)


def schema(
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown tables instead.")] = False,
) -> None:
    """Print the JSON Schema of campaign files."""
    from receptance.campaign import field_tables, json_schema

    text = field_tables() if markdown else json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"
    output().out(text, end="", highlight=False)


def identify(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit with 3 if the fit has not converged or has advice.")
    ] = False,
) -> None:
    """Identify the unknown parameters of a campaign, with intervals."""
    targets = Targets(json_file, plot)
    read, found = run_on_campaign(campaign, targets, lambda read: read.identify())
    targets.show(found, read.tables(), profiles=None if found.profiled is None else found.profiled.plot)
    if strict and (found.advice or not found.converged):
        raise typer.Exit(_NO)


def predict(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    at_most: Annotated[
        float | None,
        typer.Option(
            "--at-most",
            metavar="PERCENT",
            min=0.0,
            help="Exit with 3 if the error of a held-out natural frequency or peak is larger.",
        ),
    ] = None,
) -> None:
    """Predict held-out measurements and unmeasured assemblies."""
    targets = Targets(json_file, plot)

    def work(read: Campaign) -> Prediction:
        if at_most is not None and not read.held_out:
            raise InputError("--at-most needs held-out measurements, and the campaign has none")
        return read.predict()

    read, found = run_on_campaign(campaign, targets, work)
    targets.show(found)
    if at_most is not None:
        worst = max(map(abs, found.errors_percent), default=float("inf"))
        missed = sum(peak.predicted_hz is None for frf in found.frfs for peak in frf.peaks)
        failed = sum(name in found.not_predicted for name in read.held_out)
        no = worst > at_most or missed > 0 or failed > 0
        lost = f", {missed} measured peaks have no prediction" if missed else ""
        lost += f", {failed} measurements could not be predicted" if failed else ""
        answer = "no" if no else "yes"
        targets.console().print(f"At most {at_most:g} %: {answer}, the largest error is {worst:.2f} %{lost}")
        if no:
            raise typer.Exit(_NO)


def transfer(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    splits: Annotated[
        str, typer.Option("--splits", help="leave-one-out: each assembly from all others; one-for-all: all from each.")
    ] = "leave-one-out",
) -> None:
    """Predict every measured assembly of a campaign from the others."""
    targets = Targets(json_file, plot)
    if splits not in ("leave-one-out", "one-for-all"):
        raise InputError(f"--splits is {splits!r}, expected leave-one-out or one-for-all")
    way: Literal["leave-one-out", "one-for-all"] = "one-for-all" if splits == "one-for-all" else "leave-one-out"
    _, found = run_on_campaign(campaign, targets, lambda read: read.transfer(splits=way))
    if plot is not None and not found.modes and not found.frfs:
        raise InputError(f"nothing could be predicted, so there is no figure: {'; '.join(found.not_predicted)}")
    targets.show(found)


def invert(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    joint: Annotated[
        str | None,
        typer.Option("--joint", metavar="NAME", help="Joint; by default all joints with unknown stiffness."),
    ] = None,
    limit: Annotated[
        float,
        typer.Option(
            "--limit", metavar="PERCENT", min=0.1, help="Largest standard deviation of an informative frequency line."
        ),
    ] = 20.0,
) -> None:
    """Compute joint stiffness on each line by inverse coupling."""
    targets = Targets(json_file, plot)
    _, found = run_on_campaign(campaign, targets, lambda read: read.invert(joint, limit=limit / 100.0))
    targets.show(found)


def next_measurement(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target",
            metavar="NAME",
            help="Unknown, or assembly for its natural frequencies, whose uncertainty counts; may be repeated.",
        ),
    ] = None,
) -> None:
    """Rank candidate measurements by their expected benefit."""
    targets = Targets(json_file, plot)
    _, found = run_on_campaign(campaign, targets, lambda read: read.next_measurement(targets=target or ()))
    targets.show(found)


def stability(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    cut: Annotated[
        list[str] | None, typer.Option("--cut", metavar="NAME", help="Only this cut; may be repeated.")
    ] = None,
) -> None:
    """Compute stable depths of cut and recommended spindle speeds."""
    targets = Targets(json_file, plot)
    _, found = run_on_campaign(campaign, targets, lambda read: read.stability(cuts=cut or ()))
    targets.show(found)


def diagnose(
    campaign: CampaignFile,
    json_file: Json = None,
    plot: Plot = None,
    causes: Annotated[
        list[str] | None, typer.Option("--cause", metavar="ID", help="Only this cause; may be repeated.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE.html", help="Write the report as one HTML file.")
    ] = None,
    extended: Annotated[
        Path | None,
        typer.Option("--extended", metavar="FILE.toml", help="Write the extended model as a campaign file."),
    ] = None,
    metrics: Annotated[
        list[str] | None,
        typer.Option("--metric", metavar="NAME", help="Further error on held-out data: stable_depth."),
    ] = None,
    fast: Annotated[
        bool, typer.Option("--fast", help="Leave out tests by held-out data and competing changes; names no cause.")
    ] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 3 unless the verdict is adequate.")] = False,
) -> None:
    """Test whether the model explains the measurements, and why not.

    Ctrl-C stops with a preliminary result and exit code 130.
    """
    targets = Targets(json_file, plot, report, extended)

    def work(read: Campaign) -> Verdict:
        from receptance.campaign.changed_lines import with_campaign_lines
        from receptance.campaign.stability import named_metrics

        return with_campaign_lines(
            read, read.diagnose(causes or None, fast=fast, metrics=named_metrics(read, metrics or ()))
        )

    read, found = run_on_campaign(campaign, targets, work)

    def page() -> str:
        from receptance.diagnosis.report import diagnosis_html

        return diagnosis_html(found, title=read.title)

    text, why_not = _extended(read, found, extended)
    targets.show(found, report=page, extended=text)
    if why_not:
        targets.console().print(f"{extended} was not written: {why_not}", soft_wrap=True)
    if not found.final:
        raise InterruptedAnswer("interrupted, the result is preliminary")
    if strict and found.verdict != "adequate":
        raise typer.Exit(_NO)


def _extended(campaign: Campaign, found: Verdict, target: Path | None) -> tuple[str | None, str]:
    """Return the text of the extended campaign, or the reason why there is none."""
    from receptance.campaign import extended_text

    if target is None:
        return None, ""
    if not found.final:
        return None, "the diagnosis was interrupted"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            return extended_text(campaign, found, target.parent), ""
        except ValueError as error:
            return None, str(error)
