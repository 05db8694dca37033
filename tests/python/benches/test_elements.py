"""Elements of 4 and of 10 nodes at the same price."""

from __future__ import annotations

import json

import pytest
from command_line import run_bench

from benches import elements


@pytest.mark.slow
def test_at_equal_nodes_quadratic_elements_are_closer(monkeypatch, tmp_path):
    monkeypatch.setattr(elements, "CELLS", {False: (8,), True: (4,)})
    monkeypatch.setattr(elements, "_livers", list)
    result = run_bench("elements", "--json", "--out", tmp_path)
    assert result.exit_code == 0
    linear, quadratic = json.loads(result.stdout)["rows"]
    assert linear["nodes"] == quadratic["nodes"]
    assert abs(linear["store_bytes"] / quadratic["store_bytes"] - 1) < 0.01
    for nu, error in linear["errors"].items():
        assert 0 < quadratic["errors"][nu] < 0.5 * error
    assert (tmp_path / "elements.png").exists()
