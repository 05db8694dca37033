"""Materials of a body, one or one for each region of its mesh."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate import units
from palpate.body.strain_law import StrainLaw, strain_law
from palpate.errors import BodyError, LockingWarning
from palpate.mesh import TetMesh
from palpate.units import brief_repr
from palpate.vectors import number

# Largest Poisson's ratio without volumetric locking to speak of, by nodes an element: 4-node tetrahedra cannot keep
# their volume without keeping their shape; 10-node ones can until the conditioning of K gives out.
LOCKING = {4: 0.45, 10: 0.499}


# Moduli beyond these, Pa, are no material's (the softest gels have 1, diamond 1e12), and their products with squares of
# lengths leave the range of doubles and floats somewhere on the way to a force.
SOFTEST, STIFFEST = 1e-6, 1e15
# Relative difference of a Young's modulus from that of a law's constants that is round-off.
SAME_MODULUS = 1e-9


@dataclass(frozen=True)
class Material:
    """Isotropic elastic material.

    Parameters
    ----------
    youngs_modulus
        Pa, positive, or text such as ``"10kPa"``. Laws with constants of their own derive it from them.
    poissons_ratio
        In (-1, 0.5). Nearly incompressible materials make elements lock: 4-node tetrahedra above about 0.45, 10-node
        ones hardly; a :class:`palpate.LockingWarning` says so.
    density
        kg/m^3, or text such as ``"1.2g/cm3"``.
    law
        Beyond small strain: ``"linear"`` as in the paper, ``"neo-hookean"``, ``"mooney-rivlin"`` (with `c10`, `c01`) or
        ``"yeoh"`` (with `c10`, `c20`, `c30`). Contacts of spheres follow it; :meth:`palpate.GreensFunction.solve` and
        ``touch`` are linear.
    c10, c01, c20, c30
        Constants of the reduced polynomial, Pa, as in Abaqus and CalculiX. ``E = 4 (1 + nu) (c10 + c01)``.

    Raises
    ------
    BodyError
        A constant that no material has.
    UnitError
        Text that is no quantity.

    """

    youngs_modulus: float | None = None
    poissons_ratio: float = 0.45
    density: float = 1000.0
    law: str = "linear"
    c10: float | None = None
    c01: float | None = None
    c20: float | None = None
    c30: float | None = None

    def __post_init__(self) -> None:
        density = units.density(self.density)
        ratio = number(self.poissons_ratio, "Poisson's ratio", BodyError)
        law, modulus = self._law_and_modulus(ratio)
        if not modulus > 0:
            raise BodyError(f"Young's modulus must be positive, got {modulus:g} Pa")
        if not SOFTEST <= modulus <= STIFFEST:
            raise BodyError(
                f"Young's modulus must lie between {SOFTEST:g} and {STIFFEST:g} Pa, got {modulus:g} Pa: "
                "a soft tissue has 1e3 to 1e5 Pa, rubber 1e6, steel 2e11"
            )
        if not -1 < ratio < 0.5:
            raise BodyError(f"Poisson's ratio must lie in (-1, 0.5), got {ratio:g}")
        if not (np.isfinite(density) and density >= 0):
            raise BodyError(f"density must not be negative, got {density:g} kg/m^3")
        for name, value in (("youngs_modulus", modulus), ("poissons_ratio", ratio), ("density", density)):
            object.__setattr__(self, name, value)
        law.terms(ratio)

    def _law_and_modulus(self, ratio: float) -> tuple[StrainLaw, float]:
        for name in ("c10", "c01", "c20", "c30"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, units.pressure(getattr(self, name)))
        law, shear = strain_law(self.law, {name: getattr(self, name) for name in ("c10", "c01", "c20", "c30")})
        if shear is None and self.youngs_modulus is None:
            raise BodyError(f"law '{self.law}' needs a Young's modulus, such as youngs_modulus = '10kPa'")
        given = None if self.youngs_modulus is None else units.pressure(self.youngs_modulus)
        if shear is None:
            return law, given
        modulus = 2.0 * (1.0 + ratio) * shear
        if given is not None and abs(given - modulus) > SAME_MODULUS * modulus:
            raise BodyError(
                f"law '{self.law}': its constants give a Young's modulus of {modulus:g} Pa, not {given:g} Pa; "
                "leave one out"
            )
        return law, modulus

    @property
    def strain_law(self) -> StrainLaw:
        """Law beyond small strain, with the ratios of its constants."""
        return self._law_and_modulus(self.poissons_ratio)[0]

    @property
    def strain_terms(self) -> np.ndarray:
        """Coefficients (3,) of a sphere's contact at finite strain; zero of a linear material."""
        return self.strain_law.terms(self.poissons_ratio)


