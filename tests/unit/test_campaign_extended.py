"""The extended model as a campaign file: identified and predicted as it is, with the same values and misfit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from as_if_found import as_if_found, fit_at_start
from campaign_text import TEXT, load
from plain_residuals import truncated
from receptance import FRF, campaign, examples
from receptance.diagnosis import CATALOGUE, Cause, Variant
from receptance.diagnosis.explanation import Explanation
from receptance.diagnosis.model import Model
from receptance.diagnosis.truncation import ALL_RECORDS
from receptance.fit.observation import altered
from receptance.fit.unknowns import Law, Move
from receptance.io import read_frf, write

LINES = np.linspace(300.0, 6000.0, 400)
JOINT = {"joint.k_y": 5e8, "joint.k_theta": 1e5, "joint.c_y": 200.0, "joint.c_theta": 0.5}
HEAD = TEXT.partition("[measurements.short]")[0]
OTHER = '[assemblies.other]\nchain = ["tool", "joint", "holder"]\nset = { "tool.segment[0].length" = "75 mm" }\n'
MEASURED = """
[measurements.{name}]
kind = "frf"
assembly = "{name}"
role = "{role}"
file = "data/{name}.csv"
standard_deviation = "1 %"
conditions = {{ force = "{force} N", plane = {plane} }}
{more}
"""
UNKNOWNS = """
[unknowns]
"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m", start = "5e8 N/m" }
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad", start = "1e5 N m/rad" }
"joint.c_y" = { lower = "1 N s/m", upper = "1e5 N s/m", start = "200 N s/m" }
"joint.c_theta" = { lower = "1e-3 N m s/rad", upper = "1e2 N m s/rad", start = "0.5 N m s/rad" }
"""
SERIES = """
[series]
over = "torque"
levels = ["40 N m", "50 N m", "60 N m"]
hold_out = ["50 N m"]

[assemblies."at {level}"]
chain = ["tool", "joint", "holder"]

[measurements."at {level}"]
kind = "frf"
assembly = "at {level}"
file = "data/{value}.csv"
standard_deviation = "1 %"

