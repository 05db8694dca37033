"""The table of coefficients of the contact law at large strain, by material, for the core.

`python -m benches strain-table` presses a sphere into half-spaces of all materials of the table and writes the
coefficients as Rust source. Materials that stand in the results already are not computed again.
"""

from __future__ import annotations

import json
import subprocess
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import typer

from benches.strain.indentation import coefficients
from benches.strain.materials import Material, NeoHookean, ReducedPolynomial
from palpate.progress import status_line

# Poisson's ratios of the neo-Hookean material, and of the two others.
RATIOS = (0.0, 0.1, 0.2, 0.3, 0.35, 0.4, 0.45, 0.49)
FEW_RATIOS = (0.3, 0.45)
# `c01 / (c10 + c01)` of Mooney and Rivlin; `c20 / c10` and `c30 / c10` of Yeoh.
SHARES = (0.0, 0.5, 1.0)
QUADRATIC, CUBIC = (0.0, 0.5, 2.0), (0.0, 1.0)
RESULTS = Path(__file__).with_name("coefficients.json")
SOURCE = Path(__file__).parents[2] / "crates/core/src/contact/local/strain_table.rs"


def materials() -> dict[str, Material]:
    """Return the materials of the table by name."""
    found: dict[str, Material] = {f"neo-hookean {nu}": NeoHookean(1.0, nu) for nu in RATIOS}
    for nu, share in product(FEW_RATIOS, SHARES):
        found[f"mooney-rivlin {nu} {share}"] = ReducedPolynomial(1.0, nu, share)
    for nu, quadratic, cubic in product(FEW_RATIOS, QUADRATIC, CUBIC):
        found[f"yeoh {nu} {quadratic} {cubic}"] = ReducedPolynomial(1.0, nu, 0.0, quadratic, cubic)
    return found


def compute(results: Path) -> dict[str, list[float]]:
    """Compute what is missing in a file of results; return the coefficients and the error of each fit by name."""
    found = json.loads(results.read_text()) if results.exists() else {}
    wanted = materials()
    for done, (name, material) in enumerate(wanted.items()):
        if name in found:
            continue
        with status_line(f"{done} of {len(wanted)}: {name}"):
            fit = coefficients(material)
        found[name] = [*map(float, fit.coefficients), fit.error]
        results.write_text(json.dumps(found, indent=1) + "\n")
    return found


def rust_source(found: dict[str, list[float]]) -> str:
    """Return the table as Rust source."""

    def row(name: str) -> str:
        return "[" + ", ".join(f"{value:.6}" for value in found[name][:3]) + "]"

    def nested(names: list[Any]) -> str:
        return "[" + ", ".join(nested(name) if isinstance(name, list) else row(name) for name in names) + "]"

    neo_hookean = [f"neo-hookean {nu}" for nu in RATIOS]
    mooney_rivlin = [[f"mooney-rivlin {nu} {share}" for share in SHARES] for nu in FEW_RATIOS]
    yeoh = [[[f"yeoh {nu} {q} {c}" for c in CUBIC] for q in QUADRATIC] for nu in FEW_RATIOS]
    worst = max(fit[3] for fit in found.values())
    points = {
        "RATIOS": (RATIOS, "Poisson's ratios of the neo-Hookean material"),
        "FEW_RATIOS": (FEW_RATIOS, "Poisson's ratios of the others"),
        "SHARES": (SHARES, "`c01 / (c10 + c01)` of Mooney and Rivlin"),
        "YEOH_QUADRATIC": (QUADRATIC, "`c20 / c10` of Yeoh"),
        "YEOH_CUBIC": (CUBIC, "`c30 / c10` of Yeoh"),
    }
    lines = [
        "//! Coefficients of a sphere's contact at finite strain, by `python -m benches strain-table`.",
        "//!",
        f"//! Forces of {len(found)} half-spaces by full Newton's method, d/R to 1.5; fits within {100 * worst:.1f} %.",
        "",
        "use super::finite_strain::StrainTerms;",
        "",
    ]
    for name, (values, meaning) in points.items():
        lines += [f"/// {meaning}.", f"pub const {name}: [f64; {len(values)}] = {list(map(float, values))};"]
    n, m, q, c = len(RATIOS), len(FEW_RATIOS), len(QUADRATIC), len(CUBIC)
    lines += [
        "",
        "/// By Poisson's ratio.",
        f"pub const NEO_HOOKEAN: [StrainTerms; {n}] = {nested(neo_hookean)};",
        "",
        "/// By Poisson's ratio and share.",
        f"pub const MOONEY_RIVLIN: [[StrainTerms; {len(SHARES)}]; {m}] = {nested(mooney_rivlin)};",
        "",
        "/// By Poisson's ratio, quadratic and cubic term.",
        f"pub const YEOH: [[[StrainTerms; {c}]; {q}]; {m}] = {nested(yeoh)};",
    ]
    return "\n".join(lines) + "\n"


def strain_table(out: Annotated[Path, typer.Option(help="Folder of the results.")] = RESULTS.parent) -> None:
    """Compute the coefficients of spheres on half-spaces of all materials; write the table of the core.

    Takes about a minute a material. Example: python -m benches strain-table
    """
    found = compute(out / RESULTS.name)
    target = SOURCE if out == RESULTS.parent else out / SOURCE.name
    target.write_text(rust_source(found))
    subprocess.run(["rustfmt", "--edition", "2024", str(target)], check=True)
    print(f"wrote {target}")
