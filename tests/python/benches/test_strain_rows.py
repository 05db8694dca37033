"""Rows of `python -m benches strain`: none passes for want of a reference, and no program is missing in silence."""

from __future__ import annotations

import numpy as np
import pytest

from benches import contact_peers
from benches.strain import bodies, peers
from benches.strain.beside import Row, pressed, table
from benches.strain.solid import Solid

# Largest error of a force beside a full solution on the same mesh.
ALLOWED = 0.02


def test_a_body_without_a_full_solution_is_an_error(monkeypatch, tmp_path):
    monkeypatch.setattr(bodies, "SOLVED", tmp_path / "forces.json")
    beam = next(iter(bodies.cuboids()))
    monkeypatch.setattr(Solid, "pressed", lambda *_: [])
    with pytest.raises(RuntimeError, match="cantilever: Newton's method does not converge at 5 mm"):
        beam.full()
    assert not bodies.SOLVED.exists()
    monkeypatch.setattr(Solid, "pressed", lambda *_: [0.004])
    assert np.array_equal(beam.full(), [0.004])


def test_depths_without_a_full_solution_are_named():
    row = Row("beam", 10, [0.005], [0.1], [0.0], [0.0], [0.0], [0.01], [0.01, 0.02])
    assert table([row]).notes == ["beam: full Newton's method does not converge at 10, 20 mm"]
    assert table([Row("beam", 10, [0.005], [0.1], [0.0], [0.0], [0.0], [0.01], [])]).notes == []


def test_programs_that_take_no_part_are_named(monkeypatch):
    monkeypatch.setattr(contact_peers, "installed", lambda: ["MuJoCo"])
    notes = peers.table([peers.PeerRow("MuJoCo", [0.1], 1.0)]).notes
    assert notes == [
        "Drake is left out: not installed (pip install drake)",
        "SOFA is left out: PyPI has no wheel of it",
    ]


def test_the_bodies_of_cuboids_have_a_full_solution_at_every_depth():
    stored = bodies._stored()
    for case in bodies.cuboids():
        assert stored[case.name]["depths"] == case.depths.tolist()
        assert len(stored[case.name]["forces"]) == len(case.depths), case.name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cantilever", "12 mm from an edge"])
def test_bodies_that_bend_and_end_have_the_force_of_a_full_solution(name, tmp_path):
    """A cantilever bent by a fifth of its length, and a block beside its edge; the linear law is 17 and 5 % off."""
    (case,) = (case for case in bodies.cuboids() if case.name == name)
    force, stated = pressed(case, "neo-hookean", True, tmp_path)
    errors = np.abs(force / case.full() - 1.0)
    assert errors.max() < ALLOWED
    assert (errors < stated).all()
    for factor in (0.95, 1.05, -1.0):
        assert np.abs(factor * force / case.full() - 1.0).max() > ALLOWED
