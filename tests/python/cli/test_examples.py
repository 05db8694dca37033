"""Every example runs and passes its own checks."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda p: p.stem)
def test_example(example, tmp_path):
    result = subprocess.run([sys.executable, example], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr


CHUNKS = [text.split("```")[0] for text in (ROOT / "docs" / "dynamics.md").read_text().split("```python\n")[1:]]


@pytest.mark.parametrize("code", CHUNKS, ids=["scene", "newmark"])
def test_the_examples_of_the_page_on_motion(code):
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    assert "kinetic=" in result.stdout


def test_the_example_of_the_readme():
    code = (ROOT / "README.md").read_text().split("```python\n")[1].split("```")[0]
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    body, device = (float(line.split("]")[0].split()[-1]) for line in result.stdout.splitlines())
    assert body < 0 < device  # pushed down, the body pushes the device up
