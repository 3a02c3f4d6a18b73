"""A machine as a campaign: `campaign.toml` and one CSV file for each record."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .machine import FLOOR, Machine, Record
from .structure import Place, section_count

BOUNDS = {
    "joint.k_y": ("1e7 N/m", "1e10 N/m"),
    "joint.k_theta": ("1e3 N m/rad", "1e6 N m/rad"),
    "joint.c_y": ("1 N s/m", "1e5 N s/m"),
    "joint.c_theta": ("1e-4 N m s/rad", "10 N m s/rad"),
}
SPEEDS_RPM = (4000.0, 20000.0)
_UNITS = {
    "k_y": "N/m",
    "k_theta": "N m/rad",
    "c_y": "N s/m",
    "c_theta": "N m s/rad",
    "frequency_hz": "Hz",
    "damping_ratio": "",
    "y": "1/kg**0.5",
    "theta": "rad/(m*kg**0.5)",
    "y_imaginary": "1/kg**0.5",
    "theta_imaginary": "rad/(m*kg**0.5)",
    "residual_y": "m/N",
    "residual_theta": "rad/(N m)",
    "residual_ytheta": "m/(N m)",
}
Starts = Mapping[str, tuple[float, float, float]]
"""Lower bound, start and upper bound in SI units by address."""


def write(
    machine: Machine,
    folder: Path,
    *,
    modes: int | str,
    starts: Starts | None = None,
    settings: Mapping[str, object] | None = None,
    name: str = "campaign.toml",
) -> Path:
    """Write the records and the campaign into a folder, and return the campaign's path.

    Parameters
    ----------
    machine : Machine
        The machine.
    folder : Path
        An existing folder.
    modes : int or str
        Number of unknown modes of the spindle, or "auto".
    starts : mapping, optional
        Bounds and starts of unknowns; by default the joint has bounds, and the program chooses the rest.
    settings : mapping, optional
        Settings of the fit.
    name : str, optional
        Name of the campaign file. Records that are there already are not written again.
    """
    for record in machine.records:
        path = folder / f"{record.name}.csv"
        if not path.exists():
            path.write_text(_table(record), encoding="utf-8")
    text = [*_parts(machine), *_measurements(machine, modes), *_cuts(machine)]
    if settings:
        text += ["[settings]", *(f"{key} = {_toml(value)}" for key, value in settings.items())]
    path = folder / name
    path.write_text("\n".join([*text, *_unknowns(starts)]) + "\n", encoding="utf-8")
    return path


def _toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value) if isinstance(value, int) else f'"{value}"'


def _table(record: Record) -> str:
    rows = ["frequency [Hz],receptance real [m/N],receptance imaginary [m/N],coherence"]
    for f, h, c in zip(record.frequency_hz, record.receptance, record.coherence, strict=True):
        rows.append(f"{f:.10g},{h.real:+.12e},{h.imag:+.12e},{c:.12e}")
    return "\n".join(rows) + "\n"


def _mm(metres: float) -> str:
    return f'"{1e3 * metres:.6f} mm"'


def _parts(machine: Machine) -> list[str]:
    """Return materials and parts with their tolerances."""
    p, sd = machine.numbers, machine.deviations
    text = ['title = "machine"']
    for name, kind in (("carbide", "tool"), ("steel", "holder")):
        text += [
            f"[materials.{name}]",
            f'youngs_modulus = "{1e-9 * p[f"{kind}.modulus"]:g} GPa"',
            f'density = "{p[f"{kind}.density"]:g} kg/m^3"',
            f"poisson_ratio = {p[f'{kind}.poisson']:g}",
            f"loss_factor = {p[f'{kind}.loss']:g}",
            f'tolerance = {{ youngs_modulus = "{1e-9 * sd[f"{kind}.modulus"]:g} GPa", '
            f'density = "{sd[f"{kind}.density"]:g} kg/m^3" }}',
        ]
    flutes = p.get("flute.length", 0.0)
    if flutes:
        text += [
            "[[parts.tool.segments]]",
            f"length = {_mm(flutes)}",
            f"outer_diameter = {_mm(p['flute.diameter'])}",
            'material = "carbide"',
            f"tolerance = {{ length = {_mm(sd['flute.length'])}, outer_diameter = {_mm(sd['flute.diameter'])} }}",
        ]
    text += [
        "[[parts.tool.segments]]",
        f"length = {_mm(machine.overhangs[0] - flutes)}",
        f"outer_diameter = {_mm(p['tool.diameter'])}",
        'material = "carbide"',
        f"tolerance = {{ length = {_mm(machine.overhang_deviation)}, outer_diameter = {_mm(sd['tool.diameter'])} }}",
    ]
    for i in range(section_count(p)):
        name = f"holder.{i}"
        outer = 0.5 * (p[f"{name}.small"] + p[f"{name}.large"])
        tolerance = {"length": sd[f"{name}.length"], "outer_diameter": sd[f"{name}.large"]}
        if f"{name}.inner" in sd:
            tolerance["inner_diameter"] = sd[f"{name}.inner"]
        text += [
            "[[parts.holder.segments]]",
            f"length = {_mm(p[f'{name}.length'])}",
            f"outer_diameter = {_mm(outer)}",
            f"inner_diameter = {_mm(p[f'{name}.inner'])}",
            'material = "steel"',
            *(['core = "carbide"'] if p[f"{name}.core"] else []),
            f"tolerance = {{ {', '.join(f'{key} = {_mm(value)}' for key, value in tolerance.items())} }}",
        ]
    return text


def _place(place: Place) -> str:
    return f'{{ part = "{place[0]}", position = {_mm(place[1])} }}'


def _measurements(machine: Machine, modes: int | str) -> list[str]:
    """Return joint, spindle, sensor, assemblies and measurements."""
    text = ["[joints.joint]", "[modal_parts.spindle]", "identify = true", f"modes = {_toml(modes)}"]
    text += ["[sensors.light]", f'mass = "{1e3 * machine.numbers["sensor.mass"]:g} g"']
    flutes = machine.numbers.get("flute.length", 0.0)
    shank = 1 if flutes else 0
    for number, overhang in enumerate(machine.overhangs):
        text += [
            f"[assemblies.o{number}]",
            'chain = ["tool", "joint", "holder", "spindle"]',
            f'set = {{ "tool.segment[{shank}].length" = {_mm(overhang - flutes)} }}',
            f"conditions = {{ overhang = {_mm(overhang)} }}",
        ]
    for record in machine.records:
        text += [
            f"[measurements.{record.name}]",
            'kind = "frf"',
            f'assembly = "o{record.overhang}"',
            f'file = "{record.name}.csv"',
            "averages = 10",
            f'floor = "{100.0 * FLOOR:g} %"',
            'sensor = "light"',
            f"response = {_place(record.response)}",
            f"excitation = {_place(record.hit)}",
        ]
    return text


def _cuts(machine: Machine) -> list[str]:
    """Return the cuts, of both directions alike."""
    text = ["[stability]", f'speeds = ["{SPEEDS_RPM[0]:g} rpm", "{SPEEDS_RPM[1]:g} rpm"]'] if machine.cuts else []
    for overhang, cut in machine.cuts:
        text += [
            f"[cuts.c{overhang}]",
            'kind = "milling"',
            f"teeth = {cut.teeth}",
            f'k_t = "{1e-6 * cut.k_t:g} MPa"',
            f'k_n = "{1e-6 * cut.k_n:g} MPa"',
            f"radial_depth = {cut.immersion:g}",
            f'feed = "{cut.feed}"',
            f'x = {{ assembly = "o{overhang}" }}',
        ]
    return text


def _unknowns(starts: Starts | None) -> list[str]:
    if starts is None:
        rows = {address: f'{{ lower = "{low}", upper = "{high}" }}' for address, (low, high) in BOUNDS.items()}
    else:
        rows = {address: _row(address, *values) for address, values in starts.items()}
    return ["[unknowns]", *(f'"{address}" = {row}' for address, row in rows.items())]


def _row(address: str, lower: float, start: float, upper: float) -> str:
    unit = _UNITS[address.rsplit(".", 1)[1]]
    values = {"lower": lower, "start": float(np.clip(start, lower, upper)), "upper": upper}
    written = {key: f'"{value:.15g} {unit}"' if unit else f"{value:.15g}" for key, value in values.items()}
    return f"{{ {', '.join(f'{key} = {value}' for key, value in written.items())} }}"
