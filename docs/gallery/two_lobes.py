"""Stable depth of cut over spindle speed for two overhangs of one tool."""

import numpy as np
from matplotlib.figure import Figure

from receptance import CARBIDE, STEEL, Assembly, GroundSpring, Part, PointJoint, Segment
from receptance.stability import Milling, stability_lobes

lines = np.arange(300.0, 6000.0, 1.0)
speeds = np.arange(6e3, 22e3, 50.0)
cut = Milling(teeth=4, k_t=8e8, k_n=3e8, immersion=0.5, feed="down")
joint = PointJoint(k_y=4e8, k_theta=8e4, c_theta=0.8, name="joint")
holder = Part([Segment(length=0.1, outer_diameter=0.045, material=STEEL)], name="holder")
clamped = GroundSpring(part="holder", position=0.1, k_y=2e8, k_theta=3e5, c_y=2e3, name="spindle")

figure = Figure(figsize=(7, 3.8), layout="constrained")
axes = figure.subplots()
for overhang, style in ((0.05, "C0-"), (0.07, "C1--")):
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    tip = Assembly([tool, joint, holder], [clamped]).receptance(lines)
    lobes = stability_lobes(cut, lines, tip[:, None, None] * np.eye(2), speeds_rpm=speeds)
    speed, depth = lobes.best()
    print(f"{1e3 * overhang:.0f} mm: always stable below {1e3 * lobes.depth.min():.2f} mm; best {speed:.0f} rpm")
    axes.plot(1e-3 * speeds, 1e3 * lobes.depth, style, label=f"overhang {1e3 * overhang:.0f} mm")
axes.set(xlabel="spindle speed [1000 rpm]", ylabel="stable depth of cut [mm]", ylim=(0, None))
axes.legend(frameon=False)
