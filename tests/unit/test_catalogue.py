"""Catalogues: rows and their mistakes, assemblies, predictions against draws and a measured spindle, the command."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign_text import by_name
from command_line import call
from machine_with_catalogue import HOLDERS, TEXT, TOOLS, TRUE_K_THETA, load
from receptance import Assembly, MeasuredPart, Part, damped_modes
from receptance.campaign import CampaignError
from receptance.campaign.measurements import read_frequencies
from receptance.campaign.prediction import predict_assembly
from receptance.catalogue import Catalogue, predict_catalogue, read_holders, read_tools
from receptance.catalogue.building import ToolAssembly
from receptance.catalogue.figure import draw_outlines
from receptance.catalogue.results import CatalogueSummary, ToolSummary
from receptance.coupling import read_spindle, write_spindle
from receptance.fit.line_modes import line_modes
from receptance.io import read_frf

SEED = 20261121


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return load(tmp_path_factory.mktemp("machine"))


@pytest.fixture(scope="module")
def identified(machine: Any) -> Any:
    return machine.identify()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("T1,er32", "T1,er23", 'line 2, holder: is "er23", which is not known, expected one of'),
        ("T2,shrink", "T1,shrink", 'line 3, name: is "T1", as in line 2, expected another name'),
        ("80,12,40", "-80,12,40", 'line 3, overhang: is "-80 mm", expected more than zero'),
        ("80,12,40", "80,12,90", 'line 3, "flute length": is 90 mm, expected at most the overhang, 80 mm'),
        ("12,40,80,4", "12,40,,4", 'line 3, "effective diameter": is empty, but the tool has flutes'),
        ("12,40,80,4", "12,40,80,0", 'line 3, teeth: is "0", expected a whole number from 1 to 1000'),
        ("12,40,80,4,80", "12,40,80,4", "line 3: has 8 cells, expected 9"),
        ("overhang [mm]", "overhang", 'has no unit, expected one such as "overhang [mm]"'),
        ("overhang [mm]", "overhnag [mm]", 'there is no column "overhang"'),
        ("T2,shrink", '"' + "T" * 140_000 + '",shrink', "line 3: cannot be split into cells: field larger than field"),
        (
            "teeth,torque [N m]",
            "bore [mm],teeth",
            "line 3, bore: is 40 mm, expected less than the effective diameter, 9.6 mm",
        ),
    ],
)
def test_mistakes_of_tools(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert TOOLS.count(old) == 1
    text = TOOLS.replace(old, new).replace("40,80,4,80", "40,80,40,80") if "bore" in new else TOOLS.replace(old, new)
    with pytest.raises(CampaignError) as error:
        Catalogue(load(tmp_path, tools=text))
    assert words in str(error.value)


def test_a_given_error_replaces_that_of_the_campaign(machine: Any) -> None:
    plain = Catalogue(machine)
    stated = plain.assemble(plain.tools[0]).tolerances
    wider = replace(stated[0], moves={address: 2.0 * size for address, size in stated[0].moves.items()})
    found = Catalogue(machine, errors=[wider]).assemble(plain.tools[0]).tolerances
    assert [one.name for one in found] == [one.name for one in stated]
    assert found[0] == wider


def test_several_mistakes_come_together(tmp_path: Path) -> None:
    text = TOOLS.replace("T1,er32", "T1,er23").replace("T3,er32", "T3,er33")
    with pytest.raises(CampaignError, match="2 mistakes"):
        Catalogue(load(tmp_path, tools=text))
    with pytest.raises(CampaignError, match='line 2, material: is "stel"'):
        Catalogue(load(tmp_path, holders=HOLDERS.replace("12,steel", "12,stel")))
    with pytest.raises(CampaignError, match='is "taper", which is also a part or a joint'):
        Catalogue(load(tmp_path, holders=HOLDERS.replace("shrink", "taper")))
    for text in ("", " \n"):
        with pytest.raises(
            CampaignError, match=r"file is empty, expected a first line such as name,holder,material,over"
        ):
            Catalogue(load(tmp_path, tools=text))
    with pytest.raises(CampaignError) as error:
        Catalogue(load(tmp_path, tools=HOLDERS))
    assert 'there is no column "name", "overhang", "diameter", expected a first line such as ' in str(error.value)
    assert 'but it is "holder,length [mm],' in str(error.value)

    with pytest.raises(CampaignError, match="none of the 2 columns is one of these: ") as error:
        Catalogue(load(tmp_path, tools="S3CRET,S3CRET\n"))
    assert "S3CRET" not in str(error.value)
    with pytest.raises(CampaignError, match="there is no row below the header"):
        Catalogue(load(tmp_path, tools=TOOLS.splitlines()[0]))
    with pytest.raises(CampaignError, match=r'catalogue\.machine\[0\]: is "tapr", which is not a part or a joint'):
        load(tmp_path, text=TEXT.replace('machine = ["taper"', 'machine = ["tapr"'))
    with pytest.raises(CampaignError, match="there is no \\[catalogue\\]"):
        Catalogue(load(tmp_path, text=TEXT.split("[catalogue]")[0]))


def test_mistakes_of_both_files_come_together(tmp_path: Path) -> None:
    """Also those of a row with a cell that cannot be read, and of the other columns where a head is wrong."""
    tools = """\
