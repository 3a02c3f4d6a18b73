"""The laboratory of machines with an unknown spindle: `python benches/laboratory.py COMMAND [--seed S] [--cases N]
[--jobs N] [--limit S] [--resume FILE]`.

`converge` identifies joint and spindle of random machines of finite elements and compares each optimum with the best
known one. `--best FILE` keeps the costs of fits from near the truth, which take longest, for the next run.

`depths` recommends depths of cut from descriptions as users make them and compares them with the true limits.

`blind` hides an effect in each machine and scores the diagnosis.

A case that fails or exceeds its limit counts as failed. A case is drawn from the seed and its number, so a resumed run
gives the same cases. `tests/machine_laboratory` has the laboratory. Times are processor times.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more.
os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import sys
from pathlib import Path

# The laboratory is under tests.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from machine_laboratory import batch, blind, converge, depths

COMMANDS = {"converge": (converge, 50, 300.0), "depths": (depths, 300, 300.0), "blind": (blind, 120, 900.0)}
"""Each command with its default number of cases and its time limit in s."""


def main(arguments: list[str] | None = None) -> int:
    """Run a command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, (command, cases, limit) in COMMANDS.items():
        # argparse formats the help with `%`.
        of_command = commands.add_parser(name, help=command.__doc__.partition("\n")[0].replace("%", "%%"))
        batch.add_options(of_command, cases, limit)
        command.add_options(of_command)
    options = parser.parse_args(arguments)
    return COMMANDS[options.command][0].main(options)


if __name__ == "__main__":
    sys.exit(main())
