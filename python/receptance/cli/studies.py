"""The commands `demo` and `study`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from receptance.cli.running import InputError, Json, Plot, Seed, Targets, input_errors, with_progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure
    from rich.console import Console

__all__ = ["demo", "studies"]

DEMO_FIGURE = "receptance-demo.png"


class _Studies(TyperGroup):
    """Answers an unknown study with the known ones."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and self.get_command(ctx, args[0]) is None:
            raise InputError(f"there is no study {args[0]!r}; the studies are {', '.join(self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)


studies = typer.Typer(
    cls=_Studies, no_args_is_help=True, help="One published study, done again from its printed numbers."
)

Draws = Annotated[int, typer.Option(min=1, help="Simulations of the bias under chance.")]
Resolution = Annotated[
    float,
    typer.Option(
        "--resolution", metavar="HZ", help="Step in which frequencies are printed; ten times that from 10 kHz."
    ),
]
Overhang = Annotated[float, typer.Option("--overhang-error", metavar="MM", help="Standard deviation of an overhang.")]


def _tell(
    targets: Targets, document: dict[str, Any], result: Any, show: Callable[[Console, Any], None], figure: str
) -> None:
    """Write what was asked for, print the study, name the files."""

    def draw() -> Figure:
        from receptance import plot

        drawn: Figure = getattr(plot, figure)(result)
        return drawn

    targets.write(document, draw)
    console = targets.console()
    show(console, result)
    targets.name(console)


def demo(json_file: Json = None, plot: Plot = None) -> None:
    """Do the ER32 study end to end and save its figure in the current folder (or where --plot says)."""
    _run_er32(json_file, plot or Path(DEMO_FIGURE), {})


@studies.command()
def er32(
    json_file: Json = None,
    plot: Plot = None,
    resolution: Resolution = 1.0,
    overhang_error: Overhang = 0.1,
    draws: Draws = 300,
    seed: Seed = 0,
) -> None:
    """The joint of an ER32 collet holder, Matthias et al. 2016 (doi 10.1016/j.cirpj.2016.02.005)."""
    given = {"resolution": resolution, "overhang_error": overhang_error, "draws": draws, "seed": seed}
    _run_er32(json_file, plot, given)


def _run_er32(json_file: Path | None, plot: Path | None, given: dict[str, Any]) -> None:
    targets = Targets(json_file, plot)
    from receptance.cli.er32 import print_er32
    from receptance.studies import er32 as study

    options: dict[str, Any] = {name: given[name] for name in ("draws", "seed") if name in given}
    with input_errors():
        if "resolution" in given:
            fine = given["resolution"]
            options["resolution"] = study.Resolution(fine_hz=fine, coarse_hz=10.0 * fine)
        if "overhang_error" in given:
            options["chance"] = study.ChanceModel(overhang_mm=given["overhang_error"])
        settings = study.ER32Settings(**options)
    result = with_progress(lambda say: study.run(settings, progress=say))
    _tell(targets, study.as_dict(result), result, print_er32, "draw_er32")


@studies.command("clamped-rods")
def clamped_rods(
    json_file: Json = None,
    plot: Plot = None,
    reading_error: Annotated[
        float | None,
        typer.Option("--reading-error", metavar="HZ", help="How far a reading can be off; else as the source says."),
    ] = None,
    seed: Seed = 0,
) -> None:
    """The clamp of aluminium rods from one rod's first mode, the other rods predicted."""
    targets = Targets(json_file, plot)
    from receptance.cli.clamped_rods import print_clamped_rods
    from receptance.studies import clamped_rods as study

    with input_errors():
        error = study.checked_error(reading_error)
    result = with_progress(lambda say: study.run(reading_error_hz=error, seed=seed, progress=say))
    _tell(targets, study.as_dict(result), result, print_clamped_rods, "draw_clamped_rods")


@studies.command()
def table3(
    json_file: Json = None,
    plot: Plot = None,
    coherence: Annotated[float, typer.Option("--coherence", help="Of every line of the simulated tests.")] = 0.98,
    averages: Annotated[int, typer.Option("--averages", help="Of the simulated tests.")] = 10,
    seed: Seed = 0,
) -> None:
    """VIRTUAL: what one tip response in a simulated machine says of the joint, the four sets of table 3, what helps."""
    targets = Targets(json_file, plot)
    from receptance.cli.table3 import print_table3
    from receptance.studies import table3 as study

    with input_errors():
        measuring = study.Measuring(coherence=coherence, averages=averages)
        settings = study.Table3Settings(measuring=measuring, seed=seed)
    result = with_progress(lambda say: study.run(settings, progress=say))
    _tell(targets, study.as_dict(result), result, print_table3, "draw_table3")


@studies.command()
def clamping(
    json_file: Json = None,
    plot: Plot = None,
    resolution: Resolution = 1.0,
    seed: Seed = 0,
) -> None:
    """Insertion, material and damping as VIRTUAL studies, published torque and diameter as laws with their evidence."""
    targets = Targets(json_file, plot)
    from receptance.cli.clamping import print_clamping
    from receptance.studies import clamping as study
    from receptance.studies.er32 import Resolution as Steps

    with input_errors():
        steps = Steps(fine_hz=resolution, coarse_hz=10.0 * resolution)
        settings = study.ClampingSettings(resolution=steps, seed=seed)
    result = with_progress(lambda say: study.run(settings, progress=say))
    _tell(targets, study.as_dict(result), result, print_clamping, "draw_clamping")


@studies.command()
def bt50(
    json_file: Json = None,
    plot: Plot = None,
    step: Annotated[int, typer.Option("--step", metavar="KN", min=1, max=2, help="Every how many kN to measure.")] = 1,
    seed: Seed = 0,
) -> None:
    """A BT50 taper over drawbar force, Xu et al. 2012: its procedure on a virtual rig, and what it gets wrong."""
    targets = Targets(json_file, plot)
    from receptance.cli.bt50 import print_bt50
    from receptance.studies import bt50 as study

    with input_errors():
        settings = study.BT50Settings(step_kn=step, seed=seed)
    result = with_progress(lambda say: study.run(settings, progress=say))
    _tell(targets, study.as_dict(result), result, print_bt50, "draw_bt50")


@studies.command()
def machines(
    json_file: Json = None,
    plot: Plot = None,
    hits: Annotated[int, typer.Option("--hits", min=3, help="Hammer hits of each simulated test of the blanks.")] = 10,
    seed: Seed = 0,
) -> None:
    """VIRTUAL: spindles of two machines from blanks in them, the tools of table 5 predicted, and where that fails."""
    targets = Targets(json_file, plot)
    from receptance.cli.machines import print_machines
    from receptance.studies import machines as study

    with input_errors():
        settings = study.MachinesSettings(hits=hits, seed=seed)
    result = with_progress(lambda say: study.run(settings, progress=say))
    _tell(targets, study.as_dict(result), result, print_machines, "draw_machines")
