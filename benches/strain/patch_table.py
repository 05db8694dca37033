"""The table of the series of a half-space under a patch, by material, for the core."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

from benches.strain.materials import NeoHookean, ReducedPolynomial
from benches.strain.patch_series import half_space_terms

RATIOS = (0.0, 0.1, 0.2, 0.3, 0.35, 0.4, 0.45, 0.49, 0.499)
SOURCE = Path(__file__).parents[2] / "crates/core/src/series/half_space_table.rs"


def neo_hookean_row(nu: float) -> list[float]:
    """Return `h_2` and `h_3`."""
    return half_space_terms(NeoHookean(1.0, nu))[1:].tolist()


def polynomial_row(nu: float) -> list[float]:
    """Return `h_2 = a + b x` and `h_3 = c + d x + e x^2 + f y` as (a, b, c, d, e, f).

    Here `x = c01 / (c10 + c01)` and `y = c20 / c10`; the order of each term in the strain leaves no others.
    """
    at = {x: half_space_terms(ReducedPolynomial(1.0, nu, x)) for x in (0.0, 0.5, 1.0)}
    stiffer = half_space_terms(ReducedPolynomial(1.0, nu, 0.0, 1.0))
    start, middle, end = (at[x][2] for x in (0.0, 0.5, 1.0))
    straight, square = 4.0 * middle - end - 3.0 * start, 2.0 * (end - 2.0 * middle + start)
    return [at[0.0][1], at[1.0][1] - at[0.0][1], start, straight, square, stiffer[2] - start]


def _rust(name: str, meaning: str, rows: Sequence[Sequence[float]]) -> list[str]:
    text = ", ".join("[" + ", ".join(f"{value:.6}" for value in row) + "]" for row in rows)
    return ["", f"/// {meaning}.", f"pub const {name}: [[f64; {len(rows[0])}]; {len(rows)}] = [{text}];"]


def patch_table() -> None:
    """Compute the series of a half-space under a patch for all materials; write the table of the core.

    Example: python -m benches patch-table
    """
    lines = [
        "//! Series of a half-space under a patch, by `python -m benches patch-table`.",
        "",
        "/// Poisson's ratios.",
        f"pub const RATIOS: [f64; {len(RATIOS)}] = {list(RATIOS)};",
        *_rust("NEO_HOOKEAN", "`h_2` and `h_3` by Poisson's ratio", [neo_hookean_row(nu) for nu in RATIOS]),
        *_rust(
            "POLYNOMIAL",
            "Polynomial, `x = c01/(c10 + c01)`, `y = c20/c10`: `h_2 = a + b x`, `h_3 = c + d x + e x^2 + f y`",
            [polynomial_row(nu) for nu in RATIOS],
        ),
    ]
    SOURCE.write_text("\n".join(lines) + "\n")
    subprocess.run(["rustfmt", "--edition", "2024", str(SOURCE)], check=True)
    print(f"wrote {SOURCE}")
