//! Motion of one axis while the written force is held, in closed form.
//!
//! ```text
//! m x'' + b x' + k x = F + k (wanted + drift t) - friction sign(x')
//! ```
//!
//! With `k > 0` the particular solution is `target + (F - b drift) / k + drift t`, and what is left of `x` decays as
//! `exp(-a t) (y cos wt + (y' + a y) sin(wt) / w)` with `a = b / 2m`, `w^2 = k/m - a^2`; beyond critical damping the functions are
//! hyperbolic. With `k = 0` it is a mass in a viscous medium.

use libm::{exp, expm1, sincos};

/// Longest time between two looks at the sign of the velocity, s. Turns are found to the bit between two looks; one that is
/// begun and undone within is missed, which a mass on muscles, of 40 Hz at most, does not make.
const SIGN_CHECK_INTERVAL: f64 = 0.25e-3;

/// Halvings of a look to where the velocity is zero: below the resolution of a double.
const HALVINGS: usize = 60;

/// Position and velocity, m and m/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    pub position: f64,
    pub velocity: f64,
}

/// What is constant for a time.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// kg.
    pub mass: f64,
    /// N s/m.
    pub damping: f64,
    /// Of the muscles, N/m.
    pub stiffness: f64,
    /// Dry friction, N: also the force that a tip at rest withstands.
    pub friction: f64,
    /// Held, N.
    pub force: f64,
    /// Where the muscles pull at the beginning, m, and how fast that moves, m/s.
    pub target: f64,
    pub drift: f64,
}

impl Axis {
    /// After `seconds`.
    pub fn advance(&self, mut state: State, seconds: f64) -> State {
        if self.friction == 0.0 {
            return self.free(state, seconds);
        }
        let mut time = 0.0;
        while time < seconds {
            let at = Axis { target: self.target + self.drift * time, ..*self };
            let left = seconds - time;
            let rests = state.velocity == 0.0;
            let stuck = if rests { at.time_stuck(state.position) } else { 0.0 };
            if stuck > 0.0 {
                // Even where the time is too short to change the sum.
                time += stuck.min(left).max(f64::EPSILON * seconds);
                continue;
            }
            let pull = at.pull(state.position);
            let sense = if rests { if pull == 0.0 { self.drift } else { pull } } else { state.velocity }.signum();
            let slid;
            (state, slid) = at.slide(state, sense, left.min(SIGN_CHECK_INTERVAL));
            time += slid;
        }
        state
    }

    /// Force on a tip at rest without its friction, N.
    fn pull(&self, position: f64) -> f64 {
        self.force + self.stiffness * (self.target - position)
    }

    /// How long friction holds a tip at rest, s.
    fn time_stuck(&self, position: f64) -> f64 {
        let (pull, rate) = (self.pull(position), self.stiffness * self.drift);
        if pull.abs() > self.friction {
            0.0
        } else if rate == 0.0 {
            f64::INFINITY
        } else {
            (self.friction - pull * rate.signum()) / rate.abs()
        }
    }

    /// Slides in one sense for `seconds`, or until it stops; how long that was, s.
    fn slide(&self, state: State, sense: f64, seconds: f64) -> (State, f64) {
        let sliding = Axis { force: self.force - sense * self.friction, ..*self };
        let end = sliding.free(state, seconds);
        if end.velocity * sense > 0.0 {
            return (end, seconds);
        }
        if state.velocity == 0.0 {
            // About to slide, but the difference of the forces is lost in rounding.
            return (state, seconds);
        }
        let (mut moves, mut stops) = (0.0, seconds);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (moves + stops);
            if sliding.free(state, middle).velocity * sense > 0.0 { moves = middle } else { stops = middle }
        }
        (State { position: sliding.free(state, stops).position, velocity: 0.0 }, stops)
    }

    /// Without friction.
    fn free(&self, state: State, t: f64) -> State {
        if self.stiffness == 0.0 {
            return self.in_viscous_medium(state, t);
        }
        let centre = self.target + (self.force - self.damping * self.drift) / self.stiffness;
        let (y, rate) = (state.position - centre, state.velocity - self.drift);
        let a = 0.5 * self.damping / self.mass;
        let squared = self.stiffness / self.mass;
        let (cosine, sine) = decaying(a, squared - a * a, t);
        State {
            position: centre + self.drift * t + y * cosine + (rate + a * y) * sine,
            velocity: self.drift + rate * cosine - (a * rate + squared * y) * sine,
        }
    }

    /// Towards the speed at which damping balances the force; written in functions that stay exact where there is next to no
    /// damping.
    fn in_viscous_medium(&self, state: State, t: f64) -> State {
        let (z, acceleration) = (self.damping / self.mass * t, self.force / self.mass);
        // (1 - exp(-z)) / z and (z - 1 + exp(-z)) / z^2.
        let first = if z == 0.0 { 1.0 } else { -expm1(-z) / z };
        let second = if z < 1e-2 {
            0.5 - z / 6.0 * (1.0 - z / 4.0 * (1.0 - z / 5.0 * (1.0 - z / 6.0 * (1.0 - z / 7.0))))
        } else {
            (1.0 - first) / z
        };
        State {
            position: state.position + state.velocity * t * first + acceleration * t * t * second,
            velocity: state.velocity * exp(-z) + acceleration * t * first,
        }
    }
}

