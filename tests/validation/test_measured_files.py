"""Measured files of other programs in ../shared/measured, with PROVENANCE.txt beside them."""

from __future__ import annotations

import contextlib
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from receptance import FRF, Coordinate, ReceptanceWarning
from receptance.io import Coherence, FileFormatError, TimeSeries, read, read_all, read_frf, read_time_series
from receptance.io.uff.datasets import Function, data_sets

MEASURED = Path(__file__).resolve().parents[3] / "shared" / "measured"
UFF = MEASURED / "uff_io" / "UFFFiles.jl"
PYUFF = MEASURED / "uff_io" / "pyuff"
ACCELERANCE = {"quantity": "accelerance", "unit": "m/s^2/N"}

pytestmark = pytest.mark.skipif(not MEASURED.is_dir(), reason=f"there are no measured files in {MEASURED}")


def functions(path: Path) -> list[Function]:
    return [item for item in data_sets(path.read_bytes()) if isinstance(item, Function)]


def rounded(values: np.ndarray, digits: int) -> np.ndarray:
    """Return numbers as a column of a text holds them."""
    return np.array([float(f"{value:.{digits - 1}E}") for value in np.atleast_1d(values)])


def within_digits(exact: np.ndarray, text: np.ndarray, digits: int) -> bool:
    """Return whether numbers differ by half a unit of the last digit of the text, and the rest of single precision."""
    unit = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(text), 1e-300))) - digits + 1)
    return bool(np.all(np.abs(exact - text) <= 0.5 * unit + 1e-7 * np.abs(text)))


# Universal files: https://github.com/maucejo/UFFFiles.jl and https://github.com/ladisk/pyuff, test files


@pytest.mark.parametrize("case", range(1, 9))
def test_eight_layouts_read_the_same_in_text_and_binary(case: int) -> None:
    (text,) = functions(UFF / f"dataset58_case{case}_ascii.unv")
    (binary,) = functions(UFF / f"dataset58_case{case}_binary.unv")
    assert not text.notes
    assert not binary.notes
    assert (text.binary, binary.binary) == (False, True)
    assert text.ordinate.dtype == binary.ordinate.dtype
    assert text.ordinate.size == (801 if case in (3, 4, 7, 8) else 1602)
    # Precision of text files: six digits in single precision and of abscissae, 13 in double precision.
    digits = 6 if case <= 4 else 13
    assert within_digits(binary.abscissa, text.abscissa, 6)
    assert np.array_equal(rounded(binary.ordinate.real, digits), text.ordinate.real)
    assert np.array_equal(rounded(binary.ordinate.imag, digits), text.ordinate.imag)


def test_uneven_double_precision_binaries_are_standard() -> None:
    """Their abscissa is single precision, as in the standard; pyuff reads it as double, which is wrong."""
    binary = {case: functions(UFF / f"dataset58_case{case}_binary.unv")[0] for case in range(1, 9)}
    assert np.array_equal(binary[6].abscissa, binary[2].abscissa)
    assert np.array_equal(binary[8].abscissa, binary[4].abscissa)
    assert np.array_equal(binary[6].ordinate, binary[5].ordinate)
    assert np.array_equal(binary[8].ordinate, binary[7].ordinate)
    # The writer made its real cases of the complex one, parts in turn.
    assert np.array_equal(binary[5].ordinate, binary[7].ordinate.view(np.float64))


@pytest.mark.parametrize("case", range(1, 9))
@pytest.mark.parametrize("kind", ["ascii", "binary"])
def test_eight_layouts_as_frfs(case: int, kind: str) -> None:
    """The files state acceleration per force, without a unit: there is neither a data set 164 nor a label."""
    path = UFF / f"dataset58_case{case}_{kind}.unv"
    with pytest.raises(FileFormatError, match=r"line 2: neither a data set 164 .* unit='m/s\^2/N'"):
        read(path)
    real = case in (1, 2, 5, 6)
    with pytest.warns(ReceptanceWarning, match="without a phase") if real else contextlib.nullcontext():
        frf = read_frf(path, unit="m/s^2/N")
    assert frf.form == "accelerance"
    assert frf.labels == (("1:+1",), ("22:+1",))
    assert bool(frf.notes) == real
    with pytest.raises(FileFormatError, match="to override the file give quantity"):
        read(path, unit="m/N")


