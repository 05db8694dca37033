"""Stages: a region first, a store that grows, and the same numbers in the end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import box_mesh, relative
from stored_columns import child_program, rollers, touchable_square

import palpate
from palpate.green import BackgroundPrecompute

FIRST = "x > 6cm"


@pytest.fixture(scope="module")
def body() -> palpate.Body:
    return rollers(box_mesh(cells=(7, 5, 5)))


def operator(path) -> bytes:
    """Numbers of a store as they stand in the file."""
    data = path.read_bytes()
    head = int.from_bytes(data[:8], "little")
    return data[8 + head :]


@pytest.mark.parametrize(("precision", "bound"), [("f64", 1e-11), ("f32", 1e-6), ("f16", 2e-4)])
def test_stages_give_the_numbers_of_one(body, precision, bound, tmp_path):
    whole = palpate.precompute(body, precision=precision, path=tmp_path / "whole.palpate")
    seen = []
    staged = palpate.precompute(body, precision=precision, first=FIRST, path=tmp_path / "a.palpate", ready=seen.append)
    assert staged.key == whole.key
    (expected, _), (entries, _) = touchable_square(whole), touchable_square(staged)
    size = np.sqrt(np.abs(np.diagonal(expected)))
    assert (np.abs(entries - expected) / np.outer(size, size)).max() < bound
    # Symmetric to the bit; skew between supports and free dofs.
    assert np.array_equal(np.abs(entries), np.abs(entries.T))
    assert seen, "no store on the way"
    assert [len(green.touchable_nodes) for green in seen] == sorted({len(green.touchable_nodes) for green in seen})


def test_a_growing_store_is_a_whole_one_of_what_is_ready(tmp_path):
    path = tmp_path / "a.palpate"

    class Enough(Exception):
        pass

    def stop(_green):
        raise Enough

    # So large that the first stage is read before the last has ended.
    body = palpate.Body(
        box_mesh(cells=(16, 12, 12)), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 2] < 1e-9
    )
    with pytest.raises(Enough):
        palpate.precompute(body, precision="f16", first=FIRST, path=path, ready=stop)
    first = palpate.GreensFunction.load(tmp_path / "a.palpate", body=body)
    first.save(tmp_path / "first.palpate")
    final = palpate.precompute(body, precision="f16", first=FIRST, path=path)
    inside = body.mesh.surface_nodes[body.mesh.nodes[body.mesh.surface_nodes, 0] > 0.06]
    assert np.isin(inside, first.touchable_nodes).all()
    alone = palpate.precompute(body, precision="f16", touch=first.touchable_nodes, path=tmp_path / "b.palpate")
    assert alone.key == first.key
    node, other = (int(n) for n in np.setdiff1d(inside, body.fixed_nodes)[[0, -1]])
    forces = {node: (0.1, 0.2, -0.3)}
    for green in (first, alone):
        moved = green.solve(forces=forces).displacements
        assert relative(moved, final.solve(forces=forces).displacements) < 1e-3
    # The entries between nodes that are ready are those of the finished store, to the bit.
    assert first._core.entry(3 * _rank(first, other), 3 * _column(first, node)) == final._core.entry(
        3 * _rank(final, other), 3 * _column(final, node)
    )
    with pytest.raises(palpate.BodyError, match="not touchable"):
        outside = np.setdiff1d(final.touchable_nodes, first.touchable_nodes)[0]
        first.solve(forces={int(outside): (1.0, 0.0, 0.0)})


def _rank(green: palpate.GreensFunction, node: int) -> int:
    return int(np.searchsorted(green.surface_nodes, node))


def _column(green: palpate.GreensFunction, node: int) -> int:
    return int(np.searchsorted(green.touchable_nodes, node))


@pytest.mark.slow
def test_what_is_painted_comes_next(tmp_path):
    body = palpate.Body(
        box_mesh(cells=(20, 16, 16)), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 2] < 1e-9
    )
    surface = body.mesh.surface_nodes
    corner = surface[(body.mesh.nodes[surface] < [0.02, 0.02, 1.0]).all(axis=1)]
    seen = []
    for painted in (False, True):
        asked = [corner] if painted else []
        final = palpate.precompute(
            body,
            precision="f16",
            first="x > 7cm",
            path=tmp_path / f"{painted}.palpate",
            ready=lambda green, painted=painted: seen.append((painted, np.isin(corner, green.touchable_nodes).all())),
            painted=lambda asked=asked: asked.pop() if asked else None,
            progress=False,
        )
    assert (False, True) not in seen, "the corner is far from what comes first"
    assert (True, True) in seen, "what was painted did not come before the rest"
    plain = palpate.precompute(body, precision="f16", path=tmp_path / "b.palpate")
    forces = {int(corner[-1]): (0.1, 0.0, -0.2)}
    assert relative(final.solve(forces=forces).displacements, plain.solve(forces=forces).displacements) < 1e-3


GROWING = """
import os
def show(done, columns):
    print(done / columns, flush=True)
