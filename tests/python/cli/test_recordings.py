"""Sessions of the examples are recorded and made again, by the commands that a user types."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import refused, run

import palpate
from benches.record import run_session

ROOT = Path(__file__).parents[3]
# The nodule is the largest; its store is shared with the tests of its forces.
EXAMPLES = sorted(
    path for path in (ROOT / "examples").glob("*.toml") if path.stem not in ("exam", "study")
)  # no scenes


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_a_session_of_every_example_is_made_again(example, tmp_path, shared_cache):
    """At rest and in motion, one tool and two."""
    built = palpate.Scene.read(example).build(progress=False)
    result = run_session(built, example.stem, tmp_path / "session.mcap", seconds=2.5, pace=4.0)
    assert result.same and result.dropped == 0 and result.not_finite == 0
    assert result.ticks > 1000 and result.contacts > 300


@pytest.fixture(scope="module")
def recorded(cache, tmp_path_factory) -> Path:
    """A press of the block by its command."""
    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        result = run("run", ROOT / "examples" / "block.toml", "--headless", 1.0, "--record", "press.mcap", cwd=folder)
    assert result.returncode == 0
    assert "recorded press.mcap: to compute it again: palpate replay press.mcap" in result.stdout
    return folder / "press.mcap"


@pytest.fixture(scope="module")
def block(cache, tmp_path_factory) -> Path:
    """The same scene with the tetrahedra themselves, which no mesher has to find again."""
    folder = tmp_path_factory.mktemp("block")
    text = (ROOT / "examples" / "block.toml").read_text()
    surface = 'mesh = "block.obj"\nunit = "mm"\nmax_element_size = "16mm"\n'
    assert surface in text
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(cache))
        built = palpate.Scene.read(ROOT / "examples" / "block.toml").build(progress=False)
    built.bodies[0].body.mesh.write(folder / "block.vtu", unit="m")
    mesh_file = (folder / "block.vtu").as_posix()
    (folder / "block.toml").write_text(text.replace(surface, f'mesh = "{mesh_file}"\nunit = "m"\n'))
    return folder / "block.toml"


def test_a_press_is_recorded_and_made_again(recorded, shared_cache, tmp_path):
    again = run("replay", recorded, "--headless", cwd=tmp_path)
    assert again.returncode == 0 and again.stdout.strip().endswith("ticks computed again: every bit is as recorded")
    force = np.linalg.norm(palpate.Recording.load(recorded).forces, axis=1)
    assert force.max() > 0.01


@pytest.mark.slow
def test_another_scene_gives_other_bits(recorded, block, shared_cache, tmp_path):
    text = block.read_text()
    (tmp_path / "slippery.toml").write_text(text.replace('radius = "6mm"', 'radius = "6.0001mm"'))
    (tmp_path / "other.toml").write_text(text.replace('"10kPa"', '"11kPa"'))
    other = run("replay", recorded, "--headless", "--scene", "slippery.toml", cwd=tmp_path)
    assert other.returncode == 1 and "tool 0: force of the contact law was " in other.stdout.splitlines()[0]
    refused(
        run("replay", recorded, "--headless", "--scene", "other.toml", cwd=tmp_path),
        "is not the body that was",
        "material",
    )


def test_files_that_cannot_be(recorded, block, shared_cache, tmp_path):
    before = recorded.read_bytes()
    refused(run("run", block, "--headless", 0.5, "--record", recorded, cwd=tmp_path), "press.mcap: exists")
    refused(run("run", block, "--headless", 0.5, "--record", "no/a.mcap", cwd=tmp_path), "there is no folder no")
    refused(run("run", block, "--headless", 0.5, "--record", "a.foo", cwd=tmp_path), "a recording ends in .mcap")
    for command in ("info", "run"):
        refused(run(command, recorded, cwd=tmp_path), "press.mcap is a recording: 'palpate replay' shows it")
    refused(run("replay", "none.mcap", cwd=tmp_path), "none.mcap: no such file")
    refused(run("replay", block, cwd=tmp_path), "block.toml: this is no recording")
    assert recorded.read_bytes() == before


@pytest.mark.slow
def test_a_killed_process_loses_a_tenth_of_a_second(block, tmp_path, shared_cache):
    code = (
        "import sys, time, palpate\n"
        f"simulation = palpate.Simulation(palpate.Scene.read({str(block)!r}))\n"
        "simulation.record('killed.mcap')\n"
        "with simulation:\n"
        "    while True:\n"
        "        print(simulation.frame().statistics['ticks'], flush=True)\n"
        "        time.sleep(0.002)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        ticks = 0
        while ticks < 700:
            ticks = int(process.stdout.readline())
        process.send_signal(signal.SIGKILL)
        # What it still said before it died.
        ticks = max([ticks, *map(int, process.stdout.read().split()[:-1])])
    # Deadlines that passed without a tick are no ticks; what was written is whole.
    cut = palpate.Recording.load(tmp_path / "killed.mcap")
    assert cut.dropped is None and ticks - 100 <= len(cut.ticks) <= ticks + 100
    assert np.array_equal(cut.ticks, np.arange(len(cut.ticks)))
    again = run("replay", "killed.mcap", "--headless", cwd=tmp_path)
    assert again.returncode == 0 and "note: the file was cut short" in again.stdout
    # One without a tick has the same bits as anything.
    (tmp_path / "head.mcap").write_bytes((tmp_path / "killed.mcap").read_bytes()[:3000])
    refused(run("replay", "head.mcap", "--headless", cwd=tmp_path), "head.mcap", "no tick of it can be computed again")


@pytest.mark.slow
def test_a_full_disk_ends_the_recording_and_nothing_else(block, tmp_path, shared_cache):
    """The size of files is limited in the process, as a full disk would."""
    code = (
        "import resource, signal, sys, time, palpate\n"
        f"simulation = palpate.Simulation(palpate.Scene.read({str(block)!r}))\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))\n"
        "simulation.record('full.mcap')\n"
        "with simulation:\n"
        "    end = time.monotonic() + 60\n"
        "    while simulation.recording.error is None and time.monotonic() < end:\n"
        "        time.sleep(0.01)\n"
        "    before = simulation.frame().statistics['ticks']\n"
        "    time.sleep(0.2)\n"
        "    frame = simulation.frame()\n"
        "    assert frame.statistics['fault'] is None and frame.statistics['ticks'] > before + 50\n"
        "    print(simulation.recording.error)\n"
        "    print(simulation.stop_recording().error)\n"
    )
    result = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=280)
    assert result.returncode == 0, result.stderr
    assert all("full.mcap: " in line and "the recording ends here" in line for line in result.stdout.splitlines())
    cut = palpate.Recording.load(tmp_path / "full.mcap")
    assert cut.dropped is None and len(cut.ticks) > 100
    assert run("replay", "full.mcap", "--headless", cwd=tmp_path).returncode == 0
