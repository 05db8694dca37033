"""Work by a Dask cluster: the same bits and numbers as one machine, whoever dies or joins meanwhile."""

from __future__ import annotations

import os
import re
import signal
import sys
import time
import types
from pathlib import Path

import distributed
import numpy as np
import pytest
from command_line import refused
from command_line import run_process as run
from conftest import box_mesh
from dask_cluster import certificates, certificates_in, local_cluster, programs

import palpate
from palpate import cluster as clusters
from palpate.cluster import connected
from palpate.green import worker
from palpate.green.series import SeriesJob
from palpate.study import Study

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def workers():
    with local_cluster(2) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def body():
    mesh = box_mesh(cells=(16, 10, 10))
    return palpate.Body(mesh, material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-9)


@pytest.fixture(scope="module")
def undisturbed(body, tmp_path_factory):
    return palpate.precompute(body, path=tmp_path_factory.mktemp("one") / "a.palpate").path.read_bytes()


@pytest.mark.slow
def test_one_worker_killed_half_way_leaves_the_bits_of_one_machine(workers, body, undisturbed, tmp_path):
    seen, killed = [], []

    def kill_one(done, total):
        seen.append(done)
        if done >= total // 2 and not killed:
            killed.append(next(iter(pids.values())))
            os.kill(killed[0], signal.SIGKILL)

    with connected(workers.scheduler_address) as client:
        pids = client.run(os.getpid)
        assert len(pids) == 2
        green = palpate.precompute(body, path=tmp_path / "a.palpate", dask=client, progress=kill_one)
        assert killed
        # Another takes the place of the one that died; nobody holds a factor any more.
        client.wait_for_workers(2, timeout=120)
        assert set(client.run(held_factors).values()) == {0}
        assert killed[0] not in client.run(os.getpid).values()
    assert green.path.read_bytes() == undisturbed
    assert os.listdir(tmp_path) == ["a.palpate"]
    assert seen == sorted(seen) and seen[0] == 0 and seen[-1] == 3 * len(body.mesh.surface_nodes)


@pytest.mark.slow
def test_a_series_by_two_workers_has_the_bits_of_one_machine(workers, tmp_path):
    mesh = box_mesh(cells=(8, 8, 4))
    material = palpate.Material(1e4, 0.45, law="neo-hookean")
    held = palpate.Body(mesh, material=material, fixed=lambda p: p[:, 2] < 1e-9)
    green = palpate.precompute(held, path=tmp_path / "a.palpate", progress=False)
    job = SeriesJob.of(green, held, 0.006)
    alone, killed, seen = job.compute(), [], []
    job.file().path.unlink()

    def kill_one(done, total):
        seen.append(done)
        if done >= total // 2 and not killed:
            killed.append(next(iter(pids.values())))
            os.kill(killed[0], signal.SIGKILL)

    with connected(workers.scheduler_address) as client:
        client.wait_for_workers(2, timeout=120)
        pids = client.run(os.getpid)
        series = job.compute(kill_one, client)
        client.wait_for_workers(2, timeout=120)
        assert set(client.run(held_factors).values()) == {0}
    assert series.is_complete and killed
    assert seen == sorted(seen) and seen[0] == 0 and seen[-1] == series.places
    for known in (series, job.file().load()):
        assert np.array_equal(known.fields, alone.fields) and np.array_equal(known.positions, alone.positions)