palpate.precompute(body, precision='f32', first='x > 7cm', path={path!r}, progress=show)
"""


@pytest.mark.slow
def test_killed_in_every_stage_it_goes_on_to_the_same_bits_and_is_readable_all_the_time(tmp_path):
    path, cells = tmp_path / "a.palpate", (14, 11, 11)
    program = child_program(cells, GROWING.format(path=str(path)))
    undisturbed = tmp_path / "whole.palpate"
    whole = child_program(cells, GROWING.format(path=str(undisturbed)))
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-c", whole], check=True, stdout=subprocess.DEVNULL, env=environment)
    read, stop = [], threading.Event()

    def reader():
        while not stop.wait(0.002):
            if path.exists():
                read.append(len(palpate.GreensFunction.load(path).touchable_nodes))

    watching = threading.Thread(target=reader)
    watching.start()
    kills, last = 0, 0.0
    try:
        for part in (0.1, 0.3, 0.6, 0.9, 2.0):
            child = subprocess.Popen(
                [sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, env=environment
            )
            computed = False
            for line in child.stdout:
                done, computed = float(line), True
                assert done >= last or done == 0, "finished columns were lost"
                last = max(last, done)
                if done > part:
                    child.send_signal(signal.SIGKILL)
                    kills += 1
                    break
            child.wait()
            child.stdout.close()
        time.sleep(0.05)
    finally:
        stop.set()
        watching.join()
    assert child.returncode == 0 and kills >= 3
    assert operator(path) == operator(undisturbed)
    assert read == sorted(read), "the store has shrunk"
    # A process that is killed after its last column leaves a finished store, and its panels beside it.
    assert not (computed and list(tmp_path.glob("*.partial")))


def test_a_partial_with_all_columns_only_has_to_be_written(tmp_path):
    body = palpate.Body(
        box_mesh(cells=(16, 12, 12)), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 2] < 1e-9
    )
    path, other = tmp_path / "a.palpate", tmp_path / "b.palpate"
    partial = other.with_name("b.palpate.partial")

    def keep(_done, _columns):
        # A second name of the file: it has all the columns in the end.
        if not partial.exists() and path.with_name("a.palpate.partial").exists():
            os.link(path.with_name("a.palpate.partial"), partial)

    palpate.precompute(body, precision="f32", first=FIRST, path=path, progress=keep)
    assert partial.exists()
    begun = []
    palpate.precompute(body, precision="f32", first=FIRST, path=other, progress=lambda done, _all: begun.append(done))
    assert set(begun) <= {0, 3 * len(body.mesh.surface_nodes)}, "finished columns were computed again"
    assert operator(other) == operator(path)


@pytest.mark.slow
def test_a_partial_of_other_stages_is_used(tmp_path):
    body = palpate.Body(
        box_mesh(cells=(20, 14, 14)), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9
    )
    path = tmp_path / "a.palpate"

    class Enough(Exception):
        pass

    def stop(done, columns):
        if done > columns / 4:
            raise Enough

    with pytest.raises(Enough):
        palpate.precompute(body, precision="f32", first="z > 4cm", path=path, progress=stop)
    begun = []
    green = palpate.precompute(
        body, precision="f32", first="z < 1cm", path=path, progress=lambda done, columns: begun.append(done / columns)
    )
    assert next(part for part in begun if part) > 0.2
    plain = palpate.precompute(body, precision="f32", path=tmp_path / "b.palpate")
    node = int(green.touchable_nodes[-1])
    forces = {node: (0.0, 0.1, -0.2)}
    assert relative(green.solve(forces=forces).displacements, plain.solve(forces=forces).displacements) < 1e-6


@pytest.mark.parametrize(
    ("region", "message"),
    [
        ("x > 9cm", "no surface node lies in 'x > 9cm'"),
        ([10**6], "node 1000000 is not on the surface"),
        ("y", "not allowed in the predicate"),
    ],
)
def test_regions_that_are_none_are_refused(body, region, message):
    with pytest.raises(palpate.BodyError, match=message):
        palpate.precompute(body, touch=region)
    with pytest.raises(palpate.BodyError, match=message):
        palpate.precompute(body, first=region)


def test_regions_by_nodes_predicate_and_solid_are_the_same(body, tmp_path):
    surface = body.mesh.surface_nodes
    nodes = surface[body.mesh.nodes[surface, 0] > 0.06]
    solid = palpate.shapes.Box((0.06 + 1e-12, -1.0, -1.0), (1.0, 1.0, 1.0))
    mask = body.mesh.nodes[:, 0] > 0.06
    keys = {
        palpate.precompute(body, precision="f16", touch=region, path=tmp_path / "a.palpate").key
        for region in (nodes, "x > 6cm", solid, mask)
    }
    assert len(keys) == 1


def test_a_store_that_does_not_fit_the_disk_is_refused_with_what_would(body, tmp_path, monkeypatch):
    monkeypatch.setattr("palpate.green.resources.free_bytes", lambda target: 2_000_000)
    with pytest.raises(
        palpate.StoreError, match=r"are free there: a touch region of up to \d+ of the \d+ nodes fits, 'f16'"
    ):
        palpate.precompute(body, precision="f32", path=tmp_path / "a.palpate")
    assert not list(tmp_path.iterdir())


def test_columns_whose_process_sends_nonsense_end_with_an_error():
    growing = BackgroundPrecompute.__new__(BackgroundPrecompute)
    growing._changed, growing._complete, growing.error = threading.Condition(), None, None
    growing._listen([b'{"done": 1, "colu'])
    assert "JSONDecodeError" in growing.error
