//! Phases of a precomputation, reported to a callback, which measures the time of each.

/// Phase of a precomputation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Stiffness from the elements.
    Assembly,
    /// Fill-reducing order, structure of the factor, and its needed part.
    Ordering,
    /// The factor, and the operators of the sweeps from it.
    Factor,
    /// Accuracy of the answers.
    Accuracy,
    /// Columns, block by block.
    Columns,
    /// The store from the blocks.
    Store,
}

impl Phase {
    /// Name for users.
    pub fn name(self) -> &'static str {
        match self {
            Phase::Assembly => "assembling",
            Phase::Ordering => "ordering",
            Phase::Factor => "factorising",
            Phase::Accuracy => "measuring accuracy",
            Phase::Columns => "columns",
            Phase::Store => "writing",
        }
    }
}

/// Called as each phase begins.
pub type PhaseCallback<'a> = &'a (dyn Fn(Phase) + Sync);
