"""Frozen outputs: record the outputs of the program, and print later differences.

``python tests/frozen record`` runs every case below and writes one JSON file for each beside this file.
``python tests/frozen compare`` runs them again and prints each number, word or key that differs; exit code 1 where
any does. ``--only TEXT`` selects cases whose name contains the text, ``--jobs N`` runs N cases at a time. An intended
difference is accepted by recording that case again; say why in the changelog.

A case is one command on one packaged example, of `gauge` after `spindle`, one study, the accuracy report with a fixed
seed, or one block of cases of the blind laboratory. Numbers are written with six digits. Two numbers agree if they
differ by less than `RELATIVE` of the larger one, or by less than `ABSOLUTE`. Long lists of numbers, and the real and
imaginary parts of complex ones, are recorded as their length, range, mean and root mean square. Times, versions and
texts that only people read are left out.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]

EXAMPLES = ("bt50", "drawing", "er32", "forgotten-sensor", "free-free", "hammer", "machine", "taper")
COMMANDS = ("identify", "predict", "transfer", "invert", "next", "stability")
SPINDLE = "gauge"
"""Example whose spindle is identified first; the other commands read the file of its modes."""
SCRIPTS = ("bt50", "er32", "clamped-rods", "table3", "clamping", "machines")
"""Studies that are scripts in docs/studies."""

RELATIVE = 1e-3
"""Largest relative difference of two numbers that agree: results of fits end within a thousandth of themselves."""

ABSOLUTE = 1e-9
"""Largest absolute difference of two numbers that agree: above rounding errors around zero, below any result."""

LONG = 40
"""Lists of numbers longer than this are recorded by their statistics."""

IGNORED = frozenset(
    {"seconds", "versions", "version", "python", "platform", "provenance", "created", "date", "elapsed", "notes"}
    | {"advice", "sentences", "title", "summary", "texts", "statements", "warnings", "path", "threads"}
)
"""Keys whose values are times, versions, places or sentences."""

BLIND_SEED = 20261122
BLIND_CASES = 60
BLIND_BLOCK = 5
"""Cases of the blind laboratory that are run in one process."""


@dataclass(frozen=True)
class Run:
    """One case: its name, the arguments of the interpreter, and the files that it writes."""

    name: str
    arguments: tuple[str, ...]
    outputs: tuple[str, ...]
    before: tuple[str, ...] = ()
    """Arguments of the command that runs before it."""


def cases() -> list[Run]:
    """Return every case, the longest first, so that they fill both processors to the end."""
    cli = ("-m", "receptance.cli")
    runs = []
    for name in SCRIPTS:
        script = str(REPOSITORY / "docs" / "studies" / f"{name.replace('-', '_')}.py")
        runs.append(Run(f"study-{name}", (script, "--json", "out.json"), ("out.json",)))
    # The taper is left out: its 26 levels take many minutes. The example bt50 has some of its data.
    for name in ("bt50", "drawing", "er32", "forgotten-sensor", "hammer", "free-free", "machine"):
        runs.append(Run(f"diagnose-{name}", (*cli, "diagnose", name, "--json", "out.json"), ("out.json",)))
    for first in range(0, BLIND_CASES, BLIND_BLOCK):
        script = str(HERE / "blind_cases.py")
        runs.append(
            Run(f"blind-{first:02d}", (script, str(BLIND_SEED), str(first), str(first + BLIND_BLOCK)), ("out.json",))
        )
    report = str(REPOSITORY / "tests" / "validation" / "accuracy_report.py")
    runs.append(Run("accuracy", (report, "--seed", "1", "--cases", "20", "--json", "out.json"), ("out.json",)))
    for example in EXAMPLES:
        for command in COMMANDS:
            if (command, example) == ("transfer", "taper"):
                continue  # 52 fits take more than ten minutes
            runs.append(Run(f"{command}-{example}", (*cli, command, example, "--json", "out.json"), ("out.json",)))
        runs.append(
            Run(f"sweep-{example}", (*cli, "sweep", example, "--sample", "500", "--json", "out.json"), ("out.json",))
        )
        runs.append(Run(f"catalogue-{example}", (*cli, "catalogue", example, "--out", "out.csv"), ("out.csv",)))
    modes = ("spindle", SPINDLE, "--modes", "auto")
    runs.append(Run(f"spindle-{SPINDLE}", (*cli, *modes, "--json", "out.json"), ("out.json",)))
    for command in ("identify", "predict", "stability"):
        runs.append(
            Run(f"{command}-{SPINDLE}", (*cli, command, SPINDLE, "--json", "out.json"), ("out.json",), before=modes)
        )
    return runs


def answer(run: Run) -> dict[str, Any]:
    """Run one case in an empty folder and return its exit code and its rounded output."""
    with tempfile.TemporaryDirectory() as folder:
        words = list(run.arguments)
        if words[1] == "receptance.cli":
            example = words[3]
            subprocess.run(
                [sys.executable, "-m", "receptance.cli", "example", example, example],
                cwd=folder, check=True, capture_output=True,
            )  # fmt: skip
        if run.before:
            subprocess.run(
                [sys.executable, "-m", "receptance.cli", *run.before], cwd=folder, check=True, capture_output=True
            )
        alone = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "Agg", "COLUMNS": "100"}
        begun = time.perf_counter()
        done = subprocess.run(
            [sys.executable, *words], cwd=folder, capture_output=True, text=True, env={**os.environ, **alone}
        )
        found: dict[str, Any] = {"exit": done.returncode}
        if done.returncode not in (0, 1, 2, 3):
            raise RuntimeError(f"{run.name} ended with exit code {done.returncode}:\n{done.stderr[-2000:]}")
        for name in run.outputs:
            path = Path(folder, name)
            if path.exists():
                found["output"] = rounded(read(path))
        sys.stderr.write(f"{time.perf_counter() - begun:7.1f} s  {run.name}: exit code {done.returncode}\n")
        return found


def read(path: Path) -> Any:
    """Return the contents of an output file."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        return json.loads(text)
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    return [{key: _number(value) for key, value in row.items()} for row in rows]


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def rounded(value: Any) -> Any:
    """Return a document with ignored keys left out, numbers rounded and long lists replaced by their statistics."""
    if isinstance(value, dict):
        return {key: rounded(inner) for key, inner in value.items() if key not in IGNORED}
    if isinstance(value, list):
        numbers = [x for x in value if isinstance(x, (int, float)) and not isinstance(x, bool)]
        if len(value) > LONG and len(numbers) == len(value):
            finite = [x for x in numbers if math.isfinite(x)]
            square = math.fsum(x * x for x in finite)
            statistics = {"least": min(finite), "most": max(finite), "mean": math.fsum(finite) / len(finite)}
            return {
                "length": len(value),
                "finite": len(finite),
                **{key: rounded(one) for key, one in statistics.items()},
                "rms": rounded(math.sqrt(square / len(finite))),
            }
        if len(value) > LONG and all(isinstance(x, list) and len(x) == 2 for x in value):  # complex numbers
            return [rounded(list(part)) for part in zip(*value, strict=True)]
        return [rounded(inner) for inner in value]
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.6g}")
    if isinstance(value, float):
        return str(value)
    return value


