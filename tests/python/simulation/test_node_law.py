"""The contact of the paper, a single node: prescribed like any other boundary condition."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh
from running import settle

import palpate
from palpate.scene import BuiltScene

RADIUS = 0.006
PRESS = np.array([0.0011, -0.0006, -0.003])
UP = np.array([0.0, 0.0, 1.0])
BARE = {"device": {"max_force": 1e3, "max_slew": 1e9, "ramp": 0, "max_stiffness": 1e9}, "view": {"strain_limit": 0}}


@pytest.fixture(scope="module", params=["linear", "quadratic"])
def body(request) -> palpate.Body:
    mesh = box_mesh((5, 4, 4))
    mesh = mesh.to_quadratic() if request.param == "quadratic" else mesh
    return palpate.Body(mesh, material=palpate.Material(10e3, 0.4), fixed=lambda p: p[:, 2] < 1e-9)


def simulation_of(body: palpate.Body, folder, touch=None, contact: str = "node") -> palpate.Simulation:
    green = palpate.precompute(body, precision="f64", touch=touch, path=folder / f"{contact}.palpate")
    tool = {"radius": RADIUS, "contact": contact, "contact_radius": 0.0}
    return palpate.Simulation(BuiltScene.of(palpate.Scene(body={"store": "b.palpate"}, tool=tool, **BARE), body, green))


def top_node(body: palpate.Body, point=(0.046, 0.024)) -> int:
    """Surface node of the top that is closest to a place on it."""
    nodes = body.mesh.surface_nodes[body.mesh.nodes[body.mesh.surface_nodes, 2] > 0.05 - 1e-9]
    return int(nodes[np.argmin(np.linalg.norm(body.mesh.nodes[nodes, :2] - point, axis=1))])


def over(place: np.ndarray, ticks: int = 40) -> np.ndarray:
    """Straight down on a place by the depth of the press, then sideways by the rest of it."""
    share = np.linspace(0, 1, ticks)[:, None]
    down = place + RADIUS * UP + 1e-4 * UP + share * (PRESS[2] - 1e-4) * UP
    return np.concatenate([down, down[-1] + share * PRESS * (1 - UP)])


def test_the_force_is_that_of_the_prescribed_node(body, tmp_path):
    simulation = simulation_of(body, tmp_path)
    node = top_node(body)
    # Beside the node, where it is still the closest: the tool's displacement is the node's, wherever it landed.
    landing = body.mesh.nodes[node] + [0.0008, -0.0005, 0.0]
    assert top_node(body, landing[:2]) == node
    played = simulation.play(over(landing), watch=[node])
    answer = simulation.green.solve(displacements={node: PRESS})
    expected = answer.forces[np.searchsorted(simulation.green.surface_nodes, node)]
    assert np.linalg.norm(expected) > 0.05
    assert np.abs(played.forces[-1] + expected).max() <= 1e-9 * np.abs(expected).max()
    assert played.displacements[-1, 0] == pytest.approx(PRESS, rel=1e-9)


def test_the_whole_surface_is_that_of_the_prescribed_node(body, tmp_path):
    simulation = simulation_of(body, tmp_path)
    node = top_node(body)
    place = body.mesh.nodes[node] + RADIUS * UP
    with simulation:
        simulation.move(place + 0.002 * UP)
        settle(simulation)
        simulation.move(place - 0.002 * UP)
        frame = settle(simulation, lambda frame: frame.contacts)
    (contact,) = frame.contacts
    assert contact.nodes.tolist() == [node] and contact.weights.tolist() == [1.0]
    answer = simulation.green.solve(displacements={node: contact.displacement})
    assert np.abs(frame.displacements - answer.displacements).max() <= 1e-9 * np.abs(answer.displacements).max()


def test_a_node_is_softer_than_a_patch(body, tmp_path):
    """A concentrated force makes a deeper dent than the same force over a disc."""
    place = body.mesh.nodes[top_node(body)]
    node, patch = (simulation_of(body, tmp_path, contact=law) for law in ("node", "patch"))
    patch.set_radius(0.015)
    assert 0 < node.run(over(place))[39, 2] < 0.8 * patch.run(over(place))[39, 2]


@pytest.mark.parametrize("law", ["node", "patch"])
def test_a_node_outside_the_touch_region_is_refused_with_a_reason(body, tmp_path, law):
    node = top_node(body)
    touchable = body.mesh.surface_nodes[body.mesh.nodes[body.mesh.surface_nodes, 0] < 0.02]
    assert node not in touchable
    simulation = simulation_of(body, tmp_path, touch=touchable, contact=law)
    path = over(body.mesh.nodes[node])
    with pytest.warns(palpate.TouchWarning, match=r"without a force, first in tick \d+: the contact"):
        assert np.abs(simulation.run(path)).max() == 0
    inside = over(body.mesh.nodes[top_node(body, (0.0, 0.025))])
    assert simulation.run(inside)[39, 2] > 0.01
    with simulation:
        simulation.move(path[39])
        frame = settle(simulation, lambda frame: frame.statistics["refused"] != [None])
        assert frame.statistics["refused"] == ["the contact reaches outside the touch region"]
        assert frame.contacts == [] and np.abs(frame.forces).max() == 0 and np.abs(frame.displacements).max() == 0
        assert frame.statistics["fault"] is None
        # Out of the scene, and where it may touch, the reason is gone.
        simulation.remove()
        settle(simulation, lambda frame: frame.statistics["refused"] == [None])
        simulation.move(inside[39])
        frame = settle(simulation, lambda frame: frame.contacts)
        assert frame.statistics["refused"] == [None] and len(frame.contacts) == 1


def test_an_unknown_contact_is_refused_with_its_line(tmp_path):
    (tmp_path / "a.toml").write_text('[body]\nmodel = "beam"\n[tool]\ncontact = "nodes"\n')
    with pytest.raises(palpate.SceneError, match=r"a\.toml:4: tool\.contact: .*'patch' or 'node', got 'nodes'"):
        palpate.Scene.read(tmp_path / "a.toml")
