"""Timed pairs: the library and the NumPy reference on one input, and the difference of their results.

The library is called as by a user (`Assembly.receptance` and so on: objects checked and flattened at every call). The
reference works on ready tables. Both get fresh output, and what either prepares for a structure (the reference's power
series, our minors) is inside the time unless a name says otherwise.
"""

from __future__ import annotations

import cones

from . import campaigns, compiled, diagnoses, fits, frequencies, peers, receptances, sweeps, threads
from .pair import Pair, largest_difference

__all__ = ["Pair", "all_pairs", "compiled", "largest_difference", "peers"]

LINES, FIT_LINES, THREAD_LINES, CAMPAIGN_LINES, DIAGNOSIS_LINES = 5_000, 12_000, 50_000, 2_500, 150


def all_pairs(share: int = 1) -> list[Pair]:
    """Return all pairs, on a `share`-th of the frequency lines (to try them out; times then are mostly overhead)."""
    return [
        *receptances.segment_pairs(LINES // share),
        *receptances.chain_pairs(LINES // share),
        *receptances.long_chain_pairs(THREAD_LINES // share),
        *receptances.joint_pairs(LINES // share),
        *receptances.spread_pairs(LINES // share),
        *receptances.cone_pairs(cones.LINES // share),
        *frequencies.mode_pairs(),
        *fits.identification_pairs(FIT_LINES // share),
        *campaigns.campaign_pairs(CAMPAIGN_LINES // share, campaigns.STARTS if share == 1 else 2),
        *diagnoses.diagnosis_pairs(DIAGNOSIS_LINES),
        *sweeps.sweep_pairs(sweeps.LINES // share, sweeps.CANDIDATES // share),
        *compiled.compiled_pairs(LINES // share),
        *peers.peer_pairs(LINES // share),
        *threads.thread_pairs(THREAD_LINES // share),
    ]
