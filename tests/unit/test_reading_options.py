"""Options that read files: the same in Python, in commands and in campaigns."""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np
import pytest

from command_line import call
from receptance import FRF, campaign, examples
from receptance._reading import campaign_keys, reading_options
from receptance.campaign import CampaignError
from receptance.campaign.schema import FRFTable, HammerTable, TipTable
from receptance.cli.files import convert, show
from receptance.cli.new import new
from receptance.io import TimeSeries, read, read_frf, write

pytestmark = pytest.mark.usefixtures("empty_folder")

LINES = np.arange(10.0, 2000.0, 10.0)
RIGHT = FRF(frequency_hz=LINES, values=1e-6 / (1.0 - (LINES / 800.0) ** 2 + 0.04j * LINES / 800.0))


@pytest.mark.parametrize("command", [show, convert, new])
def test_commands_have_all_options_of_read(command: object) -> None:
    parameters = inspect.signature(command).parameters  # type: ignore[arg-type]
    assert reading_options().keys() <= parameters.keys()


def test_campaigns_have_all_options_of_read() -> None:
    frf, records = campaign_keys(records=False), campaign_keys(records=True)
    assert frf.keys() | records.keys() == reading_options().keys()
    for table in (FRFTable, TipTable):
        assert set(frf.values()) <= table.declared.keys()
    assert set(records.values()) <= HammerTable.declared.keys()


def test_the_options_are_documented() -> None:
    assert all(name in (read.__doc__ or "") for name in reading_options())


@pytest.mark.parametrize("ending", ["uff", "csv", "npz", "mat", "h5", "frf"])
def test_conjugate_and_reversed_frfs(ending: str) -> None:
    file = f"tip.{ending}"
    write(file, RIGHT.with_(values=-RIGHT.values.conj()))
    found = read_frf(file, conjugate=True, reverse=True)
    assert np.allclose(found.values, RIGHT.values, rtol=1e-6)
    assert found.notes[-2:] == ("conjugated on request", "sign changed on request")
    assert np.allclose(read_frf(file, conjugate=True).values, -RIGHT.values, rtol=1e-6)


def test_a_drive_point_is_tested_after_its_conversion() -> None:
    tip = RIGHT.with_(responses="y", excitations="y")
    write("tip.npz", tip.with_(values=tip.values.conj(), responses=None, excitations=None))
    assert read_frf("tip.npz", conjugate=True).with_(responses="y", excitations="y").notes == ("conjugated on request",)


def test_time_records_have_no_conjugate() -> None:
    write("hit.npz", TimeSeries(values=[0.0, 1.0], channels=["f"], units=["N"], sample_rate_hz=1.0))
    with pytest.raises(ValueError, match="conjugate was given, but there is no FRF in the file"):
        read("hit.npz", conjugate=True)


def test_convert_and_show(capsys: pytest.CaptureFixture[str]) -> None:
    write("a.csv", RIGHT.conjugated())
    assert call("convert", "a.csv", "b.npz", "--conjugate") == 0
    assert np.array_equal(read_frf("b.npz").values, RIGHT.values)
    assert call("show", "a.csv", "--reverse", "--no-window") == 0
    assert "sign changed on request" in capsys.readouterr().out


def write_coherences() -> None:
    rows = "".join(f"{line:g},0.99\n" for line in LINES)
    Path("named.csv").write_text("f,C\n" + rows)
    Path("bare.csv").write_text(rows)
    np.savez("array.npz", lines=LINES, quality=np.full(LINES.size, 0.99))


COLUMNS = ["frequency [Hz]", "coherence"]


