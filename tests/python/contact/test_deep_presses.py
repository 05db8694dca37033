"""Deep presses of every tool in bodies with edges, thin walls and hollows: numbers stay finite and places on the body.

A stylus 11 mm deep in a prism with a star's section once found its place 1 m away, and 5e42 N there.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from crossings import LYING, RADII, TOOLS, Loops, Played, lowest, played, polyline, surface_places, upright_on
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation, Slerp

import palpate

# No press of this file can have a larger force: ten times a flat punch of 24 mm pressed by 15 mm.
MOST = 50.0
# What a point of contact may be off the untouched surface, over the longest edge of an element's face.
OFF = 1.0
DEEPEST = 0.015


class Surface:
    """The untouched surface as points less than a sixth of an element apart."""

    def __init__(self, body: palpate.Body):
        faces = body.mesh.surface_faces[:, :3]
        corners = body.mesh.nodes[faces]
        self.element = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
        k = np.linspace(0, 1, 7)
        a, b = (v.ravel() for v in np.meshgrid(k, k))
        part = np.column_stack([1 - a - b, a, b])[a + b <= 1 + 1e-9]
        self._tree = cKDTree((part @ corners).reshape(-1, 3))

    def off(self, points: np.ndarray) -> float:
        """How far points are off it at the most, over an element."""
        return float(self._tree.query(points)[0].max() / self.element)


def size_of(tool: str) -> float:
    """Longest extent of a tool, m."""
    given = TOOLS["capsule" if tool == "file" else tool]
    return max(2 * RADII[tool] + given.get("length", 0.0), 2 * max(given.get("semi_axes", (0.0,))), 4 * RADII[tool])


def wrong_with(found: Played, surface: Surface, tool: str) -> str | None:
    """What cannot be in a press; None if all can."""
    record = found.recording
    numbers = {"forces": found.forces, "torques": found.torques, "energy at the port": record.port_energy}
    rows = record.contacts
    numbers |= {name: rows[name] for name in ("point", "normal", "force", "torque", "radius", "depth", "stiffness")}
    bad = [name for name, values in numbers.items() if not np.isfinite(values).all()]
    if bad:
        return f"{', '.join(bad)} not finite"
    if found.size.max() > MOST:
        return f"{found.size.max():.3g} N"
    if len(rows) == 0:
        return None
    points, ticks = rows["point"].astype(float), rows["tick"].astype(int)
    if surface.off(points) > OFF:
        return f"a place {surface.off(points):.3g} elements off the body"
    # A place is carried along with the surface by as much as the tool has come since it touched, and as it was deep
    # then: in a hollow that is narrower than the tool it starts inside.
    come = rows["depth"][0] + np.linalg.norm(found.path[ticks] - found.path[ticks[0]], axis=1)
    away = np.linalg.norm(points - found.path[ticks], axis=1) - size_of(tool) - np.maximum(come, rows["depth"])
    return f"a place {1e3 * away.max():.3g} mm too far from the tool" if away.max() > 0 else None


def presses(loops: Loops, name: str, tool: str, ranks: Iterable[int], device: dict | None = None) -> list[str]:
    """What is wrong with random presses of these numbers: down, aside with a turn, up; at 0.02 to 1 mm a tick."""
    body, green = loops.body(name)
    surface, wrong = Surface(body), []
    simulation = loops.loop(name, tool, device=device)
    for rank in ranks:
        random = np.random.default_rng([rank, len(name), len(tool)])
        foot, normal = (found[0] for found in simulation.closest(surface_places(green, body, 1, rank))[:2])
        deep = min(DEEPEST, random.uniform(1.0, 4.0) * RADII[tool])
        path, turns = press(tool, foot, normal, deep, random)
        try:
            problem = wrong_with(played(simulation, path, turns), surface, tool)
        except palpate.SimulationError as error:
            problem = f"fault: {error}"
        if problem:
            wrong.append(f"{tool} in {name}, press {rank} at {foot.round(4)}, {1e3 * deep:.1f} mm deep: {problem}")
    return wrong


def press(
    tool: str, foot: np.ndarray, normal: np.ndarray, deep: float, random: np.random.Generator
) -> tuple[np.ndarray, Rotation]:
    """Path (t, 3), m, of a press at a foot, and the tool's turn at each place."""
    rotation = upright_on(normal, random.uniform(0, 2 * np.pi))
    if tool in ("capsule", "thick capsule", "file") and random.random() < 0.7:
        # Half of those that lie lean somewhat.
        rotation = rotation * LYING * Rotation.from_rotvec(random.choice([0.0, 0.3]) * random.normal(size=3))
    aside = np.cross(normal, random.normal(size=3))
    aside *= random.uniform(1e-4, 0.015) / np.linalg.norm(aside)
    start = foot - lowest(tool, rotation, normal)
    pressed = start - deep * normal
    legs = [start + 2e-3 * normal, pressed, pressed + aside, start + aside + 2e-3 * normal]
    path = polyline(legs, 10 ** random.uniform(np.log10(2e-5), -3))
    part = np.clip((path - pressed) @ aside / (aside @ aside), 0.0, 1.0)
    return path, rotation * Rotation.from_rotvec(part[:, None] * random.uniform(0, 0.5) * random.normal(size=3))


