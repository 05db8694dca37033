"""Surface files as programs and scanners write them: strips, missing textures, scenes, comments."""

from __future__ import annotations

import json
import re
import struct

import numpy as np
import pytest
import trimesh
from command_line import refused, run

import palpate
from palpate.mesh.surface_file import load_surface

# A tetrahedron with a corner at the origin and one on each axis: of volume 1/6.
CORNERS = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
HEAD = "ply\nformat {form} 1.0\ncomment made by a scanner\nelement vertex 4\n"
HEAD += "property float x\nproperty float y\nproperty float z\n"
STRIP = [0, 2, 1, 3, 0, -1, 0, 3, 2]


def strips(form: str) -> bytes:
    """As Cyberware's scans are: one list of strips with -1 between them."""
    head = HEAD.format(form=form) + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    if form == "ascii":
        return (head + CORNERS + " ".join(map(str, [len(STRIP), *STRIP])) + "\n").encode()
    order = "<" if "little" in form else ">"
    numbers = [float(x) for x in CORNERS.split()]
    return head.encode() + struct.pack(f"{order}12f{len(STRIP) + 1}i", *numbers, len(STRIP), *STRIP)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_triangle_strips(tmp_path, form):
    (tmp_path / "scan.ply").write_bytes(strips(form))
    shape = load_surface(tmp_path / "scan.ply").shape
    assert len(shape.faces) == 4 and shape.is_watertight and shape.is_winding_consistent
    assert shape.volume == pytest.approx(1 / 6)


def test_textures_and_materials_that_are_missing(tmp_path, capfd):
    faces = "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    triangles = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"
    head = HEAD.format(form="ascii").replace("comment made", "comment TextureFile gone.png\ncomment made")
    (tmp_path / "scan.ply").write_text(head + faces + CORNERS + triangles)
    rows = [f"v {row}" for row in CORNERS.splitlines()]
    rows += ["f " + " ".join(str(int(i) + 1) for i in row.split()[1:]) for row in triangles.splitlines()]
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nusemtl skin\n" + "\n".join(rows))
    (tmp_path / "b.obj").write_text("mtllib b.mtl\nusemtl skin\n" + "\n".join(rows))
    (tmp_path / "b.mtl").write_text("newmtl skin\nmap_Kd gone.png\n")
    for name in ("scan.ply", "a.obj", "b.obj"):
        assert load_surface(tmp_path / name).shape.volume == pytest.approx(1 / 6)
    assert capfd.readouterr() == ("", "")


def test_a_gltf_whose_image_is_missing(tmp_path):
    for name, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(trimesh.creation.box())).items():
        (tmp_path / name).write_bytes(content)
    tree = json.loads((tmp_path / "model.gltf").read_text())
    tree |= {"images": [{"uri": "gone.png"}], "textures": [{"source": 0}]}
    tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    tree["meshes"][0]["primitives"][0]["material"] = 0
    (tmp_path / "model.gltf").write_text(json.dumps(tree))
    assert load_surface(tmp_path / "model.gltf").shape.volume == pytest.approx(1.0)


def test_meshes_of_a_scene_stand_where_its_transforms_place_them(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), node_name="heart")
    turned = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1]) @ np.diag([2.0, 1.0, -1.0, 1.0])
    turned[:3, 3] = [5, 0, 0]
    scene.add_geometry(trimesh.creation.box(), node_name="lung", transform=turned)
    scene.export(tmp_path / "thorax.glb")
    found = load_surface(tmp_path / "thorax.glb")
    assert sorted(found.part_names) == ["heart", "lung"]
    own = found.shape.vertices[found.shape.faces[found.part_of_face == found.part_names.index("lung")]].reshape(-1, 3)
    # Twice as long along x, then turned onto y, and moved.
    assert own.min(axis=0) == pytest.approx([4.5, -1.0, -0.5]) and own.max(axis=0) == pytest.approx([5.5, 1.0, 0.5])
    # The mirrored one has its outside outside.
    assert found.shape.volume == pytest.approx(3.0)


def test_stl_text_between_comments_and_binaries_that_say_solid(tmp_path):
    box = trimesh.creation.box()
    text = trimesh.exchange.stl.export_stl_ascii(box)
    (tmp_path / "text.stl").write_text("; made by hand\n# twice\n\n" + text.replace("endsolid", "// end\nendsolid"))
    content = bytearray(trimesh.exchange.stl.export_stl(box))
    content[:80] = b"solid facet of some other program".ljust(80)
    (tmp_path / "binary.stl").write_bytes(bytes(content) + b"trailing bytes")
    for name in ("text.stl", "binary.stl"):
        assert load_surface(tmp_path / name).shape.merge_vertices() is None
        assert load_surface(tmp_path / name).shape.volume == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("cut.ply", strips("binary_little_endian")[:-10]),
        ("outside.ply", strips("ascii").replace(b"9 0 2 1", b"9 0 2 7")),
        ("header.ply", b"ply\nformat ascii 1.0\n"),
        ("words.stl", b"solid a\nfacet normal 0 0 1\nvertex one two three\n"),
        ("empty.glb", b"glTF"),
        ("words.obj", b"v one two three\nf 1 2 3\n"),
        ("words.off", b"OFF\nthree\n"),
        ("words.gltf", b"{"),
    ],
)
def test_files_that_cannot_be_read_cost_one_line(tmp_path, name, content, capfd):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(palpate.MeshError, match=name) as refusal:
        load_surface(tmp_path / name)
    assert "\n" not in str(refusal.value)
    assert capfd.readouterr() == ("", "")


SPHERE = {
    "text.stl": trimesh.creation.icosphere(2).export(file_type="stl_ascii").encode(),
    "binary.stl": trimesh.creation.icosphere(2).export(file_type="stl"),
    "text.ply": trimesh.creation.icosphere(2).export(file_type="ply", encoding="ascii"),
    "binary.ply": trimesh.creation.icosphere(2).export(file_type="ply"),
    "text.off": trimesh.creation.icosphere(2).export(file_type="off").encode(),
}


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("text.stl", r"'endsolid' is missing after \d+ triangles"),
        ("binary.stl", r"counts 320 triangles, \d+ are there"),
        ("text.ply", r"counts 320 faces, \d+ are there"),
        ("binary.ply", ""),
        ("text.off", r"counts 320 faces, \d+ are there"),
    ],
)
def test_files_cut_short_are_refused(tmp_path, name, words):
    """Filling would close the hole without a message."""
    (tmp_path / name).write_bytes(SPHERE[name])
    assert len(load_surface(tmp_path / name).shape.faces) == 320
    kept = SPHERE[name][:-400]
    if "text" in name:
        kept = kept[: kept.rindex(b"facet normal" if name == "text.stl" else b"\n3 ")]
    (tmp_path / name).write_bytes(kept)
    with pytest.raises(palpate.MeshError, match=rf"{name}: [^\n]*cut short") as refusal:
        load_surface(tmp_path / name)
    assert re.search(words, str(refusal.value))


def test_a_description_of_a_surface_needs_finite_coordinates(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n4 4 0\n0 0 0\nnan 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n")
    refused(run("info", "a.off", "--unit", "mm", cwd=tmp_path), "a.off: vertex 1 has a coordinate that is not finite")
