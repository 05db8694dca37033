//! The exact step of one mode, for a modal force linear in time or constant within the step.
//!
//! Let `B(t)` be the displacement after a unit velocity, and `I1`, `I2`, `I3` those under the forces `1`, `t`, `t^2 / 2` from
//! rest, each the derivative of the next:
//!
//! ```text
//! q1 = A q + B v + I1 p0 + I2 (p1 - p0) / h       A = B' + c B
//! v1 = -k B q + B' v + B p0 + I1 (p1 - p0) / h
//! mean of q over the step = [(B + c I1) q + I1 v + I2 p0 + I3 (p1 - p0) / h] / h
//! ```

use super::ModeStep;
use crate::math::{cos, exp, expm1, log2, sin};

/// Below this `k h^2` the closed forms of `I1`, `I2`, `I3` lose digits: their numerators go like `h^2 k` to `h^4 k`.
const SMALL_SQUARED_ANGLE: f64 = 0.1;
/// The series in `h` converges to round-off in `TERMS` terms below this `max(k h^2, c h)`.
const SERIES_RADIUS: f64 = 0.5;
const TERMS: usize = 18;

/// Step of `q'' + c q' + k q = p` over `h`, exact for `p` linear in time; `k >= 0`, `c >= 0`.
pub fn exact_step(k: f64, c: f64, h: f64) -> ModeStep {
    let Response { b, db, i1, i2, .. } = Response::after(k, c, h);
    ModeStep {
        qq: db + c * b,
        qv: b,
        qp: i1 - i2 / h,
        q_load: i2 / h,
        vq: -k * b,
        vv: db,
        vp: b - i1 / h,
        v_load: i1 / h,
    }
}

/// Step over `h`, exact for the constant `p = (1 - weight) p0 + weight p1`.
pub fn held_step(k: f64, c: f64, h: f64, weight: f64) -> ModeStep {
    let Response { b, db, i1, .. } = Response::after(k, c, h);
    let before = 1.0 - weight;
    ModeStep {
        qq: db + c * b,
        qv: b,
        qp: before * i1,
        q_load: weight * i1,
        vq: -k * b,
        vv: db,
        vp: before * b,
        v_load: weight * b,
    }
}

/// Mean of `q` over a step under a force linear in time: `q q0 + v v0 + p0 p0 + p1 p1`.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)] // the formula above says what each is
pub struct MeanDisplacement {
    pub q: f64,
    pub v: f64,
    pub p0: f64,
    pub p1: f64,
}

impl MeanDisplacement {
    /// Of a mode as [`exact_step`] takes it.
    pub fn new(k: f64, c: f64, h: f64) -> Self {
        let Response { b, i1, i2, i3, .. } = Response::after(k, c, h);
        let p1 = i3 / (h * h);
        Self { q: (b + c * i1) / h, v: i1 / h, p0: i2 / h - p1, p1 }
    }
}

/// `B`, `B'`, `I1`, `I2`, `I3` at the end of the step.
#[derive(Clone, Copy)]
struct Response {
    b: f64,
    db: f64,
    i1: f64,
    i2: f64,
    i3: f64,
}

impl Response {
    fn after(k: f64, c: f64, h: f64) -> Self {
        if k * h * h >= SMALL_SQUARED_ANGLE { closed_form(k, c, h) } else { by_doubling(k, c, h) }
    }
}

fn closed_form(k: f64, c: f64, h: f64) -> Response {
    let sigma = 0.5 * c;
    let squared = k - sigma * sigma;
    // e^(-sigma t) times cos(w t) and sin(w t)/w, or their hyperbolic twins written with decaying exponentials only.
    let (even, b) = if squared > 0.0 {
        let w = squared.sqrt();
        let decay = exp(-sigma * h);
        (decay * cos(w * h), decay * sin(w * h) / w)
    } else {
        let w = (-squared).sqrt();
        let slow = exp(-k / (sigma + w) * h);
        let fast = exp(-2.0 * w * h);
        let odd = if w * h > 1e-8 { -expm1(-2.0 * w * h) / (2.0 * w) } else { h };
        (0.5 * slow * (1.0 + fast), slow * odd)
    };
    let (a, db) = (even + sigma * b, even - sigma * b);
    let i1 = (1.0 - a) / k;
    let i2 = (h - b - c * i1) / k;
    Response { b, db, i1, i2, i3: (0.5 * h * h - i1 - c * i2) / k }
}

