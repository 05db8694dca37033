"""Tools that are no spheres: force and torque against contact mechanics in series with the block, and their energy."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from conftest import box_mesh
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, nnls
from scipy.special import ellipe, ellipk

import palpate
from palpate.scene import BuiltScene
from palpate.simulation.native import tool_arguments

SIZE = np.array([0.12, 0.12, 0.08])
TOP = np.array([0.061, 0.059, 0.08])
YOUNGS, POISSON = 10e3, 0.45
MODULUS = YOUNGS / (1 - POISSON**2)
SPACING = 0.01
# Mean displacement of a half-space under the mask's own pressure (docs/theory.md).
MASK = 0.766544
# Turned so that the tool's own axis, its z, lies along x.
LYING = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
BARE = {"device": {"max_force": 1e3, "max_slew": 1e9, "ramp": 0, "max_stiffness": 1e9}, "view": {"strain_limit": 0}}


@pytest.fixture(scope="module")
def block(tmp_path_factory) -> tuple[palpate.Body, palpate.GreensFunction]:
    mesh = box_mesh((6, 6, 4), tuple(SIZE)).to_quadratic()
    body = palpate.Body(mesh, material=palpate.Material(YOUNGS, POISSON), fixed=lambda p: p[:, 2] < 1e-9)
    return body, palpate.precompute(body, precision="f64", path=tmp_path_factory.mktemp("block") / "b.palpate")


def simulation_of(block, **tool) -> palpate.Simulation:
    body, green = block
    tool = {"friction": 0.0, **tool}
    return palpate.Simulation(BuiltScene.of(palpate.Scene(body={"store": "b.palpate"}, tool=tool, **BARE), body, green))


def pressed(simulation, height: float, depth: float, orientation=(1.0, 0.0, 0.0, 0.0), ticks: int = 60):
    """Record a press straight down; the tool's origin is ``height`` above its lowest point."""
    down = np.linspace(-2e-4, depth, ticks)[:, None]
    path = TOP + np.array([0.0, 0.0, height]) - down * [0, 0, 1]
    return simulation.play(path, np.tile(orientation, (ticks, 1)))


def in_series(block, law, depth: float, size: float) -> float:
    """Force of a half-space's ``law`` behind the block's own compliance over the radius of its mask."""
    width = max(3 * SPACING, 1.6 * size)
    touch = block[1].touch(TOP, (None, None, -1e-3), width)
    regular = 1e-3 / np.linalg.norm(touch.force) - MASK / (MODULUS * width)
    return brentq(lambda force: force - law(depth - regular * force), 0.0, 2 * law(depth))


def hertz_ellipse(depth: float, radii: tuple[float, float]) -> float:
    """Force of Hertz's ellipse on a plane (Johnson, Contact Mechanics, section 4.2), N."""
    if depth <= 0:
        return 0.0
    large, small = 1 / min(radii), 1 / max(radii)

    def parts(g: float) -> tuple[float, float]:
        m = 1 - g * g
        return ellipk(m), (ellipk(m) - ellipe(m)) / m

    def miss(g: float) -> float:
        k, d = parts(g)
        return g * g * d / (k - d) - small / large

    g = brentq(miss, 1e-3, 1 - 1e-6)
    k, d = parts(g)
    short = np.sqrt(2 * depth * (k - d) / (k * large))
    return 2 * np.pi / 3 * MODULUS * (short / g) * depth / k


def rounded_punch(depth: float, flat: float, rounding: float) -> float:
    """Force of a flat punch with a rounded rim (Sneddon's integrals of its profile), N."""
    if depth <= 0:
        return 0.0

    def integral(a: float, power: int) -> float:
        # r = a sin(t); the profile's slope is that of the circle that rounds the rim.
        def slope(r: float) -> float:
            s = (r - flat) / rounding
            return s / np.sqrt(1 - s * s)

        return quad(lambda t: (a * np.sin(t)) ** power * slope(a * np.sin(t)), np.arcsin(flat / a), np.pi / 2)[0]

    radius = brentq(lambda a: a * integral(a, 0) - depth, flat * (1 + 1e-9), flat + 0.999 * rounding)
    return 2 * MODULUS * integral(radius, 2)


def test_an_ellipsoid_is_hertz_in_series_with_the_block(block):
    axes, depth = (0.009, 0.006, 0.005), 5e-4
    force = pressed(simulation_of(block, shape="ellipsoid", semi_axes=axes), axes[2], depth).forces[-1]
    radii = (axes[0] ** 2 / axes[2], axes[1] ** 2 / axes[2])
    expected = in_series(block, lambda d: hertz_ellipse(d, radii), depth, max(axes))
    assert force[2] == pytest.approx(expected, rel=0.05)
    assert np.abs(force[:2]).max() < 0.02 * force[2]


