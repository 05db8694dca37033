"""Label maps of segmented images (NRRD, NIfTI): reading, choice of segments, smooth boundaries."""

from palpate.segmentation.endings import is_segmentation
from palpate.segmentation.reading import load_label_map

__all__ = ["is_segmentation", "load_label_map"]
