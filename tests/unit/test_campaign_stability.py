"""Cuts in campaign files: mistakes, lobes of measured and of predicted tips, and the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign_text import TEXT, changed, load, possible
from command_line import call
from receptance import FRF
from receptance.campaign import CampaignError
from receptance.campaign.prediction import predict_assembly
from receptance.campaign.stability import named_metrics
from receptance.io import write
from receptance.stability import Milling, TipModes, receptance_matrix, semi_discretised_limit, stability_lobes

TIP = TipModes(frequency_hz=[922.0, 1900.0], damping_ratio=[0.03, 0.02], shapes=[[5.0, 0.0], [4.0, 0.0]])
LINES = np.arange(200.0, 3000.0, 2.0)
MEASURED = """
[stability]
speeds = ["8000 rpm", "26000 rpm"]
step = "250 rpm"
draws = 40

[cuts.slot]
kind = "milling"
teeth = 2
k_t = "600 MPa"
k_n = "200 N/mm^2"
x = { file = "tip.csv", standard_deviation = "2 %" }
y = "rigid"
"""
PREDICTED = """
[prediction]
upper = "4 kHz"
step = "10 Hz"

[stability]
speeds = ["8000 rpm", "26000 rpm"]
step = "500 rpm"
draws = 40

[cuts.rough]
kind = "milling"
teeth = 3
radial_depth = 0.5
feed = "up"
k_t = "800 MPa"
k_n = "300 MPa"
x = { assembly = "longest" }

