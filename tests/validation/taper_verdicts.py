"""Verdicts of `diagnose` on the BT50 study's rigid holder. `python tests/validation/taper_verdicts.py --seeds N`.

For each seed of hits and noise the study's virtual FRFs at a few forces are diagnosed with all causes of the catalogue:
along, across, or both together. Printed are the verdict, the causes of every explanation, those that are
indistinguishable, the misfit as a multiple of noise and floor, and the body's Young's modulus (the rig has 208 GPa).
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import bt50
from receptance.diagnosis import Verdict

MOTIONS = ("axial", "radial", "both")


def named_causes(verdict: Verdict) -> list[str]:
    """Return the causes of every explanation."""
    return [one.id for one in verdict.causes if one.id not in verdict.ambiguous_between]


def verdict_line(verdict: Verdict) -> str:
    """Return a verdict in one line."""
    after = "" if verdict.adequacy_after is None else f" to {verdict.adequacy_after.misfit:.2f}"
    text = f"{verdict.verdict}: {' + '.join(named_causes(verdict)) or 'nothing'}"
    if verdict.ambiguous_between:
        text += f" with one of {', '.join(verdict.ambiguous_between)}"
    text += f"; misfit {verdict.adequacy.misfit:.0f}{after}"
    for cause in verdict.causes:
        if cause.id == "flexible_body" and cause.id in named_causes(verdict):
            ((_, low, high),) = cause.parameters.values()
            text += f"; E {200.0 * 10.0**low:.1f} to {200.0 * 10.0**high:.1f} GPa"
    return text


def main() -> None:
    """Diagnose and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--seeds", type=int, default=6, help="how many")
    parser.add_argument("--levels", type=int, default=3, help="how many forces are seen")
    parser.add_argument("--motion", choices=MOTIONS, action="append", help="by default axial and radial, one by one")
    own = parser.parse_args()
    count: dict[str, Counter[str]] = {}
    for motion in own.motion or MOTIONS[:2]:
        for seed in range(own.seed, own.seed + own.seeds):
            began = time.process_time()
            verdict = bt50.rigid_campaign(motion, 2, seed, levels=own.levels).diagnose()
            causes = " + ".join(sorted(named_causes(verdict))) or "nothing"
            count.setdefault(motion, Counter())[f"{verdict.verdict} {causes}"] += 1
            print(f"{motion}, seed {seed}: {verdict_line(verdict)}; {time.process_time() - began:.0f} s", flush=True)
    for name, found in count.items():
        print(f"{name}: {', '.join(f'{n} of {own.seeds} {what}' for what, n in found.most_common())}")


if __name__ == "__main__":
    main()