def test_pyuff_agrees_where_it_is_correct() -> None:
    pyuff = pytest.importorskip("pyuff")
    compared = 0
    for path in sorted([*UFF.glob("*58*"), *PYUFF.glob("*.uff")]):
        try:
            mine = functions(path)
        except FileFormatError:
            continue
        sets = pyuff.UFF(str(path)).read_sets()
        theirs = [one for one in (sets if isinstance(sets, list) else [sets]) if one.get("type") == 58]
        assert len(theirs) == len(mine), path.name
        for one, other in zip(mine, theirs, strict=True):
            if re.fullmatch(r"dataset58_case[68]_binary\.unv", path.name):
                continue
            # The zeros that fill up the last line are values to it.
            n = one.ordinate.size
            assert np.array_equal(one.ordinate, other["data"][:n]), path.name
            assert not np.any(other["data"][n:]), path.name
            assert np.allclose(one.abscissa, other["x"][:n], rtol=1e-12), path.name
            assert (one.kind, one.response.node, one.reference.direction) == (
                other["func_type"],
                other["rsp_node"],
                other["ref_dir"],
            )
            compared += 1
    assert compared >= 30


@pytest.mark.parametrize("name", ["dataset58_FRF.unv", "dataset58_FRF_UTF.unv"])
def test_hammer_frf_and_its_coherence(name: str) -> None:
    """The label is receptance, the unit mobility or invalid, the values accelerances: this is an error."""
    with pytest.raises(FileFormatError, match=r"dataset58_FRF.*, line 2: the (file contradicts itself|axis label)"):
        read(UFF / name)
    with pytest.raises(FileFormatError, match="quantity"):
        read(UFF / name, unit="SI")
    frf = read_frf(UFF / name, **ACCELERANCE, coherence=UFF / "dataset58_coh.unv")
    assert frf.shape == (1600, 1, 1)
    assert (frf.frequency_hz[0], frf.frequency_hz[-1]) == (0.0, 799.5)
    assert frf.labels == ((".1.Z-",), (".56.Z",))
    assert frf.coherence is not None
    assert np.median(frf.coherence) == pytest.approx(0.998, abs=5e-4)
    assert any("overridden" in note for note in frf.notes)
    alone = read(UFF / "dataset58_coh.unv")
    assert isinstance(alone, Coherence)
    assert np.array_equal(alone.values, frf.coherence)


def test_time_series() -> None:
    force = read_time_series(UFF / "dataset58_time.unv", sample_rate_hz=2048.0)
    assert force.quantities == ("force",)
    assert np.abs(force.values).max() == pytest.approx(114.8, abs=0.05)
    assert force.sample_rate_hz == 2048.0, "the file's time step, 4.88281E-04 s, has six digits"
    four = read_time_series(PYUFF / "MPSTD#Set001_2024_10_08_10_27_07.uff")
    assert four.values.shape == (222400, 4)
    assert four.quantities == ("acceleration",) * 4
    assert four.sample_rate_hz == 3200.0
    sine = read_time_series(PYUFF / "binary8byte.uff")
    assert sine.units == ("m/s^2",)
    assert np.abs(sine.values).max() == pytest.approx(9.80665, rel=1e-6), "the file has 1 g"
    sound = read_time_series(PYUFF / "Sample_UFF58b_bin.uff")
    assert (sound.quantities, sound.units) == (("",), ("Pa",))
    short = read_time_series(PYUFF / "time-history-not-all-columns-filled.uff")
    assert (short.channels, short.units, len(short)) == (("1x",), ("m/s^2",), 13)
    packed = read_time_series(UFF / "dataset58_nospacing.uff")
    assert packed.values[:3, 0] == pytest.approx([-3.09944e-4, -2.74181e-4, -0.00115633], rel=1e-12)
    assert packed.units == ("(V^2)",)


