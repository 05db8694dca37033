//! A contact patch seen by the modes: `G = W^T Phi`, three rows, and the compliance it feels within one step.
//!
//! With `W` the patch's weights on three components, its mean displacement is `G q`, its force `f` enters as the modal
//! force `G^T f`, and one step gives it the compliance `G diag(q_load) G^T`. A truncated basis leaves out the residual
//! flexibility `Psi - Phi diag(1/k) Phi^T`, which answers at once: with the static compliance `W^T Psi W` at hand, the
//! patch feels `step_compliance + (W^T Psi W - static_compliance)`, exact at rest for any number of modes.

use glam::{DMat3, DVec3};

use super::lanes::{Lanes, dot};
use super::{Model, State};

/// Nodes taken at once when a patch is gathered: few enough streams for the processor to fetch ahead.
const NODES_AT_ONCE: usize = 4;

/// The rows `G` of one patch.
#[derive(Clone, Debug)]
pub struct Projection {
    axes: [Vec<Lanes>; 3],
}

impl Projection {
    /// Memory for a patch; nothing gathered yet.
    pub fn new(model: &Model) -> Self {
        Self { axes: std::array::from_fn(|_| vec![Lanes::default(); model.groups]) }
    }

    /// Gathers a patch: the row of each node's first component (the other two follow it) and its weight. Rows that do not
    /// exist are left out.
    pub fn gather(&mut self, model: &Model, nodes: &[(u32, f64)]) {
        for (axis, sum) in self.axes.iter_mut().enumerate() {
            sum.fill(Lanes::default());
            for chunk in nodes.chunks(NODES_AT_ONCE) {
                let mut shapes = [(0.0, model.row(0)); NODES_AT_ONCE];
                for (shape, &(first, weight)) in shapes.iter_mut().zip(chunk) {
                    let row = first as usize + axis;
                    if row < model.rows() {
                        *shape = (weight, model.row(row));
                    }
                }
                let [(wa, a), (wb, b), (wc, c), (wd, d)] = shapes;
                model.arch.dispatch(|| {
                    for ((((g, a), b), c), d) in sum.iter_mut().zip(a).zip(b).zip(c).zip(d) {
                        *g = g.plus_scaled(wa, *a).plus_scaled(wb, *b).plus_scaled(wc, *c).plus_scaled(wd, *d);
                    }
                });
            }
        }
    }

    /// Mean displacement (or velocity, for the state's `v`) of the patch, `G x`.
    pub fn read(&self, model: &Model, x: &[Lanes]) -> DVec3 {
        model.arch.dispatch(|| DVec3::from(std::array::from_fn(|axis| dot(&self.axes[axis], x))))
    }

    /// Mean displacement of the patch, m.
    pub fn displacement(&self, model: &Model, state: &State) -> DVec3 {
        self.read(model, &state.q)
    }

    /// Adds the modal force of a force on the patch, `load += G^T f`.
    pub fn add_force(&self, model: &Model, force: DVec3, load: &mut [Lanes]) {
        let [x, y, z] = &self.axes;
        model.arch.dispatch(|| {
            for (((p, x), y), z) in load.iter_mut().zip(x).zip(y).zip(z) {
                *p = p.plus_scaled(force.x, *x).plus_scaled(force.y, *y).plus_scaled(force.z, *z);
            }
        });
    }

    /// Displacement of this patch at the step's end per unit force on `other` there, `G diag(q_load) G_other^T`, m/N.
    pub fn step_compliance(&self, model: &Model, other: &Projection) -> DMat3 {
        let mut columns = [[0.0; 3]; 3];
        model.arch.dispatch(|| {
            for (j, column) in columns.iter_mut().enumerate() {
                let mut sums = [Lanes::default(); 3];
                for (g, effect) in model.q_load.iter().enumerate() {
                    let weighted = effect.times(other.axes[j][g]);
                    for (axis, sum) in self.axes.iter().zip(&mut sums) {
                        *sum = sum.plus(axis[g], weighted);
                    }
                }
                *column = sums.map(Lanes::sum);
            }
        });
        DMat3::from_cols_array_2d(&columns)
    }

    /// Static part that the modes kept carry, `G diag(1/k) G_other^T` over the elastic modes, m/N.
    pub fn static_compliance(&self, model: &Model, other: &Projection) -> DMat3 {
        let mut columns = [[0.0; 3]; 3];
        for (j, column) in columns.iter_mut().enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                let pairs = self.axes[i].iter().zip(&other.axes[j]).zip(&model.stiffness);
                *value = pairs
                    .flat_map(|((a, b), k)| (0..super::LANES).map(move |l| (a.0[l] * b.0[l], k.0[l])))
                    .map(|(product, k)| if k > 0.0 { product / k } else { 0.0 })
                    .sum();
            }
        }
        DMat3::from_cols_array_2d(&columns)
    }
}
