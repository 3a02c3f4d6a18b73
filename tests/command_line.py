"""The command line, run in the process of a test or in a process that is interrupted."""

from __future__ import annotations

import functools
import re
import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import pytest
import typer.main

from limits import LIMIT_S
from receptance.cli import main

_SCRIPT = """
import receptance.cli.running as running
from receptance.cli import main
running._QUIET = 0.0  # every line of progress is printed at once
main()
"""


PNG = b"\x89PNG\r\n\x1a\n"
"""First bytes of a figure."""
_built = functools.cache(typer.main.get_command)


def left() -> set[str]:
    """Return the names in the current folder."""
    return {path.name for path in Path().iterdir()}


def call(*arguments: object) -> int:
    """Run the command line in this process and return its exit code; a command whose extra is missing is skipped."""
    if arguments and arguments[0] == "sweep":
        pytest.importorskip("zarr", reason="needs Zarr: pip install 'receptance[sweep]'")
    if any(str(one).endswith((".h5", ".h5.gz")) for one in arguments):
        pytest.importorskip("h5py", reason="needs h5py: pip install 'receptance[hdf5]'")
    # Typer reads the annotations of all commands at each call, which takes as long as many of the commands.
    fixed, typed = patch.object(typer.main, "get_command", _built), ["receptance", *map(str, arguments)]
    with fixed, patch.object(sys, "argv", typed), pytest.raises(SystemExit) as end:
        main()
    assert isinstance(end.value.code, int)
    return end.value.code


def interrupted(*arguments: str, progress: str = "") -> tuple[int, str, str]:
    """Interrupt a command at the first line of progress with a pattern; return exit code, output and error output."""
    command = [sys.executable, "-c", _SCRIPT, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        try:
            lines = []
            for line in process.stderr:
                lines.append(line)
                if re.search(progress, line):
                    process.send_signal(signal.SIGINT)
                    break
            out, err = process.communicate(timeout=LIMIT_S)
        finally:
            process.kill()
    return process.returncode, out, "".join(lines) + err
