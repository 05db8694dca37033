"""Label maps are read with the place, unit and names that their files give; other files are refused in one line."""

from __future__ import annotations

import gzip
from pathlib import Path

import nibabel
import numpy as np
import pytest
from label_maps import ball, labels_of, turned, write_nifti, write_nrrd

import palpate
from palpate.segmentation import load_label_map

# One voxel of each label at places that no mirrored or swapped axis maps onto each other.
PLACES = {1: (1, 2, 3), 2: (4, 1, 2), 3: (0, 5, 1)}


def marked() -> tuple[np.ndarray, np.ndarray]:
    """Labels of an oblique scan, and its affine map to right, anterior, superior, mm."""
    labels = np.zeros((6, 7, 5), dtype=np.uint8)
    for value, place in PLACES.items():
        labels[place] = value
    affine = np.eye(4)
    affine[:3, :3] = turned() * [0.7, 0.9, 2.5]
    affine[:3, 3] = [-31.0, 12.0, 205.0]
    return labels, affine


def places(path: Path, unit: str | None = None) -> np.ndarray:
    """Where the labelled voxels lie, m, by their labels."""
    found = load_label_map(path, unit)
    rows = []
    for value in PLACES:
        (index,) = np.argwhere(found.mask(found.find(value)))
        rows.append(found.affine[:3, :3] @ index + found.affine[:3, 3])
    return np.array(rows)


def expected(affine: np.ndarray) -> np.ndarray:
    return 1e-3 * np.array([affine[:3, :3] @ place + affine[:3, 3] for place in PLACES.values()])


def test_every_format_and_space_gives_the_same_places_in_the_patient(tmp_path):
    labels, affine = marked()
    true = expected(affine)
    files = [write_nrrd(tmp_path / "lps.nrrd", labels, affine)]
    for space, signs in (("right-anterior-superior", (1, 1, 1)), ("LAS", (-1, 1, 1))):
        turned_round = np.diag([*signs, 1.0]) @ affine
        place = {"space_directions": turned_round[:3, :3].T, "space_origin": turned_round[:3, 3]}
        files.append(write_nrrd(tmp_path / f"{space}.nrrd", labels, affine, space=space, **place))
    files += [write_nifti(tmp_path / name, labels, affine) for name in ("a.nii", "a.nii.gz")]
    for file in files:
        np.testing.assert_allclose(places(file), true, atol=1e-7, err_msg=str(file))
    mirrored = np.diag([-1.0, 1, 1, 1]) @ affine
    assert np.abs(places(write_nifti(tmp_path / "mirrored.nii", labels, mirrored)) - true).max() > 1e-3


def test_qform_alone_and_nifti_2(tmp_path):
    labels, affine = marked()
    image = nibabel.Nifti2Image(labels, None)
    image.set_qform(affine, 1)
    image.set_sform(None, 0)
    nibabel.save(image, tmp_path / "two.nii")
    np.testing.assert_allclose(places(tmp_path / "two.nii"), expected(affine), atol=1e-7)


def test_unit_of_the_file_or_millimetres(tmp_path):
    labels, affine = marked()
    true = expected(affine)
    for unit, factor in (("meter", 1e3), ("micron", 1e-3), ("unknown", 1.0), ("mm", 1.0)):
        np.testing.assert_allclose(places(write_nifti(tmp_path / "a.nii", labels, affine, unit)), factor * true, 1e-6)
    write_nrrd(tmp_path / "a.nrrd", labels, affine, space_units=["cm", "cm", "cm"])
    np.testing.assert_allclose(places(tmp_path / "a.nrrd"), 10 * true, 1e-6)
    np.testing.assert_allclose(places(tmp_path / "a.nrrd", "mm"), true, 1e-6)


