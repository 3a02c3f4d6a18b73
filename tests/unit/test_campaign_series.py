"""Campaigns over levels: one table for all levels, parameters over them, and interpolation."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from receptance import FRF, STEEL, Part, Segment, campaign, io
from receptance.cli.app import app
from receptance.coupling import Holder

HOLDER = Holder(
    part=Part(
        [Segment(length=x, outer_diameter=d, material=STEEL) for x, d in ((0.08, 0.08), (0.1, 0.055))], name="holder"
    ),
    big_end=0.08,
    small_end=0.18,
)
LEVELS = (0, 2, 5, 10, 15, 20, 22, 25)
NOISE = 0.01
TEXT = f"""\
title = "A holder over drawbar force"

[materials.steel]
youngs_modulus = "{STEEL.youngs_modulus / 1e9:g} GPa"
density = "{STEEL.density:g} kg/m^3"
poisson_ratio = {STEEL.poisson_ratio}

[parts.holder]
segments = [
  {{ length = "80 mm", outer_diameter = "80 mm", material = "steel" }},
  {{ length = "100 mm", outer_diameter = "55 mm", material = "steel" }},
]

[attachments.taper]
kind = "ground"
position = "80 mm"
length = "100 mm"
points = 12

[series]
over = "drawbar force"
levels = ["0 kN", "2 kN", "5 kN", "10 kN", "15 kN", "20 kN", "22 kN", "25 kN"]
hold_out = ["15 kN"]

[assemblies."axial {{level}}"]
chain = ["holder"]
attachments = ["taper"]
motion = "axial"

[measurements."axial {{level}}"]
kind = "frf"
assembly = "axial {{level}}"
file = "axial_{{value}}.csv"
standard_deviation = "1 %"