name,holder,material,overhang [mm],diameter [mm],bore [mm],flute length,effective diameter [%]
T1,er23,carbid,sixty,12,13,30,80
T1,shrink,carbide,80,12,,90,80
T3,er32,carbide,-100
T4,shrink,carbide,80,-12,30,40,80
"""
    holders = HOLDERS.replace("45,32,12,steel,carbide", "45,32,40,stel,carbide").replace("50,40,20", "x,40,20")
    with pytest.raises(CampaignError) as error:
        Catalogue(load(tmp_path, tools=tools, holders=holders))
    text = str(error.value)
    expected = (
        'holders.csv, line 2, "inner diameter": is 40 mm, expected less than the outer diameter, 32 mm',
        'holders.csv, line 2, material: is "stel", which is not a material of the campaign',
        'holders.csv, line 3, length: is "x mm"',
        'tools.csv, line 1: column "flute length" has no unit',
        'tools.csv, line 2, overhang: is "sixty mm"',
        "tools.csv, line 2, bore: is 13 mm, expected less than the effective diameter, 9.6 mm",
        'tools.csv, line 2, holder: is "er23", which is not known',
        'tools.csv, line 2, material: is "carbid", which is not known',
        'tools.csv, line 3, name: is "T1", as in line 2',
        "tools.csv, line 4: has 4 cells, expected 8",
        'tools.csv, line 5, diameter: is "-12 mm"',
    )
    for words in expected:
        assert words in text, text
    # No mistake is told that is only a consequence of another one.
    assert f"have {len(expected)} mistakes:" in text, text


def test_rows_of_python_have_the_checks_of_a_file(tmp_path: Path) -> None:
    machine = load(tmp_path)
    tools = [replace(tool, line=0) for tool in Catalogue(machine).tools]
    assert len(Catalogue(machine, tools)) == len(tools)
    tools[0] = replace(tools[0], holder="er23", bore=0.02)
    with pytest.raises(CampaignError) as error:
        Catalogue(machine, tools)
    assert 'T1.holder: is "er23"' in str(error.value)
    assert "T1.bore: is 20 mm" in str(error.value)


def notes_on_shanks(machine: Catalogue) -> list[str]:
    return [note for note in machine.notes if "diameter: the shank" in note]


def test_a_shank_that_is_not_the_core_of_the_holder_is_told(tmp_path: Path) -> None:
    """The tools with 12 mm fit the cores of 12 mm; T3 with 10 mm does not, and 12.05 mm do within 1 %."""
    (note,) = notes_on_shanks(Catalogue(load(tmp_path)))
    for words in ("tools.csv, line 6, ", "the shank has 10 mm", "holder er32 12 mm", "inner diameter 10 mm"):
        assert words in note
    assert notes_on_shanks(Catalogue(load(tmp_path, tools=TOOLS.replace("100,10,", "100,12.05,")))) == []
    with pytest.raises(CampaignError, match="line 3, diameter: is 33 mm, but the nose of the holder shrink is 32 mm"):
        Catalogue(load(tmp_path, tools=TOOLS.replace("80,12,40", "80,33,40")))


def test_a_shank_that_fits_an_empty_bore_is_told(tmp_path: Path) -> None:
    """The bore of another diameter may be that of a tool that is described without its shank."""
    tools = TOOLS.replace("100,10,", "100,12,")
    (note,) = notes_on_shanks(
        Catalogue(load(tmp_path, tools=tools, holders=HOLDERS.replace("steel,carbide", "steel,")))
    )
    for words in ("tools.csv, line 3, ", "of 12 mm fits the bore of 12 mm", "holder shrink", 'core = "carbide"'):
        assert words in note
    wider = HOLDERS.replace("12,steel,carbide", "16,steel,")
    assert notes_on_shanks(Catalogue(load(tmp_path, tools=tools, holders=wider))) == []


def test_a_table_as_a_spreadsheet_writes_it(tmp_path: Path) -> None:
    """Semicolons, decimal commas and a byte order mark give the same table."""
    plain = tmp_path / "plain.csv"
    plain.write_text(TOOLS.replace(",60,", ",60.5,"))
    other = tmp_path / "other.csv"
    head, *rows = TOOLS.replace(",60,", ",60.5,").splitlines()
    text = "\n".join([head.replace(",", ";"), *(row.replace(",", ";").replace(".", ",") for row in rows)])
    other.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert read_tools(other) == read_tools(plain)
    one = read_tools(plain)[0]
    assert (one.overhang, one.effective_diameter, one.teeth) == (pytest.approx(0.0605), pytest.approx(0.0096), 4)
    assert one.conditions == {"torque": 80.0}
    holders = tmp_path / "holders.csv"
    holders.write_text(HOLDERS)
    assert [segment.outer_diameter for segment in read_holders(holders)["shrink"]] == [0.032, 0.04]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_no_table(tmp_path: Path) -> None:
    """Opening a pipe without a writer would block."""
    os.mkfifo(tmp_path / "pipe.csv")
    for read in (read_tools, read_holders, read_frequencies, read_spindle):
        with pytest.raises(OSError, match="it is a pipe or a device, expected a file"):
            read(tmp_path / "pipe.csv")


def test_assemblies_follow_the_rows(machine: Any) -> None:
    one, two, three = Catalogue(machine)
    assert isinstance(one, ToolAssembly)
    assert list(one.site.assembly.elements) == ["tool", "collet", "er32", "taper", "spindle"]
    tool = one.site.assembly.elements["tool"]
    assert isinstance(tool, Part)
    assert [s.outer_diameter for s in tool.segments] == [pytest.approx(0.0096), 0.012]
    assert [s.length for s in tool.segments] == [pytest.approx(0.03), pytest.approx(0.03)]
    assert list(two.site.assembly.elements)[2] == "shrink"
    assert len(three.site.assembly.elements["tool"].segments) == 1  # type: ignore[union-attr]
    # Errors of its dimensions, and of the material, which has the same name in the fit.
    errors = by_name(one.tolerances)
    assert errors["T1: overhang"] == {"tool.segment[1].length": pytest.approx(1e-4)}
    assert errors["T1: effective diameter"] == {"tool.segment[0].outer_diameter": pytest.approx(9.6e-5)}
    assert "materials.carbide.youngs_modulus" in set(errors) & set(by_name(machine.tolerances["short"]))
    assert errors["attachments.front.k_y"] == {"front.k_y": pytest.approx(1.25e7)}


def test_modes_are_those_of_the_model(machine: Any, identified: Any) -> None:
    """Peaks of 2000 lines against the complex modes: values and derivatives."""
    assert abs(identified.values["collet.k_theta"] / TRUE_K_THETA - 1.0) < 1e-3
    for one in predict_catalogue(Catalogue(replace(machine, threads=1)), identified):
        addresses = ["collet.k_theta", "collet.c_theta", "front.k_y", "tool.segment[0].length"]
        values, slopes = one.assembly.derivatives(one.tip.frequency_hz, addresses)
        modes = line_modes(one.tip.frequency_hz, values)
        exact = damped_modes(one.assembly, 5500.0, addresses)
        scale = np.array([one.assembly.get(address) for address in addresses])
        assert len(modes) >= 3
        for found, slope in zip(modes.values, modes.log_slopes(slopes), strict=True):
            if found[2] > 10.0 * modes.values[:, 2].min():
                continue  # a bump beside a resonance
            nearest = int(np.argmin(np.abs(exact.frequency_hz - found[0])))
            expected = [exact.frequency_hz[nearest], exact.damping_ratio[nearest], exact.dynamic_stiffness[nearest]]
            np.testing.assert_allclose(found[[0, 2]], [expected[0], expected[2]], rtol=2e-3)
            np.testing.assert_allclose(found[1], expected[1], rtol=0.02)
            np.testing.assert_allclose(slope * scale, exact.log_slopes[nearest] * scale, rtol=0.05, atol=0.02)


@pytest.mark.slow
def test_a_tool_without_a_peak_has_no_modes(identified: Any, tmp_path: Path) -> None:
    read = load(tmp_path, text=TEXT.replace('upper = "5 kHz"', 'upper = "80 Hz"'))
    for tool in predict_catalogue(Catalogue(read), identified):
        assert tool.modes.shape == tool.modes_deviation.shape == (0, 3)
        assert np.isfinite(tool.tip.scatter.total).all()


@pytest.mark.slow
def test_linear_intervals_against_draws(machine: Any, identified: Any) -> None:
    """Standard deviations of the modes against the complex modes of 150 draws of everything."""
    print(f"seed {SEED}")
    catalogue = Catalogue(machine)
    for one, tool in list(zip(predict_catalogue(catalogue, identified), catalogue, strict=True))[:2]:
        found = []
        there = predict_assembly(machine, identified, tool.site, tool.tolerances, tool.row.name, [])
        for assembly in there.assemblies(150, SEED):
            assert assembly is not None
            modes = damped_modes(assembly, 5200.0, threads=1)
            values = np.stack([modes.frequency_hz, modes.damping_ratio, modes.dynamic_stiffness], axis=1)
            found.append(np.log([values[np.argmin(np.abs(values[:, 0] - f))] for f in one.modes[:, 0]]))
        spread = np.std(found, axis=0)
        visible = one.modes[:, 2] < 10.0 * one.modes[:, 2].min()
        assert visible.sum() >= 3
        np.testing.assert_allclose(one.modes_deviation[visible], spread[visible], rtol=0.25)


def _as_table(own: Assembly, lines: Any, covariance: Any = None) -> MeasuredPart:
    """The spindle of an assembly as a table of receptances at its nose."""
    from receptance import Coordinate

    spindle = Assembly([own.elements["spindle"]], own.attachments.values())
    places = [Coordinate("spindle", 0.0, "y"), Coordinate("spindle", 0.0, "theta")]
    matrix = spindle.receptance(lines, response=places, excitation=places)
    return MeasuredPart(frequency_hz=lines, matrix=matrix, covariance=covariance, name="nose")


@pytest.mark.parametrize("name", ["T1", "HPMT-12345-R05", "CoroMill Plura 2P342-1200-PA 1730"])
def test_the_table_is_in_one_piece_at_80_columns(name: str) -> None:
    mode, interval = (
        np.array([12345.0, 0.0123, 5.4e6]),
        np.array([[12000.0, 12999.0], [0.0111, 0.0133], [5.1e6, 5.7e6]]),
    )
    tools = (
        ToolSummary(name, "HSK63A-ER32-100", 3, mode, interval, ()),
        ToolSummary(f"{name}-2", "er32", 0, None, None, ()),
    )
    lines = CatalogueSummary(tools=tools, level=0.95).summary(80).splitlines()
    assert max(map(len, lines)) <= 80
    assert sum(line.startswith(" tool ") for line in lines) == 1
    text = " ".join(lines)
    for number in ("12345", "12000 to 12999", "1.23", "1.11 to 1.33", "5.4", "5.1 to 5.7", "none"):
        assert number in text


def test_a_measured_spindle(machine: Any, identified: Any, tmp_path: Path) -> None:
    """The same tips as those of the modes; intervals include the variance of the lines, against noisy tables."""
    print(f"seed {SEED}")
    whole = next(predict_catalogue(Catalogue(machine), identified))
    lines = whole.tip.frequency_hz
    table = _as_table(machine.built.assemblies["short"], lines)
    share = 0.001 * np.abs(np.stack([table.matrix[:, 0, 0], table.matrix[:, 1, 1], table.matrix[:, 0, 1]], axis=1))
    covariance = np.einsum("ni,ij->nij", share**2, np.eye(3)).astype(complex)
    bare = TEXT.replace('machine = ["taper", "spindle"]\nattachments = ["front", "rear"]', 'machine = ["taper"]')
    text = bare.replace('tolerance = { overhang = "0.1 mm", diameter = "0.05 %", effective_diameter = "1 %" }', "")
    text = text.replace('tolerance = { youngs_modulus = "1 %", density = "0.5 %" }', "")
    text = text.replace('tolerance = { k_theta = "5 %", c_theta = "20 %" }', "")
    exact = load(tmp_path, text=text)
    noisy = _as_table(machine.built.assemblies["short"], lines, covariance)
    fit = exact.identify()
    one = next(predict_catalogue(Catalogue(exact, spindle=noisy), fit))
    np.testing.assert_allclose(one.tip.receptance, whole.tip.receptance, rtol=1e-3)
    # Modes from tables with this noise scatter as the intervals state, without the contribution of the fit.
    residuals = [f"nose.residual_{name}" for name in ("y", "theta", "ytheta")]
    slope = one.assembly.derivatives(lines, residuals)[1]
    variance = np.einsum("ni,nij,nj->n", slope, covariance, slope.conj()).real
    rng = np.random.default_rng(SEED)
    found = []
    for _ in range(100):
        real, imaginary = share * rng.standard_normal((2, lines.size, 3))
        error = real + 1j * imaginary
        matrix = table.matrix + np.stack([error[:, [0, 2]], error[:, [2, 1]]], axis=1)
        drawn = MeasuredPart(frequency_hz=lines, matrix=matrix, name="nose")
        values = Assembly([*list(one.assembly.elements.values())[:-1], drawn]).receptance(lines, threads=1)
        modes = line_modes(lines, values, variance).values
        found.append(np.log(modes[np.argmin(np.abs(modes[:, 0] - one.modes[0, 0]))]))
    spread = np.std(found, axis=0)
    alone = next(predict_catalogue(Catalogue(exact, spindle=_as_table(machine.built.assemblies["short"], lines)), fit))
    of_table = np.sqrt(one.modes_deviation[0] ** 2 - alone.modes_deviation[0] ** 2)
    np.testing.assert_allclose(of_table, spread, rtol=0.25)
    assert (one.tip.scatter.total > alone.tip.scatter.total).all()


def test_drift_in_a_spindle_table_is_noted(machine: Any, tmp_path: Path) -> None:
    lines = np.arange(50.0, 4000.0, 5.0)
    nose = _as_table(machine.built.assemblies["short"], lines)
    read = load(
        tmp_path,
        text=TEXT.replace('machine = ["taper", "spindle"]\nattachments = ["front", "rear"]', 'machine = ["taper"]'),
    )
    fit = read.identify()
    random = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    noise = abs(nose.matrix[0, 0, 0]) * (300.0 / lines) ** 2 * np.exp(2j * np.pi * random.random(lines.size))
    matrix = nose.matrix + noise[:, None, None] * np.diag([1.0, 0.0])
    drifting = MeasuredPart(frequency_hz=lines, matrix=matrix, name="nose")
    for spindle, expected in ((nose, False), (drifting, True)):
        one = next(predict_catalogue(Catalogue(read, spindle=spindle), fit))
        notes = [note for note in one.notes if "1/f^2" in note]
        assert bool(notes) == expected
    assert notes[0].startswith("nose: from ")
    assert 'under [prediction] lower = "' in notes[0]


def test_a_spindle_that_the_campaign_names(machine: Any, tmp_path: Path) -> None:
    """The file gives the same predictions as the object; mistakes are reported with the name of the file."""
    lines = np.linspace(100.0, 4000.0, 1000)
    covariance = np.einsum("n,ij->nij", np.full(1000, 1e-22), np.eye(3)).astype(complex)
    nose = _as_table(machine.built.assemblies["short"], lines, covariance)
    write_spindle(tmp_path / "nose.npz", nose)
    whole = 'machine = ["taper", "spindle"]\nattachments = ["front", "rear"]'
    spindles = '[spindles.nose]\nfile = "nose.npz"\n\n[catalogue]'
    text = TEXT.replace(whole, 'machine = ["taper"]\nspindle = "nose"').replace("[catalogue]", spindles)
    read = load(tmp_path, text=text)
    fit = read.identify()
    one = next(predict_catalogue(Catalogue(read), fit))
    other = next(predict_catalogue(Catalogue(read, spindle=nose), fit))
    np.testing.assert_array_equal(one.tip.receptance, other.tip.receptance)
    np.testing.assert_array_equal(one.modes_deviation, other.modes_deviation)
    # Behind the holder without a joint.
    bare = next(
        predict_catalogue(Catalogue(load(tmp_path, text=text.replace('machine = ["taper"]', "machine = []"))), fit)
    )
    assert list(bare.assembly.elements)[-2:] == ["er32", "nose"]
    with pytest.raises(ValueError, match=r"catalogue.machine: is empty, expected what is behind the holder"):
        load(tmp_path, text=text.replace('machine = ["taper"]\nspindle = "nose"', "machine = []"))
    with pytest.raises(
        ValueError, match=r'machine\[1\]: is "nose", a measured spindle; expected .* `spindle = "nose"`'
    ):
        load(tmp_path, text=text.replace('machine = ["taper"]', 'machine = ["taper", "nose"]'))
    (tmp_path / "nose.npz").write_bytes(b"PK nothing")
    with pytest.raises(ValueError, match=r"spindles.nose.file: .*nose.npz: this is not a complete NPZ file"):
        load(tmp_path, text=text)
    (tmp_path / "nose.npz").unlink()
    with pytest.raises(ValueError, match=r'spindles.nose.file: is "nose.npz", which does not exist'):
        load(tmp_path, text=text)


@pytest.mark.slow
def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    load(tmp_path)
    monkeypatch.chdir(tmp_path)
    Path("figures").mkdir()
    Path("frfs").mkdir()
    arguments = ["--out", "m.csv", "--json", "c.json", "--plot", "o.png", "--figures", "figures", "--frfs", "frfs"]
    assert call("catalogue", ".", *arguments) == 0
    output = capsys.readouterr().out
    assert "The most flexible mode of each tool" in output
    assert "3 tools in" in output
    rows = list(csv.DictReader(Path("m.csv").read_text().splitlines()))
    assert {row["name"] for row in rows} == {"T1", "T2", "T3"}
    first = rows[0]
    low, middle, high = (float(first[f"frequency{end} [Hz]"]) for end in (" lower", "", " upper"))
    assert low < middle < high
    best = [row for row in rows if row["most flexible"] == "yes"]
    assert len(best) == 3
    document = json.loads(Path("c.json").read_text())
    for tool, row in zip(document["tools"], best, strict=True):
        assert tool["name"] == row["name"]
        assert tool["modes"] == sum(one["name"] == tool["name"] for one in rows)
        stiffness = tool["most_flexible"]["dynamic_stiffness"]
        assert stiffness["value"] == pytest.approx(1e6 * float(row["dynamic stiffness [N/um]"]), rel=1e-5)
        assert stiffness["interval"][1] == pytest.approx(1e6 * float(row["dynamic stiffness upper [N/um]"]), rel=1e-5)
    assert {path.name for path in Path("figures").iterdir()} == {"T1.png", "T2.png", "T3.png"}
    assert Path("o.png").read_bytes().startswith(b"\x89PNG")
    assert call("catalogue", ".", "--depths", "d.csv", "--cut", "slot") == 0
    depths = list(csv.DictReader(Path("d.csv").read_text().splitlines()))
    assert {(row["name"], row["teeth"]) for row in depths} == {("T1", "4"), ("T2", "4"), ("T3", "2")}
    assert all(0.0 < float(row["stable depth [mm]"]) <= 1.05 * float(row["limit [mm]"]) for row in depths)
    for folder, words in (("m.csv", "m.csv is a file, expected a folder"), ("none", "there is no folder none")):
        assert call("catalogue", ".", "--frfs", folder) == 2
        assert words in capsys.readouterr().err
    assert call("catalogue", ".", "--depths", "e.csv") == 2
    assert "name it with --cut; there are roughing, slot" in capsys.readouterr().err
    Path("cut.toml").write_text(
        '[stability]\nspeeds = ["4000 rpm", "9000 rpm"]\nstep = "1000 rpm"\n[cuts.a]\n'
        'kind = "milling"\nteeth = 2\nk_t = "800 MPa"\nk_n = "300 MPa"\n'
        'tolerance = { k_t = "10 %" }\nx = { file = "frfs/T1.csv" }\n'
    )
    assert call("stability", "cut.toml", "--json", "s.json") == 0
    assert json.loads(Path("s.json").read_text())["cuts"][0]["draws"] == 200


@pytest.mark.slow
def test_every_tool_has_separate_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    """Invalid file names, names that differ only in replaced characters or case, and one that begins a formula."""
    names = [
        "a/b",
        "a\\b",
        "a_b",
        "T",
        "T.",
        "t",
        "=cmd|' /C calc'!A0",
        "../../up",
        "con",
        "a_b-2",
        "\u00e9",
        "e\u0301",
        "@x",
    ]
    head, row, *_ = TOOLS.splitlines()
    load(tmp_path, tools="\n".join([head, *(row.replace("T1", name) for name in names)]) + "\n")
    monkeypatch.chdir(tmp_path)
    Path("frfs").mkdir()
    assert call("catalogue", ".", "--out", "m.csv", "--frfs", "frfs") == 0
    assert "tools whose files have another name: a/b as a_b-3, " in capsys.readouterr().out
    written = sorted(path.name.casefold() for path in Path("frfs").iterdir())
    assert len(set(written)) == len(names)
    assert {read_frf(path).label for path in Path("frfs").iterdir()} == set(names)
    assert read_frf("frfs/a_b.csv").label == "a_b"
    assert read_frf("frfs/T.csv").label == "T"
    cells = {row["name"] for row in csv.DictReader(Path("m.csv").read_text().splitlines())}
    assert cells == {f"'{name}" if name[0] in "=@" else name for name in names}
    formulas = ["=1+2", "_1+2"]
    load(tmp_path, tools="\n".join([head, *(row.replace("T1", name) for name in formulas)]) + "\n")
    Path("figures").mkdir()
    arguments = ["--depths", "d.csv", "--cut", "slot", "--figures", "figures"]
    assert call("catalogue", ".", *arguments) == 0
    assert {path.name for path in Path("figures").iterdir()} == {"1+2.png", "1+2-2.png"}
    assert {row["name"] for row in csv.DictReader(Path("d.csv").read_text().splitlines())} == {"'=1+2", "_1+2"}


def test_no_partial_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    """An error in the middle of the catalogue leaves no new file and does not change an old one."""
    load(tmp_path, text=TEXT.replace('k_y = "6e8 N/m"', 'k_y = "6e8 N/m"\nk_ytheta = "2.9e7 N/rad"'))
    monkeypatch.chdir(tmp_path)
    Path("m.csv").write_text("old")
    from receptance.catalogue import prediction

    original = prediction.predict_assembly

    def fails(campaign: Any, identified: Any, site: Any, *rest: Any) -> Any:
        if site.configuration == "T3":
            raise ValueError("no such luck")
        return original(campaign, identified, site, *rest)

    monkeypatch.setattr(prediction, "predict_assembly", fails)
    assert call("catalogue", ".", "--out", "m.csv", "--overwrite") == 2
    assert "T3 cannot be predicted: no such luck" in capsys.readouterr().err
    assert Path("m.csv").read_text() == "old"
    assert not [path for path in tmp_path.iterdir() if path.name.endswith(".part")]
    for option in ("--out", "--json"):
        assert call("catalogue", ".", option, "tools.csv") == 2
        assert "which is a data file of the campaign" in capsys.readouterr().err


def test_outlines_of_tools_have_one_scale(machine: Any) -> None:
    # All are of one size in inches and over the same length and radius, the longest and the largest in a holder.
    catalogue = Catalogue(machine)
    figures = list(draw_outlines(catalogue))
    assert len(figures) == len(catalogue)
    places = [(figure, figure.axes[0]) for figure in figures]
    (limits,) = {(*axes.get_xlim(), *axes.get_ylim(), *figure.get_size_inches()) for figure, axes in places}
    for tool in catalogue:
        held = list(tool.site.assembly.elements)
        held = held[: held.index(tool.row.holder) + 1]
        length = sum(getattr(tool.site.assembly.elements[name], "length", 0.0) for name in held)
        assert 1e3 * length <= limits[1]
