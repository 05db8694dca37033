"""Hyperelastic laws of materials, by the constants that their authors use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate import _native
from palpate.errors import BodyError
from palpate.units import brief_repr

# Constants of each law, Pa, the first of which it must have. The others are zero where they are not given.
CONSTANTS: dict[str, tuple[str, ...]] = {
    "linear": (),
    "neo-hookean": (),
    "mooney-rivlin": ("c10", "c01"),
    "yeoh": ("c10", "c20", "c30"),
}


@dataclass(frozen=True)
class StrainLaw:
    """A material beyond small strain, as the native module takes it."""

    name: str = "linear"  # one of :data:`CONSTANTS`
    # Ratios of its constants: `c01 / (c10 + c01)` of Mooney and Rivlin, `c20 / c10` and `c30 / c10` of Yeoh.
    parameters: tuple[float, float] = (0.0, 0.0)

    def terms(self, poissons_ratio: float) -> np.ndarray:
        """Return the three coefficients of a sphere's contact at finite strain.

        Raises BodyError for a material that the table of coefficients does not reach.
        """
        if self.name == "linear":
            return np.zeros(3)
        terms = _native.strain_terms(self.name, *self.parameters, poissons_ratio)
        if terms is None:
            raise BodyError(f"law '{self.name}': {_range_of(self.name)}, got {self._given(poissons_ratio)}")
        return np.array(terms)

    def _given(self, poissons_ratio: float) -> str:
        names = {"mooney-rivlin": ["c01/(c10 + c01)"], "yeoh": ["c20/c10", "c30/c10"]}.get(self.name, [])
        given = [f"{name} = {value:g}" for name, value in zip(names, self.parameters, strict=False)]
        return ", ".join([f"Poisson's ratio {poissons_ratio:g}", *given])


def _range_of(name: str) -> str:
    return {
        "mooney-rivlin": "Poisson's ratio must be at least 0.3, and c10 and c01 must not be negative",
        "yeoh": "Poisson's ratio must be at least 0.3, c20/c10 lie between 0 and 2, c30/c10 between 0 and 1",
    }.get(name, "unknown")


def strain_law(name: str, constants: dict[str, float | None]) -> tuple[StrainLaw, float | None]:
    """Return the law and the shear modulus at small strain, Pa, which a law without constants leaves open.

    Raises BodyError for a law that is unknown, or constants that are missing, negative in sum or those of another law.
    """
    if name not in CONSTANTS:
        raise BodyError(f"law must be one of {', '.join(map(repr, CONSTANTS))}, got {brief_repr(name)}")
    own = CONSTANTS[name]
    foreign = next((key for key, value in constants.items() if value is not None and key not in own), None)
    if foreign is not None:
        raise BodyError(f"'{foreign}' does not belong to law '{name}', which has {' and '.join(own) or 'no constants'}")
    if not own:
        return StrainLaw(name), None
    if constants["c10"] is None:
        raise BodyError(f"law '{name}' needs {', '.join(own)}: 'c10' is missing")
    values = {key: constants[key] or 0.0 for key in own}
    half = values["c10"] + values.get("c01", 0.0)
    if not (half > 0.0 and values["c10"] >= 0.0 and np.isfinite(list(values.values())).all()):
        raise BodyError(f"law '{name}': c10 must be positive, got {values['c10']:g} Pa")
    if name == "mooney-rivlin":
        return StrainLaw(name, (values["c01"] / half, 0.0)), 2.0 * half
    return StrainLaw(name, (values["c20"] / half, values["c30"] / half)), 2.0 * half
