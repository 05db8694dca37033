"""Forces at the places of an exam are kept, and never taken from a file that was damaged."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from palpate.exam.library import _ForceCache


def test_no_changed_byte_of_kept_forces_is_taken(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    asked = SimpleNamespace(force_settings=lambda: "press"), SimpleNamespace(points=np.zeros((2, 3)))
    _ForceCache(*asked).add("key", [0.25, 0.5])
    (path,) = tmp_path.rglob("*.felt.palpate")
    content = path.read_bytes()
    assert _ForceCache(*asked).forces == {"key": [0.25, 0.5]}
    for at in range(len(content)):
        for change in (0x01, 0x10):
            path.write_bytes(content[:at] + bytes([content[at] ^ change]) + content[at + 1 :])
            assert _ForceCache(*asked).forces in ({}, {"key": [0.25, 0.5]})


@pytest.mark.parametrize("text", ["[]", "7", '{"key": [1.0]}'])
def test_forces_of_another_form_are_made_again(text, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    asked = SimpleNamespace(force_settings=lambda: "press"), SimpleNamespace(points=np.zeros((2, 3)))
    _ForceCache(*asked).add("key", [0.25])
    (path,) = tmp_path.rglob("*.felt.palpate")
    path.write_text(text)
    assert _ForceCache(*asked).forces == {} and not path.exists()
