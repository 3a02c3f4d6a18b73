"""A campaign on a simulated machine: a gauge blank and a tool in one spindle, as CSV files and one campaign file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from machine_spindle import make_spindle, with_spindle
from receptance import CARBIDE, FRF, STEEL, Assembly, Coordinate, Part, PointJoint, Segment, io

LINES = np.arange(200.0, 3500.0, 4.0)
LOSSY_STEEL = replace(STEEL, loss_factor=0.001)
LOSSY_CARBIDE = replace(CARBIDE, loss_factor=0.002)
TRUE = {"joint.k_y": 2e8, "joint.k_theta": 4e4, "joint.c_y": 300.0, "joint.c_theta": 0.3}
GAUGE = Assembly([Part([Segment(length=0.1, outer_diameter=0.05, material=LOSSY_STEEL)], name="gauge")])
BLANK_RECORDS = {"gauge_tip": (0.0, 0.0), "gauge_between": (0.07, 0.0), "gauge_near": (0.07, 0.07)}
"""Response and excitation in m from the tip."""
TOOL_RECORDS = {
    "tool_tip": (("tool", 0.0), ("tool", 0.0)),
    "tool_across": (("tool", 0.0), ("holder", 0.02)),
    "tool_holder": (("holder", 0.02), ("holder", 0.02)),
}
CAMPAIGN = """\
title = "A tool on a machine, simulated"

[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.3
loss_factor = 0.001

[materials.carbide]
youngs_modulus = "580 GPa"
density = "14500 kg/m^3"
poisson_ratio = 0.22
loss_factor = 0.002

[[parts.gauge.segments]]
length = "100 mm"
outer_diameter = "50 mm"
material = "steel"

[[parts.tool.segments]]
length = "60 mm"
outer_diameter = "12 mm"
material = "carbide"

[[parts.holder.segments]]
length = "80 mm"
outer_diameter = "45 mm"
material = "steel"

[joints.joint]

[spindles.spindle]
blanks = ["gauge"]
file = "spindle.npz"

[assemblies.gauge]
chain = ["gauge", "spindle"]

[assemblies.tool]
chain = ["tool", "joint", "holder", "spindle"]

[assemblies.longer]
chain = ["tool", "joint", "holder", "spindle"]
set = { "tool.segment[0].length" = "75 mm" }

[unknowns]
"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e6 N m/rad" }
"joint.c_y" = { lower = "1 N s/m", upper = "1e4 N s/m" }
"joint.c_theta" = { lower = "0.001 N m s/rad", upper = "10 N m s/rad" }

[settings]
starts = 1
profiles = false

[stability]
speeds = ["4000 rpm", "16000 rpm"]

[cuts.slot]
kind = "milling"
teeth = 4
k_t = "800 MPa"
k_n = "250 MPa"
x = { assembly = "tool" }
"""


def tool_on_machine(overhang: float = 0.06, values: Mapping[str, float] = TRUE) -> Assembly:
    """Return tool, joint, holder and the spindle of beams."""
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=LOSSY_CARBIDE)], name="tool")
    joint = PointJoint(**{name.split(".")[1]: value for name, value in values.items()}, name="joint")
    holder = Part([Segment(length=0.08, outer_diameter=0.045, material=LOSSY_STEEL)], name="holder")
    return with_spindle(Assembly([tool, joint, holder]), make_spindle())


def measured(
    machine: Assembly,
    response: Coordinate,
    excitation: Coordinate,
    sd: float,
    rng: np.random.Generator,
    lines: np.ndarray,
) -> FRF:
    """Return an FRF with noise of magnitude and phase."""
    h = machine.receptance(lines, response=response, excitation=excitation)
    noise = sd * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
    return FRF(frequency_hz=lines, values=h * np.exp(noise), log_variance=np.full(lines.size, sd**2))


def write_records(folder: Path, sd: float = 0.005, seed: int = 1, lines: np.ndarray = LINES) -> None:
    """Write the records of blank and tool as CSV files."""
    rng = np.random.default_rng(seed)
    gauge = with_spindle(GAUGE, make_spindle())
    for name, places in BLANK_RECORDS.items():
        one, other = (Coordinate("gauge", position) for position in places)
        io.write(folder / f"{name}.csv", measured(gauge, one, other, sd, rng, lines))
    for name, sides in TOOL_RECORDS.items():
        one, other = (Coordinate(*side) for side in sides)
        io.write(folder / f"{name}.csv", measured(tool_on_machine(), one, other, sd, rng, lines))


def campaign_text(text: str = CAMPAIGN) -> str:
    """Return the text of the campaign with the tables of all records."""
    places = {name: [("gauge", position) for position in sides] for name, sides in BLANK_RECORDS.items()}
    for name, sides in {**places, **TOOL_RECORDS}.items():
        assembly = name.split("_")[0]
        text += f'\n[measurements.{name}]\nkind = "frf"\nassembly = "{assembly}"\nfile = "{name}.csv"\n'
        for key, (part, position) in zip(("response", "excitation"), sides, strict=True):
            text += f'{key} = {{ part = "{part}", position = "{1e3 * position:g} mm" }}\n'
    return text


def write_campaign(folder: Path, text: str = CAMPAIGN, **records: object) -> Path:
    """Write records and campaign, and return the campaign file."""
    write_records(folder, **records)  # type: ignore[arg-type]
    file = folder / "campaign.toml"
    file.write_text(campaign_text(text), encoding="utf-8")
    return file
