"""Joints of each kind in campaign files: built, identified, predicted, and mistakes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaign_text import TEXT, by_name, changed, load
from receptance import FRF, ColletJoint, MicroslipJoint, PointJoint, SpreadJoint, campaign, io

SPREAD = """[joints.joint]
kind = "spread"
length = "30 mm"
shank = { outer_diameter = "12 mm", material = "carbide" }
sleeve.outer_diameter = "50 mm"
sleeve.inner_diameter = "12 mm"
sleeve.material = "steel"
loss_factor = 0.02
tolerance = { length = "0.1 mm" }
sleeve.tolerance = { outer_diameter = "0.1 mm" }
"""
COLLET = """[joints.joint]
kind = "collet"
mass = "120 g"
inertia = "1e-5 kg m^2"
inner = { k_theta = "2e5 N m/rad" }
outer = { k_y = "2e9 N/m", k_theta = "3e5 N m/rad", tolerance = { k_y = "5 %" } }
tolerance = { mass = "2 g" }
"""
MICROSLIP = """[joints.joint]
kind = "micro-slip"
k_y = "4e8 N/m"
slip_theta = 0.2
reference_theta = "20 urad"
reference_force = "20 N"
loss_factor = 0.02
"""
THETA = '"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad" }\n'
SLIP = '"joint.slip_theta" = { lower = 0.01, upper = 0.45, start = 0.1 }\n'


def text_of(joint: str, unknowns: str, *edits: tuple[str, str]) -> str:
    text = TEXT.replace("[joints.joint]\n", joint)
    text = text.replace('core = "carbide"\n', "")
    text = text[: text.index("[unknowns]")] + "[settings]\nstarts = 2\nprofiles = false\n[unknowns]\n" + unknowns
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def load_campaign(folder: Path, text: str) -> campaign.Campaign:
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return campaign.load(folder)


def fit_to(folder: Path, text: str, true: dict[str, float]) -> tuple[campaign.Campaign, dict[str, float]]:
    """Return a campaign whose frequencies are those of these values, and its identified values."""
    drawn = load_campaign(folder, text)
    for name, written in (("short", '"2500 Hz", "10000 Hz"'), ("long", '"1400 Hz", "6600 Hz"')):
        modes = drawn.measurements[name].assembly.replace(true).natural_frequencies(40e3)[:2]
        text = text.replace(written, ", ".join(f'"{mode:.9f} Hz"' for mode in modes))
    found = load_campaign(folder, text)
    fit = found.identify()
    return found, {name: value for name, value in fit.values.items() if name not in fit.errors}


def test_a_spread_joint(tmp_path: Path) -> None:
    unknowns = '"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }\n' + THETA
    true = {"joint.k_y": 5e8, "joint.k_theta": 3e4}
    text = text_of(SPREAD, unknowns, ("starts = 2", "starts = 1"))
    read, values = fit_to(tmp_path, text, true)
    joint = read.assemblies["short"].elements["joint"]
    assert isinstance(joint, SpreadJoint)
    assert (joint.length, joint.shank.outer_diameter, joint.sleeve.material.name) == (0.03, 0.012, "steel")
    assert values == pytest.approx(true, rel=1e-4)
    errors = by_name(read.tolerances["short"])
    assert errors["joints.joint.length"] == {"joint.length": pytest.approx(1e-4)}
    assert errors["joints.joint.sleeve.outer_diameter"] == {"joint.sleeve.outer_diameter": pytest.approx(1e-4)}
    # The shank is of the same carbide as the tool: one error.
    assert "joint.shank.density" in errors["materials.carbide.density"]
    assert "tool.segment[0].density" in errors["materials.carbide.density"]
    assert read.predict().rms_percent == pytest.approx(0.0, abs=1e-3)


def test_a_spread_joint_s_sections_may_be_unknown_and_set(tmp_path: Path) -> None:
    unknowns = '"joint.shank.youngs_modulus" = { lower = "400 GPa", upper = "700 GPa" }\n'
    joint = SPREAD + 'k_y = "5e8 N/m"\nk_theta = "3e4 N m/rad"\npoints = 5\n'
    edit = (
        'set = { "tool.segment[0].length" = "90 mm"',
        'set = { "joint.length" = "25 mm", "tool.segment[0].length" = "90 mm"',
    )
    read, values = fit_to(tmp_path, text_of(joint, unknowns, edit), {"joint.shank.youngs_modulus": 5.5e11})
    assert values["joint.shank.youngs_modulus"] == pytest.approx(5.5e11, rel=1e-4)
    assert read.assemblies["long"].get("joint.length") == 0.025
    assert read.assemblies["short"].elements["joint"].points == 5  # type: ignore[union-attr]


def test_a_collet(tmp_path: Path) -> None:
    unknowns = '"joint.inner.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }\n'
    unknowns += '"joint.outer.k_theta" = { lower = "1e4 N m/rad", upper = "1e7 N m/rad" }\n'
    true = {"joint.inner.k_y": 6e8, "joint.outer.k_theta": 2.5e5}
    read, values = fit_to(tmp_path, text_of(COLLET, unknowns), true)
    joint = read.assemblies["short"].elements["joint"]
    assert isinstance(joint, ColletJoint)
    assert (joint.mass, joint.inertia, joint.inner.k_theta, joint.outer.k_y) == (0.12, 1e-5, 2e5, 2e9)
    assert values == pytest.approx(true, rel=1e-4)
    # The value in the file is the start of the fit.
    starts = {unknown.address: unknown.start for unknown in read.unknowns}
    assert starts["joint.outer.k_theta"] == pytest.approx(3e5)
    errors = by_name(read.tolerances["short"])
    assert errors["joints.joint.mass"] == {"joint.mass": pytest.approx(2e-3)}
    assert errors["joints.joint.outer.k_y"] == {"joint.outer.k_y": pytest.approx(1e8)}


def test_unknown_applies_to_held_out_assembly(tmp_path: Path) -> None:
    """No measurement to identify from has the second joint; the held-out assembly is predicted with it."""
    edits = (
        ("[joints.joint]\n", '[joints.joint]\n\n[joints.second]\nk_y = "1e9 N/m"\nk_theta = "1e5 N m/rad"\n'),
        (
            '[assemblies.long]\nchain = ["tool", "joint", "holder"]',
            '[assemblies.long]\nchain = ["tool", "second", "holder"]',
        ),
        ('upper = "1e10 N/m" }', 'upper = "1e10 N/m", also = { "second.k_y" = 1.0 } }'),
        ('upper = "1e7 N m/rad" }', 'upper = "1e7 N m/rad", also = { "second.k_theta" = 2.0 } }'),
    )
    read = load(tmp_path, changed(*edits))
    found = read.identify()
    assert any("no observation's assembly has second.k_theta; it affects predictions" in n for n in found.notes)
    predicted = read.predict(found)
    held_out = next(one for one in predicted.frequencies if one.name == "long")
    applied = found.at(read.assemblies["long"], tolerances=read.tolerances["long"]).assembly
    assert applied.get("second.k_theta") == pytest.approx(2.0 * found.values["joint.k_theta"])
    expected = applied.natural_frequencies(2e4)[:2]
    np.testing.assert_allclose(held_out.predicted_hz, expected, rtol=1e-6)


def test_levels_of_measurements(tmp_path: Path) -> None:
    edits = (("[measurements.long]\n", '[measurements.long]\nlevel = "40 N"\n'), ('role = "hold out"\n', ""))
    text = text_of(MICROSLIP, THETA + SLIP, ("[measurements.short]\n", "[measurements.short]\nlevel = 0.5\n"), *edits)
    true = {"joint.k_theta": 6e4, "joint.slip_theta": 0.15}
    read, values = fit_to(tmp_path, text, true)
    assert isinstance(read.assemblies["short"].elements["joint"], MicroslipJoint)
    levels = {name: one.assembly.get("joint.level") for name, one in read.measurements.items()}
    assert levels == {"short": 0.5, "long": 2.0}
    assert values == pytest.approx(true, rel=1e-3)


def test_a_stepped_sine(tmp_path: Path) -> None:
    """FRFs at two forces identify slip; a third is predicted, and an unmeasured assembly."""
    data = "".join(
        f'[measurements.sine{i}]\nkind = "frf"\nassembly = "short"\nfile = "sine{i}.csv"\nforce = "{force} N"\n'
        f'standard_deviation = "1 %"\n{role}'
        for i, (force, role) in enumerate(((0.2, ""), (1.0, ""), (0.5, 'role = "hold out"\n')))
    )
    text = text_of(MICROSLIP, THETA + SLIP, ("[settings]", '[prediction]\nforce = "0.5 N"\n[settings]'))
    a, b = text.index("[measurements.short]"), text.index("[prediction]")
    text = text[:a] + data + text[b:]
    true = {"joint.k_theta": 6e4, "joint.slip_theta": 0.15}
    joint = MicroslipJoint(k_y=4e8, k_theta=6e4, slip_theta=0.15, reference_theta=20e-6, loss_factor=0.02, name="joint")
    lines = np.linspace(1000.0, 3500.0, 120)
    for i in range(3):
        (tmp_path / f"sine{i}.csv").write_text("")
    shape = campaign.read.measured_structures(text)["sine0"][0]
    assembly = type(shape)([joint if name == "joint" else of for name, of in shape.elements.items()])
    rng = np.random.default_rng(3)
    for i, force in enumerate((0.2, 1.0, 0.5)):
        noise = 0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
        values = assembly.receptance(lines, force=force) * np.exp(noise)
        io.write(tmp_path / f"sine{i}.csv", FRF(frequency_hz=lines, values=values))
    read = load_campaign(tmp_path, text)
    assert read.measurements["sine1"].force == pytest.approx(np.ones(lines.size))
    found = read.identify()
    assert found.rms == pytest.approx(1.0, abs=0.1)
    for name, value in true.items():
        low, high = found.interval(name, 0.999)
        assert low <= value <= high
    predicted = read.predict(found)
    held_out = next(frf for frf in predicted.frfs if frf.name == "sine2")
    difference = np.log(held_out.receptance / held_out.measured)
    assert np.sqrt(np.mean(np.abs(difference) ** 2) / 2.0) < 0.015
    other = next(frf for frf in predicted.frfs if frf.name == "long")
    again = found.at(read.assemblies["long"], tolerances=read.tolerances["long"]).assembly
    np.testing.assert_allclose(other.receptance, again.receptance(other.frequency_hz, force=0.5), rtol=1e-9)
    found.plot(), predicted.plot()


SHORT = "[measurements.short]\n"
STIFF = SPREAD + 'k_y = "5e8 N/m"\n'
INNER = '"joint.inner.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }\n'
LEVEL = '"joint.level" = { lower = 0.1, upper = 1.0 }\n'
WITHOUT = MICROSLIP.replace('reference_force = "20 N"\n', "")


@pytest.mark.parametrize(
    ("joint", "unknowns", "old", "new", "words"),
    [
        (STIFF, THETA, '"spread"', '"spred"', 'joints.joint: has the kind "spred", expected one of "point", "spread"'),
        (
            STIFF,
            THETA,
            'material = "carbide" }\nsleeve',
            'material = "carbid" }\nsleeve',
            'joints.joint.shank.material: is "carbid", which is not a material',
        ),
        (STIFF, THETA, "joint.k_theta", "joint.shank.k_theta", '"joint.shank.k_theta": is a parameter of no assembly'),
        (MICROSLIP, THETA, "_theta = 0.2", "_theta = -0.2", "joints.joint.slip_theta: is -0.2, expected zero or more"),
        (
            MICROSLIP,
            THETA,
            "_theta = 0.2",
            "_theta = 0.2\nlevel = 3.0",
            "joints.joint: the level 3 reduces k_theta by a share of 0.6",
        ),
        (
            MICROSLIP,
            THETA,
            SHORT,
            SHORT + 'level = "5 mm"\n',
            'measurements.short.level: is "5 mm", a length, expected a force',
        ),
        (
            WITHOUT,
            THETA,
            SHORT,
            SHORT + 'level = "5 N"\n',
            'short.level: is the force "5 N", but the joint "joint" has no `reference_force`',
        ),
        (
            MICROSLIP,
            THETA + LEVEL,
            SHORT,
            SHORT + "level = 1\n",
            "short.level: is given and joint.level is among the unknowns",
        ),
        (
            COLLET,
            INNER,
            SHORT,
            SHORT + "level = 1\n",
            'short.level: is given, but no joint of the assembly is of the kind "micro-slip"',
        ),
    ],
)
def test_one_mistake(joint: str, unknowns: str, old: str, new: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(campaign.CampaignError) as caught:
        load_campaign(tmp_path, text_of(joint, unknowns, (old, new)))
    assert words in str(caught.value)
    assert all(problem.line is not None for problem in caught.value.problems)


def test_joint_without_kind_is_a_point_joint(tmp_path: Path) -> None:
    unknowns = '"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }\n' + THETA
    for joint in ("[joints.joint]\n", '[joints.joint]\nkind = "point"\n'):
        assert isinstance(
            load_campaign(tmp_path, text_of(joint, unknowns)).assemblies["short"].elements["joint"], PointJoint
        )
