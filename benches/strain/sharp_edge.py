"""A rigid, frictionless sphere or capsule carried over a block's sharp edge: by full finite strain, and by the loop.

The tool bends the edge down and outwards. At some place the edge slips past the tool to its side. Plain Newton steps
do not converge there. Here each step lowers the energy of body and penalty, so that the steps lead to the next
equilibrium. A stiffness that is not positive definite is shifted until it is.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse

import palpate
from benches.output import Table
from benches.strain.materials import Material, NeoHookean
from benches.strain.solid import DivergedError, Solid, invariants, solved_with_inertia
from palpate import TetMesh
from palpate.scene import BuiltScene, Scene
from palpate.validation.verify.benchmark import quiet_body
from palpate.validation.verify.contact.loop import UNLIMITED
from palpate.validation.verify.contact.measures import given_out
from palpate.validation.verify.contact.reference import graded
from palpate.validation.verify.grids import lattice, mapped

SIZE, MATERIAL = (0.08, 0.05, 0.05), NeoHookean(10e3, 0.45)
# Longest step, m.
STEP = 0.5e-3
# Edges of the loop's elements, and a step of the loop, m.
LOOP_CELL, TICK = 5e-3, 20e-6
# Full solutions by tool and depth over the radius: places x and z, m, and forces x and z, N; their columns.
IN_PLANE = [0, 2, 3, 5]
SOLVED = Path(__file__).with_name("edge_forces.json")
# Fine elements reach so far from the edge over the top and down the side, and so far along it, m.
FINE, ALONG, CELL = 0.018, 0.010, 2.5e-3
# Largest residual over the force; most steps to an equilibrium, and updates of the pressures in it.
TOLERANCE, MOST_STEPS, UPDATES = 1e-5, 150, 2
# Largest change in a step over the radius; decrease of the energy over that of its slope; halvings of a step.
LONGEST, DECREASE, HALVINGS = 0.3, 1e-4, 12
# First shift over the mean of the diagonal, and the largest.
SHIFT, MOST_SHIFT = 1e-4, 1e3


@dataclass(frozen=True)
class Tool:
    """What is carried over the edge.

    Attributes
    ----------
    name, radius
        Its radius, m.
    length
        Of the segment around which it lies, across the edge, m; zero for a sphere.
    inside
        Distance of its middle from the edge where it is pressed down, m.
    depths
        How deep it is pressed, over its radius.

    """

    name: str
    radius: float
    length: float
    inside: float
    depths: tuple[float, ...]

    def path(self, depth: float, step: float) -> np.ndarray:
        """Places of its middle (t, 3), m: down to a depth, and out over the edge at that height until it is free."""
        start, top = SIZE[0] - self.inside, SIZE[2] + self.radius
        down = np.linspace(0.0, depth, max(2, int(np.ceil(depth / (2.0 * step))) + 1))
        end = SIZE[0] + 0.5 * self.length + self.radius + step
        out = np.linspace(start, end, int(np.ceil((end - start) / step)) + 1)[1:]
        return np.array([(start, 0.0, top - d) for d in down] + [(x, 0.0, top - depth) for x in out])


TOOLS = (Tool("sphere", 6e-3, 0.0, 0.010, (1.0, 1.5)), Tool("capsule", 3e-3, 0.018, 0.015, (1.5,)))


@dataclass(frozen=True)
class Carried:
    """Path of the middle (t, 3), m, and force on the tool (t, 3), N."""

    path: np.ndarray
    forces: np.ndarray

    @property
    def lost(self) -> float:
        """What the hand has not got back at the end, over the most that it had put in."""
        given, put_in = given_out(self.path[None], self.forces[None])
        return float(-given[0] / put_in[0])


@dataclass(frozen=True)
class Slip:
    """Where the edge slips past the tool, and what the hand loses by it.

    Attributes
    ----------
    beyond
        Distance of the middle from the edge, outwards, m.
    before, after
        Forces outwards and up at the end of the step before, and of the step in which it slips, N.
    lost
        Of the most that was put in.

    """

    beyond: float
    before: list[float]
    after: list[float]
    lost: float

    @classmethod
    def of(cls, carried: Carried) -> Slip:
        """Find the step on the way out in which the force changes most."""
        out = carried.path[:, 0] > carried.path[0, 0] + 1e-9
        changes = np.linalg.norm(np.diff(carried.forces, axis=0), axis=1) * out[:-1]
        step = int(np.argmax(changes))
        before, after = (carried.forces[k, [0, 2]].round(5).tolist() for k in (step, step + 1))
        return cls(round(float(carried.path[step + 1, 0]) - SIZE[0], 6), before, after, round(carried.lost, 4))


@dataclass(frozen=True)
class SlipRow:
    """Slips of the full solution and of the loop, the tool so deep, over its radius."""

    tool: str
    depth: float
    full: Slip
    loop: Slip


@dataclass(frozen=True)
class Pair:
    """Both solutions of one path, the tool so deep, over its radius."""

    tool: Tool
    depth: float
    full: Carried
    loop: Carried

    def row(self) -> SlipRow:
        """Compare the slips."""
        return SlipRow(self.tool.name, self.depth, Slip.of(self.full), Slip.of(self.loop))


class EdgedBlock(Solid):
    """The half of a block on one side of a plane across its edge, at y = 0; the edge is at x = 80, z = 50 mm."""

    def __init__(self, mesh: TetMesh, material: Material, tool: Tool):
        _, y, z = mesh.nodes.T
        super().__init__(mesh, material, z < 1e-9)
        self._tool = tool
        held = np.repeat((z < 1e-9)[:, None], 3, axis=1)
        held[np.abs(y) < 1e-9, 1] = True
        self._free = np.flatnonzero(~held.ravel())
        corners = mesh.nodes[self._faces[:, :3]]
        outer = (corners[..., 2] > SIZE[2] - 1e-9).all(axis=1) | (corners[..., 0] > SIZE[0] - 1e-9).all(axis=1)
        self._faces, self._areas, self._pressures = self._faces[outer], self._areas[outer], self._pressures[outer]

    def carry(self, path: np.ndarray) -> Carried:
        """Put the tool's middle at places (t, 3), m, one after the other."""
        # Both halves.
        forces = [2.0 * self.press(centre, self._tool.radius, UPDATES) * [1.0, 0.0, 1.0] for centre in path]
        return Carried(path, np.array(forces))

    def _offset(self, centre: np.ndarray) -> np.ndarray:
        offset = super()._offset(centre)
        offset[..., 0] -= np.clip(offset[..., 0], -0.5 * self._tool.length, 0.5 * self._tool.length)
        return offset

    def _round(self, centre: np.ndarray, faces: np.ndarray) -> np.ndarray:
        beside = np.abs(super()._offset(centre)[faces, :, 0]) < 0.5 * self._tool.length
        return np.eye(3) - beside[..., None, None] * np.diag([1.0, 0.0, 0.0])

    def _balance(self, centre: np.ndarray, radius: float) -> np.ndarray:
        shift = 0.0
        for _ in range(MOST_STEPS):
            forces, tangent = self._internal()
            pushed, contact, force = self._contact(centre, radius)
            residual = (forces + pushed)[self._free]
            if np.abs(residual).max() <= TOLERANCE * max(np.linalg.norm(force), 1e-4):
                if force[2] < -TOLERANCE:
                    raise DivergedError("the surface has passed through the tool")
                return force
            whole = (tangent + contact)[self._free][:, self._free]
            shift = self._descend(whole, residual, shift, (centre, radius))
        raise DivergedError(f"residual {np.abs(residual).max():g} N")

    def _descend(self, stiffness, residual: np.ndarray, shift: float, at: tuple[np.ndarray, float]) -> float:
        """Take a step that lowers the energy; return the shift to begin the next one with."""
        mean, before = stiffness.diagonal().mean(), self._potential(self.u, *at)
        while shift <= MOST_SHIFT:
            change, negative = solved_with_inertia(stiffness + shift * mean * sparse.eye(len(residual)), -residual)
            if not negative:
                step = np.zeros(self.u.size)
                step[self._free] = change
                share = min(1.0, LONGEST * at[1] / np.abs(change).max())
                for _ in range(HALVINGS):
                    trial = self.u + share * step.reshape(-1, 3)
                    allowed = before + DECREASE * share * (change @ residual) + 1e-12 * abs(before)
                    if self._potential(trial, *at) <= allowed:
                        self.u = trial
                        return shift / 4 if shift > SHIFT / 10 else 0.0
                    share *= 0.5
            shift = max(4.0 * shift, SHIFT)
        raise DivergedError("no step lowers the energy")

    def _potential(self, u: np.ndarray, centre: np.ndarray, radius: float) -> float:
        """Return the energy of body and penalty, J; infinite where an element is turned over."""
        f = np.eye(3) + np.einsum("eai,eqaj->eqij", u[self.mesh.tets], self._slopes)
        try:
            _, i1, i2, j = invariants(f)
        except DivergedError:
            return np.inf
        own = float(np.sum(self._weights * self.material.density(i1, i2, j).value))
        kept, self.u = self.u, u
        pressures = self._pressed(centre, radius)[0]
        self.u = kept
        squares = pressures**2 - self._pressures**2
        return own + float(np.sum(self._areas * squares)) / (2.0 * self._penalty(radius))


