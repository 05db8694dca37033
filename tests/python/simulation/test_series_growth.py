"""Series beyond small strain that are computed beside a running loop."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import palpate
from palpate.errors import SceneError
from palpate.green import background_series
from palpate.scene import BuiltScene, Scene
from palpate.scene.series import with_series, with_stored_series
from palpate.simulation import Simulation
from palpate.simulation.replay import built_scene_of
from palpate.validation.verify.contact.loop import UNLIMITED, sphere
from palpate.validation.verify.grids import box

RADIUS = 0.01
ABOVE, PRESSED = (0.08, 0.01, 0.032), (0.08, 0.01, 0.012)
# Ticks of a press by a script, and time, s, after which a pressed tool stands still.
TICKS, SETTLES = 600, 1.0


@pytest.fixture(scope="module")
def body() -> palpate.Body:
    mesh = box((20, 4, 4), (0.1, 0.02, 0.02), quadratic=True)
    material = palpate.Material(10e3, 0.45, law="neo-hookean")
    return palpate.Body(mesh, material=material, fixed=lambda places: places[:, 0] < 1e-9)


@pytest.fixture(scope="module")
def store(body, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("store") / "beam.palpate"
    return palpate.precompute(body, path=path, progress=False).path


def beam_of(body: palpate.Body, store: Path) -> BuiltScene:
    """A clamped beam: it is softer by 15 % with its series, which lies beside the store."""
    table = {"name": "body", "model": "beam"}  # the table asks for a source; the body is given
    scene = Scene(body=table, tool=[sphere(RADIUS, 0.0)], device=UNLIMITED, view={"strain_limit": 0.0})
    return with_stored_series(BuiltScene.of(scene, body, palpate.GreensFunction.load(store, body=body)))


@pytest.fixture(scope="module")
def with_the_series(body, store, tmp_path_factory) -> Path:
    """Folder with the store and its series."""
    folder = tmp_path_factory.mktemp("with_the_series")
    with_series(beam_of(body, Path(shutil.copy(store, folder))))
    return folder


@pytest.fixture
def beam(body, store, tmp_path) -> BuiltScene:
    """The beam whose series is not known yet."""
    beam = beam_of(body, Path(shutil.copy(store, tmp_path)))
    assert beam.bodies[0].series == ((RADIUS, None),)
    return beam


@pytest.fixture
def known_beam(body, store, with_the_series, tmp_path) -> BuiltScene:
    shutil.copytree(with_the_series, tmp_path, dirs_exist_ok=True)
    beam = beam_of(body, tmp_path / store.name)
    assert beam.bodies[0].series[0][1].is_complete
    return beam


def path_of_press() -> np.ndarray:
    shares = np.minimum(1.0, 2.0 * np.arange(TICKS) / TICKS)[:, None]
    return np.array(ABOVE) + shares * (np.array(PRESSED) - np.array(ABOVE))


def pressed(built: BuiltScene) -> np.ndarray:
    return Simulation(built).run(path_of_press())


def without_series(built: BuiltScene) -> BuiltScene:
    return replace(built, bodies=tuple(replace(body, series=()) for body in built.bodies))


def before_the_series(built: BuiltScene) -> np.ndarray:
    """Press by the law of a loop that knows nothing of the series yet."""
    return run_as_known(built, path_of_press())


def run_as_known(built: BuiltScene, path: np.ndarray) -> np.ndarray:
    """Move the tool with what is known of the series."""
    simulation = Simulation(built)
    simulation.complete_series = lambda *_: None
    return simulation.run(path)


def settled_force(simulation: Simulation, place: tuple[float, float, float]) -> float:
    # By steps from above: what a hand does, which a jump by two radii is not.
    for share in np.linspace(0.0, 1.0, 60):
        simulation.move(((1.0 - share) * np.array(ABOVE) + share * np.array(place)).tolist())
        time.sleep(1e-3)
    time.sleep(SETTLES)
    return float(simulation.frame().forces[0][2])


@pytest.mark.slow
def test_a_script_waits_for_the_series(beam):
    forces = pressed(beam)
    assert np.array_equal(forces, pressed(with_series(beam)))
    assert forces[-1, 2] < 0.93 * pressed(without_series(beam))[-1, 2]


def test_a_running_loop_takes_the_series_up_when_the_tool_has_lifted(beam):
    simulation = Simulation(beam)
    with simulation:
        background = simulation.series
        assert background is not None
        first = settled_force(simulation, PRESSED)
        # Places near the tool come first, and wait: it goes on pressing.
        assert background.wait(120.0), background.error
        assert (background.done, background.seconds_left) == (background.places, None)
        held = float(simulation.frame().forces[0][2])
        settled_force(simulation, ABOVE)
        again = settled_force(simulation, PRESSED)
        assert simulation.bodies[0].series[0][1].is_complete
    half_space, whole = before_the_series(beam)[-1, 2], pressed(beam)[-1, 2]
    assert whole < 0.9 * half_space
    assert first == pytest.approx(half_space, rel=1e-4)
    assert held == pytest.approx(first, rel=1e-6)
    assert again == pytest.approx(whole, rel=1e-4)
    # The file is there: the next loop has the series from its start.
    with Simulation(with_stored_series(beam)) as simulation:
        assert simulation.series is None


@pytest.mark.slow
def test_a_tool_of_another_radius_gets_its_series_in_the_running_loop(known_beam):
    smaller = 0.006
    with Simulation(known_beam) as simulation:
        assert simulation.series is None
        simulation.add_tool(radius=f"{smaller} m", contact="local", friction=0.0)
        assert [radius for radius, _ in simulation.bodies[0].series] == [RADIUS, smaller]
        background = simulation.series
        assert background is not None
        assert background.wait(120.0), background.error
        assert simulation.bodies[0].series[1][1].is_complete
        tables = simulation.scene
    # It is that of a scene with both tools, and another one than without.
    path = np.stack([np.full_like(path_of_press(), 1.0), path_of_press() - (0.0, 0.0, RADIUS - smaller)], axis=1)
    changed, bodies = Simulation(known_beam), with_series(BuiltScene(tables, known_beam.bodies))
    changed.add_tool(radius=f"{smaller} m", contact="local", friction=0.0)
    forces = changed.run(path)[:, 1]
    assert np.array_equal(forces, Simulation(bodies).run(path)[:, 1])
    assert forces[-1, 2] < 0.93 * Simulation(without_series(bodies)).run(path)[-1, 1, 2]


@pytest.mark.slow
def test_a_recording_has_the_series_that_its_loop_had(beam, tmp_path):
    with Simulation(beam) as simulation:
        background = simulation.series
        assert background is not None
        while not background.done and background.error is None:
            time.sleep(0.01)
        simulation.record(tmp_path / "one.mcap")
        settled_force(simulation, ABOVE)
        settled_force(simulation, PRESSED)
        simulation.stop_recording()
        assert background.wait(120.0), background.error
    recording = palpate.Recording.load(tmp_path / "one.mcap")
    assert palpate.replay(recording, beam).same
    # Where there is none, nothing is made again without it.
    simulation = Simulation(with_series(beam))
    recording = simulation.play(np.linspace(ABOVE, PRESSED, 200))
    assert palpate.replay(recording, beam).same
    with pytest.raises(SceneError, match="no series beyond small strain"):
        built_scene_of(recording, without_series(beam))


def test_a_closed_path_into_the_unknown_part_gives_out_nothing(known_beam):
    """Where the series is known in part the force is the gradient of one energy too."""
    (known,) = [series for _, series in known_beam.bodies[0].series]
    half = known.only([block >= len(known.known) // 2 for block in range(len(known.known))])
    corners = np.array([[0.07, 0.01, 0.0305], [0.07, 0.01, 0.02], [0.025, 0.012, 0.026], [0.025, 0.012, 0.0305]])
    shares = np.linspace(0.0, 1.0, 1500, endpoint=False)[:, None]
    path = np.vstack([a + shares * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    whole, none, partial = (
        run_as_known(replace(known_beam, bodies=(replace(known_beam.bodies[0], series=((RADIUS, series),)),)), path)
        for series in (known, None, half)
    )
    # It goes from one part into the other.
    pressed = np.linalg.norm(whole, axis=1) > 1e-4
    same = [np.isclose(partial, other, rtol=0.0, atol=1e-9).all(axis=1)[pressed].mean() for other in (whole, none)]
    assert min(same) > 0.05 and sum(same) < 0.95
    steps = np.linalg.norm(np.diff(partial, axis=0), axis=1)
    assert steps.max() < 1e-2 * np.linalg.norm(partial, axis=1).max()
    work = np.cumsum((-0.5 * (partial[1:] + partial[:-1]) * np.diff(path, axis=0)).sum(axis=1))
    assert work.max() > 1e-5 and abs(work[-1]) < 1e-4 * work.max()


def test_series_that_cannot_begin_are_not_complete(tmp_path, monkeypatch):
    def none(_module):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(background_series, "start_child", none)
    job = SimpleNamespace(key="a", radius=0.01, file=lambda: SimpleNamespace(path=tmp_path / "none"))
    series = background_series.BackgroundSeries([job], lambda *_: None, lambda _: None)
    assert not series.wait(20) and not series.is_complete and "temporarily unavailable" in series.error
