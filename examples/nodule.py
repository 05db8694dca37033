"""Feel for a hard nodule in soft tissue: a fingertip slides over it at constant depth, and over tissue without one.

Usage: nodule.py [plot.png]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import palpate

# The smallest difference in stiffness that fingers tell apart, about a tenth (Jones and Hunter find 23 %, others 8 %).
JUST_NOTICEABLE = 0.1
TOP, DEPTH = 0.04, 1.5e-3

scene = palpate.Scene.read(Path(__file__).with_name("nodule.toml"))
plain = scene.model_copy(update={"region": []})
radius = scene.tools[0].radius

# Down to the depth, then along a line over the middle, half a millimetre a tick, through the force loop of the page.
line = np.arange(0.012, 0.068, 5e-4)
height = TOP + radius
lower = [(line[0], 0.04, z) for z in np.linspace(height + 1e-3, height - DEPTH, 200)]
path = np.array(lower + [(x, 0.04, height - DEPTH) for x in line])
forces = {}
for name, chosen in {"with the nodule": scene, "without": plain}.items():
    simulation = palpate.Simulation(chosen)
    print(f"{name}: {simulation.body.mesh}")
    forces[name] = simulation.run(path)[-len(line) :, 2]

gain = forces["with the nodule"] / forces["without"] - 1
felt = line[gain > JUST_NOTICEABLE]
print(f"over the nodule {100 * gain.max():.0f} % more force, at x = {1e3 * line[gain.argmax()]:.0f} mm")
print(f"more than {100 * JUST_NOTICEABLE:.0f} % from x = {1e3 * felt.min():.0f} to {1e3 * felt.max():.0f} mm")

figure = Figure(figsize=(7, 4), dpi=120, layout="constrained")
FigureCanvasAgg(figure)
axes = figure.subplots()
for (name, values), color in zip(forces.items(), ("tab:red", "0.45"), strict=True):
    axes.plot(1e3 * line, 1e3 * values, color=color, linewidth=1.8, label=name)
axes.axvspan(35, 45, color="tab:red", alpha=0.1, linewidth=0, label="nodule, 5 to 15 mm deep")
axes.set_xlabel("x [mm]")
axes.set_ylabel(f"force at {1e3 * DEPTH:g} mm depth [mN]")
axes.set_ylim(0, 1.15e3 * max(values.max() for values in forces.values()))
axes.legend(loc="lower right", frameon=False)
axes.grid(alpha=0.25)
axes.spines[["top", "right"]].set_visible(False)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "nodule.png")

# The nodule is where the tissue is hardest to press, and can be felt; far away nothing changes.
assert abs(line[gain.argmax()] - 0.04) < 0.003
assert gain.max() > JUST_NOTICEABLE
assert abs(gain[[0, -1]]).max() < 0.03
