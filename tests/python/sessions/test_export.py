"""Recordings as tables, time series, animations and films, each read back by another program's reader."""

from __future__ import annotations

import csv
import subprocess
import sys
from xml.etree import ElementTree

import meshio
import numpy as np
import pygltflib
import pytest
import trimesh
from command_line import refused, run
from sessions_scene import called, path

import palpate
from palpate.scene import BuiltScene
from palpate.sessions.frames import RecordedFrames, Span
from palpate.sessions.shapes import tools_of
from palpate.vectors import rotated, turning_z_to

RATE = 20.0


def read(path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return dict(zip(header, zip(*rows, strict=True), strict=True))


@pytest.fixture(scope="module")
def tables(recording, tmp_path_factory):
    return palpate.export(recording, tmp_path_factory.mktemp("tables") / "press.csv")


def test_a_table_has_a_row_for_every_tick_to_the_bit(tables, recording):
    columns = read(tables[0])
    assert np.array_equal(np.array(columns["tick"], int), recording.ticks)
    assert np.array_equal(np.array(columns["time_s"], float), recording.time)
    for name, values in (("force", recording.forces), ("position", recording.positions)):
        unit = {"force": "N", "position": "m"}[name]
        for tool in range(2):
            read_back = [np.array(columns[f"tool{tool}_{name}_{axis}_{unit}"], float) for axis in "xyz"]
            assert np.array_equal(np.stack(read_back, axis=1), values[:, tool])
    assert np.array_equal(np.array(columns["tool1_active"], int), recording.active[:, 1])
    assert np.array_equal(np.array(columns["body0_work_J"], float), recording.energy.work)
    assert [(tick, text) for tick, text in enumerate(columns["events"]) if text] == list(recording.events)


def test_contacts_have_a_table_of_their_own(tables, recording):
    columns, rows = read(tables[1]), recording.contacts
    assert tables[1].name == "press-contacts.csv"
    assert np.array_equal(np.array(columns["tick"], int), rows["tick"])
    for axis, part in enumerate("xyz"):
        assert np.array_equal(np.array(columns[f"force_{part}_N"], "f4"), rows["force"][:, axis])
    assert np.array_equal(np.array(columns["stiffness_N_per_m"], "f4"), rows["stiffness"])


def test_parquet_has_the_same_columns_and_tells_what_was_recorded(tables, recording, tmp_path):
    import pyarrow.parquet

    written = palpate.export(recording, tmp_path / "press.parquet", start=0.1, end=0.2)
    table = pyarrow.parquet.read_table(written[0])
    assert table.column_names == list(read(tables[0]))
    assert np.array_equal(table["tool0_force_z_N"].to_numpy(), recording.forces[99:200, 0, 2])
    assert table.schema.metadata[b"palpate.version"].decode() == palpate.__version__
    contacts = pyarrow.parquet.read_table(written[1])
    assert contacts["tick"].to_numpy().min() >= 99 and contacts["tick"].to_numpy().max() <= 199


@pytest.fixture(scope="module")
def frames(recording, built) -> list:
    """What is to be seen: frames of the recording, made again."""
    return list(RecordedFrames(recording, Span(rate=RATE), built))


def test_frames_are_those_of_the_recorded_ticks(frames, recording):
    assert [frame.row for frame in frames] == list(range(0, 300, 50))
    for frame in frames:
        assert np.array_equal(frame.frame.forces, recording.forces[frame.row])
        assert frame.time == recording.time[frame.row]
        assert np.array_equal(frame.present, recording.active[frame.row])


def test_a_time_series_for_paraview(frames, recording, built, tmp_path):
    written = palpate.export(recording, tmp_path / "press.pvd", rate=RATE, scene=built)
    assert sorted(tmp_path.iterdir()) == written == [tmp_path / "press.pvd", tmp_path / "press_frames"]
    listed = ElementTree.parse(written[0]).getroot().findall("Collection/DataSet")
    assert len(listed) == 2 * len(frames)
    for rank, recorded in enumerate(frames):
        body, tools = (meshio.read(tmp_path / entry.get("file")) for entry in listed[2 * rank : 2 * rank + 2])
        assert float(listed[2 * rank].get("timestep")) == recorded.time
        surface = recorded.frame.bodies[0].surface_in_scene()
        assert np.array_equal(body.point_data["displacement"], surface.displacements)
        assert np.allclose(body.points - body.point_data["displacement"], surface.positions, atol=1e-15)
        assert np.array_equal(tools.point_data["force"][:2], recorded.frame.forces)
        assert not tools.point_data["force"][2:].any(), "a glyph draws one arrow a tool"
        ball = tools.points[2:][tools.point_data["tool"][2:] == 0]
        assert np.allclose(np.linalg.norm(ball - recorded.frame.positions[0], axis=1), 0.006)
        capsule = tools.points[2:][tools.point_data["tool"][2:] == 1]
        assert (np.ptp(capsule, axis=0).max() > 0.01) == recorded.present[1]


def test_a_time_series_replaces_an_earlier_one_and_nothing_else(recording, built, tmp_path):
    for end in (0.3, 0.1):
        palpate.export(recording, tmp_path / "press.pvd", rate=RATE, end=end, scene=built)
    assert len(list((tmp_path / "press_frames").iterdir())) == 4
    (tmp_path / "press_frames" / "notes.txt").write_text("mine")
    with pytest.raises(palpate.Error, match=r"press_frames: exists and contains other files than frames"):
        palpate.export(recording, tmp_path / "press.pvd", scene=built)


def test_an_animation_for_other_programs(frames, recording, built, tmp_path):
    """Displacements of each frame from the morph targets and weights, read by pygltflib; the scene by trimesh."""
    (file,) = palpate.export(recording, tmp_path / "press.glb", rate=RATE, scene=built)
    gltf = pygltflib.GLTF2().load_binary(file)
    data = gltf.binary_blob()

    def values(number: int) -> np.ndarray:
        accessor = gltf.accessors[number]
        view = gltf.bufferViews[accessor.bufferView]
        size = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
        dtype = {pygltflib.FLOAT: np.float32, pygltflib.UNSIGNED_INT: np.uint32}[accessor.componentType]
        return np.frombuffer(data, dtype, accessor.count * size, view.byteOffset).reshape(accessor.count, size)

    names = [node.name for node in gltf.nodes]
    tracks = {}
    for channel in gltf.animations[0].channels:
        sampler = gltf.animations[0].samplers[channel.sampler]
        assert np.allclose(values(sampler.input)[:, 0], [frame.time - frames[0].time for frame in frames], atol=1e-7)
        tracks[names[channel.target.node], channel.target.path] = values(sampler.output)
    (primitive,) = gltf.meshes[gltf.nodes[names.index("block")].mesh].primitives
    targets = np.stack([values(target["POSITION"]) for target in primitive.targets])
    weights = tracks["block", "weights"].reshape(len(frames), -1)
    assert weights.shape[1] == len(targets) and np.abs(weights).max() <= 1
    largest = 0.0
    for rank, recorded in enumerate(frames):
        surface = recorded.frame.bodies[0].surface_in_scene()
        moved = np.tensordot(weights[rank], targets, 1)
        assert np.allclose(moved, surface.displacements, atol=1.01e-4 * 0.08), "the tolerance that is stated"
        largest = max(largest, np.abs(surface.displacements).max())
        assert np.allclose(tracks["tool 0", "translation"][rank], recorded.frame.positions[0], atol=1e-7)
        assert tracks["tool 1", "scale"][rank].tolist() == [float(recorded.present[1])] * 3
        turned = tracks["tool 1", "rotation"][rank][[3, 0, 1, 2]]
        if recorded.present[1]:
            assert abs(turned @ recorded.frame.orientations[1]) == pytest.approx(1, abs=1e-6)
    assert largest > 1e-3
    scene = trimesh.load(file, force="scene")
    assert len(scene.geometry) == 5 and scene.bounds[1, 1] > 0.05, "y is up"


def test_a_body_that_nothing_touches_is_exported_too(built, tmp_path):
    recording = palpate.Simulation(built).play(np.tile([0.0, 0.0, 1.0], (100, 1)))
    (file,) = palpate.export(recording, tmp_path / "still.glb", rate=RATE, scene=built)
    gltf = pygltflib.GLTF2().load_binary(file)
    (mesh,) = [gltf.meshes[node.mesh] for node in gltf.nodes if node.name == "block"]
    assert not mesh.primitives[0].targets and not mesh.weights


def test_a_film_for_slides(recording, built, tmp_path):
    import imageio_ffmpeg

    (file,) = palpate.export(recording, tmp_path / "press.mp4", rate=10, scene=built)
    words = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", file, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    read = subprocess.run(words, capture_output=True, check=True)
    assert b"Video: h264" in read.stderr and b"1280x720" in read.stderr and b" 10 fps" in read.stderr
    pictures = np.frombuffer(read.stdout, np.uint8).reshape(-1, 720, 1280, 3)
    assert len(pictures) == 3
    change = np.abs(pictures[0].astype(int) - pictures[-1]).max(axis=2) > 60
    assert 1e-3 < change.mean() < 0.5, "the tools have moved, the background has not"


def test_a_shape_stands_where_the_force_loop_has_it(block, block_green):
    """The front of a capsule and of a punch along -z, as `ShapeTable` says."""
    tools = [
        {"shape": "capsule", "radius": 0.004, "length": 0.02},
        {"shape": "punch", "radius": 0.005, "rounding": 0.001},
        {"shape": "ellipsoid", "semi_axes": (0.003, 0.004, 0.005)},
    ]
    scene = palpate.Scene(body={"store": "block.palpate"}, tool=tools)
    capsule, punch, ellipsoid = tools_of(palpate.Simulation(BuiltScene.of(scene, block, block_green)))
    assert capsule.bounds[:, 2] == pytest.approx([-0.004, 0.024]) and capsule.is_volume
    assert punch.bounds[0] == pytest.approx([-0.005, -0.005, 0]) and punch.is_volume
    assert punch.volume == pytest.approx(np.pi * 0.005**2 * 0.01, rel=0.03)
    assert ellipsoid.bounds[1] == pytest.approx([0.003, 0.004, 0.005], rel=0.01)


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0, -1), (1, 2, -3), (-1e-9, 0, -1), (0, 0, 0)])
def test_an_arrow_points_along_its_force(direction):
    turned = rotated(np.array([0.0, 0.0, 1.0]), tuple(turning_z_to(np.array(direction, dtype=float))))
    wanted = np.array(direction) / (np.linalg.norm(direction) or 1)
    assert turned == pytest.approx(wanted if np.any(direction) else [0, 0, 1], abs=1e-8)


