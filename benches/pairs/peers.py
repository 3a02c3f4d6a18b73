"""Pairs against other programs on the same task, where they are installed.

Tool and holder coupled through a joint, where the peers couple ready receptances of tool and holder, which ours makes
at every call; and the tip of a chain of segments, where the peer has finite elements.
"""

from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np

from numpy_reference.cases import JOINT, ten_segments
from receptance import Assembly

from .models import Array, between_ends, coupled, part, sweep
from .pair import Pair, largest_difference

PEERS = {"skrf": "scikit-rf", "sdynpy": "sdynpy", "ross": "ross-rotordynamics"}
"""Modules and the packages that bring them."""
TOLERANCE = 1e-6
"""Receptances that are coupled lose digits at low frequency, where those of the parts cancel."""
FROM_HZ = 100.0
ROSS_TO_HZ, ROSS_SHARE = 2_000.0, 10
"""ROSS keeps all receptances between all degrees of freedom, thrice: a tenth of the lines."""
ROSS_TOLERANCE, BESIDE_RESONANCE = 1e-2, 0.1
"""One element a segment, no damping on either side: lines this close to a natural frequency are not compared."""
LOSS_FACTOR = 8
"""Its column."""


@cache
def missing(module: str) -> str:
    """Return why a peer is left out; empty if it is not."""
    # SDynPy imports a graphical interface, which needs a display.
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    try:
        _module(module)
    except ModuleNotFoundError as error:
        if error.name == module:
            return f"{module} is not installed (pip install {PEERS[module]})"
        return f"{module} cannot be imported: {error}"
    except Exception as error:
        return f"{module} cannot be imported: {str(error).partition(chr(10))[0]}"
    return ""


def skipped() -> str:
    """Return which peers are left out and why; empty if none is."""
    return "; ".join(filter(None, map(missing, PEERS)))


