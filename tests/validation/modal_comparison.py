"""Modal estimates of other programs and of the library on known modes: `python tests/validation/modal_comparison.py`.

Needs `pip install sdypy-EMA` and SciPy 1.15 or later, which the project does not; docs/modal.md shows what it prints.
Three modes, the first two 2 % apart, four responses, white noise of some share of the rms value.
"""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from known_modes import values_of
from receptance import FRF
from receptance.modal import fit_modes

F = np.arange(0.0, 1001.0)
BAND = (F >= 200.0) & (F <= 800.0)
TRUE_HZ, TRUE_DAMPING = np.array([300.0, 306.0, 620.0]), np.array([0.008, 0.01, 0.005])
CONSTANTS = np.random.default_rng(1).normal(size=(3, 4))
SEEDS = 20

Found = tuple[np.ndarray, np.ndarray]


def sdypy_ema(values: np.ndarray) -> Found:
    """Its LSCF and its choice of the stable poles nearest to the true frequencies."""
    from sdypy import EMA

    model = EMA.Model(values.T, F, lower=200, upper=800, pol_order_high=30, frf_form="receptance")
    model.get_poles(show_progress=False)
    model.select_closest_poles(list(TRUE_HZ), f_window=5)
    return np.asarray(model.nat_freq), np.asarray(model.nat_xi)


def aaa(values: np.ndarray) -> Found:
    """SciPy's AAA of the largest response, with the poles nearest to the true frequencies."""
    from scipy.interpolate import AAA

    largest = int(np.argmax(np.abs(values[BAND]).sum(axis=0)))
    poles = AAA(2j * np.pi * F[BAND], values[BAND, largest], max_terms=12).poles()
    poles = poles[(poles.imag > 0.0) & (poles.real < 0.0)]
    size = np.abs(poles)
    nearest = [int(np.argmin(np.abs(size / (2.0 * np.pi) - f))) for f in TRUE_HZ]
    return size[nearest] / (2.0 * np.pi), -poles.real[nearest] / size[nearest]


def ours(values: np.ndarray) -> Found:
    """All four responses, three modes."""
    fit = fit_modes(FRF(frequency_hz=F[BAND], values=values[BAND, :, None]), 3)
    return fit.frequency_hz, fit.damping_ratio


def main() -> None:
    """Print root-mean-square errors over the seeds."""
    exact = values_of(F, TRUE_HZ, TRUE_DAMPING, CONSTANTS)
    print("noise      method        frequency error (%)            damping error (%)")
    for noise in (0.0, 0.001, 0.01, 0.03):
        methods: tuple[Callable[[np.ndarray], Found], ...] = (sdypy_ema, aaa, ours)
        for method in methods:
            errors = []
            for seed in range(SEEDS if noise else 1):
                rng = np.random.default_rng(seed)
                deviation = noise * np.sqrt(np.mean(np.abs(exact) ** 2) / 2.0)
                values = exact + deviation * (rng.normal(size=exact.shape) + 1j * rng.normal(size=exact.shape))
                with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
                    warnings.simplefilter("ignore")
                    frequency, damping = method(values)
                errors.append([frequency / TRUE_HZ - 1.0, damping / TRUE_DAMPING - 1.0])
            rms = 100.0 * np.sqrt(np.mean(np.square(errors), axis=0))
            shown = ["  ".join(f"{value:8.2g}" for value in row) for row in rms]
            print(f"{noise:<9g}  {method.__name__:<10}  {shown[0]}   {shown[1]}")


if __name__ == "__main__":
    main()
