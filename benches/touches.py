"""Scripted touches by a simulated hand on emulated devices: press, slide, hold, lift.

A hand holds the device and follows a path of its own wish; what it feels moves it, and so what it feels next. A touch
is unstable if the tip runs away, or if it does not rest while the hand does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from benches.emulation import FIRM, LOOSE, Device, Hand, Held, Motion, emulate, frictionless, known_devices
from benches.output import Json, Table, show
from benches.zwidth import Spring
from palpate.models import NAMES
from palpate.progress import status_line
from palpate.scene import BuiltScene, Scene, model_scene
from palpate.simulation import Simulation

HANDS = {"loose": LOOSE, "firm": FIRM}
# How deep each hand wishes to be in soft bodies, m, and in blocks that may be hard: there it pushes with 1.5 and 2.4 N,
# less than any device's largest force.
DEPTHS = {"loose": 15e-3, "firm": 8e-3}
HARD_DEPTHS = {"loose": 15e-3, "firm": 3e-3}
# From how high above the surface, and how far along it, m.
HEIGHT, WAY = 5e-3, 10e-3
# When the hand begins to come down, is down, has slid, begins to lift, is up, and the end, s: a device of 0.6 kg in a
# loose hand takes two seconds to come to rest from a few millimetres.
TIMES = (0.3, 0.8, 1.3, 3.3, 3.6, 5.8)
# Time for which the tip is watched before the hand lifts, and before the end, s.
WATCHED = 0.15
# Steps of the encoder to which a tip at rest may hop to and fro, and the least that counts, m.
STEPS, LEAST = 2.0, 10e-6
# A tip has run away that is farther from its start, m.
REACH = 0.1
# Of the devices' stiffness beyond which nothing is sensible, N/m.
UNLIMITED = 1e9


@dataclass(frozen=True)
class Touch:
    """What came of a touch.

    Attributes
    ----------
    scene, device, hand
        Names.
    max_stiffness
        That tools may ask for, N/m.
    force, speed
        Largest on the device, N, and of the tip, m/s.
    unrest
        Half of the range in which a tip moves about its mean drift while the hand rests, m.
    allowed
        Largest unrest of a tip at rest, m.
    ran_away
        Whether a tip left the scene.

    """

    scene: str
    device: str
    hand: str
    max_stiffness: float
    force: float
    speed: float
    unrest: float
    allowed: float
    ran_away: bool

    @property
    def stable(self) -> bool:
        """Whether the tip stayed, touched, and rested."""
        return not self.ran_away and self.unrest <= self.allowed


def touch_with_all(
    built: BuiltScene, devices: Sequence[Device], hands: Sequence[str] = tuple(HANDS), limited: bool = True
) -> Iterator[Touch]:
    """Touch a scene with each device in each hand, one device a tool.

    Where they are ``limited``, tools ask for no more stiffness than their device holds, and else for any.
    """
    loops: dict[float, Simulation] = {}
    for device in devices:
        most = min(built.scene.device.max_stiffness, device.max_stiffness) if limited else UNLIMITED
        if most not in loops:
            loops[most] = Simulation(with_stiffness(built, most))
        asked = device if limited else replace(device, max_stiffness=UNLIMITED)
        for hand in hands:
            yield touch(loops[most], asked, hand)


def with_stiffness(built: BuiltScene, max_stiffness: float) -> BuiltScene:
    """Return the scene with tools that ask for so much stiffness at most, N/m."""
    table = built.scene.device.model_copy(update={"max_stiffness": max_stiffness})
    return BuiltScene(built.scene.model_copy(update={"device": table}), built.bodies)


def touch(simulation: Simulation, device: Device, hand: str) -> Touch:
    """Touch once."""
    tools = simulation.scene.tools
    held = [hold(device, HANDS[hand], path(simulation, tool, DEPTHS[hand])) for tool in range(len(tools))]
    period = 1 / simulation.scene.device.rate
    motion = emulate(simulation, held, period, round(TIMES[-1] / period), reach=REACH)
    return judge(simulation.scene.name, device, hand, simulation.scene.device.max_stiffness, motion, period)


def hold(device: Device, hand: Hand, waypoints: Sequence[tuple[float, np.ndarray]]) -> Held:
    """Device in a hand that begins at rest at its first waypoint."""
    return Held(device, waypoints[0][1], hand=hand, waypoints=waypoints)


def path(simulation: Simulation, tool: int, depth: float) -> list[tuple[float, np.ndarray]]:
    """Wish of a hand: from above the top of a body down, along, and up again."""
    body = simulation.bodies[min(tool, len(simulation.bodies) - 1)]
    points = body.points_to_scene(body.green.surface_positions)
    low, high = points.min(0), points.max(0)
    # Beside the middle, away from edges.
    near = (np.abs(points[:, :2] - (low + high)[:2] / 2) < 0.2 * (high - low)[:2] + 1e-3).all(axis=1)
    top = points[near][points[near][:, 2].argmax()]
    return strokes(top + [0, 0, simulation.scene.tools[tool].radius], depth, min(WAY, 0.15 * (high - low)[0]))


def strokes(touching: np.ndarray, depth: float, way: float) -> list[tuple[float, np.ndarray]]:
    """Waypoints of a tool whose centre touches at a place, (3,) m: down to a depth, along x, and up, m."""
    up, down, along = np.array([0, 0, HEIGHT]), np.array([0, 0, -depth]), np.array([way, 0, 0])
    offsets = (up, down, down + along, down + along, up + along)
    return [(time, touching + offset) for time, offset in zip(TIMES, offsets, strict=False)]


def judge(scene: str, device: Device, hand: str, max_stiffness: float, motion: Motion, period: float) -> Touch:
    """Classify a motion as stable or not."""
    whole = len(motion) == round(TIMES[-1] / period)
    unrest = max(unrest_before(motion, end, period) for end in (TIMES[3], TIMES[-1])) if whole else np.inf
    force = float(np.linalg.norm(motion.forces, axis=-1).max())
    speed = float(np.linalg.norm(motion.velocities, axis=-1).max())
    allowed = max(STEPS * device.mechanics.encoder_step, LEAST)
    return Touch(scene, device.name, hand, max_stiffness, force, speed, unrest, allowed, not whole)


def unrest_before(motion: Motion, time: float, period: float) -> float:
    """Half of the range of the tips about their mean drift over the time watched before ``time``, m."""
    last = round(time / period)
    window = motion.positions[last - round(WATCHED / period) : last].reshape(round(WATCHED / period), -1)
    straight = np.polynomial.polynomial.polyfit(np.arange(len(window)), window, 1)
    about = window - np.polynomial.polynomial.polyval(np.arange(len(window)), straight).T
    return float(np.ptp(about, axis=0).max() / 2)


def touch_of_spring(spring: Spring, device: Device, hand: str, stiffness: float, most: float) -> Touch:
    """Touch a block that pushes back with ``stiffness``, N/m, where tools may ask for ``most``."""
    simulation = spring.pressed(stiffness, most)
    held = hold(device, HANDS[hand], strokes(spring.place + [0, 0, spring.radius], HARD_DEPTHS[hand], 0.0))
    motion = emulate(simulation, [held], 1e-3, round(TIMES[-1] / 1e-3), reach=REACH)
    return judge(f"{stiffness:g} N/m", device, hand, most, motion, 1e-3)


# Stiffness of the blocks on which a Touch is tried: beyond what it holds, and beyond what anybody does, N/m.
FIRM_BODY, HARD_BODY = 800.0, 30_000.0


def controls(spring: Spring, touch_device: Device) -> list[tuple[Touch, bool | None]]:
    """Touches of firm blocks, and whether each must be stable; None where either may be.

    The last of each hand shows that instability is seen: a hard block under a tool that may ask for any stiffness.
    """
    unlimited = replace(touch_device, max_stiffness=UNLIMITED)
    found: list[tuple[Touch, bool | None]] = []
    for hand in HANDS:
        held = touch_device.max_stiffness
        found.append((touch_of_spring(spring, touch_device, hand, FIRM_BODY, held), True))
        found.append((touch_of_spring(spring, unlimited, hand, FIRM_BODY, UNLIMITED), None))
        found.append((touch_of_spring(spring, touch_device, hand, HARD_BODY, held), True))
        found.append((touch_of_spring(spring, unlimited, hand, HARD_BODY, UNLIMITED), False))
    return found


def hardest_at_rest(spring: Spring, device: Device, hand: str) -> float:
    """Stiffness up to which a touch comes to rest before the hand lifts, tools asking for any, N/m, to 2 %."""
    unlimited = replace(device, max_stiffness=UNLIMITED)

    def rests(stiffness: float) -> bool:
        return touch_of_spring(spring, unlimited, hand, stiffness, UNLIMITED).stable

    stable = unstable = FIRM_BODY / 8
    while rests(unstable):
        stable, unstable = unstable, 2 * unstable
    while unstable > 1.02 * stable:
        middle = float(np.sqrt(stable * unstable))
        stable, unstable = (middle, unstable) if rests(middle) else (stable, middle)
    return stable


def scenes_table(found: Sequence[Touch]) -> Table:
    """Return one line per scene and hand, and a note for each device on which a tip does not rest."""
    lines = []
    for scene, hand in sorted({(touch.scene, touch.hand) for touch in found}):
        rows = [touch for touch in found if (touch.scene, touch.hand) == (scene, hand)]
        force, speed = max(touch.force for touch in rows), 1e3 * max(touch.speed for touch in rows)
        unrest, share = 1e6 * max(touch.unrest for touch in rows), max(touch.unrest / touch.allowed for touch in rows)
        figures = (f"{force:.2f}", f"{speed:.0f}", f"{unrest:.1f}", f"{100 * share:.0f} %")
        lines.append([scene, hand, str(len(rows)), str(sum(touch.stable for touch in rows)), *figures])
    headings = ["scene", "hand", "devices", "at rest", "force N", "speed mm/s", "unrest um", "of what is allowed"]
    wrong = [
        f"UNSTABLE: {touch.scene}, {touch.device}, {touch.hand}: {1e6 * touch.unrest:.0f} um"
        for touch in found
        if not touch.stable
    ]
    return Table("Touches by simulated hands on emulated devices", headings, lines, words=2, notes=wrong)


def blocks_table(found: Sequence[tuple[Touch, bool | None]]) -> Table:
    """Return one line per block, hand and limit, with the verdict."""
    lines = []
    for touch, expected in found:
        verdict = "stable" if touch.stable else "UNSTABLE"
        if expected not in (None, touch.stable):
            verdict += ": wrong"
        figures = (f"{touch.max_stiffness:g}", f"{touch.force:.2f}", f"{1e6 * touch.unrest:.1f}")
        lines.append([touch.scene, touch.hand, *figures, f"{1e6 * touch.allowed:.0f}", verdict])
    headings = ["block", "hand", "at most N/m", "force N", "unrest um", "allowed", ""]
    return Table("A Touch on blocks, limited to what it holds, and not", headings, lines, words=2)


def touches(
    scenes: Annotated[
        list[Path] | None, typer.Argument(help="Scene files (.toml); the built-in models if none is named.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Press, slide, hold and lift with simulated hands on every known device; exit code 1 if a tip does not rest.

    Each scene is touched with eight emulated devices, with and without their dry friction, loosely and firmly held;
    tools ask for no more stiffness than the device holds. A Touch on blocks of 800 and 30,000 N/m shows what that limit
    does.

    Example: python -m benches touches examples/block.toml examples/nodule.toml
    """
    known = known_devices()
    devices = [*known.values(), *map(frictionless, known.values())]
    given = [(path.stem, Scene.read(path)) for path in scenes or []]
    found: list[Touch] = []
    for name, scene in given or [(name, model_scene(name, True, False)) for name in NAMES]:
        with status_line(f"touching {name}"):
            found += [replace(touch, scene=name) for touch in touch_with_all(scene.build(progress=False), devices)]
    with status_line("touching hard blocks"):
        spring, own = Spring(), known["Touch"]
        hard = controls(spring, own)
        hardest = [
            (one.name, hand, hardest_at_rest(spring, one, hand)) for one in (own, frictionless(own)) for hand in HANDS
        ]
    notes = [f"{name}, in a {hand} hand: comes to rest on blocks up to {most:.0f} N/m" for name, hand, most in hardest]
    rows = [*found, *(touch for touch, _ in hard)]
    stable = [touch.stable for touch in rows]
    show(as_json, rows, scenes_table(found), replace(blocks_table(hard), notes=notes), stable=stable, hardest=hardest)
    if not all(stable[: len(found)]) or any(expected not in (None, touch.stable) for touch, expected in hard):
        raise typer.Exit(1)
