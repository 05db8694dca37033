"""Bodies and tools that come into a running simulation and go out of it; devices of a scene."""

import time

import numpy as np
import pytest
from conftest import box_mesh
from emulators import REST, inverse_service

import palpate

RUBBER = palpate.Material(youngs_modulus=20e3, poissons_ratio=0.4)
DEPTH = 0.003


@pytest.fixture(scope="module")
def green(tmp_path_factory):
    """A cube 60 mm wide, held from below, with its store."""
    mesh = box_mesh((5, 5, 5), (0.06, 0.06, 0.06), jitter=0.0)
    body = palpate.Body(mesh, material=RUBBER, fixed=mesh.nodes[:, 2] < 1e-9)
    path = tmp_path_factory.mktemp("changing") / "cube.palpate"
    palpate.precompute(body, path=path, progress=False)
    return palpate.GreensFunction.load(path)


def scene_of(green, tools=1):
    return palpate.Scene(
        body={"store": str(green.path)},
        tool=[{"radius": 0.006, "contact": "patch", "contact_radius": 0.012}] * tools,
        device={"rate": 1000.0, "priority": 0},
    )


def pressing_force(simulation, tool, x):
    """Force on a tool that presses the top at (x, 0.03), once it has settled, N."""
    simulation.move((x, 0.03, 0.08), tool=tool)
    time.sleep(0.1)
    simulation.move((x, 0.03, 0.066 - DEPTH), tool=tool)
    return settled(simulation, tool)


def settled(simulation, tool):
    before = np.full(3, np.nan)
    for _ in range(200):
        time.sleep(0.05)
        frame = simulation.frame()
        assert frame.statistics["fault"] is None
        if np.abs(frame.forces[tool] - before).max() < 1e-9 and frame.time > 0.4:
            return frame.forces[tool]
        before = frame.forces[tool]
    raise AssertionError("the force does not settle")


def expected(green, x):
    """The same by `green.touch`: the patch is pressed so deep."""
    touch = green.touch(point=(x, 0.03, 0.06), displacement=(0.0, 0.0, -DEPTH), radius=0.012)
    return -touch.force


def test_a_body_and_a_tool_come_and_go(green):
    with palpate.Simulation(scene_of(green)) as simulation:
        alone = pressing_force(simulation, 0, 0.03)
        assert np.allclose(alone, expected(green, 0.03), rtol=0.01, atol=1e-4)
        body = simulation.add_body(green, position=("200mm", 0, 0))
        tool = simulation.add_tool(radius="6mm", contact="patch", contact_radius="12mm")
        assert (body, tool) == (1, 1) and len(simulation.bodies) == 2 and len(simulation.scene.tools) == 2
        assert np.array_equal(simulation.frame().forces[0], alone), "what is there feels nothing of it"
        second = pressing_force(simulation, 1, 0.23)
        assert np.allclose(second, alone, rtol=1e-6)
        contacts = {(contact.tool, contact.body) for contact in simulation.frame().contacts}
        assert contacts == {(0, 0), (1, 1)}
        # Ranks behind what goes move up.
        simulation.remove_body(0)
        frame = simulation.frame()
        assert {(contact.tool, contact.body) for contact in frame.contacts} == {(1, 0)}
        assert np.array_equal(frame.forces[0], np.zeros(3)) and np.allclose(frame.forces[1], second)
        simulation.remove_tool(0)
        assert np.allclose(simulation.frame().forces, [second])
        simulation.set_youngs_modulus("40kPa")
        assert np.allclose(settled(simulation, 0), 2 * second, rtol=1e-6)


def test_a_body_that_is_moved_takes_its_contact_along(green):
    with palpate.Simulation(scene_of(green)) as simulation:
        force = pressing_force(simulation, 0, 0.03)
        simulation.place_body(0, (0.0, 0.0, -0.001))
        less = settled(simulation, 0)
        assert np.allclose(less, force * (DEPTH - 0.001) / DEPTH, rtol=1e-6)
        turned = (np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4))
        simulation.place_body(0, (0.06, 0.0, 0.0), turned)
        surface = simulation.frame().bodies[0].surface_in_scene().positions
        assert np.allclose([surface.min(axis=0), surface.max(axis=0)], [[0, 0, 0], [0.06, 0.06, 0.06]])


