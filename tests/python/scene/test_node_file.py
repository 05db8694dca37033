"""Supports in a file of node numbers."""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.scene.files import read_nodes, write_nodes


def test_numbers_come_back_ascending_and_once(tmp_path):
    nodes = np.random.default_rng(1).integers(0, 10**6, 1000)
    write_nodes(tmp_path / "a.nodes", nodes, "of a test")
    assert read_nodes(tmp_path / "a.nodes") == np.unique(nodes).tolist()


def test_a_scene_holds_the_nodes_of_its_file(tmp_path, block):
    block.mesh.write(tmp_path / "block.vtu")
    held = np.flatnonzero(block.mesh.nodes[:, 0] < 1e-9)
    write_nodes(tmp_path / "held.nodes", held, "one side")
    (tmp_path / "a.toml").write_text(
        '[body]\nmesh = "block.vtu"\nunit = "m"\n[supports]\nfixed = "held.nodes"\n'
        "[material]\nyoungs_modulus = 10e3\npoissons_ratio = 0.4\n"
    )
    built = palpate.Scene.read(tmp_path / "a.toml").build()
    assert built.bodies[0].green.key == palpate.precompute(block).key


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1 2 x", "a.nodes:1: 'x' is no node number"),
        ("# none\n", "holds no node numbers"),
        ("1 -2", "'-2' is no node"),
        (None, "no such file"),
        ("999999", "node 999999 does not exist"),
    ],
)
def test_a_wrong_file_is_refused(tmp_path, block, text, reason):
    if text is not None:
        (tmp_path / "a.nodes").write_text(text)
    block.mesh.write(tmp_path / "block.vtu")
    path = tmp_path / "a.toml"
    path.write_text('[body]\nmesh = "block.vtu"\nunit = "m"\n[supports]\nfixed = "a.nodes"\n')
    with pytest.raises(palpate.Error, match=reason):
        palpate.Scene.read(path).require_files()