[unknowns]
"taper.k_y" = {{ lower = "1e8 N/m", upper = "1e11 N/m", free = true }}
"taper.c_y" = {{ lower = "10 N s/m", upper = "1e5 N s/m", free = true }}
"""


def stiffness(force: float) -> float:
    return 5e9 * (1.0 + 0.2 * (force / 25.0) ** 1.6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("series")
    rng = np.random.default_rng(6)
    lines = np.arange(2500.0, 6500.0, 40.0)
    for force in LEVELS:
        h = HOLDER.axial(stiffness(force), 1500.0).receptance(lines)
        h *= np.exp(NOISE * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size)))
        io.write(made / f"axial_{force}.csv", FRF(frequency_hz=lines, values=h, form="receptance"))
    (made / "campaign.toml").write_text(TEXT)
    return made


def changed(folder: Path, tmp_path: Path, *pairs: tuple[str, str]) -> Path:
    text = TEXT
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    for file in folder.glob("*.csv"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "campaign.toml").write_text(text)
    return tmp_path


def test_table_for_all_levels_equals_one_per_level(folder: Path) -> None:
    read = campaign.load(folder)
    assert list(read.measurements) == [f"axial {force} kN" for force in LEVELS]
    assert read.templates["axial 5 kN"] == "axial {level}"
    assert list(read.held_out) == ["axial 15 kN"]
    assert read.site("axial 22 kN").conditions["drawbar force"] == 22e3
    own = read.assemblies["axial 0 kN"]
    assert own.motion == "axial"
    lines = np.array([3000.0, 5000.0])
    values = {"taper.k_y": 5e9, "taper.c_y": 1500.0}
    np.testing.assert_allclose(
        own.replace(values).receptance(lines), HOLDER.axial(5e9, 1500.0).receptance(lines), rtol=1e-9
    )


def test_parameters_over_levels_and_held_out_data(folder: Path) -> None:
    found = campaign.load(folder).identify()
    series = found.series["taper.k_y"]
    assert series.force.tolist() == [0.0, 2.0, 5.0, 10.0, 20.0, 22.0, 25.0]
    np.testing.assert_allclose(
        series.values, [stiffness(f) for f in series.force], atol=4.0 * series.standard_errors.max()
    )
    assert series.law.name == "power"
    low, high = series.exponent_interval
    assert low < 1.6 < high
    assert found.series["taper.c_y"].trend().direction == "not determined"
    stored = json.loads(json.dumps(found.to_dict(), allow_nan=False))["series"]
    assert stored["over"] == "drawbar force"
    assert stored["unit"] == "kN"
    assert stored["parameters"]["taper.k_y"]["slope_trend"]["direction"] == "rises"
    prediction = campaign.load(folder).predict(found)
    # On a straight line from 10 to 20 kN the stiffness is 0.4 % too large, and a peak of noisy lines is no better.
    assert 0.02 < max(map(abs, prediction.errors_percent)) < 0.5
    figure = found.plot()
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["taper.k_y", "taper.c_y"]


def test_command_prints_values_trends_and_residuals(folder: Path, tmp_path: Path) -> None:
    ran = CliRunner().invoke(app, ["identify", str(folder), "--json", str(tmp_path / "found.json")])
    assert ran.exit_code == 0, ran.output
    for text in ("taper over drawbar force", "axial {level}", "best law K0 + a F^n", "by group"):
        assert text in ran.output
    assert json.loads((tmp_path / "found.json").read_text())["series"]["parameters"]["taper.c_y"]["law"]


def test_a_rigid_part_is_the_rigid_body(folder: Path, tmp_path: Path) -> None:
    read = campaign.load(changed(folder, tmp_path, ("[parts.holder]", "[parts.holder]\nrigid = true")))
    own = read.assemblies["axial 0 kN"].replace({"taper.k_y": 5e9, "taper.c_y": 0.0})
    expected = np.sqrt(5e9 / HOLDER.body.mass) / (2.0 * np.pi)
    np.testing.assert_allclose(own.natural_frequencies(1e4), [expected], rtol=1e-6)


@pytest.mark.parametrize(
    ("pairs", "expected"),
    [
        ((("over =", "ovr ="),), ['series.ovr: is not a known key; did you mean "over"?']),
        (
            (("[series]", "[serie]"),),
            ["has {level} in its name, but the file has no `series`", 'did you mean "series"?'],
        ),
        (
            (('hold_out = ["15 kN"]', 'hold_out = ["16 kN"]'),),
            ['hold_out[0]: is "16 kN", which is not one of the levels'],
        ),
        ((('"2 kN", "5 kN"', '"2 kN", "2 kN"'),), ["series.levels[2]", "for the second time"]),
        ((('"2 kN", "5 kN"', '"2 mm", "5 kN"'),), ['levels[1]: is "2 mm" after "0 kN"', "the same quantity"]),
        ((('motion = "axial"', 'motion = "sideways"'),), ['assemblies."axial {level}".motion', '"sideways"']),
        (
            (('"axial_{value}.csv"', '"radial_{value}.csv"'),),
            ['is "radial_0.csv", which does not exist', "radial_25.csv"],
        ),
        ((("free = true }", 'along = "drawbar force" }'),), ["is given without `free`"]),
        ((("points = 12", "weights = [1, -1]"),), ["attachments.taper.weights[1]"]),
        ((('length = "100 mm"\npoints', 'length = "200 mm"\npoints'),), ['assemblies."axial {level}".attachments']),
        (
            (('standard_deviation = "1 %"', 'standard_deviation = "1 %"\nresponse = { direction = "+theta" }'),),
            ["axial motion has no rotation"],
        ),
    ],
)
def test_mistakes_are_reported_once_with_position(
    folder: Path, tmp_path: Path, pairs: tuple[tuple[str, str], ...], expected: list[str]
) -> None:
    with pytest.raises(campaign.CampaignError) as error:
        campaign.load(changed(folder, tmp_path, *pairs))
    text = str(error.value)
    for words in expected:
        assert words in text
    lines = text.splitlines()[1:]
    assert len(lines) == len(set(lines))
    if "radial" not in text:
        assert len(error.value.problems) <= 3
    assert all(problem.line for problem in error.value.problems)


def test_no_trends_with_few_levels(folder: Path, tmp_path: Path) -> None:
    few = [(f', "{force} kN"', "") for force in (10, 15, 20, 22, 25)]
    found = campaign.load(changed(folder, tmp_path, *few, ('hold_out = ["15 kN"]', "hold_out = []"))).identify()
    assert not found.series
    assert any("at least 6 different levels" in note for note in found.notes)


def test_level_outside_the_measured_range_is_an_error(folder: Path, tmp_path: Path) -> None:
    read = campaign.load(changed(folder, tmp_path, ('hold_out = ["15 kN"]', 'hold_out = ["25 kN"]')))
    with pytest.raises(campaign.CampaignError, match="from 0 to 22000"):
        read.predict()


def test_transfer_skips_the_outermost_levels(folder: Path, tmp_path: Path) -> None:
    """Each level from its neighbours; the outermost two have a neighbour on one side only, and a note says so."""
    written = tmp_path / "t.json"
    done = CliRunner().invoke(app, ["transfer", str(folder), "--json", str(written)])
    assert done.exit_code == 0, done.output
    found = json.loads(written.read_text())
    frfs = {one["name"] for split in found["splits"] for one in split["frfs"]}
    assert frfs == {f"axial {force} kN" for force in LEVELS[1:-1]}
    reasons = [reason for split in found["splits"] for reason in split["not_predicted"]]
    assert len(reasons) == 2
    for force in (LEVELS[0], LEVELS[-1]):
        (reason,) = (one for one in reasons if one.startswith(f"axial {force} kN: "))
        assert reason in " ".join(done.output.split())


def test_held_out_level_outside_the_range_is_skipped(folder: Path, tmp_path: Path) -> None:
    own = changed(folder, tmp_path, ('hold_out = ["15 kN"]', 'hold_out = ["15 kN", "25 kN"]'))
    done = CliRunner().invoke(app, ["predict", str(own), "--json", str(tmp_path / "p.json")])
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "p.json").read_text())
    assert [one["name"] for one in found["frfs"]] == ["axial 15 kN"]
    assert list(found["not_predicted"]) == ["axial 25 kN"]
    assert "not predicted: axial 25 kN cannot be predicted: taper.k_y is known for" in " ".join(done.output.split())
    assert CliRunner().invoke(app, ["predict", str(own), "--at-most", "100"]).exit_code == 3
