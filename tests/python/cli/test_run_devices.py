"""`palpate run --device` with emulated devices, and without any."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import command_line
import numpy as np
import pytest
from emulators import PRESS, inverse_service, library

# Variable and file of each emulated library.
LIBRARIES = {
    "touch": ("PALPATE_OPENHAPTICS_LIBRARY", "hd"),
    "forcedimension": ("PALPATE_FORCEDIMENSION_LIBRARY", "dhd"),
}
VARIABLES = ("PALPATE_HAPLY_ADDRESS", "PALPATE_OPENHAPTICS_LIBRARY", "PALPATE_FORCEDIMENSION_LIBRARY")
# Above the top of the block, whose corner is the origin: first touch is in the middle of the device's workspace.
TABLE = "[[device]]\nposition = [{}, 0.025, 0.056]\n"


@pytest.fixture(scope="module")
def scene(block_green, tmp_path_factory) -> Path:
    """Two tools over a block, 30 mm from each other."""
    folder = tmp_path_factory.mktemp("devices")
    tool = '[[tool]]\nradius = "6mm"\n'
    tables = TABLE.format(0.025) + TABLE.format(0.055)
    (folder / "scene.toml").write_text(f'[body]\nstore = "{block_green.path}"\n{2 * tool}{tables}')
    return folder / "scene.toml"


def run(scene: Path, *devices: str, seconds: float = 2.0, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    options = [option for device in devices for option in ("--device", device)]
    command = [sys.executable, "-m", "palpate", "run", scene.name, "--headless", str(seconds), "--record", "run.mcap"]
    (scene.parent / "run.mcap").unlink(missing_ok=True)
    return subprocess.run(
        [*command, *options],
        cwd=scene.parent,
        env={**environment, **variables},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.fixture(scope="module")
def pressed(scene):
    """What a run with a library in a pressing hand says, and its recording; each library runs once."""

    @cache
    def run_with(kind: str) -> tuple[str, Path]:
        variable, emulated = LIBRARIES[kind]
        variables = {variable: library(emulated), "PALPATE_EMULATED_HAND": PRESS}
        done = run(scene, kind, **variables)
        # The emulated device's thread has no priority: where a busy machine halts it, the device counts as dead.
        for _ in range(2):
            if "has stopped sending measurements" in done.stderr:
                done = run(scene, kind, **variables)
        assert done.returncode == 0, done.stderr
        return done.stderr, (scene.parent / "run.mcap").rename(scene.parent / f"{kind}.mcap")

    return run_with


def largest_forces(recording: Path) -> np.ndarray:
    """Upward, on each device, N."""
    import palpate

    recording = palpate.Recording.load(recording)
    return recording.forces.reshape(len(recording.time), -1, 3)[:, :, 2].max(axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", LIBRARIES)
def test_a_library_moves_the_first_tool(pressed, kind):
    words, recording = pressed(kind)
    forces = largest_forces(recording)
    assert 0.02 < forces[0] < 3.3 and forces[1] == 0.0
    assert ("renders contacts up to 400 N/m, and this scene has up to 5000" in words) == (kind == "touch")


@pytest.mark.slow
def test_two_devices_at_once(scene):
    with inverse_service() as (address, _):
        hand = {"PALPATE_FORCEDIMENSION_LIBRARY": library("dhd"), "PALPATE_EMULATED_HAND": PRESS}
        done = run(scene, "forcedimension", "haply", seconds=4.0, PALPATE_HAPLY_ADDRESS=address, **hand)
    assert done.returncode == 0, done.stderr
    assert (largest_forces(scene.parent / "run.mcap") > 0.02).all()


def test_the_first_recording_of_devices_is_made_again(pressed):
    import palpate

    # What the device held was part of what was computed.
    again = palpate.replay(pressed("touch")[1])
    assert again.same and again.ticks > 500, again.differences[:1]


@pytest.mark.slow
def test_a_service_that_dies_ends_the_force_and_is_told(scene):
    with inverse_service() as (address, process):
        command = [sys.executable, "-m", "palpate", "run", scene.name, "--headless", "6", "--device", "haply"]
        environment = {**os.environ, "PALPATE_HAPLY_ADDRESS": address}
        with subprocess.Popen(
            [*command, "--record", "died.mcap"], cwd=scene.parent, env=environment, stderr=subprocess.PIPE, text=True
        ) as running:
            log = scene.parent / "died.mcap"
            while not (log.exists() and log.stat().st_size > 100_000):
                assert running.poll() is None
            process.kill()
            output = running.communicate(timeout=60)[1]
    assert running.returncode == 1 and "the device is disconnected" in output, output
    import palpate

    recording = palpate.Recording.load(log)
    tick, _ = next(event for event in recording.events if "disconnected" in event[1])
    assert not recording.forces[recording.ticks >= tick].any()


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("haply", "no Haply Inverse Service listens at ws://127.0.0.1:9"),
        ("touch", "the library of OpenHaptics (HD) is not found, looked for as"),
        ("forcedimension", "the library of Force Dimension's SDK is not found, looked for as"),
    ],
)
def test_without_a_device_the_message_says_what_to_do(scene, kind, message):
    variables = {"PALPATE_HAPLY_ADDRESS": "ws://127.0.0.1:9"} if kind == "haply" else {}
    done = run(scene, kind, **variables)
    assert done.returncode == 2 and message in done.stderr and "Traceback" not in done.stderr, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and not (scene.parent / "run.mcap").exists()


def test_options_that_cannot_be_are_refused(scene):
    for devices, message in [
        (["haptic"], "--device: there is no device 'haptic'"),
        (["haply"] * 3, "--device was given 3 times, but the scene has 2 of [[tool]]"),
    ]:
        options = [option for device in devices for option in ("--device", device)]
        done = command_line.run("run", scene.name, "--headless", "2.0", *options, cwd=scene.parent)
        assert done.returncode == 2 and message in done.stderr, done.stderr
