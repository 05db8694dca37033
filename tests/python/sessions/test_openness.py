"""A recording read by the `mcap` package and its support of ROS 2 alone, field by field, against our own reader."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from mcap_ros2.decoder import DecoderFactory

import palpate


@pytest.fixture(scope="module")
def messages(file) -> dict[str, list]:
    """All messages by topic; chunks are checked by their own sums."""
    by_topic = defaultdict(list)
    with file.open("rb") as stream:
        reader = NonSeekingReader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for _, channel, _, message in reader.iter_decoded_messages():
            by_topic[channel.topic].append(message)
    return by_topic


@pytest.fixture(scope="module")
def ours(file) -> palpate.Recording:
    return palpate.Recording.load(file)


def vector(message) -> list[float]:
    return [message.x, message.y, message.z]


def quaternion(message) -> list[float]:
    return [message.w, *vector(message)]


def of_tools(ticks, number) -> np.ndarray:
    return np.array([[number(tool) for tool in tick.tools] for tick in ticks])


def test_the_topics_are_those_that_are_documented(messages):
    tools = [f"/tool{tool}/{kind}" for tool in range(2) for kind in ("pose", "wrench")]
    assert sorted(messages) == sorted(["/ticks", "/settings", "/events", *tools])


def test_ticks(messages, ours):
    ticks = messages["/ticks"]
    assert np.array_equal([tick.number for tick in ticks], ours.ticks) and len(ours.ticks) == 300
    period = 1 / float(ours.about["rate"])
    assert np.allclose([tick.stamp.sec + 1e-9 * tick.stamp.nanosec + period for tick in ticks], ours.time, atol=2e-9)
    assert {tick.period for tick in ticks} == {period}
    assert np.array_equal([1e-3 * tick.took_ns for tick in ticks], ours.compute_us)
    assert np.array_equal([1e-3 * tick.delay_ns for tick in ticks], ours.wakeup_us)
    assert [tick.number for tick in ticks if tick.strike] == [100]
    assert not any(tick.reset or tick.fault.kind or tick.unasked for tick in ticks)
    for name, number in {
        "positions": lambda tool: vector(tool.pose.position),
        "orientations": lambda tool: quaternion(tool.pose.orientation),
        "velocities": lambda tool: vector(tool.twist.linear),
        "angular_velocities": lambda tool: vector(tool.twist.angular),
        "forces": lambda tool: vector(tool.wrench.force),
        "torques": lambda tool: vector(tool.wrench.torque),
        "computed_forces": lambda tool: vector(tool.computed.force),
        "computed_torques": lambda tool: vector(tool.computed.torque),
        "port_energy": lambda tool: list(tool.port_energy),
        "buttons": lambda tool: tool.buttons,
        "active": lambda tool: tool.active,
        "limited": lambda tool: tool.limited,
    }.items():
        expected = getattr(ours, name)
        assert np.array_equal(of_tools(ticks, number), expected), name
        assert expected.any() or name in ("buttons", "limited"), f"{name} is not zero everywhere"
    faults = of_tools(ticks, lambda tool: [tool.fault.kind, tool.fault_before.kind, tool.reading_fault.kind])
    assert not faults.any()
    assert np.isfinite(of_tools(ticks, lambda tool: [*vector(tool.law.force), *vector(tool.law.torque)])).all()


def test_contacts(messages, ours):
    found = [(tick.number, contact) for tick in messages["/ticks"] for contact in tick.contacts]
    rows = ours.contacts
    assert len(found) == len(rows) > 200
    for name in ("tool", "body", "slipping", "limited", "point", "normal", "force", "torque"):
        assert np.array_equal([getattr(contact, name) for _, contact in found], rows[name]), name
    for name in ("radius", "depth", "stiffness"):
        assert np.array_equal(np.array([getattr(contact, name) for _, contact in found], "f4"), rows[name]), name
    assert np.array_equal([number for number, _ in found], rows["tick"])
    assert np.array_equal([contact.mode == 2 for _, contact in found], rows["grab"])


def test_bodies(messages, ours):
    bodies = [tick.bodies[0] for tick in messages["/ticks"]]
    for name in ("kinetic", "strain", "coupling", "dissipated", "work"):
        assert np.array_equal([getattr(body, name) for body in bodies], getattr(ours.energy, name)), name
    assert np.allclose([body.time for body in bodies], ours.time, rtol=1e-12)


def test_settings(messages, ours):
    assert [settings.number for settings in messages["/settings"]] == [row["tick"] for row in ours.settings] == [0, 100]
    for message, row in zip(messages["/settings"], ours.settings, strict=True):
        for name in row.keys() - {"tick"}:
            assert np.array_equal(getattr(message, name), row[name]), name
    assert messages["/settings"][1].strike_impulse == [0, 0, -2e-4]


def test_events(messages, ours):
    result = messages["/events"]
    at = [round(1000 * (event.stamp.sec + 1e-9 * event.stamp.nanosec)) for event in result]
    assert [(tick, event.msg) for tick, event in zip(at, result, strict=True)] == list(ours.events)
    assert [event.name for event in result] == ["palpate"]


@pytest.mark.parametrize("tool", [0, 1])
def test_poses_and_wrenches_for_any_viewer_of_ros(tool, messages, ours):
    poses, wrenches = messages[f"/tool{tool}/pose"], messages[f"/tool{tool}/wrench"]
    stamps = [round(1000 * (pose.header.stamp.sec + 1e-9 * pose.header.stamp.nanosec)) for pose in poses]
    assert stamps == list(range(0, 300, 20)), "fifty a second"
    assert {pose.header.frame_id for pose in poses} == {"world"}
    assert np.array_equal([vector(pose.pose.position) for pose in poses], ours.positions[::20, tool])
    assert np.array_equal([quaternion(pose.pose.orientation) for pose in poses], ours.orientations[::20, tool])
    assert np.array_equal([vector(wrench.wrench.force) for wrench in wrenches], ours.forces[::20, tool])
    assert np.array_equal([vector(wrench.wrench.torque) for wrench in wrenches], ours.torques[::20, tool])
