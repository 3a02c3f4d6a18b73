"""A small campaign as text, to be changed and written by tests."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from receptance import campaign
from receptance.fit import Tolerance

TEXT = """\
title = "A blank in a holder"

[materials.carbide]
youngs_modulus = "580 GPa"
density = "14500 kg/m^3"
poisson_ratio = 0.22
tolerance = { youngs_modulus = "0.5 %", density = "45 kg/m^3" }

[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.3

[[parts.tool.segments]]
length = "60 mm"
outer_diameter = "12 mm"
material = "carbide"
tolerance = { length = "0.05 mm", outer_diameter = "0.05 %" }

[[parts.holder.segments]]
length = "40 mm"
outer_diameter = "50 mm"
inner_diameter = "12 mm"
material = "steel"
core = "carbide"

[[parts.holder.segments]]
length = "90 mm"
outer_diameter = "42 mm"
inner_diameter = "20 mm"
material = "steel"
tolerance = { outer_diameter = "0.1 mm" }

[joints.joint]

[sensors.accelerometer]
mass = "0.6 g"
tolerance = { mass = "0.02 g" }

[assemblies.short]
chain = ["tool", "joint", "holder"]
conditions = { torque = "135 N m" }

[assemblies.long]
chain = ["tool", "joint", "holder"]
set = { "tool.segment[0].length" = "90 mm" }

[assemblies.longest]
chain = ["tool", "joint", "holder"]
set = { "tool.segment[0].length" = "120 mm" }

[measurements.short]
kind = "natural frequencies"
assembly = "short"
frequencies = ["2500 Hz", "10000 Hz"]
standard_deviation = "2 Hz"

[measurements.long]
kind = "natural frequencies"
assembly = "long"
role = "hold out"
frequencies = ["1400 Hz", "6600 Hz"]
standard_deviation = ["1 Hz", "0.1 %"]

[unknowns]
"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad" }
"""


def changed(*edits: tuple[str, str]) -> str:
    """Return the text with pieces of it replaced, each of which must be there once."""
    text = TEXT
    for old, new in edits:
        assert text.count(old) == 1, f"{old!r} is there {text.count(old)} times"
        text = text.replace(old, new)
    return text


@functools.cache
def possible() -> tuple[str, str]:
    """Return an edit of the frequencies to those of a joint; the text has some that no joint has."""
    with tempfile.TemporaryDirectory() as folder:
        pair = campaign.load(write(Path(folder), TEXT)).measurements["short"].assembly
    first, second = pair.replace({"joint.k_y": 3e8, "joint.k_theta": 1e5}).natural_frequencies(2e4)[:2].tolist()
    return '"2500 Hz", "10000 Hz"', f'"{first!r} Hz", "{second!r} Hz"'


def write(folder: Path, text: str = TEXT) -> Path:
    """Write the text as a campaign file and return its path."""
    file = folder / "campaign.toml"
    file.write_text(text, encoding="utf-8")
    return file


def load(folder: Path, text: str = TEXT) -> campaign.Campaign:
    """Return the campaign of a text."""
    return campaign.load(write(folder, text))


def by_name(tolerances: Iterable[Tolerance]) -> dict[str, Mapping[str, float]]:
    """Return the standard deviations of errors by name and address."""
    return {one.name: one.moves for one in tolerances}
