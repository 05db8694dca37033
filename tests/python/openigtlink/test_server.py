"""The server of OpenIGTLink: a pyigtl client moves the tool and feels it; peers that misbehave harm nobody."""

from __future__ import annotations

import contextlib
import json
import socket
import struct
import time

import numpy as np
import pytest

import palpate
from palpate.openigtlink import Axes, Link, LinkServer
from palpate.openigtlink.messages import HEADER, Message, pack, string_content, transform_content
from palpate.openigtlink.server import PATIENCE
from palpate.scene import BuiltScene

pyigtl = pytest.importorskip("pyigtl")
TOP = np.array([0.04, 0.025, 0.05])


@pytest.fixture
def simulation(block, block_green):
    scene = palpate.Scene(body={"store": "b.palpate"}, tool={"radius": 0.006}, device={"ramp": 0, "priority": 0})
    with palpate.Simulation(BuiltScene.of(scene, block, block_green)) as running:
        yield running


@pytest.fixture
def server(simulation, tmp_path):
    with LinkServer(Link(lambda: simulation, folder=tmp_path), 0) as served:
        yield served


@contextlib.contextmanager
def client_of(server):
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", server.port)
    try:
        until(client.is_connected)
        yield client
    finally:
        client.stop()


def until(holds, seconds=20.0):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)


def pose(depth):
    matrix = np.eye(4)
    matrix[:3, 3] = 1e3 * (TOP + [0, 0, 0.006 - depth])
    return matrix


def force_of(client):
    message = client.wait_for_message("Force", timeout=10)
    return json.loads(message.string)


