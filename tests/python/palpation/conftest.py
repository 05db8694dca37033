from __future__ import annotations

import pytest
from palpated import block_body, scene_of

import palpate
from palpate.scene import BuiltScene


@pytest.fixture(scope="session")
def store(tmp_path_factory):
    path = tmp_path_factory.mktemp("palpation") / "block.palpate"
    palpate.precompute(block_body(), precision="f64", path=path)
    return path


@pytest.fixture(scope="session")
def block(store) -> BuiltScene:
    return scene_of(store).build()
