"""Where fTetWild is not installed, NETGEN fills the wrap, and one line names the package and how it is installed."""

from __future__ import annotations

import os
import warnings

import numpy as np
import pytest
import trimesh

import palpate
from palpate.mesh.filling import Filling, MesherFailedError

# Python runs this file of a folder on its path at its start: the mesher's process does not find the package either.
HIDING = """
import sys

class Hidden:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name.split(".")[0] == "pytetwild":
            raise ModuleNotFoundError(f"No module named '{name}'")

sys.meta_path.insert(0, Hidden)
"""
RADIUS = 0.04


@pytest.fixture
def without_ftetwild(tmp_path, monkeypatch):
    folder = tmp_path / "hiding"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(HIDING)
    before = os.environ.get("PYTHONPATH")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(folder), before])))


def open_ball() -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    ball.update_faces(np.linalg.norm(ball.triangles_center - [0, 0, RADIUS], axis=1) > 0.008)
    return ball


def test_netgen_fills_the_wrap_and_one_line_names_the_package(without_ftetwild):
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        mesh = palpate.tetrahedralize(open_ball(), 0.009, "m")
    texts = [str(note.message) for note in notes]
    (missing,) = [text for text in texts if "fTetWild" in text]
    assert "is not installed" in missing and "pip install pytetwild" in missing and "\n" not in missing
    # What the wrap alone has lost says nothing of the mesh, whose nodes are put back on the surface.
    assert sum("% of the volume" in text for text in texts) == 1
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.04)


@pytest.mark.slow
def test_where_netgen_fails_too_the_error_names_the_package(without_ftetwild, monkeypatch):
    def fail(_filling):
        raise MesherFailedError("NETGEN crashed")

    monkeypatch.setattr(Filling, "mesh", fail)
    with (
        pytest.warns(palpate.MeshWarning, match="fTetWild is not installed"),
        pytest.raises(
            palpate.MeshError, match=r"is not closed .*NETGEN cannot fill the wrap.*pip install pytetwild"
        ) as e,
    ):
        palpate.tetrahedralize(open_ball(), 0.009, "m")
    assert "\n" not in str(e.value)


@pytest.mark.slow
def test_the_package_is_found_where_it_is_installed():
    pytest.importorskip("pytetwild", reason="pytetwild has no wheel for macOS", exc_type=ImportError)
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        palpate.tetrahedralize(open_ball(), 0.009, "m")
    assert not [note for note in notes if "fTetWild" in str(note.message)]
