"""The seed of a run: fresh every time, printed, and repeatable by the environment variable of all tests."""

from __future__ import annotations

import os
import secrets


def fresh_seed() -> int:
    """Return RECEPTANCE_TEST_SEED, or a random number."""
    return int(os.environ.get("RECEPTANCE_TEST_SEED", secrets.randbelow(2**31)))
