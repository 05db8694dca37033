"""A small exam, its bodies a matter of seconds."""

from __future__ import annotations

import shutil
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"

# Three places 40 mm apart on a slab of coarse elements.
EXAM = """[[body]]
name = "slab"
mesh = "slab.obj"
unit = "mm"
max_element_size = "20mm"
precision = "f16"
refine = [
    { center = ["20mm", "20mm", "25mm"], radius = "11mm", size = "8mm" },
    { center = ["60mm", "20mm", "25mm"], radius = "11mm", size = "8mm" },
    { center = ["20mm", "60mm", "25mm"], radius = "11mm", size = "8mm" },
]

[supports]
fixed = "z < min + 1mm"

[tool]
radius = "10mm"

[nodule]
radii = ["11mm"]
depths = ["19mm"]

[nodule.contrast]
low = 1.4
high = 40
count = 5

[exam]
search = "z > max - 1mm"
press_depth = "4mm"
places = [["20mm", "20mm", "40mm"], ["60mm", "20mm", "40mm"], ["20mm", "60mm", "40mm"]]
trials = 4
seed = 3
"""


def write_exam(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the exam with parts of its text replaced, each of which must be there."""
    text = EXAM
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    shutil.copy(EXAMPLES / "slab.obj", folder)
    path = folder / "exam.toml"
    path.write_text(text)
    return path
