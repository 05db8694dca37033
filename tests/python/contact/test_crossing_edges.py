"""Tools that cross straight edges and creases in steps of 4 um: forces without jumps, and no contact that gets lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from crossings import LYING, RADII, TOOLS, UP, Loops, lowest, played
from scipy.spatial.transform import Rotation
from strange_bodies import EDGE_LENGTH

STEP, LEAD = 4e-6, 1.5e-3
# What the force may change by in a tick: this part of it, or so much, N, whichever is larger.
PART, LEAST = 0.05, 0.01
# Below this part of the tool's radius a contact has a force.
DEEP = 0.25
ACROSS, ALONG = LYING, Rotation.from_rotvec([0.0, 0.0, np.pi / 2]) * LYING
POSES = {
    "upright": Rotation.identity(),
    "across": ACROSS,
    "along": ALONG,
    "yawed": Rotation.from_rotvec([0.0, 0.0, np.radians(30)]) * ACROSS,
    "tilted": Rotation.from_rotvec([0.0, np.radians(12), 0.0]) * ACROSS,
}


@dataclass(frozen=True)
class Wedge:
    """An edge through the origin, along y, between two planes with these outward normals; convex, or a crease."""

    normals: tuple[np.ndarray, np.ndarray]
    convex: bool

    @classmethod
    def of(cls, kind: str, degrees: float) -> Wedge:
        angle, convex = np.radians(degrees), kind in ("convex", "ridge")
        sign = 1.0 if convex else -1.0
        second = np.array([sign * np.sin(angle), 0.0, -np.cos(angle)])
        if kind in ("convex", "concave"):
            return cls((UP, second), convex)
        # The bisector of the body's angle, or of the air's, is turned upright.
        turn = Rotation.from_rotvec([0.0, -sign * (np.pi / 2 - angle / 2), 0.0])
        return cls((turn.apply(UP), turn.apply(second)), convex)

    def inside(self, points: np.ndarray) -> np.ndarray:
        """How deep points are in the body at the least, m; negative outside."""
        depths = np.stack([-(points @ normal) for normal in self.normals])
        return depths.min(axis=0) if self.convex else depths.max(axis=0)

    def touch(self, tool: str, rotation: Rotation, x: float) -> float:
        """Height of the tool's origin, standing at x in a crease, at which it touches a wall from above, m."""
        heights = []
        for normal in self.normals:
            low = lowest(tool, rotation, normal) + [x, 0.0, 0.0]
            heights.append(-(low @ normal) / normal[2])
        return max(heights)


def skin(tool: str, rotation: Rotation) -> np.ndarray:
    """Points (n, 3), m, of a tool's surface about its origin."""
    given = TOOLS["capsule" if tool == "file" else tool]
    ways = Rotation.from_rotvec(np.pi / 2 * np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])).as_matrix()
    around = np.random.default_rng(0).normal(size=(200, 3))
    around = np.vstack([around / np.linalg.norm(around, axis=1)[:, None], *ways, *-ways])
    if given.get("shape") == "ellipsoid":
        return rotation.apply(around * given["semi_axes"])
    if given.get("shape") == "punch":
        turn = np.linspace(0, 2 * np.pi, 40)
        rings = [
            np.column_stack([r * np.cos(turn), r * np.sin(turn), 0 * turn])
            for r in np.linspace(0, given["radius"] - given["rounding"], 8)
        ]
        return rotation.apply(np.vstack(rings))
    spine = np.linspace(0, given.get("length", 0.0), 25)[:, None] * UP
    return rotation.apply((spine[:, None] + given["radius"] * around).reshape(-1, 3))


