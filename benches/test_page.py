"""The bench of the page at a small size: it runs and returns its numbers."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from page import main


def test_a_few_moves() -> None:
    (row,) = main(["--quick"])
    assert row["painted_median_ms"] >= row["data_median_ms"] > 0.0
    assert row["first_picture_s"] > row["address_s"] > 0.0
    assert row["memory_after_mb"] > 0.0
