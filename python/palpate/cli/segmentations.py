"""Summary of a segmentation file."""

from __future__ import annotations

import shlex
from pathlib import Path


def print_segmentation(path: Path, unit: str | None) -> None:
    """Print the voxels, the segments with their volumes, and the command that makes a body of them."""
    from palpate.mesh.label_summary import label_summary

    labels = label_summary(path, unit)
    sides = " x ".join(f"{1e3 * side:.4g}" for side in labels.spacing)
    shape = " x ".join(map(str, labels.shape))
    print(f"{path}: label map of {shape} voxels of {sides} mm, {len(labels.segments)} segments")
    for segment in labels.segments:
        volume = f"{1e6 * segment.voxels * labels.voxel_volume:.4g} cm3, {segment.voxels:,} voxels"
        print(f"  '{segment.name}' (label {segment.value}): {volume if segment.voxels else 'empty'}")
    largest = max(labels.segments, key=lambda segment: segment.voxels)
    print(f"  to touch it: palpate run {shlex.quote(str(path))} --segment {shlex.quote(str(largest.name))}")
