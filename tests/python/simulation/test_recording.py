"""Recordings: of runs and of sessions, in files, made again bit for bit."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np
import pytest
from running import settle

import palpate
from palpate.scene import BuiltScene
from palpate.simulation import CONTACT_DTYPE

TOOLS = [{"radius": "6mm", "friction": 0.3}, {"radius": "5mm"}]


@pytest.fixture(scope="module")
def built(block, block_green) -> BuiltScene:
    scene = palpate.Scene(body={"model": "beam"}, tool=TOOLS, view={"strain_limit": 0.1})
    return BuiltScene.of(scene, block, block_green)


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory) -> str:
    """A scene that can be built anew from its file alone, in motion."""
    path = tmp_path_factory.mktemp("scene") / "beam.toml"
    path.write_text(
        '[body]\nmodel = "beam"\npaper = true\n[[tool]]\nradius = "5mm"\nfriction = 0.3\n[[tool]]\nradius = "4mm"\n'
        "[dynamics]\nmodes = 20\ndamping_ratios = [0.05, 0.05]\n"
    )
    return str(path)


def paths(ticks: int = 600) -> np.ndarray:
    """Two tools that press the free end of the block and slide over it."""
    t = np.linspace(0, 2 * np.pi, ticks)
    x = 0.08 + 0.0055 - 0.002 * (1 - np.cos(t))
    first = np.stack([x, 0.015 + 0.003 * np.sin(2 * t), np.full(ticks, 0.025)], axis=1)
    second = np.stack([x - 0.001, 0.036 + 0 * t, np.full(ticks, 0.025)], axis=1)
    return np.stack([first, second], axis=1)


def test_a_run_is_saved_loaded_and_made_again(built, tmp_path):
    simulation = palpate.Simulation(built)
    recording = simulation.play(paths())
    recording.save(tmp_path / "press.mcap")
    loaded = palpate.Recording.load(tmp_path / "press.mcap")
    assert loaded == recording and loaded.dropped == 0
    assert np.array_equal(loaded.positions, paths()) and loaded.orientations.shape == (600, 2, 4)
    # The safety stage only takes away.
    assert (np.linalg.norm(loaded.computed_forces, axis=2) >= np.linalg.norm(loaded.forces, axis=2) - 1e-12).all()
    assert np.linalg.norm(loaded.forces, axis=2).max(axis=0).min() > 0.01
    contacts = loaded.contacts
    assert contacts.dtype == CONTACT_DTYPE and set(contacts["tool"]) == {0, 1}
    # By Newton's third law, tool by tool, to the digits that contacts are kept in.
    for tool in (0, 1):
        total = np.zeros((600, 3))
        own = contacts[contacts["tool"] == tool]
        np.add.at(total, own["tick"], own["force"])
        assert np.abs(total + loaded.computed_forces[:, tool]).max() < 3e-5 * np.abs(total).max()
    replayed = palpate.replay(loaded, built)
    assert replayed.same and replayed.whole and replayed.ticks == 600


def test_one_tool_keeps_its_shape(built, tmp_path):
    recording = palpate.Simulation(built).play(paths()[:50, 0])
    recording.save(tmp_path / "one.mcap")
    loaded = palpate.Recording.load(tmp_path / "one.mcap")
    assert loaded == recording and loaded.forces.shape == loaded.positions.shape == (50, 3)


def test_scripts_and_files_that_cannot_be_are_refused(built, tmp_path):
    simulation = palpate.Simulation(built)
    for play in (simulation.run, simulation.play):
        with pytest.raises(palpate.SceneError, match=r"positions must have shape .*got \(0, 3\)"):
            play(np.zeros((0, 3)))
    far = paths(5)
    far[3, 0, 1] = np.inf
    with pytest.raises(palpate.SceneError, match="position 3 is infinite"):
        simulation.play(far)
    recording = simulation.play(paths(5))
    with pytest.raises(palpate.SceneError, match="there is no folder"):
        recording.save(tmp_path / "nowhere" / "a.mcap")


def session(simulation: palpate.Simulation, seconds: float = 0.5) -> None:
    """Press by hand, as it were."""
    begun = time.monotonic()
    for rank in range(2):
        simulation.move(paths()[300, rank], tool=rank)
    while time.monotonic() - begun < seconds:
        simulation.set_friction(0.2 + 0.1 * np.sin(10 * time.monotonic()), tool=0)
        time.sleep(0.01)
    settle(simulation)


def test_a_session_is_recorded_and_made_again(built, tmp_path):
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    with palpate.Simulation(built) as simulation:
        assert simulation.recording is None
        session(simulation, 0.1)
        # In the middle of a press: it begins anew, and so does what is recorded.
        simulation.record(first)
        session(simulation)
        status = simulation.recording
        assert status.path == first and status.ticks > 400 and status.error is None and status.dropped == 0
        with pytest.raises(palpate.Error, match=r"is being recorded already"):
            simulation.record(second)
        done = simulation.stop_recording()
        assert simulation.recording is None and simulation.stop_recording() is None
        simulation.record(second)
        session(simulation, 0.1)
    assert done.size == first.stat().st_size
    recording = palpate.Recording.load(first)
    assert len(recording.ticks) == done.ticks and recording.dropped == 0
    assert np.linalg.norm(recording.forces, axis=2).max(axis=0).min() > 0.01
    assert np.allclose(np.diff(recording.time) * 1e3, np.round(np.diff(recording.time) * 1e3), atol=1e-3)
    assert recording.compute_us.min() > 0 and (recording.limited.any() or len(recording.contacts) > 400)
    for file in (first, second):
        replayed = palpate.replay(file, built)
        assert replayed.same and replayed.whole and replayed.ticks > 50, [
            str(difference) for difference in replayed.differences[:3]
        ]


def test_a_recording_asked_for_before_the_start_has_the_first_tick(built, tmp_path):
    simulation = palpate.Simulation(built)
    simulation.record(tmp_path / "whole.mcap")
    with simulation:
        session(simulation, 0.1)
        ticks = simulation.frame().statistics["ticks"]
    recording = palpate.Recording.load(tmp_path / "whole.mcap")
    assert recording.ticks[0] == 0 and len(recording.ticks) >= ticks - 20
    assert palpate.replay(recording, built).same
    with pytest.raises(palpate.SceneError, match=r"whole\.mcap: exists: give another name"):
        simulation.record(tmp_path / "whole.mcap")
    with palpate.Simulation(built) as running, pytest.raises(palpate.Error, match="nowhere"):
        running.record(tmp_path / "nowhere" / "a.mcap")


@pytest.mark.slow
def test_the_scene_of_a_recording_is_built_from_the_file_alone(scene_file, tmp_path):
    """In another process, by the command, with one thread and two."""
    simulation = palpate.Simulation(palpate.Scene.read(scene_file))
    top = simulation.body.mesh.nodes[simulation.green.surface_nodes]
    end = top[np.argmax(top[:, 0] + 0.1 * top[:, 2])]
    ticks = np.linspace(0, 2 * np.pi, 400)[:, None]
    path = end + [0, 0, 0.005] - [0, 0, 0.0008] * (1 - np.cos(ticks))
    recording = simulation.play(path, strikes=[(100, tuple(end), (0, 0, -1e-3))])
    assert recording.energy.work[-1] > 0 and next(what for _, what in recording.events).startswith("strike of 0.001")
    file = tmp_path / "beam.mcap"
    recording.save(file)
    for threads in ("1", "2"):
        env = {**os.environ, "RAYON_NUM_THREADS": threads}
        run = subprocess.run(
            [sys.executable, "-m", "palpate", "replay", str(file), "--headless"],
            env=env,
            capture_output=True,
            text=True,
        )
        assert run.returncode == 0 and "400 ticks computed again: every bit is as recorded" in run.stdout, run.stderr


def test_a_changed_coefficient_is_found_and_named(built, scene_file, tmp_path):
    recording = palpate.Simulation(built).play(paths())
    touched = int(np.flatnonzero(np.linalg.norm(recording.computed_forces, axis=2).any(axis=1))[0])
    tool = built.scene.tools[0].model_copy(update={"radius": built.scene.tools[0].radius * (1 + 1e-9)})
    changed = built.scene.model_copy(update={"tools": [tool, built.scene.tools[1]]})
    replayed = palpate.replay(recording, BuiltScene(changed, built.bodies))
    first = replayed.differences[0]
    assert (first.of, first.quantity) == ("tool 0", "force of the contact law") and first.tick >= touched
    assert str(first).startswith(f"tick {first.tick}: tool 0: force of the contact law was ")
    # Another body is not compared at all.
    with pytest.raises(palpate.SceneError, match=r"is not the body that was recorded: its mesh, material"):
        palpate.replay(recording, palpate.Scene.read(scene_file).model_copy(update={"dynamics": None}))


def test_what_is_no_recording_is_refused(built, tmp_path):
    (tmp_path / "a.mcap").write_bytes(b"solid ascii")
    with pytest.raises(palpate.Error, match=r"a\.mcap: this is no recording"):
        palpate.Recording.load(tmp_path / "a.mcap")
    with pytest.raises(palpate.Error, match=r"none\.mcap"):
        palpate.Recording.load(tmp_path / "none.mcap")
    recording = palpate.Simulation(built).play(paths())
    (tmp_path / "cut.mcap").write_bytes(recording.source[: int(0.9 * len(recording.source))])
    cut = palpate.Recording.load(tmp_path / "cut.mcap")
    assert cut.dropped is None and 100 < len(cut.ticks) < 600
    assert np.array_equal(cut.forces, recording.forces[: len(cut.ticks)])
    replayed = palpate.replay(cut, built)
    assert replayed.same and not replayed.whole and replayed.ticks == len(cut.ticks)


def unchanged(recording: palpate.Recording, whole: palpate.Recording) -> bool:
    """Whether a recording is another one up to where it says that it was cut short."""
    count = len(recording.ticks)
    same = recording.about == whole.about and np.array_equal(recording.ticks, whole.ticks[:count])
    names = ("time", "forces", "positions", "velocities", "computed_forces", "buttons", "active")
    same = same and all(np.array_equal(getattr(recording, name), getattr(whole, name)[:count]) for name in names)
    return same and (count == len(whole.ticks) or recording.dropped is None)


@pytest.mark.slow
def test_no_changed_byte_of_a_recording_gives_another_one(built, tmp_path):
    whole = palpate.Simulation(built).play(paths()[:60])
    content, path = whole.source, tmp_path / "damaged.mcap"
    # What was recorded stands at the beginning; of the chunks some bytes, of the end all.
    rng = np.random.default_rng(3)
    places = {*range(9000), *rng.integers(0, len(content), 1500).tolist(), *range(len(content) - 1500, len(content))}
    for at in sorted(place for place in places if place < len(content)):
        value = content[at]
        other = ord("0") + (value - ord("0") + 8) % 10 if chr(value).isdigit() else value ^ 0x10
        path.write_bytes(content[:at] + bytes([other]) + content[at + 1 :])
        try:
            found = palpate.Recording.load(path)
        except palpate.Error as error:
            assert "\n" not in str(error)
        else:
            assert unchanged(found, whole), at


def test_texts_that_are_none_are_refused_in_one_line(built, monkeypatch):
    """Whole by its checksum, and yet not what this version can read."""
    simulation = palpate.Simulation(built)
    for key, text in (("scene", "{"), ("keys", "7"), ("rate", "fast"), ("format", "99"), ("shown", "[]")):
        about = {**simulation._about((2, False), clock=False), key: text}
        monkeypatch.setattr(simulation, "_about", lambda *_, about=about, **__: about)
        with pytest.raises(palpate.Error, match=r"^[^\n]*$"):
            palpate.replay(simulation.play(paths()[:5]), built if key != "scene" else None)


def test_a_recording_that_cannot_begin_does_not_hold_the_series(block, block_green, monkeypatch, tmp_path):
    held = []
    native = palpate._native.hold_series
    monkeypatch.setattr(palpate._native, "hold_series", lambda core, on: held.append(on) or native(core, on))
    built = BuiltScene.of(palpate.Scene(body={"model": "beam"}, tool={"radius": "5mm"}), block, block_green)
    with palpate.Simulation(built) as simulation:
        with pytest.raises((palpate.Error, OSError)):
            simulation.record("/proc/none/a.mcap")
        assert not held or held[-1] is False
