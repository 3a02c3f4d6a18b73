"""The seed of a run: fresh every time, printed, and repeatable through the variable that all tests heed."""

from __future__ import annotations

import os
import secrets


def fresh_seed() -> int:
    """Return RECEPTANCE_TEST_SEED, or a number that nobody has seen."""
    return int(os.environ.get("RECEPTANCE_TEST_SEED", secrets.randbelow(2**31)))
