from __future__ import annotations

import numpy as np
import pytest

import palpate
from palpate.body import parse

NODES = np.random.default_rng(0).uniform(-0.1, 0.1, (200, 3))
X, Y, Z = NODES.T


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("z < 0.01", Z < 0.01),
        ("z < 10mm", Z < 0.01),
        ("z < min + 5 mm", Z < Z.min() + 0.005),
        ("x > max - 2cm or not (y >= 0)", (X > X.max() - 0.02) | ~(Y >= 0)),
        ("-0.02 < x <= 3e-2", (X > -0.02) & (X <= 0.03)),
        ("x*x + y*y < 0.0025", X**2 + Y**2 < 0.0025),
    ],
)
def test_masks(text, expected):
    assert np.array_equal(parse(text)(NODES), expected)
    assert 0 < expected.sum() < len(NODES)


@pytest.mark.parametrize(
    "text",
    ["", "z", "1 < 2", "z < 0.01 and", "__import__('os')", "z < open('f')", "z.real < 1", "z[0] < 1", "z < w", "z == 0",
     "z < 'a'", "(lambda: z)() < 1", "z < True", "(" * 300 + "z < 1" + ")" * 300, "z < 9**9**9"],
)  # fmt: skip
def test_anything_else_is_refused(text):
    with pytest.raises(palpate.Error, match="predicate"):
        parse(text)
