"""Duration of diagnoses: ``python benches/diagnosis.py [OLD] [--only TEXT] [--rounds N] [--cases N] [--json FILE]``.

Each row runs in a separate process. With OLD, a folder with a `checkout` and its `venv` as for ``versus.py``, each row
runs alternately with that commit and with this one, and the ratio of the medians is shown; it is above 1 if the old
commit is slower. The verdicts are printed beside the times, and not checked.

The rows:

blind I
    A case of the blind laboratory, on one thread: `--cases` N of them from number 0 on (seed 20261123).
sensor, held out
    Four records of 1,605 lines each, a sensor of 2 g that is not in the model, noise of 1 %, tolerances of dimensions
    and materials, with the improvement on held-out configurations.
free-free, hammer, er32, taper
    `receptance diagnose` of the packaged campaigns, start of the program included.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[1]
SEED = 20261123
SINGLE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def blind(number: int) -> dict[str, Any]:
    """Diagnose a case of the blind laboratory on one thread."""
    sys.path.remove(str(Path(__file__).resolve().parent))  # it has a file with the name of the laboratory
    from blind import bridge
    from blind.generator import draw_case, every

    kind, effects = list(every(number + 1))[number]
    case, _ = draw_case(SEED, number, kind, tuple(effects))
    answer = bridge.ask(case)
    return {"seconds": answer.seconds, "verdict": answer.verdict, "causes": sorted(answer.reported)}


def sensor() -> dict[str, Any]:
    """Diagnose four records with a forgotten sensor, held-out configurations included."""
    import numpy as np

    from receptance import Assembly, Material, Observation, Part, PointJoint, PointMass, Segment, Unknown
    from receptance.diagnosis import diagnose
    from receptance.fit import Tolerance

    carbide = Material(youngs_modulus=580e9, density=14500.0, poisson_ratio=0.22, loss_factor=0.002)
    steel = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3, loss_factor=0.002)

    true = PointJoint(k_y=4e8, k_theta=7e4, c_y=250.0, c_theta=0.3, name="joint")
    stated = PointJoint(k_y=1e8, k_theta=5e4, c_y=300.0, c_theta=0.2, name="joint")

    def assembled(overhang: float, joint: PointJoint, *points: Any) -> Any:
        tool = Part([Segment(length=overhang, outer_diameter=0.016, material=carbide)], name="tool")
        holder = Part(
            [
                Segment(length=0.04, outer_diameter=0.034, inner_diameter=0.016, material=steel, core=carbide),
                Segment(length=0.05, outer_diameter=0.05, inner_diameter=0.02, material=steel),
                Segment(length=0.07, outer_diameter=0.063, inner_diameter=0.02, material=steel),
            ],
            name="holder",
        )
        return Assembly([tool, joint, holder], points)

    rng = np.random.default_rng(SEED)
    lines = np.linspace(300.0, 8320.0, 1605)
    observations = [
        Observation(
            assembly=assembled(overhang, stated),
            frequency_hz=lines,
            receptance=assembled(overhang, true, PointMass(mass=2e-3, part="tool", position=0.0)).receptance(lines)
            * np.exp(0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))),
            standard_deviation=0.01,
            label=f"overhang {1e3 * overhang:.0f} mm",
            configuration=f"overhang {1e3 * overhang:.0f} mm",
        )
        for overhang in (0.045, 0.06, 0.075, 0.09)
    ]
    bounds = {"k_y": (1e6, 1e11), "k_theta": (1e3, 1e7), "c_y": (1.0, 1e5), "c_theta": (1e-4, 1e2)}
    unknowns = [
        Unknown(address=f"joint.{name}", lower=low, upper=high, start=getattr(stated, name))
        for name, (low, high) in bounds.items()
    ]
    shared = {
        "tool.segment[*].outer_diameter": 1e-3,
        "tool.segment[*].youngs_modulus": 0.02,
        "tool.segment[*].density": 0.01,
        "holder.segment[*].youngs_modulus": 0.01,
        "holder.segment[*].density": 0.005,
        **{f"holder.segment[{i}].outer_diameter": 1e-3 for i in range(3)},
        **{f"holder.segment[{i}].length": 1e-3 for i in range(3)},
    }
    tolerances = [Tolerance(name=a, moves={a: size}, relative=True) for a, size in shared.items()]
    tolerances += [
        Tolerance(name="overhang", moves={"tool.segment[0].length": 2e-4}, configurations=one.label)
        for one in observations
    ]
    began = time.perf_counter()
    verdict = diagnose(observations, unknowns, tolerances=tolerances, held_out=True, threads=None)
    seconds = time.perf_counter() - began
    causes = sorted(one.id for one in verdict.causes)
    evaluations = int(verdict.settings["model_evaluations"])
    return {"seconds": seconds, "verdict": verdict.verdict, "causes": causes, "evaluations": evaluations}


def packaged(example: str) -> dict[str, Any]:
    """Run the command on a packaged campaign; the time includes the start of the program."""
    program = [sys.executable, "-m", "receptance.cli"]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([*program, "example", example, example], cwd=folder, capture_output=True, check=True)
        began = time.perf_counter()
        words = [*program, "diagnose", example, "--json", "found.json"]
        subprocess.run(words, cwd=folder, capture_output=True, check=True)
        seconds = time.perf_counter() - began
        found = json.loads(Path(folder, "found.json").read_text(encoding="utf-8"))
    found = found.get("diagnosis", found)
    causes = sorted(one["id"] for one in found.get("causes", []))
    return {"seconds": seconds, "verdict": found.get("verdict", ""), "causes": causes}


def row(name: str) -> dict[str, Any]:
    """Return time and verdict of a row, with the processor time of the process and its children."""
    if name.startswith("blind "):
        found = blind(int(name.removeprefix("blind ")))
    else:
        found = sensor() if name.startswith("sensor") else packaged(name)
    times = os.times()
    return {**found, "processor": times.user + times.system + times.children_user + times.children_system}


def run(python: Path, checkout: Path, name: str) -> dict[str, Any]:
    """Run a row in a process, with an interpreter and the tests of its checkout."""
    path = os.pathsep.join(
        [str(checkout / "tests"), os.environ.get("PYTHONPATH", "") if checkout == REPOSITORY else ""]
    )
    words = [str(python), str(Path(__file__).resolve()), "--row", name]
    done = subprocess.run(
        words, env={**os.environ, **SINGLE, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.exit(f"{name} with {python} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> None:
    """Measure the rows in turn and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", nargs="?", type=Path, help="a folder with a `checkout` and its `venv`")
    parser.add_argument("--only", default="", help="rows whose name contains the text")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--cases", type=int, default=20, help="cases of the blind laboratory")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--row", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row:
        sys.stdout.write(json.dumps(row(options.row)) + "\n")
        return
    commits = {"new": (Path(sys.executable), REPOSITORY)}
    if options.old is not None:
        folder = options.old.resolve()
        commits = {"old": (folder / "venv" / "bin" / "python", folder / "checkout"), **commits}
    names = [*(f"blind {i}" for i in range(options.cases)), "sensor, held out", "free-free", "hammer", "er32", "taper"]
    sys.stdout.write(f"{os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, {options.rounds} rounds\n")
    sys.stdout.write(f"{'':<18}" + "".join(f"{which + ' s':>9}" for which in commits) + f"{'old/new':>9}  verdicts\n")
    table: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for name in (name for name in names if options.only in name):
        measured: dict[str, list[dict[str, Any]]] = {which: [] for which in commits}
        for turn in range(options.rounds):
            for which in sorted(commits, reverse=turn % 2 == 1):
                measured[which].append(run(*commits[which], name))
        table[name] = measured
        sys.stdout.write(line(name, measured) + "\n")
        sys.stdout.flush()
    of_blind = [measured for name, measured in table.items() if name.startswith("blind")]
    if of_blind:
        for title, of in (("blind, median", statistics.median), ("blind, longest", max)):
            times = {which: of([seconds(one[which]) for one in of_blind]) for which in commits}
            sys.stdout.write(f"{title:<18}" + _times(times) + "\n")
    if options.json is not None:
        options.json.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


def seconds(measured: list[dict[str, Any]]) -> float:
    """Return the median time over the rounds."""
    return float(statistics.median(one["seconds"] for one in measured))


def line(name: str, measured: dict[str, list[dict[str, Any]]]) -> str:
    """Return a row of the table: times, ratio, and the verdicts, once where they are equal."""
    times = {which: seconds(found) for which, found in measured.items()}
    verdicts = dict.fromkeys(" ".join([one["verdict"], *one["causes"]]) for found in measured.values() for one in found)
    return f"{name:<18}{_times(times)}  {' | '.join(verdicts)}"


def _times(times: dict[str, float]) -> str:
    ratio = f"{times['old'] / times['new']:>9.2f}" if "old" in times else f"{'':>9}"
    return "".join(f"{value:>9.2f}" for value in times.values()) + ratio


if __name__ == "__main__":
    main()
