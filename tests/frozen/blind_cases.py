"""Write verdicts of some cases of the blind laboratory: ``python blind_cases.py SEED FIRST END`` writes ``out.json``.

The cases are those of ``benches/blind.py --quick`` with that seed: every effect of the catalogue in turn, effects
outside it, pairs, and nothing.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from blind.bridge import ask
from blind.generator import every
from blind.outcome import run_case


def main() -> None:
    """Run the cases and write the verdicts; sizes of misfits are left to the comparison's tolerance."""
    seed, first, end = (int(word) for word in sys.argv[1:4])
    found = {}
    for index, (kind, effects) in list(enumerate(every(end)))[first:]:
        one = run_case(seed, index, kind, effects, ask, quick=True, oracle=False)
        found[str(index)] = {
            "kind": kind,
            "effects": list(one.effects),
            "verdict": one.verdict,
            "reported": sorted(one.reported),
            "misfit": one.misfit,
            "misfit_after": one.misfit_after,
            "error": one.error,
        }
    Path("out.json").write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
