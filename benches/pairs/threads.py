"""Pairs of the library on two threads and on one."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from .models import chain, coupled, segment_addresses, sweep
from .pair import Pair


def thread_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs of two threads against one."""
    f, _ = sweep(lines)
    assembly = coupled()
    own = segment_addresses(assembly)
    calls: list[tuple[str, int, Callable[[int], Any]]] = [
        ("ten-segment chain, tip", 10, lambda threads: chain().receptance(f, threads=threads)),
        ("tool, joint and holder, tip", 9, lambda threads: assembly.receptance(f, threads=threads)),
        (
            f"tool, joint and holder with {len(own)} segment derivatives",
            9,
            lambda threads: assembly.derivatives(f, own, threads=threads)[1],
        ),
    ]
    for what, segments, call in calls:
        yield Pair(
            subject=f"two threads, {what}",
            against="ours on one thread",
            ours=lambda call=call: call(2),
            reference=lambda call=call: call(1),
            # Bit for bit.
            difference=lambda a, b: 0.0 if np.array_equal(a, b) else np.inf,
            tolerance=0.0,
            lines=lines,
            segments=segments,
            threads=2,
        )


def machine_gain(size: int = 10_000_000) -> float:
    """Return the ratio of speed of two threads to one for independent work on this machine at its present load.

    Two threads that each compute a checksum share no data, so this ratio is an upper bound for the pairs.
    """
    data = bytes(size)

    def run(count: int) -> float:
        threads = [threading.Thread(target=lambda: hashlib.sha256(data).digest()) for _ in range(count)]
        began = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return time.perf_counter() - began

    return 2 * run(1) / run(2)
