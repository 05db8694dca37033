"""Messages of OpenIGTLink, against pyigtl's own, and what is refused."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from palpate.openigtlink.link import Axes
from palpate.openigtlink.messages import (
    HEADER,
    MOST_BODY_BYTES,
    MessageError,
    Reader,
    crc64,
    pack,
    point_content,
    read_string,
    read_transform,
    string_content,
    transform_content,
)

pyigtl = pytest.importorskip("pyigtl")
TURNED = np.array([[0.0, -1.0, 0.0, 12.5], [1.0, 0.0, 0.0, -3.25], [0.0, 0.0, 1.0, 40.0], [0.0, 0.0, 0.0, 1.0]])


def unpacked(data: bytes):
    """As pyigtl reads it."""
    fields = pyigtl.MessageBase.parse_header(data[: HEADER.size])
    message = pyigtl.MessageBase.create_message(fields["message_type"])
    message.unpack(fields, data[HEADER.size :])
    return message


def test_pyigtl_reads_what_is_written():
    transform = unpacked(pack("TRANSFORM", "ToolPose", transform_content(TURNED), 1.5))
    assert np.array_equal(transform.matrix, TURNED) and transform.device_name == "ToolPose"
    assert unpacked(pack("STRING", "Force", string_content('{"N": [0, 1]}'))).string == '{"N": [0, 1]}'
    points = np.array([[1.0, 2.0, 3.0], [-4.0, 5.5, 6.0]])
    point = unpacked(pack("POINT", "Contacts", point_content(points, ["a", "b"], [8.0, 9.0])))
    assert np.array_equal(point.positions, points) and point.names == ["a", "b"]


@pytest.mark.parametrize("metadata", [{}, {"unit": "mm", "from": "a tracker"}])
def test_what_pyigtl_writes_is_read_in_any_pieces(metadata):
    sent = pyigtl.TransformMessage(TURNED, device_name="Tool")
    text = pyigtl.StringMessage("reset", device_name="Command")
    sent.metadata = text.metadata = metadata
    data = sent.pack() + text.pack()
    for size in (1, 7, 58, len(data)):
        reader, messages = Reader(), []
        for start in range(0, len(data), size):
            messages += reader.push(data[start : start + size])
        assert [message.device for message in messages] == ["Tool", "Command"] and not reader.is_within_message
        assert np.array_equal(read_transform(messages[0]), TURNED)
        assert read_string(messages[1]) == "reset"


def test_the_checksum_is_that_of_the_specification():
    assert crc64(b"123456789") == 0x6C40DF5F0B497347


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (HEADER.pack(9, b"TRANSFORM", b"Tool", 0, 0, 0, 0), "version 9"),
        (HEADER.pack(1, b"IMAGE", b"Tool", 0, 0, 2**63, 0), "refused"),
        (HEADER.pack(1, b"IMAGE", b"Tool", 0, 0, MOST_BODY_BYTES + 1, 0), "refused"),
        (pack("STRING", "Command", b"abcd")[:-1] + b"x", "checksum"),
        (HEADER.pack(2, b"TRANSFORM", b"Tool", 0, 0, 4, crc64(b"abcd")) + b"abcd", "cut short"),
        (
            HEADER.pack(2, b"A", b"T", 0, 0, 12, crc64(struct.pack(">HHII", 12, 9, 9, 0)))
            + struct.pack(">HHII", 12, 9, 9, 0),
            "fit",
        ),
        (b"GET / HTTP/1.1\r\nHost: localhost\r\n" * 4, "unknown"),
    ],
)
def test_what_is_no_message_is_refused(data, words):
    with pytest.raises(MessageError, match=words):
        Reader().push(data)


def test_contents_that_are_wrong_are_refused():
    def message(kind, content):
        return Reader().push(pack(kind, "Tool", content))[0]

    for content in (b"", b"\0" * 47, np.full(12, np.nan, ">f4").tobytes(), np.zeros(12, ">f4").tobytes()):
        with pytest.raises(MessageError):
            read_transform(message("TRANSFORM", content))
    mirrored = TURNED * [[1], [1], [-1], [1]]
    with pytest.raises(MessageError, match="rotation"):
        read_transform(message("TRANSFORM", transform_content(mirrored)))
    for content in (b"", b"\0\3\0\5abc", b"\0\3\0\2\xff\xfe"):
        with pytest.raises(MessageError):
            read_string(message("STRING", content))


@pytest.mark.parametrize("name", ["RAS", "LPS"])
def test_poses_come_back_in_millimetres_and_in_the_axes_of_the_wire(name):
    axes, rng = Axes(name), np.random.default_rng(4)
    placement = np.eye(4)
    placement[:3, :3], placement[:3, 3] = np.linalg.qr(rng.normal(size=(3, 3)))[0], [100.0, -50.0, 7.0]
    placement[:3, 0] *= np.sign(np.linalg.det(placement[:3, :3]))
    axes.place(placement)
    for _ in range(20):
        quaternion = rng.normal(size=4)
        quaternion *= np.sign(quaternion[0]) / np.linalg.norm(quaternion)
        position = rng.normal(size=3)
        there = axes.pose_to_wire(position, quaternion)
        back, turned = axes.pose_from_wire(there)
        assert np.allclose(back, position, atol=1e-12) and np.allclose(turned, quaternion, atol=1e-12)
        assert np.allclose(axes.points_to_wire(position[None])[0], there[:3, 3])
        assert np.isclose(np.linalg.det(there[:3, :3]), 1.0)


def test_lps_turns_x_and_y_around():
    assert np.allclose(Axes("LPS").points_to_wire(np.array([[0.001, 0.002, 0.003]])), [[-1.0, -2.0, 3.0]])
    assert np.allclose(Axes("LPS").vector_to_wire(np.array([1.0, 2.0, 3.0])), [-1.0, -2.0, 3.0])
    assert np.allclose(Axes().pose_from_wire(TURNED)[0], [0.0125, -0.00325, 0.04])
