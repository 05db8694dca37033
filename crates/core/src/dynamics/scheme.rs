//! Newmark's scheme for one mode `q'' + c q' + k q = p`, and where it is stable.
//!
//! `k = omega^2` is the mode's eigenvalue, `c` its damping, `p` its modal force; shapes are mass-normalised.

use crate::{Error, Result};

/// Rayleigh damping `B = mass M + stiffness K`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rayleigh {
    /// Factor of the mass matrix, 1/s.
    pub mass: f64,
    /// Factor of the stiffness matrix, s.
    pub stiffness: f64,
}

impl Rayleigh {
    /// Damping `c` of a mode with eigenvalue `k`, 1/s.
    pub fn modal(&self, k: f64) -> f64 {
        self.mass + self.stiffness * k
    }
}

/// Time step and weights of Newmark's scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Newmark {
    /// Time step, s.
    pub dt: f64,
    /// Weight of the new acceleration in the displacement (often called beta): 1/4 average, 0 central difference.
    pub alpha: f64,
    /// Weight of the new acceleration in the velocity (often called gamma): 1/2 adds no damping, more does.
    pub delta: f64,
}

/// One step of a mode: `q1 = qq q + qv v + qp p0 + q_load p1`, `v1 = vq q + vv v + vp p0 + v_load p1`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(missing_docs)] // the formula above says what each is
pub struct ModeStep {
    pub qq: f64,
    pub qv: f64,
    pub qp: f64,
    pub q_load: f64,
    pub vq: f64,
    pub vv: f64,
    pub vp: f64,
    pub v_load: f64,
}

impl Newmark {
    /// Checks the ranges.
    ///
    /// # Errors
    /// A step that is not positive, a negative `alpha`, `delta < 1/2` (it adds energy at every step).
    pub fn new(dt: f64, alpha: f64, delta: f64) -> Result<Self> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::Invalid(format!("the time step must be positive, got {dt} s")));
        }
        if !(alpha >= 0.0 && alpha.is_finite()) {
            return Err(Error::Invalid(format!("alpha must not be negative, got {alpha}")));
        }
        if !(delta >= 0.5 && delta.is_finite()) {
            return Err(Error::Invalid(format!(
                "delta must be at least 0.5, got {delta}: below, every step adds energy"
            )));
        }
        Ok(Self { dt, alpha, delta })
    }

    /// Largest stable step, s, for a body whose largest eigenvalue is `k`; infinite where every step is stable.
    ///
    /// The amplification matrix leaves the unit circle through -1, where
    /// `(delta/2 - alpha) k dt^2 - (delta - 1/2) c dt - 1 = 0`. With `Omega = omega dt` and `c = 2 xi omega` this is the
    /// usual `Omega = [xi (delta - 1/2) + sqrt(delta/2 - alpha + xi^2 (delta - 1/2)^2)] / (delta/2 - alpha)`. Of all
    /// modes the one of largest `k` limits, also with Rayleigh damping.
    pub fn largest_stable_dt(&self, rayleigh: &Rayleigh, k: f64) -> f64 {
        let quadratic = (0.5 * self.delta - self.alpha) * k;
        if quadratic <= 0.0 {
            return f64::INFINITY;
        }
        let linear = (self.delta - 0.5) * rayleigh.modal(k);
        (linear + (linear * linear + 4.0 * quadratic).sqrt()) / (2.0 * quadratic)
    }

    /// Refuses a step beyond the stability limit of a body with largest eigenvalue `k`.
    ///
    /// # Errors
    /// The step, with the limit and the largest angular frequency.
    pub fn require_stable(&self, rayleigh: &Rayleigh, k: f64) -> Result<()> {
        let limit = self.largest_stable_dt(rayleigh, k);
        if self.dt <= limit {
            return Ok(());
        }
        let Self { dt, alpha, delta } = self;
        Err(Error::Invalid(format!(
            "a step of {dt:.6e} s is unstable with alpha = {alpha}, delta = {delta}: the largest stable dt is \
             {limit:.6e} s (omega_max = {:.6e} rad/s); take it smaller, or alpha of at least delta / 2",
            k.sqrt()
        )))
    }

    /// The step of one mode.
    ///
    /// Eliminating the accelerations (`a0 = p0 - c v - k q`) from the scheme and the equation of motion at the new time,
    /// without a difference of large numbers even for `omega dt >> 1`.
    pub fn mode_step(&self, k: f64, c: f64) -> ModeStep {
        let Self { dt: h, alpha, delta } = *self;
        let s = 1.0 / (1.0 + delta * h * c + alpha * h * h * k);
        // What a0 contributes: s h^2 r to the displacement, s h g to the velocity.
        let r = (0.5 - alpha) + h * c * (0.5 * delta - alpha);
        let g = (1.0 - delta) + h * h * k * (alpha - 0.5 * delta);
        ModeStep {
            qq: s * (1.0 + delta * h * c - h * h * k * r),
            qv: s * h * (1.0 + (delta - alpha) * h * c - h * c * r),
            qp: s * h * h * r,
            q_load: s * alpha * h * h,
            vq: -s * h * k * (delta + g),
            vv: s * (1.0 + (alpha - delta) * h * h * k - h * c * g),
            vp: s * h * g,
            v_load: s * delta * h,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The scheme as it is defined, by the accelerations.
    fn by_definition(n: &Newmark, k: f64, c: f64, (q, v, p0): (f64, f64, f64), p1: f64) -> (f64, f64) {
        let h = n.dt;
        let a0 = p0 - c * v - k * q;
        let (u, w) = (q + h * v + h * h * (0.5 - n.alpha) * a0, v + h * (1.0 - n.delta) * a0);
        let a1 = (p1 - c * w - k * u) / (1.0 + n.delta * h * c + n.alpha * h * h * k);
        (u + n.alpha * h * h * a1, w + n.delta * h * a1)
    }

    #[test]
    fn coefficients_are_the_scheme() {
        for (alpha, delta) in [(0.25, 0.5), (0.0, 0.5), (0.3025, 0.6), (1.0 / 6.0, 0.5), (0.1, 0.7)] {
            let scheme = Newmark::new(1e-3, alpha, delta).expect("valid");
            for (k, c) in [(0.0, 0.0), (0.0, 3.0), (1e4, 0.0), (4e6, 17.0), (1e5, 900.0)] {
                let (q, v, p0, p1) = (0.3, -20.0, 700.0, -1e3);
                let m = scheme.mode_step(k, c);
                let got =
                    (m.qq * q + m.qv * v + m.qp * p0 + m.q_load * p1, m.vq * q + m.vv * v + m.vp * p0 + m.v_load * p1);
                let want = by_definition(&scheme, k, c, (q, v, p0), p1);
                assert!((got.0 - want.0).abs() < 1e-12 * (1.0 + want.0.abs()), "{alpha} {delta} {k} {c}");
                assert!((got.1 - want.1).abs() < 1e-12 * (1e3 + want.1.abs()), "{alpha} {delta} {k} {c}");
            }
        }
    }

    #[test]
    fn an_unstable_step_is_refused_with_the_limit() {
        let scheme = Newmark::new(1e-3, 0.0, 0.5).expect("valid");
        assert_eq!(scheme.largest_stable_dt(&Rayleigh::default(), 1e4), 0.02);
        let error = scheme.require_stable(&Rayleigh::default(), 1e8).expect_err("unstable");
        assert!(error.to_string().contains("2.000000e-4 s") && error.to_string().contains("1.000000e4 rad/s"));
    }
}
