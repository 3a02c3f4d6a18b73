"""The commands together, and how they end.

Exit codes: 0 done, 1 an internal error, 2 bad input, 3 the answer is no, 130 interrupted.
"""

from __future__ import annotations

import sys
import traceback
from typing import Annotated

import typer

from receptance._text import printable
from receptance.cli.campaigns import diagnose, example, identify, predict, schema, transfer
from receptance.cli.catalogue import catalogue
from receptance.cli.convert import convert
from receptance.cli.running import InputError, InterruptedAnswer
from receptance.cli.stability import stability
from receptance.cli.steps import invert, next_step
from receptance.cli.studies import demo, studies
from receptance.cli.sweep import sweep

__all__ = ["app", "main"]

_INTERRUPTED = 130

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Joint parameters of spindle-holder-tool assemblies from measured vibration.",
)
app.command()(demo)
app.add_typer(studies, name="study")
for command in (example, identify, predict, transfer, diagnose, convert, schema):
    app.command()(command)
app.command()(invert)
app.command("next")(next_step)
app.command()(sweep)
app.command()(stability)
app.command()(catalogue)


def _print_version(wanted: bool) -> None:
    if wanted:
        from receptance.provenance import versions

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


def main() -> None:
    """Run the command line and end the process with its exit code."""
    try:
        # Not standalone: an interruption and a mistake are told apart here, by exit code.
        code = app(standalone_mode=False, prog_name="receptance")
    except InputError as error:
        print(f"receptance: {printable(str(error))}", file=sys.stderr)
        code = 2
    except InterruptedAnswer as error:
        print(f"receptance: {error}", file=sys.stderr)
        raise SystemExit(_INTERRUPTED) from None
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
    print(printable("".join(traceback.format_exception(error))), end="", file=sys.stderr)
    print("receptance: this is an error of the program, not of what you gave it; please report it", file=sys.stderr)
    return 1
