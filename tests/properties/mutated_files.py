"""Damages files of every format and campaign files and reads them: each read ends soon, with a result or an error.

    python tests/properties/mutated_files.py --count 100000 --seed 1

A `FileFormatError` or, for a campaign, a `CampaignError` names the file. `--formats campaign` takes campaigns alone.
Run it under `ulimit -v 8000000`. A file whose reading takes longer than a second is read again, and its processor time
counts then, so that a busy machine is not taken for a hang; files that fail are kept in the folder for temporary files.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from properties.damage import damaged
from properties.good_files import Base, good_files
from receptance import campaign
from receptance.campaign import CampaignError
from receptance.io import FileFormatError, read_all


@dataclass
class Report:
    """Outcomes of the damaged files."""

    seed: int
    count: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    slowest: tuple[float, str] = (0.0, "")
    failures: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        lines = [f"seed {self.seed}: {self.count} damaged files"]
        for name in sorted({key.split(":")[0] for key in self.outcomes}):
            read, refused = self.outcomes[f"{name}:read"], self.outcomes[f"{name}:refused"]
            lines.append(f"  {name:12s} {read:7d} read, {refused:7d} refused")
        lines.append(f"  slowest {self.slowest[0]:.3f} s ({self.slowest[1]})")
        lines.append(f"  failures {len(self.failures)}")
        return "\n".join([*lines, *self.failures[:20]])


def run(
    count: int,
    seed: int,
    formats: Sequence[str] = (),
    *,
    longest_s: float = 1.0,
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Read that many damaged files, of some formats or of all, and return what became of them."""
    rng = random.Random(seed)
    by_format: dict[str, list[Base]] = {}
    for base in good_files(seed):
        if formats and base.format not in formats:
            continue
        by_format.setdefault(base.format, []).append(base)
    report = Report(seed)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number in range(count):
            kind = rng.choice(list(by_format))
            base = rng.choice(by_format[kind])
            content = damaged(base, by_format[kind], rng)
            options = rng.choice(base.options)
            path = Path(folder) / base.name
            path.write_bytes(content)
            outcome, seconds = _outcome(path, kind, options)
            if seconds > longest_s:
                seconds = min(
                    seconds, *(_outcome(path, kind, options)[1] for _ in range(2)), _processor_time(path, kind, options)
                )
            report.count += 1
            report.outcomes[f"{kind}:{'read' if outcome == 'read' else 'refused'}"] += 1
            if seconds > report.slowest[0]:
                report.slowest = (seconds, f"file {number}, {base.name}")
            if seconds > longest_s or outcome not in ("read", "refused"):
                kept = Path(tempfile.gettempdir()) / f"mutated-{seed}-{number}-{base.name}"
                kept.write_bytes(content)
                report.failures.append(f"file {number} ({kept}, {options}), {seconds:.2f} s: {outcome}")
            if number % 1000 == 999:
                say(f"{number + 1} files, {len(report.failures)} failures")
    return report


def _processor_time(path: Path, kind: str, options: dict[str, Any]) -> float:
    """Return the processor time of reading a file, that of a second process that ended over it included."""
    began = os.times()
    _outcome(path, kind, options)
    ended = os.times()
    return sum(ended[:4]) - sum(began[:4])


def _outcome(path: Path, kind: str, options: dict[str, Any]) -> tuple[str, float]:
    began = time.perf_counter()
    try:
        if kind == "campaign":
            campaign.load(path)
        else:
            read_all(path, **options)
        outcome = "read"
    except (FileFormatError, CampaignError) as error:
        outcome = "refused" if str(error) and path.name in str(error) else f"a message without the file: {error}"
    except Exception:
        outcome = "".join(traceback.format_exc().splitlines(keepends=True)[-7:])
    return outcome, time.perf_counter() - began


def main() -> int:
    """Damage and read files by the command-line options; return 1 if any outcome was wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("RECEPTANCE_TEST_SEED", "1")))
    parser.add_argument("--formats", nargs="+", default=(), help="by default all")
    parser.add_argument("--longest", type=float, default=1.0, help="seconds; a longer reading is a failure")
    arguments = parser.parse_args()
    began = time.perf_counter()
    report = run(
        arguments.count,
        arguments.seed,
        arguments.formats,
        longest_s=arguments.longest,
        say=lambda text: print(text, file=sys.stderr, flush=True),
    )
    print(report)
    print(f"  {time.perf_counter() - began:.0f} s in all")
    return 1 if report.failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