@dataclass(frozen=True)
class Crossing:
    """A tool at a depth, m, over or into an edge."""

    kind: str
    degrees: int
    tool: str
    pose: str
    depth: float

    def __str__(self) -> str:
        return f"{self.tool} {self.pose}, {1e3 * self.depth:g} mm, {self.kind} {self.degrees}"

    def path(self) -> tuple[np.ndarray, int]:
        """Origins (t, 3), m, of the tool, and how many of them come down to the first place."""
        wedge, rotation = Wedge.of(self.kind, self.degrees), POSES[self.pose]
        left, right = (lowest(self.tool, rotation, np.array([side, 0.0, 0.0]))[0] for side in (1.0, -1.0))
        middle, half = 0.5 * (left + right), 0.5 * abs(right - left)
        if self.kind == "convex":
            # From the middle's place on the top until nothing is over it.
            ends, height = (-0.4 * half - 2e-3, half + 0.5e-3), -lowest(self.tool, rotation, UP)[2]
        elif self.kind == "concave":
            height, normal = -lowest(self.tool, rotation, UP)[2], wedge.normals[1]
            wall = -(lowest(self.tool, rotation, normal) + (height - self.depth) * UP) @ normal / normal[0] + middle
            ends = (wall - 2e-3, wall + self.depth)
        elif self.kind == "ridge":
            # Its lowest point passes over the edge.
            middle, _, low = lowest(self.tool, rotation, UP)
            ends, height = (-3e-3, 3e-3), -low
        else:
            ends, height = (-1.5e-3, 1.5e-3), wedge.touch(self.tool, rotation, -middle)
        x, low = np.arange(*ends, STEP) - middle, height - self.depth
        # It comes down from where it is outside of the body, in a crease from above the wall that it is nearer to.
        outside = wedge.touch(self.tool, rotation, x[0]) if self.kind == "valley" else height
        y = 0.5 * EDGE_LENGTH + 1.7e-3 - rotation.apply(UP)[1] * 0.5 * TOOLS[self.tool].get("length", 0.0)
        across = np.column_stack([x, np.full_like(x, y), np.full_like(x, low)])
        down = np.arange(outside + LEAD - low, 0, -10e-6)[:, None] * UP
        return np.vstack([across[0] + down, across]), len(down)


def jumps(forces: np.ndarray) -> np.ndarray:
    """Changes from tick to tick over what they may be; at most 1 is smooth."""
    size = np.linalg.norm(forces, axis=1)
    change = np.linalg.norm(np.diff(forces, axis=0), axis=1)
    found = change / np.maximum(PART * np.maximum(size[1:], size[:-1]), LEAST)
    return np.where(np.isfinite(forces).all(axis=1)[1:], found, np.inf)


def largest_jump(forces: np.ndarray) -> float:
    return float(jumps(forces).max())


