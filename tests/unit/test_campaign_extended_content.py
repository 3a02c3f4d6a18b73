"""Campaign content: measuring chain, shared factors of parameters, and attachments during measurement."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaign_text import TEXT, load
from receptance import FRF, PointMass
from receptance.campaign import CampaignError
from receptance.io import write

LINES = np.linspace(300.0, 6000.0, 400)
JOINT = {"joint.k_y": 5e8, "joint.k_theta": 1e5, "joint.c_y": 200.0, "joint.c_theta": 0.5}
HEAD = TEXT.partition("[measurements.short]")[0]
FRFS = """
[measurements.{name}]
kind = "frf"
assembly = "{name}"
role = "{role}"
file = "{name}.csv"
standard_deviation = "1 %"
{more}
"""
UNKNOWNS = """
[settings]
starts = 1
profiles = false

[unknowns]
"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m", start = "4e8 N/m" }
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad", start = "9e4 N m/rad" }
"joint.c_y" = { lower = "1 N s/m", upper = "1e5 N s/m", start = "250 N s/m" }
"joint.c_theta" = { lower = "1e-3 N m s/rad", upper = "1e2 N m s/rad", start = "0.4 N m s/rad" }
"""


def campaign_of(
    folder: Path, unknowns: str = "", more: str = "", head: str = "", *masses: PointMass, factor: complex = 1.0
) -> object:
    """Simulate the FRFs of short, long and, held out, longest; the campaign adds statements to the simulated data."""
    plain = load(folder, f"{HEAD}{UNKNOWNS}")
    for name, assembly in plain.assemblies.items():
        from receptance.campaign.build import with_attached

        true = with_attached(assembly.replace(JOINT), *masses)
        write(folder / f"{name}.csv", FRF(frequency_hz=LINES, values=factor * true.receptance(LINES)))
    roles = {"short": "identify", "long": "identify", "longest": "hold out"}
    measured = "".join(FRFS.format(name=name, role=role, more=more) for name, role in roles.items())
    return load(folder, f"{HEAD}{head}{measured}{UNKNOWNS}{unknowns}")


def test_a_gain_is_identified_and_the_held_out_frf_is_predicted_with_it(tmp_path: Path) -> None:
    gain = '"observation.log_gain" = { lower = -1.0, upper = 1.0, start = 0.0 }\n'
    read = campaign_of(tmp_path, gain, factor=1.08)
    found = read.identify()
    assert found.values["observation.log_gain"] == pytest.approx(np.log(1.08), abs=1e-6)
    assert found.values["joint.k_y"] == pytest.approx(5e8, rel=1e-4)
    (frf,) = read.predict(found).frfs
    np.testing.assert_allclose(frf.receptance, frf.measured, rtol=1e-4)


def test_a_delay_of_one_assembly_alone(tmp_path: Path) -> None:
    delay = '"observation.delay" = { lower = "-1 ms", upper = "1 ms", assemblies = ["short"], name = "lag" }\n'
    found = campaign_of(tmp_path, delay).identify()
    assert found.values["lag"] == pytest.approx(0.0, abs=1e-10)


def test_moves_and_multiples(tmp_path: Path) -> None:
    both = """
"tool E" = { lower = -0.2, upper = 0.2, start = 0.0, moves = { "tool.segment[*].youngs_modulus" = 1 }, relative = true }
[unknowns."holder.segment[0].length"]
lower = 0.01
upper = 0.03
start = 0.018
multiple = 2.0
also = { "holder.segment[1].length" = 4.5 }
"""
    found = campaign_of(tmp_path, both).identify()
    assert found.values["tool E"] == pytest.approx(0.0, abs=1e-4)
    assert found.values["holder.segment[0].length"] == pytest.approx(0.02, rel=1e-3)


def test_a_power_of_a_condition_moves_several(tmp_path: Path) -> None:
    moved = """
[unknowns.softer]
lower = -4
upper = 4
moves = { "joint.k_y" = 1, "joint.k_theta" = 1 }
relative = true
power_of = "tool.segment[0].length"
reference = "75 mm"
"""
    found = campaign_of(tmp_path, moved).identify()
    assert found.values["softer"] == pytest.approx(0.0, abs=1e-3)


def test_mass_during_measurement_is_not_part_of_the_assembly(tmp_path: Path) -> None:
    head = '\n[attachments.second]\nkind = "mass"\nmass = "0 g"\n'
    unknown = '"second.mass" = { lower = "0 g", upper = "20 g", scale = "linear" }\n'
    second = PointMass(mass=2e-3, name="second")
    read = campaign_of(tmp_path, unknown, 'attachments = ["second"]', head, second)
    found = read.identify()
    assert found.values["second.mass"] == pytest.approx(2e-3, rel=1e-3)
    assert "second" not in read.assemblies["short"].attachments
    (frf,) = read.predict(found).frfs
    np.testing.assert_allclose(frf.receptance, frf.measured, rtol=1e-3)


def test_quantity_overrides_that_of_the_file(tmp_path: Path) -> None:
    plain = campaign_of(tmp_path).measurements["short"]
    again = campaign_of(tmp_path, more="integrate = 1").measurements["short"]
    np.testing.assert_allclose(again.receptance, plain.receptance / (2j * np.pi * LINES), rtol=1e-12)


@pytest.mark.parametrize(
    ("unknown", "text"),
    [
        ('"observation.log_gian" = { lower = -1.0, upper = 1.0 }', 'did you mean "log_gain"'),
        ('"x" = { lower = -1, upper = 1, moves = { "tol.segment[*].density" = 1 } }', 'begins with "tol"'),
        ('"x" = { lower = -1, upper = 1, moves = { "tool.segment[7].density" = 1 } }', "is a parameter of no assembly"),
        ('"x" = { lower = "1 mm", upper = 1, moves = { "tool.segment[*].density" = 1 } }', 'is "1 mm", expected'),
        ('"x" = { lower = -1, upper = 1, free = true, moves = { "joint.k_y" = 1 } }', "is given with `moves`"),
        ('"joint.k_ytheta" = { lower = "-1 N/rad", upper = "1 N/rad", relative = true }', "is given without `moves`"),
        ('"observation.delay" = { lower = "-1 ms", upper = "1 ms", assemblies = ["shrt"] }', 'did you mean "short"'),
    ],
)  # fmt: skip
def test_mistakes_are_reported(tmp_path: Path, unknown: str, text: str) -> None:
    with pytest.raises(CampaignError) as error:
        campaign_of(tmp_path, f"{unknown}\n")
    assert text in str(error.value)
