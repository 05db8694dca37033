"""Reference loads: nodal forces against theory, and everything that follows from them against a direct solve."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh, direct_solve, relative

import palpate
from palpate.fields import Interior
from palpate.mesh.shape_functions import surface_integrals

SIZE = np.array([0.08, 0.05, 0.05])
DENSITY = 1100.0
LOADS = palpate.Loads(
    gravity=(1.0, 0.0, -9.81),
    pressure=[(lambda p: p[:, 2] > SIZE[2] - 1e-9, 150.0)],
    spread=[(lambda p: p[:, 0] > SIZE[0] - 1e-9, (0.0, 0.1, 0.0))],
    forces={40: (0.0, 0.05, 0.0)},
)


@pytest.fixture(scope="module")
def loaded() -> palpate.Body:
    material = palpate.Material(10e3, 0.4, DENSITY)
    return palpate.Body(box_mesh(), material=material, fixed=lambda p: p[:, 0] < 1e-9, loads=LOADS)


@pytest.fixture(scope="module")
def loaded_green(loaded, tmp_path_factory):
    return palpate.precompute(loaded, precision="f64", path=tmp_path_factory.mktemp("loads") / "loaded.palpate")


def test_nodal_forces_have_the_resultant_and_moment_of_the_loads(loaded):
    """Linear displacements are reproduced exactly, so force and moment are those of the continuous load."""
    nodes, volume = loaded.mesh.nodes, SIZE.prod()
    single = {
        "gravity": ({"gravity": (1, 2, -9.81)}, DENSITY * volume * np.array([1, 2, -9.81]), SIZE / 2),
        "pressure": (
            {"pressure": [(lambda p: p[:, 2] > SIZE[2] - 1e-9, 150.0)]},
            [0, 0, -150 * SIZE[0] * SIZE[1]],
            [SIZE[0] / 2, SIZE[1] / 2, SIZE[2]],
        ),
        "spread": (
            {"spread": [(lambda p: p[:, 0] > SIZE[0] - 1e-9, (0.3, 0, -0.1))]},
            [0.3, 0, -0.1],
            [SIZE[0], SIZE[1] / 2, SIZE[2] / 2],
        ),
    }
    for name, (arguments, force, centre) in single.items():
        body = palpate.Body(loaded.mesh, material=loaded.material, loads=palpate.Loads(**arguments))
        nodal = body.load_vector()
        assert nodal.sum(axis=0) == pytest.approx(np.array(force), abs=1e-12), name
        moment = np.cross(nodes, nodal).sum(axis=0)
        assert moment == pytest.approx(np.cross(centre, force), abs=1e-12), name


def test_pressure_all_round_is_in_equilibrium(loaded):
    everywhere = palpate.Loads(pressure=[(np.ones(len(loaded.mesh.nodes), dtype=bool), 1e3)])
    nodal = palpate.Body(loaded.mesh, material=loaded.material, loads=everywhere).load_vector()
    assert np.abs(nodal).max() > 0.1
    assert np.abs(nodal.sum(axis=0)).max() < 1e-12
    assert np.abs(np.cross(loaded.mesh.nodes, nodal).sum(axis=0)).max() < 1e-12


def test_quadratic_faces_carry_a_uniform_load_on_their_edge_nodes():
    """A flat six-node triangle: int N dA is a third of the area at each edge node, nothing at the corners."""
    corners = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]])
    nodes = np.vstack([corners, (corners + np.roll(corners, -1, axis=0)) / 2])
    areas, normals = surface_integrals(nodes, np.arange(6)[None])
    assert areas[0] == pytest.approx([0, 0, 0, 1 / 3, 1 / 3, 1 / 3], abs=1e-14)
    assert normals[0, 3:] == pytest.approx(np.tile([0, 0, 1 / 3], (3, 1)), abs=1e-14)


def test_rest_state_equals_a_direct_solve(loaded, loaded_green):
    prescribed = dict.fromkeys(loaded.fixed_dofs.tolist(), 0.0)
    u, f = direct_solve(loaded, prescribed, loaded.load_vector().ravel())
    answer = loaded_green.solve()
    surface = loaded.mesh.surface_nodes
    assert relative(loaded_green.free_displacements, u[surface]) <= 1e-9
    assert relative(answer.displacements, u[surface]) <= 1e-9
    assert relative(answer.forces, f[surface]) <= 1e-9
    assert relative(answer.reactions, f[loaded.fixed_nodes]) <= 1e-9
    assert relative(Interior(loaded).extend(answer.displacements), u) <= 1e-9
    # The supports carry all of the load: K u at them is the reaction and what is loaded onto them.
    carried = answer.reactions - loaded.load_vector()[loaded.fixed_nodes]
    assert carried.sum(axis=0) == pytest.approx(-loaded.load_vector().sum(axis=0), rel=1e-9)


@pytest.mark.parametrize("quadratic", [False, True])
def test_hanging_bar_equals_theory(tmp_path, quadratic):
    """Under its own weight a bar with nu = 0 stretches by rho g L^2 / 2 E, as quadratic elements do exactly."""
    mesh = box_mesh(cells=(3, 3, 10), size=(0.02, 0.02, 0.1), jitter=0)
    mesh = mesh.to_quadratic() if quadratic else mesh
    loads = palpate.Loads(gravity=(0, 0, -9.81))
    top = mesh.nodes[:, 2] > 0.1 - 1e-9
    # Supported as the theory wants it: along the bar everywhere at the top, sideways nowhere but against rigid motion.
    fixed = np.zeros((len(mesh.nodes), 3), dtype=bool)
    fixed[top, 2] = True
    fixed[np.flatnonzero(top & (np.linalg.norm(mesh.nodes[:, :2], axis=1) < 1e-9)), :2] = True
    fixed[np.flatnonzero(top & (np.linalg.norm(mesh.nodes[:, :2] - [0.02, 0], axis=1) < 1e-9)), 1] = True
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.0, 1000.0), fixed=fixed, loads=loads)
    green = palpate.precompute(body, precision="f64", path=tmp_path / "bar.palpate")
    stretch = -green.free_displacements[mesh.nodes[mesh.surface_nodes, 2] < 1e-9, 2].mean()
    assert stretch == pytest.approx(1000 * 9.81 * 0.1**2 / (2 * 10e3), rel=1e-9 if quadratic else 0.01)


def test_touch_starts_from_the_loaded_state(loaded, loaded_green):
    """A patch left where the loads put it is not pushed; one kept at its unloaded place carries them."""
    node = int(np.setdiff1d(loaded.mesh.surface_nodes, loaded.fixed_nodes)[9])
    row = np.searchsorted(loaded.mesh.surface_nodes, node)
    sag = loaded_green.free_displacements[row]
    idle = loaded_green.touch(point=loaded.mesh.nodes[node], displacement=sag)
    assert np.abs(idle.force).max() <= 1e-12
    assert idle.displacements == pytest.approx(loaded_green.free_displacements, abs=1e-15)
    press = loaded_green.touch(point=loaded.mesh.nodes[node], displacement=(0, 0, 0))
    answer = loaded_green.solve(displacements={node: (0, 0, 0)})
    assert press.force == pytest.approx(answer.forces[row] - loaded.load_vector()[node], rel=1e-9)
    assert press.displacements == pytest.approx(answer.displacements, abs=1e-12)


def test_simulation_presses_the_sagged_body(loaded, loaded_green):
    """The tool meets the surface where the loads have put it, and feels its displacement from there."""
    scene = palpate.Scene.of_store(loaded_green.path)
    limits = {"max_force": 100.0, "max_slew": 1e9, "ramp": 0.0}
    tool = {"radius": 0.006, "contact": "patch", "contact_radius": 0.012}
    scene = scene.model_copy(update={"device": scene.device.model_copy(update=limits)})
    view = scene.view.model_copy(update={"strain_limit": 0.0})
    scene = scene.model_copy(update={"tools": [scene.tools[0].model_copy(update=tool)], "view": view})
    simulation = palpate.Simulation(scene)
    rows = np.searchsorted(loaded.mesh.surface_nodes, loaded.mesh.surface_triangles)
    rest = loaded_green.surface_positions[rows]
    triangle = int(np.argmin(np.linalg.norm(rest.mean(axis=1) - [0.05, 0.025, 0.05], axis=1)))
    sag = loaded_green.free_displacements[rows[triangle]].mean(axis=0)
    assert np.linalg.norm(sag) > 1e-3
    point = rest[triangle].mean(axis=0)
    a, b, c = loaded_green.surface_positions[rows[triangle]] + loaded_green.free_displacements[rows[triangle]]
    normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
    clearance = np.linspace(2e-4, -1e-3, 500)
    forces = simulation.run(point + sag + (0.006 + clearance[:, None]) * normal)
    assert np.abs(forces[clearance > 1e-9]).max() == 0
    assert (forces[clearance < -1e-9] @ normal > 0).all()
    pushed, kept = (loaded_green.touch(point, d, 0.012).force for d in (-1e-3 * normal, np.zeros(3)))
    assert forces[-1] == pytest.approx(kept - pushed, rel=1e-9)
    with simulation:
        frame = simulation.frame()
        assert frame.displacements == pytest.approx(loaded_green.free_displacements, abs=1e-15)
        assert simulation.youngs_modulus is None


def test_loads_are_in_the_key_and_in_the_file(loaded, loaded_green, tmp_path):
    unloaded = palpate.Body(loaded.mesh, material=loaded.material, fixed=loaded.fixed_nodes)
    with pytest.raises(palpate.StoreError, match="load N"):
        palpate.GreensFunction.load(loaded_green.path, body=unloaded)
    twisted = palpate.Loads(forces={50: (1, 0, 0), 51: (-1, 0, 0)})
    other = palpate.Body(loaded.mesh, material=loaded.material, fixed=loaded.fixed_nodes, loads=twisted)
    green = palpate.precompute(other, path=tmp_path / "twisted.palpate")
    with pytest.raises(palpate.StoreError, match="other loads"):
        palpate.GreensFunction.load(green.path, body=unloaded)
    again = palpate.GreensFunction.load(loaded_green.path, body=loaded)
    assert np.array_equal(again.free_displacements, loaded_green.free_displacements)
    assert again.youngs_modulus is None  # loads do not scale with it


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"gravity": (0, 0)}, "gravity needs three numbers, got 2"),
        ({"gravity": (0, 0, np.nan)}, "gravity has a number that is not finite"),
        ({"pressure": [([0], np.inf)]}, "pressure must be a finite number"),
        ({"pressure": [([0], 10.0)]}, "pressure: no face of the surface"),
        ({"spread": [([0, 10**6], (0, 0, 1))]}, "spread node 1000000 does not exist"),
        ({"forces": {10**6: (0, 0, 1)}}, "forces node 1000000 does not exist"),
        ({"forces": {3: (0, 0, np.inf)}}, "forces: node 3 has a number that is not finite"),
    ],
)
def test_bad_loads_are_refused_by_name(loaded, arguments, message):
    with pytest.raises(palpate.BodyError, match=message):
        palpate.Body(loaded.mesh, material=loaded.material, loads=palpate.Loads(**arguments)).load_vector()
