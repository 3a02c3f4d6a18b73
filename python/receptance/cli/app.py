"""Commands, their options, and how they end: 0 done, 1 an internal error, 2 bad input."""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.console import Console
from typer.core import TyperGroup

from receptance._files import check_target, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["app", "main"]

DEMO_FIGURE = "receptance-demo.png"
_PIPE_WIDTH = 132
_INTERRUPTED = 130
_Result = TypeVar("_Result")


class InputError(Exception):
    """A mistake of the person, in words."""


class _Studies(TyperGroup):
    """Answers an unknown study with the known ones."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args and self.get_command(ctx, args[0]) is None:
            raise InputError(f"there is no study {args[0]!r}; the studies are {', '.join(self.list_commands(ctx))}")
        return super().resolve_command(ctx, args)


app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Joint parameters of spindle-holder-tool assemblies from measured vibration.",
)
studies = typer.Typer(
    cls=_Studies, no_args_is_help=True, help="One published study, done again from its printed numbers."
)
app.add_typer(studies, name="study")

Json = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write all results as JSON.")]
Plot = Annotated[
    Path | None,
    typer.Option("--plot", metavar="FILE", help="Save the figure; the ending says which format (png, pdf, svg)."),
]
Seed = Annotated[int, typer.Option(min=0, help="Of everything that is drawn.")]
Draws = Annotated[int, typer.Option(min=1, help="Simulations of the bias under chance.")]
Resolution = Annotated[
    float,
    typer.Option(
        "--resolution", metavar="HZ", help="Step in which frequencies are printed; ten times that from 10 kHz."
    ),
]
Overhang = Annotated[float, typer.Option("--overhang-error", metavar="MM", help="Standard deviation of an overhang.")]


def _print_version(wanted: bool) -> None:
    if wanted:
        from receptance.studies._provenance import versions

        found = versions()
        print(f"receptance {found.pop('receptance')} ({', '.join(f'{name} {value}' for name, value in found.items())})")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and stop.")
    ] = False,
) -> None:
    # The option's callback does its work; the argument is only there to declare it.
    del version


@app.command()
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
    targets = _Targets(json_file, plot)
    from receptance.cli.er32 import print_er32
    from receptance.studies import er32 as study

    options: dict[str, Any] = {name: given[name] for name in ("draws", "seed") if name in given}
    with _input():
        if "resolution" in given:
            fine = given["resolution"]
            options["resolution"] = study.Resolution(fine_hz=fine, coarse_hz=10.0 * fine)
        if "overhang_error" in given:
            options["chance"] = study.ChanceModel(overhang_mm=given["overhang_error"])
        settings = study.ER32Settings(**options)
    result = _with_progress(lambda say: study.run(settings, progress=say))

    def draw() -> Figure:
        from receptance.plot import draw_er32

        return draw_er32(result)

    targets.write(study.as_dict(result), draw)
    console = _console()
    print_er32(console, result)
    targets.name(console)


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
    targets = _Targets(json_file, plot)
    from receptance.cli.clamped_rods import print_clamped_rods
    from receptance.studies import clamped_rods as study

    with _input():
        error = study.checked_error(reading_error)
    result = _with_progress(lambda say: study.run(reading_error_hz=error, seed=seed, progress=say))

    def draw() -> Figure:
        from receptance.plot import draw_clamped_rods

        return draw_clamped_rods(result)

    targets.write(study.as_dict(result), draw)
    console = _console()
    print_clamped_rods(console, result)
    targets.name(console)


class _Targets:
    """The files that a command was asked for; checked before the work, written together after it."""

    def __init__(self, json_file: Path | None, plot: Path | None) -> None:
        self.json_file, self.plot = json_file, plot
        if json_file is not None and plot is not None and json_file.resolve() == plot.resolve():
            raise InputError(f"--json and --plot both name {plot}; give two files")
        for path in (json_file, plot):
            if path is not None:
                with _input():
                    check_target(path)
        self.kind = "" if plot is None else _image_kind(plot)

    def write(self, results: dict[str, Any], draw: Callable[[], Figure]) -> None:
        contents: dict[Path, bytes] = {}
        if self.json_file is not None:
            contents[self.json_file] = (json.dumps(results, indent=2, allow_nan=False) + "\n").encode()
        if self.plot is not None:
            from receptance.plot import as_image

            contents[self.plot] = as_image(draw(), self.kind)
        with _input():
            write_whole(contents)

    def name(self, console: Console) -> None:
        if self.json_file is not None:
            console.print(f"Results: {self.json_file}", soft_wrap=True)
        if self.plot is not None:
            console.print(f"Figure: {self.plot}", soft_wrap=True)


def _image_kind(plot: Path) -> str:
    from receptance.plot import image_formats

    kind = plot.suffix.removeprefix(".").lower()
    if kind not in image_formats():
        raise InputError(
            f"cannot write {plot}: its ending must name a format of pictures: {', '.join(image_formats())}"
        )
    return kind


@contextmanager
def _input() -> Iterator[None]:
    """What is raised in here is about what the person gave."""
    try:
        yield
    except (ValueError, TypeError, OSError) as error:
        raise InputError(str(error)) from error


class _Output(Console):
    """The standard output; a reader who has seen enough (`| head`) is no error."""

    def on_broken_pipe(self) -> None:
        self.quiet = True
        # What is still buffered has nowhere to go, and Python would complain of it at the end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(0)


def _console() -> Console:
    """Return the standard output; in a pipe wide enough for the tables and without colour."""
    console = _Output(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console = _Output(highlight=False, markup=False, emoji=False, width=_PIPE_WIDTH, no_color=True)
    return console


def _with_progress(work: Callable[[Callable[[str], None]], _Result]) -> _Result:
    console = Console(stderr=True)
    if not console.is_terminal:
        return work(lambda _: None)
    with console.status("starting") as status:
        return work(lambda text: status.update(text))


def main() -> None:
    """Run the command line and end the process with its exit code."""
    try:
        # Not standalone: an interruption and a mistake are told apart here, by exit code.
        code = app(standalone_mode=False, prog_name="receptance")
    except InputError as error:
        print(f"receptance: {error}", file=sys.stderr)
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        code = _INTERRUPTED
    except Exception as error:
        code = _answer(error)
    # Newer versions of typer answer an interruption with this code, older ones with an exception.
    if code == _INTERRUPTED:
        print("receptance: interrupted, no file was written", file=sys.stderr)
    raise SystemExit(code if isinstance(code, int) else 0)


def _answer(error: Exception) -> int:
    """Answer a mistake in the options as typer words it, anything else as an error of the program."""
    show = getattr(error, "show", None)
    if callable(show):
        show()
        return int(getattr(error, "exit_code", 2))
    traceback.print_exception(error)
    print("receptance: this is an error of the program, not of what you gave it; please report it", file=sys.stderr)
    return 1
