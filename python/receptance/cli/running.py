"""Files, errors, progress and terminal output of commands."""

from __future__ import annotations

import functools
import inspect
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from threading import Event, Lock, Thread
from time import perf_counter
from typing import Annotated, Any, Literal, TypeVar

import typer
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

import receptance
from receptance._files import check_target, write_whole
from receptance._remaining import Remaining
from receptance._text import printable
from receptance.report.terminal import LEAST_WIDTH, print_result

_PIPE_WIDTH = 132
_QUIET = 10.0
"""Seconds without output after which progress is printed to a pipe."""
_SOON = 0.05
"""Shortest interval in seconds at which the time without output is checked."""
_OUTPUT = "Output"
"""Group of the options of output files in the help."""
_Result = TypeVar("_Result")

Json = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        help="Write the results as JSON; with - to standard output, and the text to standard error.",
        rich_help_panel=_OUTPUT,
    ),
]
_Plot = Annotated[
    Path | None,
    typer.Option(
        "--plot",
        metavar="FILE",
        help="Save the figure; its ending is the format: png, pdf, svg.",
        rich_help_panel=_OUTPUT,
    ),
]
_Report = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="FILE",
        help="Write the results with figures as one HTML file, ending .html.",
        rich_help_panel=_OUTPUT,
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.", rich_help_panel=_OUTPUT)]
Seed = Annotated[int, typer.Option(metavar="N", min=0, help="Seed of random numbers.")]
NewSeed = Annotated[
    int | None, typer.Option("--seed", metavar="N", min=0, help="Seed of random numbers; by default that of the file.")
]


_is_quiet: ContextVar[bool] = ContextVar("quiet", default=False)
_STANDARD_OUTPUT = Path("-")
_NO = 3
"""Exit code for a negative result: without an answer, or of --strict or --at-most."""
PROFILES, STABILISATION = "profiles", "modes"
"""Ends of the names of the figures of a fit beside its own: of profiles, and of the number of modes."""


class InputError(Exception):
    """Wrong input, with a message for the user."""


class InterruptedAnswer(Exception):  # noqa: N818
    """An interruption after which a preliminary result was printed."""


