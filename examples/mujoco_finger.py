"""A robot's finger in MuJoCo presses on soft tissue of Palpate: its wrench goes into MuJoCo.

MuJoCo steps the finger, a mass on a slide that a motor pushes down; Palpate steps the contact. Once it is at rest,
motor, weight and contact force balance. Usage: mujoco_finger.py [plot.png]      (pip install mujoco)
"""

import sys
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import palpate

RADIUS, MASS, PUSH = 0.006, 0.05, 0.3
FINGER = f"""
<mujoco>
  <option timestep="0.001"/>
  <worldbody>
    <body name="finger" pos="0.04 0.025 {0.05 + RADIUS + 0.001}">
      <joint name="down" type="slide" axis="0 0 1" damping="2"/>
      <geom type="sphere" size="{RADIUS}" mass="{MASS}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <actuator><motor joint="down"/></actuator>
</mujoco>
"""
scene = palpate.Scene.read(Path(__file__).with_name("block.toml"))
scene = scene.model_copy(update={"view": scene.view.model_copy(update={"strain_limit": 0.0})})
sensor = palpate.Sensor(scene, taxels=(16, 16), device_limits=False)
model = mujoco.MjModel.from_xml_string(FINGER)
data = mujoco.MjData(model)
finger = model.body("finger").id
# The motor carries the weight and pushes down by so many newtons.
data.ctrl[0] = MASS * 9.81 - PUSH
mujoco.mj_forward(model, data)
forces, heights = [], []
for _ in range(1500):
    pose = np.concatenate([data.xpos[finger], data.xquat[finger]])
    # About the tip, which is the body's centre of mass: as xfrc_applied takes it.
    data.xfrc_applied[finger] = sensor.step(pose, model.opt.timestep)[0, 0]
    mujoco.mj_step(model, data)
    forces.append(data.xfrc_applied[finger, 2])
    heights.append(data.xpos[finger, 2])
contact = sensor.contacts
print(f"at rest: {forces[-1]:.6f} N from the tissue, {PUSH} N of the motor beyond the weight")
print(f"contact of {2e3 * contact.radius[0]:.2f} mm, largest pressure {sensor.pressures.max() / 1e3:.2f} kPa")

figure = Figure(figsize=(8, 3.4), dpi=120, layout="constrained")
FigureCanvasAgg(figure)
curve, taxels = figure.subplots(1, 2)
curve.plot(forces, color="tab:red")
curve.axhline(PUSH, color="0.6", linestyle="--")
curve.set(xlabel="time [ms]", ylabel="contact force [N]", title="force on the finger")
image = taxels.imshow(sensor.pressures[0, 0] / 1e3, origin="lower", extent=[-6, 6, -6, 6])
taxels.set(xlabel="x of the finger [mm]", ylabel="y [mm]", title="16 x 16 taxels")
figure.colorbar(image, label="pressure [kPa]")
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "mujoco_finger.png")
assert abs(forces[-1] - PUSH) < 1e-4 * PUSH and abs(data.qvel[0]) < 1e-6
assert abs(sensor.pressures.sum() * (2 * RADIUS / 16) ** 2 - PUSH) < 1e-2 * PUSH
