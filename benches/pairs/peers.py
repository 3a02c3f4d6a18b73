"""Pairs against other programs on the same task, where they are installed: tool and holder coupled through a joint.

The peers couple ready receptances of tool and holder, which ours makes at every call.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

import numpy as np

from numpy_reference.cases import JOINT

from .models import Array, coupled, sweep
from .pair import Pair, largest_difference

TOLERANCE = 1e-6
"""Receptances that are coupled lose digits at low frequency, where those of the parts cancel."""
FROM_HZ = 100.0


def skipped() -> str:
    """Return which peer is left out and why, nothing where none is."""
    return "" if find_spec("skrf") else "scikit-rf is not installed (pip install scikit-rf)"


def peer_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs, that of scikit-rf where it is installed."""
    f, w = sweep(lines)
    tool, holder = parts(f, w)
    peers = [("pyFBS's formula: one interface matrix, batched pseudo-inverse", lambda: by_pseudo_inverse(tool, holder))]
    if not skipped():
        peers.append(("scikit-rf: receptances as impedances, connect", lambda: by_networks(f, tool, holder)))
    digits = f >= FROM_HZ
    for against, call in peers:
        yield Pair(
            subject="tool, joint and holder, tip, from parts",
            against=against,
            ours=lambda: coupled().receptance(f, threads=1),
            reference=call,
            difference=lambda a, b: largest_difference(a[digits], b[digits]),
            tolerance=TOLERANCE,
            lines=lines,
            segments=9,
        )


def parts(f: Array, w: Array) -> tuple[Array, Array]:
    """Return the tool (n, 3, 3), y at the tip, y and theta at the joint, and the holder with the joint (n, 2, 2)."""
    elements = coupled().elements
    tool = elements["tool"].receptance(f, threads=1)[:, [0, 2, 3]][:, :, [0, 2, 3]]
    holder = elements["holder"].receptance(f, threads=1)[:, :2, :2].copy()
    holder[:, 0, 0] += 1 / (JOINT.k_y + 1j * w * JOINT.c_y)
    holder[:, 1, 1] += 1 / (JOINT.k_theta + 1j * w * JOINT.c_theta)
    return np.ascontiguousarray(tool), holder


def by_pseudo_inverse(tool: Array, holder: Array) -> Array:
    """Return Y - Y B^T (B Y B^T)^+ B Y at the tip, B the compatibility of both parts' coordinates."""
    y = np.zeros((len(tool), 5, 5), dtype=np.complex128)
    y[:, :3, :3], y[:, 3:, 3:] = tool, holder
    b = np.array([[0.0, 1.0, 0.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0, -1.0]])
    # Metres and radians side by side: without scales the pseudo-inverse would take the smaller one for zero.
    scale = np.sqrt(np.abs(np.einsum("nii->ni", b @ y @ b.T)))
    interface = (b @ y @ b.T) / (scale[:, :, None] * scale[:, None, :])
    inverse = np.linalg.pinv(interface) / (scale[:, :, None] * scale[:, None, :])
    return np.asarray((y - y @ b.T @ inverse @ b @ y)[:, 0, 0])


def by_networks(f: Array, tool: Array, holder: Array) -> Array:
    """Return the same by networks whose voltages are displacements and whose currents are forces."""
    import skrf
    from skrf.network import connect

    frequency = skrf.Frequency.from_f(f, unit="Hz")
    size = np.abs(np.einsum("nii->ni", tool))
    first = skrf.Network(frequency=frequency, z=tool, z0=size)
    second = skrf.Network(frequency=frequency, z=holder, z0=size[:, 1:])
    return np.asarray(connect(first, 1, second, 0, num=2).z[:, 0, 0])