def takes_options(
    name: str, options: Mapping[str, tuple[Any, Any]], made: Callable[[dict[str, Any]], Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command options, by their names with type and default, in place of its parameter `name`.

    The parameter is made from the values of the options. Typer declares the options from the signature.
    """

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def called(**values: Any) -> None:
            command(**{name: made({option: values.pop(option) for option in options})}, **values)

        signature = inspect.signature(command, eval_str=True)
        kept = [parameter for parameter in signature.parameters.values() if parameter.name != name]
        only = inspect.Parameter.KEYWORD_ONLY
        added = [inspect.Parameter(key, only, default=value, annotation=kind) for key, (kind, value) in options.items()]
        called.__signature__ = signature.replace(parameters=[*kept, *added])  # type: ignore[attr-defined]
        return called

    return with_options


def takes_quiet(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the option --quiet: neither text nor progress, but for errors and the JSON of `--json -`."""

    @functools.wraps(command)
    def silenced(*, quiet: bool, **values: Any) -> None:
        before = _is_quiet.set(quiet)
        try:
            command(**values)
        finally:
            _is_quiet.reset(before)

    words = "Print errors only; files are written all the same."
    option = typer.Option("--quiet", "-q", help=words, rich_help_panel=_OUTPUT)
    return takes_options("quiet", {"quiet": (Annotated[bool, option], False)}, lambda values: values["quiet"])(silenced)


def takes_targets(
    strict: str = "", *, plot: Path | None = None, report: Path | None = None
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of its output files, and pass these as `targets`.

    `strict` are the results for which the option --strict, which is then there, ends with exit code 3. `plot` and
    `report` are default files, which are replaced because the same command has written them.
    """
    options: dict[str, tuple[Any, Any]] = {"json_file": (Json, None), "plot": (_Plot, plot)}
    options |= {"report": (_Report, report), "overwrite": (Overwrite, False)}
    if strict:
        option = typer.Option("--strict", help=f"Exit with {_NO} {strict}.", rich_help_panel=_OUTPUT)
        options["strict"] = (Annotated[bool, option], False)

    def targets(values: dict[str, Any]) -> Targets:
        own = {path for path in (plot, report) if path is not None and path in (values["plot"], values["report"])}
        return Targets(**values, own=own)

    return takes_options("targets", options, targets)


@contextmanager
def input_errors(*kinds: type[Exception]) -> Iterator[None]:
    """Convert errors to `InputError`; by default ValueError, TypeError and OSError."""
    expected = kinds or (ValueError, TypeError, OSError)
    try:
        yield
    except expected as error:
        text = str(error)
        if isinstance(error, OSError) and error.filename is not None and error.strerror:
            text = f"{error.filename}: {error.strerror}"  # without the error number
        raise InputError(text) from error


def count_of_modes(option: str, text: str) -> int | Literal["auto"]:
    """Return a number of modes that an option states, or "auto"; raise `InputError` for another text."""
    if text == "auto":
        return "auto"
    if not text.isdecimal() or not int(text):
        raise InputError(f"{option} is {text!r}, expected a number of modes such as 6, or auto")
    return int(text)


def refuse_existing(option: str, path: Path, *, overwrite: bool) -> None:
    """Raise `InputError` if a file exists and may not be replaced; devices and pipes are written to."""
    if path.is_symlink() and not path.exists() and not overwrite:
        target = os.readlink(path)
        raise InputError(
            f"{option} is {path}, a link to {target}, which would be created; add --overwrite if it should"
        )
    if path.is_file() and not overwrite:
        raise InputError(f"{option} would replace {path}, which exists; give another name, or add --overwrite")


class Targets:
    """Output files of a command: checked before the work, and written together after it."""

    def __init__(
        self,
        json_file: Path | None,
        plot: Path | None,
        report: Path | None,
        *,
        overwrite: bool,
        own: Set[Path | None] = frozenset(),
        strict: bool = False,
    ) -> None:
        self._strict, self.overwrite, self._own = strict, overwrite, own
        self._files: dict[str, Path] = {}
        """Files by option."""
        self._names: list[tuple[str, Path]] = []
        """What is printed of the files."""
        self.json_to_output = json_file == _STANDARD_OUTPUT
        self.add("--json", None if self.json_to_output else json_file, "Results")
        self.add("--report", report, "Report", (".html", ".htm"), "a report is one HTML file")
        self.add("--plot", plot, "Figure")
        self.kind = "" if plot is None else _image_kind(plot)

    def add(self, option: str, path: Path | None, name: str, endings: Sequence[str] = (), what: str = "") -> None:
        """Add a file if its option was given.

        `name` is that of its contents, which is printed with the file; `what` is the reason for the allowed endings.
        """
        if path is None:
            return
        if endings and path.suffix.lower() not in endings:
            raise InputError(f"cannot write {path}: {what}, expected an ending {endings[0]}")
        for other, file in self._files.items():
            if file.resolve() == path.resolve():
                raise InputError(f"{other} and {option} both name {path}; give two files")
        with input_errors():
            check_target(path)
        self._files[option] = path
        self._names.append((name, path))

    def leave_out(self, path: Path) -> None:
        """Neither write nor name a file."""
        self._names = [name for name in self._names if name[1] != path]

    @property
    def asked(self) -> bool:
        """Whether any output beside the text was asked for."""
        return bool(self._files) or self.json_to_output

    @property
    def draws(self) -> bool:
        """Whether a figure is written, alone or in the report."""
        return bool({"--plot", "--report"} & self._files.keys())

    def _every(self) -> Iterator[tuple[str, Path]]:
        """Yield option and path of each file that may be written, further figures included."""
        yield from self._files.items()
        if (plot := self._files.get("--plot")) is not None and plot not in self._own:
            for name in (PROFILES, STABILISATION):
                yield "--plot", _beside(plot, name)

    def protect(self, path: Path, what: str) -> None:
        """Raise `InputError` if an output file is a file that is read."""
        for option, target in self._every():
            if target.resolve() == path.resolve():
                raise InputError(f"{option} names {target}, which is {what}; give another file")

    def require_new(self) -> None:
        """Raise `InputError` if an output file exists and --overwrite was not given."""
        for option, path in self._every():
            if path not in self._own:
                refuse_existing(option, path, overwrite=self.overwrite)

    def write(
        self,
        results: Callable[[], dict[str, Any]],
        draw: Callable[[], Any] | None = None,
        beside: Mapping[str, Callable[[], Any]] | None = None,
        html: Callable[[], str] | None = None,
        more: Mapping[Path, str | bytes] | None = None,
    ) -> None:
        """Write all output files or none.

        `beside` are further figures, by the ends of their names; `more` are contents of other files.
        """
        json_file, plot, page = (self._files.get(option) for option in ("--json", "--plot", "--report"))
        contents = {p: text.encode() if isinstance(text, str) else text for p, text in (more or {}).items()}
        document = ""
        if json_file is not None or self.json_to_output:
            document = json.dumps(results(), indent=2, allow_nan=False) + "\n"
        if json_file is not None:
            contents[json_file] = document.encode()
        if page is not None and html is not None:
            with input_errors():  # some results have no figure, such as sweeps of many parameters
                contents[page] = html().encode()
        figures: dict[Path, bytes] = {}
        if plot is not None and draw is not None:
            try:
                with input_errors():
                    figures[plot] = receptance.report.figure.as_image(draw(), self.kind)
                for name, draw_other in (beside or {}).items():
                    self._names.append(("Figure", _beside(plot, name)))
                    figures[_beside(plot, name)] = receptance.report.figure.as_image(draw_other(), self.kind)
            except Exception:
                with input_errors():
                    write_whole(contents)  # results are written even if the figure cannot be drawn
                raise
        with input_errors():
            write_whole({**contents, **figures})
        if self.json_to_output:
            output(quiet=False).out(document, end="", highlight=False)

    def show(
        self,
        result: receptance.report.Result,
        measured: Sequence[receptance.report.Table] = (),
        *,
        beside: Mapping[str, Callable[[], Any]] | None = None,
        more: Mapping[Path, str | bytes] | None = None,
    ) -> None:
        """Write the output files, print the result with the tables of its data, and print the names of the files."""
        self.write(result.to_dict, result.plot, beside, lambda: result.to_html(measured=measured), more)
        console = self.console()
        print_result(console, result, measured)
        self.print_names(console)

    def require(self, good: bool, *, always: bool = False) -> None:
        """End with the exit code of a negative result if --strict was given and the result is not good."""
        if not good and (self._strict or always):
            raise typer.Exit(_NO)

    def console(self) -> Console:
        """Return the console for text: standard output, unless the JSON goes there."""
        return output(stderr=self.json_to_output)

    def print_names(self, console: Console) -> None:
        """Print the names of the files that were written."""
        for name, path in self._names:
            console.print(f"{name}: {path}", soft_wrap=True)


def _beside(path: Path, what: str) -> Path:
    return path.with_name(f"{path.stem}-{what}{path.suffix}")


def _image_kind(plot: Path) -> str:
    kind = plot.suffix.removeprefix(".").lower()
    formats = receptance.report.figure.image_formats()
    if kind not in formats:
        raise InputError(f"cannot write {plot}: expected an ending with a format of figures: {', '.join(formats)}")
    return kind


class _Output(Console):
    """Standard output; control characters of titles and names are escaped, and a closed pipe (`| head`) is no error."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(printable(segment.text), segment.style)

    def on_broken_pipe(self) -> None:
        self.quiet = True
        # Discard the buffer, because Python reports an error if it cannot be flushed at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(0)


def output(*, stderr: bool = False, quiet: bool | None = None) -> Console:
    """Return standard output or standard error; to a pipe without colour, with the width COLUMNS.

    Nothing is printed to it if it is quiet, by default as the option --quiet says.
    """
    quiet = _is_quiet.get() if quiet is None else quiet
    options: dict[str, Any] = {"highlight": False, "markup": False, "emoji": False, "stderr": stderr, "quiet": quiet}
    console = _Output(**options)
    if not console.is_terminal:
        columns = os.environ.get("COLUMNS", "")
        width = int(columns) if columns.isdecimal() and int(columns) > 0 else _PIPE_WIDTH
        console = _Output(**options, width=width, no_color=True)
    # A narrower terminal wraps the lines itself.
    console.width = max(console.width, LEAST_WIDTH)
    return console


@contextmanager
def _printed_progress() -> Iterator[Callable[[str], None]]:
    """Print the latest message and the elapsed time if nothing was printed for some seconds."""
    began = last = perf_counter()
    latest, lock, done = "", Lock(), Event()

    def print_if_quiet() -> None:
        nonlocal last
        now = perf_counter()
        with lock:
            if latest and now - last >= _QUIET:
                last = now
                print(f"{now - began:.0f} s: {latest}", file=sys.stderr, flush=True)

    def say(text: str) -> None:
        nonlocal latest
        latest = text
        print_if_quiet()

    def watch() -> None:
        # A step without messages may take minutes.
        while not done.wait(max(_QUIET, _SOON)):
            print_if_quiet()

    thread = Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield say
    finally:
        done.set()
        thread.join()


def with_progress(work: Callable[[Callable[[str], None]], _Result]) -> _Result:
    """Run long work and show its progress on standard error: live on a terminal, else a line every few seconds."""
    if _is_quiet.get():
        return work(lambda text: None)
    console, timed = Console(stderr=True), Remaining()
    if not console.is_terminal:
        with _printed_progress() as say:
            return work(lambda text: say(timed(text)))
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("starting", total=None)
        return work(lambda text: progress.update(task, description=printable(timed(text))))
