"""Columns of tables as others write them: words, units, levels, complex numbers, times, and limits of reading."""

from __future__ import annotations

import gzip
import unicodedata
from pathlib import Path

import numpy as np
import pytest

from receptance import ReceptanceWarning
from receptance.io import FileFormatError, TimeSeries, errors, read, read_all, read_frf, read_time_series
from receptance.io import text as io_text
from receptance.io.column_names import parse_column

RATE = 51200.0


def table(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "made.csv"
    path.write_text(text, encoding="utf-8")
    return path


# Names and units -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "role"),
    [
        ("Realteil, Real, Re, Réelle, Partie réelle, Reale, parte reale, real part, Re.", "real"),
        ("Imaginärteil, Imag., Imaginaire, partie imaginaire, Immaginaria, parte imaginaria, Im{FRF}", "imaginary"),
        ("Betrag, Module, Modulo, Módulo, Amplitud, Ampiezza, Mag., |H|", "magnitude"),
        ("Phasenwinkel, Phase, Fase, Ángulo", "phase"),
        ("Kohärenz, Kohaerenz, Cohérence, Coherencia, Coerenza, Coh.", "coherence"),
        ("Frequenz, Fréquence, Frequenza, Frecuencia, Freq., Kreisfrequenz, ω", "frequency"),
        ("Zeit, Temps, Tempo, Tiempo", "time"),
    ],
)
def test_words_of_other_languages(names: str, role: str) -> None:
    """With composed and with separate accents, as macOS writes them."""
    for name in names.split(", "):
        for form in ("NFC", "NFD"):
            assert parse_column(unicodedata.normalize(form, name)).role == role, name


def test_an_entry_keeps_its_accents() -> None:
    assert parse_column("Imag. Spindel-Nähe [m/N]").entry == "Spindel-Nähe"


def test_a_coherence_without_dimension(tmp_path: Path) -> None:
    for unit in ("[-]", "(–)", "[]", ""):
        frf = read_frf(table(tmp_path, f"f [Hz];Realteil [m/N];Imag. [m/N];Kohärenz {unit}\n1;2;3;0,5\n2;3;4;0,75\n"))
        assert frf.coherence is not None
        assert frf.coherence.ravel().tolist() == [0.5, 0.75]


@pytest.mark.parametrize(
    ("axis", "hertz"),
    [
        ("frequency [rad/s]", 1.0 / (2.0 * np.pi)),
        ("omega_rad/s", 1.0 / (2.0 * np.pi)),
        ("f (rpm)", 1.0 / 60.0),
        ("frequency [1/min]", 1.0 / 60.0),
        ("frequency [deg/s]", 1.0 / 360.0),
    ],
)
def test_units_of_the_frequency(axis: str, hertz: float, tmp_path: Path) -> None:
    frf = read_frf(table(tmp_path, f"{axis},real [m/N],imag [m/N]\n600,1,2\n1200,1,2\n"))
    assert frf.frequency_hz == pytest.approx([600.0 * hertz, 1200.0 * hertz], rel=1e-14)


def test_an_angular_frequency_without_a_unit(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"'omega' has no unit, expected omega \[rad/s\]"):
        read(table(tmp_path, "omega,real [m/N],imag [m/N]\n600,1,2\n"))


@pytest.mark.parametrize("unit", ["dB re 1 mm/s^2/N", "dB (rel. 1 mm/s^2/N)", "dB ref mm/s^2/N", "db // 1e-3 m/s^2/N"])
def test_levels_with_a_reference(unit: str, tmp_path: Path) -> None:
    """20 dB are a factor of ten."""
    frf = read_frf(table(tmp_path, f"f [Hz],magnitude [{unit}],phase [deg]\n1,20,0\n2,-40,90\n"))
    assert frf.form == "accelerance"
    assert np.allclose(frf.values.ravel(), [1e-2, 1e-5j], rtol=1e-14, atol=1e-20)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("magnitude [dB],phase [deg]", r"'dB' is a level in dB, whose reference is unknown; state it, as in 'dB re 1"),
        ("real [dB re 1 m/N],imag [m/N]", r"column 'real': 'dB re 1 m/N' is the unit of a magnitude"),
        ("magnitude [dB re 1 mm],phase [deg]", "'1 mm' is not the unit of a receptance"),
    ],
)
def test_levels_that_are_not_understood(header: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=f"line 1: .*{message}"):
        read(table(tmp_path, f"f [Hz],{header}\n1,20,0\n"))