@pytest.mark.parametrize("file", ["named.csv", "bare.csv", "array.npz"])
def test_the_header_of_a_file_with_a_coherence(file: str) -> None:
    write("tip.npz", RIGHT)
    write_coherences()
    variables = {"frequency_hz": "lines", "coherence": "quality"}
    by_name = file.endswith(".npz")
    named = {"coherence_variables": variables} if by_name else {"coherence_columns": COLUMNS}
    found = read_frf("tip.npz", coherence=file, **named)  # type: ignore[arg-type]
    assert found.coherence is not None
    assert np.all(found.coherence == 0.99)
    options = [f"--coherence-variable={role}={name}" for role, name in variables.items()]
    options = options if by_name else [f"--coherence-columns={','.join(COLUMNS)}"]
    assert call("convert", "tip.npz", "out.npz", "--coherence", file, *options) == 0
    assert np.array_equal(read_frf("out.npz").coherence, found.coherence)  # type: ignore[arg-type]


def test_mistakes_in_a_file_with_a_coherence_name_its_options() -> None:
    write("tip.npz", RIGHT)
    write_coherences()
    with pytest.raises(ValueError, match=r"named\.csv, line 1: .*whose options are coherence_columns"):
        read_frf("tip.npz", coherence="named.csv")
    with pytest.raises(ValueError, match="coherence_columns is given without coherence"):
        read_frf("tip.npz", coherence_columns=COLUMNS)


NEW = (
    *("--tool", "20 mm", "--tool-material", "carbide", "--holder", "48 mm x 50 mm", "--holder-material", "steel"),
    *("--insertion", "40 mm", "--sensor", "none", "--support", "free", "--averages", "10"),
)


def test_new_takes_a_coherence_for_each_file(capsys: pytest.CaptureFixture[str]) -> None:
    write_coherences()
    for name, factor in (("a", 1.0), ("b", 2.0)):
        write(f"{name}.npz", RIGHT.conjugated().with_(values=factor * RIGHT.values.conj()))
    words = ["new", "made", "a.npz", "b.npz", *NEW, "--overhang=60 mm", "--overhang=70 mm", "--conjugate"]
    words += [f"--coherence-columns={','.join(COLUMNS)}", "--coherence=named.csv"]
    assert call(*words) == 2
    assert "1 --coherence is given for 2 files, expected one for each" in capsys.readouterr().err
    assert call(*words, "--coherence=bare.csv") == 0
    made = campaign.load("made")
    assert [made.files_of(name) for name in made.measurements] == [
        ("../a.npz", "../named.csv"),
        ("../b.npz", "../bare.csv"),
    ]
    frf = made.measurements["a"]
    assert frf is not None
    assert np.allclose(frf.receptance, RIGHT.values[:, 0, 0])


def er32_with(text: str) -> campaign.Campaign:
    examples.write("er32", ".", overwrite=True)
    file = Path("campaign.toml")
    file.write_text(file.read_text() + text)
    return campaign.load(file)


CUT = '\n[cuts.slot]\nkind = "milling"\nteeth = 2\nk_t = "600 MPa"\nk_n = "200 MPa"\ny = "rigid"\n'


def test_the_tip_of_a_cut() -> None:
    write("tip.npz", RIGHT.conjugated().flipped())
    found = er32_with(f'{CUT}x = {{ file = "tip.npz", conjugate = true, reverse = true }}\n')
    frf = found.cuts["slot"].x.frf
    assert frf is not None
    assert np.array_equal(frf.values, RIGHT.values)


def test_keys_of_a_file_need_a_file() -> None:
    with pytest.raises(CampaignError, match=r"cuts\.slot\.x\.conjugate: is given without `file`"):
        er32_with(f'{CUT}x = {{ assembly = "d11_long", conjugate = true }}\n')


def test_a_measured_frf() -> None:
    write("tip.npz", RIGHT.conjugated())
    keys = 'kind = "frf"\nassembly = "d11_long"\nfile = "tip.npz"\nconjugate = true\nstandard_deviation = "2 %"\n'
    found = er32_with(f"\n[measurements.tip]\n{keys}")
    frf = found.measurements["tip"]
    assert frf is not None
    assert np.array_equal(frf.receptance, RIGHT.values[:, 0, 0])
