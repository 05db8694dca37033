//! Chapter 1 of docs/theory.md: isoparametric elements, their shape functions, derivatives and rules of quadrature.
//!
//! An element maps the reference tetrahedron with corners `0, e_1, e_2, e_3` to `x(xi) = sum_a N_a(xi) x_a`; its faces
//! map the triangle of barycentric coordinates in the same way. Node order is VTK's: corners, then the middles of the
//! edges 01, 12, 02, 03, 13, 23 of a tetrahedron and 01, 12, 20 of a triangle.
//!
//! One element a file, behind [`Tetrahedron`] or [`Face`]; which one is chosen outside all loops.

mod quadrature;
mod tet10;
mod tet4;
mod tri3;
mod tri6;

use glam::{DMat3, DVec3};

pub use quadrature::Point;
pub use tet4::Tet4;
pub use tet10::Tet10;
pub use tri3::Tri3;
pub use tri6::Tri6;

/// A tetrahedron with `N` nodes.
pub trait Tetrahedron<const N: usize>: Sync {
    /// Reference coordinates of the nodes.
    const NODES: [DVec3; N];

    /// Shape functions at `xi`.
    fn shapes(xi: DVec3) -> [f64; N];

    /// Derivatives of the shape functions by `xi`.
    fn derivatives(xi: DVec3) -> [DVec3; N];

    /// Rule for the stiffness of an element with these nodes.
    fn stiffness_rule(nodes: &[DVec3; N]) -> &'static [Point];

    /// Rule that is exact for the mass, and so for the volume, of an element with these nodes.
    fn mass_rule(nodes: &[DVec3; N]) -> &'static [Point];
}

/// A face with `N` nodes, over barycentric coordinates.
pub trait Face<const N: usize> {
    /// The flat triangles a face is drawn and searched by: local nodes of each.
    const PARTS: &'static [[usize; 3]];

    /// Barycentric coordinates of the nodes.
    const NODES: [DVec3; N];

    /// Shape functions at the barycentric coordinates `l`.
    fn shapes(l: DVec3) -> [f64; N];

    /// Derivatives of each shape function along the edges from corner 0 to corners 1 and 2.
    fn derivatives(l: DVec3) -> [[f64; 2]; N];
}

/// `dx/dxi`, from the nodes (m) and the derivatives of the shape functions.
fn jacobian<const N: usize>(nodes: &[DVec3; N], derivatives: &[DVec3; N]) -> DMat3 {
    let mut columns = [DVec3::ZERO; 3];
    for (x, d) in nodes.iter().zip(derivatives) {
        columns[0] += *x * d.x;
        columns[1] += *x * d.y;
        columns[2] += *x * d.z;
    }
    DMat3::from_cols(columns[0], columns[1], columns[2])
}

/// Gradients of the shape functions in space (1/m) and the volume (m^3) that a point of a rule stands for.
///
/// `grad N_a = J^-T dN_a/dxi`; the rows of `J^-1` are the cross products of the columns of `J` over its determinant.
pub fn gradients<E: Tetrahedron<N>, const N: usize>(nodes: &[DVec3; N], point: &Point) -> ([DVec3; N], f64) {
    let derivatives = E::derivatives(point.xi);
    let j = jacobian(nodes, &derivatives);
    let (u, v, w) = (j.x_axis, j.y_axis, j.z_axis);
    let determinant = u.cross(v).dot(w);
    let rows = [v.cross(w) / determinant, w.cross(u) / determinant, u.cross(v) / determinant];
    (derivatives.map(|d| rows[0] * d.x + rows[1] * d.y + rows[2] * d.z), point.weight * determinant)
}

/// Determinant of `dx/dxi` at `xi`, m^3: six volumes where the element is straight, and not positive where it is
/// inverted.
pub fn determinant<E: Tetrahedron<N>, const N: usize>(nodes: &[DVec3; N], xi: DVec3) -> f64 {
    jacobian(nodes, &E::derivatives(xi)).determinant()
}

