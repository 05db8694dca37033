"""`python -m benches`: a checkout has it, the installed program does not; a mistake is one line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import run, run_bench

ROOT = Path(__file__).parents[3]
NAMES = {"tick", "contact", "scale", "precompute", "surface", "elements", "paper", "dynamics", "record", "viewer"}
NAMES |= {"zwidth", "touches", "web"}


@pytest.mark.slow
def test_every_benchmark_is_listed():
    listed = run_bench("--help").stdout
    assert set(listed[listed.index("Commands:") :].split()) >= NAMES
    command = [sys.executable, "-m", "benches", "scale", "--sizes", "many"]
    refused = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert refused.returncode == 2
    assert refused.stderr.splitlines()[-1].startswith("palpate: error: 'many' is no number of tetrahedra")


def test_the_installed_program_has_no_benchmarks(tmp_path):
    result = run("bench", "paper", cwd=tmp_path)
    assert result.returncode == 2
    assert "No such command 'bench'" in result.stderr


@pytest.mark.slow
def test_the_method_of_the_paper_gives_the_same_forces():
    """Both methods answer the same contact: the dense inverse is the outside value."""
    result = run_bench("paper", "--json")
    assert result.exit_code == 0
    rows = json.loads(result.stdout)["rows"]
    assert [row["model"] for row in rows] == ["doll", "kidney", "liver"]
    assert all(row["difference"] < 1e-5 for row in rows)