# A file in a star has several contacts of many cells: minutes beside other tests.
@pytest.mark.quick(3)
@pytest.mark.timeout(900)
@pytest.mark.campaign(3)
@pytest.mark.parametrize("tool", ["sphere", "capsule", "punch", pytest.param("file", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["torus", *(pytest.param(name, marks=pytest.mark.slow) for name in ("star", "cup"))])
def test_places_of_deep_presses_stay_on_the_body_and_forces_finite(loops, name, tool, rounds):
    wrong = presses(loops, name, tool, range(rounds(24)))
    assert not wrong, "; ".join(wrong)


@pytest.mark.slow
def test_a_stylus_deep_in_a_star_under_the_default_device(loops):
    wrong = presses(loops, "star", "capsule", [135, 339, 617, *range(10)], device={})
    assert not wrong, "; ".join(wrong)


def test_a_stylus_pressed_and_turned_through_a_point_of_the_star(loops):
    """Its place once ran 0.3 m away, with a force of 25 N."""
    legs = [[41.57, 48.462, 14.22], [36.1, 48.462, 11.521], [34.266, 44.891, 15.237], [39.736, 44.891, 17.936]]
    first, last = Rotation.from_quat([[0.24022, 0.05412, -0.84623, -0.47251], [0.08458, 0.22831, -0.70336, -0.66783]])
    between = Slerp([0.0, 1.0], Rotation.concatenate([first, last]))
    path, part = np.array(legs[:1]) / 1e3, np.zeros(1)
    for leg, count in enumerate((92, 82, 92)):
        k = np.linspace(0, 1, count + 1)[1:]
        path = np.vstack([path, (np.array(legs[leg]) + k[:, None] * np.subtract(legs[leg + 1], legs[leg])) / 1e3])
        part = np.append(part, k if leg == 1 else np.full(count, leg / 2))
    found = played(loops.loop("star", "capsule"), path, between(part))
    assert wrong_with(found, Surface(loops.body("star")[0]), "capsule") is None


@pytest.mark.slow
@pytest.mark.campaign(2)
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", ["star", "cup", "torus", "kidney", "doll", "valley 60", "ridge 30"])
def test_many_deep_presses(loops, name, rounds):
    wrong = [text for tool in TOOLS for text in presses(loops, name, tool, range(20, 20 + rounds(12)))]
    assert not wrong, f"{len(wrong)}: " + "; ".join(wrong[:6])


def test_the_checks_see_forces_and_places_that_cannot_be(loops):
    body, _ = loops.body("torus")
    surface = Surface(body)
    path = polyline([np.array([0.04, 0.0, 0.018]), np.array([0.04, 0.0, 0.012])], 50e-6)
    found = played(loops.loop("torus", "sphere"), path, LYING)
    assert wrong_with(found, surface, "sphere") is None

    def falsified(**columns: np.ndarray) -> str | None:
        forces = columns.pop("forces", found.forces)
        rows = found.recording.contacts.copy()
        for name, values in columns.items():
            rows[name] = values
        record = type("Record", (), {"contacts": rows, "port_energy": found.recording.port_energy})()
        return wrong_with(Played(path, forces, found.torques, record), surface, "sphere")

    point = found.recording.contacts["point"]
    assert "N" in falsified(forces=1e4 * found.forces)
    assert "finite" in falsified(forces=found.forces + np.nan)
    assert "finite" in falsified(stiffness=np.full(len(point), np.inf))
    assert "off the body" in falsified(point=point + [0.0, 0.0, 0.03])
    # On the other side of the torus.
    assert "from the tool" in falsified(point=point * [-1.0, 1.0, 1.0])
