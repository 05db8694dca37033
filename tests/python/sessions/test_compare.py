"""What differs between two recordings, against differences that were made on purpose."""

from __future__ import annotations

import json

import numpy as np
import pytest
from command_line import refused
from sessions_scene import STRIKE, built_of, called, path, scene_of

import palpate


def test_the_same_script_gives_the_same(recording, built):
    found = palpate.compare(recording, palpate.Simulation(built).play(*path(), strikes=[STRIKE]))
    assert found.same and found.first is None and found.settings == ()
    assert found.ticks == 300 and len(found.quantities) > 20


@pytest.fixture(scope="module")
def slippery(built):
    """The same hand with another friction from tick 0."""
    simulation = palpate.Simulation(built)
    simulation.set_friction(0.1, tool=0)
    return simulation.play(*path(), strikes=[STRIKE])


def test_differences_are_those_of_the_arrays(recording, slippery):
    found = palpate.compare(recording, slippery)
    assert not found.same and not found.first.is_input
    rows = {(row.of, row.quantity): row for row in found.quantities}
    difference = np.linalg.norm(recording.forces - slippery.forces, axis=2)[:, 0]
    force = rows["tool 0", "force"]
    assert force.largest == pytest.approx(difference.max()) and force.tick == difference.argmax()
    assert force.rms == pytest.approx(np.sqrt((difference**2).mean())) and force.time == recording.time[force.tick]
    assert force.first == np.flatnonzero((recording.forces != slippery.forces)[:, 0].any(axis=1))[0]
    assert rows["tool 0", "position"].first is None
    total = [np.zeros((300, 3)) for _ in range(2)]
    for sums, one in zip(total, (recording, slippery), strict=True):
        for contact in one.contacts[one.contacts["tool"] == 0]:
            sums[contact["tick"]] += contact["force"]
    assert rows["tool 0", "force of the contacts"].largest == pytest.approx(
        np.linalg.norm(total[0] - total[1], axis=1).max()
    )
    work = np.abs(recording.energy.work - slippery.energy.work)
    assert rows["body 0", "work"].largest == pytest.approx(work.max())
    assert found.settings == (("friction from tick 0 on", [0.3, 0.3], [0.1, 0.3]),)


def test_an_input_that_differs_is_told_as_one(recording, built):
    moved, turned = path()
    moved[150:, 0, 2] -= 1e-5
    other = palpate.Simulation(built).play(moved, turned, strikes=[STRIKE])
    first = palpate.compare(recording, other).first
    assert (first.first, first.of, first.quantity, first.is_input) == (150, "tool 0", "position", True)
    shorter = palpate.Simulation(built).play(moved[:120], turned[:120], strikes=[STRIKE])
    found = palpate.compare(recording, shorter)
    assert found.counts == (300, 120) and found.ticks == 120 and found.first is None and not found.same


def test_a_hand_in_the_same_scene_feels_the_same_and_in_another_what_it_would_have_felt(
    recording, built, block, block_green
):
    assert palpate.compare(recording, palpate.rerun(recording, built)).same
    tools = [tool.model_dump(exclude_unset=True) for tool in scene_of().tools]
    tools[0]["friction"] = 0.1
    other = built_of(scene_of(tool=tools), block, block_green)
    felt = palpate.rerun(recording, other)
    assert felt == palpate.Simulation(other).play(*path(), strikes=[STRIKE])
    found = palpate.compare(recording, felt)
    assert ("tool[0].friction", 0.3, 0.1) in found.settings
    with pytest.raises(palpate.SceneError, match="the recording has 2 tools, the scene 1"):
        palpate.rerun(recording, built_of(scene_of(tool={"radius": 0.006}), block, block_green))


def test_the_command_ends_as_diff_does(file, recording, slippery, block, block_green, tmp_path, monkeypatch, capsys):
    def command(*words):
        return called(monkeypatch, capsys, "compare", file, *words)

    monkeypatch.chdir(tmp_path)
    slippery.save(tmp_path / "slippery.mcap")
    result = command("slippery.mcap", "--out", "plots", "--json")
    assert result.returncode == 1, result
    data = json.loads(result.stdout)
    assert data["first"] == palpate.compare(recording, slippery).first.first and not data["same"]
    assert (tmp_path / "plots" / "press-slippery.png").stat().st_size > 10_000
    table = command("slippery.mcap")
    assert table.returncode == 1 and f"first difference: tick {data['first']}, " in table.stdout
    named = scene_of(body={"store": "block.palpate", "name": "Größe"})
    palpate.Simulation(built_of(named, block, block_green)).play(*path()).save(tmp_path / "named.mcap")
    assert "body[0].name: not given and Größe" in command("named.mcap").stdout
    assert '"b": "Größe"' in command("named.mcap", "--json").stdout
    same = command(file)
    assert same.returncode == 0 and "the same bits in all 300 ticks" in same.stdout
    refused(command(), "two recordings, or one and --scene")
    refused(command("none.mcap"), "none.mcap: no such file")
