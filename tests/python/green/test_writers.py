"""Several processes that compute one body into one file: what they leave is right, or it is refused."""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import box_mesh
from stored_columns import child_program

import palpate
from palpate import _native
from palpate.body import description, problem_arrays
from palpate.green.bounds import CHOSEN

CELLS = (14, 11, 11)
FIRST = ("x > 7cm", "z > 4cm", None)
WRITER = """
print("ready", flush=True)
sys.stdin.readline()
palpate.precompute(body, precision='f32', first={first!r}, path={path!r}, progress=False)
"""


@pytest.fixture(scope="module")
def body() -> palpate.Body:
    return palpate.Body(box_mesh(cells=CELLS), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)


@pytest.fixture(scope="module")
def expected(body, tmp_path_factory) -> palpate.GreensFunction:
    return palpate.precompute(body, precision="f32", path=tmp_path_factory.mktemp("alone") / "a.palpate")


def writer(path, first: str | None) -> subprocess.Popen[str]:
    """Process that computes the body into ``path`` once it is given a line."""
    program = child_program(CELLS, WRITER.format(first=first, path=str(path)))
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    return subprocess.Popen(
        [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )


def race(path, regions, lives) -> None:
    """Two writers that begin together; each is killed after its life (s), None lets it end."""
    writers = [writer(path, first) for first in regions]
    for one in writers:
        assert one.stdout.readline() == "ready\n"
    for one in writers:
        one.stdin.write("go\n")
        one.stdin.flush()
    began = time.monotonic()
    for one, life in sorted(zip(writers, lives, strict=True), key=lambda pair: pair[1] or np.inf):
        if life is not None:
            time.sleep(max(0.0, began + life - time.monotonic()))
            one.send_signal(signal.SIGKILL)
        one.communicate()


def error_of(path, body, expected) -> float | None:
    """Largest relative error of the answers of the store that is left; None where it is refused or not there."""
    try:
        green = palpate.GreensFunction.load(path, body=body)
    except (palpate.StoreError, FileNotFoundError):
        return None
    worst = 0.0
    for node in green.touchable_nodes[:: max(1, len(green.touchable_nodes) // 40)]:
        if node in body.fixed_nodes:
            continue
        right = expected.solve(displacements={int(node): (1e-3, 2e-3, -1e-3)})
        try:
            found = green.solve(displacements={int(node): (1e-3, 2e-3, -1e-3)})
        except palpate.PrecisionError:  # numbers that belong to no body
            return np.inf
        for a, b in ((found.forces, right.forces), (found.displacements, right.displacements)):
            worst = max(worst, float(np.abs(a - b).max() / np.abs(b).max()))
    return worst


@pytest.mark.slow
def test_of_two_writers_one_computes_and_the_other_waits(body, expected, tmp_path):
    path = tmp_path / "a.palpate"
    race(path, FIRST[:2], (None, None))
    assert error_of(path, body, expected) < 1e-4
    assert [file.name for file in tmp_path.iterdir()] == ["a.palpate"]


def test_a_store_that_is_being_computed_is_waited_for(body, expected, tmp_path):
    path = tmp_path / "a.palpate"
    held = _native.StoreClaim.take(path)
    assert held is not None and _native.StoreClaim.take(path) is None
    writing = threading.Timer(0.5, lambda: (shutil.copy(expected.path, path), held.release()))
    writing.start()
    with pytest.warns(palpate.StoreWarning, match=r"another process is computing .*a\.palpate: waiting for it"):
        green = palpate.precompute(body, precision="f32", path=path, progress=lambda *_: pytest.fail("computed again"))
    assert green.key == expected.key


def test_a_store_that_is_being_computed_is_not_written_by_others(body, tmp_path):
    path = tmp_path / "a.palpate"
    held = _native.StoreClaim.take(path)
    with pytest.raises(palpate.StoreError, match="is being computed by another process: wait for it to end"):
        _native.GreenCore.precompute_to(problem_arrays(body, None), "f32", CHOSEN, "", None, path)
    held.release()
    assert not list(tmp_path.iterdir())


def test_columns_that_another_program_changes_are_refused_and_computed_again(body, expected, tmp_path):
    path, partial = tmp_path / "a.palpate", tmp_path / "a.palpate.partial"
    problem = problem_arrays(body, None)
    job = _native.ColumnJob(problem, "f32", CHOSEN, 1)
    store = _native.ColumnStore(
        _native.ColumnLayout(problem), "f32", CHOSEN, job.measured, path, json.dumps(description(body))
    )
    for block in store.missing():
        assert store.put(block, *job.solve(block, job.measured[1]))
    content = np.memmap(partial, dtype=np.uint8, mode="r+")
    content[content.size // 2] ^= 0x40
    content.flush()
    with pytest.raises(palpate.StoreError, match=r"another program has changed its finished columns in .*run the same"):
        store.finish()
    assert not path.exists() and len(store.missing()) == 1
    del store
    palpate.precompute(body, precision="f32", path=path, progress=False)
    assert path.read_bytes() == expected.path.read_bytes()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_races_of_two_writers_leave_a_store_that_is_right_or_none(body, expected, tmp_path, rounds):
    random = np.random.default_rng(7)
    pairs = list(itertools.product(FIRST, FIRST))
    for k in range(rounds(20)):
        path = tmp_path / f"{k}.palpate"
        regions = pairs[k % len(pairs)]
        lives = [None if random.random() < 0.3 else float(random.uniform(0.05, 3.0)) for _ in range(2)]
        race(path, regions, lives)
        error = error_of(path, body, expected)
        assert error is None or error < 1e-4, f"race {k}, {regions}, killed after {lives}"
        # What is left is gone on with, to the right store.
        palpate.precompute(body, precision="f32", first=regions[0], path=path, progress=False)
        assert error_of(path, body, expected) < 1e-4, f"after race {k}, {regions}, killed after {lives}"
