from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def one_cache(shared_cache):
    """Each store and each set of modes is computed once for all tests of the folder."""
