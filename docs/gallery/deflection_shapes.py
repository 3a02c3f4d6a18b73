"""Deflection shapes of a tool in its holder at two natural frequencies."""

import numpy as np
from matplotlib.figure import Figure

from receptance import CARBIDE, STEEL, Assembly, Coordinate, Part, PointJoint, Segment

tool = Part([Segment(length=0.07, outer_diameter=0.012, material=CARBIDE)], name="tool")
holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
assembly = Assembly([tool, PointJoint(k_y=2e8, k_theta=5e4, c_y=300.0, c_theta=1.0, name="joint"), holder])

places = [("tool", x) for x in np.linspace(0.0, 0.0699, 30)] + [("holder", x) for x in np.linspace(0.0, 0.1299, 40)]
responses = [Coordinate(part, x) for part, x in places]
along = np.array([x if part == "tool" else x + 0.07 for part, x in places])
modes = assembly.natural_frequencies(20e3)[:2]
matrix = assembly.receptance(modes, response=responses, excitation=[Coordinate("tool", 0.0)])[:, :, 0]

figure = Figure(figsize=(7, 3.8), layout="constrained")
axes = figure.subplots()
for frequency, shape, style in zip(modes, matrix, ("C0-", "C1--"), strict=True):
    # A quarter of a cycle after the force, at resonance, the motion is largest.
    largest = shape.imag / np.max(abs(shape.imag))
    is_tool = np.array([part == "tool" for part, _ in places])
    axes.plot(1e3 * along[is_tool], largest[is_tool], style, label=f"{frequency:.0f} Hz")
    axes.plot(1e3 * along[~is_tool], largest[~is_tool], style)
    print(f"{frequency:.0f} Hz: the nose moves {abs(largest[30] / largest[0]):.2f} of the tip")
axes.axvline(70.0, color="0.6", linewidth=0.8)
axes.set(
    xlabel="distance from the tip [mm]", ylabel="motion over its largest value", title="Tool up to 70 mm, then holder"
)
axes.legend(frameon=False)
