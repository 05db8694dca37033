//! A contact patch seen by the modes: `G = W^T Phi`, three rows, and the compliance it feels within one step.
//!
//! With `W` the patch's weights on three components, its mean displacement is `G q`, its force `f` enters as the modal
//! force `G^T f`, and one step gives it the compliance `G diag(q_load) G^T`. A truncated basis leaves out the residual
//! flexibility `Psi - Phi diag(1/k) Phi^T`, which answers at once: with the static compliance `W^T Psi W` at hand, the
//! patch feels `step_compliance + (W^T Psi W - static_compliance)`, exact at rest for any number of modes.

use glam::{DMat3, DVec3};

use super::kernels::{AddRows, Compliance, Dot, PredictAndRead};
use super::lanes::Lanes;
use super::{Model, State};

/// Nodes taken at once when a patch is gathered: few enough streams for the processor to fetch ahead.
const NODES_AT_ONCE: usize = 5;

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
    pub fn gather(&mut self, model: &Model, nodes: impl Iterator<Item = (usize, f64)> + Clone) {
        for (axis, sum) in self.axes.iter_mut().enumerate() {
            sum.fill(Lanes::default());
            let mut nodes = nodes.clone().filter(|(first, _)| first + 2 < model.rows()).peekable();
            while nodes.peek().is_some() {
                let mut rows = [model.row(0); NODES_AT_ONCE];
                let mut forces = [0.0; NODES_AT_ONCE];
                for (i, (first, weight)) in nodes.by_ref().take(NODES_AT_ONCE).enumerate() {
                    (rows[i], forces[i]) = (model.row(first + axis), weight);
                }
                model.arch.dispatch(AddRows { load: sum, rows, forces });
            }
        }
    }

    /// The step without a new force (see [`Model::predict`]) and the mean displacement of the patch in it, m.
    pub fn predict(&self, model: &Model, state: &mut State) -> DVec3 {
        DVec3::from(model.arch.dispatch(PredictAndRead { predict: model.prediction(state), rows: self.rows() }))
    }

    /// Mean displacement of the patch, m.
    pub fn displacement(&self, model: &Model, state: &State) -> DVec3 {
        DVec3::from(self.rows().map(|row| model.arch.dispatch(Dot(row, &state.q))))
    }

    /// Mean velocity of the patch, m/s.
    pub fn velocity(&self, model: &Model, state: &State) -> DVec3 {
        DVec3::from(self.rows().map(|row| model.arch.dispatch(Dot(row, &state.v))))
    }

    /// Adds the modal force of a force on the patch, `load += G^T f`.
    pub fn add_force(&self, model: &Model, force: DVec3, load: &mut [Lanes]) {
        model.arch.dispatch(AddRows { load, rows: self.rows(), forces: force.to_array() });
    }

    /// Displacement of this patch at the step's end per unit force on `other` there, `G diag(q_load) G_other^T`, m/N.
    pub fn step_compliance(&self, model: &Model, other: &Projection) -> DMat3 {
        let (steps, left) = (&model.load_steps, self.rows());
        DMat3::from_cols_array_2d(&other.rows().map(|right| model.arch.dispatch(Compliance { steps, left, right })))
    }

    fn rows(&self) -> [&[Lanes]; 3] {
        self.axes.each_ref().map(Vec::as_slice)
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
