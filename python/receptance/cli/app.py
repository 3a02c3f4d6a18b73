"""The command line: all commands, and their exit codes.

Exit codes: 0 success, 1 internal error, 2 wrong input, 3 negative result (--strict, --at-most), 130 interrupted.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from receptance import report
from receptance._text import instead_of, printable, shown
from receptance.cli.campaigns import (
    check,
    diagnose,
    example,
    identify,
    invert,
    next_measurement,
    predict,
    schema,
    stability,
    transfer,
)
from receptance.cli.catalogue import catalogue
from receptance.cli.contour import contour
from receptance.cli.demo import demo
from receptance.cli.files import convert, show
from receptance.cli.materials import materials
from receptance.cli.new import new
from receptance.cli.open import open_page
from receptance.cli.running import InputError, InterruptedAnswer, takes_quiet
from receptance.cli.spindle import spindle
from receptance.cli.sweep import sweep
from receptance.errors import MissingExtraError

_INTERRUPTED = 130

_COMMANDS: dict[str, dict[str, Callable[..., None]]] = {
    "Start": {"demo": demo, "new": new, "open": open_page, "check": check, "example": example},
    "Identify": {
        "identify": identify,
        "diagnose": diagnose,
        "next": next_measurement,
        "invert": invert,
        "spindle": spindle,
        "sweep": sweep,
    },
    "Use": {"predict": predict, "transfer": transfer, "stability": stability, "catalogue": catalogue},
    "Tools": {
        "show": show,
        "contour": contour,
        "materials": materials,
        "convert": convert,
        "schema": schema,
    },
}


def _print_version(wanted: bool) -> None:
    if wanted:
        found = report.versions()
        print(f"receptance {found.pop('receptance')} ({', '.join(f'{name} {value}' for name, value in found.items())})")
        raise typer.Exit


def _root(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    # The callback of the option does the work; the argument only declares it.
    del version


class _Commands(TyperGroup):
    """The group of all commands; a name that is none of them is answered with those that are."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        name = args[0]
        if name not in self.commands and not name.startswith("-"):
            ctx.fail(f"there is no command {shown(name)}{instead_of(name, self.commands)}")
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Identify joints of spindle-holder-tool assemblies from measured vibration.",
)
app.callback()(_root)
for _group, _commands in _COMMANDS.items():
    for _name, _command in _commands.items():
        # The text of `schema` is all that it does.
        app.command(_name, rich_help_panel=_group)(_command if _command is schema else takes_quiet(_command))


def run() -> int:
    """Run the command line and return its exit code; an interruption without an answer is a KeyboardInterrupt."""
    try:
        # Not standalone, so that interruptions and wrong input get their own exit codes here.
        code = app(standalone_mode=False, prog_name="receptance")
    except (InputError, MissingExtraError) as error:
        print(f"receptance: {printable(str(error))}", file=sys.stderr)
        return 2
    except InterruptedAnswer as error:
        print(f"receptance: {error}", file=sys.stderr)
        return _INTERRUPTED
    except typer.Abort:
        raise KeyboardInterrupt from None
    except Exception as error:
        return _report(error)
    # Newer versions of typer return this code for an interruption, older ones raise an exception.
    if code == _INTERRUPTED:
        raise KeyboardInterrupt
    return code if isinstance(code, int) else 0


def _report(error: Exception) -> int:
    """Print a usage error in the words of typer, or the traceback of an internal error; return the exit code."""
    show = getattr(error, "show", None)
    if callable(show):
        show()
        return int(getattr(error, "exit_code", 2))
    print(printable("".join(traceback.format_exception(error))), end="", file=sys.stderr)
    print("receptance: this is an error of the program, not of the input; please report it", file=sys.stderr)
    return 1
