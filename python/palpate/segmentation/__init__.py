"""Label maps of segmented images (NRRD, NIfTI): reading, choice of segments, smooth boundaries."""

from palpate.segmentation.reading import load_label_map

__all__ = ["load_label_map"]
