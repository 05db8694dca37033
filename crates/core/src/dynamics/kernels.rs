//! The loops of a step: each reads and writes every mode once.

use pulp::NullaryFnOnce;

use super::lanes::{Lanes, dot};

/// Coefficients of [`super::ModeStep`] that carry the state, for eight modes.
#[derive(Clone, Copy, Debug, Default)]
pub struct FreeStep {
    pub qq: Lanes,
    pub qv: Lanes,
    pub qp: Lanes,
    pub vq: Lanes,
    pub vv: Lanes,
    pub vp: Lanes,
}

/// What a unit of modal force at the step's end adds, for eight modes.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadStep {
    /// To the displacement, s^2.
    pub q: Lanes,
    /// To the velocity, s.
    pub v: Lanes,
}

/// Free motion of one step.
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
            *v = step.vq.times(q).plus(&step.vv, v).plus(&step.vp, p);
            *q = free;
        }
    }
}

/// Free motion of one step, and what it makes of three rows: `rows . q`.
pub struct PredictAndRead<'a> {
    pub predict: Predict<'a>,
    pub rows: [&'a [Lanes]; 3],
}

impl NullaryFnOnce for PredictAndRead<'_> {
    type Output = [f64; 3];
    #[inline(always)]
    fn call(self) -> [f64; 3] {
        let Predict { steps, q, v, load } = self.predict;
        let [x, y, z] = self.rows;
        let mut sums = [Lanes::default(); 3];
        let rows = x.iter().zip(y).zip(z);
        for ((((step, q), v), p), ((x, y), z)) in steps.iter().zip(q).zip(v).zip(load).zip(rows) {
            let free = step.qq.times(q).plus(&step.qv, v).plus(&step.qp, p);
            *v = step.vq.times(q).plus(&step.vv, v).plus(&step.vp, p);
            *q = free;
            sums = [sums[0].plus(x, &free), sums[1].plus(y, &free), sums[2].plus(z, &free)];
        }
        sums.map(Lanes::sum)
    }
}

/// Effect of the modal forces in `load` on a predicted state.
pub struct Correct<'a> {
    pub steps: &'a [LoadStep],
    pub q: &'a mut [Lanes],
    pub v: &'a mut [Lanes],
    pub load: &'a [Lanes],
}

impl NullaryFnOnce for Correct<'_> {
    type Output = ();
    #[inline(always)]
    fn call(self) {
        for (((step, q), v), p) in self.steps.iter().zip(self.q).zip(self.v).zip(self.load) {
            *q = q.plus(&step.q, p);
            *v = v.plus(&step.v, p);
        }
    }
}

/// `v . v`, `q . k q` and `w . c w` with `w = before + v`, in one pass.
pub struct Energy<'a> {
    pub q: &'a [Lanes],
    pub v: &'a [Lanes],
    pub before: &'a [Lanes],
    pub stiffness: &'a [Lanes],
    pub damping: &'a [Lanes],
}

impl NullaryFnOnce for Energy<'_> {
    type Output = [f64; 3];
    #[inline(always)]
    fn call(self) -> [f64; 3] {
        let mut sums = [Lanes::default(); 3];
        let modes = self.q.iter().zip(self.v).zip(self.before).zip(self.stiffness).zip(self.damping);
        for ((((q, v), before), k), c) in modes {
            let twice = v.plus_scaled(1.0, before);
            sums = [sums[0].plus(v, v), sums[1].plus(&q.times(k), q), sums[2].plus(&twice.times(c), &twice)];
        }
        sums.map(Lanes::sum)
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

/// `left diag(steps.q) right`, for one row `right`: three sums at a time stay in registers.
pub struct Compliance<'a> {
    pub steps: &'a [LoadStep],
    pub left: [&'a [Lanes]; 3],
    pub right: &'a [Lanes],
}

impl NullaryFnOnce for Compliance<'_> {
    type Output = [f64; 3];
    #[inline(always)]
    fn call(self) -> [f64; 3] {
        let [x, y, z] = self.left;
        let mut sums = [Lanes::default(); 3];
        for ((((step, right), x), y), z) in self.steps.iter().zip(self.right).zip(x).zip(y).zip(z) {
            let weighted = step.q.times(right);
            sums = [sums[0].plus(x, &weighted), sums[1].plus(y, &weighted), sums[2].plus(z, &weighted)];
        }
        sums.map(Lanes::sum)
    }
}
