"""Pictures of the terminal: `python benches/screens.py FOLDER [--columns N] [--only TEXT ...] [--json FILE]`.

Every command runs on every packaged example on a terminal of 80 columns, and so do `demo`, `show` and the
help of each command. What the terminal shows is written to FOLDER as SVG, with a page `index.html` of all of them.
Printed are the processor time of each command, the number of lines, and the number of cut cells: lines with an ellipsis
and lines of tables that are wider than the terminal. Exit code 1 if there is one, or if a command fails.

`--json FILE` keeps the processor times, together with those that FILE has of earlier runs. `--source FOLDER` runs the
package of another folder, such as `python` of an older commit with its compiled core. `--table FILE [FILE]` prints the
times of one or two such files, before and after, as a Markdown table, and runs nothing. Bytecode is written and read,
as after an installation.
"""

from __future__ import annotations

import argparse
import compileall
import json
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
    ("show", "forgotten-sensor/tool_40mm.csv", "--no-window"),
    (
        "new",
        "own",
        "forgotten-sensor/tool_40mm.csv",
        "--overhang",
        "40 mm",
        "--tool",
        "12 mm",
        "--tool-material",
        "carbide",
        "--holder",
        "40 mm x 50 mm, 50 mm x 44/16 mm",
        "--holder-material",
        "steel",
        "--insertion",
        "40 mm",
        "--sensor",
        "none",
        "--support",
        "free",
    ),
    *((command, "--help") for command in (*COMMANDS, "demo", "new", "show", "convert", "schema")),
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


def run(words: tuple[str, ...], folder: Path, columns: int, source: Path | None = None) -> Screen:
    """Run a command whose standard output is a terminal; progress on standard error is not part of the picture."""
    ours, theirs = pty.openpty()
    variables = {**os.environ, "COLUMNS": str(columns), "LINES": "50", "TERM": "xterm-256color"}
    variables.pop("PYTHONDONTWRITEBYTECODE", None)
    if source is not None:
        variables["PYTHONPATH"] = str(source.resolve())
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


def times_table(files: list[Path]) -> str:
    """Return the processor times of one or two files as Markdown: examples below each other, commands side by side."""
    times = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    every = list(dict.fromkeys(name for one in reversed(times) for name in one))
    by_example = [name for name in every if name.split()[0] in COMMANDS and not name.endswith("--help")]
    examples = list(dict.fromkeys(name.split()[1] for name in by_example))
    rows = [["example", *COMMANDS], ["---"] * (len(COMMANDS) + 1)]
    rows += [[example, *(_cell(times, f"{command} {example}") for command in COMMANDS)] for example in examples]
    others = [name for name in every if name not in by_example]
    rows += [[], ["command", "processor time [s]"], ["---", "---"]]
    rows += [[f"`receptance {name}`", _cell(times, name)] for name in others]
    return "\n".join(f"| {' | '.join(row)} |" if row else "" for row in rows)


def _named(words: tuple[str, ...]) -> str:
    """Return the first words of a command, without options that take values."""
    kept = [word for word in words[:3] if not word.startswith("-") or word in ("--help", "--list")]
    return " ".join(kept)


def _cell(times: list[dict[str, float]], name: str) -> str:
    """Return the time of a command in each file; a dash where it did not run."""
    return " → ".join(f"{one[name]:.2f}" if name in one else "-" for one in times)


def main(arguments: list[str] | None = None) -> int:
    """Run all commands and write their pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="where the pictures are written")
    parser.add_argument("--columns", type=int, default=80, help="width of the terminal")
    parser.add_argument("--only", nargs="+", default=[""], help="only commands whose text contains one of these")
    parser.add_argument("--json", type=Path, help="processor times of the commands that ended without an error")
    parser.add_argument("--source", type=Path, help="folder of another version of the package")
    parser.add_argument("--table", type=Path, nargs="+", help="files of --json, before and after; nothing is run")
    options = parser.parse_args(arguments)
    if options.table:
        print(times_table(options.table))
        return 0
    if options.folder is None:
        parser.error("give a FOLDER for the pictures, or --table")
    from receptance import examples

    options.folder.mkdir(parents=True, exist_ok=True)
    every = [*OTHERS, *((command, name, *more) for name in examples.EXAMPLES for command, more in COMMANDS.items())]
    cut = failed = 0
    shown = []
    times: dict[str, float] = {}
    if options.json and options.json.exists():
        times = json.loads(options.json.read_text(encoding="utf-8"))
    package = Path(examples.__file__).parents[1] if options.source is None else options.source / "receptance"
    compileall.compile_dir(package, quiet=2)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        for name in examples.EXAMPLES:
            examples.write(name, folder / name)
        for words in every:
            if not any(text in " ".join(words) for text in options.only):
                continue
            screen = run(words, folder, options.columns, options.source)
            if screen.code == 0:
                times[_named(words)] = round(screen.seconds, 3)
            if options.json:
                options.json.write_text(json.dumps(times, indent=2) + "\n", encoding="utf-8")
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
