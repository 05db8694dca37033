"""The regular compliance beside the store: read again, and computed again where it is damaged or cannot be kept."""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.validation.verify.grids import box

SIZE = (0.04, 0.04, 0.02)
PRESS = np.array([[0.02, 0.02, 0.026], [0.02, 0.02, 0.0245], [0.021, 0.02, 0.0242]])


@pytest.fixture
def kept(tmp_path):
    """A body whose store stands in a folder, and the forces of a press on it."""
    mesh = box((4, 4, 2), SIZE, quadratic=True)
    body = palpate.Body(mesh, material=palpate.Material(10e3, 0.45), fixed=np.flatnonzero(mesh.nodes[:, 2] < 1e-9))
    palpate.precompute(body, path=tmp_path / "block.palpate", progress=False)
    table = {"name": "block", "model": "liver"}  # the table asks for a source; the body is given

    def press(radius: float = 5e-3) -> np.ndarray:
        green = palpate.GreensFunction.load(tmp_path / "block.palpate", body=body)
        tool = {"radius": radius, "contact": "local", "friction": 0.0}
        scene = palpate.Scene(body=table, tool=[tool], device={"ramp": 0.0})
        return palpate.Simulation(BuiltScene.of(scene, body, green)).run(PRESS)

    return tmp_path, press


def files(folder):
    return sorted(folder.glob("*.contact.palpate"))


def test_it_is_kept_for_every_tool_and_read_again(kept):
    folder, press = kept
    first = press()
    assert np.abs(first).max() > 0
    (file,) = files(folder)
    written = file.stat().st_mtime_ns
    assert np.array_equal(press(), first)
    assert file.stat().st_mtime_ns == written
    press(radius=6e-3)
    assert len(files(folder)) == 2
    assert {path.name for path in folder.iterdir()} == {"block.palpate", *(path.name for path in files(folder))}


@pytest.mark.parametrize("damage", [lambda whole: whole[: len(whole) // 2], lambda whole: whole[:-9] + b"\x07" * 9])
def test_a_damaged_file_is_computed_again(kept, damage):
    folder, press = kept
    first = press()
    (file,) = files(folder)
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    assert np.array_equal(press(), first)
    # The header's entries have no order.
    assert (file.stat().st_size, file.read_bytes()[-500:]) == (len(whole), whole[-500:])


def test_where_nothing_can_be_written_the_answer_is_the_same(kept):
    folder, press = kept
    first = press()
    (file,) = files(folder)
    file.unlink()
    file.mkdir()  # a folder stands where the file would
    assert np.array_equal(press(), first)
    assert file.is_dir()


@pytest.mark.slow
def test_few_are_kept_beside_a_store(kept):
    folder, press = kept
    for k in range(20):
        press(radius=5e-3 + 1e-4 * k)
    assert len(files(folder)) == 16
