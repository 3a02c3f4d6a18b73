"""A bar and an FRF of it with everything that an FRF can have, for the tests of FRFs."""

import numpy as np

from receptance import FRF, STEEL, Assembly, Coordinate, Part, Segment

BAR = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
TIP, END = Coordinate("bar"), Coordinate("bar", "end")
SLOPE = Coordinate("bar", 0.0, "theta")
LINES = np.linspace(50.0, 5000.0, 100)
VALUES = BAR.receptance(LINES, response=[TIP, END, SLOPE], excitation=[TIP, SLOPE])


def make(**changes):
    fields = {
        "frequency_hz": LINES,
        "values": VALUES,
        "responses": [TIP, END, SLOPE],
        "excitations": [TIP, SLOPE],
        "coherence": np.linspace(0.5, 1.0, LINES.size),
        "averages": 10,
        "log_variance": np.linspace(1e-4, 1e-2, LINES.size),
        "degrees_of_freedom": 18,
        "usable": LINES > 100.0,
        "labels": (("1:+Y", "2:+Y", "1:+RZ"), ("1:+Y", "1:+RZ")),
        "label": "blank",
        "source": "simulated",
        "notes": ["first note"],
    }
    return FRF(**(fields | changes))
