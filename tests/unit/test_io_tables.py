"""Tables with a header, CutPro's .frf and Data Physics' exports."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from receptance import FRF, Coordinate, ReceptanceWarning
from receptance.campaign import CampaignError
from receptance.campaign.measurements import read_frequencies
from receptance.io import Coherence, FileFormatError, TimeSeries, read, read_all, read_frf, read_time_series, write
from receptance.io.column_names import parse_column

EXPECTED = [1e-3 - 2e-3j, 3e-3 + 4e-3j]


def text_file(tmp_path: Path, text: str, name: str = "made.csv", encoding: str = "utf-8") -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize(
    "text",
    [
        "frequency [Hz],accelerance real [mm/s^2/N],accelerance imaginary [mm/s^2/N]\n10,1,-2\n20,3,4\n",
        "Frequency (Hz);Inertance Re (mm/s²/N);Inertance Im (mm/s²/N)\r\n10,0;1,0;-2,0\r\n20,0;3,0;4,0\r\n",
        "freq [kHz]\treal [mm/s^2/N]\timag [mm/s^2/N]\n1D-2\t1\t-2\n2E-2\t3.0\t4\n",
        "# from the analyser\nfrequency,real accelerance,imag accelerance\nHz,mm/s^2/N,mm/s^2/N\n10,1,-2\n20,3,4\n\n",
        '"frequency [Hz]","H real [mm/s^2/N]","H imaginary part [mm/s^2/N]"\n"10","1","-2"\n20,3,4\n',
        "frequency [Hz],real [mm/s^2/N],imag [mm/s^2/N],\n10,1,-2,\n20,3,4,\n",
        "frequency [Hz],real [mm/s^2/N],imag [mm/s^2/N],remark\n10,1,-2,0\n20,3,4,0\n",
        "Frequenz / Hz;Realteil / (mm/s²/N);Imaginärteil / (mm/s²/N)\n10,0;1,0;-2,0\n20,0;3,0;4,0\n",
        "freq_Hz,H1 real [mm/s^2/N],H1 imag [mm/s^2/N]\n10,1,-2\n20,3,4\n",
        "frequency [Hz],Re(H1) [mm/s^2/N],Im(H1) [mm/s^2/N]\n10,1,-2\n20,3,4\n",
        "frequency [Hz],accelerance_real,accelerance_imag\nHz,mm/s^2/N,mm/s^2/N\n10,1,-2\n20,3,4\n",
        "Frequency (Hz)   Real (mm/s²/N)   Imag (mm/s²/N)\n   10,0   1,0  -2,0\n   20,0   3,0   4,0\n",
    ],
    ids=[
        "plain",
        "German",
        "tabs",
        "row of units",
        "quoted",
        "comma at the end",
        "other column",
        "DIN 1313",
        "underscores",
        "functions",
        "underscores and units",
        "blanks",
    ],
)
def test_tables_written_by_hand(text: str, tmp_path: Path) -> None:
    for encoding in ("utf-8", "utf-8-sig", "latin-1"):
        frf = read_frf(text_file(tmp_path, text, encoding=encoding))
        assert frf.frequency_hz.tolist() == [10.0, 20.0]
        assert frf.form == "accelerance"
        assert np.allclose(frf.values[:, 0, 0], EXPECTED, rtol=1e-15)
        assert frf.notes == (("column 'remark' was not read",) if "remark" in text else ())


def test_magnitude_and_phase_and_coherence_in_percent(tmp_path: Path) -> None:
    text = "frequency [Hz],mobility magnitude [m/s/N],mobility phase [deg],coherence [%]\n10,2,90,99\n20,1,-180,98\n"
    frf = read_frf(text_file(tmp_path, text))
    assert np.allclose(frf.values[:, 0, 0], [2j, -1.0], atol=1e-15)
    assert frf.coherence is not None
    assert frf.coherence.ravel() == pytest.approx([0.99, 0.98])
    alone = read(text_file(tmp_path, "f [Hz],coherence\n1,0.5\n2,0.75\n"))
    assert isinstance(alone, Coherence)
    assert alone.values.ravel().tolist() == [0.5, 0.75]


def test_names_of_analysers_in_other_languages(tmp_path: Path) -> None:
    for names in ("Frequenz [Hz];Betrag [m/s/N];Phasenwinkel [deg];Kohärenz", "f [Hz];|H| [m/s/N];arg(H) [deg];Coh."):
        frf = read_frf(text_file(tmp_path, f"{names}\n10,0;2,0;90;0,5\n20,0;1,0;-180;0,75\n"))
        assert np.allclose(frf.values[:, 0, 0], [2j, -1.0], atol=1e-15)
        assert frf.coherence is not None
        assert frf.coherence.ravel().tolist() == [0.5, 0.75]
    found = read(text_file(tmp_path, "Zeit [ms]\ttip [g]\n0\t1\n0,5\t2\n"))
    assert isinstance(found, TimeSeries)
    assert found.sample_rate_hz == pytest.approx(2000.0)


def test_averages_before_the_header(tmp_path: Path) -> None:
    header = "f [Hz];real [m/N];imag [m/N]\n1;2;3\n2;3;4\n"
    for line in ("Averages;12", "# Averages: 12", "Mittelungen = 12", "Number of averages\t12", "No. averages 12"):
        frf = read_frf(text_file(tmp_path, f"Analyser;7\n{line}\n{header}"))
        assert frf.averages == 12, line
        assert "12 averages, by line 2" in frf.notes
    for line in ("Averages;12 of 20", "Averages;12\nAverages;10", "Averages;0", "Averages", "12 averages later"):
        assert read_frf(text_file(tmp_path, f"Analyser;7\n{line}\n{header}")).averages is None, line


def test_a_slash_in_a_name_is_not_always_a_unit() -> None:
    for name, expected in (("real 2/1", "2/1"), ("real tip/hammer", "tip/hammer"), ("imag a_b", "a_b")):
        column = parse_column(name)
        assert (column.unit, column.entry) == (None, expected)


def test_a_given_header_skips_other_lines_with_as_many_columns(tmp_path: Path) -> None:
    text = "Analyser;3;of 5\nRange;0;20\n10,0;1,5;-0,5\n20,0;2,5;0,5\n"
    frf = read_frf(text_file(tmp_path, text), columns=["frequency [Hz]", "real [m/N]", "imag [m/N]"])
    assert frf.values.ravel().tolist() == [1.5 - 0.5j, 2.5 + 0.5j]


def test_several_responses(tmp_path: Path) -> None:
    names = [f"receptance {part} {point} [um/N]" for point in ("tip", "nose") for part in ("real", "imag")]
    text = ",".join(["frequency [Hz]", *names]) + "\n10,1,2,3,4\n20,5,6,7,8\n"
    frf = read_frf(text_file(tmp_path, text), responses=[Coordinate("tool", 0.0), Coordinate("holder", 0.0)])
    assert frf.labels == (("tip", "nose"), ("",))
    assert frf.select(responses="nose").values.ravel() == pytest.approx([3e-6 + 4e-6j, 7e-6 + 8e-6j])
    with pytest.raises(FileFormatError, match="1 responses were given, the file has 2"):
        read_frf(text_file(tmp_path, text), responses=Coordinate("tool", 0.0))
    with pytest.raises(FileFormatError, match="the file has a translation there"):
        read_frf(text_file(tmp_path, text), responses=[Coordinate("tool"), Coordinate("holder", 0.0, "theta")])


def test_time_series(tmp_path: Path) -> None:
    text = "time [ms],hammer [lbf],tip (g),count\n0,1,2,3\n0.5,4,5,6\n1,7,8,9\n"
    series = read_time_series(text_file(tmp_path, text), unit={"count": "V"})
    assert series.channels == ("hammer", "tip", "count")
    assert series.units == ("N", "m/s^2", "V")
    assert series.quantities == ("force", "acceleration", "")
    assert series.sample_rate_hz == pytest.approx(2000.0)
    assert series.values[0] == pytest.approx([4.4482216152605, 2 * 9.80665, 3.0])
    with pytest.raises(
        FileFormatError,
        match=r"line 1: channel 'count' has no unit; give it, .* --unit count=N\), or count \[N\] as its name",
    ):
        read(text_file(tmp_path, text))
    replaced = read_time_series(text_file(tmp_path, text), unit={"count": "V", "tip": "m/s^2"})
    assert replaced.channel("tip").tolist() == [2.0, 5.0, 8.0]
    assert "tip: the unit in the file, 'g', was overridden by 'm/s^2'" in replaced.notes


def test_f_and_t_after_the_first_column_are_channels(tmp_path: Path) -> None:
    series = read_time_series(text_file(tmp_path, "t [s],f [N],T [V]\n0,1,2\n1,3,4\n"))
    assert (series.channels, series.quantities) == (("f", "T"), ("force", ""))


BEFORE = "Analyser,Model 4\nDate,12.3.2024,09:15\nTime,averages\nFrequency range: 0 to 20 Hz\n\n"


@pytest.mark.parametrize("unit_row", [False, True])
def test_lines_before_the_header(unit_row: bool, tmp_path: Path) -> None:
    header = "Frequency,H real,H imag,Coh\nHz,m/N,m/N,\n" if unit_row else "Freq [Hz],Real [m/N],Imag [m/N],Coh\n"
    rows = "10,1,-2,0.9\n20,3,4,0.8\n"
    options = {"quantity": "receptance"}
    frf = read_frf(text_file(tmp_path, BEFORE + header + rows), **options)
    assert frf.values.ravel().tolist() == [1 - 2j, 3 + 4j]
    assert frf.coherence is not None
    assert frf.coherence.ravel().tolist() == [0.9, 0.8]
    assert frf.notes == ("4 lines before line 6 were not read",)
    given = ["frequency [Hz]", "real [m/N]", "imag [m/N]", "coherence"]
    same = read_frf(text_file(tmp_path, BEFORE + rows), columns=given)
    assert same.values.ravel().tolist() == [1 - 2j, 3 + 4j]
    assert same.notes == ("4 lines before line 6 were not read",)
    series = read(text_file(tmp_path, BEFORE + "Time [s];hammer [N]\n0,0;1,5\n0,1;2\n"))
    assert isinstance(series, TimeSeries)
    assert series.values.ravel().tolist() == [1.5, 2.0]
    assert series.notes == ("4 lines before line 6 were not read",)


WRONG = [
    (
        "frequency [Hz],real [m/N],imag [m/N]\nHz,um/N,um/N\n1,2,3\n",
        "line 2: column 'real' is in 'm/N' by its name",
    ),
    (
        "frequency [Hz],magnitude [m/N],phase [deg]\n1,2,3\n\n2,-45.3,3\n",
        r"line 4: column 'magnitude' is -45\.3, expected zero or more: .* if these are levels in dB",
    ),
    ("", "the file is empty"),
    ("10,1,2\n20,3,4\n", r"line 1: this line holds numbers, expected a header .* columns=\[\.\.\.\]"),
    ("a,b\n1,2\n", "line 1: of the 2 columns none is named frequency or time, expected a header"),
    (
        "Frequenz;Real;Imag\n10,0;1,5;2\n20,0;2;3\n",
        r"line 1: column 'Frequenz' has no unit, expected Frequenz \[Hz\]; .* --columns 'Frequenz \[Hz\],Real,Imag'\)",
    ),
    ("f [Hz],real [m/N],imag [m/N]\n10,0,1,5,-0,5\n", r"line 2: there are 6 columns of whole numbers, .* semicolons"),
    ("frequency [Hz],real [m/N],imag [m/N]\n", "line 1: there are no rows of numbers"),
    ("frequency [Hz],real [m/N],imag [m/N]\n1,2,3\n2,x,3\n", "line 3: column 'real' is 'x', expected a number"),
    ("frequency [Hz],real [m/N],imag [m/N]\n1,2,3\n\n2,3\n", "line 4: there are 2 columns, expected 3"),
    (
        "frequency [Hz],real [m/N],imag [m/N]\n1,2,3\n1,2,3\n",
        r"line 3: .* is not ascending: \[1\] is 1 Hz after 1 Hz",
    ),
    ("frequency,real [m/N],imag [m/N]\n1,2,3\n", "line 1: column 'frequency' has no unit"),
    ("frequency [s],real [m/N],imag [m/N]\n1,2,3\n", "column 'frequency' is in 's', expected Hz"),
    (
        "frequency [Hz],real,imag\n1,2,3\n",
        r"line 1: column 'real' has no unit, such as real \[m/s\^2/N\]; give it, for example unit=",
    ),
    ("frequency [Hz],real [m/N],imag [mm/N]\n1,2,3\n", "the real part is in 'm/N', the imaginary part in 'mm/N'"),
    (
        "frequency [Hz],mobility real [m/N],mobility imag [m/N]\n1,2,3\n",
        "the file contradicts itself: it is declared as a mobility",
    ),
    ("frequency [Hz],real [m/N]\n1,2\n", "found 'real', expected a real and an imaginary part"),
    ("frequency [Hz],real [m/N],real [m/N]\n1,2,3\n", "there are two columns 'real'; add the response"),
    ("frequency [Hz],magnitude [dB],phase [deg]\n1,2,3\n", "a level in dB"),
    (
        "frequency [Hz],magnitude [m/N],phase\n1,2,3\n",
        r"column 'phase' has no unit, expected phase \[deg\]; .*--columns 'frequency \[Hz\],.*,phase \[deg\]'\)",
    ),
    ("frequency [Hz],remark\n1,2\n", "no column is an FRF or a coherence"),
    ("frequency [Hz],coherence\n1,1.3\n", "the coherence at 1 Hz is 1.3"),
    (
        "time [s],a [N]\n0,1\n1,2\n3,4\n",
        "the samples are not evenly spaced in time: sample 2 is at 1 s, expected 1.5 s",
    ),
    ("time [s],a [N]\n0,1\n", "there is a single sample and no sample rate"),
    (
        'frequency [Hz],coherence\n1,"' + "x" * 140_000 + '"\n',
        "line 2: this row cannot be split into columns: field larger than field limit",
    ),
    ('# receptance: {"receptance": 1}\nfrequency [Hz],coherence\n1,1\n', "line 1: 'about' names the kind 1"),
    (
        '# receptance: {"receptance": "frf", "version": 9}\nfrequency [Hz],coherence\n1,1\n',
        "written by a later version",
    ),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=range(len(WRONG)))
def test_mistakes(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        read(text_file(tmp_path, text), format="csv")
    assert str(caught.value).startswith("made.csv")


def test_a_row_of_units_that_agrees_with_the_names(tmp_path: Path) -> None:
    """The coherence has the unit 1; a given unit overrides both."""
    text = "frequency [Hz],real [m/N],imag [m/N],coherence\nHz,1000 mm/N,m/N,1\n1,2,3,1\n"
    frf = read_frf(text_file(tmp_path, text.replace("1000 mm/N", "m/N")))
    assert frf.values.ravel().tolist() == [2 + 3j]
    other = text_file(tmp_path, text.replace("1000 mm/N,m/N", "um/N,um/N"))
    assert read_frf(other, unit="um/N").values.ravel().tolist() == pytest.approx([2e-6 + 3e-6j])
    bare = text_file(tmp_path, "frequency [Hz],real,imag\n,[um/N],[um/N]\n1,2,3\n")
    assert read_frf(bare).values.ravel().tolist() == pytest.approx([2e-6 + 3e-6j])


# Texts that were cut off -------------------------------------------------------------------------------------------

NOISE = np.random.default_rng(15).normal(size=(30, 2)) @ [1e-8, 1e-8j]
"""Seed 15."""
WHOLE = FRF(frequency_hz=np.arange(1.0, 31.0), values=NOISE, label="tip")


@pytest.mark.parametrize("ending", [".csv", ".frf", ".txt"])
def test_truncated_files_of_this_library(ending: str, tmp_path: Path) -> None:
    """At any byte of them: a number without its exponent is a number still."""
    path = tmp_path / f"a{ending}"
    options: dict[str, Any] = {"format": "dataphysics"} if ending == ".txt" else {}
    write(path, WHOLE, **options)
    content = path.read_bytes()
    assert np.array_equal(read_frf(path).values, WHOLE.values)
    assert read_frf(path).label == "tip"
    end = len(content) - (2 if content.endswith(b"\r\n") else 1)
    for size in range(0, end + 1):
        path.write_bytes(content[:size])
        # In the first row of .frf the number of rows itself is cut; the note is that the rest has no end of line.
        with pytest.raises((FileFormatError, ReceptanceWarning)):
            read(path, **options)
    path.write_bytes(content[: end - 4])
    with pytest.raises(FileFormatError, match="the last line has no line ending"):
        read(path, **options)
    path.write_bytes(content[:end].rpartition(b"\n")[0] + b"\n")
    with pytest.raises(FileFormatError, match="declares 30 rows of numbers and has 29: it was truncated"):
        read(path, **options)


FOREIGN = {
    "a.csv": "frequency [Hz],accelerance real [m/s^2/N],accelerance imag [m/s^2/N]\n",
    "series.csv": "time [s],a [g],b [g]\n",
    "a.frf": "",
    "a.txt": (
        "Units: Ratio\r\nRef Chan:Resp Chan\t1-Z:2-X\r\nChannel Name\t : \r\nChannel Comment\t : \r\n\r\n"
        "Frequency\t Real\t Imaginary\r\n\r\nUnits:\r\nHz\t(m/s²)(N)\t \r\n"
    ),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_truncated_files_of_other_programs(name: str, tmp_path: Path) -> None:
    """Read with a warning if the last line has no line ending, or is shorter than all others."""
    between = "," if name.endswith(".csv") else "\t"
    rows = [between.join(f"{x:+.6e}" for x in (k, v.real, v.imag)) + "\n" for k, v in enumerate(NOISE, 1)]
    path = text_file(tmp_path, FOREIGN[name] + "".join(rows), name, "latin-1")
    (whole,) = read_all(path)
    assert not whole.notes
    line = len(FOREIGN[name].splitlines()) + 30
    for cut, reported in (
        (5, f"the last line, {line}, has no line ending"),
        (1, f"the last line, {line}, has no line ending"),
    ):
        path = text_file(tmp_path, (FOREIGN[name] + "".join(rows))[:-cut], name, "latin-1")
        with pytest.warns(ReceptanceWarning, match=reported) as caught:
            (found,) = read_all(path)
        assert caught[0].filename == __file__
        assert [note.startswith(reported) for note in found.notes] == [True]
        assert np.array_equal(found.values, whole.values) == (cut == 1)
    path = text_file(tmp_path, (FOREIGN[name] + "".join(rows))[:-5] + "\n", name, "latin-1")
    with pytest.warns(ReceptanceWarning, match=f"the last line, {line}, is shorter than all others"):
        read_all(path)


def test_the_shortest_line_may_be_the_last_by_chance(tmp_path: Path) -> None:
    """Where lines have different lengths many of them are needed."""
    head = FOREIGN["a.csv"]
    read(text_file(tmp_path, head + "10,1.25,1.125\n11,1.5,1.25\n12,1,2\n"))
    rows = "".join(f"{k},{k % 7 + 0.125},{k % 3 + 0.25}\n" for k in range(100, 250))
    read(text_file(tmp_path, head + rows))
    with pytest.warns(ReceptanceWarning, match="the last line, 152, is shorter than all others"):
        read(text_file(tmp_path, head + rows + "250,1,2\n"))


# Encodings and other contents ----------------------------------------------------------------------------------------


def test_tables_in_utf_16(tmp_path: Path) -> None:
    """As spreadsheets write "Unicode text"."""
    text = "frequency [Hz]\taccelerance real [mm/s²/N]\taccelerance imag [mm/s²/N]\n10\t1\t-2\n20\t3\t4\n"
    for encoding in ("utf-16", "utf-16-be", "utf-16-le"):
        mark = "" if encoding == "utf-16" else "\ufeff"
        frf = read_frf(text_file(tmp_path, mark + text, "a.txt", encoding))
        assert np.allclose(frf.values[:, 0, 0], EXPECTED, rtol=1e-15)
    for encoding in ("utf-16-be", "utf-16-le"):
        with pytest.raises(FileFormatError, match="zero bytes, as in UTF-16 without a byte order mark"):
            read(text_file(tmp_path, text, "a.txt", encoding))
    damaged = text.encode("utf-16") + b"\x00\xd8"
    (tmp_path / "a.txt").write_bytes(damaged)
    with pytest.raises(FileFormatError, match="UTF-16 text is damaged"):
        read(tmp_path / "a.txt")


@pytest.mark.parametrize("content", ["S3CRET:x,S3CRET;S3CRET\tS3CRET\n" * 12, "S3CRET S3CRET\n" * 12, "S3CRET\n"])
def test_errors_do_not_quote_files_other_than_measurements(content: str, tmp_path: Path) -> None:
    """With any stated format, and with other column names."""
    path = text_file(tmp_path, content, "passwd")
    columns = ["frequency [Hz]", "real [m/N]", "imag [m/N]"]
    for format_ in ("uff", "csv", "npz", "mat", "hdf5", "cutpro", "dataphysics", None):
        for options in ({}, {"columns": columns}, {"columns": columns[:1]}):
            with pytest.raises(FileFormatError) as caught:
                read(path, format=format_, **options)  # type: ignore[arg-type]
            assert "S3CRET" not in str(caught.value)
    with pytest.raises(CampaignError) as other:
        read_frequencies(path)
    assert "S3CRET" not in str(other.value)


def test_a_header_from_options(tmp_path: Path) -> None:
    columns = ["frequency [Hz]", "mobility real [m/s/N]", "mobility imag [m/s/N]"]
    frf = read_frf(text_file(tmp_path, "10,1,2\n20,3,4\n"), columns=columns)
    assert (frf.form, frf.values.ravel().tolist()) == ("mobility", [1 + 2j, 3 + 4j])
    replaced = read_frf(text_file(tmp_path, "F,X,Y\n10,1,2\n20,3,4\n"), columns=columns)
    assert replaced.values.ravel().tolist() == [1 + 2j, 3 + 4j]


def test_a_changed_header_of_this_library_is_detected(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    write(path, FRF(frequency_hz=[1.0], values=[1.0], form="mobility"))
    path.write_text(path.read_text().replace("[m/s/N]", "[mm/s/N]"))
    with pytest.raises(FileFormatError, match="remove that line if the header is correct"):
        read(path)
    path.write_text("\n".join([*path.read_text().splitlines()[1:], ""]))
    assert read_frf(path).values.ravel().tolist() == [1e-3]


# CutPro ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "10\t1e-3\t-2e-3\ttip of the tool\n20\t3e-3\t4e-3\n",
        "  10.0   1.0D-3 -2.0E-03   tip of the tool\r\n\r\n  20.0   3.0D-3  4.0E-03\r\n",
    ],
)
def test_cutpro(text: str, tmp_path: Path) -> None:
    frf = read_frf(text_file(tmp_path, text, "a.frf"))
    assert np.allclose(frf.values[:, 0, 0], EXPECTED, rtol=1e-15)
    assert (frf.unit, frf.label) == ("m/N", "tip of the tool")
    with pytest.raises(FileFormatError, match="in the file the unit is 'm/N', that of a receptance; to override"):
        read(text_file(tmp_path, text, "a.frf"), unit="m/s^2/N")
    other = read_frf(text_file(tmp_path, text, "a.frf"), unit="mm/N")
    assert np.allclose(other.values[:, 0, 0], np.array(EXPECTED) * 1e-3, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("10 1\n", "line 1: there are 2 columns, expected 3"),
        ("10 1 2 label\n20 1 2 3\n", "line 2: there are 4 columns"),
        ("10 1 2\n20 1 x\n", "line 2: the imaginary part is 'x', expected a number"),
        ("10 1 2\n20 inf 1\n", r"line 2: FRF: values at 20 Hz is \(inf\+1j\)"),
        ("10 1 2\n\n5 1 2\n", "line 3: FRF: frequency_hz is not ascending"),
        ("f re im\n10 1 2\n", "line 1: the frequency is text, expected a number"),
        ("\n \n", "there are no rows"),
    ],
)
def test_mistakes_in_cutpro(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message):
        read(text_file(tmp_path, text, "a.frf"))


def test_cutpro_stores_receptances(tmp_path: Path) -> None:
    frf = FRF(frequency_hz=[0.0, 10.0, 20.0], values=[0.0, 1.0, 2.0 - 1j], form="accelerance", label="a\tb")
    with pytest.warns(ReceptanceWarning, match="it is written as a receptance"):
        write(tmp_path / "a.frf", frf)
    back = read_frf(tmp_path / "a.frf")
    assert np.array_equal(back.values, frf.to("receptance").values)
    assert back.label == "a b"
    wide = FRF(frequency_hz=[1.0], values=np.ones((1, 2, 1)))
    with pytest.raises(ValueError, match="has 2 and 1; select one"):
        write(tmp_path / "b.frf", wide)
    with pytest.raises(ValueError, match="this FRF is in rad/N"):
        write(tmp_path / "b.frf", FRF(frequency_hz=[1.0], values=[1.0], responses="theta"))
    with pytest.warns(ReceptanceWarning, match="decay_rate"):
        write(tmp_path / "b.frf", FRF(frequency_hz=[1.0], values=[1.0], decay_rate=3.0))
    series = TimeSeries(values=[1.0, 2.0], channels=["a"], units=["N"], sample_rate_hz=1.0)
    with pytest.raises(ValueError, match="holds an FRF, this is TimeSeries"):
        write(tmp_path / "b.frf", series)


# Data Physics ----------------------------------------------------------------------------------------------------


def export(tmp_path: Path, changes: dict[int, str] | None = None) -> Path:
    lines = ["Units: Ratio", "Ref Chan:Resp Chan\t1-Z:2-X", "Channel Name\t : ", "Channel Comment\t : ", ""]
    lines += ["Frequency\t Real\t Imaginary", "", "Units:", "Hz\t(g²)(lbf)\t ".replace("g²", "m/s²")]
    lines += ["0.0000000000000e+000\t      -0.1504349\t               0", "1.9531250000000e-002\t 0.5\t 1.5e-001"]
    for number, text in (changes or {}).items():
        lines[number - 1] = text
    path = tmp_path / "export.txt"
    path.write_bytes("\r\n".join([*lines, ""]).encode("latin-1"))
    return path


def test_data_physics(tmp_path: Path) -> None:
    path = export(tmp_path)
    frf = read_frf(path)
    assert frf.frequency_hz.tolist() == [0.0, 0.01953125]
    assert frf.values.ravel() == pytest.approx(np.array([-0.1504349, 0.5 + 0.15j]) / 4.4482216152605)
    assert (frf.unit, frf.labels) == ("m/s^2/N", (("2-X",), ("1-Z",)))
    packed = tmp_path / "export.txt.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    assert np.array_equal(read_frf(packed).values, frf.values)
    packed.write_bytes(gzip.compress(path.read_bytes())[:-20])
    with pytest.raises(FileFormatError, match="the gzip data are truncated"):
        read(packed)
    packed.write_bytes(packed.read_bytes()[:40] + b"\xff" * 30)
    with pytest.raises(FileFormatError, match="the gzip data"):
        read(packed)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({1: "Units: Mag dB"}, "line 1: the units are 'Mag dB'; only a ratio"),
        ({6: "Frequency\t Magnitude\t Phase"}, "line 6: the columns are Frequency, Magnitude, Phase, expected"),
        ({9: "rpm\t(g)(N)"}, "line 9: the frequency is in 'rpm', expected Hz"),
        ({9: "Hz\t"}, "line 9: column 'real part' has no unit"),
        ({9: "Hz\t(apples)(N)"}, "line 9: column 'real part': '\\(apples\\)/\\(N\\)' is not understood"),
        ({9: "Hz\t(N)(N)"}, "line 9: '\\(N\\)/\\(N\\)' is not the unit of a receptance"),
        ({11: "1.9531250000000e-002\t 0.5"}, "line 11: there are 2 columns"),
        ({11: "1.9531250000000e-002\t 0.5\t zero"}, "line 11: the imaginary part is 'zero'"),
        ({11: "0\t 0.5\t 1"}, "line 11: FRF: frequency_hz is not ascending"),
    ],
)
def test_mistakes_in_data_physics(changes: dict[int, str], message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message):
        read(export(tmp_path, changes))


def test_data_physics_unit_from_options(tmp_path: Path) -> None:
    frf = read_frf(export(tmp_path, {9: "Hz\t(apples)(N)"}), unit="g/N")
    assert frf.values[1, 0, 0] == pytest.approx((0.5 + 0.15j) * 9.80665)


def test_data_physics_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    for response, excitation, form in (
        ("y", "y", "accelerance"),
        ("theta", "theta", "mobility"),
        ("theta", "y", "receptance"),
    ):
        numbers: Any = rng.normal(size=5) + 1j * rng.normal(size=5)
        frf = FRF(frequency_hz=np.arange(5) / 3, values=numbers, form=form, responses=response, excitations=excitation)
        frf = frf.with_(labels=(["2-X"], ["1-Z"]), label="nose")
        write(tmp_path / "a.txt", frf, format="dataphysics")
        (back,) = read_all(tmp_path / "a.txt")
        assert isinstance(back, FRF)
        assert np.array_equal(back.values, frf.values)
        assert np.array_equal(back.frequency_hz, frf.frequency_hz)
        assert (back.unit, back.labels, back.label) == (frf.unit, frf.labels, "nose")
