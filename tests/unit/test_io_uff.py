"""Synthetic universal files: layouts of other programs, damaged files, and the place in the error."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from made_uff import MM, SI, data_set, file, values
from receptance import FRF, Coordinate, ReceptanceWarning
from receptance.io import Coherence, FileFormatError, TimeSeries, read, read_all, read_frf, read_time_series, write
from receptance.model.coordinates import UnknownPosition


def test_plain(tmp_path: Path) -> None:
    frf = read_frf(file(tmp_path, SI, data_set(texts=("hit 3", "NONE", "NONE", "NONE", "NONE"))))
    assert values(frf) == [1 - 1j, 2 - 2j]
    assert frf.frequency_hz.tolist() == [1.0, 2.0]
    assert (frf.unit, frf.label, frf.labels) == ("m/s^2/N", "hit 3", (("1:+2",), ("2:+2",)))
    assert frf.source == "made.uff (universal file (data set 58))"
    assert frf.responses == (UnknownPosition("y"),)


@pytest.mark.parametrize(
    "body",
    [
        ["  1.00000D+00 -1.00000D+00  2.00000d+00 -2.00000E+00"],
        [" 1.00000E+000-1.00000E+000 2.00000E+000-2.00000E+000"],
        ["  1.00000E+00 -1.00000E+00", "  2.00000E+00 -2.00000E+00"],
        ["  1.00000E+00 -1.00000E+00  2.00000E+00 -2.00000E+00  0.00000E+00  0.00000E+00"],
        ["            1           -1            2           -2" + " " * 28],
        ["  1.00000E+00\t-1.0", "2.0 -2.0"],
    ],
    ids=["D exponents", "no blanks", "short lines", "padded", "integers", "separated"],
)
def test_number_formats_of_other_programs(body: list[str], tmp_path: Path) -> None:
    assert values(read(file(tmp_path, SI, data_set(body)))) == [1 - 1j, 2 - 2j]


def test_numbers_in_other_columns_are_noted(tmp_path: Path) -> None:
    frf = read_frf(file(tmp_path, SI, data_set(["1.0 -1.0", "2.0 -2.0"])))
    assert values(frf) == [1 - 1j, 2 - 2j]
    assert "not in the columns of the format" in frf.notes[0]


def test_values_that_look_like_a_delimiter(tmp_path: Path) -> None:
    """The number of values is known, so a delimiter among them does not end the data set."""
    body = [
        "-1.00000E+00 -1.00000E+00 -1.00000E+00 -1.00000E+00 -1.00000E+00 -1.00000E+00",
        "           -1            5",
    ]
    assert values(read(file(tmp_path, SI, data_set(body, count=4)))) == [-1 - 1j, -1 - 1j, -1 - 1j, -1 + 5j]
    binary = struct.pack("<2d", struct.unpack("<d", b"\n    -1\n")[0], 1.5)
    identity = f"    58b     1     2          11{len(binary):12d}     0     0           0           0"
    found = read(file(tmp_path, SI, data_set(binary, ordinate=6, count=1, identity=identity)))
    assert values(found) == [complex(*struct.unpack("<2d", binary))]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_line_endings_and_padding(end: str, tmp_path: Path) -> None:
    text = file(tmp_path, SI, data_set()).read_text()
    padded = end.join(f"{line:<80}" for line in text.splitlines()) + end
    assert values(read(file(tmp_path, padded.encode()))) == [1 - 1j, 2 - 2j]


def test_last_delimiter_may_be_missing(tmp_path: Path) -> None:
    with pytest.warns(ReceptanceWarning, match="the file ends without the -1 .* may be cut"):
        frf = read_frf(file(tmp_path, SI, data_set().removesuffix(b"    -1\n")))
    assert values(frf) == [1 - 1j, 2 - 2j]
    assert frf.notes == ("the file ends without the -1 that closes the data set",)


@pytest.mark.parametrize(
    ("layout", "ordinate", "even", "note"),
    [
        ("<ff", 5, 1, ""),
        (">ff", 5, 1, ""),
        ("<fff", 5, 0, ""),
        ("<dd", 6, 1, ""),
        (">fdd", 6, 0, ""),
        ("<ddd", 6, 0, ""),
        ("<fd", 4, 0, "real"),
        ("<d", 4, 1, "real"),
    ],
)
@pytest.mark.parametrize("after", [b"", b"\r\n"])
def test_binary_layouts(layout: str, ordinate: int, even: int, note: str, after: bytes, tmp_path: Path) -> None:
    """By the standard an uneven abscissa is single precision; pyuff writes doubles, which the length shows."""
    numbers = {2: (0.5, 1.0), 3: (4.0, 0.5, 1.0), 1: (0.5,)}[len(layout) - 1]
    body = b"".join(struct.pack(layout, *(k + n for n in numbers)) for k in (0, 1))
    identity = (
        f"    58b{1 if layout[0] == '<' else 2:6d}     2          11{len(body):12d}     0     0           0           0"
    )
    path = file(tmp_path, SI, data_set(body + after, ordinate=ordinate, even=even, identity=identity))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore" if note else "error", ReceptanceWarning)
        frf = read_frf(path)
    assert frf.frequency_hz.tolist() == (
        [1.0, 2.0] if even else [4.0 if len(numbers) == 3 else 0.5, 5.0 if len(numbers) == 3 else 1.5]
    )
    assert frf.values.real.ravel().tolist() == ([0.5, 1.5] if len(numbers) != 2 or ordinate > 4 else [1.0, 2.0])
    assert bool(frf.notes) == bool(note)


def test_a_wrong_number_of_bytes_is_noted(tmp_path: Path) -> None:
    """Such as pyuff 2.5.8 declares for complex data."""
    body = struct.pack("<4f", 1.0, -1.0, 2.0, -2.0)
    frf = read_frf(file(tmp_path, SI, data_set(body, identity="    58b     1     2          11           8")))
    assert values(frf) == [1 - 1j, 2 - 2j]
    assert frf.notes == (
        "8 binary bytes are declared, 2 complex single-precision values with even spacing take 16, which were read",
    )


def test_units_from_labels_data_set_164_and_options(tmp_path: Path) -> None:
    labelled = ((18, "", "Hz"), (12, "", "g"), (13, "", "lbf"))
    g_per_lbf = 9.80665 / 4.4482216152605
    assert values(read(file(tmp_path, data_set(axes=labelled)))) == pytest.approx(
        [(1 - 1j) * g_per_lbf, (2 - 2j) * g_per_lbf]
    )
    assert values(read(file(tmp_path, MM, data_set()))) == pytest.approx([(1 - 1j) * 1e-3, (2 - 2j) * 1e-3])
    rotation = {"response": (1, 6), "reference": (2, -5)}
    assert read_frf(file(tmp_path, MM, data_set(**rotation))).unit == "rad/s^2/(N m)"
    assert values(read(file(tmp_path, MM, data_set(**rotation))))[0] == pytest.approx((1 - 1j) * 1e3), "per N mm"
    theta = Coordinate("tool", 0.0, "theta")
    turned = read_frf(
        file(tmp_path, data_set()), unit="rad/s^2/(N m)", quantity="accelerance", responses=theta, excitations=theta
    )
    assert "the directions are those of a translation per force" in turned.notes[0]
    overruled = read_frf(file(tmp_path, MM, data_set()), unit="m/s^2/N")
    assert values(overruled) == [1 - 1j, 2 - 2j]
    assert "was overridden" in overruled.notes[0]
    for abscissa in ((18, "", "cycles per second"), (0, "", "Hertz")):
        assert read_frf(file(tmp_path, data_set(axes=(abscissa, *labelled[1:])))).shape == (2, 1, 1)
    whole = ((18, "", "Hz"), (0, "Inertance", "(m/s²)/N"), (0, "", ""))
    assert read_frf(file(tmp_path, data_set(axes=whole))).form == "accelerance"


@pytest.mark.parametrize(
    ("axes", "system", "options", "message"),
    [
        (((18, "", ""), (12, "", ""), (13, "", "")), [], {}, "neither a data set 164 nor axis labels"),
        (((18, "", ""), (12, "", "m/s"), (13, "", "N")), [], {}, "the file contradicts itself"),
        (((18, "", ""), (12, "", "g"), (13, "", "N")), SI, {}, "by its labels .* by data set 164"),
        (((18, "", ""), (12, "", "bananas"), (13, "", "N")), [], {}, "unknown: 'bananas'"),
        (((18, "", ""), (12, "", "dB"), (13, "", "N")), [], {}, "a level in dB"),
        (((18, "", ""), (15, "", "Pa"), (13, "", "N")), [], {}, "'\\(Pa\\)/\\(N\\)' is not the unit of a receptance"),
        (((18, "", ""), (13, "", "N"), (12, "", "g")), [], {}, "numerator of the FRF is force"),
        (((17, "", ""), (12, "", "g"), (13, "", "N")), [], {}, "abscissa's specific data type is 17, expected 18"),
        (((0, "", ""), (12, "", "g"), (13, "", "N")), [], {}, "abscissa's specific data type is 0, expected 18"),
        (((18, "", ""), (12, "", ""), (13, "", "")), [], {"unit": "m/N"}, "to override the file give quantity="),
        (
            ((18, "", ""), (12, "", ""), (13, "", "")),
            [],
            {"unit": "rad/s^2/N", "quantity": "accelerance"},
            "directions are those of a translation per force; give unit='SI' if all of the file is in SI",
        ),
        (
            ((18, "", ""), (12, "", ""), (13, "", "")),
            [],
            {"unit": "m/N", "quantity": "mobility"},
            "give a matching quantity=",
        ),
    ],
)
def test_missing_and_contradictory_units(
    axes: Any, system: list[str], options: Any, message: str, tmp_path: Path
) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        read(file(tmp_path, system, data_set(axes=axes)) if system else file(tmp_path, data_set(axes=axes)), **options)
    assert caught.value.line == (8 if system else 2)
    assert str(caught.value).startswith("made.uff, line ")


REPLACED = [
    (2, "   5x", "made.uff, line 2: the number of the data set is '5x'"),
    (2, "    -1", "line 2: found -1, expected the number of a data set"),
    (2, "    58c", "line 2: found '    58c', expected 58, or 58b"),
    (8, "   x4" + " " * 70, "line 8: the function type is 'x4'"),
    (
        8,
        f"    4{0:10d}{0:5d}{0:10d} NONE      {1:10d}   9 NONE      {1:10d}   2",
        "line 8: the response's direction is 9",
    ),
    (9, f"{3:10d}{2:10d}{1:10d}", "line 9: the ordinate data type is 3"),
    (9, f"{5:10d}{0:10d}{1:10d}", "line 9: the number of values is 0"),
    (9, f"{5:10d}{-4:10d}{1:10d}", "line 9: the number of values is -4"),
    (9, f"{5:10d}{2:10d}{7:10d}", "line 9: the abscissa spacing is 7"),
    (9, f"{5:10d}{2:10d}{1:10d}  1.00000E+00  0.00000E+00", "line 9: the abscissa increment is 0"),
    (9, f"{5:10d}{2:10d}{1:10d}        1e999  1.00000E+00", "line 9: the abscissa minimum is '1e999'"),
    (
        9,
        f"{5:10d}{3:10d}{1:10d}  1.00000E+00  1.00000E+00",
        "line 15: the data set ends after 4 of the 6 numbers .* line 9",
    ),
    (9, f"{5:10d}{1:10d}{1:10d}  1.00000E+00  1.00000E+00", None),
    (10, "        18    x", "line 10: the abscissa's length exponent is 'x'"),
    (14, "  1.00000E+00 -1.00000E+00  2.0000xE+00 -2.00000E+00", "line 14: number 3 of 4 is '2.0000xE\\+00'"),
    (14, "  1.00000E+00          NaN  2.00000E+00 -2.00000E+00", "line 14: number 2 of 4 is 'NaN'"),
    (14, "  1.00000E+00 -1.0E+00 3    2.00000E+00 -2.00000E+00", "line 14: number 2 of 4 is '-1.0E\\+00 3'"),
    (15, "something", "line 15: found 'something' after 2 complex single-precision values"),
    (5, "    -1", "line 5: the data set ends here, expected record 3 of the 11 before the data"),
]


@pytest.mark.parametrize(
    ("line", "text", "message"), REPLACED, ids=[f"{line}-{k}" for k, (line, _, _) in enumerate(REPLACED)]
)
def test_damaged_lines(line: int, text: str, message: str | None, tmp_path: Path) -> None:
    lines = data_set(axes=((18, "", ""), (12, "", "g"), (13, "", "N"))).decode().splitlines()
    lines[line - 1] = text
    path = file(tmp_path, lines)
    if message is None:
        assert len(values(read(path))) == 1, "text behind the values on the last line is padding"
        return
    with pytest.raises(FileFormatError, match=message):
        read(path)


@pytest.mark.parametrize(
    ("identity", "body", "message"),
    [
        ("    58b     3     2          11          16", b"\0" * 16, "line 8: the byte order is 3"),
        (
            "    58b     1     1          11          16",
            b"\0" * 16,
            "line 8: the floating-point format is 1 \\(DEC VMS\\)",
        ),
        ("    58b     1     3          11          16", b"\0" * 16, "\\(IBM 370\\)"),
        ("    58b     1     2          12          16", b"\0" * 16, "line 8: the number of header lines is 12"),
        (
            "    58b     1     2          11          16",
            b"\0" * 20,
            "byte \\d+: binary data begin here; 2 complex .* take 16 bytes",
        ),
        (
            "    58b     1     2          11          16",
            struct.pack("<4f", 1, np.nan, 1, 1),
            "byte \\d+: value 1 of 2 is",
        ),
    ],
)
def test_damaged_binary_data(identity: str, body: bytes, message: str, tmp_path: Path) -> None:
    path = file(tmp_path, SI, data_set(body, identity=identity))
    with pytest.raises(FileFormatError, match=message) as caught:
        read(path)
    if caught.value.byte is not None:
        assert path.read_bytes()[caught.value.byte :].startswith(body[:1])


def test_damaged_data_set_164(tmp_path: Path) -> None:
    for number, line, message in (
        (3, f"{'x':>25}", "line 4: factor 1 of the units is 'x'"),
        (3, f"{0.0:25.17E}" * 3, "line 3: the factors of length and force are 0 and 0"),
        (4, "    -1", None),
        (3, "    -1", "line 4: data set 164 ends after 0 factors"),
    ):
        lines = list(SI)
        lines[number] = line
        if message is None:
            assert values(read(file(tmp_path, lines[:5], data_set())))
            continue
        with pytest.raises(FileFormatError, match=message):
            read(file(tmp_path, lines, data_set()))


def test_labels_beyond_ascii(tmp_path: Path) -> None:
    """Columns counted in characters (Python) or in bytes (others); Latin-1 or UTF-8."""
    axes = ((18, "", ""), (0, "Größe", "(m/s²)/N"), (0, "", ""))
    for data in (data_set(axes=axes), data_set(axes=axes).decode().encode("latin-1")):
        assert read_frf(file(tmp_path, data)).form == "accelerance"
    in_bytes = data_set(axes=axes).decode().replace("Größe" + " " * 16, "Größe" + " " * 14).encode()
    assert read_frf(file(tmp_path, in_bytes)).form == "accelerance"


def test_matrices_coherences_and_remaining_functions(tmp_path: Path) -> None:
    coherence = {"function": 6, "ordinate": 2, "axes": ((18, "", ""), (0, "", ""), (0, "", ""))}
    share = ["  9.00000E-01  8.00000E-01"]
    parts = [data_set(response=(row, 2), reference=(column, 2)) for row in (1, 2) for column in (1, 3)]
    parts += [
        data_set(share, response=(row, 2), reference=(column, 2), **coherence) for row in (1, 2) for column in (1, 3)
    ]
    matrix = read_frf(file(tmp_path, SI, *parts))
    assert matrix.shape == (2, 2, 2)
    assert matrix.labels == (("1:+2", "2:+2"), ("1:+2", "3:+2"))
    assert matrix.coherence is not None
    assert np.all(matrix.coherence[:, 1, 1] == [0.9, 0.8])
    without = read_frf(file(tmp_path, SI, *parts), ignore_coherence=True)
    assert (without.coherence, without.notes) == (None, ("the coherence in the file was ignored on request",))
    missing = read_all(file(tmp_path, SI, *parts[:-1]))
    assert [type(thing) for thing in missing] == [FRF, Coherence, Coherence, Coherence], (
        "nothing is lost where one is missing"
    )
    hole = read_all(file(tmp_path, SI, *parts[:3]))
    assert [thing.values.shape for thing in hole] == [(2, 1, 1)] * 3
    twice = read_all(file(tmp_path, SI, parts[0], parts[0], data_set(function=2)))
    assert len(twice) == 2
    assert twice[0].notes == ("not read: auto spectrum (1 in the file)",)
    with pytest.raises(FileFormatError, match=r"the file holds 2 measurements, expected one: .* read_all returns all"):
        read(file(tmp_path, SI, parts[0], parts[0]))
    both = [data_set(response=(1, 2)), data_set(response=(1, 6), axes=((18, "", ""), (8, "", ""), (13, "", "")))]
    assert sorted(thing.form for thing in read_all(file(tmp_path, SI, *both))) == ["accelerance", "receptance"]


def test_coherence_above_one_and_complex(tmp_path: Path) -> None:
    share = {"function": 6, "axes": ((18, "", ""), (0, "", ""), (0, "", ""))}
    bad = data_set(["  1.20000E+00  8.00000E-01"], ordinate=2, **share)
    for path in (file(tmp_path, SI, data_set(), bad), file(tmp_path, bad)):
        with pytest.raises(FileFormatError, match=r"the coherence at 1 Hz is 1.2"):
            read(path)
    with pytest.raises(FileFormatError, match="line 2: the coherence is complex"):
        read(file(tmp_path, data_set(**share)))


def test_time_series_are_grouped_by_sampling(tmp_path: Path) -> None:
    def record(node: int, kind: int, unit: str, count: int = 2) -> bytes:
        axes = ((17, "", "s"), (kind, "", unit), (0, "", ""))
        body = ["  1.00000E+00  2.00000E+00"] if count == 2 else ["  1.00000E+00"]
        return data_set(body, function=1, ordinate=2, count=count, response=(node, 2), axes=axes, step="1.00000E-03")

    two_hits = [record(1, 13, "N"), record(2, 12, "g")] * 2
    first, second = read_all(file(tmp_path, *two_hits))
    assert isinstance(first, TimeSeries)
    assert first.channels == ("1:+2", "2:+2")
    assert first.units == ("N", "m/s^2")
    assert first.values[0].tolist() == [1.0, 9.80665]
    assert first.sample_rate_hz == 1000.0
    assert np.array_equal(first.values, second.values)
    repeated = read_time_series(file(tmp_path, record(1, 12, "g"), record(2, 12, "g"), record(1, 12, "g")))
    assert repeated.channels == ("1:+2", "2:+2", "1:+2 (2)")
    assert len(read_all(file(tmp_path, record(1, 12, "g"), record(2, 12, "g", count=1)))) == 2
    for unit, options, message in (
        ("", {}, "the unit of channel '1:\\+2'; give it, for example unit={'1:\\+2': 'N'}"),
        ("m/s", {}, "declared as acceleration"),
        ("g", {"unit": {"1:+2": "m/s^2/N"}}, "is the unit of an FRF, but channel"),
        ("g", {"sample_rate_hz": 1234.0}, "sample_rate_hz is 1234, but the file has 1000"),
        ("g", {"quantity": "mobility"}, "quantity was given, but there is no FRF in the file"),
    ):
        with pytest.raises(FileFormatError, match=message):
            read(file(tmp_path, record(1, 12, unit)), **options)
    with pytest.raises(FileFormatError, match="a single unit, 'g', was given for 2 channels"):
        read(file(tmp_path, record(1, 12, ""), record(2, 12, "")), unit="g")
    assert read_time_series(file(tmp_path, MM, record(1, 12, ""))).values[0, 0] == pytest.approx(1e-3)
    assert read_time_series(file(tmp_path, record(1, 12, "")), unit="SI").units == ("m/s^2",)


def test_the_nth_function_of_a_pair_belongs_to_the_nth_matrix(tmp_path: Path) -> None:
    """Two runs over two points, one after the other and interlaced; a third of one point alone."""
    runs = [
        [data_set([f"  {run}.{point}0000E+00" + "  0.00000E+00" * 3], response=(point, 2)) for point in (1, 2)]
        for run in (1, 2)
    ]
    for order in ([*runs[0], *runs[1]], [runs[0][0], runs[1][0], runs[0][1], runs[1][1]]):
        found = read_all(file(tmp_path, SI, *order, data_set(["  9.10000E+00" + "  0.00000E+00" * 3])))
        assert [thing.values[0].ravel().real.tolist() for thing in found] == [[1.1, 1.2], [2.1, 2.2], [9.1]]


CUT = "its last characters are missing"
EIGHT = [f"{value:13.5E}" * 6 for value in (1.5e-9, -8.5e-9, 2.5e-9, 4.5e-9)]
"""Four full lines of twelve complex values."""


@pytest.mark.parametrize("lost", [1, 2, 3, 4, 6, 8])
@pytest.mark.parametrize("line", [0, 1, 3])
def test_a_line_that_lost_its_last_characters_is_refused(line: int, lost: int, tmp_path: Path) -> None:
    """-8.5E-09 without its exponent is -8.5."""
    body = [text[:-lost] if index == line else text for index, text in enumerate(EIGHT)]
    with pytest.raises(FileFormatError, match=rf"line {20 + line}: (the line ends with|number \d+ of 24 is)"):
        read(file(tmp_path, SI, data_set(body, count=12)))


@pytest.mark.parametrize("lost", [4, 6])
def test_a_file_that_ends_within_a_number_is_refused(lost: int, tmp_path: Path) -> None:
    whole = file(tmp_path, SI, data_set(EIGHT, count=12)).read_bytes()
    with pytest.raises(FileFormatError, match=CUT):
        read(file(tmp_path, whole.removesuffix(b"\n    -1\n")[:-lost]))
    one_line = file(tmp_path, SI, data_set()).read_bytes().removesuffix(b"\n    -1\n")
    with pytest.raises(FileFormatError, match=r"ends with '-2.0*'.*" + CUT):
        read(file(tmp_path, one_line[:-lost]))


def test_numbers_separated_by_blanks_without_the_last_exponent_are_refused(tmp_path: Path) -> None:
    body = ["1.5E-09 2.5E-09", "2.5E-09 3.5E-09", "2.5E-09 -8.5"]
    with pytest.raises(FileFormatError, match=r"ends with '-8\.5', but the other numbers have an exponent"):
        read(file(tmp_path, SI, data_set(body, count=3)))
    whole = values(read(file(tmp_path, SI, data_set([*body[:2], "2.5E-09 -8.5E-09"], count=3))))
    assert whole == [1.5e-9 + 2.5e-9j, 2.5e-9 + 3.5e-9j, 2.5e-9 - 8.5e-9j]


def test_a_header_line_that_ends_within_a_number_is_refused(tmp_path: Path) -> None:
    text = file(tmp_path, SI, data_set(step="2.50000E+01")).read_bytes()
    assert read_frf(file(tmp_path, text)).frequency_hz.tolist() == [1.0, 26.0]
    cut = text.replace(b"  2.50000E+01  0.00000E+00", b"  2.50000")
    with pytest.raises(FileFormatError, match=r"abscissa increment is '2.50000', and the line ends before column 56"):
        read(file(tmp_path, cut))
    units = text.replace(f"{1.0:25.17E}".encode(), f"{1e-3:25.17E}".encode(), 3)
    cut = units.replace(f"{1e-3:25.17E}\n".encode(), f"{1e-3:25.17E}"[:-4].encode() + b"\n", 1)
    with pytest.raises(FileFormatError, match=r"factor 3 of the units is .*" + CUT):
        read(file(tmp_path, cut))


@pytest.mark.parametrize(("layout", "ordinate"), [("ff", 5), ("dd", 6)])
@pytest.mark.parametrize("stated", ["<", ">"])
@pytest.mark.parametrize("factor", [1.0, 1e-9, 1e6])
def test_binary_numbers_in_the_other_byte_order_are_turned_with_a_note(
    layout: str, ordinate: int, stated: str, factor: float, tmp_path: Path
) -> None:
    rng = np.random.default_rng(1)
    numbers = np.float32(factor * (rng.normal(size=40) + 1j * rng.normal(size=40)).view(float)).tolist()
    written = {"<": ">", ">": "<"}[stated]
    identity = f"    58b{1 if stated == '<' else 2:6d}     2          11{struct.calcsize(layout) * 40:12d}{0:6d}{0:6d}"
    for order in (stated, written):
        body = struct.pack(order + layout * 40, *numbers)
        path = file(tmp_path, SI, data_set(body, ordinate=ordinate, count=40, identity=identity))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            frf = read_frf(path)
        np.testing.assert_array_equal(frf.values[:, 0, 0].view(float), numbers)
        told = [str(warning.message) for warning in caught]
        assert len(told) == (order != stated)
        assert all("in the byte order that the header states" in text and text in frf.notes for text in told)


def test_text_between_data_sets_and_a_byte_order_mark_are_skipped(tmp_path: Path) -> None:
    remark = b"exported by X, 12.5 kHz\nsecond remark\n"
    path = file(tmp_path, b"\xef\xbb\xbf" + file(tmp_path, SI).read_bytes(), remark, data_set(), remark)
    frf = read_frf(path)
    assert values(frf) == [1 - 1j, 2 - 2j]
    assert frf.notes == ("4 lines of text between the data sets were skipped, the first is line 7",)
    for line in (b"  1.00000E+00  2.00000E+00\n", b"    58\n"):
        with pytest.raises(FileFormatError, match="expected a line with -1 in columns 5 and 6"):
            read(file(tmp_path, SI, line, data_set()))


COHERENCE = ["  5.00000E-01  7.50000E-01"]


@pytest.mark.parametrize("points", [{"reference": (0, 0)}, {"response": (0, 0), "reference": (0, 0)}])
def test_a_coherence_without_a_reference_belongs_to_the_only_frf(points: dict[str, Any], tmp_path: Path) -> None:
    coherence = data_set(COHERENCE, function=6, ordinate=2, **points)
    frf = read_frf(file(tmp_path, SI, data_set(), coherence))
    assert frf.coherence is not None
    assert frf.coherence.ravel().tolist() == [0.5, 0.75]
    assert frf.notes == ("the coherence states no reference point: it is the only one on the lines of the FRF",)
    # Of two FRFs it may be that of either.
    two = read_all(file(tmp_path, SI, data_set(), data_set(reference=(3, 2)), coherence))
    assert [type(one) for one in two] == [FRF, Coherence]
    assert isinstance(two[0], FRF)
    assert two[0].coherence is None


def test_a_coherence_that_is_not_assigned_is_told(tmp_path: Path) -> None:
    coherence = data_set(COHERENCE, function=6, ordinate=2, response=(7, 2))
    path = file(tmp_path, SI, data_set(), coherence)
    with pytest.warns(ReceptanceWarning, match="a coherence that was not assigned to the FRF"):
        frf = read_frf(path)
    assert frf.coherence is None
    assert "read_all returns it" in frf.notes[0]
    assert read_frf(path, ignore_coherence=True).notes == ()


def test_a_coherence_written_beside_an_frf_stays_separate(tmp_path: Path) -> None:
    frf = FRF(frequency_hz=[1.0, 2.0], values=[1.0 - 1j, 2.0], label="before")
    write(tmp_path / "both.uff", [frf, Coherence(frequency_hz=[1.0, 2.0], values=[0.5, 0.75], label="after")])
    first, second = read_all(tmp_path / "both.uff")
    assert isinstance(first, FRF)
    assert first.coherence is None
    assert (second.label, second.values.ravel().tolist()) == ("after", [0.5, 0.75])


def test_another_label_of_the_coherence_is_noted(tmp_path: Path) -> None:
    labelled = [("first hit", *("NONE",) * 4), ("second hit", *("NONE",) * 4)]
    coherence = data_set(COHERENCE, function=6, ordinate=2, texts=labelled[1])
    frf = read_frf(file(tmp_path, SI, data_set(texts=labelled[0]), coherence))
    assert frf.notes == ("the coherence is labelled 'second hit'; it has the points and lines of the FRF",)
