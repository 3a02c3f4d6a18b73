"""Mistakes in a campaign file: all at once, each with its key, its line, the value and the expected one."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from campaign_text import TEXT, changed, load, write
from command_line import call
from receptance import campaign
from receptance.campaign import CampaignError


def mistakes(folder: Path, text: str) -> CampaignError:
    with pytest.raises(CampaignError) as error:
        load(folder, text)
    return error.value


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('title = "A', 'titel = "A', 'titel: is not a known key; did you mean "title"?'),
        ('length = "60 mm"', "", "parts.tool.segments[0].length: is missing"),
        (
            'length = "60 mm"',
            'length = "-60 mm"',
            'parts.tool.segments[0].length: is "-60 mm", expected more than zero',
        ),
        (
            'length = "60 mm"',
            "length = 60",
            "parts.tool.segments[0].length: is 60, expected a length as text with a unit",
        ),
        ('inner_diameter = "12 mm"', 'inner_diameter = "60 mm"', "parts.holder.segments[0]: inner_diameter is 0.06 m"),
        ('core = "carbide"', 'core = "carbid"', 'parts.holder.segments[0].core: is "carbid", which is not a material'),
        ("[joints.joint]", "[joints.tool]", "joints.tool: is also the name of one of the parts"),
        ("[joints.joint]", '[joints."a b"]', 'joints."a b": is "a b", expected one word'),
        (
            '"tool.segment[0].length" = "90 mm"',
            '"tool.segment[3].length" = "90 mm"',
            "is no parameter of this assembly",
        ),
        ('"tool.segment[0].length" = "90 mm"', '"joint.k_y" = "1e8 N/m"', "is set here and is among the unknowns"),
        ('kind = "natural frequencies"\nassembly = "short"', 'assembly = "short"', "measurements.short: has no `kind`"),
        ('assembly = "short"', 'assembly = "shrt"', 'measurements.short.assembly: is "shrt", which is not an assembly'),
        ('role = "hold out"', 'role = "holdout"', '(did you mean "hold out"?)'),
        ('frequencies = ["2500 Hz", "10000 Hz"]', 'file = "f.csv"', 'file: is "f.csv", which does not exist'),
        ('frequencies = ["2500 Hz", "10000 Hz"]', "", "measurements.short: has neither frequencies nor a file"),
        ('["2500 Hz", "10000 Hz"]', '["2500 Hz", "1000 Hz"]', "frequency_hz is not ascending"),
        (
            'standard_deviation = "2 Hz"',
            'standard_deviation = ["2 Hz"]',
            "is a list of 1, expected one for all or 2",
        ),
        ('standard_deviation = "2 Hz"', "modes = [1, 2, 3]", "there are 3 modes for 2 frequencies"),
        ('"joint.k_y" = {', '"joint.k_z" = {', 'unknowns."joint.k_z": names an unknown quantity "k_z"'),
        ('"joint.k_y" = {', '"jiont.k_y" = {', 'begins with "jiont", which is not a part, joint, attachment or sensor'),
        ('lower = "1e7 N/m"', 'lower = "1e11 N/m"', 'unknowns."joint.k_y": lower is 1e+11 and upper 1e+10'),
        (
            "[joints.joint]",
            '[joints.joint]\nk_y = "1e6 N/m"',
            'unknowns."joint.k_y": has bounds that exclude the value 1e+06',
        ),
        (
            '"joint.k_y" = {',
            '"tool.segment[*].length" = { lower = "1 mm", upper = "1 m" }\n"joint.k_y" = {',
            "unknowns",
        ),
        ('title = "A', 'materials = 3\ntitle = "A', "Cannot"),
    ],
)
def test_one_mistake(old: str, new: str, words: str, tmp_path: Path) -> None:
    text = changed((old, new))
    error = mistakes(tmp_path, text)
    assert words in str(error)
    if new and "is missing" not in words:
        for problem in error.problems:
            assert problem.line is not None
            assert 1 <= problem.line <= text.count("\n")


def test_all_mistakes_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = changed(
        ('length = "60 mm"', 'length = "60 mn"'),
        ('material = "carbide"\ntolerance = { length', 'material = "carbyde"\ntolerance = { length'),
        ('chain = ["tool", "joint", "holder"]\nconditions', 'chain = ["tool", "jiont", "holder"]\nconditions'),
        ('role = "hold out"', 'role = "holdout"\nfile = "missing.csv"'),
        ('upper = "1e7 N m/rad" }', "uper = 3 }"),
    )
    error = mistakes(tmp_path, text)
    assert [campaign.problems.path_text(problem.path) for problem in error.problems] == [
        "parts.tool.segments[0].length",
        "parts.tool.segments[0].material",
        "assemblies.short.chain[1]",
        "measurements.long.role",
        "measurements.long.file",
        'unknowns."joint.k_theta".uper',
    ]
    lines = text.splitlines()
    for problem, piece in zip(
        error.problems, ["60 mn", "carbyde", "jiont", "holdout", "missing.csv", "uper"], strict=True
    ):
        assert problem.line is not None
        assert piece in lines[problem.line - 1]
    first, *rest = str(error).splitlines()
    assert first == f"{tmp_path / 'campaign.toml'} has 6 mistakes:"
    assert len(rest) == 6
    assert all(line.startswith("  line ") for line in rest)


def test_each_mistake_is_reported_once(tmp_path: Path) -> None:
    """Errors caused by another mistake are not reported: a broken material is not an unknown material."""
    error = mistakes(tmp_path, changed(('youngs_modulus = "580 GPa"', 'youngs_modulus = "580"')))
    assert [problem.path for problem in error.problems] == [("materials", "carbide", "youngs_modulus")]
    error = mistakes(tmp_path, changed(('lower = "1e7 N/m"', 'lower = "1e7"')))
    assert [problem.path for problem in error.problems] == [("unknowns", "joint.k_y", "lower")]
    error = mistakes(tmp_path, TEXT.replace("[parts.", "[part.").replace("[[parts.", "[[part."))
    assert [problem.path for problem in error.problems] == [("part",)]


def test_data_identified_together_need_comparable_weights(tmp_path: Path) -> None:
    extra = (
        '[measurements.more]\nkind = "natural frequencies"\nassembly = "short"\nfrequencies = ["2500 Hz"]\n[unknowns]'
    )
    error = mistakes(tmp_path, changed(("[unknowns]", extra)))
    assert "measurements.more: has no standard deviation, but other measurements have one" in str(error)


def test_tolerances_of_an_assembly(tmp_path: Path) -> None:
    base = 'conditions = { torque = "135 N m" }'
    for written, words in (
        ('{ "tool.segment[0].length" = "3 N" }', "a force, expected a standard deviation"),
        ('{ "tool.segment[1].length" = "1 %" }', "is no parameter of this assembly"),
        ('{ "joint.k_y" = "1 %" }', "has a tolerance and is among the unknowns"),
        ('{ "tool" = "1 %" }', "is not an address"),
    ):
        error = mistakes(tmp_path, changed((base, f"tolerance = {written}")))
        assert words in str(error)
        assert len(error.problems) == 1


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"# a comment\n", "no tables in the file, expected a campaign; `receptance new DIR FILES` writes one"),
        (b"a = [\n", "is not TOML"),
        (b"a = 1\na = 2\n", "line 2: is not TOML: Cannot overwrite a value"),
        (b"a = \xff\n", "byte 4 is not UTF-8"),
        (b"\x00\x01\x02", "is not TOML"),
        (b"materials = 3\n", "materials: is 3, expected a table"),
        (b"[[materials]]\n", "materials: is a list of 1, expected a table"),
        (b"[materials]\ncarbide = 3\n", "materials.carbide: is 3, expected a table"),
    ],
)
def test_files_other_than_campaigns(content: bytes, words: str, tmp_path: Path) -> None:
    file = tmp_path / "odd.toml"
    file.write_bytes(content)
    with pytest.raises(CampaignError) as error:
        campaign.load(file)
    assert words in str(error.value)


def test_byte_order_mark_is_accepted(tmp_path: Path) -> None:
    file = tmp_path / "campaign.toml"
    file.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n").encode())
    assert len(campaign.load(file).assemblies) == 3


def test_no_file(tmp_path: Path) -> None:
    write(tmp_path)
    with pytest.raises(
        FileNotFoundError, match=r"there is no campaign file .*campain\.toml; did you mean .*campaign\.toml"
    ):
        campaign.load(tmp_path / "campain.toml")
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileNotFoundError, match=r"there is no campaign\.toml in the folder"):
        campaign.load(tmp_path / "empty")


def test_the_error_pickles(tmp_path: Path) -> None:
    error = mistakes(tmp_path, changed(('length = "60 mm"', 'length = "60"')))
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert again.problems == error.problems


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("mode,frequency [Hz]\n1,2500\n2,10000\n", None),
        ("# remark\n\nfrequency [kHz], standard_deviation [Hz]\n2.5,2\n10,3\n", None),
        ("frequency_hz\n2500\n", None),
        ("", "the file is empty"),
        ("frequency\n2500\n", 'column "frequency" has no unit'),
        ("frequency [mm]\n2500\n", 'column "frequency [mm]" is in "mm", a length'),
        ("frequency [Hz],frequency [kHz]\n2500,2.5\n", "occurs twice"),
        ("frequency [Hz]\n2500,3\n", "line 2: has 2 cells, expected 1"),
        ("mode,frequency [Hz]\none,2500\n", 'line 2, mode: is "one"'),
        ("mode\n1\n", 'there is no column "frequency"'),
        (
            'frequency [Hz]\n"' + "1" * 140_000 + '"\n',
            "line 2: cannot be split into cells: field larger",
        ),
    ],
)
def test_tables_of_frequencies(table: str, words: str | None, tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text(table)
    text = changed(
        ('frequencies = ["2500 Hz", "10000 Hz"]', 'file = "f.csv"'),
        ('standard_deviation = "2 Hz"\n', ""),
        ('standard_deviation = ["1 Hz", "0.1 %"]\n', ""),
    )
    if words is None:
        assert load(tmp_path, text).measurements["short"].frequency_hz[0] == 2500.0
        return
    error = mistakes(tmp_path, text)
    assert words in str(error)
    assert error.problems[0].path == ("measurements", "short", "file")


_DEEP = 900 * "[" + 900 * "]"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'torque = "135 N m"',
            "overhang = inf",
            "assemblies.short.conditions.overhang: is inf, expected a finite number",
        ),
        ('length = "60 mm"', 'length = "60 N m/dB"', 'is "60 N m/dB", with the unknown unit "dB"'),
        ("[unknowns]", "[[unknowns]]", "unknowns: is a list of 1, expected a table"),
        ('torque = "135 N m"', f"torque = {_DEEP}", "tables and lists are nested more than 20 deep"),
        ("= 0.22", f"= {400 * '1'}", "materials.carbide.poisson_ratio: is a whole number beyond the 64 bits"),
        ("= 0.22", f"= {5000 * '1'}", "the file cannot be read: Exceeds the limit"),
    ],
    ids=lambda text: text[:20],
)
def test_former_internal_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, words: str
) -> None:
    write(tmp_path, changed((old, new)))
    assert call("identify", str(tmp_path)) == 2
    assert words in capsys.readouterr().err


def test_zero_tolerance_is_accepted(tmp_path: Path) -> None:
    """A zero tolerance is accepted and equals no tolerance."""
    settings = "\n[settings]\nstarts = 1\nprofiles = false\n"
    ends = []
    for old, new in (
        ('length = "0.05 mm", ', ""),
        ('length = "0.05 mm"', 'length = "0 mm"'),
        ('length = "0.05 mm"', 'length = "0 %"'),
    ):
        found = load(tmp_path, changed((old, new)) + settings)
        fit = found.identify()
        ends.append([*fit.interval("joint.k_theta"), *found.predict(fit).frequencies[0].scatter.total])
        assert "parts.tool.segments[0].length" not in fit.errors
    assert ends[1] == pytest.approx(ends[0])
    assert ends[2] == pytest.approx(ends[0])


def test_a_mistake_in_the_tip_of_a_cut(tmp_path: Path) -> None:
    """The tip across the feed is a table or a word; a mistake in the table is reported at its key, once."""
    cut = '\n[cuts.one]\nkind = "milling"\nteeth = 2\nk_t = "800 MPa"\nk_n = "300 MPa"\nx = { assembly = "short" }\n'
    for written, words in (
        ('{ measurment = "short" }', 'cuts.one.y.measurment: is not a known key; did you mean "measurement"?'),
        ("{ measurement = 3 }", "cuts.one.y.measurement: is 3, expected text in quotes"),
        ('{ measurement = "shrt" }', 'cuts.one.y.measurement: is "shrt", which is not a measurement of this file'),
        ('"as z"', 'cuts.one.y: is "as z", expected a table, "as x" or "rigid"'),
    ):
        error = mistakes(tmp_path, f"{TEXT}{cut}y = {written}\n")
        assert words in str(error)
        assert len(error.problems) == 1


def test_the_force_channel_of_hammer_records_is_not_the_amplitude_of_a_sine(tmp_path: Path) -> None:
    old = 'kind = "natural frequencies"\nassembly = "short"\nfrequencies = ["2500 Hz", "10000 Hz"]\n'
    joint = ("[joints.joint]", '[joints.joint]\nkind = "micro-slip"')
    for kind, expected in (
        ('"hammer records"\nforce = "hammer"\nmotion = "tip"', ["file"]),
        ('"frf"\nforce = "5 N"', ["file", "level"]),
    ):
        new = f'kind = {kind}\nassembly = "short"\nfile = "short.csv"\nlevel = 2\n'
        error = mistakes(tmp_path, changed((f'{old}standard_deviation = "2 Hz"\n', new), joint))
        assert [problem.path for problem in error.problems] == [("measurements", "short", key) for key in expected]
