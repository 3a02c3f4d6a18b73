"""Natural frequencies of a carbide tool over its overhang, with a stiff and a soft joint."""

import numpy as np
from matplotlib.figure import Figure

from receptance import CARBIDE, STEEL, Assembly, Part, PointJoint, Segment

holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
overhangs = np.linspace(0.03, 0.11, 33)


def first_modes(k_theta):
    joint = PointJoint(k_y=6e8, k_theta=k_theta, name="joint")
    found = []
    for overhang in overhangs:
        tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
        found.append(Assembly([tool, joint, holder]).natural_frequencies(30e3)[:2])
    return np.array(found)


figure = Figure(figsize=(7, 3.8), layout="constrained")
axes = figure.subplots()
for k_theta, style in ((1e5, "-"), (3e4, "--")):
    modes = first_modes(k_theta)
    axes.plot(1e3 * overhangs, 1e-3 * modes, f"C0{style}", label=f"k_theta = {k_theta:g} N m/rad")
    at_70 = int(np.argmin(abs(overhangs - 0.07)))
    print(f"k_theta = {k_theta:g}: first mode {modes[at_70, 0]:.0f} Hz at {1e3 * overhangs[at_70]:.0f} mm")
axes.set(xlabel="overhang [mm]", ylabel="natural frequency [kHz]", title="First and second mode")
handles, labels = axes.get_legend_handles_labels()
axes.legend(handles[::2], labels[::2], frameon=False)
