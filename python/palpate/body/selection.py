"""Sets of nodes, as users name them: indices, a mask, a function of the positions, or a predicate.

A predicate that a user types is parsed against a whitelist, never executed as code: ``z < 0.01``, ``z < min + 5mm``,
``x > 2cm and not (y >= 0 or z < 1e-3)``. Bare numbers are metres; ``min`` and ``max`` are the body's bounds along the
axis on the other side of the comparison.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from palpate.errors import BodyError
from palpate.units import LENGTH_UNITS

Selection = Sequence[int] | np.ndarray | Callable[[np.ndarray], np.ndarray]
AXES = {"x": 0, "y": 1, "z": 2}
COMPARE = {ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal}
ARITHMETIC = {ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide}
_NUMBER_WITH_UNIT = re.compile(rf"(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+)\s*({'|'.join(LENGTH_UNITS)})\b", re.ASCII)
MAX_LENGTH = 500


def node_indices(values: Any, count: int, what: str) -> np.ndarray:
    """Check a list of nodes or an (n,) mask, as indices below ``count``; ``what`` names it in messages.

    Raises BodyError for a mask of the wrong length, an index out of range, anything else.
    """
    array = np.asarray(values)
    if array.dtype == bool:
        if array.shape != (count,):
            raise BodyError(f"a mask for {what} must have length {count}, got shape {array.shape}")
        return np.flatnonzero(array)
    if array.size == 0:
        return np.empty(0, dtype=np.int64)
    if array.ndim != 1 or not np.issubdtype(array.dtype, np.integer):
        raise BodyError(f"{what} nodes must be a one-dimensional list of integers or a mask")
    bad = array[(array < 0) | (array >= count)]
    if bad.size:
        raise BodyError(f"{what} node {bad[0]} does not exist: the mesh has nodes 0 to {count - 1}")
    return array.astype(np.int64)


def selected_nodes(selection: Selection, nodes: np.ndarray, what: str) -> np.ndarray:
    """Like :func:`node_indices`, for a function of the (n, 3) positions too."""
    if callable(selection):
        selection = np.asarray(selection(nodes))
        if selection.dtype != bool:
            raise BodyError(f"the function for {what} must return a boolean mask of length {len(nodes)}")
    return node_indices(selection, len(nodes), what)


def parse(text: str) -> Callable[[np.ndarray], np.ndarray]:
    """Turn a predicate into a function of the (n, 3) node positions that returns an (n,) mask.

    Raises BodyError for anything that is not a comparison of x, y, z with numbers, joined by and, or, not; the message
    shows where. The function raises it for a division by zero.
    """
    if len(text) > MAX_LENGTH:
        raise BodyError(f"a predicate may have at most {MAX_LENGTH} characters")
    plain = _NUMBER_WITH_UNIT.sub(lambda m: f"({m[1]}*{LENGTH_UNITS[m[2]]!r})", text)
    try:
        tree = ast.parse(plain.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise BodyError(f"cannot read the predicate '{text}': write for example 'z < 0.01 and x > 2cm'") from None
    _check(tree, text, plain.strip())

    def holds(nodes: np.ndarray) -> np.ndarray:
        try:
            with np.errstate(divide="raise", invalid="raise", over="raise", under="ignore"):
                return _truth(tree, np.asarray(nodes))
        except (FloatingPointError, OverflowError) as error:
            # numpy says "divide by zero", or "invalid value" for 0/0.
            large = "flow" in str(error) or "large" in str(error)
            what = "has a number that is too large" if large else "divides by zero"
            raise BodyError(f"the predicate '{text}' {what}") from None

    return holds


def _refuse(node: ast.AST, text: str, plain: str) -> BodyError:
    part = ast.get_source_segment(plain, node) or type(node).__name__
    return BodyError(f"'{part}' is not allowed in the predicate '{text}': compare x, y, z with numbers")


def _check(node: ast.AST, text: str, plain: str) -> None:
    """Walk the whole tree once; whatever passes can be evaluated."""
    if isinstance(node, ast.BoolOp):
        for value in node.values:
            _check(value, text, plain)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        _check(node.operand, text, plain)
    elif isinstance(node, ast.Compare) and all(type(op) in COMPARE for op in node.ops):
        sides = [node.left, *node.comparators]
        for side in sides:
            _check_number(side, text, plain)
        if not any(_axes(side) for side in sides):
            raise _refuse(node, text, plain)
    else:
        raise _refuse(node, text, plain)


def _check_number(node: ast.AST, text: str, plain: str) -> None:
    if isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
        _check_number(node.left, text, plain)
        _check_number(node.right, text, plain)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        _check_number(node.operand, text, plain)
    elif not (
        (isinstance(node, ast.Name) and node.id in {*AXES, "min", "max"})
        or (isinstance(node, ast.Constant) and type(node.value) in {int, float})
    ):
        raise _refuse(node, text, plain)


def _axes(node: ast.AST) -> set[str]:
    return {n.id for n in ast.walk(node) if isinstance(n, ast.Name) and n.id in AXES}


def _truth(node: ast.AST, nodes: np.ndarray) -> np.ndarray:
    if isinstance(node, ast.BoolOp):
        combine = np.logical_and if isinstance(node.op, ast.And) else np.logical_or
        return combine.reduce([_truth(value, nodes) for value in node.values])
    if isinstance(node, ast.UnaryOp):
        return ~_truth(node.operand, nodes)
    assert isinstance(node, ast.Compare)
    sides = [node.left, *node.comparators]
    axis = AXES[sorted(set().union(*(_axes(side) for side in sides)))[0]]
    values = [_number(side, nodes, axis) for side in sides]
    pairs = zip(node.ops, values, values[1:], strict=False)
    mask = np.logical_and.reduce([np.broadcast_to(COMPARE[type(op)](a, b), len(nodes)) for op, a, b in pairs])
    return np.array(mask, dtype=bool)


def _number(node: ast.AST, nodes: np.ndarray, axis: int) -> np.ndarray | float:
    if isinstance(node, ast.BinOp):
        return ARITHMETIC[type(node.op)](_number(node.left, nodes, axis), _number(node.right, nodes, axis))
    if isinstance(node, ast.UnaryOp):
        value = _number(node.operand, nodes, axis)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.Name):
        if node.id in AXES:
            return nodes[:, AXES[node.id]]
        return float(getattr(nodes[:, axis], node.id)())
    assert isinstance(node, ast.Constant)
    return float(node.value)
