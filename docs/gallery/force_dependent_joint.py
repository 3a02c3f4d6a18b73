"""FRFs of one assembly at four forces of a stepped sine, with a joint in micro-slip."""

import numpy as np
from matplotlib.figure import Figure

from receptance import CARBIDE, STEEL, Assembly, MicroslipJoint, Part, Segment

tool = Part([Segment(length=0.07, outer_diameter=0.012, material=CARBIDE)], name="tool")
holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
lines = np.arange(1600.0, 2400.0, 2.0)

figure = Figure(figsize=(7, 3.8), layout="constrained")
axes = figure.subplots()
for level in (0.1, 1.0, 2.0, 4.0):
    joint = MicroslipJoint(
        k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=0.5, slip_y=0.05, slip_theta=0.08, level=level, name="joint"
    )
    tip = abs(Assembly([tool, joint, holder]).receptance(lines))
    print(f"level {level:g}: largest {1e6 * tip.max():.1f} um/N at {lines[tip.argmax()]:.0f} Hz")
    axes.plot(lines, 1e6 * tip, label=f"level {level:g}")
axes.set(xlabel="frequency [Hz]", ylabel="|receptance| [µm/N]", title="The same tool at four amplitudes")
axes.legend(frameon=False)
