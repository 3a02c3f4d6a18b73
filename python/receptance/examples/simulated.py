"""Simulated measurements of the examples, computed from a stated seed and labelled as simulated.

The simulated structure is that of the campaign, with joint parameters that are not in the campaign.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np
import tomli_w
from numpy.typing import NDArray

from receptance import hammer, io, units
from receptance.campaign.read import measured_structures
from receptance.examples.virtual_rig import VirtualRig, load_rig
from receptance.frf import FRF
from receptance.io import TimeSeries
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate

Say = Callable[[str], None]

FREE_FREE_SEED = 20240229
FREE_FREE_JOINT = {"joint.k_y": 4.2e8, "joint.k_theta": 1.6e5, "joint.c_y": 400.0, "joint.c_theta": 0.08}
"""True joint parameters of the example free-free, in SI units."""
_LINES_HZ = np.arange(200.0, 6000.5, 4.0)
_HITS = 10
_SCATTER = 0.03
"""Relative standard deviation of real and imaginary part between hits, from the scatter of the hit point."""
_FLOOR = 0.02
"""Noise of the accelerometer in m/s^2/N for the weakest hit, for real and imaginary part."""
_DIGITS = 7

MACHINE_SEED = 20261127
_MACHINE_HIGHEST_HZ = 4000.0
_MACHINE = """
[joints.joint]
k_y = "1.5e8 N/m"
k_theta = "4e4 N m/rad"
c_y = "200 N s/m"
c_theta = "0.3 N m s/rad"
[joints.taper]
k_y = "1.5e9 N/m"
k_theta = "2e6 N m/rad"
loss_factor = 0.02
[[parts.shaft.segments]]
length = "60 mm"
outer_diameter = "85 mm"
inner_diameter = "30 mm"
material = "steel"
[[parts.shaft.segments]]
length = "300 mm"
outer_diameter = "70 mm"
inner_diameter = "30 mm"
material = "steel"
[attachments.front]
kind = "ground"
part = "shaft"
position = "60 mm"
k_y = "3e8 N/m"
k_theta = "5e4 N m/rad"
c_y = "3000 N s/m"
[attachments.rear]
kind = "ground"
part = "shaft"
position = "320 mm"
k_y = "2e8 N/m"
c_y = "4000 N s/m"
[unknowns]
"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }
"""
"""What is behind blank and holder in the example gauge, and its joint."""

HAMMER_SEED = 20241017
HAMMER_JOINT = {"collet.k_y": 2.8e8, "collet.k_theta": 5.0e4, "collet.c_y": 400.0, "collet.c_theta": 0.06}
"""True joint parameters of the example hammer, in SI units."""
_HAMMER_HITS = 8
_RATE_HZ = 25600.0
_BLOCK_S = 0.4
_CONTACT_S = 1.5e-4
_NOISE_DB = -75.0

TAPER_SEED = 20250522
_TAPER_HIGHEST_HZ = 6500.0


def free_free(campaign: str, say: Say) -> Mapping[str, bytes]:
    """Return the FRFs of the example free-free by file name: accelerance and coherence of ten hits each."""
    random = np.random.default_rng(FREE_FREE_SEED)
    files = {}
    for name, (assembly, tip) in measured_structures(campaign).items():
        say(f"simulating {name}")
        frf = _averaged(assembly.replace(FREE_FREE_JOINT), tip, tip, random, name, FREE_FREE_SEED)
        files[f"{name}.csv"] = _content(frf, ".csv")
    return files


def machine_records(campaign: str, say: Say) -> Mapping[str, bytes]:
    """Return the FRFs of the example gauge by file name: blank and tool in a machine that the campaign lacks."""
    random = np.random.default_rng(MACHINE_SEED)
    data, machine = tomllib.loads(campaign), tomllib.loads(_MACHINE)
    del data["spindles"], data["cuts"]
    for section, tables in machine.items():
        data[section] = {**data.get(section, {}), **tables}
    for assembly in data["assemblies"].values():
        assembly["chain"][-1:] = ["taper", "shaft"]
        assembly["attachments"] = ["front", "rear"]
    files = {}
    for name, (assembly, response) in measured_structures(tomli_w.dumps(data)).items():
        say(f"simulating {name}")
        table = data["measurements"][name].get("excitation", {})
        part = table.get("part", next(iter(assembly.elements)))
        excitation = Coordinate(part, units.parse(table.get("position", "0 mm"), units.LENGTH_OR_ZERO))
        frf = _averaged(assembly, response, excitation, random, name, MACHINE_SEED)
        files[f"{name}.csv"] = _content(frf.select(high_hz=_MACHINE_HIGHEST_HZ), ".csv")
    return files


def time_records(campaign: str, say: Say) -> Mapping[str, bytes]:
    """Return the records of the example hammer by file name: one long record each, with all hits."""
    files = {}
    for number, (name, (assembly, tip)) in enumerate(measured_structures(campaign).items()):
        say(f"simulating hits on {name}")
        records = hammer.simulate_hits(
            assembly.replace(HAMMER_JOINT),
            response=tip,
            excitation=tip,
            hits=_HAMMER_HITS,
            sample_rate_hz=_RATE_HZ,
            duration_s=_BLOCK_S,
            contact_s=_CONTACT_S,
            force_noise_db=_NOISE_DB,
            response_noise_db=_NOISE_DB,
            double_hits=[3] if name == "medium" else [],
            overloads=[5] if name == "long" else [],
            one_record=True,
            seed=HAMMER_SEED + number,
        )
        series = TimeSeries(
            values=np.stack([records.force[0], records.response[0, :, 0]], axis=1),
            channels=["hammer", "tip"],
            units=["N", "m/s^2"],
            sample_rate_hz=records.sample_rate_hz,
            label=f"{name} (simulated)",
            source=records.source,
            notes=records.notes,
        )
        files[f"{name}.npz"] = _content(series, ".npz")
    return files


def taper(campaign: str, say: Say) -> Mapping[str, bytes]:
    """Return the FRFs of the examples taper and bt50 by file name: the virtual rig at the forces of the campaign."""
    forces = tomllib.loads(campaign)["series"]["levels"]
    seeds = enumerate(load_rig(), start=TAPER_SEED)
    return taper_files(((rig, seed) for seed, rig in seeds if f"{rig.force_kn:g} kN" in forces), say)


def taper_files(rigs: Iterable[tuple[VirtualRig, int]], say: Say = lambda _: None) -> dict[str, bytes]:
    """Return the FRFs of a virtual rig by file name, from the rig at each force and the seed of its measurement."""
    files = {}
    for rig, seed in rigs:
        say(f"hitting the virtual rig at {rig.force_kn:g} kN, {rig.motion}")
        frf = rig.windowed(seed).select(high_hz=_TAPER_HIGHEST_HZ)
        files[f"{rig.motion}_{rig.force_kn:g}.npz"] = _content(frf, ".npz")
    return files


def _content(thing: FRF | TimeSeries, ending: str) -> bytes:
    """Return the content of a file of a measurement."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"data{ending}"
        io.write(file, thing)
        return file.read_bytes()


