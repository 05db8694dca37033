"""Label maps of analytic bodies, and their files as 3D Slicer and others write them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import nibabel
import nrrd
import numpy as np

# A CT: in the slice 0.7 mm, between slices 2.5 mm.
CT = (0.7, 0.7, 2.5)
Inside = Callable[[np.ndarray], np.ndarray]


def ball(center: Sequence[float], radius: float) -> Inside:
    """Ball, mm."""
    return lambda points: ((points - np.array(center)) ** 2).sum(axis=-1) <= radius**2


def ellipsoid(semi_axes: Sequence[float]) -> Inside:
    """Ellipsoid around the origin, mm."""
    return lambda points: ((points / np.array(semi_axes)) ** 2).sum(axis=-1) <= 1


def turned() -> np.ndarray:
    """Rotation of an oblique scan: 20 degrees around x, then 15 around z."""
    a, b = np.radians(20), np.radians(15)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_z = np.array([[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
    return about_z @ about_x


def labels_of(
    shapes: Sequence[Inside], reach: Sequence[float], spacing: Sequence[float] = CT, rotation: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Labels 1, 2, ... of shapes, later ones over earlier ones; and the affine map to right, anterior, superior, mm.

    The grid covers ``reach`` (3,), mm, on both sides of the origin, along its own axes.
    """
    columns = (np.eye(3) if rotation is None else rotation) * np.array(spacing)
    counts = np.ceil(2 * np.array(reach) / np.array(spacing)).astype(int) + 1
    affine = np.eye(4)
    affine[:3, :3] = columns
    affine[:3, 3] = -columns @ ((counts - 1) / 2)
    indices = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    points = indices @ columns.T + affine[:3, 3]
    labels = np.zeros(counts, dtype=np.uint8)
    for value, inside in enumerate(shapes, 1):
        labels[inside(points)] = value
    return labels, affine


def write_nrrd(
    path: Path, labels: np.ndarray, affine: np.ndarray, names: Mapping[str, int] | None = None, **keys: object
) -> Path:
    """Write in left, posterior, superior, as 3D Slicer does, with its keys for segments; ``keys`` replace others."""
    lps = np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine
    header: dict[str, object] = {
        "space": "left-posterior-superior",
        "space directions": lps[:3, :3].T,
        "space origin": lps[:3, 3],
        "kinds": ["domain"] * 3,
        "encoding": "gzip",
    }
    for rank, (name, value) in enumerate((names or {}).items()):
        prefix = f"Segment{rank}"
        header |= {f"{prefix}_ID": f"Segment_{rank + 1}", f"{prefix}_Name": name}
        header |= {f"{prefix}_LabelValue": str(value), f"{prefix}_Layer": "0"}
    header |= {key.replace("_", " ") if key.startswith("space") else key: value for key, value in keys.items()}
    nrrd.write(str(path), labels, {key: value for key, value in header.items() if value is not None})
    return path


def write_nifti(path: Path, labels: np.ndarray, affine: np.ndarray, unit: str = "mm") -> Path:
    """Write with an sform."""
    image = nibabel.Nifti1Image(labels, affine)
    image.header.set_xyzt_units(unit)
    nibabel.save(image, path)
    return path