def test_units_of_data_set_164() -> None:
    """Inch and pound force: an accelerance of 1 in/s2 per lbf is 0.0254 / 4.448 m/s2 per N."""
    frf = read_frf(UFF / "dataset151_164_58_55.unv")
    (stored,) = functions(UFF / "dataset151_164_58_55.unv")
    assert frf.unit == "m/s^2/N"
    assert np.allclose(frf.values[:, 0, 0], stored.ordinate * 0.0254 / 4.4482216152605, rtol=1e-9)


def test_two_records_and_labels_beyond_ascii() -> None:
    both = read(UFF / "dataset58_ufb.ufb", unit="SI")
    assert isinstance(both, FRF)
    assert (both.shape, both.labels) == ((801, 2, 1), (("1:+1", "1:+2"), ("22:+1",)))
    frf = read_frf(PYUFF / "non_ascii_header.uff")
    assert frf.unit == "m/s^2/N", "(1/N)*(m/s²) in Latin-1"


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (PYUFF / "dataset_milestone_in_header.uff", r"line 21: the data set ends after 42 of the 2508876 numbers"),
        (PYUFF / "meas_point_1.txt", r"line 1: this line has no columns separated by"),
        (PYUFF / "TestLab 161 164 18 15 82.uff", r"line 2: there is no time series, FRF or coherence"),
        (PYUFF / "sample_dataset58_psd.uff", r"it holds power spectral density"),
        (UFF / "dataset58_spectrum.unv", r"it holds spectrum"),
        (UFF / "dataset55_bad_format.unv", r"line 2: .* it holds data set 55"),
        (UFF / "unsupported_dataset.unv", r"data set 15, data set 1859"),
        (MEASURED / "modelab_freefree_beam" / "setup.csv", r"line 1: of the \d+ columns none is named"),
    ],
)
def test_refused_files(path: Path, message: str) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        read(path)
    assert path.name in str(caught.value)


@pytest.mark.parametrize("folder", [UFF, PYUFF], ids=lambda folder: str(folder.name))
def test_every_universal_file_is_read_or_refused_with_a_place(folder: Path) -> None:
    refused = {}
    for path in sorted(folder.iterdir()):
        try:
            assert read_all(path)
        except FileFormatError as error:
            refused[path.name] = error
    assert len(refused) > 5
    for name, error in refused.items():
        assert error.line is not None or error.byte is not None or "format=" in str(error), name


@pytest.mark.parametrize("case", [3, 8])
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 0.995])
def test_truncated_files(case: int, share: float, tmp_path: Path) -> None:
    for kind in ("ascii", "binary"):
        whole = (UFF / f"dataset58_case{case}_{kind}.unv").read_bytes()
        path = tmp_path / f"{kind}.uff"
        path.write_bytes(whole[: int(share * (len(whole) - 100))])
        with pytest.raises(FileFormatError, match=r"(line|byte) \d+: ") as caught:
            read(path, unit="SI")
        assert (caught.value.byte is not None) == (kind == "binary")


# Data Physics: https://github.com/alxhslm/ModeLAB, SignalCalc exports of a free-free beam


@pytest.mark.parametrize("point", [1, 5, 9])
def test_data_physics_exports(point: int) -> None:
    frf = read_frf(MEASURED / "modelab_freefree_beam" / f"Hxysv0000{point}.txt.gz")
    assert frf.unit == "m/s^2/N", "(m/s²)(N) of a ratio"
    assert frf.shape == (51201, 1, 1)
    assert frf.frequency_hz[1] == 0.01953125
    assert frf.frequency_hz[-1] == 1000.0
    assert not frf.notes


