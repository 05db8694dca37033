//! Changed boundary conditions, by column of the operator, in the order in which they are solved.

use std::collections::{BTreeMap, BTreeSet};

use crate::green::GreensFunction;

/// Columns with the values of conditions that keep their type, and of those that change it.
pub type SplitConditions = (Vec<(usize, f64)>, Vec<(usize, f64)>);

/// What is asked of the columns of the operator.
#[derive(Clone, Debug, Default)]
pub struct Change {
    /// Forces, N, besides the body's own loads.
    pub forces: BTreeMap<usize, f64>,
    /// Displacements, m.
    pub displacements: BTreeMap<usize, f64>,
    /// Supports that are taken away; a column that is none stays as it is.
    pub released: BTreeSet<usize>,
}

impl Change {
    /// The conditions as [`super::solve`] takes them, in ascending order.
    ///
    /// # Errors
    /// A column with both a force and a displacement that the force would have to move.
    pub fn sorted(&self, green: &GreensFunction) -> Result<SplitConditions, usize> {
        let is_fixed = |column: usize| green.row_is_fixed[green.row_of_column(column)];
        let released = |column: usize| self.released.contains(&column) && is_fixed(column);
        let columns = self.forces.keys().chain(self.displacements.keys()).chain(&self.released);
        let (mut known, mut switched) = (Vec::new(), Vec::new());
        for &column in columns.collect::<BTreeSet<_>>() {
            let force = self.forces.get(&column).copied().unwrap_or(0.0);
            if let Some(&displacement) = self.displacements.get(&column) {
                if force != 0.0 && (released(column) || !is_fixed(column)) {
                    return Err(column);
                }
                if is_fixed(column) { &mut known } else { &mut switched }.push((column, displacement));
            } else if released(column) {
                switched.push((column, force));
            } else if !is_fixed(column) && self.forces.contains_key(&column) {
                // A force on a support goes straight into it and moves nothing.
                known.push((column, force));
            }
        }
        Ok((known, switched))
    }
}
