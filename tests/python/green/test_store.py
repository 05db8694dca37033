"""The Green's function's file: trusted or refused, never half-written."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import palpate


@pytest.fixture
def store(block, tmp_path):
    path = tmp_path / "block.palpate"
    palpate.precompute(block, path=path)
    return path


def test_round_trip(block, block_green, tmp_path):
    block_green.save(tmp_path / "copy.palpate")
    copy = palpate.GreensFunction.load(tmp_path / "copy.palpate", body=block)
    node = int(np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)[3])
    a, b = (g.solve(forces={node: (0, 0, 1)}) for g in (block_green, copy))
    assert np.array_equal(a.displacements, b.displacements)
    assert copy.youngs_modulus == 10e3
    assert os.listdir(tmp_path) == ["copy.palpate"]


def test_every_flipped_byte_is_refused(store):
    content = store.read_bytes()
    rng = np.random.default_rng(0)
    places = [*rng.integers(16, len(content), 40).tolist(), len(content) - 1]
    for at in places:
        damaged = bytearray(content)
        damaged[at] ^= 0x10
        store.write_bytes(damaged)
        with pytest.raises(palpate.StoreError):
            palpate.GreensFunction.load(store)
    store.write_bytes(content)
    palpate.GreensFunction.load(store)


def damaged_in_header(content: bytes) -> list[bytearray]:
    """Every byte of the header changed, and every digit to another digit."""
    length = 8 + int.from_bytes(content[:8], "little")
    changed = []
    for at in range(length):
        values = {content[at] ^ 0x01, content[at] ^ 0x10}
        if chr(content[at]).isdigit():
            values |= {ord("0") + (content[at] - ord("0") + step) % 10 for step in (1, 8)}
        changed += [content[:at] + bytes([value]) + content[at + 1 :] for value in values]
    return changed


@pytest.mark.slow
def test_no_changed_byte_of_a_header_is_accepted(store):
    """The description has the elastic constants that contacts are computed with."""
    content = store.read_bytes()
    accepted = 0
    for damaged in damaged_in_header(content):
        store.write_bytes(damaged)
        try:
            palpate.GreensFunction.load(store)
        except palpate.StoreError as error:
            assert "\n" not in str(error)
        else:
            accepted += 1
    assert accepted == 0
    store.write_bytes(content)
    palpate.GreensFunction.load(store)


@pytest.mark.parametrize("length", [0, 4, 100, 5000])
def test_truncated_store_is_refused(store, length):
    store.write_bytes(store.read_bytes()[:length])
    with pytest.raises(palpate.StoreError, match=r"block\.palpate"):
        palpate.GreensFunction.load(store)


def test_store_cut_short_in_use_harms_nobody(block, block_green, tmp_path):
    """A mapped file would kill the process by SIGBUS."""
    block_green.save(tmp_path / "copy.palpate")
    copy = palpate.GreensFunction.load(tmp_path / "copy.palpate", body=block)
    os.truncate(tmp_path / "copy.palpate", 100)
    node = int(np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)[3])
    a, b = (g.solve(displacements={node: (0, 0, 1e-3)}) for g in (block_green, copy))
    assert np.array_equal(a.forces, b.forces)
    with pytest.raises(palpate.StoreError, match="cut short"):
        palpate.GreensFunction.load(tmp_path / "copy.palpate")


def test_missing_file(tmp_path):
    with pytest.raises(palpate.StoreError, match="no such file"):
        palpate.GreensFunction.load(tmp_path / "none.palpate")


def test_store_of_another_body_is_refused_by_load_and_replaced_by_precompute(block, store):
    other = palpate.Body(block.mesh, material=palpate.Material(20e3, 0.4), fixed=block.fixed_nodes)
    with pytest.raises(palpate.StoreError, match="materials"):
        palpate.GreensFunction.load(store, body=other)
    nodes = block.mesh.nodes.copy()
    nodes[-1] *= 1.0 + 1e-12
    moved = palpate.Body(palpate.TetMesh(nodes, block.mesh.tets), material=block.material, fixed=block.fixed_nodes)
    with pytest.raises(palpate.StoreError, match="node positions"):
        palpate.GreensFunction.load(store, body=moved)
    palpate.precompute(other, path=store)
    palpate.GreensFunction.load(store, body=other)


def test_matching_store_is_reused(block, store):
    before = store.stat().st_mtime_ns
    palpate.precompute(block, path=store)
    assert store.stat().st_mtime_ns == before


def test_touch_region_has_only_its_columns(block, block_green, tmp_path):
    region = np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)[:9]
    green = palpate.precompute(block, touch=region, precision="f64", path=tmp_path / "region.palpate")
    assert green.touchable_nodes.tolist() == region.tolist()
    a = green.solve(forces={int(region[2]): (1, 2, 3)}).displacements
    b = block_green.solve(forces={int(region[2]): (1, 2, 3)}).displacements
    assert np.abs(a - b).max() <= 1e-12 * np.abs(b).max()
    outside = int(np.setdiff1d(green.surface_nodes, region)[0])
    with pytest.raises(palpate.Error, match=f"node {outside} is not touchable"):
        green.solve(forces={outside: (1, 0, 0)})


def test_unwritable_folder_is_an_os_error_and_leaves_nothing(block, block_green, tmp_path):
    with pytest.raises(OSError, match="No such file"):
        block_green.save(tmp_path / "missing" / "x.palpate")
    assert os.listdir(tmp_path) == []


def test_write_cut_short_is_an_os_error_and_leaves_nothing(tmp_path):
    """A file size limit cuts the write in the middle, as a full disk does: here before any columns are finished."""
    program = f"""
import resource, signal, sys; sys.path.insert(0, {os.path.dirname(os.path.dirname(__file__))!r})
from conftest import box_mesh
import palpate
body = palpate.Body(box_mesh(), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000))
try:
    palpate.precompute(body, path={str(tmp_path / "cut.palpate")!r})
except OSError as error:
    print(error)
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=280)
    assert result.returncode == 0, result.stderr
    assert "cut.palpate'" in result.stdout
    assert os.listdir(tmp_path) == []
