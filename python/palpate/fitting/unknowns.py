"""The unknowns of a fit: moduli by region, Poisson's ratio and constants of laws, as numbers of a vector and in tables.

Young's modulus `E` of ``[material]`` enters as its logarithm, that of a region as the logarithm of its ratio to it. All
forces then scale with `E` alone, exactly, for a body at rest without loads: static elasticity, Sneddon's and the
hyperelastic laws know no other pressure than the moduli. A change of `E` needs no new solution, that of a ratio does.
Constants of a law enter by their ratios: `c01 / (c10 + c01)`, `c20 / c10` and `c30 / c10`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.body import Material
from palpate.errors import FitError
from palpate.scene import Scene
from palpate.scene.regions import MaterialTable, RegionTable, SegmentTable

# Ratio of each law's constant, with its range: that of the table of contacts at finite strain.
RATIOS: dict[str, dict[str, tuple[float, float]]] = {
    "mooney-rivlin": {"c01": (0.0, 1.0)},
    "yeoh": {"c20": (0.0, 2.0), "c30": (0.0, 1.0)},
}
# Range of a logarithm, and of Poisson's ratio by law: elements of 10 nodes do not lock yet.
LOG_RANGE = 12.0
POISSON_RANGE, POISSON_RANGE_OF_CONSTANTS = (0.05, 0.495), (0.3, 0.495)


@dataclass(frozen=True)
class Unknown:
    """A number that is fitted."""

    name: str  # its key in the scene, such as ``region.0.youngs_modulus``
    # Value to begin with and its range, of a modulus its logarithm.
    start: float
    low: float
    high: float
    step: float  # change that differences are taken with
    telling: float  # half the width of an interval beyond which the data do not determine the number


@dataclass(frozen=True)
class Slot:
    """A table with a modulus of its own: its key in the scene, its place in the lists, and its material."""

    key: str
    rank: int | None
    table: MaterialTable | RegionTable | SegmentTable
    material: Material

    @property
    def name(self) -> str:
        """Its key and place, such as ``region.0``."""
        return self.key if self.rank is None else f"{self.key}.{self.rank}"


class Unknowns:
    """Slots of a scene's first body, and what may be fitted of them."""

    def __init__(self, scene: Scene):
        body = scene.bodies[0]
        self._scene = scene
        base = body.material or scene.material
        self.slots = [Slot("material", None, base, base.material())]
        regions = scene.region if body.region is None else body.region
        for key, tables in (("region", regions), ("segment", body.segment)):
            for rank, table in enumerate(tables):
                if table.youngs_modulus is not None or table.c10 is not None:
                    self.slots.append(Slot(key, rank, table, table.material(base)))
        self.all = [*self._moduli(), self._poissons_ratio(), *self._constants()]

    def _moduli(self) -> list[Unknown]:
        first = math.log(self.slots[0].material.youngs_modulus)
        found = [Unknown("material.youngs_modulus", first, -13.0, 34.0, 0.05, math.inf)]
        for slot in self.slots[1:]:
            ratio = math.log(slot.material.youngs_modulus) - first
            found.append(Unknown(f"{slot.name}.youngs_modulus", ratio, ratio - LOG_RANGE, ratio + LOG_RANGE, 0.05, 0.5))
        return found

    def _poissons_ratio(self) -> Unknown:
        laws = {slot.material.law for slot in self.slots}
        low, high = POISSON_RANGE_OF_CONSTANTS if laws & set(RATIOS) else POISSON_RANGE
        ratio = self.slots[0].material.poissons_ratio
        return Unknown("material.poissons_ratio", ratio, min(low, ratio), max(high, ratio), 0.01, 0.04)

    def _constants(self) -> list[Unknown]:
        found = []
        for slot in self.slots:
            ratios = RATIOS.get(slot.material.law, {})
            if slot.table.c10 is None:
                continue
            for (name, (low, high)), value in zip(ratios.items(), slot.material.strain_law.parameters, strict=False):
                width = high - low
                found.append(Unknown(f"{slot.name}.{name}", value, low, high, 0.05 * width, 0.25 * width))
        return found

    def solution_key(self, numbers: Mapping[str, float]) -> tuple[float, ...]:
        """All that decides the curves of a body whose first modulus is that of the scene."""
        return tuple(round(numbers[u.name], 12) for u in self.all[1:])

    def values(self, numbers: Mapping[str, float]) -> dict[str, float]:
        """Values of keys of the scene, in SI units, in the order of its tables."""
        found: dict[str, float] = {}
        for rank, slot in enumerate(self.slots):
            key, ratio = slot.name, self._ratio_of(slot, numbers)
            modulus = math.exp(numbers["material.youngs_modulus"])
            modulus *= math.exp(numbers[f"{key}.youngs_modulus"]) if rank else 1.0
            found[f"{key}.youngs_modulus"] = modulus
            half = modulus / (4.0 * (1.0 + ratio))
            if slot.material.law == "mooney-rivlin" and slot.table.c10 is not None:
                share = numbers[f"{key}.c01"]
                found |= {f"{key}.c10": (1.0 - share) * half, f"{key}.c01": share * half}
            if slot.material.law == "yeoh" and slot.table.c10 is not None:
                found |= {f"{key}.c10": half}
                found |= {f"{key}.{name}": numbers[f"{key}.{name}"] * half for name in ("c20", "c30")}
        found["material.poissons_ratio"] = numbers["material.poissons_ratio"]
        return found

    def _ratio_of(self, slot: Slot, numbers: Mapping[str, float]) -> float:
        own = slot.rank is not None and slot.table.poissons_ratio is not None
        return slot.material.poissons_ratio if own else numbers["material.poissons_ratio"]

    def changes(self, numbers: Mapping[str, float]) -> list[tuple[Slot, dict[str, float]]]:
        """Keys of each slot's table with their values: a law's constants replace the modulus where they stand."""
        values, found = self.values(numbers), []
        for slot in self.slots:
            prefix = f"{slot.name}."
            own = {name.removeprefix(prefix): v for name, v in values.items() if name.startswith(prefix)}
            given = slot.table.youngs_modulus is not None and "youngs_modulus" in slot.table.model_fields_set
            if "c10" in own and not given:
                own.pop("youngs_modulus")
            if slot.rank is None and own["poissons_ratio"] == slot.material.poissons_ratio:
                own.pop("poissons_ratio")
            found.append((slot, own))
        return found

    def scene_with(self, numbers: Mapping[str, float]) -> Scene:
        """Scene with these values."""
        scene, body = self._scene, self._scene.bodies[0]
        in_body: dict[str, Any] = {"segment": list(body.segment)}
        in_scene: dict[str, Any] = {"region": list(scene.region)}
        if body.region is not None:
            in_body["region"] = list(body.region)
        for slot, keys in self.changes(numbers):
            changed = slot.table.model_copy(update=keys)
            if slot.rank is None:
                (in_scene if body.material is None else in_body)["material"] = changed
            else:
                (in_body if slot.key == "segment" or body.region is not None else in_scene)[slot.key][slot.rank] = (
                    changed
                )
        return scene.model_copy(update={**in_scene, "bodies": [body.model_copy(update=in_body)]})


def chosen_to_fit(unknowns: Unknowns, hold: Sequence[str]) -> list[Unknown]:
    """Return the unknowns that are not held by name, or by the last part of it.

    Raises FitError for a name that there is not, or nothing left.
    """
    names = {u.name for u in unknowns.all}
    for name in hold:
        if name not in names and not any(other.endswith(f".{name}") for other in names):
            raise FitError(f"there is no '{name}' to hold; there are {', '.join(sorted(names))}")
    left = [u for u in unknowns.all if not any(u.name == name or u.name.endswith(f".{name}") for name in hold)]
    if not left:
        raise FitError("everything is held: leave something to fit")
    return left


def as_numbers(unknowns: Unknowns, free: Sequence[Unknown], vector: np.ndarray) -> dict[str, float]:
    """Return the numbers of all unknowns: those of a vector, and the start of the others."""
    return {u.name: u.start for u in unknowns.all} | {u.name: float(v) for u, v in zip(free, vector, strict=False)}