def test_a_recording_that_was_cut_short_is_written_up_to_there(built, tmp_path):
    """Chunks of an offline run have 512 ticks: of three runs on end, the first chunk is whole."""
    moved, turned = (np.concatenate([values] * 3) for values in path())
    whole = palpate.Simulation(built).play(moved, turned).source
    (tmp_path / "cut.mcap").write_bytes(whole[: int(0.8 * len(whole))])
    result = run("export", "cut.mcap", "--to", "csv", cwd=tmp_path)
    assert result.returncode == 0, result
    assert "cut.mcap was cut short: what is there is 0." in result.stderr and result.stdout.split()[0] == "cut.csv"
    rows = len(read(tmp_path / "cut.csv")["tick"])
    assert rows == 512


@pytest.mark.parametrize("ending", [".csv", ".pvd", ".glb", ".mp4"])
def test_nothing_half_written_is_left(ending, recording, built, tmp_path):
    def stop(_done, _expected):
        raise KeyboardInterrupt

    scene, rate = (None, None) if ending == ".csv" else (built, 5.0)
    with pytest.raises(KeyboardInterrupt):
        palpate.export(recording, tmp_path / f"press{ending}", rate=rate, scene=scene, progress=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("ending", "package"), [(".parquet", "pyarrow"), (".glb", "pygltflib"), (".mp4", "imageio_ffmpeg")]
)
def test_a_package_that_is_missing_is_named(ending, package, recording, built, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(palpate.Error, match=r"pip install 'palpate\[export\]'"):
        palpate.export(recording, tmp_path / f"press{ending}", scene=None if ending == ".parquet" else built)


def test_mistakes_are_told_in_a_line(file, recording, tmp_path, monkeypatch, capsys):
    def command(*words):
        return called(monkeypatch, capsys, "export", *words)

    refused(command(file), "--to or --out", "csv", "mp4")
    refused(command(file, "--to", "avi"), "--to avi", "unknown format")
    refused(command("none.mcap", "--to", "csv"), "none.mcap: no such file")
    for words, message in (
        ({"start": 2.0}, r"nothing was recorded from 2 s .* 0.300 s long"),
        ({"rate": 30.0}, "a table has a row for every tick"),
    ):
        with pytest.raises(palpate.Error, match=message):
            palpate.export(recording, tmp_path / "press.csv", **words)
    with pytest.raises(palpate.Error, match=r"written as \.csv"):
        palpate.export(recording, tmp_path / "press.txt")
