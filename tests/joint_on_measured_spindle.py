"""Coverage of a joint's intervals behind a spindle that was identified from noisy records of a blank."""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from receptance import ReceptanceWarning, campaign
from receptance.coupling import write_spindle
from spindle_campaign import CAMPAIGN, TRUE, write_campaign


def one_machine(folder: Path, seed: int, sd: float, kind: str) -> dict[str, Any]:
    """Return the joint of one draw of noise: its offset in standard errors by address, and the rms of the fit."""
    suffix = "npz" if kind == "table" else "toml"
    text = CAMPAIGN.replace("spindle.npz", f"spindle.{suffix}").replace("starts = 1", "starts = 3")
    write_campaign(folder, text, sd=sd, seed=seed, lines=np.arange(200.0, 3500.0, 8.0))
    found = campaign.load(folder, unidentified=True).spindle(modes=None if kind == "table" else "auto")
    write_spindle(folder / f"spindle.{suffix}", found.identified)
    fit = campaign.load(folder).identify()
    off = {address: (fit.values[address] - true) / fit.standard_errors[address] for address, true in TRUE.items()}
    inside = {}
    for address, true in TRUE.items():
        low, high = fit.interval(address)
        inside[address] = bool(low <= true <= high)
    errors = {address: fit.standard_errors[address] / fit.values[address] for address in TRUE}
    usable = float(found.table.usable.mean())
    return {"seed": seed, "off": off, "inside": inside, "rms": fit.rms, "errors": errors, "usable": usable}


def coverage(seeds: range, sd: float, kind: str) -> list[dict[str, Any]]:
    """Return the results of several draws of noise."""
    results = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        for seed in seeds:
            with tempfile.TemporaryDirectory() as folder:
                results.append(one_machine(Path(folder), seed, sd, kind))
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--kind", choices=("table", "modes"), default="table")
    given = parser.parse_args()
    cases = coverage(range(given.seed, given.seed + given.cases), given.noise, given.kind)
    print(json.dumps({a: [sum(c["inside"][a] for c in cases), len(cases)] for a in TRUE}))
    print(json.dumps({a: round(float(np.sqrt(np.mean([c["off"][a] ** 2 for c in cases]))), 2) for a in TRUE}), "rms z")
    print(json.dumps({a: float(f"{np.median([c['errors'][a] for c in cases]):.3g}") for a in TRUE}), "relative errors")
    print("rms of the fits", np.round([c["rms"] for c in cases], 2).tolist())
    print("usable lines", round(float(np.mean([c["usable"] for c in cases])), 3))
