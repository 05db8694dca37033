"""The one check of three numbers that users give."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.errors import BodyError, SceneError
from palpate.vectors import brief, three_components, three_numbers


@pytest.mark.parametrize("given", [(1, 2, 3), [1.0, 2, np.float32(3)], np.array([1, 2, 3]), iter((1, 2, 3))])
def test_three_finite_numbers_are_taken(given):
    taken = three_numbers(given, "a point", SceneError)
    assert taken == (1.0, 2.0, 3.0) and all(type(v) is float for v in taken)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ((1, 2), "a point needs three numbers, got 2"),
        (np.zeros((3, 3)), "a point needs three numbers"),
        (5.0, "a point needs three numbers"),
        (None, "a point needs three numbers"),
        ("123", "a point needs three numbers"),
        ((1, True, 2), "a point needs three numbers"),
        ((1, None, 2), "a point needs three numbers"),
        ((1, 2j, 2), "a point needs three numbers"),
        ((1, np.nan, 2), "a point has a number that is not finite"),
        ((1, np.inf, 2), "a point has a number that is not finite"),
    ],
)
def test_anything_else_is_refused_by_name(given, message):
    with pytest.raises(SceneError, match=f"^{message}$"):
        three_numbers(given, "a point", SceneError)


def test_a_component_may_be_left_free():
    assert three_components((None, 0, None), "displacement", BodyError) == (None, 0.0, None)
    with pytest.raises(BodyError, match="displacement needs three numbers, got 1"):
        three_components((None,), "displacement", BodyError)


def test_numbers_are_written_in_short():
    assert brief(np.array([0.0123456, 0.0, -1.5])) == "[0.01235, 0, -1.5]"
