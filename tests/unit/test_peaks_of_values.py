"""Local maxima and prominences against SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks

from receptance._peaks import local_maxima


@pytest.mark.parametrize("seed", range(8))
def test_they_are_those_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=rng.integers(1, 400)).cumsum() * rng.integers(0, 2) + rng.normal(size=1)
    if seed % 2:
        values = np.round(values)  # equal neighbours, and maxima of equal height
    for prominence in (0.0, 0.5, 2.0):
        places, found = local_maxima(values, prominence)
        expected, properties = find_peaks(values, prominence=prominence)
        np.testing.assert_array_equal(places, expected)
        np.testing.assert_array_equal(found, properties["prominences"])
