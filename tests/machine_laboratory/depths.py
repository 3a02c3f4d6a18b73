"""Whether depths that are stable with 95 % are below the true limits, with descriptions as users make them.

The flutes of the end mill are described as a cylinder of 80 % of the diameter, the cone of the holder as two cylinders,
the spindle as unknown modes. One tool was measured, the other has an overhang between the measured ones.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from machine_laboratory.batch import Row, append_row, finished_and_left, run, seed_of, share
from machine_laboratory.generator import Cut, Machine, draw_machine, stable_limit, write
from machine_laboratory.generator.structure import Numbers, receptances

LINES = np.concatenate([np.arange(40.0, 1000.0, 0.1), np.arange(1000.0, 10000.0, 0.5)])
"""Lines of the true tip in Hz, so dense that limits between them are right to 1e-4."""
TIP = ("tool", 0.0)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""


def main(options: argparse.Namespace) -> int:
    """Run all machines and print a line for each cut, then the totals."""
    seed = seed_of(options)
    rows, left = finished_and_left(options, seed)
    sys.stdout.write(f"{HEADER}\n" + "".join(f"{line}\n" for row in rows.values() for line in _lines(row)))
    for case, result in run(recommend, left, jobs=options.jobs, limit=options.limit):
        row = rows[case["index"]] = {**case, **result}
        append_row(options.resume, row)
        sys.stdout.write("".join(f"{line}\n" for line in _lines(row)))
        sys.stdout.flush()
    sys.stdout.write("\n".join(totals([rows[i] for i in sorted(rows)])) + "\n")
    return 0


def machine_of(seed: int, index: int) -> Machine:
    """Return a machine of a batch, with an end mill and cuts."""
    return draw_machine(int(np.random.SeedSequence([seed, index, 5]).generate_state(1)[0]), end_mill=True)


def true_limits(p: Numbers, cut: Cut, speeds_rpm: Sequence[float]) -> list[float]:
    """Return the true limit of a cut in m at each speed, without the sensor."""
    tip = receptances({**p, "sensor.mass": 0.0}, TIP, [TIP], LINES)[:, :, None] * np.eye(2)
    return [stable_limit(cut, LINES, tip, speed)[0] for speed in speeds_rpm]


def recommend(seed: int, index: int, modes: int | str, threads: int) -> Row:
    """Identify a machine, compute its lobes as a user would, and return each recommended depth over the true limit."""
    from receptance import campaign

    machine = machine_of(seed, index)
    with tempfile.TemporaryDirectory() as folder:
        path = write(machine, Path(folder), modes=modes, settings={"profiles": False})
        loaded = campaign.load(path, threads=threads)
        fit = loaded.identify()
        stability = loaded.stability(fit)
    cuts = []
    for number, cut in machine.cuts:
        lobes = stability[f"c{number}"]
        limits = true_limits(machine.truth[number], cut, [one.speed_rpm for one in lobes.best_cuts])
        ratios = [one.depth / limit for one, limit in zip(lobes.best_cuts, limits, strict=True)]
        cuts.append(
            {
                "measured": number < 2,
                "ratios": ratios,
                "rejected": bool(lobes.rejection.unusable),
                "banded": lobes.probability is not None,
                "reason": " ".join(lobes.rejection)[:400],
            }
        )
    return {
        "rms": float(fit.rms),
        "converged": bool(fit.converged),
        "adequate": fit.adequacy.passed,
        "usable": not fit.rejection.unusable,
        "discrepancy": None if fit.task.discrepancy is None else fit.task.discrepancy.data(),
        "cuts": cuts,
    }


REFUSALS = ("fit not converged", "no error of the model explains the data", "the cut")
"""Why a cut has no depth: the fit, or the lobes of a fit that can be used."""


def refusal(row: Row, cut: Row) -> str:
    """Return why a cut has no depth; empty where it has."""
    if cut["ratios"]:
        return ""
    return REFUSALS[2] if row["usable"] else REFUSALS[1] if row["converged"] else REFUSALS[0]


# The table ------------------------------------------------------------------------------------------------------------

HEADER = "machine  tool           rms cpu s  depth over true limit at each speed"


def _lines(row: Row) -> list[str]:
    """Return a line for each cut of a machine."""
    if "failure" in row:
        return [f"{row['index']:7d}  {row['failure'][:70]}"]
    return [
        f"{row['index']:7d}  {'measured' if cut['measured'] else 'not measured':<12} {row['rms']:5.2f} "
        f"{row['processor']:5.0f}  "
        + (" ".join(f"{ratio:.2f}" for ratio in cut["ratios"]) or f"refused: {refusal(row, cut)}")
        + (" (rejected)" if cut["rejected"] and cut["ratios"] else "")
        for cut in row["cuts"]
    ]


def totals(rows: Sequence[Row]) -> list[str]:
    """Return the totals of a batch."""
    cuts = [cut for row in rows for cut in row.get("cuts", ())]
    stated = [cut for cut in cuts if cut["ratios"]]
    lines = []
    for title, chosen in (
        ("depths above the true limit", stated),
        ("   of the measured tool", [cut for cut in stated if cut["measured"]]),
        ("   of the other tool", [cut for cut in stated if not cut["measured"]]),
        ("   with the fit rejected", [cut for cut in stated if cut["rejected"]]),
    ):
        ratios = [ratio for cut in chosen for ratio in cut["ratios"]]
        lines.append(share(title, [r for r in ratios if r > 1.0], ratios, "<= 5 %"))
    deepest = [cut["ratios"][0] for cut in stated]
    lines.append(share("   the deepest of each cut", [ratio for ratio in deepest if ratio > 1.0], deepest))
    machines = [[ratio for cut in row["cuts"] for ratio in cut["ratios"]] for row in rows if "failure" not in row]
    advised = [ratios for ratios in machines if ratios]
    lines.append(share("machines with a depth above the limit", [one for one in advised if max(one) > 1.0], advised))
    ratios = [ratio for one in advised for ratio in one]
    if ratios:
        losses = 100.0 * (1.0 - np.quantile(ratios, [0.9, 0.5, 0.1]))
        lines.append(
            "loss against the true limit: median {1:.1f} %, 80 % between {0:.1f} and {2:.1f} %".format(*losses)
        )
        lines.append(f"largest depth over true limit {max(ratios):.3f}")
        lines.append(f"cuts without a band {sum(not cut['banded'] for cut in stated)}")
    lines.append(share("machines with depths", advised, rows))
    reasons = [refusal(row, cut) for row in rows for cut in row.get("cuts", ())]
    lines.append(share("cuts without a number (refused)", [one for one in reasons if one], reasons))
    lines += [f"   {reasons.count(reason):3d}: {reason}" for reason in REFUSALS if reason in reasons]
    lines.append(share("machines that failed", [row for row in rows if "failure" in row], rows))
    return lines