# Complex numbers -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rows",
    [
        "10,1.5-0.5i\n20,2+3i\n",
        "10,(1.5-0.5j)\n20,(2+3j)\n",
        "10,1.5 - 0.5*I\n20,2.0E0 + 3.0D+00*I\n",
        "(1e1+0j) (1.5e+00+-5e-01j)\n(2e1+0j) (2e+00+3e+00j)\n",
        "10;1,5-0,5i\n20;2+3i\n",
    ],
    ids=["MATLAB", "Python", "Mathematica", "NumPy savetxt", "decimal comma"],
)
def test_complex_cells(rows: str, tmp_path: Path) -> None:
    frf = read_frf(table(tmp_path, rows), columns=["f [Hz]", "mobility [m/s/N]"])
    assert (frf.form, frf.frequency_hz.tolist()) == ("mobility", [10.0, 20.0])
    assert frf.values.ravel().tolist() == [1.5 - 0.5j, 2.0 + 3.0j]


def test_several_complex_columns(tmp_path: Path) -> None:
    text = "f [Hz],H1 tip [m/N],H1 Nähe [m/N],coherence tip,coherence Nähe\n1,1.5-0.5j,2j,1,1\n2,(1.5-0.5j),3,1,1\n"
    frf = read_frf(table(tmp_path, text))
    assert frf.labels == (("tip", "Nähe"), ("",))
    assert frf.values[:, :, 0].tolist() == [[1.5 - 0.5j, 2j], [1.5 - 0.5j, 3.0]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f [Hz],H [m/N]\n1,1+2j\n2,1+2\n", r"line 3: column 'H' is '1\+2', expected a number"),
        ("f [Hz],H [m/N]\n1,1+2j\n2,(1+2j\n", r"line 3: column 'H' is '\(1\+2j', expected a number"),
        ("f [Hz],real [m/N],imag [m/N]\n1,1+2j,3\n", "line 2: column 'real' has complex numbers, expected real ones"),
        ("f [Hz],H [m/N],coherence\n1,1+2j,1j\n", "line 2: column 'coherence' has complex numbers"),
        ("time [s],tip [g]\n1,1+2j\n2,1+2j\n", "line 2: column 'tip' has complex numbers"),
        ("f [Hz],H [m/N]\n1+1j,1+2j\n", r"line 2: column 'f' is '1\+1j', expected a number"),
    ],
)
def test_complex_cells_in_other_places(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message):
        read(table(tmp_path, text))


# Times ---------------------------------------------------------------------------------------------------------------


def times(count: int, digits: int, first: int = 0) -> list[str]:
    return [f"{k / RATE:.{digits}f}" for k in range(first, first + count)]


def test_rounded_times_with_the_sample_rate(tmp_path: Path) -> None:
    """Five decimals are half a sample; the rate must agree within them over the whole record."""
    text = "time [s],tip [g]\n" + "".join(f"{t},{k}\n" for k, t in enumerate(times(3000, 5)))
    series = read_time_series(table(tmp_path, text), sample_rate_hz=RATE)
    assert (series.sample_rate_hz, len(series)) == (RATE, 3000)
    with pytest.raises(FileFormatError, match=r"not evenly spaced .* give the sample rate if the times are rounded"):
        read(table(tmp_path, text))
    for wrong in (51210.0, 50000.0, 25600.0):
        with pytest.raises(FileFormatError, match=r"not those of .* samples per second, rounded"):
            read(table(tmp_path, text), sample_rate_hz=wrong)
    uneven = text.replace("0.02000,", "0.02002,")
    with pytest.raises(FileFormatError, match="not evenly spaced"):
        read(table(tmp_path, uneven), sample_rate_hz=RATE)


def test_too_few_digits_do_not_confirm_a_rate(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="time step is 0 s"):
        read(table(tmp_path, "time [s],tip [g]\n" + "0.00,1\n" * 20), sample_rate_hz=RATE)