def test_changes_before_the_start_and_offline(green):
    simulation = palpate.Simulation(scene_of(green))
    simulation.add_body(green, position=(0.2, 0.0, 0.0))
    simulation.add_tool(radius=0.006, contact="patch", contact_radius=0.012)
    path = np.zeros((800, 2, 3))
    path[:, 0], path[:, 1] = (0.03, 0.03, 0.1), (0.23, 0.03, 0.066)
    path[:, 1, 2] -= np.linspace(0, DEPTH, 800)
    forces = simulation.run(path)
    assert np.allclose(forces[-1, 1], expected(green, 0.03), rtol=0.01, atol=1e-4)
    assert not forces[:, 0].any()


def test_a_moving_body_comes_in(green, tmp_path):
    scene = palpate.Scene(body={"model": "beam"}, dynamics={"modes": 10})
    simulation = palpate.Simulation(scene_of(green))
    with simulation:
        moving = simulation.add_body(scene, position=(0.0, 0.5, 0.0))
        assert simulation.bodies[moving].motion is not None
        simulation.strike((0.1, 0.5, 0.0), (0.0, 0.0, -1e-3), body=moving)
        deadline = time.monotonic() + 10
        while simulation.frame().bodies[moving].energy.kinetic == 0.0 and time.monotonic() < deadline:
            time.sleep(0.01)
        assert simulation.frame().bodies[moving].energy.kinetic > 0.0


def test_what_cannot_be_is_refused(green, tmp_path):
    with palpate.Simulation(scene_of(green)) as simulation:
        for change, message in [
            (lambda: simulation.remove_body(0), "needs a body"),
            (lambda: simulation.remove_tool(0), "needs a tool"),
            (lambda: simulation.remove_body(3), "there is no body 3"),
            (lambda: simulation.add_tool(radius="-2mm"), "tool.radius"),
            (lambda: simulation.add_tool("mouse"), "no kind of device 'mouse'"),
            (lambda: simulation.place_body(0, (0, 0, float("nan"))), "finite"),
            (lambda: simulation.place_body(0, (0, 0, 0), (1, 1, 0, 0)), "unit quaternion"),
        ]:
            with pytest.raises(palpate.Error, match=message):
                change()
        for _ in range(3):
            simulation.add_tool(radius="4mm")
        with pytest.raises(palpate.Error, match="at most 4 tools"):
            simulation.add_tool(radius="4mm")
        assert len(simulation.scene.tools) == 4 and len(simulation.frame().forces) == 4
        simulation.record(tmp_path / "run.mcap")
        with pytest.raises(palpate.Error, match="stop the recording first"):
            simulation.remove_tool(3)
        simulation.stop_recording()
        simulation.remove_tool(3)
        assert len(simulation.frame().forces) == 3


def test_devices_come_and_go_while_the_loop_runs(green, monkeypatch):
    with inverse_service(REST) as (address, process), palpate.Simulation(scene_of(green)) as simulation:
        monkeypatch.setenv("PALPATE_HAPLY_ADDRESS", address)
        with pytest.warns(palpate.DeviceWarning, match="800 N/m"):
            tool = simulation.add_tool("haply", radius="6mm", contact="patch", contact_radius="12mm")
        assert simulation.devices == {1: "Haply Inverse3 0A01"} and simulation.frame().active.tolist() == [False, True]
        with pytest.raises(palpate.SceneError, match="tool 1 is moved by Haply"):
            simulation.move((0.0, 0.0, 0.0), tool=tool)
        simulation.remove_tool(tool)
        assert simulation.devices == {}
        # The arm is free again: another tool takes it.
        with pytest.warns(palpate.DeviceWarning, match="800 N/m"):
            assert simulation.connect(0, "haply") == "Haply Inverse3 0A01"
        assert simulation.frame().active.tolist() == [True]
        process.kill()
        deadline = time.monotonic() + 20
        while simulation.frame().statistics["fault"] is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert "the device is disconnected" in simulation.frame().statistics["fault"]
        with pytest.raises(palpate.DeviceError, match="no Haply Inverse Service listens"):
            simulation.add_tool("haply")
        assert len(simulation.scene.tools) == 1
