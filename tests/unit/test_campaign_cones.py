"""A campaign with a conical holder, from the file to the verdict; the data are those of the tests' finite elements."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from as_if_found import as_if_found
from command_line import call
from finite_elements import NU, RHO, E, cone, coupled
from receptance import FRF, campaign
from receptance.campaign import json_schema
from receptance.diagnosis import CATALOGUE
from receptance.draft import inserted, parse_pieces
from receptance.io import write

LINES = np.linspace(300.0, 8000.0, 400)
TRUE = {"joint.k_y": 3e8, "joint.k_theta": 9e4, "joint.c_y": 250.0, "joint.c_theta": 0.1}
LOSS = 0.002
HEAD = f"""\
[materials.steel]
youngs_modulus = "{1e-9 * E:g} GPa"
density = "{RHO:g} kg/m^3"
poisson_ratio = {NU}
loss_factor = {LOSS}

[[parts.tool.segments]]
length = "60 mm"
outer_diameter = "16 mm"
material = "steel"

[[parts.holder.segments]]
length = "50 mm"
outer_diameter = "34 mm"
end_outer_diameter = "52 mm"
inner_diameter = "12 mm"
end_inner_diameter = "20 mm"
material = "steel"
tolerance = {{ outer_diameter = "0.05 mm", end_outer_diameter = "0.1 %", end_inner_diameter = "0.02 mm" }}

[[parts.holder.segments]]
length = "70 mm"
outer_diameter = "60 mm"
inner_diameter = "20 mm"
material = "steel"

[joints.joint]
"""
UNKNOWNS = """
[unknowns]
"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad" }
"joint.c_y" = { lower = "1 N s/m", upper = "1e5 N s/m" }
"joint.c_theta" = { lower = "1e-3 N m s/rad", upper = "1e2 N m s/rad" }
"""
OVERHANGS = {"short": 0.06, "long": 0.09, "longest": 0.11}


@pytest.fixture(scope="module")
def conical(tmp_path_factory: pytest.TempPathFactory) -> campaign.Campaign:
    """Three overhangs with 1 % of noise, the last one held out."""
    folder = tmp_path_factory.mktemp("conical")
    seed = 39
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    holder = [*cone(0.05, (0.034, 0.012), (0.052, 0.02)), (0.07, 0.06, 0.02)]
    text = HEAD
    for name, overhang in OVERHANGS.items():
        values = coupled([(overhang, 0.016, 0.0)], holder, tuple(TRUE.values()), LINES, LOSS)
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        write(folder / f"{name}.csv", FRF(frequency_hz=LINES, values=values * np.exp(noise)))
        role = "hold out" if name == "longest" else "identify"
        text += f"""
[assemblies.{name}]
chain = ["tool", "joint", "holder"]
set = {{ "tool.segment[0].length" = "{1e3 * overhang:g} mm" }}

