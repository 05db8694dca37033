//! Coulomb friction under a tool: stick, partial slip, full slip.
//!
//! A round contact that is loaded sideways slips from its rim inwards (Mindlin, 1949; Cattaneo, 1938):
//!
//! ```text
//! T = mu F (1 - (1 - q/q_max)^(3/2)),     q_max = 3 mu F / (2 k),     k = 8 a G / (2 - nu)
//! ```
//!
//! `q` being the tool's displacement along the surface. Its slope is `k sqrt(1 - q/q_max)`: the part of the contact that
//! still sticks. So it is a sum of `N` equal springs `k/N`, each with a slider: the slider `i` slips at the mean of
//! `q / q_max = 1 - s^2` over its share of `s = sqrt(1 - q/q_max)`. A sum of springs with sliders follows Masing's rule when
//! it is unloaded and loaded again, as Mindlin and Deresiewicz (1953) found for contacts, and cannot release energy.
//!
//! `k` and the sliders' bounds follow the pressing force. Where `k` falls, springs keep their stretch and lose force in proportion;
//! where it rises they keep their force. Neither adds energy, so no cycle of pressing, shearing and lifting releases any.

use glam::{DMat3, DVec3};
use pulp::{Arch, NullaryFnOnce};

use crate::math::sum_lanes;
use crate::tensor::{across, symmetric};

/// Springs with sliders.
pub const SPRINGS: usize = 8;

/// Share of `mu F` at which each slider slips; they sum to one.
const BOUNDS: [f64; SPRINGS] = {
    let (mut bounds, mut i) = ([0.0; SPRINGS], 0);
    while i < SPRINGS {
        let (low, high) = ((SPRINGS - i - 1) as f64 / SPRINGS as f64, (SPRINGS - i) as f64 / SPRINGS as f64);
        let mean_square = (high * high + high * low + low * low) / 3.0;
        bounds[i] = 1.5 * (1.0 - mean_square) / SPRINGS as f64;
        i += 1;
    }
    bounds
};

/// A number for each spring.
type Springs = [f64; SPRINGS];

/// Forces of the springs on the body, N, by component, and the stiffness that they were stretched with.
#[derive(Clone, Copy, Debug, Default)]
pub struct Friction {
    springs: [Springs; 3],
    /// `k`, N/m.
    stiffness: f64,
}

/// Response of friction to a displacement.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrictionResponse {
    /// The springs afterwards.
    pub friction: Friction,
    /// Their force on the body, N.
    pub force: DVec3,
    /// Its derivative by the displacement, N/m.
    pub by_displacement: DMat3,
    /// Its derivative by the pressing force.
    pub by_pressing: DVec3,
    /// Whether all sliders slip.
    pub slipping: bool,
    /// Work that the springs do not store, J.
    pub dissipated: f64,
}

impl Friction {
    /// Energy of the springs, J.
    pub fn energy(&self) -> f64 {
        let squares = self.springs.iter().flatten().map(|force| force * force).sum::<f64>();
        if self.stiffness > 0.0 { 0.5 * SPRINGS as f64 * squares / self.stiffness } else { 0.0 }
    }

    /// Force of all springs on the body, N.
    pub fn force(&self) -> DVec3 {
        DVec3::from_array(self.springs.map(sum_lanes))
    }

    /// The springs after a `displacement` of the tool along the surface (m; its part along the normal does not
    /// count), under a pressing force whose bound `mu F` is `bound`, N, with the stiffness `k` and the normal as they are now.
    pub fn respond(
        &self,
        displacement: DVec3,
        bound: f64,
        coefficient: f64,
        stiffness: f64,
        normal: DVec3,
    ) -> FrictionResponse {
        let unloading = if self.stiffness > stiffness { stiffness / self.stiffness } else { 1.0 };
        let spring = stiffness / SPRINGS as f64;
        let along = displacement - normal * normal.dot(displacement);
        let sliders = Sliders { springs: &self.springs, unloading, stretch: along * spring, bound, normal };
        let forces = Arch::new().dispatch(sliders);
        let mut response = FrictionResponse {
            friction: Friction { springs: forces.springs, stiffness },
            ..FrictionResponse::default()
        };
        response.force = response.friction.force();
        // The force of a slipping slider turns with the displacement and keeps the length of its bound.
        response.by_displacement =
            (across(normal) * sum_lanes(forces.shares) - symmetric(forces.turning.map(sum_lanes))) * spring;
        response.by_pressing = DVec3::from_array(forces.directions.map(sum_lanes)) * coefficient;
        response.slipping = forces.slipping.iter().all(|&slips| slips > 0.0);
        let work = 0.5 * (self.force() + response.force).dot(along);
        response.dissipated = work + self.energy() - response.friction.energy();
        response
    }
}

/// All sliders at once, as a struct: a closure might be compiled for the narrowest vectors.
struct Sliders<'a> {
    springs: &'a [Springs; 3],
    /// Factor of their forces by unloading.
    unloading: f64,
    /// Force added to each, N.
    stretch: DVec3,
    bound: f64,
    normal: DVec3,
}

/// The springs and sliders afterwards.
struct SliderForces {
    springs: [Springs; 3],
    /// One for those that slip, otherwise zero.
    slipping: Springs,
    /// Factor by which each slider reduces the force of its spring.
    shares: Springs,
    /// For those that slip: the direction times their share of the bound, and its outer product by `xx, xy, xz, yy, yz, zz` times
    /// that factor.
    directions: [Springs; 3],
    turning: [Springs; 6],
}

