"""Picture of docs/ros2.md: poses that go into the node of the example, and the messages that it publishes.

Usage: python scripts/ros2_picture.py
The node runs on the stand-ins for ROS 2 of the tests, with the block of the examples.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "python" / "ros2"))

import test_node as stand_ins  # noqa: E402

import palpate  # noqa: E402
from shrink_pictures import shrunk  # noqa: E402

# Middle of the block's top, radius of the tool, and how far it moves, m; how long, s.
TOP, RADIUS, CLEAR, DEPTH, SECONDS = (0.04, 0.025, 0.05), 0.006, 0.002, 0.004, 4.0


def pressed() -> tuple[np.ndarray, np.ndarray]:
    """Rows of time, s, height, m, and force, N; and the deepest cloud (n, 4), m."""
    scene = palpate.Scene.read(ROOT / "examples" / "block.toml").build(progress=False)
    rows, clouds = [], []
    with pytest.MonkeyPatch.context() as patch:
        node = stand_ins.node_of(patch, scene)
        measured, begun = node.subscriptions["measured_cp"][1], time.monotonic()
        while (passed := time.monotonic() - begun) < SECONDS:
            height = TOP[2] + RADIUS + CLEAR - (CLEAR + DEPTH) * np.sin(np.pi * passed / SECONDS) ** 2
            measured(stand_ins.pose(height))
            rows.append((passed, height, node.publishers["servo_cf"].sent[-1].wrench.force.z))
            if len(clouds) < SECONDS / 2 / 0.1 <= passed / 0.1:
                node.timers[0][1]()
                clouds.append(node.publishers["surface"].sent[-1])
            time.sleep(0.002)
        node.close()
    return np.array(rows), np.frombuffer(bytes(clouds[0].data), "<f4").reshape(-1, 4)


def main() -> None:
    """Draw both."""
    rows, cloud = pressed()
    times, heights, forces = rows.T
    figure = Figure(figsize=(9, 3.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(1, 2, 1)
    axes.plot(times, 1e3 * (heights - RADIUS - TOP[2]), color="0.45", label="measured_cp: tip over the surface [mm]")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("tip over the untouched surface [mm]")
    other = axes.twinx()
    other.plot(times, forces, color="tab:orange", linewidth=1.8)
    other.set_ylabel("servo_cf: force z [N]", color="tab:orange")
    axes.grid(alpha=0.25)
    space = figure.add_subplot(1, 2, 2, projection="3d")
    dots = space.scatter(*(1e3 * cloud[:, :3].T), c=1e3 * cloud[:, 3], s=14, cmap="viridis")
    space.set_aspect("equal")
    space.set_title("surface: points of PointCloud2 [mm]", fontsize=10)
    figure.colorbar(dots, ax=space, shrink=0.7, label="displacement [mm]")
    out = ROOT / "docs" / "images" / "ros2.png"
    figure.savefig(out)
    print(f"{shrunk(out)}: largest force {forces.max():.3f} N")


if __name__ == "__main__":
    main()