def peer_pairs(lines: int) -> Iterator[Pair]:
    """Yield the pairs, those of programs that are installed."""
    f, w = sweep(lines)
    tool, holder = parts(f, w)
    peers: list[tuple[str, Callable[[], Array]]] = [
        ("pyFBS's formula: one interface matrix, batched pseudo-inverse", lambda: by_pseudo_inverse(tool, holder))
    ]
    if not missing("sdynpy"):
        peers.append(("SDynPy: substructure_by_coordinate", lambda: by_coordinates(f, tool, holder)))
    if not missing("skrf"):
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
    if not missing("ross"):
        yield ross_pair(max(lines // ROSS_SHARE, 2))


def _module(name: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return importlib.import_module(name)


def parts(f: Array, w: Array) -> tuple[Array, Array]:
    """Return the tool (n, 3, 3), y at the tip, y and theta at the joint, and the holder with the joint (n, 2, 2)."""
    elements = coupled().elements
    tool = between_ends(elements["tool"], f)[:, [0, 2, 3]][:, :, [0, 2, 3]]
    holder = between_ends(elements["holder"], f)[:, :2, :2].copy()
    holder[:, 0, 0] += 1 / (JOINT.k_y + 1j * w * JOINT.c_y)
    holder[:, 1, 1] += 1 / (JOINT.k_theta + 1j * w * JOINT.c_theta)
    return np.ascontiguousarray(tool), holder


def uncoupled(tool: Array, holder: Array) -> Array:
    """Return both parts in one matrix (n, 5, 5)."""
    y = np.zeros((len(tool), 5, 5), dtype=np.complex128)
    y[:, :3, :3], y[:, 3:, 3:] = tool, holder
    return y


def by_pseudo_inverse(tool: Array, holder: Array) -> Array:
    """Return Y - Y B^T (B Y B^T)^+ B Y at the tip, B the compatibility of both parts' coordinates."""
    y = uncoupled(tool, holder)
    b = np.array([[0.0, 1.0, 0.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0, -1.0]])
    # Metres and radians side by side: without scales the pseudo-inverse would take the smaller one for zero.
    scale = np.sqrt(np.abs(np.einsum("nii->ni", b @ y @ b.T)))
    interface = (b @ y @ b.T) / (scale[:, :, None] * scale[:, None, :])
    inverse = np.linalg.pinv(interface) / (scale[:, :, None] * scale[:, None, :])
    return np.asarray((y - y @ b.T @ inverse @ b @ y)[:, 0, 0])


def by_networks(f: Array, tool: Array, holder: Array) -> Array:
    """Return the same by networks whose voltages are displacements and whose currents are forces."""
    skrf = _module("skrf")
    frequency = skrf.Frequency.from_f(f, unit="Hz")
    size = np.abs(np.einsum("nii->ni", tool))
    first = skrf.Network(frequency=frequency, z=tool, z0=size)
    second = skrf.Network(frequency=frequency, z=holder, z0=size[:, 1:])
    return np.asarray(skrf.network.connect(first, 1, second, 0, num=2).z[:, 0, 0])


def by_coordinates(f: Array, tool: Array, holder: Array) -> Array:
    """Return the same by SDynPy: node 1 is the tip, 2 the tool's end, which is tied to 3, the holder's."""
    sdpy = _module("sdynpy")
    translation, rotation = 2, 6
    dofs = sdpy.coordinate_array([1, 2, 2, 3, 3], [translation, translation, rotation, translation, rotation])
    functions = sdpy.data_array(
        sdpy.data.FunctionTypes.FREQUENCY_RESPONSE_FUNCTION,
        f,
        np.moveaxis(uncoupled(tool, holder), 0, -1),
        sdpy.coordinate.outer_product(dofs, dofs),
    )
    return np.asarray(functions.substructure_by_coordinate(dofs[[[1, 3], [2, 4]]]).ordinate[0, 0])


def ross_pair(lines: int) -> Pair:
    """Return the pair of a chain without damping: its tip, free at both ends, at rest."""
    table = ten_segments()
    table[:, LOSS_FACTOR] = 0.0
    assembly, rotor = Assembly([part(table, "chain")]), shaft(table)
    f = np.linspace(FROM_HZ, ROSS_TO_HZ, lines)
    modes = assembly.natural_frequencies(1.5 * ROSS_TO_HZ)
    digits = (np.abs(f[:, None] / modes - 1.0) > BESIDE_RESONANCE).all(axis=1)

    def by_elements() -> Array:
        # It would reuse the result of the last call.
        rotor._run_freq_response.cache_clear()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = rotor.run_freq_response(speed_range=2.0 * np.pi * f, free_free=True)
        return np.asarray(found.freq_resp[0, 0])

    return Pair(
        subject=f"ten-segment chain without damping, tip, up to {ROSS_TO_HZ / 1e3:g} kHz",
        against=f"ROSS: one finite element a segment, {rotor.ndof} degrees of freedom",
        ours=lambda: assembly.receptance(f, threads=1),
        reference=by_elements,
        difference=lambda a, b: largest_beside_zeros(a[digits], b[digits]),
        tolerance=ROSS_TOLERANCE,
        lines=lines,
        segments=len(table),
        most_rounds=5,
    )


def largest_beside_zeros(ours: Array, other: Array) -> float:
    """Return the largest difference relative to the modulus, or to its median where it is less: it may pass zero."""
    size = np.abs(other)
    return float(np.max(np.abs(ours - other) / np.maximum(size, np.median(size))))


def shaft(table: Array) -> Any:
    """Return ROSS's rotor, a shaft alone, with the same shear coefficient."""
    ross = _module("ross")
    elements = []
    for number, row in enumerate(table):
        _, _, length, outer, inner, modulus, density, poisson = row[:LOSS_FACTOR]
        material = ross.Material(name=f"segment{number}", rho=density, E=modulus, Poisson=poisson)
        elements.append(
            ross.ShaftElement(L=length, idl=inner, odl=outer, material=material, shear_method_calc="cowper")
        )
    return ross.Rotor(elements, [], [])
