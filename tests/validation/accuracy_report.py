"""Print how many digits the core keeps: `python tests/validation/accuracy_report.py [--seed N] [--cases N]`."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from validation import accuracy, plain_formulations


def main() -> None:
    """Measure, print, and write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=accuracy.base_seed())
    parser.add_argument("--cases", type=int, default=accuracy.DEFAULT_CASES)
    parser.add_argument("--only", type=int, nargs="*", help="numbers of single models to look at")
    parser.add_argument("--offenders", type=int, default=20, help="how many entries outside the rule to name")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    report = accuracy.run(options.seed, options.cases, options.only)
    sys.stdout.write(report.text() + "\n")
    for name, tally in report.rows():
        for offender in sorted(tally.offenders, key=lambda line: -float(line.split()[1].rstrip(",")))[
            : options.offenders
        ]:
            sys.stdout.write(f"outside the rule: {name}: {offender}\n")
    for refused in report.refused:
        sys.stdout.write(f"refused: {refused}\n")
    found = {**report.as_json()}
    if options.only is None:
        evidence = plain_formulations.compare(options.seed)
        sys.stdout.write(evidence.text() + "\n")
        found["formulations"] = evidence.as_json()
    if options.json:
        options.json.write_text(json.dumps(found, indent=2), encoding="utf-8")


if __name__ == "__main__":
    main()
