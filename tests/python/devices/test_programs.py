"""Devices of a program in a simulation: the force of the body reaches them, and ends where it should."""

from __future__ import annotations

import time

import numpy as np
import pytest
from conftest import box_mesh
from held_device import starved, unstarved

import palpate

TOP, RADIUS, PATCH, DEPTH = 0.06, 0.006, 0.012, 0.003
PLACE = np.array([0.03, 0.03, TOP + RADIUS - DEPTH])


@pytest.fixture(scope="module")
def green(tmp_path_factory):
    """A cube 60 mm wide, held from below, with its store."""
    mesh = box_mesh((4, 4, 4), (0.06, 0.06, TOP), jitter=0.0)
    body = palpate.Body(mesh, material=palpate.Material(20e3, 0.4), fixed=mesh.nodes[:, 2] < 1e-9)
    path = tmp_path_factory.mktemp("programs") / "cube.palpate"
    palpate.precompute(body, path=path, progress=False)
    return palpate.GreensFunction.load(path)


class Pressing(palpate.Device):
    """Stands above the top; told to press, goes down to a depth within a quarter of a second, and stays."""

    limits = palpate.DeviceLimits(max_stiffness=5000.0)
    # How the frame of the device lies in the scene.
    SCALE, SHIFT = 2.0, np.array([0.01, -0.02, 0.03])

    def __init__(self, aside=0.0):
        self.place = PLACE + [aside, 0, 0]
        self.begun, self.written, self.closed, self.go_wrong = None, [], 0, None

    def read(self):
        if self.go_wrong is not None:
            raise self.go_wrong
        above = 0.005 * (1.0 if self.begun is None else max(0.0, 1.0 - 4.0 * (time.monotonic() - self.begun)))
        # In the scene: turned by a right angle about z, x to y.
        x, y, z = (self.place + [0, 0, above] - self.SHIFT) / self.SCALE
        return palpate.Reading(np.array([y, -x, z]))

    def write(self, force, torque):
        self.written.append((time.monotonic(), force))

    def close(self):
        self.closed += 1


def scene_of(green, tools=1):
    half = np.sqrt(0.5)
    table = {"position": tuple(Pressing.SHIFT), "orientation": (half, 0.0, 0.0, half), "scale": Pressing.SCALE}
    return palpate.Scene(
        body={"store": str(green.path)},
        tool=[{"radius": RADIUS, "contact": "patch", "contact_radius": PATCH}] * tools,
        device=[{"force_scale": 0.5, "priority": 0, **table}, table][:tools],
    )


def pressed(simulation, *devices):
    """Forces on the tools of devices that press, when they have been the same for a while, N."""

    def attempt():
        for device in devices:
            device.begun = None
        time.sleep(0.05)
        simulation.reset()
        time.sleep(0.05)
        for device in devices:
            device.begun = time.monotonic()
        before = np.full(3, np.nan)
        for _ in range(100):
            time.sleep(0.05)
            frame = simulation.frame()
            if frame.forces.any() and np.abs(frame.forces - before).max() < 1e-9:
                return frame.forces, None
            if starved(frame.statistics["fault"]):
                return None, frame.statistics["fault"]
            before = frame.forces
        raise AssertionError(f"the force does not settle: {frame.forces}, {frame.statistics['fault']}")

    return unstarved(attempt)


def test_the_force_of_the_body_reaches_the_program_in_its_own_frame(green):
    device = Pressing()
    with palpate.Simulation(scene_of(green), devices={0: device}) as simulation:
        assert simulation.devices == {0: "Pressing"}
        force = pressed(simulation, device)[0]
        touch = green.touch(point=(0.03, 0.03, TOP), displacement=(0.0, 0.0, -DEPTH), radius=PATCH)
        # A spring of 5000 / (2 * 0.5) N/m at most stands in series: the contact is that much softer.
        compliance = DEPTH / -touch.force[2]
        assert force[2] == pytest.approx(DEPTH / compliance, rel=0.02)
        x, y, z = force
        assert device.written[-1][1] == pytest.approx(0.5 * np.array([y, -x, z]), rel=1e-9, abs=1e-12)
        frame = simulation.frame()
        assert frame.positions[0] == pytest.approx(PLACE, abs=1e-12)
    assert not device.written[-1][1].any() and device.closed == 1


def test_a_failure_is_told_in_the_frame_and_passes_by_a_reset(green):
    device = Pressing()
    with palpate.Simulation(scene_of(green), devices={0: device}) as simulation:
        before = pressed(simulation, device)
        with pytest.warns(palpate.DeviceWarning, match="OSError: the cable is out"):
            device.go_wrong, wrong = OSError("the cable is out"), time.monotonic()
            time.sleep(0.3)
        frame = simulation.frame()
        assert frame.statistics["fault"] == (
            "tool 0: Pressing.read raised OSError: the cable is out; forces are off until a reset"
        )
        assert not frame.forces.any()
        # Of the loop's own time a tick, of the machine's what it takes to wake a thread.
        assert not any(force.any() for when, force in device.written if when > wrong + 0.1)
        device.go_wrong = None
        time.sleep(0.3)
        assert simulation.frame().statistics["fault"] is not None, "it stays until a reset"
        assert pressed(simulation, device) == pytest.approx(before, rel=1e-6)


def test_two_programs_feel_each_other_and_one_device_moves_one_tool(green):
    def felt(*devices):
        given = dict(enumerate(devices))
        with palpate.Simulation(scene_of(green, len(given)), devices=given) as simulation:
            return pressed(simulation, *devices)[0]

    alone, beside = felt(Pressing(-0.015)), felt(Pressing(-0.015), Pressing(0.015))
    assert 0.2 * alone[2] < beside[2] < 0.99 * alone[2], "what the neighbour has pressed down resists less"
    twice = Pressing()
    with pytest.raises(palpate.DeviceError, match="another tool or simulation has this device"):
        palpate.Simulation(scene_of(green, 2), devices={0: twice, 1: twice}).start()
    assert twice.closed == 1, "what was opened before the refusal is closed"


def test_devices_come_and_go_while_the_loop_runs(green):
    device = Pressing()
    with palpate.Simulation(scene_of(green)) as simulation:
        tool = simulation.add_tool(device=device, radius=RADIUS, contact="patch", contact_radius=PATCH)
        assert simulation.devices == {tool: "Pressing"}
        simulation.remove_tool(tool)
        assert device.closed == 1 and not device.written[-1][1].any()
        simulation.connect(0, device)
        assert pressed(simulation, device)[0][2] > 0
    assert device.closed == 2


def test_what_is_no_device_is_refused(green):
    with pytest.raises(
        palpate.DeviceError, match=r"tool 0 must be an object of a palpate\.Device, got the class Pressing"
    ):
        palpate.Simulation(scene_of(green), devices={0: Pressing})
    with palpate.Simulation(scene_of(green)) as simulation:
        with pytest.raises(palpate.DeviceError, match=r"must be an object of a palpate\.Device, got dict"):
            simulation.add_tool(device={})
