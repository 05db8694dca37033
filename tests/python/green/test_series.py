"""Series that are computed block by block: any order and any interruption give the same bits."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.green.background_series import BackgroundSeries
from palpate.green.series import SeriesJob, lines_of_series, series_beside, series_line
from palpate.mesh import TetMesh
from palpate.validation.verify.grids import box

RADIUS = 0.006


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """A block, held at its bottom, with its store."""
    mesh: TetMesh = box((8, 8, 4), (0.08, 0.08, 0.04), quadratic=False)
    material = palpate.Material(10e3, 0.45, law="neo-hookean")
    body = palpate.Body(mesh, material=material, fixed=lambda places: places[:, 2] < 1e-9)
    return body, palpate.precompute(body, path=tmp_path_factory.mktemp("store") / "block.palpate", progress=False)


@pytest.fixture
def job(solved, tmp_path):
    body, green = solved
    whole = SeriesJob.of(green, body, RADIUS)
    return SeriesJob(body, RADIUS, whole.touchable, tmp_path / "block.palpate", green.key)


@pytest.fixture(scope="module")
def whole(solved, tmp_path_factory):
    body, green = solved
    job = SeriesJob.of(green, body, RADIUS)
    series = job.compute()
    assert series.is_complete and len(series.known) > 6
    return series


def same(one, other) -> bool:
    return one.known == other.known and np.array_equal(one.fields, other.fields)


class Stopped(Exception):
    pass


def compute_some(job, blocks: int) -> None:
    """Compute at least so many blocks, and stop."""

    def stop(done: int, places: int) -> None:
        if done >= 8 * blocks:
            raise Stopped

    with contextlib.suppress(Stopped):
        job.compute(stop)


def test_an_interrupted_series_goes_on_to_the_same_bits(job, whole):
    file = job.file()
    for blocks in (1, 3):
        compute_some(job, blocks)
    begun = file.load()
    assert begun is not None and 0 < begun.done
    # Nothing is known at a fan until all around it is, and then its last bits.
    known = begun.fields[:, 6] > 0.0
    assert np.array_equal(begun.fields[known], whole.fields[known])
    assert not begun.fields[~known].any()
    assert same(job.compute(), whole)
    assert same(file.load(), whole)


def test_places_near_a_point_come_first_and_give_the_same_bits(job, whole):
    file = job.file()
    corner = np.array([0.08, 0.08, 0.04])
    file.set_near(tuple(corner.tolist()))

    def stop(done: int, places: int) -> None:
        if done >= 8:
            raise Stopped

    with contextlib.suppress(Stopped):
        file.compute(job.problem, stop)
    begun = file.load()
    if begun is not None and not begun.is_complete:
        distances = np.linalg.norm(begun.positions - corner, axis=1)
        assert np.median(distances[begun.fields[:, 6] > 0.0]) < 0.8 * np.median(distances)
    assert same(file.compute(job.problem), whole)


def test_a_changed_byte_is_refused(job, whole):
    job.compute()
    file = job.file()
    right = file.path.read_bytes()
    for at in (40, len(right) // 2, len(right) - 9):
        wrong = bytearray(right)
        wrong[at] ^= 1
        file.path.write_bytes(bytes(wrong))
        assert file.load() is None
    file.path.write_bytes(right)
    assert same(file.load(), whole)


def test_a_file_is_described(job, whole):
    compute_some(job, 3)
    begun = job.file().load()
    (path,) = series_beside(job.store)
    if begun is not None and not begun.is_complete:
        assert f"{begun.done} of {whole.places} places" in series_line(path)
    job.compute()
    assert f"all {whole.places} places" in series_line(path)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(palpate.StoreError, match="damaged"):
        series_line(path)
    (line,) = lines_of_series(job.store)
    assert "damaged" in line


def test_two_processes_compute_one_file(job, whole):
    """Each waits for the other, and takes what that has stored."""
    pair = [BackgroundSeries([job], lambda *_: None) for _ in range(2)]
    try:
        assert all(background.wait(120.0) for background in pair), [background.error for background in pair]
    finally:
        for background in pair:
            background.close()
    assert same(job.file().load(), whole)
    assert not list(job.file().path.parent.glob("*.partial"))


def test_a_killed_child_is_reported_and_its_work_is_found_again(job, whole):
    begun = threading.Event()
    background = BackgroundSeries([job], lambda _, series: begun.set() if series.done else None)
    try:
        begun.wait(60.0)
        children = subprocess.run(["pgrep", "-P", str(os.getpid())], capture_output=True, text=True).stdout.split()
        ours = [pid for pid in map(int, children) if b"series" in Path(f"/proc/{pid}/cmdline").read_bytes()]
        for pid in ours:
            os.kill(pid, signal.SIGKILL)
        background.wait(60.0)
        stored = job.file().load()
        assert stored is not None and stored.done > 0
        assert stored.is_complete or (background.error is not None and "has ended" in background.error)
    finally:
        background.close()
    taken = []
    with contextlib.closing(BackgroundSeries([job], lambda _, series: taken.append(series))) as again:
        assert again.wait(120.0), again.error
    assert same(taken[-1], whole) and taken[0].done >= stored.done


@pytest.mark.skipif(sys.platform != "linux", reason="priorities of processes are those of Linux")
def test_the_child_gives_way_and_ends_with_its_parent(solved, tmp_path):
    program = (
        "import pathlib, time, palpate\n"
        "from palpate.green.background_series import BackgroundSeries\n"
        "from palpate.green.series import SeriesJob\n"
        "body = palpate.Body(palpate.models.beam(), material=palpate.Material(10e3, 0.45, law='neo-hookean'), "
        "fixed=palpate.models.fixed('beam', palpate.models.beam()))\n"
        f"store = pathlib.Path({str(tmp_path)!r}) / 'beam.palpate'\n"
        "job = SeriesJob(body, 0.003, body.mesh.surface_nodes, store, 'k')\n"
        "background = BackgroundSeries([job], lambda *_: None)\n"
        "time.sleep(600)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program])
    try:
        child = _child_of(parent.pid)
        deadline = time.monotonic() + 60.0
        while os.getpriority(os.PRIO_PROCESS, child) != 19 and time.monotonic() < deadline:
            time.sleep(0.05)
        assert os.getpriority(os.PRIO_PROCESS, child) == 19
    finally:
        parent.kill()
        parent.wait()
    deadline = time.monotonic() + 20.0
    while os.path.exists(f"/proc/{child}") and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not os.path.exists(f"/proc/{child}")


def _child_of(pid: int) -> int:
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        found = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True).stdout.split()
        if found:
            return int(found[0])
        time.sleep(0.05)
    raise AssertionError("no child has begun")


def test_a_plan_counts_the_series(solved, job, whole):
    body, _ = solved
    planned = palpate.plan(body, path=job.store, radii=[RADIUS, 4 * RADIUS])
    near, far = planned.series
    assert (near.radius, near.places, near.missing) == (RADIUS, whole.places, whole.places)
    assert far.places < near.places and 0 < far.seconds < near.seconds
    assert str(planned).splitlines()[3] == str(near) and f"{whole.places} places" in str(near)
    compute_some(job, 2)
    assert palpate.plan(body, path=job.store, radii=[RADIUS]).series[0].missing == whole.places - job.file().load().done
    job.compute()
    (stored,) = palpate.plan(body, path=job.store, radii=[RADIUS]).series
    # The header of the file has names and sums of its arrays.
    assert 0 < job.file().path.stat().st_size - stored.size < 2000
    assert (stored.missing, stored.seconds) == (0, 0.0) and str(stored).endswith("stored")
    linear = palpate.Body(body.mesh, material=palpate.Material(10e3, 0.45), fixed=body.fixed_nodes)
    assert palpate.plan(linear, radii=[RADIUS]).series == ()
