//! Correction for finite strain below an ellipsoid, and below a sphere near a corner.
//!
//! Pressure cells give the energy `U` of a linear half-space. A sphere of radius `L` stores `U = 8/15 E* L^3 s^5`, `s = sqrt(d/L)`
//! (Hertz), and beyond small strain (`contact::local::finite_strain`)
//!
//! ```text
//! G(U, E*, L) = U h(s),    h = 1 + sum_k q_k s^k / (1 + k/5)        dG/dU = g = 1 + sum_k q_k s^k
//! ```
//!
//! An ellipsoid counts as the sphere of the Gaussian curvature at its pole along the contact's normal: with the normal `m` in its
//! own frame, `L = a b c / (a^2 m_x^2 + b^2 m_y^2 + c^2 m_z^2)`. As a function of `U`, `G` keeps one energy: forces are scaled by `g`,
//! and those from the derivatives by `E*`, `q` and `L` are added.

use glam::{DMat3, DVec3};

use super::half_space::{HalfSpace, Indentation};
use crate::contact::footprint::Footprint;
use crate::contact::shape::ToolShape;
use crate::math::pow;

/// Largest `s`: beyond it the factor of the force stays.
const DEEPEST: f64 = 1.25;

/// The indentation by an ellipsoid or a sphere with the correction; of another shape as it is. `modulus_by_rotation` is the gradient of `E*`.
pub fn correct_shape(
    linear: Indentation,
    (shape, rotation): (&ToolShape, DMat3),
    half_space: &HalfSpace,
    footprint: &Footprint,
    modulus_by_rotation: DVec3,
) -> Indentation {
    let semi_axes = match *shape {
        ToolShape::Ellipsoid { semi_axes } => semi_axes,
        ToolShape::Sphere { radius } => DVec3::splat(radius),
        _ => return linear,
    };
    let (energy, terms) = (linear.energy, half_space.strain_terms);
    if energy <= 0.0 || terms == [0.0; 3] {
        return linear;
    }
    let (length, by_normal) = radius_along(semi_axes, rotation, footprint.normal);
    let unit = half_space.modulus * length.powi(3);
    let s = pow(15.0 / 8.0 * energy / unit, 0.2);
    let within = s.min(DEEPEST);
    // Beyond the largest s, at the energy U_m, G = U_m h_m + g_m (U - U_m).
    let (mut force_factor, mut energy_factor, mut slope, mut by_s, mut power) = (1.0, 1.0, 0.0, 0.0, 1.0);
    let mut by_terms = [0.0; 3];
    let share = (within / s).powi(5);
    for (k, (&term, by_term)) in terms.iter().zip(&mut by_terms).enumerate() {
        let order = k as f64 + 1.0;
        power *= within;
        let fraction = 5.0 / (5.0 + order);
        *by_term = power * (fraction * share + (1.0 - share));
        force_factor += term * power;
        energy_factor += term * *by_term;
        by_s += term * power * fraction * order * share;
        slope += if s < DEEPEST { term * power * order } else { 0.0 };
    }
    // s^5 goes with U / (E* L^3).
    let by_modulus = -0.2 * energy / half_space.modulus * by_s;
    let by_length = -0.6 * energy / length * by_s;
    let by_normal = by_normal * by_length;
    let by_materials: DVec3 =
        half_space.strain_slopes.iter().zip(by_terms).map(|(&slope, by_term)| slope * (by_term * energy)).sum();
    Indentation {
        force: linear.force * force_factor,
        stiffness: linear.stiffness * force_factor + slope * linear.force * linear.force / (5.0 * energy),
        energy: energy * energy_factor,
        gradient: linear.gradient * force_factor
            + half_space.slope * by_modulus
            + by_materials
            + footprint.normal_by[0].transpose() * by_normal,
        torque: linear.torque * force_factor
            - modulus_by_rotation * by_modulus
            - footprint.normal_by[1].transpose() * by_normal
            + footprint.normal.cross(by_normal),
        ..linear
    }
}

/// Radius of the sphere of the Gaussian curvature where an ellipsoid has a normal, m, and its derivative by the normal.
fn radius_along(semi_axes: DVec3, rotation: DMat3, normal: DVec3) -> (f64, DVec3) {
    let own = rotation.transpose() * normal;
    let squares = semi_axes * semi_axes;
    let support = (squares * own * own).element_sum();
    let volume = semi_axes.element_product();
    (volume / support, rotation * (squares * own) * (-2.0 * volume / (support * support)))
}