[unknowns]
"""


def write_campaign(folder: Path, more: str = "", **changes: float) -> campaign.Campaign:
    """FRFs of three overhangs with 1 % of noise; the last one is held out, a fourth was not measured."""
    head = HEAD + OTHER
    plain = load(folder, f"{head}{UNKNOWNS}")
    (folder / "data").mkdir(exist_ok=True)
    rng = np.random.default_rng(8)
    for name, assembly in plain.assemblies.items():
        values = assembly.replace({**JOINT, **changes}).receptance(LINES)
        noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        write(folder / "data" / f"{name}.csv", FRF(frequency_hz=LINES, values=values * np.exp(noise)))
    rows = (("short", "identify", 20, 1), ("long", "identify", 40, 2), ("longest", "hold out", 20, 1))
    measured = "".join(
        MEASURED.format(name=name, role=role, force=force, plane=plane, more=more) for name, role, force, plane in rows
    )
    return load(folder, f"{head}{measured}{UNKNOWNS}")


UNDECIDABLE = {"flexible_body", "contact_distribution", "spindle_mode", "coarse_resolution", "exchanged_files"}
"""Causes that require something absent from the small campaign, such as a rigid body, or hits at the same places."""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> campaign.Campaign:
    return write_campaign(tmp_path_factory.mktemp("small"))


@pytest.mark.parametrize("part", [slice(1), pytest.param(slice(1, 3), marks=pytest.mark.slow)], ids=["first", "others"])
@pytest.mark.parametrize("cause", sorted(set(CATALOGUE) - UNDECIDABLE))
# These data have the right sign, so the file that turns it is warned of.
@pytest.mark.filterwarnings("ignore:.*the phase of minus receptance")
def test_every_cause_can_be_written(small: campaign.Campaign, cause: str, part: slice) -> None:
    """`write_extended` reads its text before writing, and refuses a model that differs from the diagnosed one."""
    model, _ = small.base_model()
    for variant, _ in CATALOGUE[cause].extensions(model)[part]:
        read, verdict = as_if_found(small, (cause, variant.name))
        if cause == "hammer_offset" and "configuration" in variant.name:
            # The step that moves with the hits would be in the tool of one assembly alone.
            with pytest.raises(ValueError, match="cannot"):
                campaign.write_extended(read, verdict, small.file.with_name("extended.toml"))
            continue
        path = campaign.write_extended(read, verdict, small.file.with_name("extended.toml"))
        again = campaign.load(path)
        assert set(again.measurements) == {"short", "long", "longest"}
        if CATALOGUE[cause].group == "measurement":
            assert not any(name.startswith("cause_") for name in again.assemblies["other"].attachments)


def test_exchanged_files_are_named_and_exchanged(tmp_path: Path) -> None:
    examples.write("free-free", tmp_path)
    file = tmp_path / "campaign.toml"
    text = file.read_text(encoding="utf-8")
    short, medium = 'file = "short.csv"', 'file = "medium.csv"'
    file.write_text(text.replace(short, "?").replace(medium, short).replace("?", medium), encoding="utf-8")
    read = campaign.load(file)
    verdict = read.diagnose(causes=["exchanged_files", "overhang_error", "calibration_gain", "joint_overhang_law"])
    assert (verdict.verdict, [cause.id for cause in verdict.causes]) == ("named", ["exchanged_files"])
    assert verdict.causes[0].variant == "short and medium"
    again = campaign.load(campaign.write_extended(read, verdict, file.with_name("extended.toml")))
    files = {name: again.contents["measurements"][name]["file"] for name in again.measurements}
    assert files == {"short": "short.csv", "medium": "medium.csv", "long": "long.csv"}
    assert again.diagnose(causes=["exchanged_files", "calibration_gain"]).verdict == "adequate"


def test_a_frequency_scale_acts_in_measured_assemblies_only(small: campaign.Campaign) -> None:
    read, verdict = as_if_found(small, ("frequency_scale", "in accelerations"))
    again = campaign.load(campaign.write_extended(read, verdict, small.file.with_name("extended.toml")))
    scale = again.unknowns[-1]
    assert scale.name == "frequency_scale.log_scale"
    assert scale.configurations == tuple({one.configuration: None for one in again.measurements.values()})
    assert "other" in again.assemblies
    assert "other" not in scale.configurations


def test_spread_joint_with_positions_on_the_holder(tmp_path: Path) -> None:
    """Responses and masses behind the contact are written where they are on the holder that has become shorter."""
    read = write_campaign(tmp_path, 'response = { part = "holder", position = "100 mm" }')
    chain = 'chain = ["tool", "joint", "holder"]'
    text = read.file.read_text().replace(chain, f'{chain}\nattachments = ["screw"]')
    screw = '[attachments.screw]\nkind = "mass"\npart = "holder"\nposition = "60 mm"\nmass = "20 g"\n'
    kept = load(tmp_path, text.replace("[unknowns]", f"{screw}\n[unknowns]"))
    read, verdict = as_if_found(kept, ("joint_spread", "layer"))
    again = campaign.load(campaign.write_extended(read, verdict, tmp_path / "extended.toml"))
    assembly = again.assemblies["other"]
    assert [one.length for one in assembly.elements["holder"].segments] == pytest.approx([0.0399, 0.02, 0.04, 0.03])
    assert assembly.attachments["screw"].position == pytest.approx(0.0599)
    measured_data = again.measurements["longest"]
    assert (measured_data.response.part, measured_data.response.position) == ("holder", pytest.approx(0.0999))


def cut_off(folder: Path) -> campaign.Campaign:
    """The same records on the lines of an analyser, cut off 71 ms after each hit."""
    read = write_campaign(folder)
    lines = np.arange(24, 480) / 0.08
    for name, assembly in read.assemblies.items():
        true = assembly.replace(JOINT)
        measured_data = truncated(lambda f, true=true: true.receptance(f)[:, None], lines, 0.071, 0.1)[:, 0]
        write(folder / "data" / f"{name}.csv", FRF(frequency_hz=lines, values=measured_data))
    return campaign.load(folder / "campaign.toml")


def test_truncated_records_report_their_end(tmp_path: Path) -> None:
    read = cut_off(tmp_path)
    read, verdict = as_if_found(read, ("coarse_resolution", "records end too early"))
    again = campaign.load(campaign.write_extended(read, verdict, tmp_path / "extended.toml"))
    ends = {one.ends for one in again.measurements.values()}
    assert len(ends) == 1
    assert ends.pop() == pytest.approx(0.071, abs=2e-3)
    assert again.unknowns[-1].address == "observation.end"


@pytest.mark.slow
def test_held_out_records_have_their_own_end(tmp_path: Path) -> None:
    """The held-out record is complete; the others are cut off."""
    read = cut_off(tmp_path)
    lines = np.arange(24, 480) / 0.08
    values = read.assemblies["longest"].replace(JOINT).receptance(lines)
    write(tmp_path / "data" / "longest.csv", FRF(frequency_hz=lines, values=values))
    verdict = campaign.load(read.file).diagnose(["coarse_resolution", "exponential_window"])
    assert [one.id for one in verdict.causes] == ["coarse_resolution"]
    assert verdict.selection.base.model.ends[ALL_RECORDS] == pytest.approx(0.071, abs=2e-3)
    assert "longest" not in verdict.held_out.ends
    assert verdict.gains[0].held_out_after < 0.02


def test_every_level_of_a_series_is_written_out(tmp_path: Path) -> None:
    unknowns = write_campaign(tmp_path).file.read_text().partition("[unknowns]")[2]
    for value in (40, 50, 60):
        frf = read_frf(tmp_path / "data" / "short.csv")
        write(tmp_path / "data" / f"{value}.csv", frf.with_(values=(1.0 + 1e-6 * value) * frf.values))
    read = load(tmp_path, HEAD + SERIES + unknowns.replace('"joint.k_y" = {', '"joint.k_y" = { free = true,'))
    read, verdict = as_if_found(read, ("tool_density", "all of the tool"))
    again = campaign.load(campaign.write_extended(read, verdict, tmp_path / "e.toml"))
    assert list(again.measurements) == ["at 40 N m", "at 50 N m", "at 60 N m"]
    assert list(again.held_out) == ["at 50 N m"]
    assert [one.along for one in again.unknowns if isinstance(one, Law)] == ["torque"]
    assert again.unknowns[-1].name == "tool_density.log_density"


def test_coupling_term_follows_the_clampings_in_the_file(tmp_path: Path) -> None:
    text = write_campaign(tmp_path).file.read_text().replace('"joint.k_y" = {', '"joint.k_y" = { individual = "5 %",')
    read, verdict = as_if_found(load(tmp_path, text), ("joint_cross_term", "stiffness"))
    again = campaign.load(campaign.write_extended(read, verdict, tmp_path / "extended.toml"))
    assert [dict(one.follows) for one in again.unknowns if isinstance(one, Law)] == [{"joint.k_ytheta": 0.5}]


def test_causes_together_sensors_and_flutes_and_hits(tmp_path: Path) -> None:
    sensed = write_campaign(tmp_path, 'sensor = "accelerometer"')
    causes = [("sensor_mass", "all"), ("fluted_part", "from the tip"), ("calibration_gain", "configuration short")]
    read, verdict = as_if_found(sensed, *causes)
    again = campaign.load(campaign.write_extended(read, verdict, tmp_path / "extended.toml"))
    observed = again.measurements["longest"].assembly
    assert set(observed.attachments) == {"accelerometer"}
    (mass,) = [one for one in again.unknowns if one.name == "sensor_mass.mass"]
    assert isinstance(mass, Move)
    assert (dict(mass.moves), mass.lower) == ({"accelerometer.mass": 1.0}, -observed.get("accelerometer.mass"))
    assert len(again.assemblies["other"].elements["tool"].segments) == 2
    # The error of the diameter is one error for all segments of the blank.
    (error,) = [one for one in again.tolerances["other"] if one.name.endswith("outer_diameter") and "tool" in one.name]
    assert set(error.moves) == {"tool.segment[0].outer_diameter", "tool.segment[1].outer_diameter"}


def test_causes_without_campaign_syntax_are_refused(tmp_path: Path) -> None:
    """The file of a custom cause is the diagnosed model, or no file is written."""

    def enlarge(model: Model) -> Model:
        return model.map(lambda one: altered(one, receptance=1.1 * one.receptance))

    def change(p: Any, model: Model) -> Any:
        yield Variant("all", enlarge)

    odd = Cause(id="odd", group="measurement", parameters=(), change=change, meaning="odd", remedy="none")
    read = write_campaign(tmp_path)
    read, verdict = as_if_found(read)
    ((variant, model),) = odd.extensions(verdict.explanation.fit.model)
    verdict.explanation = Explanation((variant,), fit_at_start(model), 100.0, 100.0)
    with pytest.raises(ValueError, match="a campaign file cannot describe"):
        campaign.write_extended(read, verdict, tmp_path / "extended.toml")
    assert not (tmp_path / "extended.toml").exists()


def test_diagnose_write_identify_predict(tmp_path: Path) -> None:
    """The round trip: the same values, the same misfit, and held-out data nearer than before."""
    read = write_campaign(tmp_path, **{"tool.segment[0].density": 1.06 * 14500.0})
    found = read.diagnose(["tool_density", "calibration_gain", "sensor_mass"])
    assert [one.id for one in found.causes] == ["tool_density"]
    (tmp_path / "elsewhere").mkdir()
    path = campaign.write_extended(read, found, tmp_path / "elsewhere" / "extended.toml")
    again = campaign.load(path)
    identified = again.identify()
    fit = found.explanation.fit
    assert set(identified.values) == set(fit.values)
    for name, value in fit.values.items():
        # Two ways to the optimum end within a hundredth of a standard error.
        assert abs(identified.values[name] - value) <= 0.01 * identified.standard_errors[name], name
    errors = [identified.values[name] for name in identified.errors]
    chi_square = sum(float(r @ r) for r in identified.residuals) + float(np.square(errors).sum())
    assert chi_square == pytest.approx(fit.chi_square, rel=1e-5)
    after, before = again.predict(identified), read.predict()
    assert after.rms_percent < 0.3 * before.rms_percent
    assert {one.name for one in after.frequencies} == {one.name for one in before.frequencies}


def test_without_an_extension_no_file_is_written(tmp_path: Path) -> None:
    read, verdict = as_if_found(write_campaign(tmp_path))
    verdict.explanation = None
    with pytest.raises(ValueError, match="no extended model"):
        campaign.extended_text(read, verdict, tmp_path)
