"""Label maps from files: units, checks, and names of segments."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from palpate.errors import MeshError
from palpate.input_file import require_file
from palpate.segmentation.endings import SEGMENTATION_ENDINGS, is_segmentation
from palpate.segmentation.label_map import LabelMap, RawImage, Segment
from palpate.segmentation.nifti_file import read_nifti
from palpate.segmentation.nrrd_file import read_nrrd
from palpate.units import LENGTH_UNITS, length_scale

# Largest label. FreeSurfer's go to 14,175.
MOST_LABEL = 1 << 16
# More labels than this make an intensity image of it, if neighbours in the image mostly differ as well: voxels beside
# each other have the same label but for boundaries, while an intensity has noise.
MANY_LABELS, LEAST_EQUAL = 64, 0.5
# An affine map whose columns are nearer to a plane than this has no inverse to speak of.
FLAT = 1e-6


def load_label_map(path: str | os.PathLike[str], unit: str | None = None) -> LabelMap:
    """Read a segmentation: ``.seg.nrrd``, ``.nrrd``, ``.nii`` or ``.nii.gz``.

    ``unit`` is the unit of length instead of the file's own; without both it is mm. Raises UnitError for a unit that is
    not a length, and MeshError for a file that is missing, damaged, of another kind, or without a place in the patient.
    """
    path = Path(path)
    require_file(path, MeshError)
    if not is_segmentation(path):
        raise MeshError(f"{path}: is no segmentation; known are {', '.join(SEGMENTATION_ENDINGS)}")
    raw = read_nrrd(path) if path.name.lower().endswith(".nrrd") else read_nifti(path)
    if unit is None and raw.unit is not None and raw.unit not in LENGTH_UNITS:
        raise MeshError(f"{path}: its unit of length '{raw.unit}' is not known; give one by --unit")
    affine = raw.affine.copy()
    affine[:3] *= length_scale(unit or raw.unit or "mm")
    sides = np.linalg.norm(affine[:3, :3], axis=0)
    if not sides.all() or abs(np.linalg.det(affine[:3, :3] / sides)) < FLAT:
        raise MeshError(f"{path}: its affine map is flat: voxels have no volume")
    layers, present = _labels(path, raw)
    return LabelMap(str(path), layers, affine, _segments(path, raw, present))


def _labels(path: Path, raw: RawImage) -> tuple[np.ndarray, list[np.ndarray]]:
    """Voxels as whole numbers, and the labels in each layer; MeshError for an intensity image."""
    voxels = raw.layers
    low, high = voxels.min(), voxels.max()
    why = None
    if not (np.isfinite(low) and np.isfinite(high)):
        why = "values that are not finite"
    elif low < 0 or high > MOST_LABEL:
        why = f"values from {low:g} to {high:g}"
    elif not np.issubdtype(voxels.dtype, np.integer):
        if any((part != np.rint(part)).any() for layer in voxels for part in layer):
            why = "values with fractions"
    if why is None:
        whole = voxels.astype(np.uint16 if high < MOST_LABEL else np.uint32, copy=False)
        present = [np.flatnonzero(np.bincount(layer.ravel(order="K"))) for layer in whole]
        if raw.segments is None and len(present[0]) > MANY_LABELS and _equal_neighbours(whole[0]) < LEAST_EQUAL:
            why = f"{len(present[0])} different values, and few neighbours are equal"
    if why is not None:
        raise MeshError(
            f"{path}: is an intensity image ({why}), not a label map; segment it first, in 3D Slicer for instance"
        )
    return whole, present


def _equal_neighbours(labels: np.ndarray) -> float:
    """Share of pairs along the first axis with the same label, among those that are not both background."""
    a, b = labels[1:], labels[:-1]
    body = (a != 0) | (b != 0)
    return float(((a == b) & body).sum() / max(int(body.sum()), 1))


def _segments(path: Path, raw: RawImage, present: list[np.ndarray]) -> tuple[Segment, ...]:
    """Segments that the file names, and labels without a name; all of them by their labels if it names none."""
    named = raw.segments or ()
    wrong = next((s for s in named if not 0 <= s.layer < len(present)), None)
    if wrong is not None:
        raise MeshError(f"{path}: segment '{wrong.name}' is in layer {wrong.layer}; the file has {len(present)}")
    taken = {(s.layer, s.value) for s in named}
    unnamed = [
        Segment(str(value), value, layer)
        for layer, values in enumerate(present)
        for value in values.tolist()
        if value != 0 and (layer, value) not in taken
    ]
    if not named and not unnamed:
        raise MeshError(f"{path}: every voxel is background (label 0); it has no segment")
    return (*named, *unnamed)
