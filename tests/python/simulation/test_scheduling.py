"""The loop's thread keeps to its processors; what the system does not give is refused or warned of by its key."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

import palpate
from palpate.scene import BuiltScene
from palpate.simulation.scheduling import cpu_ranges

BEYOND = 100_000
TASKS = Path("/proc/self/task")

linux = pytest.mark.skipif(not TASKS.is_dir(), reason="this system does not tell where threads run")


def scene_of(block, block_green, **device) -> BuiltScene:
    scene = palpate.Scene(body={"store": "block.palpate"}, device=device)
    return BuiltScene.of(scene, block, block_green)


def thread_status(name: str) -> dict[str, str]:
    """What the kernel tells of the only thread of that name."""
    found = [task for task in TASKS.iterdir() if (task / "comm").read_text() == f"{name}\n"]
    assert len(found) == 1
    lines = (found[0] / "status").read_text().splitlines()
    return dict(line.split(":\t", 1) for line in lines if ":\t" in line) | {"id": found[0].name}


@linux
@pytest.mark.parametrize("by", ["scene", "argument"])
def test_the_thread_keeps_to_its_processors(block, block_green, by):
    before = os.sched_getaffinity(0)
    for cpu in sorted(before)[:2]:
        given = {"cpus": [cpu]}
        built = scene_of(block, block_green, **(given if by == "scene" else {}))
        with palpate.Simulation(built, **({} if by == "scene" else given)) as simulation:
            assert simulation.scene.device.cpus == (cpu,)
            assert thread_status("palpate-servo")["Cpus_allowed_list"] == str(cpu)
            assert os.sched_getaffinity(0) == before
    with palpate.Simulation(scene_of(block, block_green)):
        assert thread_status("palpate-servo")["Cpus_allowed_list"] == cpu_ranges(before)


@linux
def test_a_priority_is_granted_or_warned_of(block, block_green):
    with warnings.catch_warnings(record=True) as record:
        warnings.simplefilter("always")
        with palpate.Simulation(scene_of(block, block_green, priority=7)):
            thread = int(thread_status("palpate-servo")["id"])
            granted = os.sched_getscheduler(thread) == os.SCHED_FIFO
            if granted:
                assert os.sched_getparam(thread).sched_priority == 7
    texts = [str(one.message) for one in record if one.category is palpate.SchedulingWarning]
    assert len(texts) == (0 if granted else 1)
    assert granted or ("device.priority = 7" in texts[0] and "palpate doctor" in texts[0])


@linux
def test_no_priority_is_asked_for_or_warned_of(block, block_green):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for priority in (None, 0):
            with palpate.Simulation(scene_of(block, block_green), priority=priority) as simulation:
                thread = int(thread_status("palpate-servo")["id"])
                assert priority is None or os.sched_getscheduler(thread) == os.SCHED_OTHER
                assert priority is None or not simulation.frame().statistics["realtime"][0]


@linux
def test_only_what_a_tick_reads_is_locked(block, block_green):
    def locked() -> int:
        lines = Path("/proc/self/status").read_text().splitlines()
        return 1024 * int(next(line for line in lines if line.startswith("VmLck")).split()[1])

    # Mapped by the process, and of no use to a tick.
    mapped, before = np.zeros(2**28, dtype=np.uint8), locked()
    with palpate.Simulation(scene_of(block, block_green)) as simulation:
        now, granted = locked(), simulation.frame().statistics["realtime"][1]
    store = block_green.path.stat().st_size
    # Beside the store the stack of the loop's thread, and the code: 25 MB.
    assert now - before <= store + 50e6, f"{(now - before) / 1e6:.0f} MB are locked for a store of {store / 1e6:.0f} MB"
    # All of it may lie in memory that the loop of another test had locked.
    assert now >= store / 2 or not granted
    assert mapped.nbytes == 2**28


def test_what_the_machine_does_not_have_is_refused_by_its_key(block, block_green):
    with pytest.raises(palpate.SceneError, match=rf"device\.cpus: .* CPU {BEYOND}, only on"):
        palpate.Simulation(scene_of(block, block_green), cpus=[0, BEYOND])
    with pytest.raises(palpate.SceneError, match=r"device\.priority: must be less than or equal to 99, got 100"):
        palpate.Simulation(scene_of(block, block_green), priority=100)
    # A scene of another machine can be played, but its loop does not start.
    elsewhere = palpate.Simulation(scene_of(block, block_green, cpus=[BEYOND]))
    assert elsewhere.run([[0.0, 0.0, 1.0]]).shape == (1, 3)
    with pytest.raises(palpate.SceneError, match=r"device\.cpus"):
        elsewhere.start()


@pytest.mark.parametrize(
    ("text", "words"), [("cpus = [1, 1]", "device.cpus: give a list"), ("priority = -1", "device")]
)
def test_a_mistake_in_the_file_has_its_line(tmp_path, text, words):
    path = tmp_path / "scene.toml"
    path.write_text(f'[body]\nmodel = "beam"\n[device]\n{text}\n')
    with pytest.raises(palpate.SceneError, match=words) as error:
        palpate.Scene.read(path)
    assert "scene.toml:4" in str(error.value)


def test_ranges_are_those_of_the_kernel():
    assert [cpu_ranges(c) for c in ([], [3], [2, 0, 1], [7, 0, 1, 5, 8])] == ["", "3", "0-2", "0-1,5,7-8"]
