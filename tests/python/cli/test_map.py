"""`palpate map` as a user types it: its results, and error messages of one line."""

from __future__ import annotations

import csv

import pytest
from command_line import run
from palpated import TOP, block_body

import palpate
from palpate.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("palpate")
    palpate.precompute(block_body(), precision="f32", path=folder / "block.palpate")
    return folder


def test_a_grid_is_pressed_and_written(folder):
    words = ("map", "block.palpate", "--grid", "20mm", "--depth", "1mm", "--radius", "4mm", "--on", TOP)
    result = run(*words, cwd=folder)
    assert result.returncode == 0, result.stderr
    assert "9 points" in result.stdout and "stiffness at 1 mm: from" in result.stdout
    with (folder / "block-palpation" / "points.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 9 and all(40 < float(row["stiffness_N_per_m"]) < 55 for row in rows)
    assert not list((folder / "block-palpation").glob("*.partial"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--grid", "10parsec", "--depth", "1mm"), ("--grid", "unknown unit 'parsec'", "mm")),
        (("--grid", "10mm", "--depth", "3N"), ("--depth", "unknown unit 'N'")),
        (("--grid", "10mm", "--depth", "1mm", "--speed", "5mm"), ("--speed", "unknown unit 'mm'", "mm/s")),
        (("--grid", "10mm", "--depth=-1mm"), ("--depth must be positive",)),
        (("--grid", "20cm", "--depth", "1mm"), ("a grid of 200 mm is wider than the body of 60 x 60 x 40 mm",)),
        (("--grid", "10mm", "--depth", "5mm"), ("a depth of 5 mm is beyond the tool, whose radius is 3.75 mm",)),
        (("--grid", "10mm", "--depth", "1mm", "--speed", "1m/s"), ("takes fewer than 20 ticks", "at most 50 mm/s")),
        (("--grid", "10mm", "--depth", "1mm", "--on", "z >"), ("cannot read the predicate",)),
        (("--grid", "10mm", "--depth", "1mm", "--on", "z > 1m"), ("no point to press where z > 1m",)),
        (("--grid", "10mm", "--depth", "1mm", "--against", "no.toml"), ("no.toml: no such file",)),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(folder, words, message, monkeypatch, capsys):
    complaint(["map", "block.palpate", *words, "--out", "refused"], message, folder, monkeypatch, capsys)
    assert not (folder / "refused").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("map", "no.stl"), ("no.stl: no such file",)),
        (("map", "lung"), ("lung: no such file", "models are doll, kidney, liver, beam")),
        (("map", "liver", "--unit", "mm"), ("--unit is not for this file",)),
    ],
)
def test_what_is_not_there_is_refused(folder, words, message, monkeypatch, capsys):
    complaint([*words, "--grid", "10mm", "--depth", "1mm"], message, folder, monkeypatch, capsys)


def test_a_map_that_is_none_is_refused(folder, monkeypatch, capsys):
    complaint(["run", "block.palpate", "--map", "no.vtu"], ("no.vtu: no such file",), folder, monkeypatch, capsys)
    (folder / "text.vtu").write_text("no mesh")
    message = ("text.vtu: not a map that can be read",)
    complaint(["run", "block.palpate", "--map", "text.vtu"], message, folder, monkeypatch, capsys)


def complaint(words, message, folder, monkeypatch, capsys) -> None:
    """The command ends with code 2 and one line; in this process, for it is quick to refuse."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["palpate", *words])
    with pytest.raises(SystemExit) as stop:
        main()
    lines = capsys.readouterr().err.strip().splitlines()
    assert stop.value.code == 2 and len(lines) == 1, lines
    for word in message:
        assert word in lines[0], lines[0]
