"""A Dask cluster of processes on this machine."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import distributed

ROLES = ("SCHEDULER", "WORKER", "CLIENT")


@contextlib.contextmanager
def local_cluster(workers: int) -> Iterator[distributed.LocalCluster]:
    """Scheduler in this process, and workers of one thread each."""
    # Workers that are killed on purpose are not worth the library's warnings.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    before = os.environ.get("RAYON_NUM_THREADS")
    with distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0", silence_logs=logging.CRITICAL
    ) as cluster:
        yield cluster
    assert os.environ.get("RAYON_NUM_THREADS") == before


def certificates(folder: Path) -> dict[str, str]:
    """Make a certificate that signs itself: dask's configuration of it, as variables of the environment."""
    words = "req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=palpate -addext subjectAltName=IP:127.0.0.1".split()
    files = ["-keyout", folder / "node.key", "-out", folder / "node.pem"]
    subprocess.run(["openssl", *words, *files], check=True, capture_output=True)
    return certificates_in(folder)


def certificates_in(folder: Path) -> dict[str, str]:
    """The same of a certificate that is there."""
    cert, key = folder / "node.pem", folder / "node.key"
    prefix = "DASK_DISTRIBUTED__COMM__TLS__"
    roles = {f"{prefix}{role}__{kind}": path for role in ROLES for kind, path in (("CERT", cert), ("KEY", key))}
    return {name: str(path) for name, path in {f"{prefix}CA_FILE": cert, **roles}.items()}


@contextlib.contextmanager
def programs(folder: Path, tls: dict[str, str] | None = None) -> Iterator[tuple[str, subprocess.Popen]]:
    """Address and process of ``dask scheduler``, and one ``dask worker``, as a user starts them."""
    file = folder / "scheduler.json"
    started: list[subprocess.Popen] = []

    def start(*words: str) -> None:
        command = [sys.executable, "-m", "dask", *words, "--no-dashboard"]
        environment = {**os.environ, **(tls or {})}
        started.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment))

    protocol = ["--protocol", "tls"] if tls else []
    start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file), *protocol)
    try:
        until, address = time.monotonic() + 60, ""
        while not address and time.monotonic() < until:
            time.sleep(0.05)
            with contextlib.suppress(OSError, ValueError):  # not written yet, or not all of it
                address = json.loads(file.read_text())["address"]
        start("worker", address, "--nthreads", "1", "--no-nanny")
        yield address, started[0]
    finally:
        for process in started:
            process.kill()
            process.wait()
