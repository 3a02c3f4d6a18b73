"""Spindles in files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from receptance import FRF, MeasuredPart, ModalPart, Mode, io
from receptance.coupling import SpindleModes, read_spindle, write_spindle

LINES = np.linspace(100.0, 2000.0, 40)


def table() -> MeasuredPart:
    pole = 1.0 / (1.0 - (LINES / 900.0) ** 2 + 0.05j * LINES / 900.0)
    matrix = pole[:, None, None] * np.array([[2e-8, 3e-8], [3e-8, 1e-6]])
    covariance = np.einsum("n,ij->nij", np.abs(pole) ** 2, np.diag([4e-20, 1e-16, 9e-20])).astype(complex)
    covariance[:, 0, 1] = 1e-18j
    covariance[:, 1, 0] = -1e-18j
    return MeasuredPart(
        frequency_hz=LINES, matrix=matrix, covariance=covariance, decay_rate=3.0, residual_y=1e-9, name="spindle"
    )


def test_round_trip(tmp_path: Path) -> None:
    write_spindle(tmp_path / "s.npz", table())
    found = read_spindle(tmp_path / "s.npz", name="nose")
    np.testing.assert_array_equal(found.frequency_hz, LINES)
    np.testing.assert_allclose(found.matrix - table().matrix, np.diag([1e-9, 0.0])[None].repeat(40, 0), atol=1e-24)
    np.testing.assert_array_equal(found.covariance, table().covariance)
    assert (found.decay_rate, found.name) == (3.0, "nose")
    assert [path.name for path in tmp_path.iterdir()] == ["s.npz"]


def modes(seed: int) -> SpindleModes:
    """Return modes with complex shapes, residuals and a covariance, all of random digits over many decades."""
    rng = np.random.default_rng(seed)

    def number() -> float:
        return float(rng.normal() * 10.0 ** rng.uniform(-9.0, 2.0))

    shapes = [
        Mode(
            frequency_hz=float(rng.uniform(10.0, 4000.0)),
            damping_ratio=float(rng.uniform(1e-4, 0.3)),
            **{name: number() for name in Mode.columns_of[2:]},
        )
        for _ in range(6)
    ]
    residuals = {f"residual_{name}": number() for name in ("y", "theta", "ytheta")}
    part = ModalPart(modes=shapes, band_hz=(100.0 / 3.0, 4000.0), discrepancy=1.0 / 300.0, name="spindle", **residuals)
    root = rng.normal(size=(39, 39)) * 10.0 ** rng.uniform(-12.0, 1.0, size=39)[:, None]
    return SpindleModes(part=part, covariance=root @ root.T)


@pytest.mark.parametrize("seed", range(4))
def test_modes_come_back_bit_for_bit(tmp_path: Path, seed: int) -> None:
    written = modes(seed)
    write_spindle(tmp_path / "s.toml", written)
    found = read_spindle(tmp_path / "s.toml")
    assert isinstance(found, SpindleModes)
    assert found.part == written.part
    np.testing.assert_array_equal(found.covariance, written.covariance)
    assert found.tolerances == written.tolerances
    content = (tmp_path / "s.toml").read_bytes()
    write_spindle(tmp_path / "s.toml", found)
    assert (tmp_path / "s.toml").read_bytes() == content


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('format = "receptance spindle modes 1"', 'format = "other"', r"has the format \"other\""),
        ("[[modes]]", "[[mode]]", "has the key 'mode', expected format"),
        ("damping_ratio =", "damping =", r"modes\[0\].damping is not a known key"),
        ('frequency_hz = "', 'frequency_hz = "-', r"modes\[0\].frequency_hz is"),
        ("discrepancy = 0", 'discrepancy = "a lot"  # 0', "discrepancy is"),
        ('band = [\n    "33.', 'band = [\n    "5 Hz", "33.', "band is"),
        ("[uncertainty]", "[uncertain]", "has the key 'uncertain'"),
        ("covariance = [\n    [", "covariance = [\n    [1.0, ", "is no square matrix of numbers"),
        ("covariance = [\n    [", "covariance = [\n    [-", r"a negative variance of mode\[0\].frequency_hz"),
    ],
)
def test_mistakes_in_a_file_of_modes(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "s.toml"
    write_spindle(path, modes(1))
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ValueError, match=rf"s\.toml: .*({message})"):
        read_spindle(path)


def test_damaged_files_of_modes(tmp_path: Path) -> None:
    """Wrong bytes, lost ends and other values raise a ValueError with the name of the file, or the file is read."""
    path, seed = tmp_path / "damaged.toml", 3
    print(f"seed {seed}")
    write_spindle(path, modes(1))
    whole, rng = path.read_bytes(), np.random.default_rng(seed)
    values = [match.span() for match in re.finditer(rb"[^\s\[\],=\"]+", whole)]
    others = [b"1e999", b"nan", b"-1", b"9" * 400, b"[", b'"', b"true", b"1e308", b"{}", b"1979-05-27"]
    messages = []
    for number in range(300):
        damaged = bytearray(whole)
        if number % 3 == 0:
            damaged[rng.integers(0, len(whole))] = rng.integers(0, 256)
        elif number % 3 == 1:
            del damaged[rng.integers(0, len(whole)) :]
        else:
            first, last = values[rng.integers(0, len(values))]
            damaged[first:last] = others[rng.integers(0, len(others))]
        path.write_bytes(bytes(damaged))
        try:
            assert isinstance(read_spindle(path), SpindleModes)
        except ValueError as error:
            messages.append(str(error))
    assert len(messages) > 200
    assert all("damaged.toml" in message for message in messages)


def test_an_frf_matrix_of_another_program(tmp_path: Path) -> None:
    part = table()
    frf = FRF(
        frequency_hz=LINES,
        values=part.matrix,
        responses=["y", "theta"],
        excitations=["y", "theta"],
        log_variance=np.full(part.matrix.shape, 1e-4),
    )
    io.write(tmp_path / "matrix.npz", frf)
    found = read_spindle(tmp_path / "matrix.npz")
    np.testing.assert_allclose(found.matrix, part.matrix)
    assert found.covariance is not None
    np.testing.assert_allclose(found.covariance[:, 0, 0].real, 1e-4 * np.abs(part.matrix[:, 0, 0]) ** 2)
    np.testing.assert_allclose(found.covariance[:, 2, 2].real, 1e-4 * np.abs(part.matrix[:, 0, 1]) ** 2)


def test_damaged_files(tmp_path: Path) -> None:
    """Truncated files and files with wrong bytes raise a ValueError with the name of the file, or have the content."""
    path = tmp_path / "damaged.npz"
    write_spindle(path, table())
    whole, rng = path.read_bytes(), np.random.default_rng(7)
    messages = []
    for number in range(900):
        damaged = bytearray(whole)
        if number % 3:
            for place in rng.integers(0, len(whole), size=rng.integers(1, 5)):
                damaged[place] = rng.integers(0, 256)
        else:
            del damaged[rng.integers(0, len(whole)) :]
        path.write_bytes(bytes(damaged))
        try:
            np.testing.assert_array_equal(read_spindle(path).frequency_hz, LINES)
        except ValueError as error:
            messages.append(str(error))
    assert len(messages) > 800
    assert all("damaged.npz" in message for message in messages)


def test_mistakes_name_the_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"s\.csv: .*expected the suffix \.npz"):
        write_spindle(tmp_path / "s.csv", table())
    with pytest.raises(ValueError, match=r"s\.npz: .*expected the suffix \.toml"):
        write_spindle(tmp_path / "s.npz", modes(1))
    (tmp_path / "s.npz").write_bytes(b"nothing of that kind")
    with pytest.raises(ValueError, match=r"s\.npz"):
        read_spindle(tmp_path / "s.npz")
    with pytest.raises(OSError, match=r"none\.npz"):
        read_spindle(tmp_path / "none.npz")
    io.write(tmp_path / "tip.npz", FRF(frequency_hz=LINES, values=table().matrix[:, 0, 0]))
    with pytest.raises(ValueError, match=r"tip.npz: .*expected y, theta and y, theta"):
        read_spindle(tmp_path / "tip.npz")


def test_invalid_contents_name_the_file(tmp_path: Path) -> None:
    """A change of any byte: the content is unchanged, or the file is refused with its name."""
    path = tmp_path / "s.npz"
    write_spindle(path, table())
    content, whole = path.read_bytes(), read_spindle(path)
    refused = []
    places = range(0, len(content), 23)
    for at in places:
        path.write_bytes(content[:at] + bytes([content[at] ^ 0xFF]) + content[at + 1 :])
        try:
            np.testing.assert_array_equal(read_spindle(path).matrix, whole.matrix)
        except ValueError as error:
            refused.append(str(error))
    assert all("s.npz" in message for message in refused)
    assert len(refused) > 0.8 * len(places)
