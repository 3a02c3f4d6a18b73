"""The commands that analyse a campaign, and `example` and `schema`."""

from __future__ import annotations

import json
import shlex
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import typer

from receptance import campaign, diagnosis, examples
from receptance.cli.files import NoWindow, open_figure
from receptance.cli.running import (
    PROFILES,
    STABILISATION,
    InputError,
    InterruptedAnswer,
    NewSeed,
    Overwrite,
    Targets,
    input_errors,
    output,
    takes_targets,
    with_progress,
)
from receptance.errors import ReceptanceError, ReceptanceWarning

_MOST_FILES = 6
_Found = TypeVar("_Found")

CampaignFile = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Campaign file, or folder with a campaign.toml.")
]


def load_campaign(
    path: Path, targets: Targets, progress: Callable[[str], None], *, unidentified: bool = False
) -> campaign.Campaign:
    """Read a campaign, and check that no file that it reads would be overwritten."""
    if not path.exists() and str(path) in examples.EXAMPLES:
        hint = f"`receptance example {path}` writes the example of this name"
        raise InputError(f"there is no campaign file or folder {path}; {hint}")
    loaded = campaign.load(path, progress=progress, unidentified=unidentified)
    protect_files(loaded, targets)
    targets.require_new()
    return loaded


def protect_files(loaded: campaign.Campaign, targets: Targets, *, of_spindles: bool = True) -> None:
    """Raise `InputError` if an output file is one that the campaign reads."""
    targets.protect(loaded.file, "the campaign file")
    files = [file for name in (*loaded.measurements, *loaded.on_blanks) for file in loaded.files_of(name)]
    files += [spindle.file for spindle in loaded.table.spindles.values() if of_spindles and spindle.file]
    files += [tip.file for cut in loaded.cuts.values() for tip in cut.tips if tip.file]
    files += [part.contour for part in loaded.table.parts.values() if part.contour]
    if (table := loaded.table.catalogue) is not None:
        files += [name for name in (table.tools, table.holders) if name]
    for name in files:
        targets.protect(loaded.file.parent / name, "a data file of the campaign")


def run_on_campaign(
    path: Path,
    targets: Targets,
    work: Callable[[campaign.Campaign], _Found],
    seed: int | None = None,
    *,
    unidentified: bool = False,
) -> tuple[campaign.Campaign, _Found]:
    """Read a campaign and analyse it, with a progress display; mistakes in the input become `InputError`.

    Warnings are not shown, because they are among the notes of the result.
    """

    def run(say: Callable[[str], None]) -> tuple[campaign.Campaign, _Found]:
        read = load_campaign(path, targets, say, unidentified=unidentified)
        read = read if seed is None else read.with_seed(seed)
        return read, work(read)

    with warnings.catch_warnings(), input_errors(campaign.CampaignError, ReceptanceError, OSError):
        warnings.simplefilter("ignore", ReceptanceWarning)
        return with_progress(run)


