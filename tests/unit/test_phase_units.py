"""Phases whose numbers are those of the other unit are named when a column is read."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from receptance.errors import ReceptanceWarning
from receptance.io import read

F = np.arange(2.0, 3001.0, 2.0)
H = 1e-8 / (1.0 - (F / 922.0) ** 2 + 0.022j * F / 922.0)


def write_table(path, phase, unit):
    rows = [f"{f!r},{a!r},{p!r}" for f, a, p in zip(F.tolist(), np.abs(H).tolist(), phase.tolist(), strict=True)]
    path.write_text("\n".join([f"frequency [Hz],magnitude [m/N],phase [{unit}]", *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("phase", "unit", "text"),
    [
        (np.angle(H), "deg", r"the phase is within 3\.13\d degrees: if it is in radians"),
        (np.angle(H, deg=True), "rad", r"the phase reaches 17\d\.\d radians, more than a turn: if it is in degrees"),
    ],
)
def test_numbers_of_the_other_unit_are_named(tmp_path, phase, unit, text):
    with pytest.warns(ReceptanceWarning, match=text):
        frf = read(write_table(tmp_path / "tip.csv", phase, unit))
    assert any("the phase" in note for note in frf.notes)
    np.savez(tmp_path / "tip.npz", frequency_hz=F, magnitude=np.abs(H), phase=phase)
    names = {"frequency_hz": "frequency_hz", "magnitude": "magnitude", f"phase_{unit}": "phase"}
    with pytest.warns(ReceptanceWarning, match=text):
        read(tmp_path / "tip.npz", variables=names, unit="m/N")


@pytest.mark.parametrize(
    ("phase", "unit"),
    [
        (np.angle(H), "rad"),
        (np.angle(H) % (2.0 * np.pi), "rad"),
        (np.angle(H, deg=True), "deg"),
        (np.full(F.size, 0.3), "deg"),  # far below a resonance
    ],
)
def test_numbers_of_their_unit_pass(tmp_path, phase, unit):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read(write_table(tmp_path / "tip.csv", phase, unit))