def test_a_rounded_punch_is_sneddons_in_series_with_the_block(block):
    radius, rounding, depth = 0.006, 0.002, 8e-4
    force = pressed(simulation_of(block, shape="punch", radius=radius, rounding=rounding), 0.0, depth).forces[-1]
    expected = in_series(block, lambda d: rounded_punch(d, radius - rounding, rounding), depth, radius)
    assert force[2] == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("radius", [0.003, 0.004])
def test_an_upright_punch_on_a_plane_has_no_force_sideways(block, radius):
    """Wherever it stands and however it is turned about its axis, on elements five times as wide as the punch."""
    simulation = simulation_of(block, shape="punch", radius=radius, rounding=0.3 * radius)
    down = np.linspace(-2e-4, 1e-3, 40)[:, None] * [0, 0, 1]
    for x, y, yaw in np.random.default_rng(0).uniform((-0.01, -0.01, 0.0), (0.01, 0.01, 2 * np.pi), (10, 3)):
        turned = np.tile([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)], (40, 1))
        forces = simulation.play(TOP + [x, y, 0.0] - down, turned).forces
        assert forces[-1, 2] > 0.05
        assert np.linalg.norm(forces[:, :2], axis=1).max() <= 1e-3 * forces[-1, 2]


def test_a_finger_pad_is_a_second_half_space_in_series(block):
    """Hertz for two elastic bodies; the pad does not change its volume: `1/E* = (1 - nu^2)/E + (1 - 1/4)/E_pad`."""
    radius, depth, pad = 0.008, 4e-4, 15e3
    modulus = 1 / (1 / MODULUS + 0.75 / pad)
    expected = in_series(block, lambda d: 4 / 3 * modulus * np.sqrt(radius) * max(d, 0.0) ** 1.5, depth, radius)
    soft = pressed(simulation_of(block, radius=radius, pad_youngs_modulus=pad), radius, depth).forces[-1]
    assert soft[2] == pytest.approx(expected, rel=0.05)
    rigid = pressed(simulation_of(block, radius=radius), radius, depth).forces[-1]
    assert rigid[2] > 1.3 * expected


def test_a_sphere_from_a_file_is_the_sphere(block, tmp_path):
    radius, depth = 0.006, 1e-3
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1e3 * radius)
    ball.export(tmp_path / "ball.stl")
    from_file = simulation_of(block, shape=str(tmp_path / "ball.stl"), unit="mm")
    closed = simulation_of(block, radius=radius)
    forces = [pressed(simulation, radius, depth).forces[-1, 2] for simulation in (from_file, closed)]
    assert forces[0] == pytest.approx(forces[1], rel=0.03)


def test_the_torque_of_a_lying_capsule_is_its_lever(block):
    radius, length = 0.004, 0.02
    played = pressed(simulation_of(block, shape="capsule", radius=radius, length=length), radius, 5e-4, LYING)
    force, torque = played.forces[-1], played.torques[-1]
    # Its front is at the origin, its middle half its length on along x.
    assert force[2] > 0.01
    assert torque[1] == pytest.approx(-0.5 * length * force[2], rel=0.03)
    assert np.abs(torque[[0, 2]]).max() < 0.02 * abs(torque[1])