def example(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of the example, see --list.")] = None,
    folder: Annotated[Path | None, typer.Argument(metavar="DIR", help="Folder; by default NAME.")] = None,
    list_them: Annotated[bool, typer.Option("--list", help="List the examples and exit.")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Write a complete example campaign with its data to a folder."""
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
    console.print(f"Next: receptance {examples.EXAMPLES[name].first_command} {files[0]}", soft_wrap=True)


@takes_targets("if identify or diagnose cannot run, or something is missing")
def check(
    file: CampaignFile,
    targets: Targets,
    no_window: NoWindow = False,
) -> None:
    """Say what a campaign contains and lacks, and draw its assemblies.

    The figure is opened in the default viewer, or saved with --plot.
    """
    _, result = run_on_campaign(file, targets, campaign.CampaignCheck, unidentified=True)
    targets.show(result)
    if not no_window and not targets.asked:
        open_figure(targets.console(), result.plot, "check")
    targets.require(not (result.missing["identify"] or result.missing["diagnose"] or result.warnings()))


def schema(
    markdown: Annotated[bool, typer.Option("--markdown", help="Print Markdown tables instead.")] = False,
) -> None:
    """Print the JSON Schema of campaign files."""
    text = (
        campaign.field_tables() if markdown else json.dumps(campaign.json_schema(), indent=2, ensure_ascii=False) + "\n"
    )
    output().out(text, end="", highlight=False)


@takes_targets("if the fit has not converged or has advice")
def identify(
    file: CampaignFile,
    targets: Targets,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            "--profile",
            metavar="ADDRESS",
            help="Unknown with an interval from its profile likelihood; may be repeated. By default those of the "
            "joints, if they take less time than the fit.",
        ),
    ] = None,
    seed: NewSeed = None,
) -> None:
    """Identify the unknown parameters of a campaign, with intervals."""
    read, result = run_on_campaign(file, targets, lambda read: read.identify(profile or None), seed)
    beside = {PROFILES: result.profiled, STABILISATION: result.stabilised}
    targets.show(result, read.tables(), beside={name: each.plot for name, each in beside.items() if each is not None})
    targets.require(not result.advice)


@takes_targets("if the fit has advice")
def predict(
    file: CampaignFile,
    targets: Targets,
    at_most: Annotated[
        float | None,
        typer.Option(
            "--at-most",
            metavar="PERCENT",
            min=0.0,
            help="Exit with 3 if the error of a held-out natural frequency or peak is larger.",
        ),
    ] = None,
    seed: NewSeed = None,
) -> None:
    """Predict held-out measurements and unmeasured assemblies."""

    def work(read: campaign.Campaign) -> campaign.Prediction:
        if at_most is not None and not read.held_out:
            raise InputError("--at-most needs held-out measurements, and the campaign has none")
        return read.predict()

    read, result = run_on_campaign(file, targets, work, seed)
    targets.show(result)
    if at_most is not None:
        worst = max(map(abs, result.errors_percent), default=float("inf"))
        missed = sum(peak.predicted_hz is None for frf in result.frfs for peak in frf.peaks)
        failed = sum(name in result.not_predicted for name in read.held_out)
        no = worst > at_most or missed > 0 or failed > 0
        lost = f", {missed} measured peaks have no prediction" if missed else ""
        lost += f", {failed} measurements could not be predicted" if failed else ""
        answer = "no" if no else "yes"
        targets.console().print(f"At most {at_most:g} %: {answer}, the largest error is {worst:.2f} %{lost}")
        targets.require(not no, always=True)
    targets.require(not result.warnings() and not result.rejection)


@takes_targets("if the fits have advice or an assembly is not predicted")
def transfer(
    file: CampaignFile,
    targets: Targets,
    splits: Annotated[
        str, typer.Option("--splits", help="leave-one-out: each assembly from all others; one-for-all: all from each.")
    ] = "leave-one-out",
    seed: NewSeed = None,
) -> None:
    """Predict every measured assembly of a campaign from the others."""
    if splits not in ("leave-one-out", "one-for-all"):
        raise InputError(f"--splits is {splits!r}, expected leave-one-out or one-for-all")
    way: Literal["leave-one-out", "one-for-all"] = "one-for-all" if splits == "one-for-all" else "leave-one-out"
    _, result = run_on_campaign(file, targets, lambda read: read.transfer(splits=way), seed)
    if targets.draws and not result.modes and not result.frfs:
        raise InputError(f"nothing could be predicted, so there is no figure: {'; '.join(result.not_predicted)}")
    targets.show(result)
    targets.require(not result.warnings() and not result.rejection and not result.not_predicted)


@takes_targets()
def invert(
    file: CampaignFile,
    targets: Targets,
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
    _, result = run_on_campaign(file, targets, lambda read: read.invert(joint, limit=limit / 100.0))
    targets.show(result)


@takes_targets("if the fit is rejected")
def next_measurement(
    file: CampaignFile,
    targets: Targets,
    target: Annotated[
        list[str] | None,
        typer.Option(
            "--target",
            metavar="NAME",
            help="Unknown, or assembly for its natural frequencies, whose uncertainty counts; may be repeated.",
        ),
    ] = None,
    seed: NewSeed = None,
) -> None:
    """Rank candidate measurements, of the campaign or of a menu, by their expected benefit."""
    _, result = run_on_campaign(file, targets, lambda read: read.next_measurement(targets=target or ()), seed)
    targets.show(result)
    targets.require(not result.rejection)


@takes_targets("if limits are rejected, as those of a rejected fit")
def stability(
    file: CampaignFile,
    targets: Targets,
    cut: Annotated[
        list[str] | None, typer.Option("--cut", metavar="NAME", help="Only this cut; may be repeated.")
    ] = None,
    seed: NewSeed = None,
) -> None:
    """Compute stable depths of cut and recommended spindle speeds.

    The exit code is 3 if no cut has a limit.
    """
    _, result = run_on_campaign(file, targets, lambda read: read.stability(cuts=cut or ()), seed)
    targets.show(result)
    targets.require(any(lobes.has_limits for lobes in result.values()), always=True)
    targets.require(not result.rejection)


@takes_targets("unless the verdict is adequate")
def diagnose(
    file: CampaignFile,
    targets: Targets,
    causes: Annotated[
        list[str] | None, typer.Option("--cause", metavar="ID", help="Only this cause; may be repeated.")
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
    seed: NewSeed = None,
) -> None:
    """Test whether the model explains the measurements, and why not.

    Ctrl-C stops with a preliminary result and exit code 130.
    """
    targets.add("--extended", extended, "Extended campaign", (".toml",), "a campaign is a TOML file")

    def work(read: campaign.Campaign) -> diagnosis.Verdict:
        made = read.diagnose(causes or None, fast=fast, metrics=campaign.stability.named_metrics(read, metrics or ()))
        verdict = campaign.write.with_campaign_lines(read, made)
        return replace(verdict, campaign=replace(verdict.campaign, path=shlex.quote(str(file))))

    read, result = run_on_campaign(file, targets, work, seed)
    texts, why_not = _extended(read, result, extended)
    if extended is not None and why_not:
        targets.leave_out(extended)
    targets.show(result, more=texts)
    if why_not:
        targets.console().print(f"{extended} was not written: {why_not}", soft_wrap=True)
    if not result.final:
        raise InterruptedAnswer("interrupted, the result is preliminary")
    targets.require(result.verdict == "adequate")


def _extended(read: campaign.Campaign, result: diagnosis.Verdict, target: Path | None) -> tuple[dict[Path, str], str]:
    """Return the text of the extended campaign by its file, or the reason why there is none."""
    if target is None:
        return {}, ""
    if not result.final:
        return {}, "the diagnosis was interrupted"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            return {target: campaign.extended_text(read, result, target.parent)}, ""
        except ValueError as error:
            return {}, str(error)
