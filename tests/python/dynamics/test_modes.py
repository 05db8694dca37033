"""Eigenmodes against SciPy's dense solver, and their file: trusted or refused."""

from __future__ import annotations

import os

import numpy as np
import pytest
import scipy.linalg
from conftest import box_mesh, skfem_mass, skfem_stiffness

import palpate
from palpate.dynamics import basis as basis_module


@pytest.mark.parametrize("solver", ["dense", "lanczos"])
def test_modes_are_those_of_scikit_fem_and_scipy(block, solver, monkeypatch):
    if solver == "lanczos":
        monkeypatch.setattr(basis_module, "DENSE_DOFS", 0)
    basis = palpate.modes(block, 25)
    free = np.setdiff1d(np.arange(3 * len(block.mesh.nodes)), block.fixed_dofs)
    k, m = (x[free][:, free].toarray() for x in (skfem_stiffness(block), skfem_mass(block)))
    eigenvalues = scipy.linalg.eigh(k, m, eigvals_only=True)[:25]
    assert basis.frequencies == pytest.approx(np.sqrt(eigenvalues) / (2 * np.pi), rel=1e-9)
    assert basis.shapes.shape == (len(block.mesh.nodes), 3, 25)
    shapes = basis.shapes.reshape(-1, 25)
    assert shapes.T @ block.mass() @ shapes == pytest.approx(np.eye(25), abs=1e-9)
    assert not shapes[block.fixed_dofs].any()


def test_all_modes_of_a_lumped_mass(block):
    basis = palpate.modes(block, mass="lumped")
    free = np.setdiff1d(np.arange(3 * len(block.mesh.nodes)), block.fixed_dofs)
    k, m = block.stiffness()[free][:, free].toarray(), block.mass(lumped=True).diagonal()[free]
    eigenvalues = np.linalg.eigvalsh(k / np.sqrt(np.outer(m, m)))
    assert len(basis) == len(free)
    assert basis.eigenvalues == pytest.approx(eigenvalues, rel=1e-9)


@pytest.mark.parametrize("solver", ["dense", "lanczos"])
def test_a_free_body_has_six_zero_frequencies(solver, monkeypatch):
    if solver == "lanczos":
        monkeypatch.setattr(basis_module, "DENSE_DOFS", 0)
    body = palpate.Body(box_mesh(), material=palpate.Material(10e3, 0.4))
    basis = palpate.modes(body, 12)
    assert np.array_equal(basis.frequencies[:6], np.zeros(6))
    assert basis.frequencies[6] > 1.0
    k, m = body.stiffness().toarray(), body.mass().toarray()
    assert basis.eigenvalues[6:] == pytest.approx(scipy.linalg.eigh(k, m, eigvals_only=True)[6:12], rel=1e-8)
    # The six shapes are translations and rotations: they reproduce both.
    shapes = basis.shapes[:, :, :6].reshape(-1, 6)
    for rigid in (np.ones_like(body.mesh.nodes), np.cross([1.0, 2.0, 3.0], body.mesh.nodes)):
        motion = rigid.ravel()
        assert shapes @ (shapes.T @ (m @ motion)) == pytest.approx(motion, abs=1e-7 * np.abs(motion).max())


def test_the_same_body_gives_the_same_bits(block, monkeypatch, tmp_path):
    monkeypatch.setattr(basis_module, "DENSE_DOFS", 0)
    first, second = (palpate.modes(block, 10, path=tmp_path / f"{i}.modes.palpate") for i in range(2))
    assert np.array_equal(first.shapes, second.shapes)


def test_round_trip_and_reuse(block, tmp_path):
    path = tmp_path / "block.modes.palpate"
    basis = palpate.modes(block, 10, path=path)
    before = path.stat().st_mtime_ns
    again = palpate.modes(block, 10, path=path)
    fewer = palpate.modes(block, 4, path=path)
    assert path.stat().st_mtime_ns == before
    assert np.array_equal(again.shapes, basis.shapes)
    assert np.array_equal(fewer.shapes, basis.shapes[:, :, :4])
    loaded = palpate.ModalBasis.load(path, body=block, mass="consistent")
    assert np.array_equal(loaded.eigenvalues, basis.eigenvalues)
    assert loaded.key == basis.key
    assert os.listdir(tmp_path) == [path.name]
    more = palpate.modes(block, 20, path=path)
    assert len(palpate.ModalBasis.load(path)) == len(more) == 20


def test_modes_of_another_body_are_refused(block, tmp_path):
    path = tmp_path / "block.modes.palpate"
    basis = palpate.modes(block, 5, path=path)
    heavier = palpate.Body(block.mesh, material=palpate.Material(10e3, 0.4, 1100.0), fixed=block.fixed_nodes)
    with pytest.raises(palpate.StoreError, match="materials"):
        palpate.ModalBasis.load(path, body=heavier)
    with pytest.raises(palpate.StoreError, match="consistent mass matrix, but the lumped"):
        palpate.ModalBasis.load(path, mass="lumped")
    nodes = block.mesh.nodes.copy()
    nodes[-1] *= 1.0 + 1e-12
    moved = palpate.Body(palpate.TetMesh(nodes, block.mesh.tets), material=block.material, fixed=block.fixed_nodes)
    with pytest.raises(palpate.StoreError, match="node positions"):
        palpate.ModalBasis.load(path, body=moved)
    with pytest.raises(palpate.BodyError, match="not those of this body"):
        palpate.Newmark(moved, modes=basis)


def test_damaged_files_are_refused(block, tmp_path):
    path = tmp_path / "block.modes.palpate"
    palpate.modes(block, 5, path=path)
    content = path.read_bytes()
    for at in np.random.default_rng(0).integers(1500, len(content), 20):
        damaged = bytearray(content)
        damaged[at] ^= 0x10
        path.write_bytes(damaged)
        with pytest.raises(palpate.StoreError):
            palpate.ModalBasis.load(path)
    for length in (0, 4, 100, len(content) // 2):
        path.write_bytes(content[:length])
        with pytest.raises(palpate.StoreError):
            palpate.ModalBasis.load(path)
    green = tmp_path / "green.palpate"
    palpate.precompute(block, path=green)
    with pytest.raises(palpate.StoreError, match="not a file of modes"):
        palpate.ModalBasis.load(green)
    with pytest.raises(palpate.StoreError, match="no such file"):
        palpate.ModalBasis.load(tmp_path / "none")


@pytest.mark.slow
def test_no_changed_byte_of_a_header_of_modes_is_accepted(block, tmp_path):
    path = tmp_path / "block.modes.palpate"
    palpate.modes(block, 5, path=path)
    content = path.read_bytes()
    for at in range(8 + int.from_bytes(content[:8], "little")):
        for change in (0x01, 0x10):
            path.write_bytes(content[:at] + bytes([content[at] ^ change]) + content[at + 1 :])
            with pytest.raises(palpate.StoreError, match=r"^[^\n]*$"):
                palpate.ModalBasis.load(path)


@pytest.mark.parametrize("count", [0, -1, 10**6, 2.5, True])
def test_counts_that_make_no_sense_are_refused(block, count):
    with pytest.raises(palpate.BodyError, match="number of modes"):
        palpate.modes(block, count)


def test_all_modes_of_a_large_body_are_refused(block, monkeypatch):
    monkeypatch.setattr(basis_module, "ALL_MODES_DOFS", 100)
    with pytest.raises(palpate.BodyError, match="give a count"):
        palpate.modes(block)
