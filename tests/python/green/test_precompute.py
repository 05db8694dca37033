"""The precomputation: its numbers against SciPy, its plan against what it takes, and how it survives interruptions."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pytest
from conftest import box_mesh
from scipy.sparse.linalg import splu
from stored_columns import child_program, rollers, touchable_square

import palpate
from palpate import _native
from palpate.body import description, problem_arrays
from palpate.green.bounds import CHOSEN

ERRORS = {"f64": 1e-11, "f32": 1e-6, "f16": 1e-3}
# Of the body whose computation is interrupted.
CELLS = (20, 14, 14)


def dense_psi(body: palpate.Body) -> tuple[np.ndarray, np.ndarray]:
    """Whole `Psi` of the paper's equation 3.3 (corrected) by SciPy, and the dofs that are fixed."""
    stiffness = body.stiffness()
    fixed = np.zeros(stiffness.shape[0], dtype=bool)
    fixed[body.fixed_dofs] = True
    free_part = splu(stiffness[~fixed][:, ~fixed].tocsc())
    coupling = stiffness[~fixed][:, fixed].toarray()
    psi = np.zeros(stiffness.shape)
    psi[np.ix_(~fixed, ~fixed)] = free_part.solve(np.eye((~fixed).sum()))
    psi[np.ix_(~fixed, fixed)] = -free_part.solve(coupling)
    psi[np.ix_(fixed, ~fixed)] = -psi[np.ix_(~fixed, fixed)].T
    psi[np.ix_(fixed, fixed)] = stiffness[fixed][:, fixed].toarray() + coupling.T @ psi[np.ix_(~fixed, fixed)]
    return psi, fixed


@pytest.mark.parametrize("precision", ERRORS)
@pytest.mark.parametrize("region", [False, True])
def test_columns_are_those_of_scipy_and_symmetric_to_the_bit(precision, region, tmp_path):
    body = rollers(box_mesh(cells=(4, 3, 3)))
    touch = body.mesh.surface_nodes[::2] if region else None
    green = palpate.precompute(body, precision=precision, touch=touch, path=tmp_path / "a.palpate")
    psi, fixed = dense_psi(body)
    entries, columns = touchable_square(green)
    rows = (3 * green.surface_nodes[:, None] + np.arange(3)).ravel()
    exact = psi[np.ix_(rows, columns)]
    # Compliances, stiffnesses and pure numbers apart: each against the largest of its kind in its column.
    for kind in (False, True):
        part = fixed[rows] == kind
        error = np.abs(entries - exact)[part].max(axis=0) / np.abs(exact[part]).max(axis=0)
        assert error.max() <= ERRORS[precision], kind
    own = np.searchsorted(rows, columns)
    square = entries[own]
    sign = np.where(fixed[columns][:, None] == fixed[columns][None, :], 1.0, -1.0)
    assert np.array_equal(square, sign * square.T)


def test_held_and_written_operators_are_the_same(block, tmp_path):
    for precision in ERRORS:
        in_memory = _native.GreenCore.precompute(problem_arrays(block, None), precision, "{}", None)
        written = palpate.precompute(block, precision=precision, path=tmp_path / precision)
        in_memory.save(tmp_path / "in_memory")
        a, b = (touchable_square(g)[0] for g in (palpate.GreensFunction.load(tmp_path / "in_memory"), written))
        assert np.array_equal(a, b)
        assert in_memory.precision == precision == written.precision


