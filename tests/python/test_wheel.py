"""The wheel: small, with the page inside, installed and used where there is neither a compiler nor Rust nor Node."""

from __future__ import annotations

import csv
import os
import re
import shutil
import socket
import subprocess
import sys
import urllib.request
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "python/palpate/viewer/static/index.html"

pytestmark = [
    pytest.mark.slow,
    # Alone, without another test before it, it compiles all crates.
    pytest.mark.timeout(1800),
    pytest.mark.skipif(shutil.which("cargo") is None, reason="cargo is not installed"),
    pytest.mark.skipif(not PAGE.exists(), reason="the page is not built: make viewer"),
]


def run(*command: object, **options) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def tools(tmp_path_factory) -> Path:
    """Python of an environment with what builds and examines wheels."""
    where = tmp_path_factory.mktemp("tools")
    venv.create(where, with_pip=True)
    run(where / "bin/python", "-m", "pip", "install", "--quiet", "maturin>=1.9,<2", "auditwheel>=6", timeout=300)
    return where / "bin/python"


@pytest.fixture(scope="module")
def wheel(tools, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("dist")
    # As `make wheel` does: all that is compiled for the tests serves, but for the bindings.
    run(tools, "-m", "maturin", "build", "--release", "--strip", "--quiet", "--out", out, cwd=ROOT, timeout=1500)
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def bare(wheel, tmp_path_factory) -> dict[str, str]:
    """Environment variables under which there is the wheel, and no program but those that its packages bring."""
    where = tmp_path_factory.mktemp("bare")
    venv.create(where / "venv", with_pip=True)
    variables = {name: value for name, value in os.environ.items() if re.match(r"PIP_|https?_proxy|SSL_", name, re.I)}
    variables |= {"PATH": str(where / "venv/bin"), "HOME": str(where), "XDG_CACHE_HOME": str(where / "cache")}
    cache = run(sys.executable, "-m", "pip", "cache", "dir").strip()
    assert not any(shutil.which(tool, path=variables["PATH"]) for tool in ("cc", "gcc", "cargo", "node", "npm"))
    # Only wheels: what would have to be compiled is refused.
    install = ("-m", "pip", "install", "--quiet", "--no-compile", "--only-binary", ":all:", "--cache-dir", cache, wheel)
    run(where / "venv/bin/python", *install, env=variables, timeout=600)
    return variables


def installed(bare: dict[str, str]) -> Path:
    return Path(bare["PATH"]) / "palpate"


def test_a_wheel_is_small_complete_and_for_every_python(tools, wheel):
    result = run(tools, ROOT / "scripts/check_wheel.py", wheel)
    assert f"{wheel.stat().st_size / 1e6:.1f} MB" in result
    if sys.platform == "linux":
        assert "is consistent with the following platform tag" in re.sub(r"\s+", " ", result)


def test_an_empty_environment_without_a_compiler_presses_on_the_liver(bare, tmp_path):
    version = re.search(r'^version = "(.*)"', (ROOT / "Cargo.toml").read_text(), re.MULTILINE)[1]
    assert run(installed(bare), "--version", env=bare, timeout=60) == f"palpate {version}\n"
    result = run(installed(bare), "demo", "--headless", "1", env=bare, cwd=tmp_path, timeout=250)
    assert re.search(r"largest force 0\.[1-9]\d* N", result), result
    with open(tmp_path / "liver.csv", newline="") as log:
        assert len(list(csv.reader(log))) > 900


def test_an_empty_environment_serves_the_page(bare, tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = (installed(bare), "demo", "--no-browser", "--port", str(port))
    with subprocess.Popen(command, env=bare, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as server:
        try:
            address = next(found for line in server.stdout if (found := re.search(r"http://\S+", line)))
            with urllib.request.urlopen(address[0].split("#")[0], timeout=20) as page:
                assert page.read() == PAGE.read_bytes()
        finally:
            server.terminate()
