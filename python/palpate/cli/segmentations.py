"""Summary of a segmentation file."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def print_segmentation(path: Path, unit: str | None) -> None:
    """Print the voxels, the segments with their volumes, and the command that makes a body of them."""
    from palpate.segmentation import load_label_map

    labels = load_label_map(path, unit)
    sides = " x ".join(f"{1e3 * side:.4g}" for side in labels.spacing)
    shape = " x ".join(map(str, labels.layers.shape[1:]))
    print(f"{path}: label map of {shape} voxels of {sides} mm, {len(labels.segments)} segments")
    largest, most = labels.segments[0].name, -1
    for segment in labels.segments:
        count = int(np.count_nonzero(labels.mask(segment)))
        largest, most = (segment.name, count) if count > most else (largest, most)
        size = f"{1e6 * count * labels.voxel_volume:.4g} cm3, {count:,} voxels" if count else "empty"
        print(f"  '{segment.name}' (label {segment.value}): {size}")
    print(f"  to touch it: palpate run {path} --segment '{largest}'")
