"""The commands `study`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from receptance.cli.running import InputError, Seed, Targets, input_errors, takes_quiet, takes_targets, with_progress
from receptance.report.terminal import print_sentences, print_table, print_title

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.studies.report import ReportSection


class _Studies(TyperGroup):
    """Group of commands that lists the studies if one does not exist."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and self.get_command(ctx, args[0]) is None:
            raise InputError(f"there is no study {args[0]!r}; the studies are {', '.join(self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)


studies = typer.Typer(cls=_Studies, no_args_is_help=True, help="Reproduce a published study from its printed numbers.")

Draws = Annotated[int, typer.Option(metavar="N", min=1, help="Number of simulations of the chance model.")]
Resolution = Annotated[
    float,
    typer.Option(
        "--resolution", metavar="HZ", help="Resolution of printed frequencies; ten times that from 10 kHz on."
    ),
]
Overhang = Annotated[float, typer.Option("--overhang-error", metavar="MM", help="Standard deviation of an overhang.")]
Step = Annotated[int, typer.Option("--step", metavar="KN", min=1, max=2, help="Step of the drawbar force in kN.")]


@studies.command()
@takes_quiet
@takes_targets()
def er32(
    targets: Targets,
    resolution: Resolution = 1.0,
    overhang_error: Overhang = 0.1,
    draws: Draws = 300,
    seed: Seed = 0,
) -> None:
    """Joint of an ER32 collet holder, Matthias et al. 2016.

    doi 10.1016/j.cirpj.2016.02.005
    """
    from receptance.studies import er32 as study

    targets.require_new()
    with input_errors():
        settings = study.ER32Settings(
            resolution=study.Resolution(fine_hz=resolution, coarse_hz=10.0 * resolution),
            chance=study.ChanceModel(overhang_mm=overhang_error),
            draws=draws,
            seed=seed,
        )
    found = with_progress(lambda say: study.run(settings, progress=say))
    _report(targets, found, study.sections(found), lambda: study.draw(found))


@studies.command()
@takes_quiet
@takes_targets()
def bt50(targets: Targets, step: Step = 1, seed: Seed = 0) -> None:
    """BT50 taper over drawbar force, Xu et al. 2012, on a virtual rig."""
    from receptance.studies import bt50 as study

    targets.require_new()
    found = with_progress(lambda say: study.run(step, seed, progress=say))
    _report(targets, found, study.sections(found), lambda: study.draw(found))


def _report(
    targets: Targets, found: dict[str, Any], sections: Sequence[ReportSection], draw: Callable[[], Figure]
) -> None:
    """Write the files, print the sections of a study and name the files."""
    targets.write(lambda: found, draw, report=lambda: _page(found, sections, draw()))
    console = targets.console()
    for section in sections:
        print_title(console, section.title)
        for table in section.tables:
            print_table(console, table)
        print_sentences(console, section.sentences)
    print_sentences(console, [_origin(found)])
    targets.print_names(console)


def _origin(found: dict[str, Any]) -> str:
    versions = ", ".join(f"{name} {value}" for name, value in found["versions"].items())
    return f"seed {found['settings']['seed']}; {versions}"


def _page(found: dict[str, Any], sections: Sequence[ReportSection], figure: Figure) -> str:
    """Return the sections of a study as an HTML page."""
    from receptance.report.html import html_page, shown, table_html, wide_figure

    heading = sections[0].title
    parts = [f"<header><h1>{shown(heading)}</h1></header>", wide_figure(figure, heading)]
    for section in sections:
        parts += [f"<h2>{shown(section.title)}</h2>", *map(table_html, section.tables)]
        parts += [f"<p>{shown(text)}</p>" for text in section.sentences]
    return html_page(heading, [*parts, f"<p><small>{shown(_origin(found))}</small></p>"])
