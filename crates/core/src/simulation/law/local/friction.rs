//! Coulomb friction under a tool: stick, partial slip, full slip.
//!
//! A round contact that is loaded sideways slips from its rim inwards (Mindlin, 1949; Cattaneo, 1938):
//!
//! ```text
//! T = mu F (1 - (1 - q/q_max)^(3/2)),     q_max = 3 mu F / (2 k),     k = 8 a G / (2 - nu)
//! ```
//!
//! `q` being the tool's displacement along the surface. Its slope is `k sqrt(1 - q/q_max)`: the part of the contact that
//! still sticks. So it is a sum of `N` equal springs `k/N`, each with a slider: the slider `i` gives at the mean of
//! `q / q_max = 1 - s^2` over its share of `s = sqrt(1 - q/q_max)`. A sum of springs with sliders follows Masing's rule when
//! it is unloaded and loaded again, as Mindlin and Deresiewicz (1953) found for contacts, and cannot give out energy.
//!
//! `k` and the sliders' bounds follow the pressing force. Where `k` falls, springs keep their stretch and lose force in
//! proportion; where it rises they keep their force: neither adds energy, so no cycle of pressing, shearing and lifting makes any.

use glam::{DMat3, DVec3};

use crate::tensor::{across, outer};

/// Springs with sliders.
pub const SPRINGS: usize = 8;

/// Share of `mu F` at which each slider gives; they sum to one.
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

/// Forces of the springs on the body, N, and what they were stretched with.
#[derive(Clone, Copy, Debug, Default)]
pub struct Friction {
    springs: [DVec3; SPRINGS],
    /// `k`, N/m.
    stiffness: f64,
}

/// What friction answers to a displacement.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answer {
    /// The springs then.
    pub friction: Friction,
    /// Their force on the body, N.
    pub force: DVec3,
    /// Its derivative by the displacement, N/m, and by the pressing force.
    pub by_displacement: DMat3,
    pub by_pressing: DVec3,
    /// Whether all sliders give.
    pub slipping: bool,
    /// Work on the springs that they do not hold, J.
    pub dissipated: f64,
}

impl Friction {
    /// Energy of the springs, J.
    pub fn energy(&self) -> f64 {
        let squares: f64 = self.springs.iter().map(|spring| spring.length_squared()).sum();
        if self.stiffness > 0.0 { 0.5 * SPRINGS as f64 * squares / self.stiffness } else { 0.0 }
    }

    /// The springs after the tool has gone on by `displacement` along the surface (m; its part along the normal does not
    /// count), under a pressing force whose bound `mu F` is `bound`, N, with the stiffness `k` and the normal as they are now.
    pub fn answer(&self, displacement: DVec3, bound: f64, coefficient: f64, stiffness: f64, normal: DVec3) -> Answer {
        // A matrix is the identity by default.
        let mut answer = Answer { by_displacement: DMat3::ZERO, ..Answer::default() };
        answer.friction.stiffness = stiffness;
        let along = across(normal);
        let kept = if self.stiffness > stiffness { stiffness / self.stiffness } else { 1.0 };
        let spring = stiffness / SPRINGS as f64;
        let stretch = along * displacement * spring;
        let mut giving = 0;
        for (i, (before, after)) in self.springs.iter().zip(&mut answer.friction.springs).enumerate() {
            let turned = turned(*before, normal) * kept;
            let tried = turned + stretch;
            let (size, most) = (tried.length(), BOUNDS[i] * bound);
            if size <= most {
                *after = tried;
                answer.by_displacement += along * spring;
            } else {
                let direction = tried / size;
                *after = direction * most;
                answer.by_displacement += (along - outer(direction, direction)) * (spring * most / size);
                answer.by_pressing += direction * (BOUNDS[i] * coefficient);
                giving += 1;
            }
            answer.force += *after;
        }
        answer.slipping = giving == SPRINGS;
        let before: DVec3 = self.springs.iter().sum();
        let work = 0.5 * (before + answer.force).dot(along * displacement);
        answer.dissipated = work + self.energy() - answer.friction.energy();
        answer
    }
}

/// A force across one normal turned to lie across another, its size kept.
fn turned(force: DVec3, normal: DVec3) -> DVec3 {
    let across = force - normal * force.dot(normal);
    let (size, left) = (force.length(), across.length());
    if left > 0.5 * size { across * (size / left) } else { across }
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
            let answer = friction.answer(DVec3::X * dq, bound, 0.3, STIFFNESS, DVec3::Z);
            friction = answer.friction;
            let exact = mindlin(dq * f64::from(step), bound);
            worst = worst.max((answer.force.x - exact).abs() / bound);
            assert_eq!(answer.slipping, dq * f64::from(step) > most * (1.0 - 1.0 / (3.0 * 64.0)));
        }
        assert!(worst < 0.01, "{worst}");
        assert!((friction.answer(DVec3::ZERO, bound, 0.3, STIFFNESS, DVec3::Z).force.x - bound).abs() < 1e-12);
    }

    /// Mindlin and Deresiewicz: unloaded from `T*`, the curve is the first one doubled and turned round.
    #[test]
    fn unloading_follows_masing() {
        let (bound, most) = (0.3, 1.5 * 0.3 / STIFFNESS);
        let mut friction = Friction::default();
        let mut go = |dq: f64| {
            let answer = friction.answer(DVec3::X * dq, bound, 0.3, STIFFNESS, DVec3::Z);
            friction = answer.friction;
            answer.force.x
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
            let answer = friction.answer(to - place, 0.4 * pressing, 0.4, stiffness, DVec3::Z);
            work += 0.5 * (force + answer.force).dot(to - place);
            assert!(answer.force.length() <= 0.4 * pressing * (1.0 + 1e-12));
            (friction, force, place) = (answer.friction, answer.force, to);
            least = least.min(work);
        }
        assert!(least > -1e-9 && work > 0.0, "{least} {work}");
    }
}
