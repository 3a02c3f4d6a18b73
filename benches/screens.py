"""Pictures of the terminal: `python benches/screens.py FOLDER [--columns N] [--only TEXT]`.

Every command runs on every packaged example on a terminal of 80 columns, and so do `demo`, `show`, the studies and the
help of each command. What the terminal shows is written to FOLDER as SVG, with a page `index.html` of all of them.
Printed are the processor time of each command, the number of lines, and the number of cut cells: lines with an ellipsis
and lines of tables that are wider than the terminal. Exit code 1 if there is one, or if a command fails.
"""

from __future__ import annotations

import argparse
import os
import pty
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.text import Text

COMMANDS = {
    "check": ("--no-window",),
    "identify": (),
    "diagnose": (),
    "next": (),
    "invert": (),
    "sweep": ("--sample", "200"),
    "predict": (),
    "transfer": (),
    "stability": (),
    "catalogue": (),
}
"""Commands that analyse a campaign, with their options."""
OTHERS = (
    ("--help",),
    ("demo",),
    ("example", "--list"),
    ("study", "er32", "--draws", "20"),
    ("study", "bt50"),
    ("show", "forgotten-sensor/tool_40mm.csv", "--no-window"),
    (
        "new",
        "own",
        "forgotten-sensor/tool_40mm.csv",
        "--overhang",
        "40 mm",
        "--tool",
        "12 mm",
        "--holder",
        "50 x 40 mm",
    ),
    *((command, "--help") for command in (*COMMANDS, "demo", "new", "show", "convert", "schema", "study")),
)
_RULES = "\u2500\u2502\u2501\u2503"
"""Characters of the lines of tables."""


class Screen(NamedTuple):
    """What a command printed on a terminal."""

    words: tuple[str, ...]
    code: int
    seconds: float
    output: str

    def cut(self, columns: int) -> int:
        """Return the number of lines with an ellipsis, and of lines of tables beyond the last column."""
        lines = Text.from_ansi(self.output).plain.splitlines()
        wide = [line for line in lines if len(line) > columns and any(rule in line for rule in _RULES)]
        return len(wide) + sum("\u2026" in line for line in lines)


def run(words: tuple[str, ...], folder: Path, columns: int) -> Screen:
    """Run a command whose standard output is a terminal; progress on standard error is not part of the picture."""
    ours, theirs = pty.openpty()
    variables = {**os.environ, "COLUMNS": str(columns), "LINES": "50", "TERM": "xterm-256color"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "receptance.cli", *words]
    process = subprocess.Popen(
        command, cwd=folder, env=variables, stdin=subprocess.DEVNULL, stdout=theirs, stderr=subprocess.PIPE
    )
    os.close(theirs)
    output = b""
    while True:
        try:
            read = os.read(ours, 65536)
        except OSError:  # the end of a terminal is an error on Linux
            break
        if not read:
            break
        output += read
    assert process.stderr is not None
    errors = process.stderr.read().decode()
    code = process.wait()
    os.close(ours)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    text = output.decode().replace("\r\n", "\n")
    return Screen(words, code, seconds, text if code == 0 else text + errors)


def picture(screen: Screen, columns: int) -> str:
    """Return the terminal as SVG."""
    console = Console(record=True, width=columns, file=open(os.devnull, "w"), force_terminal=True)  # noqa: SIM115
    console.print(Text.from_ansi(screen.output))
    return console.export_svg(title=f"receptance {' '.join(screen.words)}")


def main(arguments: list[str] | None = None) -> int:
    """Run all commands and write their pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="where the pictures are written")
    parser.add_argument("--columns", type=int, default=80, help="width of the terminal")
    parser.add_argument("--only", default="", help="only commands whose text contains this")
    options = parser.parse_args(arguments)
    from receptance import examples

    options.folder.mkdir(parents=True, exist_ok=True)
    every = [*OTHERS, *((command, name, *more) for name in examples.EXAMPLES for command, more in COMMANDS.items())]
    cut = failed = 0
    shown = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in examples.EXAMPLES:
            examples.write(name, folder / name)
        for words in every:
            if options.only not in " ".join(words):
                continue
            screen = run(words, folder, options.columns)
            # Exit code 2: an example without the data that a command needs; the message says so.
            failed += screen.code not in (0, 2)
            cut += screen.cut(options.columns)
            file = "-".join(word.strip("-").replace("/", "-").replace(" ", "") for word in words[:2]) + ".svg"
            (options.folder / file).write_text(picture(screen, options.columns), encoding="utf-8")
            shown.append(file)
            print(
                f"{' '.join(words):60.60s} {screen.seconds:7.2f} s, {screen.output.count(chr(10)):4d} lines, "
                f"{screen.cut(options.columns)} cut, exit code {screen.code}",
                flush=True,
            )
    pictures = "\n".join(f'<p>{file}</p><img src="{file}" alt="{file}">' for file in shown)
    (options.folder / "index.html").write_text(f"<!DOCTYPE html>\n<meta charset=utf-8>\n{pictures}\n", encoding="utf-8")
    print(f"{len(shown)} screens of {options.columns} columns in {options.folder}: {cut} cut cells, {failed} failed")
    return 1 if cut or failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
