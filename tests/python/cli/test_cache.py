"""The cache from the command line."""

from __future__ import annotations

import json
import os
import subprocess
import sys

from command_line import refused, run

import palpate
from palpate.cache import cache_directory


def test_cache_is_listed_by_name_size_date_and_what_it_is_and_cleared_one_by_one(block, tmp_path):
    green = palpate.precompute(block)
    soft = palpate.Body(block.mesh, material=palpate.Material(5e3, 0.4), fixed=block.fixed_mask)
    other = palpate.precompute(soft, precision="f16")
    palpate.modes(block, 3)
    palpate.Simulation(palpate.scene.BuiltScene.of(palpate.Scene(body={"store": "block.palpate"}), block, green))
    gone = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    folder = green.path.parent
    left = folder / f"{'0' * 32}.palpate.{gone.stdout.strip()}.new"
    left.write_bytes(b"x" * 2_000_000)
    also_left = folder / f"{'3' * 32}.0123456789abcdef.contact.palpate.{gone.stdout.strip()}.partial"
    also_left.write_bytes(b"w")
    (folder / f"{'1' * 32}.palpate.{os.getpid()}.new").write_bytes(b"y")
    (folder / f"{'2' * 32}.palpate.partial").write_bytes(b"z")
    listed = run("cache", "list", cwd=tmp_path).stdout.splitlines()
    assert listed[-1].startswith("8 files, ") and "2 of them leftovers" in listed[-1] and str(folder) in listed[-1]
    lines = {line.split()[0]: line for line in listed[:-1]}
    mine = lines[f"{green.path.stem[:12]}.palpate"]
    assert f"{green.path.stat().st_size / 1e6:.1f} MB" in mine and "10 kPa" in mine and "f32" in mine
    assert f"{len(block.mesh.nodes)} nodes" in mine and "-" in mine.split("MB")[1].split()[0]
    assert "5 kPa" in lines[f"{other.path.stem[:12]}.palpate"] and "f16" in lines[f"{other.path.stem[:12]}.palpate"]
    assert sum("what a tool needs to know" in line for line in lines.values()) == 1
    assert sum("modes" in line for line in lines.values()) == 1
    assert "2.0 MB" in lines[f"{'0' * 12}.palpate.{gone.stdout.strip()}.new"]
    assert "killed process" in lines[f"{'0' * 12}.palpate.{gone.stdout.strip()}.new"]
    assert "being written" in lines[f"{'1' * 12}.palpate.{os.getpid()}.new"]
    assert "interrupted" in lines[f"{'2' * 12}.palpate.partial"]
    assert "deleted 2 files, 2.0 MB" in run("cache", "clear", "--leftovers", cwd=tmp_path).stdout
    assert not left.exists() and not also_left.exists()
    assert "deleted 1 file" in run("cache", "clear", other.path.stem[:8], cwd=tmp_path).stdout
    assert green.path.exists() and not other.path.exists()
    refused(run("cache", "clear", "organ", cwd=tmp_path), "no file in the cache is called 'organ'", "cache list")
    assert "deleted 5 files" in run("cache", "clear", cwd=tmp_path).stdout
    assert run("cache", "list", cwd=tmp_path).stdout.startswith("0 files")


def test_files_of_series_are_listed_as_what_they_are(tmp_path):
    folder = cache_directory()
    folder.mkdir(parents=True)
    header = json.dumps({"__metadata__": {"format": "palpate-series"}}).encode()
    (folder / f"{'4' * 32}.0123456789abcdef.series.palpate").write_bytes(len(header).to_bytes(8, "little") + header)
    listed = run("cache", "list", cwd=tmp_path).stdout.splitlines()
    assert listed[0].endswith("series beyond small strain of the store with the same beginning")
