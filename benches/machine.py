"""A machine with an unknown spindle, hits at five points: `python benches/machine.py [--modes auto 9] [--cases N]
[--seed S] [--folder FOLDER] [--diagnose]`.

Holds out two of the five points, fits joint and spindle modes to the other three, and prints the error of the held-out
FRFs in dB rms beside that of a parabola through the other points: for a real machine, and for random machines of finite
elements with the joint over its true value. The files of the real machine are those of others and are read in
`../shared/measured/tool_in_spindle` beside the checkout, or in FOLDER; without them it is skipped with a message.
`tests/five_points.py` describes both. `--diagnose` runs the diagnosis of each as well. Times are processor times.
"""

from __future__ import annotations

import os

# One thread each, before NumPy loads the library that would start more.
if __name__ == "__main__":
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import secrets
import sys
import tempfile
import time
from pathlib import Path

# The laboratory is under tests.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from five_points import MEASURED, Machine, measured, simulated
from machine_laboratory.batch import modes_of


def main(arguments: list[str] | None = None) -> int:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--modes", type=modes_of, nargs="+", default=["auto"], metavar="N|auto", help="numbers of unknown modes"
    )
    parser.add_argument("--cases", type=int, default=4, help="number of simulated machines")
    parser.add_argument("--seed", type=int, help="of the first one; by default a new one, which is printed")
    parser.add_argument("--folder", type=Path, default=MEASURED, help="files of the real machine")
    parser.add_argument("--diagnose", action="store_true")
    options = parser.parse_args(arguments)
    seed = secrets.randbelow(2**31) if options.seed is None else options.seed
    real = measured(options.folder)
    if real is None:
        sys.stdout.write(f"skipped: the real machine: its files are not in {options.folder}\n")
    else:
        # Its dimensions are from a photograph: tolerances of a caliper would be wrong.
        report("real machine", real, options.modes, options.diagnose, tolerances=False)
    sys.stdout.write(f"seed {seed}, {options.cases} simulated machines\n")
    for number in range(options.cases):
        report(f"simulated {seed + number}", simulated(seed + number), options.modes, options.diagnose)
    return 0


def report(name: str, machine: Machine, modes: list[int | str], diagnose: bool, *, tolerances: bool = True) -> None:
    """Fit, predict and print one machine with each number of modes."""
    between = ", ".join(f"{error:.2f}" for error in machine.interpolated().values())
    sys.stdout.write(f"{name}: parabola between the points {between} dB rms\n")
    for count in modes:
        with tempfile.TemporaryDirectory() as folder:
            loaded = machine.write(Path(folder), count, tolerances=tolerances)
            begun = time.process_time()
            fit = loaded.identify()
            seconds = time.process_time() - begun
            frfs = loaded.predict(fit).frfs
            errors = ", ".join(f"{frf.rms_decibel:.2f}" for frf in frfs if frf.rms_decibel is not None)
            inside = ", ".join(f"{100.0 * share:.0f}" for frf in frfs if (share := frf.share_within()) is not None)
            sys.stdout.write(f"  {count} modes: held out {errors} dB rms, {inside} % of the lines in the 95 % band; ")
            sys.stdout.write(f"fit rms {fit.rms:.2f}, {seconds:.1f} s")
            for key, true in (machine.joint or {}).items():
                low, high = fit.interval(f"joint.{key}")
                sys.stdout.write(
                    f"; {key} {fit.values[f'joint.{key}'] / true:.2f} ({low / true:.2f}-{high / true:.2f})"
                )
            sys.stdout.write("\n")
            if diagnose:
                begun = time.process_time()
                verdict = loaded.diagnose()
                causes = " + ".join(one.id for one in verdict.causes) or "no cause"
                sys.stdout.write(f"    {verdict.verdict}: {causes}, misfit {verdict.adequacy.misfit:.2f}, ")
                sys.stdout.write(f"{time.process_time() - begun:.0f} s\n")
            sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
