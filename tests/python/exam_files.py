"""A small exam, its bodies a matter of seconds."""

from __future__ import annotations

from pathlib import Path

from palpate.mesh.tetrahedralize import tetrahedralize_with

SLAB = Path(__file__).parents[2] / "examples" / "slab.obj"
# Three places 40 mm apart on a slab of 80 x 80 x 40 mm.
PLACES = ((0.02, 0.02, 0.04), (0.06, 0.02, 0.04), (0.02, 0.06, 0.04))

EXAM = """[[body]]
name = "slab"
mesh = "slab.vtu"
precision = "f16"

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
trials = 3
seed = 3
"""


def write_slab(folder: Path) -> None:
    """Write the mesh: coarse, but for where the nodules are."""
    finer = [((x, y, 0.025), 0.011, 0.008) for x, y, _ in PLACES]
    tetrahedralize_with("quadratic", SLAB, 0.02, "mm", finer).write(folder / "slab.vtu")


def write_exam(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the exam with parts of its text replaced, each of which must be there once."""
    text = EXAM
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / "exam.toml"
    path.write_text(text)
    return path