[cuts.boring]
kind = "turning"
k = "1.2 GPa"
angle = "20 deg"
tolerance = { k = "10 %" }
x = { assembly = "longest" }
"""
TURNED = '[cuts.b]\nkind = "turning"\nk = "1 GPa"\nangle = "90 deg"\nx = { file = "tip.csv" }\n'
_WIDE = 'teeth = 2\nradial_depth = "14 mm"\ndiameter = "12 mm"'
_OPEN = 'teeth = 2\npitch = ["170 deg", "180 deg"]'
_UNEVEN = 'teeth = 2\npitch = ["170 deg", "190 deg"]'
DAMPED = (("[joints.joint]", '[joints.joint]\nc_theta = "1 N m s/rad"\nloss_factor = 0.02'),)


def write_tip(folder: Path) -> None:
    values = TIP.receptance(LINES)[:, 0, 0]
    rows = [f"{f:g},{g.real:.9e},{g.imag:.9e}" for f, g in zip(LINES, values, strict=True)]
    head = "frequency [Hz],receptance real [m/N],receptance imaginary [m/N]"
    (folder / "tip.csv").write_text("\n".join([head, *rows]) + "\n")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("teeth = 2", "teeth = 0", "cuts.slot.teeth: is 0, expected at least 1"),
        ("teeth = 2", "", "cuts.slot.teeth: is missing"),
        ("teeth = 2", "teeth = 2\nradial_depth = 1.2", "radial_depth: is 1.2, expected more than zero and at most 1"),
        ("teeth = 2", 'teeth = 2\nradial_depth = "0 %"', 'is "0 %", expected more than zero and at most 1: a length'),
        ("teeth = 2", 'teeth = 2\nradial_depth = "6 mm"', "radial_depth: is 6 mm, but the cut has no diameter, exp"),
        ("teeth = 2", _WIDE, "radial_depth: is 14 mm, more than the diameter of the cutter, 12 mm, expected"),
        ("teeth = 2", 'teeth = 2\nradial_depth = "6 N"', 'radial_depth: is "6 N", a force, expected a length such as'),
        ("teeth = 2", 'teeth = 2\nfeed = "clim"', '"down", "up", "climb", "conventional" (did you mean "climb"?)'),
        ("teeth = 2", 'teeth = 2\npitch = ["90 deg"]', "cuts.slot.pitch: has 1 angle, expected 2, one for each"),
        ("teeth = 2", _OPEN, "cuts.slot.pitch: has the sum 350 deg, expected 360 deg"),
        ("teeth = 2", 'teeth = 2\npitch = ["180", "180"]', 'cuts.slot.pitch[0]: is "180", without a unit, expected a'),
        ("teeth = 2", 'teeth = 2\nhelix = "30 deg"', 'helix: is given without the diameter of the cutter, exp'),
        ("teeth = 2", 'teeth = 2\nhelix = "89 deg"', 'helix: is "89 deg", expected at least -75 and at most 75: a'),
        ("teeth = 2", _UNEVEN, 'pitch: differs between teeth, and so do the delays, for which the mean force has no'),
        ('"600 MPa"', '"600 Pa"', "less than 5e+07 N/m^2, expected a cutting coefficient"),
        ('"600 MPa"', '"600 GPa"', "600 MPa = 600 N/mm^2"),
        ('"200 N/mm^2"', '"200 kPa"', "cuts.slot.k_n: is"),
        ('"600 MPa"', '"600 N"', 'cuts.slot.k_t: is "600 N", a force, expected a cutting coefficient'),
        ('"rigid"', '"stiff"', 'cuts.slot.y: is "stiff", expected a table, "as x" or "rigid"'),
        ('"tip.csv"', '"tipp.csv"', 'cuts.slot.x.file: is "tipp.csv", which does not exist'),
        ('"2 %" }', '"2 %", bands = [["5 kHz", "6 kHz"]] }', "a usable line, expected one within 200 to 2998 Hz"),
        ('file = "tip.csv", ', "", "cuts.slot.x: has neither an assembly, a measurement nor a file"),
        ('"8000 rpm"', '"80000 rpm"', "stability.speeds: goes from 80000 to 26000 rpm, expected the lower speed first"),
        ("draws = 40", "draws = 40\nprobability = 0.99", "stability.draws: is 40, too few for a"),
        ('"250 rpm"', '"0.1 rpm"', "stability.step: is 0.1 rpm, which makes more than 20000 speeds"),
        ("[cuts.slot]", TURNED + "[cuts.slot]", "cuts.b: angle_deg is 90"),
    ],
)  # fmt: skip
def test_mistakes(tmp_path: Path, old: str, new: str, words: str) -> None:
    write_tip(tmp_path)
    assert MEASURED.count(old) == 1
    with pytest.raises(CampaignError) as error:
        load(tmp_path, MEASURED.replace(old, new))
    assert words in str(error.value)


def test_several_mistakes_and_missing_cuts(tmp_path: Path) -> None:
    write_tip(tmp_path)
    with pytest.raises(CampaignError) as error:
        load(tmp_path, MEASURED.replace("teeth = 2", "teeth = 0").replace('"600 MPa"', '"0 MPa"'))
    assert len(error.value.problems) == 2
    with pytest.raises(CampaignError, match="2 mistakes"):
        load(tmp_path, 'title = "nothing"\n')


def test_a_measured_tip_alone(tmp_path: Path) -> None:
    """A file is sufficient, and the limit is that of `stability_lobes`."""
    write_tip(tmp_path)
    found = load(tmp_path, MEASURED).stability()
    (one,) = found.values()
    expected = stability_lobes(
        Milling(teeth=2, k_t=6e8, k_n=2e8), LINES, TIP.receptance(LINES), speeds_rpm=np.arange(8e3, 26.1e3, 250.0)
    )
    np.testing.assert_allclose(one.depth, expected.depth, rtol=1e-6)
    assert one.draws is not None
    assert one.draws.shape == (40, 73)
    assert one.best_cuts[0].probability == 0.95
    assert found.identified is None
    exact = load(tmp_path, MEASURED.replace(', standard_deviation = "2 %"', "")).stability()["slot"]
    assert exact.probability is None
    assert [note.split(":")[0] for note in exact.notes] == [
        "measured, tip.csv",
        "there is no band, because errors of tip and coefficients are not known",
    ]


def test_the_tip_of_a_measurement_has_the_variance_of_its_file(tmp_path: Path) -> None:
    """The fit widens the standard deviations of correlated lines; the lobes draw such lines together instead."""
    alike = np.where(LINES < 1000.0, 9.0, 1.0)
    frf = FRF(frequency_hz=LINES, values=TIP.receptance(LINES)[:, 0, 0], log_variance=4e-4, correlated_lines=alike)
    write(tmp_path / "tip.npz", frf)
    measured = '[measurements.tip]\nkind = "frf"\nassembly = "short"\nfile = "tip.npz"\nquantity = "receptance"\n'
    cut = MEASURED.replace('{ file = "tip.csv", standard_deviation = "2 %" }', '{ measurement = "tip" }')
    read = load(tmp_path, changed(("[unknowns]", f"{measured}\n[unknowns]")) + cut)
    tip = read.cuts["slot"].x.frf
    assert tip is not None
    np.testing.assert_allclose(tip.log_variance, 4e-4)
    np.testing.assert_array_equal(tip.correlated_lines, alike)


def drifting(lines: np.ndarray, noise: float) -> np.ndarray:
    """Return the accelerance of a held tip with white noise of an accelerometer, in m/s^2/N."""
    random = np.random.default_rng(20261122)  # seed
    scatter = random.standard_normal((2, lines.size))
    return -((2.0 * np.pi * lines) ** 2) * TIP.receptance(lines)[:, 0, 0] + noise * (scatter[0] + 1j * scatter[1])


def test_accelerometer_noise_at_low_frequencies_is_noted_and_excluded(tmp_path: Path) -> None:
    lines = np.arange(5.0, 3000.0, 2.5)
    rows = [f"{f:g},{a.real:.9e},{a.imag:.9e}" for f, a in zip(lines, drifting(lines, 0.05), strict=True)]
    head = "frequency [Hz],accelerance real [m/s^2/N],accelerance imaginary [m/s^2/N]"
    (tmp_path / "tip.csv").write_text("\n".join([head, *rows]) + "\n")
    slow = MEASURED.replace('"8000 rpm"', '"1000 rpm"')
    (wrong,) = load(tmp_path, slow).stability().values()
    assert wrong.chatter_hz[np.argmin(wrong.depth)] < 50.0
    (output,) = [note for note in wrong.notes if "1/f^2" in note]
    assert output.startswith("measured, tip.csv: from 5 to ")
    advised = output.partition("leave them out, ")[2]
    assert advised.startswith("bands = [[")
    (right,) = load(tmp_path, slow.replace('"2 %" }', f'"2 %", {advised} }}')).stability().values()
    assert not [note for note in right.notes if "1/f^2" in note]
    expected = stability_lobes(
        Milling(teeth=2, k_t=6e8, k_n=2e8), LINES, TIP.receptance(LINES), speeds_rpm=np.arange(1e3, 26.1e3, 250.0)
    )
    assert right.depth.min() == pytest.approx(expected.depth.min(), rel=0.02)
    assert wrong.depth.min() < 0.75 * expected.depth.min()


def test_tips_without_lines_are_mistakes(tmp_path: Path) -> None:
    write_tip(tmp_path)
    narrow = MEASURED.replace('"2 %" }', '"2 %", bands = [["1 kHz", "1001 Hz"]] }')
    with pytest.raises(CampaignError, match=r"cuts\.slot: stability: x has 1 usable lines, expected at least 2"):
        load(tmp_path, narrow).stability()
    other = 'y = { file = "tip.csv", bands = [["2 kHz", "3 kHz"]] }'
    apart = MEASURED.replace('"2 %" }', '"2 %", bands = [["1 kHz", "1.5 kHz"]] }').replace('y = "rigid"', other)
    with pytest.raises(CampaignError, match=r"cuts\.slot: stability: y shares 0 lines with the other FRFs"):
        load(tmp_path, apart).stability()


def test_predicted_tips(tmp_path: Path) -> None:
    read = load(tmp_path, changed(*DAMPED, possible()) + PREDICTED)
    found = read.stability()
    rough, boring = found.values()
    assert found.identified is not None
    assert rough.draws is not None
    assert rough.lower is not None
    assert (rough.lower <= rough.depth).mean() > 0.9
    # The coefficient's spread is in the turning cut as well.
    for cut in (rough, boring):
        assert cut.certain_depth.min() < cut.depth.min()
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert [one["name"] for one in data["cuts"]] == ["rough", "boring"]
    assert data["cuts"][0]["tips"] == {"x": "predicted, longest", "y": "predicted, longest"}
    assert read.stability(found.identified, cuts=["boring"])["boring"].depth.tolist() == boring.depth.tolist()
    assert len(found.plot().axes) == 2


def test_a_predicted_tip_outside_of_its_lines(tmp_path: Path) -> None:
    narrow = PREDICTED.replace('upper = "4 kHz"', 'lower = "600 Hz"\nupper = "900 Hz"').partition("[cuts.boring]")[0]
    text, _ = [one for one in load(tmp_path, changed(*DAMPED) + narrow).stability().rejection if "rises to" in one]
    assert text.startswith("cuts.rough: the magnitude of the tip in x rises to the last of the lines, at 900 Hz")
    assert text.endswith("(`lower` and `upper` under [prediction])")


def test_draws_scatter_as_to_first_order(tmp_path: Path) -> None:
    """Sampled against linear: standard deviations of natural frequencies, and what two assemblies share."""
    known = ('"joint.k_y" = { lower = "1e7 N/m", upper = "1e10 N/m" }\n', "")
    one_mode = ('frequencies = ["2500 Hz", "10000 Hz"]', 'frequencies = ["2500 Hz"]')
    read = load(tmp_path, changed(known, one_mode, ("[joints.joint]", '[joints.joint]\nk_y = "5e8 N/m"')))
    identified = read.identify()
    drawn, predicted = {}, {}
    for name in ("long", "longest"):
        there = predict_assembly(read, identified, read.site(name), read.tolerances[name], name, [])
        linear = there.natural_frequencies(2e3).standard_error_hz
        predicted[name] = there
        drawn[name] = np.array(there.draw(lambda one: one.natural_frequencies(2e3)[0], 400, 1), dtype=np.float64)
        assert drawn[name].std() == pytest.approx(linear[0], rel=0.12)
    # The same joint, holder and material: only the error of the overhang differs.
    assert np.corrcoef(drawn["long"], drawn["longest"])[0, 1] > 0.3
    assert predicted["long"].assemblies(400, 1)[3] == predicted["long"].assemblies(400, 1)[3]


def test_semi_discretisation(tmp_path: Path) -> None:
    write_tip(tmp_path)
    text = MEASURED.replace(
        'step = "250 rpm"\ndraws = 40',
        'step = "6000 rpm"\ndraws = 20\nmethod = "semi-discretisation"\nlargest_depth = "20 mm"',
    )
    text = text.replace('"200 N/mm^2"', '"200 MPa"\nradial_depth = 0.1\ntolerance = { k_t = "10 %" }')
    (one,) = load(tmp_path, text).stability().values()
    mean = load(tmp_path, text.replace("semi-discretisation", "mean force")).stability()["slot"]
    assert one.draws is not None
    # Of the same order if the mean force predicts a limit, but not equal.
    finite = np.isfinite(one.depth) & np.isfinite(mean.depth)
    ratio = one.depth[finite] / mean.depth[finite]
    assert ((ratio > 0.3) & (ratio < 2.0)).all()
    assert np.abs(ratio - 1.0).max() > 0.01
    with pytest.raises(CampaignError, match="is turning, but"):
        load(tmp_path, text + '[cuts.t]\nkind = "turning"\nk = "1 GPa"\nx = { file = "tip.csv" }\n')


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    write_tip(tmp_path)
    Path("c.toml").write_text(MEASURED)
    assert call("stability", "c.toml", "--json", "s.json", "--plot", "s.png") == 0
    output = capsys.readouterr().out
    assert "slot: 2 teeth, slot; x: measured, tip.csv, y: rigid" in output
    assert "Recommended speeds" in output
    assert Path("s.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads(Path("s.json").read_text())["cuts"][0]["draws"] == 40
    assert call("stability", "c.toml", "--cut", "slit") == 2
    assert 'there is no cut "slit"' in capsys.readouterr().err
    assert call("stability", "c.toml", "--json", "tip.csv") == 2
    Path("c.toml").write_text(MEASURED.replace('speeds = ["8000 rpm", "26000 rpm"]', ""))
    assert call("stability", "c.toml") == 2
    assert "there are no spindle speeds" in capsys.readouterr().err
    Path("c.toml").write_text(TEXT)
    assert call("stability", "c.toml") == 2
    assert "there is no cut; write one, such as" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("form", "values", "words"),
    [
        (
            "receptance",
            TIP.receptance(LINES)[:, 0, 0].conj(),
            "of the complex conjugate of receptance .*conjugate = true",
        ),
        ("receptance", -TIP.receptance(LINES)[:, 0, 0], "of minus receptance .*reverse = true, --reverse"),
        ("accelerance", TIP.receptance(LINES)[:, 0, 0], 'or of receptance .*quantity = "receptance"'),
        (
            "receptance",
            -((2.0 * np.pi * LINES) ** 2) * TIP.receptance(LINES)[:, 0, 0],
            'or of accelerance .*quantity = "accelerance"',
        ),
        (
            "receptance",
            np.abs(TIP.receptance(LINES)[:, 0, 0]).astype(complex),
            "no passive structure has its phase at a drive point",
        ),
    ],
)
def test_a_tip_that_no_passive_structure_has_is_refused(tmp_path: Path, form: Any, values: Any, words: str) -> None:
    frf = FRF(frequency_hz=LINES, values=values, form=form)
    write(tmp_path / "tip.csv", frf)
    with pytest.raises(CampaignError, match=rf"cuts\.slot\.x: the FRF: a tip in a cut is a drive point, but .*{words}"):
        load(tmp_path, MEASURED)
    for directions in ((frf, None), (None, frf)):
        with pytest.raises(ValueError, match=rf"[xy]: a tip in a cut is a drive point, but .*{words}"):
            receptance_matrix(*directions)
    if form == "receptance":
        with pytest.raises(ValueError, match=rf"receptance\[:, 0, 0\]: a tip in a cut is a drive point, but .*{words}"):
            stability_lobes(Milling(teeth=2, k_t=6e8, k_n=2e8), LINES, values, speeds_rpm=[1e4])


@pytest.mark.parametrize("method", ["mean force", "semi-discretisation"])
@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (200.0, 800.0, "rises to the last of the lines, at 800 Hz"),
        (200.0, 936.0, "rises to the last of the lines, at 936 Hz"),
        (1000.0, 1700.0, "rises to the first of the lines, at 1000 Hz"),
    ],
)
def test_lines_that_do_not_contain_the_mode_give_no_limit(
    tmp_path: Path, low: float, high: float, words: str, method: str
) -> None:
    lines = np.arange(low, high + 1.0, 2.0)
    write(tmp_path / "tip.csv", FRF(frequency_hz=lines, values=TIP.receptance(lines)[:, 0, 0]))
    found = load(tmp_path, MEASURED.replace("draws = 40", f'draws = 40\nmethod = "{method}"')).stability()
    assert words in found.rejection.unusable[0]
    assert found.rejection.unusable[0].startswith("cuts.slot: ")
    assert found.rejection.unusable[0].endswith("frequencies (a wider measurement, or wider `bands`)")
    lobes = found["slot"]
    assert np.isnan(lobes.depth).all()
    assert lobes.best_cuts == ()
    assert lobes.draws is None
    assert "no limit is known" in found.summary()
    assert "stable" not in found.summary().replace("stability", "").replace("stable depth", "")
    assert found.to_dict()["cuts"][0]["always_stable"] is None
    assert words in found.plot().get_suptitle().replace("\n", " ")
    assert words in found.to_html()


def test_no_limit_of_any_cut_is_a_negative_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.chdir(tmp_path)
    write_tip(tmp_path)
    lines = np.arange(1200.0, 1501.0, 2.0)
    write("flank.csv", FRF(frequency_hz=lines, values=TIP.receptance(lines)[:, 0, 0]))
    Path("c.toml").write_text(MEASURED.replace("tip.csv", "flank.csv"))
    assert call("stability", "c.toml", "--json", "s.json") == 3
    assert "no limit is known" in capsys.readouterr().out
    assert json.loads(Path("s.json").read_text())["cuts"][0]["always_stable"] is None
    # With a limit of another cut there is an answer.
    cut = MEASURED[MEASURED.index("[cuts.slot]") :]
    Path("c.toml").write_text(MEASURED + cut.replace("[cuts.slot]", "[cuts.flank]").replace("tip.csv", "flank.csv"))
    assert call("stability", "c.toml") == 0


def two_directions(folder: Path) -> str:
    """Write tips that differ in x and y, and return a campaign with them."""
    write_tip(folder)
    across = TipModes(frequency_hz=[1050.0, 2000.0], damping_ratio=[0.03, 0.02], shapes=[[4.0, 0.0], [4.0, 0.0]])
    write(folder / "across.csv", FRF(frequency_hz=LINES, values=across.receptance(LINES)[:, 0, 0]))
    return MEASURED.replace("teeth = 2", "teeth = 2\nradial_depth = 0.4").replace('"rigid"', '{ file = "across.csv" }')


@pytest.mark.parametrize("method", ["mean force", "semi-discretisation"])
def test_a_tip_that_was_measured_at_an_angle_to_the_feed(tmp_path: Path, method: str) -> None:
    text = two_directions(tmp_path).replace("draws = 40", f'draws = 40\nmethod = "{method}"')
    text = text.replace('"250 rpm"', '"9000 rpm"').replace(', standard_deviation = "2 %"', "")
    exchanged = text.replace("tip.csv", "other.csv").replace("across.csv", "tip.csv").replace("other.csv", "across.csv")

    def limits(text: str, angle: str = "") -> np.ndarray:
        rotated = text.replace("teeth = 2", f'teeth = 2\nrotation = "{angle}"') if angle else text
        return load(tmp_path, rotated).stability()["slot"].depth

    plain = limits(text)
    np.testing.assert_array_equal(limits(text, "0 deg"), plain)
    np.testing.assert_allclose(limits(text, "90 deg"), limits(exchanged), rtol=1e-6)
    between = limits(text, "30 deg")
    assert np.abs(between / plain - 1.0).max() > 0.05
    np.testing.assert_allclose(limits(text, "210 deg"), between, rtol=1e-6)
    np.testing.assert_allclose(limits(exchanged, "-60 deg"), between, rtol=1e-6)


def test_the_rotation_is_in_the_output(tmp_path: Path) -> None:
    text = two_directions(tmp_path).replace("teeth = 2", 'teeth = 2\nrotation = "30 deg"')
    found = load(tmp_path, text).stability()
    assert found["slot"].tips["x"] == "measured, tip.csv, 30 deg from the feed"
    same = text.replace('{ file = "across.csv" }', '"as x"')
    assert 'cuts.slot.rotation: has no effect with y = "as x"' in load(tmp_path, same).notes[0]


def test_radial_depths_and_words_of_the_workshop(tmp_path: Path) -> None:
    """A length, a percentage and a number are one share; climb is down, conventional is up."""
    write_tip(tmp_path)
    cuts = [
        load(tmp_path, MEASURED.replace("teeth = 2", f"teeth = 2\n{keys}")).cuts["slot"]
        for keys in (
            'radial_depth = "3 mm"\ndiameter = "12 mm"\nfeed = "climb"',
            'radial_depth = "25 %"\nfeed = "down"\ndiameter = "12 mm"',
            'radial_depth = 0.25\nfeed = "conventional"\ndiameter = "12 mm"',
        )
    ]
    assert cuts[0].cut == cuts[1].cut
    assert [cut.cut.feed for cut in cuts if isinstance(cut.cut, Milling)] == ["down", "down", "up"]
    # In a catalogue a length refers to the diameter of each tool.
    other = [cut.with_tool(3, 0.006).cut for cut in cuts]
    assert [(cut.teeth, cut.immersion) for cut in other if isinstance(cut, Milling)] == [(3, 0.5), (3, 0.25), (3, 0.25)]


def test_unequal_teeth_in_a_campaign(tmp_path: Path) -> None:
    write_tip(tmp_path)
    text = MEASURED.replace(
        'step = "250 rpm"\ndraws = 40',
        'step = "9000 rpm"\ndraws = 20\nmethod = "semi-discretisation"\nlargest_depth = "20 mm"',
    )
    cutter = 'pitch = ["165 deg", "195 deg"]\nhelix = ["30 deg", "33 deg"]\ndiameter = "12 mm"'
    text = text.replace("teeth = 2", f"teeth = 2\nradial_depth = 0.5\n{cutter}").replace(
        ', standard_deviation = "2 %"', ""
    )
    campaign = load(tmp_path, text)
    found = campaign.stability()["slot"]
    assert found.title_of_cut().startswith("slot: 2 teeth, pitch 165, 195 deg, helix 30, 33 deg, down-milling")
    cut = Milling(
        teeth=2,
        k_t=6e8,
        k_n=2e8,
        immersion=0.5,
        diameter=0.012,
        pitch_deg=(165.0, 195.0),
        helix_deg=(30.0, 33.0),
    )
    expected = semi_discretised_limit(cut, TIP, speeds_rpm=found.speeds_rpm, most=0.02)
    np.testing.assert_allclose(found.depth, expected, rtol=2e-3)
    assert json.loads(json.dumps(found.to_dict()))["cut"]["pitch_deg"] == [165.0, 195.0]
    with pytest.raises(
        CampaignError, match=r"the metric stable_depth uses the mean force: cuts\.slot: helix_deg differs"
    ):
        named_metrics(campaign, ["stable_depth"])