/// `exp(-a t) cos(w t)` and `exp(-a t) sin(w t) / w` by `w^2`, which may be negative.
fn decaying(a: f64, w_squared: f64, t: f64) -> (f64, f64) {
    let wt = w_squared.abs().sqrt() * t;
    if wt < 1e-4 {
        // Within rounding of both, from either side of critical damping.
        let x = w_squared * t * t;
        let decay = exp(-a * t);
        (decay * (1.0 - x / 2.0), decay * t * (1.0 - x / 6.0))
    } else if w_squared > 0.0 {
        let decay = exp(-a * t);
        let (sine, cosine) = sincos(wt);
        (decay * cosine, decay * sine * t / wt)
    } else {
        let (slow, fast) = (exp(wt - a * t), exp(-wt - a * t));
        (0.5 * (slow + fast), 0.5 * (slow - fast) * t / wt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXIS: Axis =
        Axis { mass: 0.2, damping: 3.0, stiffness: 400.0, friction: 0.0, force: 1.5, target: 0.01, drift: 0.05 };
    const START: State = State { position: -0.004, velocity: 0.3 };

    /// By the classical scheme of Runge and Kutta, from the equation of motion as it stands.
    fn by_runge_kutta(axis: &Axis, start: State, seconds: f64, steps: usize) -> State {
        let rate = |t: f64, s: State| State {
            position: s.velocity,
            velocity: (axis.force - axis.damping * s.velocity
                + axis.stiffness * (axis.target + axis.drift * t - s.position)
                - axis.friction * if s.velocity == 0.0 { 0.0 } else { s.velocity.signum() })
                / axis.mass,
        };
        let moved = |s: State, r: State, h: f64| State {
            position: s.position + h * r.position,
            velocity: s.velocity + h * r.velocity,
        };
        let h = seconds / steps as f64;
        let mut s = start;
        for step in 0..steps {
            let t = h * step as f64;
            let r1 = rate(t, s);
            let r2 = rate(t + 0.5 * h, moved(s, r1, 0.5 * h));
            let r3 = rate(t + 0.5 * h, moved(s, r2, 0.5 * h));
            let r4 = rate(t + h, moved(s, r3, h));
            s = moved(moved(moved(moved(s, r1, h / 6.0), r2, h / 3.0), r3, h / 3.0), r4, h / 6.0);
        }
        s
    }

    fn assert_close(a: State, b: State, tolerance: f64) {
        let apart = (a.position - b.position).abs() + 0.1 * (a.velocity - b.velocity).abs();
        assert!(apart < tolerance, "{a:?} {b:?}");
    }

    #[test]
    fn motion_without_friction_is_that_of_runge_and_kutta() {
        let critical = 2.0 * (400.0_f64 * 0.2).sqrt();
        for (damping, stiffness) in
            [(3.0, 400.0), (0.0, 400.0), (critical, 400.0), (critical * (1.0 + 1e-12), 400.0), (60.0, 400.0)]
                .into_iter()
                .chain([(3.0, 0.0), (0.0, 0.0), (1e-3, 0.0)])
        {
            let axis = Axis { damping, stiffness, ..AXIS };
            let expected = by_runge_kutta(&axis, START, 0.02, 2000);
            assert_close(axis.advance(START, 0.02), expected, 1e-13);
            // The half of a motion is a motion.
            let half = axis.advance(START, 0.01);
            let later = Axis { target: axis.target + axis.drift * 0.01, ..axis };
            assert_close(later.advance(half, 0.01), expected, 1e-13);
        }
    }

    #[test]
    fn a_mass_on_a_spring_with_dry_friction_loses_its_amplitude_evenly() {
        // Textbook: each half period takes 2 f/k off, and it stops where the spring is weaker than the friction.
        let axis =
            Axis { mass: 0.1, damping: 0.0, stiffness: 100.0, friction: 0.1, force: 0.0, target: 0.0, drift: 0.0 };
        let half_period = std::f64::consts::PI * (axis.mass / axis.stiffness).sqrt();
        let mut state = State { position: 0.0105, velocity: 0.0 };
        for turn in 1..=5 {
            state = axis.advance(state, half_period);
            let amplitude = 0.0105 - 0.002 * f64::from(turn);
            let side = if turn % 2 == 0 { 1.0 } else { -1.0 };
            assert!((state.position - side * amplitude).abs() < 1e-12, "{turn} {state:?}");
        }
        let rest = axis.advance(state, 1.0);
        assert!((rest.position - state.position).abs() < 1e-12 && rest.velocity == 0.0, "{rest:?}");
    }

    #[test]
    fn a_stuck_tip_starts_when_the_muscles_pull_more_than_the_friction() {
        // 400 N/m at 0.05 m/s reach 0.6 N after 30 ms.
        let axis = Axis { friction: 0.6, force: 0.0, target: 0.0, ..AXIS };
        let rest = State::default();
        assert_eq!(axis.advance(rest, 0.0299), rest);
        let (later, moved) = (0.05, axis.advance(rest, 0.05));
        let sliding = Axis { friction: 0.0, force: -0.6, target: axis.drift * 0.03, ..axis };
        assert_close(moved, by_runge_kutta(&sliding, rest, later - 0.03, 2000), 1e-12);
        // The other way just so.
        let mirrored = Axis { drift: -axis.drift, ..axis }.advance(rest, later);
        assert_eq!((mirrored.position, mirrored.velocity), (-moved.position, -moved.velocity));
    }

    #[test]
    fn friction_brakes_a_free_tip_to_rest() {
        let axis = Axis { damping: 0.0, stiffness: 0.0, friction: 0.5, force: 0.2, ..AXIS };
        let stopped = axis.advance(State { position: 0.0, velocity: 0.3 }, 1.0);
        // m v^2 / 2 = (0.5 - 0.2) N s.
        assert!((stopped.position - 0.5 * 0.2 * 0.09 / 0.3).abs() < 1e-14);
        assert_eq!(stopped.velocity, 0.0);
    }
}