def block(cell: float = CELL) -> TetMesh:
    """10-node elements of the half block, small beside the edge."""
    over, along, down = (
        graded(0.0, SIZE[0], SIZE[0], FINE, cell),
        graded(-SIZE[1] / 2, 0.0, 0.0, ALONG, cell),
        graded(0.0, SIZE[2], SIZE[2], FINE, cell),
    )
    return mapped(lattice(over, along, down), quadratic=True)


def pairs() -> Iterator[Pair]:
    """Carry the tools over the edge at their depths."""
    with tempfile.TemporaryDirectory() as folder:
        loop = LoopBlock(Path(folder))
        for tool in TOOLS:
            for part in tool.depths:
                yield Pair(tool, part, full_solution(tool, part), loop.carry(tool, tool.path(part * tool.radius, TICK)))


def full_solution(tool: Tool, part: float) -> Carried:
    """Return the full solution at a depth over the radius; its places and forces in the plane are stored."""
    stored = json.loads(SOLVED.read_text()) if SOLVED.exists() else {}
    asked = f"{tool.name}, {part:g} R, elements of {1e3 * CELL:g} mm, steps of {1e3 * STEP:g} mm"
    if asked not in stored:
        path = tool.path(part * tool.radius, STEP)
        found = np.hstack([path, EdgedBlock(block(), MATERIAL, tool).carry(path).forces])
        stored[asked] = found[:, IN_PLANE].round(6).tolist()
        lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(rows)}" for name, rows in stored.items())
        SOLVED.write_text(f"{{\n{lines}\n}}\n")
    both = np.zeros((len(stored[asked]), 6))
    both[:, IN_PLANE] = stored[asked]
    return Carried(both[:, :3], both[:, 3:])


