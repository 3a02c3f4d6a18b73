"""Coverage of predictions of real structures: 90 to 98 % of held-out natural frequencies, within chance."""

from __future__ import annotations

import numpy as np
import pytest

from blind.seeds import fresh_seed
from real.coverage import Coverage, Trial, measure, table, trials
from real.structures import MEASURED
from receptance import STEEL, Assembly, Observation, Part, Segment, Unknown

SEED = fresh_seed()


def trial_of(factor: float) -> Trial:
    """Return bars of three lengths whose measured natural frequencies are the model's times a factor and noise."""
    random = np.random.default_rng([SEED, 1])
    observations = []
    for length in (0.2, 0.3, 0.4):
        bar = Assembly([Part([Segment(length=length, outer_diameter=0.02, material=STEEL)], name="bar")])
        true = bar.lowest_natural_frequencies(5)[0]
        measured = true * (1.0 + 1e-3 * random.normal(size=true.size)) * np.where(np.arange(5) == 2, factor, 1.0)
        spread = 1e-3 * true
        observations.append(
            Observation.from_modes(
                assembly=bar, frequency_hz=measured, standard_deviation_hz=spread, configuration=f"{length} m"
            )
        )
    modulus = Unknown(address="bar.segment[0].youngs_modulus", lower=1e11, upper=4e11)
    return Trial("bars", tuple(observations), (modulus,), ())


def test_the_measure_of_coverage() -> None:
    """A model that is right covers; one that misses the third mode by 2 % is told by its other configurations."""
    print(f"RECEPTANCE_TEST_SEED={SEED}")
    right, wrong = measure(trial_of(1.0)), measure(trial_of(1.02))
    assert right.modes == wrong.modes == 15
    assert right.inside >= 12
    assert wrong.inside >= 13
    assert np.median(wrong.widths) > 3.0 * np.median(right.widths)
    assert "counted: " in table([right, wrong])


@pytest.mark.slow
@pytest.mark.skipif(not MEASURED.is_dir(), reason="the measured files of others are not beside the checkout")
def test_intervals_hold_natural_frequencies_of_real_structures() -> None:
    coverages: list[Coverage] = [measure(trial) for trial in trials() if not trial.untested]
    print(table(coverages))
    inside, modes = sum(coverage.inside for coverage in coverages), sum(coverage.modes for coverage in coverages)
    assert modes > 150
    assert 0.90 <= round(inside / modes, 2) <= 0.98
    lines_inside = sum(coverage.lines_inside for coverage in coverages)
    assert lines_inside / sum(coverage.lines for coverage in coverages) >= 0.90
