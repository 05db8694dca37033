from __future__ import annotations

import pytest
from sessions_scene import STRIKE, built_of, path, scene_of

import palpate
from palpate.scene import BuiltScene


@pytest.fixture(scope="session")
def built(block, block_green) -> BuiltScene:
    return built_of(scene_of(), block, block_green)


@pytest.fixture(scope="session")
def recording(built) -> palpate.Recording:
    """A third of a second with two tools and a strike."""
    return palpate.Simulation(built).play(*path(), strikes=[STRIKE])


@pytest.fixture(scope="session")
def file(recording, tmp_path_factory):
    saved = tmp_path_factory.mktemp("sessions") / "press.mcap"
    recording.save(saved)
    return saved