class LoopBlock:
    """The whole block in the force loop."""

    def __init__(self, folder: Path):
        cells = [round(size / LOOP_CELL) for size in SIZE]
        axes = [np.linspace(0.0, size, count + 1) for size, count in zip(SIZE, cells, strict=True)]
        mesh = mapped(lattice(*axes), quadratic=True)
        material = palpate.Material(MATERIAL.youngs_modulus, MATERIAL.poissons_ratio, law="neo-hookean")
        self._body = quiet_body(mesh, material, mesh.nodes[:, 2] < 1e-9)
        self._green = palpate.precompute(self._body, precision="f32", path=folder / "block.palpate", progress=False)

    def carry(self, tool: Tool, path: np.ndarray) -> Carried:
        """Carry the tool's middle along places (t, 3), m, of the middle plane."""
        shape = {"shape": "capsule", "length": tool.length} if tool.length else {}
        asked = {**shape, "radius": tool.radius, "friction": 0.0}
        table = {"store": "block.palpate"}
        scene = Scene(body=table, tool=[asked], device=UNLIMITED, view={"strain_limit": 0.0})
        # The tool's own axis lies across the edge, and its origin is at an end of the segment.
        turned = np.tile(np.sqrt([0.5, 0.0, 0.5, 0.0]) if tool.length else [1.0, 0.0, 0.0, 0.0], (len(path), 1))
        origins = path + [-0.5 * tool.length, 0.5 * SIZE[1], 0.0]
        recording = palpate.Simulation(BuiltScene.of(scene, self._body, self._green)).play(origins, turned)
        return Carried(path, recording.computed_forces.reshape(len(path), 3))


def table(rows: list[SlipRow]) -> Table:
    """Table of both, forces outwards and up."""

    def cells(slip: Slip) -> list[str]:
        outward, up, outward_after, up_after = (1e3 * force for force in (*slip.before, *slip.after))
        forces = f"{outward:.0f}, {up:.0f} to {outward_after:.0f}, {up_after:.0f}"
        return [f"{1e3 * slip.beyond:+.1f}", forces, f"{100 * slip.lost:.0f}"]

    lines = [[row.tool, f"{row.depth:g} R", *cells(row.full), *cells(row.loop)] for row in rows]
    one = ["slips at, mm", "force, mN", "loses, %"]
    headings = ["tool", "depth", *(f"{who}: {heading}" for who in ("full", "loop") for heading in one)]
    return Table("Tools over a sharp edge", headings, lines)


def plot(found: list[Pair], path: Path) -> None:
    """Plot both forces over the way of the tool's middle."""
    from palpate.figures import COLORS, empty_figure, write_figure

    tools = sorted({pair.tool for pair in found}, key=lambda tool: -tool.radius)
    figure = empty_figure(4.5 * len(tools), 3.6)
    for place, tool in enumerate(tools):
        axes = figure.add_subplot(1, len(tools), place + 1)
        for pair, color in zip((pair for pair in found if pair.tool == tool), COLORS, strict=False):
            for axis, style in ((2, "-"), (0, "--")):
                label = f"{pair.depth:g} R deep, {'up' if axis == 2 else 'outwards'}"
                for carried, marks in (
                    (pair.loop, {"ls": style, "label": label}),
                    (pair.full, {"ls": "", "marker": "."}),
                ):
                    out = carried.path[:, 2] < carried.path[:, 2].min() + 1e-9
                    beyond = 1e3 * (carried.path[out, 0] - SIZE[0])
                    axes.plot(beyond, carried.forces[out, axis], color=color, lw=1.2, ms=4, **marks)
        axes.set_title(tool.name)
        axes.set_xlabel("middle of the tool beyond the edge, mm")
        axes.set_ylabel("force, N")
        axes.legend(frameon=False, fontsize="small")
    write_figure(figure, path)