def test_peaks_of_the_free_free_beam() -> None:
    """Natural frequencies by PROVENANCE.txt, to one line; two of the points hardly move in the third mode."""
    frf = read_frf(MEASURED / "modelab_freefree_beam" / "Hxysv00001.txt.gz")
    for expected in (111.992, 306.855, 596.367, 974.141):
        near = frf.select(low_hz=expected - 5.0, high_hz=expected + 5.0)
        assert near.frequency_hz[np.argmax(np.abs(near.values))] == pytest.approx(expected, abs=0.02)


def test_the_accelerometer_of_the_beam_is_reversed() -> None:
    """setup.csv: hammer and accelerometer at 0.5 m, axes against each other. The drive-point check reports it."""
    place = Coordinate("beam", 0.5)
    path = MEASURED / "modelab_freefree_beam" / "Hxysv00004.txt.gz"
    with pytest.warns(ReceptanceWarning, match="reversed sensor or hammer"):
        frf = read_frf(path, responses=place, excitations=place)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frf.flipped()


# vibrationtesting: https://github.com/Vibration-Testing/vibrationtesting, two analyser records without units

VARIABLES = {"frequency_hz": "Freq_domain", "values": "Hf_chan_2", "coherence": "Hf_coh_chan_2"}


def case(number: int, **options: Any) -> FRF:
    return read_frf(MEASURED / "vibrationtesting_cases" / f"case{number}.mat", **options)


def test_analyser_record_without_units() -> None:
    with pytest.raises(FileFormatError, match=r"name its variables and their unit.*Hf_coh_chan_2 \(1601x1 single\)"):
        case(1)
    with pytest.raises(FileFormatError, match=r"the unit of its FRF; give it, for example unit="):
        case(1, variables=VARIABLES)


def test_coherence_above_one_is_refused() -> None:
    with pytest.raises(FileFormatError) as caught:
        case(1, variables=VARIABLES, **ACCELERANCE)
    message = str(caught.value)
    assert "the coherence at 0 Hz is 1.246 (and outside 0 to 1 on 4 more lines), expected 0 to 1" in message
    assert "its median is 0.31" in message
    assert "Coherence is the share of the response's power explained by the force" in message
    assert "ignore_coherence=True" in message
    frf = case(1, variables=VARIABLES, ignore_coherence=True, **ACCELERANCE)
    assert frf.coherence is None
    assert frf.notes == ("the coherence in the file was ignored on request",)


def test_low_coherence_is_noted() -> None:
    with pytest.warns(ReceptanceWarning, match="median coherence is 0.32") as caught:
        frf = case(2, variables=VARIABLES, **ACCELERANCE)
    assert caught[0].filename == __file__, "the warning points to who read the file"
    assert frf.coherence is not None
    assert "does not determine a joint" in frf.notes[0]


def test_time_series_in_mat_files() -> None:
    variables = {"time_s": "Time_domain", "ch1": "Time_chan_1", "ch2": "Time_chan_2"}
    path = MEASURED / "vibrationtesting_cases" / "case1.mat"
    series = read_time_series(path, variables=variables, unit={"ch1": "N", "ch2": "g"}, sample_rate_hz=1280.0)
    assert (series.sample_rate_hz, len(series)) == (1280.0, 4096)
    ring = MEASURED / "brb_jointed_beam" / "HammerImpact.mat"
    with pytest.raises(FileFormatError, match=r"HIdata\.acc3 \(65536 float64\)"):
        read(ring)
    acceleration = read(ring, variables={"time_s": "HIdata.time", "tip": "HIdata.acc3"}, unit="m/s^2")
    assert isinstance(acceleration, TimeSeries)
    assert (acceleration.sample_rate_hz, acceleration.values.shape) == (12800.0, (65536, 1))
    assert acceleration.start_s == pytest.approx(-0.01, abs=1e-9)
    with pytest.raises(FileFormatError, match=r"FRdata\.ForceControl\[3\]\.frequency \(41 float64\)"):
        read(MEASURED / "brb_jointed_beam" / "ForcedFrequencyResponses.mat")
