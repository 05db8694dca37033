"""The binary messages of the viewer: byte for byte, and of the shape that the page's own test decodes."""

from __future__ import annotations

import numpy as np
import pytest
from golden_messages import KINDS, content, stored

import palpate
from palpate.scene import BuiltScene
from palpate.viewer import messages
from palpate.viewer.fields import ClientView
from palpate.viewer.session import Session


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_is_these_bytes(kind):
    assert messages.encode(*content(kind)) == stored(kind)


@pytest.mark.parametrize("kind", KINDS)
def test_a_message_is_read_back(kind):
    header, arrays = content(kind)
    read, found = messages.decode(stored(kind))
    entries = {entry["name"]: entry for entry in read.pop("arrays")}
    assert read == header
    assert set(found) == set(arrays) == set(entries)
    for name, (dtype, array) in arrays.items():
        assert entries[name]["dtype"] == dtype and found[name].shape == array.shape
        assert np.array_equal(found[name], array), name


def shape_of(value, known):
    """Keys of a header, the first entry of a list, and whether a value is a flag, a text or a number."""
    if value is None or known is None:
        return None
    if isinstance(known, dict):
        assert isinstance(value, dict) and set(value) == set(known), (value, known)
        return {key: shape_of(value[key], known[key]) for key in known}
    if isinstance(known, list):
        assert isinstance(value, (list, tuple))
        return [shape_of(value[0], known[0])] if value and known else []
    assert isinstance(value, bool) == isinstance(known, bool) and isinstance(value, str) == isinstance(known, str)
    return None


@pytest.mark.parametrize("moving", [False, True])
def test_a_session_sends_messages_of_that_shape(block, block_green, moving):
    scene = palpate.Scene.of_store("block.palpate")
    motion = None
    if moving:
        strike = {"point": [0.04, 0.025, 0.05], "impulse": [0, 0, -1e-3]}
        scene = palpate.Scene(body={"store": "block.palpate"}, dynamics={"strike": strike})
        motion = scene.dynamics.build(block, scene.device.max_stiffness, progress=False)
    session = Session(BuiltScene.of(scene, block, block_green, motion))
    session.start()
    try:
        session.handle({"type": "press", "tool": 0, "position": [0.04, 0.025, 0.05], "grab": True})
        sent = {
            "scene": session.scene_message(),
            "frame": session.frame_message(1, (0, 0), ClientView(cutaway=True))[0],
        }
    finally:
        session.close()
    for kind, message in sent.items():
        header, arrays = messages.decode(message)
        kinds = {entry["name"]: entry["dtype"] for entry in header.pop("arrays")}
        known, expected = content(kind)
        shape_of(header, known)
        second = ("1/", "tools/1/")
        first = {name: dtype for name, (dtype, _) in expected.items() if not name.startswith(second)}
        assert kinds == first
        assert all(array.ndim == expected[name][1].ndim for name, array in arrays.items())
        assert (header["motion"] is not None) is moving