def _averaged(
    assembly: Assembly, response: Coordinate, excitation: Coordinate, random: np.random.Generator, name: str, seed: int
) -> FRF:
    """Return the H1 estimate of several hits with its coherence, as an analyser computes them."""
    lines = _LINES_HZ
    true = assembly.receptance(lines, response=response, excitation=excitation) * (2j * np.pi * lines) ** 2
    force = random.uniform(0.85, 1.15, (_HITS, 1)) * np.exp(-((lines / 9e3) ** 2))
    scatter = 1.0 + _SCATTER * _noise(random, (_HITS, lines.size))
    motion = true * force * scatter + 0.85 * _FLOOR * _noise(random, (_HITS, lines.size))
    cross = np.sum(force * motion, axis=0)
    power = np.sum(force**2, axis=0)
    coherence = np.abs(cross) ** 2 / (power * np.sum(np.abs(motion) ** 2, axis=0))
    values = cross / power
    return FRF(
        frequency_hz=lines,
        values=_rounded(values.real) + 1j * _rounded(values.imag),
        form="accelerance",
        coherence=_rounded(coherence),
        label=f"{name} (simulated)",
        source=f"simulated by receptance, seed {seed}",
        notes=("simulated",),
    )


def _noise(random: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.complex128]:
    return random.standard_normal(shape) + 1j * random.standard_normal(shape)


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return numbers rounded to the digits of an export."""
    return np.array([float(f"{value:.{_DIGITS - 1}e}") for value in values])
