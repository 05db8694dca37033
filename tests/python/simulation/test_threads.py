"""A running loop used from several threads at once: frames, settings, strikes, logs and changes."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene

SECONDS = 1.5


@pytest.fixture
def moving(block, block_green) -> BuiltScene:
    """A block in motion under two tools."""
    tools = [{"radius": 0.006, "contact_radius": 0.008}] * 2
    table = {"model": "beam"}
    read = palpate.Scene(
        body=table, dynamics={"modes": 12}, tool=tools, view={"strain_limit": 0}, device={"ramp": 0, "max_slew": 1e9}
    )
    return BuiltScene.of(read, block, block_green, read.dynamics.build(block, read.device.max_stiffness, False))


def failures(calls, seconds: float = SECONDS) -> list[BaseException]:
    """What calls raise, each of them again and again by a thread of its own, all at the same time."""
    raised: list[BaseException] = []
    end = time.monotonic() + seconds

    def repeat(call) -> None:
        step = 0
        while time.monotonic() < end and not raised:
            try:
                call(step)
            except BaseException as error:
                raised.append(error)
            step += 1

    threads = [threading.Thread(target=repeat, args=(call,)) for call in calls]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    return raised


def test_settings_frames_logs_and_recordings_of_several_threads(moving, tmp_path):
    with palpate.Simulation(moving) as simulation:
        recorded = []

        def record(step):
            simulation.record(tmp_path / f"{step}.mcap")
            time.sleep(0.02)
            recorded.append(simulation.stop_recording())

        raised = failures(
            [
                lambda step: simulation.set_radius(0.006 + 0.001 * (step % 3)),
                lambda step: simulation.set_friction(0.1 * (step % 5), tool=1),
                lambda step: simulation.set_time_scale(1.0 - 0.1 * (step % 5)),
                lambda step: simulation.move((0.04, 0.025, 0.055 - 1e-5 * (step % 100))),
                lambda step: simulation.frame().forces,
                lambda step: simulation.contacts(),
                lambda step: simulation.drain_log(),
                lambda step: simulation.recording,
                record,
            ]
        )
        assert raised == []
        # The settings of two threads do not undo each other.
        simulation.set_friction(0.25, tool=1)
        assert (simulation.friction_of(1), simulation.frame().statistics["ticks"] > 100) == (0.25, True)
    assert len(recorded) > 2 and all(status.ticks > 0 and status.error is None for status in recorded)


def test_frames_go_on_while_another_thread_changes_the_scene(moving):
    with palpate.Simulation(moving) as simulation:

        def change(step):
            if step % 2 == 0:
                simulation.remove_tool(1)
                simulation.place_body(0, (0.001 * (step % 3), 0, 0))
            else:
                simulation.add_tool(radius=0.006, contact_radius=0.008)

        raised = failures(
            [
                change,
                lambda step: simulation.frame(),
                lambda step: simulation.contacts(),
                lambda step: simulation.set_friction(0.2),
            ]
        )
        assert raised == []


def test_no_strike_of_a_tick_is_lost(moving, tmp_path):
    """Strikes that come faster than ticks are given one a tick, and those of one body add up."""
    point, impulse = (0.08, 0.025, 0.05), np.array([0.0, 0.0, -1e-4])
    with palpate.Simulation(moving) as simulation:
        simulation.record(tmp_path / "strikes.mcap")
        time.sleep(0.05)
        for step in range(6):
            simulation.strike(point, (1 + step) * impulse, duration="20ms")
        time.sleep(0.4)
        simulation.stop_recording()
    recording = palpate.Recording.load(tmp_path / "strikes.mcap")
    strikes = [event for _, event in recording.events if "strike" in event]
    assert strikes == [f"strike of {(1 + step) * 1e-4} N s on body 0" for step in range(6)]
    replayed = palpate.replay(recording, scene=moving)
    assert not replayed.differences


class CountedDevice(palpate.Device):
    """A device of a program that counts how often it is opened."""

    def __init__(self):
        self.opened = 0

    def open(self):
        self.opened += 1
        time.sleep(0.05)

    def read(self):
        return palpate.Reading((0.0, 0.0, 1.0))

    def write(self, force, torque):
        pass


def test_two_threads_that_start_a_loop_start_it_once(block, block_green):
    built = BuiltScene.of(palpate.Scene(body={"model": "beam"}, tool={"radius": "5mm"}), block, block_green)
    device = CountedDevice()
    simulation = palpate.Simulation(built, devices={0: device})
    threads = [threading.Thread(target=simulation.start) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    simulation.stop()
    assert device.opened == 1
