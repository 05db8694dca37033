"""The table of the series of a half-space under a patch, by material, for the core."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benches.strain.materials import NeoHookean, ReducedPolynomial
from benches.strain.patch_series import half_space_terms

RATIOS = (0.0, 0.1, 0.2, 0.3, 0.35, 0.4, 0.45, 0.49, 0.499)
SOURCE = Path(__file__).parents[2] / "crates/core/src/series/half_space_table.rs"


# `x = c01 / (c10 + c01)` and `y = c20 / c10`.
SHARES, QUADRATIC = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0), 1.0


def neo_hookean_row(nu: float) -> list[float]:
    """Return `h_2`, `h_3` and `h_4`."""
    return half_space_terms(NeoHookean(1.0, nu))[1:].tolist()


def polynomial_row(nu: float) -> list[float]:
    """Return `h_k` of `k` from 2 to 4, each as the coefficients of 1, x, .., x^(k - 1); the last number is that of y.

    The order of each term of the energy in the strain leaves no others; `h_2` has no y.
    """
    at = np.array([half_space_terms(ReducedPolynomial(1.0, nu, x)) for x in SHARES])
    stiffer = half_space_terms(ReducedPolynomial(1.0, nu, 0.0, QUADRATIC))
    row = []
    for order in (2, 3, 4):
        powers = np.linalg.lstsq(np.vander(SHARES, order, increasing=True), at[:, order - 1], rcond=None)[0]
        row += powers.tolist()
        if order > 2:
            row.append((stiffer[order - 1] - at[0, order - 1]) / QUADRATIC)
    return row


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
        *_rust("NEO_HOOKEAN", "`h_2`, `h_3` and `h_4` by Poisson's ratio", [neo_hookean_row(nu) for nu in RATIOS]),
        *_rust(
            "POLYNOMIAL",
            "Polynomial, `x = c01/(c10 + c01)`, `y = c20/c10`: factors of 1, x in `h_2`, of 1, x, x^2, y in `h_3`, "
            "of 1, x, x^2, x^3, y in `h_4`",
            [polynomial_row(nu) for nu in RATIOS],
        ),
    ]
    SOURCE.write_text("\n".join(lines) + "\n")
    subprocess.run(["rustfmt", "--edition", "2024", str(SOURCE)], check=True)
    print(f"wrote {SOURCE}")
