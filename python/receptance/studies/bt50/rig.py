"""The virtual rig: poles from finite elements, hit and recorded as the paper recorded its own."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance.beams import Part, Segment
from receptance.coordinates import Coordinate
from receptance.errors import ReceptanceWarning
from receptance.materials import Material
from receptance.measurement import estimate_frf, find_hits, simulate_hits
from receptance.studies._data import number, read_table, read_toml
from receptance.taper import Holder, without_each

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from receptance.frf import FRF
    from receptance.measurement import TimeRecords

__all__ = ["SAMPLE_RATE_HZ", "SPACING_HZ", "VirtualRig", "load_holder", "load_rig"]

Motion = Literal["axial", "radial"]

SAMPLE_RATE_HZ = 20480.0
SPACING_HZ = 20.0
HITS = 10
"""Of the paper: sampling, resolution and averaged impacts."""
DECAY_RATE = 120.0
"""In 1/s, of the exponential window: after 50 ms nothing is left to be cut off."""
ESTIMATE: dict[str, Any] = {"decay_rate": DECAY_RATE, "force_window_s": None, "estimator": "Hv"}
"""The force counts as a whole, because what a window takes off it is the same for all hits, and no scatter shows it;
more noise of the force then comes in, which Hv allows for."""
_NOISE_DB = -60.0
_CONTACT_S = 2e-4
_PRE_TRIGGER_S = 1e-3


@dataclass(frozen=True, eq=False)
class VirtualRig:
    """The rig in one motion at one drawbar force, as poles and residues; what `simulate_hits` can hit.

    Attributes
    ----------
    motion : {"axial", "radial"}
        Along or across.
    force_kn : float
        Drawbar force.
    hit, seen : Coordinate, tuple of Coordinate
        Where it is hit and seen; other places are not known.
    poles, residues : ndarray
        `(m,)` in rad/s and `(m, n_seen)`.
    rest : ndarray
        `(n_seen,)` receptance of the modes above.
    """

    motion: Motion
    force_kn: float
    hit: Coordinate
    seen: tuple[Coordinate, ...]
    poles: NDArray[np.complex128]
    residues: NDArray[np.complex128]
    rest: NDArray[np.complex128]

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
            Without a window and with all lines, as the paper has it, though the response has not died away in a block
            of 50 ms; and from the same records with an exponential window on both channels, which is exact.
        left_out : tuple of FRF
            The second without each of the hits.
        """
        records = self.records(seed)
        with warnings.catch_warnings():
            # It is said in the study's findings, once.
            warnings.filterwarnings("ignore", ".*has not died away", ReceptanceWarning)
            plain = estimate_frf(records)
        hits = find_hits(records)
        windowed = estimate_frf(hits, **ESTIMATE)
        return plain.with_(usable=None), windowed, without_each(hits, **ESTIMATE)

    def windowed(self, seed: int) -> FRF:
        """Return the second FRF of `measure` alone."""
        return estimate_frf(find_hits(self.records(seed)), **ESTIMATE)

    def records(self, seed: int) -> TimeRecords:
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
    rows: dict[tuple[float, str], list[Any]] = {}
    for row in read_table("bt50_virtual_rig.csv"):
        rows.setdefault((number(row, "force_kn"), row["motion"]), []).append(row)
    places = read_toml("bt50_holder.toml")["rig"]
    found = []
    for (force, motion), own in rows.items():
        seen = [Coordinate("holder", 1e-3 * x) for x in places[f"{motion}_seen_mm"]]
        columns = range(1, len(seen) + 1)
        residues = np.array(
            [[complex(number(r, f"residue_{i}_real"), number(r, f"residue_{i}_imag")) for i in columns] for r in own]
        )
        poles = np.array([complex(number(r, "pole_real"), number(r, "pole_imag")) for r in own])
        modes = np.array([int(r["mode"]) > 0 for r in own])
        found.append(
            VirtualRig(
                motion="axial" if motion == "axial" else "radial",
                force_kn=force,
                hit=Coordinate("holder", 1e-3 * places[f"{motion}_hit_mm"]),
                seen=tuple(seen),
                poles=poles[modes],
                residues=residues[modes],
                rest=residues[~modes][0],
            )
        )
    return tuple(found)


def load_holder() -> Holder:
    """Return the holder as somebody would describe it from a drawing: cylinders, and the cone in steps."""
    data = read_toml("bt50_holder.toml")
    steel = Material(
        youngs_modulus=1e9 * data["steel"]["E_gpa"],
        density=float(data["steel"]["density_kg_m3"]),
        poisson_ratio=data["steel"]["poisson"],
        name="steel",
    )

    def cylinder(length: float, diameter: float) -> Segment:
        return Segment(length=1e-3 * length, outer_diameter=1e-3 * diameter, material=steel)

    before = [cylinder(length, diameter) for length, diameter in data["before_the_gauge_line_mm"]]
    taper = data["taper"]
    step = taper["length_mm"] / taper["steps"]
    ends = [taper["gauge_diameter_mm"] - i * step * 7.0 / 24.0 for i in range(taper["steps"] + 1)]
    # Each step as heavy as the frustum that it stands for.
    cone = [cylinder(step, float(np.sqrt((a * a + a * b + b * b) / 3.0))) for a, b in pairwise(ends)]
    behind = [cylinder(length, diameter) for length, diameter in data["behind_the_taper_mm"]]
    part = Part([*before, *cone, *behind], name="holder")
    big_end = sum(segment.length for segment in before)
    return Holder(part=part, big_end=big_end, small_end=big_end + 1e-3 * taper["length_mm"])
