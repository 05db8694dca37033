"""The precompute benchmark: what it refuses, what it leaves out, what it draws."""

from __future__ import annotations

import json

import numpy as np
import pytest

import palpate
from benches import precompute as bench
from benches.output import show


def results() -> list[bench.Result]:
    return [
        bench.Result("1k", 1404, 3858, dofs, method, threads, seconds * dofs, seconds * dofs, 5)
        for dofs in (2181, 3339)
        for threads in (1, 2)
        for method, seconds in (("Palpate", 1e-5), ("SuperLU", 1e-3))
    ]


def test_unknown_size_is_named():
    with pytest.raises(palpate.BodyError, match="unknown size 'huge': there are 1k, 2k"):
        bench.run(["1k", "huge"], [1])


def test_peers_solve_the_same_system(block):
    system = bench.System(block)
    assert len(system.columns) == 3 * len(np.setdiff1d(block.mesh.surface_nodes, block.fixed_nodes))
    for name in ("SuperLU", *(peer for peer in bench.PACKAGES if peer not in bench.missing_peers())):
        wall, cpu = bench.PEERS[name](system, system.columns[:10])
        assert wall > 0
        assert cpu > 0
    assert (bench.palpate_columns(block)[0] > 0).all()


def test_plot_json_and_table(tmp_path, capsys):
    bench.plot(results(), tmp_path / "curves.png")
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    show(True, results())
    data = json.loads(capsys.readouterr().out)
    assert data["rows"][0]["method"] == "Palpate"
    assert data["machine"]["cpus"] >= 1
    first = bench.as_tables([result for result in results() if result.surface_dofs == 2181])[0]
    assert first.title.endswith("1 thread")
    # Palpate takes a hundredth of the other's time.
    assert [line[2] for line in first.lines] == ["1.000", "0.010"]
