"""Compare the speed of two commits: ``python benches/versus.py OLD [NEW] [--rounds N] [--only TEXT] [--json FILE]``.

Both commits (NEW is the working commit by default) are checked out and installed into virtual environments of their
own; a folder with a `checkout` and its `venv` may be given instead of a commit. Then ``ratios.py`` of each commit runs
in turn, N times, the first of a round alternating. For every row that both commits have, the table shows our time in ms
with the old and with the new commit, the ratio of the medians, and its quartiles over the rounds. A ratio above 1 means
that the new commit is slower. Nothing is asserted.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]


def run(*words: str | Path, cwd: Path = REPOSITORY) -> str:
    """Run a command that must succeed, and return its output."""
    done = subprocess.run([str(word) for word in words], cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return done.stdout


def installed(commit: str, folder: Path) -> Path:
    """Check out a commit, install it with what its benchmarks need, and return the folder; a folder is ready."""
    if (Path(commit) / "venv").is_dir():
        return Path(commit).resolve()
    run("git", "worktree", "add", "--detach", folder / "checkout", commit)
    run(sys.executable, "-m", "venv", folder / "venv")
    sys.stderr.write(f"installing {commit}\n")
    run(folder / "venv" / "bin" / "pip", "install", "--quiet", ".[test]", cwd=folder / "checkout")
    return folder


def rows(folder: Path, only: str) -> dict[str, tuple[float, int]]:
    """Return our seconds and the number of threads of the rows whose name contains a text."""
    out = folder / "rows.json"
    script = folder / "checkout" / "benches" / "ratios.py"
    words = [folder / "venv" / "bin" / "python", script, "--rounds", "5", "--json", out]
    run(*words, *(["--only", only] if only else []), cwd=folder)
    found = json.loads(out.read_text(encoding="utf-8"))
    table = found["rows"] if isinstance(found, dict) else found
    return {row["name"]: (row["ours_s"], row["threads"]) for row in table}


def main() -> None:
    """Build both, measure in turn, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", help="a commit, or a folder with a `checkout` and its `venv`")
    parser.add_argument("new", nargs="?", default="HEAD")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", default="", help="rows whose name contains the text")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        new = [Path(place) / name for name in ("old", "new")]
        try:
            folders = [installed(name, folder) for name, folder in zip((options.old, options.new), new, strict=True)]
            commits = [run("git", "rev-parse", "--short", "HEAD", cwd=one / "checkout").strip() for one in folders]
            measured = compare(folders, options.only, options.rounds)
        finally:
            for folder in new:
                subprocess.run(
                    ["git", "worktree", "remove", "--force", str(folder / "checkout")],
                    cwd=REPOSITORY, capture_output=True, check=False,
                )  # fmt: skip
    sys.stdout.write(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, {options.rounds} rounds\n")
    sys.stdout.write(
        f"{'':<62} {'threads':>7} {commits[0] + ' ms':>12} {commits[1] + ' ms':>12} {'new/old':>8}  quartiles\n"
    )
    for name, row in measured.items():
        low, high = row["quartiles"]
        sys.stdout.write(
            f"{name:<62} {row['threads']:>7} {row['old_ms']:>12.4g} {row['new_ms']:>12.4g} {row['ratio']:>8.3f}  "
            f"{low:.3f} to {high:.3f}\n"
        )
    if options.json:
        options.json.write_text(json.dumps({"commits": commits, "rows": measured}, indent=1), encoding="utf-8")


def compare(folders: list[Path], only: str, rounds: int) -> dict[str, dict[str, float | list[float]]]:
    """Measure both commits in turn and return a row for each name that both have."""
    seconds: list[dict[str, list[float]]] = [{}, {}]
    threads: dict[str, int] = {}
    for count in range(rounds):
        for side in (0, 1) if count % 2 else (1, 0):
            for name, (taken, number) in rows(folders[side], only).items():
                seconds[side].setdefault(name, []).append(taken)
                threads[name] = number
    found: dict[str, dict[str, float | list[float]]] = {}
    for name in seconds[1]:
        if name not in seconds[0]:
            continue
        old, new = seconds[0][name], seconds[1][name]
        ratios = [b / a for a, b in zip(old, new, strict=True)]
        quartiles = statistics.quantiles(ratios, n=4, method="inclusive") if rounds > 1 else ratios * 3
        found[name] = {
            "threads": threads[name],
            "old_ms": 1e3 * statistics.median(old),
            "new_ms": 1e3 * statistics.median(new),
            "ratio": statistics.median(new) / statistics.median(old),
            "quartiles": [quartiles[0], quartiles[2]],
        }
    return found


if __name__ == "__main__":
    main()
