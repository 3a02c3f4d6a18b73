"""The command `convert`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io
import typer

import command_line
from receptance import FRF, ReceptanceWarning
from receptance.cli.files import convert
from receptance.cli.running import InputError
from receptance.io import TimeSeries, read, read_all, read_frf, write

pytestmark = pytest.mark.usefixtures("empty_folder")

app = typer.Typer(add_completion=False)
app.command()(convert)


def call(*arguments: str) -> None:
    app(list(arguments), standalone_mode=False)


def test_from_one_format_to_another(capsys: pytest.CaptureFixture[str]) -> None:
    frf = FRF(frequency_hz=[0.0, 10.0, 20.0], values=[0.0, 1.0, 2.0 - 1j], form="accelerance", label="tip")
    write("a.npz", frf)
    call("a.npz", "b.uff")
    assert capsys.readouterr().out == (
        "FRF('tip': accelerance in m/s^2/N, 1 x 1, 3 lines from 0 to 20 Hz)\nWritten: b.uff\n"
    )
    call("b.uff", "c.frf", "--as", "receptance")
    printed = capsys.readouterr().out
    assert "FRF('tip': receptance in m/N, 1 x 1, 2 lines from 10 to 20 Hz)" in printed
    assert "Note: the line at 0 Hz is dropped" in printed
    assert np.allclose(read_frf("c.frf").values, frf.to("receptance").values)
    call("c.frf", "d.h5")
    call("d.h5", "e.txt", "--to", "dataphysics")
    call("e.txt", "f.csv.gz", "--from", "dataphysics")
    assert np.array_equal(read_frf("f.csv.gz").values, read_frf("c.frf").values)


def test_units_variables_and_columns() -> None:
    scipy.io.savemat("a.mat", {"f": [1.0, 2.0], "H": [1j, 2j], "t": [0.0, 0.1], "x": [1.0, 2.0], "y": [3.0, 4.0]})
    call("a.mat", "a.npz", "--variable", "frequency_hz=f", "--variable", "values=H", "--unit", "g/N")
    assert read_frf("a.npz").form == "accelerance"
    given = {"--variable": ["time_s=t", "F=x", "a=y"], "--unit": ["F=N", "a=g"]}
    call("a.mat", "t.uff", *(word for option, texts in given.items() for text in texts for word in (option, text)))
    series = read("t.uff")
    assert isinstance(series, TimeSeries)
    assert series.units == ("N", "m/s^2")
    Path("plain.csv").write_text("1,2,3\n4,5,6\n")
    columns = "frequency [Hz],mobility real [m/s/N],mobility imag [m/s/N]"
    call("plain.csv", "b.npz", "--columns", columns)
    assert read_frf("b.npz").values.ravel().tolist() == [2 + 3j, 5 + 6j]
    Path("nameless.csv").write_text("f [Hz],real,imag,coherence\n1,2,3,1.2\n4,5,6,1\n")
    call("nameless.csv", "c.npz", "--quantity", "mobility", "--unit", "SI", "--ignore-coherence")
    assert read_frf("c.npz").form == "mobility"


def test_several_and_coherence(capsys: pytest.CaptureFixture[str]) -> None:
    frfs = [FRF(frequency_hz=[1.0, 2.0], values=[k, k]) for k in (1.0, 2.0)]
    write("a.uff", frfs)
    call("a.uff", "b.npz")
    assert len(read_all("b.npz")) == 2
    call("a.uff", "c.csv", "--number", "2")
    assert read_frf("c.csv").values[0, 0, 0] == 2.0
    Path("coh.csv").write_text("f [Hz],coherence\n1,0.2\n2,0.3\n")
    capsys.readouterr()
    call("c.csv", "d.npz", "--coherence", "coh.csv")
    assert "Note: the median coherence is 0.25" in capsys.readouterr().out
    with pytest.warns(ReceptanceWarning, match=r"the median coherence is 0\.25"):
        assert read_frf("d.npz").coherence is not None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("missing.uff b.npz", "missing.uff"),
        ("a.uff a.uff", "IN and OUT are both a.uff; give two files"),
        ("a.uff b.xyz", "b.xyz: unknown extension"),
        ("a.uff b.csv", "holds a single measurement, there are 2"),
        ("a.uff b.csv --number 3", "--number is 3, but there are 2"),
        ("a.uff b.csv --unit N --unit m", "--unit is 'N', expected one unit, or CHANNEL=UNIT"),
        ("a.uff b.csv --variable x", "--variable is 'x', expected ROLE=NAME"),
        ("t.npz b.csv --as mobility", "--as is 'mobility', but TimeSeries"),
    ],
)
def test_mistakes(arguments: str, message: str) -> None:
    write("a.uff", [FRF(frequency_hz=[1.0, 2.0], values=[k, k]) for k in (1.0, 2.0)])
    write("t.npz", TimeSeries(values=[1.0], channels=["a"], units=["N"], sample_rate_hz=1.0))
    before = set(Path().iterdir())
    with pytest.raises(InputError, match=message):
        call(*arguments.split())
    assert set(Path().iterdir()) == before


def test_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.csv").write_text("frequency [Hz],real,imag\n1,2,3\n")
    command = ("convert", "a.csv", "b.npz")
    assert command_line.call(*command) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("receptance: a.csv, line 1: column 'real' has no unit")
    assert not Path("b.npz").exists()
    assert command_line.call(*command, "--unit", "m/N") == 0
    output = capsys.readouterr()
    assert output.err == ""
    assert output.out.endswith("Written: b.npz\n")


def test_a_link_to_nothing_is_not_written_through_without_overwrite() -> None:
    write("a.csv", FRF(frequency_hz=[10.0, 20.0], values=[1.0, 2.0 - 1j], form="accelerance"))
    Path("b.npz").symlink_to("elsewhere.npz")
    with pytest.raises(InputError, match=r"OUT is b\.npz, a link to elsewhere\.npz, which would be created"):
        call("a.csv", "b.npz")
    assert not Path("elsewhere.npz").exists()
    call("a.csv", "b.npz", "--overwrite")
    assert read_frf("elsewhere.npz").form == "accelerance"