impl NullaryFnOnce for Sliders<'_> {
    type Output = SliderForces;

    #[inline(always)]
    fn call(self) -> SliderForces {
        let zero = [0.0; SPRINGS];
        let mut forces = SliderForces {
            springs: [zero; 3],
            slipping: zero,
            shares: zero,
            directions: [zero; 3],
            turning: [zero; 6],
        };
        let ([nx, ny, nz], [sx, sy, sz]) = (self.normal.to_array(), self.stretch.to_array());
        for i in 0..SPRINGS {
            // Rotated into the plane of the new normal with the same length, unless they are nearly along that normal.
            let (x, y, z) = (self.springs[0][i], self.springs[1][i], self.springs[2][i]);
            let off = x * nx + y * ny + z * nz;
            let (ax, ay, az) = (x - nx * off, y - ny * off, z - nz * off);
            let (size, left) = (x * x + y * y + z * z, ax * ax + ay * ay + az * az);
            let turns = left > 0.25 * size;
            let grown = self.unloading * (if turns { size / left } else { 1.0 }).sqrt();
            let (tx, ty, tz) = (ax * grown + sx, ay * grown + sy, az * grown + sz);
            let (size, most) = ((tx * tx + ty * ty + tz * tz).sqrt(), BOUNDS[i] * self.bound);
            let slips = size > most;
            let share = if slips { most / size } else { 1.0 };
            let inverse = if slips { 1.0 / size } else { 0.0 };
            let (dx, dy, dz) = (tx * inverse, ty * inverse, tz * inverse);
            let (qx, qy, qz) = (dx * share, dy * share, dz * share);
            forces.slipping[i] = if slips { 1.0 } else { 0.0 };
            forces.shares[i] = share;
            for (to, value) in forces.springs.iter_mut().zip([tx * share, ty * share, tz * share]) {
                to[i] = value;
            }
            for (to, value) in forces.directions.iter_mut().zip([dx * BOUNDS[i], dy * BOUNDS[i], dz * BOUNDS[i]]) {
                to[i] = value;
            }
            for (to, value) in forces.turning.iter_mut().zip([qx * dx, qx * dy, qx * dz, qy * dy, qy * dz, qz * dz]) {
                to[i] = value;
            }
        }
        forces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STIFFNESS: f64 = 300.0;

    fn mindlin(q: f64, bound: f64) -> f64 {
        let most = 1.5 * bound / STIFFNESS;
        bound * (1.0 - (1.0 - (q / most).min(1.0)).powf(1.5))
    }

    #[test]
    fn a_slow_shear_follows_mindlin() {
        let (bound, steps) = (0.3, 400);
        let most = 1.5 * bound / STIFFNESS;
        let (mut friction, mut worst) = (Friction::default(), 0.0f64);
        for step in 1..=steps {
            let dq = 1.2 * most / f64::from(steps);
            let response = friction.respond(DVec3::X * dq, bound, 0.3, STIFFNESS, DVec3::Z);
            friction = response.friction;
            let exact = mindlin(dq * f64::from(step), bound);
            worst = worst.max((response.force.x - exact).abs() / bound);
            assert_eq!(response.slipping, dq * f64::from(step) > most * (1.0 - 1.0 / (3.0 * 64.0)));
        }
        assert!(worst < 0.01, "{worst}");
        assert!((friction.respond(DVec3::ZERO, bound, 0.3, STIFFNESS, DVec3::Z).force.x - bound).abs() < 1e-12);
    }

    /// Mindlin and Deresiewicz: unloaded from `T*`, the curve is the first one doubled and turned round.
    #[test]
    fn unloading_follows_masing() {
        let (bound, most) = (0.3, 1.5 * 0.3 / STIFFNESS);
        let mut friction = Friction::default();
        let mut go = |dq: f64| {
            let response = friction.respond(DVec3::X * dq, bound, 0.3, STIFFNESS, DVec3::Z);
            friction = response.friction;
            response.force.x
        };
        let turned_at = go(0.7 * most);
        for step in 1..=100 {
            let back = 0.014 * most * f64::from(step);
            let exact = turned_at - 2.0 * mindlin(0.5 * back, bound);
            assert!((go(-0.014 * most) - exact).abs() < 0.02 * bound);
        }
    }

    #[test]
    fn no_cycle_makes_energy_and_the_cone_holds() {
        let mut seed = 7u64;
        let mut noise = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let (mut friction, mut place, mut force, mut work) = (Friction::default(), DVec3::ZERO, DVec3::ZERO, 0.0);
        let mut least = 0.0f64;
        for step in 0..20_000 {
            let pressing = 1.0 + 0.9 * (0.013 * f64::from(step)).sin();
            let to = if step % 2000 < 1900 { place + 2e-5 * DVec3::new(noise(), noise(), 0.0) } else { 0.9 * place };
            let stiffness = STIFFNESS * pressing.cbrt();
            let response = friction.respond(to - place, 0.4 * pressing, 0.4, stiffness, DVec3::Z);
            work += 0.5 * (force + response.force).dot(to - place);
            assert!(response.force.length() <= 0.4 * pressing * (1.0 + 1e-12));
            (friction, force, place) = (response.friction, response.force, to);
            least = least.min(work);
        }
        assert!(least > -1e-9 && work > 0.0, "{least} {work}");
    }
}