@pytest.mark.parametrize("header", ["", "hammer [N],tip [g]\n", "Recorder,7\nhammer,tip\nN,g\n"])
def test_tables_without_times(header: str, tmp_path: Path) -> None:
    given = None if "[" in header else ["hammer [N]", "tip [g]"]
    series = read_time_series(table(tmp_path, header + "1.5,2\n3,4\n5,6\n"), columns=given, sample_rate_hz=RATE)
    assert (series.channels, series.sample_rate_hz, series.start_s) == (("hammer", "tip"), RATE, 0.0)
    assert series.channel("hammer").tolist() == [1.5, 3.0, 5.0]
    with pytest.raises(FileFormatError, match=r"(none is named frequency or time|holds numbers)"):
        read(table(tmp_path, header + "1.5,2\n3,4\n5,6\n"), columns=given)


def test_a_single_column_without_times(tmp_path: Path) -> None:
    for text, given in (("tip [V]\n0.5\n1.5\n", None), ("0,5\n1,5\n", ["tip [V]"])):
        series = read_time_series(table(tmp_path, text), columns=given, sample_rate_hz=RATE)
        assert series.channel("tip").tolist() == [0.5, 1.5]


def test_an_frf_is_no_time_record(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="'m/N' is the unit of an FRF, but column 'real' is a time record"):
        read(table(tmp_path, "real [m/N],imag [m/N]\n1,2\n3,4\n"), sample_rate_hz=RATE)


@pytest.mark.parametrize(("digits", "rate"), [(9, None), (5, RATE)])
def test_times_that_begin_again_with_each_hit(digits: int, rate: float | None, tmp_path: Path) -> None:
    """Hits before which 20 samples were kept; the last one was stopped earlier."""
    rows = [*times(500, digits, -20), *times(500, digits, -20), *times(400, digits, -20)]
    path = table(tmp_path, "time [s],hammer [N],tip [g]\n" + "".join(f"{t},{k},1\n" for k, t in enumerate(rows)))
    records = read_all(path, sample_rate_hz=rate)
    assert all(isinstance(record, TimeSeries) for record in records)
    assert [len(record) for record in records] == [500, 500, 400]
    assert [record.values[0, 0] for record in records] == [0.0, 500.0, 1000.0]
    assert [record.label for record in records] == ["record 1 of 3", "record 2 of 3", "record 3 of 3"]
    assert len({record.sample_rate_hz for record in records if isinstance(record, TimeSeries)}) == 1
    assert records[0].sample_rate_hz == pytest.approx(RATE, rel=1e-5)


def test_a_time_that_goes_back_elsewhere(tmp_path: Path) -> None:
    rows = "".join(f"{t},1\n" for t in (0, 1, 2, 4, 3, 5))
    with pytest.raises(
        FileFormatError, match=r"line 6: the time is 3 s after 4 s, expected ascending times, or times "
    ):
        read(table(tmp_path, "time [s],tip [g]\n" + rows))
    rows = "".join(f"{t},1\n" for t in (0, 1, 2, 3, 0, 2, 4))
    with pytest.raises(FileFormatError, match=r"line 6: sample_rate_hz is 1, but the file has 0\.5 samples per second"):
        read(table(tmp_path, "time [s],tip [g]\n" + rows))


# Decimal signs, windows and coherence --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("f [Hz];hammer [N]\n1;0.001\n2;1,234\n", r"line 3: '1,234' has a comma, and '0\.001' in line 2 a point"),
        ("time [s]\thammer [N]\n0,5\t1.234,5\n1\t2\n", r"line 2: '0,5' has a comma, and '1\.234,5' in line 2 a point"),
        ('time [s],hammer [N]\n0.5,"1,234"\n', "line 2: column 'hammer' is '1,234', expected a number"),
    ],
)
def test_two_decimal_signs(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=message):
        read(table(tmp_path, text))


