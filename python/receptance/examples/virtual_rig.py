"""A virtual BT50 rig: poles from finite elements, with the hits and records of Xu et al. 2012.

The holder, that of the packaged campaign `taper`, has the taper of JIS B 6339 BT50; its other dimensions and the
contact are invented, because the paper prints none. `tests/bt50_rig.py` computes the poles and residues in
`virtual_rig.csv`.
"""

from __future__ import annotations

import csv
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance.campaign.read import measured_structures
from receptance.coupling import Holder, without_each
from receptance.errors import ReceptanceWarning
from receptance.frf import FRF
from receptance.hammer import HammerRecords, estimate_frf, find_hits, simulate_hits
from receptance.model.beams import Part
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring

Motion = Literal["axial", "radial"]

SAMPLE_RATE_HZ = 20480.0
SPACING_HZ = 20.0
HITS = 10
"""Sampling, resolution and number of impacts of the paper."""
DECAY_RATE = 120.0
"""Rate of the exponential window in 1/s: the response has decayed after 50 ms."""
ESTIMATE: dict[str, Any] = {"decay_rate": DECAY_RATE, "force_window_s": None, "estimator": "Hv"}
"""Without a force window, because its error is the same for all hits and so invisible in their scatter. More noise of
the force is then included, which Hv allows for."""
PLACES_MM: dict[str, tuple[float, tuple[float, ...]]] = {"axial": (0.0, (0.0,)), "radial": (10.0, (10.0, 50.0))}
"""Hit and responses in mm from the tip."""
_NOISE_DB = -60.0
_CONTACT_S = 2e-4
_PRE_TRIGGER_S = 1e-3


@dataclass(frozen=True, eq=False)
class VirtualRig:
    """The rig in one motion at one drawbar force, as poles and residues, for `simulate_hits`."""

    motion: Motion
    """Along or across."""
    force_kn: float
    """Drawbar force."""
    hit: Coordinate
    """Place of the hit."""
    seen: tuple[Coordinate, ...]
    """Places of the responses; no others are available."""
    poles: NDArray[np.complex128]
    """`(m,)` in rad/s."""
    residues: NDArray[np.complex128]
    """`(m, n_seen)`."""
    rest: NDArray[np.complex128]
    """`(n_seen,)` receptance of the modes above."""

    def receptance(
        self,
        frequency_hz: ArrayLike,
        *,
        response: Coordinate | Sequence[Coordinate] | None = None,
        excitation: Coordinate | Sequence[Coordinate] | None = None,
    ) -> NDArray[np.complex128]:
        """`(n, n_seen, 1)` receptance; the coordinates must be those of the rig."""
        if response not in (None, self.seen) or excitation not in (None, self.hit, (self.hit,)):
            raise ValueError(f"the virtual rig is hit at {self.hit} and seen at {self.seen} only")
        s = 2j * np.pi * np.asarray(frequency_hz, dtype=np.complex128)[:, None, None]
        terms = self.residues / (s - self.poles[:, None]) + self.residues.conj() / (s - self.poles.conj()[:, None])
        return np.asarray((terms.sum(axis=1) + self.rest)[:, :, None])

    @property
    def frequency_hz(self) -> NDArray[np.float64]:
        """Natural frequencies |pole| / 2 pi."""
        return np.asarray(np.abs(self.poles) / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> NDArray[np.float64]:
        """Damping ratios."""
        return np.asarray(-self.poles.real / np.abs(self.poles))

    def measure(self, seed: int) -> tuple[FRF, FRF, tuple[FRF, ...]]:
        """Hit it ten times, record at 20 480 Hz and estimate the FRF on lines 20 Hz apart.

        Returns
        -------
        plain, windowed : FRF
            Without a window and with all lines, as in the paper, although the response has not decayed in a block of
            50 ms; and from the same records with an exponential window on both channels, which is exact.
        left_out : tuple of FRF
            The second without each of the hits.
        """
        records = self.records(seed)
        with warnings.catch_warnings():
            # docs/studies/bt50.py states it once.
            warnings.filterwarnings("ignore", ".*has not decayed", ReceptanceWarning)
            plain = estimate_frf(records)
        hits = find_hits(records)
        windowed = estimate_frf(hits, **ESTIMATE)
        return plain.with_(usable=None), windowed, without_each(hits, **ESTIMATE)

    def windowed(self, seed: int) -> FRF:
        """Return the second FRF of `measure` alone."""
        return estimate_frf(find_hits(self.records(seed)), **ESTIMATE)

    def records(self, seed: int) -> HammerRecords:
        """Hit it ten times and record at 20 480 Hz."""
        return simulate_hits(
            self,
            response=self.seen,
            excitation=self.hit,
            hits=HITS,
            sample_rate_hz=SAMPLE_RATE_HZ,
            duration_s=1.0 / SPACING_HZ,
            pre_trigger_s=_PRE_TRIGGER_S,
            contact_s=_CONTACT_S,
            force_noise_db=_NOISE_DB,
            response_noise_db=_NOISE_DB,
            seed=seed,
            label=f"virtual BT50 rig, {self.motion}, {self.force_kn:g} kN",
        )


def load_rig() -> tuple[VirtualRig, ...]:
    """Read the packaged poles: all forces, axial and radial in turn."""
    text = (resources.files("receptance.examples") / "virtual_rig.csv").read_text(encoding="utf-8")
    rows: dict[tuple[float, str], list[dict[str, str]]] = {}
    for row in csv.DictReader(line for line in text.splitlines() if not line.startswith("#")):
        rows.setdefault((float(row["force_kn"]), row["motion"]), []).append(row)
    found = []
    for (force, motion), own in rows.items():
        hit, seen = PLACES_MM[motion]
        columns = range(1, len(seen) + 1)
        residues = np.array(
            [[complex(float(r[f"residue_{i}_real"]), float(r[f"residue_{i}_imag"])) for i in columns] for r in own]
        )
        poles = np.array([complex(float(r["pole_real"]), float(r["pole_imag"])) for r in own])
        modes = np.array([int(r["mode"]) > 0 for r in own])
        found.append(
            VirtualRig(
                motion="axial" if motion == "axial" else "radial",
                force_kn=force,
                hit=Coordinate("holder", 1e-3 * hit),
                seen=tuple(Coordinate("holder", 1e-3 * x) for x in seen),
                poles=poles[modes],
                residues=residues[modes],
                rest=residues[~modes][0],
            )
        )
    return tuple(found)


def holder() -> Holder:
    """Return the holder of the packaged campaign `taper`.

    Examples
    --------
    >>> from receptance.examples.virtual_rig import holder
    >>> round(holder().body.mass, 2)
    5.33
    """
    campaign = (resources.files("receptance.examples") / "taper" / "campaign.toml").read_text(encoding="utf-8")
    assembly, _ = measured_structures(campaign)["axial 0 kN"]
    part, taper = assembly.elements["holder"], assembly.attachments["taper"]
    assert isinstance(part, Part)
    assert isinstance(taper, GroundSpring)
    big_end = float(taper.position)
    return Holder(part=part, big_end=big_end, small_end=big_end + taper.length)