def test_a_scene_is_precomputed_by_a_cluster(workers, tmp_path):
    box_mesh(cells=(6, 4, 4)).write(tmp_path / "box.vtu")
    scene = """
[body]
mesh = "box.vtu"
[supports]
fixed = "z < min + 1mm"
[tool]
radius = "12mm"
"""
    (tmp_path / "box.toml").write_text(scene)
    result = run("precompute", "box.toml", "--dask", workers.scheduler_address, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    planned, store, done = result.stdout.splitlines()[-3:]
    series = re.fullmatch(
        r"series beyond small strain below spheres of 12 mm: (\d+) places, .* MB, time about .*", planned
    )
    assert f"spheres of 12 mm: {series[1]} places" in done
    again = run("info", store.split(": ")[0], cwd=tmp_path)
    assert f"series beyond small strain at all {series[1]} places" in again.stdout
    refused(run("precompute", "box.toml", "--touch", "z > 0", cwd=tmp_path), "--touch", "a scene has its own bodies")


def test_a_result_that_is_lost_with_its_worker_is_computed_again(workers):
    with connected(workers.scheduler_address) as client:
        client.wait_for_workers(2, timeout=120)
        first = client.run(os.getpid)
        future = clusters.submit(client, os.getpid)
        assert clusters.wait_for_some(client, [future]) == [future]
        (holder,) = client.who_has([future])[future.key]
        os.kill(first[holder], signal.SIGKILL)
        while holder in clusters.threads_of_workers(client):
            time.sleep(0.01)
        assert clusters.result_of(client, future) != first[holder]


def held_factors():
    return len(worker._factors.held)


@pytest.mark.slow
def test_what_a_cluster_began_is_finished_by_one_machine(workers, body, undisturbed, tmp_path):
    path, total = tmp_path / "a.palpate", 3 * len(body.mesh.surface_nodes)
    begun = []

    def stop_at(part):
        def stop(done, _total):
            begun.append(done)
            if done >= part * total:
                raise KeyboardInterrupt

        return stop

    for part in (0.3, 0.6):
        with pytest.raises(KeyboardInterrupt):
            palpate.precompute(body, path=path, dask=workers.scheduler_address, progress=stop_at(part))
        assert os.listdir(tmp_path) == ["a.palpate.partial"]
        assert begun[-1] < total
    assert begun.count(0) == 1
    assert_finished_here(body, path, undisturbed, begun[-1])


def assert_finished_here(body, path, undisturbed, finished):
    seen = []
    palpate.precompute(body, path=path, progress=lambda done, _: seen.append(done))
    # Nothing is done while this process factorises.
    assert min(done for done in seen if done > 0) >= finished > 0
    assert path.read_bytes() == undisturbed
    assert os.listdir(path.parent) == ["a.palpate"]


@pytest.mark.slow
def test_a_scheduler_that_is_killed_loses_nothing(body, undisturbed, tmp_path_factory, tmp_path):
    path, begun = tmp_path / "a.palpate", []
    with programs(tmp_path_factory.mktemp("programs")) as (address, scheduler):

        def kill(done, total):
            begun.append(done)
            if done >= total // 2:
                scheduler.kill()

        with pytest.raises(
            palpate.ClusterError, match="the connection to the scheduler is lost; finished blocks are kept"
        ):
            palpate.precompute(body, path=path, dask=address, progress=kill)
    assert os.listdir(tmp_path) == ["a.palpate.partial"]
    assert_finished_here(body, path, undisturbed, begun[-1])


def test_a_lost_connection_is_not_taken_for_a_full_disk(workers, body, tmp_path, monkeypatch):
    def lose(client, *_):
        (tmp_path / "a.palpate.partial").write_bytes(b"")
        client.sync(distributed.comm.connect, "tcp://127.0.0.1:1", timeout=0.2)

    monkeypatch.setattr(sys.modules["palpate.green.precompute"], "precompute_on", lose)
    with pytest.raises(palpate.ClusterError, match="the connection to the scheduler is lost; finished blocks are kept"):
        palpate.precompute(body, path=tmp_path / "a.palpate", dask=workers.scheduler_address)


@pytest.mark.slow
def test_eight_bodies_on_two_workers_answer_what_they_answer_one_by_one(workers, tmp_path):
    box_mesh(cells=(6, 4, 4)).write(tmp_path / "box.vtu")
    (tmp_path / "study.toml").write_text(
        """
[body]
mesh = "box.vtu"
[supports]
fixed = "z < min + 1mm"
[[region]]
shape = "box"
low = [0, 0, "20mm"]
high = ["80mm", "50mm", "40mm"]
[[press]]
point = ["40mm", "25mm", "50mm"]
displacement = [0, "1mm", "-2mm"]
[grid]
region.youngs_modulus = ["5kPa", "10kPa", "20kPa", "40kPa"]
material.poissons_ratio = [0.3, 0.45]
"""
    )
    study = Study.read(tmp_path / "study.toml")
    alone, seen = study.run(tmp_path / "alone", progress=False), []
    result = run("study", "study.toml", "--dask", workers.scheduler_address, "--out", "by-two", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "8 bodies" in result.stdout
    assert (tmp_path / "by-two" / "study.csv").read_bytes() == written(alone, tmp_path)
    spread = study.run(tmp_path / "spread", dask=workers.scheduler_address, progress=lambda *at: seen.append(at))
    assert spread == alone and seen[-1] == (8, 8)
    assert len(np.unique(alone.columns["force_N"])) == 8


def written(result, folder):
    return result.save(folder)[0].read_bytes()


def test_mistakes_of_a_cluster_are_told_in_a_line(workers, body, tmp_path, monkeypatch):
    # A worker may still hold the factor of the other tests' body for a while, and need no memory for another.
    body = palpate.Body(body.mesh, material=palpate.Material(3e4, 0.4), fixed=body.fixed_nodes)

    def refuses(dask, match, **options):
        with pytest.raises(palpate.Error, match=match) as error:
            palpate.precompute(body, path=tmp_path / "a.palpate", dask=dask, **options)
        assert "\n" not in str(error.value)
        assert not os.listdir(tmp_path)

    monkeypatch.setattr(clusters, "CONNECT_SECONDS", 0.5)
    refuses("tcp://127.0.0.1:1", "no scheduler answers at tcp://127.0.0.1:1")
    for nonsense in ("nonsense", "127.0.0.1", "abc://x:1", ""):
        refuses(nonsense, f"^'{nonsense}' is no address of a scheduler, such as tcp://")
    refuses(8786, "address of a scheduler")
    refuses(workers.scheduler_address, "already in use", memory="1MB")
    with local_cluster(0) as nobody:
        refuses(nobody.scheduler_address, "has no worker: 'dask worker tcp://")
    with monkeypatch.context() as other:
        other.setattr(clusters, "_native", types.SimpleNamespace(__version__="0.0.1"))
        refuses(workers.scheduler_address, r"worker at tcp://\S+ has Palpate \S+, not 0\.0\.1")
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "distributed", None)
        refuses(workers.scheduler_address, r"pip install 'palpate\[cluster\]'")


def test_a_worker_of_another_version_that_joins_is_refused(monkeypatch):
    monkeypatch.setattr(worker, "_address", lambda: "tcp://10.0.0.7:1234")
    job = worker.FactorRequest("key", "0.0.1", "f32", None)
    with pytest.raises(palpate.ClusterError, match=r"the worker at tcp://10\.0\.0\.7:1234 has Palpate"):
        worker.measure((), job)


@pytest.mark.slow
def test_command_line(workers, tmp_path):
    mesh = box_mesh(cells=(8, 5, 5))
    mesh.write(tmp_path / "box.vtu")
    command = ["precompute", "box.vtu", "--fix", "x < 1mm", "-E", "10kPa", "--nu", "0.4", "-o", "a.palpate", "--dask"]
    result = run(*command, workers.scheduler_address, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert f"{workers.scheduler_address}: 2 workers with 2 threads" in result.stdout
    body = palpate.Body(
        palpate.TetMesh.read(tmp_path / "box.vtu"), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 0] < 1e-3
    )
    assert (
        palpate.precompute(body, path=tmp_path / "b.palpate").path.read_bytes() == (tmp_path / "a.palpate").read_bytes()
    )
    refused(run(*command, "tcp://127.0.0.1:1", cwd=tmp_path), "no scheduler answers at tcp://127.0.0.1:1")


@pytest.mark.slow
def test_certificates_of_dasks_own_configuration_are_taken(tmp_path):
    """A scheduler that asks for certificates: the command has them from the environment, as dask has."""
    box_mesh(cells=(8, 5, 5)).write(tmp_path / "box.vtu")
    command = ["precompute", "box.vtu", "--fix", "x < 1mm", "-E", "10kPa", "--nu", "0.4", "-o", "a.palpate", "--dask"]
    ours, others = tmp_path / "ours", tmp_path / "others"
    ours.mkdir(), others.mkdir()
    with programs(ours, certificates(ours)) as (address, _):
        assert address.startswith("tls://")
        refused(
            run(*command, address, cwd=tmp_path),
            f"{address} needs certificates: dask's configuration has no distributed.comm.tls.ca-file",
        )
        strange = run(*command, address, cwd=tmp_path, env={**os.environ, **certificates(others)})
        refused(strange, f"no scheduler answers at {address} with these certificates")
        result = run(*command, address, cwd=tmp_path, env={**os.environ, **certificates_in(ours)})
        assert result.returncode == 0 and f"{address}: 1 worker" in result.stdout, result
    assert palpate.GreensFunction.load(tmp_path / "a.palpate").touch_error < 0.1
