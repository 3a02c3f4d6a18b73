"""A machine with a catalogue of tools as campaign text, for tests; what was measured is simulated."""

from __future__ import annotations

from pathlib import Path

from receptance import campaign

TEXT = """\
title = "A machine with a catalogue, SIMULATED"

[materials.carbide]
youngs_modulus = "580 GPa"
density = "14500 kg/m^3"
poisson_ratio = 0.22
loss_factor = 0.002
tolerance = { youngs_modulus = "1 %", density = "0.5 %" }

[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.3
loss_factor = 0.002

[[parts.spindle.segments]]
length = "150 mm"
outer_diameter = "70 mm"
inner_diameter = "30 mm"
material = "steel"

[[parts.spindle.segments]]
length = "300 mm"
outer_diameter = "60 mm"
inner_diameter = "30 mm"
material = "steel"

[[parts.blank.segments]]
length = "60 mm"
outer_diameter = "12 mm"
material = "carbide"

[[parts.er32.segments]]
length = "40 mm"
outer_diameter = "50 mm"
inner_diameter = "12 mm"
core = "carbide"
material = "steel"

[[parts.er32.segments]]
length = "50 mm"
outer_diameter = "45 mm"
inner_diameter = "20 mm"
material = "steel"

[joints.collet]
k_y = "2e8 N/m"
c_y = "60 N s/m"
c_theta = "0.4 N m s/rad"

[joints.taper]
k_y = "6e8 N/m"
k_theta = "1.5e6 N m/rad"
c_y = "500 N s/m"
c_theta = "6 N m s/rad"
tolerance = { k_theta = "5 %", c_theta = "20 %" }

[attachments.front]
kind = "ground"
part = "spindle"
position = "80 mm"
k_y = "2.5e8 N/m"
c_y = "1500 N s/m"
tolerance = { k_y = "5 %" }

[attachments.rear]
kind = "ground"
part = "spindle"
position = "350 mm"
k_y = "1.5e8 N/m"
c_y = "1500 N s/m"

[assemblies.short]
chain = ["blank", "collet", "er32", "taper", "spindle"]
attachments = ["front", "rear"]

[assemblies.long]
chain = ["blank", "collet", "er32", "taper", "spindle"]
attachments = ["front", "rear"]
set = { "blank.segment[0].length" = "90 mm" }

[measurements.short]
kind = "natural frequencies"
assembly = "short"
modes = [4]
frequencies = ["1892.9 Hz"]
standard_deviation = "2 Hz"

[measurements.long]
kind = "natural frequencies"
assembly = "long"
modes = [3]
frequencies = ["1051.2 Hz"]
standard_deviation = "2 Hz"

[unknowns]
"collet.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad" }

[prediction]
lower = "50 Hz"
upper = "5 kHz"

[catalogue]
tools = "tools.csv"
holders = "holders.csv"
machine = ["taper", "spindle"]
attachments = ["front", "rear"]
joint = "collet"
tolerance = { overhang = "0.1 mm", diameter = "0.05 %", effective_diameter = "1 %" }
"""
TRUE_K_THETA = 4e4
"""Behind the natural frequencies of the file, in N m/rad."""
HOLDERS = """\
holder,length [mm],outer diameter [mm],inner diameter [mm],material,core
shrink,45,32,12,steel,carbide
shrink,50,40,20,steel,
"""
TOOLS = """\
name,holder,material,overhang [mm],diameter [mm],flute length [mm],effective diameter [%],teeth,torque [N m]
T1,er32,carbide,60,12,30,80,4,80
T2,shrink,carbide,80,12,40,80,4,80
# a comment, and an empty line

T3,er32,carbide,100,10,,,2,
"""


def load(folder: Path, *, text: str = TEXT, tools: str = TOOLS, holders: str = HOLDERS) -> campaign.Campaign:
    """Write the three files and return the campaign."""
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    (folder / "tools.csv").write_text(tools, encoding="utf-8")
    (folder / "holders.csv").write_text(holders, encoding="utf-8")
    return campaign.load(folder)