@pytest.mark.parametrize("line", ["Window,Force-Exponential", "# Fenster: exponentiell", "Ventana;Exponencial"])
def test_an_exponential_window_before_the_header(line: str, tmp_path: Path) -> None:
    path = table(tmp_path, f"{line}\nf [Hz];real [m/N];imag [m/N]\n1;2;3\n2;3;4\n")
    with pytest.warns(ReceptanceWarning, match="adds damping to every mode") as caught:
        frf = read_frf(path)
    assert str(caught[0].message).startswith(f"line 1 states a window, {line!r}")
    assert str(caught[0].message) in frf.notes


def test_another_window_before_the_header(tmp_path: Path) -> None:
    text = "Operating system;Windows\nWindow;Hanning\nf [Hz];real [m/N];imag [m/N]\n1;2;3\n"
    assert read_frf(table(tmp_path, text)).notes == (
        "2 lines before line 3 were not read",
        "line 2 states a window, 'Window;Hanning'",
    )


# Limits --------------------------------------------------------------------------------------------------------------


def test_no_step_of_reading_is_quadratic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Twenty times the size of what took minutes: a quadratic step would take hours."""
    monkeypatch.setattr(errors, "_IMPORT_SECONDS", 60.0)
    brackets = '(["' * 500_000
    pairs = 20_000
    names = ",".join(f"real {k} [m/N],imag {k} [m/N]" for k in range(pairs))
    digits = "1" * 5_000_000
    for text, message in (
        (brackets, "this line has no columns"),
        (f"frequency {brackets}\n1 2\n", "holds numbers"),
        (f"frequency [Hz]{' ' * 5_000_000}x,real [m/N]\n1,2\n", "a name of"),
        (f"time [s],tip [g]\n{digits}x,1\n", "'time' is '1111"),
        (f"time [s],tip [g]\n{digits}+j,1\n", "'time' is '1111"),
        (f"time [s],tip [g]\n{digits}j,1\n", "'time' is '1111"),
    ):
        with pytest.raises(FileFormatError, match=message):
            read(table(tmp_path, text))
    row = ",".join(["1"] * (2 * pairs + 1))
    assert read_frf(table(tmp_path, f"f [Hz],{names}\n{row}\n")).shape == (1, pairs, 1)


def test_the_size_of_a_text_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(io_text, "MAX_TEXT", 100)
    for name in ("a.csv", "a.frf", "a.lvm", "a.csv.gz"):
        content = b"f [Hz],real [m/N],imag [m/N]\n" + b" " * 100
        (tmp_path / name).write_bytes(gzip.compress(content) if name.endswith("gz") else content)
        with pytest.raises(FileFormatError, match="the text has 129 bytes or more, expected at most 100"):
            read(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "unit", "role", "entry"),
    [
        ("Real ((m/s^2)/N)", "(m/s^2)/N", "real", ""),
        ("Imag (m/s²)/N", "(m/s²)/N", "imaginary", ""),
        ("Z+ Real [m/s²/N]", "m/s²/N", "real", "Z+"),
        ("Point 1 +X Imag (g/N)", "g/N", "imaginary", "Point 1 +X"),
        ("1:+Z Magnitude ((m/s²)/N)", "(m/s²)/N", "magnitude", "1:+Z"),
        ("1:+Z Phase (deg)", "deg", "phase", "1:+Z"),
        ("FRF 1:+Z Real (g/N)", "g/N", "real", "1:+Z"),
        ("H1(1:+Z;2:-Z) Imag [g/N]", "g/N", "imaginary", "1:+Z;2:-Z"),
        ("1:+Z/2:+Z Real [g/N]", "g/N", "real", "1:+Z/2:+Z"),
        ("Real Z+ g/N", "g/N", "real", "Z+"),
        ("1:+Z Coherence", None, "coherence", "1:+Z"),
        ("Frequency Hz", "Hz", "frequency", ""),
        ("Hz", "Hz", "frequency", ""),
    ],
)
def test_points_and_directions_as_analysers_write_them(name: str, unit: str | None, role: str, entry: str) -> None:
    column = parse_column(name)
    assert (column.unit, column.role, column.entry) == (unit, role, entry)


@pytest.mark.parametrize("name", ["Force 1:+Z (N)", "Acc 2:-Z (m/s²)", "Ch1:Force (N)", "Hammer", "Point 1 Z+"])
def test_channels_of_time_records_stay_channels(name: str) -> None:
    assert parse_column(name).role == "channel"
