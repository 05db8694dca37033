"""What a body is not made of: each is refused in a line that says what to do instead."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import box_mesh

import palpate

SOFT = palpate.Material(10e3, 0.4)


def test_a_predicate_holds_what_a_function_does():
    mesh = box_mesh()
    by_text = palpate.Body(mesh, material=SOFT, fixed="x < min + 1mm")
    by_function = palpate.Body(mesh, material=SOFT, fixed=lambda p: p[:, 0] < p[:, 0].min() + 1e-3)
    assert np.array_equal(by_text.fixed_mask, by_function.fixed_mask) and by_text.fixed_mask.any()


@pytest.mark.parametrize("fixed", ["z < -1", lambda p: p[:, 2] < -1, [], {"z": []}, np.zeros((80, 3), dtype=bool)])
def test_supports_that_hold_nothing_are_refused(fixed):
    with pytest.raises(
        palpate.BodyError, match=r"fixed.* holds no node: the body reaches from .* to .* m; None leaves"
    ):
        palpate.Body(box_mesh(), material=SOFT, fixed=fixed)


def test_a_file_is_not_taken_for_a_mesh():
    with pytest.raises(palpate.BodyError, match=r"must be a palpate\.TetMesh, got 'block\.obj': read .*TetMesh\.read"):
        palpate.Body("block.obj", material=SOFT)
    with pytest.raises(palpate.BodyError, match="cannot read the predicate 'z <'"):
        palpate.Body(box_mesh(), material=SOFT, fixed="z <")


def two(shift, size=(0.04, 0.04, 0.04), cells=(3, 3, 3)) -> palpate.TetMesh:
    """A box, and another one that is not connected with it."""
    first, second = box_mesh(cells=(4, 4, 4), size=(0.04, 0.04, 0.04)), box_mesh(cells=cells, size=size, seed=2)
    nodes = np.vstack([first.nodes, second.nodes + np.array(shift)])
    return palpate.TetMesh(nodes, np.vstack([first.tets, second.tets + len(first.nodes)]))


@pytest.mark.parametrize(
    "mesh",
    [
        two((0.03, 0.0, 0.0)),
        two((0.01, 0.01, 0.01), (0.01, 0.01, 0.01)),
        two((0.015, -0.02, 0.015), (0.01, 0.08, 0.01), (2, 8, 2)),
    ],
    ids=["a corner", "one inside the other", "one through the other"],
)
def test_two_bodies_in_one_place_are_refused(mesh):
    body = palpate.Body(mesh, material=SOFT, fixed="z < min + 1um")
    with pytest.raises(palpate.BodyError, match=r"not connected overlap at \(.*\) m: unite them"):
        palpate.precompute(body)


@pytest.mark.parametrize("shift", [(0.04, 0.0, 0.0), (0.05, 0.0, 0.0), (0.04, 0.04, 0.0)])
def test_parts_side_by_side_are_taken(shift):
    palpate.Body(two(shift), material=SOFT, fixed="z < min + 1um").require_supported()


def test_shares_of_a_large_mesh_take_no_time():
    """Two parts of 30,000 elements each, whose boxes overlap and which do not."""
    import time

    first = box_mesh(cells=(18, 18, 18), size=(0.04, 0.04, 0.04), jitter=0)
    # Of an L, the other part stands in the corner that is free.
    keep = ~(first.nodes[first.tets].mean(axis=1)[:, :2] > 0.02).all(axis=1)
    used, tets = np.unique(first.tets[keep], return_inverse=True)
    ell = palpate.TetMesh(first.nodes[used], tets.reshape(-1, 4))
    other = box_mesh(cells=(16, 16, 18), size=(0.0199, 0.0199, 0.04))
    nodes = np.vstack([ell.nodes, other.nodes + [0.0201, 0.0201, 0.0]])
    mesh = palpate.TetMesh(nodes, np.vstack([ell.tets, other.tets + len(ell.nodes)]))
    body = palpate.Body(mesh, material=SOFT, fixed="z < min + 1um")
    begun = time.process_time()
    body.require_supported()
    assert time.process_time() - begun < 10.0
