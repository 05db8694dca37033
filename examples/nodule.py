"""Feel for a hard nodule in soft tissue: the stiffness under a finger along a line, with the nodule and without.

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

scene = palpate.Scene.read(Path(__file__).with_name("nodule.toml"))
built = scene.build()
body = built.bodies[0].body
tissue = built.scene.material.material()
without = palpate.Body(body.mesh, material=tissue, fixed=body.fixed_nodes)
fields = {"with the nodule": built.bodies[0].green, "without": palpate.precompute(without)}

# Press by a millimetre with a fingertip, sideways free, along a line over the middle.
line = np.linspace(0.012, 0.068, 57)
stiffness = {}
for name, green in fields.items():
    presses = [green.touch((x, 0.04, 0.04), (None, None, -1e-3), scene.tools[0].contact_radius) for x in line]
    stiffness[name] = np.array([-press.force[2] / 1e-3 for press in presses])

gain = stiffness["with the nodule"] / stiffness["without"] - 1
felt = line[gain > JUST_NOTICEABLE]
print(f"{body.mesh}")
print(f"over the nodule {100 * gain.max():.0f} % stiffer, at x = {1e3 * line[gain.argmax()]:.0f} mm")
print(f"more than {100 * JUST_NOTICEABLE:.0f} % from x = {1e3 * felt.min():.0f} to {1e3 * felt.max():.0f} mm")

figure = Figure(figsize=(7, 4), dpi=120, layout="constrained")
FigureCanvasAgg(figure)
axes = figure.subplots()
for (name, values), color in zip(stiffness.items(), ("tab:red", "0.45"), strict=True):
    axes.plot(1e3 * line, values, color=color, linewidth=1.8, label=name)
axes.axvspan(35, 45, color="tab:red", alpha=0.1, linewidth=0, label="nodule, 5 to 15 mm deep")
axes.set_xlabel("x [mm]")
axes.set_ylabel("stiffness under the finger [N/m]")
axes.set_ylim(0, 1.15 * max(values.max() for values in stiffness.values()))
axes.legend(loc="lower right", frameon=False)
axes.grid(alpha=0.25)
axes.spines[["top", "right"]].set_visible(False)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "nodule.png")

# The nodule is where the tissue is stiffest, and can be felt; far away nothing changes.
assert abs(line[gain.argmax()] - 0.04) < 0.003
assert gain.max() > JUST_NOTICEABLE
assert abs(gain[[0, -1]]).max() < 0.03