/// Least and largest determinant of `dx/dxi` over the nodes and the points of both rules, m^3.
pub fn determinant_range<E: Tetrahedron<N>, const N: usize>(nodes: &[DVec3; N]) -> [f64; 2] {
    let rules = E::stiffness_rule(nodes).iter().chain(E::mass_rule(nodes)).map(|p| p.xi);
    E::NODES.into_iter().chain(rules).map(|xi| determinant::<E, N>(nodes, xi)).fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[low, high], d| {
            // A determinant that is not a number is the least of all.
            let low = if d.is_nan() { f64::NEG_INFINITY } else { low.min(d) };
            [low, high.max(d)]
        },
    )
}

/// Volume, m^3.
pub fn volume<E: Tetrahedron<N>, const N: usize>(nodes: &[DVec3; N]) -> f64 {
    E::mass_rule(nodes).iter().map(|p| p.weight * determinant::<E, N>(nodes, p.xi)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nodality<E: Tetrahedron<N>, const N: usize>() {
        for (a, &xi) in E::NODES.iter().enumerate() {
            for (b, n) in E::shapes(xi).into_iter().enumerate() {
                assert!((n - f64::from(u8::from(a == b))).abs() < 1e-15, "N_{b} at node {a}");
            }
        }
        let xi = DVec3::new(0.21, 0.17, 0.4);
        assert!((E::shapes(xi).iter().sum::<f64>() - 1.0).abs() < 1e-15);
        let step = 1e-6;
        for (axis, e) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
            let (ahead, behind) = (E::shapes(xi + step * e), E::shapes(xi - step * e));
            for a in 0..N {
                let slope = (ahead[a] - behind[a]) / (2.0 * step);
                assert!((slope - E::derivatives(xi)[a][axis]).abs() < 1e-9);
            }
        }
    }

    fn face_nodality<F: Face<N>, const N: usize>() {
        for (a, &l) in F::NODES.iter().enumerate() {
            for (b, n) in F::shapes(l).into_iter().enumerate() {
                assert!((n - f64::from(u8::from(a == b))).abs() < 1e-15, "N_{b} at node {a}");
            }
        }
        let (l, step) = (DVec3::new(0.5, 0.2, 0.3), 1e-6);
        for (k, e) in [DVec3::new(-1.0, 1.0, 0.0), DVec3::new(-1.0, 0.0, 1.0)].into_iter().enumerate() {
            let (ahead, behind) = (F::shapes(l + step * e), F::shapes(l - step * e));
            for a in 0..N {
                assert!(((ahead[a] - behind[a]) / (2.0 * step) - F::derivatives(l)[a][k]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn shape_functions_are_nodal_sum_to_one_and_have_these_derivatives() {
        nodality::<Tet4, 4>();
        nodality::<Tet10, 10>();
        face_nodality::<Tri3, 3>();
        face_nodality::<Tri6, 6>();
    }

    #[test]
    fn volume_of_a_bent_element() {
        // The edge 12 pushed out by d: V = 1/6 + int of the bulge, cubic in the nodes; against a fine sampling.
        let mut nodes = <Tet10 as Tetrahedron<10>>::NODES;
        nodes[5] += DVec3::new(0.1, 0.12, -0.05);
        let exact = volume::<Tet10, 10>(&nodes);
        let count = 60;
        let h = 1.0 / f64::from(count);
        let mut sampled = 0.0;
        for (i, j, k) in (0..count * count * count).map(|c| (c / (count * count), c / count % count, c % count)) {
            // Duffy's map of the midpoints of a cube's cells.
            let [u, v, w] = [i, j, k].map(|i| (f64::from(i) + 0.5) * h);
            let xi = DVec3::new(u, (1.0 - u) * v, (1.0 - u) * (1.0 - v) * w);
            let part = (1.0 - u) * (1.0 - u) * (1.0 - v) * h * h * h;
            sampled += part * determinant::<Tet10, 10>(&nodes, xi);
        }
        assert!((exact - sampled).abs() < 1e-4 * exact, "{exact} {sampled}");
        assert!((exact - 1.0 / 6.0).abs() > 0.01);
    }
}
