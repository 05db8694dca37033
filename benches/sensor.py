"""Copies of a scene as a sensor of a robot simulator, timed beside a step of MuJoCo's flex with one contact."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from benches import contact_peers
from benches.output import Json, Table, show
from benches.timing import call_times
from palpate import Scene, Sensor
from palpate.body import Material
from palpate.mesh import TetMesh
from palpate.progress import status_line
from palpate.scene import BuiltScene

SCENE = Path(__file__).parents[1] / "examples" / "nodule.toml"
STEP_US = 1000.0
DEPTH, SLIDE = 0.002, 0.004
# Tools: the scene's ball; a punch, whose contact is solved on 16 x 16 cells that are written out for taxels.
PUNCH = {"shape": "punch", "radius": 0.005, "friction": 0.1}


@dataclass(frozen=True)
class Row:
    """Steps of so many copies, us: median, one of a hundred, the worst; ``taxels`` whether pressures were read."""

    tool: str
    copies: int
    taxels: bool
    p50: float
    p99: float
    worst: float


def poses(copies: int, ticks: int, top: float, reach: float) -> np.ndarray:
    """Poses (ticks, copies, 1, 7) of tools that slide on circles over the nodule, each with a phase of its own."""
    angle = 2 * np.pi * (np.arange(ticks)[:, None] / 500 + np.arange(copies) / copies)
    deep = DEPTH * np.minimum(1.0, np.arange(ticks) / 50)[:, None] + 0 * angle
    flat = np.array([0.04, 0.04]) + SLIDE * np.stack([np.cos(angle), np.sin(angle)], -1)
    tips = np.concatenate([flat, (top + reach - deep)[..., None]], -1)
    return np.concatenate([tips, np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*tips.shape[:-1], 4))], -1)[:, :, None]


def measure(built: BuiltScene, tool: str, copies: int, ticks: int, taxels: bool) -> Row:
    """Time steps of copies, from the tick on in which all are in contact."""
    sensor = Sensor(built, copies, taxels=(16, 16) if taxels else None, device_limits=False)
    top = built.bodies[0].green.surface_positions[:, 2].max()
    path = iter(poses(copies, ticks + 60, top, built.scene.tools[0].reach))
    for _ in range(60):
        sensor.step(next(path))
    times = call_times(lambda: sensor.step(next(path)), ticks)
    if len(sensor.contacts) < copies:
        raise RuntimeError("a copy has lost its contact")
    return Row(tool, copies, taxels, *np.percentile(times, [50, 99, 100]).tolist())


def flex_step_us(built: BuiltScene) -> float | None:
    """Return the time of a step of MuJoCo's flex on the same corners, of one material; None without MuJoCo."""
    if "MuJoCo" not in contact_peers.installed():
        return None
    mesh = built.bodies[0].body.mesh
    used, corners = np.unique(mesh.tets[:, :4], return_inverse=True)
    linear = TetMesh(mesh.nodes[used], corners.reshape(-1, 4))
    radius = float(built.scene.tools[0].radius)
    _, seconds = contact_peers.mujoco_forces(linear, Material(5e3, 0.45), radius, np.array([[0.04, 0.04]]), [DEPTH])
    return 1e6 * seconds


def with_tool(scene: Scene, tool: dict[str, Any] | None) -> Scene:
    """Scene with another tool."""
    return scene if tool is None else scene.model_copy(update={"tools": [type(scene.tools[0])(**tool)]})


def sensor(
    copies: Annotated[int, typer.Option(help="Copies of the nodule's scene.")] = 64,
    ticks: Annotated[int, typer.Option(help="Steps that are timed.")] = 1000,
    peers: Annotated[bool, typer.Option(help="Step MuJoCo's flex as well.")] = True,
    as_json: Json = False,
) -> None:
    """Step copies of the nodule's scene, each with a contact of its own, beside MuJoCo's flex."""
    rows, scene = [], Scene.read(SCENE)
    with status_line("stepping"):
        built = scene.build()
        for name, tool in (("ball", None), ("punch", PUNCH)):
            other = BuiltScene(with_tool(scene, tool), built.bodies)
            rows += [measure(other, name, count, ticks, taxels) for count in (1, copies) for taxels in (False, True)]
        flex = flex_step_us(built) if peers else None
    lines = [
        [r.tool, "taxels" if r.taxels else "", str(r.copies), f"{r.p50:.0f}", f"{r.p99:.0f}", f"{r.worst:.0f}"]
        for r in rows
    ]
    all_copies = next(r for r in rows if r.copies == copies)
    notes = [f"{copies} copies at 1 kHz take {all_copies.p50 / STEP_US:.2f} of real time (median, ball)"]
    if flex is not None:
        each = all_copies.p50 / copies
        notes.append(
            f"MuJoCo's flex, one contact: {flex:.0f} us a step, {flex / each:.0f} times a copy's {each:.1f} us"
        )
    headings = ["tool", "", "copies", "p50 us", "p99 us", "worst us"]
    show(as_json, rows, Table("steps of a sensor", headings, lines, 2, notes), flex_step_us=flex)
