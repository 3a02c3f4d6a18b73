"""Raw hits with known faults, recorded by others: overload of three samples, double hit."""

from pathlib import Path

import pytest

from receptance.errors import ReceptanceWarning
from receptance.hammer import HammerRecords, find_hits
from receptance.io import read_all

FILE = Path(__file__).resolve().parents[3] / "shared" / "measured" / "impact_faults" / "impact2_response0.lvm.gz"


@pytest.mark.skipif(not FILE.exists(), reason=f"measured data are not there: {FILE.name}")
def test_known_faults_of_five_hits_are_named():
    """The source says: hit 1 overflowed (three equal samples at the top of the pulse), hit 3 is a double hit."""
    records = [
        HammerRecords.from_series(series, force="Force (Trigger)", responses="Acceleration (Trigger)")
        for series in read_all(FILE)
    ]
    with pytest.warns(ReceptanceWarning, match="hit 1 dropped: overload"):
        hits = find_hits(records)
    assert [hit.number for hit in hits.kept] == [2, 4, 5]
    assert "the force has a flat top of 3 samples at 2000" in hits.hits[0].reason
    assert "double hit: a contact with 20 % of the force" in hits.hits[2].reason
