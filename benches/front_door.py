"""From measurement files to the named cause: `python benches/front_door.py [--wheel FILE] [--json FILE] [--seed N]`.

A timed protocol in a new virtual environment and an empty folder. Three CSV files come from `tests/foreign_beam.py`,
a finite-element model that shares nothing with the package, with a sensor of 2 g that is not mentioned to the program.
The commands are those that a person types; the campaign is not edited. Printed are the time of each command, the number
of commands and of characters, and the cause that `diagnose` names. Exit code 1 if that is not the sensor's mass. The
wheel is installed by its file name; pip downloads its dependencies, or takes them from its cache.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CAUSE = "sensor_mass"
CAMPAIGN = Path("beam") / "campaign.toml"
RESULT = Path("diagnosis.json")
COMMANDS = (
    "receptance new beam tool_60mm.csv tool_90mm.csv tool_120mm.csv "
    "--overhang '60 mm' --overhang '90 mm' --overhang '120 mm' --tool '20 mm' --tool-material carbide "
    "--holder '48 mm x 50 mm, 90 mm x 44/16 mm' --holder-material steel --insertion '48 mm' "
    "--sensor none --support free",
    "receptance check beam --plot beam.png",
    f"receptance diagnose beam --json {RESULT}",
)
"""Commands after `pip install`, as they are typed."""
CHARACTERS_PER_MINUTE = 100
"""Rate of a person who types with two fingers."""


def named_cause(folder: Path) -> tuple[str, str | None]:
    """Return the verdict and the only cause that a diagnosis names; None for no cause or several."""
    found = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    causes = found["causes"]
    return found["verdict"], causes[0]["id"] if len(causes) == 1 else None


def digest(folder: Path) -> str:
    """Return a hash of the campaign file, to show that it was not edited."""
    return hashlib.sha256((folder / CAMPAIGN).read_bytes()).hexdigest()


def main(arguments: list[str] | None = None) -> int:
    """Run the protocol and print its times."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheel", type=Path, help="built from the checkout if it is not given")
    parser.add_argument("--json", type=Path, help="times and result as JSON")
    parser.add_argument("--seed", type=int, default=0, help="of the noise")
    options = parser.parse_args(arguments)
    if options.wheel and not options.wheel.is_file():
        parser.error(f"--wheel is {options.wheel}, which is not there; leave it out to build one")
    with tempfile.TemporaryDirectory() as temporary:
        folder, environment, wheels = (Path(temporary) / name for name in ("work", "environment", "wheels"))
        folder.mkdir()
        wheel = options.wheel.resolve() if options.wheel else _built(wheels)
        venv.create(environment, with_pip=True)
        beam = [sys.executable, str(ROOT / "tests" / "foreign_beam.py"), str(folder), "--seed", str(options.seed)]
        subprocess.run(beam, check=True, stdout=subprocess.DEVNULL)
        programs = environment / ("Scripts" if os.name == "nt" else "bin")
        variables = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "PYTHONHOME")}
        variables |= {
            "PATH": os.pathsep.join([str(programs), variables.get("PATH", "")]),
            "VIRTUAL_ENV": str(environment),
        }
        typed = [f"pip install {wheel.name}", *COMMANDS]
        rows = []
        written = ""
        for text in typed:
            words = shlex.split(text.replace(wheel.name, shlex.quote(str(wheel))))
            began = time.perf_counter()
            done = subprocess.run(
                [str(programs / words[0]), *words[1:]], cwd=folder, env=variables, stdin=subprocess.DEVNULL,
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            seconds = time.perf_counter() - began
            rows.append({"command": text, "seconds": seconds})
            print(f"{seconds:7.1f} s  {text}", flush=True)
            if done.returncode:
                print(done.stdout, done.stderr, sep="\n", file=sys.stderr)
                return 1
            if not written and (folder / CAMPAIGN).exists():
                written = digest(folder)
        verdict, cause = named_cause(folder)
        edits = int(digest(folder) != written)
    characters = sum(map(len, typed))
    machine = sum(float(row["seconds"]) for row in rows)
    minutes = machine / 60.0 + characters / CHARACTERS_PER_MINUTE
    print(f"{len(typed)} commands, {edits} edits, {characters} characters, {machine:.0f} s of the computer")
    print(f"{minutes:.1f} min for a person who types {CHARACTERS_PER_MINUTE} characters a minute")
    print(f"verdict {verdict}, cause {cause}, expected named, {CAUSE}")
    if options.json:
        found = {"commands": rows, "edits": edits, "characters": characters, "minutes": minutes}
        options.json.write_text(json.dumps({**found, "verdict": verdict, "cause": cause}, indent=2) + "\n")
    return 0 if (verdict, cause) == ("named", CAUSE) else 1


def _built(wheels: Path) -> Path:
    """Build the wheel of the checkout."""
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(wheels), str(ROOT)],
        check=True,
    )
    (wheel,) = wheels.glob("receptance-*.whl")
    return wheel


if __name__ == "__main__":
    raise SystemExit(main())
