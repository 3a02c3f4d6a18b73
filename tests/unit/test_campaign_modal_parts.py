"""A spindle given by its modes in a campaign: fitted with the joint from hits at several places of tool and holder."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from receptance import FRF, Assembly, Coordinate, ModalPart, Mode, Part, PointJoint, Segment, campaign, io
from receptance.campaign import CampaignError
from receptance.materials import Material

STEEL = Material(name="steel", youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3, loss_factor=0.002)
LINES = np.arange(300.0, 3000.0, 10.0)
MODES = (
    Mode(frequency_hz=800.0, damping_ratio=0.03, y=0.28, theta=1.2),
    Mode(frequency_hz=1900.0, damping_ratio=0.025, y=0.35, theta=-2.5),
)
PLACES = {"tip": ("tool", 0.0), "mid": ("tool", 0.03), "nose": ("holder", 0.0), "back": ("holder", 0.05)}
HITS = [("tip", "tip"), ("tip", "mid"), ("tip", "nose"), ("tip", "back"), ("back", "back"), ("nose", "back")]
HELD_OUT = ("mid", "back")
HEAD = """
[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.3
loss_factor = 0.002

[[parts.tool.segments]]
length = "70 mm"
outer_diameter = "16 mm"
material = "steel"

[[parts.holder.segments]]
length = "90 mm"
outer_diameter = "45 mm"
material = "steel"

[joints.joint]
k_y = "3e8 N/m"
c_y = "100 N s/m"

[[modal_parts.spindle.modes]]
frequency_hz = "780 Hz"

[[modal_parts.spindle.modes]]
frequency_hz = "2 kHz"

[assemblies.machine]
chain = ["tool", "joint", "holder", "spindle"]

[assemblies.longer]
chain = ["tool", "joint", "holder", "spindle"]
set = { "tool.segment[0].length" = "85 mm" }

[settings]
starts = 4

[unknowns]
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e6 N m/rad" }
"joint.c_theta" = { lower = "0.01 N m s/rad", upper = "100 N m s/rad" }
"spindle.mode[0].frequency_hz" = { lower = "600 Hz", upper = "1 kHz" }
"spindle.mode[1].frequency_hz" = { lower = "1.6 kHz", upper = "2.4 kHz" }
"spindle.mode[0].damping_ratio" = { lower = 0.005, upper = 0.2 }
"spindle.mode[1].damping_ratio" = { lower = 0.005, upper = 0.2 }
"spindle.mode[0].y" = { lower = "0.01 1/kg**0.5", upper = "1 1/kg**0.5" }
"spindle.mode[1].y" = { lower = "0.01 1/kg**0.5", upper = "1 1/kg**0.5" }
"spindle.mode[0].theta" = { lower = "-10 rad/(m*kg**0.5)", upper = "10 rad/(m*kg**0.5)" }
"spindle.mode[1].theta" = { lower = "-10 rad/(m*kg**0.5)", upper = "10 rad/(m*kg**0.5)" }
"spindle.residual_y" = { lower = "-1e-8 m/N", upper = "1e-8 m/N" }
"spindle.residual_theta" = { lower = "-1e-6 rad/(N m)", upper = "1e-6 rad/(N m)" }
"""


def true_machine(overhang: float = 0.07) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.016, material=STEEL)], name="tool")
    joint = PointJoint(k_y=3e8, k_theta=4e4, c_y=100.0, c_theta=2.0, name="joint")
    holder = Part([Segment(length=0.09, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, joint, holder, ModalPart(modes=MODES, residual_y=2e-9, residual_theta=3e-7, name="spindle")])


def written(folder: Path, text: str = HEAD) -> campaign.Campaign:
    """Write FRFs of the roving hammer with 1 % noise, seed 5, and the campaign, and load it."""
    rng = np.random.default_rng(5)
    for response, excitation in (*HITS, HELD_OUT):
        h = true_machine().receptance(
            LINES, response=Coordinate(*PLACES[response]), excitation=Coordinate(*PLACES[excitation])
        )
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        name = f"{response}_{excitation}"
        io.write(folder / f"{name}.npz", FRF(frequency_hz=LINES, values=h * np.exp(noise), log_variance=1e-4))
        role = "hold out" if (response, excitation) == HELD_OUT else "identify"
        text += f'\n[measurements.{name}]\nkind = "frf"\nassembly = "machine"\nfile = "{name}.npz"\nrole = "{role}"\n'
        for key, place in (("response", response), ("excitation", excitation)):
            part, position = PLACES[place]
            text += f'{key} = {{ part = "{part}", position = "{1e3 * position:g} mm" }}\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return campaign.load(folder)


def test_a_spindle_is_fitted_with_the_joint(tmp_path: Path) -> None:
    loaded = written(tmp_path)
    found = loaded.identify()
    true = true_machine()
    values = found.fit.values
    for address, value in values.items():
        if "residual" not in address:
            assert value == pytest.approx(true.get(address), rel=0.1), address
    assert values["joint.k_theta"] == pytest.approx(4e4, rel=0.02)
    assert values["spindle.mode[0].frequency_hz"] == pytest.approx(800.0, rel=0.005)
    assert found.fit.rms == pytest.approx(1.0, abs=0.1)
    assert np.isfinite(found.fit.covariance).all()
    # Another overhang, which was not measured, and a pair of places that was held out.
    fitted = loaded.built.assemblies["longer"].replace(values)
    off = np.abs(np.log(fitted.receptance(LINES) / true_machine(0.085).receptance(LINES)))
    assert np.median(off) < 0.02
    held = [one for one in loaded.predict(found).frfs if one.rms_decibel is not None]
    assert len(held) == 1
    assert held[0].rms_decibel < 0.5


def test_mistakes_of_a_modal_part(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="frequency_hz"):
        written(tmp_path, HEAD.replace('frequency_hz = "780 Hz"', 'frequency_hz = "780 mm"'))
    with pytest.raises(CampaignError, match="so that nothing can follow it"):
        written(tmp_path, HEAD.replace('"holder", "spindle"]', '"spindle", "holder"]', 1))
    with pytest.raises(CampaignError, match=r"mode\[2\]"):
        written(tmp_path, HEAD.replace('"spindle.mode[1].y"', '"spindle.mode[2].y"'))
    with pytest.raises(CampaignError, match="has no mode shape, expected y or theta"):
        written(tmp_path, re.sub(r'"spindle.mode\[1\].(y|theta)".*\n', "", HEAD))
