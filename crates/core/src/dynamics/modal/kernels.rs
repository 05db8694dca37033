//! The loops of a step: each reads and writes every mode once.

use pulp::NullaryFnOnce;

use super::lanes::{Lanes, dot};

/// Coefficients of [`crate::dynamics::ModeStep`] that carry the state, for eight modes.
#[derive(Clone, Copy, Debug, Default)]
pub struct FreeStep {
    pub qq: Lanes,
    pub qv: Lanes,
    pub qp: Lanes,
    pub vq: Lanes,
    pub vv: Lanes,
    pub vp: Lanes,
}

/// Free motion of one step; what has decayed is zero.
pub struct Predict<'a> {
    pub steps: &'a [FreeStep],
    pub q: &'a mut [Lanes],
    pub v: &'a mut [Lanes],
    pub load: &'a [Lanes],
}

impl NullaryFnOnce for Predict<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        for (((step, q), v), p) in self.steps.iter().zip(self.q).zip(self.v).zip(self.load) {
            let free = step.qq.times(q).plus(&step.qv, v).plus(&step.qp, p);
            *v = step.vq.times(q).plus(&step.vv, v).plus(&step.vp, p).settled();
            *q = free.settled();
        }
    }
}

/// Effect of the modal forces in `load` on a predicted state; what has decayed is zero.
pub struct Correct<'a> {
    pub q_load: &'a [Lanes],
    pub v_load: &'a [Lanes],
    pub q: &'a mut [Lanes],
    pub v: &'a mut [Lanes],
    pub load: &'a [Lanes],
}

impl NullaryFnOnce for Correct<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        for ((((q_load, v_load), q), v), p) in
            self.q_load.iter().zip(self.v_load).zip(self.q).zip(self.v).zip(self.load)
        {
            *q = q.plus(q_load, p).settled();
            *v = v.plus(v_load, p).settled();
        }
    }
}

/// `v . v` and `q . k q`, added to sums so far.
///
/// A loop a sum, here and below: together, the compiler mixes their lanes and takes twice as long.
#[inline(always)]
fn add_energies(q: &[Lanes], v: &[Lanes], stiffness: &[Lanes], mut kinetic: Lanes, mut strain: Lanes) -> [Lanes; 2] {
    for v in v {
        kinetic = kinetic.plus(v, v);
    }
    for (q, k) in q.iter().zip(stiffness) {
        strain = strain.plus(&q.times(k), q);
    }
    [kinetic, strain]
}

/// `v . v`, `q . k q` and `w . c w` with `w = before + v`, added to sums so far.
pub struct EnergySums<'a> {
    pub q: &'a [Lanes],
    pub v: &'a [Lanes],
    pub before: &'a [Lanes],
    pub stiffness: &'a [Lanes],
    pub damping: &'a [Lanes],
    pub sums: [Lanes; 3],
}

impl NullaryFnOnce for EnergySums<'_> {
    type Output = [Lanes; 3];
    #[inline(always)]
    fn call(self) -> [Lanes; 3] {
        let [kinetic, strain, mut power] = self.sums;
        let [kinetic, strain] = add_energies(self.q, self.v, self.stiffness, kinetic, strain);
        for ((v, before), c) in self.v.iter().zip(self.before).zip(self.damping) {
            let twice = v.plus_scaled(1.0, before);
            power = power.plus(&twice.times(c), &twice);
        }
        [kinetic, strain, power]
    }
}

/// `v . v`, `q . k q` and `(p0 + weight (p1 - p0)) . (q - before)`, added to sums so far.
pub struct WorkSums<'a> {
    pub q: &'a [Lanes],
    pub v: &'a [Lanes],
    pub before: &'a [Lanes],
    pub stiffness: &'a [Lanes],
    pub loads: [&'a [Lanes]; 2],
    pub weight: f64,
    pub sums: [Lanes; 3],
}

impl NullaryFnOnce for WorkSums<'_> {
    type Output = [Lanes; 3];
    #[inline(always)]
    fn call(self) -> [Lanes; 3] {
        let [kinetic, strain, mut work] = self.sums;
        let [kinetic, strain] = add_energies(self.q, self.v, self.stiffness, kinetic, strain);
        let [p0, p1] = self.loads;
        for (((q, before), p0), p1) in self.q.iter().zip(self.before).zip(p0).zip(p1) {
            let moved = q.plus_scaled(-1.0, before);
            let mean = p0.plus_scaled(-self.weight, p0).plus_scaled(self.weight, p1);
            work = work.plus(&mean, &moved);
        }
        [kinetic, strain, work]
    }
}

/// `rows . x`, added to sums so far.
pub struct Read<'a> {
    pub rows: [&'a [Lanes]; 3],
    pub x: &'a [Lanes],
    pub sums: [Lanes; 3],
}

impl NullaryFnOnce for Read<'_> {
    type Output = [Lanes; 3];
    #[inline(always)]
    fn call(self) -> [Lanes; 3] {
        let [x, y, z] = self.rows;
        let mut sums = self.sums;
        for (((value, x), y), z) in self.x.iter().zip(x).zip(y).zip(z) {
            sums = [sums[0].plus(x, value), sums[1].plus(y, value), sums[2].plus(z, value)];
        }
        sums
    }
}

/// `load += sum of forces times rows`.
pub struct AddRows<'a, const N: usize> {
    pub load: &'a mut [Lanes],
    pub rows: [&'a [Lanes]; N],
    pub forces: [f64; N],
}

impl<const N: usize> NullaryFnOnce for AddRows<'_, N> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        let groups = self.load.len();
        let rows = self.rows.map(|row| &row[..groups]);
        for (g, p) in self.load.iter_mut().enumerate() {
            for (row, force) in rows.iter().zip(self.forces) {
                *p = p.plus_scaled(force, &row[g]);
            }
        }
    }
}

/// `row . x`.
pub struct Dot<'a>(pub &'a [Lanes], pub &'a [Lanes]);

impl NullaryFnOnce for Dot<'_> {
    type Output = f64;
    #[inline(always)]
    fn call(self) -> f64 {
        dot(self.0, self.1)
    }
}

/// `left diag(weights) right`, for one row `right`: three sums at a time stay in registers.
pub struct Compliance<'a> {
    pub weights: &'a [Lanes],
    pub left: [&'a [Lanes]; 3],
    pub right: &'a [Lanes],
}

impl NullaryFnOnce for Compliance<'_> {
    type Output = [f64; 3];
    #[inline(always)]
    fn call(self) -> [f64; 3] {
        let [x, y, z] = self.left;
        let mut sums = [Lanes::default(); 3];
        for ((((weight, right), x), y), z) in self.weights.iter().zip(self.right).zip(x).zip(y).zip(z) {
            let weighted = weight.times(right);
            sums = [sums[0].plus(x, &weighted), sums[1].plus(y, &weighted), sums[2].plus(z, &weighted)];
        }
        sums.map(Lanes::sum)
    }
}
