"""A catalogue of tools: `python benches/catalogue.py [--tools N] [--threads N] [--seed S] [--json FILE] [--quick]`.

Predicts the tips of many tools, drawn anew from the seed, in one machine of beams on springs, on 2000 lines each, with
95 % intervals of their modes from the fit of the joint and all tolerances, and writes them to a file as they come.
Prints time and the largest memory, beside that after a tenth of the tools: it must not grow with their number.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more.
if __name__ == "__main__":
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import json
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

# The machine is that of the tests.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from machine_with_catalogue import load
from receptance.catalogue import Catalogue, predict_catalogue
from receptance.catalogue.results import summaries, write_modes

QUICK = 40


def tools(count: int, seed: int) -> str:
    """Return a catalogue of drawn tools."""
    rng = np.random.default_rng(seed)
    rows = ["name,holder,material,overhang [mm],diameter [mm],flute length [mm],effective diameter [%],teeth"]
    for number in range(count):
        overhang = rng.uniform(30.0, 130.0)
        flutes = rng.uniform(0.2, 0.7) * overhang
        holder, diameter, teeth = rng.choice(["er32", "shrink"]), rng.choice([6, 8, 10, 12, 16, 20]), rng.integers(2, 7)
        rows.append(
            f"T{number},{holder},carbide,{overhang:.2f},{diameter},{flutes:.2f},{rng.uniform(75, 90):.1f},{teeth}"
        )
    return "\n".join(rows) + "\n"


def memory_mb() -> float:
    """Return the largest memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def measure(count: int, threads: int | None, seed: int) -> dict[str, Any]:
    """Predict and write `count` tools."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        read = load(folder, tools=tools(count, seed))
        identified = read.identify()
        begun = time.perf_counter()
        catalogue = Catalogue(replace(read, threads=threads))
        reading = time.perf_counter() - begun
        processor = time.process_time()
        modes, early = 0, 0.0
        predictions = predict_catalogue(catalogue, identified)
        for number, one in enumerate(summaries(write_modes(folder / "modes.csv", predictions))):
            modes += one.modes
            if number == count // 10:
                early = memory_mb()
        seconds = time.perf_counter() - begun
        size = (folder / "modes.csv").stat().st_size
    return {
        "tools": count,
        "lines": 2000,
        "modes": modes,
        "threads": threads or 0,
        "seed": seed,
        "reading_s": reading,
        "seconds": seconds,
        "processor_s": time.process_time() - processor,
        "memory_mb": memory_mb(),
        "memory_after_a_tenth_mb": early,
        "file_mb": size / 1e6,
    }


def main() -> None:
    """Measure, print, write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tools", type=int, default=10_000)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} tools")
    options = parser.parse_args()
    found = measure(QUICK if options.quick else options.tools, options.threads, options.seed)
    each = 1e3 * found["seconds"] / found["tools"]
    reading, late, early = found["reading_s"], found["memory_mb"], found["memory_after_a_tenth_mb"]
    lines = (
        f"seed {options.seed}, {found['tools']} tools x {found['lines']} lines, {found['modes']} modes, "
        f"{options.threads} threads: {found['seconds']:.1f} s ({each:.1f} ms each)",
        f"processor {found['processor_s']:.1f} s, reading and checking {reading:.1f} s of the time, "
        f"memory {late:.0f} MB "
        f"({early:.0f} MB after a tenth), file {found['file_mb']:.1f} MB",
    )
    sys.stdout.write("\n".join(lines) + "\n")
    if options.json:
        options.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
