"""A precomputation in pieces: blocks of columns by number, from anybody and in any order, into one store."""

from __future__ import annotations

import json
import types

import numpy as np
import pytest
from conftest import box_mesh

import palpate
from palpate import _native
from palpate.body import description, problem_arrays
from palpate.green import gathering
from palpate.green.bounds import CHOSEN


@pytest.fixture(scope="module")
def body():
    mesh = box_mesh(cells=(8, 5, 5))
    weight = palpate.Loads(gravity=(0, 0, -9.81))
    return palpate.Body(mesh, material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9, loads=weight)


def store_of(body: palpate.Body, job: _native.ColumnJob, precision: str | None, path) -> _native.ColumnStore:
    layout = _native.ColumnLayout(problem_arrays(body, None))
    assert layout.order == job.order
    return _native.ColumnStore(layout, precision, CHOSEN, job.measured, path, json.dumps(description(body)))


@pytest.mark.parametrize("precision", [None, "f16", "f32", "f64"])
def test_pieces_of_several_factors_are_the_store_of_one_process(precision, body, tmp_path):
    problem = problem_arrays(body, None)
    whole = palpate.precompute(body, precision=precision, path=tmp_path / "whole.palpate")
    jobs = [_native.ColumnJob(problem, precision, CHOSEN, threads) for threads in (1, 2)]
    width = jobs[0].measured[1]
    assert jobs[1].measured[1] == width
    store = store_of(body, jobs[0], precision, tmp_path / "pieces.palpate")
    missing = store.missing()
    assert len(missing) > 4 and store.done == 0
    for block in np.random.default_rng(3).permutation(missing):
        panels = [job.solve(int(block), width) for job in jobs]
        assert panels[0] == panels[1], "bits depend on the number of threads"
        assert store.put(int(block), *panels[block % 2])
    assert store.missing() == [] and store.done == store.columns == whole._core.touch_ranks.size * 3
    store.finish()
    assert (tmp_path / "pieces.palpate").read_bytes() == whole.path.read_bytes()
    assert not (tmp_path / "pieces.palpate.partial").exists()


def test_damaged_and_foreign_panels_are_refused(body, tmp_path):
    job = _native.ColumnJob(problem_arrays(body, None), "f32", CHOSEN, 1)
    store = store_of(body, job, "f32", tmp_path / "a.palpate")
    width = job.measured[1]
    panel, checksum = job.solve(2, width)
    damaged = bytearray(panel)
    damaged[len(panel) // 2] ^= 1
    assert not store.put(2, bytes(damaged), checksum)
    assert 2 in store.missing()
    with pytest.raises(palpate.BodyError, match="does not have"):
        store.put(3, panel, checksum)
    with pytest.raises(palpate.BodyError, match="block 0 of columns is missing"):
        store.finish()
    with pytest.raises(palpate.BodyError, match="no block 9999"):
        job.solve(9999, width)
    assert store.put(2, panel, checksum)
    assert 2 not in store.missing()
    # Another store of the same thing goes on with it, and one process finishes it.
    done = store.done
    del store
    again = store_of(body, job, "f32", tmp_path / "a.palpate")
    assert again.done == done > 0 and not again.discarded
    del again
    resumed, discarded = _native.GreenCore.precompute_to(
        problem_arrays(body, None), "f32", CHOSEN, json.dumps(description(body)), None, tmp_path / "a.palpate"
    )
    assert resumed == done and not discarded
    whole = palpate.precompute(body, precision="f32", path=tmp_path / "whole.palpate")
    assert (tmp_path / "a.palpate").read_bytes() == whole.path.read_bytes()


@pytest.mark.parametrize("times", [1, 2, 3])
def test_a_block_that_was_damaged_on_its_way_is_asked_for_again(times, body, tmp_path, monkeypatch):
    job = _native.ColumnJob(problem_arrays(body, None), "f32", CHOSEN, 1)
    store = store_of(body, job, "f32", tmp_path / "a.palpate")
    width = job.measured[1]
    asked = []

    def spread(client, waiting, start):
        while waiting:
            block = waiting.pop()
            asked.append(block)
            panel, checksum = job.solve(block, width)
            if block == 3 and asked.count(3) <= times:
                panel = panel[:-1] + bytes([panel[-1] ^ 128])
            yield block, types.SimpleNamespace(status="finished", result=lambda timeout, got=(panel, checksum): got)

    monkeypatch.setattr(gathering, "spread", spread)
    asked_for = (None, store.missing(), None, store.put, lambda: (store.done, store.columns), None)
    if times == gathering.MOST_DAMAGED:
        with pytest.raises(palpate.ClusterError, match="block 3 was damaged in transit 3 times"):
            gathering._gather(*asked_for)
        return
    gathering._gather(*asked_for)
    store.finish()
    assert asked.count(3) == times + 1
    whole = palpate.precompute(body, precision="f32", path=tmp_path / "whole.palpate")
    assert (tmp_path / "a.palpate").read_bytes() == whole.path.read_bytes()


def test_memory_bounds_the_blocks_solved_at_a_time(body):
    problem = problem_arrays(body, None)
    with pytest.raises(palpate.BodyError, match="needs at least"):
        _native.ColumnJob(problem, "f32", CHOSEN, 1, 1_000_000)