/// The series over a small part of the step, composed with itself until the step is full.
fn by_doubling(k: f64, c: f64, h: f64) -> Response {
    let stiffness = (k * h * h).max(c * h);
    let halvings = log2(stiffness / SERIES_RADIUS).ceil().max(0.0) as i32;
    let mut t = h * 0.5f64.powi(halvings);
    let mut r = series(k, c, t);
    for _ in 0..halvings {
        // The state reached after t, carried on by another t, under the forces 1, t + t' and (t + t')^2 / 2.
        let a = r.db + c * r.b;
        let i1 = a * r.i1 + r.b * r.b + r.i1;
        let i2 = a * r.i2 + r.b * r.i1 + t * r.i1 + r.i2;
        let i3 = a * r.i3 + r.b * r.i2 + 0.5 * t * t * r.i1 + t * r.i2 + r.i3;
        r = Response { b: (a + r.db) * r.b, db: r.db * r.db - k * r.b * r.b, i1, i2, i3 };
        t *= 2.0;
    }
    r
}

/// Taylor's series: `(n + 1)(n + 2) q_(n+2) = p_n - c (n + 1) q_(n+1) - k q_n`.
fn series(k: f64, c: f64, t: f64) -> Response {
    let sum = |start: [f64; 2], force: [f64; 3]| {
        let (mut low, mut high) = (start[0], start[1]);
        let (mut value, mut slope, mut power) = (low + high * t, high, t);
        for n in 0..TERMS {
            let p = force.get(n).copied().unwrap_or(0.0);
            let next = (p - c * (n + 1) as f64 * high - k * low) / ((n + 1) * (n + 2)) as f64;
            slope += (n + 2) as f64 * next * power;
            power *= t;
            value += next * power;
            (low, high) = (high, next);
        }
        (value, slope)
    };
    let (b, db) = sum([0.0, 1.0], [0.0; 3]);
    let [i1, i2, i3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5]].map(|force| sum([0.0, 0.0], force).0);
    Response { b, db, i1, i2, i3 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten thousand Runge-Kutta steps of fourth order, an error far below the tolerance here: displacement, velocity, and the
    /// integral of the displacement.
    fn integrated(k: f64, c: f64, h: f64, [q, v]: [f64; 2], p: impl Fn(f64) -> f64) -> [f64; 3] {
        let steps = 10_000;
        let d = h / f64::from(steps);
        let slope = |t: f64, [q, v, _]: [f64; 3]| [v, p(t) - c * v - k * q, q];
        let ahead = |[q, v, s]: [f64; 3], [dq, dv, ds]: [f64; 3], d: f64| [q + d * dq, v + d * dv, s + d * ds];
        let mut x = [q, v, 0.0];
        for i in 0..steps {
            let t = f64::from(i) * d;
            let s1 = slope(t, x);
            let s2 = slope(t + 0.5 * d, ahead(x, s1, 0.5 * d));
            let s3 = slope(t + 0.5 * d, ahead(x, s2, 0.5 * d));
            let s4 = slope(t + d, ahead(x, s3, d));
            for j in 0..3 {
                x[j] += d / 6.0 * (s1[j] + 2.0 * s2[j] + 2.0 * s3[j] + s4[j]);
            }
        }
        x
    }

    const H: f64 = 1e-3;
    /// Rigid, rigid and damped, slow, oscillating, near critical, overdamped, slow and overdamped: `k` and `c`.
    const CASES: [(f64, f64); 8] =
        [(0.0, 0.0), (0.0, 4e3), (1.0, 0.1), (9e6, 40.0), (1e6, 2e3), (1e6, 2.0001e3), (4e5, 8e3), (50.0, 3e3)];
    const START: [f64; 2] = [1e-3, 2.0];
    const FORCES: [f64; 2] = [5e3, -3e3];

    fn stepped(m: &ModeStep) -> [f64; 2] {
        let ([q, v], [p0, p1]) = (START, FORCES);
        [m.qq * q + m.qv * v + m.qp * p0 + m.q_load * p1, m.vq * q + m.vv * v + m.vp * p0 + m.v_load * p1]
    }

    fn check(got: [f64; 2], want: [f64; 3], case: (f64, f64)) {
        assert!((got[0] - want[0]).abs() < 1e-12, "k, c {case:?}: {got:?} {want:?}");
        assert!((got[1] - want[1]).abs() < 1e-9, "k, c {case:?}: {got:?} {want:?}");
    }

    #[test]
    fn every_regime_agrees_with_runge_kutta() {
        let ([q, v], [p0, p1]) = (START, FORCES);
        for (k, c) in CASES {
            let want = integrated(k, c, H, START, |t| p0 + (p1 - p0) * t / H);
            check(stepped(&exact_step(k, c, H)), want, (k, c));
            let m = MeanDisplacement::new(k, c, H);
            let mean = m.q * q + m.v * v + m.p0 * p0 + m.p1 * p1;
            assert!((mean - want[2] / H).abs() < 1e-12, "k {k}, c {c}: {mean:e} {:e}", want[2] / H);
            let want = integrated(k, c, H, START, |_| 0.3 * p0 + 0.7 * p1);
            check(stepped(&held_step(k, c, H, 0.7)), want, (k, c));
        }
    }
}
