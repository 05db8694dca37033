//! The smooth surface as the zero of a function, `f = sum w_i f_i / sum w_i`: the quadrics `f_i` of the fans around, blended
//! by weights that depend on the place only (implicit moving least squares; Kolluri, 2005, with quadrics for planes).

use glam::{DMat3, DVec3};

use super::fans::Fan;
use crate::tensor::outer;

/// Squared distance within which a node does not draw the surface towards itself, over its squared reach.
const SHARP: f64 = 0.25;

/// Value, gradient and Hessian of a blended function at a point.
#[derive(Clone, Copy, Debug)]
pub struct Blend {
    pub value: f64,
    pub gradient: DVec3,
    pub hessian: DMat3,
}

/// The weight `(1 - r^2 / reach^2)^3` of a fan at an offset from it, its gradient and its Hessian; `None` beyond its reach.
pub fn weight(fan: &Fan, offset: DVec3) -> Option<(f64, DVec3, DMat3)> {
    let squared_reach = fan.reach * fan.reach;
    let left = 1.0 - offset.length_squared() / squared_reach;
    if left <= 0.0 {
        return None;
    }
    let (first, second) = (-6.0 * left * left / squared_reach, 24.0 * left / (squared_reach * squared_reach));
    let hessian = outer(offset * second, offset) + DMat3::from_diagonal(DVec3::splat(first));
    Some((left * left * left, offset * first, hessian))
}

/// The weight that quadrics are blended with: that of [`weight`] over `(t + SHARP)^2`, `t = r^2 / reach^2`, so that the surface
/// passes close by the nodes.
fn sharp_weight(fan: &Fan, offset: DVec3) -> Option<(f64, DVec3, DMat3)> {
    let squared_reach = fan.reach * fan.reach;
    let t = offset.length_squared() / squared_reach;
    let left = 1.0 - t;
    if left <= 0.0 {
        return None;
    }
    let near = 1.0 / (t + SHARP);
    let (a, b) = (left * near, near * near);
    let value = left * a * a;
    let first = -3.0 * a * a - 2.0 * value * near;
    let second = 6.0 * left * b + 12.0 * a * a * near + 6.0 * value * b;
    let hessian = outer(offset * (4.0 * second / (squared_reach * squared_reach)), offset)
        + DMat3::from_diagonal(DVec3::splat(2.0 * first / squared_reach));
    Some((value, offset * (2.0 * first / squared_reach), hessian))
}

/// Blends the quadrics of some fans; `None` where no weight is positive.
pub fn blend<'a>(fans: impl Iterator<Item = &'a Fan>, x: DVec3) -> Option<Blend> {
    let (mut w, mut wx, mut wxx) = (0.0, DVec3::ZERO, DMat3::ZERO);
    let (mut n, mut nx, mut nxx) = (0.0, DVec3::ZERO, DMat3::ZERO);
    for fan in fans {
        let offset = x - fan.position;
        let Some((weight, slope, bend)) = sharp_weight(fan, offset) else { continue };
        let curved = fan.curvature * offset;
        let value = fan.normal.dot(offset) + 0.5 * offset.dot(curved);
        let gradient = fan.normal + curved;
        w += weight;
        wx += slope;
        wxx += bend;
        n += weight * value;
        nx += weight * gradient + slope * value;
        let cross = outer(slope, gradient);
        nxx += fan.curvature * weight + cross + cross.transpose() + bend * value;
    }
    if w <= 0.0 {
        return None;
    }
    let value = n / w;
    let gradient = (nx - value * wx) / w;
    let cross = outer(gradient, wx);
    let hessian = (nxx - wxx * value - cross - cross.transpose()) * (1.0 / w);
    Some(Blend { value, gradient, hessian })
}
