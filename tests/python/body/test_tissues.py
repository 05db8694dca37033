"""The list of tissues, and its table in the documents."""

from __future__ import annotations

from pathlib import Path

from palpate.body import Material
from palpate.body.tissues import TISSUES

VIEWER = Path(__file__).parents[3] / "docs" / "materials.md"


def test_each_tissue_is_a_material_and_stands_in_the_documents_with_its_source():
    rows = [line for line in VIEWER.read_text().splitlines() if line.startswith("| ")]
    for tissue in TISSUES:
        Material(tissue.youngs_modulus, tissue.poissons_ratio, 1000.0)
        (row,) = [line for line in rows if line.startswith(f"| {tissue.title} |")]
        spread = f" ± {tissue.spread / 1e3:.3g}" if tissue.spread else ""
        cells = (f"{tissue.youngs_modulus / 1e3:.3g}{spread} kPa", str(tissue.poissons_ratio), tissue.citation)
        assert row == f"| {tissue.title} | {' | '.join(cells)} |"
    assert len({tissue.name for tissue in TISSUES}) == len(TISSUES)


def test_figures_that_were_not_checked_say_so():
    citations = {tissue.name: tissue.citation for tissue in TISSUES}
    assert {name for name, text in citations.items() if "not checked at the source" in text} == {"fat", "silicone"}
