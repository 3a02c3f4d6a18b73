"""The bench of catalogues at a small size: it runs and returns its numbers."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from catalogue import measure


def test_a_few_tools() -> None:
    found = measure(12, 2, seed=1)
    assert found["modes"] >= 24
    assert found["processor_s"] > 0.0
    assert found["file_mb"] > 0.0
