"""What a precomputation will do and need, counted before any number is computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate import _native
from palpate.body import Body, problem_arrays
from palpate.green.memory import allowed_memory, memory_in_use


@dataclass(frozen=True)
class Plan:
    """Counts of a precomputation.

    Attributes
    ----------
    precision
        Stored number format it is counted for. One that the body chooses is known only when columns have been measured:
        the counts are then those of the best that the memory allows, the most that will be needed.
    free_dofs, columns, rows
        Order of the matrix, and shape of the operator.
    factor_entries, factor_flops
        Numbers in the Cholesky factor, and operations to compute it.
    sweep_flops
        Operations to compute the columns by sweeps through the elimination tree, the route taken.
    surface_last_flops
        Least number of operations of the other route: all touchable dofs ordered last, their dense block inverted.
    block, tasks
        Columns solved together, and blocks solved at a time.
    memory
        Peak memory of the process, bytes: what it held when the plan was made, and what the precomputation adds.
    store
        Size of the operator in its file, bytes.

    """

    precision: str
    free_dofs: int
    columns: int
    rows: int
    factor_entries: int
    factor_flops: float
    sweep_flops: float
    surface_last_flops: float
    block: int
    tasks: int
    memory: int
    store: int

    def __str__(self) -> str:
        """Two lines for people."""
        factor, sweeps, other = (
            f"{n / 1e9:.3g}" for n in (self.factor_flops, self.sweep_flops, self.surface_last_flops)
        )
        return (
            f"{self.columns} columns of {self.rows} rows: factor {factor} Gflop, columns {sweeps} Gflop by sweeps "
            f"(surface last: at least {other})\n"
            f"peak memory {self.memory / 1e9:.2f} GB, {self.tasks} tasks with {self.block} columns each, "
            f"store {self.store / 1e9:.3g} GB in {self.precision}"
        )


def plan(
    body: Body,
    *,
    precision: str | None = None,
    touch: Sequence[int] | np.ndarray | None = None,
    memory: int | str | None = None,
) -> Plan:
    """Count what :func:`palpate.precompute` would do with the same arguments.

    Raises
    ------
    BodyError
        A bound of memory that cannot be kept, and what it refuses.

    """
    body.require_supported()
    problem = problem_arrays(body, touch)
    used = memory_in_use()
    counts = _native.GreenCore.plan(problem, precision, None if memory is None else allowed_memory(memory))
    return Plan(**{**counts, "memory": used + counts["memory"]})
