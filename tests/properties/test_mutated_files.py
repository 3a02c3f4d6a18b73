"""Damaged files of every format; `python tests/properties/mutated_files.py --count N --seed S` does more of it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from limits import LIMIT_S
from properties.mutated_files import run

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "1"))
SCRIPT = Path(__file__).with_name("mutated_files.py")
COUNT = 1_000


def test_some_damaged_files() -> None:
    report = run(700, SEED, longest_s=LIMIT_S)
    print(report)
    assert not report.failures, str(report)
    formats = {key.split(":")[0] for key in report.outcomes}
    assert formats == {"uff", "ufb", "csv", "npz", "npy", "mat", "h5", "cutpro", "dataphysics", "lvm", "gz", "campaign"}
    for name in formats:
        # Some files stay readable and some do not.
        assert report.outcomes[f"{name}:read"] > 0, str(report)
        assert report.outcomes[f"{name}:refused"] > 0, str(report)


@pytest.mark.slow
def test_many_damaged_files() -> None:
    """In a process of its own, with a limit of memory: a crash would be seen as one."""
    command = f"ulimit -v 8000000 && exec {sys.executable} {SCRIPT} --count {COUNT} --seed {SEED} --longest {LIMIT_S}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    print(done.stdout)
    assert done.returncode == 0, f"ended with {done.returncode}: {done.stdout[-3000:]}{done.stderr[-500:]}"
    assert re.search(rf"{COUNT} damaged files", done.stdout)