def press(client, depth=0.003, seconds=20.0):
    """Moves the tool down and keeps it there until a force is felt."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        client.send_message(pyigtl.TransformMessage(pose(depth), device_name="Tool"))
        result = force_of(client)
        if result["force_N"][0][2] > 0.05:
            return result
    raise AssertionError("no force")


def test_a_client_moves_the_tool_and_gets_force_pose_and_contact(server, simulation):
    with client_of(server) as client:
        force = press(client)
        assert force["axes"] == "RAS" and force["fault"] is None and len(force["torque_Nm"]) == 1
        tip = client.wait_for_message("ToolPose", timeout=10).matrix[:3, 3]
        assert np.abs(tip - 1e3 * simulation.frame().positions[0]).max() < 0.5
        point = client.wait_for_message("Contacts", timeout=10)
        assert abs(point.positions[0][2] - 50.0) < 1.0 and point.diameters[0] > 1.0
        client.send_message(pyigtl.StringMessage("surface", device_name="Command"))
        answer = client.wait_for_message("Answer", timeout=10).string
        mesh = __import__("trimesh").load(answer.removeprefix("surface "), process=False)
        assert len(mesh.vertices) == len(simulation.green.surface_nodes)
        assert np.ptp(mesh.vertices[:, 0]) == pytest.approx(80.0, rel=0.05)
    until(lambda: not simulation.frame().active[0])
    assert not simulation.frame().contacts


def test_a_silent_client_lets_go(server, simulation):
    with client_of(server) as client:
        press(client)
        until(lambda: not simulation.frame().active[0])


def test_only_one_client_moves_a_tool_at_a_time(simulation, tmp_path):
    link, now = Link(lambda: simulation, folder=tmp_path), 10.0

    def move(peer, depth, at):
        link.take(peer, Message("TRANSFORM", "Tool", transform_content(pose(depth))), at)

    move("one", 0.0, now)
    move("other", 0.03, now + 0.1)
    until(lambda: simulation.frame().active[0])
    time.sleep(0.2)
    assert simulation.frame().positions[0][2] == pytest.approx(0.056, abs=1e-4)
    move("other", -0.03, now + 1.0)
    until(lambda: simulation.frame().positions[0][2] > 0.07)


def test_a_peer_that_falls_silent_leaves_the_tool_to_whoever_moved_it_since(simulation, tmp_path):
    link, content = Link(lambda: simulation, folder=tmp_path), transform_content(pose(-0.01))
    link.take("peer", Message("TRANSFORM", "Tool", content), 10.0)
    simulation.move((0.04, 0.025, 0.055))
    link.let_go_of_silent(20.0)
    time.sleep(0.2)
    assert simulation.frame().active[0]
    # A tool that was not moved since then leaves the scene.
    link.take("peer", Message("TRANSFORM", "Tool", content), 30.0)
    link.let_go_of_silent(40.0)
    until(lambda: not simulation.frame().active[0])


def test_the_scene_may_stand_elsewhere_in_the_world_of_the_wire(simulation, tmp_path):

    link = Link(lambda: simulation, Axes("LPS"), tmp_path)
    placement = np.array([[0.0, -1.0, 0.0, 100.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 20.0], [0, 0, 0, 1.0]])
    link.take("p", Message("TRANSFORM", "Body", transform_content(placement)), 0.0)
    own = pose(0.0) * [[-1], [-1], [1], [1]]
    own[:3, :3] = np.eye(3)
    link.take("p", Message("TRANSFORM", "Tool", transform_content(placement @ own)), 0.0)
    until(lambda: simulation.frame().active[0])
    until(lambda: np.abs(simulation.frame().positions[0] - TOP - [0, 0, 0.006]).max() < 1e-4)


def test_peers_that_misbehave_are_disconnected_and_harm_nobody(server, simulation, capfd):
    def closed(sender):
        sender.settimeout(20.0)
        with contextlib.suppress(ConnectionError):
            while sender.recv(65536):
                pass
        return True

    rng = np.random.default_rng(7)
    bad = [
        b"GET / HTTP/1.1\r\nHost: localhost\r\nUser-Agent: a browser that has lost its way\r\n\r\n",
        HEADER.pack(1, b"IMAGE", b"x", 0, 0, 2**40, 0),
        pack("TRANSFORM", "Tool", b"short"),
        pack("TRANSFORM", "Tool", struct.pack(">12f", *[np.nan] * 12)),
        pack("STRING", "Command", string_content("reset"))[:-1] + b"?",
        rng.bytes(200),
    ]
    with client_of(server) as client:
        press(client)
        for data in bad:
            with socket.create_connection(("127.0.0.1", server.port)) as sender:
                sender.sendall(data)
                assert closed(sender), data
        assert force_of(client)["fault"] is None and simulation.frame().statistics["fault"] is None
    assert capfd.readouterr().err.count("was disconnected") == len(bad)


def test_unknown_messages_and_commands_change_nothing(server, simulation):
    with client_of(server) as client:
        client.send_message(pyigtl.StringMessage("rm -rf /", device_name="Command"))
        assert client.wait_for_message("Answer", timeout=10).string.startswith("refused")
        client.send_message(pyigtl.PointMessage([[0.0, 0.0, 0.0]], device_name="Tool"))
        client.send_message(pyigtl.TransformMessage(pose(0.003), device_name="Tool7"))
        client.send_message(pyigtl.TransformMessage(pose(0.003), device_name="Toolbox"))
        assert force_of(client)["force_N"] == [[0.0, 0.0, 0.0]] and not simulation.frame().active[0]


def test_a_peer_that_takes_nothing_up_or_stops_within_a_message_is_left_behind(server, monkeypatch):
    monkeypatch.setattr("palpate.openigtlink.server.PATIENCE", 0.3)
    assert PATIENCE == 5.0
    half = pack("TRANSFORM", "Tool", transform_content(pose(0)))[:70]
    with (
        client_of(server) as client,
        socket.socket() as deaf,
        socket.create_connection(("127.0.0.1", server.port)) as slow,
    ):
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        deaf.connect(("127.0.0.1", server.port))
        slow.sendall(half)
        until(lambda: len(server._peers) == 1, 60)
        times = [force_of(client)["time_s"] for _ in range(10)]
        assert np.all(np.diff(times) > 0)


def test_no_more_peers_than_there_is_room_for(server):
    with contextlib.ExitStack() as stack:
        sockets = [stack.enter_context(socket.create_connection(("127.0.0.1", server.port))) for _ in range(8)]
        until(lambda: len(server._peers) == 8)
        with socket.create_connection(("127.0.0.1", server.port)) as ninth:
            ninth.settimeout(10)
            assert ninth.recv(1) == b""
        assert all(sender.recv(1) for sender in sockets)


def test_a_tracker_that_is_a_server_is_called(simulation, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as tracker:
        address = tracker.getsockname()
        with LinkServer(Link(lambda: simulation, folder=tmp_path), None, tracker=address) as server:
            assert server.port is None
            tracker.settimeout(20)
            connection, _ = tracker.accept()
            with connection:
                deadline = time.monotonic() + 20
                while not simulation.frame().active[0]:
                    assert time.monotonic() < deadline
                    connection.sendall(pack("TRANSFORM", "Tool", transform_content(pose(0.0))))
                    time.sleep(0.05)


def test_a_tracker_of_an_unknown_name_is_refused(simulation, tmp_path):
    for host in ("no-such-host.invalid", "ä..b"):
        with pytest.raises(palpate.Error, match="of --igtl-from is unknown"):
            LinkServer(Link(lambda: simulation, folder=tmp_path), None, tracker=(host, 18944))


def test_a_port_in_use_is_refused_by_its_number(server, simulation):
    with pytest.raises(palpate.ViewerError, match=str(server.port)):
        LinkServer(Link(lambda: simulation), server.port)


@pytest.mark.slow
@pytest.mark.timeout(200)
def test_sixty_a_second_for_a_minute(server, simulation, rounds):
    """A pyigtl client moves the tool sixty times a second and gets a force for each."""
    seconds, sent, got = rounds(60), 0, []
    with client_of(server) as client:
        begun = time.monotonic()
        while (now := time.monotonic() - begun) < seconds:
            if now >= sent / 60.0:
                depth = 0.002 + 0.001 * np.sin(now)
                client.send_message(pyigtl.TransformMessage(pose(depth), device_name="Tool"), wait=False)
                sent += 1
            for message in client.get_latest_messages():
                if message.device_name == "Force":
                    got.append(json.loads(message.string)["force_N"][0][2])
            time.sleep(0.001)
    assert sent / seconds >= 59 and len(got) / seconds >= 60
    assert max(got) > 0.05 and simulation.frame().statistics["fault"] is None