def deepest_without_force(crossing: Crossing, path: np.ndarray, forces: np.ndarray) -> float:
    """How deep the tool is in the untouched body at the least where there is no force, over its radius."""
    empty = np.flatnonzero(np.linalg.norm(forces, axis=1) == 0)
    points, wedge = skin(crossing.tool, POSES[crossing.pose]), Wedge.of(crossing.kind, crossing.degrees)
    depths = [wedge.inside(points + path[tick]).max() for tick in empty[:: max(1, len(empty) // 50)]]
    return max(depths, default=0.0) / RADII[crossing.tool]


# The blade bends aside and springs back, as `spring_of_blade` says too: how many times more than allowed a force may
# jump then, within so many metres of the path from where the tip alone springs. The contact's own compliance lets it
# go earlier.
SPRINGS = {("ridge", 30, "capsule", "along"): 3.3}
AROUND_SPRING = 1.3e-3


def judged(loops: Loops, crossing: Crossing) -> str | None:
    """What is wrong with a crossing; None if nothing is."""
    path, lead = crossing.path()
    found = played(loops.loop(f"{crossing.kind} {crossing.degrees}", crossing.tool), path, POSES[crossing.pose])
    jump = float((jumps(found.forces[lead:]) / allowed_jumps(loops, crossing, path[lead:])).max())
    lost = deepest_without_force(crossing, path[lead:], found.forces[lead:])
    if found.size.max() == 0:
        return f"{crossing}: no force anywhere"
    if jump <= 1 and lost <= DEEP:
        return None
    return f"{crossing}: jumps {jump:.3g} times what is allowed, no force {lost:.2g} radii deep"


def allowed_jumps(loops: Loops, crossing: Crossing, path: np.ndarray) -> np.ndarray:
    """How many times more than allowed a force may jump in each tick: not once, but where a blade springs back."""
    allowed = np.ones(len(path) - 1)
    key = (crossing.kind, crossing.degrees, crossing.tool, crossing.pose)
    if key in SPRINGS:
        stiffness = tip_stiffness(loops, crossing.degrees, path)
        spring = int(jumps(spring_of_blade(stiffness, path[:, [0, 2]], RADII[crossing.tool])).argmax())
        around = np.abs(path[1:, 0] - path[spring + 1, 0]) < AROUND_SPRING
        allowed[around] = SPRINGS[key]
    return allowed


def crossings(kinds: list[str], degrees: list[int], held: dict[str, list[str]], depths: list[float]) -> list[Crossing]:
    return [
        Crossing(kind, angle, tool, pose, depth)
        for kind in kinds
        for angle in degrees
        for tool, poses in held.items()
        for pose in poses
        for depth in depths
    ]


QUICK = [
    Crossing("convex", 90, "sphere", "upright", 1e-3),
    # The reported ones.
    Crossing("convex", 90, "capsule", "across", 2e-3),
    Crossing("convex", 90, "capsule", "yawed", 1e-3),
    Crossing("convex", 90, "thick capsule", "across", 2e-3),
    Crossing("convex", 90, "punch", "upright", 1e-3),
    Crossing("ridge", 60, "punch", "upright", 0.5e-3),
    Crossing("ridge", 60, "capsule", "along", 1e-3),
    Crossing("ridge", 30, "ellipsoid", "across", 1e-3),
    Crossing("ridge", 30, "capsule", "tilted", 1e-3),
    Crossing("concave", 120, "capsule", "yawed", 1e-3),
    Crossing("valley", 30, "capsule", "yawed", 1e-3),
    Crossing("concave", 90, "sphere", "upright", 1e-3),
    Crossing("concave", 60, "ellipsoid", "across", 1e-3),
    Crossing("valley", 120, "capsule", "along", 1e-3),
    # Each differs from one above in its angle or in how the tool lies.
    *(
        pytest.param(crossing, marks=pytest.mark.slow)
        for crossing in (
            Crossing("ridge", 30, "capsule", "yawed", 1e-3),
            Crossing("ridge", 90, "capsule", "along", 0.5e-3),
            Crossing("concave", 90, "capsule", "across", 1e-3),
            Crossing("valley", 120, "capsule", "across", 1e-3),
        )
    ),
]


@pytest.mark.quick(8)
@pytest.mark.parametrize("crossing", QUICK, ids=str)
def test_a_tool_crosses_an_edge_without_a_jump_and_keeps_its_contact(loops, crossing):
    wrong = judged(loops, crossing)
    assert wrong is None, wrong


@pytest.mark.parametrize("tool", ["capsule", "ellipsoid", pytest.param("file", marks=pytest.mark.slow)])
def test_in_a_corner_a_tool_presses_both_walls(loops, tool):
    """Along the floor into a wall: what each does is nearly what it does alone."""
    path, lead = Crossing("concave", 90, tool, "across", 1e-3).path()
    # Beginning and end of the way are what counts here: 32 um a tick over it.
    path, start = np.vstack([path[:lead:4], path[lead::8]]), -(-lead // 4)
    simulation = loops.loop("concave 90", tool)
    both, above = (played(simulation, path + lift * UP, ACROSS).forces[start:] for lift in (0.0, 1.5e-3))
    along, alone = both[-1, 0], above[-1, 0]
    assert np.abs(both[:12, 0]).max() < 0.02 * both[0, 2], "the wall is felt from afar"
    assert alone < -5e-3 and abs(above[-1, 2]) < 0.2 * abs(alone), "the wall alone presses back"
    assert abs(along / alone - 1) < 0.15
    assert abs(both[-1, 2] / both[0, 2] - 1) < 0.15
    # One wall of the two missing, or a force of the wrong sign, would be seen.
    assert abs(both[0, 0] / alone - 1) > 0.15 and abs(above[-1, 2] / both[0, 2] - 1) > 0.15


@pytest.mark.quick(4)
@pytest.mark.parametrize("degrees", [60, 120, *(pytest.param(other, marks=pytest.mark.slow) for other in (90, 150))])
def test_in_the_middle_of_a_valley_its_sides_press_alike(loops, degrees):
    """A capsule lies across it with both ends: by symmetry they push along the valley's bisector."""
    path, lead = Crossing("valley", degrees, "capsule", "across", 1e-3).path()
    forces = played(loops.loop(f"valley {degrees}", "capsule"), path, ACROSS).forces[lead:]
    # Against the part that one side alone has.
    left, middle, right = (
        forces[k, 0] / forces[k, 2] * np.tan(np.radians(degrees / 2)) for k in (0, len(forces) // 2, -1)
    )
    assert abs(middle) < 0.35
    assert left > 0.4 and right < -0.4


def tip_stiffness(loops: Loops, degrees: int, path: np.ndarray) -> np.ndarray:
    """Stiffness (2, 2), N/m, of a ridge's edge along x and z, under an even load as long as a capsule along it."""
    body, green = loops.body(f"ridge {degrees}")
    nodes = body.mesh.nodes
    edge = np.flatnonzero(np.abs(nodes[:, [0, 2]]).max(axis=1) < 1e-9)
    edge = edge[np.argsort(nodes[edge, 1])]
    y = nodes[edge, 1]
    ends = path[0, 1] + np.array([0.0, POSES["along"].apply(UP)[1] * TOOLS["capsule"]["length"]])
    share = np.gradient(y) * ((y >= ends.min()) & (y <= ends.max()))
    share /= share.sum()
    rows = np.searchsorted(np.unique(body.mesh.surface_triangles), edge)
    compliance = np.empty((2, 2))
    for column, axis in enumerate((0, 2)):
        loads = {
            int(node): tuple(1e-3 * part * np.eye(3)[axis]) for node, part in zip(edge, share, strict=True) if part
        }
        compliance[:, column] = 1e3 * (share @ green.solve(forces=loads).displacements[rows])[[0, 2]]
    return np.linalg.inv(compliance)


def spring_of_blade(stiffness: np.ndarray, centres: np.ndarray, radius: float) -> np.ndarray:
    """Forces (t, 2), N, on a round tool that pushes a tip before it, without friction.

    The tip `u = c + R e(a)` slides on the tool until it is at rest, `t . K u = 0` along the tool's tangent `t`. It is
    stable while `R t . K t > e . K u`: its own stiffness, against the turning of the force with the tool's surface.
    """
    forces, angle = np.zeros((len(centres), 2)), None
    for tick, centre in enumerate(centres):
        if angle is None:
            if np.linalg.norm(centre) >= radius:
                continue
            angle = np.arctan2(-centre[1], -centre[0])
        for _ in range(500):
            e = np.array([np.cos(angle), np.sin(angle)])
            tangent, load = np.array([-e[1], e[0]]), stiffness @ (centre + radius * e)
            slope, bend = tangent @ load, radius * tangent @ stiffness @ tangent - e @ load
            step = np.clip(-slope / bend if bend > 0 else -np.sign(slope) * 0.02, -0.02, 0.02)
            angle += step
            if abs(step) < 1e-10:
                break
        if e @ load < 0:
            angle = None
            continue
        forces[tick] = -load
    return forces


@pytest.mark.slow
def test_a_thin_blade_springs_back_under_a_capsule_along_it(loops):
    """As its tip alone would, with the body's stiffness and without any law of contact: this jump is the body's own."""
    for (kind, degrees, tool, pose), most in SPRINGS.items():
        path, lead = Crossing(kind, degrees, tool, pose, 1e-3).path()
        path, sizes = path[lead:], []
        computed = played(loops.loop(f"{kind} {degrees}", tool), np.vstack([path[0] + LEAD * UP, path]), POSES[pose])
        tip = spring_of_blade(tip_stiffness(loops, degrees, path), path[:, [0, 2]], RADII[tool])
        ticks = [int(jumps(forces).argmax()) for forces in (computed.forces[1:], tip)]
        assert abs(path[ticks[0] + 1, 0] - path[ticks[1] + 1, 0]) < AROUND_SPRING
        for forces in (computed.forces[1:], tip):
            sizes.append(np.linalg.norm(np.diff(forces, axis=0), axis=1).max())
            assert 2 < largest_jump(forces) <= most
            # A single tick springs.
            assert np.sort(jumps(forces))[-2] <= 1
        assert sizes[0] == pytest.approx(sizes[1], rel=0.3)
        # An edge of 90 degrees is stiff enough sideways.
        stiff = spring_of_blade(tip_stiffness(loops, 90, path), path[:, [0, 2]], RADII[tool])
        assert np.linalg.norm(stiff, axis=1).max() > 0.05 and largest_jump(stiff) < 1


HELD = {
    "sphere": ["upright"],
    "ellipsoid": ["across"],
    "capsule": ["across", "along", "yawed", "tilted"],
    "punch": ["upright"],
    "file": ["across"],
}
EVERY = crossings(["convex", "ridge", "concave", "valley"], [30, 60, 90, 120, 150], HELD, [1e-3])


# Of the eight poses of an edge and of the five angles each share has all.
@pytest.mark.slow
@pytest.mark.campaign(7)
@pytest.mark.parametrize("crossing", EVERY, ids=str)
def test_every_tool_crosses_edges_of_every_angle(loops, crossing):
    wrong = judged(loops, crossing)
    assert wrong is None, wrong


def test_the_checks_see_a_jump_and_a_contact_that_is_lost():
    crossing = Crossing("convex", 90, "capsule", "across", 2e-3)
    path, lead = crossing.path()
    path = path[lead:]
    # A tool of so many newtons for each metre that it lies over the top.
    over = np.clip(-(path[:, 0] - 3e-3), 0.0, None)
    forces = np.column_stack([0 * over, 0 * over, 40.0 * over])
    smooth = (largest_jump(forces), deepest_without_force(crossing, path[over > 0], forces[over > 0]))
    assert smooth[0] <= 1 and smooth[1] <= DEEP

    late = forces.copy()
    late[len(late) // 3 :] *= 1.1
    turned = forces.copy()
    turned[1000] *= -1.0
    dropped = forces.copy()
    dropped[500:] = 0.0
    assert largest_jump(late) > 1
    assert largest_jump(turned) > 1
    assert deepest_without_force(crossing, path, dropped) > DEEP
