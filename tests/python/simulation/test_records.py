"""Answers, frames and recordings as values: compared, printed, refused when there is nothing to read."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from running import settle

import palpate
from palpate.scene import BuiltScene

TOP = np.array([0.041, 0.026, 0.05])
RADIUS = 0.005


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    scene = palpate.Scene(body={"store": "block.palpate"}, tool={"radius": RADIUS, "contact_radius": 0.012})
    return BuiltScene.of(scene, block, block_green)


def press(built: BuiltScene, depth: float) -> palpate.Recording:
    path = TOP + [0.0, 0.0, RADIUS] - np.outer(np.linspace(-1e-4, depth, 50), [0.0, 0.0, 1.0])
    return palpate.Simulation(built).play(path, watch=[int(built.bodies[0].green.surface_nodes[5])])


def one_number_changed(record, name: str):
    changed = np.array(getattr(record, name))
    changed.flat[-1] = np.nextafter(changed.flat[-1], np.inf)
    return dataclasses.replace(record, **{name: changed})


def test_answers_are_equal_if_all_their_numbers_are(block_green):
    touch, again = (block_green.touch(TOP, (None, None, -1e-3), 0.012) for _ in range(2))
    assert touch == again and touch is not again
    assert touch != one_number_changed(touch, "displacements") and touch != one_number_changed(touch, "force")
    assert touch != "a touch"
    node = int(block_green.touchable_nodes[-1])
    answers = [block_green.solve(forces={node: (0.1, 0, force)}) for force in (0.0, 0.0, 0.2)]
    assert answers[0] == answers[1] != answers[2]
    with pytest.raises(TypeError, match="unhashable"):
        hash(touch)


def test_recordings_are_equal_if_their_ticks_are(built):
    assert press(built, 1e-3) == press(built, 1e-3) != press(built, 1.1e-3)
    longer = press(built, 1e-3)
    assert longer != dataclasses.replace(longer, time=longer.time[:-1])


def test_loads_on_masks_are_compared_too():
    masks = [np.array([True, False, value]) for value in (True, True, False)]
    loads = [palpate.Loads(pressure=[(mask, 5.0)], forces={1: (0, 0, 1)}) for mask in masks]
    assert loads[0] == loads[1] != loads[2]


def test_frames_and_contacts_are_compared_by_value(built):
    with palpate.Simulation(built) as simulation:
        simulation.move(TOP + [0, 0, RADIUS - 1e-3])
        frame = settle(simulation, lambda frame: frame.contacts)
        assert len(frame.contacts) == 1
        (body,) = frame.bodies
        copied = dataclasses.replace(body, displacements=body.displacements.copy())
        assert frame == dataclasses.replace(frame, bodies=(copied,))
        assert frame != dataclasses.replace(frame, bodies=(one_number_changed(body, "displacements"),))
        assert frame != one_number_changed(frame, "forces")
        assert frame.contacts[0] != one_number_changed(frame.contacts[0], "weights")
        assert settle(simulation) != frame, "another tick has another time"


def test_a_line_tells_what_a_thing_is(built, block, block_green):
    mesh = block.mesh
    counts = f"{len(mesh.nodes)} nodes, {len(mesh.tets)} 4-node tets"
    assert repr(block) == f"Body({counts}, 1 material, {len(block.fixed_nodes)} nodes fixed)"
    surface, path = len(mesh.surface_nodes), block_green.path
    expected = f"GreensFunction({surface} surface nodes, {surface} touchable, f64, E = 1e+04 Pa, {path})"
    assert repr(block_green) == expected
    touch = block_green.touch(TOP, (0, 0, -1e-3), 0.012)
    largest = 1e3 * np.linalg.norm(touch.displacements, axis=1).max()
    assert repr(touch).startswith("Touch(force [")
    assert repr(touch).endswith(f"largest displacement {largest:.4g} mm, right to {100 * touch.error:.2g} %)")
    assert repr(built.scene) == "Scene(block.palpate, tool of radius 5 mm)"
    recording = press(built, 1e-3)
    assert repr(recording).startswith("Recording(50 ticks, largest force ")
    with palpate.Simulation(built) as simulation:
        assert repr(simulation) == "Simulation(block, 1 tool, running)"
        simulation.move(TOP + [0, 0, RADIUS - 1e-3])
        frame = settle(simulation, lambda frame: frame.contacts)
    assert repr(simulation) == "Simulation(block, 1 tool, stopped)"
    assert f"{frame.time:.3f} s, 1 contact, forces on the devices [" in repr(frame)
    assert repr(frame.contacts[0]).startswith("Contact(tool 0, press, ")
    answer = block_green.solve(forces={int(block_green.touchable_nodes[-1]): (0.1, 0, 0)})
    things = [block, block_green, touch, built.scene, recording, simulation, frame, frame.contacts[0], answer, mesh]
    assert all("\n" not in repr(thing) and len(repr(thing)) < 250 for thing in things)


def test_a_loop_that_does_not_run_is_a_fault_of_the_simulation_not_of_the_scene(built):
    with pytest.raises(palpate.SimulationError, match="does not run"):
        palpate.Simulation(built).frame()
    assert not issubclass(palpate.SimulationError, palpate.SceneError)
    assert issubclass(palpate.SimulationError, palpate.Error)


@pytest.mark.parametrize("position", [(0, 0), (0, np.nan, 0), None, "abc"])
def test_a_position_that_is_none_is_refused_by_name(built, position):
    with pytest.raises(palpate.SceneError, match=r"a tool's position (needs three numbers|has a number that is not)"):
        palpate.Simulation(built).move(position)
