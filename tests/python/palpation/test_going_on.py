"""A palpation that is interrupted goes on from what is finished, and ends as if it had not been."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
from palpated import TOP, block_body, scene_of

import palpate
from palpate.palpation import runs, stiffness_map
from palpate.palpation.runs import MARK


def interrupted(block, partial, after: int) -> None:
    def stop(done: int, _total: int) -> None:
        if done == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stiffness_map(block, "20mm", "0.3mm", on=TOP, partial=partial, progress=stop)


@pytest.fixture(scope="module")
def whole(block):
    return stiffness_map(block, "20mm", "0.3mm", on=TOP)


def test_finished_presses_are_not_made_again(block, whole, tmp_path):
    partial = tmp_path / "kept.partial"
    interrupted(block, partial, 4)
    size = partial.stat().st_size
    seen = []

    def note(done: int, total: int) -> None:
        seen.append((done, total, partial.stat().st_size))

    again = stiffness_map(block, "20mm", "0.3mm", on=TOP, partial=partial, progress=note)
    assert again.resumed == 4 and again == whole
    assert [now[:2] for now in seen] == [(k, 9) for k in range(1, 10)]
    assert [now[2] for now in seen[:4]] == 4 * [size] and seen[4][2] > size


def test_what_a_killed_process_left_half_written_is_made_again(block, whole, tmp_path):
    partial = tmp_path / "kept.partial"
    interrupted(block, partial, 4)
    content = partial.read_bytes()
    press = (len(content) - len(MARK) - 64) // 4
    third = bytearray(content)
    third[-2 * press + 20] ^= 1
    for damaged, known in ((content[:-7], 3), (bytes(third), 2), (b"", 0)):
        partial.write_bytes(damaged)
        again = stiffness_map(block, "20mm", "0.3mm", on=TOP, partial=partial)
        assert again.resumed == known and again == whole


def test_zeros_that_a_power_loss_left_are_no_press(block, whole, tmp_path):
    partial = tmp_path / "kept.partial"
    interrupted(block, partial, 4)
    partial.write_bytes(partial.read_bytes() + bytes(4096))
    again = stiffness_map(block, "20mm", "0.3mm", on=TOP, partial=partial)
    assert again.resumed == 4 and again == whole


def test_laws_and_modes_belong_to_the_key_of_a_palpation(tmp_path):
    """A store holds constants at small strain only, and the key of modes is that of all that were computed."""
    plain = block_body()
    other = palpate.Body(plain.mesh, material=palpate.Material(10e3, 0.45, law="neo-hookean"), fixed=plain.fixed_nodes)
    laws = [runs._laws_of(SimpleNamespace(body=body)) for body in (plain, other, None)]
    assert len(set(laws)) == 3
    basis = palpate.modes(plain, 4, path=tmp_path / "block.modes.palpate", progress=False)
    motions = [SimpleNamespace(basis=b, scheme=1, exact=True, coupling=None) for b in (basis, basis.first(3))]
    assert runs._motion_of(motions[0]) != runs._motion_of(motions[1])


@pytest.mark.parametrize("change", ["depth", "tool", "grid"])
def test_presses_of_another_palpation_are_not_used(block, store, tmp_path, change):
    partial = tmp_path / "kept.partial"
    interrupted(block, partial, 4)
    scene = scene_of(store, radius=5e-3) if change == "tool" else block
    grid, depth = ("25mm" if change == "grid" else "20mm"), ("0.4mm" if change == "depth" else "0.3mm")
    assert stiffness_map(scene, grid, depth, on=TOP, partial=partial).resumed == 0
    # From then on it is this palpation's.
    assert stiffness_map(scene, grid, depth, on=TOP, partial=partial).resumed > 0


@pytest.mark.slow
def test_a_command_that_is_interrupted_leaves_the_same_files(store, tmp_path):
    # So many presses that most are still to be made when the signal comes.
    words = ["map", str(store), "--grid", "10mm", "--depth", "0.5mm", "--speed", "1mm/s", "--radius", "4mm"]
    command = [sys.executable, "-m", "palpate", *words, "--on", TOP, "--out"]
    # A shell's background job is born with Ctrl-C ignored.
    heeding = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.default_int_handler)}
    process = subprocess.Popen([*command, str(tmp_path / "resumed")], stderr=subprocess.PIPE, text=True, **heeding)
    partial, end = tmp_path / "resumed" / "palpation.partial", time.monotonic() + 60
    while time.monotonic() < end and not (partial.exists() and partial.stat().st_size > 1000):
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    output = process.communicate(timeout=60)[1]
    assert process.returncode == 130, output
    assert "the same command continues" in output and "Traceback" not in output
    assert output.count("interrupted") == 1
    assert [path.name for path in (tmp_path / "resumed").iterdir()] == ["palpation.partial"]
    for name in ("resumed", "whole"):
        done = subprocess.run([*command, str(tmp_path / name)], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        assert ("known" in done.stdout) is (name == "resumed")
    files = sorted(path.name for path in (tmp_path / "whole").iterdir())
    assert files == ["curves.csv", "curves.png", "points.csv", "stiffness.png", "stiffness.vtu"]
    for name in files:
        assert (tmp_path / "resumed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
