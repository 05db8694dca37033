"""`palpate fit` on the files of the examples: prints values with intervals, writes the scene and a picture."""

from __future__ import annotations

import shutil
from pathlib import Path

from command_line import run

from palpate.scene import Scene

EXAMPLES = Path(__file__).parents[3] / "examples"


def test_the_examples_are_fitted(tmp_path, shared_cache):
    for name in ("block.obj", "block.toml", "indentations.csv"):
        shutil.copy(EXAMPLES / name, tmp_path)
    result = run("fit", "indentations.csv", "block.toml", "--hold", "poissons_ratio", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "80 rows of 2 curves; 1 body solved" in result.stdout and "side: pressed at (20.0, 20.0" in result.stdout
    # Of 14.2 kPa on finer elements: those of the example are 2 to 3 % softer.
    modulus = Scene.read(tmp_path / "block-fitted.toml").material.youngs_modulus
    assert abs(modulus - 14.2e3) < 0.04 * 14.2e3
    assert (tmp_path / "indentations-fit.png").stat().st_size > 10_000
    wrong = run("fit", "indentations.csv", "block.toml", "--force-unit", "bar", cwd=tmp_path)
    assert wrong.returncode != 0 and "indentations.csv, line 2, column 'Force (mN)': unknown unit 'bar'" in wrong.stderr
