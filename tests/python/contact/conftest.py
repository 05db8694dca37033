from __future__ import annotations

import pytest
from crossings import Loops


@pytest.fixture(scope="module")
def loops(tmp_path_factory) -> Loops:
    return Loops(tmp_path_factory.mktemp("bodies"), {})