def test_names_of_slicer_are_found_and_labels_without_a_name(tmp_path):
    labels, affine = marked()
    file = write_nrrd(tmp_path / "a.seg.nrrd", labels, affine, {"Leber": 1, "Groesse 3": 3})
    # 3D Slicer writes UTF-8, pynrrd ASCII alone.
    file.write_bytes(file.read_bytes().replace(b"Groesse", "Größe".encode()))
    found = load_label_map(file)
    assert [s.name for s in found.segments] == ["Leber", "Größe 3", "2"]
    assert found.find("leber").value == 1
    assert found.find("Größe 3").value == 3
    assert found.find(2).value == found.find("2").value == 2
    with pytest.raises(palpate.MeshError, match=r"no segment 'Lebr'; did you mean 'Leber'\? .*'Größe 3', '2'"):
        found.find("Lebr")


def test_layers_of_slicer_may_overlap(tmp_path):
    labels, affine = marked()
    layers = np.stack([(labels > 0) * 1, (labels == 2) * 4]).astype(np.uint8)
    directions = np.vstack([np.full((1, 3), np.nan), affine[:3, :3].T])
    place = {"space": "RAS", "space_directions": directions, "space_origin": affine[:3, 3]}
    keys = {"Segment0_Name": "all", "Segment0_LabelValue": "1", "Segment0_Layer": "0"}
    keys |= {"Segment1_Name": "one", "Segment1_LabelValue": "4", "Segment1_Layer": "1"}
    kinds = ["list", "domain", "domain", "domain"]
    found = load_label_map(write_nrrd(tmp_path / "a.seg.nrrd", layers, affine, kinds=kinds, **place, **keys))
    both = [found.mask(found.find(name)) for name in ("all", "one")]
    assert [mask.sum() for mask in both] == [3, 1] and (both[0] & both[1]).sum() == 1
    # Older versions write neither labels nor layers.
    old = {"Segment0_Name": "all", "Segment1_Name": "one"}
    write_nrrd(tmp_path / "old.seg.nrrd", (layers > 0).astype(np.uint8), affine, kinds=kinds, **place, **old)
    found = load_label_map(tmp_path / "old.seg.nrrd")
    assert [found.mask(found.find(name)).sum() for name in ("all", "one")] == [3, 1]


def _cut(path: Path, share: float) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])


def _noise(kind: type, low: int, high: int) -> np.ndarray:
    return np.random.default_rng(0).integers(low, high, (20, 20, 20)).astype(kind)


def _without_forms(path: Path) -> None:
    image = nibabel.Nifti1Image(marked()[0], None)
    image.set_sform(None, 0)
    image.set_qform(None, 0)
    nibabel.save(image, path)


def _changed(path: Path, old: bytes, new: bytes) -> None:
    labels, affine = marked()
    content = write_nrrd(path, labels, affine).read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new))


