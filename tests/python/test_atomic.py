"""Files and folders appear whole or not at all, and nothing that is no file is replaced by one."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import stat
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
from command_line import refused, run
from conftest import box_mesh

import palpate
from palpate import _native, atomic
from palpate.atomic import folder_beside, written_beside


@pytest.fixture
def mesh_file(tmp_path):
    box_mesh(cells=(2, 2, 2)).write(tmp_path / "box.vtu")
    return tmp_path


@pytest.fixture
def strange(tmp_path):
    """What is there under the name of an output, and is no file."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(os.path.relpath(tmp_path / "socket"))
        kinds = {"pipe": "a pipe", "folder": "a folder", "socket": "a socket"}
        with contextlib.suppress(PermissionError):  # only root makes devices
            os.mknod(tmp_path / "null", stat.S_IFCHR | 0o666, os.makedev(1, 3))
            kinds["null"] = "a device"
        yield kinds


def test_what_is_no_regular_file_is_not_replaced(tmp_path, strange):
    for name, kind in strange.items():
        with (
            pytest.raises(palpate.Error, match=f"{name} is {kind}, no file that can be replaced: give another name"),
            written_beside(tmp_path / name),
        ):
            pytest.fail("nothing is written")
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(strange)


def test_commands_refuse_what_is_no_regular_file(mesh_file, strange):
    make = ("precompute", "box.vtu", "--fix", "z < 1mm", "-o")
    for name in ("pipe.palpate", "pipe.vtu"):
        (mesh_file / name).symlink_to("pipe")
    refused(run(*make, "pipe.palpate", cwd=mesh_file), "pipe.palpate is a pipe")
    refused(run("mesh", "box.vtu", "pipe.vtu", cwd=mesh_file), "pipe.vtu is a pipe")
    body = palpate.Body(box_mesh(cells=(2, 2, 2)), material=palpate.Material(1e4, 0.4), fixed=[0, 1, 2, 3])
    with pytest.raises(palpate.StoreError, match="socket is a socket"):
        palpate.precompute(body, path=mesh_file / "socket", progress=False)


def test_the_target_of_a_symbolic_link_is_replaced_in_its_folder(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    for made_before in (True, False):
        target, link = tmp_path / "elsewhere" / f"{made_before}.txt", tmp_path / f"{made_before}.link"
        if made_before:
            target.write_text("old")
        link.symlink_to(target)
        with written_beside(link) as partial:
            assert partial.parent == target.parent
            partial.write_text("new")
        assert link.is_symlink() and target.read_text() == "new"
    body = palpate.Body(box_mesh(cells=(2, 2, 2)), material=palpate.Material(1e4, 0.4), fixed=lambda p: p[:, 2] < 1e-9)
    link, target = tmp_path / "a.palpate", tmp_path / "elsewhere" / "b.palpate"
    link.symlink_to(target)
    green = palpate.precompute(body, path=link, progress=False)
    assert link.is_symlink() and palpate.GreensFunction.load(target).key == green.key
    green.save(link)
    assert link.is_symlink() and sorted(os.listdir(target.parent)) == ["False.txt", "True.txt", "b.palpate"]
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with pytest.raises(palpate.Error, match="circle: "), written_beside(tmp_path / "circle"):
        pytest.fail("nothing is written")


def written(folder, text: str) -> None:
    with folder_beside(folder) as partial:
        (partial / "a.txt").write_text(text)


@pytest.mark.parametrize("exchanges", [True, False], ids=["one step", "two renames"])
def test_a_folder_is_replaced(tmp_path, exchanges, monkeypatch):
    if not exchanges:
        monkeypatch.setattr(_native, "exchange", lambda one, other: False)
    for text in ("old", "new"):
        written(tmp_path / "out", text)
        assert (tmp_path / "out" / "a.txt").read_text() == text and os.listdir(tmp_path) == ["out"]


@pytest.mark.parametrize("fails", [OSError, KeyboardInterrupt])
def test_a_folder_is_there_when_its_replacement_is_interrupted(tmp_path, fails, monkeypatch):
    monkeypatch.setattr(_native, "exchange", lambda one, other: False)
    written(tmp_path / "out", "old")
    rename, calls = os.replace, []

    def interrupted(one, other):
        calls.append(other)
        if len(calls) == 2:
            raise fails
        rename(one, other)

    monkeypatch.setattr(atomic.os, "replace", interrupted)
    with pytest.raises(fails):
        written(tmp_path / "out", "new")
    assert (tmp_path / "out" / "a.txt").read_text() == "old"


def test_a_folder_that_a_killed_process_moved_away_is_put_back(tmp_path):
    gone = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    before = tmp_path / f".{gone.stdout.strip()}.out.before"
    before.mkdir()
    (before / "a.txt").write_text("old")
    with pytest.raises(ZeroDivisionError), folder_beside(tmp_path / "out"):
        assert (tmp_path / "out" / "a.txt").read_text() == "old"
        1 / 0  # noqa: B018
    assert os.listdir(tmp_path) == ["out"]


@pytest.mark.slow
def test_a_folder_is_there_whenever_its_writer_is_killed(tmp_path):
    program = """
        from pathlib import Path
        from palpate.atomic import folder_beside
        for k in range(10**9):
            with folder_beside(Path("out")) as partial:
                (partial / "a.txt").write_text("whole")
            print(k, flush=True)
    """
    random = np.random.default_rng(5)
    for _ in range(5):
        command = [sys.executable, "-c", textwrap.dedent(program)]
        writer = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE)
        assert writer.stdout.readline()
        end = time.monotonic() + random.uniform(0.05, 0.3)
        while time.monotonic() < end:
            assert (tmp_path / "out").is_dir()
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
        assert (tmp_path / "out" / "a.txt").read_text() == "whole"


def test_caches_of_a_store_with_a_similar_name_stay(tmp_path):
    names = [f"{stem}.{'0123456789abcdef'}.contact.palpate" for stem in ("organ", "organ.left")]
    for name in names:
        (tmp_path / name).touch()
    _native.forget_contacts(tmp_path / "organ.palpate")
    assert os.listdir(tmp_path) == names[1:]
