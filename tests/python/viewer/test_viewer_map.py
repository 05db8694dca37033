"""What a palpation has left, as a field of the page."""

from __future__ import annotations

import numpy as np
import pytest
from palpated import HEIGHT, TOP, block_body, scene_of
from viewer_client import frame_of

import palpate
from palpate.palpation import compare, stiffness_map
from palpate.viewer import messages
from palpate.viewer.fields import ClientView, read_map
from palpate.viewer.session import Session


@pytest.fixture(scope="module")
def palpated(tmp_path_factory):
    """A scene, its map, and the file of a comparison with a softer body."""
    folder = tmp_path_factory.mktemp("map")
    for name, modulus in (("block", 10e3), ("softer", 8e3)):
        palpate.precompute(block_body(modulus), path=folder / f"{name}.palpate")
    built = scene_of(folder / "block.palpate").build()
    found = stiffness_map(built, "15mm", "0.3mm", on=TOP)
    compare(found, scene_of(folder / "softer.palpate")).save(folder)
    return built, found, folder / "detection.vtu"


def picture(session: Session, **wants):
    session.start()
    try:
        return frame_of(session, ClientView(**wants))
    finally:
        session.close()


def test_a_map_is_the_first_field_and_stands_where_it_was_measured(palpated):
    built, found, file = palpated
    session = Session(built, maps=read_map(file, built))
    header, _ = messages.decode(session.scene_message())
    names = [field["name"] for field in header["bodies"][0]["fields"]]
    assert names[:3] == ["palpated_change", "palpated_stiffness", "displacement"]
    frame, arrays = picture(session, field="palpated_stiffness")
    field, scalar = frame["fields"][0], arrays["0/scalar"]
    assert (field["unit"], field["gaps"], field["signed"]) == ("N/m", True, False)
    green = built.bodies[0].green
    on_top = green.surface_positions[:, 2] > HEIGHT - 1e-9
    expected = found.at(green.surface_positions[on_top], np.tile([0.0, 0.0, 1.0], (on_top.sum(), 1)))
    inner = np.abs(green.surface_positions[on_top][:, :2] - 0.03).max(axis=1) < 0.02
    shown = field["min"] + (field["max"] - field["min"]) * (scalar[on_top][inner].astype(float) - 1) / 254
    clipped = np.clip(expected[inner], field["min"], field["max"])
    assert np.abs(shown - clipped).max() < 0.02 * (field["max"] - field["min"])
    assert (scalar[green.surface_positions[:, 2] < 0.02] == 0).all() and (scalar[on_top] > 0).all()


def test_a_change_has_two_signs_and_a_range_may_be_typed(palpated):
    built, _, file = palpated
    frame, arrays = picture(Session(built, maps=read_map(file, built)), field="palpated_change", full_scale=50.0)
    field, scalar = frame["fields"][0], arrays["0/scalar"]
    assert field["signed"] and field["max"] == 50.0 and field["largest"] == pytest.approx(25.0, rel=1e-3)
    known = scalar[scalar > 0]
    assert np.abs(known - (1 + 254 * 0.75)).max() <= 1


def test_a_map_of_another_body_is_refused(palpated, tmp_path):
    _, _, file = palpated
    mesh = block_body().mesh
    body = palpate.Body(
        palpate.TetMesh(mesh.nodes + [0, 0, 1e-3], mesh.tets),
        material=palpate.Material(10e3, 0.45),
        fixed=lambda p: p[:, 2] < 1.1e-3,
    )
    other = palpate.precompute(body, path=tmp_path / "moved.palpate")
    with pytest.raises(palpate.ViewerError, match="a map of another body"):
        read_map(file, scene_of(other.path).build())
