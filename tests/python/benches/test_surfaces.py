"""Frames of a large surface: what the bench says of them."""

from __future__ import annotations

import pytest

from benches import surfaces


def test_frames_are_measured_whole_and_by_fewer_triangles():
    whole, fewer = surfaces.run([5000], most=(None, 1500), page=False)
    assert whole.triangles == whole.drawn == fewer.triangles == 5000
    assert 1350 < fewer.drawn <= 1500
    # Three numbers of four bytes a node, and one byte of the field.
    assert whole.frame_kb == pytest.approx(13e-3 * 51 * 51, abs=0.5)
    assert fewer.frame_kb < 0.4 * whole.frame_kb
    assert whole.frames_per_second is None


def test_a_dome_is_shown_as_a_session_shows_a_body():
    dome = surfaces.Dome(2000, 500)
    arrays = dome.shown.arrays()
    assert len(arrays["surface_triangles"][1]) == len(dome.drawn.triangles) <= 500
    assert dome.shown.header(None)["drawn"]["triangles"] == len(dome.drawn.triangles)
    # Half a second into a period the dent is as deep as it gets.
    assert dome.displacements(0.5)[:, 2].min() == pytest.approx(-surfaces.DEPTH, rel=0.02)