# Two axes of the array in one direction.
FLAT = np.array([[1.0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
LABELS, AFFINE = labels_of([ball((0, 0, 0), 8)], (10, 10, 10))
BAD = {
    "cut short, gzip": ("a.nrrd", lambda p: (write_nrrd(p, LABELS, AFFINE), _cut(p, 0.95)), "cut short: "),
    "cut short, raw": ("a.nrrd", lambda p: (write_nrrd(p, LABELS, AFFINE, encoding="raw"), _cut(p, 0.7)), "cut short"),
    "cut short, header": ("a.nrrd", lambda p: p.write_bytes(b"NRRD0004\ntype: uchar\n"), "cut short in its header"),
    "cut short, nii.gz": ("a.nii.gz", lambda p: (write_nifti(p, LABELS, AFFINE), _cut(p, 0.7)), "cut short or damaged"),
    "cut short, nii": ("a.nii", lambda p: (write_nifti(p, LABELS, AFFINE), _cut(p, 0.7)), "cannot be read as a NIfTI"),
    "no NRRD": ("a.nrrd", lambda p: p.write_bytes(b"\x89PNG\n" * 99), "is no NRRD file"),
    "no NIfTI": ("a.nii", lambda p: p.write_bytes(b"solid cube" * 99), "is no NIfTI file"),
    "no gzip": ("a.nii.gz", lambda p: p.write_bytes(b"solid cube" * 99), "damaged"),
    "damaged header": ("a.nrrd", lambda p: _changed(p, b"sizes: 6 7 5", b"sizes: 6 x 5"), "header is damaged"),
    "sizes": ("a.nrrd", lambda p: _changed(p, b"sizes: 6 7 5", b"sizes: 6 7 -5"), "header is damaged"),
    "4D NIfTI": ("a.nii", lambda p: write_nifti(p, np.ones((4, 4, 4, 3), np.uint8), np.eye(4)), "4 dimensions"),
    "4D NRRD": (
        "a.nrrd",
        lambda p: write_nrrd(p, np.ones((4, 4, 4, 3), np.uint8), AFFINE, kinds=None, space_directions=None),
        "4 dimensions",
    ),
    "no space": ("a.nrrd", lambda p: write_nrrd(p, LABELS, AFFINE, space=None, space_dimension=3), "no 'space'"),
    "no directions": (
        "a.nrrd",
        lambda p: write_nrrd(p, LABELS, AFFINE, space_directions=None),
        "no 'space dir",
    ),
    "other space": ("a.nrrd", lambda p: write_nrrd(p, LABELS, AFFINE, space="3D-left-handed"), "is not read"),
    "no affine": ("a.nii", _without_forms, "neither sform nor qform"),
    "flat": (
        "a.nii",
        lambda p: write_nifti(p, LABELS, FLAT),
        "have no volume",
    ),
    "CT": ("a.nii", lambda p: write_nifti(p, _noise(np.int16, -1000, 900), AFFINE), "intensity image (values from -"),
    "floats": ("a.nii", lambda p: write_nifti(p, LABELS * np.float32(0.5), AFFINE), "intensity image (values with"),
    "MRI": ("a.nrrd", lambda p: write_nrrd(p, _noise(np.uint8, 0, 255), AFFINE), "intensity image (25"),
    "not finite": ("a.nii", lambda p: write_nifti(p, LABELS * np.float32(np.nan), AFFINE), "not finite"),
    "background": ("a.nii", lambda p: write_nifti(p, 0 * LABELS, AFFINE), "every voxel is background"),
    "huge": ("a.nrrd", lambda p: _changed(p, b"sizes: 6 7 5", b"sizes: 60000 60000 60000"), "more than the 4 GiB"),
    "elsewhere": (
        "a.nrrd",
        lambda p: _changed(p, b"encoding: gzip", b"data file: a.raw\nencoding: gzip"),
        "another file",
    ),
    "encoding": ("a.nrrd", lambda p: _changed(p, b"encoding: gzip", b"encoding: hex"), "'hex' is not read"),
    "unit": ("a.nrrd", lambda p: write_nrrd(p, LABELS, AFFINE, space_units=["ell"] * 3), "'ell' is not known"),
    "layer": (
        "a.nrrd",
        lambda p: write_nrrd(p, LABELS, AFFINE, Segment0_Name="a", Segment0_LabelValue="1", Segment0_Layer="7"),
        "in layer 7",
    ),
    "missing": ("a.nrrd", lambda p: None, "no such file"),
    "empty": ("a.nii", lambda p: p.write_bytes(b""), "the file is empty"),
}


@pytest.mark.parametrize("name, write, message", BAD.values(), ids=BAD.keys())
def test_what_is_no_label_map_is_refused_in_one_line(tmp_path, name, write, message):
    path = tmp_path / name
    write(path)
    with pytest.raises(palpate.MeshError) as error:
        load_label_map(path)
    text = str(error.value)
    assert message in text and text.startswith(str(path)) and "\n" not in text and len(text) < 400


def test_more_voxels_than_the_header_says_are_not_unpacked(tmp_path):
    """A file of 1 MB that unpacks to 1 GB gives the voxels of its header."""
    labels, affine = marked()
    header = write_nrrd(tmp_path / "a.nrrd", labels, affine).read_bytes().split(b"\n\n")[0]
    bomb = gzip.compress(labels.tobytes(order="F") + bytes(1 << 28))
    (tmp_path / "a.nrrd").write_bytes(header + b"\n\n" + bomb)
    np.testing.assert_allclose(places(tmp_path / "a.nrrd"), expected(affine), atol=1e-7)
