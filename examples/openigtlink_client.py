"""Press on a scene over OpenIGTLink, as a tracker or 3D Slicer does, and plot what comes back.

python examples/openigtlink_client.py [plot.png]      (pip install pyigtl)

It starts `palpate run examples/block.toml --igtl 18944 --no-browser` itself.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyigtl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

# Middle of the upper side of the block, and the radius of its tool, mm.
TOP, RADIUS = np.array([40.0, 25.0, 50.0]), 6.0
RATE, SECONDS = 60.0, 4.0

scene = Path(__file__).with_name("block.toml")
command = [sys.executable, "-m", "palpate", "run", scene, "--igtl", "18944", "--no-browser", "--port", "0"]
server = subprocess.Popen(command, stdout=subprocess.DEVNULL)
client = pyigtl.OpenIGTLinkClient("127.0.0.1", 18944)
while not client.is_connected():
    assert server.poll() is None, "palpate run has ended"
    time.sleep(0.01)
client.wait_for_message("Force")
depths, forces, sent, begun = [], [], 0, time.monotonic()
while (now := time.monotonic() - begun) < SECONDS:
    if now * RATE >= sent:
        depth = 3.0 * np.sin(np.pi * now / 2.0) ** 2 - 0.5
        matrix = np.eye(4)
        matrix[:3, 3] = TOP + [0.0, 0.0, RADIUS - depth]
        client.send_message(pyigtl.TransformMessage(matrix, device_name="Tool"), wait=False)
        depths.append((now, depth))
        sent += 1
    for message in client.get_latest_messages():
        if message.device_name == "Force":
            forces.append((now, *json.loads(message.string)["force_N"][0]))
    time.sleep(0.001)
client.stop()
server.terminate()
server.wait()
depths, forces = np.array(depths), np.array(forces)
rates = [len(rows) / SECONDS for rows in (depths, forces)]
print(f"{rates[0]:.0f} poses and {rates[1]:.0f} forces a second; largest force {forces[:, 3].max():.3f} N")

figure = Figure(figsize=(7, 3.6), dpi=120, layout="constrained")
FigureCanvasAgg(figure)
axes = figure.subplots()
axes.plot(forces[:, 0], forces[:, 3], color="tab:red", label="force on the tool [N]")
axes.set(xlabel="time [s]", ylabel="force [N]")
right = axes.twinx()
right.plot(depths[:, 0], depths[:, 1], color="0.6", linestyle="--", label="depth sent [mm]")
right.set_ylabel("depth [mm]")
figure.legend(loc="outside upper center", ncols=2, frameon=False)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "openigtlink.png")
assert forces[:, 3].max() > 0.05 and len(forces) / SECONDS > 50
