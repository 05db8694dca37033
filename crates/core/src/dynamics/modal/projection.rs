//! Projection of a contact patch on the modes: `G = W^T Phi`, three rows, and the compliance it feels within one step.
//!
//! With `W` the patch's weights on three components, its mean displacement is `G q`, its force `f` enters as the modal
//! force `G^T f`, and one step gives it the compliance `G diag(q_load) G^T`. A truncated basis leaves out the residual
//! flexibility `Psi - Phi diag(1/k) Phi^T`, which answers at once: with the static compliance `W^T Psi W` at hand, the
//! patch feels `step_compliance + (W^T Psi W - static_compliance)`, exact at rest for any number of modes.

use glam::{DMat3, DVec3};

use super::kernels::{AddRows, Compliance, Dot};
use super::lanes::Lanes;
use super::model::ModalModel;

/// Nodes taken at once when a patch is gathered: few enough streams for the processor to fetch ahead.
const NODES_AT_ONCE: usize = 5;

/// The rows `G` of one patch.
#[derive(Clone, Debug)]
pub struct Projection {
    axes: [Vec<Lanes>; 3],
}

impl Projection {
    /// Memory for a patch; nothing gathered yet.
    pub fn new(model: &ModalModel) -> Self {
        Self { axes: std::array::from_fn(|_| vec![Lanes::default(); model.groups]) }
    }

    /// Gathers a patch: the row of each node's first component (the other two follow it) and its weight. Rows that do not
    /// exist are left out.
    pub fn gather(&mut self, model: &ModalModel, nodes: impl Iterator<Item = (usize, f64)> + Clone) {
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

    /// Mean over the patch of modal numbers: displacement, m, of the state's `q`, or velocity, m/s, of its `v`.
    pub fn read(&self, model: &ModalModel, x: &[Lanes]) -> DVec3 {
        DVec3::from(self.rows().map(|row| model.arch.dispatch(Dot(row, x))))
    }

    /// Adds the modal force of a force on the patch, `load += G^T f`.
    pub fn add_force(&self, model: &ModalModel, force: DVec3, load: &mut [Lanes]) {
        model.arch.dispatch(AddRows { load, rows: self.rows(), forces: force.to_array() });
    }

    /// Takes the static displacement under a force on the patch off modal displacements: `x -= diag(1/k) G^T f`.
    pub fn take_static(&self, model: &ModalModel, force: DVec3, x: &mut [Lanes]) {
        let mut load = vec![Lanes::default(); x.len()];
        self.add_force(model, -force, &mut load);
        model.add_static(&load, x);
    }

    /// Displacement of this patch at the step's end per unit force on `other` there, `G diag(q_load) G_other^T`, m/N.
    pub fn step_compliance(&self, model: &ModalModel, other: &Projection) -> DMat3 {
        self.weighted(model, &model.q_load, other)
    }

    /// Static part that the modes kept carry, `G diag(1/k) G_other^T` over the elastic modes, m/N.
    pub fn static_compliance(&self, model: &ModalModel, other: &Projection) -> DMat3 {
        self.weighted(model, &model.flexibility, other)
    }

    fn weighted(&self, model: &ModalModel, weights: &[Lanes], other: &Projection) -> DMat3 {
        let left = self.rows();
        DMat3::from_cols_array_2d(&other.rows().map(|right| model.arch.dispatch(Compliance { weights, left, right })))
    }

    pub(super) fn rows(&self) -> [&[Lanes]; 3] {
        self.axes.each_ref().map(Vec::as_slice)
    }
}
