"""The package without what Linux alone has: what macOS or Windows lack is taken away, from child processes too."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Python imports it at its start.
WITHOUT = """
import asyncio.unix_events, os, pathlib, sys
sys.modules["fcntl"] = None
del os.sched_getaffinity, os.sched_setaffinity, os.killpg
def refuse(*_):
    raise NotImplementedError
asyncio.unix_events._UnixSelectorEventLoop.add_signal_handler = refuse
exists, read = pathlib.Path.exists, pathlib.Path.read_text
def is_hidden(path):
    return str(path).startswith("/proc/")
def read_text(path, *arguments, **options):
    if is_hidden(path):
        raise FileNotFoundError(path)
    return read(path, *arguments, **options)
pathlib.Path.exists = lambda path, **options: not is_hidden(path) and exists(path, **options)
pathlib.Path.read_text = read_text
"""


@pytest.fixture(scope="module")
def environment(cache, tmp_path_factory):
    folder = tmp_path_factory.mktemp("other")
    (folder / "sitecustomize.py").write_text(WITHOUT)
    return {**os.environ, "PYTHONPATH": str(folder), "XDG_CACHE_HOME": str(cache)}


@pytest.mark.slow
def test_meshes_solves_and_presses(environment, tmp_path):
    for words in (
        ["mesh", ROOT / "examples/block.obj", tmp_path / "block.vtu", "--unit", "mm"],
        ["info", ROOT / "examples/block.obj", "--unit", "mm"],
        ["cache", "list"],
        ["demo", "--paper", "--headless", "1"],
    ):
        command = [sys.executable, "-m", "palpate", *map(str, words)]
        ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment)
        assert ended.returncode == 0, (words, ended.stderr)
    assert "N" in ended.stdout and (tmp_path / "liver-paper.csv").exists()


@pytest.mark.slow
def test_the_server_ends_by_an_interrupt(environment):
    words = [sys.executable, "-m", "palpate", "demo", "--paper", "--port", "0", "--no-browser"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert any("http://" in line for line in process.stdout)
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