def lying_capsule(depth: float, radius: float, length: float, cells=(40, 12)) -> float:
    """Force of a capsule on its side on a half-space: uniform pressures on rectangles (Love, 1929), N."""
    half = 0.5 * length + np.sqrt(max(2 * radius * depth, 0)), np.sqrt(max(2 * radius * depth, 0))
    sides = [2 * h / n for h, n in zip(half, cells, strict=True)]
    x, y = (
        g.ravel() for g in np.meshgrid(*(s * (np.arange(n) - (n - 1) / 2) for s, n in zip(sides, cells, strict=True)))
    )
    off_axis = np.maximum(np.abs(x) - 0.5 * length, 0) ** 2 + y**2
    gap = radius - np.sqrt(np.maximum(radius**2 - off_axis, 0)) - depth

    def corner(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return a * np.arcsinh(b / np.abs(a)) + b * np.arcsinh(a / np.abs(b))

    dx, dy = x[:, None] - x, y[:, None] - y
    a, b = 0.5 * sides[0], 0.5 * sides[1]
    influence = corner(dx + a, dy + b) - corner(dx + a, dy - b) - corner(dx - a, dy + b) + corner(dx - a, dy - b)
    root = np.linalg.cholesky(influence / (np.pi * MODULUS))
    pressures, _ = nnls(root.T, -np.linalg.solve(root, gap), maxiter=10_000)
    return pressures.sum() * sides[0] * sides[1]


def test_a_lying_capsule_is_the_half_spaces_in_series_with_the_block(block):
    radius, length, depth = 0.004, 0.02, 5e-4
    simulation = simulation_of(block, shape="capsule", radius=radius, length=length)
    # Its middle over the middle of the block.
    down = np.linspace(-2e-4, depth, 60)[:, None]
    path = TOP + np.array([-0.5 * length, 0.0, radius]) - down * [0, 0, 1]
    force = simulation.play(path, np.tile(LYING, (60, 1))).forces[-1, 2]
    size = radius + 0.5 * length

    depths = np.linspace(0.0, 2 * depth, 9)
    forces = [0.0, *(lying_capsule(d, radius, length) for d in depths[1:])]
    law = CubicSpline(depths, forces)
    expected = in_series(block, lambda d: float(law(max(d, 0.0))), depth, size)
    assert force == pytest.approx(expected, rel=0.05)


SHAPES = {
    "ellipsoid": {"shape": "ellipsoid", "semi_axes": (0.008, 0.006, 0.005)},
    "capsule": {"shape": "capsule", "radius": 0.004, "length": 0.01},
    "punch": {"shape": "punch", "radius": 0.005, "rounding": 0.002},
}


def closed_path(ticks: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places, rotation vectors and quaternions of a loop that slides, rocks and presses; it starts and ends outside."""
    turn = 2 * np.pi * np.linspace(0, 1, ticks)
    down = 1.2e-3 * np.sin(0.5 * turn) ** 2 - 2e-4
    lean = 0.2 * np.stack([np.sin(turn), np.sin(2 * turn + 0.4) - np.sin(0.4), 0 * turn], axis=1)
    place = np.stack([4e-3 * np.sin(turn), 3e-3 * np.sin(2 * turn), -down], axis=1)
    angle = np.linalg.norm(lean, axis=1)
    axis = lean / np.maximum(angle, 1e-300)[:, None]
    quaternion = np.concatenate([np.cos(0.5 * angle)[:, None], np.sin(0.5 * angle)[:, None] * axis], axis=1)
    return place, quaternion, lean


def rotations(quaternions: np.ndarray) -> np.ndarray:
    """Rotation vector (t - 1, 3) from each orientation to the next, rad."""
    before, after = quaternions[:-1], quaternions[1:]
    w = np.sum(before * after, axis=1)
    vector = before[:, :1] * after[:, 1:] - after[:, :1] * before[:, 1:] - np.cross(after[:, 1:], before[:, 1:])
    size = np.linalg.norm(vector, axis=1)
    return vector * (2 * np.arctan2(size, w) / np.maximum(size, 1e-300))[:, None]


@pytest.mark.quick(3)
@pytest.mark.parametrize("name", SHAPES)
def test_closed_paths_with_rotation_give_out_no_energy(block, name):
    tool = SHAPES[name]
    height = {"ellipsoid": 0.005, "capsule": 0.004, "punch": 0.0}[name]
    place, quaternion, _ = closed_path(3000)
    simulation = simulation_of(block, **tool)
    played = simulation.play(place + TOP + [0.0, 0.0, height], quaternion)
    force, torque = -played.forces, -played.torques
    step, turn = np.diff(place, axis=0), rotations(quaternion)
    work = np.sum(0.5 * (force[1:] + force[:-1]) * step + 0.5 * (torque[1:] + torque[:-1]) * turn, axis=1)
    done = np.cumsum(work)
    assert np.linalg.norm(force[-1]) == 0.0 and done.max() > 1e-5
    assert abs(done[-1]) <= 1e-3 * done.max()
    again = simulation_of(block, **tool).play(place + TOP + [0.0, 0.0, height], quaternion)
    assert np.array_equal(again.forces, played.forces) and np.array_equal(again.torques, played.torques)


def test_mistakes_in_shapes_are_told_with_their_line(tmp_path):
    mistakes = {
        'shape = "ellipsoid"': "needs the key 'semi_axes'",
        'shape = "punch"\nlength = "1cm"': "takes no 'length'",
        'shape = "ball"': "unknown shape 'ball'",
        'shape = "punch"\ncontact = "patch"': "contact = 'patch' is for spheres",
        'shape = "punch"\nradius = "2mm"\nrounding = "3mm"': "more than the radius",
    }
    for tool, message in mistakes.items():
        path = tmp_path / "scene.toml"
        path.write_text(f'[body]\nmodel = "beam"\n[tool]\n{tool}\n')
        with pytest.raises(palpate.SceneError, match=r"scene\.toml:[34]: .*tool") as caught:
            palpate.Scene.read(path)
        assert message in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("file", "message"), [("open.stl", "not closed"), ("missing.stl", "no such file")])
def test_mistakes_in_surface_files_are_told_with_their_line(tmp_path, file, message):
    surface = trimesh.creation.box((1.0, 1.0, 1.0))
    surface.faces = surface.faces[:-1]
    surface.export(tmp_path / "open.stl")
    path = tmp_path / "scene.toml"
    path.write_text(f'[body]\nmodel = "beam"\n[tool]\nshape = "{file}"\n')
    with pytest.raises(palpate.SceneError, match=r"scene\.toml:4: tool\.shape") as caught:
        tool_arguments(palpate.Scene.read(path), 0)
    assert message in str(caught.value) and "\n" not in str(caught.value)
