"""Devices of a scene: which tool has which, mistakes by their line, and limits of several of them."""

from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.scene.tables import tables_of_tools

SCENE = """[body]
model = "beam"
[[tool]]
device = "left"
[[tool]]
device = "haply"
[[device]]
name = "left"
kind = "touch"
rate = 500
[[device]]
kind = "haply"
max_force = "5N"
"""


def read(tmp_path, text: str) -> palpate.Scene:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return palpate.Scene.read(path)


def kinds(scene: palpate.Scene) -> list[str]:
    return [scene.device_of(tool).kind for tool in range(len(scene.tools))]


def test_tools_take_the_devices_they_name(tmp_path):
    scene = read(tmp_path, SCENE)
    assert kinds(scene) == ["touch", "haply"]
    assert [scene.device_of(tool).max_force for tool in (0, 1)] == [8.0, 5.0] and scene.device.rate == 500
    again = palpate.Scene(**scene.model_dump(mode="json", by_alias=True, exclude_unset=True))
    assert kinds(again) == kinds(scene) and again.additional_devices == scene.additional_devices


@pytest.mark.parametrize(
    ("device", "tools", "expected"),
    [
        ("", ["", ""], ["simulated", "simulated"]),
        ('[device]\nkind = "haply"', [""], ["haply"]),
        ('[device]\nkind = "haply"', ["", ""], ["haply", "simulated"]),
        ('[device]\nkind = "haply"', ["", 'device = "haply"'], ["simulated", "haply"]),
        ('[device]\nmax_force = "3N"', ['device = "touch"'], ["touch"]),
        ('[[device]]\nkind = "haply"\n[[device]]\nkind = "touch"', ["", ""], ["haply", "touch"]),
        ('[[device]]\nkind = "haply"\n[[device]]\nkind = "haply"', ['device = "haply"'] * 2, ["haply", "haply"]),
        (
            '[[device]]\nname = "a"\nkind = "haply"\n[[device]]\nkind = "touch"',
            ["", 'device = "a"'],
            ["simulated", "haply"],
        ),
    ],
)
def test_tools_that_name_none_take_the_tables_in_order(tmp_path, device, tools, expected):
    tables = "".join(f"[[tool]]\n{tool}\n" for tool in tools)
    assert kinds(read(tmp_path, f'[body]\nmodel = "beam"\n{tables}{device}\n')) == expected


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'device = "left"',
            'device = "lef"',
            ":4: tool.device: there is no device 'lef'; there are left, simulated, haply",
        ),
        ('device = "haply"', 'device = "left"', ":6: tool.device: tools 0 and 1 both have the device 'left'"),
        ('max_force = "5N"', "ramp = 1.0", ":13: device.ramp: ramp is of the whole loop"),
        ('max_force = "5N"', 'max_forze = "5N"', ":13: unknown key 'device.max_forze'; did you mean 'max_force'"),
        ('max_force = "5N"', 'name = "left"', ":13: device.name: two tables have the name 'left'"),
        (
            'kind = "touch"',
            'kind = "omega"',
            ":9: device.kind: must be 'simulated', 'haply', 'touch' or 'forcedimension'",
        ),
        ('max_force = "5N"', "scale = 0", ":13: device.scale"),
        ('max_force = "5N"', "orientation = [1, 1, 0, 0]", ":13: device.orientation: must be a unit quaternion"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path, old, new, message):
    with pytest.raises(palpate.SceneError) as error:
        read(tmp_path, SCENE.replace(old, new))
    assert message in str(error.value)


def test_tables_of_tools_keep_the_loop_in_the_first(tmp_path):
    scene = read(tmp_path, SCENE)
    left = tables_of_tools(scene, without=0)
    assert [(table.kind, table.rate, table.max_force) for table in left] == [("haply", 500.0, 5.0)]
    both = tables_of_tools(scene)
    assert [(table.kind, table.rate) for table in both] == [("touch", 500.0), ("haply", 1000.0)]


def test_each_device_keeps_its_own_force(block, block_green):
    tool = {"radius": 0.01, "contact": "patch", "contact_radius": 0.02}
    devices = [{"max_force": 0.8, "max_slew": 1e6, "ramp": 0}, {"max_force": 0.5}]
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=[tool, tool], device=devices, view={"strain_limit": 0})
    simulation = palpate.Simulation(palpate.scene.BuiltScene.of(scene, block, block_green))
    path = np.zeros((600, 2, 3))
    path[:, 0], path[:, 1] = (0.06, 0.015, 0.06), (0.06, 0.035, 0.06)
    path[:, :, 2] -= np.linspace(0, 0.03, 600)[:, None]
    largest = np.linalg.norm(simulation.run(path), axis=2).max(axis=0)
    assert np.allclose(largest, [0.8, 0.5])
    # Half the force for the hand: the scene may have twice as much.
    scaled = scene.model_copy(update={"device": scene.device.model_copy(update={"force_scale": 0.5})})
    largest = palpate.Simulation(palpate.scene.BuiltScene.of(scaled, block, block_green)).run(path)
    assert np.isclose(np.linalg.norm(largest[:, 0], axis=1).max(), 1.6)