def test_sixteen_bits_answer_within_a_thousandth(block, block_green, tmp_path):
    half = palpate.precompute(block, precision="f16", path=tmp_path / "half.palpate")
    assert half.path.stat().st_size < 0.3 * block_green.path.stat().st_size
    rng = np.random.default_rng(5)
    free = np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes)
    for count in (1, 3, 9):
        pressed = {int(n): tuple(1e-3 * rng.standard_normal(3)) for n in rng.choice(free, count, replace=False)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", palpate.PrecisionWarning)  # estimates are several times too high
            a, b = (g.solve(displacements=pressed) for g in (block_green, half))
        for exact, stored in ((a.displacements, b.displacements), (a.forces, b.forces)):
            assert np.abs(stored - exact).max() <= 1e-3 * np.abs(exact).max()


def test_plan_counts_and_bounds_memory(block):
    free = palpate.plan(block, precision="f32")
    # What is yet to be chosen is counted as the most that it may be.
    assert palpate.plan(block).store == 2 * free.store
    assert palpate.plan(block).precision == "f64"
    assert free.columns == 3 * len(block.mesh.surface_nodes)
    assert free.store == 4 * free.columns * free.rows
    assert palpate.plan(block, precision="f16").store == free.store // 2
    assert 0 < free.factor_flops < free.sweep_flops
    assert "Gflop" in str(free)
    body = palpate.Body(box_mesh(cells=(50, 8, 2)), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
    problem = problem_arrays(body, None)
    wide = _native.GreenCore.plan(problem, "f32")
    narrow = _native.GreenCore.plan(problem, "f32", wide["memory"] - 100_000)
    assert narrow["memory"] < wide["memory"]
    assert (narrow["tasks"], narrow["block"]) < (wide["tasks"], wide["block"])
    # A block's columns do only their own work, whatever stands beside them.
    assert narrow["sweep_flops"] == pytest.approx(wide["sweep_flops"], rel=0.1)
    with pytest.raises(palpate.BodyError, match=r"needs at least 0\.\d+ GB of memory.*touch region|mesh"):
        _native.GreenCore.plan(problem, "f32", 1_000_000)
    with pytest.raises(palpate.BodyError, match="already in use"):
        palpate.plan(body, memory="1MB")
    with pytest.raises(palpate.UnitError, match="GB"):
        palpate.plan(body, memory="8 apples")


def test_a_plan_for_workers_may_need_more_memory_than_there_is_here(block, monkeypatch):
    here = palpate.plan(block, precision="f32")
    monkeypatch.setattr("palpate.green.job.available_memory", lambda: 1_000_000)
    with pytest.raises(palpate.BodyError, match=r"needs at least 0\.\d+ GB of memory"):
        palpate.plan(block, precision="f32")
    of_workers = palpate.plan(block, precision="f32", dask="tcp://10.0.0.1:8786")
    assert (of_workers.block, of_workers.store) == (here.block, here.store)


@pytest.mark.slow
def test_peak_memory_is_the_planned_one(tmp_path):
    program = child_program(
        (26, 20, 20),
        f"""
plan = palpate.plan(body)
palpate.precompute(body, path={str(tmp_path / "big.palpate")!r})
# Not ru_maxrss: a child inherits that of the process it was forked from.
peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(plan.memory, plan.store, 1024 * int(peak.split()[1]))
""",
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=280)
    assert result.returncode == 0, result.stderr
    planned, store, peak = map(int, result.stdout.split())
    assert peak <= 1.3 * planned
    assert store > 0.3 * planned  # the operator itself does not count


def test_number_of_threads_changes_no_bit(tmp_path):
    for threads in (1, 2):
        program = child_program((8, 6, 6), f"palpate.precompute(body, path={str(tmp_path / str(threads))!r})")
        environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
        subprocess.run([sys.executable, "-c", program], check=True, timeout=280, env=environment)
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    path = tmp_path_factory.mktemp("undisturbed") / "a.palpate"
    program = child_program(CELLS, f"palpate.precompute(body, path={str(path)!r})")
    subprocess.run([sys.executable, "-c", program], check=True, timeout=280)
    return path.read_bytes()


def test_what_a_killed_process_was_writing_is_removed_by_the_next_one(tmp_path):
    path = tmp_path / "a.palpate"
    program = child_program((16, 12, 12), f"palpate.precompute(body, path={str(path)!r})")
    child = subprocess.Popen([sys.executable, "-c", program])
    beside = tmp_path / f"a.palpate.{child.pid}.new"
    while not beside.exists() and child.poll() is None:
        time.sleep(1e-3)
    child.kill()
    child.wait(60)
    assert beside.exists() and not path.exists()
    mine, other = tmp_path / f"a.palpate.{os.getppid()}.new", tmp_path / f"b.palpate.{child.pid}.new"
    mine.write_bytes(b"of a process that runs")
    other.write_bytes(b"of another store")
    body = palpate.Body(
        box_mesh(cells=(16, 12, 12)), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9
    )
    palpate.precompute(body, path=path)
    assert sorted(os.listdir(tmp_path)) == sorted(["a.palpate", mine.name, other.name])


@pytest.mark.quick(2)
@pytest.mark.parametrize("kill", [signal.SIGINT, signal.SIGKILL])
def test_interrupted_precompute_resumes_to_the_same_bits(kill, undisturbed, tmp_path):
    path = tmp_path / "a.palpate"
    at = random.Random(int(kill)).uniform(0.05, 0.8)
    program = child_program(
        CELLS,
        f"""
# What starts tests in the background ignores SIGINT, and what is ignored is inherited.
signal.signal(signal.SIGINT, signal.default_int_handler)
def show(done, total):
    if done >= {at} * total:
        print("now", flush=True)
        time.sleep(0.2 if {kill == signal.SIGINT} else 60)
palpate.precompute(body, path={str(path)!r}, progress=show)
""",
    )
    # One slow thread, so that the interruption falls into the columns.
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    child = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment
    )
    assert child.stdout.readline() == b"now\n"
    if kill == signal.SIGKILL:
        time.sleep(0.02)
    child.send_signal(kill)
    child.communicate(timeout=280)
    assert child.returncode != 0
    left = os.listdir(tmp_path)
    body = palpate.Body(box_mesh(cells=CELLS), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
    if not path.exists():
        assert "a.palpate.partial" in left
        problem, about = problem_arrays(body, None), json.dumps(description(body))
        resumed, discarded = _native.GreenCore.precompute_to(problem, None, CHOSEN, about, None, path)
        assert resumed >= at * 3 * len(body.mesh.surface_nodes)
        assert not discarded
    assert path.read_bytes() == undisturbed
    assert "a.palpate.partial" not in os.listdir(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("room", [0.25, 0.8], ids=["for a part of the columns", "for all columns, not for the store"])
def test_a_full_disk_leaves_what_is_finished(room, undisturbed, tmp_path):
    """A limit of the size of a file is met as the end of a disk is."""
    path = tmp_path / "a.palpate"
    program = child_program(
        CELLS,
        f"""
import resource
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({int(room * len(undisturbed))},) * 2)
try:
    palpate.precompute(body, path={str(path)!r})
except palpate.StoreError as error:
    print(error)
""",
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=280)
    assert result.returncode == 0, result.stderr
    assert (
        f"finished columns are kept in {path}.partial: free some disk space, and the same command continues"
        in result.stdout
    )
    assert os.listdir(tmp_path) == ["a.palpate.partial"]
    body = palpate.Body(box_mesh(cells=CELLS), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
    seen = []
    palpate.precompute(body, path=path, progress=lambda done, total: seen.append(done / total))
    assert min(part for part in seen if part > 0) > (0.1 if room < 0.5 else 0.999)
    assert path.read_bytes() == undisturbed


def test_partial_of_another_body_is_thrown_away(block, tmp_path):
    path = tmp_path / "a.palpate"
    partial = tmp_path / "a.palpate.partial"
    for content in (b"x", b"x" * 10_000, b'{"format":"palpate-partial"}'):
        partial.write_bytes(content)
        with pytest.warns(palpate.StoreWarning, match="was deleted"):
            palpate.precompute(block, path=path)
        assert os.listdir(tmp_path) == ["a.palpate"]
        path.unlink()


@pytest.mark.slow
def test_damaged_block_of_a_partial_is_computed_again(undisturbed, tmp_path):
    body = palpate.Body(box_mesh(cells=CELLS), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)
    path, partial = tmp_path / "a.palpate", tmp_path / "a.palpate.partial"

    def stop(done, total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        palpate.precompute(body, path=path, progress=stop)
    content = bytearray(partial.read_bytes())
    for at in range(5000, len(content), 100_000):
        content[at] ^= 1
    partial.write_bytes(content)
    palpate.precompute(body, path=path)
    assert path.read_bytes() == undisturbed
