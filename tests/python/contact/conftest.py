from __future__ import annotations

import pytest
from crossings import Loops


@pytest.fixture(scope="module")
def loops(tmp_path_factory) -> Loops:
    return Loops(tmp_path_factory.mktemp("bodies"), {})


@pytest.fixture(autouse=True)
def one_cache(shared_cache):
    """Each store is computed once for all tests of the folder."""
