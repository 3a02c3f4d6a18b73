"""Records of hits, the FRF with its scatter, and the joint identified from it."""

import warnings

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    Observation,
    Part,
    PointJoint,
    ReceptanceWarning,
    Segment,
    Unknown,
    identify,
)
from receptance.hammer import estimate_frf, find_hits, simulate_hits

tool = Part([Segment(length=0.06, outer_diameter=0.0127, material=CARBIDE)], name="tool")
holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
bench = Assembly([tool, PointJoint(k_y=6.3e8, k_theta=1e5, c_y=500.0, c_theta=0.5, name="joint"), holder])
tip = Coordinate("tool", 0.0)
records = simulate_hits(
    bench, response=tip, excitation=tip, hits=8, duration_s=0.2, contact_s=1e-4, double_hits=[3], seed=5
)

with warnings.catch_warnings():
    warnings.simplefilter("ignore", ReceptanceWarning)  # the notes of the FRF contain them
    hits = find_hits(records)
    frf = estimate_frf(hits, decay_rate=60.0, high_hz=12e3)
print(f"{len(hits.kept)} of {len(hits.hits)} hits are kept; {hits.notes[-1]}")

found = identify(
    Observation.from_frf(bench, frf),
    [
        Unknown(address="joint.k_y", lower=1e7, upper=1e10),
        Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
        Unknown(address="joint.c_y", lower=1.0, upper=1e5),
        Unknown(address="joint.c_theta", lower=1e-3, upper=10.0),
    ],
)
for address, value in found.values.items():
    print(f"{address:14s} {value:.3e} +- {found.standard_errors[address]:.0e}")
figure = found.plot()