[measurements.{name}]
kind = "frf"
assembly = "{name}"
role = "{role}"
file = "{name}.csv"
standard_deviation = "1 %"
"""
    file = folder / "campaign.toml"
    file.write_text(text + UNKNOWNS, encoding="utf-8")
    return campaign.load(file)


def test_check_identify_and_predict(conical: campaign.Campaign) -> None:
    found = conical.identify()
    assert found.converged
    for name, value in TRUE.items():
        assert abs(found.values[name] - value) < 4.0 * found.standard_errors[name], name
    predicted = conical.predict(found)
    assert predicted.rms_percent < 5.0


def test_a_null_is_adequate(conical: campaign.Campaign) -> None:
    causes = ["tool_density", "holder_modulus", "tip_diameter", "joint_spread", "sensor_mass"]
    verdict = conical.diagnose(causes)
    assert verdict.verdict == "adequate", verdict.summary()
    assert "is a cone" in verdict.undecidable["joint_spread"]


def test_an_extended_campaign_keeps_the_cones(conical: campaign.Campaign) -> None:
    """A section that begins within a conical tool divides it; the file has the pieces."""
    text = conical.file.read_text(encoding="utf-8")
    straight = 'outer_diameter = "16 mm"'
    assert straight in text
    lines = text.replace(straight, f'{straight}\nend_outer_diameter = "18 mm"').splitlines()
    path = conical.file.with_name("tapered.toml")
    # Tools of other lengths would be other cones.
    path.write_text("\n".join(line for line in lines if not line.startswith("set = ")), encoding="utf-8")
    tapered = campaign.load(path)
    variant = CATALOGUE["tip_diameter"].extensions(tapered.base_model()[0])[0][0].name
    read, verdict = as_if_found(tapered, ("tip_diameter", variant))
    again = campaign.load(campaign.write_extended(read, verdict, path.with_name("extended.toml")))
    (whole,) = tapered.assemblies["short"].parts["tool"].segments
    first, second = again.assemblies["short"].parts["tool"].segments
    assert again.assemblies["short"].parts["holder"] == tapered.assemblies["short"].parts["holder"]
    assert first.length + second.length == pytest.approx(whole.length, rel=1e-9)
    assert first.ends[1] == pytest.approx(second.ends[0], rel=1e-9)
    assert first.ends[1] == pytest.approx(whole.at(first.length / whole.length), rel=1e-9)
    assert second.ends[1] == pytest.approx(whole.ends[1], rel=1e-9)


def test_tolerances_of_the_far_end(conical: campaign.Campaign) -> None:
    model, _ = conical.base_model()
    moves = [address for tolerance in model.tolerances for address in tolerance.moves]
    fields = [address.removeprefix("holder.segment[0].") for address in moves]
    assert sorted(set(fields)) == ["end_inner_diameter", "end_outer_diameter", "outer_diameter"]


def test_a_bore_through_the_far_end_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "campaign.toml"
    text = HEAD.replace('end_inner_diameter = "20 mm"', 'end_inner_diameter = "60 mm"')
    file.write_text(f'{text}\n[assemblies.a]\nchain = ["tool", "joint", "holder"]\n', encoding="utf-8")
    with pytest.raises(ValueError, match=r"parts.holder.segments\[0\].*bore at the far end"):
        campaign.load(file)


def test_the_schema_has_the_keys_of_the_far_end() -> None:
    assert '"end_outer_diameter"' in str(json_schema()).replace("'", '"')


def test_pieces_of_cones() -> None:
    first, second, third = parse_pieces("48 mm x 50-60/20 mm, 3e1 x 60 – 50/20-30 mm, 10 mm x 44 mm")
    assert (first.outer_diameter, first.end_outer_diameter, first.end_inner_diameter) == (0.05, 0.06, None)
    assert (second.length, second.outer_diameter, second.end_outer_diameter) == pytest.approx((0.03, 0.06, 0.05))
    assert (second.inner_diameter, second.end_inner_diameter) == pytest.approx((0.02, 0.03))
    assert third.end_outer_diameter is None
    (small,) = parse_pieces("1e-1 m x 5e-2 m")
    assert (small.length, small.outer_diameter, small.end_outer_diameter) == (0.1, 0.05, None)


def test_a_bore_wider_than_the_thin_end_is_refused() -> None:
    with pytest.raises(ValueError, match="has a bore that is not smaller"):
        parse_pieces("48 mm x 50-20/25 mm")


def test_a_shank_in_a_conical_nose() -> None:
    (shank,) = parse_pieces("12 mm", shank=True)
    holder = parse_pieces("60 mm x 30-60/12 mm")
    around, behind = inserted(holder, 0.04, shank)
    assert (around.length, around.outer_diameter, around.end_outer_diameter) == pytest.approx((0.04, 0.03, 0.05))
    assert (behind.length, behind.outer_diameter, behind.end_outer_diameter) == pytest.approx((0.02, 0.05, 0.06))
    assert (around.inner_diameter, behind.inner_diameter) == (0.012, 0.012)


@pytest.mark.parametrize("command", ["check", "identify", "predict"])
def test_the_command_line_takes_cones(
    command: str, conical: campaign.Campaign, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(command, conical.file) == 0
    assert capsys.readouterr().out


def test_a_new_campaign_has_the_cone_of_its_answer(conical: campaign.Campaign, tmp_path: Path) -> None:
    files = [conical.file.with_name(f"{name}.csv") for name in ("short", "long")]
    answers = {
        "tool": "12 mm",
        "tool-material": "steel",
        "holder": "50 mm x 34-54/12 mm, 70 mm x 60/20-30 mm",
        "holder-material": "steel",
        "insertion": "20 mm",
        "sensor": "0 g",
        "standard-deviation": "1 %",
        "support": "free",
    }
    options = [text for name, answer in answers.items() for text in (f"--{name}", answer)]
    overhangs = ["--overhang", "60 mm", "--overhang", "90 mm"]
    assert call("new", tmp_path / "made", *files, *overhangs, *options) == 0
    made = campaign.load(tmp_path / "made" / "campaign.toml")
    holder = next(iter(made.assemblies.values())).parts["holder"]
    around, behind, body = (np.array(segment.ends) for segment in holder.segments)
    # The insertion ends at 20 of 50 mm: 34 mm + 0.4 x 20 mm.
    assert around == pytest.approx(np.array([[0.034, 0.012], [0.042, 0.012]]))
    assert behind == pytest.approx(np.array([[0.042, 0.012], [0.054, 0.012]]))
    assert body == pytest.approx(np.array([[0.06, 0.02], [0.06, 0.03]]))
    assert [segment.core is not None for segment in holder.segments] == [True, False, False]