def material_rows(mesh: TetMesh, material: Material | Mapping[int | str, Material]) -> np.ndarray:
    """Young's modulus, Poisson's ratio and density of each element, (m, 3)."""
    rows = np.empty((len(mesh.tets), 3))
    for region, m in _by_region(mesh, material).items():
        rows[mesh.regions == region] = (m.youngs_modulus, m.poissons_ratio, m.density)
    return rows


def strain_term_rows(mesh: TetMesh, material: Material | Mapping[int | str, Material]) -> np.ndarray:
    """Coefficients of a sphere's contact at finite strain of each element, (m, 3)."""
    rows = np.empty((len(mesh.tets), 3))
    for region, m in _by_region(mesh, material).items():
        rows[mesh.regions == region] = m.strain_terms
    return rows


def element_laws(
    mesh: TetMesh, material: Material | Mapping[int | str, Material]
) -> tuple[list[tuple[str, float, float]], np.ndarray]:
    """Laws beyond small strain with the ratios of their constants, and the number of that of each element (m,)."""
    known: list[tuple[str, float, float]] = []
    numbers = np.empty(len(mesh.tets), np.uint32)
    for region, m in _by_region(mesh, material).items():
        law = (m.strain_law.name, *m.strain_law.parameters)
        if law not in known:
            known.append(law)
        numbers[mesh.regions == region] = known.index(law)
    return known, numbers


def _by_region(mesh: TetMesh, material: Material | Mapping[int | str, Material]) -> dict[int, Material]:
    if isinstance(material, Material):
        table = {int(region): material for region in np.unique(mesh.regions)}
    elif isinstance(material, Mapping):
        table = {_region_number(mesh, region): m for region, m in material.items()}
    else:
        raise BodyError(f"material must be a palpate.Material, or one for each region, got {brief_repr(material)}")
    wrong = next((m for m in table.values() if not isinstance(m, Material)), None)
    if wrong is not None:
        raise BodyError(f"material of a region must be a palpate.Material, got {brief_repr(wrong)}")
    missing = sorted(set(np.unique(mesh.regions).tolist()) - set(table))
    if missing:
        names = {number: name for name, number in mesh.region_names.items()}
        region = names.get(missing[0], missing[0])
        raise BodyError(f"region {region} of the mesh has no material; given are {', '.join(map(str, material))}")
    return table


def _region_number(mesh: TetMesh, region: int | str) -> int:
    if not isinstance(region, str):
        return int(region)
    if region not in mesh.region_names:
        known = ", ".join(mesh.region_names) or "none"
        raise BodyError(f"the mesh has no region called '{region}'; it has {known}")
    return mesh.region_names[region]


def warn_of_locking(mesh: TetMesh, poissons_ratio: float) -> None:
    """Warn the caller of a body's constructor of elements too stiff for a ratio."""
    count = mesh.tets.shape[1]
    if poissons_ratio <= LOCKING[count]:
        return
    remedy = "10-node ones (mesh.to_quadratic()), " if count == 4 else ""
    warnings.warn(
        f"volumetric locking: {count}-node tetrahedra are too stiff at Poisson's ratio {poissons_ratio:g}, above "
        f"{LOCKING[count]}; {remedy}a smaller ratio or a finer mesh help",
        LockingWarning,
        stacklevel=3,
    )
