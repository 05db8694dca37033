"""`palpate run --igtl PORT` as a process: a client of OpenIGTLink moves the tool and receives its force."""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pyigtl = pytest.importorskip("pyigtl")
BLOCK = Path(__file__).parents[3] / "examples" / "block.toml"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def running(*options, cwd, scene=BLOCK):
    program = "from palpate.cli import main; main()"
    command = [sys.executable, "-c", program, "run", str(scene), "--no-browser", *options]
    with (Path(cwd) / "output").open("wb") as output:
        process = subprocess.Popen(command, cwd=cwd, stdout=output, stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(60)
        process.kill()
        process.wait()


def wait_for_port(port: int, process, folder) -> None:
    end = time.monotonic() + 120
    while time.monotonic() < end:
        assert process.poll() is None, (folder / "output").read_text()
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
            return
        time.sleep(0.2)
    raise AssertionError("the port did not open")


@pytest.mark.slow
def test_a_client_of_the_command_feels_the_block(tmp_path, shared_cache):
    port, page = free_port(), free_port()
    with running("--igtl", str(port), "--port", str(page), cwd=tmp_path) as process:
        wait_for_port(port, process, tmp_path)
        client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)
        try:
            force, end = 0.0, time.monotonic() + 60
            while force < 0.02 and time.monotonic() < end:
                pose = np.eye(4)
                pose[:3, 3] = (40.0, 25.0, 53.0)
                client.send_message(pyigtl.TransformMessage(pose, device_name="Tool"))
                message = client.wait_for_message("Force", timeout=5)
                force = json.loads(message.string)["force_N"][0][2] if message is not None else 0.0
            assert force >= 0.02
        finally:
            client.stop()


@pytest.mark.slow
def test_without_the_option_no_port_is_open(tmp_path, shared_cache):
    port, page = free_port(), free_port()
    (tmp_path / "beam.toml").write_text('[body]\nmodel = "beam"\npaper = true\n')
    with running("--port", str(page), cwd=tmp_path, scene=tmp_path / "beam.toml") as process:
        wait_for_port(page, process, tmp_path)
        with pytest.raises(OSError), socket.create_connection(("127.0.0.1", port), 1):
            pass
