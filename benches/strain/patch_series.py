"""A half-space under a patch of pressure: Taylor series of the mean displacement by the force.

The pressure `(1 - r^2/b^2)^2 / int` presses with the force F, and the displacement weighted by it is

    q = sum over n of h_n F^n / (E^n b^(2 n - 1))

`h_1` is `0.766544 (1 - nu^2)` in closed form. The stress is a power series at every point of quadrature, so that no
difference loses digits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from benches.strain.axisymmetric import Cylinder, graded
from benches.strain.materials import Material, NeoHookean, ReducedPolynomial, shear_modulus

# Orders from 0 on; the fourth order of the displacement needs the fourth of the stress.
ORDERS = 5
# Size of elements below the patch over its radius, growth outwards, radius and height of the cylinder over that of the
# patch.
FINE, GROWTH, EXTENT = 1 / 10, 1.35, 3000.0
Series = list[np.ndarray]


def half_space_terms(material: Material) -> np.ndarray:
    """Return `h_1` to `h_4` of a material of `E = 1`."""
    r, z = graded(FINE, 1.5, GROWTH, EXTENT), graded(FINE, 1.0, GROWTH, EXTENT)
    cylinder = Cylinder(r, -z, material)
    load = patch_weights(cylinder)
    _, stiffness = cylinder._internal(np.zeros_like(cylinder.nodes), True)
    free = cylinder._free
    factor = splu(stiffness[free][:, free].tocsc())
    fields, terms = [], []
    right = -load
    for order in range(1, ORDERS):
        field = np.zeros(load.size)
        field[free] = factor.solve(right[free])
        fields.append(field)
        terms.append(-float(load @ field))
        if order + 1 < ORDERS:
            right = -_internal_part(cylinder, material, fields, order + 1)
    # Positive along the force.
    return np.array(terms)


def patch_weights(cylinder: Cylinder, radius: float = 1.0) -> np.ndarray:
    """Return the weights of the patch of a radius, m, along z."""
    at = cylinder.nodes[cylinder._edges][:, :, 0] @ cylinder._edge_shape.T / radius
    pressure = np.where(at < 1.0, (1.0 - np.minimum(at, 1.0) ** 2) ** 2, 0.0) * cylinder._edge_weight
    load = np.zeros(cylinder.nodes.shape)
    np.add.at(load[:, 1], cylinder._edges, pressure @ cylinder._edge_shape)
    return load.ravel() / pressure.sum()


def _internal_part(cylinder: Cylinder, material: Material, fields: Series, order: int) -> np.ndarray:
    """Return the internal forces of one order of the sum of fields of order 1, 2, ..."""
    gradients = [np.einsum("eqki,ei->eqk", cylinder._b, field[cylinder._dofs]) for field in fields]
    deformation = [_matrix(g) for g in gradients]
    identity = np.broadcast_to(np.eye(3), deformation[0].shape)
    deformation = [identity, *deformation]
    deformation += [np.zeros_like(deformation[1])] * (ORDERS - len(deformation))
    stress = _stress(material, deformation)[order]
    packed = np.stack(
        [stress[..., 0, 0], stress[..., 0, 1], stress[..., 1, 0], stress[..., 1, 1], stress[..., 2, 2]], -1
    )
    forces = np.zeros(fields[0].size)
    np.add.at(forces, cylinder._dofs, np.einsum("eq,eqk,eqki->ei", cylinder._weight, packed, cylinder._b))
    return forces


def _matrix(gradient: np.ndarray) -> np.ndarray:
    whole = np.zeros((*gradient.shape[:-1], 3, 3))
    whole[..., 0, 0], whole[..., 0, 1] = gradient[..., 0], gradient[..., 1]
    whole[..., 1, 0], whole[..., 1, 1], whole[..., 2, 2] = gradient[..., 2], gradient[..., 3], gradient[..., 4]
    return whole


def _stress(material: Material, f: Series) -> Series:
    """Return the first Piola stress by order."""
    inverse = _inverse(f)
    log = _log_determinant(f, inverse)
    against = [_transposed(x) for x in inverse]
    mu, nu = shear_modulus(material.youngs_modulus, material.poissons_ratio), material.poissons_ratio
    if isinstance(material, NeoHookean):
        lame = 2.0 * mu * nu / (1.0 - 2.0 * nu)
        pressed = _times(log, against)
        return [mu * (a - b) + lame * c for a, b, c in zip(f, against, pressed, strict=True)]
    if not isinstance(material, ReducedPolynomial):
        raise TypeError(f"no series of {type(material).__name__}")
    return _polynomial(material.coefficients(), f, against, log)


def _polynomial(c: dict[str, float], f: Series, against: Series, log: Series) -> Series:
    i1, cauchy = _trace_of(f, f), _times([_transposed(x) for x in f], f)
    shrunk = _exponential([-2.0 / 3.0 * x for x in log])
    excess = _shifted(_times(i1, shrunk), -3.0)
    slope = [2.0 * c["c20"] * x + 3.0 * c["c30"] * y for x, y in zip(excess, _times(excess, excess), strict=True)]
    slope = _shifted(slope, c["c10"])
    by_f = [2.0 * x - 2.0 / 3.0 * y for x, y in zip(f, _times(i1, against), strict=True)]
    first = _times(_times(shrunk, slope), by_f)
    i2 = [0.5 * (x - y) for x, y in zip(_times(i1, i1), _trace_of(cauchy, cauchy), strict=True)]
    parts = zip(_times(i1, f), _times(f, cauchy), _times(i2, against), strict=True)
    second = _times(_times(shrunk, shrunk), [2.0 * x - 2.0 * y - 4.0 / 3.0 * z for x, y, z in parts])
    volume = _exponential(log)
    pressed = _times(_times(_shifted(volume, -1.0), volume), against)
    return [x + c["c01"] * y + c["bulk"] * z for x, y, z in zip(first, second, pressed, strict=True)]


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Multiply two matrices, or a number and either."""
    both = a.ndim >= 4 and b.ndim >= 4
    if both:
        return a @ b
    if a.ndim == b.ndim:
        return a * b
    return (a[..., None, None] if a.ndim < b.ndim else a) * (b[..., None, None] if b.ndim < a.ndim else b)


def _times(a: Series, b: Series) -> Series:
    return [sum(_product(a[k], b[n - k]) for k in range(n + 1)) for n in range(len(a))]


def _trace_of(a: Series, b: Series) -> Series:
    return [sum(np.einsum("...ij,...ij", a[k], b[n - k]) for k in range(n + 1)) for n in range(len(a))]


def _shifted(a: Series, by: float) -> Series:
    return [a[0] + by, *a[1:]]


def _transposed(a: np.ndarray) -> np.ndarray:
    return np.swapaxes(a, -1, -2)


def _inverse(f: Series) -> Series:
    x = [f[0]]
    for n in range(1, len(f)):
        x.append(-sum(f[k] @ x[n - k] for k in range(1, n + 1)))
    return x


def _log_determinant(f: Series, inverse: Series) -> Series:
    log: list[Any] = [np.zeros(f[0].shape[:-2])]
    for n in range(1, len(f)):
        traces = [k * np.einsum("...ij,...ji", inverse[n - k], f[k]) for k in range(1, n + 1)]
        log.append(sum(traces) / n)
    return log


def _exponential(log: Series) -> Series:
    e = [np.ones_like(log[0])]
    for n in range(1, len(log)):
        e.append(sum(k * log[k] * e[n - k] for k in range(1, n + 1)) / n)
    return e