def differences(before: Any, after: Any, where: str = "") -> Iterator[str]:
    """Yield a line for every place at which two documents differ."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in before.keys() | after.keys():
            place = f"{where}.{key}"
            if key not in after:
                yield f"{place}: gone, was {_short(before[key])}"
            elif key not in before:
                yield f"{place}: new, {_short(after[key])}"
            else:
                yield from differences(before[key], after[key], place)
    elif isinstance(before, list) and isinstance(after, list):
        if len(before) != len(after):
            yield f"{where}: {len(before)} entries, now {len(after)}"
        for index, (old, new) in enumerate(zip(before, after, strict=False)):
            yield from differences(old, new, f"{where}[{index}]")
    elif _numeric(before) and _numeric(after):
        away = abs(before - after)
        if away > max(ABSOLUTE, RELATIVE * max(abs(before), abs(after))):
            share = away / max(abs(before), abs(after))
            yield f"{where}: {before:.6g}, now {after:.6g} ({100 * share:.2g} %)"
    elif before != after:
        yield f"{where}: {_short(before)}, now {_short(after)}"


def _numeric(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."


def write(run: Run, found: dict[str, Any]) -> None:
    """Write one record."""
    text = json.dumps(found, indent=1, sort_keys=True) + "\n"
    (HERE / f"{run.name}.json").write_text(text, encoding="utf-8")


def main() -> int:
    """Record or compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("--only", default="", help="cases whose name contains the text")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    chosen = [run for run in cases() if options.only in run.name]
    if not chosen:
        parser.error(f"no case has {options.only!r} in its name")
    different = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for run, found in zip(chosen, pool.map(answer, chosen), strict=True):
            if options.what == "record":
                write(run, found)
                continue
            path = HERE / f"{run.name}.json"
            before = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
            lines = sorted(differences(before, json.loads(json.dumps(found))))
            different += bool(lines)
            sys.stdout.writelines(f"{run.name}{line}\n" for line in lines)
    if options.what == "compare":
        sys.stdout.write(f"{len(chosen)} cases compared, {different} differ\n")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
