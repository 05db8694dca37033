"""``[[loads]]``: reference loads of the body."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import model_validator

from palpate.body import Body, Loads, gravity_error, parse
from palpate.scene.table import Acceleration, ForceVector, SignedPressure, Table, explained


class LoadTable(Table):
    """One load: gravity, a pressure on a part of the surface, or a force, which acts in full on each of ``nodes``."""

    gravity: Acceleration | None = None
    """Acceleration of the whole body, m/s^2."""
    pressure: SignedPressure | None = None
    """Pressure on a part of the surface."""
    force: ForceVector | None = None
    """Force on a part of the surface, spread evenly, or on each of `nodes`."""
    on: str | None = None
    """Predicate over `x`, `y`, `z` that selects the part of the surface."""
    nodes: list[int] | None = None
    """Numbers of the nodes on which the force acts."""

    @model_validator(mode="after")
    def _one_load(self) -> LoadTable:
        if sum(load is not None for load in (self.gravity, self.pressure, self.force)) != 1:
            raise ValueError("give exactly one of gravity, pressure and force")
        if self.gravity is not None and not (self.on is None and self.nodes is None):
            raise ValueError("gravity acts on the whole body: leave 'on' and 'nodes' out")
        mistake = None if self.gravity is None else gravity_error(self.gravity)
        if mistake is not None:
            raise ValueError(mistake)
        if self.pressure is not None and (self.on is None or self.nodes is not None):
            raise ValueError("a pressure acts on a part of the surface, such as on = 'z > max - 1mm'")
        if self.force is not None and (self.on is None) == (self.nodes is None):
            raise ValueError(
                "a force is spread over a part of the surface, on = '...', or acts on each of nodes = [...]"
            )
        if self.on is not None:
            with explained():
                parse(self.on)
        return self

    def check(self, body: Body) -> None:
        """Refuse a load that finds nothing to act on.

        Raises BodyError for a node that does not exist, or a predicate that holds on no face of the surface.
        """
        loads = together([self])
        assert loads is not None
        loads.nodal(body.mesh, body.element_materials)


def together(tables: Sequence[LoadTable]) -> Loads | None:
    """Sum of the tables; None for none."""
    if not tables:
        return None
    gravity = [sum(g) for g in zip((0.0, 0.0, 0.0), *(t.gravity for t in tables if t.gravity), strict=True)]
    forces: dict[int, list[float]] = {}
    for table in tables:
        for node in table.nodes or ():
            forces[node] = [a + b for a, b in zip(forces.get(node, [0.0] * 3), table.force or (), strict=True)]
    return Loads(
        gravity=gravity,
        pressure=[(parse(t.on), t.pressure) for t in tables if t.on is not None and t.pressure is not None],
        spread=[(parse(t.on), t.force) for t in tables if t.on is not None and t.force is not None],
        forces=forces,
    )
